"""Whole runs on the simulated bench: what is measured, what is written, and how a run ends."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motoremi.arrays import JsonDict
from motoremi.bench.connect import VisaBench
from motoremi.bench.replay import ReplayBench
from motoremi.data.session import Session, SessionWriter, StorageError, load, reopen, verify
from motoremi.errors import BadInput, InstrumentError
from motoremi.report.identity import identity_section
from motoremi.run.rerun import rerun
from motoremi.run.runner import Outcome, make_bench, resumable, run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure, parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.workflow import report_session


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    bench = SimulatedBench(11, ("eddy-laminations",))
    yield bench
    bench.close()


@pytest.fixture
def procedure() -> Procedure:
    """The full test, with few points."""
    data = copy.deepcopy(load_procedure("full_motor_test").source)
    data["sweep"]["points"] = 21
    data["spectrum"]["step"] = "150 kHz"
    return parse_procedure(data, "short.toml")


def analyse(kind: str, session: Any, parameters: JsonDict) -> JsonDict | None:
    return {"verdict": "pass", **parameters} if kind == "compare" else None


def measure(path: Path, procedure: Procedure, bench: Any, **others: Any) -> Outcome:
    writer = SessionWriter.create(path, start_document(procedure, BenchFile(backend="sim")))
    if listener := others.pop("listener", None):
        writer.subscribe(listener)
    return run(procedure, bench, writer, **{"analyse": analyse, "prompt": lambda text: None, **others})


def kinds(session: Session) -> list[str]:
    return [document["kind"] for document in session.documents]


@pytest.mark.slow
def test_a_full_run(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    told: list[str] = []
    seen: list[JsonDict] = []
    asked: list[tuple[str, JsonDict]] = []

    def fake(kind: str, session: Any, parameters: JsonDict) -> JsonDict | None:
        asked.append((kind, parameters))
        return analyse(kind, session, parameters)

    outcome = measure(tmp_path / "s", procedure, bench, analyse=fake, prompt=told.append, listener=seen.append)
    session = load(tmp_path / "s")
    assert outcome.passed
    assert outcome.to_dict() == {"steps": 13, "passed": True, "verdicts": [{"verdict": "pass", "error_percent": 5.0}]}
    assert [kind for kind, _ in asked] == ["fit", "compare", "diagnose", "report"]
    assert asked[0][1] == {"method": "ant-colony", "seed": 1}
    assert [text.split()[0] for text in told] == ["Leave"] + ["Connect"] * 5
    assert session.status == "done"
    assert not session.interrupted
    assert verify(tmp_path / "s") == []
    assert [sweep.termination for sweep in session.sweeps] == ["short"] * 3 + ["open"] * 3
    assert [sweep.metadata["connection"] for sweep in session.sweeps] == [3, 3, 3, 4, 4, 4]
    assert sorted(spectrum.detector for spectrum in session.spectra) == ["average", "average", "peak", "peak"]
    assert [d["kind"] for d in seen] == kinds(session)[1:]
    assert kinds(session).count("step-start") == kinds(session).count("step-stop") == 13
    # What is reported has ended: its instruments are safe, and the session says so.
    assert kinds(session)[-5:] == ["safe", "safe", "stop", "step-start", "step-stop"]
    instruments = [document for document in session.documents if document["kind"] == "instrument"]
    assert [document["identity"]["model"] for document in instruments] == ["4294A", "ESR3"]
    assert instruments[0]["settings"]["points"] == 21
    assert session.start["procedure"] == procedure.source
    for sweep in session.sweeps:
        truth = bench.motor.impedance(sweep.termination, sweep.frequency_hz)
        assert np.median(np.abs(sweep.impedance_ohm / truth - 1)) < 0.02


@pytest.mark.slow
def test_the_report_of_a_run_says_how_the_run_ended(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    """It is a step of the run, but the run has ended when it is written."""
    data = copy.deepcopy(procedure.source)
    data["steps"] = [step for step in data["steps"] if step["do"] in ("identify", "sweep", "report")]
    short = parse_procedure(data, "x")
    measure(tmp_path / "s", short, bench, analyse=lambda kind, store, _: report_session(store) and None)
    told = json.loads((tmp_path / "s" / "report" / "report.json").read_text(encoding="utf-8"))
    assert told["status"] == "done"
    session = load(tmp_path / "s")
    assert ("ended", "done") in identity_section(session, "").tables[0].rows
    assert "<td>interrupted</td>" not in (tmp_path / "s" / "report" / "report.html").read_text(encoding="utf-8")
    assert [d["status"] for d in session.documents if d["kind"] == "stop"] == ["done"]
    assert (session.status, session.interrupted, verify(tmp_path / "s")) == ("done", False, [])


@pytest.mark.slow
@pytest.mark.parametrize(("trouble", "status"), [(BadInput("no paper"), "failed"), (KeyboardInterrupt(), "interrupted")])
def test_a_report_that_fails_is_made_when_the_run_goes_on(
    tmp_path: Path, procedure: Procedure, bench: SimulatedBench, trouble: BaseException, status: str
) -> None:
    def broken(kind: str, session: Any, parameters: JsonDict) -> JsonDict | None:
        if kind == "report":
            raise trouble
        return None

    with pytest.raises(type(trouble)):
        measure(tmp_path / "s", procedure, bench, analyse=broken)
    session = load(tmp_path / "s")
    assert session.status == status
    assert verify(tmp_path / "s") == []
    if status == "failed":
        recorded = rerun(session, tmp_path / "again", lambda: broken)
        assert recorded.same
        assert recorded.ended == session.documents[-1]["reason"] == "step 13 (report): no paper"
    bench_file = BenchFile(backend="sim")
    going_on, done = resumable(session, bench_file)
    asked: list[str] = []
    run(going_on, bench, reopen(tmp_path / "s"), analyse=lambda kind, *_: asked.append(kind), prompt=lambda text: None, done=done)  # type: ignore[func-returns-value]
    assert asked == ["report"]
    assert load(tmp_path / "s").status == "done"


@pytest.mark.parametrize(
    ("said", "verdict"),
    [([], "done"), (["missing-effect"], "done"), (["pass"], "pass"), (["pass", "missing-effect"], "pass"), (["pass", "fail"], "fail")],
)
def test_a_run_passes_only_if_something_was_judged(said: list[str], verdict: str) -> None:
    outcome = Outcome(3, tuple({"verdict": word} for word in said))
    assert (outcome.verdict, outcome.passed) == (verdict, verdict != "fail")


@pytest.mark.slow
def test_one_seed_is_one_session(tmp_path: Path, procedure: Procedure) -> None:
    for name in ("a", "b"):
        bench = SimulatedBench(4)
        measure(tmp_path / name, procedure, bench)
        bench.close()
    for file in ("sweeps/open-3.csv", "spectra/peak-1.csv"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


@pytest.mark.slow
def test_a_run_replays_from_its_own_traffic(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    measure(tmp_path / "first", procedure, bench)
    recorded = load(tmp_path / "first")
    replay = ReplayBench(recorded.traffic())
    measure(tmp_path / "again", parse_procedure(recorded.start["procedure"], "session"), replay)
    replay.finish()
    for name in ("sweeps/short-1.csv", "sweeps/open-3.csv", "spectra/peak-1.csv"):
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "first" / name).read_bytes()


@pytest.mark.slow
def test_a_replay_of_another_procedure_tells_the_difference(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    measure(tmp_path / "first", procedure, bench)
    data = copy.deepcopy(procedure.source)
    data["sweep"]["points"] = 22
    with pytest.raises(InstrumentError, match=r"expected write 'POIN 21\\n', got write 'POIN 22\\n'"):
        measure(tmp_path / "again", parse_procedure(data, "x"), ReplayBench(load(tmp_path / "first").traffic()))
    with pytest.raises(InstrumentError, match="analyser: the session holds no recorded traffic"):
        measure(tmp_path / "none", procedure, ReplayBench([]))


def test_an_instrument_that_fails_keeps_what_was_measured(
    tmp_path: Path, procedure: Procedure, bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = bench.devices["analyser"]
    sweeps = 0

    def fail_at_the_fifth(document: JsonDict) -> None:
        nonlocal sweeps
        sweeps += document["kind"] == "sweep"
        if sweeps == 5:
            monkeypatch.setattr(device, "respond", lambda query: b'-200,"EXECUTION ERROR"' if query == b"OUTPERRO?" else b"")

    with pytest.raises(InstrumentError, match="expected a binary block"):
        measure(tmp_path / "s", procedure, bench, listener=fail_at_the_fifth)
    session = load(tmp_path / "s")
    assert len(session.sweeps) == 5
    assert session.status == "failed"
    stop = session.documents[-1]
    assert stop["kind"] == "stop"
    assert stop["reason"].startswith("step 5 (sweep): GPIB0::17::INSTR: expected a binary block")
    safe = {document["role"]: document for document in session.documents if document["kind"] == "safe"}
    assert not safe["analyser"]["safe"]
    assert safe["receiver"]["safe"]
    assert session.traffic()[-1]["direction"] == "close"


def test_ctrl_c_leaves_the_instruments_safe(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    def interrupt(document: JsonDict) -> None:
        if document["kind"] == "sweep" and document["file"].endswith("open-1.csv"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        measure(tmp_path / "s", procedure, bench, listener=interrupt)
    session = load(tmp_path / "s")
    assert session.status == "interrupted"
    assert session.documents[-1]["reason"] == "stopped by the operator in step 5 (sweep)"
    assert len(session.sweeps) == 4
    assert bench.devices["analyser"].value("level") == 0.005
    assert verify(tmp_path / "s") == []


def test_a_full_disk_does_not_keep_an_instrument_from_its_safe_state(
    tmp_path: Path, procedure: Procedure, bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> Path:
        monkeypatch.setattr(SessionWriter, "log_traffic", full)
        raise StorageError("no space left")

    monkeypatch.setattr(SessionWriter, "add_sweep", full)
    with pytest.raises(StorageError, match="no space left"):
        measure(tmp_path / "s", procedure, bench)
    assert bench.devices["analyser"].value("level") == 0.005


@pytest.mark.slow
def test_an_analysis_that_fails_is_told(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    def broken(kind: str, session: Any, parameters: JsonDict) -> JsonDict | None:
        raise BadInput("nothing to fit")

    with pytest.raises(BadInput, match="nothing to fit"):
        measure(tmp_path / "s", procedure, bench, analyse=broken)
    session = load(tmp_path / "s")
    assert session.documents[-1]["reason"] == "step 10 (fit): nothing to fit"
    assert len(session.sweeps) == 6


def test_a_verdict_of_fail_is_no_error(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    outcome = measure(tmp_path / "s", procedure, bench, analyse=lambda *_: {"verdict": "fail"})
    assert not outcome.passed
    verdicts = [document for document in load(tmp_path / "s").documents if document["kind"] == "verdict"]
    assert [document["do"] for document in verdicts] == ["fit", "compare", "diagnose", "report"]
    assert load(tmp_path / "s").status == "done"


def test_the_wrong_driver_for_a_role(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    data = copy.deepcopy(procedure.source)
    data["instruments"]["analyser"]["driver"] = "esr"
    with pytest.raises(InstrumentError, match=r"expected a ESR\\d\*, but 'HEWLETT-PACKARD,4294A"):
        measure(tmp_path / "s", parse_procedure(data, "x"), bench)


def test_a_driver_that_is_no_analyser(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    data = copy.deepcopy(procedure.source)
    data["instruments"]["analyser"]["driver"] = "esr"
    bench.resources = {"analyser": bench.resources["receiver"], "receiver": bench.resources["receiver"]}  # type: ignore[misc]
    with pytest.raises(BadInput, match="RohdeSchwarzESR is no impedance analyser"):
        measure(tmp_path / "s", parse_procedure(data, "x"), bench)


def test_a_second_sweep_step_is_a_new_connection(tmp_path: Path, procedure: Procedure, bench: SimulatedBench) -> None:
    data = copy.deepcopy(procedure.source)
    step = {"do": "sweep", "termination": "open"}
    data["steps"] = [{"do": "identify"}, step, step]
    measure(tmp_path / "s", parse_procedure(data, "x"), bench)
    assert [sweep.metadata["connection"] for sweep in load(tmp_path / "s").sweeps] == [1, 2]


def test_benches_from_bench_files() -> None:
    simulated = make_bench(BenchFile(backend="sim", seed=5, effects=("core-loss",)))
    assert isinstance(simulated, SimulatedBench)
    assert simulated.truth()["hidden"] == ["core-loss"]
    simulated.close()
    real = make_bench(BenchFile(backend="@py"))
    assert isinstance(real, VisaBench)
    real.close()
    with pytest.raises(InstrumentError, match="no VISA library"):
        make_bench(BenchFile(backend="@nowhere"))
