"""Laws that are not exact: what they add to the error bars of a model with effects.

The effects of a real motor follow the laws of the catalogue only approximately: sheets are of several thicknesses, insulation relaxes at more than
one frequency, wire is stranded. Such a law describes the sweeps with parameters that change a little along frequency, and the fit, which has one
value of each, takes the difference into the elements beside it.
"""

from __future__ import annotations

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.fitting.problem import Linearised, Problem
from motoremi.model.effects import find_effect

# Least change of a parameter of an effect along frequency: standard deviation, relative to its value. Of 33 motors of two generators by other
# authors, whose laws are not those of the catalogue and whose effects were named rightly, 82 % of 189 intervals of elements that no effect changes
# contained the truth without it, 92 % with it. With 1 % half of all error bars would be 1.7 times as wide or more, instead of 1.2 times.
CHANGES = 0.005
# Independent changes in a decade: one relaxation departs from two neighbouring ones over about half a decade.
A_DECADE = 2


def pulls_of_laws(problem: Problem, u: FloatArray, here: Linearised, left: float) -> FloatArray:
    """What a change along frequency of each parameter of an effect adds to J' C^-1 r, shape (m, k).

    All change by the same share of their values: `CHANGES`, or as much as it takes for the undescribed part to be such changes.

    Parameters
    ----------
    problem : Problem
        Of the likelihood.
    u : ndarray, shape (k,)
        Its solution.
    here : Linearised
        The problem there.
    left : float
        The undescribed part, relative to Z.
    """
    # Of effects with a cause: one that only describes is what it describes.
    laws = {name for name in problem.motor.effects if not find_effect(name).effect.describes}
    of_laws = [index for index, parameter in enumerate(problem.unknowns) if parameter.name.rpartition(".")[0].partition("#")[0] in laws]
    if not of_laws:
        return np.zeros((0, u.size))
    logarithmic = np.array([problem.unknowns[index].scale == "log" for index in of_laws])
    slopes = (np.where(logarithmic, 1.0, u[of_laws]) * here.chain[of_laws])[:, None] * here.slopes[of_laws]
    size = float(np.sqrt(np.mean(np.sum(np.abs(slopes / problem.observed.weight) ** 2, axis=0))))
    share = max(CHANGES, left / size) if size else CHANGES
    changed = slopes[:, None, :] * _along_frequency(problem.observed.frequency_hz)
    return share * problem.pull(here, changed.reshape(-1, problem.size))


def _along_frequency(frequency_hz: FloatArray) -> FloatArray:
    """Smooth independent changes along log frequency, shape (m, n), whose sum has a variance of about one everywhere.

    A constant one is not among them: it is a change of the parameter's own value.
    """
    decades = np.log10(frequency_hz)
    span = float(np.ptp(decades))
    count = max(1, round(A_DECADE * span))
    place = np.pi * (decades - decades.min()) / max(span, 1e-9)
    return np.sqrt(2 / count) * np.cos(np.arange(1, count + 1)[:, None] * place)
