"""A report that a laboratory signs: its profile in every form, its number given once, its equipment, and what has to stand on every page."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import os
import re
import shutil
import tomllib
from datetime import date
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pypdfium2
import pytest
from command_line import motoremi
from laboratory_cases import PROFILE, measured_session, pages_of, profile, spectrum, squeezed
from report_cases import HOSTILE, Poison, diagnosed_session, parsed
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.laboratory import laboratory_of
from motoremi.data.session import load
from motoremi.data.text import clean_text
from motoremi.report.contents import Choice
from motoremi.report.headline import boxes
from motoremi.report.model import Materials, build_report
from motoremi.report.pdf import BREAK, breakable, in_font
from motoremi.report.renderings import render_all
from motoremi.report.words import SIMULATED
from motoremi.workflow import ladder_of, opened, report_session
from motoremi.workflow_emission import predict_session
from motoremi.workflow_issue import laboratory_in

pytestmark = pytest.mark.slow

LONG = {"report.html", "report.pdf", "report.json", "junit.xml", "parameters.csv"}


def report(path: Path, lab: Path | None = None, choice: Choice | None = None) -> dict[str, bytes]:
    with opened(path) as store:
        return {file.name: file.read_bytes() for file in report_session(store, lab, choice)}


def of(path: Path, choice: Choice | None = None, text: str = PROFILE):
    laboratory = laboratory_of(tomllib.loads(text), "test")
    return build_report(Materials(load(path), (), None, None, laboratory=laboratory), choice or Choice())


@pytest.fixture
def session(tmp_path, measure) -> Path:
    return measured_session(tmp_path / "s", measure(2)[0][:1], [spectrum(line="L1")], serial="SN-1", calibrated={"analyser": "2020-04-01"})


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory, measure) -> Path:
    return diagnosed_session(tmp_path_factory.mktemp("diagnosed") / "session", measure)


def test_everything_that_a_laboratory_says_is_said_in_every_form(tmp_path, session):
    files = report(session, profile(tmp_path / "lab", 'logo = "logo.svg"\n' + PROFILE))
    assert set(files) == LONG
    page = parsed(files["report.html"].decode())
    pages = pages_of(files["report.pdf"])
    told = {"html": squeezed("".join(page.text)), "pdf": squeezed("".join(pages))}
    issued = json.loads(files["report.json"])["issue"]
    assert issued["number"] == "EMC-2026-0001"
    for text in (
        *("EMC Laboratory North", "20457 Hamburg", "Drives Ltd, Motor Street 5", "EMC-2026-0001", issued["date"]),
        *("The results relate only to the item tested.", "Decision rule: A verdict needs", "Source: ILAC-G8:09/2019, 4.2.2"),
        *("authorised by: Dr. A. Person", "ENV216", "101234", "D-K-0815", "2027-01-15", "leads F2", "End of report EMC-2026-0001"),
    ):
        assert {form for form, said in told.items() if squeezed(text) not in said} == set(), text
    assert pages[-1].count("End of report") == 1
    assert all(f"page {number} of {len(pages)}" in text and "report EMC-2026-0001" in text for number, text in enumerate(pages, start=1))
    assert [str(value)[:27] for name, value in page.attributes if name == "src"] == ["data:image/svg+xml;base64,P"]

    root = ElementTree.fromstring(files["junit.xml"])
    said = {entry.get("name"): entry.get("value") for entry in root.iter("property")}
    rows = {row["name"]: row["note"] for row in csv.DictReader(io.StringIO(files["parameters.csv"].decode())) if row["kind"] == "report"}
    for table in (said, rows):
        assert table["report_number"] == "EMC-2026-0001"
        assert table["laboratory"] == "EMC Laboratory North, Harbour Road 1, 20457 Hamburg"
        assert table["decision_rule_source"] == "ILAC-G8:09/2019, 4.2.2"


def test_number_and_date_are_given_once(tmp_path, session, monkeypatch):
    lab = profile(tmp_path / "lab")
    first = report(session, lab)
    # Later, from the profile that is kept: the same bytes.
    later = type("Later", (), {"today": staticmethod(lambda: date(2099, 1, 1))})
    monkeypatch.setattr("motoremi.workflow_issue.date", later)
    assert report(session) == first
    assert report(session, lab) == first
    assert (tmp_path / "lab" / "lab.register.csv").read_text().count("\n") == 1
    assert CliRunner().invoke(app, ["verify", str(session)]).exit_code == 0


def test_a_report_that_says_something_else_is_an_amendment(tmp_path, session):
    lab = profile(tmp_path / "lab")
    issued = [json.loads(report(session, lab)["report.json"])["issue"]]
    with opened(session) as store:
        predict_session(store, limit="cispr32-b", with_model=False)
    issued += [json.loads(report(session)["report.json"])["issue"] for _ in range(2)]
    lab.write_text(PROFILE.replace("Drives Ltd", "Motors Ltd"))
    files = report(session, lab)
    issued.append(json.loads(files["report.json"])["issue"])
    assert [one["number"] for one in issued] == ["EMC-2026-0001", *["EMC-2026-0001 A1"] * 2, "EMC-2026-0001 A2"]
    assert issued[-1]["replaces"] == {"number": "EMC-2026-0001 A1", "date": issued[1]["date"]}
    assert "report EMC-2026-0001 A1 of" in files["report.html"].decode()
    assert laboratory_in(load(session)).customer[0] == "Motors Ltd"


def test_without_a_series_the_data_are_the_number(tmp_path, session):
    files = report(session, profile(tmp_path / "lab", 'name = "X"'))
    data = json.loads(files["report.json"])
    assert data["issue"]["number"] == data["session_sha256"][:16]
    assert list((tmp_path / "lab").glob("*.csv")) == []


def test_a_profile_in_the_settings_is_every_reports(tmp_path, session, monkeypatch):
    monkeypatch.chdir(tmp_path)
    profile(tmp_path)
    Path("motoremi.toml").write_text('[report]\nprofile = "lab.toml"\nform = "short"\n')
    done = motoremi("report", session, cwd=tmp_path, HOME=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert {Path(line).name for line in done.stdout.split()} == {"short.html", "short.pdf"}
    assert load(session).analysis("laboratory")["laboratory"]["name"] == "EMC Laboratory North"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--profile", "nowhere.toml"], "no such file"),
        (["--form", "medium"], "there are long, short"),
        (["--sections", "fits"], "there are sweeps, fit"),
        (["--sections", "fit", "--form", "short"], "has its own sections"),
        (["other", "--out", "x", "--form", "short"], "--form is for the report of one session"),
    ],
)
def test_wrong_use_is_one_line_and_writes_nothing(session, words, told):
    with pytest.raises(me.BadInput, match=told) as caught:
        CliRunner().invoke(app, ["report", str(session), *words], catch_exceptions=False)
    assert "\n" not in str(caught.value)
    assert not (session / "report").exists()


def test_a_logo_that_is_no_image_leaves_everything_as_it_was(tmp_path, session):
    lab = profile(tmp_path / "lab", 'logo = "logo.png"\n' + PROFILE)
    (tmp_path / "lab" / "logo.png").write_bytes(os.urandom(3000))
    before = sorted(session.rglob("*"))
    with pytest.raises(me.BadInput, match=r"logo\.png: is not an image that a report can show; save the logo as PNG or SVG$"):
        report(session, lab)
    assert sorted(session.rglob("*")) == before
    assert not (tmp_path / "lab" / "lab.register.csv").exists()


def test_a_kept_profile_that_cannot_be_used_is_one_line(session):
    with opened(session) as store:
        store.save_analysis("laboratory", {"laboratory": {"name": "X", "logo_svg": "<svg onload='x'/>"}})
    with pytest.raises(me.BadInput, match="give it again with --profile FILE"):
        report(session)


@pytest.mark.parametrize("text", HOSTILE)
def test_every_field_of_a_profile_is_shown_and_none_obeyed(tmp_path, session, text):
    poison = Poison(text)
    content = {name: poison(name) for name in ("name", "authoriser", "statement", "series")}
    content |= {name: [poison(f"{name} 1"), poison(f"{name} 2")] for name in ("address", "customer")}
    content["decision_rule"] = {"rule": poison("rule"), "source": poison("source")}
    content["equipment"] = [{name: poison(f"equipment.{name}") for name in ("kind", "name", "serial", "certificate")}]
    issue = {"number": content["series"], "date": poison("date"), "replaces": {"number": poison("replaced"), "date": poison("replaced on")}}
    whole = laboratory_of(content, "test")
    with opened(session) as store:
        store.save_analysis("laboratory", {"laboratory": whole.to_dict()})
        store.save_analysis("issue", {**issue, "content_sha256": "", "series_number": content["series"], "amendment": 0})
    materials = Materials(load(session), (), None, None, laboratory=laboratory_in(load(session)), issue=issue)
    for form in ("long", "short"):
        files = {Path(name).name: data for name, data in render_all(build_report(materials, Choice(form)), form).items()}
        html = next(data.decode() for name, data in files.items() if name.endswith(".html"))
        page = parsed(html)
        assert not {"script", "img", "iframe", "object", "link"} & set(page.tags[page.tags.index("body") :])
        assert not any(name.startswith("on") or str(value).strip().lower().startswith("javascript") for name, value in page.attributes)
        assert not set("\x1b\x00\u202e\u2028") & set(html)
        shown = poison.found_in("".join(page.text), text)
        assert {place for number, place in poison.places.items() if number not in shown} == set()
        pdf = next(data for name, data in files.items() if name.endswith(".pdf"))
        in_pdf = poison.found_in("".join(pages_of(pdf)), "".join(map(in_font, clean_text(text))))
        assert {poison.places[number] for number in shown ^ in_pdf} == set()
        if form == "long":
            ElementTree.fromstring(files["junit.xml"])
            assert not set("\x1b\x00\u202e\u2028") & set(files["junit.xml"].decode() + files["parameters.csv"].decode())
            rows = list(csv.reader(io.StringIO(files["parameters.csv"].decode())))
            assert {len(row) for row in rows} == {7}


def test_no_spreadsheet_takes_a_profile_for_a_formula(tmp_path, session):
    text = f'name = {json.dumps("=HYPERLINK(1)")}\nauthoriser = " @SUM(1)"'
    files = report(session, profile(tmp_path / "lab", text))
    notes = {row[2]: row[6] for row in csv.reader(io.StringIO(files["parameters.csv"].decode()))}
    assert notes["laboratory"] == "'=HYPERLINK(1)"
    assert notes["authorised_by"] == "' @SUM(1)"


def test_equipment_is_joined_by_its_serial_number_and_what_was_due_is_marked(session):
    section = next(section for section in of(session).sections if section.title == "Equipment")
    (table,) = section.tables
    rows = {row[0]: row for row in table.rows}
    # The laboratory's own date of the analyser stands in place of the bench file's, with its certificate; due so many days later.
    assert rows["analyser"][1:6] == ("HP 4294A", "JP1KG00123", "2020-05-01", "2021-05-01", "D-K-0816")
    assert "instrument" not in rows
    assert rows["adapter"][1] == "1m"
    assert set(rows) == {"analyser", "adapter", "LISN", "fixture"}
    assert [table.rows[index][0] for index in table.marked] == ["analyser"]
    assert "the calibration of the analyser HP 4294A was due on 2021-05-01" in of(session).warnings


def test_equipment_of_the_other_measurement_is_not_listed(tmp_path, measure):
    impedance = measured_session(tmp_path / "z", measure(2)[0][:1])
    emission = measured_session(tmp_path / "e", (), [spectrum()])
    for path, own, other in ((impedance, "leads F2", "ENV216"), (emission, "ENV216", "leads F2")):
        told = str(next(section for section in of(path).sections if section.title == "Equipment"))
        assert own in told
        assert other not in told


def test_corrections_are_equipment_with_their_tables(tmp_path, measure):
    pad = {"name": "10 dB pad", "kind": "loss", "db": 10.0, "serial": "PA-1", "calibrated": "2026-03-02", "due": "2027-03-02"}
    cable = {"name": "cable W3", "kind": "loss", "db": [1.0, 2.0], "frequency_hz": [1e5, 4e7], "file": "w3.csv"}
    path = measured_session(tmp_path / "s", (), [spectrum()], corrections=[pad, cable])
    (table,) = next(section for section in of(path).sections if section.title == "Equipment").tables
    assert ("receiver correction", "10 dB pad", "PA-1", "2026-03-02", "2027-03-02", "-", "one value") in table.rows
    assert ("receiver correction", "cable W3", "-", "not stated", "not stated", "-", "w3.csv") in table.rows
    assert any("calibration dates (analyser, cable W3)" in gap for gap in build_report(Materials(load(path), (), None, None)).warnings)


@pytest.mark.parametrize(
    ("dates", "doubts"),
    [
        ({"calibrated": "2023-01-10", "due": "2024-01-10"}, ["the calibration of the receiver correction pad was due on 2024-01-10"]),
        ({"calibrated": "2024-03-01"}, ["the calibration of the receiver correction pad is dated 2024-03-01, after the measurement"]),
        ({"calibrated": "2024-02-03", "due": "2025-02-03"}, []),
    ],
)
def test_calibrations_are_compared_with_the_date_that_imported_files_state(tmp_path, dates, doubts):
    (tmp_path / "b.csv").write_text("# date: 03.Feb 2024\n# detector: peak\nfrequency_hz,level_dbuv\n150e3,40\n160e3,41\n170e3,40\n")
    entry = "\n".join(f"{key} = {day}" for key, day in dates.items())
    (tmp_path / "lab.toml").write_text(f"[[correction]]\nname = 'pad'\nrole = 'receiver'\nkind = 'loss'\ndb = 10\n{entry}\n")
    words = ["import", str(tmp_path / "s"), "--spectrum", str(tmp_path / "b.csv"), "--corrections", str(tmp_path / "lab.toml")]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == 0, told.output
    warnings = build_report(Materials(load(tmp_path / "s"), (), None, None)).warnings
    assert [one for one in warnings if one.startswith("the calibration of")] == doubts


def test_imported_data_are_called_so_with_their_own_date_and_every_gap(tmp_path, measure):
    sweeps, _ = measure(2)
    (tmp_path / "a.csv").write_text(
        "# date: 03.Feb 2024\n"
        + "frequency_hz,resistance_ohm,reactance_ohm\n"
        + "".join(f"{f!r},{z.real!r},{z.imag!r}\n" for f, z in zip(sweeps[0].frequency_hz.tolist(), sweeps[0].impedance_ohm.tolist(), strict=True))
    )
    (tmp_path / "b.csv").write_text("frequency_hz,level_dbuv\n# detector: peak\n150e3,40\n160e3,41\n170e3,40\n")
    told = CliRunner().invoke(app, ["import", str(tmp_path / "s"), "--short", str(tmp_path / "a.csv"), "--spectrum", str(tmp_path / "b.csv")])
    assert told.exit_code == 0, told.output
    made = build_report(Materials(load(tmp_path / "s"), (), None, None))
    facts = dict(made.facts)
    assert facts["Measured"] == "2024-02-03"
    assert re.match(r"IMPORTED on \d{4}-\d\d-\d\d from 2 files", facts["Data"])
    assert "2024-02-03" in made.subtitle
    gaps = "\n".join(made.warnings)
    for gap in (
        "imported: the data were read from 2 files",
        "b.csv: the header does not say when the data were measured",
        "do not state bandwidth of the spectra",
        "the motor's name, the motor's serial number, who measured, ambient conditions, the instruments and their serial numbers, the LISN",
    ):
        assert gap in gaps
    assert made.mark == ""


@pytest.mark.parametrize("form", ["long", "short"])
def test_simulated_data_say_so_on_every_page(tmp_path, measure, form):
    path = measured_session(tmp_path / "s", measure(2)[0], [spectrum()], backend="sim", simulated=True)
    CliRunner().invoke(app, ["import", str(tmp_path / "i"), *(w for f in sorted(path.glob("sweeps/short*")) for w in ("--short", str(f)))])
    for session in (path, tmp_path / "i"):
        files = report(session, None, Choice(form))
        html, pdf = (next(data for name, data in files.items() if name.endswith(ending)) for ending in (".html", ".pdf"))
        assert all(SIMULATED in text for text in pages_of(pdf))
        assert html.decode().count(SIMULATED) == 1
        assert "simulated" in "".join(gap for gap in build_report(Materials(load(session), (), None, None)).warnings)


def test_each_requirement_has_its_own_verdict_and_box(tmp_path, measure):
    sweeps, _ = measure(2)
    both = measured_session(tmp_path / "b", sweeps, [spectrum()])
    made = build_report(Materials(load(both), (), None, None))
    assert [(box.title, box.verdict[1]) for box in made.boxes] == [("Common-mode impedance", "not judged"), ("Conducted emission", "not judged")]
    assert made.title == "Common-mode impedance and conducted emission test report"
    emission = build_report(Materials(load(measured_session(tmp_path / "e", (), [spectrum()])), (), None, None))
    assert [box.title for box in emission.boxes] == ["Conducted emission"]
    assert emission.title == "Conducted emission test report"
    # What an emission test never had is no gap of it.
    assert not any("fit" in gap or "diagnosis" in gap or "compared" in gap for gap in emission.warnings)
    assert "no impedance sweep was measured" in emission.warnings


def test_what_is_only_proposed_is_not_green(diagnosed):
    session = load(diagnosed)
    base, last = ladder_of(session)
    for steps, mood in (((base,), "plain"), ((base, last), "good")):
        made = build_report(Materials(session, steps, None, session.analysis("diagnosis")))
        assert next(shown for label, _, shown in made.headline if label.startswith("Error after")) == mood
    judged = {"detector": "peak", "line": "quasi-peak", "worst_margin_db": 5.0, "verdict": "pass", "why": "below"}
    stored = {"verdict": "pass", "judged": [judged], "limit": {"title": "L"}}
    for what, mood in (("predicted", "plain"), ("measured", "good")):
        document = json.dumps({**stored, "judged_what": what}).encode()
        changed = dataclasses.replace(session, analysis_files={**session.analysis_files, "prediction": document})
        assert boxes(Materials(changed, (), None, None))[1].verdict[2] == mood


def test_sections_are_chosen_and_what_is_left_out_is_told(tmp_path, diagnosed):
    files = report(shutil.copytree(diagnosed, tmp_path / "s"), None, Choice(sections=frozenset({"fit", "equipment"})))
    page = parsed(files["report.html"].decode())
    anchors = [str(value) for name, value in page.attributes if name == "id"]
    assert [name for name in anchors if not name.startswith(("figure", "first")) and name in ("fit", "equipment", "emission", "identity")] == [
        "fit",
        "equipment",
    ]
    assert "this report leaves out: sweeps, ladder, comparison, diagnosis, emission, state, identity, procedure" in files["report.html"].decode()


def test_contents_lead_to_every_section(tmp_path, diagnosed):
    page = parsed(report(shutil.copytree(diagnosed, tmp_path / "s"))["report.html"].decode())
    links = [str(value)[1:] for name, value in page.attributes if name == "href" and str(value).startswith("#")]
    ids = [str(value) for name, value in page.attributes if name == "id"]
    assert set(links) <= set(ids)
    assert len(ids) == len(set(ids))
    assert {"fit", "ladder", "emission", "equipment", "identity"} <= set(links)
    assert page.tags.count("nav") == 1


def test_names_are_broken_at_their_joints_only():
    for name, pieces in {
        "insulation-leakage@Cf.resistance_ohm": ["insulation-leakage@", "Cf.", "resistance_ohm"],
        "GPIB0::17::INSTR-and-more": ["GPIB0::", "17::", "INSTR-and-more"],
        "resolution_bandwidth_hz": ["resolution_bandwidth_hz"],
        "a_very_long_name_of_a_setting": ["a_", "very_", "long_", "name_", "of_", "a_", "setting"],
        "0123456789abcdef" * 4: ["0123456789abcdef"] * 4,
    }.items():
        assert breakable(name).split(BREAK) == pieces


def test_a_logo_stands_at_the_margin(session, tmp_path):
    pdf = report(session, profile(tmp_path, 'logo = "logo.png"\n' + PROFILE), Choice("short"))["short.pdf"]
    page = pypdfium2.PdfDocument(pdf)[0]
    images = [one.get_bounds() for one in page.get_objects() if one.type == pypdfium2.raw.FPDF_PAGEOBJ_IMAGE]
    lines = [one.get_bounds() for one in page.get_objects() if one.type == pypdfium2.raw.FPDF_PAGEOBJ_PATH]
    # The line under the page's head goes from margin to margin.
    assert len(images) == 1
    assert images[0][2] == pytest.approx(max(right for _, _, right, _ in lines), abs=1.0)


def test_the_first_page_says_on_what_share_of_the_span_the_verdict_is(tmp_path):
    whole = 150e3 + 4.5e3 * np.arange(6634)
    for name, axis_hz, said in (
        ("part", whole[(whole >= 1e6) & (whole <= 2e6)], "PASS (measured levels, on 13 % of the limit's span)"),
        ("all", whole, "PASS (measured levels)"),
    ):
        quasi_peak, average = (
            me.Spectrum("quasi-peak", axis_hz, np.full(axis_hz.size, 40.0)),
            me.Spectrum("average", whole, np.full(whole.size, 30.0)),
        )
        with opened(measured_session(tmp_path / name, [], [quasi_peak, average])) as store:
            predict_session(store, limit="cispr32-b")
        (box,) = boxes(Materials(load(tmp_path / name), (), None, None))
        assert box.verdict[1] == said
