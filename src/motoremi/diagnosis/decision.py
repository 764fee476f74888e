"""The search for the effects that are missing, and the choice of the set that is named, from all models that were found."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

from motoremi.arrays import Progress
from motoremi.diagnosis.belief import FAMILY_TOGETHER, MOST_ERRING_PERCENT, believe
from motoremi.diagnosis.candidates import Candidate, candidate
from motoremi.diagnosis.explore import Budget, Key, best_of, explore, key_of, ranked
from motoremi.diagnosis.judgement import COMMONEST_FIRST, Judgement, accurate, leaves_an_error, needs
from motoremi.diagnosis.motor_board import MotorBoard
from motoremi.diagnosis.needed import as_asked_for, is_assumed
from motoremi.diagnosis.thresholds import ALIKE, CLEAR_GAIN, CONTENDING, NEARLY_ALIKE, SURE_GAIN
from motoremi.fitting.integrated import integrated
from motoremi.fitting.result import Fit
from motoremi.fitting.search import BEYOND_SIGMA
from motoremi.model.effects import find_effect
from motoremi.workers import Map

BUDGET = Budget()
# A search for one effect.
ONE_EFFECT = Budget(swaps=(0,))
# Number of further sets of one size that are refitted on all points if none describes everything, as alternatives for the decision;
# and of sets with unusual values that are searched anew, which takes a second for each of their effects.
FURTHER = 4


def judge(
    base: Fit,
    progress: Progress | None = None,
    budget: Budget = BUDGET,
    each: Map = map,
    further: Callable[[Candidate], bool] = lambda best: True,
) -> Judgement:
    """Search for the effects that are missing from a fit, and decide; `further` as in `explore`."""
    # For a circuit within the stated accuracy, effects are shown and none is named.
    spent = ONE_EFFECT if accurate(base) else budget
    board = MotorBoard(base, each, FURTHER if spent.most_effects > 1 else 0)
    found = searched_anew(board, explore(board, board.start(), spent, progress, further))
    best = best_of(found.values())
    if base.measurement.terminations == ("short",) and len(best.added) == 1 and (accurate(base) or _is_nearly_ordinary(base, best)):
        # One sweep of a winding alone, of which hardly more than copper and insulation may be left.
        found = {**{key_of(one): one for one in board.every_winding()}, **found}
    return decided(base, _integrated(base, found, each))


def searched_anew(board: MotorBoard, found: Mapping[Key, Candidate]) -> dict[Key, Candidate]:
    """The same models; if the best one describes everything with unusual values only, those near it are searched again.

    Values beyond their range are often those of a wrong minimum. Each effect of such a set starts anew beside the others: a choke at the brushes
    behind a capacitor to the frame, with its share and its corner at their lower bounds, was behind a coupling with unusual values by e^35, and
    ahead of it with usual ones.
    """
    best = best_of(found.values())
    if not best.added or not best.done or best.ordinary:
        return dict(found)
    anew = dict(found)
    near = [one for one in ranked(found, len(best.added)) if not one.ordinary and one.score > best.score - CLEAR_GAIN]
    for one in near[:FURTHER]:
        for effect in dict.fromkeys(one.added):
            for again in board.swapped(anew[key_of(one)], effect, effect):
                key = key_of(again)
                anew[key] = best_of([again, anew.get(key, again)])
    return anew


def _is_nearly_ordinary(base: Fit, best: Candidate) -> bool:
    """Whether copper and insulation may be all that a winding has although another effect is more probable: its circuit alone errs little."""
    return needs(best.effect) != COMMONEST_FIRST[0] and base.rms_error_percent <= MOST_ERRING_PERCENT


def _integrated(base: Fit, found: Mapping[Key, Candidate], each: Map) -> dict[Key, Candidate]:
    """The same models; those near the best are searched further and their evidence is integrated where the data hardly determine a parameter.

    This is not done for sets larger than the best: their further effect is not needed.
    """
    best = best_of(found.values())
    near = [key for key, one in found.items() if 0 < len(key) <= len(best.added) and one.score > best.score - CONTENDING]
    again = {}
    for key, (fit, gained) in zip(near, each(integrated, [(found[key].fit, best.score - found[key].score) for key in near]), strict=True):
        one, better = found[key], candidate(fit, base)
        # The difference, since a score may have another prior than that of the number of effects (`as_in_every_winding`).
        again[key] = dataclasses.replace(better, score=one.score + better.score - candidate(one.fit, base).score + gained)
    return {**found, **again}


def decided(base: Fit, found: Mapping[Key, Candidate], together: float = FAMILY_TOGETHER, proven: bool = False) -> Judgement:
    """The decision from the models that were found; `together` as in `belief.believe`, `proven` as in `Judgement`."""
    judgement = _decided(base, found, together, proven)
    return judgement if proven else _commonest_first(of_every_winding(judgement, is_assumed(base)))


def of_every_winding(judgement: Judgement, assumed: bool) -> Judgement:
    """The judgement for losses of copper and insulation together, if they describe a winding alone as well as one effect that needs more.

    They are two effects, but no coincidence: every winding has both, and only some a core.

    Parameters
    ----------
    judgement : Judgement
    assumed : bool
        Whether nobody named the analyser: likelihood ratios then rest on assumed errors, and circuits are about equally good if they err alike.
    """
    if len(judgement.named) != 1 or not judgement.accepted or judgement.base.measurement.terminations != ("short",):
        return judgement
    if needs(judgement.named[0]) == COMMONEST_FIRST[0]:
        return judgement
    named = judgement.model
    most_percent = NEARLY_ALIKE * named.fit.rms_error_percent if assumed else 0.0
    both = {key: one for key, one in judgement.found.items() if len(key) == 2 and all(needs(name) == COMMONEST_FIRST[0] for name in key)}
    as_good: dict[Key, Candidate] = {
        key: dataclasses.replace(one, score=max(one.score, named.score) if one.fit.rms_error_percent <= most_percent else one.score)
        for key, one in both.items()
        if one.score > named.score - SURE_GAIN or one.fit.rms_error_percent <= most_percent
    }
    if not as_good:
        return judgement
    found: dict[Key, Candidate] = {**judgement.found, **as_good}
    without: dict[Key, Candidate] = {(): found[()]}
    chosen = believe(without | as_good)
    ordinary = Judgement(judgement.base, found, dataclasses.replace(chosen, posterior=believe(found).posterior))
    return ordinary if len(ordinary.named) == 2 and ordinary.accepted else judgement


def _commonest_first(judgement: Judgement) -> Judgement:
    """The judgement with other members of the families named first, if they need less of the device: every winding has copper, few a core.

    A motor has a core, but a sweep of a winding alone may be of any coil. The effects of a family describe it about as well, so what is common is
    the better guess; measurements that decide between them (`proven`) are better than any.
    """
    if judgement.base.measurement.terminations != ("short",) or not judgement.accepted:
        return judgement
    for effect in judgement.named:
        judgement = _with_commonest(judgement, effect)
    return judgement


def _with_commonest(judgement: Judgement, effect: str) -> Judgement:
    """The same with the commonest member of an effect's family in its place, among those that these sweeps do not distinguish from it."""
    family, instead, model = judgement.families[effect], judgement.instead_of(effect), judgement.model
    most_percent = NEARLY_ALIKE * model.fit.rms_error_percent if leaves_an_error(model.fit) else 0.0
    near = [name for name in family if instead[name].fit.rms_error_percent <= most_percent or instead[name].score > model.score - SURE_GAIN]
    first = min((effect, *(name for name in near if instead[name].ordinary)), key=lambda name: COMMONEST_FIRST.index(needs(name)))
    if first == effect:
        return judgement
    named = tuple(first if name == effect else name for name in judgement.named)
    families = {**judgement.families, first: (effect, *(name for name in family if name != first))}
    families.pop(effect, None)
    other = dataclasses.replace(judgement, belief=dataclasses.replace(judgement.belief, named=named, families=families))
    return other if other.named == instead[first].added or sorted(other.named) == sorted(named) else judgement


def _decided(base: Fit, found: Mapping[Key, Candidate], together: float, proven: bool) -> Judgement:
    """The decision by evidence, values and errors."""
    judgement = _believed(base, found, together, proven)
    if len(judgement.best.added) > 2 and not judgement.accepted:
        # Three effects that are not accepted say nothing about two.
        judgement = _believed(base, _without_threes(found), together, proven)
    if judgement.accurate:
        # None is named, and what is likeliest in the rest stays as it was found.
        return dataclasses.replace(judgement, none_named=True)
    if len(judgement.best.added) < len(judgement.belief.named):
        # The further effects of this set only reduce the analyser's error; without such sets another one may be the most probable.
        needed = _with_usual_values(judgement.of_needed, together)
        if len(needed.belief.named) > 2 and not needed.accepted:
            needed = _believed(base, _without_threes(judgement.found), together, proven)
        more = {key: one for key, one in judgement.found.items() if key not in needed.found and len(key) > len(needed.best.added)}
        aside = {key: one for key, one in more.items() if one.leaves_nothing and one.score > needed.best.score}
        judgement = dataclasses.replace(needed, aside=aside)
    judgement = _of_the_closer_circuit(judgement, together)
    if (enough := judgement.of_accurate) is not None:
        return enough
    if (single := judgement.of_singles_as_good) is not None:
        return single.or_closest
    if judgement.accepted:
        return judgement.or_closest
    # If a larger set is not accepted and its further effects add little, the effect that does most is named and the rest stays undescribed.
    single = judgement.of_singles
    smaller = judgement.of_none or judgement.of_closest if single is None else single.or_closest
    if any(one is not None and judgement.is_better_than(one) for one in (single, smaller)):
        return dataclasses.replace(judgement, pair_is_better=True)
    accepted = smaller or _without_steps(base, found, together, proven)
    if accepted is not None:
        return accepted
    if judgement.leaves_hardly_anything:
        return dataclasses.replace(judgement, pair_is_better=True)
    return judgement.of_within or judgement


def _without_threes(found: Mapping[Key, Candidate]) -> Mapping[Key, Candidate]:
    return {key: one for key, one in found.items() if len(key) < 3}


def _believed(base: Fit, found: Mapping[Key, Candidate], together: float, proven: bool) -> Judgement:
    """The judgement by the probabilities of the models, and by their values where laws are alike."""
    return _with_usual_values(Judgement(base, found, believe(found, together), proven=proven), together)


def _without_steps(base: Fit, found: Mapping[Key, Candidate], together: float, proven: bool) -> Judgement | None:
    """The decision from the models without steps of the analyser's range, if it accepts one; None if it does not, or if no model has such a step.

    A step within the specification is part of what such an analyser measures; however probable, it does not show what the motor lacks.
    """
    without = {key: one for key, one in found.items() if not any(find_effect(name).effect.of_ranges for name in key)}
    judgement = _decided(base, without, together, proven) if len(without) < len(found) else None
    return judgement if judgement is not None and judgement.accepted else None


def _of_the_closer_circuit(judgement: Judgement, together: float) -> Judgement:
    """The judgement among the sets whose circuits err half as much as the most probable one's, if one of them describes everything as well.

    Of an analyser without a name the errors are an assumption, and likelihood ratios rest on it: with a ferrite bead (1 MHz - 1 GHz) two terms of
    its permeability left a circuit's error of 0.9 %, and one with a relaxing capacitance, more probable by e^35, one of 35 %.
    """
    likeliest = judgement.model
    if not likeliest.added or not is_assumed(likeliest.fit):
        return judgement
    most_percent = likeliest.fit.rms_error_percent / ALIKE
    closer = {
        key: one
        for key, one in judgement.found.items()
        if len(key) <= len(likeliest.added) and _describes_everything(one) and one.fit.rms_error_percent <= most_percent
    }
    if not closer:
        return judgement
    # A further effect has to bring the circuit clearly closer: what it adds to the likelihood rests on the assumption too.
    least = min(one.fit.rms_error_percent for one in closer.values())
    size = min(len(key) for key, one in closer.items() if one.fit.rms_error_percent <= ALIKE * least)
    closer = {key: one for key, one in closer.items() if len(key) <= size}
    other = dataclasses.replace(judgement, belief=believe({(): judgement.found[()], **closer}, together))
    return other if other.named and other.accepted else judgement


def _describes_everything(one: Candidate) -> bool:
    """Whether a model with ordinary values describes everything, with an analyser that errs by no more than twice what is assumed of it."""
    return one.ordinary and one.fit.marginal.nothing_left >= 0.5 and one.fit.instrument_sigma <= BEYOND_SIGMA


def _with_usual_values(judgement: Judgement, together: float) -> Judgement:
    """The judgement among the sets with usual values, if the most probable set has unusual ones and one of the others does as well.

    If an error remains, the laws are approximate and likelihood ratios mean little, so usual values decide. A set that describes everything
    with unusual values, with one at a physical bound or with errors of the analyser far beyond its specification is replaced by one of its
    size that does as well as asked for with ordinary values and the analyser within its specification, unless the odds against it are clear.
    """
    likeliest = judgement.model
    leaves_nothing = likeliest.fit.marginal.nothing_left >= 0.5
    usual = {key for key, one in judgement.found.items() if (one.ordinary if leaves_nothing else not one.unusual)}
    # Errors of the analyser far beyond its specification are as unusual as a value: of a shorted cable of 0.3 m on a NanoVNA a resonance was more
    # probable than the cable, by e^10, with 24 times the specification.
    excessive = leaves_nothing and judgement.beyond_specification
    if not likeliest.added or (tuple(sorted(likeliest.added)) in usual and not excessive):
        return judgement
    own_size = len(likeliest.added)
    if leaves_nothing and not excessive and own_size == 1 and any((name,) in usual for name in judgement.families[likeliest.effect]):
        # Its family, which is told, has an effect with usual values.
        return judgement
    if leaves_nothing:
        usual = {key for key in usual if not key or as_asked_for(judgement.found[key])}
    for size in range(own_size, own_size + 1 if leaves_nothing else BUDGET.most_effects + 1):
        found = {key: one for key, one in judgement.found.items() if key in usual and len(key) <= size}
        other = dataclasses.replace(judgement, belief=believe(found, together))
        if leaves_nothing:
            # Likelihood ratios of approximate laws mean little if the circuit errs no more than noise and analyser: a film of brushes that relaxes
            # twice, with a leak, was less probable by e^191 than a resonance that does not resonate, which is no cause.
            within = not judgement.accepted and other.model.fit.within_specification
            alike = within or likeliest.score - other.model.score <= CLEAR_GAIN
        else:
            alike = other.model.fit.rms_error_percent <= ALIKE * likeliest.fit.rms_error_percent
        if other.named and alike and (other.accepted or not judgement.accepted):
            return other
    return judgement
