"""Adapters, averaging, bias, load standard and list sweeps of the 4294A and the E4990A, as a procedure asks for them."""

from __future__ import annotations

import copy
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fault_matrix import BENCH_FILE

from motoremi.bench.bridge import BridgeAnalyser
from motoremi.bench.sweep_options import Bias, Segment, SweepOptions
from motoremi.data.analyser import find_analyser, specification
from motoremi.data.files import read_impedance
from motoremi.data.measurement import Measurement
from motoremi.data.session import Session, SessionWriter, load, verify
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.rehearsal import rehearse
from motoremi.run.rerun import rerun
from motoremi.run.runner import run, start_document
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.virtual.simulated_bench import STANDARDS_OHM, SimulatedBench

BRIDGES = ("4294a", "e4990a")
SWEEP: dict[str, Any] = {"start": "150 kHz", "stop": "30 MHz", "points": 11}
OPEN_SWEEP = {"do": "sweep", "termination": "open"}


def procedure(driver: str, sweep: dict[str, Any], *steps: dict[str, Any]) -> Procedure:
    """One analyser, that sweep, those steps."""
    instruments = {"analyser": {"driver": driver, "resource": "GPIB0::17::INSTR"}}
    data = {"title": "t", "instruments": instruments, "sweep": sweep, "steps": [{"do": "identify"}, *steps]}
    return parse_procedure(copy.deepcopy(data), "p")


def measured(folder: Path, bench: SimulatedBench, asked: Procedure) -> Session:
    """Run it and load what was stored; `InstrumentError` passes."""
    writer = SessionWriter.create(folder, start_document(asked, BENCH_FILE))
    run(asked, bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    assert verify(folder) == []
    return load(folder)


def driver(bench: SimulatedBench, name: str) -> BridgeAnalyser:
    opened = bench.open("analyser", name, "", lambda record: None)
    assert isinstance(opened, BridgeAnalyser)
    opened.reset()
    opened.configure(150e3, 30e6, 11)
    return opened


@pytest.mark.parametrize("name", BRIDGES)
def test_the_adapter_is_set_read_back_and_recorded(tmp_path: Path, bench: SimulatedBench, name: str) -> None:
    session = measured(tmp_path / "s", bench, procedure(name, SWEEP | {"adapter": "42941A", "fixture": "leads"}, OPEN_SWEEP))
    (sweep,) = session.sweeps
    assert bench.devices["analyser"].value("adapter") == {"4294a": "PROBE", "e4990a": "E4PR"}[name]
    assert sweep.metadata["settings"]["adapter"] == sweep.metadata["adapter"] == "42941A"
    assert sweep.metadata["fixture"] == "leads"
    assert sweep.metadata["analyser"] == f"{name}+42941a+leads"
    assert Measurement.of(session.sweeps).analyser.name == f"{name}+42941a+leads"


def test_an_adapter_that_somebody_changes_stops_the_run(tmp_path: Path, bench: SimulatedBench) -> None:
    writer = SessionWriter.create(tmp_path / "s", start_document(procedure("4294a", SWEEP, OPEN_SWEEP), BENCH_FILE))

    def meddle(_: str) -> None:
        bench.devices["analyser"].set_value("adapter", "M1")

    with pytest.raises(InstrumentError, match="adapter is '1m', was 'none'"):
        run(procedure("4294a", SWEEP, OPEN_SWEEP), bench, writer, analyse=lambda *_: None, prompt=meddle)


def test_adapter_and_fixture_decide_the_specification() -> None:
    frequency_hz, impedance_ohm = np.geomspace(150e3, 30e6, 20), np.full(20, 100 + 0j)
    plain = find_analyser("4294a")
    assert specification("4294a", "none", "none") == "4294a"
    assert specification("e4990a", "1m", "16047E") == "e4990a+1m+16047e"
    for name, more_gain, residuals in (("4294a+1m", True, 1), ("4294a+2m", True, 1), ("4294A+42941A+leads", True, 10), ("4294a+16047e", False, 1)):
        found = find_analyser(name)
        assert found.name == name.lower()
        assert bool(np.all(found.gain_sigma(frequency_hz) > plain.gain_sigma(frequency_hz))) is more_gain
        assert found.inductance_sigma_h == pytest.approx(residuals * plain.inductance_sigma_h)
        larger = found.uncertainty(frequency_hz, impedance_ohm) - plain.uncertainty(frequency_hz, impedance_ohm)
        assert np.all(larger >= 0)
    with pytest.raises(BadInput, match="'3m' is not an adapter or fixture of it; use 4294a\\+ADAPTER\\+FIXTURE"):
        find_analyser("4294a+3m")
    with pytest.raises(BadInput, match="use nanovna alone"):
        find_analyser("nanovna+1m")


def test_the_adapter_of_a_saved_file_decides_too(tmp_path: Path) -> None:
    axis = np.geomspace(150e3, 30e6, 9)
    for told, name in (("NONE", "4294a"), ("4TP 1M", "4294a+1m"), ("PROBE 42941A", "4294a+42941a")):
        rows = "\n".join(f"{f:.11e}\t1.0\t0.0" for f in axis)
        traces = "".join(f'"TRACE: {letter}"\n"Frequency"\t"Data Trace Real"\t"Data Trace Imag"\n{rows}\n' for letter in "AB")
        header = f'4294A REV1.11\n"MEASURE PARAMETER: R X"\n"ADAPTER: {told}"\n"NUMBER of POINTS: 9"\n'
        path = tmp_path / "saved.txt"
        path.write_text(header + traces, encoding="ascii")
        assert read_impedance(path, "short").metadata["analyser"] == name


@pytest.mark.slow
@pytest.mark.parametrize("name", BRIDGES)
@pytest.mark.parametrize("averages", [{"sweep_averages": 4}, {"point_averages": 4}])
def test_averaging_is_set_takes_longer_and_quietens(bench: SimulatedBench, name: str, averages: dict[str, int]) -> None:
    analyser = driver(bench, name)
    bench.connect("open")

    def scatter(options: SweepOptions) -> tuple[float, float]:
        settings = analyser.prepare(options)
        assert settings is not None
        assert settings["sweep_averaging"] is (options.sweep_averages > 1)
        assert settings["point_averaging"] is (options.point_averages > 1)
        began = bench.clock.now()
        sweeps = np.array([analyser.sweep("open").impedance_ohm for _ in range(40)])
        return bench.clock.now() - began, float(np.mean(np.std(sweeps, axis=0) / np.abs(np.mean(sweeps, axis=0))))

    plain_s, plain = scatter(SweepOptions())
    averaged_s, averaged = scatter(SweepOptions(**averages))
    assert averaged_s > plain_s
    # Standard deviations of 40 sweeps at 11 points, in two parts: known to some 4 %.
    assert averaged == pytest.approx(plain / 2, rel=0.15)


@pytest.mark.parametrize("name", BRIDGES)
def test_a_load_standard_takes_the_gain_error_out(bench: SimulatedBench, name: str) -> None:
    analyser = driver(bench, name)
    analyser.configure(150e3, 30e6, 11, bandwidth_factor=5)
    bench.connect("open-standard")
    analyser.compensate("open")
    bench.connect("short-standard")
    analyser.compensate("short")

    def error() -> float:
        bench.connect("load-standard")
        return float(np.max(np.abs(analyser.sweep("open").impedance_ohm / STANDARDS_OHM["load-standard"] - 1)))

    before = error()
    analyser.define_load(STANDARDS_OHM["load-standard"], 0.0)
    bench.connect("load-standard")
    analyser.compensate("load")
    # What is left are the residuals of the next connection, some mOhm and nH at 100 Ohm and 30 MHz.
    assert error() < before / 2


@pytest.mark.parametrize("name", BRIDGES)
def test_a_load_standard_and_its_value_are_recorded(tmp_path: Path, bench: SimulatedBench, name: str) -> None:
    ohm = STANDARDS_OHM["load-standard"]
    standards = [{"do": "compensate", "standard": "open"}, {"do": "compensate", "standard": "short"}]
    load_step = {"do": "compensate", "standard": "load", "nominal": f"{ohm:g} Ohm", "inductance": "1 nH"}
    session = measured(tmp_path / "s", bench, procedure(name, SWEEP | {"bandwidth": 5}, *standards, load_step, OPEN_SWEEP))
    (sweep,) = session.sweeps
    assert sweep.metadata["compensated"] == ["load", "open", "short"]
    assert sweep.metadata["load_standard"] == {"ohm": ohm, "henry": 1e-9}
    kept = [document for document in session.documents if document["kind"] == "compensation"]
    assert [document["standard"] for document in kept] == ["open", "short", "load"]
    assert all((session.path / document["file"]).is_file() for document in kept)
    assert rerun(session, tmp_path / "again", lambda: lambda *_: None).same


@pytest.mark.parametrize("name", BRIDGES)
def test_what_the_instrument_holds_of_a_standard_is_archived(tmp_path: Path, bench: SimulatedBench, name: str) -> None:
    steps = [{"do": "compensate", "standard": standard} for standard in ("open", "short")]
    session = measured(tmp_path / "s", bench, procedure(name, SWEEP, *steps))
    short = np.loadtxt(
        session.path / "compensation" / "short-1.csv", delimiter=",", skiprows=_header(session.path / "compensation" / "short-1.csv")
    )
    omega = 2 * np.pi * short[:, 0]
    np.testing.assert_allclose(short[:, 1], 0.03, rtol=1e-6)
    np.testing.assert_allclose(short[:, 2], 15e-9 * omega, rtol=1e-6)
    open_ = np.loadtxt(session.path / "compensation" / "open-1.csv", delimiter=",", skiprows=_header(session.path / "compensation" / "open-1.csv"))
    # The fixture's 4 pF; its 15 nH in series are in resonance far above.
    np.testing.assert_allclose((1 / (open_[:, 1] + 1j * open_[:, 2])).imag / omega, 4e-12, rtol=1e-2)


def _header(path: Path) -> int:
    """Lines before the numbers."""
    return next(number for number, line in enumerate(path.read_text(encoding="utf-8").splitlines()) if line[:1].isdigit())


def test_a_bias_is_on_only_during_the_sweep(tmp_path: Path, bench: SimulatedBench) -> None:
    asked = procedure("4294a", SWEEP | {"bias": "5 V", "bias_limit": "10 mA", "bias_ramp": "2 s"}, {**OPEN_SWEEP, "repeat": 2})
    session = measured(tmp_path / "s", bench, asked)
    for sweep in session.sweeps:
        assert sweep.metadata["bias"] == {"volt": 5.0, "limit_a": 0.01, "ramp_s": 2.0}
    sent = [str(record["text"]).strip() for record in session.traffic() if record["direction"] == "write"]
    first = sent[sent.index("DCO ON") : sent.index("DCO OFF") + 1]
    levels = [float(text.split()[1]) for text in first if text.startswith("DCV ")]
    assert "DCRNG M10" in sent
    assert levels == pytest.approx([*np.linspace(0.25, 5, 20), *np.linspace(4.75, 0, 20)])
    assert first.index("SING") > first.index("DCV 5 V")
    assert first[-1] == "DCO OFF"
    assert bench.devices["analyser"].value("bias") == "0"
    assert rerun(session, tmp_path / "again", lambda: lambda *_: None).same


def test_a_bias_beyond_its_limit_is_told_and_off(tmp_path: Path, bench: SimulatedBench) -> None:
    asked = procedure("4294a", SWEEP | {"bias": "5 V", "bias_limit": "100 mA"}, {"do": "sweep", "termination": "short"})
    with pytest.raises(InstrumentError, match=r"a bias of 5 V could not be raised within 100 mA .*137"):
        measured(tmp_path / "s", bench, asked)
    assert bench.devices["analyser"].value("bias") == "0"
    assert load(tmp_path / "s").status == "failed"


def test_the_e4990a_measures_its_bias(tmp_path: Path, bench: SimulatedBench) -> None:
    asked = procedure("e4990a", SWEEP | {"bias": "2 V", "bias_ramp": "0 s"}, OPEN_SWEEP)
    (sweep,) = measured(tmp_path / "s", bench, asked).sweeps
    assert sweep.metadata["bias"]["measured_volt"] == 2.0
    assert abs(sweep.metadata["bias"]["measured_ampere"]) < 1e-3
    short = procedure("e4990a", SWEEP | {"bias": "2 V", "bias_ramp": "0 s"}, {"do": "sweep", "termination": "short"})
    with pytest.raises(InstrumentError, match="more than its limit of 1 mA"):
        measured(tmp_path / "t", bench, short)
    assert bench.devices["analyser"].value("bias") == "0"


@pytest.mark.parametrize("name", BRIDGES)
def test_the_safe_state_has_no_bias(bench: SimulatedBench, name: str) -> None:
    analyser = driver(bench, name)
    analyser.prepare(SweepOptions(bias=Bias(1.0)))
    bench.connect("open")
    with suppress(KeyboardInterrupt), analyser.stimulus():
        assert bench.devices["analyser"].value("bias") == "1"
        raise KeyboardInterrupt
    assert bench.devices["analyser"].value("bias") == "0"
    analyser.bias_on = True
    analyser.safe()
    assert bench.devices["analyser"].value("bias") == "0"


def test_a_standard_gets_no_bias(tmp_path: Path, bench: SimulatedBench) -> None:
    session = measured(tmp_path / "s", bench, procedure("4294a", SWEEP | {"bias": "5 V"}, {"do": "check", "standard": "short"}))
    assert not any("DCO ON" in str(record.get("text")) for record in session.traffic())


@pytest.mark.parametrize("name", BRIDGES)
def test_a_list_is_swept_compensated_and_judged_by_its_own_points(tmp_path: Path, bench: SimulatedBench, name: str) -> None:
    segments = [{"start": "150 kHz", "stop": "1 MHz", "points": 6}, {"start": "2 MHz", "stop": "30 MHz", "points": 5}]
    steps = [{"do": "compensate", "standard": standard} for standard in ("open", "short")]
    session = measured(tmp_path / "s", bench, procedure(name, {"spacing": "list", "segments": segments}, *steps, OPEN_SWEEP))
    (sweep,) = session.sweeps
    np.testing.assert_allclose(sweep.frequency_hz, [*np.linspace(150e3, 1e6, 6), *np.linspace(2e6, 30e6, 5)])
    assert sweep.metadata["settings"]["spacing"] == "list"
    assert sweep.metadata["settings"]["points"] == 11
    truth = bench.motor.impedance("open", sweep.frequency_hz)
    assert np.median(np.abs(sweep.impedance_ohm / truth - 1)) < 5e-3


def test_a_list_that_the_instrument_does_not_sweep_is_an_error(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    analyser = driver(bench, "4294a")
    monkeypatch.setattr(analyser, "read_axis", lambda: np.linspace(1e6, 2e6, 10))
    with pytest.raises(InstrumentError, match="sweeps 10 points, which are not the 4 points of the list"):
        analyser.prepare(SweepOptions(segments=(Segment(1e6, 2e6, 2), Segment(3e6, 4e6, 2))))


SEGMENT = {"start": "1 MHz", "stop": "2 MHz", "points": 9}


@pytest.mark.parametrize(
    ("driver_name", "sweep", "step", "message"),
    [
        ("4294a", SWEEP | {"adapter": "3m"}, OPEN_SWEEP, "sweep.adapter: Input should be 'none', '1m'"),
        ("4294a", SWEEP | {"bias": "50 V"}, OPEN_SWEEP, "sweep.bias: '50 V' is outside the range -40 V to 40 V"),
        ("4294a", SWEEP | {"bias_limit": "1 A"}, OPEN_SWEEP, "sweep.bias_limit: '1 A' is outside"),
        ("4294a", SWEEP | {"point_averages": 300}, OPEN_SWEEP, "sweep.point_averages: 300 is outside the range 1 to 256 of the 4294a"),
        ("nanovna", SWEEP | {"adapter": "1m", "bias": "1 V"}, OPEN_SWEEP, "sweep: the nanovna: has no adapter, bias; leave it out"),
        ("nanovna", SWEEP, {"do": "compensate", "standard": "load", "nominal": "50 Ohm"}, "the nanovna compensates no load"),
        ("4294a", SWEEP, {"do": "compensate", "standard": "load"}, "nominal: belongs to the load standard"),
        ("4294a", SWEEP, {"do": "compensate", "standard": "open", "nominal": "50 Ohm"}, "nominal: belongs to the load standard"),
        ("4294a", SWEEP | {"spacing": "list"}, OPEN_SWEEP, 'segments: belong to spacing = "list"'),
        ("4294a", SWEEP | {"segments": [SEGMENT]}, OPEN_SWEEP, "segments: leave out start, stop and points of the sweep"),
        ("4294a", {"segments": [SEGMENT]}, OPEN_SWEEP, 'segments: belong to spacing = "list"'),
        ("4294a", {"spacing": "list", "segments": [SEGMENT, SEGMENT]}, OPEN_SWEEP, "segments: each must start above the stop of the one before"),
        ("4294a", {"spacing": "list", "segments": [{**SEGMENT, "stop": "9 V"}]}, OPEN_SWEEP, "'9 V' has the unit 'V', expected Hz"),
        ("4294a", {"spacing": "list", "segments": [7]}, OPEN_SWEEP, "sweep.segments"),
        ("4294a", {"spacing": "list", "segments": [{"start": "1 MHz"}]}, OPEN_SWEEP, "sweep.segments"),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_connected(driver_name: str, sweep: dict[str, Any], step: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInput) as caught:
        procedure(driver_name, sweep, step)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_dry_run_knows_the_options() -> None:
    asked = procedure("e4990a", SWEEP | {"sweep_averages": 8, "bias": "1 V"}, OPEN_SWEEP)
    plain = rehearse(procedure("e4990a", SWEEP, OPEN_SWEEP), BENCH_FILE)
    longer = rehearse(asked, BENCH_FILE)
    assert longer[1].seconds > plain[1].seconds + 2
    assert ("analyser", ":SOUR1:BIAS:STAT OFF", 1) in longer[1].sent
