"""The next measurement: what would tell the standing candidates apart, found by simulating each under all that can be measured."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.diagnosis.foresee import Parting, answering, parting
from motoremi.diagnosis.menu import MENU, Option
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band

# Differences of so many times the uncertainty decide.
CLEAR = 5.0
MOST_RIVALS = 4


def next_measurement(fit: Fit, rivals: Sequence[Fit]) -> JsonDict:
    """What to measure next.

    Parameters
    ----------
    fit : Fit
        The model that stands.
    rivals : sequence of Fit
        Models that these data cannot tell apart (or the best of those that fail); may be empty.

    Returns
    -------
    dict
        `id` and `why`; with rivals also `menu`: what each measurement would do (`id`, `separates`: share of pairs that it would tell
        apart, `ratio`: smallest difference of a pair over the uncertainty), best first; `procedure` where the bench can do it.
    """
    if len(fit.measurement.sweeps) == 1:
        missing = "open" if fit.measurement.terminations == ("short",) else "short"
        return {"id": f"{missing}-sweep", "why": f"measure the {missing}-circuit sweep too: one sweep cannot locate an effect"}
    if len(rivals) > 1:
        return _separating(rivals[:MOST_RIVALS])
    if fit.effects:
        return _confirming(fit)
    undetermined = fit.undetermined()
    if "Ra" in undetermined:
        return {"id": "dc-resistance", "why": "these sweeps do not determine Ra: measure it at DC with four wires and hold it in the fit"}
    if undetermined:
        span = show_band(*fit.measurement.analyser.span_hz)
        return {"id": "wide-sweep", "why": f"these sweeps do not determine {', '.join(undetermined)}: sweep {span}"}
    return {"id": "repeat", "why": "nothing is missing; repeat after turning the shaft or warming up to see what changes"}


def _confirming(fit: Fit) -> JsonDict:
    """The change to which the effect that was added last would answer most."""
    effect = find_effect(fit.effects[-1]).effect
    foreseen = [(option, answering(option, fit)) for option in MENU if option.name in effect.responds]
    option, answer = max(foreseen, key=lambda entry: entry[1].ratio, default=(None, Parting(0.0)))
    if option is None or answer.ratio < CLEAR:
        return {"id": f"confirm-{effect.name}", "why": f"to confirm {effect.name}: {effect.deciding}"}
    found: JsonDict = {
        "id": option.name,
        "why": f"to confirm {effect.name}: {option.action}; the {answer.place} sweep should change by {answer.ratio:.0f} times its "
        f"repeatability near {show(answer.frequency_hz, 'Hz')}. Or: {effect.deciding}",
    }
    if option.procedure:
        found["procedure"] = f"{option.procedure}.toml"
    return found


def _separating(rivals: Sequence[Fit]) -> JsonDict:
    """The least effort that tells most pairs apart."""
    pairs = list(combinations(rivals, 2))
    foreseen = [(option, [parting(option, one, other) for one, other in pairs]) for option in MENU]
    foreseen.sort(key=lambda entry: (-_share(entry[1]), entry[0].effort, -_smallest(entry[1])))
    if _share(foreseen[0][1]) == 0:
        foreseen.sort(key=lambda entry: -_smallest(entry[1]))
    option, partings = foreseen[0]
    answer: JsonDict = {
        "id": option.name,
        "why": _why(option, partings, pairs),
        "menu": [{"id": o.name, "action": o.action, "separates": _share(p), "ratio": _smallest(p)} for o, p in foreseen if _largest(p) >= 1],
    }
    if option.procedure:
        answer["procedure"] = f"{option.procedure}.toml"
    return answer


def _share(partings: Sequence[Parting]) -> float:
    return float(np.mean([one.ratio >= CLEAR for one in partings]))


def _smallest(partings: Sequence[Parting]) -> float:
    return min(one.ratio for one in partings)


def _largest(partings: Sequence[Parting]) -> float:
    return max(one.ratio for one in partings)


def _why(option: Option, partings: Sequence[Parting], pairs: Sequence[tuple[Fit, Fit]]) -> str:
    names = _names([fit for pair in pairs for fit in pair])
    if _share(partings) == 0:
        effect = find_effect(pairs[0][0].effects[-1]).effect
        return (
            f"none of {len(MENU)} measurements that were simulated would clearly separate {names}; the best of them is to {option.action} "
            f"(they would differ by {_largest(partings):.1f} times the uncertainty); otherwise {effect.deciding}"
        )
    clear = max(partings, key=lambda one: one.ratio)
    where = f" near {show(clear.frequency_hz, 'Hz')} ({clear.place})" if clear.place else ""
    told = names if all(one.ratio >= CLEAR for one in partings) else "most of " + names
    return f"{option.action}: {told} would then differ by {clear.ratio:.0f} times the uncertainty{where}"


def _names(fits: Sequence[Fit]) -> str:
    sets = list(dict.fromkeys(" + ".join(fit.effects) or "no effect" for fit in fits))
    return f"{', '.join(sets[:-1])} and {sets[-1]}"
