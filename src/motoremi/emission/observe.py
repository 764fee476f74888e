"""Observations on spectra without a model: a comb, the repetition rate from peak and average, unsuitable settings of the scan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.emission.band import band_of
from motoremi.emission.judge import levels_in_words, place_of
from motoremi.emission.limit import LOWEST_HZ
from motoremi.errors import BadInput
from motoremi.quantities import show
from motoremi.threads import one_blas_thread

# Number of lines of a comb that are used, and the least score that is accepted. The score is a correlation: 1 for a pure cosine.
_LINES = 40
LEAST_SCORE = 0.3
# Probability with which noise may be taken for a comb. The score of n points of noise scatters by 1 / sqrt(n).
FALSE_COMB = 1e-3
# Spacings near each one that is tried.
_TRIES = 9
# Range of the commutation rates of small and large motors.
COMMUTATION_HZ = (50.0, 20e3)
# In bandwidths: half of one, and what rounding of written frequencies adds.
LARGEST_STEP = 0.505
# Peak minus average is at least this for noise and for separate pulses; it is 0 for lines.
_LINES_DB = 3.0


@dataclass(frozen=True)
class Comb:
    """Lines at multiples of a frequency.

    Parameters
    ----------
    spacing_hz : float
    score : float
        Correlation of the spectrum with the comb.
    points : int
        Number of points of that correlation.
    """

    spacing_hz: float
    score: float
    points: int = 0


@one_blas_thread
def find_comb(frequency_hz: FloatArray, level_dbuv: FloatArray, resolution_bandwidth_hz: float = 0.0) -> Comb | None:
    """The most distinct comb, with a spacing from twice the step or the bandwidth to a tenth of the span, or None.

    Parameters
    ----------
    frequency_hz, level_dbuv : ndarray, shape (n,)
    resolution_bandwidth_hz : float
        Lines nearer to each other are not resolved.
    """
    step = float(np.median(np.diff(frequency_hz[: max(3, frequency_hz.size // 4)])))
    low, high = max(2.1 * step, resolution_bandwidth_hz), (frequency_hz[-1] - frequency_hz[0]) / 10
    if high <= low or frequency_hz.size < 40:
        return None
    best: list[Comb] = []
    for spacing in np.geomspace(low, high, max(2, int(np.log(high / low) * 4 * _LINES))):
        best.append(_refined(frequency_hz, level_dbuv, float(spacing)))
    by_chance = math.sqrt(2 * math.log(len(best) * _TRIES / FALSE_COMB))
    best = [comb for comb in best if comb.points and comb.score > max(LEAST_SCORE, by_chance / math.sqrt(comb.points))]
    if not best:
        return None
    top = max(comb.score for comb in best)
    # Sharp lines correlate with every fraction of their spacing as well, so the largest spacing is taken.
    largest = max(comb.spacing_hz for comb in best if comb.score > 0.8 * top)
    return max((comb for comb in best if comb.spacing_hz > 0.93 * largest), key=lambda comb: comb.score)


def _refined(frequency_hz: FloatArray, level_dbuv: FloatArray, spacing: float) -> Comb:
    inside = frequency_hz <= max(frequency_hz[0], spacing) + _LINES * spacing
    part_hz = frequency_hz[inside]
    if part_hz.size < 20:
        return Comb(spacing, 0.0)
    per_line = int(np.clip(spacing / np.median(np.diff(part_hz)), 2, part_hz.size // 4))
    detail = level_dbuv[inside] - median_filter(level_dbuv[inside], size=2 * per_line + 1, mode="nearest")
    detail = detail - detail.mean()
    power = float(np.sqrt(np.sum(detail**2) * detail.size / 2))
    if not power:
        return Comb(spacing, 0.0)
    tries = spacing * (1 + np.linspace(-1, 1, _TRIES) / (8 * _LINES))
    scores = sums_of_cosines(part_hz, detail, tries) / power
    top = int(np.argmax(scores))
    return Comb(float(tries[top]), float(scores[top]), part_hz.size)


def sums_of_cosines(frequency_hz: FloatArray, detail: FloatArray, spacings: FloatArray) -> FloatArray:
    """Sum of detail cos(2 pi f / spacing) for each spacing.

    Parameters
    ----------
    frequency_hz, detail : ndarray, shape (n,)
    spacings : ndarray, shape (m,)
        In hertz.

    Returns
    -------
    ndarray, shape (m,)
    """
    turn = 2 * np.pi / spacings[:, None]
    if not np.allclose(frequency_hz, np.linspace(frequency_hz[0], frequency_hz[-1], frequency_hz.size), rtol=1e-9, atol=0):
        return np.cos(turn * frequency_hz) @ detail
    # At equal steps exp(i (a + b)) = exp(i a) exp(i b): n points need only about 2 sqrt(n) exponentials, for the rows and for the points in a row.
    step = (frequency_hz[-1] - frequency_hz[0]) / (frequency_hz.size - 1)
    width = math.isqrt(frequency_hz.size)
    rows = np.pad(detail, (0, -detail.size % width)).reshape(-1, width)
    within = np.exp(1j * turn * step * np.arange(width))
    starts = np.exp(1j * turn * (frequency_hz[0] + step * width * np.arange(len(rows))))
    return np.sum(starts * (within @ rows.T), axis=1).real


def repetition_from(peak: Spectrum, average: Spectrum) -> float | None:
    """Events per second from peak minus average, 20 log(impulse bandwidth / repetition), at points well above the noise.

    Returns
    -------
    float or None
        None if the two agree (lines), or have no common points.
    """
    if not np.array_equal(peak.frequency_hz, average.frequency_hz):
        return None
    usable = ~(peak.overload | average.overload)
    strong = usable & (average.level_dbuv > np.percentile(average.level_dbuv[usable], 10) + 10) if usable.any() else usable
    if strong.sum() < 10:
        return None
    difference = float(np.median((peak.level_dbuv - average.level_dbuv)[strong]))
    if difference < _LINES_DB:
        return None
    return float(band_of(peak.resolution_bandwidth_hz).impulse_bandwidth_hz * 10 ** (-difference / 20))


def observations(spectra: Sequence[Spectrum]) -> list[JsonDict]:
    """Observations, each with an identifier, a sentence and its numbers."""
    found: list[JsonDict] = []
    by_detector = {spectrum.detector: spectrum for spectrum in spectra}
    strongest = by_detector.get("peak") or next(iter(by_detector.values()), None)
    comb = None
    if strongest is not None:
        comb = find_comb(strongest.frequency_hz, strongest.level_dbuv, strongest.resolution_bandwidth_hz)
    if comb is not None:
        kind = ", too fast for a commutator: a switching converter or chopper" if comb.spacing_hz > COMMUTATION_HZ[1] else ""
        text = f"comb at multiples of {comb.spacing_hz / 1e3:.4g} kHz (correlation {comb.score:.2f}){kind}"
        found.append({"id": "comb", "text": text, "spacing_hz": comb.spacing_hz, "score": comb.score})
    peak, average = by_detector.get("peak"), by_detector.get("average")
    if peak is not None and average is not None:
        try:
            rate = repetition_from(peak, average)
        except BadInput as error:
            rate = None
            found.append({"id": "bandwidth", "text": str(error)})
        if comb is not None and comb.spacing_hz > peak.resolution_bandwidth_hz:
            rate = None
        if rate is not None and COMMUTATION_HZ[0] <= rate <= COMMUTATION_HZ[1]:
            text = f"peak - average corresponds to {rate:.4g} events a second: compare it with speed times segments"
            found.append({"id": "repetition", "text": text, "repetition_hz": rate})
    if comb is not None and comb.spacing_hz > COMMUTATION_HZ[1]:
        found.append({"id": "not-a-commutator", "text": "these spectra do not look like those of a commutator motor"})
    return [*found, *(one for spectrum in spectra for one in unsuitable(spectrum))]


def unsuitable(spectrum: Spectrum) -> list[JsonDict]:
    """What of a scan's steps and readings is not as a comparison with a limit needs it."""
    found = []
    what = levels_in_words(spectrum.detector, *place_of(spectrum))
    steps = np.diff(spectrum.frequency_hz)
    if spectrum.frequency_hz[0] < LOWEST_HZ:
        found.append({"id": "below-9-khz", "text": f"{what}: starts at {spectrum.frequency_hz[0]:g} Hz; no CISPR band begins below 9 kHz"})
    if steps.max() > 1.5 * steps.min():
        found.append({"id": "uneven-steps", "text": f"{what}: not in equal steps ({steps.min():.4g} to {steps.max():.4g} Hz)"})
    if steps.max() > LARGEST_STEP * spectrum.resolution_bandwidth_hz:
        wide = f"steps of {show(float(steps.max()), 'Hz')} are wider than half the bandwidth of {show(spectrum.resolution_bandwidth_hz, 'Hz')}"
        found.append({"id": "coarse-steps", "text": f"{what}: {wide}: lines may be missed or read too low"})
    if spectrum.overload.any():
        text = f"{what}: the receiver was overloaded at {int(spectrum.overload.sum())} points; they are not judged"
        found.append({"id": "overload", "text": text})
    return found
