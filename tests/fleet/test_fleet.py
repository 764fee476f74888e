"""Many sessions: the same results wherever they are computed, nothing lost, and figures that find what was put in."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import motoremi
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter
from motoremi.data.storage import AppendFile, StorageError
from motoremi.errors import BadInput, InstrumentError
from motoremi.fleet import run as fleet_run
from motoremi.fleet.fleet_frames import motors_of, table_of
from motoremi.fleet.limits import parse_tolerances, tolerance_factor
from motoremi.fleet.motors import deviation
from motoremi.fleet.page import fleet_html, usual_span
from motoremi.fleet.run import RESULTS, DaskCluster, ExecutorMaker, LocalProcesses, run_fleet, sessions_in, settled, stored_results
from motoremi.fleet.statistics import fleet_figures
from motoremi.fleet.work import Job, serial_of, work

pytestmark = pytest.mark.slow


class InThisProcess(Executor):
    """The smallest executor."""

    def submit(self, fn, /, *args, **kwargs):
        future: Future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Serial(ExecutorMaker):
    def open(self) -> Executor:
        return InThisProcess()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, measure):
    root = tmp_path_factory.mktemp("fleet") / "motors"
    for number in range(1, 7):
        sweeps, _ = measure(number, ("core-loss",) if number == 2 else (), 2)
        with SessionWriter.create(
            root / ("golden" if number < 4 else "line") / f"motor-{number}", {"title": "x", "serial": f"SN{number:03d}"}
        ) as writer:
            for sweep in sweeps:
                writer.add_sweep(
                    me.ImpedanceSweep(sweep.termination, sweep.frequency_hz[::8], sweep.impedance_ohm[::8], None, {"analyser": "4294a"})
                )
            writer.close("done")
    with SessionWriter.create(root / "line" / "nothing", {"title": "x"}) as writer:
        writer.close("done")
    shutil.copytree(root / "line" / "motor-4", root / "line" / "tampered")
    victim = next((root / "line" / "tampered" / "sweeps").iterdir())
    victim.write_text(victim.read_text().replace("1", "2", 5))
    return root


def jobs_in(folder: Path) -> list[Job]:
    # Diagnosing is what takes long: one of the motors is enough.
    return [Job(session, str(folder), session == "golden/motor-2", 1) for session in sessions_in(folder)]


@pytest.fixture(scope="module")
def serial_results(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("serial")
    assert run_fleet(jobs_in(folder), out, Serial()) == 8
    return list(settled(jobs_in(folder), out / RESULTS))


def test_bad_sessions_are_told_and_stop_nothing(serial_results):
    assert [r["session"] for r in serial_results] == sorted(r["session"] for r in serial_results)
    troubled = {r["session"]: r["trouble"] for r in serial_results if r["status"] == "bad"}
    assert set(troubled) == {"line/nothing", "line/tampered"}
    assert "no impedance sweep" in troubled["line/nothing"]
    assert "changed after it was stored" in troubled["line/tampered"]
    second = next(r for r in serial_results if r["session"] == "golden/motor-2")
    named = {*second["diagnosis"]["effects"], *(m for family in second["diagnosis"]["families"] for m in family)}
    assert "core-loss" in named


def test_a_session_gives_here_what_it_gives_alone(folder, serial_results):
    session = me.load(folder / "golden" / "motor-1")
    alone = me.fit(me.dc_motor(), session.sweeps)
    stored = next(r for r in serial_results if r["session"] == "golden/motor-1")["base"]
    assert {name: entry["value"] for name, entry in stored["parameters"].items()} == {
        name: value for name, value in alone.parameters.items() if alone.determined(name)
    }


def test_processes_give_the_same_bit_for_bit_and_go_on_where_they_stopped(folder, serial_results, tmp_path):
    jobs = jobs_in(folder)
    told = []

    def stop_after_three(name, done, total):
        told.append((done, total))
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_fleet(jobs, tmp_path, LocalProcesses(2), stop_after_three)
    assert told == [(1, 8), (2, 8), (3, 8)]
    with open(tmp_path / RESULTS, "ab") as file:
        file.write(b'{"session": "golden/mot')  # a crash in the middle of a line
    assert run_fleet(jobs, tmp_path, LocalProcesses(2)) == 5
    assert list(settled(jobs, tmp_path / RESULTS)) == serial_results
    assert run_fleet(jobs, tmp_path, LocalProcesses(2)) == 0


def test_new_data_are_computed_again_and_later_analyses_are_not(folder, tmp_path, measure):
    root = tmp_path / "copy"
    shutil.copytree(folder / "line" / "motor-5", root / "a")
    run_fleet([Job("a", str(root), False, 1)], tmp_path / "out", Serial())
    with me.data.session.reopen(root / "a") as writer:
        writer.save_analysis("note", {"x": 1})
    assert run_fleet([Job("a", str(root), False, 1)], tmp_path / "out", Serial()) == 0
    assert run_fleet([Job("a", str(root), False, 2)], tmp_path / "out", Serial()) == 1
    with me.data.session.reopen(root / "a") as writer:
        writer.add_sweep(measure(9)[0][0])
    assert run_fleet([Job("a", str(root), False, 1)], tmp_path / "out", Serial()) == 1


def deadly_work(job: Job):
    """Kills its process for one session, as a defect in a compiled library or a lack of memory would."""
    if job.session == "line/motor-5":
        os.kill(os.getpid(), signal.SIGKILL)
    return {"session": job.session, "key": job.key(), "status": "done"}


def test_a_session_that_kills_its_worker_is_given_up_and_the_rest_is_done(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(fleet_run, "work", deadly_work)
    jobs = jobs_in(folder)
    run_fleet(jobs, tmp_path, LocalProcesses(2))
    results = {r["session"]: r for r in settled(jobs, tmp_path / RESULTS)}
    assert len(results) == 8
    assert {name for name, r in results.items() if r["status"] == "lost"} == {"line/motor-5"}
    monkeypatch.undo()
    assert run_fleet(jobs, tmp_path, Serial()) == 1  # what was lost is tried again


def test_dask_cluster_with_a_worker_killed_in_the_middle(folder, serial_results, tmp_path):
    from distributed import LocalCluster

    jobs = jobs_in(folder)
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1") as cluster:
        maker = DaskCluster(cluster.scheduler_address)
        assert maker.workers == 2
        killed = []

        def kill_a_worker(name, done, total):
            if done == 1:
                process = next(iter(cluster.workers.values())).process.process
                os.kill(process.pid, signal.SIGKILL)
                killed.append(process.pid)

        try:
            assert run_fleet(jobs, tmp_path, maker, kill_a_worker) == 8
        finally:
            maker.close()
    assert killed
    assert list(settled(jobs, tmp_path / RESULTS)) == serial_results


def test_addresses_that_are_no_cluster():
    with pytest.raises(BadInput, match="tcp://"):
        DaskCluster("http://127.0.0.1:8786")
    with pytest.raises(InstrumentError, match="no Dask scheduler"):
        DaskCluster("tcp://127.0.0.1:9")


def results_without_fits(root: Path) -> list[str]:
    """Sessions that hold nothing, so that a fleet of them is done at once."""
    for number in range(3):
        with SessionWriter.create(root / f"motor-{number}", {"title": "x"}) as writer:
            writer.close("done")
    return [str(root), "--fit-only", "--jobs", "1", "--out", str(root.with_name("out"))]


def test_a_fleet_without_any_result_and_one_that_is_to_be_good_have_an_exit_status(tmp_path, folder):
    nothing = CliRunner().invoke(app, ["fleet", *results_without_fits(tmp_path / "empty")])
    assert nothing.exit_code == 1
    assert "no result 3" in nothing.output
    assert re.search(r"^20\d\d-\S+ 3 of 3 sessions, last motor-\d$", nothing.stderr, re.MULTILINE)
    for more, status in (([], 0), (["--strict"], 1)):
        done = CliRunner().invoke(app, ["fleet", str(folder), "--fit-only", "--jobs", "1", "--out", str(tmp_path / "out"), *more])
        assert done.exit_code == status
        assert "line/nothing: no result: " in done.output


def test_a_stopped_fleet_says_how_to_continue_and_leaves_no_worker(folder, tmp_path):
    """SIGTERM, as `timeout` and service managers send it."""
    command = [sys.executable, "-m", "motoremi", "fleet", str(folder), "--jobs", "2", "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as started:
        until(lambda: (tmp_path / "out" / RESULTS).exists() and len(children(started.pid)) >= 2)
        workers = children(started.pid)
        started.terminate()
        assert started.stderr is not None
        told = started.stderr.read()
    assert started.returncode == 130
    assert re.search(r"stopped; \d+ results are kept in .*fleet.jsonl: the same command continues", told)
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers))


def children(pid: int) -> list[int]:
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def until(holds: Callable[[], bool]) -> None:
    for _ in range(600):
        if holds():
            return
        time.sleep(0.1)
    raise AssertionError("it did not come about within a minute")


def test_the_command(folder, tmp_path):
    arguments = ["fleet", str(folder), "--out", str(tmp_path / "out"), "--jobs", "1", "--fit-only", "--golden", "golden/*"]
    result = CliRunner().invoke(app, [*arguments, "--json"])
    assert result.exit_code == 0, result.exception
    told = json.loads(result.stdout)
    assert told["counts"] == {"sessions": 8, "in_the_figures": 6, "troubled": 2}
    assert told["computed_now"] == 8
    assert told["diagnosed"] == 0
    again = CliRunner().invoke(app, arguments)
    assert "0 computed now" in again.stdout
    assert "missing effects and findings: not looked for" in again.stdout
    assert "line/tampered" in again.stdout
    # Three golden motors are too few.
    assert "no limits from the golden set: there are 3 golden motors, and at least 5 are needed" in again.stdout
    page = (tmp_path / "out" / "fleet.html").read_text()
    assert "Fleet report" in page
    assert not re.search(r'(?:src|href)="http', page)
    motors = pd.read_csv(tmp_path / "out" / "motors.csv", index_col="session")
    assert motors.loc["line/nothing", "result"] == "no result"
    assert len(motors) == 8
    table = pd.read_csv(tmp_path / "out" / "parameters.csv", index_col="session")
    assert len(table) == 6
    assert list(table.columns[:4]) == ["Ra_ohm", "Ra_ohm_sigma", "La_h", "La_h_sigma"]
    assert (table["La_h_sigma"] > 0).all()
    assert (table["La_h_sigma"] < 0.1 * table["La_h"]).all()
    with pytest.raises(BadInput, match="no sessions"):
        sessions_in(tmp_path / "out")


def test_a_pattern_that_matches_no_session_is_refused_before_any_work(folder, tmp_path):
    done = motoremi("fleet", folder, "--out", tmp_path / "out", "--jobs", "1", "--fit-only", "--golden", "gulden/*")
    assert done.returncode == 2
    assert "'gulden/*' of golden sessions matches none of the 8" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()
    with pytest.raises(BadInput, match="matches none"):
        fleet_figures(story(), "gulden/*")


def test_each_session_s_own_report(folder, tmp_path):
    job = Job("golden/motor-1", str(folder), False, 1, str(tmp_path / "reports"))
    result = work(job)
    assert result["status"] == "done"
    assert result["key"] != Job("golden/motor-1", str(folder), False, 1).key()
    assert "Common-mode impedance test report" in (tmp_path / "reports" / "golden" / "motor-1.html").read_text()


# The figures, on results with a known story


def story(count: int = 60) -> list[dict]:
    """La drifts by 10 % over the serial numbers, motor 30 has a tenfold Cf, three quarters are golden."""
    rng = np.random.default_rng(4)
    results = []
    for n in range(count):
        values = {"La": 12e-6 * (1 + 0.1 * n / count) * np.exp(0.005 * rng.normal()), "Cf": 2e-10 * np.exp(0.05 * rng.normal())}
        values["Cf"] *= 10 if n == 30 else 1
        parameters = {name: {"value": float(v), "sigma": 0.0, "unit": "H" if name == "La" else "F"} for name, v in values.items()}
        verdict = {"verdict": "missing-effect", "effects": ["core-loss"]} if n % 4 == 0 else {"verdict": "adequate", "effects": []}
        best = {"converged": n != 7, "rms_error_percent": 0.2 + 0.01 * rng.random(), "parameters": parameters}
        name = f"{'line' if n % 4 == 0 or n == 30 else 'golden'}/m{n:03d}"
        when = f"2026-01-{1 + n % 28:02d}T10:00:00+00:00"
        results.append({"session": name, "status": "done", "serial": f"A-{n}", "time": when, "diagnosis": verdict, "best": best})
    return results


def test_figures_find_the_drift_the_outlier_and_the_effects():
    figures = fleet_figures(story(), "golden/*")
    assert figures["effects"] == {"core-loss": 15}
    assert [(d["parameter"], d["along"]) for d in figures["drift"]] == [("La", "serial")]
    assert figures["drift"][0]["change_percent"] == pytest.approx(10, rel=0.1)
    assert [(o["session"], o["parameter"]) for o in figures["outliers"]] == [("line/m030", "Cf")]
    assert ("line/m030", "Cf") in {(b["session"], b["parameter"]) for b in figures["beyond_limits"]}
    assert figures["limits"]["Cf"]["low"] < 2e-10 < figures["limits"]["Cf"]["high"]
    assert "did not converge" in figures["troubles"][0]["trouble"]
    page = fleet_html(figures, "story")
    assert "Kendall" in page
    assert "line/m030" in page


def test_each_motor_has_a_result_and_reasons():
    results = story()
    results.append({"session": "line/cut", "status": "bad", "trouble": "the file is cut off"})
    for result in results[:5]:
        result["best"]["floor_percent"] = 0.3
    figures = fleet_figures(results, "golden/*")
    motors = {one["session"]: one for one in figures["motors"]}
    assert figures["motors"][0]["session"] == "line/m030"
    assert motors["line/m030"]["result"] == "beyond limits"
    assert re.fullmatch(r"Cf 1\.\d+ nF, limits 1\d+\.?\d* pF - 2\d+\.?\d* pF \(\+\d+ % from golden\)", motors["line/m030"]["reasons"][0])
    assert motors["line/m004"] == {"session": "line/m004", "serial": "A-4", "result": "within limits", "reasons": []}
    assert (motors["golden/m001"]["result"], motors["line/cut"]["result"]) == ("golden", "no result")
    assert motors["line/cut"]["reasons"] == ["the file is cut off"]
    assert {one["result"] for one in fleet_figures(results)["motors"]} == {"no result", "not judged"}
    assert deviation({"deviation_percent": 1e5}) == "1000 times that of golden"
    page = fleet_html(figures, "story")
    assert "beyond limits 1, no result 2, within limits" in page
    assert "not that the motor is a good one" in page
    table = table_of(figures)
    assert motors_of(figures).loc["line/cut"].tolist() == ["", "no result", "the file is cut off"]
    assert table.loc["line/m030", "Cf_f_from_golden_percent"] == pytest.approx(900, rel=0.2)


def test_a_second_run_on_the_same_folder_changes_nothing_while_the_first_one_writes(folder, tmp_path):
    jobs = jobs_in(folder)
    log = tmp_path / RESULTS
    first = AppendFile(log, new=True)
    first.lock()
    # In the middle of a line, which is not torn but not yet complete.
    log.write_bytes(b'{"session": "a", ')
    with pytest.raises(StorageError, match="another process is writing to it"):
        run_fleet(jobs, tmp_path, Serial())
    assert log.read_bytes() == b'{"session": "a", '
    first.close()
    # Its process has ended: the line stays incomplete, is cut off, and everything is computed.
    assert run_fleet(jobs, tmp_path, Serial()) == len(jobs)
    assert len(list(stored_results(log))) == len(jobs)


def test_no_spreadsheet_takes_a_name_of_a_session_or_a_serial_number_for_a_formula():
    results = story()
    results[5]["session"], results[5]["serial"] = "=HYPERLINK(1)/m004", "@SUM(1)"
    figures = fleet_figures(results, "golden/*")
    for table in (motors_of(figures), table_of(figures)):
        assert table.loc["'=HYPERLINK(1)/m004", "serial"] == "'@SUM(1)"
        assert not [name for name in table.index if name.startswith("=")]


def test_an_error_within_what_the_analyser_leaves_is_none_of_the_motor():
    results = story()
    for result, floor in ((results[4], 1.0), (results[8], 0.1)):
        result["best"] |= {"rms_error_percent": 0.5, "floor_percent": floor}
    # An error that is smaller than all others: fewer points, say.
    results[12]["best"]["rms_error_percent"] = 0.01
    figures = fleet_figures(results, "golden/*")
    for told in ("outliers", "beyond_limits"):
        assert {one["session"] for one in figures[told] if one["parameter"] == "error"} == {"line/m008"}


def test_limits_are_kept_by_motors_like_the_golden_ones():
    """By 95 % of them for all values together, and by the golden ones themselves."""
    rng = np.random.default_rng(8)
    results = []
    for n in range(1060):
        parameters = {name: {"value": float(np.exp(0.05 * rng.normal())), "sigma": 0.0, "unit": "F"} for name in ("Ca", "Cr", "Cf", "La", "Lr")}
        best = {"converged": True, "rms_error_percent": 0.1, "parameters": parameters}
        results.append({"session": f"{'golden' if n < 60 else 'line'}/{n}", "status": "done", "serial": "", "time": "", "best": best})
    figures = fleet_figures(results, "golden/*")
    beyond = {one["session"] for one in figures["beyond_limits"]}
    assert 0 < len(beyond) <= 50
    assert not any(session.startswith("golden") for session in beyond)


def test_one_golden_motor_is_enough_for_stated_tolerances():
    results = [result for result in story() if result["session"].startswith("line")]
    figures = fleet_figures(results, "line/m000", parse_tolerances(["20%", "Cf = 30 %"]))
    assert (figures["no_limits"], sorted(figures["limits"])) == ("", ["Cf", "La"])
    first = {name: column["line/m000"] for name, column in figures["values"].items()}
    assert figures["limits"]["Cf"]["high"] == pytest.approx(1.3 * first["Cf"])
    assert figures["limits"]["La"]["low"] == pytest.approx(0.8 * first["La"])
    assert {one["session"] for one in figures["beyond_limits"]} == {"line/m030"}
    assert "stated deviations from their mean: each element 20 %, Cf 30 %" in fleet_html(figures, "x")


@pytest.mark.parametrize(
    ("text", "told"), [("Cx=10%", "no element"), ("0.1", "write a percentage"), ("Ca=ten", "write a percentage"), ("100%", "below 100 %")]
)
def test_tolerances_that_are_none(text, told):
    with pytest.raises(BadInput, match=told):
        parse_tolerances([text])


def test_motors_that_are_there_twice_are_told():
    results = story()
    results.append({**results[3], "session": "line/copy"})
    figures = fleet_figures(results)
    assert figures["alike"] == {"serial": [["golden/m003", "line/copy"]], "data": [["golden/m003", "line/copy"]]}
    page = fleet_html(figures, "x")
    assert "golden/m003; line/copy: the same serial number" in page
    assert "golden/m003; line/copy: the same data" in page


def test_frequencies_in_another_unit_than_those_of_most_motors_are_told():
    results = [{**result, "span_hz": [20e3, 30e6]} for result in story(12)]
    results[5]["span_hz"] = [20.0, 30e3]
    results[6]["span_hz"] = [20e3, 10e6]
    told = {one["session"]: one for one in fleet_figures(results)["motors"] if one["reasons"] and one["result"] != "no result"}
    assert {session: (one["result"], one["reasons"]) for session, one in told.items()} == {
        "golden/m005": ("data in doubt", ["swept over 20 Hz - 30 kHz, most motors over 20 kHz - 30 MHz"])
    }


def test_drift_is_not_denied_where_it_was_not_tested():
    """Three points of a life test cannot be significant in any order; data without a date have none."""
    three = fleet_figures(story(3))
    assert three["testable"] == []
    page = fleet_html(three, "x")
    assert "Not tested." in page
    assert "No parameter depends" not in page
    undated = [{**result, "time": ""} for result in story()]
    figures = fleet_figures(undated)
    assert (figures["testable"], figures["undated"]) == (["serial"], 59)
    page = fleet_html(figures, "x")
    assert "Time is not tested: too few sessions have one." in page
    assert "The files of 59 sessions do not state when they were measured." in page


def test_an_imported_motor_has_the_date_of_its_measurement(tmp_path):
    frequency = np.geomspace(150e3, 30e6, 61)
    impedance = 3 + 2j * np.pi * frequency * 27e-6
    rows = "\n".join(f"{f},{z.real},{z.imag}" for f, z in zip(frequency, impedance, strict=True))
    for name, header in (("dated", "# Date: 2026-01-31 09:00:00\n"), ("undated", "")):
        (tmp_path / f"{name}.csv").write_text(f"{header}frequency_hz,resistance_ohm,reactance_ohm\n{rows}\n")
        assert motoremi("import", tmp_path / "all" / name, "--short", tmp_path / f"{name}.csv").returncode == 0
    assert [work(Job(name, str(tmp_path / "all"), False, 1))["time"] for name in ("dated", "undated")] == ["2026-01-31 09:00:00", ""]


def test_one_far_value_leaves_the_others_to_be_seen():
    values = np.exp(0.05 * np.random.default_rng(3).standard_normal(60))
    values[7] = 1e3
    assert usual_span(values, None)[1] < 2
    assert usual_span(values, {"low": 0.2, "high": 5.0}) == (0.2, 5.0)
    assert usual_span(np.ones(4), None) == (0.0, np.inf)


def test_what_was_not_looked_for_is_not_called_none():
    fitted = [{key: value for key, value in result.items() if key != "diagnosis"} for result in story()]
    figures = fleet_figures(fitted)
    assert figures["diagnosed"] == 0
    page = fleet_html(figures, "fitted")
    assert page.count("They were not looked for: no session was diagnosed.") == 2
    assert "None was named." not in page
    assert "None that is serious." not in page
    assert re.search(r"serious findings</t[dh]>\s*<td[^>]*>not looked for<", page)

    healthy = [{**result, "diagnosis": {"verdict": "adequate", "effects": []}} for result in fitted]
    assert fleet_figures(healthy)["diagnosed"] == 60
    page = fleet_html(fleet_figures(healthy), "healthy")
    assert "None was named." in page
    assert "None that is serious." in page
    assert "not looked for" not in page


def with_value(results: list[dict], session: str, parameter: str, value: float, sigma: float) -> list[dict]:
    """The same results with one value, which its own fit knows within `sigma`."""
    (one,) = (result for result in results if result["session"] == session)
    one["best"]["parameters"][parameter].update(value=value, sigma=sigma)
    return results


def test_too_few_golden_motors_are_told_and_not_shown_as_good():
    few = [result for result in story() if not result["session"].startswith("golden")] + [
        result for result in story() if result["session"] in ("golden/m001", "golden/m002", "golden/m007")
    ]
    figures = fleet_figures(few, "golden/*")
    # m007 did not converge.
    assert figures["no_limits"] == "2 of the 3 golden motors gave a result, and at least 5 are needed"
    page = fleet_html(figures, "few")
    assert "none: 2 of the 3 golden motors" in page
    assert "beyond the golden set's limits" not in page.replace("&#39;", "'").replace("&#x27;", "'")
    assert fleet_figures(story(), "golden/*")["no_limits"] == ""
    assert fleet_figures(story())["no_limits"] == ""


@pytest.mark.parametrize(("sigma", "told"), [(0.32, False), (0.01, True)])
def test_a_value_is_compared_with_regard_to_its_own_uncertainty(sigma, told):
    # The fleet's Cf is 200 pF within 5 %; 119 pF is 40 % lower, ten times as far as the fleet spreads.
    figures = fleet_figures(with_value(story(), "line/m004", "Cf", 119e-12, sigma * 119e-12), "golden/*")
    assert (("line/m004", "Cf") in {(o["session"], o["parameter"]) for o in figures["outliers"]}) is told
    assert (("line/m004", "Cf") in {(b["session"], b["parameter"]) for b in figures["beyond_limits"]}) is told
    # The motor that really is another one is told in both cases.
    assert ("line/m030", "Cf") in {(o["session"], o["parameter"]) for o in figures["outliers"]}


def test_distance_and_limits_with_the_own_uncertainty():
    exact, uncertain = (fleet_figures(with_value(story(), "line/m030", "Cf", 2e-9, sigma * 2e-9), "golden/*") for sigma in (0.0, 0.2))
    spread = exact["parameters"]["Cf"]["spread_percent"] / 100
    assert uncertain["outliers"][0]["distance"] == pytest.approx(exact["outliers"][0]["distance"] * spread / np.hypot(spread, 0.2))
    limit = exact["limits"]["Cf"]
    half, middle = 0.5 * np.log(limit["high"] / limit["low"]), np.sqrt(limit["high"] * limit["low"])
    wider = np.exp(np.hypot(half, limit["factor"] * 0.1))
    for factor, beyond in ((0.99, False), (1.01, True)):
        for edge in (middle * wider**factor, middle / wider**factor):
            figures = fleet_figures(with_value(story(), "line/m004", "Cf", edge, 0.1 * edge), "golden/*")
            assert (("line/m004", "Cf") in {(b["session"], b["parameter"]) for b in figures["beyond_limits"]}) is beyond


def test_what_the_data_do_not_determine_is_not_compared_and_told():
    results = story()
    for result in results[:9]:
        del result["best"]["parameters"]["Cf"]
        result["best"]["undetermined"] = ["Cf"]
    figures = fleet_figures(results, "golden/*")
    # Motor 7, whose fit did not converge, is in no figure.
    assert len(figures["undetermined"]["Cf"]) == 8
    assert figures["parameters"]["Cf"]["n"] == 51
    page = fleet_html(figures, "story")
    assert "Cf is not determined by the data of line/m000; golden/m001; golden/m002" in page
    assert "and 2 more: not compared" in page


def test_a_narrow_sweep_leaves_parameters_undetermined(tmp_path, measure):
    with SessionWriter.create(tmp_path / "narrow", {"title": "x"}) as writer:
        for sweep in measure(2, repeats=1)[0]:
            writer.add_sweep(sweep.within(150e3, 300e3))
        writer.close("done")
    best = work(Job("narrow", str(tmp_path), False, 1))["best"]
    assert best["undetermined"]
    assert not set(best["undetermined"]) & set(best["parameters"])


def test_chance_alone_is_no_drift():
    results = story()
    rng = np.random.default_rng(1)
    for result in results:
        result["best"]["parameters"]["La"]["value"] = 12e-6 * np.exp(0.01 * rng.normal())
    assert fleet_figures(results)["drift"] == []
    assert "drift" in fleet_html(fleet_figures(results), "x")
    assert "No session gave a result" in fleet_html(fleet_figures([]), "empty")


def test_limits_hold_what_they_promise():
    # Table of ISO 16269-6 (two-sided, unknown mean and spread, 95 % content, 95 % confidence): n = 10 gives 3.393, n = 50 gives 2.382.
    assert tolerance_factor(10) == pytest.approx(3.393, rel=0.01)
    assert tolerance_factor(50) == pytest.approx(2.382, rel=0.01)


@pytest.mark.parametrize(
    ("start", "session", "serial"),
    [({"serial": "B-7"}, "x", "B-7"), ({"motor": "type 3 no 12"}, "x", "12"), ({}, "lot4/motor-009", "009"), ({}, "a", "")],
)
def test_serial_numbers(start, session, serial):
    assert serial_of(start, session) == serial


def test_results_are_plain_and_hold_no_times_of_computation(folder):
    result = work(Job("line/motor-5", str(folder), False, 1))
    assert json.loads(json.dumps(result)) == result
    assert "elapsed" not in json.dumps(result)


def test_a_damaged_store_is_told(tmp_path):
    (tmp_path / RESULTS).write_bytes(b"not json\n")
    with pytest.raises(BadInput, match="damaged"):
        list(stored_results(tmp_path / RESULTS))
