"""What the workbench's views are made of, and that it does to a session what the command line does."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import httpx
import numpy as np
import pytest
from conftest import simulated_sweeps
from laboratory_cases import PROFILE, profile
from made_once import made_once
from places import ROOT
from workbench_tools import ATTACKS, bench_of, client_of, listening, make_fitted_session, make_session, measuring_only, served, until

from motoremi.data.paths import MANIFEST
from motoremi.data.session import SessionWriter, load, reopen, verify
from motoremi.data.spectrum import Spectrum
from motoremi.data.text import clean_value
from motoremi.schema.bench_file import BenchFile
from motoremi.workbench.bench_view import Asked, Workplace
from motoremi.workbench.desk import Desk
from motoremi.workbench.events import Events
from motoremi.workbench.routes import Workbench
from motoremi.workbench.shelf import Shelf
from motoremi.workbench.terms import TERMS
from motoremi.workbench.views import rounded
from motoremi.workflow import add_to_session, drop_from_session, opened
from motoremi.workflow_emission import judged

pytestmark = pytest.mark.slow

STATIC = ROOT / "src" / "motoremi" / "workbench" / "static"
MOTOREMI = Path(sys.executable).with_name("motoremi")
RUN = {"procedure": "impedance_only", "bench": "simulated", "motor": "M1", "operator": "me", "seed": 7, "hides": "eddy-laminations", "ask": False}


@pytest.fixture
def at(fitted):
    """Asks for something of the one session."""
    workbench = bench_of(fitted.parent, fitted)
    client = client_of(workbench)
    base = f"/api/sessions/{workbench.shelf.first}"

    def ask(path: str = "", **body):
        answer = (
            client.post(base + path, json=body) if body or path in ("/drop", "/redo", "/report", "/fit", "/diagnose") else client.get(base + path)
        )
        return answer.json()

    return ask


@pytest.fixture
def measuring(monkeypatch):
    """Runs end with their last sweep: what becomes of the analysing steps is seen in `test_a_run_is_a_session`."""
    monkeypatch.setattr("motoremi.workbench.bench_view.load_procedure", measuring_only)


def test_curves_are_the_models(at, fitted):
    told, top = at("/curves"), Desk(fitted).top
    sweep = told["sweeps"][0]
    measured = np.array(sweep["real"]) + 1j * np.array(sweep["imag"])
    model = np.array(sweep["model_real"]) + 1j * np.array(sweep["model_imag"])
    # Numbers are told with eight digits.
    assert np.allclose(measured, top.measurement.sweeps[0].mean_ohm, rtol=2e-7, atol=0)
    assert np.allclose(model / measured - 1, top.errors()["short"], atol=2e-6)
    assert np.allclose(sweep["error_percent"], 100 * np.abs(model / measured - 1), atol=2e-4)


def test_adding_is_what_the_command_does(at, fitted):
    told = at("/add", effect="eddy-laminations")
    assert told["after"]["error"] < 0.1 * told["before"]["error"]
    assert load(fitted).ladder[-1]["fit"]["effects"] == ["eddy-laminations"]
    assert at("/drop")["after"]["effects"] == []
    with opened(fitted) as store:
        _, by_command = add_to_session(store, "eddy-laminations")
    assert by_command.rms_error_percent == pytest.approx(told["after"]["error"], rel=1e-9)
    assert not verify(fitted)


def test_what_others_change_is_seen(at, fitted):
    assert len(at("")["ladder"]) == 1
    with opened(fitted) as store:
        add_to_session(store, "eddy-laminations")
    assert [step["added"] for step in at("")["ladder"]] == ["", "eddy-laminations"]
    with opened(fitted) as store:
        drop_from_session(store)
    assert len(at("/story")["ladder"]) == 1


@pytest.mark.parametrize(("path", "body"), [("/add", {"effect": "core-loss"}), ("/drop", {}), ("/fit", {}), ("/diagnose", {})])
def test_a_ladder_that_moved_is_left_alone(at, fitted, path, body):
    shown = at("")["standing"]
    assert at("/story")["standing"] == shown
    with opened(fitted) as store:
        add_to_session(store, "eddy-laminations")
    before = [step["added"] for step in at("")["ladder"]]
    told = at(path, standing=shown, **body)
    assert "the current model is now the paper's circuit + eddy-laminations" in told["error"]
    assert [step["added"] for step in at("")["ladder"]] == before
    assert at("/drop", standing=at("")["standing"])["after"]["effects"] == []
    assert at("")["standing"] == shown


def test_the_list_says_motor_date_and_state(tmp_path):
    make_session(tmp_path / "complete", motor="M1")
    make_fitted_session(tmp_path / "diagnosed")
    sweeps, _ = simulated_sweeps(7)
    client = client_of(bench_of(tmp_path))

    def state(name):
        return next(one for one in client.get("/api/sessions").json()["sessions"] if one["name"] == name)["state"]

    with SessionWriter.create(tmp_path / "cut", {"title": "x", "motor": "M2"}) as writer:
        writer.add_sweep(sweeps[0])
        assert state("cut") == "measuring"
        writer.close("interrupted")
    assert state("cut") == "interrupted"
    # What a program leaves that was killed: nobody writes, and nothing says that it ended.
    log = tmp_path / "cut" / "session.jsonl"
    log.write_bytes(b"".join(log.read_bytes().splitlines(keepends=True)[:-1]))
    assert state("cut") == "interrupted"
    (tmp_path / "no").mkdir()
    (tmp_path / "no" / "session.jsonl").write_text("no session")
    assert [state(name) for name in ("complete", "diagnosed", "no")] == ["complete", "diagnosed", "unreadable"]
    entry = next(one for one in client.get("/api/sessions").json()["sessions"] if one["name"] == "complete")
    assert entry["motor"] == "M1"
    assert entry["began"].startswith(str(load(tmp_path / "complete").start["time"])[:16])


def test_a_session_that_is_being_measured_is_no_interrupted_one(tmp_path):
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    identifier = client.post("/api/run", json={**RUN, "ask": True}).json()["session"]
    # The session is there as soon as the run is.
    told = client.get(f"/api/sessions/{identifier}").json()
    assert (told["state"], told["resumable"]) == ("measuring", False)
    client.post("/api/run/stop", json={})
    workbench.place.run.wait()
    told = client.get(f"/api/sessions/{identifier}").json()
    assert (told["state"], told["resumable"]) == ("interrupted", True)


def test_a_run_that_still_writes_its_report_is_not_resumed(tmp_path):
    sweeps, _ = simulated_sweeps(7)
    client = client_of(bench_of(tmp_path))
    writer = SessionWriter.create(tmp_path / "s", {"title": "x", "procedure": measuring_only("impedance_only").source})
    writer.add_sweep(sweeps[0])
    writer.end()
    base = f"/api/sessions/{client.get('/api/sessions').json()['sessions'][0]['id']}"

    def told():
        head = client.get(base).json()
        return head["status"], head["interrupted"], head["resumable"], client.get(f"{base}/story").json()["next"]["do"] == "resume"

    assert told() == ("done", True, False, False)
    # Killed before its report was complete.
    writer.log.close()
    assert told() == ("done", True, True, True)


def test_pages_are_told_what_the_command_line_changes(fitted):
    workbench = bench_of(fitted.parent, fitted)
    with served(workbench) as address, listening(address) as events:
        listed = next(data for kind, data in events if kind == "sessions")
        assert [one["state"] for one in listed["sessions"]] == ["diagnosed"]
        with opened(fitted) as store:
            add_to_session(store, "eddy-laminations")
        assert next(data for kind, data in events if kind == "changed") == {"session": workbench.shelf.first}
        file = next((fitted / "sweeps").glob("*.csv"))
        file.write_bytes(file.read_bytes() + b"1,2,3\n")
        assert next(data for kind, data in events if kind == "changed") == {"session": workbench.shelf.first}
        make_session(fitted.parent / "new")
        listed = next(data for kind, data in events if kind == "sessions" and len(data["sessions"]) == 2)
        assert listed["sessions"][0]["name"] == "new"


def test_two_tabs_that_add_at_once_add_one(fitted):
    """Both show the same ladder and click at the same moment: one is told, and nothing is added twice or lost."""
    workbench = bench_of(fitted.parent, fitted)
    base, both, answers = f"/api/sessions/{workbench.shelf.first}", threading.Barrier(2), []
    shown = client_of(workbench).get(f"{base}/story").json()["standing"]

    def click(effect: str) -> None:
        client = client_of(workbench)
        both.wait()
        answers.append(client.post(f"{base}/add", json={"effect": effect, "standing": shown}).json())

    threads = [threading.Thread(target=click, args=(effect,)) for effect in ("eddy-laminations", "core-loss")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (done,), (refused,) = ([one for one in answers if ("error" in one) is wrong] for wrong in (False, True))
    assert "going on in this session" in refused["error"] or "was changed since this page showed it" in refused["error"]
    assert [step["fit"]["effects"] for step in load(fitted).ladder] == [[], done["after"]["effects"]]
    assert not verify(fitted)


def test_a_file_that_changed_on_disk_is_told_not_hidden(at, fitted):
    file = next((fitted / "sweeps").glob("*.csv"))
    kept = file.read_bytes()
    assert at("/curves")["sweeps"]
    file.write_bytes(kept.replace(b"1", b"2", 5))
    for path in ("", "/curves", "/story", "/fails"):
        assert "changed" in at(path)["error"], path
    file.write_bytes(kept)
    assert at("/curves")["sweeps"]


def test_a_folder_that_vanishes_is_one_sentence(at, fitted):
    away = fitted.rename(fitted.parent / "away")
    for path, body in (("/story", {}), ("/curves", {}), ("/add", {"effect": "core-loss"}), ("/fit", {}), ("/report", {})):
        assert "no such session folder" in at(path, **body)["error"], path
    away.rename(fitted)
    assert at("/story")["ladder"]


def test_form_sections_and_laboratory_of_the_report(fitted, tmp_path):
    lab = profile(tmp_path / "lab", 'logo = "logo.svg"\n' + PROFILE)
    shelf = Shelf(fitted.parent, [fitted])
    unsigned, signed = (client_of(Workbench(shelf, profile=own)) for own in (None, lab))
    address = f"/api/sessions/{shelf.first}/report"
    assert unsigned.get(address).json()["laboratory"] == ""
    for wrong, says in (
        ({"form": "medium"}, "no form"),
        ({"sections": "fit"}, "list of names"),
        ({"sections": ["x"]}, "no section"),
        ({"form": "short", "sections": ["fit"]}, "own sections"),
    ):
        assert says in unsigned.post(address, json=wrong).json()["error"]
    assert unsigned.get(address).json()["files"] == []
    assert signed.get(address).json()["laboratory"] == "EMC Laboratory North"
    assert set(signed.post(address, json={"form": "short"}).json()["files"]) == {"short.html", "short.pdf"}
    # The session keeps who signs.
    assert unsigned.get(address).json()["laboratory"] == "EMC Laboratory North"
    assert "report.html" in unsigned.post(address, json={"sections": ["fit"]}).json()["files"]
    assert "this report leaves out" in (fitted / "report" / "report.html").read_text()


def test_a_session_that_somebody_writes_is_left_alone(at, fitted):
    before = at("")["ladder"]
    with opened(fitted):
        assert "error" in at("/add", effect="eddy-laminations")
    assert at("")["ladder"] == before


def test_pointing_leads_from_the_model_to_the_measurement(at):
    told, drawn = at("/look?effect=eddy-laminations"), at("/story")["panels"][0]["frames"]
    wanted_db = np.array(drawn[1]["series"][0]["values"])
    _, given_db, error_percent = (np.array(values) for values in told["panels"][0])
    # What is left is the error of the model with the effect.
    assert np.sqrt(np.mean((wanted_db - given_db) ** 2)) < 0.02 * np.sqrt(np.mean(wanted_db**2))
    assert told["after"]["error"] < told["before"]["error"]
    assert np.mean(error_percent**2) < 0.01 * np.mean(np.array(drawn[2]["series"][0]["values"]) ** 2)


def test_a_preview_asked_of_a_ladder_that_has_moved_is_no_error(at):
    """The page asks with the ladder that it shows; an effect added meanwhile cannot be previewed once more."""
    shown = at("/story")["standing"]
    at("/add", effect="eddy-laminations")
    assert at(f"/look?effect=eddy-laminations&standing={shown}") == {"superseded": True}
    assert "in the model already" in at("/look?effect=eddy-laminations")["error"]


def test_what_cannot_be_withdrawn_is_a_sentence(at):
    names = [one["name"] for one in at("")["sweeps"]]
    assert names[0] == "short-1"
    assert "no sweep of the motor as it is would be left" in at("/withdraw", names=names, why="x")["error"]
    assert "say why" in at("/withdraw", names=names[:1])["error"]
    assert "no sweep, spectrum or single value is called 'x'" in at("/withdraw", names=["x"], why="x")["error"]
    assert "is not withdrawn" in at("/withdraw", names=names[:1], restore=True)["error"]
    assert [one["name"] for one in at("")["sweeps"]] == names
    assert at("/withdraw", names=names[:1], why="bad contact") == {"names": names[:1], "emptied_ladder": True, "discarded": False}
    assert at("")["withdrawn"] == [{"name": "short-1", "why": "bad contact"}]
    assert [one["name"] for one in at("")["sweeps"]] == names[1:]


def test_a_spectrum_is_withdrawn_with_the_verdict_on_it(tmp_path):
    frequency_hz = np.geomspace(150e3, 30e6, 300)
    with SessionWriter.create(tmp_path / "spectra", {"title": "spectra", "motor": "M"}) as writer:
        for level_dbuv in (30.0, 80.0):
            writer.add_spectrum(Spectrum("quasi-peak", frequency_hz, np.full(300, level_dbuv)))
        judged(writer, "cispr14-1")
        writer.close("done")
    workbench = bench_of(tmp_path, tmp_path / "spectra")
    client, base = client_of(workbench), f"/api/sessions/{workbench.shelf.first}"
    assert client.get(f"{base}/emission").json()["prediction"]["verdict"] == "fail"
    assert [one["name"] for one in client.get(base).json()["spectra"]] == ["quasi-peak-1", "quasi-peak-2"]
    done = client.post(f"{base}/withdraw", json={"names": ["quasi-peak-2"], "why": "attenuator not entered"}).json()
    assert done == {"names": ["quasi-peak-2"], "emptied_ladder": False, "discarded": True}
    shown = client.get(f"{base}/emission").json()
    assert (shown["prediction"], len(shown["spectra"])) == (None, 1)
    assert [one["name"] for one in client.get(base).json()["spectra"]] == ["quasi-peak-1"]


def test_a_session_read_just_before_it_is_closed_is_complete_afterwards(tmp_path):
    folder = make_session(tmp_path / "one")
    manifest = (folder / MANIFEST).read_bytes()
    (folder / MANIFEST).unlink()
    desk = Desk(folder)
    assert desk.session.interrupted
    (folder / MANIFEST).write_bytes(manifest)
    assert not desk.session.interrupted


def test_a_pointer_that_moved_on_is_not_waited_for(fitted):
    desk = Desk(fitted)
    answers = {}
    with desk.glancing:
        threads = []
        for effect in ("core-loss", "eddy-laminations"):
            before = desk.looking
            threads.append(threading.Thread(target=lambda name=effect: answers.__setitem__(name, desk.glance(name))))
            threads[-1].start()
            until(lambda asked=before: desk.looking is not asked)
    for thread in threads:
        thread.join()
    assert answers["core-loss"] is None
    assert answers["eddy-laminations"] is not None


def test_fails_ranking_next_and_inspection(at):
    fails = at("/fails")
    assert fails["verdict"] == "fail"
    assert {band["sweep"] for band in fails["bands"]} == {"short", "open"}
    effects = at("/story")
    assert effects["current"]
    assert all(entry["formula"] for entry in effects["catalogue"])
    assert effects["diagnosis"]["candidates"][0]["effect"] == "eddy-laminations"
    assert {entry["id"] for entry in effects["catalogue"]} >= {candidate["effect"] for candidate in effects["diagnosis"]["candidates"]}
    assert at("/next")["why"]
    inspected = at("/inspect?element=La")
    assert {sweep["sweep"] for sweep in inspected["sweeps"]} <= {"short", "open"}
    assert len(inspected["sweeps"][0]["real"]) == len(inspected["sweeps"][0]["frequency_hz"])


def test_judging_by_another_tolerance(at):
    assert at("/fails")["tolerance"]["error_percent"] == 10.0
    at("/judge", error_percent=200.0)
    assert at("/fails")["verdict"] == "pass"
    assert "above 0" in at("/judge", error_percent=-1)["error"]
    assert "number" in at("/judge", error_percent="x")["error"]


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("/look?effect=nonsense", None),
        ("/look?effect=", None),
        ("/look?of=nonsense&effect=skin-effect", None),
        ("/look?of=emission&effect=arc-breakdown", None),
        ("/add", {"of": "emission", "effect": "arc-breakdown"}),
        ("/redo", None),
        ("/inspect?element=../x", None),
        ("/inspect", None),
        ("/add", {"effect": "nonsense"}),
        ("/add", {"effect": 5}),
        ("/challenge", {"answer": ["adequate"]}),
        ("/challenge", {"answer": "adequate"}),
        ("/challenge", None),
        ("/resume", {"procedure": "impedance_only", "bench": "simulated"}),
        ("/drop", None),
        ("/predict", {"limit": "/etc/passwd"}),
        ("/predict", {"limit": "../x.toml"}),
    ],
)
def test_errors_are_one_sentence(at, path, body):
    told = at(path, **(body or {}))
    assert "\n" not in told["error"]
    assert "Traceback" not in told["error"]
    assert "internal" not in told["error"]


def test_a_session_without_sweeps_says_so(tmp_path):
    SessionWriter.create(tmp_path / "empty", {"title": "x"}).close("done")
    workbench = bench_of(tmp_path, tmp_path / "empty")
    client, base = client_of(workbench), f"/api/sessions/{workbench.shelf.first}"
    assert client.get(base).json()["ladder"] == []
    for path in ("/curves", "/fails", "/look?effect=skin-effect", "/next", "/inspect?element=La"):
        answer = client.get(base + path)
        assert answer.status_code == 400, path
        assert answer.json()["error"]


def _session_with_a_fit(folder: Path) -> None:
    Desk(make_session(folder)).fit()


@pytest.mark.parametrize(
    ("name", "payload"),
    [
        ("diagnosis", {"verdict": 1}),
        ("diagnosis", {"candidates": "x", "verdict": "adequate", "effects": [], "families": [], "confidence": 1, "where": []}),
        ("ladder", {"steps": [1]}),
        ("ladder", {"steps": [{"fit": {"effects": ["nonsense"]}}]}),
        ("comparison", {"tolerance": {"nonsense": 1}}),
        ("prediction", {"verdict": "x"}),
    ],
)  # fmt: skip
def test_analyses_of_others_are_told_not_obeyed(tmp_path, name, payload):
    folder = tmp_path / "s"
    shutil.copytree(made_once("session-with-a-fit", _session_with_a_fit), folder)
    with reopen(folder) as writer:
        writer.save_analysis(name, payload)
        writer.close("done")
    workbench = bench_of(tmp_path, folder)
    client, base = client_of(workbench), f"/api/sessions/{workbench.shelf.first}"
    told = [client.get(base + path) for path in ("/curves", "/fails", "/story", "/next", "/emission")]
    told.append(client.post(base + "/report", json={}))
    assert any(answer.status_code == 400 for answer in told)
    for answer in told:
        assert answer.status_code in (200, 400)
        assert "internal" not in answer.text


@pytest.mark.parametrize("attack", ATTACKS)
def test_outside_text_arrives_as_data(tmp_path, attack):
    folder = make_session(tmp_path / "s", motor=attack, operator=attack, title=attack)
    with reopen(folder) as writer:
        identity = {"vendor": attack, "model": attack, "serial": attack, "firmware": attack}
        writer.emit("instrument", role=attack, resource=attack, identity=identity)
        writer.close("done")
    workbench = bench_of(tmp_path, folder)
    answer = client_of(workbench).get(f"/api/sessions/{workbench.shelf.first}")
    assert answer.headers["content-type"] == "application/json"
    # Nothing that a terminal or a page obeys; bidirectional and invisible characters are written out.
    text = answer.json()["start"]["motor"]
    assert text.isprintable()
    assert answer.json()["instruments"][0]["identity"]["model"] == text


def test_rounding_keeps_digits_and_marks_gaps():
    values = np.array([1.23456789012e-12, -9.87654321098e15, 0.0, np.nan, np.inf])
    assert rounded(values) == [1.2345679e-12, -9.8765432e15, 0.0, None, None]


@pytest.mark.usefixtures("few_effects")
def test_a_run_is_a_session(tmp_path):
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    identifier = client.post("/api/run", json=RUN).json()["session"]
    assert "going on" in client.post("/api/run", json=RUN).json()["error"]
    workbench.place.run.wait()
    state = workbench.place.state()["run"]
    assert state["status"] == "done", state["message"]
    told = client.get(f"/api/sessions/{identifier}").json()
    assert told["start"]["motor"] == "M1"
    assert told["start"]["operator"] == "me"
    assert not verify(workbench.shelf.desk(identifier).path)
    sweep = next(document for document in state["documents"] if document["kind"] == "sweep")
    trace = client.get(f"/api/run/trace/{sweep['seq']}").json()
    assert len(trace["real"]) == sweep["points"]
    assert "error" in client.get("/api/run/trace/0").json()
    # What the motor hides is not told before the diagnosis, which is the run's last step but one.
    session = load(workbench.shelf.desk(identifier).path)
    assert "eddy-laminations" not in json.dumps(session.start)
    assert session.analysis("diagnosis")["effects"] == ["eddy-laminations"]
    assert (session.path / "report" / "report.html").is_file()


def test_what_answers(tmp_path):
    found = client_of(bench_of(tmp_path)).post("/api/bench/look", json=RUN).json()["found"]
    assert found[0]["identity"]["model"] == "4294A"


@pytest.mark.parametrize(
    "change",
    [
        {"procedure": "../x"}, {"procedure": 5}, {"bench": "real"}, {"bench": "x"}, {"seed": -1}, {"seed": True}, {"hides": "x"},
        {"motor": "x" * 300}, {"motor": ["x"]},
    ],
)  # fmt: skip
def test_a_run_that_cannot_be(tmp_path, change):
    workbench = bench_of(tmp_path)
    answer = client_of(workbench).post("/api/run", json={**RUN, **change})
    assert answer.status_code == 400
    assert answer.json()["error"]
    assert workbench.place.run is None


def test_a_page_that_comes_late_catches_up_and_going_stops_nothing(tmp_path):
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    with served(workbench) as address:
        with listening(address) as early:
            assert next(early) == ("state", {"run": None, "jobs": []})
            client.post("/api/run", json={**RUN, "procedure": "fixture_check", "ask": True})
            for kind, data in early:
                if kind == "run" and data["prompt"]:
                    break
        # The first page is gone, in the middle of the run.
        assert workbench.place.run.active
        with listening(address) as late:
            kind, data = next(late)
            assert kind == "state"
            run = data["run"]
            assert run["prompt"][0].startswith("Leave the fixture open")
            # The first document is written when the session is made, before anybody listens.
            assert [document["seq"] for document in run["documents"]] == list(range(1, len(run["documents"]) + 1))
            assert "instrument" in [document["kind"] for document in run["documents"]]
            seen = run["documents"]
            client.post("/api/run/answer", json={})
            for kind, data in late:
                client.post("/api/run/answer", json={})
                if kind == "document":
                    seen.append(data["document"])
                elif kind == "run" and data["status"] != "running":
                    assert data["status"] == "done"
                    break
    documents = load(workbench.shelf.desk(run["session"]).path).documents
    # A page is told line ends within a text written out.
    assert seen == clean_value(list(documents[1:]))


def test_stop_makes_safe_keeps_the_data_and_the_run_can_go_on(tmp_path, measuring):
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    identifier = client.post("/api/run", json={**RUN, "ask": True}).json()["session"]
    run = workbench.place.run
    asked: list[str] = []
    while not asked or not asked[0].startswith("Connect the analyser between one terminal"):
        if asked:
            client.post("/api/run/answer", json={})
        until(lambda before=asked: run.state()["prompt"] not in ([], before))
        asked = run.state()["prompt"]
    client.post("/api/run/stop", json={})
    run.wait()
    assert run.state()["status"] == "stopped"
    assert [document["safe"] for document in run.state()["documents"] if document["kind"] == "safe"] == [True]
    told = client.get(f"/api/sessions/{identifier}").json()
    assert (told["status"], told["resumable"]) == ("interrupted", True)
    assert len(told["sweeps"]) == 3
    assert client.get(f"/api/sessions/{identifier}/story").json()["next"] == {"do": "resume", "text": "Resume the run"}
    assert "error" not in client.post(f"/api/sessions/{identifier}/resume", json=RUN).json()
    workbench.place.run.wait()
    assert workbench.place.state()["run"]["status"] == "done"
    assert client.get(f"/api/sessions/{identifier}/story").json()["next"]["do"] != "resume"
    assert len(client.get(f"/api/sessions/{identifier}").json()["sweeps"]) == 6


@pytest.mark.parametrize("seed", [7, 8])
def test_a_run_that_hides_something_can_go_on(tmp_path, measuring, seed):
    """What it hides was drawn and nobody is told; a page opened anew does not even know which motor it was."""
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    unknown = {**RUN, "hides": "something"}
    identifier = client.post("/api/run", json={**unknown, "ask": True, "seed": seed}).json()["session"]
    run = workbench.place.run
    until(lambda: run.state()["prompt"])
    client.post("/api/run/stop", json={})
    run.wait()
    assert run.state()["status"] == "stopped"
    assert "error" not in client.post(f"/api/sessions/{identifier}/resume", json={**unknown, "seed": 1}).json()
    workbench.place.run.wait()
    assert workbench.place.state()["run"]["status"] == "done"


def test_a_motor_that_is_typed_does_not_take_the_serial_number_of_another(tmp_path):
    place = Workplace(Shelf(tmp_path), Events(), BenchFile(motor="M1", serial="1", operator="Anna"))

    def stated(**typed):
        bench_file = place.bench_file_of(Asked.of({**RUN, "bench": "real", "motor": "", **typed}))
        return bench_file.motor, bench_file.serial

    assert stated() == stated(motor="M1") == ("M1", "1")
    assert stated(motor="M2") == ("M2", "")
    assert stated(motor="M2", serial="2") == ("M2", "2")
    assert stated(serial="3") == ("M1", "3")


def test_motor_and_serial_number_are_kept_with_the_session(tmp_path, measuring):
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    identifier = client.post("/api/run", json={**RUN, "serial": "17", "ask": True}).json()["session"]
    client.post("/api/run/stop", json={})
    workbench.place.run.wait()
    start = load(workbench.place.run.folder).start
    assert (start["motor"], start["serial"]) == ("M1", "17")
    told = client.post(f"/api/sessions/{identifier}/resume", json={**RUN, "motor": "M2"}).json()
    assert "was begun with motor 'M1', but 'M2' is stated now" in told["error"]
    assert "error" not in client.post(f"/api/sessions/{identifier}/resume", json={**RUN, "serial": "17", "operator": "Bert"}).json()
    workbench.place.run.wait()
    resumed = next(document for document in load(workbench.place.run.folder).documents if document["kind"] == "resume")
    assert (resumed["motor"], resumed["serial"], resumed["operator"]) == ("M1", "17", "Bert")


def test_not_done_ends_the_run_and_is_no_data(tmp_path):
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    identifier = client.post("/api/run", json={**RUN, "ask": True}).json()["session"]
    run = workbench.place.run
    until(lambda: run.state()["prompt"])
    assert "must be one of done, not done, stop" in client.post("/api/run/answer", json={"answer": "perhaps"}).json()["error"]
    client.post("/api/run/answer", json={"answer": "not done"})
    run.wait()
    assert run.state()["status"] == "failed"
    assert run.state()["message"].startswith("the operator answered 'not done' to: Leave the fixture open")
    assert [document["answer"] for document in run.state()["documents"] if document["kind"] == "prompt"] == ["not done"]
    told = client.get(f"/api/sessions/{identifier}").json()
    assert (told["status"], told["resumable"], told["sweeps"]) == ("interrupted", True, [])
    # The other button of the prompt.
    client.post(f"/api/sessions/{identifier}/resume", json={**RUN, "ask": True})
    run = workbench.place.run
    until(lambda: run.state()["prompt"])
    client.post("/api/run/answer", json={"answer": "stop"})
    run.wait()
    assert run.state()["status"] == "stopped"
    assert [document["answer"] for document in run.state()["documents"] if document["kind"] == "prompt"] == ["stop"]


def test_a_run_that_fails_says_why(tmp_path, monkeypatch):
    workbench = bench_of(tmp_path)

    def broken(*args, **kwargs):
        raise RuntimeError("boom\nboom")

    monkeypatch.setattr("motoremi.workbench.runs.run", broken)
    client_of(workbench).post("/api/run", json=RUN)
    workbench.place.run.wait()
    state = workbench.place.state()["run"]
    assert state["status"] == "failed"
    assert "boom" in state["message"]


def test_challenge_keeps_the_seal_until_you_answer(tmp_path, monkeypatch):
    # Always the same motor: what is hidden decides whether the diagnosis takes two seconds or twenty, and does not matter here.
    monkeypatch.setattr("motoremi.workbench.routes.secrets.randbelow", lambda below: 1)
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    identifier = client.post("/api/challenge", json={}).json()["session"]
    base = f"/api/sessions/{identifier}"
    assert client.get(base).json()["sealed"]
    client.post(base + "/fit", json={})
    assert "sealed" in client.post(base + "/diagnose", json={}).json()["error"]
    assert "sealed" in client.get(base + "/challenge").json()["error"]
    assert client.get(base + "/story").json()["diagnosis"] is None
    assert "error" in client.post(base + "/challenge", json={"answer": []}).json()
    assert "error" in client.post(base + "/challenge", json={"answer": ["nonsense"]}).json()
    assert client.get(base).json()["sealed"]
    told = client.post(base + "/challenge", json={"answer": ["adequate"]}).json()
    assert told["yours"]["outcome"] in ("right", "missed", "wrong")
    assert told["tool"]["answer"]["verdict"]
    assert told == client.get(base + "/challenge").json()
    assert "already" in client.post(base + "/challenge", json={"answer": ["adequate"]}).json()["error"]


def test_every_term_of_the_page_is_explained():
    used = set()
    for file in STATIC.rglob("*.js"):
        text = file.read_text()
        for part in text.split('term("')[1:]:
            used.add(part.partition('"')[0])
    assert used
    assert used <= set(TERMS)
    # Detectors are looked up by name.
    assert {"peak", "quasi-peak", "average", "rms-average"} <= set(TERMS)


def test_the_page_names_no_other_host_and_makes_no_markup():
    for file in [*STATIC.glob("*"), *(STATIC / "views").glob("*")]:
        if file.is_file():
            text = file.read_text()
            assert "https://" not in text, file
            assert "http://" not in text.replace("http://www.w3.org/2000/svg", ""), file
            for forbidden in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function", "style="):
                assert forbidden not in text, (file, forbidden)


def test_the_command_serves_on_loopback_and_ends_with_ctrl_c(fitted):
    command = [MOTOREMI, "workbench", str(fitted), "--folder", str(fitted.parent), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    text = ""
    while not text.rstrip().endswith("}"):
        line = process.stdout.readline()
        assert line, process.stderr.read()
        text += line
    address = json.loads(text)["address"]
    assert address.startswith("http://127.0.0.1:")
    with httpx.Client(follow_redirects=True) as page:
        assert "motoremi workbench" in page.get(address).text
        told = page.get(address.partition("?")[0] + "api/sessions").json()
    assert told["sessions"][0]["name"] == fitted.name
    cookie = {f"motoremi-{address.rpartition(':')[2].partition('/')[0]}": address.partition("token=")[2]}
    # A page is still open: its stream is ended, not cut.
    with httpx.stream("GET", address.partition("?")[0] + "api/events", cookies=cookie, timeout=60) as stream:
        lines = stream.iter_lines()
        assert next(lines) == "event: state"
        process.send_signal(signal.SIGINT)
        assert "data" in "".join(lines)
    _, error = process.communicate(timeout=60)
    assert error == "" or error.startswith("motoremi: stopped")
    assert process.returncode in (0, 130)


def test_the_command_refuses_what_is_no_session(tmp_path):
    command = [MOTOREMI, "workbench", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


def test_an_analysis_that_is_just_being_replaced_is_no_damage(at, fitted):
    """A command writes the file first and the line of the log after it: a page that looks in between sees what was there before."""
    before = at("/story")
    file = fitted / "analysis" / "ladder.json"
    file.write_bytes(file.read_bytes() + b" ")
    assert at("/story") == before
