"""Sessions run again from their own record: bit for bit, with their errors and interruptions, and what a difference looks like."""

from __future__ import annotations

import contextlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from fault_matrix import BENCH_FILE, SEED, measured, small
from record_sessions import PROCEDURES, RECEIVER, REQUESTS, SESSIONS, WITH_REQUESTS

from motoremi.bench.connect import driver_names
from motoremi.bench.replay import ReplayTransport
from motoremi.bench.replay_difference import ReplayDifference
from motoremi.cli import main
from motoremi.data.session import Session, SessionWriter, load, reopen, verify
from motoremi.errors import BadInput, InstrumentError, MotoremiError
from motoremi.run.rerun import MEASURED, Replayed, rerun
from motoremi.run.runner import resumable, run, start_document
from motoremi.schema.procedure import load_procedure, ready_procedures
from motoremi.virtual.faults import FaultLayer
from motoremi.virtual.simulated_bench import SimulatedBench


def quiet(kind: str, *_: object) -> None:
    """An analysing step that does nothing: here the measurement matters."""


def again(session: Session, folder: Path, lenient: bool = False) -> Replayed:
    return rerun(session, folder, lambda: quiet, lenient)


def begin(folder: Path, bench: SimulatedBench, stop_at: str = "", name: str = "full_motor_test") -> Session:
    """A run that the operator stops when a certain file is stored."""
    writer = SessionWriter.create(folder, start_document(small(name), BENCH_FILE))

    def stop(document: dict[str, Any]) -> None:
        if document.get("file") == stop_at and stop_at:
            raise KeyboardInterrupt

    writer.subscribe(stop)
    with contextlib.suppress(KeyboardInterrupt, MotoremiError):
        run(small(name), bench, writer, analyse=quiet, prompt=lambda text: None)
    return load(folder)


@pytest.fixture
def bench() -> Any:
    bench = SimulatedBench(SEED)
    yield bench
    bench.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", ready_procedures())
def test_every_ready_procedure_replays_bit_for_bit(tmp_path: Path, bench: SimulatedBench, name: str) -> None:
    recorded = measured(tmp_path / "first", load_procedure(name), bench)
    result = again(recorded, tmp_path / "again")
    files = [str(d["file"]) for d in recorded.documents if d["kind"] in MEASURED]
    assert result.same
    assert result.compared == len(files) > 0
    for file in files:
        assert (tmp_path / "again" / file).read_bytes() == (tmp_path / "first" / file).read_bytes()
    assert verify(tmp_path / "again") == []


@pytest.mark.parametrize("name", [*sorted(driver_names()), *WITH_REQUESTS])
def test_a_kept_session_of_every_driver_still_replays(tmp_path: Path, name: str) -> None:
    driver = name.removesuffix(REQUESTS)
    assert driver in PROCEDURES, f"record a session of {driver}: see tests/record_sessions.py"
    kept = load(SESSIONS / name)
    assert verify(SESSIONS / name) == []
    assert any(record["direction"] == "request" for record in kept.traffic()) is (name != driver)
    assert {d["driver"] for d in kept.documents if d["kind"] == "instrument"} - {RECEIVER} == {driver} - {RECEIVER}
    result = again(kept, tmp_path / "again")
    assert result.same
    assert result.compared > 0


@pytest.mark.slow
def test_the_virtual_clock_follows_the_recorded_one(tmp_path: Path, bench: SimulatedBench) -> None:
    recorded = measured(tmp_path / "first", small(), bench)
    times = [record["clock_s"] for record in recorded.traffic() if "clock_s" in record]
    result = again(recorded, tmp_path / "again")
    replayed = [record["clock_s"] for record in load(result.path).traffic() if "clock_s" in record]
    assert replayed[-1] - replayed[0] == pytest.approx(times[-1] - times[0], abs=1.0)


def test_a_stopped_run_replays_up_to_where_it_was_stopped(tmp_path: Path, bench: SimulatedBench) -> None:
    recorded = begin(tmp_path / "first", bench, "sweeps/open-1.csv")
    assert recorded.status == "interrupted"
    result = again(recorded, tmp_path / "again")
    assert result.same
    assert result.compared == 4
    assert result.ended == "stopped by the operator in step 5 (sweep)"


@pytest.mark.parametrize("kind", ["silence", "dead", "garbled", "error-entry", "restart"])
def test_a_failed_run_fails_again_in_the_same_way(tmp_path: Path, bench: SimulatedBench, kind: str) -> None:
    FaultLayer(bench.devices["analyser"], kind, 150)
    recorded = begin(tmp_path / "first", bench)
    assert recorded.status == "failed"
    result = again(recorded, tmp_path / "again")
    assert result.same
    assert result.compared == len(recorded.sweeps)
    assert result.ended == next(d["reason"] for d in recorded.documents if d["kind"] == "stop")


@pytest.mark.slow
@pytest.mark.parametrize("stop_at", ["sweeps/short-2.csv", "sweeps/open-3.csv", "spectra/peak-1.csv"])
def test_a_resumed_run_replays_with_its_resumption(tmp_path: Path, bench: SimulatedBench, stop_at: str) -> None:
    begun = begin(tmp_path / "first", bench, stop_at)
    procedure, done = resumable(begun, BENCH_FILE)
    other = SimulatedBench(SEED)
    run(procedure, other, reopen(tmp_path / "first"), analyse=quiet, prompt=lambda text: None, done=done)
    other.close()
    recorded = load(tmp_path / "first")
    assert recorded.status == "done"
    result = again(recorded, tmp_path / "again")
    assert result.same
    assert result.compared == 10
    assert result.ended == "done"


@pytest.mark.slow
def test_a_killed_run_replays_to_the_last_exchange(tmp_path: Path, bench: SimulatedBench) -> None:
    measured(tmp_path / "first", small(), bench)
    # What SIGKILL leaves: a record and documents that just end.
    (tmp_path / "first" / "manifest.json").unlink()
    documents = (tmp_path / "first" / "session.jsonl").read_bytes().splitlines(keepends=True)
    last = next(number for number, line in enumerate(documents) if b"sweeps/short-2.csv" in line)
    (tmp_path / "first" / "session.jsonl").write_bytes(b"".join(documents[: last + 1]))
    moment = json.loads(documents[last + 1])["time"]
    records = (tmp_path / "first" / "traffic.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "first" / "traffic.jsonl").write_bytes(b"".join(r for r in records if json.loads(r)["time"] < moment))
    recorded = load(tmp_path / "first")
    assert recorded.interrupted
    assert len(recorded.sweeps) == 2
    result = again(recorded, tmp_path / "again")
    assert (result.same, result.ended) == (True, "killed")


@pytest.mark.slow
def test_a_run_killed_while_its_instrument_was_made_safe_replays(tmp_path: Path, bench: SimulatedBench) -> None:
    measured(tmp_path / "whole", small(), bench)
    records = (tmp_path / "whole" / "traffic.jsonl").read_bytes().splitlines(keepends=True)
    leaves = next(number for number, line in enumerate(records) if b'"direction":"leave"' in line)
    documents = (tmp_path / "whole" / "session.jsonl").read_bytes().splitlines(keepends=True)
    safe = next(number for number, line in enumerate(documents) if b'"kind":"safe"' in line)
    (tmp_path / "whole" / "manifest.json").unlink()
    (tmp_path / "whole" / "session.jsonl").write_bytes(b"".join(documents[:safe]))
    assert b'"direction":"close"' in records[-1]
    assert len(records) - leaves > 3
    # With all exchanges recorded, nothing in the record says where the kill came.
    for end in range(leaves, len(records) - 1):
        (tmp_path / "whole" / "traffic.jsonl").write_bytes(b"".join(records[:end]))
        result = again(load(tmp_path / "whole"), tmp_path / f"again-{end}")
        assert (result.same, result.ended) == (True, "killed"), end


def changed_session(folder: Path, bench: SimulatedBench, command: str, replacement: str) -> Session:
    """A session whose record holds another command, as an older version of a driver would have sent it."""
    measured(folder, small(), bench)
    path = folder / "traffic.jsonl"
    path.write_text(path.read_text(encoding="utf-8").replace(json.dumps(f"{command}\n"), json.dumps(f"{replacement}\n")), encoding="utf-8")
    (folder / "manifest.json").unlink()
    return load(folder)


def test_a_difference_is_shown_with_both_sides(tmp_path: Path, bench: SimulatedBench) -> None:
    recorded = changed_session(tmp_path / "first", bench, "POIN 11", "POIN 12")
    with pytest.raises(ReplayDifference) as caught:
        again(recorded, tmp_path / "again")
    lines = caught.value.lines()
    assert lines[0].startswith("GPIB0::17::INSTR, exchange ")
    assert lines[-3:-1] == ["  - write 'POIN 12\\n'   (recorded)", "  + write 'POIN 11\\n'   (asked now)"]
    assert lines[-1].index("^") == lines[-2].index("1\\n")
    assert "read '0,\"NO ERRORS\"\\n'" in lines[-4]
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_the_command_line_shows_it_and_exits_with_3(
    tmp_path: Path, bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    changed_session(tmp_path / "first", bench, "POIN 11", "POIN 12")
    monkeypatch.setattr("sys.argv", ["motoremi", "replay", str(tmp_path / "first"), "--out", str(tmp_path / "again"), "--json"])
    with pytest.raises(SystemExit) as caught:
        main()
    out, error = capsys.readouterr()
    assert caught.value.code == 3
    assert json.loads(out)["differences"][0]["expected"] == "write 'POIN 12\\n'"
    assert error.count("\n") == 1


def test_a_lenient_replay_goes_on_and_keeps_account(tmp_path: Path, bench: SimulatedBench) -> None:
    recorded = changed_session(tmp_path / "first", bench, "POIN 11", "POIN 12")
    result = again(recorded, tmp_path / "again", lenient=True)
    assert not result.same
    assert [difference.came for difference in result.differences] == ["write 'POIN 11\\n'"]
    assert result.differing == ()
    assert result.compared == 10


def test_lenient_skips_what_is_no_longer_asked_and_answers_what_is_new() -> None:
    records = [
        {"direction": "write", "text": "A?\n"}, {"direction": "read", "text": "1\n"},
        {"direction": "write", "text": "OLD?\n"}, {"direction": "read", "text": "2\n"},
        {"direction": "write", "text": "B?\n"}, {"direction": "read", "text": "3\n"},
    ]  # fmt: skip
    link = ReplayTransport("TEST", records, lenient=True)
    assert link.query("A?") == "1"
    assert link.query("B?") == "3"
    assert link.query("A?") == "1"
    link.write("NEW 1")
    with pytest.raises(InstrumentError, match="nothing in the record answers 'NEW\\?'"):
        link.query("NEW?")
    assert [difference.came for difference in link.differences] == [f"write '{c}\\n'" for c in ("B?", "A?", "NEW 1", "NEW?")]
    link.finish()


@pytest.mark.parametrize(("changed", "differing", "rounded"), [(1e-3, 1, 0), (1e-6, 1, 0), (1e-12, 0, 1)])
def test_data_that_were_changed_are_told(tmp_path: Path, bench: SimulatedBench, changed: float, differing: int, rounded: int) -> None:
    """A record that was tampered with gives other data than those stored; the last digits may be the rounding of another processor."""
    measured(tmp_path / "first", small("emission_only"), bench)
    path = tmp_path / "first" / "traffic.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines()
    for number, line in enumerate(lines):
        record = json.loads(line)
        if record["direction"] == "read" and record["text"].count(",") > 10:
            first, *rest = record["text"].split(",")
            record["text"] = ",".join([repr(float(first) * (1 + changed)), *rest])
            lines[number] = json.dumps(record)
            break
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    (tmp_path / "first" / "manifest.json").unlink()
    result = again(load(tmp_path / "first"), tmp_path / "again")
    assert result.differing == ("spectra/peak-motor-off-1.csv",) * differing
    assert result.rounded == ("spectra/peak-motor-off-1.csv",) * rounded
    assert result.same is not bool(differing)


def test_an_imported_session_cannot_be_replayed(tmp_path: Path) -> None:
    with SessionWriter.create(tmp_path / "s", {"title": "imported"}):
        pass
    with pytest.raises(BadInput, match="was imported, not measured"):
        again(load(tmp_path / "s"), tmp_path / "again")


def test_nothing_is_written_into_the_recorded_session(tmp_path: Path, bench: SimulatedBench) -> None:
    measured(tmp_path / "first", small("emission_only"), bench)
    shutil.copytree(tmp_path / "first", tmp_path / "copy")
    again(load(tmp_path / "first"), tmp_path / "again")
    for file in (tmp_path / "copy").rglob("*"):
        if file.is_file():
            assert file.read_bytes() == (tmp_path / "first" / file.relative_to(tmp_path / "copy")).read_bytes()
