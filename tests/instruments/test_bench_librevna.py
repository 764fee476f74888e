"""The LibreVNA driver on its simulated program, and the simulated program against the SCPI Programming Guide."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from motoremi.bench.motor_connections import STANDARDS
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.librevna import LibreVna
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_librevna import SimulatedLibreVna


@pytest.fixture
def sent() -> list[str]:
    return []


@pytest.fixture
def analyser(bench: SimulatedBench, sent: list[str]) -> LibreVna:
    def note(record: Any) -> None:
        if record["direction"] == "write":
            sent.append(record["text"].strip())

    driver = bench.open("analyser", "librevna", "whatever", note)
    assert isinstance(driver, LibreVna)
    driver.identify()
    driver.reset()
    driver.configure(150e3, 30e6, 41)
    return driver


def device_of(bench: SimulatedBench) -> SimulatedLibreVna:
    device = bench.devices["analyser"]
    assert isinstance(device, SimulatedLibreVna)
    return device


def answering(monkeypatch: pytest.MonkeyPatch, bench: SimulatedBench, query: str, answer: str) -> None:
    """Have the program answer one query in another way."""
    device = device_of(bench)
    monkeypatch.setitem(device.known_commands, device.fold(query), lambda _: answer.encode())


def test_identity(analyser: LibreVna) -> None:
    identity = analyser.identify()
    assert (identity.vendor, identity.model, identity.serial, identity.firmware) == ("LibreVNA", "LibreVNA-GUI", "206039903350", "1.6.5")


def test_a_value_that_is_no_number_is_refused(bench: SimulatedBench, analyser: LibreVna) -> None:
    with pytest.raises(InstrumentError, match=r"'\*ESE nan' was refused"):
        analyser.tell("*ESE nan")


def test_a_program_without_instrument_is_refused(bench: SimulatedBench, analyser: LibreVna, monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, bench, "*IDN?", "LibreVNA,LibreVNA-GUI,Not connected,1.6.5")
    with pytest.raises(InstrumentError, match="is not connected to a LibreVNA; connect it there"):
        analyser.identify()


def test_settings_are_what_the_program_says(analyser: LibreVna) -> None:
    assert analyser.configure(200e3, 20e6, 51, "linear", 5) == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "points": 51,
        "spacing": "linear",
        "bandwidth_hz": 100.0,
        "averages": 1,
        "level_dbm": -10.0,
        "calibration": "SOLT_12",
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_hz": 10e3}, "start_hz = 10 kHz is outside the range 100 kHz to 6 GHz"),
        ({"stop_hz": 7e9}, "stop_hz = 7 GHz"),
        ({"points": 5000}, "points = 5000 is outside the range 2 to 4501"),
        ({"bandwidth_factor": 0}, "bandwidth_factor = 0 is outside the range 1 to 5"),
    ],
)
def test_settings_out_of_range_are_refused(analyser: LibreVna, change: dict[str, float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        analyser.configure(**{"start_hz": 150e3, "stop_hz": 30e6, "points": 51, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize("active", ["None", "ThroughNormalization_12", "OSL_2"])
def test_a_program_that_does_not_calibrate_s11_is_refused(
    bench: SimulatedBench, analyser: LibreVna, monkeypatch: pytest.MonkeyPatch, active: str
) -> None:
    answering(monkeypatch, bench, "VNA:CALibration:ACTIVE?", active)
    with pytest.raises(InstrumentError, match=rf"no calibration of port 1 is active \({active}\); calibrate .* for 150 kHz to 30 MHz"):
        analyser.configure(150e3, 30e6, 41)


def test_the_calibration_survives_a_reset(bench: SimulatedBench, analyser: LibreVna, sent: list[str]) -> None:
    """The program's own `*RST` deletes it."""
    analyser.reset()
    assert "*RST" not in sent
    assert analyser.configure(150e3, 30e6, 41)["calibration"] == "SOLT_12"
    analyser.tell("*RST")
    with pytest.raises(InstrumentError, match=r"is active \(None\)"):
        analyser.configure(150e3, 30e6, 41)


@pytest.mark.parametrize("termination", TERMINATIONS)
def test_compensation_moves_the_reference_plane_to_the_fixture(bench: SimulatedBench, analyser: LibreVna, termination: Any) -> None:
    bench.connect(termination)
    at_port = analyser.sweep(termination)
    for standard in ("open", "short"):
        bench.connect(STANDARDS[standard])
        analyser.compensate(standard)
    bench.connect(termination)
    sweep = analyser.sweep(termination)
    assert (at_port.metadata["reference_plane"], sweep.metadata["reference_plane"]) == ("connector", "fixture")
    assert (sweep.metadata["analyser"], sweep.metadata["settings"]["calibration"]) == ("nanovna", "SOLT_12")
    assert (sweep.metadata["deembedding"], sweep.metadata["level_reached"]) == (False, True)
    assert Measurement.of([at_port]).analyser.fixture is not None
    assert Measurement.of([sweep]).analyser.fixture is None
    truth = bench.motor.impedance(termination, sweep.frequency_hz)
    usable = (np.abs(truth) > 5) & (np.abs(truth) < 500)
    before, after = (np.abs(one.impedance_ohm / truth - 1)[usable] for one in (at_port, sweep))
    # Residual tracking and match of the simulated instrument are 0.3 % and 0.5 % of S11: about 2 % between 5 and 500 Ohm.
    assert np.median(after) < 0.02
    assert np.median(after) < np.median(before)


def test_every_sweep_is_a_new_one(bench: SimulatedBench, analyser: LibreVna) -> None:
    """The trace keeps its last sweep, and the program says that it is complete."""
    swept = {}
    for termination in ("short", "open", "short"):
        bench.connect(termination)  # type: ignore[arg-type]
        swept[termination] = analyser.sweep(termination)
        assert analyser.ask(":VNA:ACQ:FIN?") == "TRUE"
    assert np.median(np.abs(swept["open"].impedance_ohm / swept["short"].impedance_ohm - 1)) > 0.3


@pytest.mark.parametrize(
    ("query", "answer", "message"),
    [
        ("VNA:TRACe:TYPE?", "MAXHOLD", "':VNA:TRAC:TYPE\\? S11' is answered 'MAXHOLD', expected 'OVERWRITE'; undo that"),
        ("VNA:TRACe:PAUSED?", "TRUE", "expected 'FALSE'"),
        ("VNA:TRACe:PARAMeter?", "S22", "expected 'S11'"),
        ("DEVice:STAtus:ADCOVERload?", "TRUE", "the receiver was overdriven; lower the level"),
        ("VNA:ACQuisition:FINished?", "MAYBE", "'MAYBE' in answer to ':VNA:ACQ:FIN\\?', expected TRUE or FALSE"),
        ("VNA:ACQuisition:FINished?", "FALSE", "':VNA:ACQ:RUN' is not complete after 11 s"),
        ("VNA:TRACe:DATA?", "EMPTY", "'EMPTY' in answer to .* is no list of frequency, real and imaginary part"),
        ("VNA:TRACe:DATA?", "[150000,0.5,0.1],[30000000,0.5,0.1]", "the trace S11 is no sweep of the frequencies asked for"),
        ("VNA:TRACe:DATA?", "[150000,0.5]", "the trace S11 is no sweep"),
    ],
)
def test_sweeps_that_are_none(
    bench: SimulatedBench, analyser: LibreVna, monkeypatch: pytest.MonkeyPatch, query: str, answer: str, message: str
) -> None:
    answering(monkeypatch, bench, query, answer)
    with pytest.raises(InstrumentError, match=message):
        analyser.sweep("open")


def test_a_trace_of_other_frequencies_is_refused(bench: SimulatedBench, analyser: LibreVna) -> None:
    analyser.read_axis()
    device_of(bench).assign("stop", "29E6")
    with pytest.raises(InstrumentError, match="the trace S11 is no sweep of the frequencies asked for; do not touch"):
        analyser.sweep("open")


def test_frequencies_with_six_digits_are_those_asked_for(bench: SimulatedBench, analyser: LibreVna, monkeypatch: pytest.MonkeyPatch) -> None:
    """As versions before 1.6 print them, and as the guide's example shows."""
    axis = analyser.read_axis()
    answering(monkeypatch, bench, "VNA:TRACe:DATA?", ",".join(f"[{hertz:.6g},0.5,-0.25]" for hertz in axis))
    np.testing.assert_allclose(analyser.scan(), 0.5 - 0.25j)


def test_a_refused_command_is_told(analyser: LibreVna) -> None:
    with pytest.raises(InstrumentError, match=r"':VNA:NONSENSE 3' was refused \(event status '32'\)"):
        analyser.tell(":VNA:NONSENSE 3")
    with pytest.raises(InstrumentError, match="was refused"):
        analyser.tell(":VNA:SWEEPTYPE CUBIC")


def test_the_program_spells_and_clamps_as_its_guide_and_source_say(bench: SimulatedBench) -> None:
    device = device_of_new(bench)

    def say(command: str) -> str:
        device.write(f"{command}\n".encode())
        return device.take_answers().decode().strip()

    assert say("DEVice:INFo:LIMits:MINFrequency?") == say(":dev:inf:lim:minf?") == "0"
    # A word in capitals has no short form, a query that is not known no answer.
    assert (say("VNA:ACQ:POIN?"), say("*ESR?")) == ("", "32")
    assert say("VNA:ACQ:POINTS 99999;:VNA:ACQ:POINTS?") == "4501"
    assert (say("VNA:FREQ:START 5e9;:VNA:FREQ:STOP 1e9"), say("VNA:FREQ:START?"), say("*ESR?")) == ("", "1000000000", "0")
    # Said again while it sweeps, SINGLE starts no new sweep; RUN does.
    say("VNA:ACQ:POINTS 101;:VNA:ACQ:SINGLE TRUE;:VNA:ACQ:RUN")
    assert (say("VNA:ACQ:FIN?"), say("VNA:ACQ:RUN?")) == ("FALSE", "TRUE")
    device.clock.sleep(1.0)
    assert (say("VNA:ACQ:FIN?"), say("VNA:ACQ:RUN?")) == ("TRUE", "FALSE")
    assert (say("VNA:TRAC:LIST?"), say("VNA:TRAC:DATA? S31"), say("*ESR?")) == ("S11,S12,S21,S22", "", "32")
    assert say("VNA:TRAC:DATA? S11").count("[") == 101


def device_of_new(bench: SimulatedBench) -> SimulatedLibreVna:
    bench.open("analyser", "librevna", "whatever", lambda record: None)
    return device_of(bench)
