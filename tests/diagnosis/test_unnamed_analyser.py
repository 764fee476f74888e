"""Stations in the sweeps, and faults of the bench beside an effect where nobody named the analyser."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from few_effects import FEW, seeking
from paper_circuit import DAMPED, impedance
from scipy.special import ive

import motoremi as me
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
pytestmark = pytest.mark.slow


def sweeps(change: Callable[[np.ndarray, np.random.Generator], np.ndarray], seed: int) -> list[ImpedanceSweep]:
    """Three repeats of both sweeps of the paper's circuit, changed by a function, by a 4294A whose gain is off by several per cent."""
    rng = np.random.default_rng(seed)
    gain = 1 + 0.03 * np.sin(np.log(FREQUENCY_HZ / 1e6))
    found = []
    for name in TERMINATIONS:
        true = impedance(DAMPED, name, FREQUENCY_HZ) * gain
        for _ in range(3):
            noise = 1e-4 * (rng.normal(size=201) + 1j * rng.normal(size=201))
            found.append(ImpedanceSweep(name, FREQUENCY_HZ, change(true * (1 + noise), rng), metadata={"analyser": "4294a"}))
    return found


def with_stations(impedance_ohm: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Fifteen points, the same in each sweep, disturbed by about 20 %, differently in each."""
    disturbed = impedance_ohm.copy()
    points = np.arange(10, 190, 12)
    disturbed[points] *= 1 + 0.2 * (rng.normal(size=points.size) + 1j * rng.normal(size=points.size))
    return disturbed


def test_stations_are_no_undescribed_part_of_the_circuit() -> None:
    """The circuit's own error contains them, and what is undescribed is that of the other points."""
    clean = me.fit(me.dc_motor(), sweeps(lambda z, rng: z, 1))
    disturbed = me.fit(me.dc_motor(), sweeps(with_stations, 1))
    assert clean.unexplained_percent["value"] > 0.5
    assert disturbed.rms_error_percent > 2 * clean.rms_error_percent
    assert disturbed.unexplained_percent["value"] == pytest.approx(clean.unexplained_percent["value"], rel=0.3)


def with_round_wire(termination: str) -> np.ndarray:
    """The paper's circuit wound of round wire, exactly by Bessel functions, with a clamp of 6 Ohm in the short-circuit sweep."""
    s = 2j * np.pi * FREQUENCY_HZ
    depth = 0.3e-3 * np.sqrt(s * 4e-7 * np.pi * 5.8e7)
    copper = 20 * depth * ive(0, depth) / (2 * ive(1, depth))
    winding = 1 / (1 / (copper + s * 12.1e-6) + s * 22e-12)
    if termination == "short":
        return winding + 6.0
    return winding + 1 / (1 / (39.8 + s * 1.6e-6 + 1 / (s * 424e-12)) + s * 210e-12)


@pytest.mark.case
def test_a_clamp_beside_an_effect_is_named_where_the_analyser_is_shown_to_err_little() -> None:
    """Reflections of an analyser without a name that errs by a few hundred-thousandths: it is assumed to err more than the clamp changes."""
    rng = np.random.default_rng(2)
    saved = []
    for name in TERMINATIONS:
        true = with_round_wire(name)
        for _ in range(3):
            read = (true - 50) / (true + 50) + 3e-5 * (rng.normal(size=201) + 1j * rng.normal(size=201))
            metadata = {"read_as": "S11", "compensated": ["open", "short", "load"]}
            saved.append(ImpedanceSweep(name, FREQUENCY_HZ, 50 * (1 + read) / (1 - read), metadata=metadata))
    with seeking(FEW):
        found = me.diagnose(me.fit(me.dc_motor(), saved))
    assert set(found.effects) == {"skin-effect", "contact-resistance"}
    assert found.best.parameters["contact-resistance.short_ohm"] == pytest.approx(6.0, rel=0.02)


@pytest.mark.usefixtures("catalogue")
@pytest.mark.parametrize(("siemens", "verdict"), [(100e-9, "adequate"), (200e-9, "instrument")])
def test_an_error_within_what_is_assumed_of_an_unnamed_analyser_is_no_fault(siemens: float, verdict: str) -> None:
    """A residual conductance of the fixture from 1 kHz, where a motor is 190 kOhm: with 100 nS the circuit errs by less than is assumed."""
    frequency_hz = np.geomspace(1e3, 30e6, 401)
    s = 2j * np.pi * frequency_hz
    short = 1 / (1 / (76 + s * 563e-6) + s * 166e-12)
    frame = 1 / (s * 304e-12 + 1 / (24.8 + s * 0.55e-6 + 1 / (s * 534e-12)))
    rng = np.random.default_rng(1)
    found = []
    for name, true in (("short", short), ("open", short + frame)):
        for _ in range(2):
            noise = 7e-4 * (rng.normal(size=401) + 1j * rng.normal(size=401))
            found.append(ImpedanceSweep(name, frequency_hz, (1 + noise) / (1 / true - siemens)))
    fit = me.fit(me.dc_motor(), found)
    with seeking():
        diagnosis = me.diagnose(fit)
    assert diagnosis.verdict == verdict
    assert diagnosis.effects == (() if verdict == "adequate" else ("open-residual",))
    assert (fit.rms_error_percent < fit.floor_percent) == (verdict == "adequate")
