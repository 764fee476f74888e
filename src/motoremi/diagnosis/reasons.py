"""The verdict in words: what was found, what it rests on, and what these sweeps do not show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import sqrt

from motoremi.arrays import JsonDict
from motoremi.diagnosis.belief import Verdict
from motoremi.diagnosis.candidates import Candidate, changed_elements, possible_effects
from motoremi.diagnosis.explore import Key, best_of
from motoremi.diagnosis.findings import hardly_seen, shows_nothing
from motoremi.diagnosis.judgement import Judgement, distributed
from motoremi.diagnosis.machine_modes import machine_in_words
from motoremi.diagnosis.needed import is_within
from motoremi.fitting.result import Fit
from motoremi.fitting.search import BEYOND_SIGMA
from motoremi.fitting.seen_by import MODES
from motoremi.inspection.compare import compare
from motoremi.model.effects import find_effect
from motoremi.model.effects.effect import Needs
from motoremi.model.effects.names import as_sum, what_is_more
from motoremi.quantities import percent, show, show_band

# About 3 cm of wire: leads may differ by as much between the two sweeps.
SHORT_STRAP_H = 30e-9
# What was tried beside single effects, by size of the largest sets that were compared.
TRIED_BESIDE = ("", "", ", nor do two of them", ", nor do two of them, nor a third beside the best two")
# Speed of waves on cables, two thirds of that of light (polyethylene and PVC).
CABLE_M_PER_S = 2e8
# What a device needs for an effect, in words.
NEEDED: Mapping[Needs, str] = {"winding": "a winding", "core": "a core", "lossy insulation": "lossy insulation", "part": "such a further part"}
# Causes of the verdict `instrument` that are no fault of analyser or fixture, by the effect that is named alone.
_OF_THE_SETUP = {
    "temperature-drift": "the motor's temperature was not the same in both sweeps",
    "far-end-tie": "the wire from the winding's far end to the analyser is part of what the short-circuit sweep measures",
}


def reasons_for(judgement: Judgement, verdict: Verdict, named: Key, families: Sequence[Key], validation: JsonDict) -> list[str]:
    """The reasons for a verdict, each a line of text: the most important first.

    Parameters
    ----------
    judgement : Judgement
    verdict : str
    named : tuple of str
        The named effects.
    families : sequence of tuple of str
        Of each named effect that others could replace: all of them.
    validation : dict
        Gains of `Diagnosis.validation`.
    """
    base, closest = judgement.base, judgement.closest
    if verdict in ("unexplained", "data"):
        tried, most = len(possible_effects(base)), max(map(len, judgement.found))
        spans = "; ".join(f"{span['sweep']} {show_band(*span['band_hz'])}" for span in compare(closest.fit).where[:3])
        left = closest.fit.unexplained_percent
        floor = f"noise and analyser would leave {percent(base.floor_percent, 2)}"
        less = ", which is more than that over all points but less at some frequencies" if base.rms_error_percent <= base.floor_percent else ""
        missing = f"something is missing (error {percent(base.rms_error_percent)}; {floor}{less})"
        if judgement.described and judgement.distributed:
            pair = judgement.best.added
            imitation = _imitation(pair)
            return [f"{missing}; two relaxations describe it, {' and '.join(pair)}, and so would {imitation}, which is not in the catalogue"]
        if judgement.described and judgement.best.unusual:
            return [
                f"{missing}; {' and '.join(judgement.best.added)} describe it, but only with unusual values "
                f"({judgement.best.unusual_in_words}): an effect outside the catalogue is more probable",
            ]
        return [
            f"{missing} and none of {tried} effects explains it{TRIED_BESIDE[most]}",
            *(() if judgement.whole is None else machine_in_words(judgement.whole)),
            f"closest: {as_sum(closest.added) or 'none'}, which leaves {percent(closest.fit.rms_error_percent)}; beyond noise and analyser "
            f"{percent(left['value'], 2)} ({spans or 'spread over the whole span'})",
            *_nearly(judgement),
            *_modes_hint(closest),
        ]
    if not named:
        return _reasons_of_none(judgement, verdict)
    best = judgement.best.fit
    left = best.unexplained_percent
    before, after = base.rms_error_percent, best.rms_error_percent
    floor = f"(noise and analyser would leave {percent(best.floor_percent, 2)})"
    if after > before:
        # Near a sharp resonance the analyser's errors, within its specification, are a large part of Z.
        effect = (
            f"the error that neither circuit nor analyser describes from {percent(base.unexplained_percent['value'], 2)} to "
            f"{percent(left['value'], 2)}; the circuit's own error rises from {percent(before)} to {percent(after)}, as the analyser's errors are "
            f"taken out of it {floor}"
        )
    else:
        rest = f"; {percent(left['value'], 2)} stays undescribed" if left["value"] else ""
        effect = f"the circuit's error from {percent(before)} to {percent(after)} {floor}{rest}"
    said = [f"adding {' and '.join(named)} takes {effect}"]
    said += _several_terms(named)
    said += as_a_cable(named, best)
    if judgement.model.larger_than_winding:
        said.append(f"of the parts of this winding the larger one is in {as_sum(named)}, so La, Ca and Ra are those of the smaller one")
    if verdict == "instrument":
        allowed = f"the analyser's specification allows this error, but without {as_sum(named)} the elements are wrong"
        of_analyser = allowed if is_within(base) else "the analyser or its fixture is beyond its specification"
        cause = _OF_THE_SETUP.get("".join(named), of_analyser)
        said.append(f"{cause}; the motor's circuit needs nothing")
    if len(named) == 1 and (imitation := find_effect(named[0]).imitated_by):
        same = "which is not in the catalogue, has nearly the same impedance: these sweeps do not distinguish it from"
        said.append(f"{imitation}, {same} {named[0]}")
    if (strap_h := short_strap_h(judgement)) is not None:
        said.append(
            f"a strap of {show(strap_h, 'H')} is so short that leads which were longer in the open-circuit sweep have the same impedance: measure "
            "both sweeps with the same leads, in the same positions"
        )
    if judgement.model.unusual:
        said.append(f"these values are unusual: {judgement.model.unusual_in_words}; something that is not in the catalogue is as probable")
    if (unusual := judgement.unusual_instead) is not None:
        values = unusual.unusual_in_words or ", ".join(unusual.at_bound)
        said.append(f"{as_sum(unusual.added)} describes these sweeps as well and is more probable, but only with unusual values ({values})")
    if (absorbing := judgement.absorbing_instead) is not None:
        said.append(
            f"{as_sum(absorbing.added)} is more probable, but only by errors that are assumed of an analyser without a name: its circuit misses by "
            f"{percent(absorbing.fit.rms_error_percent)} (name the analyser: --analyser)"
        )
    if (needing_more := judgement.instead_of_every_winding) is not None:
        said.append(
            f"{needing_more.effect} alone describes these sweeps about as well, but needs more than the wire and insulation that every winding "
            "has: they do not show which it is"
        )
    if needing_more is None and (alone := judgement.describes_nearly_all) is not None:
        alone_left = alone.fit.unexplained_percent["value"]
        said.append(
            f"{alone.effect} alone leaves {percent(alone_left, 2)} undescribed of {percent(base.unexplained_percent['value'], 2)}; a law that "
            "is not quite the motor's leaves as much, so the two together are uncertain"
        )
    relieving = [one for one in judgement.aside.values() if one.fit.analyser_sigma < best.analyser_sigma]
    if relieving:
        further = best_of(relieving)
        gone = what_is_more(named, further.added)
        said.append(
            f"with {what_is_more(further.added, named)} {f'in place of {gone}' if gone else 'as well'} the analyser would err by "
            f"{further.fit.analyser_sigma / 3:.2g} times its specification, without it by {best.analyser_sigma / 3:.2g} times: these sweeps do not "
            "show whether that is missing too"
        )
    for family in families:
        said.append(f"these sweeps do not distinguish {', '.join(family[:-1])} and {family[-1]}")
        if (likeliest := judgement.commoner_than) is not None:
            needs = NEEDED[find_effect(likeliest.effect).effect.needs_a]
            said.append(f"{likeliest.effect} is more probable of these; {family[0]} is named first because fewer devices have {needs}")
        rivals = judgement.instead_of(family[0])
        if changed := changed_elements(best, {name: rivals[name].fit for name in family[1:] if name in rivals}):
            said.append(f"the elements depend on which it is: {changed}")
    if min((gain for gain in validation.values() if gain is not None), default=0.0) < 0:
        said.append("but it predicts left-out parts of the sweeps no better than before: repeat the sweeps before you rely on it")
    return said


def _several_terms(named: Key) -> list[str]:
    """That a law of a core which is named several times is one cause."""
    several = {name: number for name, number in Counter(named).items() if number > 1 and find_effect(name).effect.needs_a == "core"}
    return [f"the {number} {name} are terms of the permeability of one core, which is one cause" for name, number in several.items()]


def as_a_cable(named: Key, fit: Fit) -> list[str]:
    """Which cable is named, or has the inductance and capacitance of leads and terminals, if any: below its resonance it is both."""
    if "supply-cable" in named:
        cable = _cable(fit.parameters["supply-cable.wave_ohm"], fit.parameters["supply-cable.delay_s"])
        return [f"that is {cable}: if there is none, a winding of one layer or a printed one, whose conductor is as long, is such a line itself"]
    if set(named) != {"lead-inductance", "terminal-capacitance"}:
        return []
    henry, farad = fit.parameters["lead-inductance.inductance_h"], fit.parameters["terminal-capacitance.capacitance_f"]
    wave_ohm, delay_s = sqrt(henry / farad), sqrt(henry * farad)
    parameter = next(one for one in find_effect("supply-cable").effect.parameters if one.name == "wave_ohm")
    assert parameter.usual is not None
    low, high = parameter.usual
    if not low <= wave_ohm <= high:
        return []
    return [f"{_cable(wave_ohm, delay_s)} has both: is one behind the plane of the compensation?"]


def _cable(wave_ohm: float, delay_s: float) -> str:
    return f"a cable of {show(wave_ohm, 'Ohm')} and about {delay_s * CABLE_M_PER_S:.2g} m ({show(delay_s, 's')})"


def _imitation(relaxing: Key) -> str:
    """What has the impedance of two relaxations at one place."""
    return next(text for name in (*relaxing, "dielectric-relaxation@Cf") if (text := find_effect(name).imitated_by))


def _nearly(judgement: Judgement) -> list[str]:
    """Why effects that describe nearly all are not named."""
    if not judgement.nearly_described:
        return []
    found = judgement.closest_found
    if distributed(found.added):
        why = f"but so would {_imitation(found.added)}, which is not in the catalogue"
    elif found.unusual:
        why = f"but only with unusual values ({found.unusual_in_words})"
    else:
        why = "but several effects together describe almost any curve" if len(found.added) > 1 else "but its law may be that of another effect"
    return [f"{as_sum(found.added)} may be what is missing, since it describes nine tenths of it or more, {why}: it is not named"]


def short_strap_h(judgement: Judgement) -> float | None:
    """Inductance of a strap in the accepted model that leads of different length could be; None if there is none."""
    if "ground-strap-inductance" not in judgement.model.added:
        return None
    henry = judgement.model.fit.parameters["ground-strap-inductance.inductance_h"]
    return henry if henry <= SHORT_STRAP_H else None


def _modes_hint(closest: Candidate) -> list[str]:
    """If resonances are missing: the effect that describes them without a cause."""
    if MODES in closest.added or not any("inductance-resonance" in find_effect(name).effect.seen_as for name in closest.added):
        return []
    return ["resonances are missing; as seen from the terminals they can be described without a cause: motoremi add SESSION winding-modes"]


def _reasons_of_none(judgement: Judgement, verdict: Verdict) -> list[str]:
    base = judgement.base
    if shows_nothing(base):
        return [
            f"the analyser's own errors may be as large as what was measured (error {percent(base.rms_error_percent, 2)}): the sweeps say nothing "
            "about the motor"
        ]
    left = base.unexplained_percent
    beyond = left["low"] > 0 and base.rms_error_percent > base.floor_percent
    rest = f"to {percent(left['value'], 2)}, beyond noise and analyser" if beyond else "down to noise and analyser"
    if hardly_seen(base):
        rest = "only where the analyser is sensitive"
    floor = f"noise and analyser would leave {percent(base.floor_percent, 2)}"
    said = [f"the model describes the sweeps {rest} (error {percent(base.rms_error_percent, 2)}, {floor})"]
    if verdict == "instrument" and base.analyser_sigma > BEYOND_SIGMA:
        said.append(f"but only if the analyser errs by {base.analyser_sigma / 3:.2g} times its specification")
    instead = judgement.instead_of_the_analyser
    if judgement.accurate:
        said.append(f"that is within the accuracy of {base.measurement.accuracy_percent:g} % that was stated for these data")
    elif instead is not None and not judgement.belief.named:
        said.append(
            f"{instead.effect} would describe them too, with the analyser within its specification (the circuit would err by "
            f"{percent(instead.fit.rms_error_percent, 2)}): these sweeps do not show which it is"
        )
    elif judgement.belief.named:
        said.append(
            f"{' and '.join(judgement.belief.named)} would describe the rest, which is too small to matter or may be the analyser's: "
            "state the accuracy that you need (--accuracy) if it matters"
        )
        if changed := changed_elements(base, {as_sum(judgement.belief.named): judgement.found[tuple(sorted(judgement.belief.named))].fit}):
            said.append(f"the elements depend on it: {changed}")
    else:
        said.append("an effect too weak to be seen by this analyser over this band cannot be ruled out")
    return said
