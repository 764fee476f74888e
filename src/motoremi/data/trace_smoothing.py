"""Whether an instrument smoothed its trace: noise that is a moving average over neighbouring points of one sweep.

White noise whose mean over m neighbours is shown has correlations that fall on a straight line to nothing at a distance of m points, so that its
spectrum has zeros. Noise that is correlated for other causes (flicker, drift, cables) has none, and nearly always a white part besides. The
likelihood of each is compared, in windows from which the curve is removed: a parabola from the differences of repeats, a local rational function
from a single sweep. The size of the noise in each window is free.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.kernels import matern
from motoremi.data.local_rational import COEFFICIENTS, LocalEquations
from motoremi.data.noise import Noise
from motoremi.data.repeats import contrasts
from motoremi.data.sweep import RepeatedSweep
from motoremi.interrupts import checkpoint
from motoremi.threads import one_blas_thread

# Points of a window. Differences of repeats hold no curve, so that a long window is possible; a rational function follows a resonance over less.
OF_REPEATS, OF_ONE = 25, 20
# Columns of a parabola.
PARABOLA = 3
# Points, about, that are examined: enough to see it, and a hundred thousand would take seconds.
ENOUGH = 1000
# Numbers of points of a moving average: analysers offer odd ones, or a percentage of the span. Then of a parabola through so many neighbours
# (Savitzky and Golay), which programs offer. An average without zeros in its spectrum, such as a Gaussian, looks like what a local rational
# function leaves of a sharp curve, so it is not sought.
AVERAGED, PARABOLAS = (3, 4, 5, 6, 7, 9, 11, 13, 15), (5, 7, 9, 11, 15)
# Share of white noise beside that of a moving average, from the digits of the trace and what is added behind it.
WHITE_BESIDE = (0.001, 0.01, 0.03)
# Correlation lengths in points of other noise, and its share of the variance: an Ornstein-Uhlenbeck process has a spectrum of 1/f^2 at last, a
# Matern process 1/f^4, and sums of both with white noise all between.
LENGTHS, SHARES = (1.0, 1.5, 2.0, 3.0, 5.0, 8.0, 16.0, 40.0), (0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.997, 0.999)
# In a window in which the curve is not removed, the rest is as smooth as this many points; one in so many windows may be such.
CURVE_LENGTH, OF_CURVE = 16.0, 0.2
# Log likelihood ratio of the best moving average to the best other noise. If the noise is one of the other ones, such as white noise, a certain
# average gains so much with a probability below e^-10 (Markov's inequality for a likelihood ratio), any of them below 0.2 %. In fact the largest of
# 600 simulated sweeps of white noise was 1.2, of 200 with disturbances of all sorts -2, of 900 motors whose noise is far below their curve 3.3; of
# sweeps of 201 points averaged over 5, one alone has 5 to 41, three repeats 55 to 85.
GAIN = 10.0


def _parabola(points: int) -> FloatArray:
    powers = np.vander(np.linspace(-1, 1, points), 3)
    return np.asarray((powers @ np.linalg.pinv(powers))[points // 2])


def _mean(points: int) -> FloatArray:
    return np.full(points, 1 / points)


# Weights of the neighbours in the averages that are compared.
AVERAGES: tuple[FloatArray, ...] = (*map(_mean, AVERAGED), *map(_parabola, PARABOLAS))


class Smoothing(NamedTuple):
    """A moving average that an instrument seems to have made.

    Parameters
    ----------
    weights : ndarray
        Of the neighbouring points.
    log_odds : float
        Log likelihood ratio to noise that is correlated otherwise.
    sweeps : tuple of RepeatedSweep
        In which it is seen.
    """

    weights: FloatArray
    log_odds: float
    sweeps: tuple[RepeatedSweep, ...]

    @property
    def points(self) -> int:
        """Number of equally weighted points whose mean lowers white noise as much."""
        return round(1 / float(np.sum(self.weights**2)))

    @property
    def changes(self) -> list[FloatArray]:
        """How much averaging once more would change each sweep, relative to Z, shape (n,): about as much as it was changed already."""
        return [_changed_by_averaging(sweep.mean_ohm, self.weights) for sweep in self.sweeps]


def smoothing_of(sweeps: Sequence[RepeatedSweep], noise: Sequence[Noise]) -> Smoothing | None:
    """The moving average that the scatter of all sweeps together shows, or else of one of them; None if there is none.

    Parameters
    ----------
    sweeps : sequence of RepeatedSweep
    noise : sequence of Noise
        Of the mean of each.
    """
    pairs = [(sweep, average_gains(sweep, own)) for sweep, own in zip(sweeps, noise, strict=True)]
    examined = [(sweep, gains) for sweep, gains in pairs if gains]
    for together in (examined, *([one] for one in examined if len(examined) > 1)):
        # It is a setting of the analyser, which mostly stays the same.
        total = np.sum([gains for _, gains in together], axis=0) if together else np.zeros(1)
        best = int(np.argmax(total))
        if total[best] > GAIN:
            return Smoothing(AVERAGES[best], float(total[best]), tuple(sweep for sweep, _ in together))
    return None


@one_blas_thread
def average_gains(sweep: RepeatedSweep, noise: Noise) -> list[float]:
    """Log likelihood ratio of each of `AVERAGES` to the best other noise.

    Empty if the sweep is too short, or if the rounding of its numbers is most of its noise.
    """
    checkpoint()
    width = OF_REPEATS if sweep.repeats > 1 else OF_ONE
    # A last digit that stays the same over several points is no average of them.
    rounded = sweep.rounding_relative is not None and np.median(noise.sigma) < 2 * np.median(sweep.rounding_relative)
    if sweep.frequency_hz.size < 2 * width or rounded:
        return []
    starts = np.arange(0, sweep.frequency_hz.size - width + 1, width)
    windows = starts[:: max(1, starts.size * width // ENOUGH), None] + np.arange(width)
    if sweep.repeats > 1:
        free = contrasts(sweep.impedance_ohm / sweep.mean_ohm - 1) / noise.sigma
        values = free[:, windows].reshape(-1, width)
        spaces = np.linalg.qr(np.vander(np.linspace(-1, 1, width), PARABOLA), mode="complete")[0][None, :, PARABOLA:] + 0j
    else:
        values, spaces = _beside_rational(sweep, windows)
    inside = np.einsum("...ij,...i->...j", spaces.conj(), values)
    differs = np.any(inside != 0, axis=1)
    if not differs.any():
        return []
    inside, spaces = inside[differs], spaces if len(spaces) == 1 else spaces[differs]
    others, averages = _correlations(width)
    curve = _log_likelihoods(inside, spaces, _of_the_curve(width))
    # In each window the rest of the curve may be what is seen, whatever the noise is.
    best_other = max(_together(_log_likelihoods(inside, spaces, one), curve) for one in others)
    return [max(_together(_log_likelihoods(inside, spaces, one), curve) for one in kind) - best_other for kind in averages]


def _changed_by_averaging(impedance_ohm: ComplexArray, weights: FloatArray) -> FloatArray:
    points = weights.size
    # At the ends there are no neighbours to average.
    inside = slice((points - 1) // 2, impedance_ohm.size - points // 2)
    changed = np.zeros(impedance_ohm.size)
    changed[inside] = np.abs(np.convolve(impedance_ohm, weights, "valid") / impedance_ohm[inside] - 1)
    return changed


def _beside_rational(sweep: RepeatedSweep, windows: np.ndarray) -> tuple[ComplexArray, ComplexArray]:
    """Values in the windows and, as orthonormal columns, the space beside the local rational functions, both in units of their noise."""
    frequency, impedance = sweep.frequency_hz, sweep.mean_ohm
    size = np.abs(impedance[windows]).max(axis=1, keepdims=True)
    equations = LocalEquations.of(frequency, frequency[windows[:, windows.shape[1] // 2]], impedance[windows] / size, windows)
    weight = equations.weights(np.abs(equations.values))
    basis = np.linalg.qr(equations.columns * weight[:, :, None], mode="complete")[0]
    return equations.values * weight, basis[:, :, COEFFICIENTS:]


def _log_likelihoods(inside: ComplexArray, spaces: ComplexArray, correlation: FloatArray) -> FloatArray:
    """Of each window, whose noise has the most likely size: restricted to the space that the curve does not reach."""
    own = np.swapaxes(spaces.conj(), 1, 2) @ correlation @ spaces
    triangle = np.linalg.cholesky(own + 1e-9 * np.eye(own.shape[-1]))
    # With one space for all windows, several sweeps have several windows each.
    white = np.linalg.solve(np.broadcast_to(triangle, (len(inside), *triangle.shape[1:])), inside[:, :, None])[:, :, 0]
    scales = np.log(np.abs(np.diagonal(triangle, axis1=1, axis2=2))).sum(axis=1)
    return np.asarray(-inside.shape[1] * np.log(np.sum(np.abs(white) ** 2, axis=1)) - 2 * scales)


def _together(noise: FloatArray, curve: FloatArray) -> float:
    return float(np.sum(np.logaddexp(np.log(1 - OF_CURVE) + noise, np.log(OF_CURVE) + curve)))


def _distance(width: int) -> FloatArray:
    place = np.arange(width, dtype=np.float64)
    return np.abs(place[:, None] - place)


def _of_the_curve(width: int) -> FloatArray:
    place = np.arange(width, dtype=np.float64)
    return SHARES[-1] * matern(place, place, CURVE_LENGTH) + (1 - SHARES[-1]) * np.eye(width)


@lru_cache(maxsize=2)
def _correlations(width: int) -> tuple[Sequence[FloatArray], Sequence[Sequence[FloatArray]]]:
    """Correlations between the points of a window of noise that is not averaged, and of each average with some white noise."""
    place, white = np.arange(width, dtype=np.float64), np.eye(width)
    kinds: Iterable[FloatArray] = [kind for length in LENGTHS for kind in (np.exp(-_distance(width) / length), matern(place, place, length))]
    others = [white, *(share * kind + (1 - share) * white for kind in kinds for share in SHARES)]
    averages = [[(1 - beside) * _of_average(weights, width) + beside * white for beside in WHITE_BESIDE] for weights in AVERAGES]
    return others, averages


def _of_average(weights: FloatArray, width: int) -> FloatArray:
    by_distance = np.zeros(width)
    own = np.correlate(weights, weights, "full")[weights.size - 1 :][:width]
    by_distance[: own.size] = own / own[0]
    return np.asarray(by_distance[_distance(width).astype(np.intp)])
