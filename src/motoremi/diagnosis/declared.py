"""Whether the data are those of the analyser that was declared: they are judged under the others as well.

Only where the declared one leaves something, or has to err beyond its specification, since the others cost a search each. Another one is
taken if the data prefer it clearly and a model stands under it: a healthy declaration was never denied, a wrong one by 43 to 87 nats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import Progress
from motoremi.data.analyser import ANALYSERS, Analyser
from motoremi.diagnosis.candidates import BEYOND_SIGMA
from motoremi.diagnosis.judgement import Judgement, judge
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, Task, arrived_on_all

# Log odds beyond which the data deny the declared analyser: 150 to 1.
TAKEN = 5.0


@dataclass(frozen=True, eq=False)
class Declared:
    """The judgement to go by.

    Parameters
    ----------
    judgement : Judgement
    instead : Analyser or None
        What the data say it was, where they deny the declared one.
    log_odds : float
        For that one.
    """

    judgement: Judgement
    instead: Analyser | None = None
    log_odds: float = 0.0


def likeliest(first: Judgement, progress: Progress | None = None) -> Declared:
    """The judgement under the analyser that the data ask for.

    Parameters
    ----------
    first : Judgement
        Under the declared analyser.
    progress : callable, optional
    """
    if first.stands and first.model.fit.analyser_sigma <= BEYOND_SIGMA:
        return Declared(first)
    bases = sorted((_under(first, other) for other in hypotheses(first.base.measurement.analyser)), key=lambda fit: -fit.log_evidence)
    for base in bases[: 1 if first.stands else 2]:
        best = max(base.log_evidence, _best_under(first, base))
        if first.stands and best < first.best.fit.log_evidence + TAKEN:
            continue
        other = judge(base, progress)
        odds = other.best.score - first.best.score
        if odds > TAKEN and other.stands and other.model.fit.analyser_sigma <= BEYOND_SIGMA:
            return Declared(other, base.measurement.analyser, float(odds))
    return Declared(first)


def hypotheses(declared: Analyser) -> list[Analyser]:
    """What the analyser could have been instead."""
    others = [one for one in ANALYSERS if not one.ideal and one.name not in (declared.name, "e4990a", "unknown")]
    network = next(one for one in ANALYSERS if one.by_reflection)
    both = [*others, network, network.compensated_here()]
    same = (declared.name, declared.compensated)
    return list({(one.name, one.compensated): one for one in both if (one.name, one.compensated) != same}.values())


def _under(first: Judgement, analyser: Analyser) -> Fit:
    """The base under another analyser."""
    return _refitted(first.base, analyser)


def _best_under(first: Judgement, base: Fit) -> float:
    """Evidence of the likeliest model under another analyser."""
    return _refitted(first.best.fit, base.measurement.analyser).log_evidence if first.best.added else -np.inf


def _refitted(fit: Fit, analyser: Analyser) -> Fit:
    measurement = fit.measurement.by(analyser)
    task = Task(fit.motor, measurement, fit.bounds, fit.held)
    own = dict(fit.parameters)
    solution = arrived_on_all(task, [own, {**own, **fit.search_parameters}])
    return summarise(task, Found(solution, fit.history, fit.search_parameters), fit.method, fit.seed)
