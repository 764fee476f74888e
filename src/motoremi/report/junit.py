"""The report as JUnit XML: a suite for each sweep, a case for each band."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from motoremi.arrays import JsonDict
from motoremi.data.sweep import TERMINATIONS
from motoremi.data.text import clean_text
from motoremi.quantities import show_band
from motoremi.report.contents import Report
from motoremi.report.machine_readable import issued
from motoremi.report.words import findings_of, in_words, is_confirmed, levels_of, place_of, reasons_of, serious_of

# Characters that XML 1.0 does not allow at all, even escaped.
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def render_junit(report: Report) -> str:
    """JUnit XML text."""
    root = Element("testsuites", name="motoremi")
    comparison = report.data["comparison"]
    if comparison is not None:
        for sweep in TERMINATIONS:
            _sweep_suite(root, sweep, [band for band in comparison["bands"] if band["sweep"] == sweep])
    if report.data["prediction"] is not None:
        _emission_suite(root, report.data["prediction"])
    _session_suite(root, report)
    for suite in root:
        _count(suite)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _sweep_suite(root: Element, sweep: str, bands: Sequence[JsonDict]) -> None:
    suite = SubElement(root, "testsuite", name=f"{sweep} sweep")
    if not bands:
        case = SubElement(suite, "testcase", classname=f"motoremi.{sweep}", name="all bands")
        SubElement(case, "skipped", message=f"no {sweep} sweep was measured")
    for band in bands:
        case = SubElement(suite, "testcase", classname=f"motoremi.{sweep}", name=show_band(*band["band_hz"]))
        figures = f"rms {band['rms_error_percent']:.3g} %, max {band['max_error_db']:.3g} dB, {band['max_phase_deg']:.3g} deg"
        if band["verdict"] == "fail":
            spans = ", ".join(show_band(*span) for span in band["fails_hz"])
            SubElement(case, "failure", message=f"{figures}; fails at {spans}")
        else:
            SubElement(case, "system-out").text = figures


def _emission_suite(root: Element, prediction: JsonDict) -> None:
    """A case for each detector and limit line, and a skipped one for each part of a limit line that was not measured.

    As for `motoremi predict`, a marginal level does not fail, but its case says so.
    """
    suite = SubElement(root, "testsuite", name="emission")
    limit = prediction["limit"]
    confirmed = "yes" if is_confirmed(limit) else "no: check the values against the standard"
    known = {"limit": limit["title"], "limit_confirmed": confirmed, "judged": prediction["judged_what"], "verdict": prediction["verdict"]}
    _properties(suite, known)
    for one in prediction["judged"]:
        case = SubElement(suite, "testcase", classname="motoremi.emission", name=_legal(f"{levels_of(one)} levels, {one['line']} limit"))
        why = _legal(str(one["why"]))
        if one["verdict"] is None:
            SubElement(case, "skipped", message=why)
        elif one["verdict"] == "fail":
            SubElement(case, "failure", message=why)
        else:
            SubElement(case, "system-out").text = f"{_legal(str(one['verdict'])).upper()}: {why}"
    # Predictions of earlier versions list no gaps, and some no reasons.
    for gap in prediction.get("not_measured", ()):
        name = f"{levels_of(gap)} limit, {show_band(*gap['band_hz'])}"
        case = SubElement(suite, "testcase", classname="motoremi.emission", name=_legal(name))
        SubElement(case, "skipped", message="not measured")
    if reasons := prediction.get("reasons"):
        SubElement(suite, "system-out").text = "\n".join(_legal(str(reason)) for reason in reasons)


def _session_suite(root: Element, report: Report) -> None:
    """The session's properties, and cases for fit, comparison and diagnosis: a missing effect is no failure, contradictory data are one."""
    comparison, diagnosis = report.data["comparison"], report.data["diagnosis"]
    suite = SubElement(root, "testsuite", name="session")
    properties = {name: report.data[name] for name in ("motor", "operator", "software", "session_sha256", "status")}
    properties |= {name: value for name, value in issued(report.data) if value}
    if diagnosis is not None:
        properties["diagnosis"] = diagnosis["verdict"]
        properties["effects"] = ", ".join(diagnosis["effects"])
        properties["confidence"] = f"{diagnosis['confidence']:.3g}"
    _properties(suite, properties)
    _fit_case(suite, report.data["ladder"])
    case = SubElement(suite, "testcase", classname="motoremi.session", name="comparison")
    if comparison is None:
        SubElement(case, "skipped", message="the model was not compared with the measurement")
    case = SubElement(suite, "testcase", classname="motoremi.session", name="diagnosis")
    if diagnosis is None:
        SubElement(case, "skipped", message="no diagnosis was made")
    else:
        if diagnosis["verdict"] == "data":
            why = [str(one["why"]) for one in serious_of(findings_of(diagnosis))]
            SubElement(case, "failure", message=_legal("; ".join([in_words(diagnosis), *why])))
        lines = [f"verdict: {diagnosis['verdict']}", f"effects: {', '.join(diagnosis['effects'])}", *reasons_of(diagnosis)]
        lines += [
            f"found{', serious' if one['serious'] else ''}: {one['id']} ({place_of(one)}): {one['why']}; {one['remedy']}"
            for one in findings_of(diagnosis)
        ]
        SubElement(case, "system-out").text = "\n".join(_legal(str(line)) for line in lines)
    if report.warnings:
        SubElement(suite, "system-out").text = "\n".join(_legal(warning) for warning in report.warnings)


def _fit_case(suite: Element, ladder: Sequence[JsonDict]) -> None:
    """A case for the fit, which fails if the fit did not converge: no band is judged then, so nothing else would fail."""
    case = SubElement(suite, "testcase", classname="motoremi.session", name="fit")
    if not ladder:
        SubElement(case, "skipped", message="no fit was made")
    elif not ladder[-1]["result"]:
        SubElement(case, "failure", message="the fit did not converge: nothing is judged")


def _properties(suite: Element, values: Mapping[str, object]) -> None:
    properties = SubElement(suite, "properties")
    for name, value in values.items():
        SubElement(properties, "property", name=name, value=_legal(str(value)))


def _count(suite: Element) -> None:
    for name, tag in (("tests", "testcase"), ("failures", ".//failure"), ("skipped", ".//skipped")):
        suite.set(name, str(len(suite.findall(tag))))
    suite.set("errors", "0")


def _legal(text: str) -> str:
    return _ILLEGAL.sub("?", clean_text(text))
