"""A machine of which several parts show at once: no one or two effects describe it, its ordinary parts together do."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from few_effects import FEW, seeking
from scipy.special import ive
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.session import load
from motoremi.simulate.analyser_errors import SimulatedAnalyser

FREQUENCY_HZ = np.geomspace(10e3, 30e6, 151)
COPPER_S_PER_M, VACUUM_H_PER_M = 5.8e7, 4e-7 * np.pi
# What the search and the description of the whole machine may use: every part of this machine, and what looks like one of them. A line is not
# among them, since it takes half of the time.
PARTS = FEW | {"suppressor-capacitor@frame", "proximity-effect"}
# Of the hidden parts.
WIRE_RADIUS_M, LEAD_H, STRAP_H, CAPACITOR_F, LEAK_OHM = 0.18e-3, 350e-9, 120e-9, 2e-9, 150e3


def machine(termination: str) -> np.ndarray:
    """Round wire by Bessel functions, a leaking frame behind a strap, a capacitor from the terminal to the frame, and a lead of 35 cm."""
    s = 2j * np.pi * FREQUENCY_HZ
    depth = WIRE_RADIUS_M * np.sqrt(s * VACUUM_H_PER_M * COPPER_S_PER_M)
    copper = 4.8 * depth * ive(0, depth) / (2 * ive(1, depth))
    winding = 1 / (1 / (copper + s * 30e-6) + s * 40e-12)
    frame = 1 / (1 / (29.0 + s * 3e-6 + 1 / (s * 150e-12)) + s * 80e-12 + 1 / LEAK_OHM) + 0.05 + s * STRAP_H
    capacitor = 0.1 + s * 20e-9 + 1 / (s * CAPACITOR_F)
    # Shorted, the terminals are the frame: the capacitor is across the winding.
    seen = 1 / (1 / (winding + (frame if termination == "open" else 0.0)) + 1 / capacitor)
    return seen + 0.01 + s * LEAD_H


@pytest.fixture(scope="module")
def sweeps() -> list[me.ImpedanceSweep]:
    analyser = SimulatedAnalyser(4)
    return [
        me.ImpedanceSweep(name, FREQUENCY_HZ, analyser.measure(name, FREQUENCY_HZ, machine(name), connection=at), metadata={"analyser": "4294a"})
        for at, name in enumerate(("short", "open"))
    ]


@pytest.fixture(scope="module")
def found(sweeps: list[me.ImpedanceSweep]) -> me.Diagnosis:
    with seeking(PARTS):
        return me.diagnose(me.fit(me.dc_motor(), sweeps))


@pytest.mark.case
@pytest.mark.slow
def test_its_parts_are_shown_with_their_values_and_not_named(found: me.Diagnosis) -> None:
    assert (found.verdict, found.effects) == ("unexplained", ())
    assert found.base.rms_error_percent > 50
    assert found.best.rms_error_percent < 1
    values = found.best.parameters
    assert values["suppressor-capacitor@frame.capacitance_f"] == pytest.approx(CAPACITOR_F, rel=0.05)
    assert values["insulation-leakage@Cf.resistance_ohm"] == pytest.approx(LEAK_OHM, rel=0.1)
    assert values["lead-inductance.inductance_h"] == pytest.approx(LEAD_H, rel=0.3)
    assert any("several parts of the machine show at once" in reason for reason in found.reasons)


HIDDEN = ("lead-inductance", "insulation-leakage@Cf", "suppressor-capacitor@frame", "skin-effect", "ground-strap-inductance")


@pytest.mark.slow
@pytest.mark.parametrize(("effects", "largest_percent"), [(HIDDEN[:3], 10), pytest.param(HIDDEN, 1, marks=pytest.mark.case)])
def test_several_effects_are_added_at_once_as_steps_of_one_each(
    tmp_path: Path, sweeps: list[me.ImpedanceSweep], effects: tuple[str, ...], largest_percent: float
) -> None:
    files = []
    for sweep in sweeps:
        files.append(tmp_path / f"{sweep.termination}.csv")
        write_impedance_csv(files[-1], sweep)
    folder = tmp_path / "machine"
    for command in (("import", folder, "--short", files[0], "--open", files[1], "--analyser", "4294a"), ("add", folder, *effects)):
        done = CliRunner().invoke(app, list(map(str, command)))
        assert done.exit_code == 0, done.output
    ladder = [step["fit"] for step in load(folder).ladder]
    assert [len(one["effects"]) for one in ladder] == list(range(len(effects) + 1))
    assert all(set(one["effects"]) < set(other["effects"]) for one, other in itertools.pairwise(ladder))
    assert set(ladder[-1]["effects"]) == set(effects)
    assert ladder[-1]["rms_error_percent"] < largest_percent < 50 < ladder[0]["rms_error_percent"]
