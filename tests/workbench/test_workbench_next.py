"""The view Next: what to measure, and its answer as a value, as files, or from the bench; in a client and in a browser."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path
from typing import Any

import pytest
from conftest import simulated_sweeps
from few_effects import FEW, seeking
from made_once import made_once
from playwright.sync_api import expect
from workbench_browser import PATIENCE_MS, Watched, drop, findings, launched, needs_chromium
from workbench_tools import bench_of, client_of, make_fitted_session, served, until

from motoremi.cli.demo_investigate import measured_once
from motoremi.data.conditions import SingleValue, parse_value
from motoremi.data.session import SessionWriter, load, reopen
from motoremi.errors import BadInput
from motoremi.interrupts import Cancelled
from motoremi.run.answer import NotDone
from motoremi.run.requested import MeasurementRequest
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import load_procedure, parse_procedure
from motoremi.workbench.desk import Desk
from motoremi.workbench.events import Events
from motoremi.workbench.investigations import InvestigationRun, plan_of
from motoremi.workbench.runs import Stopped
from motoremi.workflow_on_bench import Plan

BYTES = {"Content-Type": "application/octet-stream"}


class Page:
    """A client of one session."""

    def __init__(self, folder: Path) -> None:
        self.workbench = bench_of(folder.parent, folder)
        self.client = client_of(self.workbench)
        self.folder = folder
        (entry,) = [one for one in self.client.get("/api/sessions").json()["sessions"] if one["name"] == folder.name]
        self.base = f"/api/sessions/{entry['id']}"

    def get(self, path: str) -> Any:
        return self.client.get(self.base + path).json()

    def post(self, path: str, **body: Any) -> Any:
        return self.client.post(self.base + path, json=body).json()


def csv_of(termination: str, seed: int = 7, effects: tuple[str, ...] = ("eddy-laminations",)) -> str:
    """One sweep as a file."""
    sweeps, _ = simulated_sweeps(seed, effects)
    sweep = next(one for one in sweeps if one.termination == termination)
    rows = (f"{f:.9g},{z.real:.9g},{z.imag:.9g}" for f, z in zip(sweep.frequency_hz, sweep.impedance_ohm, strict=True))
    return "frequency_hz,real_ohm,imag_ohm\n" + "\n".join(rows) + "\n"


def _short_only(folder: Path) -> None:
    sweeps, _ = simulated_sweeps(7, ("eddy-laminations",))
    with SessionWriter.create(folder, {"title": "t", "motor": "one sweep", "analyser": "4294a"}) as writer:
        writer.add_sweep(next(one for one in sweeps if one.termination == "short"))
        writer.close("done")
    desk = Desk(folder)
    desk.fit()
    with seeking():
        desk.diagnose()


@pytest.fixture
def short_only(tmp_path: Path) -> Path:
    folder = tmp_path / "short-only"
    shutil.copytree(made_once("short-only", _short_only), folder)
    return folder


@pytest.mark.slow
def test_what_cannot_be_measured_here_is_left_out(tmp_path):
    page = Page(make_fitted_session(tmp_path / "s"))
    every = page.get("/next")
    listed = [one["id"] for one in (every["asked"], *every["alternatives"]) if one]
    left = page.get(f"/next?without={listed[0]}")
    assert listed[0] not in [one["id"] for one in (left["asked"], *left["alternatives"]) if one]
    assert left["without"] == [listed[0]]
    assert sum(share for _, share in every["probabilities"]) == pytest.approx(1, abs=0.02)
    assert "unknown measurement" in page.get("/next?without=rubbish")["error"]


@pytest.mark.slow
@pytest.mark.usefixtures("few_effects")
def test_a_value_is_added_and_the_session_diagnosed_anew(tmp_path):
    page = Page(make_fitted_session(tmp_path / "s"))
    assert "in Ohm, the unit of dc-resistance" in page.post("/answer", value="dc-resistance=2m")["error"]
    assert not load(page.folder).values
    assert page.post("/answer", value="dc-resistance=2.5ohm") == {"notes": []}
    assert [one.value_si for one in load(page.folder).values] == [2.5]
    told = page.get("/next")
    assert told["steps"][-1]["brought"].startswith("dc-resistance=2.5Ohm")
    assert told["steps"][-1]["taught_bits"] >= 0
    assert "dc-resistance" not in [one["id"] for one in (told["asked"], *told["alternatives"]) if one]


@pytest.mark.slow
@pytest.mark.usefixtures("few_effects")
def test_the_missing_sweep_is_asked_for_and_brought_as_a_file(short_only):
    page = Page(short_only)
    assert page.get("/next")["asked"]["id"] == "open-sweep"
    assert "choose at least one file" in page.post("/answer", condition="")["error"]
    page.client.post(
        "/api/files", params={"name": "open.csv"}, content=csv_of("open").encode(), headers={"Content-Type": "application/octet-stream"}
    )
    # A file for another condition is refused before anything is stored.
    assert "error" in page.post("/answer", condition="second-temperature=-400degC")
    assert {sweep.termination for sweep in load(page.folder).sweeps} == {"short"}
    page.client.post("/api/files/1", json={"used_as": "open"})
    assert page.post("/answer", condition="") == {"notes": []}
    assert {sweep.termination for sweep in load(page.folder).sweeps} == {"short", "open"}
    assert page.client.get("/api/files").json()["files"] == []
    told = page.get("/next")
    assert (told["steps"][0]["asked"], told["newer"]) == ("open-sweep", False)
    with reopen(page.folder) as writer:
        writer.add_value(parse_value("dc-resistance=2.5ohm"))
    assert page.get("/next")["newer"]


@pytest.mark.slow
def test_what_was_brought_is_kept_where_its_diagnosis_is_cancelled(tmp_path, monkeypatch):
    def cancelled(store, progress):
        raise Cancelled("cancelled")

    page = Page(make_fitted_session(tmp_path / "s"))
    monkeypatch.setattr("motoremi.workbench.next_view.diagnose_session", cancelled)
    assert page.post("/answer", value="dc-resistance=2.5ohm") == {"notes": ["The diagnosis was cancelled; what was added is kept."]}
    assert len(load(page.folder).values) == 1
    assert page.get("/next")["newer"]


def test_an_undiagnosed_session_says_what_to_do_first(tmp_path):
    folder = tmp_path / "s"
    with SessionWriter.create(folder, {"title": "t", "motor": "m"}) as writer:
        for sweep in simulated_sweeps(7, ())[0]:
            writer.add_sweep(sweep)
        writer.close("done")
    page = Page(folder)
    assert "diagnose this session first" in page.get("/next")["error"]
    assert "no bench file was named" in page.post("/investigate", bench="real")["error"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "says"),
    [({"budget": "3 apples"}, "as a time"), ({"budget": "0s"}, "is not possible"), ({"without": ["x"]}, "unknown"), ({"without": 3}, "list")],
)
def test_a_plan_that_cannot_be_read_is_refused(tmp_path, body, says):
    assert says in Page(make_fitted_session(tmp_path / "s")).post("/investigate", bench="simulated", **body)["error"]


@pytest.mark.slow
@seeking(FEW | {"bearing-film", "dielectric-relaxation@Cr"})
def test_one_measurement_on_the_simulated_bench_then_the_rest(tmp_path):
    folder = tmp_path / "s"
    measured_once(folder, 5, ("bearing-film",))
    page = Page(folder)
    page.post("/investigate", bench="simulated", one=True)
    assert "a run is going on" in page.post("/investigate", bench="simulated")["error"]
    page.client.post("/api/run/stop", json={})
    until(lambda: not page.workbench.place.run.active)
    # Stopped, the session stays usable, and the investigation goes on where it was.
    assert (page.workbench.place.run.state()["status"], page.get("")["status"], page.get("")["resumable"]) == ("stopped", "done", False)
    page.post("/investigate", bench="simulated", one=True)
    until(lambda: not page.workbench.place.run.active)
    assert page.workbench.place.run.state()["status"] == "done", page.workbench.place.run.state()["message"]
    told = page.get("/next")
    assert (told["benches"], len(told["steps"])) == (["simulated"], 1)
    page.post("/investigate", bench="simulated")
    until(lambda: not page.workbench.place.run.active)
    told = page.get("/next")
    assert told["stop"] == "one-stands"
    assert told["probabilities"][0][0] == "bearing-film"


class _Asking(InvestigationRun):
    """A run of which only the operator's part is tried."""

    def __init__(self, tmp_path: Path) -> None:
        procedure = parse_procedure(dict(load_procedure("impedance_only").source), "impedance_only")
        super().__init__("s", procedure, BenchFile(backend="sim"), Plan(10.0), tmp_path, Events())


def _answered(run: InvestigationRun, act: Any) -> SingleValue:
    """The value that the run gets once its operator has acted."""
    request = MeasurementRequest("dc-resistance", "measure the winding's DC resistance", terminations=())
    threading.Thread(target=lambda: (until(lambda: run.state()["example"]), act())).start()
    return run.value(request)


def test_the_operator_of_a_real_bench_types_a_value_on_the_page(tmp_path):
    run = _Asking(tmp_path)
    refused = []

    def types() -> None:
        try:
            run.give("2 apples")
        except BadInput as error:
            refused.append(str(error))
        run.give("2.5 ohm")

    assert _answered(run, types).value_si == 2.5
    assert len(refused) == 1
    assert run.state()["prompt"] == []
    with pytest.raises(NotDone):
        _answered(run, lambda: run.answer("not done"))
    with pytest.raises(Stopped):
        _answered(run, run.stop)


def test_a_budget_is_a_time():
    assert plan_of({"budget": "90min", "one": True}).budget_minutes == pytest.approx(90)
    assert plan_of({"one": True}).most == 1


@pytest.mark.slow
@needs_chromium
def test_a_session_of_one_sweep_is_led_to_its_answer_by_clicks(short_only):
    workbench = bench_of(short_only.parent, short_only)
    with served(workbench) as address, launched() as browser:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("next")
        expect(page.locator("#next-id")).to_have_text("open-sweep")
        expect(page.locator("#bring")).to_be_disabled()
        page.click("#not-possible")
        expect(page.locator("#next-id")).not_to_have_text("open-sweep")
        page.click("#all-possible")
        expect(page.locator("#next-id")).to_have_text("open-sweep")
        drop(page, {"open.csv": csv_of("open").encode()})
        expect(page.locator("#files-read")).to_contain_text("open.csv")
        page.select_option("#files-read select", "open")
        expect(page.locator("#bring")).to_be_enabled()
        assert findings(page) == []
        page.click("#bring")
        expect(page.locator("#way")).to_contain_text("open-sweep", timeout=PATIENCE_MS)
        assert findings(page) == []
        watched.close()
