"""Work that takes its time: one counter, elapsed and remaining time, Cancel; and long curves thinned for the page."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from workbench_tools import bench_of, client_of, measuring_only, until

from motoremi.data.session import load
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.interrupts import Cancelled, cancelled_by, checkpoint
from motoremi.progress import WHOLE, part
from motoremi.workbench import desk as desk_module
from motoremi.workbench import jobs as jobs_module
from motoremi.workbench.desk import Desk
from motoremi.workbench.events import Events
from motoremi.workbench.jobs import Jobs
from motoremi.workbench.story import Sweeps
from motoremi.workbench.thinning import CELLS, seen
from motoremi.workbench.thinning import WHOLE as LONGEST_WHOLE
from motoremi.workflow import add_to_session, opened

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("few_effects")]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_counter_never_starts_over(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(jobs_module.time, "monotonic", lambda: now[0])
    jobs = Jobs(Events())
    with jobs.begin("a", "diagnosing") as job:
        assert jobs.to_list()[0]["remaining_s"] is None
        now[0] += 10
        job.report("core-loss", 1, 4)
        (told,) = jobs.to_list()
        assert (told["share"], told["elapsed_s"], told["remaining_s"]) == (0.25, 10, 30)
        now[0] += 5
        job.report("bearing-film", 0, 4)
        (told,) = jobs.to_list()
        assert (told["doing"], told["share"], told["elapsed_s"], told["remaining_s"]) == ("bearing-film", 0.25, 15, 45)
    assert jobs.to_list() == []


def test_one_thing_at_a_time_for_each_session():
    jobs = Jobs(Events())
    with jobs.begin("a", "fitting"), jobs.begin("b", "fitting"):
        with pytest.raises(BadInput, match="fitting is going on in this session: wait for its end or cancel it first"), jobs.begin("a", "drop"):
            pass
        assert len(jobs.to_list()) == 2
    with jobs.begin("a", "drop"):
        pass


def test_a_checkpoint_stops_who_was_cancelled_and_nobody_else():
    checkpoint()
    asked = threading.Event()
    with cancelled_by(asked.is_set):
        checkpoint()
        asked.set()
        with pytest.raises(Cancelled):
            checkpoint()
        other = threading.Thread(target=checkpoint)
        other.start()
        other.join()
    checkpoint()


def test_parts_count_for_the_whole():
    told = []
    whole = part(lambda *what: told.append(what), 0.5, 1.0)
    for progress in (whole, part(whole, 0.0, 0.5), part(None, 0, 1)):
        if progress is not None:
            progress("x", 1, 2)
    assert told == [("x", 750, WHOLE), ("x", 625, WHOLE)]


def test_a_diagnosis_is_cancelled_while_others_look(fitted):
    workbench = bench_of(fitted.parent, fitted)
    client, other = client_of(workbench), client_of(workbench)
    base, before, answers = f"/api/sessions/{workbench.shelf.first}", contents(fitted), []
    work = threading.Thread(target=lambda: answers.append(client.post(f"{base}/diagnose", json={})))
    work.start()
    until(lambda: any(job["share"] > 0 for job in workbench.jobs.to_list()))
    # It can be looked at, and not changed.
    assert other.get(f"{base}/story").json()["ladder"]
    refused = other.post(f"{base}/drop", json={}).json()
    assert workbench.jobs.to_list()[0]["title"] == "diagnosing"
    assert refused["error"] == "diagnosing is going on in this session: wait for its end or cancel it first"
    assert other.post(f"{base}/cancel", json={}).status_code == 200
    work.join()
    assert answers[0].json() == {"cancelled": True}
    assert contents(fitted) == before
    assert workbench.jobs.to_list() == []
    # Where nothing goes on, there is nothing to cancel.
    assert other.post(f"{base}/cancel", json={}).status_code == 200


@pytest.mark.parametrize("what", ["fit", "report"])
def test_a_fit_and_a_report_are_cancelled_too(fitted, what):
    desk, jobs, before = Desk(fitted), Jobs(Events()), contents(fitted)
    with jobs.begin("s", what), pytest.raises(Cancelled):
        getattr(desk, what)(progress=lambda *progress: jobs.cancel("s"))
    assert contents(fitted) == before


def test_an_inspection_is_made_once(fitted, monkeypatch):
    desk, made = Desk(fitted), []
    monkeypatch.setattr(desk_module, "inspect", lambda fit, element: made.append((fit.effects, element)) or object())
    assert desk.inspection("La") is desk.inspection("La")
    desk.inspection("Ca")
    desk.add("core-loss")
    desk.inspection("Ca")
    assert made == [((), "La"), ((), "Ca"), (("core-loss",), "Ca")]


def test_adding_takes_as_many_as_the_command_and_can_be_cancelled(fitted, monkeypatch):
    """Of modes of a winding; what is counted here is what is stored, so one fit stands for each mode."""
    desk, told = Desk(fitted), []
    assert next(one for one in Sweeps(desk).catalogue() if one["accumulates"])["id"] == "winding-modes"
    more = [Fit.add(desk.top, effect) for effect in ("core-loss", "skin-effect")]

    def further(fit, effect, progress):
        progress(f"one more of {effect}", 1, 2)
        yield more[:1]
        checkpoint()
        yield more[1:]

    monkeypatch.setattr(desk_module, "further", further)
    _, after = desk.add("eddy-laminations", progress=lambda *what: told.append(what))
    assert (len(desk.steps), after.effects, told) == (4, ("skin-effect",), [("one more of eddy-laminations", 1, 2)])
    desk.drop(count=3)
    contained, jobs = contents(fitted), Jobs(Events())
    with jobs.begin("s", "adding an effect") as job, pytest.raises(Cancelled):
        desk.add("eddy-laminations", progress=lambda *what: job.cancelled.set())
    assert contents(fitted) == contained


def test_a_ladder_that_moves_meanwhile_is_left_alone(fitted):
    desk, moved = Desk(fitted), []

    def tell(*progress) -> None:
        if not moved:
            with opened(fitted) as store:
                moved.append(add_to_session(store, "eddy-laminations"))

    with pytest.raises(BadInput, match="the model of this session was changed elsewhere meanwhile: nothing was stored"):
        desk.diagnose(tell)
    assert load(fitted).ladder[-1]["fit"]["effects"] == ["eddy-laminations"]


def test_the_fits_of_a_diagnosis_are_kept(fitted, monkeypatch):
    desk = Desk(fitted)
    desk.diagnose()
    ranked = {one["effect"]: one["rms_error_percent"] for one in desk.session.analysis("diagnosis")["candidates"]}
    monkeypatch.setattr(Fit, "add", lambda *anything: pytest.fail("fitted again"))
    monkeypatch.setattr(desk_module, "restore", lambda *anything: pytest.fail("read back"))
    before, after = desk.add("eddy-laminations")
    assert after.rms_error_percent == pytest.approx(ranked["eddy-laminations"])
    assert desk.steps == (before, after)
    desk.drop()
    desk.redo()
    assert desk.steps == (before, after)
    monkeypatch.undo()
    assert Desk(fitted).standing == desk.standing


def test_a_long_curve_keeps_its_peaks():
    frequency = np.geomspace(1e5, 3e7, 10_001)
    flat, dipped = np.ones(10_001), np.ones(10_001)
    flat[7001], dipped[[2003, 9990]] = 50.0, (0.01, np.nan)
    kept = seen(frequency, flat, dipped)
    assert len(kept) <= CELLS * 5 + 1
    assert np.all(np.diff(kept) > 0)
    assert {0, 7001, 2003, 10_000} <= set(kept.tolist())
    assert seen(frequency[:LONGEST_WHOLE], flat[:LONGEST_WHOLE]).size == LONGEST_WHOLE


@pytest.mark.parametrize(("low", "high", "whole"), [(3000, 4000, True), (0, 1500, True), (9000, 10_000, True), (1000, 9000, False)])
def test_the_points_of_a_shown_span_are_not_left_out(low, high, whole):
    frequency = np.geomspace(1e5, 3e7, 10_001)
    curve = np.sin(np.arange(10_001))
    all_over = set(seen(frequency, curve).tolist())
    kept = seen(frequency, curve, band_hz=(frequency[low], frequency[high]))
    assert np.all(np.diff(kept) > 0)
    assert all_over < set(kept.tolist())
    assert (set(range(low, high + 1)) <= set(kept.tolist())) == whole
    assert len(kept) < 2 * CELLS * 3 + LONGEST_WHOLE
    # Beside what was measured there is nothing to add.
    assert set(seen(frequency, curve, band_hz=(1.0, 2.0)).tolist()) == all_over


def test_a_long_session_is_sent_short(tmp_path):
    from motoremi.data.session import SessionWriter
    from motoremi.data.spectrum import Spectrum
    from motoremi.data.sweep import ImpedanceSweep

    frequency = np.geomspace(1e5, 3e7, 10_001)
    impedance = 50 + 2j * np.pi * frequency * 1e-6
    impedance[5000] *= 100
    with SessionWriter.create(tmp_path / "long", {"title": "long", "motor": "M"}) as writer:
        writer.add_sweep(ImpedanceSweep("short", frequency, impedance))
        writer.add_spectrum(Spectrum("peak", frequency, np.full(10_001, 40.0)))
        writer.close("done")
    workbench = bench_of(tmp_path, tmp_path / "long")
    client, base = client_of(workbench), f"/api/sessions/{workbench.shelf.first}"
    (sweep,) = client.get(f"{base}/curves").json()["sweeps"]
    assert sweep["points"] == 10_001
    assert len(sweep["frequency_hz"]) < 5000
    assert max(sweep["real"]) == pytest.approx(5000)
    (panel,) = client.get(f"{base}/story").json()["panels"]
    assert len(panel["frequency_hz"]) == len(panel["frames"][0]["series"][0]["values"]) < 5000
    (spectrum,) = client.get(f"{base}/emission").json()["spectra"]
    assert (spectrum["points"], len(spectrum["frequency_hz"]) < 5000) == (10_001, True)
    # Zoomed, the points that were left out come.
    span = f"low={frequency[4000]}&high={frequency[5000]}"
    zoomed = {
        "curves": client.get(f"{base}/curves?{span}").json()["sweeps"][0],
        "story": client.get(f"{base}/story?{span}").json()["panels"][0],
        "panels": client.get(f"{base}/panels?{span}").json()["panels"][0],
        "emission": client.get(f"{base}/emission?{span}").json()["spectra"][0],
    }
    for name, told in zoomed.items():
        shown = np.array(told["frequency_hz"])
        assert np.count_nonzero((shown >= 0.999999 * frequency[4000]) & (shown <= 1.000001 * frequency[5000])) == 1001, name
        assert told["points"] == 10_001, name
    for wrong in ("low=5&high=1", "low=x&high=1", "low=1", "low=1&high=inf", "low=nan&high=1"):
        assert "low below high" in client.get(f"{base}/curves?{wrong}").json()["error"]


def test_a_run_tells_elapsed_and_remaining_time(tmp_path, monkeypatch):
    monkeypatch.setattr("motoremi.workbench.bench_view.load_procedure", measuring_only)
    workbench = bench_of(tmp_path)
    client = client_of(workbench)
    asked = {"procedure": "impedance_only", "bench": "simulated", "seed": 7, "hides": "nothing"}
    assert client.post("/api/run", json=asked).status_code == 200
    workbench.place.run.wait()
    progress = workbench.place.run.state()["progress"]
    assert set(progress) == {"doing", "share", "elapsed_s", "remaining_s"}
    assert 0 < progress["share"] <= 1
    assert progress["elapsed_s"] > 0
