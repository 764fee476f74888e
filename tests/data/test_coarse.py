"""Sweeps of many thousand points: what is averaged says the same, and errors are shown of all points."""

from __future__ import annotations

import numpy as np
import pytest
from paper_circuit import impedance

import motoremi as me
from motoremi.data.coarse import MOST_POINTS, bins_of, coarse, points_in_bins, scatter_in_bins
from motoremi.data.measurement import Measurement
from motoremi.data.noise import Noise
from motoremi.diagnosis.outliers import outlying
from motoremi.fitting.polish import sharpened
from motoremi.fitting.problem import Problem
from motoremi.inspection.causal import check_causality

MOTOR = {"Ra": 10.0, "La": 25e-6, "Ca": 60e-12, "Rr": 30.0, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
MANY_HZ = np.geomspace(150e3, 30e6, 6001)
NOISE = 5e-4
STEPS_HZ = (1e6, 15e6)


def sweeps(rng, frequency=MANY_HZ, repeats=2):
    found = []
    for termination in ("short", "open"):
        true = impedance(MOTOR, termination, frequency)
        for _ in range(repeats):
            noise = NOISE * (rng.normal(size=true.size) + 1j * rng.normal(size=true.size))
            found.append(me.ImpedanceSweep(termination, frequency, true * (1 + noise)))
    return found


@pytest.fixture(scope="module")
def measurement():
    return Measurement.of(sweeps(np.random.default_rng(8)), "4294a")


@pytest.fixture(scope="module")
def fitted(measurement):
    return me.fit(None, measurement)


def test_few_points_stay_as_they_are():
    few = Measurement.of(sweeps(np.random.default_rng(8), np.geomspace(150e3, 30e6, MOST_POINTS)), "4294a")
    assert few.coarse is few
    sweep = few.sweeps[0]
    chosen = np.arange(sweep.frequency_hz.size) % 2 == 0
    assert points_in_bins(sweep, STEPS_HZ, chosen) is chosen
    assert scatter_in_bins(sweep, few.noise[0], STEPS_HZ, sweep.mean_ohm) == 0.0


@pytest.mark.slow
def test_averages_keep_curve_weight_and_ranges(measurement):
    for whole, noise, few, its in zip(measurement.sweeps, measurement.noise, measurement.coarse.sweeps, measurement.coarse.noise, strict=True):
        true = impedance(MOTOR, whole.termination, few.frequency_hz)
        off = (np.log(few.mean_ohm / true)) / its.sigma
        # Noise and nothing else, also where the curve bends: of 1500 numbers its size is known to 2 %, and it was estimated from two repeats.
        assert np.sqrt(np.mean(np.abs(off) ** 2) / 2) == pytest.approx(1.0, abs=0.1)
        assert np.sum(1 / its.sigma**2) == pytest.approx(np.sum(1 / noise.sigma**2), rel=1e-9)
        assert few.counts.sum() == whole.frequency_hz.size
        bins = bins_of(whole, STEPS_HZ)
        assert np.all(np.diff(bins) >= 0)
        for step in STEPS_HZ:
            assert not set(bins[whole.frequency_hz <= step]) & set(bins[whole.frequency_hz > step])


@pytest.mark.slow
def test_points_that_stand_out_hardly_move_their_average(measurement):
    sweep, noise = measurement.sweeps[0], measurement.noise[0]
    outliers = np.zeros(sweep.frequency_hz.size, dtype=np.bool_)
    outliers[3000] = True
    spoilt = sweep.impedance_ohm.copy()
    spoilt[:, 3000] *= 1.5
    known = Noise(np.where(outliers, 1.0, noise.sigma), "repeats", outliers=outliers)
    few, its = coarse(type(sweep)(sweep.termination, sweep.frequency_hz, spoilt, None), known, STEPS_HZ)
    off = np.abs(np.log(few.mean_ohm / impedance(MOTOR, "short", few.frequency_hz))) / its.sigma
    assert off.max() < 5
    assert its.outliers is None


@pytest.mark.slow
def test_solution_and_error_bars_are_those_of_all_points(fitted, measurement):
    everything = Problem(fitted.motor, measurement, sizes=fitted.sizes)
    assert everything.size == 2 * MANY_HZ.size > 5 * fitted.weighed.size
    u, _ = sharpened(everything, fitted.unknowns)
    covariance = np.linalg.inv(everything.linearised(u).matrix)
    own = fitted.weighed.own
    # A fifth of an error bar; a tenth of its size.
    np.testing.assert_array_less((np.abs(fitted.unknowns - u) / np.sqrt(np.diag(covariance)))[own], 0.2)
    np.testing.assert_allclose(np.diag(fitted.covariance)[own], np.diag(covariance)[own], rtol=0.2)


def test_errors_are_shown_of_all_points(fitted):
    errors = fitted.errors()
    assert all(error.size == MANY_HZ.size for error in errors.values())
    shown = 100 * np.sqrt(np.mean(np.abs(np.concatenate(list(errors.values()))) ** 2))
    assert fitted.rms_error_percent == pytest.approx(shown, rel=1e-9)
    # White noise of two repeats: sigma of the real and the imaginary part each.
    assert fitted.corrected_error_percent == pytest.approx(100 * NOISE, rel=0.03)
    assert fitted.chi2_reduced == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_single_points_are_found_among_many(measurement):
    """One near the end of a sweep, where it is not held against its neighbours before."""
    spoilt = sweeps(np.random.default_rng(8))
    spoilt = [me.ImpedanceSweep(s.termination, s.frequency_hz, s.impedance_ohm * np.where(np.arange(6001) == 5998, 1.2, 1.0)) for s in spoilt]
    found = outlying(me.fit(None, spoilt, analyser="4294a"))
    assert set(found) == {"short", "open"}
    assert all(points.size == MANY_HZ.size and points[5998] and points.sum() < 30 for points in found.values())


def test_causal_check_takes_more_points_than_it_uses(measurement):
    check = check_causality(measurement)
    assert check.causal
