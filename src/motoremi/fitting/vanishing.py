"""A further effect never fits worse than the circuit without it.

The range of an effect is what a motor can have: copper wire of 0.2 mm and more has some skin effect, whatever is measured. If none of its values
fits as well as the circuit without the effect, the data exclude it, and it is held at the values at which it vanishes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, Solution
from motoremi.model.effects import find_effect
from motoremi.quantities import percent

# An error larger by this factor is a real increase, not an effect of the weights of the points.
LARGER = 1.05


def no_worse(before: Fit, fitted: Fit, effect: str, given: Iterable[str] = ()) -> Fit:
    """A fit with a further effect, or the circuit without it with the effect held where it vanishes.

    Parameters
    ----------
    before : Fit
        Without the effect.
    fitted : Fit
    effect : str
    given : iterable of str
        Parameters that are held or bounded by the user: the effect is then fitted as requested.
    """
    found = find_effect(effect)
    label = found.label_in(before.motor)
    vanished = {f"{label}.{name}": value for name, value in found.effect.limit_values.items()}
    if found.effect.describes or not vanished.keys().isdisjoint(given) or not _is_worse(fitted, before):
        return fitted
    task = dataclasses.replace(fitted.task, held={**before.held, **vanished})
    values = {**before.parameters, **before.nuisance}
    solution = Solution(values, before.sizes, before.marginal, before.converged, before.evaluations + fitted.evaluations)
    result = summarise(task, Found(solution, before.history, dict(before.search_parameters)), before.method, before.seed)
    warning = (
        f"{label}: with any values in its range the error would rise from {before.rms_error_percent:.3g} to {percent(fitted.rms_error_percent)}; "
        "the data exclude it, and it is held at the values at which it vanishes"
    )
    return dataclasses.replace(result, elapsed_s=fitted.elapsed_s, warnings=(*result.warnings, warning))


def _is_worse(fitted: Fit, before: Fit) -> bool:
    return fitted.log_evidence < before.log_evidence and fitted.rms_error_percent > LARGER * before.rms_error_percent
