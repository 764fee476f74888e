"""The analyses of a session for commands, procedures and the workbench: fit, compare, diagnose, add, drop, report.

Each function reads the session folder, computes, and stores its result in `analysis/`; nothing is kept in memory between calls, so a
command, a bench run and a page can work on one session in turn.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.data.measurement import Measurement
from motoremi.data.session import Session, load, reopen
from motoremi.data.storage import write_whole
from motoremi.diagnosis.diagnosis import Diagnosis, diagnose
from motoremi.diagnosis.ladder_step import further, ladder_step
from motoremi.diagnosis.machine_modes import added_with_modes
from motoremi.diagnosis.whole_machine import added_near, added_together
from motoremi.errors import BadInput
from motoremi.fitting.fit import checked_held, fit
from motoremi.fitting.known import Known, also_from
from motoremi.fitting.result import Fit, restore, same_error_model
from motoremi.fitting.seen_by import MODES
from motoremi.inspection.compare import Comparison, Tolerance, compare
from motoremi.inspection.effect_signature import Signature, signature
from motoremi.inspection.element import Inspection, inspect
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.effects.names import as_sum
from motoremi.model.motor import Motor, dc_motor
from motoremi.progress import part
from motoremi.quantities import parse, percent
from motoremi.workers import Map, own_processes

if TYPE_CHECKING:
    from motoremi.report.contents import Choice, Materials


# Share of the progress of a diagnosis that is reserved for a first fit.
FITTING = 0.1
# Effects are added with the values of the diagnosis if the error is then no more than this many times the diagnosed one.
AS_DIAGNOSED = 1.1


class Store(Protocol):
    """An open session, in which results are stored."""

    path: Path

    def save_analysis(self, name: str, payload: Mapping[str, Any]) -> Path:
        """Store `analysis/<name>.json`."""
        ...

    def save_file(self, relative_path: str, data: bytes) -> Path:
        """Store a file."""
        ...


def opened(path: Path) -> AbstractContextManager[Store]:
    """A finished session, open for more analyses."""
    return reopen(path)


def measurement_of(session: Session) -> Measurement:
    """The session's sweeps, ready to be fitted."""
    if not session.sweeps:
        raise BadInput(f"{session.path.name} holds no impedance sweep: there is nothing to fit")
    return Measurement.of((*session.corrected_sweeps, *session.corrected_conditioned), values=session.values)


def ladder_of(session: Session) -> list[Fit]:
    """The models of the session's ladder, base first; empty before the first fit, or if they were fitted with another error model."""
    if not session.ladder:
        return []
    measurement = measurement_of(session)
    fits = [step.get("fit", {}) for step in session.ladder]
    # Sweeps between two ports, and reflections of an analyser without a name, were once fitted as those of an impedance analyser: their evidence
    # does not compare.
    if any(not same_error_model(one, measurement) for one in fits):
        return []
    return [restore(one, measurement) for one in fits]


def model_of(session: Session) -> Motor:
    """The current model, the last step of the ladder; the paper's circuit if there is no ladder that this version can read."""
    return add_effects(dc_motor(), session.ladder[-1].get("fit", {}).get("effects", []) if session.ladder else [])


def fit_session(
    store: Store,
    method: str = "ant-colony",
    seed: int = 1,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    held: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Fit the current model (the paper's circuit at first) and every step of the ladder below it.

    What the session knows of these models is where the search starts from as well, so that no step becomes worse.

    Parameters
    ----------
    seed : int
        Of the search. A known solution that is better than what it finds stays.
    held : mapping, optional
        Values that are not fitted, in place of those of the last fit; None: those of the last fit.
    """
    session = load(store.path)
    measurement, model = measurement_of(session), model_of(session)
    if held is None:
        names = {parameter.name for parameter in model.parameters}
        held = {name: value for name, value in session.held.items() if name in names}
    fixed = checked_held(model, held)
    own = {parameter.name for parameter in dc_motor().parameters}
    count = 1 + len(model.effects)
    base_held = {n: v for n, v in fixed.items() if n in own}
    base = fit(dc_motor(), measurement, seed=seed, method=method, bounds=bounds, held=base_held, progress=part(progress, 0, 1 / count))
    # The paper's algorithm is to be seen as it is.
    steps = [base if method == "paper" else also_from(base, known_solutions(session, (), measurement), base_held)]
    for effect in model.effects:
        if progress is not None:
            progress(f"with {effect}", len(steps), count)
        before = {parameter.name for parameter in steps[-1].motor.parameters}
        new = {parameter.name for parameter in find_effect(effect).added_to(steps[-1].motor).parameters} - before
        anew = steps[-1].add(effect, {n: v for n, v in fixed.items() if n in new})
        steps.append(also_from(anew, known_solutions(session, anew.effects, measurement), fixed))
    save_ladder(store, steps, held=fixed)
    return steps[-1]


def known_solutions(session: Session, effects: Sequence[str], measurement: Measurement) -> list[Known]:
    """What the steps of the ladder and the diagnosis of a session say of the model with these effects, in whatever order they were added."""
    diagnosed = (session.analysis("diagnosis") or {}).get("best")
    stored = [step.get("fit", {}) for step in session.ladder]
    records = [one for one in (*stored, diagnosed) if isinstance(one, dict) and sorted(one.get("effects", ["?"])) == sorted(effects)]
    return [known for one in records if (known := _known(one, measurement)) is not None]


def _known(record: JsonDict, measurement: Measurement) -> Known | None:
    """A stored solution; None if this version cannot read it. A diagnosis holds values only, a step of the ladder the whole fit."""
    try:
        values = {str(name): float(one["value"] if isinstance(one, dict) else one) for name, one in record["parameters"].items()}
        if not np.isfinite(list(values.values())).all():
            return None
        if "sizes" not in record or not same_error_model(record, measurement):
            return Known(values)
        stored = restore(record, measurement)
    except (BadInput, KeyError, TypeError, ValueError, AttributeError):
        return None
    return Known({**stored.parameters, **stored.nuisance}, stored)


class Refitted(NamedTuple):
    """What a new fit changed in a session that had one.

    Parameters
    ----------
    released : dict
        Values that the fit before held, and that are fitted now, by name.
    unbounded : dict
        Bounds of elements in the fit before, in SI units, that apply no longer, by name.
    errors : tuple of (str, float, float)
        The steps of the ladder whose error changed: the model, and its error in percent before and after.
    """

    released: dict[str, float]
    unbounded: dict[str, tuple[float, float]]
    errors: tuple[tuple[str, float, float], ...]

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "released": self.released,
            "unbounded": {name: list(pair) for name, pair in self.unbounded.items()},
            "ladder_changes": [{"model": model, "before_percent": before, "after_percent": after} for model, before, after in self.errors],
        }


def refitted(before: Session, after: Session) -> Refitted:
    """Compare the holds and the ladder of a session before and after a fit."""
    known = {parameter.name for parameter in model_of(after).parameters}
    errors = []
    for old, new in zip((step.get("fit", {}) for step in before.ladder), (step["fit"] for step in after.ladder), strict=False):
        error, now = float(old.get("rms_error_percent", np.nan)), float(new["rms_error_percent"])
        if old.get("effects") == new["effects"] and np.isfinite(error) and percent(error, 4) != percent(now, 4):
            errors.append((f"the circuit with {as_sum(new['effects'])}" if new["effects"] else "the paper's circuit", error, now))
    released = {name: value for name, value in before.held.items() if name in known and name not in after.held}
    kept = _stated_bounds(after)
    unbounded = {name: pair for name, pair in _stated_bounds(before).items() if name not in kept and name not in after.held}
    return Refitted(released, unbounded, tuple(errors))


def _stated_bounds(session: Session) -> dict[str, tuple[float, float]]:
    """The bounds of elements in the session's fit of the paper's circuit, which only the user states."""
    stored = session.ladder[0].get("fit", {}).get("bounds", {}) if session.ladder else {}
    return {str(name): (float(low), float(high)) for name, (low, high) in stored.items()}


def save_ladder(store: Store, steps: Sequence[Fit], kept: int = 0, held: Mapping[str, float] | None = None) -> None:
    """Store the ladder: each model, its error per band, and what changed; the first `kept` steps are not changed.

    Parameters
    ----------
    held : mapping, optional
        Values that the user holds; None: as before.
    """
    session = load(store.path)
    dc_resistance_ohm = _dc_resistance_ohm(session)
    new = [ladder_step(steps[index - 1] if index else None, steps[index], dc_resistance_ohm).to_dict() for index in range(kept, len(steps))]
    user_held = {name: value for name, value in (session.held if held is None else held).items() if name in steps[-1].held}
    store.save_analysis("ladder", {"schema": "motoremi.ladder/1", "held": user_held, "steps": [*session.ladder[:kept], *new]})


def _dc_resistance_ohm(session: Session) -> float | None:
    """The winding's DC resistance, if the file of a sweep states it: `# dc_resistance_ohm: 1.25`."""
    stated = next((sweep.metadata["dc_resistance_ohm"] for sweep in session.sweeps if "dc_resistance_ohm" in sweep.metadata), None)
    if stated is None:
        return None
    value = parse(str(stated), "Ohm")
    if value <= 0:
        raise BadInput(f"dc_resistance_ohm must be above 0, got {stated}")
    return value


def current_steps(store: Store, progress: Progress | None = None) -> list[Fit]:
    """The ladder; the paper's circuit is fitted first if there is none."""
    steps = ladder_of(load(store.path))
    return steps or [fit_session(store, progress=progress)]


def compare_session(store: Store, tolerance: Tolerance | None = None) -> Comparison:
    """Compare the current model with the sweeps; without a tolerance, with the one used last."""
    steps = current_steps(store)
    if tolerance is None or not tolerance.judges:
        tolerance = stored_tolerance(load(store.path))
    result = compare(steps[-1], tolerance)
    store.save_analysis("comparison", result.to_dict())
    return result


def stored_tolerance(session: Session) -> Tolerance | None:
    """The tolerance of the last comparison."""
    stored = session.analysis("comparison")
    try:
        return None if stored is None else Tolerance(**stored["tolerance"])
    except (KeyError, TypeError) as error:
        raise BadInput(f"the stored comparison cannot be read by this version: motoremi compare {session.path} --error-percent 5") from error


def diagnose_session(store: Store, start: Literal["ladder", "base"] = "ladder", progress: Progress | None = None) -> Diagnosis:
    """Find the missing effect, starting from the current model or from the paper's circuit."""
    steps = current_steps(store, part(progress, 0, FITTING))
    result = diagnose(steps[-1] if start == "ladder" else steps[0], part(progress, FITTING, 1))
    store.save_analysis("diagnosis", result.to_dict())
    return result


def inspect_session(store: Store, element: str) -> Inspection:
    """The value that an element of the current model would need at each frequency for the model to be exact."""
    return inspect(current_steps(store)[-1], element)


def signature_on(store: Store, effect: str) -> Signature:
    """The signature of an effect on the session's motor, in addition to the effects of the current model."""
    return signature(current_steps(store)[-1], effect)


def diagnosis_in(session: Session) -> JsonDict:
    """The stored diagnosis.

    Raises
    ------
    BadInput
        If there is none yet.
    """
    stored = session.analysis("diagnosis")
    if stored is None:
        raise BadInput(f"{session.path.name} has no diagnosis yet: motoremi diagnose {session.path}")
    return stored


def add_to_session(store: Store, effect: str, progress: Progress | None = None) -> tuple[Fit, Fit]:
    """Add an effect to the current model; returns the model before and after.

    A descriptive effect (modes of a winding) is added repeatedly, each time as a step of the ladder, as long as the error decreases by more
    than chance would explain.
    """
    find_effect(effect)  # a wrong name is reported before anything is fitted
    steps = current_steps(store)
    ladder = [*steps, _no_worse_than_known(load(store.path), steps[-1].add(effect))]
    save_ladder(store, ladder, kept=len(steps))
    for portion in further(ladder[-1], effect, progress):
        ladder += portion
        save_ladder(store, ladder, kept=len(ladder) - len(portion))
    return steps[-1], ladder[-1]


def add_several_to_session(store: Store, effects: Sequence[str], progress: Progress | None = None) -> tuple[Fit, Fit]:
    """Add several effects to the current model, fitted at once; returns the model before and after. The ladder gets a step for each.

    If modes of the winding are among them, as many are added beside the others as lower the error by more than chance would explain.
    """
    if len(set(effects)) < len(effects):
        raise BadInput("an effect is named twice: add it once more afterwards")
    add_effects(dc_motor(), list(effects))  # a wrong name is reported before anything is fitted
    steps = current_steps(store, part(progress, 0, FITTING))
    add_effects(steps[-1].motor, list(effects))
    if progress is not None:
        progress(" + ".join(effects), 1, 2)
    together = tuple(effect for effect in effects if effect != MODES)
    with own_processes() as each:
        added = _as_diagnosed(store, steps[-1], effects, each)
        if added is None and MODES in effects:
            added = added_with_modes(steps[-1], together, each, part(progress, FITTING, 1))
        elif added is None:
            *fewer, last = added_together(steps[-1], together, each)
            added = [*fewer, _no_worse_than_known(load(store.path), last)]
    ladder = [*steps, *added]
    save_ladder(store, ladder, kept=len(steps))
    return steps[-1], ladder[-1]


def _no_worse_than_known(session: Session, fitted: Fit) -> Fit:
    """A new step of the ladder, or the same from the values of the diagnosis, if that is better."""
    return also_from(fitted, known_solutions(session, fitted.effects, fitted.measurement), session.held)


def _as_diagnosed(store: Store, fit: Fit, effects: Sequence[str], each: Map) -> list[Fit] | None:
    """The steps with the values of the stored diagnosis; None if that is not of these effects on this model, or they do not lead to its error."""
    stored = load(store.path).analysis("diagnosis") or {}
    best = stored.get("best", {})
    added = tuple(best.get("effects", ())[len(fit.effects) :])
    if stored.get("base", {}).get("effects") != list(fit.effects) or set(added) != set(effects) or "parameters" not in best:
        return None
    steps = added_near(fit, added, best["parameters"], each)
    return steps if steps[-1].rms_error_percent <= AS_DIAGNOSED * best["rms_error_percent"] else None


def drop_from_session(store: Store) -> tuple[Fit, Fit]:
    """Remove the last step of the ladder; returns the model before and after."""
    steps = current_steps(store)
    if len(steps) < 2:
        raise BadInput("the current model is the paper's circuit: there is no effect to drop")
    save_ladder(store, steps[:-1], kept=len(steps) - 1)
    return steps[-1], steps[-2]


def materials_of(session: Session) -> Materials:
    """The inputs of a report of the session."""
    from motoremi.report.contents import Materials

    steps = ladder_of(session)
    comparison = compare(steps[-1], stored_tolerance(session)) if steps else None
    return Materials(session, tuple(steps), comparison, session.analysis("diagnosis"))


def report_session(store: Store, profile: Path | None = None, choice: Choice | None = None, progress: Progress | None = None) -> list[Path]:
    """Render the report in all formats into the session's `report/` folder.

    Parameters
    ----------
    store : Store
    profile : Path, optional
        Profile of the laboratory that signs; it is stored in the session and used for later reports as well.
    choice : Choice, optional
        Form and sections; by default the long form with all sections.
    progress : callable, optional
    """
    from motoremi.report.model import WHOLE
    from motoremi.report.renderings import render_session
    from motoremi.workflow_issue import ISSUE, LABORATORY, issue_for, stored_laboratory

    session = load(store.path)
    laboratory, issue = issue_for(session, profile)
    files = render_session(replace(materials_of(session), laboratory=laboratory, issue=issue), choice or WHOLE, progress)
    if laboratory is not None and issue is not None and issue != session.analysis(ISSUE):
        store.save_analysis(LABORATORY, stored_laboratory(laboratory))
        store.save_analysis(ISSUE, issue)
    return [store.save_file(name, data) for name, data in files.items()]


def report_together(paths: Sequence[Path], out: Path) -> list[Path]:
    """Write the comparison of several sessions, each with the first, into a folder; the sessions are not changed.

    Raises
    ------
    BadInput
        For one session alone, too many, or two of one name.
    """
    from motoremi.report.renderings import reported_as_unreadable
    from motoremi.report.several_sessions import build_together, render_together

    # The folder's own name, also for `.` or a path that ends in a slash.
    named = {path.resolve().name: path for path in paths}
    if len(named) < len(paths):
        raise BadInput("two of these sessions have the same name: rename one folder, so that the report can distinguish them")
    materials = {name: materials_of(load(path)) for name, path in named.items()}
    with reported_as_unreadable("one of these sessions"):
        files = render_together(build_together(materials))
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(f"cannot make the folder {out}: {error.strerror}") from error
    for name, data in files.items():
        write_whole(out / name, data)
    return [out / name for name in files]
