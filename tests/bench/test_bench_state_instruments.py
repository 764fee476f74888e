"""What reads and feeds the motor: the stand's physics, the simulated instruments under other people's programs, lines on a real serial link."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fault_matrix import BENCH_FILE, SEED, small
from pymeasure.instruments.agilent import Agilent34410A
from pymeasure.instruments.keysight import KeysightE36312A
from pymeasure.instruments.rohdeschwarz.hmp import HMP4040
from serving import served

from motoremi.arrays import JsonDict
from motoremi.bench.clock import VirtualClock
from motoremi.bench.connect import driver_class, open_manager, open_transport
from motoremi.bench.meter import Meter
from motoremi.bench.supply import Supply
from motoremi.data.session import SessionWriter, load
from motoremi.data.state import marks_of, state_line
from motoremi.errors import BadInput, InstrumentError
from motoremi.report.gaps import of_the_run
from motoremi.report.motor_state_section import state_section
from motoremi.run.runner import run, start_document
from motoremi.schema.text_lines import Lines
from motoremi.simulate.stand import AMBIENT_DEGC, MotorStand
from motoremi.virtual.simulated_bench import SimulatedBench


def test_the_motor_follows_its_supply_in_time() -> None:
    clock = VirtualClock()
    stand = MotorStand(clock.now)
    assert (stand.voltage_volt, stand.current_ampere, stand.speed_rpm, stand.temperature_degc) == (0.0, 0.0, 0.0, AMBIENT_DEGC)
    stand.drive(12.0, 2.0)
    # At first the supply limits the current, and the voltage is what that makes of the winding.
    assert stand.limited
    assert stand.voltage_volt == pytest.approx(1.6)
    clock.sleep(20)
    assert not stand.limited
    assert stand.speed_rpm == pytest.approx(3180.5, rel=1e-3)
    assert stand.current_ampere == pytest.approx(0.4286, rel=1e-3)
    cold = stand.temperature_degc
    clock.sleep(300)
    # One time constant: 63 % of what is left of a rise of 23.1 K.
    assert stand.temperature_degc - cold == pytest.approx(0.632 * (46.14 - cold), rel=0.02)
    clock.sleep(36000)
    assert stand.temperature_degc == pytest.approx(46.1, abs=0.1)
    stand.drive(6.0, 2.0)
    clock.sleep(20)
    assert stand.speed_rpm == pytest.approx(1543.5, rel=1e-2)
    stand.release()
    clock.sleep(36000)
    assert stand.speed_rpm == 0.0
    assert stand.temperature_degc == pytest.approx(AMBIENT_DEGC, abs=0.01)


def test_pymeasure_drives_an_e36300() -> None:
    with served("e36300") as (server, bench):
        client = KeysightE36312A(server.resource, visa_library="@py", read_termination="\n", write_termination="\n")
        assert client.id.split(",")[1] == "E36313A"
        client.ch_2.voltage_setpoint = 12
        client.ch_2.current_limit = 1
        assert (client.ch_2.voltage_setpoint, client.ch_2.current_limit) == (12, 1)
        assert client.ch_2.output_enabled is False
        client.ch_2.output_enabled = True
        assert client.ch_2.output_enabled is True
        assert bench.stand.driven
        bench.clock.sleep(20)
        assert client.ch_2.voltage == pytest.approx(12, rel=1e-3)
        assert client.ch_2.current == pytest.approx(0.43, rel=0.05)
        client.ch_2.output_enabled = False
        assert client.ch_2.output_enabled is False
        assert not bench.stand.driven
        assert client.check_errors() == []
        client.adapter.close()


def test_pymeasure_drives_an_hmp() -> None:
    with served("hmp4000") as (server, bench):
        client = HMP4040(server.resource, visa_library="@py", read_termination="\n", write_termination="\n")
        client.selected_channel = 3
        assert client.selected_channel == 3
        client.voltage = 12
        client.current = 5
        assert (client.voltage, client.current) == (12, 5)
        client.set_channel_state(3, True)
        assert client.selected_channel_active is True
        assert not bench.stand.driven
        client.output_enabled = True
        assert client.output_enabled is True
        assert bench.stand.driven
        bench.clock.sleep(20)
        assert client.measured_voltage == pytest.approx(12, rel=1e-3)
        assert client.measured_current == pytest.approx(0.43, rel=0.05)
        client.output_enabled = False
        assert client.output_enabled is False
        assert not bench.stand.driven
        client.adapter.close()


def test_pymeasure_reads_a_multimeter() -> None:
    with served("34461a") as (server, bench):
        bench.clock.sleep(20)
        client = Agilent34410A(server.resource, visa_library="@py", read_termination="\n", write_termination="\n")
        assert client.voltage_dc == pytest.approx(12, rel=1e-3)
        assert client.current_dc == pytest.approx(0.43, rel=0.05)
        client.adapter.close()


@pytest.mark.slow
@pytest.mark.parametrize("over", ["tcp", "pty"])
@pytest.mark.parametrize(("name", "channel"), [("e36300", 2), ("hmp4000", 4)])
def test_a_supply_is_set_limited_and_made_safe_over_a_real_link(name: str, channel: int, over: str) -> None:
    manager = open_manager("@py")
    with served(name, over) as (server, bench):
        supply = driver_class(name)(open_transport(manager, server.resource))
        assert isinstance(supply, Supply)
        supply.use({"supply": {"channel": channel}})
        supply.identify()
        supply.reset()
        supply.set_limits(12.0, 0.2)
        supply.switch_on()
        bench.clock.sleep(20)
        assert supply.regulation() == "the supply is in current limit (constant current): 0.16 V at 0.2 A instead of 12 V"
        supply.set_limits(12.0, 1.5)
        bench.clock.sleep(20)
        assert supply.regulation() == ""
        assert supply.read_quantity("voltage_volt") == pytest.approx(12, rel=1e-3)
        # Somebody turns the knob.
        bench.stand.release()
        supply.transport.write(*(["VOLT 5,(@2)"] if name == "e36300" else ["VOLT 5"]))
        with pytest.raises(InstrumentError, match=r"voltage_volt was set to 12.0, but the supply reports 5.0"):
            supply.refuse_changed()
        supply.safe()
        assert not supply.is_on()
        supply.close()
    manager.close()


@contextmanager
def talking(data: bytes) -> Iterator[str]:
    """A serial port on which these bytes come again and again, as fast as they are read."""
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    tty.setraw(master)
    stop = threading.Event()

    def talk() -> None:
        os.set_blocking(master, False)
        while not stop.wait(0.01):
            try:
                os.write(master, data)
            except BlockingIOError:
                continue

    thread = threading.Thread(target=talk, daemon=True)
    thread.start()
    try:
        yield f"ASRL{os.ttyname(slave)}::INSTR"
    finally:
        stop.set()
        thread.join(5.0)
        os.close(master)
        os.close(slave)


LINES = {"example": "n=  812.5 rpm", "pattern": r"n=\s*([\d.]+) rpm", "unit": "rpm", "baud": 19200}
TACHOMETER = {"tachometer": {"lines": LINES}}


def line_reader(resource: str, manager: object) -> Meter:
    reader = driver_class("line-reader")(open_transport(manager, resource))  # type: ignore[arg-type]
    assert isinstance(reader, Meter)
    reader.use(TACHOMETER)
    return reader


def test_an_instrument_that_talks_by_itself_is_read_on_a_serial_line() -> None:
    manager = open_manager("@py")
    with talking(b"n= 3012.5 rpm\r\n") as resource:
        reader = line_reader(resource, manager)
        assert reader.identify().model == "line reader"
        assert [reader.read_quantity("speed_rpm") for _ in range(3)] == [3012.5] * 3
        reader.safe()
        reader.close()
    manager.close()


def test_text_without_an_end_is_one_line_and_soon() -> None:
    manager = open_manager("@py")
    with talking(b"x" * 64) as resource:
        reader = line_reader(resource, manager)
        reader.LONGEST_WAIT_S = 0.3  # type: ignore[misc]
        with pytest.raises(InstrumentError, match=r"no line came within 0.3 s; check plug, power and baud rate \(19200\)"):
            reader.read_quantity("speed_rpm")
        reader.close()
    manager.close()


def test_a_simulated_reader_is_asked_over_a_serial_line() -> None:
    manager = open_manager("@py")
    with served("line-reader", "pty") as (server, bench):
        bench.clock.sleep(20)
        reader = driver_class("line-reader")(open_transport(manager, server.resource))
        assert isinstance(reader, Meter)
        lines = {"example": "n=3000.0 T=23.0", "unit": "rpm", "pattern": r"n=([\d.]+) T=[\d.]+", "ask": "?"}
        reader.use({"tachometer": {"lines": lines}, "thermometer": {"lines": {**lines, "unit": "degC", "pattern": r"n=[\d.]+ T=([\d.]+)"}}})
        assert reader.read_quantity("speed_rpm") == pytest.approx(3180.5, rel=1e-3)
        assert reader.read_quantity("temperature_degc") == pytest.approx(23, abs=3)
        reader.close()
    manager.close()


@pytest.mark.parametrize(
    ("keys", "line", "value"),
    [
        ({"example": "1;2;3", "field": 2, "separator": ";", "unit": "rpm"}, "7;50;9", 50.0),
        ({"example": "1 2", "field": 1, "unit": "Hz"}, "50.0 x", 3000.0),
        ({"example": "1 2", "field": 1, "unit": "Hz", "scale": 0.5}, "100 x", 3000.0),
        ({"example": "T=23,5C", "pattern": r"T=([-\d,]+)C", "unit": "degC"}, "T=-4,5C", -4.5),
        ({"example": "300 K", "field": 1, "unit": "K"}, "300 K", 26.85),
        ({"example": "68 F", "field": 1, "unit": "degF"}, "212 F", 100.0),
        ({"example": "1500 mA", "field": 1, "unit": "mA"}, "250 mA", 0.25),
        # Cut, not a number, too long, of another kind.
        ({"example": "1;2;3", "field": 2, "separator": ";", "unit": "rpm"}, "7;50", None),
        ({"example": "1 2", "field": 1, "unit": "rpm"}, "nan 2", None),
        ({"example": "1 2", "field": 1, "unit": "rpm"}, "inf 2", None),
        ({"example": "1 2", "field": 1, "unit": "rpm"}, "---- 2", None),
        ({"example": "1 2", "field": 1, "unit": "rpm"}, "1 " + "2" * 200, None),
        ({"example": "n=1 rpm", "pattern": r"n=([\d.]+) rpm", "unit": "rpm"}, "n=30", None),
        # Another unit, another sensor, another key; a time of day is neither.
        ({"example": "T= 23.5 C", "field": 2, "unit": "degC"}, "T= 24.5 C", 24.5),
        ({"example": "T= 23.5 C", "field": 2, "unit": "degC"}, "T= 74.3 F", None),
        ({"example": "T1 23.5", "field": 2, "unit": "degC"}, "T2 24.5", None),
        ({"example": "23.5; C", "field": 1, "separator": ";", "unit": "degC"}, "24.5;C", 24.5),
        ({"example": "09:15:00 23.5 C", "field": 2, "unit": "degC"}, "17:03:21 24.5 C", 24.5),
        ({"example": "23.5 950", "field": 1, "unit": "degC"}, "24.5 ----", 24.5),
        # Nothing was measured.
        ({"example": "2.35000000E+01", "field": 1, "unit": "degC"}, "9.90000000E+37", None),
        ({"example": "2.35000000E+01", "field": 1, "unit": "degC"}, "-9.90000000E+37", None),
        ({"example": "2.35000000E+01", "field": 1, "unit": "degC"}, "9.91E37", None),
        # Signs of thousands, and characters that Python takes for digits.
        ({"example": "950 rpm", "field": 1, "unit": "rpm"}, "3,012 rpm", None),
        ({"example": "950 rpm", "field": 1, "unit": "rpm"}, "3012 rpm", 3012.0),
        ({"example": "950 rpm", "field": 1, "unit": "rpm"}, "3_012 rpm", None),
        ({"example": "950 rpm", "field": 1, "unit": "rpm"}, "\u0663012 rpm", None),
        ({"example": "23,5 C", "field": 1, "unit": "degC"}, "1.234 C", None),
        ({"example": "23,5 C", "field": 1, "unit": "degC"}, "1234 C", 1234.0),
        ({"example": "n=950 rpm", "pattern": r"n=([\d.,]+) rpm", "unit": "rpm"}, "n=3,012 rpm", None),
    ],
)
def test_what_a_line_says(keys: dict[str, object], line: str, value: float | None) -> None:
    lines = Lines.model_validate(keys)
    assert lines.value(line) == (None if value is None else pytest.approx(value))
    if value is not None:
        assert lines.value(lines.written(line, value)) == pytest.approx(value, rel=0.02)


def test_a_slow_pattern_is_refused_and_a_hostile_line_is_not_slow() -> None:
    for pattern in (r"(?:a|a)*(\d)", r"(.*.*.*.*)", r"(?:\d{1,}){2}(x)"):
        with pytest.raises(ValueError, match="repeat no group"):
            Lines.model_validate({"example": "1", "pattern": pattern, "unit": "rpm"})
    lines = Lines.model_validate({"example": "x1", "pattern": r".*x.*?(\d+)", "unit": "rpm"})
    assert lines.value("x" * 119 + "!") is None


def test_a_reader_without_lines_is_refused() -> None:
    bench = SimulatedBench(1)
    with pytest.raises(BadInput, match="tachometer: a line reader needs 'lines'"):
        bench.open("tachometer", "line-reader", "x", lambda record: None, {"tachometer": {}})
    bench.close()


def test_the_report_shows_the_state_and_what_is_marked(tmp_path: Path) -> None:
    bench = SimulatedBench(SEED)
    tachometer = small("emission_warm_motor").instruments["tachometer"]
    bench.open("tachometer", tachometer.driver, "x", lambda record: None, {"tachometer": tachometer.options}).close()

    def unplug(document: JsonDict) -> None:
        if document.get("file") == "spectra/peak-1.csv":
            bench.devices["tachometer"].take_answers = lambda: b""  # type: ignore[method-assign]

    writer = SessionWriter.create(tmp_path / "s", start_document(small("emission_warm_motor"), BENCH_FILE))
    writer.subscribe(unplug)
    run(small("emission_warm_motor"), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    bench.close()
    session = load(tmp_path / "s")
    marks = marks_of({"outside": ["speed 1 rpm: x"], "missing": {"temperature_degc": "no line"}})
    assert marks == ["speed 1 rpm: x", "temperature not read: no line"]
    assert marks_of("nonsense") == []
    assert state_line({"speed_rpm": float("nan"), "voltage_volt": "x"}) == ""
    section = state_section(session)
    assert section is not None
    rows = section.tables[0].rows
    assert [row[0] for row in rows] == ["spectra/average-motor-off-1.csv", "spectra/peak-1.csv", "spectra/average-1.csv"]
    assert rows[1][1].startswith("12 V, 0.4286 A, 318")
    assert rows[1][4] == "-"
    assert rows[2][4].startswith("speed not read: ASRL3::INSTR: no line came within 3 s")
    assert section.tables[0].marked == {2}
    assert "speed: tachometer: line reader at ASRL3::INSTR" in section.texts[0]
    assert [gap for gap in of_the_run(session) if gap.startswith("spectra/average-1.csv: speed not read")]
