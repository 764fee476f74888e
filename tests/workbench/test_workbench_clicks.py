"""By clicks in a real browser: a session from dropped files, two side by side, exports, and a diagnosis that is cancelled."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest
from conftest import simulated_sweeps
from playwright.sync_api import Route, expect
from workbench_browser import PATIENCE_MS, Watched, choose_by_keys, drop, findings, keep, needs_chromium
from workbench_tools import ATTACKS, bench_of, make_session, served

from motoremi.arrays import Progress
from motoremi.data.csvfiles import impedance_csv
from motoremi.data.session import load, verify
from motoremi.diagnosis.diagnosis import Diagnosis
from motoremi.interrupts import checkpoint
from motoremi.workbench import desk
from motoremi.workflow import Store, diagnose_session

pytestmark = [needs_chromium, pytest.mark.slow, pytest.mark.usefixtures("few_effects", "few_source_effects")]
SWEEPS = simulated_sweeps(7, ("eddy-laminations",), repeats=2)[0]


def measured() -> dict[str, bytes]:
    """The files of one motor."""
    return {f"motor_{sweep.termination}_{number}.csv": impedance_csv(sweep).encode() for number, sweep in enumerate(SWEEPS)}


def refusals_only(watched: Watched) -> None:
    """A refusal is what the browser itself calls an error."""
    assert all("400" in line or "413" in line for line in watched.trouble), watched.trouble
    watched.trouble.clear()


def test_dropped_files_become_a_session_that_opens(browser, tmp_path):
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        # Who has no session yet is asked for files; they may be dropped on any view.
        watched.drawn("files")
        watched.see("bench")
        drop(page, measured())
        watched.drawn("files")
        rows = page.locator("#files-read tbody tr")
        expect(rows).to_have_count(4)
        expect(rows.first).to_contain_text("impedance sweep · 401 points · 150 kHz - 30 MHz")
        assert [page.input_value(f"#use-{number}") for number in (1, 2, 3, 4)] == ["short", "short", "open", "open"]
        page.select_option("#use-4", "leave out")
        page.fill("#import-motor", "Dropped motor 7")
        assert findings(page) == []
        keep(page, "files")
        page.select_option("#import-analyser", "4294a")
        # What was chosen and typed outlives a reload.
        page.reload()
        watched.drawn("files")
        assert page.input_value("#use-4") == "leave out"
        assert page.input_value("#import-motor") == "Dropped motor 7"
        page.click("#make-session")
        watched.drawn("story")
        expect(page.locator("#session-choice option:checked")).to_contain_text("Dropped motor 7")
        watched.see("files")
        expect(page.locator("#files-read")).to_have_count(0)
        expect(page.locator("#sessions tbody tr")).to_have_count(1)
        watched.close()
    session = load(tmp_path / "Dropped-motor-7")
    assert [sweep.termination for sweep in session.sweeps] == ["short", "short", "open"]
    assert session.start["imported"] == ["motor_short_0.csv", "motor_short_1.csv", "motor_open_2.csv"]
    assert session.start["analyser"] == "4294a"
    assert not verify(tmp_path / "Dropped-motor-7")


def test_files_are_chosen_by_keys(browser, tmp_path):
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        choose_by_keys(watched, measured())
        expect(page.locator("#files-read tbody tr")).to_have_count(4)
        page.focus("#import-motor")
        page.keyboard.type("By keys")
        page.keyboard.press("Enter")
        watched.drawn("story")
        watched.close()
    assert load(tmp_path / "By-keys").start["motor"] == "By keys"


def test_files_of_the_wrong_kind_are_told_in_a_sentence_each(browser, tmp_path):
    sweep = measured()["motor_short_0.csv"]
    files = {
        "photo.jpg": b"\xff\xd8\xff\xe0" + bytes(range(256)),
        "all.zip": b"PK\x03\x04" + bytes(100),
        "short.csv": sweep,
        "again.csv": sweep,
        "notes.txt": b"hello\nworld\n",
        ATTACKS[1]: b"frequency_hz,level_dbuv\n1e6,1\n2e6,2\n",
    }
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.drawn("files")
        drop(page, files)
        expect(page.locator("#refused li")).to_have_count(3)
        told = page.locator("#refused li").all_inner_texts()
        assert [text.partition(":")[0] for text in told] == ["photo.jpg", "all.zip", "again.csv"]
        assert "is the same file as short.csv" in told[2]
        expect(page.locator("#files-read tbody tr")).to_have_count(3)
        expect(page.locator("#files-read")).to_contain_text("needs the columns")
        expect(page.locator("#files-read")).to_contain_text(ATTACKS[1])
        assert page.locator("main img").count() == 0
        # A file of 2 GB is not even sent: the browser knows its size.
        page.evaluate("Object.defineProperty(File.prototype, 'size', { get: () => 2 ** 31 })")
        asked = len(watched.asked)
        drop(page, {"huge.csv": sweep})
        expect(page.locator("#refused li")).to_have_text(
            ["huge.csv: is larger than 64 MiB, the most that a measurement file may have; export fewer points"]
        )
        assert not [url for url in watched.asked[asked:] if "huge" in url]
        page.click("#clear-files")
        expect(page.locator("#files-read")).to_have_count(0)
        assert page.evaluate("window.hacked") is None
        refusals_only(watched)
        watched.close()
    assert list(tmp_path.iterdir()) == []


def test_two_sessions_side_by_side(browser, fitted, tmp_path):
    make_session(tmp_path / "second", seed=8, motor="Other motor")
    with served(bench_of(tmp_path, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("together")
        expect(page.locator("main")).to_contain_text("Choose two or more sessions")
        watched.see("files")
        page.check("#sessions tr:has-text('fitted') input")
        assert page.is_disabled("#compare")
        page.check("#sessions tr:has-text('second') input")
        page.click("#compare")
        watched.drawn("together")
        rows = page.locator("#together-verdicts tbody tr")
        expect(rows).to_have_count(2)
        expect(rows.nth(0)).to_contain_text("missing from the model: eddy-laminations")
        expect(rows.nth(1)).to_contain_text("no fit")
        expect(page.locator("#together-parameters")).to_contain_text("± ")
        # Short, open and the spectrum: magnitude, phase and change of each sweep, the level.
        expect(page.locator(".plots canvas")).to_have_count(7)
        expect(page.locator("figcaption").first).to_contain_text("second")
        # Told apart without colour.
        dashes = page.locator("figcaption").first.locator("line").evaluate_all("(all) => all.map((one) => one.getAttribute('stroke-dasharray'))")
        assert len(set(dashes)) == len(dashes) == 2
        keep(page, "together")
        page.reload()
        watched.drawn("together")
        expect(rows).to_have_count(2)
        # A change of any of them is followed, also of one that is not open.
        desk.Desk(tmp_path / "second").fit()
        expect(rows.nth(1)).not_to_contain_text("no fit")
        page.set_viewport_size({"width": 390, "height": 844})
        assert findings(page) == []
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        with page.expect_download() as download:
            page.click("[data-export='comparison.csv']")
        assert Path(download.value.path()).read_text().startswith("session,parameter")
        watched.close()


def test_everything_is_exported_by_clicks(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("session")
        page.wait_for_selector("#exports button")
        names = page.locator("#exports button").all_inner_texts()
        assert {"motor.cir", "emission-test.cir", "open.s1p", "short-model.z1p", "sweeps.csv", "session.h5", "sweeps.parquet"} <= set(names)
        for name, begin in (("motor.cir", b"*"), ("open.s1p", b"! motoremi"), ("sweeps.csv", b"termination"), ("session.h5", b"\x89HDF")):
            with page.expect_download() as download:
                page.click(f"[data-export='{name}']")
            assert download.value.suggested_filename == name
            assert Path(download.value.path()).read_bytes().startswith(begin), name
        watched.close()


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_diagnosis_is_cancelled_and_leaves_the_session_as_it_was(browser, fitted, monkeypatch):
    before, cancelled = contents(fitted), threading.Event()

    def long(store: Store, progress: Progress) -> Diagnosis:
        """A diagnosis that lasts until it is cancelled, the first time: a quick one would be over before the page is looked at."""
        progress("looking", 1, 10)
        for _ in range(600):
            if cancelled.is_set():
                break
            checkpoint()
            time.sleep(0.1)
        return diagnose_session(store, progress=progress)

    monkeypatch.setattr(desk, "diagnose_session", long)
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("story")
        page.click("#why summary")
        page.click("#diagnose")
        job = page.locator("#jobs .job")
        expect(job).to_contain_text("diagnosing")
        expect(job).to_contain_text(" so far")
        assert findings(page) == []
        # A page that comes in the middle sees the same, and may cancel it.
        late = Watched(browser, address)
        expect(late.page.locator("#jobs .job")).to_contain_text("diagnosing")
        # The page reads the session anew after a cancelled job; a click counts before that is answered.
        held: list[Route] = []
        answered = False
        page.route("**/story?**", lambda route: route.continue_() if answered else held.append(route))
        late.page.click("#jobs .cancel")
        # "within 2 s": Playwright looks until then.
        expect(job).to_have_count(0, timeout=2000)
        late.close()
        expect(page.locator("#trouble")).to_have_text("Cancelled: the session is as it was.Close")
        assert contents(fitted) == before
        # It can be done again, and to its end.
        cancelled.set()
        with page.expect_response(lambda answer: answer.url.endswith("/diagnose"), timeout=PATIENCE_MS) as done:
            page.click("#diagnose")
        assert done.value.ok
        assert held
        answered = True
        for one in held:
            one.continue_()
        expect(job).to_have_count(0)
        watched.close()
    assert contents(fitted) != before


def test_a_sweep_is_withdrawn_with_a_reason_and_used_again(browser, fitted):
    count = len(load(fitted).sweeps)
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("session")
        page.click("button[aria-label='Withdraw short-1']")
        expect(page.locator("#withdraw")).to_contain_text("Why short-1 is not to be used")
        expect(page.locator("#withdraw-why")).to_be_focused()
        # Without a reason nothing is sent.
        page.keyboard.press("Enter")
        page.keyboard.type(ATTACKS[1])
        assert findings(page) == []
        page.keyboard.press("Enter")
        again = page.locator("button[aria-label='Use short-1 again']")
        expect(again).to_be_visible()
        expect(page.locator("#trouble")).to_contain_text("fit this session again")
        expect(page.locator("main")).to_contain_text(ATTACKS[1])
        (one,) = load(fitted).withdrawn
        assert (one["name"], one["why"]) == ("short-1", ATTACKS[1])
        assert len(load(fitted).sweeps) == count - 1
        assert load(fitted).ladder == []
        assert verify(fitted) == []
        again.click()
        expect(page.locator("button[aria-label='Withdraw short-1']")).to_be_visible()
        assert len(load(fitted).sweeps) == count
        watched.close()
