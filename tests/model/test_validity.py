"""What no effect may do: deliver energy anywhere in the right half-plane, be another under a new name, stand twice where once is all."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli import main
from motoremi.cli.app import app
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.errors import BadInput
from motoremi.model.effects import add_effects, catalogue, find_effect, identifiers
from motoremi.model.effects.own import VARIABLE
from motoremi.model.effects.validity import active_at
from motoremi.model.motor import dc_motor
from motoremi.model.parameter import Parameter

PHYSICAL = [i for i in identifiers() if find_effect(i).effect.group != "instrument"]
OWN = """
from motoremi.effects import Effect, Leaf, Parameter, Series, laws, materials, with_law

def change(motor, place, parameters):
    {change}

MINE = Effect(
    name="mine", group="winding", title="mine", formula="-", parameters=({parameters},), limit="-", limit_values={{}}, signature="-",
    look_alikes=(), deciding="-", source="none", change=change, starts=({starts},),
    odds={odds},
)
"""
SHARE = 'Parameter("share", "", 0.1, {high}, "a core"), Parameter("corner_hz", "Hz", 1e5, 1e7, "a core")'
CORE = {
    "change": 'return motor.replaced("La", lambda whole: with_law(whole, materials.debye_factor, tuple(parameters.values())))',
    "starts": '{"share": 0.3, "corner_hz": 1e6}',
}
WIRE = {
    "change": 'return motor.replaced("Ra", lambda whole: with_law(whole, materials.wire_factor, tuple(parameters.values())))',
    "parameters": 'Parameter("wire_m", "m", 1e-4, 1e-3, "wire"), Parameter("copper", "", 1e-3, 1.0, "of Ra")',
    "starts": '{"wire_m": 4e-4, "copper": 1.0}',
}


@pytest.fixture
def own(tmp_path: Path):
    """A file with an effect of one's own; afterwards the catalogue is as it was."""

    def written(**parts: str) -> Path:
        path = tmp_path / "own.py"
        path.write_text(OWN.format(**{"odds": "1.0", **parts}))
        return path

    yield written
    os.environ.pop(VARIABLE, None)
    catalogue.cache_clear()


def within(parameter: Parameter, share: float) -> float:
    """A value of a parameter's range; sections are whole."""
    if parameter.scale == "linear":
        return parameter.low + share * (parameter.high - parameter.low)
    value = parameter.low * (parameter.high / parameter.low) ** share
    return round(value) if parameter.name == "sections" else value


@pytest.mark.parametrize("identifier", PHYSICAL)
def test_every_effect_is_positive_real_over_its_range(identifier: str) -> None:
    """Causal and passive: no energy from it anywhere in the right half-plane, ends of the ranges included."""
    effect = find_effect(identifier).effect
    motor = add_effects(dc_motor(), (identifier,))
    rng = np.random.default_rng(3)
    settings = []
    for _ in range(100):
        share = np.where(
            rng.uniform(size=len(effect.parameters)) < 0.5, rng.integers(0, 2, len(effect.parameters)), rng.uniform(size=len(effect.parameters))
        )
        settings.append({f"{identifier}.{p.name}": within(p, x) for p, x in zip(effect.parameters, share, strict=True)})
    assert active_at(motor, settings) is None


@pytest.mark.parametrize(
    ("identifier", "values", "says"),
    [
        # On the frequency axis a permeability below zero looks like any other: no resistance there is below zero.
        ("permeability-relaxation", {"share": 1.5}, "an inductance or a capacitance of it is below zero"),
        ("eddy-laminations", {"share": 2.0}, "below zero"),
        ("core-loss", {"resistance_ohm": -50.0}, "its resistance is below zero at"),
        ("dielectric-relaxation@Cf", {"strength": -1.5}, "below zero"),
    ],
)
def test_a_law_outside_its_validity_is_seen(identifier: str, values: dict[str, float], says: str) -> None:
    motor = add_effects(dc_motor(), (identifier,))
    found = active_at(motor, [{}, {f"{identifier}.{name}": value for name, value in values.items()}])
    assert found is not None
    assert says in found[1]
    assert list(found[0]) == [f"{identifier}.{name}" for name in values]


@pytest.mark.parametrize("given", [{"held": {"eddy-laminations.share": 1.5}}, {"bounds": {"eddy-laminations.share": (0.2, 1.4)}}])
def test_values_that_make_the_permeability_negative_are_refused(given: dict[str, object]) -> None:
    frequency = np.geomspace(1e5, 1e7, 30)
    sweep = me.ImpedanceSweep("short", frequency, 1 + 2j * np.pi * frequency * 1e-5)
    with pytest.raises(BadInput, match=r"eddy-laminations\.share = 1\.[45] makes the motor give energy away: keep it between 0\.01 and 0\.999"):
        me.fit(add_effects(dc_motor(), ("eddy-laminations",)), [sweep], **given)  # type: ignore[arg-type]


def test_an_effect_of_ones_own_that_is_passive_is_taken(own) -> None:
    assert [effect.name for effect in me.effects_from(own(**{**CORE, "parameters": SHARE.format(high=0.95), "change": CORE["change"]}))] == ["mine"]


@pytest.mark.parametrize(
    ("parts", "says"),
    [
        ({**CORE, "parameters": SHARE.format(high=2.0)}, r"own.py: mine is not passive with share = 2, corner_hz = 1e\+05 Hz: an inductance"),
        (WIRE, "own.py: mine is skin-effect under another name: use that one"),
        (
            {**WIRE, "change": 'return motor.replaced("Ra", lambda whole: parameters["radius"])'},
            "own.py: mine: its change or its law fails: KeyError",
        ),
        ({**CORE, "parameters": SHARE.format(high=0.95), "odds": "-1"}, "own.py: mine: its odds are -1; give a number above 0"),
    ],
)
def test_other_effects_of_ones_own_are_refused_in_one_line(own, monkeypatch, capsys, parts: dict[str, str], says: str) -> None:
    path = own(**parts)
    known = catalogue()
    with pytest.raises(BadInput, match=says):
        me.effects_from(path)
    assert catalogue() == known
    assert re.search(says, refused(monkeypatch, capsys, "effects", "mine", "--effects-from", path))


def refused(monkeypatch, capsys, *words: object) -> str:
    """The one line that a command ends with."""
    monkeypatch.setattr("sys.argv", ["motoremi", *(str(word) for word in words)])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    line, *more = [line for line in capsys.readouterr().err.splitlines() if "running the code of" not in line]
    assert not more
    return line


@pytest.mark.slow
def test_the_commands_refuse_in_one_line(tmp_path: Path, measure, monkeypatch, capsys) -> None:
    session = tmp_path / "s"
    sweep = measure(6)[0][0]
    write_impedance_csv(tmp_path / "short.csv", me.ImpedanceSweep("short", sweep.frequency_hz[::8], sweep.impedance_ohm[::8]))
    for words in (
        ("import", session, "--short", tmp_path / "short.csv", "--analyser", "none"),
        ("fit", session),
        ("add", session, "eddy-laminations"),
    ):
        assert CliRunner().invoke(app, [str(word) for word in words]).exit_code == 0
    assert "eddy-laminations is in the model already" in refused(monkeypatch, capsys, "add", session, "eddy-laminations")
    assert "makes the motor give energy away" in refused(monkeypatch, capsys, "fit", session, "--hold", "eddy-laminations.share=1.5")
