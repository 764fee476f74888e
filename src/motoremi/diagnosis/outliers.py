"""Single points that no smooth error explains: each is compared with its prediction from all other points."""

from __future__ import annotations

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, runs
from motoremi.data.coarse import points_in_bins
from motoremi.data.spikes import MOST
from motoremi.data.sweep import RepeatedSweep
from motoremi.fitting.result import Fit
from motoremi.interrupts import checkpoint

# Limit of the chi-squared of one point given the others (2 degrees of freedom): exceeded by chance once in three million.
FAR_OFF = 30.0
# Longest run of neighbouring outliers; a longer one may be a narrow resonance.
BESIDE = 3


def outlying(fit: Fit) -> dict[str, BoolArray]:
    """Points too far from their prediction by all others, by termination; empty if there are none or too many.

    With K the inverse covariance (of noise, analyser and discrepancy), a residual given all others has the variance 1 / K_ii and lies
    (K r)_i / K_ii off (Rasmussen and Williams, 2006, eq. 5.12). The worst is left out first, because it also shifts the prediction of its
    neighbours.
    """
    problem = fit.weighed
    far = _farthest(problem.whitening.directions(fit.sizes.discrepancy), problem.residual(fit.unknowns) * problem.observed.weight)
    found = {termination: far[where] for termination, where in problem.observed.slices.items() if far[where].any()}
    if any(_longest_run(points) > BESIDE for points in found.values()) or np.mean(far) > MOST:
        return {}
    sweeps: dict[str, RepeatedSweep] = {sweep.termination: sweep for sweep in fit.measurement.sweeps}
    steps_hz = fit.measurement.analyser.step_frequencies_hz
    return {termination: points_in_bins(sweeps[termination], steps_hz, points) for termination, points in found.items()}


def _farthest(directions: ComplexArray, weighted: ComplexArray) -> BoolArray:
    """Points left out one after the other until no other is far off; the inverse covariance is 1 - D D*."""
    pulled = weighted - directions @ (directions.conj().T @ weighted)
    own: FloatArray = np.maximum(1 - np.sum(np.abs(directions) ** 2, axis=1), 1e-12)
    gone = np.zeros(weighted.size, dtype=np.bool_)
    taken = np.zeros((weighted.size, 0), dtype=np.complex128)
    while gone.mean() <= MOST:
        checkpoint()
        off = np.where(gone, 0.0, np.abs(pulled) ** 2 / own)
        worst = int(np.argmax(off))
        if off[worst] <= FAR_OFF:
            break
        column = -directions @ directions[worst].conj() - taken @ taken[worst].conj()
        column[worst] += 1
        column /= np.sqrt(own[worst])
        pulled = pulled - column * (pulled[worst] / np.sqrt(own[worst]))
        own = np.maximum(own - np.abs(column) ** 2, 1e-12)
        taken = np.column_stack([taken, column])
        gone[worst] = True
    return gone


def _longest_run(points: BoolArray) -> int:
    return max((run.stop - run.start for run in runs(points)), default=0)
