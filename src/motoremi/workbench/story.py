"""The data of the view Story: curves, error, ladder, effects and the next step, in one format for sweeps and for spectra.

Nothing is computed here: the models' own packages do that, and each `Side` brings their results into the common format.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.session import Session
from motoremi.data.sweep import RepeatedSweep
from motoremi.diagnosis.candidates import possible_effects
from motoremi.diagnosis.ladder_step import accumulates
from motoremi.emission.source_effects import source_effects
from motoremi.emission.spectrum_fit import EmissionFit
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect, identifiers
from motoremi.workbench.challenge_view import is_open_challenge
from motoremi.workbench.desk import Desk
from motoremi.workbench.ladder import Ladder
from motoremi.workbench.thinning import Band, seen
from motoremi.workbench.views import diagnosis, readable, resumable, rounded, step_of
from motoremi.workflow_emission import DIAGNOSIS, PREDICTION

Of: TypeAlias = Literal["impedance", "emission"]
# What a curve means; the page chooses how it is drawn.
Role: TypeAlias = Literal["measured", "model", "preview", "floor", "tolerance", "fails"]
Curves: TypeAlias = Mapping[Role, tuple[str, FloatArray]]
# Verdicts after which the motor is still unexplained.
UNEXPLAINED = ("unexplained", "data")
ENTRY = ("title", "group", "formula", "signature", "deciding", "source")


class Side(ABC):
    """One side of a session: its sweeps or its spectra.

    Parameters
    ----------
    desk : Desk
    band_hz : tuple of float, optional
        The span that the plots are zoomed to.
    """

    of: Of
    # Name of the stored diagnosis.
    diagnosed_as: str
    fit_text: str
    unit: str

    def __init__(self, desk: Desk, band_hz: Band | None = None) -> None:
        self.desk = desk
        self.band_hz = band_hz

    @property
    @abstractmethod
    def ladder(self) -> Ladder[Any]:
        """The models of this side."""

    @property
    @abstractmethod
    def measured(self) -> bool:
        """Whether the session holds measurements of this side."""

    @property
    def modelled(self) -> bool:
        """Whether a model of them is possible."""
        return self.measured

    @abstractmethod
    def step(self, fit: Any) -> JsonDict:
        """One model: the effect added last, its error and the floor, in `unit`."""

    @abstractmethod
    def panels(self) -> list[JsonDict]:
        """Curves of the measurement and of the current model."""

    @abstractmethod
    def preview(self, now: Any, after: Any) -> list[list[list[float | None]]]:
        """The curves of the model with one more effect, one for each frame of each panel."""

    @abstractmethod
    def catalogue(self) -> list[JsonDict]:
        """The effects that can be added, and those in the model."""

    @abstractmethod
    def next_after(self) -> JsonDict | None:
        """The step between a complete explanation and the report, if there is one."""

    def _unexplained(self, name: str, title: str, unit: str, frequency_hz: FloatArray, values: FloatArray, log: bool = False) -> JsonDict:
        """A measured curve, before the first fit."""
        kept = seen(frequency_hz, values, band_hz=self.band_hz)
        return _panel(name, frequency_hz, kept, [_frame(title, unit, {"measured": ("measured", values[kept])}, log)])


class Sweeps(Side):
    """The impedance sweeps."""

    of = "impedance"
    diagnosed_as = "diagnosis"
    fit_text = "Fit the paper's circuit"
    unit = "%"

    @property
    def ladder(self) -> Ladder[Fit]:
        return self.desk

    @property
    def measured(self) -> bool:
        return bool(self.desk.session.sweeps)

    def step(self, fit: Fit) -> JsonDict:
        return {**_step(fit, fit.rms_error_percent, fit.floor_percent), "beside": step_of(fit)["beside"], "converged": fit.converged}

    def panels(self) -> list[JsonDict]:
        if not self.desk.steps:
            first = {sweep.termination: sweep for sweep in reversed(self.desk.session.corrected_sweeps)}
            return [
                self._unexplained(name, "magnitude |Z|", "Ω", one.frequency_hz, np.abs(one.impedance_ohm), log=True)
                for name, one in reversed(first.items())
            ]
        top = self.desk.top
        errors, comparison = top.errors(), self.desk.comparison(top)
        limit = comparison.tolerance.error_percent
        panels = []
        for sweep in top.measurement.sweeps:
            kept = self._seen_of(sweep, errors[sweep.termination])
            ratio, curve = 1 + errors[sweep.termination][kept], comparison.curves[sweep.termination]
            magnitude = np.abs(sweep.mean_ohm[kept])
            judged: dict[Role, tuple[str, FloatArray]] = {
                "model": ("error", curve.error_percent[kept]),
                "floor": ("uncertainty", curve.uncertainty_percent[kept]),
            }
            if limit is not None:
                judged["tolerance"] = ("tolerance", np.full(magnitude.shape, limit))
            judged["fails"] = ("fails", np.where(curve.fails, curve.error_percent, np.nan)[kept])
            frames = [
                _frame("magnitude |Z|", "Ω", {"measured": ("measured", magnitude), "model": ("model", magnitude * np.abs(ratio))}, log=True),
                _frame(
                    "measured over model",
                    "dB",
                    {"measured": ("measured over model", -20 * np.log10(np.abs(ratio))), "model": ("", np.zeros(magnitude.shape))},
                ),
                _frame("error", "%", judged, log=True),
            ]
            panels.append(_panel(sweep.termination, sweep.frequency_hz, kept, frames))
        return panels

    def preview(self, now: Fit, after: Fit) -> list[list[list[float | None]]]:
        before_error, after_error = now.errors(), after.errors()
        panels = []
        for sweep in now.measurement.sweeps:
            kept = self._seen_of(sweep, before_error[sweep.termination])
            ratio = np.abs(1 + after_error[sweep.termination][kept])
            given_db = 20 * np.log10(ratio / np.abs(1 + before_error[sweep.termination][kept]))
            error_percent = 100 * np.abs(after_error[sweep.termination][kept])
            panels.append([rounded(np.abs(sweep.mean_ohm[kept]) * ratio), rounded(given_db), rounded(error_percent)])
        return panels

    def catalogue(self) -> list[JsonDict]:
        if not self.desk.steps:
            return []
        top = self.desk.top
        # Effects that only describe are never named as a cause, but a user may add them.
        described = [name for name in identifiers() if find_effect(name).effect.describes and find_effect(name).fits(top.motor)]
        possible = (*possible_effects(top), *described)
        named = dict.fromkeys((*possible, *top.effects))
        return [{**entry_of(find_effect(name).effect, name, name in possible), "accumulates": accumulates(name)} for name in named]

    def next_after(self) -> JsonDict | None:
        spectra = Spectra(self.desk)
        begun = spectra.ladder.steps if spectra.modelled else self.desk.session.analysis(PREDICTION)
        return {"do": "turn", "text": "Go on to the spectra"} if spectra.measured and not begun else None

    def _seen_of(self, sweep: RepeatedSweep, error: ComplexArray) -> NDArray[np.intp]:
        """The points that are shown, the same with and without another effect."""
        magnitude = np.abs(sweep.mean_ohm)
        return seen(sweep.frequency_hz, magnitude, magnitude * np.abs(1 + error), np.abs(error), band_hz=self.band_hz)


class Spectra(Side):
    """The spectra of the conducted emission."""

    of = "emission"
    diagnosed_as = DIAGNOSIS
    fit_text = "Fit source and path"
    unit = "dB"

    @property
    def ladder(self) -> Ladder[EmissionFit]:
        return self.desk.source

    @property
    def measured(self) -> bool:
        return any(not one.is_background for one in self.desk.session.spectra)

    @property
    def modelled(self) -> bool:
        return self.desk.source.possible

    def step(self, fit: EmissionFit) -> JsonDict:
        return {**_step(fit, fit.rms_error_db, fit.floor_db), "beside": [], "converged": True}

    def panels(self) -> list[JsonDict]:
        if not self.ladder.steps:
            running = [one for one in self.desk.session.corrected_spectra if not one.is_background]
            return [self._unexplained(one.detector, "level", "dBµV", one.frequency_hz, one.level_dbuv) for one in running]
        top = self.ladder.top
        panels = []
        for detector, (frequency_hz, error_db) in top.error_db().items():
            measured, sigma_db = top.problem.measured_dbuv[top.problem.where[detector]], top.problem.sigma_db[top.problem.where[detector]]
            kept = seen(frequency_hz, measured, band_hz=self.band_hz)
            error_db, measured, sigma_db = error_db[kept], measured[kept], sigma_db[kept]
            frames = [
                _frame("level", "dBµV", {"measured": ("measured", measured), "model": ("model", measured - error_db)}),
                _frame("error", "dB", {"model": ("error", np.abs(error_db)), "floor": ("scatter and formulas", sigma_db)}),
            ]
            panels.append(_panel(detector, frequency_hz, kept, frames))
        return panels

    def preview(self, now: EmissionFit, after: EmissionFit) -> list[list[list[float | None]]]:
        panels = []
        for detector, (frequency_hz, error_db) in after.error_db().items():
            measured = after.problem.measured_dbuv[after.problem.where[detector]]
            kept = seen(frequency_hz, measured, band_hz=self.band_hz)
            panels.append([rounded(measured[kept] - error_db[kept]), rounded(np.abs(error_db[kept]))])
        return panels

    def catalogue(self) -> list[JsonDict]:
        effects = self.ladder.top.effects if self.ladder.steps else ()
        return [entry_of(effect, effect.name, effect.name not in effects) for effect in source_effects()]

    def next_after(self) -> JsonDict | None:
        stored = self.desk.session.analysis(PREDICTION)
        if stored is not None and stored.get("effects") == list(_effects(self.ladder.steps)):
            return None
        return {"do": "predict", "text": "Judge against the limit"}


SIDES: Mapping[str, type[Side]] = {"impedance": Sweeps, "emission": Spectra}


def side(desk: Desk, of: str, band_hz: Band | None = None) -> Side:
    """One side of a session by name; without a name, or where nothing of that kind was measured, the one that was."""
    if not of or (of in SIDES and not SIDES[of](desk).measured):
        of = next((name for name, kind in SIDES.items() if kind(desk).measured), "impedance")
    if of not in SIDES:
        raise BadInput(f"there is no story of that name; choose one of {', '.join(SIDES)}")
    return SIDES[of](desk, band_hz)


def story(desk: Desk, of: str, state: str, band_hz: Band | None = None) -> JsonDict:
    """All data of the view.

    Parameters
    ----------
    desk : Desk
    of : str
        "impedance", "emission", or empty.
    state : str
        The session's state, as in the list of sessions.
    band_hz : tuple of float, optional
        The span that the plots are zoomed to.
    """
    chosen = side(desk, of, band_hz)
    steps = chosen.ladder.steps
    found, stored = _found(chosen)
    explained = readable(lambda: _explained(stored, _effects(steps)))
    data = {
        "of": chosen.of,
        "sides": [name for name, kind in SIDES.items() if kind(desk).measured],
        "unit": chosen.unit,
        "modelled": chosen.modelled,
        "sealed": is_open_challenge(desk.session),
        "standing": chosen.ladder.standing,
        "ladder": [chosen.step(step) for step in steps],
        "dropped": [chosen.step(step) for step in chosen.ladder.dropped],
        "in_model": list(_effects(steps)),
        "panels": chosen.panels() if chosen.measured else [],
        "catalogue": chosen.catalogue(),
        "diagnosis": found,
        "current": stored is not None and _base(stored) == _effects(steps),
        "fit": chosen.fit_text,
    }
    coming = _next(chosen, stored, explained, state)
    return {**data, "next": coming, "stages": _stages(chosen, stored, explained, coming)}


def panels(desk: Desk, of: str, band_hz: Band | None) -> JsonDict:
    """The curves alone, for a zoomed plot."""
    return {"panels": side(desk, of, band_hz).panels()}


def look(desk: Desk, of: str, effect: str, shown: str | None = None, band_hz: Band | None = None) -> JsonDict:
    """A preview of an effect: the curves of the model with it, and the error before and after; superseded if the ladder is not the shown one."""
    chosen = side(desk, of, band_hz)
    glanced = chosen.ladder.glance(effect, shown)
    if glanced is None:
        return {"superseded": True}
    now, after = glanced
    return {"effect": effect, "before": chosen.step(now), "after": chosen.step(after), "panels": chosen.preview(now, after)}


def entry_of(effect: Any, name: str, possible: bool) -> JsonDict:
    """An effect of either catalogue, for display; `possible` if it can be added to the current model."""
    family, texts = getattr(effect, "family", effect.group), {key: getattr(effect, key) for key in ENTRY}
    return {"id": name, "family": family, **texts, "look_alikes": list(effect.look_alikes), "possible": possible}


def _step(fit: Fit | EmissionFit, error: float, floor: float) -> JsonDict:
    return {"added": fit.effects[-1] if fit.effects else "", "effects": list(fit.effects), "error": error, "floor": floor}


def _panel(name: str, frequency_hz: FloatArray, kept: NDArray[np.intp], frames: list[JsonDict]) -> JsonDict:
    return {"name": name, "points": len(frequency_hz), "frequency_hz": rounded(frequency_hz[kept]), "frames": frames}


def _frame(title: str, unit: str, curves: Curves, log: bool = False) -> JsonDict:
    series = [{"role": role, "label": label, "values": rounded(values)} for role, (label, values) in curves.items()]
    return {"title": title, "unit": unit, "log": log, "series": series}


def _effects(steps: Sequence[Any]) -> tuple[str, ...]:
    return tuple(steps[-1].effects) if steps else ()


def _found(chosen: Side) -> tuple[JsonDict | None, JsonDict | None]:
    """The diagnosis, prepared for display and as stored."""
    session = chosen.desk.session
    stored = None if is_open_challenge(session) else session.analysis(chosen.diagnosed_as)
    if stored is None:
        return None, None
    return diagnosis(stored), stored


def _base(stored: JsonDict) -> tuple[str, ...]:
    return tuple(stored["base"]["effects"])


def _explained(stored: JsonDict | None, effects: tuple[str, ...]) -> bool | None:
    """Whether the model contains the effects that the diagnosis named; None if it contains others as well, or if there is no diagnosis."""
    if stored is None:
        return None
    base, named = _base(stored), set(stored["effects"])
    added, alike = set(effects[len(base) :]), {name for family in stored["families"] for name in family}
    if effects[: len(base)] != base or not added <= named | alike:
        return None
    return len(added) >= len(named)


def _next(chosen: Side, stored: JsonDict | None, explained: bool | None, state: str) -> JsonDict:
    """The next step, for the primary button."""
    desk, session = chosen.desk, chosen.desk.session
    if state == "measuring":
        return {"do": "go", "view": "bench", "text": "Watch the run"}
    if resumable(session) and not chosen.ladder.steps:
        return {"do": "resume", "text": "Resume the run"}
    if not chosen.measured:
        return {"do": "go", "view": "bench", "text": "Measure on the bench"}
    if not chosen.modelled:
        return chosen.next_after() or _report(session)
    if not chosen.ladder.steps:
        return {"do": "fit", "text": chosen.fit_text}
    if is_open_challenge(session):
        return {"do": "go", "view": "challenge", "text": "Give your answer"}
    if stored is None or explained is None:
        return {"do": "diagnose", "text": "Find what is missing"}
    if not explained:
        effect = next(name for name in stored["effects"] if name not in _effects(chosen.ladder.steps))
        return {"do": "add", "effect": effect, "text": f"Add {effect}"}
    return chosen.next_after() or _report(desk.session)


def _report(session: Session) -> JsonDict:
    """Write the report, or open it if nothing has changed since it was written."""
    last = next((one for one in reversed(session.documents) if one["kind"] == "analysis" or _is_report(one)), None)
    if last is not None and _is_report(last):
        return {"do": "go", "view": "report", "text": "Open the report"}
    return {"do": "report", "text": "Write the report"}


def _is_report(document: JsonDict) -> bool:
    return bool(document["kind"] == "file" and str(document.get("file", "")).startswith("report/"))


def _stages(chosen: Side, stored: JsonDict | None, explained: bool | None, coming: JsonDict) -> list[JsonDict]:
    """The steps of the story: whether each is done, and the view that shows its details."""
    fitted, of, diagnosed = bool(chosen.ladder.steps), chosen.of, stored is not None
    stages = [
        ("Measured", chosen.measured and coming["do"] != "resume", "session" if of == "impedance" else "emission"),
        ("Fitted", fitted, "session" if of == "impedance" else "emission"),
        ("Where it fails", fitted and diagnosed, "fails" if of == "impedance" else ""),
        ("What is missing", fitted and diagnosed and explained is not None, "next" if of == "impedance" else ""),
        # A diagnosis that names no effect explains nothing.
        ("Explained", bool(explained) and stored is not None and stored["verdict"] not in UNEXPLAINED, ""),
        ("Report", coming["do"] == "go" and coming["view"] == "report", "report"),
    ]
    if chosen.measured and not chosen.modelled:
        stages = [stages[0], ("Judged", coming["do"] != "predict", "emission"), stages[-1]]
    return [{"title": title, "done": done, "view": view} for title, done, view in stages]
