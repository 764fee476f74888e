"""The search for the most likely unknowns: Levenberg and Marquardt, with a geodesic correction and a second step back along curved valleys."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, IntArray
from motoremi.fitting.polish import BACK_DAMPING, PROMISED, UNDAMPED
from motoremi.investigation.known import Known, Learnt
from motoremi.investigation.system import Point, Scale, Smooth, System

# Largest number of steps to a maximum, first damping, and smallest gain of a step.
STEPS, DAMPING, CONVERGED = 25, 1e-3, 1e-2
# Least damping after a step that failed: along a curved valley more of it makes all steps small.
LEAST_DAMPING = 1e-8
# Standard deviations beyond which no response is looked for: a capacitance that usually repeats to 2 % may then halve. A search that ends here
# has no solution, and its likelihood means nothing.
FARTHEST_RESPONSE = 40.0
# Smallest gain of a step as a share of the cost: an explanation whose cost is thousands need not be refined.
CONVERGED_SHARE = 1e-4


def best_from(starts: FloatArray, best: System, at: Scale) -> System:
    """The best of a search so far, or that from the likeliest of other start values, shape (m, k)."""
    others = [best.moved_to(u, best.here.eta) for u in starts]
    if not others:
        return best
    other = best_near(min(others, key=lambda one: one.cost(at)), at)
    return min(best, other, key=lambda one: one.cost(at))


def best_near(best: System, at: Scale) -> System:
    """The most likely unknowns for one size of the discrepancy (Levenberg and Marquardt, with a geodesic correction along curved valleys)."""
    prediction, known, k = best.prediction, best.known, best.known.centre.size

    def limited(wanted: FloatArray) -> FloatArray:
        # The linear model of the unknowns is valid near the fit only: unknowns on which the prediction hardly depends are not changed.
        u = np.where(prediction.moving, np.clip(known.centre + wanted[:k], known.low, known.high), known.centre)
        return np.concatenate([u - known.centre, np.clip(wanted[k:], -FARTHEST_RESPONSE, FARTHEST_RESPONSE)])

    def moved(wanted: FloatArray) -> System:
        return best.moved_to(known.centre + wanted[:k], wanted[k:])

    damping, cost, failed, bent = DAMPING, best.cost(at), False, False
    for _ in range(STEPS):
        wanted = limited(best.damped(at, damping))
        promised = cost - best.cost(at, wanted)
        if bent:
            wanted = limited(best.corrected(at, damping, wanted))
        trial = moved(wanted)
        if trial.cost(at) > cost > trial.least(at):
            # Along a curved valley: a second step, back to its floor.
            trial = moved(limited(trial.damped(at, max(damping, BACK_DAMPING))))
        gained = cost - trial.cost(at)
        bent |= gained < PROMISED * promised
        if gained > 0:
            # Right after a failure the damping is kept: with less, the next step would fail again.
            best, cost, damping, failed = trial, cost - gained, damping if failed else damping / 10, False
        else:
            damping, failed = max(10 * damping, LEAST_DAMPING), True
        small = max(CONVERGED, CONVERGED_SHARE * cost)
        # A small gain means convergence only if damping did not make the step small.
        if abs(gained) < small and (damping > 1 or cost - best.least(at) < UNDAMPED * small):
            break
    return best


def after(known: Known, learnt: Learnt, moving: BoolArray) -> Known:
    """What is known of a model's unknowns after data; `moving` are the unknowns that were searched, all others were taken for linear."""
    if known.sweeps is None:
        return replace(known, centre=learnt.centre, precision=learnt.precision)
    taught = replace(known, sweeps=known.sweeps.after(learnt))
    # What was taught is linear around the most likely point of all data so far, and wrong far from it: if that was searched, it is the centre.
    centre = learnt.centre if moving.all() else _most_likely(taught, known.centre)
    return replace(taught, centre=centre, precision=taught.near(centre).precision)


def _most_likely(known: Known, start: FloatArray) -> FloatArray:
    """The maximum near a point: what later data teach may move it along a curved valley."""
    nothing = _Nothing(start.size)
    begun = System(nothing, known, Point.of(nothing, start, np.zeros(0)), lambda rows: rows, Smooth.of(nothing.smooth))
    return best_near(begun, (1.0, 1.0, 1.0)).here.u


class _Nothing:
    """A prediction of no data, for the maximum of what is known already."""

    size = 0
    elsewhere = True
    density = 0.0
    sigma: FloatArray = np.zeros(0)
    smooth: FloatArray = np.zeros((0, 0))
    errors: FloatArray = np.zeros((0, 0))
    unpredicted: IntArray = np.zeros(0, dtype=np.intp)

    def __init__(self, count: int) -> None:
        self.moving: BoolArray = np.ones(count, dtype=np.bool_)

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return np.zeros(0), np.zeros((u.size, 0)), np.zeros((0, 0))

    def residual(self, mean: FloatArray) -> FloatArray:
        return mean
