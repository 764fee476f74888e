"""A sweep that is repeated tells nothing of a model, however badly the model describes what the analyser sees worst."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from paper_circuit import DAMPED

import motoremi as me
from motoremi.data.conditions import parse_condition
from motoremi.data.measurement import Measurement
from motoremi.investigation.conditioned import by_condition
from motoremi.investigation.known import Known
from motoremi.investigation.outcome import Outcome
from motoremi.investigation.weighing import weigh

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
ESR = "suppressor-capacitor@pair.esr_ohm"


def short(number: int, series_ohm: float = 0.0, series_h: float = 0.0, condition: str | None = None) -> me.ImpedanceSweep:
    """A capacitor of 3.7 nF across the winding of the paper's motor: in resonance with its leads it leaves 50 milliohms."""
    s, v = 2j * np.pi * FREQUENCY_HZ, DAMPED
    winding = 1 / (1 / (v["Ra"] + s * v["La"]) + s * v["Ca"] + 1 / (0.05 + s * 40e-9 + 1 / (s * 3.7e-9)))
    noise = 1e-4 * (np.random.default_rng(number).standard_normal((2, FREQUENCY_HZ.size)).T @ [1, 1j])
    read = (winding + series_ohm + s * series_h) * (1 + noise)
    told = {"analyser": "4294a"}
    return me.ImpedanceSweep("short", FREQUENCY_HZ, read, metadata=told, condition=parse_condition(condition) if condition else None)


@pytest.mark.slow
def test_a_repeat_says_the_same_of_a_model_that_misses_a_resonance_by_half() -> None:
    reference, again = short(1), short(2, 5e-3, 0.5e-9, "sweep-downwards")
    measurement = Measurement.of([reference, again])
    close = me.fit(me.dc_motor(), [reference]).add("suppressor-capacitor@pair")
    assert abs(close.parameters[ESR] - 0.05) < 0.02
    far = dataclasses.replace(close, parameters={**close.parameters, ESR: 2 * close.parameters[ESR]})
    ((_, sweeps),) = by_condition(measurement)
    known = Known.of(close)
    told = [weigh(Outcome(fit, sweeps), dataclasses.replace(known, centre=fit.unknowns)).log_likelihood for fit in (close, far)]
    assert abs(told[0] - told[1]) < 0.1
