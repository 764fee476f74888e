"""The next measurement: the one that distinguishes the remaining explanations, or one that would confirm the only one left."""

from __future__ import annotations

from collections.abc import Container
from typing import NamedTuple

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.fitting.result import Fit
from motoremi.investigation.conditioned import ahead
from motoremi.investigation.menu import MENU, REPEATABILITY, Option
from motoremi.investigation.outcome import Outcome
from motoremi.investigation.question import Question
from motoremi.model.effects import find_effect
from motoremi.quantities import percent, show, show_band

# A change of so many times the uncertainty is clear.
CLEAR = 5.0


class Answer(NamedTuple):
    """The largest change of a sweep under a condition: relative to the repeatability, in percent of the impedance, and where."""

    ratio: float
    change_percent: float
    termination: str
    frequency_hz: float


NO_CHANGE = Answer(0.0, 0.0, "", 0.0)


def next_measurement(fit: Fit, question: Question | None = None, done: Container[str] = ()) -> JsonDict:
    """The next measurement.

    Parameters
    ----------
    fit : Fit
        The accepted model.
    question : Question, optional
        About the explanations that remain.
    done : container of str
        Measurements that were made already: they are not proposed to confirm an effect.

    Returns
    -------
    dict
        `id` and `why`; where several explanations remain also `menu`, best first: the expected information of each measurement (`id`, `action`,
        `minutes`, `information_bits`, `separates`: share of the explanations that it distinguishes, `ratio`: the largest expected log odds of a
        pair); `procedure` where the bench can do it.
    """
    if len(fit.measurement.sweeps) == 1:
        missing = "open" if fit.measurement.terminations == ("short",) else "short"
        return {"id": f"{missing}-sweep", "why": f"measure the {missing}-circuit sweep too: one sweep cannot locate an effect"}
    if question is not None and question.worths and question.stop in (None, "inseparable"):
        return _separating(question)
    if question is not None and question.outside_stands:
        return {"id": "repeats", "why": question.why, "menu": _menu(question)}
    if fit.effects:
        return _confirming(fit, done)
    undetermined = fit.undetermined()
    if "Ra" in undetermined:
        return {"id": "dc-resistance", "why": "these sweeps do not determine Ra: measure it at DC with four wires and hold it in the fit"}
    if undetermined:
        span = show_band(*fit.measurement.analyser.span_hz)
        return {"id": "wide-sweep", "why": f"these sweeps do not determine {', '.join(undetermined)}: sweep {span}"}
    return {"id": "repeat", "why": "nothing is missing; repeat after turning the shaft or warming up to see what changes"}


def _separating(question: Question) -> JsonDict:
    worth = question.worths[0]
    answer: JsonDict = {
        "id": worth.option.name,
        "why": question.why,
        "menu": _menu(question),
    }
    if worth.option.procedure:
        answer["procedure"] = f"{worth.option.procedure}.toml"
    return answer


def _menu(question: Question) -> list[JsonDict]:
    return [
        {
            "id": one.option.name,
            "action": one.option.action,
            "minutes": one.minutes,
            "information_bits": one.bits,
            "separates": _share(one.separates),
            "ratio": one.farthest,
        }
        for one in question.worths
    ]


def _share(groups: tuple[tuple[str, ...], ...]) -> float:
    """Of the pairs of explanations, those in different groups."""
    count = sum(len(group) for group in groups)
    pairs = count * (count - 1) / 2
    return 1 - sum(len(group) * (len(group) - 1) / 2 for group in groups) / pairs if pairs else 0.0


def _confirming(fit: Fit, done: Container[str]) -> JsonDict:
    """The condition to which the effect that was added last responds most."""
    effect = find_effect(fit.effects[-1]).effect
    names = {*effect.responds, *(["second-temperature"] if effect.copper else [])}
    predicted = [
        (option, _answer(option, fit))
        for option in MENU
        if option.name in names and option.name not in done and option.kind == "change" and option.predicted
    ]
    option, answer = max(predicted, key=lambda entry: entry[1].ratio, default=(None, NO_CHANGE))
    if option is None or answer.ratio < CLEAR:
        return {"id": f"confirm-{effect.name}", "why": f"to confirm {effect.name}: {effect.deciding}"}
    found: JsonDict = {
        "id": option.name,
        "why": f"to confirm {effect.name}: {option.action}; the {answer.termination} sweep should change by {percent(answer.change_percent, 2)} "
        f"near {show(answer.frequency_hz, 'Hz')}, while repeats agree within {answer.change_percent / answer.ratio:.1g} %. Or: {effect.deciding}",
    }
    if option.procedure:
        found["procedure"] = f"{option.procedure}.toml"
    return found


def _answer(option: Option, fit: Fit) -> Answer:
    """Where the model's impedance changes most under a condition, relative to the repeatability."""
    sweeps = ahead(option, fit.measurement)
    if not sweeps:
        return NO_CHANGE
    outcome = Outcome(fit, sweeps, option=option)
    mean, _, _ = outcome.at(fit.unknowns, outcome.typical)
    start, best = 0, NO_CHANGE
    for sweep in sweeps:
        count = sweep.frequency_hz.size
        change = np.hypot(mean[start : start + count], mean[start + count : start + 2 * count])
        ratio = change / np.hypot(sweep.sigma, REPEATABILITY)
        at = int(np.argmax(ratio))
        best = max(best, Answer(float(ratio[at]), 100 * float(change[at]), sweep.termination, float(sweep.frequency_hz[at])))
        start += 2 * count
    return best
