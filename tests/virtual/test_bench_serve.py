"""Simulated instruments on a socket and on a pseudo-terminal, driven through real PyVISA resources."""

from __future__ import annotations

import copy
import os
import select
import signal
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import pyvisa
from fault_matrix import SEED, small
from serving import SPEED, served, started

from motoremi.bench.clock import FastClock, WallClock
from motoremi.bench.connect import driver_class, open_manager, open_transport
from motoremi.bench.impedance_analyser import ImpedanceAnalyser
from motoremi.bench.motor_connections import INSTRUCTIONS, STANDARDS
from motoremi.bench.receiver import EmiReceiver
from motoremi.data.session import SessionWriter, load, reopen, verify
from motoremi.errors import InstrumentError
from motoremi.run.rerun import rerun
from motoremi.run.runner import make_bench, resumable, run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import parse_procedure
from motoremi.virtual.serve import SocketServer
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.virtual_instruments import VIRTUAL_INSTRUMENTS

ANALYSERS = sorted(name for name, instrument in VIRTUAL_INSTRUMENTS.items() if instrument.role == "analyser")
RECEIVERS = sorted(name for name, instrument in VIRTUAL_INSTRUMENTS.items() if instrument.role == "receiver")
LINKS = ["tcp", "pty"]


@pytest.fixture
def manager() -> Iterator[pyvisa.ResourceManager]:
    manager = open_manager("@py")
    yield manager
    manager.close()


@pytest.mark.slow
@pytest.mark.parametrize("over", LINKS)
@pytest.mark.parametrize("name", ANALYSERS)
def test_an_analyser_measures_a_motor_over_a_real_link(name: str, over: str, manager: pyvisa.ResourceManager) -> None:
    """Compensated on its own standards, the motor comes out; 10 % is what network analysers need, the bridges stay far below."""
    with served(name, over) as (server, bench):
        analyser = driver_class(name)(open_transport(manager, server.resource, clock=FastClock(SPEED)))
        assert isinstance(analyser, ImpedanceAnalyser)
        analyser.identify()
        analyser.reset()
        analyser.configure(150e3, 30e6, 41)
        for standard in sorted(analyser.REQUIRED or {"open", "short"}):
            bench.connect(STANDARDS[standard])
            if standard == "load":
                analyser.define_load(100.0, 0.0)
            analyser.compensate(standard)
        bench.connect("open")
        sweep = analyser.sweep("open")
        analyser.safe()
        analyser.close()
        truth = bench.motor.impedance("open", sweep.frequency_hz)
    assert len(sweep) == 41
    assert np.median(np.abs(sweep.impedance_ohm / truth - 1)) < 0.1
    # A binary block on a stream holds newlines sooner or later; none may be lost.
    # The steps of a NanoVNA V2 are whole hertz, which may leave it 254 Hz short of the end.
    assert sweep.span_hz == pytest.approx((150e3, 30e6), rel=1e-5 if name == "nanovna-v2" else 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("over", LINKS)
@pytest.mark.parametrize("name", RECEIVERS)
def test_a_receiver_scans_over_a_real_link(name: str, over: str, manager: pyvisa.ResourceManager) -> None:
    with served(name, over) as (server, bench):
        receiver = driver_class(name)(open_transport(manager, server.resource))
        assert isinstance(receiver, EmiReceiver)
        receiver.identify()
        receiver.reset()
        receiver.configure(150e3, 30e6, 150e3, 10e3 if name == "tinysa" else 9e3, dwell_s=0.01)
        spectrum = receiver.scan("peak")
        receiver.safe()
        receiver.close()
        expected = bench.level_dbuv(spectrum.frequency_hz, "peak")
    # Analysers with a fixed number of points have a smaller step.
    assert len(spectrum) >= 200
    assert np.diff(spectrum.frequency_hz).max() <= 150e3
    assert np.median(np.abs(spectrum.level_dbuv - expected)) < 3.0


def test_one_client_after_the_other(manager: pyvisa.ResourceManager) -> None:
    with served("4294a") as (server, _):
        for points in (11, 21):
            link = open_transport(manager, server.resource)
            link.write(f"POIN {points}")
            assert link.query("POIN?") == f"+{points}"
            # Left unread; the next client must not get it.
            link.write("*IDN?")
            link.close()


def test_several_messages_in_one_packet_and_one_in_several() -> None:
    with served("4294a") as (server, _), socket.create_connection(("127.0.0.1", server.port)) as client:  # type: ignore[attr-defined]
        client.sendall(b"POIN 11\r\nPOIN?\r\nSTAR?")
        answers = client.makefile("rb")
        assert answers.readline() == b"+11\n"
        client.sendall(b"\n")
        assert float(answers.readline()) == 40.0


def test_only_this_machine_can_connect() -> None:
    with served("4294a") as (server, _):
        assert server.listener.getsockname()[0] == "127.0.0.1"  # type: ignore[attr-defined]


def test_a_taken_port_is_one_clear_line() -> None:
    bench = SimulatedBench(1)
    instrument = VIRTUAL_INSTRUMENTS["4294a"]
    first = SocketServer(instrument.make(bench, bench.clock))
    with pytest.raises(InstrumentError, match=f"TCP port {first.port} of 127.0.0.1 cannot be served"):
        SocketServer(instrument.make(bench, bench.clock), first.port)
    first.close()
    bench.close()


def test_a_server_stops_while_a_client_does_not_read() -> None:
    with served("4294a", "pty") as (server, _):
        port = os.open(server.path, os.O_RDWR | os.O_NOCTTY)  # type: ignore[attr-defined]
        os.write(port, b"POIN 801\nOUTPSWPRM?\n")
        select.select([port], [], [], 5.0)
    os.close(port)


@pytest.mark.slow
@pytest.mark.parametrize("link", [["--tcp", "0"], ["--pty"]])
def test_the_command_serves_until_it_is_stopped(link: list[str], manager: pyvisa.ResourceManager) -> None:
    with started("4294a", *link, "--speed", "1000") as (ready, process):
        assert process.stdin is not None
        assert process.stderr is not None
        analyser = driver_class("4294a")(open_transport(manager, ready["resource"]))
        assert analyser.identify().model == "4294A"
        assert isinstance(analyser, ImpedanceAnalyser)
        analyser.configure(150e3, 30e6, 11)
        magnitudes = []
        for what in ("open-standard", "short-standard", "nonsense"):
            process.stdin.write(what + "\n")
            process.stdin.flush()
            process.stderr.readline()
            magnitudes.append(float(np.abs(analyser.sweep("open").impedance_ohm[0])))
        # 4 pF of fixture at 150 kHz; then its 30 mOhm; a name that nobody knows changes nothing.
        assert magnitudes[0] == pytest.approx(1 / (2 * np.pi * 150e3 * 4e-12), rel=0.05)
        assert magnitudes[1] == pytest.approx(magnitudes[2], rel=0.01)
        assert magnitudes[1] < 0.1
        analyser.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(10) == 0


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such signals there")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_command_is_stopped_from_a_script_too(number: signal.Signals) -> None:
    with started("tinysa", "--tcp", "0", in_background=True) as (_, process):
        process.send_signal(number)
        assert process.wait(10) == 0


@pytest.mark.parametrize("name", ["4294a", "e4990a", "esr", "mxe"])
def test_an_idle_instrument_answers_at_real_speed(name: str, manager: pyvisa.ResourceManager) -> None:
    """Nothing is busy: there is no time to wait for, and on a real clock it has even passed."""
    bench = SimulatedBench(7, clock=WallClock())
    with served(name, bench=bench) as (server, _):
        link = open_transport(manager, server.resource, timeout_s=5.0)
        assert link.query("*OPC?") == "1"
        link.write("*WAI")
        assert link.query("*OPC?") == "1"
        link.close()


@pytest.mark.parametrize("over", LINKS)
def test_a_fault_in_one_message_does_not_end_the_server(
    over: str, manager: pyvisa.ResourceManager, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with served("4294a", over) as (server, _):
        device = server.device
        healthy = device.respond

        def faulty(query: bytes) -> object:
            if query.startswith(b"*TRG"):
                raise ZeroDivisionError("two\nlines")
            return healthy(query)

        monkeypatch.setattr(device, "respond", faulty)
        link = open_transport(manager, server.resource, timeout_s=0.3)
        link.write("*TRG")
        with pytest.raises(InstrumentError):
            link.query("*TRG")
        link.close()
        link = open_transport(manager, server.resource, timeout_s=5.0)
        assert link.query("POIN?") == "+201"
        link.close()
    assert {record.getMessage() for record in caplog.records if record.name == "motoremi.virtual.serve"} == {
        f"motoremi: {server.resource}: a message could not be answered (ZeroDivisionError: two\\x0alines); report it"
    }


def test_a_dropped_link_is_an_error_and_clear_makes_a_new_one(manager: pyvisa.ResourceManager) -> None:
    """Nothing is repeated by itself; the instrument is still as it was set, and can be brought into its safe state."""
    with served("4294a") as (server, _):
        analyser = driver_class("4294a")(open_transport(manager, server.resource, timeout_s=0.5))
        analyser.tell("POIN 11", "POWE 0.4 V")
        server.drop_client()  # type: ignore[attr-defined]
        with pytest.raises(InstrumentError, match=r"did not accept|gave no answer"):
            analyser.identify()
        analyser.safe()
        assert analyser.ask("POIN?") == "+11"
        assert float(analyser.ask("POWE?")) == 0.005
        assert analyser.transport.timeout_s == 0.5
        analyser.close()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["esr", "mxe"])
def test_ctrl_c_stops_a_scan_on_a_plain_socket(tmp_path: Path, name: str) -> None:
    """There is no service request and no device clear: the receiver must hear ABOR while it scans, or it scans on for minutes."""
    source = copy.deepcopy(small("emission_only").source)
    source["instruments"]["receiver"]["driver"] = name
    source["spectrum"] |= {"step": "1 MHz", "dwell": "10 s"}
    source["steps"] = [step for step in source["steps"] if step["do"] in ("identify", "spectrum")]
    procedure = parse_procedure(source, "long")
    clock = FastClock(1.0)
    with served(name, bench=SimulatedBench(SEED, clock=clock)) as (server, _):
        bench_file = BenchFile(backend="@py", resources={"receiver": server.resource})
        writer = SessionWriter.create(tmp_path / "s", start_document(procedure, bench_file))
        device = server.device

        def stop() -> None:
            if device.busy_until() > clock.now() + 60.0:
                raise KeyboardInterrupt

        visa = make_bench(bench_file)
        with pytest.raises(KeyboardInterrupt):
            run(procedure, visa, writer, analyse=lambda *_: None, prompt=lambda text: None, tick=stop)
        visa.close()
        assert device.busy_until() <= clock.now()
        session = load(tmp_path / "s")
        assert [(document["safe"], document["problem"]) for document in session.documents if document["kind"] == "safe"] == [(True, "")]
        clock.speed = 10_000.0
        visa = make_bench(bench_file)
        going_on, done = resumable(session, bench_file)
        run(going_on, visa, reopen(tmp_path / "s"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
        visa.close()
    assert len(load(tmp_path / "s").spectra) == sum(step["do"] == "spectrum" for step in source["steps"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("procedure", "analyser", "receiver"),
    [("full_motor_test", ("4294a", "tcp"), ("esr", "pty")), ("nanovna_bench", ("nanovna", "pty"), ("tinysa", "tcp"))],
)
def test_a_procedure_runs_over_real_links(tmp_path: Path, procedure: str, analyser: tuple[str, str], receiver: tuple[str, str]) -> None:
    """As on a real bench: PyVISA-py opens what the bench file names, and the operator connects what the prompts say."""
    bench = SimulatedBench(SEED, clock=FastClock(SPEED))

    def operator(text: str) -> None:
        bench.connect(next(what for what, instruction in INSTRUCTIONS.items() if text.startswith(instruction.text)))

    with served(*analyser, bench=bench) as (one, _), served(*receiver, bench=bench) as (other, _):
        bench_file = BenchFile(backend="@py", resources={"analyser": one.resource, "receiver": other.resource})
        visa = make_bench(bench_file)
        writer = SessionWriter.create(tmp_path / "s", start_document(small(procedure), bench_file))
        outcome = run(small(procedure), visa, writer, analyse=lambda *_: None, prompt=operator)
        visa.close()
    session = load(tmp_path / "s")
    assert outcome.passed
    assert verify(tmp_path / "s") == []
    assert len(session.sweeps) == 6
    for sweep in session.sweeps:
        truth = bench.motor.impedance(sweep.termination, sweep.frequency_hz)
        assert np.median(np.abs(sweep.impedance_ohm / truth - 1)) < 0.05
    assert {spectrum.metadata["condition"] for spectrum in session.spectra} == {"motor off", "motor running"}
    again = rerun(session, tmp_path / "again", lambda: lambda *_: None, False)
    assert again.same
    assert again.compared == len(session.sweeps) + len(session.spectra)
