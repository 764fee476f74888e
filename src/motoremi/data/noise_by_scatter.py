"""White noise of a single sweep, estimated from how its points scatter about local rational functions.

The scatter is compared with the analyser's law, whose parts are fitted to it. Where the curve changes more between points than a local
function follows, the scatter is larger than the noise. Therefore the least of three windows counts, one before, one around and one after the
point; points that still scatter far more do not count for the law, and a running median, which a few of them do not change, corrects the law
slowly along frequency.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import gammaincinv

from motoremi.arrays import ComplexArray, FloatArray, IntArray
from motoremi.data.local_rational import COEFFICIENTS, LocalEquations
from motoremi.data.noise_law import SMALLEST_SIGMA, Domain, fitted_by_law

# Points of a window: with fewer the coefficients follow the noise, with more a sharp resonance is not followed.
WINDOW = 10
# Share of the expected variance that the least of three windows has, because the denominator follows the noise where the curve does not
# determine it (0.95), and because it is the least (0.7): medians of 200 simulated sweeps.
KEPT = 0.67
# Points of the running median, and the largest correction of the variance: more is the curve, not the noise.
NEIGHBOURS, MOST_CORRECTED = 31, 9.0
# They are no further than this ratio of frequencies, which matters at the low end of points at equal distances only; there the variance may be
# corrected by the second number. Towards the end of its range a network analyser loses its signal in coupling capacitors and transformers: sweeps
# of a NanoVNA from 50 kHz, of 1023 points to 25 or 30 MHz, scatter by 3 to 9 times as much at the first nine points as at the others.
REACH, MOST_AT_THE_END = 2.0, 100.0
# Points whose residuals are larger than those of this share of windows with noise alone do not count for the law. The running median restores its
# size, so only its shape depends on them.
USED = 0.9
# The law weights the windows, and the windows give the law: of 80 simulated sweeps with sharp resonances 90 % change by less than 5 % after
# six rounds.
ROUNDS = 6
# With fewer points, the scatter may be that of the curve: then the noise is not assumed to be larger than the second number, which no usable
# analyser exceeds.
COARSE, MOST_OF_COARSE = 30, 0.03
# Points, about, that are examined: law and correction change slowly, and a hundred thousand would take half a minute.
ENOUGH = 1500


def noise_by_scatter(frequency_hz: FloatArray, domain: Domain, rounding: FloatArray | None = None) -> FloatArray:
    """Standard deviation of the white noise, of the real and of the imaginary part each, in the domain of the analyser's law.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    domain : Domain
    rounding : ndarray, shape (n,), optional
        The known part that is caused by rounded numbers, in the same domain.

    Returns
    -------
    ndarray, shape (n,)
    """
    count = frequency_hz.size
    width = min(WINDOW, count)
    at = np.arange(0, count, max(count // ENOUGH, 1))
    windows = np.clip(at - width // 2, 0, count - width)[:, None] + np.arange(width)
    freedom = KEPT * 2 * (width - COEFFICIENTS)
    # Quantiles of chi-squared.
    median, largest = (2 * gammaincinv(freedom / 2, share) for share in (0.5, USED))

    sigma, known = np.ones(count), None if rounding is None else rounding**2
    equations, size = _equations(frequency_hz, domain.rational, windows, at)
    for _ in range(ROUNDS):
        squares = _squares(equations, (sigma * domain.of_rational)[windows] / size)
        used = squares <= largest * max(float(np.median(squares)) / median, 1.0)
        sigma = np.sqrt(fitted_by_law((squares / freedom * sigma[at] ** 2)[used], domain.law, at[used], known))
    squares = _squares(equations, (sigma * domain.of_rational)[windows] / size)
    typical = np.interp(np.arange(count), at, _correction(squares / median, frequency_hz[at]))
    sigma = np.maximum(sigma * np.sqrt(typical), SMALLEST_SIGMA)
    return np.minimum(sigma, MOST_OF_COARSE) if count < COARSE else sigma


def _correction(squares: FloatArray, frequency_hz: FloatArray) -> FloatArray:
    """The running median of the squares over `NEIGHBOURS` points, without those beyond `REACH`, and no more than the noise can be, shape (n,)."""
    found = np.minimum(median_filter(squares, size=min(NEIGHBOURS, squares.size), mode="nearest"), MOST_CORRECTED)
    place, half = np.arange(squares.size), NEIGHBOURS // 2
    last = np.searchsorted(frequency_hz, frequency_hz * REACH, side="right")
    # Of points at equal ratios as many are within reach everywhere.
    few = last - place < np.median(last - place) / 2
    for index in np.flatnonzero(few & (last <= np.minimum(place + half, squares.size - 1))):
        first = max(index - half, int(np.searchsorted(frequency_hz, frequency_hz[index] / REACH)))
        found[index] = min(float(np.median(squares[first : last[index]])), MOST_AT_THE_END)
    return found


def _equations(frequency_hz: FloatArray, values: ComplexArray, windows: IntArray, at: IntArray) -> tuple[LocalEquations, FloatArray]:
    """The equations in the windows around some points, and the unit of their values at each, shape (k, 1)."""
    size = np.abs(values[windows]).max(axis=1, keepdims=True)
    # Nothing at all is reflected by the reference resistance.
    size = np.where(size > 0, size, 1.0)
    return LocalEquations.of(frequency_hz, frequency_hz[at], values[windows] / size, windows), size


def _squares(equations: LocalEquations, noise: FloatArray) -> FloatArray:
    """Sum of squares of the residuals in units of their expected variance, the least of three windows at each point, shape (n,).

    The windows before and after a point are those around other points of the equations.

    Parameters
    ----------
    equations : LocalEquations
    noise : ndarray, shape (n, k)
        Expected noise of the values.
    """
    weight = equations.weights(noise)
    basis = np.linalg.qr(equations.columns * weight[:, :, None])[0]
    right = (equations.values * weight)[:, :, None]
    squares = np.sum(np.abs(right - basis @ (np.swapaxes(basis.conj(), 1, 2) @ right))[:, :, 0] ** 2, axis=1)
    place, before = np.arange(squares.size), (weight.shape[1] - 1) // 2
    windows = [np.clip(place + shift, 0, squares.size - 1) for shift in (-before, 0, before)]
    return np.min(squares[windows], axis=0)
