"""The laboratory that signs, chosen on the page: its profile and logo are kept in the workbench's folder, and nothing else is read."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import pytest
from laboratory_cases import PROFILE, SVG, measured_session, pages_of, png, spectrum
from workbench_tools import ATTACKS, client_of

from motoremi.data.laboratory import read_laboratory
from motoremi.workbench.routes import STATIC, Workbench
from motoremi.workbench.shelf import Shelf

ADDRESS = "/api/laboratory"
WITH_LOGO = 'logo = "logo.svg"\n' + PROFILE


def sent(**files: str | bytes) -> dict[str, Any]:
    """Files as the page sends them; an underscore stands for the point."""
    told = ((name.replace("_", "."), data.encode() if isinstance(data, str) else data) for name, data in files.items())
    return {"files": [{"name": name, "data": base64.b64encode(data).decode()} for name, data in told]}


@pytest.fixture
def session(tmp_path) -> Path:
    return measured_session(tmp_path / "work" / "s", spectra=[spectrum()])


@pytest.fixture
def workbench(session) -> Workbench:
    return Workbench(Shelf(session.parent, [session]))


@pytest.fixture
def client(workbench):
    return client_of(workbench)


def report_of(workbench: Workbench) -> str:
    return f"/api/sessions/{workbench.shelf.first}/report"


def who_signs(client: Any, report: str) -> tuple[str, bool]:
    """As the view Report says it, and whether another can be chosen there."""
    told = client.get(report).json()
    return told["laboratory"], told["choosable"]


@pytest.mark.slow
def test_a_profile_chosen_on_the_page_signs_and_counts(client, workbench, session):
    report = report_of(workbench)
    assert who_signs(client, report) == ("", True)
    assert client.post(ADDRESS, json=sent(lab_toml=WITH_LOGO, logo_svg=SVG)).json() == {"laboratory": "EMC Laboratory North"}
    assert who_signs(client, report) == ("EMC Laboratory North", True)
    assert client.post(report, json={"form": "short"}).status_code == 200
    first = "\n".join(pages_of((session / "report" / "short.pdf").read_bytes()))
    assert "EMC-2026-0001" in first
    assert "EMC Laboratory North" in first
    # It signs again when the workbench has been started again, and the next session has the next number.
    other = measured_session(session.parent / "other", spectra=[spectrum(line="N")])
    again = Workbench(Shelf(session.parent, [other]))
    assert client_of(again).post(report_of(again), json={"form": "short"}).status_code == 200
    assert "EMC-2026-0002" in "\n".join(pages_of((other / "report" / "short.pdf").read_bytes()))
    # Another profile takes its place; the numbers go on.
    assert client.post(ADDRESS, json=sent(new_toml=PROFILE.replace("North", "South"))).json() == {"laboratory": "EMC Laboratory South"}
    assert who_signs(client, report) == ("EMC Laboratory South", True)
    assert (session.parent / "laboratory" / "profile.register.csv").read_text().count("EMC-2026-") == 2


def test_every_page_is_told(workbench, client):
    told: list[str] = []
    workbench.events.publish = lambda kind, data: told.append(kind)  # type: ignore[method-assign]
    client.post(ADDRESS, json=sent(lab_toml=PROFILE))
    assert told == ["files"]


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({}, "a TOML file"),
        ({"logo_svg": SVG}, "a TOML file"),
        ({"a_toml": PROFILE, "b_toml": PROFILE}, "a TOML file"),
        ({"lab_toml": WITH_LOGO}, "choose that file together with the profile"),
        ({"lab_toml": WITH_LOGO, "logo_png": png()}, "choose that file together with the profile"),
        ({"lab_toml": 'logo = "/etc/passwd"\n' + PROFILE}, "choose that file together"),
        ({"lab_toml": 'logo = "../s/session.jsonl"\n' + PROFILE}, "choose that file together"),
        ({"lab_toml": "logo = [1]\n" + PROFILE}, "logo"),
        ({"lab_toml": WITH_LOGO, "logo_svg": b"\xff\xd8\xff\xe0 a photo"}, "logo.svg: is not an image"),
        ({"lab_toml": WITH_LOGO, "logo_svg": "<svg onload='x()'/>"}, "logo.svg"),
        ({"lab_toml": "name = 'x"}, "lab.toml: is not TOML"),
        ({"lab_toml": "name = 'x'\nsurname = 'y'"}, "lab.toml: surname"),
        ({"lab_toml": b"PK\x03\x04" + bytes(100)}, "lab.toml: is a ZIP archive"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_keeps_nothing(client, session, files, says):
    answer = client.post(ADDRESS, json=sent(**files))
    assert answer.status_code == 400
    assert says in answer.json()["error"]
    assert "/tmp" not in answer.json()["error"]
    assert not (session.parent / "laboratory").exists()


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"files": "x"},
        {"files": [1]},
        {"files": [{"name": "a.toml"}]},
        {"files": [{"name": "a.toml", "data": "é"}]},
        {"files": [{"name": 1, "data": ""}]},
    ],
)
def test_a_request_that_holds_no_files_is_one_sentence(client, body):
    answer = client.post(ADDRESS, json=body)
    assert answer.status_code == 400
    assert "a TOML file" in answer.json()["error"]


def test_hostile_names_and_texts_are_text(client, session):
    for attack in ATTACKS:
        told = client.post(ADDRESS, json={"files": [{"name": f"{attack}.toml", "data": base64.b64encode(b"name = 1").decode()}]})
        assert told.status_code == 400
        assert "\x1b" not in told.json()["error"]
        assert "\n" not in told.json()["error"]
    assert sorted(path.name for path in session.parent.iterdir()) == ["s"]


def test_who_was_named_at_the_start_signs(session, tmp_path):
    named = tmp_path / "named.toml"
    named.write_text('name = "Named at the start"\n')
    workbench = Workbench(Shelf(session.parent, [session]), profile=named)
    client = client_of(workbench)
    assert who_signs(client, report_of(workbench)) == ("Named at the start", False)
    assert "without --profile" in client.post(ADDRESS, json=sent(lab_toml=PROFILE)).json()["error"]


def test_a_profile_is_larger_than_other_requests_and_still_has_a_limit(client):
    big = png() + bytes(200_000)
    assert client.post(ADDRESS, json=sent(logo_png=big)).status_code == 400
    assert client.post(ADDRESS, content=b" " * (4 * 1024**2 + 1), headers={"Content-Type": "application/json"}).status_code == 413


def test_the_profile_to_fill_in_is_one(tmp_path):
    text = (STATIC / "laboratory.toml").read_text()
    assert read_laboratory(STATIC / "laboratory.toml").name == "Name of the laboratory"
    # What stands in comments is one too.
    _, comments, table = text.rpartition("# [[equipment]]")
    filled = text.removesuffix(comments + table) + "".join(line.removeprefix("# ") for line in (comments + table).splitlines(keepends=True))
    (tmp_path / "filled.toml").write_text(filled)
    assert read_laboratory(tmp_path / "filled.toml").equipment[0].certificate == "Number of the certificate"
