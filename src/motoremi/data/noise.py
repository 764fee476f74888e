"""Random noise of a sweep, from its repeats or, for want of any, from its own scatter.

The noise model is that of a bridge: a relative part, an additive part in impedance (seen at low |Z|) and an additive part in
admittance (seen at high |Z|), times a slow function of frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import nnls

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import RepeatedSweep

NoiseSource: TypeAlias = Literal["repeats", "stated", "scatter"]
# The quietest export of a 4294A that we know scatters by 6e-5; files carry 6 or 7 digits. Below this no noise is believed.
SMALLEST_SIGMA = 1e-5
# Scatter from point to point misses what wanders more slowly; in the native 4294A export that we have, an R-L load, the residuals of
# a good fit are 1.4 times the scatter. So its variance may be short by this factor.
SCATTER_DOUBT = 1.5**2


@dataclass(frozen=True)
class Noise:
    """Random noise of the mean of the repeats.

    Parameters
    ----------
    sigma : ndarray, shape (n,)
        Standard deviation of the real and of the imaginary part of ln Z (that is, of the relative error).
    source : {"repeats", "stated", "scatter"}
        Where it comes from.
    """

    sigma: FloatArray
    source: NoiseSource


def estimate_noise(sweep: RepeatedSweep) -> Noise:
    """Noise of the mean of a repeated sweep."""
    if sweep.repeats > 1:
        return Noise(_from_repeats(sweep) / np.sqrt(sweep.repeats), "repeats")
    if sweep.sigma_relative is not None:
        return Noise(np.maximum(sweep.sigma_relative, SMALLEST_SIGMA), "stated")
    return Noise(_from_scatter(sweep.frequency_hz, sweep.impedance_ohm[0]), "scatter")


def _from_repeats(sweep: RepeatedSweep) -> FloatArray:
    """Standard deviation of one repeat: sample variances, fitted with the bridge's law, times a slow correction."""
    relative = sweep.impedance_ohm / sweep.mean_ohm - 1
    variance = np.sum(np.abs(relative) ** 2, axis=0) / (2 * (sweep.repeats - 1))
    magnitude = np.abs(sweep.mean_ohm)
    law = _bridge_law(variance, magnitude)
    # The slow correction averages over so many points that its own scatter stays near 10 %.
    width = min(len(variance), max(25, len(variance) // 6))
    correction = uniform_filter1d(variance / law, width, mode="reflect")
    sigma: FloatArray = np.maximum(np.sqrt(law * np.clip(correction, 0.25, 4.0)), SMALLEST_SIGMA)
    return sigma


def _bridge_law(variance: FloatArray, magnitude: FloatArray) -> FloatArray:
    """r^2 + (z/|Z|)^2 + (y |Z|)^2 fitted to sample variances, whose own scatter is proportional to themselves."""
    columns = np.column_stack([np.ones_like(magnitude), 1 / magnitude**2, magnitude**2])
    law = np.full_like(variance, max(float(np.mean(variance)), SMALLEST_SIGMA**2))
    for _ in range(8):
        scaled = columns / law[:, None]
        norms = np.linalg.norm(scaled, axis=0)
        coefficients = nnls(scaled / norms, variance / law)[0] / norms
        law = np.maximum(columns @ coefficients, SMALLEST_SIGMA**2)
    return law


def _from_scatter(frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> FloatArray:
    """Scatter round a local parabola through the neighbours; an upper bound where the sweep is coarse.

    Medians keep sharp resonances, where a parabola does not follow, from passing for noise.
    """
    logarithm = np.log(frequency_hz)
    response = np.log(np.abs(impedance_ohm)) + 1j * np.unwrap(np.angle(impedance_ohm))
    half = 3
    variance = np.empty(len(response))
    for index in range(len(response)):
        start = min(max(index - half, 0), len(response) - 2 * half - 1)
        window = slice(start, start + 2 * half + 1)
        x = logarithm[window] - logarithm[index]
        design = np.vander(x / np.max(np.abs(x)), 4)
        orthonormal = np.linalg.qr(design)[0]
        residual = response[window] - orthonormal @ (orthonormal.T @ response[window])
        # 7 points less 4 coefficients leave 3 complex degrees of freedom.
        variance[index] = np.sum(np.abs(residual) ** 2) / (2 * 3)
    # Median of chi-squared with 6 degrees of freedom over its mean.
    typical = median_filter(variance, size=min(31, len(variance)), mode="nearest") / 0.8914
    overall = float(np.median(variance)) / 0.8914
    return np.maximum(np.sqrt(np.minimum(typical, 9 * overall)), SMALLEST_SIGMA)
