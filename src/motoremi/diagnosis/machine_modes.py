"""A machine whose winding resonates many times: its ordinary parts, and modes of the winding as long as each lowers the error.

From 150 kHz to 30 MHz the best single effect left 21 to 27 % on the measured windings of two machines (docs/real_motor.md, docs/real_windings.md),
and a core, leads or terminals with seven to sixteen modes beside them 2 to 5 %. The modes are a description without a cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from motoremi.arrays import Progress
from motoremi.diagnosis.candidates import Candidate, Effects, candidate, own_labels, possible_effects
from motoremi.diagnosis.ladder_step import further
from motoremi.diagnosis.whole_machine import by_need, falling, in_wider_ranges, nearest
from motoremi.fitting.race import Trail
from motoremi.fitting.refit import on_all_points
from motoremi.fitting.result import Fit
from motoremi.fitting.search import Solution
from motoremi.fitting.seen_by import MODES
from motoremi.model.effects import find_effect
from motoremi.quantities import show
from motoremi.workers import Map

# What a machine has beside its resonances: a core of iron or ferrite, leads, and terminals if their capacitance shows.
ORDINARY = (("permeability-relaxation", "lead-inductance", "terminal-capacitance"), ("permeability-relaxation", "lead-inductance"))
# Minima of the ordinary parts from which modes are added: which of them is the right one shows only then. Of one winding the best one led to
# 62 %, the others to 2 %.
BEGINNINGS = 3


def machine_with_modes(base: Fit, whole: Candidate | None, each: Map = map, progress: Progress | None = None) -> Candidate | None:
    """The model with the least error of ordinary parts and modes; None if the base has an effect beside which there are no modes.

    Parameters
    ----------
    base : Fit
        Nothing added; its own effects stay.
    whole : Candidate, optional
        The ordinary parts that `whole_machine` found, which are tried too.
    each : callable
        As the built-in `map`.
    progress : callable, optional
    """
    if not find_effect(MODES).fits(base.motor):
        return None
    possible = set(possible_effects(base)) - set(base.effects)
    sets = {tuple(sorted(name for name in names if name in possible)) for names in (*ORDINARY, () if whole is None else whole.added)}
    jobs = [job for names in sorted(sets) if names for job in _beginnings(base, names, each)]
    return candidate(_least(jobs, each, progress).steps[-1], base) if jobs else None


def added_with_modes(base: Fit, names: Effects, each: Map = map, progress: Progress | None = None) -> list[Fit]:
    """Several effects added to a fit at once, and modes beside them as long as they lower the error, as steps of one effect each.

    Raises
    ------
    BadInput
        If an effect is unknown, cannot be added, or is given twice.
    """
    base = in_wider_ranges(base, names)
    best = _least(_beginnings(base, names, each), each, progress)
    return [*falling(base, [*each(on_all_points, best.fewer), best.steps[0]]), *best.steps[1:]]


def machine_in_words(whole: Candidate) -> list[str]:
    """The parts of a machine that were fitted together, with the values that the data determine, and the command that adds them."""
    own = own_labels(whole.fit.effects, whole.added)
    of_modes = [label for label in own if label.startswith(MODES)]
    parameters = whole.fit.parameters
    known = [p for p in whole.fit.motor.parameters if p.name.rpartition(".")[0] in own and whole.fit.determined(p.name)]
    values = ", ".join(f"{p.name} = {show(parameters[p.name], p.unit)}" for p in known if p.name.rpartition(".")[0] not in of_modes)
    resonances = sorted(parameters[f"{label}.resonance_hz"] for label in of_modes)
    said = [f"several parts of the machine show at once; fitted together: {values}"] if values else []
    if resonances:
        listed = ", ".join(show(hertz, "Hz") for hertz in resonances)
        said.append(f"the winding resonates {len(resonances)} times more, which is described without a cause: modes at {listed}")
    return [*said, f"add them to the model: motoremi add SESSION {' '.join(dict.fromkeys(whole.added))}"]


def _beginnings(base: Fit, names: Effects, each: Map) -> list[tuple[Fit, Trail, Solution]]:
    return [(base, *found) for found in nearest(base, names, each)[:BEGINNINGS]]


def _least(jobs: Sequence[tuple[Fit, Trail, Solution]], each: Map, progress: Progress | None) -> _Ladder:
    """Of the ladders with modes from all beginnings the shortest of those that describe enough; the one whose end errs least if none does.

    With more modes any of them errs less, also with modes that describe nothing real.
    """
    beginnings = _unlike(list(each(_begun, jobs)))
    ladders = []
    for ladder in each(_with_modes, beginnings):
        ladders.append(ladder)
        if progress is not None:
            progress("modes of the winding", len(ladders), len(beginnings))
    enough = [ladder for ladder in ladders if ladder.steps[-1].explained]
    return min(enough or ladders, key=lambda ladder: (len(ladder.steps) if enough else 0, ladder.steps[-1].rms_error_percent))


class _Ladder(NamedTuple):
    """A ladder with modes.

    Parameters
    ----------
    fewer : list
        What `on_all_points` takes for the steps to the ordinary parts but the last one. They are not fitted before a ladder is chosen: modes
        begin at the last one, and a diagnosis shows none of them.
    steps : list of Fit
        All ordinary parts, and then one mode more in each.
    """

    fewer: list[tuple[Trail, Solution, Fit]]
    steps: list[Fit]


def _begun(job: tuple[Fit, Trail, Solution]) -> _Ladder:
    """The ordinary parts, fitted on all points."""
    base, trail, end = job
    *fewer, last = by_need(base, (trail, end))
    return _Ladder(fewer, [on_all_points(last)])


def _unlike(ladders: Sequence[_Ladder]) -> list[_Ladder]:
    """Without those whose ordinary parts ended in the minimum of one before: of a measured winding three beginnings of three did."""
    kept: dict[tuple[Effects, str], _Ladder] = {}
    for ladder in ladders:
        end = ladder.steps[-1]
        kept.setdefault((tuple(sorted(end.effects)), f"{end.rms_error_percent:.3g}"), ladder)
    return list(kept.values())


def _with_modes(ladder: _Ladder) -> _Ladder:
    steps = [*ladder.steps, ladder.steps[-1].add(MODES)]
    for portion in further(steps[-1], MODES):
        steps += portion
    return _Ladder(ladder.fewer, steps)
