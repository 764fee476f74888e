"""Service requests: the end of a measurement told by the instrument, where the link can; polling where it cannot."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import pyvisa
from fault_matrix import BENCH_FILE, SEED, small
from pyvisa.constants import EventMechanism, EventType, StatusCode
from serving import SPEED, served

from motoremi.bench.clock import FastClock, WallClock
from motoremi.bench.connect import attach, open_manager, open_transport
from motoremi.bench.impedance_analyser import ImpedanceAnalyser
from motoremi.bench.receiver import EmiReceiver
from motoremi.bench.replay import ReplayBench, ReplayTransport
from motoremi.bench.transport import Transport
from motoremi.data.session import SessionWriter, load
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.rerun import rerun
from motoremi.run.runner import run, start_document
from motoremi.schema.procedure import parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.visa_library import BenchLibrary

REQUEST, QUEUE = EventType.service_request, EventMechanism.queue
# What each driver looks at to see whether it is done, and what it starts the measurement with.
REGISTER = {"4294a": "ESB?\n", "e4990a": "*ESR?\n", "esr": "*ESR?\n", "mxe": "*ESR?\n"}
START = {"4294a": "SING\n", "e4990a": ":TRIG:SING\n", "esr": "INIT2;*OPC\n", "mxe": ":INIT2:IMM;*OPC\n"}
READ_BACK = {"4294a": {"OUTPERRO?\n", "POIN?\n", "BWFACT?\n"}, "e4990a": {":SYST:ERR?\n", ":SENS1:SWE:POIN?\n", ":SENS1:APER:TIME?\n"}}
ANALYSERS = ("4294a", "e4990a")
STOCK_PROFILE = """spec: "1.1"
devices:
  d:
    eom:
      GPIB INSTR: {q: "\\n", r: "\\n"}
    error: ERROR
    dialogues: [{q: "*IDN?", r: "a,b,c,d"}]
resources:
  GPIB0::1::INSTR: {device: d}
"""


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    bench = SimulatedBench(SEED)
    yield bench
    bench.close()


@pytest.fixture
def raw(bench: SimulatedBench) -> pyvisa.resources.GPIBInstrument:
    """A stock client: PyVISA and nothing of ours."""
    resource = bench.resource_manager.open_resource("GPIB0::17::INSTR", write_termination="\n")
    assert isinstance(resource, pyvisa.resources.GPIBInstrument)
    return resource


def ready(bench: SimulatedBench, name: str, traffic: list[Any]) -> Any:
    """A driver on its simulated instrument, set up to measure."""
    role = "analyser" if name in ANALYSERS else "receiver"
    driver = bench.open(role, name, "", traffic.append)
    driver.reset()
    if isinstance(driver, ImpedanceAnalyser):
        bench.connect("open")
        driver.configure(150e3, 30e6, 201)
    else:
        assert isinstance(driver, EmiReceiver)
        bench.connect("lisn-motor-on")
        driver.configure(150e3, 30e6, 150e3)
    return driver


def measure(driver: Any) -> Any:
    return driver.sweep("open") if isinstance(driver, ImpedanceAnalyser) else driver.scan("peak")


def texts(traffic: list[Any]) -> list[str]:
    return [record.get("text", record["direction"]) for record in traffic]


def test_a_stock_client_waits_for_the_event(bench: SimulatedBench, raw: pyvisa.resources.GPIBInstrument) -> None:
    raw.enable_event(REQUEST, QUEUE)
    raw.write("*CLS;POIN 101;BWFACT 5;ESNB 1;*SRE 4;SING")
    began_s = bench.clock.now()
    assert raw.wait_on_event(REQUEST, 60_000).event.event_type == REQUEST
    assert bench.clock.now() - began_s == pytest.approx(101 * 0.2 + 0.04, abs=0.01)
    assert raw.read_stb() == 0x44
    # Polling answers the request (IEEE 488.2); the event that it was for stays until it is read.
    assert raw.read_stb() == 0x04
    assert int(raw.query("ESB?")) == 1
    with pytest.raises(pyvisa.VisaIOError) as caught:
        raw.wait_on_event(REQUEST, 5000)
    assert caught.value.error_code == StatusCode.error_timeout


def test_wait_for_srq_of_a_stock_client(bench: SimulatedBench, raw: pyvisa.resources.GPIBInstrument) -> None:
    raw.write("*CLS;ESNB 256;*SRE 4;COMA")
    raw.wait_for_srq(60_000)
    assert int(raw.query("ESB?")) == 256


def test_masks_decide_whether_service_is_requested(raw: pyvisa.resources.GPIBInstrument) -> None:
    raw.enable_event(REQUEST, QUEUE)
    for masks in ("ESNB 0;*SRE 4", "ESNB 1;*SRE 0", "ESNB 256;*SRE 4"):
        raw.write(f"*CLS;{masks};SING")
        assert raw.wait_on_event(REQUEST, 60_000, capture_timeout=True).timed_out
    raw.write("*CLS;*ESE 1;*SRE 32;SING;*OPC")
    assert not raw.wait_on_event(REQUEST, 60_000, capture_timeout=True).timed_out


def test_events_are_enabled_first_discarded_and_disabled(bench: SimulatedBench, raw: pyvisa.resources.GPIBInstrument) -> None:
    def ended() -> None:
        raw.write("*CLS;ESNB 1;*SRE 4;SING")
        bench.clock.sleep(10.0)
        raw.read_stb()

    with pytest.raises(pyvisa.VisaIOError, match="VI_ERROR_NENABLED"):
        raw.wait_on_event(REQUEST, 10)
    raw.enable_event(REQUEST, QUEUE)
    ended()
    raw.discard_events(REQUEST, QUEUE)
    assert raw.wait_on_event(REQUEST, 10, capture_timeout=True).timed_out
    ended()
    assert not raw.wait_on_event(REQUEST, 10, capture_timeout=True).timed_out
    raw.disable_event(REQUEST, QUEUE)
    with pytest.raises(pyvisa.VisaIOError, match="VI_ERROR_NENABLED"):
        raw.wait_on_event(REQUEST, 10)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(REGISTER))
def test_on_gpib_nothing_is_asked_during_the_measurement(bench: SimulatedBench, name: str) -> None:
    traffic: list[Any] = []
    driver = ready(bench, name, traffic)
    assert driver.transport.service_requests
    traffic.clear()
    began_s = bench.clock.now()
    measure(driver)
    sent = texts(traffic)
    assert sent.count("request") == sent.count(REGISTER[name]) == 1
    start, request = sent.index(START[name]), sent.index("request")
    assert sent[request + 1] == REGISTER[name]
    # An analyser's settings are read before its deadline is known; a receiver answers nothing while it scans.
    asked = {text for text in sent[start + 1 : request] if text.endswith("?\n")}
    assert asked == READ_BACK.get(name, set())
    assert traffic[request]["came"] is True
    assert traffic[request]["clock_s"] - began_s > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(REGISTER))
def test_on_a_socket_it_is_polled_as_ever(name: str) -> None:
    manager = open_manager("@py")
    with served(name, "tcp") as (server, bench):
        role = "analyser" if name in ANALYSERS else "receiver"
        traffic: list[Any] = []
        # What a simulated receiver works out takes real seconds, and a deadline on a fast clock would not wait for it.
        clock = FastClock(SPEED) if role == "analyser" else WallClock()
        driver: Any = attach(open_transport(manager, server.resource, clock=clock), role, name, traffic.append)
        driver.reset()
        driver.configure(150e3, 30e6, *([21] if name in ANALYSERS else [1.5e6]))
        bench.connect("open" if name in ANALYSERS else "lisn-motor-on")
        assert len(measure(driver)) in (20, 21)
        driver.safe()
        driver.close()
    manager.close()
    assert traffic[0]["service_requests"] is False
    sent = texts(traffic)
    assert "request" not in sent
    assert not any(text.startswith("*SRE") for text in sent)


def test_stock_pyvisa_sim_and_serial_lines_have_none(bench: SimulatedBench, tmp_path: Path) -> None:
    bench.open("analyser", "nanovna", "", lambda record: None)
    assert not open_transport(bench.resource_manager, bench.resources["analyser"]).service_requests
    profile = tmp_path / "stock.yaml"
    profile.write_text(STOCK_PROFILE, encoding="utf-8")
    manager = pyvisa.ResourceManager(f"{profile}@sim")
    link = open_transport(manager, "GPIB0::1::INSTR")
    assert not link.service_requests
    manager.close()


@pytest.mark.parametrize("name", sorted(REGISTER))
def test_an_instrument_that_never_ends_meets_its_deadline(bench: SimulatedBench, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = ready(bench, name, [])
    device = bench.devices["analyser" if name in ANALYSERS else "receiver"]
    monkeypatch.setattr(device, "busy_until", lambda: device.clock.now() + 1e9)
    monkeypatch.setattr(device, "ended", lambda: None, raising=False)
    with pytest.raises(InstrumentError, match=r"is not complete after \d+ s; check trigger source and front panel"):
        measure(driver)


@pytest.mark.parametrize("name", sorted(REGISTER))
def test_a_link_that_loses_requests_is_polled_from_then_on(bench: SimulatedBench, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The measurement is not lost: it is found complete at the deadline, and the next one does not wait for that."""
    traffic: list[Any] = []
    driver = ready(bench, name, traffic)
    first = measure(driver)

    def deaf(library: BenchLibrary, session: Any, event: Any, timeout: int) -> Any:
        library.device_on(session).clock.sleep(timeout / 1000)
        raise pyvisa.VisaIOError(StatusCode.error_timeout)

    monkeypatch.setattr(BenchLibrary, "wait_on_event", deaf)
    traffic.clear()
    assert len(measure(driver)) == len(first)
    assert [record["came"] for record in traffic if record["direction"] == "request"] == [False]
    assert "*SRE 0\n" in texts(traffic)
    traffic.clear()
    began_s = bench.clock.now()
    assert len(measure(driver)) == len(first)
    assert "request" not in texts(traffic)
    assert bench.clock.now() - began_s < 15


@pytest.mark.parametrize("polled", [False, True])
@pytest.mark.parametrize("name", sorted(REGISTER))
def test_a_request_of_an_earlier_sweep_is_no_completion(bench: SimulatedBench, name: str, polled: bool) -> None:
    """The sweep before ended unheard; its request waits in VISA's queue, answered by a poll or not, when the next sweep begins."""
    traffic: list[Any] = []
    driver = ready(bench, name, traffic)
    device = bench.devices["analyser" if name in ANALYSERS else "receiver"]
    driver.tell("*CLS")
    if name == "4294a":
        driver.tell("ESNB 1")
    driver.request_service()
    driver.transport.write(START[name].strip() + (";*OPC" if name == "e4990a" else ""))
    bench.clock.sleep(60.0)
    if polled:
        assert device.serial_poll() & 64
    device.notice_request()
    assert device.service_requests == 1
    traffic.clear()
    began_s = bench.clock.now()
    measure(driver)
    sent = texts(traffic)
    assert device.service_requests == 2
    assert bench.clock.now() - began_s > 1.0
    assert sent.count("request") == sent.count(REGISTER[name]) == 1


def test_a_request_for_another_reason_is_waited_beyond(bench: SimulatedBench) -> None:
    """Only the register proves an end: here the instrument asks for service while it still sweeps, because of an error."""
    traffic: list[Any] = []
    driver = ready(bench, "4294a", traffic)
    driver.trigger()
    driver.transport.write("*ESE 32")
    driver.transport.write("*SRE 36")
    driver.transport.write("WOBBLE")
    driver.transport.query("OUTPERRO?")
    traffic.clear()
    driver.wait_until_complete()
    sent = texts(traffic)
    assert sent.count("request") == sent.count("ESB?\n") == 2
    assert driver.read_impedance().size == 201


def test_a_kind_of_link_that_has_none_says_so() -> None:
    class Plain(ReplayTransport):
        await_request = Transport.await_request

    with pytest.raises(InstrumentError, match="TEST: this link carries no service requests"):
        Plain("TEST", []).await_request(1.0)


def test_a_link_that_fails_in_the_wait_is_one_line_and_replays(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    traffic: list[Any] = []
    driver = ready(bench, "4294a", traffic)

    def lost(*_: Any) -> Any:
        raise pyvisa.VisaIOError(StatusCode.error_connection_lost)

    monkeypatch.setattr(BenchLibrary, "wait_on_event", lost)
    with pytest.raises(InstrumentError, match=r"GPIB0::17::INSTR: failed while it was waited for after .*VI_ERROR_CONN_LOST") as caught:
        driver.sweep("open")
    assert "\n" not in str(caught.value)
    again = ReplayBench(traffic).open("analyser", "4294a", "", lambda record: None)
    again.reset()
    again.configure(150e3, 30e6, 201)  # type: ignore[attr-defined]
    with pytest.raises(InstrumentError) as replayed:
        again.sweep("open")  # type: ignore[attr-defined]
    assert str(replayed.value) == str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("role", ["analyser", "receiver"])
def test_ctrl_c_in_the_wait_leaves_the_instruments_safe_and_replays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, role: str) -> None:
    bench = SimulatedBench(SEED)
    real, waits = BenchLibrary.wait_on_event, iter(range(1000))

    def interrupted(library: BenchLibrary, session: Any, event: Any, timeout: int) -> Any:
        if library.device_on(session) is bench.devices[role] and (role == "receiver" or next(waits) == 3):
            raise KeyboardInterrupt
        return real(library, session, event, timeout)

    monkeypatch.setattr(BenchLibrary, "wait_on_event", interrupted)
    writer = SessionWriter.create(tmp_path / "s", start_document(small(), BENCH_FILE))
    with pytest.raises(KeyboardInterrupt):
        run(small(), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    session = load(tmp_path / "s")
    assert session.status == "interrupted"
    assert bench.devices["analyser"].value("level") == 0.005
    for device in bench.devices.values():
        assert device.value("service_mask") == 0
        assert device.busy_until() <= device.clock.now()
    bench.close()
    result = rerun(session, tmp_path / "again", lambda: lambda *_: None)
    assert result.same
    assert result.compared == len(session.sweeps) > 0
    assert result.ended.startswith("stopped by the operator")


def test_whoever_stops_the_run_is_heard_in_the_wait(tmp_path: Path, bench: SimulatedBench) -> None:
    """The workbench stops a run by an error out of `tick`; a scan of minutes must not make it deaf."""
    procedure = copy.deepcopy(small("emission_only").source)
    procedure["spectrum"] |= {"step": "1 MHz", "dwell": "1 s"}
    began_s: list[float] = []

    def stop() -> None:
        device = bench.devices["receiver"]
        if device.busy_until() > bench.clock.now():
            began_s.append(bench.clock.now())
            if bench.clock.now() > began_s[0] + 3.0:
                raise KeyboardInterrupt

    writer = SessionWriter.create(tmp_path / "s", start_document(parse_procedure(procedure, "short"), BENCH_FILE))
    with pytest.raises(KeyboardInterrupt):
        run(parse_procedure(procedure, "short"), bench, writer, analyse=lambda *_: None, prompt=lambda text: None, tick=stop)
    assert 3.0 < began_s[-1] - began_s[0] < 4.0
    # What was going on was the wait of the first scan, which takes half a minute.
    assert load(tmp_path / "s").spectra == ()


def test_a_session_recorded_without_service_requests_is_replayed_by_polling() -> None:
    link = ReplayTransport("TEST", [{"direction": "open", "stream": False}])
    assert not link.service_requests


def test_a_lenient_replay_passes_the_time_of_a_wait_that_was_not_recorded() -> None:
    records = [{"direction": "open", "stream": False, "service_requests": True}, {"direction": "write", "text": "A\n"}, {"direction": "leave"}]
    link = ReplayTransport("TEST", records, lenient=True)
    assert link.await_request(30.0) is False
    assert link.clock.now() == 30.0
    assert [difference.came for difference in link.differences] == ["request"]


@pytest.mark.parametrize("record", [{"direction": "request"}, {"direction": "request", "came": "yes"}])
def test_a_spoilt_record_of_a_request_is_refused(record: dict[str, Any]) -> None:
    with pytest.raises(BadInput, match="line 1: is no record of an exchange"):
        ReplayBench([{"instrument": "analyser", **record}])
