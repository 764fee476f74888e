"""A moving average that the instrument made is seen in the scatter of the points; noise that is white, or correlated otherwise, is none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import savgol_filter

from motoremi.arrays import ComplexArray
from motoremi.blind.departures import draw_hard_many
from motoremi.blind.disturbances import flicker_noise
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.data.trace_smoothing import GAIN, Smoothing, average_gains, smoothing_of
from motoremi.diagnosis.findings import Finding, of_the_noise

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
S = 2j * np.pi * FREQUENCY_HZ
WINDING = 1 / (1 / (9.0 + S * 24e-6) + S * 95e-12)
FRAME = 1 / (1 / (40.0 + S * 0.7e-6 + 1 / (S * 310e-12)) + S * 150e-12)
TRUE_OHM = {"short": WINDING, "open": WINDING + FRAME}


def averaged(ohm: ComplexArray, points: int) -> ComplexArray:
    """As an analyser smooths its trace: the mean over neighbours, at the ends with the last value repeated."""
    return np.convolve(np.pad(ohm, points // 2, mode="edge"), np.full(points, 1 / points), "valid")


def measured(repeats: int, points: int = 1, noise: float = 3e-3, seed: int = 1, beside: float = 0.0) -> Measurement:
    """Sweeps with white noise that the instrument averages over so many points, and with 1/f noise of this size in addition."""
    rng = np.random.default_rng(seed)
    sweeps = []
    for termination, true in TRUE_OHM.items():
        slow = [beside * flicker_noise(rng, repeats * 201) for _ in range(2)]
        for number in range(repeats):
            white = noise * (rng.normal(size=201) + 1j * rng.normal(size=201))
            here = slice(number * 201, (number + 1) * 201)
            sweeps.append(ImpedanceSweep(termination, FREQUENCY_HZ, averaged(true * (1 + white + slow[0][here] + 1j * slow[1][here]), points)))
    return Measurement.of(sweeps, "4294a")


def seen(measurement: Measurement) -> Smoothing | None:
    return smoothing_of(measurement.sweeps, measurement.noise)


def findings(measurement: Measurement) -> list[Finding]:
    return of_the_noise(SimpleNamespace(measurement=measurement))  # type: ignore[arg-type]


@pytest.mark.parametrize("points", [3, 5, 7])
@pytest.mark.parametrize("repeats", [2, 3])
def test_the_average_is_seen_in_the_differences_of_repeats(points: int, repeats: int) -> None:
    found = seen(measured(repeats, points))
    assert found is not None
    assert found.points == points
    assert [sweep.termination for sweep in found.sweeps] == ["short", "open"]


@pytest.mark.parametrize("seed", range(4))
def test_it_is_seen_in_single_sweeps(seed: int) -> None:
    found = seen(measured(1, 5, seed=seed))
    assert found is not None
    assert found.points == 5


@pytest.mark.parametrize("repeats", [1, 3])
def test_so_is_a_running_parabola(repeats: int) -> None:
    """As programs smooth (Savitzky and Golay); over 7 points it lowers white noise as a mean over 3 does."""
    rng, sweeps = np.random.default_rng(2), []
    for termination, true in TRUE_OHM.items():
        for _ in range(repeats):
            ohm = true * (1 + 3e-3 * (rng.normal(size=201) + 1j * rng.normal(size=201)))
            sweeps.append(ImpedanceSweep(termination, FREQUENCY_HZ, savgol_filter(ohm.real, 7, 2) + 1j * savgol_filter(ohm.imag, 7, 2)))
    found = seen(Measurement.of(sweeps, "4294a"))
    assert found is not None
    assert (found.weights.size, found.points) == (7, 3)


@pytest.mark.parametrize("repeats", [1, 3])
def test_it_is_told_with_its_remedy(repeats: int) -> None:
    told = [finding for finding in findings(measured(repeats, 5)) if finding.id == "correlated-noise"]
    (finding,) = told
    assert finding.serious
    assert finding.sweep is None
    assert "over about 5 points" in finding.why
    assert "flattens sharp resonances" in finding.why
    assert finding.remedy.startswith("switch smoothing off")


def test_it_is_not_serious_where_nothing_is_sharp() -> None:
    """An inductor of 24 uH: the average over 5 of 201 points changes it by less than the noise."""
    rng = np.random.default_rng(1)
    ohm = [averaged((9.0 + S * 24e-6) * (1 + 0.02 * (rng.normal(size=201) + 1j * rng.normal(size=201))), 5) for _ in range(3)]
    (finding,) = [one for one in findings(Measurement.of([ImpedanceSweep("short", FREQUENCY_HZ, z) for z in ohm], "4294a")) if one.sweep]
    assert "over about 5 points" in finding.why
    assert (finding.serious, finding.sweep) == (False, "short")


@pytest.mark.parametrize("noise", [1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("repeats", [1, 2, 3])
def test_white_noise_is_no_average(repeats: int, noise: float) -> None:
    """Not even nearly, also where it is so small that the scatter is the curve's."""
    for seed in range(5):
        measurement = measured(repeats, noise=noise, seed=seed)
        for sweep, own in zip(measurement.sweeps, measurement.noise, strict=True):
            assert max(average_gains(sweep, own)) < 0.4 * GAIN


@pytest.mark.slow
@pytest.mark.parametrize("repeats", [1, 3])
@pytest.mark.parametrize("times", [3.0, 30.0])
def test_flicker_noise_is_none(repeats: int, times: float) -> None:
    for seed in range(5):
        assert seen(measured(repeats, noise=2e-4, seed=seed, beside=times * 2e-4)) is None


@pytest.mark.slow
@pytest.mark.parametrize("departure", ["flicker", "warming", "one-repeat", "few-points", "linear-grid", "stations", "vna-reflection"])
def test_motors_of_the_board_have_none(departure: str) -> None:
    for case in draw_hard_many(7, 3, departure):
        sweeps = case.sweeps()
        single = list({sweep.termination: sweep for sweep in sweeps}.values())
        assert seen(Measurement.of(sweeps)) is None
        assert seen(Measurement.of(single)) is None


def test_digits_that_stay_the_same_are_none() -> None:
    """Three digits of a sweep with little noise: runs of points with the same last digit."""
    rounded = [
        ImpedanceSweep(
            t, FREQUENCY_HZ, np.array([complex(float(f"{z.real:.3g}"), float(f"{z.imag:.3g}")) for z in true]), rounding_relative=rounding
        )
        for t, true in TRUE_OHM.items()
        for rounding in (None, 1e-3)
    ]
    assert seen(Measurement.of(rounded[::2])) is None
    assert seen(Measurement.of(rounded[1::2])) is None
