"""The MXE driver on its simulated instrument, and the simulated instrument under a stock client."""

from __future__ import annotations

import numpy as np
import pytest
import pyvisa

from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.keysight_mxe import KeysightMXE
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_receiver import settling_db


@pytest.fixture
def bench(bench: SimulatedBench) -> SimulatedBench:
    bench.connect(bench.at_work("receiver"))
    return bench


@pytest.fixture
def receiver(bench: SimulatedBench) -> KeysightMXE:
    driver = bench.open("receiver", "mxe", "whatever", lambda record: None)
    assert isinstance(driver, KeysightMXE)
    driver.reset()
    driver.configure(150e3, 30e6, 45e3)
    return driver


def test_identity_and_settings(receiver: KeysightMXE) -> None:
    assert receiver.identify().model == "N9038A"
    assert receiver.configure(200e3, 20e6, 99e3, 9e3, 0.01, 20.0) == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "points": 201,
        "resolution_bandwidth_hz": 9e3,
        "scan_time_s": 2.01,
        "attenuation_db": 20.0,
        "preamplifier": False,
        "own_correction": False,
        "detector": "peak",
    }


@pytest.mark.slow
@pytest.mark.parametrize("detector", ["peak", "quasi-peak", "average"])
def test_a_scan_reads_what_arrives(bench: SimulatedBench, receiver: KeysightMXE, detector: str) -> None:
    before = bench.clock.now()
    spectrum = receiver.scan(detector)
    assert bench.clock.now() - before > 0.05 * len(spectrum)
    # 29.85 MHz in steps of 45 kHz do not come out even: one point more, and the last one is the stop.
    assert (len(spectrum), spectrum.frequency_hz[-1]) == (665, 30e6)
    assert not spectrum.overload.any()
    # The wire carries thousandths of a dB.
    expected = bench.level_dbuv(spectrum.frequency_hz, detector) + settling_db(detector, 0.05)
    np.testing.assert_allclose(spectrum.level_dbuv, expected, atol=6e-4)


def test_an_overload_marks_the_scan(bench: SimulatedBench, receiver: KeysightMXE, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "level_dbuv", lambda frequency_hz, detector: np.full(frequency_hz.shape, 120.0))
    assert receiver.scan("peak").overload.all()


def test_a_step_that_fits_nothing_is_refused(receiver: KeysightMXE) -> None:
    with pytest.raises(BadInput, match="step_hz = 50 MHz is outside the range"):
        receiver.configure(150e3, 30e6, 50e6)


@pytest.mark.slow
def test_levels_of_another_scan_are_refused(receiver: KeysightMXE, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(receiver, "read_levels", lambda: np.zeros(3))
    with pytest.raises(InstrumentError, match="received 3 levels for a scan table of 665 points"):
        receiver.scan("peak")


@pytest.mark.slow
def test_a_stock_client_reads_every_format(bench: SimulatedBench, receiver: KeysightMXE) -> None:
    raw = bench.resource_manager.open_resource("GPIB0::21::INSTR", write_termination="\n", read_termination="\n")
    assert isinstance(raw, pyvisa.resources.MessageBasedResource)
    raw.write(":SENSe:FSCan:SCAN2:STARt 1MHz;:FSC:SCAN2:STOP 2 MHz;:FSC:SCAN2:POINts 11;:FSC:DET:TRAC1 QPEak")
    raw.write(":INITiate2:IMMediate;*WAI")
    expected = bench.level_dbuv(np.linspace(1e6, 2e6, 11), "quasi-peak")
    raw.write(":FORM ASCii")
    text = [float(field) for field in raw.query(":TRACe:FSCan? TRACE1").split(",")]
    np.testing.assert_allclose(text, expected, atol=6e-4)
    raw.read_termination = None
    raw.write(":FORM:DATA INT,32;:FORM:BORD NORM")
    thousandths = raw.query_binary_values(":TRAC:FSC? TRACE1", datatype="i", is_big_endian=True, container=np.array)
    np.testing.assert_allclose(thousandths * 1e-3 + 106.99, expected, atol=1e-3)
    raw.write(":INST:SEL SA;:INIT2")
    assert raw.query(":SYST:ERR?").startswith("-222")


def test_a_scan_that_runs_backwards_is_refused(bench: SimulatedBench, receiver: KeysightMXE) -> None:
    with pytest.raises(InstrumentError, match="-222"):
        receiver.tell(":FSC:SCAN2:STAR 2 MHZ;:FSC:SCAN2:STOP 1 MHZ;:INIT2;*WAI")
