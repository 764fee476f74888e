"""A workbench for tests: its application behind a test client, or served on loopback; sessions to open in it."""

from __future__ import annotations

import json
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
from conftest import FREQUENCY_HZ, simulated_sweeps
from few_effects import seeking
from made_once import made_once
from starlette.testclient import TestClient

from motoremi.data.session import SessionWriter
from motoremi.data.spectrum import Spectrum
from motoremi.schema.procedure import Procedure, load_procedure, parse_procedure
from motoremi.workbench.desk import Desk
from motoremi.workbench.routes import Workbench, make_app
from motoremi.workbench.server import Server
from motoremi.workbench.shelf import Shelf

HOST = "127.0.0.1:8123"
TOKEN = "a-token-for-tests"
# What a file or an instrument may try on a page, a terminal or a spreadsheet.
ATTACKS = (
    "<script>window.hacked=1</script>",
    "<img src=x onerror=window.hacked=1>",
    "<svg onload=window.hacked=1>",
    "\"><iframe src='javascript:parent.hacked=1'></iframe>",
    "' onmouseover='window.hacked=1' x='",
    "javascript:window.hacked=1",
    "</title></style></script><b>bold</b>",
    "{{7*7}}${7*7}<%= 7*7 %>",
    "&lt;script&gt;&#60;b&#62;",
    "\x1b[31mred\x1b]0;title\x07",
    "\u202eesrever\u2066\u200b",
    '=HYPERLINK("http://example.invalid")',
    "../../../etc/passwd\x00.csv",
    "data: x\n\nevent: state\ndata: {}",
)


def bench_of(folder: Path, *sessions: Path) -> Workbench:
    """The state of a workbench in a folder."""
    return Workbench(Shelf(folder, sessions))


def client_of(workbench: Workbench, token: str = TOKEN) -> TestClient:
    """A client that shows the token with each request."""
    app = make_app(workbench, TOKEN, {HOST})
    return TestClient(app, base_url=f"http://{HOST}", headers={"Authorization": f"Bearer {token}"})


def make_session(folder: Path, seed: int = 7, effects: tuple[str, ...] = ("eddy-laminations",), **start: Any) -> Path:
    """A session with sweeps of a simulated motor and a spectrum."""
    sweeps, _ = simulated_sweeps(seed, effects)
    with SessionWriter.create(folder, {"title": "test", "motor": "motor", "analyser": "4294a", **start}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep)
        writer.add_spectrum(Spectrum("peak", FREQUENCY_HZ, 60 - 10 * (FREQUENCY_HZ / 30e6)))
        writer.close("done")
    return folder


def make_fitted_session(folder: Path) -> Path:
    """Such a session, fitted and diagnosed; that is done once, then copied."""
    shutil.copytree(made_once("fitted-session", _make_fitted_session), folder)
    return folder


def _make_fitted_session(folder: Path) -> None:
    desk = Desk(make_session(folder))
    desk.fit()
    with seeking():
        desk.diagnose()


def measuring_only(name: str) -> Procedure:
    """A ready procedure without the steps that analyse, for runs of which only the measuring is looked at."""
    source = load_procedure(name).source
    steps = [step for step in source["steps"] if step["do"] not in ("fit", "compare", "diagnose", "report")]
    return parse_procedure({**source, "steps": steps}, name)


@contextmanager
def served(workbench: Workbench, port: int = 0) -> Iterator[str]:
    """The workbench on a port of its own, or on one that it had before; gives the address with the token."""
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(("127.0.0.1", port))
    listener.listen()
    port = listener.getsockname()[1]
    app = make_app(workbench, TOKEN, {f"127.0.0.1:{port}"})
    server = Server(app, workbench)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{port}/?token={TOKEN}"
    finally:
        workbench.leave()
        server.should_exit = True
        thread.join()
        listener.close()


@contextmanager
def listening(address: str) -> Iterator[Iterator[tuple[str, Any]]]:
    """The events that a page would see."""
    base = address.partition("/?")[0]
    with httpx.stream("GET", f"{base}/api/events", headers={"Authorization": f"Bearer {TOKEN}"}, timeout=120) as answer:
        yield _events(answer.iter_lines())


def _events(lines: Iterator[str]) -> Iterator[tuple[str, Any]]:
    kind = ""
    for line in lines:
        if line.startswith("event: "):
            kind = line.removeprefix("event: ")
        elif line.startswith("data: "):
            yield kind, json.loads(line.removeprefix("data: "))


def until(condition: Any, seconds: float = 120.0) -> None:
    """Wait for something that another thread brings about; the time only ends a test that would hang."""
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        time.sleep(0.02)
