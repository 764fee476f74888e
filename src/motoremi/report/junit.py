"""The report as JUnit XML: a suite for each sweep, a case for each band."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from motoremi.data.text import clean_text
from motoremi.quantities import show_band
from motoremi.report.model import Report

# Characters that XML 1.0 does not allow at all, even escaped.
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def render_junit(report: Report) -> str:
    """JUnit XML text."""
    root = ElementTree.Element("testsuites", name="motoremi")
    comparison, diagnosis = report.data["comparison"], report.data["diagnosis"]
    bands = comparison["bands"] if comparison else []
    for sweep in dict.fromkeys(band["sweep"] for band in bands):
        own = [band for band in bands if band["sweep"] == sweep]
        failures = sum(band["verdict"] == "fail" for band in own)
        suite = ElementTree.SubElement(root, "testsuite", name=f"{sweep} sweep", tests=str(len(own)), failures=str(failures), skipped="0")
        for band in own:
            case = ElementTree.SubElement(suite, "testcase", classname=f"motoremi.{sweep}", name=show_band(*band["band_hz"]))
            figures = f"rms {band['rms_error_percent']:.3g} %, max {band['max_error_db']:.3g} dB, {band['max_phase_deg']:.3g} deg"
            if band["verdict"] == "fail":
                spans = ", ".join(show_band(*span) for span in band["fails_hz"])
                ElementTree.SubElement(case, "failure", message=_legal(f"{figures}; fails at {spans}"))
            else:
                ElementTree.SubElement(case, "system-out").text = _legal(figures)
    suite = ElementTree.SubElement(
        root, "testsuite", name="session", tests="2", failures="0", skipped=str((comparison is None) + (diagnosis is None))
    )
    properties = ElementTree.SubElement(suite, "properties")
    for name in ("motor", "operator", "software", "session_sha256", "status"):
        ElementTree.SubElement(properties, "property", name=name, value=_legal(str(report.data[name])))
    case = ElementTree.SubElement(suite, "testcase", classname="motoremi.session", name="comparison")
    if comparison is None:
        ElementTree.SubElement(case, "skipped", message="the model was not compared with the measurement")
    case = ElementTree.SubElement(suite, "testcase", classname="motoremi.session", name="diagnosis")
    if diagnosis is None:
        ElementTree.SubElement(case, "skipped", message="no diagnosis was made")
    else:
        lines = [f"verdict: {diagnosis['verdict']}", f"effects: {', '.join(diagnosis['effects'])}", *diagnosis["reasons"]]
        ElementTree.SubElement(case, "system-out").text = _legal("\n".join(lines))
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _legal(text: str) -> str:
    return _ILLEGAL.sub("?", "\n".join(clean_text(line) for line in text.split("\n")))
