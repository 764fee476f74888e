"""A capacitor from the terminal to the frame that the short-circuit sweep does not show: a guard holds the frame there, and takes its current."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import FEW, seeking
from paper_circuit import impedance

import motoremi as me
from motoremi.model.effects import add_effects

ELEMENTS = {"Ra": 600.0, "La": 60e-6, "Ca": 10e-12, "Rr": 31.0, "Lr": 1.7e-6, "Cr": 164e-12, "Cf": 105e-12}
CAPACITANCE_F, ESR_OHM, ESL_H = 2.2e-9, 0.4, 32e-9
LABEL = "suppressor-capacitor@guarded"


def sweeps() -> list[me.ImpedanceSweep]:
    """Twice each, with noise of 0.05 %."""
    rng = np.random.default_rng(17)
    frequency_hz = np.geomspace(150e3, 30e6, 201)
    s = 2j * np.pi * frequency_hz
    capacitor = ESR_OHM + s * ESL_H + 1 / (s * CAPACITANCE_F)
    found = []
    for termination in ("short", "open") * 2:
        ohm = impedance(ELEMENTS, termination, frequency_hz)
        if termination == "open":
            ohm = 1 / (1 / ohm + 1 / capacitor)
        noise = 1 + 5e-4 * (rng.standard_normal(frequency_hz.size) + 1j * rng.standard_normal(frequency_hz.size))
        found.append(me.ImpedanceSweep(termination, frequency_hz, ohm * noise))
    return found


@pytest.mark.slow
def test_it_is_named_and_not_taken_for_sweeps_of_two_motors() -> None:
    with seeking({*FEW, LABEL, "suppressor-capacitor@frame", "suppressor-capacitor"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps(), analyser="4294a"))
    assert (found.verdict, found.effects) == ("missing-effect", (LABEL,))
    assert found.base.rms_error_percent > 10 * found.best.rms_error_percent
    values = found.best.parameters
    assert values[f"{LABEL}.capacitance_f"] == pytest.approx(CAPACITANCE_F, rel=0.02)
    assert abs(values[f"{LABEL}.esl_h"] - ESL_H) < 2 * found.best.sigma[f"{LABEL}.esl_h"]
    # Beside so large a capacitor the path to the frame shows little, and the winding is that of the other sweep.
    assert values["La"] == pytest.approx(ELEMENTS["La"], rel=0.02)


def test_only_the_open_circuit_sweep_depends_on_it() -> None:
    motor = add_effects(me.dc_motor(), [LABEL])
    assert f"{LABEL}.capacitance_f" in motor.used_parameters("open")
    assert f"{LABEL}.capacitance_f" not in motor.used_parameters("short")
