"""The NanoVNA V2 driver on its simulated instrument, and the calibration that the computer does for it."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
import skrf
from fault_matrix import small
from skrf.calibration import OnePort

import motoremi as me
from motoremi.bench.impedance_analyser import ImpedanceAnalyser
from motoremi.bench.motor_connections import STANDARDS
from motoremi.bench.reflection import calibrated, impedance_from_reflection
from motoremi.bench.registers import encoded
from motoremi.bench.replay import ReplayTransport
from motoremi.bench.traffic import decode_bytes, encode_bytes
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.nanovna_v2 import NanoVnaV2
from motoremi.schema.procedure import parse_procedure
from motoremi.virtual.faults import FaultLayer
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_nanovna_v2 import REGISTERS, SimulatedNanoVnaV2

LOAD_OHM = 100.0


@pytest.fixture
def analyser(bench: SimulatedBench) -> NanoVnaV2:
    driver = bench.open("analyser", "nanovna-v2", "whatever", lambda record: None)
    assert isinstance(driver, NanoVnaV2)
    driver.identify()
    driver.reset()
    driver.configure(150e3, 30e6, 41)
    return driver


def device_of(bench: SimulatedBench) -> SimulatedNanoVnaV2:
    device = bench.devices["analyser"]
    assert isinstance(device, SimulatedNanoVnaV2)
    return device


def calibrate(bench: SimulatedBench, analyser: ImpedanceAnalyser) -> None:
    for standard in ("open", "short", "load"):
        bench.connect(STANDARDS[standard])
        if standard == "load":
            analyser.define_load(LOAD_OHM, 0.0)
        analyser.compensate(standard)


def test_commands_are_the_bytes_of_the_firmware_s_table() -> None:
    assert encoded("write8 0x00 150000") == bytes.fromhex("2300f049020000000000")
    assert encoded("write2 0x20 201") == bytes.fromhex("2120c900")
    assert encoded("write1 0x30 0") == bytes.fromhex("203000")
    assert encoded("read4 0x10") == bytes.fromhex("1210")
    assert encoded("fifo 0x30 101") == bytes.fromhex("183065")


def test_identity(analyser: NanoVnaV2) -> None:
    identity = analyser.identify()
    assert (identity.vendor, identity.model, identity.firmware) == ("NanoVNA", "NanoVNA V2, board 2", "1.3")
    assert identity.serial == "5103fd4233384d4300000011"


@pytest.mark.parametrize(
    ("register", "value", "message"),
    [
        ("firmware_major", 0xFF, "waits for a firmware update; switch it off and on"),
        ("variant", 3, "variant 3 with protocol 1 answers; check the resource or choose another driver"),
        ("protocol", 2, "variant 2 with protocol 2 answers"),
    ],
)
def test_another_instrument_is_refused(bench: SimulatedBench, analyser: NanoVnaV2, register: str, value: int, message: str) -> None:
    device_of(bench).registers[REGISTERS[register][0]] = value
    with pytest.raises(InstrumentError, match=message):
        analyser.identify()


def test_a_litevna_is_told_by_its_firmware(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    device_of(bench).registers[REGISTERS["firmware_major"][0]] = 2
    assert analyser.identify().model == "LiteVNA, board 2"


def test_an_instrument_left_in_the_middle_of_its_data_is_found_again(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    device = device_of(bench)
    device.write(encoded("fifo 0x30 11") + encoded("write8 0x00 5")[:4])
    assert analyser.identify().firmware == "1.3"


def test_what_speaks_another_language_is_refused(bench: SimulatedBench, analyser: NanoVnaV2, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_of(bench), "respond", lambda query: b"?")
    with pytest.raises(InstrumentError, match="does not answer 'indicate' with '2'; choose another driver"):
        analyser.reset()


def test_settings_are_what_the_registers_hold(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    # A LiteVNA that another program has told to send data that it has calibrated.
    device_of(bench).registers[REGISTERS["data_mode"][0]] = 3
    assert analyser.configure(200e3, 20e6, 51, "linear", 5) == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "points": 51,
        "spacing": "linear",
        "sweeps_averaged": 8,
        "data_mode": 0,
        "values_per_frequency": 1,
    }
    # 19.8 MHz in 52 steps are no whole hertz: 380769 Hz each.
    assert analyser.configure(200e3, 20e6, 53, "linear")["stop_hz"] == 200e3 + 52 * 380769


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_hz": 10e3}, "start_hz = 10 kHz is outside the range 50 kHz to 300 MHz"),
        ({"stop_hz": 400e6}, "stop_hz = 400 MHz"),
        ({"points": 1}, "points = 1 is outside the range 2 to 1601"),
        ({"bandwidth_factor": 6}, "bandwidth_factor = 6 is outside the range 1 to 5"),
    ],
)
def test_settings_out_of_range_are_refused(analyser: NanoVnaV2, change: dict[str, float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        analyser.configure(**{"start_hz": 150e3, "stop_hz": 30e6, "points": 51, **change})  # type: ignore[arg-type]


@pytest.mark.parametrize("spacing", ["log", "linear"])
@pytest.mark.parametrize("points", [2, 51, 256, 1601])
def test_the_axis_is_that_of_the_registers(analyser: NanoVnaV2, spacing: Any, points: int) -> None:
    analyser.configure(150e3, 30e6, points, spacing)
    axis = analyser.read_axis()
    assert axis.size == points
    assert np.all(np.diff(axis) > 0)
    assert axis[0] == 150e3
    assert 30e6 - 254 <= axis[-1] <= 30e6
    assert np.array_equal(axis, axis.round())


def test_a_sweep_without_calibration_is_refused(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    with pytest.raises(
        InstrumentError, match=r"sends raw data; compensate with open, short and load before a sweep \(missing: load, open, short\)"
    ):
        analyser.sweep("open")
    for standard in ("open", "short"):
        bench.connect(STANDARDS[standard])  # type: ignore[index]
        analyser.compensate(standard)  # type: ignore[arg-type]
    bench.connect("open")
    with pytest.raises(InstrumentError, match=r"\(missing: load\)"):
        analyser.sweep("open")


def test_a_calibration_at_other_frequencies_is_refused(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    calibrate(bench, analyser)
    analyser.configure(150e3, 29e6, 41)
    with pytest.raises(InstrumentError, match="compensate again"):
        analyser.sweep("open")


@pytest.mark.parametrize("termination", TERMINATIONS)
@pytest.mark.parametrize("spacing", ["log", "linear"])
def test_a_calibrated_sweep_is_the_motor(bench: SimulatedBench, analyser: NanoVnaV2, termination: Any, spacing: Any) -> None:
    analyser.configure(150e3, 30e6, 41, spacing)
    calibrate(bench, analyser)
    bench.connect(termination)
    sweep = analyser.sweep(termination)
    assert sweep.metadata["analyser"] == "nanovna"
    assert sweep.metadata["compensated"] == ["load", "open", "short"]
    assert sweep.metadata["reference_plane"] == "fixture"
    truth = bench.motor.impedance(termination, sweep.frequency_hz)
    error = np.abs(sweep.impedance_ohm / truth - 1)
    usable = (np.abs(truth) > 5) & (np.abs(truth) < 500)
    # Noise of 3e-4 of S11 from three sweeps is 0.4 % of Z between 5 and 500 Ohm at most; the two sweeps that settle are off by 2 %.
    assert np.max(error[usable]) < 0.01
    # Only noise is left: the fixture is within the plane of calibration, so the analysis takes none into account.
    assert Measurement.of([sweep]).analyser.fixture is None


@pytest.mark.slow
def test_a_motor_without_effects_is_fitted_to_the_noise(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    analyser.configure(150e3, 30e6, 101, "log", 4)
    calibrate(bench, analyser)
    sweeps = []
    for termination in TERMINATIONS:
        bench.connect(termination)
        sweeps += [analyser.sweep(termination) for _ in range(3)]
    assert me.fit(me.dc_motor(), sweeps, seed=1).chi2_reduced < 1.5


def test_the_correction_is_that_of_scikit_rf() -> None:
    rng = np.random.default_rng(3)
    points = 31
    e00, e11, e01 = (size * rng.standard_normal((2, points)).T @ np.array([1.0, 1j]) for size in (0.1, 0.1, 0.2))
    frequency = skrf.Frequency(0.15, 30, points, unit="MHz")
    load = (LOAD_OHM - 50) / (LOAD_OHM + 50)

    def seen(true: Any) -> Any:
        return e00 + (1 + e01) * true / (1 - e11 * true)

    def network(values: Any) -> skrf.Network:
        return skrf.Network(frequency=frequency, s=np.broadcast_to(values, points).astype(complex).copy(), z0=50)

    motor = rng.uniform(-0.9, 0.9, points) * np.exp(1j * rng.uniform(-3, 3, points))
    known: dict[Any, complex] = {"open": 1.0, "short": -1.0, "load": load}
    other = OnePort(ideals=[network(true) for true in known.values()], measured=[network(seen(true)) for true in known.values()])
    ours = calibrated(seen(motor), {name: seen(true) for name, true in known.items()}, known)
    np.testing.assert_allclose(ours, other.apply_cal(network(seen(motor))).s[:, 0, 0], rtol=1e-9)
    np.testing.assert_allclose(ours, motor, rtol=1e-9)
    np.testing.assert_allclose(impedance_from_reflection(ours, 50.0), 50 * (1 + motor) / (1 - motor), rtol=1e-9)


def test_a_standard_that_was_not_connected_is_told(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    bench.connect("open-standard")
    analyser.compensate("open")
    analyser.compensate("short")
    bench.connect("load-standard")
    analyser.compensate("load")
    bench.connect("open")
    with pytest.raises(InstrumentError, match="the open and the short standard read alike; was each of them connected"):
        analyser.sweep("open")


def test_the_value_of_the_load_counts(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    calibrate(bench, analyser)
    bench.connect("load-standard")
    np.testing.assert_allclose(analyser.sweep("open").impedance_ohm, LOAD_OHM, rtol=0.005)
    analyser.define_load(LOAD_OHM, 100e-9)
    sweep = analyser.sweep("open")
    np.testing.assert_allclose(sweep.impedance_ohm, LOAD_OHM + 2j * np.pi * sweep.frequency_hz * 100e-9, rtol=0.005)


def test_a_procedure_without_its_standards_is_refused_before_anything_is_connected() -> None:
    source = copy.deepcopy(small("impedance_only").source)
    source["instruments"]["analyser"]["driver"] = "nanovna-v2"
    message = "the nanovna-v2 measures only after steps that compensate with load, open, short: load missing"
    with pytest.raises(BadInput, match=message):
        parse_procedure(source, "raw")
    source["steps"].insert(1, {"do": "compensate", "standard": "load", "nominal": "50 Ohm"})
    assert parse_procedure(source, "calibrated").instruments["analyser"].driver == "nanovna-v2"


def test_lost_values_are_told(bench: SimulatedBench, analyser: NanoVnaV2, monkeypatch: pytest.MonkeyPatch) -> None:
    device = device_of(bench)
    values = device.fifo_values
    monkeypatch.setattr(device, "fifo_values", lambda count: values(count + 1)[:64] + values(count + 1)[96:][: (count - 2) * 32])
    with pytest.raises(InstrumentError, match="is incomplete; values were lost on the link, measure again"):
        analyser.compensate("open")


def test_a_restart_before_the_values_are_read_is_told(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    """The registers are at their defaults then, and 101 values of other frequencies look as good as those asked for."""
    analyser.configure(150e3, 30e6, 101, "linear")
    layer = FaultLayer(device_of(bench), "restart", 4)
    with pytest.raises(InstrumentError, match=r"points were set to .*, but the registers hold .*; did it restart"):
        analyser.scan()
    assert layer.occurred


def test_the_instrument_gets_its_screen_back(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    analyser.safe()
    assert device_of(bench).register("data_mode") == 2


def test_values_that_do_not_come_are_told(bench: SimulatedBench, analyser: NanoVnaV2) -> None:
    FaultLayer(device_of(bench), "truncated", 5)
    with pytest.raises(InstrumentError, match=r"ASRL3::INSTR: gave no whole answer to 'fifo 0x30 \d+' within"):
        analyser.scan()


def test_raw_bytes_are_recorded_and_play_back(bench: SimulatedBench) -> None:
    """Every byte is in the record, and the record alone gives the same S11."""
    records: list[Any] = []
    first = bench.open("analyser", "nanovna-v2", "whatever", records.append)
    assert isinstance(first, NanoVnaV2)
    first.configure(150e3, 30e6, 41)
    measured = first.scan()
    assert any(record["direction"] == "read" and len(decode_bytes(record)) > 500 for record in records)
    replayed = NanoVnaV2(ReplayTransport("RECORD", records))
    replayed.configure(150e3, 30e6, 41)
    np.testing.assert_array_equal(replayed.scan(), measured)
    # A record whose answers were cut is no measurement.
    cut = [{**record, **encode_bytes(decode_bytes(record)[:-1])} if record["direction"] == "read" else record for record in records]
    with pytest.raises(InstrumentError, match="1 bytes in answer to 'read2 0x22', expected 2"):
        NanoVnaV2(ReplayTransport("RECORD", cut)).configure(150e3, 30e6, 41)
