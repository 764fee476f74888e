"""Errors of the fitted values because the motor changed during the measurement.

Where the repeats of a sweep drift, their trend says how fast each copper resistance and capacitance moves: a line through them, in terms of
what those elements do to the impedance. As far as an element went while one sweep was repeated it may have gone between the sweeps too, so
each sweep is thought to be measured on a motor that differs by so much. What that does to the parameters is linear in the sensitivities at
the solution; it widens what is shown and leaves the evidence, and so the diagnosis, alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.noise import Noise
from motoremi.data.sweep import RepeatedSweep

if TYPE_CHECKING:
    from motoremi.fitting.problem import Linearised, Problem

# Copper, and insulation that holds a winding: what a warm motor changes. Inductances hardly depend on temperature.
MOVING = ("Ra", "Ca", "Cr", "Cf")
# From one repeat to the next no element moves by more (standard deviation of its logarithm): copper would have to warm by 8 K.
MOST_A_REPEAT = 0.03


def displacements(problem: Problem, u: FloatArray, here: Linearised, covariance: FloatArray) -> FloatArray:
    """Standard deviations of the solution by what moved, one row for each element in each sweep that drifts; shape (m, k).

    Parameters
    ----------
    problem : Problem
        Of the likelihood, on all points.
    u : ndarray, shape (k,)
        Its solution.
    here : Linearised
        The problem there.
    covariance : ndarray, shape (k, k)
        Of the unknowns.
    """
    rows = []
    moving = [index for index, parameter in enumerate(problem.unknowns) if parameter.name in MOVING]
    measurement = problem.measurement
    drifting = [(sweep, noise) for sweep, noise in zip(measurement.sweeps, measurement.noise, strict=True) if noise.drift is not None]
    slopes = problem.slopes_of_deviation(u)[moving] if drifting else None
    for sweep, noise in drifting:
        assert slopes is not None
        where = problem.observed.slices[sweep.termination]
        for slope, size in zip(slopes[:, where], _moved(sweep, noise, -slopes[:, where]), strict=True):
            changed = np.zeros(problem.size, dtype=np.complex128)
            changed[where] = size * slope * problem.observed.weight[where]
            rows.append(covariance @ problem.pull(here, changed))
    return np.array(rows).reshape(-1, len(problem.unknowns))


def _moved(sweep: RepeatedSweep, noise: Noise, slopes: ComplexArray) -> FloatArray:
    """By how much each element's logarithm may have moved while a sweep was repeated, shape (m,), from the trend of its repeats.

    Parameters
    ----------
    slopes : ndarray, shape (m, n)
        Derivatives of ln Z for the logarithms of the elements.
    """
    order = np.arange(sweep.repeats) - (sweep.repeats - 1) / 2
    length = float(np.sqrt(order @ order))
    trend = order @ (sweep.impedance_ohm / sweep.mean_ohm - 1) / length
    weight = 1 / (noise.sigma * np.sqrt(sweep.repeats))
    design, target = (slopes * weight).view(np.float64), (trend * weight).view(np.float64)
    # For steps of one along the unit contrast; a parameter that changes no repeat keeps its prior.
    variance = np.linalg.inv(length**2 * design @ design.T + np.eye(len(slopes)) / MOST_A_REPEAT**2)
    step = variance @ (length * design @ target)
    return sweep.repeats * np.sqrt(step**2 + np.diag(variance))
