"""A short cable beyond the calibration of a network analyser: its specification allows that error, but the elements are wrong without it."""

from __future__ import annotations

import numpy as np
import pytest
from few_effects import FEW, seeking
from paper_circuit import impedance

import motoremi as me

ELEMENTS = {"Ra": 90.0, "La": 88e-6, "Ca": 31e-12, "Rr": 20.0, "Lr": 0.55e-6, "Cr": 330e-12, "Cf": 180e-12}


def sweeps() -> list[me.ImpedanceSweep]:
    """Behind 12 cm of coaxial cable of 50 Ohm and 0.6 ns, twice each, with the noise of a receiver."""
    rng = np.random.default_rng(23)
    frequency = np.linspace(150e3, 30e6, 201)
    found = []
    for termination in ("short", "open") * 2:
        motor = impedance(ELEMENTS, termination, frequency)
        reflected = (motor - 50) / (motor + 50) * np.exp(-4j * np.pi * frequency * 0.6e-9)
        reflected += 1e-4 * (rng.standard_normal(201) + 1j * rng.standard_normal(201))
        found.append(me.ImpedanceSweep(termination, frequency, 50 * (1 + reflected) / (1 - reflected), metadata={"compensated": ["open", "short"]}))
    return found


@pytest.mark.case
@pytest.mark.slow
def test_a_cable_without_which_the_elements_are_wrong_is_named() -> None:
    with seeking({*FEW, "cable-delay"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps(), analyser="nanovna"))
    assert (found.verdict, found.effects) == ("instrument", ("cable-delay",))
    assert any("specification allows this error, but without cable-delay the elements are wrong" in reason for reason in found.said)
    assert found.best.parameters["cable-delay.delay_s"] == pytest.approx(0.6e-9, rel=0.05)
    for name, value in ELEMENTS.items():
        assert abs(found.best.parameters[name] - value) < 3 * found.best.sigma[name]
    assert abs(found.base.parameters["Cf"] - ELEMENTS["Cf"]) > 3 * found.base.sigma["Cf"]
