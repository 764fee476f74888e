"""Prescan, then final measurement: maxima, lines, dwell, attenuation, and the verdict that rests on the final values."""

from __future__ import annotations

import copy
import shutil
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
import pytest

from motoremi.arrays import JsonDict
from motoremi.data.corrections import Corrections
from motoremi.data.session import Session, SessionWriter, load, reopen
from motoremi.data.spectrum import Spectrum
from motoremi.emission.finals import Rules, choose_maxima, final_values, judge_finals
from motoremi.emission.limit import find_limit
from motoremi.errors import BadInput, InstrumentError
from motoremi.export.hdf5 import hdf5_bytes
from motoremi.export.tables import to_xarray
from motoremi.run.rehearsal import rehearse
from motoremi.run.rerun import rerun
from motoremi.run.resume import Done
from motoremi.run.runner import Outcome, resumable, run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure, parse_procedure
from motoremi.virtual.simulated_bench import OTHER_LINE_DB, SimulatedBench
from motoremi.virtual.simulated_receiver import settling_db
from motoremi.workflow import opened, report_session
from motoremi.workflow_emission import predict_session
from motoremi.workflow_steps import analyse

LIMIT = find_limit("cispr32-b")
AXIS = 150e3 + 4.5e3 * np.arange(6634)
SEED = 3
PAD = {"name": "pad", "role": "receiver", "kind": "loss", "db": 10.0}


def with_peaks(peaks: dict[float, float], detector: str = "peak", **metadata: object) -> Spectrum:
    """30 dBuV with narrow maxima: frequency to level."""
    level = np.full(AXIS.size, 30.0)
    for frequency_hz, level_dbuv in peaks.items():
        level[np.argmin(np.abs(AXIS - frequency_hz))] = level_dbuv
    return Spectrum(detector, AXIS, level, metadata=metadata)


def narrow(name: str = "conducted_emission", **spectrum: str) -> Procedure:
    """A ready procedure over a small part of the span, without its report."""
    data = copy.deepcopy(load_procedure(name).source)
    data["spectrum"] |= {"start": "1 MHz", "stop": "2 MHz", **spectrum}
    data["steps"] = [step for step in data["steps"] if step["do"] != "report"]
    return parse_procedure(data, name)


def done(folder: Path, procedure: Procedure, bench_file: BenchFile | None = None, prompts: list[str] | None = None) -> tuple[Session, Outcome]:
    """A run on the simulated bench."""
    bench_file = bench_file or BenchFile(backend="sim", seed=SEED)
    told = prompts if prompts is not None else []
    writer = SessionWriter.create(folder, start_document(procedure, bench_file))
    outcome = run(procedure, SimulatedBench(bench_file.seed), writer, analyse=analyse(), prompt=told.append)
    return load(folder), outcome


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Session, list[str]]:
    prompts: list[str] = []
    return done(tmp_path_factory.mktemp("final") / "run", narrow(), prompts=prompts)[0], prompts


def test_maxima_are_chosen_by_margin_to_the_limit_not_by_level() -> None:
    """At 200 kHz 60 dBuV is 3.6 dB below the limit, at 10 MHz 58 dBuV is 2 dB below it."""
    prescan = with_peaks({200e3: 60.0, 10e6: 58.0, 20e6: 40.0})
    limit = find_limit("cispr32-b")
    quasi_peak_only = type(limit)(limit.name, limit.title, limit.lines[:1])
    chosen, more = choose_maxima([prescan], quasi_peak_only, Rules(maxima=1))
    assert [round(one.frequency_hz / 1e6, 2) for one in chosen] == [10.0]
    assert (chosen[0].margin_db, more) == (pytest.approx(2.0), 1)


def test_exports_contain_the_scans_of_the_final_measurement(whole: tuple[Session, list[str]], tmp_path: Path) -> None:
    session, _ = whole
    assert session.finals
    (tmp_path / "s.h5").write_bytes(hdf5_bytes(session, None))
    arrays = to_xarray(session)
    with h5py.File(tmp_path / "s.h5") as file:
        assert len(file["finals"]) == len(session.finals)
        for number, final in enumerate(session.finals, start=1):
            group = file[f"finals/{number}"]
            np.testing.assert_array_equal(group["reading_dbuv"], final.level_dbuv)
            assert group.attrs["detector"] == final.detector
            added_db = session.corrections.added_db("receiver", final.frequency_hz)
            np.testing.assert_array_equal(group["level_dbuv"], final.level_dbuv + added_db)
            np.testing.assert_array_equal(arrays[f"final_{number}_dbuv"], group["level_dbuv"])


def test_background_is_no_prescan_and_a_prescan_is_needed() -> None:
    background = with_peaks({1e6: 90.0}, condition="motor off")
    assert [one.frequency_hz for one in choose_maxima([background, with_peaks({5e6: 70.0})], LIMIT, Rules())[0]] == [pytest.approx(5e6, abs=2.3e3)]
    with pytest.raises(BadInput, match="no prescan"):
        choose_maxima([background], LIMIT, Rules())


def test_two_maxima_are_apart_and_every_subrange_gives_one_first() -> None:
    peaks = {1e6: 80.0, 1.02e6: 79.0, 1.2e6: 78.0, 1.4e6: 77.0, 15e6: 61.0}
    chosen, _ = choose_maxima([with_peaks(peaks)], LIMIT, Rules(maxima=3, apart_hz=100e3, subranges=4))
    near = [round(one.frequency_hz / 1e6, 1) for one in chosen]
    # The second of the strong subrange comes after the first of the weak one.
    assert near == [1.0, 1.2, 15.0]


def test_of_maxima_with_the_same_margin_the_lowest_in_frequency_is_taken() -> None:
    chosen, more = choose_maxima([with_peaks({20e6: 60.0, 7e6: 60.0})], LIMIT, Rules(maxima=1))
    assert [round(one.frequency_hz / 1e6, 1) for one in chosen] == [7.0]
    assert more == 1


def test_the_highest_of_both_lines_counts_and_corrections_are_shown() -> None:
    small = np.array([0.9955e6, 0.99775e6, 1e6, 1.00225e6, 1.0045e6])
    finals = [
        Spectrum("quasi-peak", small, 50.0 + np.array([0, 1, offset, 1, 0]), metadata={"maximum_hz": 1e6, "line": line, "dwell_s": 1.0})
        for line, offset in (("L1", 3.0), ("N", 4.0))
    ]
    chain = Corrections.of([PAD], "test")
    (value,) = final_values(finals, chain, LIMIT)
    assert (value.line, value.reading_dbuv, value.correction_db, value.level_dbuv) == ("N", 54.0, 10.0, 64.0)
    assert value.margin_db == pytest.approx(-8.0)
    (judged,) = judge_finals([value], LIMIT, 3.4)
    assert judged.verdict == "fail"


def test_an_overloaded_final_value_below_the_limit_passes_nothing() -> None:
    small = np.array([1e6, 1.00225e6])
    finals = [Spectrum("quasi-peak", small, [30.0, 31.0], overload=[True, True], metadata={"maximum_hz": 1e6})]
    (judged,) = judge_finals(final_values(finals, Corrections(), LIMIT), LIMIT, 3.4)
    assert judged.verdict is None


def test_the_cispr_average_is_held_against_the_average_limit() -> None:
    small = np.array([1e6, 1.00225e6])
    (value,) = final_values([Spectrum("cispr-average", small, [50.0, 31.0], metadata={"maximum_hz": 1e6})], Corrections(), LIMIT)
    assert value.limit_dbuv == 46.0


@pytest.mark.slow
def test_a_full_test_reads_every_maximum_on_both_lines_and_judges_the_finals(whole: tuple[Session, list[str]]) -> None:
    session, prompts = whole
    chosen = next(d for d in session.documents if d["kind"] == "maxima")["maxima"]
    assert len(session.finals) == 2 * 2 * len(chosen) > 0
    assert {f.metadata["line"] for f in session.finals} == {"L1", "N"}
    assert {f.detector for f in session.finals} == {"quasi-peak", "cispr-average"}
    assert all(f.metadata["dwell_s"] == 1.0 and f.metadata["settings"]["dwell_s"] == 1.0 for f in session.finals)
    assert [p for p in prompts if "line" in p] == [f"Switch the LISN to line {line}" for line in ("L1", "N", "L1", "N")]
    prediction = session.analysis("prediction")
    assert prediction is not None
    assert prediction["judged_what"] == "final"
    # The stand's other line reads less.
    assert OTHER_LINE_DB < 0
    assert {value["line"] for value in prediction["finals"]} == {"L1"}
    assert {value["dwell_s"] for value in prediction["finals"]} == {1.0}


@pytest.mark.slow
def test_the_report_shows_readings_corrections_and_final_values(whole: tuple[Session, list[str]], tmp_path: Path) -> None:
    shutil.copytree(whole[0].path, tmp_path / "s")
    with opened(tmp_path / "s") as store:
        predict_session(store, limit="cispr32-b", corrections=Corrections.of([PAD], "test"), with_model=False)
        report_session(store)
    text = (tmp_path / "s" / "report" / "report.html").read_text(encoding="utf-8")
    value = load(tmp_path / "s").analysis("prediction")["finals"][0]  # type: ignore[index]
    assert value["level_dbuv"] == pytest.approx(value["reading_dbuv"] + 10.0)
    for shown in ("Final values", "Corrections of the receiver", "+10.0 dB", f"{value['reading_dbuv']:.1f} dBµV", f">{value['level_dbuv']:.1f}<"):
        assert shown in text


@pytest.mark.slow
def test_a_run_replays_bit_for_bit(whole: tuple[Session, list[str]], tmp_path: Path) -> None:
    again = rerun(whole[0], tmp_path / "again", analyse)
    assert again.same
    assert again.compared == len(whole[0].spectra) + len(whole[0].finals)


@pytest.mark.slow
@pytest.mark.parametrize("stored", [0, 1, 5])
def test_a_stopped_final_measurement_goes_on_where_it_stopped(whole: tuple[Session, list[str]], tmp_path: Path, stored: int) -> None:
    procedure, bench_file = narrow(), BenchFile(backend="sim", seed=SEED)
    writer = SessionWriter.create(tmp_path / "run", start_document(procedure, bench_file))
    left = [stored]

    def stop(document: JsonDict) -> None:
        if document["kind"] == "final" or (not stored and document["kind"] == "maxima"):
            left[0] -= 1
            if left[0] <= 0:
                raise KeyboardInterrupt

    writer.subscribe(stop)
    with pytest.raises(KeyboardInterrupt):
        run(procedure, SimulatedBench(SEED), writer, analyse=analyse(), prompt=lambda text: None)
    steps, before = resumable(load(tmp_path / "run"), bench_file)
    assert isinstance(before, Done)
    assert before.stored == stored
    run(steps, SimulatedBench(SEED), reopen(tmp_path / "run"), analyse=analyse(), prompt=lambda text: None, done=before)
    now = load(tmp_path / "run")
    assert [(f.detector, f.metadata["line"], f.level_dbuv.tolist()) for f in now.finals] == [
        (f.detector, f.metadata["line"], f.level_dbuv.tolist()) for f in whole[0].finals
    ]
    assert now.analysis("prediction")["finals"] == whole[0].analysis("prediction")["finals"]  # type: ignore[index]
    assert rerun(now, tmp_path / "again", analyse).same


def own_limit(folder: Path, level_dbuv: float) -> Path:
    path = folder / "own.toml"
    lines = "".join(
        f'[[line]]\ndetector = "{detector}"\nsegments = [[150e3, 30e6, {level_dbuv}, {level_dbuv}]]\n' for detector in ("quasi-peak", "average")
    )
    path.write_text(f'title = "own"\n{lines}')
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("corrections", "verdict"), [([], "pass"), ([PAD], "fail")])
def test_a_motor_over_the_limit_behind_a_pad_fails_in_a_run(
    whole: tuple[Session, list[str]], tmp_path: Path, corrections: Sequence[JsonDict], verdict: str
) -> None:
    """5 dB below the limit at the receiver, 5 dB above it at the LISN."""
    highest = max(float(f.level_dbuv.max()) for f in whole[0].finals)
    data = copy.deepcopy(narrow().source)
    for step in data["steps"]:
        if step["do"] in ("final", "judge"):
            step["limit"] = str(own_limit(tmp_path, highest + 5.0))
    bench_file = BenchFile.model_validate({"backend": "sim", "seed": SEED, "correction": corrections})
    session, outcome = done(tmp_path / "run", parse_procedure(data, "test"), bench_file)
    assert outcome.verdicts[-1]["verdict"] == verdict
    assert outcome.passed == (verdict == "pass")
    # The readings are stored as they came.
    assert [f.level_dbuv.tolist() for f in session.spectra] == [f.level_dbuv.tolist() for f in whole[0].spectra]


@pytest.mark.slow
def test_no_maximum_near_the_limit_leaves_nothing_to_read_and_the_prescan_is_judged(tmp_path: Path) -> None:
    data = copy.deepcopy(narrow().source)
    for step in data["steps"]:
        if step["do"] in ("final", "judge"):
            step["limit"] = str(own_limit(tmp_path, 150.0))
    session, outcome = done(tmp_path / "run", parse_procedure(data, "test"))
    assert not session.finals
    assert outcome.verdicts[-1]["verdict"] == "pass"


@pytest.mark.slow
def test_a_short_dwell_reads_low_on_meters_and_is_told_before_the_run(tmp_path: Path) -> None:
    data = copy.deepcopy(narrow().source)
    data["steps"] = [
        {"do": "identify"},
        *({"do": "spectrum", "detector": "quasi-peak", "dwell": dwell} for dwell in ("50 ms", "2 s")),
        *({"do": "spectrum", "detector": "peak", "dwell": dwell} for dwell in ("50 ms", "2 s")),
    ]
    procedure = parse_procedure(data, "test")
    assert [remark for remark in procedure.remarks() if "measures too low" in remark] == [
        "step 2: quasi-peak with a dwell of 50 ms measures too low: its meter needs 1 s at each point"
    ]
    spectra = done(tmp_path / "run", procedure)[0].spectra
    short, long, *peaks = (s.level_dbuv for s in spectra)
    # Two equal poles of 160 ms after 50 ms: 1 - (1 + x) exp(-x) with x = 50/160 is -28 dB.
    assert short - long == pytest.approx(np.full(short.size, settling_db("quasi-peak", 0.05)), abs=0.01)
    assert settling_db("quasi-peak", 0.05) == pytest.approx(-28.0, abs=0.1)
    assert np.array_equal(*peaks)


def test_a_coarse_step_is_told_before_the_run() -> None:
    assert any("coarser than half the bandwidth" in remark for remark in narrow(step="9 kHz").remarks())
    assert narrow().remarks() == ()


@pytest.mark.parametrize(("bandwidth", "says"), [("200 Hz", "reads too low: compliance cannot be shown"), ("120 kHz", "reads too high")])
def test_a_bandwidth_of_another_band_is_told_before_the_run(bandwidth: str, says: str) -> None:
    told = [remark for remark in narrow(bandwidth=bandwidth, step="100 Hz").remarks() if "bandwidth" in remark]
    assert told == [f"[spectrum]: a bandwidth of {bandwidth} {says}; band B (150 kHz - 30 MHz) has 9 kHz"]


def test_a_quasi_peak_scan_over_all_points_takes_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    # Only the time counts here, not what arrives.
    monkeypatch.setattr(SimulatedBench, "level_dbuv", lambda self, frequency_hz, detector: np.full(frequency_hz.shape, 20.0))
    data = copy.deepcopy(load_procedure("conducted_emission").source)
    data["steps"] = [{"do": "identify"}, {"do": "spectrum", "detector": "quasi-peak", "dwell": "1 s"}]
    steps = rehearse(parse_procedure(data, "test"), BenchFile(backend="sim"))
    # 6634 points at 1 s each are 1.84 h; what else is sent takes seconds.
    assert sum(step.seconds for step in steps) / 3600 == pytest.approx(1.84, abs=0.01)


@pytest.mark.slow
def test_an_overloaded_part_is_measured_again_with_more_attenuation(tmp_path: Path) -> None:
    """The simulated mixer compresses at 97 dBuV plus attenuation; the preamplifier is off, so the motor is made louder by its stand."""

    class Loud(SimulatedBench):
        def level_dbuv(self, frequency_hz: np.ndarray, detector: str) -> np.ndarray:
            return super().level_dbuv(frequency_hz, detector) + 30.0

    data = copy.deepcopy(narrow(attenuation="0 dB").source)
    data["steps"] = [{"do": "identify"}, {"do": "spectrum", "detector": "peak"}]
    levels = {}
    for choice in ("attenuate", "mark"):
        data["spectrum"]["overload"] = choice
        procedure = parse_procedure(data, "test")
        writer = SessionWriter.create(tmp_path / choice, start_document(procedure, BenchFile(backend="sim", seed=SEED)))
        run(procedure, Loud(SEED), writer, analyse=analyse(), prompt=lambda text: None)
        levels[choice] = load(tmp_path / choice).spectra[0]
    assert levels["mark"].overload.all()
    assert not levels["attenuate"].overload.any()
    raised = levels["attenuate"].metadata["attenuation_raised"]
    assert [part["attenuation_db"] for part in raised] == [10.0 * (n + 1) for n in range(len(raised))]
    assert levels["attenuate"].level_dbuv.max() > levels["mark"].level_dbuv.max() + 1


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"steps": [{"do": "identify"}, {"do": "final"}]}, "needs a step 'spectrum'"),
        ({"steps": [{"do": "identify"}, {"do": "spectrum", "detector": "peak", "condition": "motor off"}, {"do": "final"}]}, "needs a step"),
        ({"steps": [{"do": "identify"}, {"do": "spectrum", "detector": "peak"}, {"do": "final", "limit": "cispr99"}]}, "unknown limit"),
        ({"steps": [{"do": "identify"}, {"do": "spectrum", "detector": "peak"}, {"do": "final", "dwell": "0.2 s"}]}, "outside the range"),
        ({"instruments": {"receiver": {"driver": "tinysa", "resource": "x"}}}, "no average detector"),
    ],
)  # fmt: skip
def test_a_procedure_that_cannot_be_is_one_line(change: JsonDict, says: str) -> None:
    data = copy.deepcopy(narrow().source) | change
    if data["instruments"]["receiver"]["driver"] == "tinysa":
        data["spectrum"] |= {"bandwidth": "10 kHz"}
    with pytest.raises(BadInput, match=says) as told:
        parse_procedure(data, "test")
    assert "\n" not in str(told.value)


@pytest.mark.slow
def test_the_line_is_switched_by_command_where_the_receiver_controls_the_lisn(tmp_path: Path) -> None:
    prompts: list[str] = []
    session, _ = done(tmp_path / "run", narrow(line_switch="receiver"), prompts=prompts)
    assert not [p for p in prompts if "line" in p]
    sent = [str(r.get("text", "")).strip() for r in session.traffic() if r["direction"] == "write"]
    assert [s for s in sent if s.startswith("INP:LISN:PHAS ")] == [f"INP:LISN:PHAS {line}" for line in ("L1", "N", "L1", "N")]
    one, other = (s.level_dbuv for s in session.spectra if s.detector == "peak" and not s.is_background)
    assert other - one == pytest.approx(np.full(one.size, OTHER_LINE_DB), abs=2e-3)


@pytest.mark.slow
def test_a_line_switch_that_does_not_follow_ends_the_run_and_keeps_what_was_measured(tmp_path: Path) -> None:
    class Stuck(SimulatedBench):
        def place(self, role: str, name: str) -> None:
            super().place(role, name)
            if role == "receiver":
                device = self.devices[role]
                device.write(b"INP:LISN:PHAS L2\n")
                device.known_commands[device.fold("INP:LISN:PHAS")] = lambda argument: None

    procedure = narrow(line_switch="receiver")
    data = copy.deepcopy(procedure.source)
    del data["steps"][1]["line"]
    procedure = parse_procedure(data, "test")
    writer = SessionWriter.create(tmp_path / "run", start_document(procedure, BenchFile(backend="sim", seed=SEED)))
    with pytest.raises(InstrumentError, match="switched to L1, but reports"):
        run(procedure, Stuck(SEED), writer, analyse=analyse(), prompt=lambda text: None)
    assert len(load(tmp_path / "run").spectra) == 1
