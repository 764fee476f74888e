"""The NanoVNA driver on its simulated instrument and on the wire, and the simulated shell against the firmware's manners."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import motoremi as me
from motoremi.bench.connect import open_transport
from motoremi.bench.reflection import impedance_from_reflection, pieces, without_fixture
from motoremi.bench.replay import ReplayTransport
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.nanovna import NanoVna
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_nanovna import SimulatedNanoVna
from motoremi.virtual.virtual_instruments import virtual_instrument


@pytest.fixture
def analyser(bench: SimulatedBench) -> NanoVna:
    driver = bench.open("analyser", "nanovna", "whatever", lambda record: None)
    assert isinstance(driver, NanoVna)
    driver.identify()
    driver.reset()
    driver.configure(150e3, 30e6, 101)
    return driver


@pytest.fixture
def shell(bench: SimulatedBench) -> SimulatedNanoVna:
    device = virtual_instrument("nanovna").make(bench, bench.clock)
    device.resource_name = "ASRL7::INSTR"
    assert isinstance(device, SimulatedNanoVna)
    return device


def say(shell: SimulatedNanoVna, typed: str) -> str:
    shell.write(typed.encode())
    return shell.take_answers().decode()


def test_identity(analyser: NanoVna) -> None:
    identity = analyser.identify()
    assert (identity.vendor, identity.model, identity.firmware) == ("NanoVNA", "NanoVNA-H 4", "1.2.40")


def test_settings_are_what_the_instrument_says(analyser: NanoVna) -> None:
    assert analyser.configure(200e3, 20e6, 51, "linear", 5) == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "bandwidth_index": 132,
        "points": 51,
        "spacing": "linear",
        "calibration": "load open short thru Es Er Et cal'ed",
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_hz": 10e3}, "start_hz = 10 kHz is outside the range 50 kHz to 300 MHz"),
        ({"stop_hz": 400e6}, "stop_hz = 400 MHz"),
        ({"points": 1}, "points = 1 is outside the range 2 to 1601"),
        ({"bandwidth_factor": 6}, "bandwidth_factor = 6"),
    ],
)
def test_settings_out_of_range_are_refused(analyser: NanoVna, change: dict[str, float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        analyser.configure(**{"start_hz": 150e3, "stop_hz": 30e6, "points": 51, **change})  # type: ignore[arg-type]


def test_an_uncalibrated_instrument_is_refused(analyser: NanoVna) -> None:
    analyser.tell("cal off")
    with pytest.raises(InstrumentError, match=r"is not calibrated; calibrate it at its connector .* for 150 kHz to 30 MHz"):
        analyser.configure(150e3, 30e6, 51)


@pytest.mark.slow
@pytest.mark.parametrize("termination", ["short", "open"])
def test_compensation_moves_the_reference_plane_to_the_fixture(bench: SimulatedBench, analyser: NanoVna, termination: Any) -> None:
    bench.connect(termination)
    at_connector = analyser.sweep(termination)
    bench.connect("open-standard")
    analyser.compensate("open")
    bench.connect("short-standard")
    analyser.compensate("short")
    bench.connect(termination)
    at_fixture = analyser.sweep(termination)
    assert at_connector.metadata["reference_plane"] == "connector"
    assert at_fixture.metadata["reference_plane"] == "fixture"
    assert at_fixture.metadata["analyser"] == "nanovna"
    truth = bench.motor.impedance(termination, at_fixture.frequency_hz)
    usable = (np.abs(truth) > 5) & (np.abs(truth) < 500)
    before, after = (np.abs(sweep.impedance_ohm / truth - 1)[usable] for sweep in (at_connector, at_fixture))
    # Residual tracking and match of the simulated instrument are 0.3 % and 0.5 % of S11: about 2 % between 5 and 500 Ohm.
    assert np.median(after) < 0.02
    assert np.median(after) < np.median(before)


@pytest.mark.slow
def test_a_motor_without_effects_is_fitted_to_the_noise(bench: SimulatedBench, analyser: NanoVna) -> None:
    """Noise of the standards is in every sweep and not in their scatter; with a single scan of each, chi-square would be about 3."""
    analyser.configure(150e3, 30e6, 201, "log", 4)
    bench.connect("open-standard")
    analyser.compensate("open")
    bench.connect("short-standard")
    analyser.compensate("short")
    sweeps = []
    for termination in TERMINATIONS:
        bench.connect(termination)
        sweeps += [analyser.sweep(termination) for _ in range(3)]
    assert me.fit(me.dc_motor(), sweeps, seed=1).chi2_reduced < 1.5


def test_metadata_tell_how_much_lies_beyond_the_limits(bench: SimulatedBench, analyser: NanoVna) -> None:
    bench.connect("short")
    far = analyser.sweep("short")
    magnitude = np.abs(far.impedance_ohm)
    # 0.5 % of S11 is 10 % of Z outside 1.3 Ohm to 1.9 kOhm: the roots of (z + 50)^2 = 2000 z.
    beyond = np.count_nonzero((magnitude < 1.316) | (magnitude > 1898.7))
    assert far.metadata["points_beyond_10_percent"] == beyond


def test_compensation_at_other_frequencies_is_refused(bench: SimulatedBench, analyser: NanoVna) -> None:
    bench.connect("open-standard")
    analyser.compensate("open")
    analyser.configure(150e3, 29e6, 101)
    with pytest.raises(InstrumentError, match="compensate again"):
        analyser.sweep("open")


def test_data_are_refused_before_the_sweep_is_complete(analyser: NanoVna) -> None:
    analyser.trigger()
    with pytest.raises(InstrumentError, match="not complete"):
        analyser.read_impedance()


@pytest.mark.parametrize("spacing", ["log", "linear"])
@pytest.mark.parametrize("points", [2, 3, 51, 101, 102, 401, 1601])
@pytest.mark.parametrize("band", [(150_000, 30_000_000), (50_000, 60_000_000), (1_000_000, 1_500_000)])
def test_pieces_make_one_sweep(spacing: Any, points: int, band: tuple[int, int]) -> None:
    made = pieces(*band, points, spacing, 101)
    assert all(2 <= count <= 101 or count == 1 for _, _, count in made)
    axis = np.concatenate([np.linspace(first, last, count) for first, last, count in made])
    assert axis.size == points
    assert (axis[0], axis[-1]) == band
    assert np.all(np.diff(axis) > 0)
    ideal = np.geomspace(*band, points) if spacing == "log" else np.linspace(*band, points)
    # Within an octave a linear scan strays from a logarithmic one by 6.1 % of the frequency; a piece is an octave to the nearest point.
    assert np.max(np.abs(axis / ideal - 1)) < 0.08


def test_reflection_and_fixture_are_undone_exactly() -> None:
    motor = np.array([3 + 4j, 50 + 0j, 1000 - 2000j])
    gamma = (motor - 50) / (motor + 50)
    np.testing.assert_allclose(impedance_from_reflection(gamma, 50.0), motor, rtol=1e-12)
    series, shunt = 0.1 + 2j, 1e-5 + 3e-4j
    raw = series + motor / (1 + motor * shunt)
    open_, short = np.full(3, series + 1 / shunt), np.full(3, series)
    np.testing.assert_allclose(without_fixture(raw, open_, short), motor, rtol=1e-12)
    assert np.isfinite(impedance_from_reflection(np.array([1 + 0j]), 50.0)).all()


def exchanges(*pairs: tuple[str, str]) -> list[dict[str, str]]:
    """What the firmware does with each line: echo, answer, prompt; the space of the prompt comes with the next echo."""
    records = []
    for command, answer in pairs:
        records += [{"direction": "write", "text": command + "\r"}, {"direction": "read", "text": f" {command}\r\n{answer}ch>"}]
    return records


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ("frequency range is invalid\r\n", "was refused: frequency range is invalid"),
        ("150000 0.5 0.1 \r\n", "1 lines in answer to .*, expected 2 of 3 numbers each"),
        ("150000 0.5 0.1 \r\n160000 0.5 nan \r\n", "expected 2 of 3 numbers"),
        ("150000 0.5 0.1 \r\n160000 0.5 0,1 \r\n", "is no list of 3 numbers"),
        ("scan?\r\n", "was refused: scan\\?"),
    ],
)
def test_scans_that_are_none(answer: str, message: str) -> None:
    transport = ReplayTransport("SCRIPT", exchanges(("scan 150000 160000 2 3", answer)))
    analyser = NanoVna(transport)
    with pytest.raises(InstrumentError, match=message):
        analyser.rows((150_000, 160_000, 2), 3, 3)


@pytest.mark.parametrize("first_hz", [155_000, 150_002, 75_000])
def test_a_scan_of_other_frequencies_is_refused(first_hz: int) -> None:
    """A firmware that measures something else, or prints an earlier scan again."""
    rows = "".join(f"{first_hz + step} 0.5 0.1 \r\n" for step in (0, 5_000, 10_000))
    analyser = NanoVna(ReplayTransport("SCRIPT", exchanges(("scan 150000 160000 3 3", rows))))
    with pytest.raises(InstrumentError, match="measured other frequencies than asked for"):
        analyser.rows((150_000, 160_000, 3), analyser.AXIS_AND_S11, 3)


def test_frequencies_may_be_rounded_to_whole_hertz() -> None:
    rows = "150000 0.5 0.1 \r\n153333 0.5 0.1 \r\n156667 0.5 0.1 \r\n160000 0.5 0.1 \r\n"
    analyser = NanoVna(ReplayTransport("SCRIPT", exchanges(("scan 150000 160000 4 3", rows))))
    rows = analyser.rows((150_000, 160_000, 4), analyser.AXIS_AND_S11, 3)
    np.testing.assert_array_equal(rows[:, 1:], np.full((4, 2), (0.5, 0.1)))


def test_an_echo_that_is_another_one_is_a_bad_link() -> None:
    records = [{"direction": "write", "text": "pause\r"}, {"direction": "read", "text": "puse\r\nch>"}]
    with pytest.raises(InstrumentError, match="'pause' was echoed as 'puse'; the link loses characters"):
        NanoVna(ReplayTransport("SCRIPT", records)).tell("pause")


def test_a_tinysa_is_not_taken_for_a_nanovna() -> None:
    records = [
        {"direction": "clear"},
        *exchanges(("", ""), ("version", "tinySA_v1.4-175\r\n"), ("info", "tinySA v0.3\r\n2019-2024 Copyright @Erik Kaashoek\r\n")),
    ]
    with pytest.raises(InstrumentError, match=r"expected a NanoVNA.*, but 'tinySA v0.3' answers"):
        NanoVna(ReplayTransport("SCRIPT", records)).identify()


def test_the_shell_echoes_answers_and_prompts(shell: SimulatedNanoVna) -> None:
    assert say(shell, "version\r") == "version\r\n1.2.40\r\nch> "
    assert say(shell, "\r") == "\r\nch> "
    assert say(shell, "versiom\x08n\r\n") == "versiomn\r\n1.2.40\r\nch> "
    assert say(shell, "wobble 1\r") == "wobble 1\r\nwobble?\r\nch> "
    assert say(shell, "x" * 60 + "\r") == "x" * 47 + "\r\n" + "x" * 47 + "?\r\nch> "


def test_the_shell_takes_prefixed_numbers_and_prints_nine_decimals(shell: SimulatedNanoVna) -> None:
    rows = say(shell, "scan 150000 30000000 0x3 0b111\r").splitlines()[1:-1]
    assert [int(row.split()[0]) for row in rows] == [150000, 15075000, 30000000]
    assert all(len(number.rpartition(".")[2]) == 9 for row in rows for number in row.split()[1:])
    assert say(shell, "scan 150000 30000000 402\r").splitlines()[1] == "sweep points exceeds range 401"
    assert say(shell, "scan 30000000 150000\r").splitlines()[1] == "frequency range is invalid"
    assert say(shell, "scan 150000 30000000 5\r") == "scan 150000 30000000 5\r\nch> "
    assert len(say(shell, "data 0\r").splitlines()) == 7


def test_binary_scans_hold_the_same_numbers(shell: SimulatedNanoVna) -> None:
    printed = say(shell, "scan 150000 30000000 5 1\r").splitlines()[1:-1]
    shell.write(b"scan_bin 150000 30000000 5 3\r")
    answer = shell.take_answers()
    payload = answer.removeprefix(b"scan_bin 150000 30000000 5 3\r\n").removesuffix(b"ch> ")
    header = np.frombuffer(payload[:4], "<u2")
    points = np.frombuffer(payload[4:], np.dtype([("hertz", "<u4"), ("re", "<f4"), ("im", "<f4")]))
    assert header.tolist() == [0x83, 5]
    assert points["hertz"].tolist() == [int(row) for row in printed]
    assert np.all(np.hypot(points["re"], points["im"]) < 1.1)


def test_edges_of_the_sweep_follow_the_firmware(shell: SimulatedNanoVna) -> None:
    assert say(shell, "sweep\r").splitlines()[1] == "50000 900000000 101"
    say(shell, "sweep 1000000 2000000 51\r")
    assert say(shell, "sweep\r").splitlines()[1] == "1000000 2000000 51"
    say(shell, "sweep start 3000000\r")
    assert say(shell, "sweep\r").splitlines()[1] == "3000000 3000000 51"
    say(shell, "sweep center 5000000\r")
    say(shell, "sweep span 2000000\r")
    assert say(shell, "sweep\r").splitlines()[1] == "4000000 6000000 51"
    assert say(shell, "sweep 1 2 3 4\r").splitlines()[1].startswith("usage: sweep")
    assert say(shell, "bandwidth 39\r").splitlines()[1] == "bandwidth 39 (100Hz)"


def test_a_scan_takes_time_on_the_clock(bench: SimulatedBench, shell: SimulatedNanoVna) -> None:
    before = bench.clock.now()
    say(shell, "scan 150000 30000000 101 3\r")
    fast = bench.clock.now() - before
    say(shell, "bandwidth 39\r")
    before = bench.clock.now()
    say(shell, "scan 150000 30000000 101 3\r")
    assert bench.clock.now() - before > 5 * fast


def test_the_same_shell_behind_a_genuine_resource(bench: SimulatedBench, analyser: NanoVna) -> None:
    assert bench.resources["analyser"] == "ASRL1::INSTR"
    link = open_transport(bench.resource_manager, "ASRL1::INSTR", clock=bench.clock)
    assert link.stream
    analyser.safe()
    link.close()
