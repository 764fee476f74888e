"""Going on with a session that was interrupted: what is kept, what is done again, what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from fault_matrix import BENCH_FILE, SEED, measured, small

from motoremi.cli import main
from motoremi.data.session import SessionWriter, load, reopen, verify
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.resume import Done, needed_again
from motoremi.run.runner import resumable, run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench


def stopped(folder: Path, stop_at: str) -> None:
    """A full run that Ctrl-C stops when a file is stored."""
    bench = SimulatedBench(SEED)
    writer = SessionWriter.create(folder, start_document(small(), BENCH_FILE))

    def stop(document: dict[str, Any]) -> None:
        if document.get("file") == stop_at:
            raise KeyboardInterrupt

    writer.subscribe(stop)
    with pytest.raises(KeyboardInterrupt):
        run(small(), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    bench.close()


def go_on(folder: Path, prompts: list[str] | None = None, analyse: Any = lambda *_: None) -> None:
    bench = SimulatedBench(SEED)
    procedure, done = resumable(load(folder), BENCH_FILE)
    told = prompts if prompts is not None else []
    run(procedure, bench, reopen(folder), analyse=analyse, prompt=lambda text: told.append(text), done=done)
    bench.close()


@pytest.mark.slow
def test_only_what_is_missing_is_measured(tmp_path: Path) -> None:
    stopped(tmp_path / "s", "sweeps/open-1.csv")
    before = {file: file.read_bytes() for file in (tmp_path / "s" / "sweeps").iterdir()}
    prompts: list[str] = []
    asked: list[str] = []
    go_on(tmp_path / "s", prompts, lambda kind, *_: asked.append(kind))
    session = load(tmp_path / "s")
    assert session.status == "done"
    assert verify(tmp_path / "s") == []
    assert [sweep.termination for sweep in session.sweeps] == ["short"] * 3 + ["open"] * 3
    assert len(session.spectra) == 4
    assert all(file.read_bytes() == data for file, data in before.items())
    # Compensation does not survive a reset, so both standards are asked for again, and the motor is a new connection.
    assert [text.split(" (")[0].split(",")[0] for text in prompts[:3]] == [
        "Leave the fixture open",
        "Connect the short standard to the fixture\n\n  H ----o---+\n            |  short standard\n  L ----o---+",
        "Connect the analyser between one terminal of the motor and its frame",
    ]
    connections = [sweep.metadata["connection"] for sweep in session.sweeps]
    assert connections == [3, 3, 3, 4, 7, 7]
    assert asked == ["fit", "compare", "diagnose", "report"]
    resume = next(document for document in session.documents if document["kind"] == "resume")
    assert (resume["step"], resume["stored"], resume["again"]) == (5, 1, [1, 2, 3])
    again = [document["step"] for document in session.documents if document["kind"] == "step-start" and document.get("again")]
    assert again == [1, 2, 3]


def test_a_run_that_lacks_only_analysis_touches_no_instrument(tmp_path: Path) -> None:
    bench = SimulatedBench(SEED)
    writer = SessionWriter.create(tmp_path / "s", start_document(small(), BENCH_FILE))

    def broken(kind: str, *_: object) -> None:
        raise BadInput("no fit today")

    with pytest.raises(BadInput):
        run(small(), bench, writer, analyse=broken, prompt=lambda text: None)
    prompts: list[str] = []
    traffic = len(load(tmp_path / "s").traffic())
    go_on(tmp_path / "s", prompts)
    assert prompts == []
    assert len(load(tmp_path / "s").traffic()) == traffic
    assert load(tmp_path / "s").status == "done"
    bench.close()


def test_interrupted_twice(tmp_path: Path) -> None:
    stopped(tmp_path / "s", "sweeps/short-1.csv")
    bench = SimulatedBench(SEED)
    procedure, done = resumable(load(tmp_path / "s"), BENCH_FILE)
    writer = reopen(tmp_path / "s")

    def stop(document: dict[str, Any]) -> None:
        if document.get("file") == "sweeps/open-2.csv":
            raise KeyboardInterrupt

    writer.subscribe(stop)
    with pytest.raises(KeyboardInterrupt):
        run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None, done=done)
    bench.close()
    assert load(tmp_path / "s").status == "interrupted"
    go_on(tmp_path / "s")
    assert load(tmp_path / "s").status == "done"
    assert len(load(tmp_path / "s").sweeps) == 6
    assert verify(tmp_path / "s") == []


def test_another_instrument_is_refused(tmp_path: Path) -> None:
    stopped(tmp_path / "s", "sweeps/short-1.csv")
    bench = SimulatedBench(SEED)
    device = bench.devices["analyser"]
    healthy = device.respond
    device.respond = lambda query: b"HEWLETT-PACKARD,4294A,JP1KG99999,REV1.11" if query == b"*IDN?" else healthy(query)
    procedure, done = resumable(load(tmp_path / "s"), BENCH_FILE)
    with pytest.raises(InstrumentError, match="serial JP1KG99999 answers, but the session was begun with 4294A serial JP1KG00123"):
        run(procedure, bench, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
    bench.close()
    assert len(load(tmp_path / "s").sweeps) == 1


def test_what_cannot_be_resumed(tmp_path: Path) -> None:
    with SessionWriter.create(tmp_path / "imported", {"title": "x"}):
        pass
    with pytest.raises(BadInput, match="was imported"):
        resumable(load(tmp_path / "imported"), BENCH_FILE)
    stopped(tmp_path / "s", "sweeps/short-1.csv")
    with pytest.raises(BadInput, match="was begun on another bench"):
        resumable(load(tmp_path / "s"), BenchFile(backend="sim", seed=SEED + 1))
    with pytest.raises(BadInput, match="was begun on another bench"):
        resumable(load(tmp_path / "s"), BenchFile())
    bench = SimulatedBench(SEED)
    with pytest.raises(BadInput, match="is complete: there is nothing to resume"):
        resumable(measured(tmp_path / "whole", small("emission_only"), bench), BENCH_FILE)
    bench.close()


def test_a_torn_line_of_traffic_is_kept_apart(tmp_path: Path) -> None:
    stopped(tmp_path / "s", "sweeps/short-1.csv")
    with open(tmp_path / "s" / "traffic.jsonl", "ab") as file:
        file.write(b'{"time": "2026')
    (tmp_path / "s" / "manifest.json").unlink()
    go_on(tmp_path / "s")
    session = load(tmp_path / "s")
    assert session.traffic()
    assert next(d for d in session.documents if d["kind"] == "reopen")["unfinished_traffic"] == '{"time": "2026'


def test_what_the_rest_stands_on() -> None:
    data = small("fixture_check").source
    plan = parse_procedure(data, "x").plan
    assert [planned.step.do for planned in plan[3:9]] == ["connect", "check", "check"] * 2
    # In the middle of the second round: connect of this round, compensation, identity.
    assert needed_again(plan, Done(steps=7)) == {1, 2, 3, 7}
    assert needed_again(plan, Done(steps=6)) == {1, 2, 3}
    assert needed_again(plan, Done(steps=10)) == set()
    assert needed_again(plan, Done()) == set()
    # The motor is connected anew and has cooled down: the wait for its temperature is needed again too.
    emission = small("emission_only").plan
    assert [planned.step.do for planned in emission[3:7]] == ["connect", "wait", "spectrum", "spectrum"]
    assert needed_again(emission, Done(steps=6)) == {1, 4, 5}
    assert needed_again(emission, Done(steps=2)) == {1}


@pytest.mark.slow
def test_the_command_line_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    bench_file = tmp_path / "bench.toml"
    bench_file.write_text(f'backend = "sim"\nseed = {SEED}\n', encoding="utf-8")
    source = {**small().source, "steps": [step for step in small().source["steps"] if step["do"] not in ("fit", "compare", "diagnose", "report")]}
    bench = SimulatedBench(SEED)
    writer = SessionWriter.create(tmp_path / "s", start_document(parse_procedure(source, "x"), BENCH_FILE))
    writer.emit("step-start", step=1, of=9, do="identify", parameters={})
    writer.close("interrupted", "by the test")
    bench.close()
    monkeypatch.setattr("sys.argv", ["motoremi", "run", "--resume", str(tmp_path / "s"), "--bench", str(bench_file), "--json"])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "done"
    assert len(load(tmp_path / "s").sweeps) == 6
    for arguments in (["full_motor_test", "--resume", "x"], [], ["--resume", str(tmp_path / "s"), "--out", "y"]):
        monkeypatch.setattr("sys.argv", ["motoremi", "run", *arguments])
        with pytest.raises(SystemExit) as caught:
            main()
        assert caught.value.code == 2


def test_a_run_without_its_instrument_says_how_to_continue(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bench_file = tmp_path / "bench.toml"
    bench_file.write_text('backend = "@py"\n[resources]\nanalyser = "TCPIP::127.0.0.1::1::SOCKET"\n', encoding="utf-8")
    arguments = ["impedance_only", "--bench", str(bench_file), "--out", str(tmp_path / "s")]
    again = ["--resume", str(tmp_path / "s"), "--bench", str(bench_file)]
    for given, status in ((arguments, 3), (arguments, 2), (again, 3)):
        monkeypatch.setattr("sys.argv", ["motoremi", "run", *given])
        with pytest.raises(SystemExit) as caught:
            main()
        assert caught.value.code == status
        told = capsys.readouterr().err
        assert f"continue with motoremi run {' '.join(again)}" in told.replace("continue it with", "continue with")
        assert ("holds a run that is not finished" in told) == (status == 2)
