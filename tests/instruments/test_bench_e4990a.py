"""The E4990A driver on its simulated instrument, and the simulated instrument under SCPI as its public programs write it."""

from __future__ import annotations

import numpy as np
import pytest
import pyvisa

from motoremi.bench.replay import ReplayTransport
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.keysight_e4990a import KeysightE4990A
from motoremi.virtual.simulated_bench import SimulatedBench


@pytest.fixture
def analyser(bench: SimulatedBench) -> KeysightE4990A:
    driver = bench.open("analyser", "e4990a", "whatever", lambda record: None)
    assert isinstance(driver, KeysightE4990A)
    driver.reset()
    driver.configure(150e3, 30e6, 51)
    return driver


@pytest.fixture
def raw(bench: SimulatedBench, analyser: KeysightE4990A) -> pyvisa.resources.MessageBasedResource:
    """A stock client: PyVISA and nothing of ours."""
    resource = bench.resource_manager.open_resource("GPIB0::18::INSTR", write_termination="\n", read_termination="\n")
    assert isinstance(resource, pyvisa.resources.MessageBasedResource)
    return resource


def test_identity_and_settings(analyser: KeysightE4990A) -> None:
    assert analyser.identify().serial == "MY54100123"
    assert analyser.configure(200e3, 20e6, 1601, "linear", 5, 0.25) == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "points": 1601,
        "spacing": "linear",
        "bandwidth_factor": 5,
        "oscillator_volt": 0.25,
        "adapter": "none",
        "fixture": "none",
        "sweep_averaging": False,
        "sweep_averages": 16,
        "averaging_trigger": False,
        "point_averaging": False,
        "point_averages": 1,
    }


def test_settings_out_of_range_are_refused_before_the_wire(analyser: KeysightE4990A) -> None:
    with pytest.raises(BadInput, match="start_hz = 10 Hz is outside the range 20 Hz to 120 MHz"):
        analyser.configure(10.0, 30e6, 51)


def test_a_compensated_sweep_finds_the_motor(bench: SimulatedBench, analyser: KeysightE4990A) -> None:
    bench.connect("open-standard")
    analyser.compensate("open")
    bench.connect("short-standard")
    analyser.compensate("short")
    for termination in TERMINATIONS:
        bench.connect(termination)
        sweep = analyser.sweep(termination)
        assert sweep.metadata["analyser"] == "e4990a"
        assert sweep.metadata["open_compensation"] is sweep.metadata["short_compensation"] is True
        assert sweep.metadata["fixture"] == sweep.metadata["adapter"] == "none"
        truth = bench.motor.impedance(termination, sweep.frequency_hz)
        # A third of the specified error is drawn: 0.5 % at 15 MHz, and residuals on top.
        assert np.median(np.abs(sweep.impedance_ohm / truth - 1)) < 5e-3


def test_compensation_at_other_frequencies_is_refused(bench: SimulatedBench, analyser: KeysightE4990A) -> None:
    analyser.compensate("open")
    analyser.configure(150e3, 30e6, 61)
    with pytest.raises(InstrumentError, match="compensate again"):
        analyser.sweep("open")


def test_data_are_refused_before_the_sweep_is_complete(analyser: KeysightE4990A) -> None:
    analyser.trigger()
    with pytest.raises(InstrumentError, match="not complete"):
        analyser.read_impedance()


def test_the_same_trace_twice_is_refused(bench: SimulatedBench, analyser: KeysightE4990A, monkeypatch: pytest.MonkeyPatch) -> None:
    """The instrument did not follow the selection, or answers a query late."""
    bench.connect("short")
    analyser.trigger()
    analyser.wait_until_complete()
    first = analyser.read_part(0)
    monkeypatch.setattr(analyser, "read_part", lambda index: first)
    with pytest.raises(InstrumentError, match="parameter 1 and parameter 2 are the same at every point, one trace was sent twice"):
        analyser.read_impedance()


def test_a_sweep_that_never_ends_meets_its_deadline(analyser: KeysightE4990A, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(analyser, "OPERATION_COMPLETE", 2)
    analyser.trigger()
    with pytest.raises(InstrumentError, match=r"':TRIG:SING' is not complete after 12 s"):
        analyser.wait_until_complete()


def test_a_compensation_that_is_not_on_afterwards_is_an_error() -> None:
    fine = (":SYST:ERR?", '+0,"No error"')
    exchanges = [
        (":SENS1:CORR:COLL:FPO USER", None),
        fine,
        ("*CLS", None),
        fine,
        (":SENS1:CORR2:COLL:ACQ:OPEN", None),
        fine,
        ("*OPC", None),
        fine,
        (":SENS1:SWE:POIN?", "+2"),
        fine,
        (":SENS1:APER:TIME?", "+1"),
        fine,
        ("*ESR?", "+1"),
        fine,
        (":SENS1:CORR2:OPEN?", "0"),
        fine,
    ]
    records = []
    for command, answer in exchanges:
        records.append({"direction": "write", "text": command + "\n"})
        records += [] if answer is None else [{"direction": "read", "text": answer + "\n"}]
    with pytest.raises(InstrumentError, match="the open compensation is not on"):
        KeysightE4990A(ReplayTransport("SCRIPT", records)).measure_standard("open")


def test_the_safe_state_has_the_lowest_level(analyser: KeysightE4990A) -> None:
    analyser.safe()
    assert analyser.oscillator_volt == 0.005


def test_a_stock_client_spells_as_it_likes(raw: pyvisa.resources.MessageBasedResource) -> None:
    for written in (":SENSe1:FREQuency:STARt 150 kHz", "FREQ:STAR 0.15MHZ", ":sens:freq:star 1.5e5", ":SENS1:FREQ:STAR 150000 HZ"):
        raw.write(":SENS1:FREQ:STAR 20")
        raw.write(written)
        assert float(raw.query("FREQ:STAR?")) == 150e3, written
    assert raw.query(":SYSTem:ERRor:NEXT?") == '+0,"No error"'
    raw.write(":SENS1:FREQ:STAR 1 GHZ; :WOBBLE")
    assert raw.query(":SYST:ERR?").startswith("-222")
    assert raw.query(":SYST:ERR?").startswith("-113")


def test_a_stock_client_reads_every_format(bench: SimulatedBench, raw: pyvisa.resources.MessageBasedResource) -> None:
    bench.connect("open")
    raw.write(":CALC1:PAR1:DEF Z;:CALC1:PAR2:DEF TZ;:SENS1:SWE:POIN 5;:TRIG:SOUR BUS;:TRIG:SING")
    assert int(raw.query(":STAT:OPER:COND?")) == 16
    assert raw.query("*OPC?") == "1"
    assert int(raw.query(":STAT:OPER:COND?")) == 0
    raw.write(":CALC1:PAR1:SEL;:FORM:DATA ASC")
    text = np.array([float(field) for field in raw.query(":CALC1:DATA:FDAT?").split(",")])
    assert "E+005" in raw.query(":SENS1:FREQ:DATA?")
    blocks = []
    for form, order, code, big in (("REAL", "NORM", "d", True), ("REAL", "SWAP", "d", False), ("REAL32", "NORM", "f", True)):
        raw.write(f":FORM:DATA {form};:FORM:BORD {order}")
        raw.read_termination = None
        blocks.append(raw.query_binary_values(":CALC1:DATA:FDAT?", datatype=code, is_big_endian=big, container=np.array))
        raw.read_termination = "\n"
    for block in blocks:
        np.testing.assert_allclose(block, text, rtol=1e-6)
    assert not text[1::2].any()
    raw.write(":FORM:DATA ASC")
    complex_ = np.array([float(field) for field in raw.query(":CALC1:DATA:RDAT?").split(",")])
    np.testing.assert_allclose(np.hypot(complex_[::2], complex_[1::2]), text[::2], rtol=1e-9)


def test_a_trigger_of_another_source_is_ignored(raw: pyvisa.resources.MessageBasedResource) -> None:
    raw.write(":TRIG:SOUR INT;:TRIG:SING")
    assert raw.query(":SYST:ERR?").startswith("-211")
    raw.write(":SYST:PRES;:SENS1:CORR2:LOAD ON")
    assert raw.query(":SYST:ERR?").startswith("-221")
