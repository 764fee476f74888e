"""The loop of an investigation on the simulated bench: requested, measured, stopped, continued, replayed. Its assessment is scripted here."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fault_matrix import SEED, measured, small

from motoremi.arrays import JsonDict
from motoremi.cli import main
from motoremi.cli.investigate import typed_value
from motoremi.data.conditions import SingleValue, parse_condition, parse_value
from motoremi.data.session import Session, SessionWriter, load, reopen, verify
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.quantities import parse_minutes
from motoremi.report.conditions_section import asked_table
from motoremi.run.answer import Answer, NotDone
from motoremi.run.hidden_bench import SEALED, keep_bench, kept_bench
from motoremi.run.requested import MeasurementRequest, RequestedMeasurements, procedure_for, requested_value
from motoremi.run.rerun import rerun
from motoremi.run.resume import Done
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.workflow_ask import chosen
from motoremi.workflow_investigate import Assess, Assessment, Investigation, investigate, request_of, taught_bits
from motoremi.workflow_on_bench import OperatedBench

WARM: JsonDict = {
    "id": "second-temperature", "minutes": 25.0, "why": "insulation answers",
    "asks": {"kind": "sweep", "termination": "both", "condition": "temperature", "value": 53.0, "unit": "degC", "instruction": "warm the motor"},
}  # fmt: skip
COPPER: JsonDict = {
    "id": "dc-resistance", "minutes": 3.0, "why": "copper",
    "asks": {"kind": "value", "termination": None, "condition": "dc-resistance", "value": None, "unit": "Ohm", "instruction": "use four wires"},
}  # fmt: skip
SHORTED: JsonDict = {
    "id": "fixture-short", "minutes": 2.0, "why": "the fixture",
    "asks": {"kind": "standard", "termination": "short", "condition": "fixture-short", "value": None, "unit": None, "instruction": "short it"},
}  # fmt: skip
REPEATS: JsonDict = {
    "id": "repeats", "minutes": 2.0, "why": "noise",
    "asks": {"kind": "sweep", "termination": "both", "condition": None, "value": None, "unit": None, "instruction": "measure once more"},
}  # fmt: skip
MENU = (WARM, COPPER, SHORTED)
# The probabilities of the scripted assessment before any measurement.
AT_FIRST = {"eddy-laminations": 0.5, "skin-effect": 0.5}


def plain() -> Procedure:
    """Compensation and one sweep each."""
    source = dict(small("impedance_only").source)
    steps = [dict(step) for step in source["steps"] if step["do"] in ("identify", "compensate", "sweep")]
    for step in steps:
        step.pop("repeat", None)
    return parse_procedure({**source, "steps": steps}, "plain")


def scripted(store: SessionWriter, menu: Sequence[JsonDict] = MENU) -> Assess:
    """Asks for what the session lacks of a menu; one explanation stands when it has all."""

    def assess() -> Assessment:
        session = load(store.path)
        have = {str(sweep.condition and sweep.condition.id) for sweep in session.conditioned} | {value.name for value in session.values}
        have |= {"repeats"} if len(session.sweeps) > 2 else set()
        share = (1 + len(have)) / (2 + len(have))

        def ask(without: Collection[str]) -> JsonDict:
            told = {"stop": None}
            left = [one for one in menu if one["id"] not in {*have, *without}]
            if left:
                return {**told, **left[0]}
            return {**told, "id": None, "asks": None, "minutes": 0.0, "stop": "one-stands" if len(have) >= len(menu) else "inseparable"}

        return Assessment({"eddy-laminations": share, "skin-effect": 1 - share}, 1.0, ask, lambda: {"verdict": "missing-effect"})

    return assess


class Hands:
    """The simulated bench, with an operator who says what is in `answers`, then nothing."""

    def __init__(self, bench: SimulatedBench, session: Session, writer: SessionWriter, answers: Sequence[Answer | None] = ()) -> None:
        self.bench = bench
        self.told: list[str] = []
        self.answers = list(answers)
        connections = Done.of(session.documents).connections
        procedure = procedure_for(session)
        writer.emit("investigate", procedure=procedure.source, connections=connections, budget_minutes=60.0, odds=20.0, without=[])
        self.asking = RequestedMeasurements(procedure, bench, writer, self.prompt, self.set_up, connections=connections)

    def prompt(self, text: str) -> Answer | None:
        self.told.append(text.partition("\n")[0])
        return self.answers.pop(0) if self.answers else None

    def set_up(self, request: MeasurementRequest | None) -> None:
        self.bench.arrange(*((None, ()) if request is None else (request.condition, request.terminations, request.turn)))

    def sweep(self, request: MeasurementRequest) -> None:
        self.asking.measure(request)

    def value(self, request: MeasurementRequest) -> SingleValue:
        return self.bench.single_value(request.id, request.turn)

    def minutes(self, estimated: float) -> float:
        return estimated


def begun(folder: Path) -> None:
    bench = SimulatedBench(SEED)
    measured(folder, plain(), bench)
    bench.close()


def gone_through(
    folder: Path,
    *,
    menu: Sequence[JsonDict] = MENU,
    answers: Sequence[Answer | None] = (),
    minutes: float = 120.0,
    stop_at: Callable[[JsonDict], bool] | None = None,
    kill: bool = False,
) -> tuple[Investigation | None, Hands]:
    """One run of the loop; None if it was stopped by Ctrl-C, or killed: then nothing more is written, and no instrument is left safely."""
    bench = SimulatedBench(SEED)
    writer = reopen(folder)

    def stop(document: JsonDict) -> None:
        if stop_at is not None and stop_at(document):
            raise KeyboardInterrupt

    writer.subscribe(stop)
    hands = Hands(bench, load(folder), writer, answers)
    found = None
    with suppress(KeyboardInterrupt):
        found = investigate(writer, scripted(writer, menu), hands, minutes)
    if kill:
        # What the end of a process does.
        writer.log.close()
        if writer.traffic_log is not None:
            writer.traffic_log.close()
    else:
        hands.asking.leave_safe()
        writer.close("done" if found is not None else "interrupted")
    bench.close()
    return found, hands


def at(session: Session, name: str) -> list[ImpedanceSweep]:
    return [sweep for sweep in session.conditioned if sweep.condition is not None and sweep.condition.id == name]


def test_everything_that_was_asked_is_in_the_session_and_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    found, hands = gone_through(tmp_path / "s")
    assert found is not None
    assert (found.stop, [step.id for step in found.steps], found.minutes) == (
        "one-stands",
        ["second-temperature", "dc-resistance", "fixture-short"],
        30.0,
    )
    session = load(tmp_path / "s")
    assert verify(tmp_path / "s") == []
    assert session.analysis("investigation") == found.to_dict()
    assert found.to_dict()["schema"] == "motoremi.investigation/1"
    assert [step.brought.partition("=")[0] for step in found.steps] == [step.id for step in found.steps]
    assert found.steps[0].brought == "second-temperature=53degC"
    assert asked_table(session.analysis("investigation"))[0].rows[0] == ("second-temperature", "insulation answers", "second-temperature=53degC")
    assert [sweep.termination for sweep in at(session, "second-temperature")] == ["short", "open"]
    cold, warm = session.sweeps[0], at(session, "second-temperature")[0]
    # Ra is 12 % more at 30 K above ambient; the lowest frequencies of the short sweep hold it and the reactance.
    assert warm.impedance_ohm.real[0] > 1.05 * cold.impedance_ohm.real[0]
    assert np.abs(at(session, "fixture-short")[0].impedance_ohm).max() < 1
    assert [value.name for value in session.values] == ["dc-resistance"]
    # One identification and one compensation serve all sweeps, and the operator is told in plain words.
    assert hands.told[:4] == [
        "warm the motor (stored as second-temperature=53degC)",
        "Leave the fixture open (open standard), with nothing within 10 cm",
        "Connect the short standard to the fixture",
        "Connect the analyser between the two terminals of the motor, the far one joined to the frame",
    ]
    assert len([document for document in session.documents if document["kind"] == "compensation"]) in (2, 4)
    again = rerun(session, tmp_path / "again", lambda: lambda *_: None)
    assert again.same
    assert again.compared == 5
    assert [value.to_dict() for value in load(tmp_path / "again").values] == [value.to_dict() for value in session.values]


@pytest.mark.parametrize("kill", [False, True])
def test_a_stopped_or_killed_investigation_goes_on_where_it_was_and_is_replayed_as_well(kill: bool, tmp_path: Path) -> None:
    begun(tmp_path / "s")
    found, _ = gone_through(tmp_path / "s", stop_at=lambda document: document.get("file") == "sweeps/short-second-temperature-1.csv", kill=kill)
    assert found is None
    assert load(tmp_path / "s").interrupted == kill
    stored = (tmp_path / "s/sweeps/short-second-temperature-1.csv").read_bytes()
    found, hands = gone_through(tmp_path / "s")
    assert found is not None
    assert [step.id for step in found.steps] == ["second-temperature", "dc-resistance", "fixture-short"]
    assert found.steps[0].taught_bits == taught_bits(AT_FIRST, found.steps[0].probabilities) > 0.05
    session = load(tmp_path / "s")
    assert [sweep.termination for sweep in at(session, "second-temperature")] == ["short", "open"]
    assert (tmp_path / "s/sweeps/short-second-temperature-1.csv").read_bytes() == stored
    # The operator is asked again, because nobody knows whether the motor is still warm.
    assert hands.told[0] == "warm the motor (stored as second-temperature=53degC)"
    assert len({sweep.metadata["connection"] for sweep in session.conditioned}) == 3
    assert verify(tmp_path / "s") == []
    assert rerun(session, tmp_path / "again", lambda: lambda *_: None).same
    # Once more: nothing is left to ask, nothing is measured.
    once_more, hands = gone_through(tmp_path / "s")
    assert once_more is not None
    assert once_more.to_dict() == found.to_dict()
    assert hands.told == []


def test_stopped_after_the_last_sweep_nothing_is_measured_twice(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    gone_through(tmp_path / "s", menu=(WARM,), stop_at=lambda document: document.get("file") == "sweeps/open-second-temperature-1.csv")
    found, hands = gone_through(tmp_path / "s", menu=(WARM,))
    assert found is not None
    assert [step.id for step in found.steps] == ["second-temperature"]
    # What it taught is told beside what was known when it was requested.
    assert found.steps[0].taught_bits == taught_bits(AT_FIRST, found.steps[0].probabilities) > 0.05
    assert hands.told == []


def test_an_operator_who_says_no_gets_the_next_best(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    found, _ = gone_through(tmp_path / "s", answers=["not done"])
    assert found is not None
    assert (found.refused, [step.id for step in found.steps], found.stop) == (
        ("second-temperature",), ["dc-resistance", "fixture-short"], "inseparable",
    )  # fmt: skip
    assert at(load(tmp_path / "s"), "second-temperature") == []
    # It stays refused.
    again, hands = gone_through(tmp_path / "s")
    assert again is not None
    assert again.refused == ("second-temperature",)
    assert hands.told == []


def test_what_takes_longer_than_the_time_that_is_left_is_not_asked(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    found, _ = gone_through(tmp_path / "s", minutes=10.0)
    assert found is not None
    assert (found.stop, [step.id for step in found.steps]) == ("budget", ["dc-resistance", "fixture-short"])


def test_more_of_the_motor_as_it_is_are_repeats(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    earlier = {"asked": "dc-resistance", "why": "copper", "brought": "dc-resistance=1Ohm"}
    with reopen(tmp_path / "s") as writer:
        writer.save_analysis("ladder", {"steps": [{"fit": {}}]})
        writer.save_analysis("investigation", {"schema": "motoremi.asked/1", "steps": [earlier]})
    found, _ = gone_through(tmp_path / "s", menu=(REPEATS,))
    assert found is not None
    session = load(tmp_path / "s")
    assert [sweep.termination for sweep in session.sweeps] == ["short", "open", "short", "open"]
    assert session.conditioned == ()
    # The ladder's models were fitted to fewer sweeps; what was brought by files before stays told.
    assert session.ladder == []
    stored = session.analysis("investigation")
    assert stored is not None
    assert [step["asked"] for step in stored["steps"]] == ["dc-resistance", "repeats"]


def test_sweeps_that_were_imported_between_two_runs_answer_no_other_request(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    found, _ = gone_through(tmp_path / "s", stop_at=lambda document: document["kind"] == "asked")
    assert found is None
    stored = load(tmp_path / "s").sweeps
    with reopen(tmp_path / "s") as writer:
        for termination in ("short", "open"):
            sweep = next(one for one in stored if one.termination == termination)
            writer.add_sweep(sweep.under(parse_condition("known-capacitor=100pF")))
    found, hands = gone_through(tmp_path / "s")
    assert found is not None
    assert hands.told[0] == "warm the motor (stored as second-temperature=53degC)"
    assert [sweep.termination for sweep in at(load(tmp_path / "s"), "second-temperature")] == ["short", "open"]


def test_what_an_earlier_run_measured_keeps_its_estimated_minutes() -> None:
    """The clock of a real bench counts from what this run measures; from nothing it would count from the start of the computer."""
    request = MeasurementRequest("dc-resistance", "measure it", terminations=())
    read = SimpleNamespace(value=lambda request: parse_value("dc-resistance=1ohm+-1mohm"))
    bench = OperatedBench(SimpleNamespace(), read)  # type: ignore[arg-type]
    assert bench.minutes(7.0) == 7.0
    bench.value(request)
    assert bench.minutes(7.0) < 1.0


def test_a_laboratory_s_own_measurement_is_requested_as_the_one_that_it_stands_for() -> None:
    """Its instruction and minutes are its own; what is set up, and what is counted and refused, is the menu's measurement."""
    warm = {"id": "second-temperature", "condition_id": "second-temperature", "minutes": 25.0, "information_bits": 0.4, "separates": []}
    asks = {"kind": "sweep", "termination": "both", "condition": "temperature", "value": 53.0, "unit": "degC", "instruction": "warm the motor"}
    value = {**asks, "kind": "value", "termination": None, "condition": "dc-resistance", "value": None, "unit": "Ohm", "instruction": "four wires"}
    meter = {**warm, "id": "dc-resistance", "condition_id": None, "asks": value, "minutes": 3.0, "information_bits": 0.05}
    question = {"schema": "motoremi.next/2", **warm, "asks": asks, "why": "", "alternatives": [meter], "probabilities": {}, "stop": None}
    own = [
        {"id": "chamber", "like": "second-temperature", "minutes": 5, "instruction": "set the chamber", "hands": False},
        {"id": "bench-meter", "like": "dc-resistance", "minutes": 1, "instruction": "read the meter"},
    ]
    asked = chosen(question, (), own)
    assert (asked["id"], asked["minutes"]) == ("chamber", 5.0)
    request = request_of(asked)
    assert (request.id, str(request.condition), request.instruction) == ("second-temperature", "second-temperature=53degC", "set the chamber")
    assert (request.hands, MeasurementRequest.restored(request.to_dict())) == (False, request)
    read = request_of(chosen(question, ("second-temperature", "chamber"), own))
    assert (read.id, read.is_value, read.instruction) == ("dc-resistance", True, "read the meter")


def test_an_empty_menu_ends_at_once(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    with reopen(tmp_path / "s") as writer:
        empty: Assess = lambda: Assessment({}, 1.0, lambda without: {"id": None, "stop": None}, dict)  # noqa: E731
        assert investigate(writer, empty, bench=None, budget_minutes=60).stop == "nothing-left"  # type: ignore[arg-type]


def test_a_wide_sweep_is_as_wide_as_the_analyser_and_compensated_anew(tmp_path: Path) -> None:
    begun(tmp_path / "s")
    wide: JsonDict = {
        "id": "wide-sweep",
        "minutes": 4.0,
        "asks": {"kind": "sweep", "termination": "both", "value": None, "instruction": "sweep wide"},
    }
    found, hands = gone_through(tmp_path / "s", menu=(wide,))
    assert found is not None
    assert at(load(tmp_path / "s"), "wide-sweep")[0].span_hz == pytest.approx((400.0, 60e6))
    assert "Leave the fixture open" in hands.told[1]


@pytest.mark.parametrize("question", [WARM, COPPER, SHORTED, REPEATS])
def test_an_order_comes_back_from_its_record(question: JsonDict) -> None:
    request = request_of(question, 2)
    assert MeasurementRequest.restored(request.to_dict()) == request


def test_a_damaged_order_is_refused() -> None:
    with pytest.raises(BadInput, match="recorded question cannot be read"):
        MeasurementRequest.restored({"id": "x", "condition": None})


def test_an_answer_to_another_question_is_refused() -> None:
    with pytest.raises(BadInput, match="insulation-resistance was not asked for: give dc-resistance"):
        requested_value(request_of(COPPER), parse_value("insulation-resistance=2Gohm"))


@pytest.mark.parametrize(("text", "minutes"), [("30min", 30), ("2h", 120), ("90 s", 1.5), ("0.5h", 30)])
def test_times_are_read(text: str, minutes: float) -> None:
    assert parse_minutes(text) == pytest.approx(minutes)


@pytest.mark.parametrize("text", ["30", "soon", "-3min", "3 days", ""])
def test_what_is_no_time_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="write for example 30min"):
        parse_minutes(text)


def test_what_a_step_taught_is_how_far_it_moved_belief() -> None:
    assert taught_bits({"a": 0.5, "b": 0.5}, {"a": 1.0}) == pytest.approx(1.0)
    assert taught_bits({"a": 0.5, "b": 0.5}, {"a": 0.5, "b": 0.5}) == 0
    assert taught_bits({"a": 1.0}, {"b": 1.0}) > 20


def test_the_simulated_bench_of_a_session_is_kept_and_cannot_be_read_by_accident(tmp_path: Path) -> None:
    with SessionWriter.create(tmp_path / "s", {"simulated": True}) as writer:
        keep_bench(writer, 7, ["eddy-laminations"])
    session = load(tmp_path / "s")
    kept = kept_bench(session)
    assert kept is not None
    assert (kept.backend, kept.seed, kept.effects) == ("sim", 7, ("eddy-laminations",))
    assert b"eddy" not in (tmp_path / "s" / SEALED).read_bytes()
    assert "eddy" not in (tmp_path / "s" / "session.jsonl").read_text()
    (tmp_path / "s" / SEALED).write_bytes(b"!!")
    with pytest.raises(BadInput, match="cannot be read; give the bench file"):
        kept_bench(session)
    begun(tmp_path / "other")
    assert kept_bench(load(tmp_path / "other")) is None


def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """`motoremi investigate` with a scripted `Assess`."""
    monkeypatch.setattr("motoremi.workflow_on_bench.Assessor", lambda store, odds, progress, own: scripted(store))
    monkeypatch.setattr(sys, "argv", ["motoremi", "investigate", *arguments])
    with pytest.raises(SystemExit) as left:
        main()
    told = capsys.readouterr()
    return int(left.value.code or 0), told.out, told.err


def test_the_command_investigates_the_simulated_bench_of_the_session(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, bench = tmp_path / "s", SimulatedBench(SEED)
    measured(folder, plain(), bench)
    bench.close()
    with reopen(folder) as writer:
        keep_bench(writer, SEED, [])
    status, out, err = command(monkeypatch, capsys, str(folder), "--bench", "sim", "--budget", "1h", "--json")
    assert (status, err) == (0, "")
    told = json.loads(out)
    assert told["schema"] == "motoremi.investigation/1"
    assert [step["id"] for step in told["steps"]] == ["second-temperature", "dc-resistance", "fixture-short"]
    assert (told["minutes"], told["stop"]) == (30.0, "one-stands")
    assert set(told["steps"][0]["probabilities"]) == {"eddy-laminations", "skin-effect"}
    assert "diagnosis" in told


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--bench", "sim", "--budget", "soon"), "cannot read 'soon' as a time"),
        (("--bench", "sim", "--odds", "1"), "odds of 1 do not favour any"),
        (("--bench", "sim"), "was not measured on this simulated bench"),
        ((), "Missing option '--bench'"),
    ],
)
def test_bad_input_is_one_line(
    arguments: tuple[str, ...], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    begun(tmp_path / "s")
    before = load(tmp_path / "s").documents
    status, out, err = command(monkeypatch, capsys, str(tmp_path / "s"), *arguments)
    assert (status, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1
    assert load(tmp_path / "s").documents == before


def test_an_interrupted_measurement_is_finished_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyboardInterrupt), SessionWriter.create(tmp_path / "s", {"simulated": True}):
        raise KeyboardInterrupt
    status, _, err = command(monkeypatch, capsys, str(tmp_path / "s"), "--bench", "sim")
    assert status == 2
    assert "finish it first: motoremi run --resume" in err


def test_a_value_is_asked_for_until_it_is_one_and_may_be_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    request = request_of(COPPER)
    monkeypatch.setattr(sys, "stdin", io.StringIO("cold\n21.3\ninsulation-resistance=2Gohm\n21.3 mOhm\n"))
    assert typed_value(request) == parse_value("dc-resistance=21.3mOhm")
    told = capsys.readouterr().err
    assert "use four wires" in told
    assert "insulation-resistance was not asked for" in told
    monkeypatch.setattr(sys, "stdin", io.StringIO("n\n"))
    with pytest.raises(NotDone):
        typed_value(request)
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    with pytest.raises(BadInput, match="run from a terminal"):
        typed_value(request)


@pytest.mark.slow
def test_the_demo_asks_for_one_measurement_and_one_of_two_explanations_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The only test here with a real assessment."""
    monkeypatch.setattr(sys, "argv", ["motoremi", "demo", "--investigate", "--json", "--out", str(tmp_path / "s")])
    with pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    told = json.loads(capsys.readouterr().out)
    assert (told["stop"], [step["id"] for step in told["steps"]]) == ("one-stands", ["shaft-turned"])
    assert told["diagnosis"]["effects"] == told["hidden"] == ["bearing-film"]
    assert told["steps"][0]["probabilities"]["bearing-film"] > 0.99
    session = load(tmp_path / "s")
    assert session.analysis("diagnosis") == told["diagnosis"]
    asked = next(document for document in session.documents if document["kind"] == "asked")
    assert asked["minutes"] == told["minutes"]
    # What the motor hides is in the sealed file alone; what is said of it before the diagnosis is not the truth but what stands.
    before = [document for document in session.documents if document["seq"] < asked["seq"]]
    assert "bearing-film" not in json.dumps(before)
