"""Procedures and bench files: what they mean, and the one line that tells what is wrong."""

from __future__ import annotations

import copy
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from places import ROOT

from motoremi.cli.session_commands import compare_
from motoremi.errors import BadInput
from motoremi.inspection.compare import PAPER_TOLERANCE
from motoremi.quantities import parse
from motoremi.schema.bench_file import BenchFile, load_bench_file
from motoremi.schema.keys import reference
from motoremi.schema.procedure import Compensate, Identify, Scan, Sweep, load_procedure, parse_procedure
from motoremi.schema.procedure_steps import CompareStep

GOOD: dict[str, Any] = {
    "title": "Test",
    "instruments": {
        "analyser": {"driver": "4294a", "resource": "GPIB0::17::INSTR"},
        "receiver": {"driver": "esr", "resource": "GPIB0::20::INSTR"},
    },
    "sweep": {"start": "150 kHz", "stop": "30 MHz", "points": 401},
    "spectrum": {"start": "150 kHz", "stop": "30 MHz", "step": "4.5 kHz"},
    "steps": [
        {"do": "identify"},
        {"do": "sweep", "termination": "short", "repeat": 3},
        {"do": "spectrum", "detector": "peak"},
        {"do": "compare", "error_percent": 2.0},
    ],
}


def changed(*keys: str | int, value: object) -> dict[str, Any]:
    """The good procedure with one thing different."""
    data = copy.deepcopy(GOOD)
    place: Any = data
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    return data


def without(*keys: str | int) -> dict[str, Any]:
    data = copy.deepcopy(GOOD)
    place: Any = data
    for key in keys[:-1]:
        place = place[key]
    del place[keys[-1]]
    return data


@pytest.mark.parametrize("name", ["full_motor_test", "impedance_only"])
def test_the_procedures_that_come_along(name: str) -> None:
    procedure = load_procedure(name)
    assert procedure.sweep is not None
    assert (procedure.sweep.start, procedure.sweep.stop, procedure.sweep.points) == (150e3, 30e6, 401)
    assert (procedure.sweep.oscillator, procedure.sweep.bandwidth, procedure.sweep.spacing) == (0.5, 3, "log")
    assert isinstance(procedure.steps[0], Identify)
    assert [step.standard for step in procedure.steps if isinstance(step, Compensate)] == ["open", "short"]
    assert [(s.termination, s.repeat) for s in procedure.steps if isinstance(s, Sweep)] == [("short", 3), ("open", 3)]
    assert [step.do for step in procedure.steps[-4:]] == ["fit", "compare", "diagnose", "report"]
    assert bool([step for step in procedure.steps if isinstance(step, Scan)]) == (name == "full_motor_test")


def test_a_procedure_is_kept_as_written() -> None:
    procedure = parse_procedure(GOOD, "test.toml")
    assert procedure.source == GOOD
    assert parse_procedure(procedure.source, "again") == procedure


def test_a_path_comes_before_a_name(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('title = "Mine"\ninstruments = {}\nsteps = [{ do = "fit" }]\n', encoding="utf-8")
    assert load_procedure(path).title == "Mine"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (changed("steps", 1, "repeats", value=3), "test.toml: step 2 (sweep): repeats: unknown key"),
        (changed("tile", value="x"), "test.toml: tile: unknown key"),
        (changed("sweep", "start", value="150 kOhm"), "test.toml: sweep.start: '150 kOhm' has the unit 'Ohm', expected Hz"),
        (
            changed("sweep", "stop", value="200 MHz"),
            "test.toml: sweep.stop: 200 MHz is outside the range 40 Hz to 110 MHz of the 4294a",
        ),
        (changed("sweep", "start", value=150000), "test.toml: sweep.start: write it as text with its unit"),
        (changed("sweep", "start", value="150"), "test.toml: sweep.start: '150' has no unit: write it with its unit, for example '20 Hz'"),
        (changed("sweep", "start", value="150k"), "test.toml: sweep.start: '150k' has no unit"),
        (changed("spectrum", "dwell", value="50"), "test.toml: spectrum.dwell: '50' has no unit"),
        (changed("sweep", "start", value="40 MHz"), "test.toml: sweep: stop must be above start"),
        (changed("sweep", "points", value=802), "test.toml: sweep.points: 802 is outside the range 2 to 801 of the 4294a"),
        (changed("sweep", "points", value=7), "test.toml: sweep.points: Input should be greater than or equal to 8"),
        (changed("sweep", "oscillator", value="2 V"), "test.toml: sweep.oscillator: '2 V' is outside the range 5 mV to 1 V"),
        (changed("spectrum", "dwell", value="0 s"), "test.toml: spectrum.dwell: '0 s' is outside the range"),
        (changed("steps", 1, "termination", value="shot"), "test.toml: step 2 (sweep): termination: Input should be 'short' or"),
        (changed("steps", 2, "detector", value="pk"), "test.toml: step 3 (spectrum): detector: Input should be 'peak'"),
        (changed("steps", 1, "do", value="swep"), "test.toml: step 2 (swep): Input tag 'swep' found using 'do'"),
        (changed("steps", 1, value="sweep"), "test.toml: step 2 (?): "),
        (changed("steps", 1, value={"detector": "peak"}), "test.toml: step 2 (?): the key 'do' is missing: it says what the step does"),
        (changed("steps", value="sweep"), "test.toml: steps: must be a list, in brackets"),
        (changed("steps", value=[]), "test.toml: steps: Tuple should have at least 1 item"),
        (changed("steps", 3, "error_percent", value=-1), "test.toml: step 4 (compare): error_percent: Input should be greater"),
        (without("steps", 0), "test.toml: the first step must be 'identify'"),
        (without("sweep"), "test.toml: the steps need the table [sweep]"),
        (without("instruments", "receiver"), "test.toml: the steps need instruments.receiver"),
        (
            changed("instruments", "analyser", "driver", value="4924a"),
            "test.toml: instruments.analyser.driver: unknown instrument driver '4924a': known are 34461a, 4294a, ",
        ),
        (changed("instruments", "scope", value={}), "test.toml: instruments.scope"),
    ],
)
def test_mistakes_are_one_line_with_file_step_and_key(data: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput) as caught:
        parse_procedure(data, "test.toml")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_all_mistakes_are_told_at_once() -> None:
    data = changed("sweep", "start", value="loud")
    data["steps"][1]["repeat"] = 0
    with pytest.raises(BadInput, match=r"sweep.start: cannot read 'loud'.*; step 2 \(sweep\): repeat"):
        parse_procedure(data, "test.toml")


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"title = ", "is not TOML: "), (b"\xff\xfea", "is damaged UTF-16 text; save it again as UTF-8"), (None, "no such file")],
)
def test_files_that_are_none(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "broken.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInput, match=message) as caught:
        load_procedure(path)
    assert "broken.toml" in str(caught.value)


def test_a_ready_procedure_beside_a_folder_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "impedance_only").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_procedure("impedance_only").source["title"]
    with pytest.raises(BadInput, match=r"there is no procedure 'full_motor': use conducted_emission, .*, or the path of your own .toml file"):
        load_procedure("full_motor")


def test_a_bench_file(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(
        'operator = "Liu"\nallow = ["GPIB0::9::INSTR"]\n[resources]\nanalyser = "GPIB0::9::INSTR"\n[calibrated]\nanalyser = 2026-03-01\n',
        encoding="utf-8",
    )
    bench = load_bench_file(path)
    assert bench.resources == {"analyser": "GPIB0::9::INSTR"}
    assert bench.calibrated == {"analyser": date(2026, 3, 1)}
    assert (bench.operator, bench.allow, bench.backend) == ("Liu", frozenset({"GPIB0::9::INSTR"}), "")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_files_of_an_editor_that_marks_the_encoding(tmp_path: Path, encoding: str) -> None:
    bench, procedure = tmp_path / "bench.toml", tmp_path / "mine.toml"
    bench.write_text('operator = "Liu"\n', encoding=encoding)
    assert load_bench_file(bench).operator == "Liu"
    procedure.write_text('title = "Mine"\ninstruments = {}\nsteps = [{ do = "fit" }]\n', encoding=encoding)
    assert load_procedure(procedure).title == "Mine"


def test_the_simulated_bench_needs_no_file() -> None:
    assert load_bench_file("sim") == BenchFile(backend="sim")


def test_mistakes_in_a_bench_file(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text('alow = ["x"]\n', encoding="utf-8")
    with pytest.raises(BadInput, match=r"bench.toml: alow: unknown key$"):
        load_bench_file(path)


PAD = '[[correction]]\nname = "pad"\nkind = "loss"\n'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (PAD + "db = 1000", "pad: db: 1000 dB is out of range (-200 to 200 dB)"),
        (PAD + "db = nan", "pad: db: nan dB is out of range (-200 to 200 dB)"),
        (PAD + "db = [1, 1000]\nfrequency_hz = [1e5, 3e7]", "pad: db.1: 1000 dB is out of range (-200 to 200 dB)"),
        (PAD, 'pad: give db = 10.0, or file = "table.csv"'),
        (PAD + "db = 1\ncolour = 2", "pad: colour: unknown key"),
        (PAD.replace("[[", "[").replace("]]", "]") + "db = 1", "correction: write [[correction]], with two brackets"),
        ('allow = "x"', "allow: must be a list, in brackets"),
        (
            '[resources]\nanalyzer = "x"',
            "resources.analyzer: not known; write analyser, receiver, supply, voltmeter, ammeter, tachometer or thermometer",
        ),
    ],
)
def test_mistakes_in_a_bench_file_are_told_in_its_own_words(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        load_bench_file(path)
    assert str(caught.value) == f"{path}: {message}"


@pytest.mark.parametrize("text", ["nan kHz", "inf kHz", "-inf Hz", "nan", "NaN MHz"])
def test_a_quantity_that_is_no_number_is_told_as_that(text: str) -> None:
    with pytest.raises(BadInput, match=f"'{text}' is not a finite number"):
        parse(text, "Hz")


def test_the_tolerance_of_a_comparison_without_tolerances_is_the_documented_one() -> None:
    usual = f"{PAPER_TOLERANCE.error_percent:g} %"
    documented = [CompareStep.__doc__, compare_.__doc__, (ROOT / "docs" / "procedures.md").read_text(encoding="utf-8")]
    assert all(text is not None and f"at first {usual}" in text.replace("that is an error of ", "") for text in documented)


def test_the_reference_of_keys_says_what_each_key_takes() -> None:
    takes = {(table.title, key.name): key.takes for table in reference() for key in table.keys}
    assert takes['do = "wait-for"', "target"] == "text"
    assert takes['do = "spectrum"', "line"] == "L1, L2, L3, N, +, -"
    assert takes["[instruments] by role", "lines"] == "table"
    assert takes["[instruments.ROLE.lines]", "pattern"] == "text"
    assert takes["bench file", "allow"] == "list"
    assert takes["bench file or corrections.toml: [[correction]]", "calibrated"] == "date"
    assert takes['do = "check"', "tolerance_percent"] == "number, above 0 to 100"
    assert next(key.default for table in reference() for key in table.keys if key.name == "detectors") == "quasi-peak, cispr-average"
