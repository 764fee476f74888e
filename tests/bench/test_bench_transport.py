"""Links: text, blocks, deadlines, recording and replay."""

from __future__ import annotations

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest
from serving import served

from motoremi.bench.connect import VisaBench, attach, driver_class, open_manager, open_transport
from motoremi.bench.replay import ReplayTransport
from motoremi.bench.traffic import RecordingTransport, decode_bytes, encode_bytes
from motoremi.bench.transport import VisaTransport
from motoremi.errors import BadInput, InstrumentError
from motoremi.virtual.simulated_bench import SimulatedBench


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    bench = SimulatedBench(3)
    yield bench
    bench.close()


@pytest.fixture
def link(bench: SimulatedBench) -> VisaTransport:
    return open_transport(bench.resource_manager, bench.resources["analyser"], clock=bench.clock)


def record(direction: str, **content: str) -> dict[str, str]:
    return {"direction": direction, **content}


def test_a_command_and_its_answer(link: VisaTransport) -> None:
    link.write("POIN 11")
    assert link.query("POIN?") == "+11"


def test_the_deadline_is_kept_and_told_in_one_line(link: VisaTransport) -> None:
    with link.deadline(0.02), pytest.raises(InstrumentError) as caught:
        link.query("POIN 11")
    assert "GPIB0::17::INSTR" in str(caught.value)
    assert "'POIN 11' within 0.02 s" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert link.timeout_s == 5.0


def test_device_clear_forgets_a_waiting_answer(link: VisaTransport) -> None:
    link.write("*IDN?")
    link.clear()
    assert link.query("POIN?") == "+201"


def test_an_unknown_resource_is_an_error(bench: SimulatedBench) -> None:
    with pytest.raises(InstrumentError, match="GPIB0::5::INSTR: cannot be opened"):
        open_transport(bench.resource_manager, "GPIB0::5::INSTR")


def test_a_name_that_is_no_resource_is_an_error(bench: SimulatedBench) -> None:
    with pytest.raises(InstrumentError, match="nonsense: cannot be opened"):
        open_transport(bench.resource_manager, "nonsense")


def test_a_missing_backend_is_an_error() -> None:
    with pytest.raises(InstrumentError, match="@nowhere"):
        open_manager("@nowhere")


def test_text_that_is_not_ascii_is_refused(link: VisaTransport) -> None:
    with pytest.raises(InstrumentError, match="not ASCII"):
        link.write("TITL µ")


@pytest.mark.parametrize(
    "answer",
    [b"1.0,2.0\n", b"#", b"#0abc\n", b"#x12\n", b"#3", b"#216only seven\n", b"#13too long\n"],
    ids=["text", "cut at #", "indefinite", "no digit", "no count", "short", "long"],
)
def test_a_malformed_block_is_an_error(answer: bytes) -> None:
    link = ReplayTransport("TEST", [record("write", text="OUTP?\n"), record("read", **encode_bytes(answer))])
    with pytest.raises(InstrumentError, match=r"TEST: .*block.*'OUTP\?'"):
        link.query_block("OUTP?")


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b""])
def test_a_block_may_end_with_a_newline_or_without(end: bytes) -> None:
    link = ReplayTransport("TEST", [record("write", text="OUTP?\n"), record("read", **encode_bytes(b"#13a\nb" + end))])
    assert link.query_block("OUTP?") == b"a\nb"


@pytest.mark.parametrize("data", [b"STAR?\n", b"", b'0,"No error"\r\n', b"#13\x00\xff\n", bytes(range(256)), "µ".encode()])
def test_every_byte_survives_the_record(data: bytes) -> None:
    assert decode_bytes(encode_bytes(data)) == data


def test_readable_bytes_stay_readable() -> None:
    assert encode_bytes(b"STAR?\n") == {"text": "STAR?\n"}
    assert "base64" in encode_bytes(b"#11\x80")


def test_a_recording_holds_every_exchange_and_error_in_order(link: VisaTransport) -> None:
    records: list[Any] = []
    recorded = RecordingTransport(link, "analyser", records.append)
    recorded.query("POIN?")
    with recorded.deadline(0.01), pytest.raises(InstrumentError, match="'POIN 5'"):
        recorded.query("POIN 5")
    recorded.clear()
    assert [entry["direction"] for entry in records] == ["open", "write", "read", "write", "error", "clear"]
    assert records[2]["text"] == "+201\n"
    assert "no answer" in records[4]["error"]
    assert records[4]["timeout_s"] == 0.01
    assert [entry["clock_s"] for entry in records] == sorted(entry["clock_s"] for entry in records)
    assert {entry["instrument"] for entry in records} == {"analyser"}
    assert all(entry["time"].endswith("+00:00") for entry in records)


def test_a_recording_replays_with_its_errors(link: VisaTransport) -> None:
    records: list[Any] = []
    recorded = RecordingTransport(link, "analyser", records.append)
    recorded.query("*IDN?")
    with recorded.deadline(0.01), pytest.raises(InstrumentError) as first:
        recorded.query("POIN 5")
    replayed = ReplayTransport("GPIB0::17::INSTR", records)
    assert replayed.query("*IDN?").split(",")[1] == "4294A"
    with pytest.raises(InstrumentError) as again:
        replayed.query("POIN 5")
    assert str(again.value) == str(first.value)
    replayed.finish()


def test_a_replay_shows_expected_and_came() -> None:
    replayed = ReplayTransport("TEST", [record("write", text="STAR 1 HZ\n")])
    with pytest.raises(InstrumentError, match=r"exchange 1: expected write 'STAR 1 HZ\\n', got write 'STAR 2 HZ\\n'"):
        replayed.write("STAR 2 HZ")


def test_a_replay_that_goes_on_too_long_or_ends_early_is_an_error() -> None:
    with pytest.raises(InstrumentError, match="end of the record"):
        ReplayTransport("TEST", []).write("STAR?")
    with pytest.raises(InstrumentError, match="1 recorded exchanges left"):
        ReplayTransport("TEST", [record("read", text="1\n")]).finish()
    with pytest.raises(InstrumentError, match="expected read"):
        ReplayTransport("TEST", [record("read", text="1\n")]).write("STAR?")


@pytest.mark.parametrize("end", [b"\n", b"\r\n"], ids=["LF", "CR LF"])
def test_a_block_over_a_socket_may_hold_newlines(end: bytes) -> None:
    """On a socket only the newline ends a message, and the block below holds three."""
    payload = b"\n" + bytes(range(64)) + b"\n\n"
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = server.accept()
        with connection:
            for answer in (b"hello" + end, b"#267" + payload + end, b"after" + end):
                connection.recv(100)
                connection.sendall(answer)
            connection.recv(100)

    threading.Thread(target=serve, daemon=True).start()
    manager = open_manager("@py")
    link = open_transport(manager, f"TCPIP0::127.0.0.1::{server.getsockname()[1]}::SOCKET", timeout_s=2.0)
    assert link.stream
    assert link.query("*IDN?") == "hello"
    assert link.query_block("DATA?") == payload
    assert link.query("*OPC?") == "after"
    link.close()
    server.close()


class Peer:
    """The other end of a socket: answers what it is asked as slowly as it is told, and counts who connects."""

    def __init__(self, answer: bytes, every_s: float) -> None:
        self.links = 0
        self._answer, self._every_s = answer, every_s
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.resource = f"TCPIP0::127.0.0.1::{self._listener.getsockname()[1]}::SOCKET"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                self.links += 1
                threading.Thread(target=self._talk, args=(connection, self.links), daemon=True).start()

    def _talk(self, connection: socket.socket, number: int) -> None:
        with suppress(OSError), connection:
            while connection.recv(100):
                # Only the first link is slow: what is opened anew shall be seen to work.
                for position in range(len(self._answer)) if number == 1 else ():
                    time.sleep(self._every_s)
                    connection.sendall(self._answer[position : position + 1])
                if number > 1:
                    connection.sendall(b"healthy\n")

    def close(self) -> None:
        self._listener.close()


@pytest.mark.parametrize(
    ("answer", "block"),
    [(b"x" * 60 + b"\n", False), (b"#260" + b"\n" * 61, True), (b"#260" + b"x" * 60 + b"\n", True)],
    ids=["text", "block of newlines", "block without"],
)
def test_the_deadline_is_of_the_exchange_and_not_of_the_byte(answer: bytes, block: bool) -> None:
    """A byte comes long before the deadline, again and again; all of them would take seconds."""
    peer = Peer(answer, 0.05)
    link = open_transport(open_manager("@py"), peer.resource, timeout_s=0.3)
    with pytest.raises(InstrumentError, match=r"did not finish its answer to '\*IDN\?' within 0.3 s; check power") as caught:
        link.query_block("*IDN?") if block else link.query("*IDN?")
    assert "\n" not in str(caught.value)
    assert link.timeout_s == 0.3
    # What still trickles in belongs to nobody: the next exchange is on a new link.
    link.clear()
    assert link.query("*IDN?") == "healthy"
    assert peer.links == 2
    link.close()
    peer.close()


def test_a_link_that_never_falls_silent_is_opened_anew() -> None:
    peer = Peer(b"noise " * 30, 0.02)
    link = open_transport(open_manager("@py"), peer.resource, timeout_s=0.3)
    link.write("*IDN?")
    link.clear()
    assert link.query("*IDN?") == "healthy"
    link.close()
    peer.close()


def test_a_link_that_the_other_side_has_closed_is_opened_anew() -> None:
    with served("4294a") as (server, _):
        link = open_transport(open_manager("@py"), server.resource)
        assert link.query("POIN?") == "+201"
        server.drop_client()  # type: ignore[attr-defined]
        link.clear()
        assert link.query("POIN?") == "+201"
        link.close()


@pytest.mark.parametrize("sent", [b"", b"#260" + b"x" * 20], ids=["nothing", "half a block"])
def test_a_link_that_is_closed_instead_of_an_answer_is_told_as_that_and_at_once(sent: bytes) -> None:
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = server.accept()
        with connection:
            connection.recv(100)
            connection.sendall(sent)
            # Long enough for the reader to be waiting.
            time.sleep(0.2)

    threading.Thread(target=serve, daemon=True).start()
    link = open_transport(open_manager("@py"), f"TCPIP0::127.0.0.1::{server.getsockname()[1]}::SOCKET", timeout_s=30.0)
    began = time.monotonic()
    with pytest.raises(InstrumentError, match=r"to 'DATA\?' \(the other side closed the connection\); check power") as caught:
        link.query_block("DATA?")
    assert ("did not finish its answer" if sent else "gave no answer") in str(caught.value)
    assert time.monotonic() - began < 10.0
    link.close()
    server.close()


@pytest.mark.parametrize("count", [0, 100], ids=["a line", "so many bytes"])
def test_a_serial_line_that_trickles_meets_its_deadline(count: int) -> None:
    with served("4294a", "pty") as (server, _):
        server.send = lambda *_: None  # type: ignore[method-assign]
        link = open_transport(open_manager("@py"), server.resource, timeout_s=0.3)
        link.write("*IDN?")
        ended = threading.Event()

        def trickle() -> None:
            while not ended.wait(0.05):
                os.write(server.master, b"x")  # type: ignore[attr-defined]

        thread = threading.Thread(target=trickle)
        thread.start()
        with pytest.raises(InstrumentError, match=r"'\*IDN\?' within 0.3 s"):
            link.receive_bytes(count) if count else link.read()
        ended.set()
        thread.join()
        link.close()


def test_a_closed_port_is_one_clear_line() -> None:
    server = socket.create_server(("127.0.0.1", 0))
    port = server.getsockname()[1]
    server.close()
    with pytest.raises(InstrumentError) as caught:
        open_transport(open_manager("@py"), f"TCPIP0::127.0.0.1::{port}::SOCKET", timeout_s=0.2).query("*IDN?")
    assert "\n" not in str(caught.value)


def test_the_allow_list_refuses_other_resources() -> None:
    bench = VisaBench({"analyser": "GPIB0::9::INSTR"}, "@py", allow={"GPIB0::17::INSTR"})
    with pytest.raises(BadInput, match="GPIB0::9::INSTR is not on the bench's allow-list"):
        bench.open("analyser", "4294a", "GPIB0::17::INSTR", lambda record: None)
    bench.close()


def test_unknown_drivers_are_named() -> None:
    with pytest.raises(BadInput, match="unknown instrument driver '4924a': known are 34461a, 4294a"):
        driver_class("4924a")


def test_a_driver_is_put_on_a_recorded_link(link: VisaTransport) -> None:
    records: list[Any] = []
    assert attach(link, "analyser", "4294a", records.append).identify().model == "4294A"
    assert [entry["direction"] for entry in records] == ["open", "write", "read"]


def test_a_bus_that_is_not_there_is_one_clear_line() -> None:
    bench = VisaBench(backend="@py")
    with pytest.raises(InstrumentError, match="GPIB0::17::INSTR: cannot be opened") as caught:
        bench.open("analyser", "4294a", "GPIB0::17::INSTR", lambda record: None)
    assert "\n" not in str(caught.value)
    bench.close()
