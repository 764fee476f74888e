"""The report for machines: JSON with everything, CSV with the parameters and bands."""

from __future__ import annotations

import csv
import io

from motoremi.arrays import JsonDict
from motoremi.data.plain import to_page
from motoremi.data.text import in_a_cell
from motoremi.quantities import percent_span
from motoremi.report.contents import Report
from motoremi.report.words import levels_of

COLUMNS = ("kind", "where", "name", "value", "unit", "sigma", "note")


def render_json(report: Report) -> str:
    """All data of the report."""
    return to_page(report.data)


def issued(data: JsonDict) -> tuple[tuple[str, str], ...]:
    """Number, dates, laboratory and statements of the report, by name; empty where not stated."""
    if data["laboratory"] is None:
        return ()
    laboratory, issue = data["laboratory"], data["issue"] or {}
    rule = laboratory["decision_rule"] or {}
    return (
        ("report_number", str(issue.get("number", ""))),
        ("date_of_issue", str(issue.get("date", ""))),
        ("replaces", str((issue.get("replaces") or {}).get("number", ""))),
        ("laboratory", ", ".join((laboratory["name"], *laboratory["address"]))),
        ("customer", ", ".join(laboratory["customer"])),
        ("authorised_by", laboratory["authoriser"]),
        ("statement", laboratory["statement"]),
        ("decision_rule", rule.get("rule", "")),
        ("decision_rule_source", rule.get("source", "")),
    )


def _note(entry: JsonDict, held: bool) -> str:
    if held:
        return "held"
    if entry["at_bound"]:
        return "at its bound"
    return "" if entry["determined"] else "not determined"


def render_csv(report: Report) -> str:
    """Number and laboratory of the report, parameters of every step, error of each band and margins to the limit, in one long table.

    `sigma` is a number or empty; `note` says whether a parameter is held, at its bound or not determined, and gives the verdict of a band.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for name, text in issued(report.data):
        if text:
            writer.writerow(("report", "", name, "", "", "", in_a_cell(text)))
    for number, step in enumerate(report.data["ladder"]):
        for name, entry in step["parameters"].items():
            sigma = "" if entry["sigma"] is None else repr(entry["sigma"])
            note = "not converged" if not step["result"] else _note(entry, name in step["held"])
            writer.writerow(("parameter", f"step {number}", name, repr(entry["value"]), entry["unit"], sigma, note))
        note = " + ".join(step["effects"]) or "paper's circuit"
        for name in ("rms_error_percent", "corrected_error_percent", "floor_percent", "noise_percent"):
            writer.writerow(("error", f"step {number}", name, repr(step[name]), "%", "", note))
        left = step["unexplained_percent"]
        interval = f"95 %: {percent_span(left['low'], left['high'], 4)}"
        writer.writerow(("error", f"step {number}", "unexplained_percent", repr(left["value"]), "%", "", interval))
    for band in (report.data["comparison"] or {"bands": []})["bands"]:
        where = f"{band['sweep']} {band['band_hz'][0]:.9g}-{band['band_hz'][1]:.9g} Hz"
        for name, unit in (("rms_error_percent", "%"), ("max_error_percent", "%"), ("max_error_db", "dB"), ("max_phase_deg", "deg")):
            writer.writerow(("band", where, name, repr(band[name]), unit, "", band["verdict"]))
    for judged in (report.data["prediction"] or {"judged": []})["judged"]:
        if judged["worst_margin_db"] is not None:
            where = f"{levels_of(judged)} levels, {judged['line']} limit"
            writer.writerow(("emission", where, "worst_margin_db", repr(judged["worst_margin_db"]), "dB", "", judged["verdict"] or "no verdict"))
    return buffer.getvalue()
