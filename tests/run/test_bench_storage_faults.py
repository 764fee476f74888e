"""A process that is killed and a disk that is full: what was stored stays, and the run can go on."""

from __future__ import annotations

import builtins
import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fault_matrix import BENCH_FILE, SEED, measured, small
from places import TESTS

from motoremi.data import storage
from motoremi.data.session import Session, SessionWriter, StorageError, load, reopen, verify
from motoremi.run.runner import resumable, run, start_document
from motoremi.virtual.simulated_bench import SimulatedBench

pytestmark = pytest.mark.slow

# `make kills` does 200.
KILLS = 20
# What takes half a minute on a slow machine ends here at the latest.
DEADLINE_S = 300


def ignore_ctrl_c() -> None:
    """As scripts and CI runners start what they put into the background."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@pytest.mark.skipif(sys.platform == "win32", reason="no fork there")
@pytest.mark.parametrize("number", ["SIGKILL", "SIGINT"])
def test_stopped_at_random_moments_loses_no_sweep_and_goes_on(number: str) -> None:
    command = [sys.executable, TESTS / "kill_run.py", str(KILLS), number, "impedance_only"]
    env = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=env, timeout=DEADLINE_S, preexec_fn=ignore_ctrl_c)
    told = json.loads(done.stdout)
    assert told["problems"] == [], done.stderr
    assert done.returncode == 0, done.stderr
    assert (told["kills"], told["lost"]) == (KILLS, 0)
    # Random moments: before the first sweep, after the last one, and in between.
    assert len(told["kept"]) >= 4


class Disk:
    """A disk with room for so many bytes: the write that does not fit is cut, as the kernel does it, and every later one fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, room: int) -> None:
        self.room = room
        write, open_ = os.write, builtins.open

        def limited(descriptor: int, data: bytes) -> int:
            return write(descriptor, self.take(data))

        def opened(path: Any, mode: str = "r", **others: Any) -> Any:
            file = open_(path, mode, **others)
            if "x" in mode:
                inner = file.write
                file_write = lambda data: inner(self.take(data, whole=True))  # noqa: E731
                return _Wrapped(file, file_write)
            return file

        monkeypatch.setattr(storage.os, "write", limited)
        monkeypatch.setattr(storage, "open", opened, raising=False)

    def take(self, data: bytes, whole: bool = False) -> bytes:
        fits = data[: self.room]
        self.room -= len(fits)
        if not fits or (whole and len(fits) < len(data)):
            raise OSError(errno.ENOSPC, "No space left on device")
        return fits


class _Wrapped:
    def __init__(self, file: Any, write: Any) -> None:
        self._file, self.write = file, write

    def __enter__(self) -> _Wrapped:
        return self

    def __exit__(self, *trouble: object) -> None:
        self._file.close()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Session:
    bench = SimulatedBench(SEED)
    session = measured(tmp_path_factory.mktemp("reference") / "s", small(), bench)
    bench.close()
    return session


def test_a_full_disk_is_an_error_that_keeps_what_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reference: Session) -> None:
    size = sum(file.stat().st_size for file in reference.path.rglob("*") if file.is_file())
    names = [str(d["file"]) for d in reference.documents if d["kind"] in ("sweep", "spectrum")]
    stored = set()
    for part in range(1, 20, 2):
        folder = tmp_path / f"room-{part}"
        bench = SimulatedBench(SEED)
        with monkeypatch.context() as patch:
            writer = SessionWriter.create(folder, start_document(small(), BENCH_FILE))
            Disk(patch, size * part // 20)
            with pytest.raises(StorageError, match="No space left on device; what was stored before is kept") as caught:
                run(small(), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
        assert caught.value.exit_status == 2
        assert "\n" not in str(caught.value)
        # The instruments were made safe although nothing could be written any more.
        assert bench.devices["analyser"].value("level") == 0.005 or "instrument" not in [d["kind"] for d in load(folder).documents]
        session = load(folder)
        kept = [str(d["file"]) for d in session.documents if d["kind"] in ("sweep", "spectrum")]
        stored.add(len(kept))
        assert kept == names[: len(kept)]
        for name in kept:
            assert (folder / name).read_bytes() == (reference.path / name).read_bytes()
        assert all("interrupted" in problem or "not finished" in problem for problem in verify(folder))
        # With room again it goes on.
        procedure, done = resumable(session, BENCH_FILE)
        run(procedure, bench, reopen(folder), analyse=lambda *_: None, prompt=lambda text: None, done=done)
        assert verify(folder) == []
        assert len(load(folder).sweeps) == len(reference.sweeps)
        bench.close()
    assert {0, len(names) - 1} & stored
    assert len(stored) > 4


@pytest.mark.skipif(sys.platform == "win32", reason="no file size limit there")
def test_the_kernel_refusing_a_write_is_one_line_and_exit_2(tmp_path: Path) -> None:
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (60000, 60000));"
        "sys.argv = ['motoremi', 'run', 'impedance_only', '--bench', 'sim', '--out', sys.argv[1]];"
        "from motoremi.cli import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "s")], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("motoremi: cannot write")
    assert done.stderr.count("\n") == 1
    assert done.stderr.endswith("bytes could be written; what was stored before is kept\n")
    assert not [p for p in verify(tmp_path / "s") if "interrupted" not in p and "not finished" not in p]


@pytest.mark.skipif(sys.platform == "win32", reason="an open folder cannot be moved there")
def test_a_session_folder_that_is_moved_stops_the_run_and_can_go_on_where_it_is(tmp_path: Path) -> None:
    bench = SimulatedBench(SEED)
    writer = SessionWriter.create(tmp_path / "s", start_document(small(), BENCH_FILE))

    def move(document: dict[str, Any]) -> None:
        if document.get("file") == "sweeps/short-2.csv":
            (tmp_path / "s").rename(tmp_path / "moved")

    writer.subscribe(move)
    with pytest.raises(StorageError, match="the session's folder was moved or removed while it was written") as caught:
        run(small(), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    assert caught.value.exit_status == 2
    assert not (tmp_path / "s").exists()
    assert bench.devices["analyser"].value("level") == 0.005
    session = load(tmp_path / "moved")
    assert [document["safe"] for document in session.documents if document["kind"] == "safe"]
    assert (session.status, len(session.sweeps)) == ("failed", 2)
    procedure, done = resumable(session, BENCH_FILE)
    run(procedure, bench, reopen(tmp_path / "moved"), analyse=lambda *_: None, prompt=lambda text: None, done=done)
    bench.close()
    assert verify(tmp_path / "moved") == []
    assert len(load(tmp_path / "moved").sweeps) == 6
