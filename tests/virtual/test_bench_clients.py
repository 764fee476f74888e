"""Simulated instruments under other people's programs, unmodified, over real links."""

from __future__ import annotations

import importlib
import socket
from types import ModuleType

import numpy as np
import pytest
from pymeasure.instruments import Instrument, SCPIMixin
from pymeasure.instruments.agilent import Agilent4294A as PyMeasure4294A
from pymeasure.instruments.agilent import AgilentE4408B
from pymeasure.instruments.rohdeschwarz import FSL
from RsInstrument import RsInstrument, StatusException
from serving import served, started
from skrf import Frequency, Network
from skrf.calibration import OnePort
from skrf.vi.vna.nanovna import NanoVNAv2
from tsapython import tinySA

from motoremi.virtual.simulated_receiver import BAND_B_HZ

pytestmark = pytest.mark.slow


@pytest.fixture
def hardware() -> ModuleType:
    """Of PyNanoVNA, which takes long to import: it draws as well."""
    return importlib.import_module("pynanovna.hardware.Hardware")


def test_pymeasure_reads_a_4294a() -> None:
    with served("4294a") as (server, bench):
        client = PyMeasure4294A(server.resource, visa_library="@py")
        assert client.id.split(",")[1] == "4294A"
        client.start_frequency = 150e3
        client.stop_frequency = 30e6
        client.num_points = 51
        client.title = "motor"
        assert (client.start_frequency, client.stop_frequency, client.num_points) == (150e3, 30e6, 51)
        assert client.title.strip('"') == "motor"
        assert client.measurement_type == "IMPH"
        client.active_trace = "B"
        data = client.get_data()
        assert client.active_trace == "B"
        client.adapter.close()
        truth = bench.motor.impedance("open", data["Frequency"].to_numpy())
    assert data.shape == (51, 5)
    np.testing.assert_allclose(data["Frequency"], np.linspace(150e3, 30e6, 51), rtol=1e-9)
    # Nothing is compensated: the fixture's 4 pF and 15 nH still show, at 10 % or so where the motor has a few ohm.
    measured = data["A Real"] * np.exp(1j * np.radians(data["B Real"]))
    assert np.median(np.abs(measured / truth - 1)) < 0.2
    assert not data[["A Imag", "B Imag"]].to_numpy().any()


@pytest.mark.parametrize(("name", "model"), [("esr", "ESR3"), ("esrp", "ESRP7"), ("esw", "ESW26"), ("esci", "ESCI-3"), ("esu", "ESU-26")])
def test_rsinstrument_scans_with_the_receivers_of_its_maker(name: str, model: str) -> None:
    with served(name) as (server, bench):
        client = RsInstrument(server.resource, True, True, "SelectVisa='socket'")
        assert model in client.idn_string
        client.write_str("SENSe1:SCAN1:STARt 150 kHz")
        client.write_str("SCAN1:STOP 1MHz; SCAN1:STEP 4.5 kHz;:SCAN1:TIME 10 ms")
        assert client.query_float("SENSe:SCAN1:STOP?") == 1e6
        client.write_str("FORMat:DATA ASCii")
        client.write_str_with_opc("INITiate2:IMMediate")
        text = client.query_bin_or_ascii_float_list("TRACe:DATA? TRACE1")
        client.write_str("FORM REAL,32")
        block = client.query_bin_or_ascii_float_list("TRAC? TRACE1")
        assert client.query_all_errors() is None
        with pytest.raises(StatusException, match="-113"):
            client.write_str("NONSENSE 3")
        with pytest.raises(StatusException, match="-222"):
            client.write_str("SCAN1:STOP 99 GHz")
        assert client.self_test()[0] == 0
        client.reset()
        assert client.query_float("SCAN1:STOP?") == 30e6
        client.go_to_local()
        client.close()
        expected = bench.level_dbuv(np.arange(150e3, 1e6, 4.5e3), "peak")
    assert len(text) == len(block) == 189
    np.testing.assert_allclose(text, expected, atol=5e-4)
    np.testing.assert_allclose(block, expected, rtol=1e-6)


def test_rsinstrument_meets_an_esr_as_users_start_one() -> None:
    """At its default speed, which is real time: the first thing that this client sends is an *OPC? while nothing is busy."""
    with started("esr", "--tcp", "0") as (ready, _):
        client = RsInstrument(ready["resource"], True, True, "SelectVisa='socket'")
        client.write_str("SCAN1:STAR 150 kHz;:SCAN1:STOP 159 kHz;:SCAN1:STEP 4.5 kHz;:SCAN1:TIME 100 ms;:FORM ASC")
        client.write_str_with_opc("INIT2")
        assert len(client.query_bin_or_ascii_float_list("TRAC? TRACE1")) == 3
        assert client.query_opc()
        client.close()


def test_pymeasure_sweeps_with_an_esr_as_analyser() -> None:
    with served("esr") as (server, bench):
        # The stand works its spectrum out once, in seconds; a client's deadline is for the instrument.
        bench.level_dbuv(np.linspace(150e3, 30e6, 691), "peak")
        client = FSL(server.resource, visa_library="@py", read_termination="\n", write_termination="\n")
        client.write("INST:SEL SAN")
        client.continuous_sweep_enabled = False
        assert client.continuous_sweep_enabled is False
        client.freq_start = 150e3
        client.freq_stop = "30 MHz"
        client.freq_center = 20e6
        client.freq_span = "4 MHz"
        assert (client.freq_start, client.freq_stop, client.freq_center, client.freq_span) == (18e6, 22e6, 20e6, 4e6)
        client.freq_start = 150e3
        client.freq_stop = "30 MHz"
        client.res_bandwidth = 9e3
        client.attenuation = "20 dB"
        client.sweep_time = "100 ms"
        client.trace_mode = "WRIT"
        assert (client.freq_start, client.freq_stop, client.res_bandwidth) == (150e3, 30e6, 9e3)
        assert (client.attenuation, client.sweep_time, client.trace_mode) == (20.0, 0.1, "WRIT")
        client.single_sweep()
        trace = client.read_trace()
        marker = client.create_marker()
        marker.to_peak()
        peak_hz, peak_dbuv = marker.x, marker.y
        client.adapter.close()
    assert trace.shape == (2, 691)
    highest = int(np.argmax(trace[1]))
    assert peak_hz == pytest.approx(trace[0, highest])
    assert peak_dbuv == pytest.approx(trace[1, highest])


class AnyScpi(SCPIMixin, Instrument):
    """PyMeasure's instrument for whatever speaks SCPI."""


@pytest.mark.parametrize(("name", "model"), [("e4990a", "E4990A"), ("mxe", "N9038A"), ("esr", "ESR3")])
def test_pymeasure_talks_to_whatever_speaks_scpi(name: str, model: str) -> None:
    with served(name) as (server, _):
        client = AnyScpi(server.resource, "any", visa_library="@py", read_termination="\n", write_termination="\n")
        client.reset()
        client.clear()
        assert client.id.split(",")[1] == model
        assert client.complete == "1"
        assert client.status == "0"
        client.write("NONSENSE 3")
        assert [entry[0] for entry in client.check_errors()] == [-113]
        assert client.check_errors() == []
        client.adapter.close()


@pytest.mark.parametrize("name", ["xseries", "rsa"])
def test_pymeasure_sweeps_with_an_analyser_in_the_same_language(name: str) -> None:
    """Its driver for the E4408B, whose commands the X-series took over, and Rigol after it."""
    with served(name) as (server, bench):
        bench.level_dbuv(BAND_B_HZ, "peak")
        client = AgilentE4408B(server.resource, visa_library="@py", read_termination="\n", write_termination="\n")
        client.write(":INST:SEL SA;:INIT:CONT OFF")
        client.start_frequency = 150e3
        client.stop_frequency = 30e6
        client.frequency_points = 601
        client.sweep_time = 0.2
        assert (client.start_frequency, client.stop_frequency, client.frequency_points) == (150e3, 30e6, 601)
        assert client.sweep_time == 0.2
        client.write(":INIT:IMM;*WAI")
        frequency_hz, level_dbm = client.frequencies, client.trace(1)
        assert client.ask(":SYST:ERR?").startswith("0")
        client.adapter.close()
        expected = np.interp(frequency_hz, BAND_B_HZ, bench.level_dbuv(BAND_B_HZ, "peak"))
    np.testing.assert_allclose(level_dbm + 106.9897, expected, atol=1e-3)


def test_pynanovna_reads_a_nanovna(hardware: ModuleType) -> None:
    with served("nanovna", "pty") as (server, bench):
        interface = hardware.Interface("serial", "simulated")
        interface.port = server.path  # type: ignore[attr-defined]
        interface.open()
        client = hardware.get_VNA(interface)
        assert client.name == "NanoVNA-H4"
        assert str(client.read_version()).startswith("1.2.40")
        assert "NanoVNA-H 4" in client.read_firmware()
        client.datapoints = 51
        client.set_bandwidth(1000)
        client.set_sweep(150_000, 30_000_000)
        frequency_hz = np.array(client.read_frequencies(), dtype=float)
        reflection = np.array([complex(*map(float, pair.split())) for pair in client.read_values("data 0")])
        through = client.read_values("data 1")
        interface.close()
        truth = bench.motor.impedance("open", frequency_hz)
    np.testing.assert_allclose(frequency_hz, np.linspace(150e3, 30e6, 51), atol=0.5)
    assert len(through) == 51
    expected = (truth - 50) / (truth + 50)
    # Clips of 8 nH and 2 pF turn S11 by some hundredths at 30 MHz; the rest is below 0.02.
    assert np.max(np.abs(reflection - expected)) < 0.1


def test_scikit_rf_calibrates_a_nanovna_v2() -> None:
    """As its documentation does: raw networks of the standards, ideal ones, and the correction of one port."""
    with served("nanovna-v2", "pty") as (server, bench):
        client = NanoVNAv2(server.resource, backend="@py")
        assert client.id == "2"
        assert "Protocol Version:1" in client.device_info
        # The step is a whole number of hertz then.
        client.frequency = Frequency(150e3, 30e6, 51, unit="Hz")
        client.get_s11_s21()
        client.get_s11_s21()
        raw: dict[str, Network] = {}
        for what in ("open-standard", "short-standard", "load-standard", "short"):
            bench.connect(what)  # type: ignore[arg-type]
            raw[what], through = client.get_s11_s21()
        client._resource.close()
        frequency_hz = raw["short"].f
        truth = bench.motor.impedance("short", frequency_hz)
    np.testing.assert_allclose(frequency_hz, np.linspace(150e3, 30e6, 51), atol=0.5)
    assert not through.s.any()
    ideals = [Network(frequency=raw["short"].frequency, s=np.full(51, gamma, dtype=complex), z0=50) for gamma in (1.0, -1.0, 1 / 3)]
    calibration = OnePort(ideals=ideals, measured=[raw[f"{name}-standard"] for name in ("open", "short", "load")])
    impedance = calibration.apply_cal(raw["short"]).z[:, 0, 0]
    usable = (np.abs(truth) > 5) & (np.abs(truth) < 500)
    # Noise of 3e-4 of S11 in each of four networks is 2 % of Z at 5 and 500 Ohm.
    assert np.median(np.abs(impedance / truth - 1)[usable]) < 0.02
    assert np.median(np.abs(raw["short"].z[:, 0, 0] / truth - 1)[usable]) > 0.05


def test_pynanovna_reads_a_nanovna_v2(hardware: ModuleType) -> None:
    with served("nanovna-v2", "pty") as (server, bench):
        bench.connect("short-standard")
        interface = hardware.Interface("serial", "simulated")
        interface.port = server.path  # type: ignore[attr-defined]
        interface.open()
        client = hardware.get_VNA(interface)
        assert client.name == "NanoVNA-V2"
        assert str(client.read_version()).startswith("1.0.3")
        client.datapoints = 51
        client.set_sweep(150_000, 30_000_000)
        frequency_hz = np.array(client.read_frequencies(), dtype=float)
        reflection = np.array([complex(*map(float, pair.split())) for pair in client.read_values("data 0")])
        interface.close()
    np.testing.assert_allclose(frequency_hz, np.linspace(150e3, 30e6, 51), atol=0.5)
    assert reflection.size == 51
    # A short, raw: directivity, tracking and match of some per cent each, and clips of 8 nH.
    assert 0.02 < np.max(np.abs(reflection + 1)) < 0.6


def test_a_librevna_is_read_in_the_order_of_its_programming_guide() -> None:
    """What the project's own client sends, written anew from the guide over a plain socket: that client may not be distributed here."""
    with served("librevna") as (server, bench), socket.create_connection(("127.0.0.1", server.port), 5) as link:  # type: ignore[attr-defined]
        lines = link.makefile("rw", newline="\n")

        def query(command: str) -> str:
            lines.write(f"{command}\n")
            lines.flush()
            return lines.readline().strip()

        def tell(command: str) -> None:
            lines.write(f"{command}\n")
            assert int(query("*ESR?")) & 0x3C == 0

        assert query("*IDN?").startswith("LibreVNA,LibreVNA-GUI,")
        tell(":DEV:CONN")
        assert query(":DEV:CONN?") != "Not connected"
        for command in (
            ":DEV:MODE VNA", ":VNA:SWEEP FREQUENCY", ":VNA:STIM:LVL -10", ":VNA:ACQ:IFBW 100", ":VNA:ACQ:AVG 1", ":VNA:ACQ:POINTS 51",
            ":VNA:FREQuency:START 150000", ":VNA:FREQuency:STOP 30000000", ":VNA:ACQ:SINGLE 1", ":VNA:ACQ:RUN",
        ):  # fmt: skip
            tell(command)
        for _ in range(1000):
            if query(":VNA:ACQ:FIN?") == "TRUE":
                break
        else:
            pytest.fail("the sweep does not end")
        rows = np.array([float(value) for value in query(":VNA:TRACE:DATA? S11").replace("[", "").replace("]", "").split(",")]).reshape(-1, 3)
        lines.close()
        truth = bench.motor.impedance("open", rows[:, 0])
    np.testing.assert_allclose(rows[:, 0], np.linspace(150e3, 30e6, 51), atol=1)
    # Clips of 8 nH and 2 pF turn S11 by some hundredths at 30 MHz; the rest is below 0.02.
    assert np.max(np.abs(rows[:, 1] + 1j * rows[:, 2] - (truth - 50) / (truth + 50))) < 0.1


def test_tsapython_reads_a_tinysa(capsys: pytest.CaptureFixture[str]) -> None:
    with served("tinysa", "pty") as (server, bench):
        client = tinySA(serial_timeout=10)
        assert client.connect(server.path)  # type: ignore[attr-defined]
        assert client.get_profile().family == "basic"
        client.rbw(10)
        rows = bytes(client.scan(150_000, 30_000_000, 51, 3)).decode().split("\r\n")
        frame = bytes(client.scan_raw(150_000, 30_000_000, 51))
        stored = bytes(client.data(2)).decode().split()
        client.disconnect()
        frequency_hz, level_dbm = np.array([row.split()[:2] for row in rows if row], dtype=float).T
        expected = bench.level_dbuv(frequency_hz, "peak")
    np.testing.assert_allclose(frequency_hz, np.linspace(150e3, 30e6, 51), atol=0.5)
    np.testing.assert_allclose(level_dbm, np.array(stored, dtype=float), atol=1e-6)
    raw = np.frombuffer(frame[1 : 1 + 3 * 51], np.dtype([("x", "S1"), ("count", "<u2")]))
    assert set(raw["x"]) == {b"x"}
    # The same motor at frequencies a little lower, because the step of a raw scan is the span over the points.
    assert np.median(np.abs(raw["count"] / 32 - 128 - level_dbm)) < 3.0
    loud = expected > 30
    assert np.median(np.abs(level_dbm + 106.99 - expected)[loud]) < 1.0
