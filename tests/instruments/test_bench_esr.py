"""The ESR driver against the simulated ESR, and the simulated ESR's SCPI."""

from __future__ import annotations

import numpy as np
import pytest
import pyvisa

from motoremi.bench.connect import open_transport
from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.rohde_schwarz_esr import RohdeSchwarzESR
from motoremi.simulate import emission_in_time
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_receiver import settling_db


@pytest.fixture
def bench(bench: SimulatedBench) -> SimulatedBench:
    bench.connect("lisn-motor-on")
    return bench


@pytest.fixture
def receiver(bench: SimulatedBench) -> RohdeSchwarzESR:
    receiver = RohdeSchwarzESR(open_transport(bench.resource_manager, bench.resources["receiver"], clock=bench.clock))
    receiver.reset()
    receiver.configure(150e3, 30e6, 45e3, dwell_s=0.02)
    return receiver


@pytest.fixture
def raw(bench: SimulatedBench) -> pyvisa.resources.MessageBasedResource:
    resource = bench.resource_manager.open_resource(bench.resources["receiver"], write_termination="\n")
    assert isinstance(resource, pyvisa.resources.MessageBasedResource)
    return resource


def test_identity(receiver: RohdeSchwarzESR) -> None:
    assert receiver.identify().to_dict() == {
        "vendor": "Rohde&Schwarz",
        "model": "ESR3",
        "serial": "1316.3003K03/100001",
        "firmware": "2.28",
    }


@pytest.mark.slow
@pytest.mark.parametrize("detector", ["peak", "average", "quasi-peak"])
def test_a_scan_finds_the_emission(bench: SimulatedBench, receiver: RohdeSchwarzESR, detector: str) -> None:
    before = bench.clock.now()
    spectrum = receiver.scan(detector)
    assert spectrum.detector == detector
    assert len(spectrum) == 664
    assert spectrum.frequency_hz[[0, 1]].tolist() == [150e3, 195e3]
    assert spectrum.resolution_bandwidth_hz == 9e3
    assert not spectrum.overload.any()
    expected = emission_in_time.spectrum(bench.motor, spectrum.frequency_hz, detector, 7)
    # Meters have not settled after 20 ms.
    np.testing.assert_allclose(spectrum.level_dbuv, expected + settling_db(detector, 0.02), atol=1e-3)
    assert bench.clock.now() - before > 664 * 0.02


@pytest.mark.slow
def test_the_cispr_scan_has_6634_points(receiver: RohdeSchwarzESR) -> None:
    receiver.configure(150e3, 30e6, 4.5e3)
    assert len(receiver.scan("peak")) == 6634


def test_settings_are_what_the_instrument_says(receiver: RohdeSchwarzESR) -> None:
    assert receiver.settings() == {
        "start_hz": 150e3,
        "stop_hz": 30e6,
        "step_hz": 45e3,
        "filter_shape": "6 dB EMI",
        "resolution_bandwidth_hz": 9e3,
        "dwell_s": 0.02,
        "attenuation_db": 10.0,
        "level_unit": "dBuV",
        "preamplifier": False,
        "own_correction": False,
        "detector": "peak",
    }


def test_an_overload_marks_the_scan(bench: SimulatedBench, receiver: RohdeSchwarzESR, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "level_dbuv", lambda frequency_hz, detector: np.full(frequency_hz.shape, 115.0))
    marked = receiver.scan("peak")
    assert marked.overload.all()
    assert marked.level_dbuv.max() == 107.0
    receiver.attenuation_db = 30.0
    assert not receiver.scan("peak").overload.any()


def test_nothing_connected_is_quiet(bench: SimulatedBench, receiver: RohdeSchwarzESR) -> None:
    bench.connect("open")
    assert receiver.scan("peak").level_dbuv.max() < 0


def test_settings_out_of_range(receiver: RohdeSchwarzESR) -> None:
    with pytest.raises(BadInput, match="attenuation_db = 80 dB is outside"):
        receiver.attenuation_db = 80.0
    # In the driver's range, which covers the largest ESR, but not in this one's.
    with pytest.raises(InstrumentError, match=r"-222 \"Data out of range\" after 'SCAN1:STOP 7000000000 HZ'"):
        receiver.stop_hz = 7e9


def test_a_detector_that_this_receiver_lacks(receiver: RohdeSchwarzESR) -> None:
    with pytest.raises(BadInput, match="detector = 'loud' is unknown"):
        receiver.scan("loud")


@pytest.mark.slow
def test_levels_that_do_not_fit_the_scan_table(bench: SimulatedBench, receiver: RohdeSchwarzESR, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(receiver, "read_levels", lambda query: np.zeros(600))
    with pytest.raises(InstrumentError, match="received 600 levels for a scan table of 664 steps"):
        receiver.scan("peak")


@pytest.mark.parametrize(
    "written",
    ["SCAN1:STAR 200 kHz", "scan1:start 0.2MHZ", ":SENSe:SCAN1:STARt 2E5", "SENS:SCAN1:STAR 200000.0 Hz"],
)
def test_scpi_in_every_spelling(raw: pyvisa.resources.MessageBasedResource, written: str) -> None:
    raw.write(written)
    assert float(raw.query("SCAN1:STAR?")) == 200e3
    assert raw.query("SYSTem:ERRor?").startswith("0")


def test_answers_of_one_message_are_joined(raw: pyvisa.resources.MessageBasedResource) -> None:
    assert raw.query("SCAN1:TIME 50 ms; SCAN1:TIME?;DET1:REC?").strip() == "0.050000;POS"


def test_status_logic_for_stock_clients(raw: pyvisa.resources.MessageBasedResource) -> None:
    raw.write("*CLS;*ESE 1;*OPC")
    assert int(raw.query("*STB?")) & 32
    assert int(raw.query("*ESR?")) == 1
    raw.write("NONSENSE")
    assert int(raw.query("*STB?")) & 4
    assert int(raw.query("*ESR?")) == 32
    assert raw.query("SYST:ERR?").startswith("-113")
    assert not int(raw.query("*STB?")) & 4
    assert raw.query("*OPC?").strip() == "1"


@pytest.mark.slow
def test_binary_levels(raw: pyvisa.resources.MessageBasedResource) -> None:
    raw.write("SCAN1:STOP 160 kHz;FORM REAL,32;INIT2;*WAI")
    assert len(raw.query_binary_values("TRAC? TRACE1", datatype="f")) == 3
    raw.write("TRAC? TRACE9")
    assert raw.query("SYST:ERR?").startswith("-222")


def test_an_analyser_looks_beyond_the_band(bench: SimulatedBench) -> None:
    """As a spectrum analyser it may be set to any span; the simulated motor emits in band B."""
    raw = bench.resource_manager.open_resource("GPIB0::20::INSTR", write_termination="\n", read_termination="\n")
    raw.write("INST:SEL SAN;FREQ:STAR 0;FREQ:STOP 60MHZ;SWE:POIN 601;INIT;*WAI")
    levels = np.array([float(field) for field in raw.query("TRAC? TRACE1").split(",")])
    assert levels[:2].max() == levels[302:].max() == -200
    assert levels[2:300].min() > -50


def test_a_scan_of_too_many_points_is_refused(bench: SimulatedBench) -> None:
    raw = bench.resource_manager.open_resource("GPIB0::20::INSTR", write_termination="\n", read_termination="\n")
    raw.write("SCAN1:STOP 3GHZ;SCAN1:STEP 1HZ;INIT2;*WAI")
    assert raw.query("SYST:ERR?").startswith("-222")
