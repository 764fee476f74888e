"""The motor's state in a run: read, demanded, marked; the supply that is off whatever happens; the operator who may say no."""

from __future__ import annotations

import copy
import io
import re
import sys
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from fault_matrix import BENCH_FILE, SEED, small

from motoremi.arrays import JsonDict
from motoremi.cli import bench as cli_bench
from motoremi.cli import main
from motoremi.data.session import Session, SessionWriter, load, reopen, verify
from motoremi.errors import BadInput, InstrumentError
from motoremi.report.gaps import of_the_run
from motoremi.run.answer import Answer
from motoremi.run.on_bench import on_bench
from motoremi.run.rehearsal import rehearse
from motoremi.run.rerun import rerun
from motoremi.run.resume import Done, needed_again
from motoremi.run.runner import resumable, run, start_document
from motoremi.schema.bench_file import BenchFile, load_bench_file
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.schema.procedure_tables import InstrumentSpec
from motoremi.virtual.faults import FaultLayer
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_device import SimulatedDevice

WARM = small("emission_warm_motor")


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    bench = SimulatedBench(SEED)
    yield bench
    bench.close()


def changed(change: Callable[[JsonDict], object]) -> Procedure:
    """The ready procedure with something changed."""
    data = copy.deepcopy(WARM.source)
    change(data)
    return parse_procedure(data, "changed")


def measure(
    folder: Path, bench: SimulatedBench, procedure: Procedure = WARM, prompt: Callable[[str], Answer | None] = lambda text: None, **others: Any
) -> Session:
    writer = SessionWriter.create(folder, start_document(procedure, BENCH_FILE))
    if listener := others.get("listener"):
        writer.subscribe(listener)
    run(procedure, bench, writer, analyse=lambda *_: None, prompt=prompt)
    return load(folder)


def placed(bench: SimulatedBench, role: str, procedure: Procedure = WARM) -> SimulatedDevice:
    """The simulated instrument of a role, on the bench before the run."""
    spec = procedure.instruments[role]  # type: ignore[index]
    bench.open(role, spec.driver, spec.resource, lambda record: None, {role: spec.options}).close()
    return bench.devices[role]


def of_kind(session: Session, kind: str) -> list[JsonDict]:
    return [document for document in session.documents if document["kind"] == kind]


@pytest.mark.slow
def test_every_spectrum_has_the_state_that_instruments_read(tmp_path: Path, bench: SimulatedBench) -> None:
    session = measure(tmp_path / "s", bench)
    at_rest, *warm = [spectrum.metadata["state"] for spectrum in session.spectra]
    assert (at_rest["voltage_volt"], at_rest["speed_rpm"], at_rest["temperature_degc"]) == (0.0, 0.0, 23.0)
    for state in warm:
        assert state["voltage_volt"] == pytest.approx(12.0, rel=1e-3)
        assert state["current_ampere"] == pytest.approx(0.4286, rel=1e-3)
        assert state["speed_rpm"] == pytest.approx(3180.5, rel=1e-3)
        # 23 K above ambient in the end; stable within 1 K for 300 s comes a little earlier.
        assert 43 < state["temperature_degc"] < 46.2
        assert state["at_end"]["speed_rpm"] == state["speed_rpm"]
        assert state["time"] < state["at_end"]["time"]
        assert "outside" not in state
        assert "missing" not in state
    assert warm[0]["read_by"]["speed_rpm"] == "tachometer: line reader at ASRL3::INSTR"
    # The supply reads what no meter of its own is there for; the voltmeter comes before it.
    assert warm[0]["read_by"]["current_ampere"].startswith("supply: Keysight Technologies E36313A")
    assert warm[0]["read_by"]["voltage_volt"].startswith("voltmeter: Keysight Technologies 34461A")
    reached = [document["reached"] for document in of_kind(session, "state")]
    assert reached == ["temperature stable within 1 K for 300 s", "speed stable within 1 % for 30 s"]
    # Hours of the bench, none of ours.
    assert of_kind(session, "state")[0]["seconds"] > 1000
    assert not bench.stand.driven
    assert "motor's state with 3" in session.summary()
    assert verify(tmp_path / "s") == []


def test_it_replays_bit_for_bit_with_its_times(tmp_path: Path, bench: SimulatedBench) -> None:
    session = measure(tmp_path / "s", bench)
    for number, source in enumerate((session, None)):
        result = rerun(source or load(tmp_path / "again0"), tmp_path / f"again{number}", lambda: lambda *_: None)
        assert result.same
        assert result.compared == 3


@pytest.mark.slow
@pytest.mark.parametrize("at", ["spectra/average-motor-off-1.csv", "spectra/peak-1.csv"])
def test_the_supply_is_off_after_ctrl_c_and_set_again_by_resume(tmp_path: Path, bench: SimulatedBench, at: str) -> None:
    driven = []

    def stop(document: JsonDict) -> None:
        if document.get("file") == at:
            driven.append(bench.stand.driven)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        measure(tmp_path / "s", bench, listener=stop)
    assert driven == [at == "spectra/peak-1.csv"]
    assert not bench.stand.driven
    other = SimulatedBench(SEED)
    procedure, done = resumable(load(tmp_path / "s"), BENCH_FILE)
    run(procedure, other, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
    assert not other.stand.driven
    other.close()
    session = load(tmp_path / "s")
    assert session.status == "done"
    for spectrum in session.spectra[1:]:
        assert spectrum.metadata["state"]["voltage_volt"] == pytest.approx(12.0, rel=1e-3)
        assert "outside" not in spectrum.metadata["state"]
    again = rerun(session, tmp_path / "again", lambda: lambda *_: None)
    assert again.same


def test_what_is_needed_again_of_the_state() -> None:
    plan = WARM.plan
    kinds = [planned.step.do for planned in plan]
    assert kinds[2:8] == ["connect", "supply", "wait-for", "wait-for", "spectrum", "spectrum"]
    assert needed_again(plan, Done(steps=7)) == {1, 3, 4, 5, 6}
    assert needed_again(plan, Done(steps=4)) == {1, 3, 4}
    # Only the report is left, and the supply is known to be off.
    assert needed_again(plan, Done(steps=9)) == set()
    # The run was killed while the supply was on: somebody has to switch it off, whatever is left to do.
    killed = [{"kind": "instrument", "role": "supply", "identity": {}}, *[{"kind": "step-start", "step": 1}, {"kind": "step-stop"}]]
    assert Done.of(killed).left_on
    assert needed_again(plan, Done(steps=9, left_on=True)) == {1}
    assert not Done.of([*killed, {"kind": "safe", "role": "supply", "safe": True}]).left_on


def test_a_supply_that_was_left_on_is_switched_off_by_resuming(tmp_path: Path, bench: SimulatedBench) -> None:
    """Killed after the last measurement: the report alone is left, and the motor still runs."""
    session = measure(tmp_path / "s", bench)
    (tmp_path / "s" / "manifest.json").unlink()
    lines = (tmp_path / "s" / "session.jsonl").read_bytes().splitlines(keepends=True)
    kept = next(number for number, document in enumerate(session.documents) if document["kind"] == "step-stop" and document["step"] == 9)
    (tmp_path / "s" / "session.jsonl").write_bytes(b"".join(lines[: kept + 1]))
    other = SimulatedBench(SEED)
    supply = placed(other, "supply")
    for command in (b"VOLT 12,(@2)\n", b"OUTP ON,(@2)\n"):
        supply.write(command)
    assert other.stand.driven
    procedure, done = resumable(load(tmp_path / "s"), BENCH_FILE)
    run(procedure, other, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
    assert not other.stand.driven
    other.close()


@pytest.mark.parametrize("driver", ["e36300", "hmp4000"])
def test_a_supply_in_current_limit_is_told_and_marked(
    tmp_path: Path, bench: SimulatedBench, driver: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def weak(data: JsonDict) -> None:
        data["instruments"]["supply"]["driver"] = driver
        # Less than the load needs: the motor stands still.
        data["steps"][3] |= {"current_limit": "0.2 A", "ramp": "0 s"}

    session = measure(tmp_path / "s", bench, changed(weak), listener=cli_bench.tell)
    limit = "the supply is in current limit (constant current): 0.16 V at 0.2 A instead of 12 V"
    assert of_kind(session, "supply")[0]["trouble"] == limit
    assert [spectrum.metadata["state"].get("outside") for spectrum in session.spectra] == [None, [limit], [limit]]
    told = capsys.readouterr().out
    assert f"supply on; {limit}" in told
    assert told.count(f"MARKED: {limit}") == 2
    assert "2 MARKED" in session.summary()
    assert not bench.stand.driven


def test_what_is_measured_outside_of_the_demanded_state_is_marked(tmp_path: Path, bench: SimulatedBench) -> None:
    def brake(document: JsonDict) -> None:
        """Somebody puts a brake on the shaft when the motor was warm and steady."""
        if document.get("file") == "spectra/peak-1.csv":
            bench.stand.rotation *= 0.9
            bench.stand.advance = lambda: None  # type: ignore[method-assign]

    session = measure(tmp_path / "s", bench, listener=brake)
    _, first, second = [spectrum.metadata["state"].get("outside") for spectrum in session.spectra]
    assert first is None
    assert second[0] == "speed 2862 rpm: 3149 rpm to 3212 rpm was demanded"


def test_a_state_that_never_comes_ends_the_run_or_is_asked_about(tmp_path: Path, bench: SimulatedBench) -> None:
    def impatient(data: JsonDict) -> None:
        data["steps"][4] = {"do": "wait-for", "quantity": "temperature", "target": "80 degC", "within": "1 K", "hold": "10 s", "longest": "60 s"}

    with pytest.raises(
        InstrumentError, match=r"the temperature was not at 80 degC within 1 K for 10 s within 60 s \(last 27.\d* degC\); remove the cause"
    ):
        measure(tmp_path / "stop", bench, changed(impatient))
    assert not bench.stand.driven
    assert len(load(tmp_path / "stop").spectra) == 1

    def ask(data: JsonDict) -> None:
        impatient(data)
        data["steps"][4]["otherwise"] = "ask"

    asked: list[str] = []
    session = measure(tmp_path / "ask", SimulatedBench(SEED), changed(ask), prompt=lambda text: asked.append(text) or "done")
    assert asked[-1].startswith("The temperature was not at 80 degC")
    assert "CAUTION" not in asked[0]
    marks = [spectrum.metadata["state"].get("outside") for spectrum in session.spectra]
    assert marks[0] is None
    assert all("never was temperature at 80 degC within 1 K for 10 s" in mark[0] for mark in marks[1:])
    answers = of_kind(session, "prompt")
    assert [document["answer"] for document in answers] == ["done"] * len(asked)
    assert all(document["asked"] <= document["time"] for document in answers)
    again = rerun(session, tmp_path / "again", lambda: lambda *_: None)
    assert again.same


BABBLE = {
    "garbage": lambda: b"\xff\x00#\x81\xa5!!\n",
    "not a number": lambda: b"n=nan rpm\n",
    "another instrument": lambda: b"T=+023.1 C\n",
    "a cut line": lambda: b"n=30\n",
    "endless text": lambda: b"x" * 4000,
    "silence": lambda: b"",
}


@pytest.mark.parametrize("kind", sorted(BABBLE))
def test_a_babbling_tachometer_is_one_line_and_nothing_is_lost(
    tmp_path: Path, bench: SimulatedBench, kind: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_wait(data: JsonDict) -> None:
        data["steps"] = [step for step in data["steps"] if step.get("quantity") != "speed"]

    tachometer = placed(bench, "tachometer")

    def begin(document: JsonDict) -> None:
        if document.get("file") == "spectra/average-motor-off-1.csv":
            monkeypatch.setattr(tachometer, "take_answers", BABBLE[kind])

    listeners = [begin, cli_bench.tell]
    session = measure(tmp_path / "s", bench, changed(without_wait), listener=lambda document: [listen(document) for listen in listeners])
    assert len(session.spectra) == 3
    for spectrum in session.spectra[1:]:
        state = spectrum.metadata["state"]
        assert "speed_rpm" not in state
        assert state["voltage_volt"] == pytest.approx(12.0, rel=1e-3)
        reason = state["missing"]["speed_rpm"]
        expected = "no line came within 3 s" if kind in ("endless text", "silence") else "none of 8 lines can be read"
        assert expected in reason
        assert "\n" not in reason
        assert len(reason) < 400
    marked = [line for line in capsys.readouterr().out.splitlines() if "MARKED: speed not read: ASRL3::INSTR" in line]
    assert len(marked) == 2
    assert verify(tmp_path / "s") == []
    # The same while it is waited for: an end, and soon.
    other = SimulatedBench(SEED)
    tachometer = placed(other, "tachometer")
    monkeypatch.setattr(tachometer, "take_answers", BABBLE[kind])
    with pytest.raises(InstrumentError, match=r"no line came|can be read"):
        measure(tmp_path / "t", other)
    other.close()


def test_a_quantity_that_is_waited_for_and_cannot_be_read_ends_the_wait(tmp_path: Path, bench: SimulatedBench) -> None:
    tachometer = placed(bench, "tachometer")

    def unplug(document: JsonDict) -> None:
        if document["kind"] == "state":
            tachometer.take_answers = lambda: b""  # type: ignore[method-assign]

    with pytest.raises(InstrumentError, match="the speed that is waited for cannot be read: ASRL3::INSTR: no line came within 3 s"):
        measure(tmp_path / "s", bench, listener=unplug)
    assert not bench.stand.driven


def test_a_supply_that_restarts_ends_the_run_but_keeps_the_spectrum(tmp_path: Path, bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    supply = placed(bench, "supply")
    layer = FaultLayer(supply, "restart", 10**9)
    receiver = bench.devices["receiver"]
    healthy = receiver.respond

    def restart_during_the_scan(query: bytes) -> Any:
        if query.startswith(b"INIT2") and bench.stand.driven:
            layer.at = 0
        return healthy(query)

    monkeypatch.setattr(receiver, "respond", restart_during_the_scan)
    with pytest.raises(InstrumentError, match="did it restart"):
        measure(tmp_path / "s", bench)
    session = load(tmp_path / "s")
    assert [spectrum.detector for spectrum in session.spectra] == ["average", "peak"]
    assert "the supply failed while this was measured" in session.spectra[1].metadata["state"]["outside"][0]
    assert session.status == "failed"
    assert not bench.stand.driven


@pytest.mark.slow
@pytest.mark.parametrize(("answer", "raised", "status"), [("not done", InstrumentError, "interrupted"), ("stop", KeyboardInterrupt, "interrupted")])
def test_an_operator_can_say_no(tmp_path: Path, bench: SimulatedBench, answer: Answer, raised: type[BaseException], status: str) -> None:
    said: list[str] = []

    def prompt(text: str) -> Answer:
        said.append(text)
        return answer if "let the motor run" in text else "done"

    with pytest.raises(raised) as caught:
        measure(tmp_path / "s", bench, prompt=prompt)
    if answer == "not done":
        assert "the operator answered 'not done' to: Connect the motor to its supply" in str(caught.value)
        assert "\n" not in str(caught.value)
    session = load(tmp_path / "s")
    assert session.status == status
    assert [document["answer"] for document in of_kind(session, "prompt")] == ["done", answer]
    assert [spectrum.condition for spectrum in session.spectra] == ["motor off"]
    assert not bench.stand.driven
    assert verify(tmp_path / "s") == []
    again = rerun(session, tmp_path / "again", lambda: lambda *_: None)
    assert again.same
    assert again.ended.endswith(of_kind(session, "stop")[0]["reason"])
    other = SimulatedBench(SEED)
    procedure, done = resumable(session, BENCH_FILE)
    run(procedure, other, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: "done", done=done)
    other.close()
    assert load(tmp_path / "s").status == "done"
    assert len(load(tmp_path / "s").spectra) == 3
    assert rerun(load(tmp_path / "s"), tmp_path / "whole", lambda: lambda *_: None).same


@pytest.mark.parametrize(
    ("typed", "answer"),
    [("\n", "done"), ("n\n", "not done"), ("NO\n", "not done"), ("s\n", "stop"), ("what?\n n \n", "not done"), ("done\n", "done")],
)
def test_what_is_typed_at_a_prompt(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], typed: str, answer: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    assert cli_bench.ask_operator("Connect it") == answer
    assert "[Enter] done, n not done, s stop: " in capsys.readouterr().err


@pytest.mark.parametrize(("typed", "status"), [("\n" * 9, 0), ("\nn\n", 3), ("s\n", 130)])
def test_the_command_line_takes_the_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], typed: str, status: int
) -> None:
    """A real bench, as far as the command knows, with the answers piped in."""
    bench = SimulatedBench(SEED)
    monkeypatch.setattr("motoremi.run.runner.make_bench", lambda bench_file: bench)
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    source = tmp_path / "p.toml"
    source.write_text(
        'title = "x"\n[instruments]\nsupply = { driver = "hmp4000", resource = "x" }\n'
        '[[steps]]\ndo = "identify"\n[[steps]]\ndo = "connect"\nwhat = "lisn-motor-off"\n'
        '[[steps]]\ndo = "supply"\nvoltage = "12 V"\ncurrent_limit = "5 A"\n[[steps]]\ndo = "connect"\nwhat = "lisn-motor-on"\n',
        encoding="utf-8",
    )
    monkeypatch.setattr(sys, "argv", ["motoremi", "run", str(source), "--out", str(tmp_path / "s")])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == status
    error = capsys.readouterr().err
    says = {0: "s stop: ", 3: "nothing was measured for this step, continue with --resume", 130: "stopped; what was measured is kept in "}
    assert says[status] in error.splitlines()[-1]
    if status != 130:
        assert "CAUTION: the supply is ON (12 V). Connect the motor" in error
    assert not bench.stand.driven


BENCH = """
highest_voltage = "14 V"
[instruments.tachometer]
driver = "line-reader"
resource = "ASRL/dev/ttyUSB7::INSTR"
[instruments.tachometer.lines]
example = "0012;3000,5;ok"
field = 2
separator = ";"
unit = "rpm"
"""


def test_a_bench_file_brings_its_instruments_and_limits(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(BENCH, encoding="utf-8")
    bench_file = load_bench_file(tmp_path / "bench.toml")
    without = changed(lambda data: data["instruments"].pop("tachometer"))
    with pytest.raises(BadInput, match=r"step 6 \(wait-for\): needs instruments.tachometer, in the procedure or in the bench file"):
        on_bench(without, BenchFile())
    merged = on_bench(without, bench_file)
    # What the bench brings is part of the record: a replay needs it.
    assert merged.source["instruments"]["tachometer"]["lines"]["example"] == "0012;3000,5;ok"
    bench = SimulatedBench(SEED)
    session = measure(tmp_path / "s", bench, merged)
    bench.close()
    assert session.spectra[-1].metadata["state"]["speed_rpm"] == pytest.approx(3180.5, rel=1e-3)
    assert rerun(session, tmp_path / "again", lambda: lambda *_: None).same
    with pytest.raises(BadInput, match=r"step 4 \(supply\): 15 V is more than this bench allows \(14 V\)"):
        on_bench(changed(lambda data: data["steps"][3].update(voltage="15 V")), bench_file)


def interrupted(folder: Path, bench: SimulatedBench) -> Session:
    """A run that Ctrl-C stops at its first spectrum with the supply on."""

    def stop(document: JsonDict) -> None:
        if document.get("file") == "spectra/peak-1.csv":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        measure(folder, bench, listener=stop)
    return load(folder)


def test_a_resumed_run_keeps_the_limits_of_its_bench_file(tmp_path: Path, bench: SimulatedBench) -> None:
    session = interrupted(tmp_path / "s", bench)
    low = BENCH_FILE.model_copy(update={"highest_voltage": 6.0})
    with pytest.raises(BadInput, match=r"step 4 \(supply\): 12 V is more than this bench allows \(6 V\)"):
        resumable(session, low)
    weak = BENCH_FILE.model_copy(update={"highest_current": 0.1})
    with pytest.raises(BadInput, match=r"step 4 \(supply\): 2 A is more than this bench allows \(100 mA\)"):
        resumable(session, weak)


def test_a_resumed_run_uses_the_instruments_of_its_bench_file_and_records_them(tmp_path: Path, bench: SimulatedBench) -> None:
    session = interrupted(tmp_path / "s", bench)
    supply = InstrumentSpec.model_validate({**WARM.source["instruments"]["supply"], "resource": "ASRL/dev/ttyUSB9::INSTR", "channel": 3})
    other = SimulatedBench(SEED)
    procedure, done = resumable(session, BENCH_FILE.model_copy(update={"instruments": {"supply": supply}, "operator": "Bert"}))
    assert (procedure.instruments["supply"].resource, procedure.instruments["supply"].channel) == ("ASRL/dev/ttyUSB9::INSTR", 3)
    run(procedure, other, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
    other.close()
    session = load(tmp_path / "s")
    resume = of_kind(session, "resume")[0]
    assert (resume["operator"], resume["procedure"]["instruments"]["supply"]["channel"]) == ("Bert", 3)
    supplies = [document for document in of_kind(session, "instrument") if document["role"] == "supply"]
    assert [document["settings"]["channel"] for document in supplies] == [2, 3]
    for number in range(2):
        # The replay resumes with the changed instruments as well, and its own record can be replayed.
        result = rerun(session, tmp_path / f"again{number}", lambda: lambda *_: None)
        assert result.same
        session = load(result.path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"motor": "M2"}, "s was begun with motor 'M1', but 'M2' is stated now; connect and state that motor, or begin a new session"),
        ({"motor": "M1", "serial": "2"}, "s was begun with the motor with serial number '1', but '2' is stated now; connect and state that motor"),
    ],
)
def test_a_run_is_not_resumed_with_another_motor(tmp_path: Path, bench: SimulatedBench, stated: dict[str, str], message: str) -> None:
    first = BENCH_FILE.model_copy(update={"motor": "M1", "serial": "1", "operator": "Anna"})
    writer = SessionWriter.create(tmp_path / "s", start_document(WARM, first))
    writer.close("interrupted", "by the test")
    with pytest.raises(BadInput, match=re.escape(message)):
        resumable(load(tmp_path / "s"), BENCH_FILE.model_copy(update=stated))
    # A bench file that says nothing of the motor is no contradiction; who goes on is recorded.
    own = BENCH_FILE.model_copy(update={"operator": "Bert", "calibrated": {"analyser": date(2026, 5, 1)}})
    procedure, done = resumable(load(tmp_path / "s"), own)
    run(procedure, bench, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
    session = load(tmp_path / "s")
    resume = of_kind(session, "resume")[0]
    assert (resume["operator"], resume["calibrated"]) == ("Bert", {"analyser": "2026-05-01"})
    assert "procedure" not in resume
    assert "the run was interrupted and resumed later (at step 1 by Bert)" in of_the_run(session)


def test_a_supply_refuses_what_it_cannot_deliver_before_anything_is_measured(tmp_path: Path, bench: SimulatedBench) -> None:
    with pytest.raises(BadInput, match="output 2 delivers up to 25 V at 2 A, but 30 V at 2 A was asked for"):
        measure(tmp_path / "s", bench, changed(lambda data: data["steps"][3].update(voltage="30 V")))
    assert load(tmp_path / "s").spectra == ()
    with pytest.raises(BadInput, match="has outputs 1 to 3, but output 4 was asked for"):
        measure(tmp_path / "t", bench, changed(lambda data: data["instruments"]["supply"].update(channel=4)))


def test_one_instrument_plays_several_roles(tmp_path: Path, bench: SimulatedBench) -> None:
    def one(data: JsonDict) -> None:
        lines = data["instruments"]["tachometer"]["lines"] | {"example": "n=3012.4 T=23.1", "pattern": r"n=([\d.]+) T=[\d.]+"}
        data["instruments"]["tachometer"]["lines"] = lines
        data["instruments"]["thermometer"] = {
            "driver": "line-reader",
            "resource": data["instruments"]["tachometer"]["resource"],
            "lines": {**lines, "pattern": r"n=[\d.]+ T=([\d.]+)", "unit": "degC"},
        }

    session = measure(tmp_path / "s", bench, changed(one))
    assert [document["role"] for document in of_kind(session, "instrument")] == ["receiver", "supply", "voltmeter", "thermometer"]
    assert of_kind(session, "instrument")[-1]["also"] == ["tachometer"]
    state = session.spectra[-1].metadata["state"]
    assert state["speed_rpm"] == pytest.approx(3180.5, rel=1e-3)
    assert 43 < state["temperature_degc"] < 46.2


@pytest.mark.slow
def test_a_dry_run_knows_the_steps_and_waits_for_no_state_that_its_motor_never_has(bench: SimulatedBench) -> None:
    procedure = changed(lambda data: data["steps"][4].update(target="90 degC", longest="600 s", otherwise="stop"))
    steps = {(step.number, step.do): step for step in rehearse(procedure, BenchFile())}
    assert ("supply", "VOLT 12,(@2)", 1) in steps[4, "supply"].sent
    assert steps[4, "supply"].seconds >= 2
    assert steps[5, "wait-for"].seconds >= 600
    assert "Continue nevertheless?" in steps[5, "wait-for"].prompts[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data["steps"][3].pop("current_limit"), "needs voltage and current_limit"),
        (lambda data: data["steps"][3].update(output="off"), "one that is off takes neither"),
        (lambda data: data["steps"][4].update(within="1 %"), "give the tolerance of a temperature in K"),
        (lambda data: data["steps"][4].update(within="1"), "write it with its unit, K"),
        (lambda data: data["steps"][4].update(within="-1 K"), "must be above 0"),
        (lambda data: data["steps"][4].update(hold="0 s"), "must be above 0 without a target"),
        (lambda data: data["steps"][4].update(longest="10 s"), "must not be below hold"),
        (lambda data: data["instruments"]["supply"].update(driver="34461a"), "the driver '34461a' is no supply"),
        (lambda data: data["instruments"]["tachometer"].update(driver="34461a"), "the driver '34461a' reads no speed"),
        (lambda data: data["instruments"]["tachometer"].pop("lines"), "'lines' belongs to the driver line-reader"),
        (lambda data: data["instruments"]["tachometer"]["lines"].update(unit="K"), "the unit 'K' is none of speed"),
        (lambda data: data["instruments"]["tachometer"]["lines"].update(field=1), "give either field or pattern"),
        (lambda data: data["instruments"]["tachometer"]["lines"].update(pattern="x(.*)"), "no number in the example"),
        (lambda data: data["instruments"]["tachometer"]["lines"].update(pattern="n="), "has 0 groups"),
        (lambda data: data["instruments"]["tachometer"]["lines"].update(pattern="n=(["), "is no regular expression"),
        (lambda data: data["instruments"]["tachometer"]["lines"].update(pattern=r"n=((?:\d+)+)\D*"), "repeat no group"),
        (lambda data: data["steps"].pop(0), "the first step must be 'identify'"),
    ],
)
def test_mistakes_in_the_new_keys_are_one_line(change: Callable[[JsonDict], object], message: str) -> None:
    with pytest.raises(BadInput) as caught:
        changed(change)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
