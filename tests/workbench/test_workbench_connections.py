"""Connections that mean ill, and how the browser is opened."""

from __future__ import annotations

import os
import pty
import signal
import socket
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from starlette.testclient import TestClient
from workbench_tools import HOST, TOKEN, bench_of, listening, make_session, served, until

from motoremi.workbench import body, doorway, guard, server
from motoremi.workbench.routes import make_app

MOTOREMI = Path(sys.executable).with_name("motoremi")
DEADLINE_S = 60.0


def connected(address: str) -> socket.socket:
    """A connection to the workbench that speaks for itself."""
    host, _, port = address.removeprefix("http://").partition("/")[0].partition(":")
    return socket.create_connection((host, int(port)), timeout=DEADLINE_S)


def head_of(address: str, *lines: str) -> bytes:
    """A request with the key, and these lines in its head."""
    host = address.removeprefix("http://").partition("/")[0]
    common = [f"Host: {host}", f"Authorization: Bearer {TOKEN}", "Content-Type: application/json"]
    return "\r\n".join(["POST /api/run/stop HTTP/1.1", *common, *lines, "", ""]).encode()


@pytest.mark.parametrize("lines", [("Content-Length: 2", "Transfer-Encoding: chunked"), ("Transfer-Encoding: chunked",)])
def test_a_body_is_counted_as_it_comes(tmp_path, lines):
    chunk = b"10000\r\n" + b" " * 0x10000 + b"\r\n"
    with served(bench_of(tmp_path)) as address, connected(address) as stream:
        stream.sendall(head_of(address, *lines))
        sent = 0
        try:
            # Far more than kernel and server keep for who does not read: it ends only if the server ends it.
            while sent < 300 << 20:
                stream.sendall(chunk)
                sent += len(chunk)
        except OSError:
            pass
        assert sent < 64 << 20


def test_a_body_that_is_too_long_by_its_header_is_refused(tmp_path):
    with served(bench_of(tmp_path)) as address, connected(address) as stream:
        stream.sendall(head_of(address, "Content-Length: 999999999") + b"{" * (body.USUAL.most_bytes + 1))
        assert b" 413 " in stream.recv(100)


def test_a_short_body_in_chunks_is_read(tmp_path):
    with served(bench_of(tmp_path)) as address, connected(address) as stream:
        stream.sendall(head_of(address, "Transfer-Encoding: chunked") + b"1\r\n{\r\n1\r\n}\r\n0\r\n\r\n")
        assert b" 200 " in stream.recv(100)


def test_a_body_that_stays_away_is_cut_off(tmp_path, monkeypatch):
    monkeypatch.setattr(guard, "USUAL", body.USUAL._replace(within_s=0.2))
    with served(bench_of(tmp_path)) as address, connected(address) as stream:
        stream.sendall(head_of(address, "Content-Length: 20") + b"{")
        assert b" 408 " in stream.recv(100)


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: 127", b"GET / HTTP/1.1\r\nHost: x\r\n\r\nGET / HT"])
def test_half_open_requests_are_cut_off(tmp_path, monkeypatch, sent):
    monkeypatch.setattr(server, "HEADER_DEADLINE_S", 0.3)
    with served(bench_of(tmp_path)) as address:
        streams = [connected(address) for _ in range(40)]
        for stream in streams:
            stream.sendall(sent)
        for stream in streams:
            # Everything up to the end; a connection that is left open ends in the socket's own timeout.
            while stream.recv(65536):
                pass
            stream.close()


def test_a_stream_of_events_is_no_half_open_request(tmp_path, monkeypatch):
    monkeypatch.setattr(server, "HEADER_DEADLINE_S", 0.1)
    workbench = bench_of(tmp_path)
    with served(workbench) as address, listening(address) as events:
        assert next(events)[0] == "state"
        time.sleep(0.3)
        workbench.events.publish("changed", {"session": "x"})
        assert any(kind == "changed" for kind, _ in events)


@pytest.mark.slow
def test_the_key_is_not_in_the_browsers_command_line(tmp_path):
    """The command at a terminal, and a browser that writes down how it was called and what it was given."""
    (tmp_path / "home").mkdir()
    seen = tmp_path / "seen"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\nfile="${{1#file://}}"\n(echo "$@"; stat -c %a "$file"; cat "$file") > {seen}.part\nmv {seen}.part {seen}\n')
    browser.chmod(0o700)
    ours, theirs = pty.openpty()
    environment = {**os.environ, "BROWSER": str(browser), "HOME": str(tmp_path / "home")}
    process = subprocess.Popen([MOTOREMI, "workbench", "--folder", tmp_path], stdin=theirs, stdout=theirs, stderr=theirs, env=environment)
    os.close(theirs)
    printed = bytearray()

    def read() -> None:
        try:
            while data := os.read(ours, 4096):
                printed.extend(data)
        except OSError:
            # The terminal's other end is gone.
            return

    reader = threading.Thread(target=read)
    reader.start()
    try:
        until(seen.exists, DEADLINE_S)
        called, mode, page = seen.read_text().split("\n", 2)
        # The browser may be called before what was printed has been read.
        until(lambda: b"\n" in printed.partition(b"token=")[2], DEADLINE_S)
        key = printed.decode().partition("token=")[2].split()[0]
        assert key in page
        assert key not in called
        assert int(mode, 8) == stat.S_IRUSR | stat.S_IWUSR
        process.send_signal(signal.SIGINT)
        process.wait(DEADLINE_S)
        assert list((tmp_path / "home").iterdir()) == []
    finally:
        process.kill()
        process.wait()
        reader.join()
        os.close(ours)


def test_a_browser_that_comes_from_the_local_file_gets_the_cookie(tmp_path):
    make_session(tmp_path / "mine")
    stranger = TestClient(make_app(bench_of(tmp_path), TOKEN, {HOST}), base_url=f"http://{HOST}", follow_redirects=False)
    from_file = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert stranger.get("/", headers=from_file).status_code == 403
    assert stranger.get("/", params={"token": "wrong"}, headers=from_file).status_code == 403
    answer = stranger.get("/", params={"token": TOKEN}, headers=from_file)
    assert answer.status_code == 200
    assert "url=/" in answer.text
    assert TOKEN not in answer.text
    assert stranger.get("/").status_code == 200


def test_the_local_file_leads_to_the_address_and_goes(monkeypatch, tmp_path):
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    with doorway.doorway("http://127.0.0.1:1/?token=a&b") as file:
        assert "url=http://127.0.0.1:1/?token=a&amp;b" in file.read_text()
        assert file.parent == tmp_path
    assert not file.exists()


WINDOW = {"Accept": "text/html,application/xhtml+xml", "Sec-Fetch-Dest": "document"}


@pytest.mark.parametrize(
    ("path", "key", "status", "says"), [("/", "wrong", 401, "motoremi workbench"), ("/<script>x", TOKEN, 404, "&lt;script&gt;x")]
)
def test_errors_in_a_window_are_pages(tmp_path, path, key, status, says):
    client = TestClient(make_app(bench_of(tmp_path), TOKEN, {HOST}), base_url=f"http://{HOST}", headers={"Authorization": f"Bearer {key}"})
    answer = client.get(path, headers=WINDOW)
    assert answer.status_code == status
    assert answer.headers["content-type"].startswith("text/html")
    assert says in answer.text
    assert "<script" not in answer.text
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    # A script of the page asks for data and reads JSON.
    assert "error" in client.get(path, headers={"Accept": "*/*"}).json()
