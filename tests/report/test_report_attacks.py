"""The attack list: text that means harm in every field that an instrument, a file or an analysis can fill, in every rendering."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from xml.etree import ElementTree

import pypdfium2
import pytest
from report_cases import HOSTILE, Poison, parsed, together, whole_session
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter, load
from motoremi.data.text import clean_text
from motoremi.report.pdf import in_font
from motoremi.workflow import opened, report_session

pytestmark = pytest.mark.slow

# Stored for machines; the report shows what it works out from the sweeps instead.
NOT_SHOWN = (
    # What is asked next is told by `next_measurement`.
    "diagnosis.question",
    *("diagnosis.where", "diagnosis.analyser", "diagnosis.best.effects", "diagnosis.next_measurement.id"),
    # The values that `motoremi add` begins with; the report has those of the ladder.
    "diagnosis.best.parameters",
    *("emission-diagnosis.where", "emission-diagnosis.best.effects", "emission-diagnosis.candidates.family"),
    *("emission-diagnosis.next_measurement.id", "emission-diagnosis.observations.id", "emission.limit", "emission.steps.parameters name"),
    *(f"prediction.limit.{name}" for name in ("lines", "lisn", "name", "port")),
)
ANALYSES = ("diagnosis", "prediction", "emission-diagnosis", "emission")

# Between footer and header of a page, in points.
FOOT, HEAD = 51, 800


@pytest.fixture(scope="module")
def sound(tmp_path_factory, measure) -> me.Session:
    return load(whole_session(tmp_path_factory.mktemp("sound") / "session", measure))


def attacked(path: Path, sound: me.Session, poison: Poison) -> Path:
    """A session with the text wherever a bench, an instrument, a file or another program could have put it."""
    start = {name: poison(f"start.{name}") for name in ("title", "motor", "serial", "operator", "ambient", "software")}
    start |= {"imported": [poison("imported")], "calibrated": {"analyser": poison("calibrated")}, "backend": poison("backend")}
    start["procedure"] = {"steps": [{"do": "sweep"}, {"do": poison("procedure.do"), "with": poison("procedure.with")}]}
    with SessionWriter.create(path, start) as writer:
        identity = {name: poison(f"identity.{name}") for name in ("vendor", "model", "serial", "firmware")}
        settings = {poison("setting name"): poison("setting")}
        role, resource = poison("role"), poison("resource")
        writer.emit("instrument", role=role, driver="4294a", resource=resource, identity=identity, settings=settings)
        writer.emit("step-start", step=1, of=2, do=poison("step.do"), parameters={poison("step name"): poison("step value")})
        writer.emit("safe", role=poison("safe.role"), safe=False, problem=poison("safe.problem"))
        writer.emit("resume", step=poison("resume.step"), stored=0, again=[])
        for sweep in sound.sweeps:
            writer.add_sweep(sweep.with_metadata(source=poison("sweep.source")))
        for spectrum in sound.spectra:
            writer.add_spectrum(spectrum.with_metadata(condition=poison("spectrum.condition"), source=poison("spectrum.source")))
        writer.close("failed", poison("reason"))
    with opened(path) as store:
        for name in ANALYSES:
            store.save_analysis(name, poison.into(sound.analysis(name), name))
        ladder = [{**step, "notes": [poison("ladder note")]} for step in sound.ladder]
        store.save_analysis("ladder", {"schema": "motoremi.ladder/1", "steps": ladder})
    return path


@pytest.mark.parametrize("text", together(HOSTILE))
def test_every_field_is_shown_and_none_obeyed(tmp_path, sound, text):
    poison = Poison(text)
    path = attacked(tmp_path / "session", sound, poison)
    with opened(path) as store:
        files = {file.name: file.read_bytes() for file in report_session(store)}

    html = files["report.html"].decode()
    page = parsed(html)
    assert not {"script", "img", "iframe", "object", "link"} & set(page.tags[page.tags.index("body") :])
    assert not any(name.startswith("on") or str(value).strip().lower().startswith("javascript") for name, value in page.attributes)
    assert not set("\x1b\x00\u202e\u2028") & set(html)

    page_shows = poison.found_in("".join(page.text), text)
    missing = {place for place in poison.places.values() if not place.startswith(NOT_SHOWN)} - {poison.places[number] for number in page_shows}
    assert missing == set(), "\n".join(sorted(missing))

    pdf = pypdfium2.PdfDocument(files["report.pdf"])
    written = "".join(map(in_font, clean_text(text)))
    # A text may go over a page's end: without the footer and header in between it is whole.
    sides = [one.get_textpage() for one in pdf]
    between = "".join(side.get_text_bounded(bottom=FOOT, top=HEAD) for side in sides)
    pdf_shows = poison.found_in("".join(side.get_text_range() for side in sides), written) | poison.found_in(between, written)
    assert sorted(poison.places[number] for number in page_shows ^ pdf_shows) == []

    ElementTree.fromstring(files["junit.xml"])
    assert not set("\x1b\x00\u202e\u2028") & set(files["junit.xml"].decode())
    json.loads(files["report.json"])
    assert {len(row) for row in csv.reader(io.StringIO(files["parameters.csv"].decode()))} == {7}


@pytest.mark.parametrize("text", together(HOSTILE))
def test_terminal_shows_and_does_not_obey(tmp_path, sound, text):
    path = attacked(tmp_path / "session", sound, Poison(text))
    for words in (("next",), ("ladder",), ("report",), ("verify",)):
        result = CliRunner().invoke(app, [words[0], str(path), *words[1:]])
        assert result.exit_code in (0, 1, 2)
        assert not set("\x1b\x00\u202e\u2028") & set(result.output)
        assert not isinstance(result.exception, Exception) or isinstance(result.exception, me.BadInput)
