"""The analyses of a session's spectra: predict, diagnose, add, drop. Results are stored in `analysis/`, as in `workflow`.

The models of source and path form a ladder of their own, the emission's ladder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict, Progress
from motoremi.data.corrections import Corrections
from motoremi.data.session import Session, SessionWriter, load
from motoremi.data.spectrum import Spectrum
from motoremi.emission.background import ambient_of, split
from motoremi.emission.band import BANDS, band_of
from motoremi.emission.diagnose import EmissionDiagnosis, add_effect, diagnose_emission, fit_base
from motoremi.emission.finals import Rules, choose_maxima
from motoremi.emission.judge import EXPANDED_UNCERTAINTY_DB
from motoremi.emission.limit import find_limit
from motoremi.emission.observe import repetition_from
from motoremi.emission.predict import DEFAULT_LIMIT, Prediction, motor_function, predict, refuse_other_unit
from motoremi.emission.setup import Setup, read_setup
from motoremi.emission.source_effects import find_source_effect
from motoremi.emission.spectrum_fit import EmissionFit, restored
from motoremi.emission.spectrum_problem import Problem
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.progress import part
from motoremi.workflow import Store, current_steps

STATE, PREDICTION, DIAGNOSIS, CORRECTIONS = "emission", "prediction", "emission-diagnosis", "corrections"
# Share of the progress that is reserved for the fit of the motor, if that has to be made before the fit of source and path.
MOTOR_FIRST = 0.3


def _state(session: Session) -> JsonDict:
    return session.analysis(STATE) or {"schema": "motoremi.emission/1", "setup": None, "limit": DEFAULT_LIMIT, "steps": []}


def _save(store: Store, state: JsonDict, **new: Any) -> JsonDict:
    state = {**state, **new}
    store.save_analysis(STATE, state)
    return state


def _stated(session: Session) -> Setup:
    """The set-up that was given last; otherwise one with typical values."""
    stored = _state(session)["setup"]
    return Setup() if stored is None else Setup.from_dict(stored)


def limit_of(session: Session) -> str:
    """The limit that was given last, by name or file."""
    return str(_state(session)["limit"])


def setup_of(session: Session) -> Setup:
    """The set-up that was given last; otherwise one from the receiver's settings and the spectra, with typical values for the rest."""
    made = _stated(session)
    running, _ = split(session.corrected_spectra)
    if _state(session)["setup"] is not None or not running:
        return made
    settings = running[0].metadata.get("settings")
    known: Mapping[str, Any] = settings if isinstance(settings, Mapping) else {}
    receiver = replace(made.receiver, band=band_of(running[0].resolution_bandwidth_hz))
    found = {key: float(known[key]) for key in ("dwell_s", "attenuation_db") if isinstance(known.get(key), (int, float))}
    assumed = tuple(part for part in made.assumed if part != "receiver" or not found)
    made = replace(made, receiver=replace(receiver, **found), assumed=assumed)  # type: ignore[arg-type]
    rate = _rate(running)
    return made if rate is None else replace(made, source=replace(made.source, repetition_hz=rate))


def _rate(running: Sequence[Spectrum]) -> float | None:
    by_detector = {spectrum.detector: spectrum for spectrum in running}
    if not {"peak", "average"} <= set(by_detector):
        return None
    return repetition_from(by_detector["peak"], by_detector["average"])


def _motor(store: Store, progress: Progress | None = None) -> Fit:
    """The current model of the motor."""
    _refuse_without_motor(load(store.path))
    return current_steps(store, progress)[-1]


def _refuse_without_motor(session: Session) -> None:
    if not has_motor(session):
        raise BadInput("a prediction needs the open-circuit sweep: the common-mode current flows from the terminals to the frame")


def has_motor(session: Session) -> bool:
    """Whether the session holds the sweep that a prediction needs."""
    return any(sweep.termination == "open" for sweep in session.sweeps)


def _spectra(session: Session) -> tuple[Sequence[Spectrum], Sequence[Spectrum]]:
    """The spectra to which a model is fitted: those of the running motor, and those with the motor off."""
    running, background = split(session.corrected_spectra)
    if not running:
        raise BadInput(f"{session.path.name} holds no spectrum of the running motor")
    if session.corrections.level_unit != "dBuV":
        raise BadInput(f"the model of the spectra predicts voltages, but the corrected levels are in {session.corrections.level_unit}")
    return running, background


def _problem(session: Session, motor: Fit) -> Problem:
    running, background = _spectra(session)
    setup = replace(setup_of(session), corrections=session.corrections)
    return Problem(running, motor_function(motor, setup), setup, ambient_of(background))


def stored_emission_steps(session: Session) -> list[JsonDict]:
    """The stored steps of the emission's ladder; empty before the first fit."""
    return list(_state(session)["steps"])


def emission_ladder(session: Session, motor: Fit) -> list[EmissionFit]:
    """The emission's ladder with the current model of the motor, base first; empty before the first fit."""
    problem = _problem(session, motor)
    return [restored(problem, step) for step in stored_emission_steps(session)]


def emission_steps(store: Store) -> list[EmissionFit]:
    """The emission's ladder, base first; the base is fitted first if there is none."""
    session = load(store.path)
    _spectra(session)  # missing spectra are reported before the motor is fitted
    return emission_ladder(session, _motor(store)) or [fit_source(store)]


def fit_source(store: Store, progress: Progress | None = None) -> EmissionFit:
    """Fit source and path without any effect; the result replaces the emission's ladder."""
    begin = 0.0 if load(store.path).ladder else MOTOR_FIRST
    motor = _motor(store, part(progress, 0, begin))
    session = load(store.path)
    base = fit_base(_problem(session, motor), progress=part(progress, begin, 1))
    save_emission_ladder(store, session, [base])
    return base


def save_emission_ladder(store: Store, session: Session, steps: Sequence[EmissionFit]) -> None:
    """Store the emission's ladder; `session` is the present content of the store."""
    _save(store, _state(session), steps=[step.to_dict() for step in steps])


def has_analyses_of_spectra(session: Session) -> bool:
    """Whether a session has models of source and path, a diagnosis of its spectra, or a verdict on them against a limit."""
    return bool(stored_emission_steps(session) or _computed_of_spectra(session))


def _computed_of_spectra(session: Session) -> list[int]:
    """Sequence numbers of the stored verdicts, predictions and diagnoses of spectra."""
    return [int(one["seq"]) for one in session.used_documents if one["kind"] == "analysis" and one.get("name") in (PREDICTION, DIAGNOSIS)]


def discard_of_other_spectra(writer: SessionWriter) -> None:
    """Withdraw what was computed of a session's spectra, since these have changed; set-up and limit are kept."""
    session = load(writer.path)
    if found := _computed_of_spectra(session):
        writer.emit("withdrawn", name="analyses of the spectra", documents=found, why="the spectra have changed since")
    if stored_emission_steps(session):
        save_emission_ladder(writer, session, [])


def predict_session(
    store: Store,
    setup: Path | None = None,
    limit: str | None = None,
    expanded_uncertainty_db: float | None = None,
    corrections: Corrections | None = None,
    with_model: bool = True,
    guard_band_db: float | None = None,
) -> Prediction:
    """The spectrum predicted from the source and the fitted motor, and the verdict on the measured levels.

    A set-up, a limit, an uncertainty, a guard band or corrections given here are stored for later calls; the corrections replace those with which
    the session was made. Without an open-circuit sweep, or if `with_model` is False, only the measured levels are judged.

    Raises
    ------
    BadInput
        If they do not fit each other or the session, which is then unchanged.
    """
    session = load(store.path)
    alone = bool(session.spectra) and not (with_model and has_motor(session))
    if not alone:
        _refuse_without_motor(session)
    state = _state(session)
    chosen_limit = find_limit(limit if limit is not None else state["limit"])
    refuse_other_unit(corrections if corrections is not None else session.corrections, chosen_limit)
    uncertainty_db = expanded_uncertainty_db if expanded_uncertainty_db is not None else state.get("uncertainty_db", EXPANDED_UNCERTAINTY_DB)
    guard_db = guard_band_db if guard_band_db is not None else state.get("guard_band_db")
    if setup is not None:
        state = {**state, "setup": read_setup(setup).to_dict(), "steps": []}
    if corrections is not None:
        for spectrum in (*session.spectra, *session.finals):
            corrections.corrected_spectrum(spectrum)
        store.save_analysis(CORRECTIONS, {"schema": "motoremi.corrections/1", "corrections": corrections.to_list()})
        state = {**state, "steps": []}
    state = _save(store, state, limit=limit if limit is not None else state["limit"], uncertainty_db=uncertainty_db, guard_band_db=guard_db)
    session = load(store.path)
    motor, stated = (None, _stated(session)) if alone else (_motor(store), setup_of(session))
    effects: tuple[str, ...] = ()
    if state["steps"] and not alone:
        top = emission_steps(store)[-1]
        stated, effects = top.setup(), top.effects
    result = predict(
        motor,
        stated,
        session.spectra,
        chosen_limit,
        expanded_uncertainty_db=uncertainty_db,
        effects=effects,
        corrections=session.corrections,
        finals=session.finals,
        guard_band_db=guard_db,
    )
    store.save_analysis(PREDICTION, result.to_dict())
    return result


def choose_finals(
    store: Store, limit: str, margin: float, maxima: int, apart: float, subranges: int, detectors: Sequence[str] = (), dwell: float = 0.0
) -> JsonDict:
    """The maxima of the session's scans that the step `final` of a procedure has to measure again."""
    session = load(store.path)
    chosen, more = choose_maxima(session.corrected_spectra, find_limit(limit), Rules(margin, maxima, apart, subranges))
    return {"maxima": [one.to_dict() for one in chosen], "more": more, "limit": limit}


def judged(store: Store, limit: str, uncertainty: float | None = None, guard_band: float | None = None) -> JsonDict:
    """The verdict on the measured levels, with all reasons; a prediction is stored as well if a model of the motor has been fitted."""
    session = load(store.path)
    with_model = bool(session.ladder) and all(_has_band(spectrum) for spectrum in session.spectra)
    result = predict_session(store, limit=limit, expanded_uncertainty_db=uncertainty, with_model=with_model, guard_band_db=guard_band)
    decided = [one for one in result.judged if one.verdict is not None and one.worst_margin_db is not None]
    worst = min(decided, key=lambda one: one.worst_margin_db or 0.0, default=None)
    least = f"{worst.what}: {worst.why}" if worst is not None else "no level can be compared with it"
    doubt = ", values NOT CONFIRMED" if result.limit.unconfirmed else ""
    against = f"{result.limit.title}{doubt} (guard band {result.guard_band_db:.3g} dB)"
    says = f"{result.verdict}, {against}: {'; '.join(result.reasons) or least}"
    return {"verdict": result.verdict, "says": says, "reasons": list(result.reasons), "remarks": result.limit.remarks()}


def _has_band(spectrum: Spectrum) -> bool:
    """Whether the receiver's model has the bandwidth of a spectrum."""
    return any(band.accepts(spectrum.resolution_bandwidth_hz) for band in BANDS)


def diagnose_emission_session(store: Store, from_base: bool = False, progress: Progress | None = None) -> EmissionDiagnosis:
    """Find the missing effect of source or path, starting from the last step of the emission's ladder or from its base."""
    steps = emission_steps(store)
    result = diagnose_emission(steps[0].problem, steps[0] if from_base else steps[-1], progress)
    store.save_analysis(DIAGNOSIS, result.to_dict())
    return result


def add_source_effects(store: Store, names: Sequence[str]) -> tuple[EmissionFit, EmissionFit]:
    """Add effects of source or path to the emission's ladder, one step each; returns the model before and after all of them."""
    steps = emission_steps(store)
    before = last = steps[-1]
    for name in names:
        find_source_effect(name)
        if name in last.effects:
            raise BadInput(f"{name} is in the model already; drop it first or add another effect")
        last = add_effect(last.problem, last, name)
        steps.append(last)
    save_emission_ladder(store, load(store.path), steps)
    return before, last


def drop_source_effect(store: Store) -> tuple[EmissionFit, EmissionFit]:
    """Remove the last step of the emission's ladder; returns the model before and after."""
    steps = emission_steps(store)
    if len(steps) < 2:
        raise BadInput("the emission's ladder has no effect to drop")
    save_emission_ladder(store, load(store.path), steps[:-1])
    return steps[-1], steps[-2]


def emission_story(store: Store) -> JsonDict:
    """Fit the source, diagnose, add the named effects, predict: the results on the spectrum that `motoremi demo` prints."""
    base = emission_steps(store)[-1]
    found, last = diagnose_emission_session(store), base
    if found.effects:
        _, last = add_source_effects(store, found.effects)
    prediction = predict_session(store)
    return {
        "verdict": found.verdict,
        "named": list(found.effects),
        "families": [list(family) for family in found.families],
        "confidence": found.confidence,
        "reasons": list(found.reasons),
        "observations": [str(one["text"]) for one in found.seen],
        "error_before_db": base.rms_error_db,
        "error_after_db": last.rms_error_db,
        "limit": prediction.limit.title,
        "limit_verdict": prediction.verdict,
        "next": str(found.following["why"]),
    }
