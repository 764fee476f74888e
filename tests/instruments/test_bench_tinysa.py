"""The tinySA driver on its simulated instrument, and the simulated shell against the firmware's manners."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.tinysa import TinySa
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_tinysa import SimulatedTinySa
from motoremi.virtual.virtual_instruments import virtual_instrument


@pytest.fixture
def bench(bench: SimulatedBench) -> SimulatedBench:
    bench.connect(bench.at_work("receiver"))
    return bench


@pytest.fixture
def receiver(bench: SimulatedBench) -> TinySa:
    driver = bench.open("receiver", "tinysa", "whatever", lambda record: None)
    assert isinstance(driver, TinySa)
    driver.identify()
    driver.reset()
    driver.configure(150e3, 30e6, 50e3, 10e3, 0.02)
    return driver


@pytest.fixture
def shell(bench: SimulatedBench) -> SimulatedTinySa:
    device = virtual_instrument("tinysa").make(bench, bench.clock)
    device.resource_name = "ASRL7::INSTR"
    assert isinstance(device, SimulatedTinySa)
    return device


def say(shell: SimulatedTinySa, typed: str) -> str:
    shell.write(typed.encode())
    return shell.take_answers().decode()


def test_identity_and_settings(receiver: TinySa) -> None:
    identity = receiver.identify()
    assert (identity.model, identity.firmware) == ("tinySA v0.3", "tinySA_v1.4-175-g1419a93")
    assert receiver.configure(200e3, 20e6, 4.5e3, 30e3, 0.01, 20.0) == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "resolution_bandwidth_hz": 30e3,
        "attenuation_db": 20.0,
        "step_hz": 4.5e3,
        "dwell_s": 0.01,
        "own_correction": False,
    }


@pytest.mark.slow
def test_a_scan_in_pieces_is_one_spectrum(bench: SimulatedBench, receiver: TinySa) -> None:
    spectrum = receiver.scan("peak")
    np.testing.assert_allclose(spectrum.frequency_hz, np.arange(150e3, 30e6 + 1, 50e3))
    assert len(spectrum) > 2 * receiver.SCAN_POINTS
    assert spectrum.metadata["compliance"] is False
    expected = bench.level_dbuv(spectrum.frequency_hz, "peak")
    loud = expected > 30
    # Half a dB of resolution, and the simulated receiver draws 0.5 dB of ripple anew for every scan length.
    assert np.median(np.abs(spectrum.level_dbuv - expected)[loud]) < 1.5


def test_a_filter_that_does_not_exist_is_named(receiver: TinySa) -> None:
    with pytest.raises(BadInput, match="has no filter of 9 kHz, the nearest is 10 kHz; ask for that one"):
        receiver.configure(150e3, 30e6, 4.5e3, 9e3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_hz": 9e3}, "start_hz = 9 kHz is outside the range 100 kHz to 350 MHz"),
        ({"step_hz": 100e6}, "step_hz = 100 MHz"),
        ({"dwell_s": 1.0}, "dwell_s = 1 s is outside the range 0 s to 206.9 ms"),
        ({"attenuation_db": 40.0}, "attenuation_db = 40 dB"),
    ],
)
def test_settings_out_of_range_are_refused(receiver: TinySa, change: dict[str, float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        receiver.configure(**{"start_hz": 150e3, "stop_hz": 30e6, "step_hz": 50e3, "resolution_bandwidth_hz": 10e3, **change})


def test_detectors_that_it_does_not_have_are_refused(receiver: TinySa) -> None:
    with pytest.raises(BadInput, match=r"has no quasi-peak detector of CISPR 16-1-1; use peak"):
        receiver.scan("quasi-peak")


def test_a_refusal_is_an_error_and_a_bare_command_is_a_question(receiver: TinySa) -> None:
    with pytest.raises(InstrumentError, match="'rbw 5000' was refused: usage: rbw"):
        receiver.tell("rbw 5000")
    assert receiver.ask("rbw").splitlines()[-1] == "10000.0Hz"


@pytest.mark.slow
def test_the_dwell_is_kept_on_the_clock(bench: SimulatedBench, receiver: TinySa) -> None:
    before = bench.clock.now()
    spectrum = receiver.scan("peak")
    assert bench.clock.now() - before > 0.02 * len(spectrum)


def test_the_shell_prints_as_the_firmware_does(shell: SimulatedTinySa) -> None:
    assert say(shell, "version\r").splitlines()[1].startswith("tinySA_v1.4")
    rows = say(shell, "scan 150000 30000000 0x3 3\r").splitlines()[1:-1]
    assert [row.split()[0] for row in rows] == ["150000", "15075000", "30000000"]
    assert all(row.split()[2] == "0.000000000" and "e" in row.split()[1] for row in rows)
    assert say(shell, "status\r").splitlines()[1] == "Paused"
    say(shell, "resume\r")
    assert say(shell, "status\r").splitlines()[1] == "Resumed"
    assert say(shell, "scan 1 2 291\r").splitlines()[1] == "sweep points exceeds range 290"
    assert len(say(shell, "data 2\r").splitlines()) == 292


def test_raw_scans_hold_the_same_levels(shell: SimulatedTinySa) -> None:
    shell.write(b"scanraw 1000000 2000000 4 1\r")
    frame = shell.take_answers().removeprefix(b"scanraw 1000000 2000000 4 1\r\n").removesuffix(b"ch> ")
    assert (frame[:1], frame[-1:], len(frame)) == (b"{", b"}", 14)
    raw = np.frombuffer(frame[1:-1], np.dtype([("x", "S1"), ("count", "<u2")]))
    levels = raw["count"] / 32 - 128
    printed = [float(row.split()[0]) for row in say(shell, "scan 1000000 1750000 4 2\r").splitlines()[1:-1]]
    np.testing.assert_allclose(levels, printed, atol=1e-9)
