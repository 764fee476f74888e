"""The data of each view; the computations themselves are in other packages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.paths import SESSION
from motoremi.data.session import Session
from motoremi.data.storage import is_being_written
from motoremi.data.sweep import ImpedanceSweep
from motoremi.data.withdrawn import name_of, names_of
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import Comparison
from motoremi.inspection.element_circuit import ELEMENTS
from motoremi.model.effects import catalogue
from motoremi.quantities import show, show_band
from motoremi.report.identity import measured_documents
from motoremi.report.words import beside_the_error, described, findings_of, in_words, mood_of, place_of, probability_of, reasons_of
from motoremi.workbench.challenge_view import is_open_challenge
from motoremi.workbench.desk import Desk
from motoremi.workbench.thinning import Band, seen

T = TypeVar("T")
# More digits than any instrument resolves, and half the data to transfer.
DIGITS = 8


def rounded(values: FloatArray) -> list[float | None]:
    """Numbers for a plot, rounded; None in place of NaN and infinity."""
    array = np.asarray(values, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 10.0 ** (DIGITS - 1 - np.floor(np.log10(np.abs(array))))
        short = np.where(np.isfinite(scale), np.round(array * scale) / scale, array)
    return [value if ok else None for value, ok in zip(short.tolist(), np.isfinite(short).tolist(), strict=True)]


def head(desk: Desk, identifier: str) -> JsonDict:
    """The session: its start document, measurements, instruments, and the state of its analysis."""
    session = desk.session
    start = session.start
    return {
        "id": identifier,
        "name": desk.path.name,
        "status": session.status,
        "interrupted": session.interrupted,
        "resumable": resumable(session),
        "start": {key: str(start.get(key, "")) for key in ("motor", "title", "operator", "time", "software", "backend")},
        "instruments": _instruments(session),
        "sweeps": _sweeps(session, conditioned=False),
        "conditioned": _sweeps(session, conditioned=True),
        "values": _values(session),
        "spectra": _spectra(session),
        "withdrawn": [{"name": one["name"], "why": one["why"]} for one in session.withdrawn],
        "challenge": "sealed_sha256" in start,
        "sealed": is_open_challenge(session),
        "diagnosed": session.analysis("diagnosis") is not None,
        "standing": desk.standing,
        "ladder": ladder(desk),
        "elements": [*ELEMENTS, *(desk.steps[-1].effects if desk.steps else ())],
    }


def _sweeps(session: Session, conditioned: bool) -> list[JsonDict]:
    """The sweeps in use, each with the name by which it is withdrawn."""
    return [
        {"name": name_of(document), "termination": item.termination, "summary": item.summary()}
        for document, item in measured_documents(session)
        if isinstance(item, ImpedanceSweep) and ("condition" in document) == conditioned
    ]


def _values(session: Session) -> list[JsonDict]:
    """The single values in use, each with the name by which it is withdrawn."""
    names = names_of(session.documents)
    used = [names[document["seq"]] for document in session.used_documents if document["kind"] == "value"]
    texts = (one.text.partition("=")[2].replace("+-", " ± ") for one in session.values)
    return [{"name": name, "summary": text} for name, text in zip(used, texts, strict=True)]


def _spectra(session: Session) -> list[JsonDict]:
    """The spectra in use, corrected, each with the name by which it is withdrawn."""
    used = [document for document in session.used_documents if document["kind"] == "spectrum"]
    return [
        {"name": name_of(document), "detector": one.detector, "condition": one.condition, "summary": one.summary()}
        for document, one in zip(used, session.corrected_spectra, strict=True)
    ]


def resumable(session: Session) -> bool:
    """Whether a run of this session ended early and can be resumed."""
    ended_early = "procedure" in session.start and (session.status != "done" or session.interrupted)
    # A run that is done but still writes its report has not ended.
    return ended_early and not is_being_written(session.path / SESSION)


def _instruments(session: Session) -> list[JsonDict]:
    """The instruments of the session, each once: a resumed run identifies them again."""
    instruments: list[JsonDict] = []
    for document in session.documents:
        if document["kind"] == "instrument":
            one = {
                "role": str(document.get("role", "")),
                "resource": str(document.get("resource", "")),
                "identity": _texts(document.get("identity")),
            }
            if one not in instruments:
                instruments.append(one)
    return instruments


def _texts(value: object) -> dict[str, str]:
    return {str(key): str(text) for key, text in value.items()} if isinstance(value, dict) else {}


def ladder(desk: Desk) -> list[JsonDict]:
    """All steps with their errors and parameters."""
    return [step_of(step) for step in desk.steps]


def step_of(step: Fit) -> JsonDict:
    """One model with its error and parameters."""
    return {
        "effects": list(step.effects),
        "added": step.effects[-1] if step.effects else "",
        "rms_error_percent": step.rms_error_percent,
        "rms_error_db": step.rms_error_db,
        "chi2_reduced": step.chi2_reduced,
        "floor_percent": step.floor_percent,
        "beside": list(beside_the_error(step)),
        "converged": step.converged,
        "warnings": list(step.warnings),
        "parameters": [{"name": name, "value": value, "bar": bar} for name, value, bar in step.rows()],
    }


def curves(desk: Desk, band_hz: Band | None = None) -> JsonDict:
    """The measured sweeps and, after a fit, the current model with error and uncertainty."""
    session, steps = desk.session, desk.steps
    if not session.sweeps:
        raise BadInput("this session holds no impedance sweep")
    if not steps:
        measured = [(sweep.termination, sweep.frequency_hz, sweep.impedance_ohm) for sweep in _first(session)]
        return {"model": False, "sweeps": [_measured(*one, seen(one[1], *_drawn(one[2]), band_hz=band_hz)) for one in measured]}
    top = steps[-1]
    errors, comparison = top.errors(), desk.comparison(top)
    sweeps = []
    for sweep in top.measurement.sweeps:
        model, curve = sweep.mean_ohm * (1 + errors[sweep.termination]), comparison.curves[sweep.termination]
        drawn = (*_drawn(sweep.mean_ohm), *_drawn(model), curve.error_percent, curve.error_percent * curve.fails)
        kept = seen(sweep.frequency_hz, *drawn, band_hz=band_hz)
        sweeps.append(
            {
                **_measured(sweep.termination, sweep.frequency_hz, sweep.mean_ohm, kept),
                "repeats": sweep.repeats,
                "model_real": rounded(model.real[kept]),
                "model_imag": rounded(model.imag[kept]),
                "error_percent": rounded(curve.error_percent[kept]),
                "uncertainty_percent": rounded(curve.uncertainty_percent[kept]),
                "fails": curve.fails[kept].tolist(),
            }
        )
    return {"model": True, "tolerance": asdict(comparison.tolerance), "sweeps": sweeps}


def _first(session: Session) -> list[Any]:
    """One sweep of each termination."""
    return list({sweep.termination: sweep for sweep in reversed(session.corrected_sweeps)}.values())[::-1]


def _drawn(impedance_ohm: ComplexArray) -> tuple[FloatArray, ...]:
    """Everything that a plot may show of an impedance, in any of its units."""
    return np.abs(impedance_ohm), np.angle(impedance_ohm), impedance_ohm.real, impedance_ohm.imag


def _measured(termination: str, frequency_hz: FloatArray, impedance_ohm: ComplexArray, kept: NDArray[np.intp]) -> JsonDict:
    return {
        "termination": termination,
        "points": len(frequency_hz),
        "frequency_hz": rounded(frequency_hz[kept]),
        "real": rounded(impedance_ohm.real[kept]),
        "imag": rounded(impedance_ohm.imag[kept]),
    }


def fails(desk: Desk) -> JsonDict:
    """The error of each sweep and band, and the spans that contribute most."""
    comparison: Comparison = desk.comparison(desk.top)
    data = comparison.to_dict()
    for entry in (*data["bands"], *data["where"]):
        entry["band"] = show_band(*entry["band_hz"])
    return data


def diagnosis(stored: JsonDict) -> JsonDict:
    """A stored diagnosis, prepared for display.

    Raises
    ------
    BadInput
        If it was not written by this software.
    """
    return readable(lambda: _diagnosis(stored))


def _diagnosis(stored: JsonDict) -> JsonDict:
    data = {key: stored[key] for key in ("verdict", "effects", "families", "confidence", "base", "best", "next_measurement")}
    data |= {"sentence": in_words(stored), "mood": mood_of(str(stored["verdict"])), "reasons": reasons_of(stored)}
    data["findings"] = [{**{key: one[key] for key in ("id", "why", "remedy", "serious")}, "place": place_of(one)} for one in findings_of(stored)]
    data["described"] = described(stored["unexplained_percent"]) if "unexplained_percent" in stored else ""
    data["where"] = [{**span, "band": show_band(*span["band_hz"])} for span in stored["where"]]
    data["caveats"] = list(stored.get("caveats", []))
    data["observations"] = [str(one["text"]) for one in stored.get("observations", [])]
    error = "rms_error_db" if stored.get("of") == "emission" else "rms_error_percent"
    data["candidates"] = [
        {
            **{key: one[key] for key in ("effect", "family", "chi2_reduced", "delta_bic", "plausible")},
            "error": one[error],
            "probability": probability_of(one, stored),
            "parameters": ", ".join(f"{name} = {show(float(p['value']), str(p.get('unit', '')))}" for name, p in one["parameters"].items()),
        }
        for one in stored["candidates"]
    ]
    return data


def readable(read: Callable[[], T]) -> T:
    """Read a stored analysis; a file with unexpected content becomes one sentence."""
    try:
        return read()
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise BadInput("the stored diagnosis cannot be read: diagnose this session again") from error


def inspection(desk: Desk, element: str, band_hz: Band | None = None) -> JsonDict:
    """What an element would have to be at each frequency."""
    if element not in (*ELEMENTS, *desk.top.effects):
        raise BadInput(f"{element!r} is no element of this model; choose one of {', '.join((*ELEMENTS, *desk.top.effects))}")
    found = desk.inspection(element)
    data = found.to_dict()
    for sweep, curve in zip(data["sweeps"], found.curves, strict=True):
        kept = seen(curve.frequency_hz, *_drawn(np.where(curve.known, curve.value, np.nan)), *_drawn(curve.model), band_hz=band_hz)
        sweep["points"] = len(curve.frequency_hz)
        for key in ("frequency_hz", "real", "imag", "sigma", "model_real", "model_imag", "known"):
            sweep[key] = [sweep[key][index] for index in kept]
        tried = found.laws.get(curve.termination)
        if tried and curve.known.any():
            law = tried[0].value(curve.frequency_hz[kept])
            sweep["law_name"], sweep["law_real"], sweep["law_imag"] = tried[0].law.name, rounded(law.real), rounded(law.imag)
    data["lines"] = repr(found).splitlines()
    return data


def effect_titles() -> JsonDict:
    """Titles of all effects by identifier."""
    return {identifier: effect.title for effect in catalogue() for identifier in effect.identifiers}
