"""The steps beside measuring: connect, wait, repeat, check, next; the dry run; the reference of all keys."""

from __future__ import annotations

import copy
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fault_matrix import BENCH_FILE, SEED, measured, small
from places import ROOT

from motoremi.bench.motor_connections import CONNECTIONS, INSTRUCTIONS
from motoremi.cli import main
from motoremi.data.session import SessionWriter, load, verify
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.rehearsal import rehearse
from motoremi.run.run_progress import RunProgress
from motoremi.run.runner import run, start_document
from motoremi.run.standards import judge_standard, wrong_standard
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.keys import markdown, reference
from motoremi.schema.procedure import load_procedure, parse_procedure, ready_procedures
from motoremi.schema.procedure_steps import Check
from motoremi.virtual.simulated_bench import SimulatedBench

DOCS = ROOT / "docs"


@pytest.fixture
def bench() -> Any:
    bench = SimulatedBench(SEED)
    yield bench
    bench.close()


def with_steps(*steps: dict[str, Any], name: str = "full_motor_test") -> Any:
    data = copy.deepcopy(small(name).source)
    data["steps"] = [{"do": "identify"}, *steps]
    return parse_procedure(data, "test.toml")


SHORT = {"do": "sweep", "termination": "short"}


def test_a_connection_made_by_a_step_serves_those_that_follow(tmp_path: Path, bench: SimulatedBench) -> None:
    procedure = with_steps({"do": "connect", "what": "short", "note": "at 20 °C"}, SHORT, SHORT, {"do": "connect", "what": "short"}, SHORT)
    told: list[str] = []
    writer = SessionWriter.create(tmp_path / "s", start_document(procedure, BENCH_FILE))
    run(procedure, bench, writer, analyse=lambda *_: None, prompt=told.append)
    assert [sweep.metadata["connection"] for sweep in load(tmp_path / "s").sweeps] == [1, 1, 2]
    assert len(told) == 2
    assert told[0].startswith("Connect the analyser between the two terminals of the motor, the far one joined to the frame. at 20 °C\n\n  H ---")


def test_every_connection_has_words_and_a_drawing() -> None:
    assert set(INSTRUCTIONS) == set(CONNECTIONS)
    for instruction in INSTRUCTIONS.values():
        assert instruction.text
        assert 1 < len(instruction.drawing.splitlines()) < 10
        assert max(map(len, instruction.drawing.splitlines())) < 80


def test_a_wait_takes_its_time_on_the_clock_of_the_bench(tmp_path: Path, bench: SimulatedBench) -> None:
    procedure = with_steps({"do": "wait", "time": "90 s", "reason": "warm up"})
    ticks = 0

    def tick() -> None:
        nonlocal ticks
        ticks += 1

    writer = SessionWriter.create(tmp_path / "s", start_document(procedure, BENCH_FILE))
    before = bench.clock.now()
    run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None, tick=tick)
    assert 90 <= bench.clock.now() - before < 92
    assert ticks >= 90


def test_a_repeat_does_its_steps_in_rounds(tmp_path: Path, bench: SimulatedBench) -> None:
    procedure = with_steps({"do": "repeat", "times": 3, "steps": [SHORT, {"do": "sweep", "termination": "open"}]})
    assert [str(planned) for planned in procedure.plan[1:3]] == ["step 2 (sweep), round 1 of 3", "step 3 (sweep), round 1 of 3"]
    session = measured(tmp_path / "s", procedure, bench)
    assert [sweep.termination for sweep in session.sweeps] == ["short", "open"] * 3
    assert [d["of"] for d in session.documents if d["kind"] == "step-start"] == [7] * 7


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ({"do": "repeat", "times": 2, "steps": [{"do": "repeat", "times": 2, "steps": [SHORT]}]}, "step 2 (repeat): steps.0"),
        (
            {"do": "repeat", "times": 2, "steps": [{"do": "sweep", "termination": "shut"}]},
            "step 2 (repeat): steps.0.sweep.termination: Input should be",
        ),
        ({"do": "repeat", "times": 1000, "steps": [SHORT] * 11}, "steps: 11001 steps with all repeats; at most 10000"),
        ({"do": "wait", "time": "3"}, "step 2 (wait): time: '3' has no unit: write it with its unit"),
        ({"do": "wait", "time": "3 s"}, ""),
        ({"do": "wait", "time": "2 days"}, "step 2 (wait): time: "),
        ({"do": "check", "standard": "load"}, "step 2 (check): nominal: belongs to the load standard"),
        ({"do": "check", "standard": "open", "nominal": "50 Ohm"}, "step 2 (check): nominal: belongs to the load standard"),
        ({"do": "connect", "what": "the lot"}, "step 2 (connect): what: Input should be 'open-standard'"),
        ({"do": "spectrum", "detector": "peak", "condition": "broken"}, "step 2 (spectrum): condition: Input should be 'motor running'"),
    ],
)
def test_mistakes_in_these_steps(step: dict[str, Any], message: str) -> None:
    if not message:
        assert with_steps(step).plan[1].step.time == 3.0
        return
    with pytest.raises(BadInput) as caught:
        with_steps(step)
    assert str(caught.value).startswith(f"test.toml: {message}")


def test_the_background_is_kept_with_its_condition(tmp_path: Path, bench: SimulatedBench) -> None:
    session = measured(tmp_path / "s", small("emission_only"), bench)
    assert [(spectrum.detector, spectrum.condition, spectrum.is_background) for spectrum in session.spectra] == [
        ("peak", "motor off", True),
        ("average", "motor off", True),
        ("peak", "motor running", False),
        ("average", "motor running", False),
    ]
    assert (tmp_path / "s" / "spectra" / "peak-motor-off-1.csv").exists()
    background, running = session.spectra[0], session.spectra[2]
    assert running.level_dbuv[0] > background.level_dbuv[0] + 20


def swept(impedance_ohm: float | complex) -> ImpedanceSweep:
    frequency_hz = np.geomspace(150e3, 30e6, 9)
    return ImpedanceSweep("short", frequency_hz, np.full(9, impedance_ohm, dtype=complex))


def test_a_fixture_is_judged_by_what_it_leaves_of_a_standard() -> None:
    short = Check(do="check", standard="short")
    # At 150 kHz the limit is 30 mOhm and 5 nH: 34.7 mOhm.
    assert judge_standard(short, swept(0.034))["verdict"] == "pass"
    failed = judge_standard(short, swept(0.035))
    assert (failed["verdict"], failed["worst_hz"]) == ("fail", 150e3)
    assert judge_standard(Check(do="check", standard="open"), swept(1e7))["verdict"] == "pass"
    assert judge_standard(Check(do="check", standard="open"), swept(1e5))["verdict"] == "fail"
    load_ = Check.model_validate({"do": "check", "standard": "load", "nominal": "100 Ohm", "tolerance_percent": 2.0})
    assert judge_standard(load_, swept(101.9))["verdict"] == "pass"
    assert judge_standard(load_, swept(100 + 2.1j))["share_of_limit"] == pytest.approx(1.05)


def test_a_spoilt_fixture_fails_the_check(tmp_path: Path) -> None:
    for effects, passed in (((), True), (("short-residual",), False)):
        bench = SimulatedBench(SEED, effects)
        writer = SessionWriter.create(tmp_path / str(passed), start_document(small("fixture_check"), BENCH_FILE))
        outcome = run(small("fixture_check"), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
        bench.close()
        assert outcome.passed is passed
        assert load(tmp_path / str(passed)).sweeps == ()
        assert verify(tmp_path / str(passed)) == []


def test_the_next_measurement_is_told_and_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from motoremi import workflow_steps

    monkeypatch.setattr(workflow_steps, "load", lambda path: None)
    monkeypatch.setattr(workflow_steps, "diagnosis_in", lambda session: {"next_measurement": {"id": "wide-sweep", "why": "to see"}})

    class Store:
        path = tmp_path
        saved: tuple[str, Any] | None = None

        def save_analysis(self, name: str, payload: Any) -> Path:
            self.saved = (name, payload)
            return tmp_path

    store = Store()
    assert workflow_steps.analyse()("next", store, {}) == {"next_measurement": {"id": "wide-sweep", "why": "to see"}}
    assert store.saved == ("next", {"id": "wide-sweep", "why": "to see"})


def test_an_instrument_that_rounds_too_much_is_refused(tmp_path: Path, bench: SimulatedBench) -> None:
    device = bench.devices["analyser"]
    healthy = device.respond
    device.respond = lambda query: b"+3.00000000000E+08" if query == b"STOP?" else healthy(query)
    with pytest.raises(InstrumentError, match=r"stop_hz was set to 30000000.0, but the instrument reports 300000000.0"):
        measured(tmp_path / "s", small("impedance_only"), bench)


def test_an_instrument_that_cannot_be_made_safe_is_told(tmp_path: Path, bench: SimulatedBench) -> None:
    device = bench.devices["receiver"]
    healthy = device.respond

    def deaf(query: bytes) -> Any:
        if query.startswith(b"ABOR"):
            raise ConnectionResetError("gone")
        return healthy(query)

    device.respond = deaf
    with pytest.raises(InstrumentError, match="receiver could not be brought into its safe state"):
        measured(tmp_path / "s", small(), bench)
    session = load(tmp_path / "s")
    assert len(session.sweeps) + len(session.spectra) == 10
    assert session.status == "failed"


@pytest.mark.slow
@pytest.mark.parametrize("name", ready_procedures())
def test_a_dry_run_says_what_the_run_does(tmp_path: Path, bench: SimulatedBench, name: str) -> None:
    steps = rehearse(small(name), BENCH_FILE)
    session = measured(tmp_path / "s", small(name), bench)
    sent = [str(r["text"]).strip() for r in session.traffic() if r["direction"] == "write"]
    # What is sent while the instruments are left safe belongs to no step.
    leaving = next(i for i, r in enumerate(session.traffic()) if r["direction"] == "leave")
    before = sum(r["direction"] == "write" for r in session.traffic()[:leaving])
    assert sum(step.messages for step in steps) == before
    listed = [message for step in steps for _, message, times in step.sent for _ in range(times)]
    assert listed == [text for text in sent[:before] if text not in ("", "OUTPERRO?", "SYST:ERR?")]
    assert [step.do for step in steps] == [d["do"] for d in session.documents if d["kind"] == "step-start"]
    # Switching the LISN from line to line is asked for, and is no connection.
    prompts = sum("LISN to line" not in prompt for step in steps for prompt in step.prompts)
    assert prompts == sum(d["kind"] == "connection" for d in session.documents)


@pytest.mark.slow
def test_a_dry_run_of_the_full_test_takes_as_long_as_its_parts() -> None:
    steps = rehearse(load_procedure("full_motor_test"), BenchFile())
    seconds = [step.seconds for step in steps if step.do == "spectrum"]
    # 6634 steps of 50 ms, and some messages.
    assert all(331.7 <= value < 335 for value in seconds)
    assert len(seconds) == 4


def test_a_dry_run_keeps_to_the_allow_list() -> None:
    with pytest.raises(BadInput, match="receiver: GPIB0::20::INSTR is not on the bench's allow-list"):
        rehearse(small(), BenchFile(allow=frozenset({"GPIB0::17::INSTR"})))


@pytest.mark.slow
def test_a_dry_run_on_the_command_line_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments in ([], ["--json"]):
        monkeypatch.setattr(sys, "argv", ["motoremi", "run", "emission_only", "--dry-run", *arguments])
        with pytest.raises(SystemExit) as caught:
            main()
        assert not caught.value.code
    text, _, document = capsys.readouterr().out.partition("{")
    assert "nothing is sent to real ones" in text
    assert "[2/8] spectrum detector peak condition motor off repeat 1: 5 min 3" in text
    assert json.loads("{" + document)["seconds"] > 1400
    assert list(tmp_path.iterdir()) == []


def test_progress_is_in_seconds_of_the_bench() -> None:
    shown: list[tuple[str, int, int]] = []
    bench = SimulatedBench(SEED)
    steps = rehearse(small("emission_only"), BENCH_FILE)
    progress = RunProgress(steps, bench.clock, lambda *state: shown.append(state))
    progress.document({"kind": "step-start", "step": 5, "do": "wait"})
    bench.clock.sleep(60)
    progress.tick()
    bench.clock.sleep(6000)
    progress.tick()
    before = int(sum(step.seconds for step in steps[:4]))
    assert [state[1] - before for state in shown] == [0, 60, 120]
    assert {state[2] for state in shown} == {int(sum(step.seconds for step in steps))}
    bench.close()


def test_every_key_has_help_and_the_page_is_up_to_date() -> None:
    for table in reference():
        assert table.help, table.title
        for key in table.keys:
            assert key.help, (table.title, key.name)
            assert key.takes
    assert (DOCS / "procedures.md").read_text(encoding="utf-8").endswith(markdown())


def test_the_ready_procedures_are_listed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, expected in (
        ([], "fixture_check"),
        (["fixture_check"], "step 4 (connect), round 1 of 2: what short-standard"),
        (["--keys"], "text with unit, 20 Hz to 3 GHz"),
    ):
        for more in ([], ["--json"]):
            monkeypatch.setattr(sys, "argv", ["motoremi", "procedures", *arguments, *more])
            with pytest.raises(SystemExit) as caught:
                main()
            assert not caught.value.code
            out = capsys.readouterr().out
            if more:
                assert json.loads(out)["schema"].startswith("motoremi.procedure")
            else:
                assert expected in out


class MixedUp(SimulatedBench):
    """The operator connects another standard than the one that is asked for; after a doubt the right one, or the other one again."""

    def __init__(self, seed: int, instead: dict[str, Any], corrected: bool) -> None:
        super().__init__(seed)
        self._instead, self._corrected, self._asked, self.told = instead, corrected, "", []

    def connect(self, what: Any) -> int:
        self._asked = what
        return super().connect(self._instead.get(what, what))

    def answer(self, text: str) -> Any:
        """The operator's answer to an instruction."""
        self.told.append(text)
        if "seems to be connected" in text and self._corrected:
            super().connect(self._asked)
        return "done"


COMPENSATE = [{"do": "compensate", "standard": "open"}, {"do": "compensate", "standard": "short"}]


@pytest.mark.parametrize("driver", ["4294a", "e4990a"])
def test_exchanged_standards_are_noticed_and_measured_again(driver: str, tmp_path: Path) -> None:
    bench = MixedUp(SEED, {"open-standard": "short-standard", "short-standard": "open-standard"}, corrected=True)
    data = copy.deepcopy(with_steps(*COMPENSATE, SHORT).source)
    data["instruments"]["analyser"]["driver"] = driver
    procedure = parse_procedure(data, "test.toml")
    writer = SessionWriter.create(tmp_path / "s", start_document(procedure, BENCH_FILE))
    run(procedure, bench, writer, analyse=lambda *_: None, prompt=bench.answer)
    bench.close()
    wrong = [text for text in bench.told if "seems to be connected" in text]
    assert [text.partition(" measured")[0] for text in wrong] == ["the open standard", "the short standard"]
    assert "an open is above 100 ohm, so a short or a load seems to be connected. Connect the open standard." in wrong[0]
    session = load(tmp_path / "s")
    assert not [one for one in session.documents if one["kind"] == "doubt"]
    assert len(session.sweeps) == 1


def test_a_standard_that_stays_wrong_is_a_doubt_in_the_session(tmp_path: Path) -> None:
    bench = MixedUp(SEED, {"short-standard": "open-standard"}, corrected=False)
    procedure = with_steps(*COMPENSATE)
    writer = SessionWriter.create(tmp_path / "s", start_document(procedure, BENCH_FILE))
    run(procedure, bench, writer, analyse=lambda *_: None, prompt=bench.answer)
    bench.close()
    (doubt,) = [one for one in load(tmp_path / "s").documents if one["kind"] == "doubt"]
    assert doubt["about"] == "standard"
    assert "a short is below 100 ohm, so nothing or a load seems to be connected" in doubt["says"]


def test_without_an_operator_a_wrong_standard_ends_the_run(tmp_path: Path, bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    connect = bench.connect
    monkeypatch.setattr(bench, "connect", lambda what: connect("short-standard" if what == "open-standard" else what))
    procedure = with_steps(*COMPENSATE, SHORT)
    writer = SessionWriter.create(tmp_path / "s", start_document(procedure, BENCH_FILE))
    with pytest.raises(InstrumentError, match=r"the open standard measured .* connect the open standard and continue with --resume"):
        run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    assert load(tmp_path / "s").sweeps == ()


F = np.geomspace(150e3, 30e6, 101)
JOMEGA = 2j * np.pi * F


@pytest.mark.parametrize(
    ("standard", "measured", "nominal", "right"),
    [
        ("open", 1 / (1e-4 + JOMEGA * 100e-12), None, True),
        ("short", 1 + JOMEGA * 1e-6, None, True),
        ("short", 1 / (1e-4 + JOMEGA * 100e-12), None, False),
        ("open", 1 + JOMEGA * 1e-6, None, False),
        ("load", 51 + JOMEGA * 1e-6, 50.0, True),
        ("load", 0.3 + JOMEGA * 0.1e-6, 50.0, False),
        ("load", 1 / (JOMEGA * 3e-12), 100.0, False),
        ("load", 1 / (1e-4 + JOMEGA * 100e-12), 1e5, True),
    ],
)
def test_only_what_no_fixture_makes_of_a_standard_is_another_one(standard: Any, measured: Any, nominal: float | None, right: bool) -> None:
    assert (wrong_standard(standard, ImpedanceSweep("open", F, measured), nominal) == "") is right


def test_far_above_the_band_open_and_short_are_not_told_apart() -> None:
    high_hz = F * 100
    assert wrong_standard("open", ImpedanceSweep("open", high_hz, 1 / (2j * np.pi * high_hz * 200e-12))) == ""
