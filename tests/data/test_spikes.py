"""Points that stand out of their neighbours in every repeat: found beside any resonance, and nothing else taken for one."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.data.noise import estimate_noise
from motoremi.data.spikes import MOST, spikes
from motoremi.data.sweep import ImpedanceSweep, group_repeats
from motoremi.simulate.simulated_motor import SimulatedMotor

SIGMA = 1e-4


def measured(frequency_hz, seed, hidden=(), termination="short"):
    """Impedance of a simulated motor with white noise."""
    rng = np.random.default_rng(seed)
    noise = SIGMA * (rng.normal(size=frequency_hz.size) + 1j * rng.normal(size=frequency_hz.size))
    return SimulatedMotor.random(seed, hidden).impedance(termination, frequency_hz) * (1 + noise)


@pytest.mark.parametrize("grid", [np.geomspace, np.linspace])
@pytest.mark.parametrize("hidden", [(), ("second-resonance",), ("eddy-laminations",), ("skin-effect",)])
def test_nothing_of_a_motor_stands_out(grid, hidden):
    frequency = grid(150e3, 30e6, 401)
    for seed in range(10):
        assert not spikes(frequency, measured(frequency, seed, hidden), np.full(401, SIGMA)).any()


@pytest.mark.parametrize(("first_hz", "points"), [(10e3, 19), (10e3, 61), (10e3, 101), (150e3, 51)])
def test_nothing_of_a_motor_stands_out_where_points_are_few(first_hz, points):
    """Before points were also predicted by a function of more poles, one of three such sweeps lost the highest point of its resonance."""
    frequency = np.geomspace(first_hz, 30e6, points)
    for seed in range(30):
        assert not spikes(frequency, measured(frequency, seed, (), "open"), np.full(points, SIGMA)).any(), seed


def test_a_station_is_found_where_points_are_few():
    frequency = np.geomspace(10e3, 30e6, 61)
    impedance = measured(frequency, 3)
    impedance[20] *= 1.02
    np.testing.assert_array_equal(np.flatnonzero(spikes(frequency, impedance, np.full(61, SIGMA))), [20])


def test_stations_are_found_wherever_they_are():
    frequency = np.geomspace(150e3, 30e6, 401)
    impedance = measured(frequency, 3, ("second-resonance",))
    # The sharpest point of the curve is among them.
    sharpest = 4 + int(np.argmax(np.abs(np.diff(np.log(impedance), 2))[3:-3]))
    where = np.array([10, 57, 120, 121, sharpest, 333])
    disturbed = impedance.copy()
    disturbed[where] *= 1 + 0.02 * np.exp(1j * np.arange(where.size))
    found = spikes(frequency, disturbed, np.full(401, SIGMA))
    np.testing.assert_array_equal(np.flatnonzero(found), np.unique(where))
    # Known to the noise and to what the neighbours know.
    np.testing.assert_allclose(found[np.unique(where)], 0.02, rtol=0.3)


def test_a_point_that_stands_out_of_a_single_sweep_counts_for_little_and_is_told():
    frequency = np.geomspace(150e3, 30e6, 201)
    impedance = measured(frequency, 5)
    impedance[77] *= 1.05
    noise = estimate_noise(group_repeats([ImpedanceSweep("short", frequency, impedance)])[0])
    np.testing.assert_array_equal(np.flatnonzero(noise.outliers), [77])
    assert noise.sigma[77] == pytest.approx(0.05, rel=0.1)
    assert np.delete(noise.sigma, 77).max() < 1e-3


def test_more_than_a_few_are_no_single_points():
    frequency = np.geomspace(150e3, 30e6, 401)
    impedance = measured(frequency, 3)
    impedance[5::10] *= 1.05
    assert MOST < 0.1
    assert not spikes(frequency, impedance, np.full(401, SIGMA)).any()


def test_sweeps_too_short_to_tell_are_left_alone():
    frequency = np.geomspace(150e3, 30e6, 9)
    assert not spikes(frequency, measured(frequency, 1), np.full(9, SIGMA)).any()
