"""Spectrum analysers that sweep with a limited number of points: partial sweeps, filters, options, overload and their own corrections."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fault_matrix import SEED
from record_sessions import procedure
from serving import SPEED, served

from motoremi.bench.clock import FastClock
from motoremi.bench.motor_connections import INSTRUCTIONS
from motoremi.bench.swept import SweptAnalyser
from motoremi.data.session import SessionWriter, load, verify
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.rerun import rerun
from motoremi.run.runner import make_bench, run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_receiver import BAND_B_HZ

ANALYSERS = ("dsa800", "rsa", "ssa3000x", "xseries")
MOST_POINTS = {"dsa800": 601, "rsa": 1001, "ssa3000x": 751, "xseries": 1001}


@pytest.fixture
def bench(bench: SimulatedBench) -> SimulatedBench:
    bench.connect(bench.at_work("receiver"))
    return bench


def opened(bench: SimulatedBench, name: str, traffic: list[Any] | None = None) -> SweptAnalyser:
    driver = bench.open("receiver", name, "whatever", (traffic if traffic is not None else []).append)
    assert isinstance(driver, SweptAnalyser)
    return driver


def ready(bench: SimulatedBench, name: str, traffic: list[Any] | None = None, bandwidth_hz: float = 9e3, step_hz: float = 4.5e3) -> SweptAnalyser:
    driver = opened(bench, name, traffic)
    driver.reset()
    driver.configure(150e3, 30e6, step_hz, bandwidth_hz)
    return driver


def sent(traffic: list[Any]) -> list[str]:
    return [record["text"].strip() for record in traffic if record["direction"] == "write"]


def arriving(bench: SimulatedBench, frequency_hz: np.ndarray, detector: str) -> np.ndarray:
    """What the simulated sweeps are read off."""
    return np.interp(frequency_hz, BAND_B_HZ, bench.level_dbuv(BAND_B_HZ, detector))


@pytest.mark.slow
@pytest.mark.parametrize("name", ANALYSERS)
def test_partial_sweeps_are_joined_at_their_edges(bench: SimulatedBench, name: str) -> None:
    traffic: list[Any] = []
    driver = ready(bench, name, traffic)
    traffic.clear()
    spectrum = driver.scan("peak")
    sweeps = [text for text in sent(traffic) if text.startswith(":INIT")]
    settings = spectrum.metadata["settings"]
    assert len(sweeps) == settings["partial_sweeps"] > 1
    assert settings["points"] <= MOST_POINTS[name]
    assert len(spectrum) == settings["partial_sweeps"] * (settings["points"] - 1) + 1
    assert (spectrum.frequency_hz[0], spectrum.frequency_hz[-1]) == (150e3, 30e6)
    steps_hz = np.diff(spectrum.frequency_hz)
    assert 0.9 * 4.5e3 < steps_hz.min() <= steps_hz.max() <= 4.5e3
    np.testing.assert_allclose(spectrum.level_dbuv, arriving(bench, spectrum.frequency_hz, "peak"), atol=1e-3)
    # The instrument stands at the whole span again.
    assert driver.settings() == settings


@pytest.mark.slow
@pytest.mark.parametrize("name", ANALYSERS)
def test_a_short_span_is_one_sweep(bench: SimulatedBench, name: str) -> None:
    driver = opened(bench, name)
    driver.reset()
    settings = driver.configure(1e6, 1.9e6, 4.5e3, dwell_s=0.02)
    assert settings["partial_sweeps"] == 1
    assert settings["points"] == {"rsa": 201, "xseries": 201}.get(name, MOST_POINTS[name])
    # 200 steps were asked for; more points in the same time stay as long within the filter.
    assert settings["sweep_time_s"] == pytest.approx(0.02 * 201)
    assert settings["dwell_s"] == pytest.approx(0.02)
    before_s = bench.clock.now()
    spectrum = driver.scan("average")
    assert bench.clock.now() - before_s > settings["sweep_time_s"]
    np.testing.assert_allclose(spectrum.level_dbuv, arriving(bench, spectrum.frequency_hz, "average"), atol=1e-3)


@pytest.mark.slow
def test_a_line_at_the_edge_of_two_parts_is_kept(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = ready(bench, "dsa800")
    levels = iter([*(np.full(601, -60.0) for _ in range(11)), np.full(601, -40.0)])
    monkeypatch.setattr(driver, "read_levels", lambda: next(levels))
    spectrum = driver.scan("peak")
    # The last part begins where the one before it ends; the higher of both readings counts.
    assert np.count_nonzero(spectrum.level_dbuv > 60.0) == 601


@pytest.mark.slow
@pytest.mark.parametrize("name", ANALYSERS)
def test_the_filter_is_told_and_quasi_peak_needs_the_right_one(bench: SimulatedBench, name: str) -> None:
    driver = ready(bench, name, step_hz=1e6)
    spectrum = driver.scan("quasi-peak")
    assert spectrum.metadata["settings"]["filter_shape"] == "6 dB EMI"
    assert spectrum.resolution_bandwidth_hz == 9e3
    # The filter passes over a frequency in too short a time for the meter: every level is low by as much.
    below_db = spectrum.level_dbuv - arriving(bench, spectrum.frequency_hz, "quasi-peak")
    np.testing.assert_allclose(below_db, below_db[0], atol=1e-3)
    assert below_db[0] < -20
    assert driver.configure(150e3, 30e6, 1e6, 10e3)["filter_shape"] == "3 dB Gauss"
    assert driver.scan("peak").resolution_bandwidth_hz == 10e3
    with pytest.raises(BadInput, match="quasi-peak needs the 6 dB EMI filter; ask for a bandwidth of 200 Hz, 9 kHz") as caught:
        driver.scan("quasi-peak")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "option"),
    [("dsa800", "the option DSA800-EMI"), ("rsa", "the EMI option"), ("ssa3000x", "the EMI measurement kit"), ("xseries", "the option EMC")],
)
def test_without_the_option_only_gaussian_filters_are_there(bench: SimulatedBench, name: str, option: str) -> None:
    driver = opened(bench, name)
    bench.devices["receiver"].set_value("emi_option", "OFF")
    driver.reset()
    with pytest.raises(InstrumentError, match=f"-222.*the 6 dB EMI filter and quasi-peak need {option}") as caught:
        driver.configure(150e3, 30e6, 1e6, 9e3)
    assert "\n" not in str(caught.value)
    driver.configure(150e3, 30e6, 1e6, 10e3)
    assert driver.scan("peak").level_dbuv.max() > 40
    with pytest.raises(BadInput, match="quasi-peak needs"):
        driver.scan("quasi-peak")


@pytest.mark.parametrize(
    ("name", "refused"),
    [("dsa800", "cispr-average"), ("dsa800", "rms-average"), ("rsa", "cispr-average"), ("ssa3000x", "rms-average"), ("xseries", "loud")],
)
def test_a_detector_that_is_not_there_is_refused(bench: SimulatedBench, name: str, refused: str) -> None:
    with pytest.raises(BadInput, match=f"detector = '{refused}' is unknown; use one of peak, quasi-peak, average"):
        ready(bench, name, step_hz=1e6).scan(refused)


def test_a_bandwidth_without_filter_is_refused(bench: SimulatedBench) -> None:
    driver = opened(bench, "ssa3000x")
    driver.reset()
    with pytest.raises(BadInput, match="has no 3 dB Gauss filter of 12 kHz, the nearest is 10 kHz; ask for that one"):
        driver.configure(150e3, 30e6, 4.5e3, 12e3)
    with pytest.raises(BadInput, match="step_hz = 50 MHz is outside the range"):
        driver.configure(150e3, 30e6, 50e6)


@pytest.mark.parametrize("name", ANALYSERS)
def test_corrections_of_the_instrument_are_switched_off(bench: SimulatedBench, name: str) -> None:
    driver = opened(bench, name)
    left = bench.devices["receiver"]
    # What somebody left on, which a reset does not take away everywhere.
    for setting, value in {"own_correction": "ON", "level_offset": "6", "external_gain": "20"}.items():
        if left.has(setting):
            left.set_value(setting, value)
    driver.reset()
    assert driver.own_correction is True
    settings = driver.configure(150e3, 30e6, 1e6)
    assert settings["own_correction"] is False
    assert settings["level_offset_db"] == 0.0
    spectrum = driver.scan("peak")
    assert spectrum.metadata["settings"]["own_correction"] is False
    np.testing.assert_allclose(spectrum.level_dbuv, arriving(bench, spectrum.frequency_hz, "peak"), atol=1e-3)
    driver.own_correction = True
    assert driver.scan("peak").metadata["settings"]["own_correction"] is True


def test_an_overload_marks_its_part_where_the_instrument_tells(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    def loud(frequency_hz: np.ndarray, detector: str) -> np.ndarray:
        return np.where(frequency_hz < 5e6, 120.0, 40.0)

    driver = ready(bench, "xseries")
    monkeypatch.setattr(bench, "level_dbuv", loud)
    spectrum = driver.scan("peak")
    settings = spectrum.metadata["settings"]
    part_hz = 29.85e6 / settings["partial_sweeps"]
    assert spectrum.overload[spectrum.frequency_hz < 5e6].all()
    assert not spectrum.overload[spectrum.frequency_hz > 5e6 + part_hz].any()
    assert spectrum.metadata["overload_told"] is True


@pytest.mark.parametrize("name", ["dsa800", "rsa", "ssa3000x"])
def test_who_does_not_tell_an_overload_says_so(bench: SimulatedBench, name: str) -> None:
    assert ready(bench, name, step_hz=1e6).scan("peak").metadata["overload_told"] is False


@pytest.mark.parametrize("answer", ["#9", "#90000", "nothing", "-3,,-4", "1,nan"])
def test_a_garbled_trace_is_refused(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    driver = ready(bench, "dsa800", step_hz=1e6)
    monkeypatch.setattr(bench.devices["receiver"], "trace", lambda levels: answer)
    with pytest.raises(InstrumentError, match=r"is no list of levels|not finite"):
        driver.scan("peak")


def test_a_trace_of_other_length_is_refused(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = ready(bench, "ssa3000x", step_hz=1e6)
    monkeypatch.setattr(driver, "read_levels", lambda: np.zeros(3))
    with pytest.raises(InstrumentError, match="received 3 levels, but a sweep has 751"):
        driver.scan("peak")


def test_the_rsa_leaves_its_real_time_mode(bench: SimulatedBench) -> None:
    driver = opened(bench, "rsa")
    driver.reset()
    with pytest.raises(InstrumentError, match="-222"):
        driver.tell(":INIT")
    driver.configure(150e3, 30e6, 1e6)
    assert driver.ask(":INST:SEL?") == "SA"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["dsa800", "xseries"])
def test_a_procedure_runs_over_a_real_link(tmp_path: Path, name: str) -> None:
    bench = SimulatedBench(SEED, clock=FastClock(SPEED))
    bench.level_dbuv(BAND_B_HZ, "peak")
    source = dict(procedure(name).source)
    # The operator's own clock is not faster.
    source["steps"] = [step for step in source["steps"] if step["do"] != "wait"]
    planned = parse_procedure(source, name)

    def operator(text: str) -> None:
        bench.connect(next(what for what, instruction in INSTRUCTIONS.items() if text.startswith(instruction.text)))

    with served(name, bench=bench) as (server, _):
        bench_file = BenchFile(backend="@py", resources={"receiver": server.resource})
        visa = make_bench(bench_file)
        writer = SessionWriter.create(tmp_path / "s", start_document(planned, bench_file))
        run(planned, visa, writer, analyse=lambda *_: None, prompt=operator)
        visa.close()
    session = load(tmp_path / "s")
    assert verify(tmp_path / "s") == []
    assert [spectrum.detector for spectrum in session.spectra] == ["peak", "average"] * 2
    assert rerun(session, tmp_path / "again", lambda: lambda *_: None, False).same
