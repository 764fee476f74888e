"""Dates of calibration: a doubtful one is told before the first sweep, and a procedure can forbid it."""

from __future__ import annotations

import copy
import json
import sys
from datetime import date, timedelta
from pathlib import Path

import pytest
from fault_matrix import SEED, small

from motoremi.cli import main
from motoremi.data.session import load
from motoremi.errors import BadInput
from motoremi.run.calibration_check import calibration_doubts, refuse_unless_calibrated
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure, parse_procedure

TODAY = date(2026, 3, 4)
OLD, FRESH, FUTURE = (TODAY - timedelta(days=age) for age in (2882, 20, -11))
OLD_SAYS, FUTURE_SAYS = "the calibration of the analyser is 2882 days old", "the calibration of the analyser lies 11 days in the future"


@pytest.fixture(autouse=True)
def _the_day_of_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every run starts on one day: a suite that runs past midnight computes the same ages."""
    day = type("Day", (date,), {"today": staticmethod(lambda: TODAY)})
    for module in ("calibration_check", "runner"):
        monkeypatch.setattr(f"motoremi.run.{module}.date", day)


def procedure_with(within: str | None) -> Procedure:
    source = copy.deepcopy(small("impedance_only").source)
    source["steps"] = [{"do": "identify"}, {"do": "sweep", "termination": "short"}]
    return parse_procedure(source if within is None else source | {"calibration_within": within}, "x")


def written(folder: Path, within: str | None, calibrated: date | None, backend: str = "sim") -> list[str]:
    """Files of a procedure and of a bench, and the command that runs them."""
    key = "" if within is None else f'calibration_within = "{within}"\n'
    (folder / "procedure.toml").write_text(
        f'title = "one sweep"\n{key}[instruments]\nanalyser = {{ driver = "4294a", resource = "GPIB0::17::INSTR" }}\n'
        '[sweep]\nstart = "150 kHz"\nstop = "30 MHz"\npoints = 11\n[[steps]]\ndo = "identify"\n[[steps]]\ndo = "sweep"\ntermination = "short"\n',
        encoding="utf-8",
    )
    dates = "" if calibrated is None else f"[calibrated]\nanalyser = {calibrated}\n"
    (folder / "bench.toml").write_text(f'backend = "{backend}"\nseed = {SEED}\n{dates}', encoding="utf-8")
    return ["motoremi", "run", str(folder / "procedure.toml"), "--bench", str(folder / "bench.toml"), "--out", str(folder / "s")]


def test_what_is_doubtful() -> None:
    def doubts(within: str | None, calibrated: date | None, backend: str = "") -> list[str]:
        dates = {} if calibrated is None else {"analyser": calibrated}
        return list(calibration_doubts(procedure_with(within), BenchFile(backend=backend, calibrated=dates)))

    assert doubts(None, OLD) == [OLD_SAYS]
    assert doubts(None, FUTURE) == doubts("30 d", FUTURE) == [FUTURE_SAYS]
    assert doubts(None, FRESH) == doubts("20 d", FRESH) == doubts("3000 d", OLD) == doubts(None, None) == []
    assert doubts("19 d", FRESH) == ["the calibration of the analyser is 20 days old"]
    assert doubts("365 d", None) == ["the bench file does not say when the analyser was calibrated"]
    # Nobody calibrates a simulated instrument.
    assert doubts("365 d", None, "sim") == []


def test_an_instrument_that_the_procedure_does_not_use_may_be_as_old_as_it_is() -> None:
    refuse_unless_calibrated(procedure_with("365 d"), BenchFile(calibrated={"analyser": FRESH, "receiver": OLD}))


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize(("calibrated", "says"), [(OLD, OLD_SAYS), (FUTURE, FUTURE_SAYS)])
def test_it_is_told_before_the_first_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], calibrated: date, says: str, as_json: bool
) -> None:
    monkeypatch.setattr(sys, "argv", [*written(tmp_path, None, calibrated), *(["--json"] if as_json else [])])
    with pytest.raises(SystemExit) as caught:
        main()
    told = capsys.readouterr()
    assert caught.value.code == 0
    assert told.err == f"motoremi: {says}\n"
    if as_json:
        json.loads(told.out)
    kinds = [document["kind"] for document in load(tmp_path / "s").documents]
    assert kinds.index("doubt") < kinds.index("instrument")


@pytest.mark.parametrize("arguments", [[], ["--dry-run"]])
@pytest.mark.parametrize(
    ("calibrated", "says"), [(OLD, OLD_SAYS), (FUTURE, FUTURE_SAYS), (None, "the bench file does not say when the analyser was calibrated")]
)
def test_a_procedure_forbids_it_before_anything_is_connected(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    calibrated: date | None,
    says: str,
    arguments: list[str],
) -> None:
    command = written(tmp_path, "365 d", calibrated, backend="@py")
    monkeypatch.setattr(sys, "argv", [*(command[:-2] if arguments else command), *arguments])
    monkeypatch.setattr("motoremi.run.runner.make_bench", lambda _: pytest.fail("something was connected"))
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert capsys.readouterr().err == (
        f"motoremi: {says}; the procedure asks for a calibration within 365 d: use a calibrated instrument, "
        "or correct the date under [calibrated] in the bench file\n"
    )
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize("within", ["12 h", "0.5 d", "20000 d", "a year"])
def test_an_interval_that_is_none_is_refused(within: str) -> None:
    with pytest.raises(BadInput, match="x: calibration_within: "):
        procedure_with(within)


def test_ready_procedures_ask_for_nothing() -> None:
    assert load_procedure("full_motor_test").calibration_within is None
