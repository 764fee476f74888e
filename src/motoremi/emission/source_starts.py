"""Start values of a chopper from the spectrum: its period and the width of its pulses cause ripples of the levels along frequency.

In dB, factors of the spectrum are added: lines at multiples of 1/T cause a ripple cos(2 pi f T), and the two edges of a pulse, which cancel if
f d T is an integer, a ripple -cos(2 pi f d T). A cosine transform over the whole scan determines T to some nanoseconds, even if the lines are not
further apart than the receiver's bandwidth and are hardly visible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from scipy.ndimage import uniform_filter1d

from motoremi.arrays import FloatArray
from motoremi.emission.scatter import even_steps
from motoremi.emission.spectrum_problem import Problem

# Range of the chopper's frequency, and shortest pulse.
_SLOWEST_HZ, _FASTEST_HZ = 2.5e3, 60e3
_SHORTEST_S = 1.5e-6
# Structures wider than this along frequency are not caused by a chopper; larger deviations of a point are clipped.
_WIDEST_HZ, _MOST_DB = 700e3, 10.0
# Factor of zero padding, and numbers of periods and widths that are tried.
_PADDING, _PERIODS, _WIDTHS = 16, 4, 4
_RATES_HZ = np.geomspace(_SLOWEST_HZ, 9e3, 16)
_DUTIES = (0.1, 0.25, 0.4)
_VOLT, _RISE_S = 5.0, 5e-8
_RISES_S = np.geomspace(1e-8, 4e-7, 24)
_KEPT = 4


def chopper_starts(problem: Problem, effects: Sequence[str], others: Mapping[str, float]) -> list[dict[str, float]]:
    """Start values of amplitude, frequency, width and rise time.

    Parameters
    ----------
    problem : Problem
    effects : sequence of str
        Effects of the model without a chopper.
    others : mapping
        Its parameter values.
    """
    level = problem.whole.get("average", next(iter(problem.whole.values())))
    periods, widths = _ripples(problem.grid, level)
    pairs = [(1 / rate, duty) for rate in (3e3, 4.5e3, 6.5e3) for duty in _DUTIES]
    pairs += [(1 / rate, width * rate) for rate in _RATES_HZ for width in widths]
    # The pulse and the gap after it cause the same kind of ripple, and their sum is the period.
    pairs += [(one + other, one / (one + other)) for one, other in combinations(widths, 2)]
    for period in periods:
        pairs += [(period, duty) for duty in (*(width / period for width in widths), _duty_of_lines(problem, level, period))]
    rough = _best([_sized(problem, effects, others, 1 / period, duty * period, _RISE_S) for period, duty in pairs if 0.03 < duty < 0.97])
    # The rise time is scanned, because the spectrum of a ramp has zeros, which separate the minima of a fit.
    return _best([_sized(problem, effects, others, one["frequency_hz"], one["width_s"], float(rise)) for one in rough for rise in _RISES_S])


def _best(sized: list[tuple[float, dict[str, float]]]) -> list[dict[str, float]]:
    return [start for _, start in sorted(sized, key=lambda pair: pair[0])[:_KEPT]]


def _ripples(frequency_hz: FloatArray, level_dbuv: FloatArray) -> tuple[list[float], list[float]]:
    """Periods and widths of pulses, in s, strongest first; none if the scan is too short."""
    even_hz, step = even_steps(frequency_hz)
    if even_hz[-1] - even_hz[0] < 2 * _WIDEST_HZ:
        return [], []
    level = np.interp(even_hz, frequency_hz, level_dbuv)
    smooth = uniform_filter1d(level, max(3, round(_WIDEST_HZ / step)), mode="nearest")
    detail = np.clip(level - smooth, -_MOST_DB, _MOST_DB) * np.hanning(level.size)
    size = _PADDING * 2 ** int(np.ceil(np.log2(detail.size)))
    delay_s = np.arange(size) / (size * step)
    # The transform is periodic in 1/step, apart from the phase of the first frequency.
    ripple = np.real(np.fft.ifft(detail, size) * size * np.exp(2j * np.pi * frequency_hz[0] * delay_s))
    return (
        _highest(delay_s, ripple, 1 / _FASTEST_HZ, min(1 / step, 1 / _SLOWEST_HZ), _PERIODS),
        _highest(delay_s, -ripple, _SHORTEST_S, min(1 / step, 0.5 / _SLOWEST_HZ), _WIDTHS),
    )


def _highest(delay_s: FloatArray, ripple: FloatArray, shortest_s: float, longest_s: float, count: int) -> list[float]:
    inside = np.flatnonzero((delay_s >= shortest_s) & (delay_s <= longest_s))[1:-1]
    tops = inside[(ripple[inside] > ripple[inside - 1]) & (ripple[inside] >= ripple[inside + 1])]
    return [float(delay_s[top]) for top in tops[np.argsort(-ripple[tops])][:count]]


def _duty_of_lines(problem: Problem, level_dbuv: FloatArray, period_s: float) -> float:
    """The duty cycle d for which |sin(pi k d)|/k agrees best with the lines k, refined with more and more lines."""
    frequency, spacing = problem.grid, 1 / period_s
    gain_db = 20 * np.log10(np.abs(problem.setup.path.transfer(problem.grid_hz, problem.motor_ohm)))
    number = np.arange(np.ceil(frequency[0] / spacing), frequency[-1] // spacing)
    at = np.searchsorted(frequency, number * spacing - (frequency[1] - frequency[0]) / 2)
    # Correction for the attenuation of the filter, because the receiver is not tuned exactly to the line.
    beside = 6.02 * ((frequency[at] - number * spacing) / (0.5 * problem.setup.receiver.band.bandwidth_hz)) ** 2
    height_db = level_dbuv[at] + beside - np.interp(number * spacing, problem.grid_hz, gain_db)
    found, width = np.linspace(0.02, 0.5, 241), 0.001
    for most in (60, 240, 960):
        used = number <= max(most, number[0] + 20)
        tries = (found[:, None] + width * np.linspace(-1, 1, 9)).ravel()
        shape = 20 * np.log10(np.maximum(np.abs(np.sin(np.pi * number[used] * tries[:, None])), 0.05) / number[used])
        left = height_db[used] - shape
        scatter = np.mean(np.minimum(np.abs(left - np.median(left, axis=1)[:, None]), 10.0), axis=1)
        found = tries[np.argsort(scatter)[:6]]
        width *= 60 / most * 0.5
    return float(found[0])


def _sized(
    problem: Problem, effects: Sequence[str], others: Mapping[str, float], rate_hz: float, width_s: float, rise_s: float
) -> tuple[float, dict[str, float]]:
    """The remaining error, and a start with the amplitude that gives the measured average level."""
    start = {"amplitude_v": _VOLT, "frequency_hz": rate_hz, "width_s": width_s, "rise_s": rise_s}
    error = problem.error((*effects, "chopper"), {**others, **{f"chopper.{key}": value for key, value in start.items()}})
    above_db = float(np.median(error[problem.where.get("average", slice(None))]))
    left = float(np.mean(np.minimum(np.abs(error - above_db), _MOST_DB)))
    return left, {**start, "amplitude_v": float(np.clip(_VOLT * 10 ** (above_db / 20), 0.03, 70.0))}
