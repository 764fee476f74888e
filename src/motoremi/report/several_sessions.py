"""Compares several sessions, such as a motor before and after adding a filter, or two motors; each with the first."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.kernels import interpolated
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import RepeatedSweep
from motoremi.data.text import in_a_cell
from motoremi.errors import BadInput
from motoremi.inspection.compare import bands_over, compare
from motoremi.quantities import error_bar, percent, show, show_band
from motoremi.report.contents import Box, Materials, Report, Section, Table, is_result, model_name
from motoremi.report.gaps import gaps
from motoremi.report.headline import Line, boxes
from motoremi.report.html import render_html
from motoremi.report.machine_readable import render_json
from motoremi.report.model import session_hash
from motoremi.report.overlay import LOOKS, Change, spectra_overlay, sweeps_overlay
from motoremi.report.pdf import can_render_pdf, render_pdf
from motoremi.report.svg import picture
from motoremi.report.words import SIMULATED, findings_of, in_words, serious_of

# As in the rest of the report: expanded uncertainty, k = 2.
CLEAR = 2.0
COLUMNS = ("session", "parameter", "value", "unit", "sigma", "change_percent", "change_in_error_bars")
NO_VALUE = "-"


class SessionComparison:
    """Several sessions with what they have in common and where they differ.

    Parameters
    ----------
    materials : mapping
        Name as shown -> materials of that session; the others are compared with the first.

    Raises
    ------
    BadInput
        For fewer than two sessions, or more than a plot can distinguish.
    """

    def __init__(self, materials: Mapping[str, Materials]) -> None:
        if not 2 <= len(materials) <= len(LOOKS):
            raise BadInput(f"2 to {len(LOOKS)} sessions can be compared side by side, not {len(materials)}; for more use motoremi fleet")
        self.materials = materials
        self.first = first = next(iter(materials))
        self.sweeps = {name: _sweeps(own) for name, own in materials.items()}
        self.changes = {
            name: _changes(materials[first], materials[name], self.sweeps[first], self.sweeps[name]) for name in materials if name != first
        }
        self.running = {name: [s for s in own.session.corrected_spectra if not s.is_background] for name, own in materials.items()}
        self.data: JsonDict = {
            "schema": "motoremi.together/1",
            "first": first,
            "sessions": [_figures(name, own) for name, own in materials.items()],
            "parameters": _parameters(materials),
            "bands": list(_bands(self.changes)),
        }

    def verdicts(self) -> Table:
        """Model, errors and verdicts of each session."""
        return _verdicts(self.materials, self.data["sessions"])

    def bands(self) -> Table | None:
        """Change of |Z| against the first."""
        return _band_table(self.data["bands"]) if self.data["bands"] else None

    def without_common(self) -> tuple[str, ...]:
        """A sentence for each sweep of another session that the first has too, but at no common frequencies."""
        one = self.sweeps[self.first]
        return tuple(
            f"{name}: no common frequencies of its {termination} sweep ({show_band(*_span(own[termination]))}) and that of {self.first} "
            f"({show_band(*_span(one[termination]))}): the change of |Z| is not known."
            for name, own in self.sweeps.items()
            for termination in own
            if name != self.first and termination in one and termination not in self.changes[name]
        )

    def parameters(self) -> Section | None:
        """Values with their error bars, and the differences to the first."""
        return _parameter_section(self.materials, self.data["parameters"]) if self.data["parameters"] else None


def build_together(materials: Mapping[str, Materials]) -> Report:
    """The report of several sessions; `materials` as in `SessionComparison`."""
    together = SessionComparison(materials)
    begun = [str(own.session.start.get("time", "")) for own in materials.values()]
    return Report(
        title="Common-mode impedance, side by side",
        subtitle=" · ".join(materials),
        boxes=(Box("Verdicts", tuple(_line(name, own) for name, own in materials.items())),),
        warnings=tuple(f"{name}: {gap}" for name, own in materials.items() for gap in gaps(own)),
        sections=tuple(_sections(together)),
        data=together.data,
        begun=max(begun),
        footer="data " + ", ".join(session_hash(own.session)[:16] for own in materials.values()),
        signatures=("compared by: name, date, signature", "checked by: name, date, signature"),
        mark=_mark([name for name, own in materials.items() if own.session.simulated], len(materials)),
    )


def _mark(simulated: Sequence[str], sessions: int) -> str:
    if not simulated or len(simulated) == sessions:
        return SIMULATED if simulated else ""
    return f"SIMULATED DATA in {', '.join(simulated)}: no real motor was measured there"


def render_together(report: Report) -> dict[str, bytes]:
    """File name -> content; PDF where typst is installed."""
    texts = {"comparison.html": render_html(report), "comparison.json": render_json(report), "comparison.csv": _render_csv(report)}
    made = {name: text.encode("utf-8") for name, text in texts.items()}
    return {**made, "comparison.pdf": render_pdf(report)} if can_render_pdf() else made


def _render_csv(report: Report) -> str:
    """A row for each session and parameter."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for parameter in report.data["parameters"]:
        for one in parameter["sessions"]:
            numbers = [one[key] for key in ("value", "sigma", "change_percent", "change_in_error_bars")]
            value, *others = ("" if number is None else repr(number) for number in numbers)
            writer.writerow((in_a_cell(one["session"]), parameter["name"], value, parameter["unit"], *others))
    return buffer.getvalue()


def _sweeps(materials: Materials) -> dict[str, RepeatedSweep]:
    return {sweep.termination: sweep for sweep in _measurement(materials).sweeps} if materials.session.sweeps else {}


def _span(sweep: RepeatedSweep) -> tuple[float, float]:
    return float(sweep.frequency_hz[0]), float(sweep.frequency_hz[-1])


def _measurement(materials: Materials) -> Measurement:
    return materials.steps[-1].measurement if materials.steps else Measurement.of(materials.session.corrected_sweeps)


def _uncertainty(materials: Materials, termination: str) -> FloatArray:
    """Expanded, relative: noise and the analyser's specification; noise alone before the first fit."""
    if materials.steps:
        return compare(materials.steps[-1]).curves[termination].uncertainty_percent / 100
    measurement = _measurement(materials)
    noise = measurement.noise[measurement.terminations.index(termination)]
    return CLEAR * np.sqrt(2 * noise.variance)


def _changes(first: Materials, other: Materials, before: Mapping[str, RepeatedSweep], after: Mapping[str, RepeatedSweep]) -> dict[str, Change]:
    """The change of each sweep that both have; the first is interpolated in log frequency where the points differ."""
    found = {}
    for termination in (name for name in before if name in after):
        one, two = before[termination], after[termination]
        inside = (two.frequency_hz >= one.frequency_hz[0]) & (two.frequency_hz <= one.frequency_hz[-1])
        if not inside.any():
            continue
        here = np.log(two.frequency_hz[inside])
        known = np.log(one.frequency_hz)
        reference = interpolated(one.frequency_hz, one.mean_ohm, two.frequency_hz[inside])
        both = np.hypot(np.interp(here, known, _uncertainty(first, termination)), _uncertainty(other, termination)[inside])
        found[termination] = Change(two.frequency_hz[inside], two.mean_ohm[inside] / reference, both)
    return found


def _figures(name: str, materials: Materials) -> JsonDict:
    """One session's verdicts and figures."""
    start, steps, diagnosis = materials.session.start, materials.steps, materials.diagnosis
    prediction = materials.stored("prediction")
    results = [step for step in steps if is_result(step)]
    return {
        "session": name,
        "motor": start.get("motor", ""),
        "serial": start.get("serial", ""),
        "begun": start.get("time", ""),
        "session_sha256": session_hash(materials.session),
        "effects": list(steps[-1].effects) if steps else [],
        "rms_error_percent": [step.rms_error_percent for step in results],
        "floor_percent": results[-1].floor_percent if results else None,
        "comparison": None if materials.comparison is None else materials.comparison.verdict,
        "diagnosis": None if diagnosis is None else _cause(diagnosis),
        "emission": None if prediction is None else prediction["verdict"],
    }


def _cause(diagnosis: JsonDict) -> JsonDict:
    serious = [finding["id"] for finding in serious_of(findings_of(diagnosis))]
    return {**{key: diagnosis[key] for key in ("verdict", "effects", "confidence")}, "serious_findings": list(dict.fromkeys(serious))}


def _line(name: str, materials: Materials) -> Line:
    cause = "no diagnosis" if materials.diagnosis is None else in_words(materials.diagnosis, materials.effects)
    judged = [box.verdict for box in boxes(materials) if box.verdict is not None]
    moods = {mood for *_, mood in judged}
    mood = "bad" if "bad" in moods else "good" if moods == {"good"} else "plain"
    return name, "; ".join((cause, *(f"{label.split()[0].lower()} {text}" for label, text, _ in judged))), mood


def _parameters(materials: Mapping[str, Materials]) -> list[JsonDict]:
    """Values and error bars of the current models, and the differences to the first."""
    tops = {name: own.steps[-1] if own.steps and is_result(own.steps[-1]) else None for name, own in materials.items()}
    units = {p.name: p.unit for fit in tops.values() if fit is not None for p in fit.motor.parameters if p.name in fit.parameters}
    reference = next(iter(tops.values()))
    rows = []
    for parameter, unit in units.items():
        entries: list[JsonDict] = []
        for name, fit in tops.items():
            entry = {"session": name, "determined": False, **dict.fromkeys(("value", "sigma", "change_percent", "change_in_error_bars"))}
            if fit is not None and parameter in fit.parameters:
                held = parameter in fit.held
                sigma = 0.0 if held else fit.sigma[parameter]
                entry.update(value=fit.parameters[parameter], sigma=sigma if np.isfinite(sigma) and parameter not in fit.at_bounds else None)
                entry["determined"] = held or fit.determined(parameter)
                if reference is not None and fit is not reference and entry["determined"]:
                    entry.update(_difference(entry, entries[0]))
            entries.append(entry)
        rows.append({"name": parameter, "unit": unit, "sessions": entries})
    return rows


def _difference(entry: JsonDict, first: JsonDict) -> JsonDict:
    """The difference in percent of the first, and in standard uncertainties of the difference."""
    if not first["determined"]:
        return {}
    change, bar = entry["value"] - first["value"], float(np.hypot(entry["sigma"], first["sigma"]))
    return {"change_percent": 100 * change / first["value"], "change_in_error_bars": change / bar if bar > 0 else None}


def _bands(changes: Mapping[str, Mapping[str, Change]]) -> Iterator[JsonDict]:
    """Change of |Z| in each band of a comparison."""
    for name, own in changes.items():
        for termination, change in own.items():
            for low, high in bands_over(change.frequency_hz):
                inside = (change.frequency_hz >= low) & (change.frequency_hz <= high)
                if not inside.any():
                    continue
                level = change.magnitude_db[inside]
                yield {
                    "session": name,
                    "sweep": termination,
                    "band_hz": [low, high],
                    "mean_db": float(level.mean()),
                    "largest_db": float(level[np.argmax(np.abs(level))]),
                    "share_beyond_uncertainty": float(change.beyond[inside].mean()),
                }


def _sections(together: SessionComparison) -> Iterator[Section]:
    yield Section("Verdicts", (), (together.verdicts(),))
    if any(together.sweeps.values()):
        caption = "Mean of the repeats of each session; below, the change of |Z| against the first with the uncertainty of both."
        drawn = picture("overlay", sweeps_overlay({n: s for n, s in together.sweeps.items() if s}, together.changes), caption)
        text = "The band is the expanded uncertainty of both sweeps; errors of one analyser partly cancel, so a change inside it may still be real."
        bands = together.bands()
        yield Section("Sweeps", (text, *together.without_common()), (bands,) if bands else (), (drawn,))
    if parameters := together.parameters():
        yield parameters
    if any(together.running.values()):
        drawn = picture("spectra", spectra_overlay({n: s for n, s in together.running.items() if s}), "Conducted emission with the motor running.")
        yield Section("Emission", (), (), (drawn,))
    columns = ("session", "motor", "serial number", "begun (UTC)", "SHA-256 over the hashes of the measured files")
    keys = ("session", "motor", "serial", "begun", "session_sha256")
    rows = tuple(tuple(str(one[key] or NO_VALUE) for key in keys) for one in together.data["sessions"])
    yield Section("Identity", (), (Table("Sessions", columns, rows),))


def _verdicts(materials: Mapping[str, Materials], sessions: Sequence[JsonDict]) -> Table:
    rows, marked = [], set()
    for index, (one, own) in enumerate(zip(sessions, materials.values(), strict=True)):
        errors = [percent(error) for error in one["rms_error_percent"]]
        found = one["diagnosis"]
        cause = NO_VALUE if found is None else in_words(found, own.effects)
        if found is not None and found["serious_findings"]:
            cause += f" (found in the data: {', '.join(found['serious_findings'])})"
        rows.append(
            (
                one["session"],
                model_name(own.steps[-1]) if own.steps else "no fit",
                " → ".join(errors) or NO_VALUE,
                NO_VALUE if one["floor_percent"] is None else percent(one["floor_percent"], 2),
                (one["comparison"] or "not judged").upper(),
                cause,
                (one["emission"] or "not judged").upper(),
            )
        )
        if "fail" in (one["comparison"], one["emission"]):
            marked.add(index)
    columns = ("session", "current model", "rms error, step by step", "noise and analyser would leave", "model", "diagnosis", "emission")
    return Table("Verdicts", columns, tuple(rows), frozenset(marked))


def _band_table(bands: Sequence[JsonDict]) -> Table:
    rows = tuple(
        (
            band["session"],
            band["sweep"],
            show_band(*band["band_hz"]),
            level_change(band["mean_db"]),
            level_change(band["largest_db"]),
            f"{100 * band['share_beyond_uncertainty']:.0f} %",
        )
        for band in bands
    )
    return Table("Change of |Z| against the first", ("session", "sweep", "band", "mean", "largest", "points beyond uncertainty"), rows)


def _parameter_section(materials: Mapping[str, Materials], parameters: Sequence[JsonDict]) -> Section:
    rows, marked = [], set()
    for index, parameter in enumerate(parameters):
        cells = [parameter["name"]]
        for number, one in enumerate(parameter["sessions"]):
            cells.append(_value(one, parameter["unit"]))
            if number:
                bars = one["change_in_error_bars"]
                known = one["change_percent"] is not None
                cells.append(f"{change_in_percent(one['change_percent'])} %" + ("" if bars is None else f" ({bars:+.1f})") if known else NO_VALUE)
                if bars is not None and abs(bars) > CLEAR:
                    marked.add(index)
        rows.append(tuple(cells))
    names = list(materials)
    columns = ("parameter", names[0], *(column for name in names[1:] for column in (name, "change (in error bars)")))
    texts = [f"Marked: the difference is more than {CLEAR:g} standard uncertainties of both values together."]
    models = {own.steps[-1].effects for own in materials.values() if own.steps}
    if len(models) > 1:
        texts.append("The models contain different effects: an element may differ because an effect of one model represents part of it.")
    return Section("Parameters", tuple(texts), (Table("Parameters of the current models", columns, tuple(rows), frozenset(marked)),))


def _value(one: JsonDict, unit: str) -> str:
    if one["value"] is None:
        return NO_VALUE
    if not one["determined"]:
        return "not determined"
    return f"{show(one['value'], unit)} {error_bar(one['value'], one['sigma'])}" if one["value"] else show(0.0, unit)


def change_in_percent(percent: float) -> str:
    """A change with two digits, without a power of ten."""
    return f"{percent:+.2g}" if abs(percent) < 99.5 else f"{percent:+.0f}"


def level_change(db: float) -> str:
    """A level difference, without a minus sign before zero."""
    return f"{round(db, 2) + 0.0:+.2f} dB"
