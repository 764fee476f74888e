"""Leads that move between the repeats of a sweep."""

from __future__ import annotations

import numpy as np
import pytest
from test_measurement_model import DAMPED, GRID_HZ, complex_normal, impedance, repeats_of

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.data.moved import at_average_leads, student_factor
from motoremi.data.noise import estimate_noise
from motoremi.data.quantity import REFLECTION
from motoremi.data.sweep import group_repeats
from motoremi.diagnosis.diagnosis import diagnose
from motoremi.diagnosis.findings import of_the_noise

WHITE = 1e-4
# Of a hand that connects two leads of some centimetres anew: R, L, G and C.
SIGMA = np.array([5e-3, 3e-9, 0.0, 0.5e-12])


def connected_anew(seed: int, count: int, termination: str = "short", white: float = WHITE) -> list[me.ImpedanceSweep]:
    """Repeats for each of which the leads were connected anew."""
    rng = np.random.default_rng(seed)
    s = 2j * np.pi * GRID_HZ
    true = impedance(DAMPED, termination, GRID_HZ)
    sweeps = []
    for _ in range(count):
        resistance, inductance, _, capacitance = SIGMA * rng.normal(size=4)
        seen = 1 / (1 / (true + resistance + s * inductance) + s * capacitance)
        sweeps.append(me.ImpedanceSweep(termination, GRID_HZ, seen * np.exp(white * complex_normal(rng, GRID_HZ.size))))
    return sweeps


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 3, 5])
def test_leads_that_moved_give_back_their_size_and_the_noise_beside_them(count):
    found = [at_average_leads(group_repeats(connected_anew(seed, count))[0]) for seed in range(12)]
    moved = np.array([sweep.moved for sweep in found if sweep.moved is not None]) / student_factor(count - 1)
    # Three repeats in a row may pass for a drift once in ten times.
    assert len(moved) >= 9
    # Rms over all draws, each of count - 1 differences: its scatter is 1 / sqrt(2 n).
    scatter = 1 / np.sqrt(2 * len(moved) * (count - 1))
    for element in (1, 3):
        assert np.sqrt(np.mean(moved[:, element] ** 2)) == pytest.approx(SIGMA[element], rel=4 * scatter)
    white = [np.median(estimate_noise(sweep).sigma) * np.sqrt(count) / WHITE for sweep in found if sweep.moved is not None]
    assert np.mean(white) == pytest.approx(1, abs=0.1)


@pytest.mark.slow
def test_the_average_position_lies_within_its_interval_as_often_as_stated():
    inside = []
    s = 2j * np.pi * GRID_HZ
    true = impedance(DAMPED, "short", GRID_HZ)
    for seed in range(30):
        sweep = at_average_leads(group_repeats(connected_anew(100 + seed, 3))[0])
        if sweep.moved is None:
            continue
        # The capacitance alone that is left at the highest impedance, where it is felt most.
        peak = int(np.argmax(np.abs(true)))
        left = float(((1 / sweep.mean_ohm[peak] - 1 / true[peak]) / s[peak]).real)
        inside.append(abs(left) < 1.96 * sweep.moved_of_mean[3])
    # 95 % of some 28 within 3 standard deviations of a binomial.
    assert np.mean(inside) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / len(inside))


@pytest.mark.slow
@pytest.mark.parametrize("wander", [0.0, 3e-4])
def test_other_noise_moves_no_leads(wander):
    found = [at_average_leads(group_repeats(repeats_of(seed, 3, 3e-4, wander))[0]).moved for seed in range(16)]
    assert sum(moved is not None for moved in found) <= 1


def test_a_network_analyser_sees_them_too():
    sweep = at_average_leads(group_repeats(connected_anew(3, 4, white=5e-4))[0], REFLECTION)
    assert sweep.moved is not None
    assert np.all(sweep.moved[[1, 3]] > 0.2 * SIGMA[[1, 3]])


def test_one_sweep_stays_as_it_is():
    (sweep,) = group_repeats(connected_anew(1, 1))
    assert at_average_leads(sweep) is sweep


# Eight motors were tried, and all are answered like these two.
@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
@pytest.mark.parametrize(("seed", "count"), [(25, 3), pytest.param(45, 5, marks=pytest.mark.case)])
def test_a_sound_motor_whose_leads_moved_is_adequate_and_told_so(seed, count):
    measurement = Measurement.of([*connected_anew(seed, count), *connected_anew(seed + 1, count, "open")], "4294a")
    result = diagnose(me.fit(me.dc_motor(), measurement))
    assert result.verdict == "adequate"
    assert any("leads moved" in finding.why for finding in result.findings)


def test_a_bad_contact_in_one_repeat_is_serious_and_no_moved_lead():
    rng = np.random.default_rng(4)
    true = impedance(DAMPED, "short", GRID_HZ)
    sweeps = [me.ImpedanceSweep("short", GRID_HZ, (true + ohm) * np.exp(WHITE * complex_normal(rng, GRID_HZ.size))) for ohm in (0, 0, 0, 8)]
    found = of_the_noise(me.fit(me.dc_motor(), Measurement.of(sweeps, "4294a")))
    contact = [finding for finding in found if finding.why.startswith("a contact changed")]
    assert contact
    assert all(finding.serious for finding in contact)
