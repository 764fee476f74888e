"""Procedures, sessions and instruments are not trusted: they run no code, write nowhere else, and are shown, not obeyed."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from fault_matrix import BENCH_FILE, SEED, measured, small

from motoremi.cli import bench as cli_bench
from motoremi.cli import main
from motoremi.data.session import SessionWriter, load, verify
from motoremi.errors import BadInput
from motoremi.run.rerun import rerun
from motoremi.run.runner import resumable, run, start_document
from motoremi.schema.procedure import load_procedure, parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.workflow import report_session

HOSTILE = "\x1b[2J\x1b]0;owned\x07<script>alert(1)</script>\u202e\r\n,"
# Nothing that a terminal or a page would obey.
FORBIDDEN = ("\x1b", "\x07", "\u202e", "<script>alert")


def hostile_bench() -> SimulatedBench:
    """A bench whose analyser has a serial number that tries to take over terminal and page."""
    bench = SimulatedBench(SEED)
    device = bench.devices["analyser"]
    healthy = device.respond
    serial = HOSTILE.replace(",", "").replace("\r\n", " ")
    identity = f"HEWLETT-PACKARD,4294A,{serial},REV1.11".encode("latin-1", "replace")
    device.respond = lambda query: identity if query == b"*IDN?" else healthy(query)
    return bench


def test_text_of_an_instrument_is_shown_in_terminal_log_and_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bench = hostile_bench()
    writer = SessionWriter.create(tmp_path / "s", start_document(small("impedance_only"), BENCH_FILE))
    writer.subscribe(cli_bench.tell)
    run(
        small("impedance_only"),
        bench,
        writer,
        analyse=lambda kind, store, _: report_session(store) and None if kind == "report" else None,
        prompt=lambda text: None,
    )
    bench.close()
    told = capsys.readouterr().out
    assert "\\x1b[2J" in told
    # What a PDF shows is read in test_report_attacks; its bytes are not text.
    files = [file for file in (tmp_path / "s").rglob("*") if file.is_file() and file.suffix != ".pdf"]
    assert len(files) > 10
    for text in (told, *(file.read_bytes().decode("utf-8") for file in files)):
        assert not [mark for mark in FORBIDDEN[:3] if mark in text]
    html = (tmp_path / "s" / "report" / "report.html").read_text(encoding="utf-8")
    assert "alert(1)" in html
    assert "<script>alert" not in html
    # Every line of the logs is still one document.
    for name in ("session.jsonl", "traffic.jsonl"):
        for line in (tmp_path / "s" / name).read_text(encoding="ascii").splitlines():
            json.loads(line)
    assert verify(tmp_path / "s") == []


@pytest.mark.parametrize("query", ["*IDN?", "OUTPERRO?", "STAR?", "ESB?", "OUTPSWPRM?", "OUTPDTRC?", "TRAC? TRACE1", "SCAN1:STAR?", "SYST:ERR?"])
def test_hostile_answers_end_in_one_clean_line(
    tmp_path: Path, query: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bench = SimulatedBench(SEED)
    for device in bench.devices.values():
        healthy = device.respond
        device.respond = lambda asked, healthy=healthy: HOSTILE.encode("utf-8") if asked.decode() == query else healthy(asked)  # type: ignore[misc]
    monkeypatch.setattr("motoremi.run.runner.make_bench", lambda bench_file: bench)
    monkeypatch.setattr("motoremi.cli.bench.ask_operator", lambda text: None)
    monkeypatch.setattr(sys, "argv", ["motoremi", "run", "full_motor_test", "--out", str(tmp_path / "s")])
    with pytest.raises(SystemExit) as caught:
        main()
    out, error = capsys.readouterr()
    assert caught.value.code == 3
    assert error.count("\n") == 1
    assert not [mark for mark in FORBIDDEN[:3] if mark in out + error]
    assert verify(tmp_path / "s") == []


@pytest.mark.parametrize(
    "change",
    [
        {"title": "x", "import": "os"},
        {"include": "/etc/passwd"},
        {"steps": [{"do": "identify"}, {"do": "report", "file": "../../out.html"}]},
        {"steps": [{"do": "identify"}, {"do": "sweep", "termination": "../../x"}]},
        {"steps": [{"do": "identify"}, {"do": "spectrum", "detector": "../peak"}]},
        {"steps": [{"do": "shell", "command": "true"}]},
        {"instruments": {"analyser": {"driver": "os:system", "resource": "x"}}},
        {"instruments": {"analyser": {"driver": "motoremi.bench.driver:Driver", "resource": "x"}}},
    ],
)
def test_a_procedure_names_no_file_and_no_code(change: dict[str, Any]) -> None:
    with pytest.raises(BadInput):
        parse_procedure({**small().source, **change}, "hostile.toml")


def test_words_of_a_procedure_are_shown_not_obeyed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n"))
    cli_bench.ask_operator(f"Connect it. {HOSTILE}\n  drawing")
    assert not [mark for mark in FORBIDDEN[:3] if mark in capsys.readouterr().err]


def test_nobody_at_the_prompt_is_wrong_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    with pytest.raises(BadInput, match="the prompt was not answered"):
        cli_bench.ask_operator("Connect it")


def test_a_session_whose_documents_are_nonsense(tmp_path: Path) -> None:
    writer = SessionWriter.create(tmp_path / "s", start_document(small(), BENCH_FILE))
    writer.emit("step-start", step="many")
    writer.close("failed", "stop here")
    with pytest.raises(BadInput, match="its documents are not those of a run"):
        resumable(load(tmp_path / "s"), BENCH_FILE)


@pytest.mark.parametrize(
    "record",
    [
        {},
        {"direction": "eval", "instrument": "analyser"},
        {"direction": "write", "instrument": "analyser"},
        {"direction": "read", "instrument": "analyser", "base64": "%"},
    ],
)
def test_a_record_that_is_none(tmp_path: Path, record: dict[str, Any]) -> None:
    with SessionWriter.create(tmp_path / "s", start_document(small(), BENCH_FILE)) as writer:
        writer.log_traffic(record)
    with pytest.raises(BadInput, match=r"traffic.jsonl, line 1: is no record of an exchange"):
        rerun(load(tmp_path / "s"), tmp_path / "again", lambda: lambda *_: None)


def test_a_stored_procedure_that_is_none(tmp_path: Path) -> None:
    for number, procedure in enumerate(([], "x", {"steps": 3}, {"steps": ["x"]}, {"steps": [{"do": {"a": 1}}]})):
        with SessionWriter.create(tmp_path / f"{number}", {"procedure": procedure, "backend": "visa"}):
            pass
        with pytest.raises(BadInput):
            rerun(load(tmp_path / f"{number}"), tmp_path / "again", lambda: lambda *_: None)


def test_a_ready_procedure_is_found_by_its_name_only() -> None:
    for name in ("../procedures/full_motor_test", "full_motor_test/", "nothing"):
        with pytest.raises(BadInput):
            load_procedure(name)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such signal there")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_polite_kill_ends_a_run_as_ctrl_c_does(tmp_path: Path, number: signal.Signals) -> None:
    """On a prompt, where a run spends most of its time; and where a script has started it in the background, with Ctrl-C ignored."""
    code = (
        "import sys; from motoremi.run import runner; from motoremi.virtual.simulated_bench import SimulatedBench;"
        f"runner.make_bench = lambda file: SimulatedBench({SEED});"
        "sys.argv = ['motoremi', 'run', 'impedance_only', '--out', sys.argv[1]];"
        "from motoremi.cli import main; main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "s")],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN) and None,
    )  # fmt: skip
    assert process.stderr is not None
    assert process.stdin is not None
    said = ""
    until = time.monotonic() + 60
    while "s stop:" not in said and time.monotonic() < until:
        said += process.stderr.read(1)
    process.send_signal(number)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "stopped; what was measured is kept" in error
    session = load(tmp_path / "s")
    assert session.status == "interrupted"
    assert session.documents[-1]["reason"] == "stopped by the operator in step 2 (compensate)"
    assert [document["safe"] for document in session.documents if document["kind"] == "safe"] == [True]
    assert verify(tmp_path / "s") == []


def test_a_session_holds_what_was_measured_in_its_own_folder_only(tmp_path: Path) -> None:
    bench = SimulatedBench(SEED)
    measured(tmp_path / "s", small("fixture_check"), bench)
    bench.close()
    assert [entry.name for entry in tmp_path.iterdir()] == ["s"]


def test_a_resource_that_is_not_allowed_is_refused_before_anything_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bench.toml").write_text('backend = "@py"\nallow = ["GPIB0::9::INSTR"]\n', encoding="utf-8")
    monkeypatch.setattr(sys, "argv", ["motoremi", "run", "impedance_only", "--bench", str(tmp_path / "bench.toml"), "--out", str(tmp_path / "s")])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert capsys.readouterr().err == "motoremi: analyser: GPIB0::17::INSTR is not on the bench's allow-list (GPIB0::9::INSTR)\n"
    assert not (tmp_path / "s").exists()
