"""The simulated motor and everything it can hide."""

from __future__ import annotations

import ast
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from ngspice import needs_ngspice, solve

import motoremi.simulate
from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.errors import BadInput
from motoremi.simulate import hidden_connection, hidden_machine, ladders
from motoremi.simulate.hidden_effects import (
    ANALYSER_FAULTS,
    DEMO_EFFECTS,
    HIDDEN_EFFECTS,
    MOTOR_EFFECTS,
    OUTSIDE_EFFECTS,
    split_effects,
)
from motoremi.simulate.simulated_motor import SimulatedMotor

BAND = np.geomspace(150e3, 30e6, 401)


def paper(motor: SimulatedMotor, frequency: FloatArray) -> dict[Termination, ComplexArray]:
    """Eq. (1) and (2) of Liu, Wang and Nan (2011), as in the digest of the paper."""
    m, s = motor, 2j * np.pi * frequency
    short = (m.Ra + s * m.La) / (1 + s * m.Ra * m.Ca + s**2 * m.La * m.Ca)
    numerator = 1 + s * m.Rr * m.Cr + s**2 * m.Lr * m.Cr
    denominator = s * (m.Cf + m.Cr) + s**2 * m.Rr * m.Cr * m.Cf + s**3 * m.Lr * m.Cr * m.Cf
    return {"short": short, "open": short + numerator / denominator}


@pytest.mark.parametrize("motor", [SimulatedMotor(), *(SimulatedMotor.random(seed) for seed in range(10))])
@pytest.mark.parametrize("termination", TERMINATIONS)
def test_bare_motor_is_the_circuit_of_the_paper(motor: SimulatedMotor, termination: Termination) -> None:
    expected = paper(motor, BAND)[termination]
    assert np.max(np.abs(motor.impedance(termination, BAND) / expected - 1)) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("termination", TERMINATIONS)
@pytest.mark.parametrize("effect", MOTOR_EFFECTS)
def test_every_motor_is_passive(effect: str, termination: Termination) -> None:
    for seed in range(20):
        motor = SimulatedMotor.random(seed, [effect])
        impedance = motor.impedance(termination, BAND)
        assert np.all(np.isfinite(impedance))
        assert np.all(impedance.real >= 0), f"seed {seed}"


@pytest.mark.slow
@needs_ngspice
@pytest.mark.parametrize("effect", MOTOR_EFFECTS)
def test_ngspice_agrees(effect: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # Hundreds of cells of iron with resistors of nano-ohms reduce the precision of ngspice: fewer cells, and none of those far below the band.
    monkeypatch.setattr(hidden_machine, "MACHINE_CELLS", 5)
    monkeypatch.setattr(hidden_connection, "CABLE_CELLS", 5)
    monkeypatch.setattr(ladders, "LOWEST_HZ", 10e3)
    frequency = [150e3, 1.3e6, 9.1e6, 30e6]
    for seed, termination in zip((3, 4), TERMINATIONS, strict=True):
        motor = SimulatedMotor.random(seed, [effect])
        spice = solve(motor.netlist(termination).splitlines(), "X", "G", frequency)
        # The long ladders reduce the precision of ngspice: 2e-8 at worst.
        assert np.max(np.abs(motor.impedance(termination, frequency) / spice - 1)) < 1e-6


@pytest.mark.parametrize("effect", MOTOR_EFFECTS)
def test_every_effect_is_there_and_follows_from_the_seed(effect: str) -> None:
    motor, again, other = (SimulatedMotor.random(seed, [effect]) for seed in (7, 7, 8))
    assert motor == again
    assert motor.truth() == again.truth() != other.truth()
    assert list(motor.truth()["effects"]) == [effect]
    json.dumps(motor.truth())
    bare = dataclasses.replace(motor, effects=())
    change = max(float(np.max(np.abs(motor.impedance(t, BAND) / bare.impedance(t, BAND) - 1))) for t in TERMINATIONS)
    # A brush contact hardly changes the impedance.
    assert change > (1e-4 if effect == "brush-contact" else 1e-2)


@pytest.mark.parametrize(
    ("effect", "sweeps"),
    [
        ("core-loss", {"short", "open"}),
        ("lead-inductance", {"short", "open"}),
        ("terminal-capacitance", {"short", "open"}),
        ("ground-strap-inductance", {"open"}),
        ("far-end-tie", {"short"}),
        ("bearing-film", {"open"}),
        ("insulation-leakage@Cf", {"open"}),
        ("dielectric-loss@Cr", {"open"}),
        ("dielectric-relaxation@Ca", {"short", "open"}),
        ("temperature-drift", {"open"}),
        ("frame-eddy", {"open"}),
        ("common-mode-flux", {"open"}),
        ("winding-modes", {"short", "open"}),
        ("suppressor-capacitor", {"short", "open"}),
        ("suppressor-capacitor@frame", {"short", "open"}),
        ("suppressor-capacitor@pair", {"short", "open"}),
        ("suppressor-choke", {"short", "open"}),
    ],
)
def test_an_effect_shows_where_it_sits(effect: str, sweeps: set[str]) -> None:
    motor = SimulatedMotor.random(5, [effect])
    bare = paper(motor, BAND)
    seen = {t for t in TERMINATIONS if np.max(np.abs(motor.impedance(t, BAND) / bare[t] - 1)) > 1e-6}
    assert seen == sweeps


def test_effects_combine_and_do_not_disturb_each_other() -> None:
    names = ("lead-inductance", "eddy-laminations", "distributed-winding", "dielectric-loss@Cf", "second-resonance")
    motor = SimulatedMotor.random(2, names)
    truth = motor.truth()["effects"]
    assert set(truth) == set(names)
    for name in names:
        assert truth[name] == SimulatedMotor.random(2, [name]).truth()["effects"][name]
    assert motor.elements == SimulatedMotor.random(2).elements
    assert SimulatedMotor.random(2, names[::-1]) == motor
    for termination in TERMINATIONS:
        assert np.all(motor.impedance(termination, BAND).real > 0)


@needs_ngspice
def test_ngspice_agrees_on_a_combination() -> None:
    names = ("skin-effect", "field-coupling", "eddy-laminations", "core-loss", "insulation-leakage@Ca", "bearing-film")
    motor = SimulatedMotor.random(11, [*names, "ground-strap-inductance", "lead-inductance", "temperature-drift"])
    frequency = [200e3, 4e6, 30e6]
    spice = solve(motor.netlist("open").splitlines(), "X", "G", frequency)
    assert np.max(np.abs(motor.impedance("open", frequency) / spice - 1)) < 1e-7


def test_names() -> None:
    assert set(DEMO_EFFECTS) <= set(HIDDEN_EFFECTS)
    assert set(OUTSIDE_EFFECTS) <= set(MOTOR_EFFECTS)
    assert len(set(HIDDEN_EFFECTS)) == len(HIDDEN_EFFECTS)
    assert split_effects(["open-residual", "core-loss"]) == (("core-loss",), ("open-residual",))


def test_unknown_names() -> None:
    with pytest.raises(BadInput, match=r"unknown effect 'rust'.*eddy-laminations.*range-step"):
        SimulatedMotor.random(1, ["rust"])
    with pytest.raises(BadInput, match="unknown effect"):
        split_effects(["rust"])
    with pytest.raises(BadInput, match="analyser"):
        SimulatedMotor.random(1, [ANALYSER_FAULTS[0]])
    with pytest.raises(BadInput, match="twice"):
        SimulatedMotor.random(1, ["core-loss", "core-loss"])
    with pytest.raises(BadInput, match="seed"):
        SimulatedMotor.random(-1)
    with pytest.raises(BadInput, match="termination"):
        SimulatedMotor().impedance("half", BAND)  # type: ignore[arg-type]


def test_the_truth_never_borrows_from_the_fit() -> None:
    """A blind test whose truth uses the formulas of the answer proves nothing."""
    forbidden = ("motoremi.model", "motoremi.fitting", "motoremi.diagnosis")
    folder = Path(motoremi.simulate.__file__).parent
    for file in folder.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.Attribute):
                assert node.attr not in ("tanh", "coth", "ive", "iv"), f"{file.name} uses {node.attr}"
                continue
            else:
                continue
            assert not any(name == taboo or name.startswith(f"{taboo}.") for name in names for taboo in forbidden)
