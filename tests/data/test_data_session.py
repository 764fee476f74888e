"""The session folder: nothing is lost in a crash, nothing changes unnoticed."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from places import DATA

from motoremi.data import noise as noise_module
from motoremi.data import session as session_module
from motoremi.data.csvfiles import impedance_csv
from motoremi.data.files import parse_impedance_csv, read_impedance
from motoremi.data.noise import estimate_noise
from motoremi.data.session import Session, SessionWriter, StorageError, load, reopen, verify
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep, RepeatedSweep
from motoremi.errors import BadInput

NATIVE = DATA / "eth_4294A_inductor" / "impedance.txt"
FREQUENCY = np.geomspace(150e3, 30e6, 10)
REPORT = b"<p>\xc3\xa9</p>\r\n"


def sweep(termination: str = "short", gain: float = 1.0) -> ImpedanceSweep:
    impedance = gain * (3.3 + 2j * np.pi * FREQUENCY * 1.2e-5)
    return ImpedanceSweep(termination, FREQUENCY, impedance, 1e-3, {"analyser": "4294a", "settings": {"osc_v": 0.5}})


def spectrum() -> Spectrum:
    return Spectrum("quasi-peak", FREQUENCY, 40 + np.sqrt(np.arange(10)), metadata={"lisn": "5 uH"})


def fill(path: Path) -> Path:
    """A small complete session with a file of every sort."""
    with SessionWriter.create(path, {"motor": "A17"}) as writer:
        writer.log_traffic({"write": "*IDN?"})
        writer.add_sweep(sweep())
        writer.add_sweep(sweep(gain=1.01))
        writer.add_sweep(sweep("open"))
        writer.add_spectrum(spectrum())
        writer.log_traffic({"read": "4294A"})
        writer.save_analysis("ladder", {"steps": [{"effects": []}]})
        writer.save_file("report/report.html", REPORT)
    return path


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return fill(tmp_path / "session")


def all_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def content(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in all_files(folder)}


# A whole session


def test_round_trip(session: Path) -> None:
    loaded = load(session)
    assert [s.termination for s in loaded.sweeps] == ["short", "short", "open"]
    for stored, original in zip(loaded.sweeps, [sweep(), sweep(gain=1.01), sweep("open")], strict=True):
        np.testing.assert_array_equal(stored.frequency_hz, original.frequency_hz)
        np.testing.assert_array_equal(stored.impedance_ohm, original.impedance_ohm)
        np.testing.assert_array_equal(stored.sigma_relative, original.sigma_relative)
        assert stored.metadata == original.metadata
    np.testing.assert_array_equal(loaded.spectra[0].level_dbuv, spectrum().level_dbuv)
    assert loaded.spectra[0].metadata == {"lisn": "5 uH"}
    assert loaded.start["motor"] == "A17"
    assert loaded.start["software"].startswith("motoremi ")
    assert loaded.ladder == [{"effects": []}]
    assert loaded.analysis("fit") is None
    assert (loaded.status, loaded.interrupted) == ("done", False)
    assert loaded.traffic() == ({"write": "*IDN?"}, {"read": "4294A"})
    assert (session / "report" / "report.html").read_bytes() == REPORT
    assert verify(session) == []
    assert "3 sweeps" in repr(loaded)
    json.dumps(loaded.to_dict(), allow_nan=False)


def test_files_of_a_session(session: Path) -> None:
    expected = {"session.jsonl", "traffic.jsonl", "manifest.json", "analysis/ladder.json", "report/report.html"}
    expected |= {"sweeps/short-1.csv", "sweeps/short-2.csv", "sweeps/open-1.csv", "spectra/quasi-peak-1.csv"}
    assert set(content(session)) == expected
    assert read_impedance(session / "sweeps" / "open-1.csv", "open").metadata["analyser"] == "4294a"


def test_metadata_of_an_imported_file_survive(tmp_path: Path) -> None:
    native = read_impedance(NATIVE, "short")
    with SessionWriter.create(tmp_path / "s", {}) as writer:
        writer.add_sweep(native)
    stored = load(tmp_path / "s").sweeps[0]
    assert stored.metadata == native.metadata
    np.testing.assert_array_equal(stored.impedance_ohm, native.impedance_ohm)


def test_documents_form_a_chain_that_anybody_can_check(session: Path) -> None:
    lines = (session / "session.jsonl").read_text().splitlines()
    documents = [json.loads(line) for line in lines]
    assert [d["seq"] for d in documents] == list(range(len(lines)))
    assert documents[0]["kind"] == "start"
    assert documents[-1]["kind"] == "stop"
    assert documents[-1]["status"] == "done"
    for before, after in zip(lines, documents[1:], strict=False):
        assert after["previous_sha256"] == hashlib.sha256(before.encode()).hexdigest()
    for document in documents:
        assert document["time"].endswith("+00:00")
        if "file" in document:
            assert document["sha256"] == hashlib.sha256((session / document["file"]).read_bytes()).hexdigest()
    sweep_document = next(d for d in documents if d["kind"] == "sweep")
    assert sweep_document["points"] == 10
    assert sweep_document["span_hz"] == [FREQUENCY[0], FREQUENCY[-1]]


def test_loaded_session_cannot_be_changed(session: Path) -> None:
    loaded = load(session)
    steps = loaded.ladder
    steps.append({})
    analysis = loaded.analysis("ladder")
    assert analysis is not None
    analysis["steps"].clear()
    assert loaded.ladder == [{"effects": []}]
    with pytest.raises(AttributeError):
        loaded.status = "failed"  # type: ignore[misc]


# Documents


def test_emit_returns_stores_and_tells_plain_data(tmp_path: Path) -> None:
    told: list[dict[str, Any]] = []
    with SessionWriter.create(tmp_path / "s", {}) as writer:
        writer.subscribe(told.append)
        document = writer.emit("verdict", passed=np.bool_(True), chi2=np.float64(2.5), bad=float("nan"), n=np.arange(2))
        assert (document["passed"], document["chi2"], document["bad"], document["n"]) == (True, 2.5, None, [0, 1])
        path = writer.add_sweep(sweep())
    assert told[0] == document
    assert [d["kind"] for d in told] == ["verdict", "sweep", "stop"]
    assert told[1]["file"] == path.relative_to(tmp_path / "s").as_posix()
    assert list(load(tmp_path / "s").documents[1:]) == told
    assert "NaN" not in (tmp_path / "s" / "session.jsonl").read_text()


def test_listeners_find_the_file_in_place(tmp_path: Path) -> None:
    seen: list[bytes] = []
    with SessionWriter.create(tmp_path / "s", {}) as writer:
        writer.subscribe(lambda d: seen.append((writer.path / d["file"]).read_bytes()) if "file" in d else None)
        writer.save_analysis("fit", {"n": 1})
        writer.save_analysis("fit", {"n": 2})
    assert [json.loads(data)["n"] for data in seen] == [1, 2]


def test_emit_refuses_what_it_cannot_keep(tmp_path: Path) -> None:
    with SessionWriter.create(tmp_path / "s", {}) as writer:
        with pytest.raises(BadInput, match="'seq'"):
            writer.emit("note", seq=3)
        with pytest.raises(TypeError, match="complex"):
            writer.emit("note", z=1j)
        writer.emit("note", text="still works")
    assert verify(tmp_path / "s") == []
    with pytest.raises(StorageError, match="closed"):
        writer.emit("note")
    with pytest.raises(StorageError, match="closed"):
        writer.add_sweep(sweep())
    writer.close("failed")
    assert load(tmp_path / "s").status == "done"


def test_listener_that_raises_is_dropped_and_the_session_closed(tmp_path: Path) -> None:
    told: list[str] = []

    def bad(document: dict[str, Any]) -> None:
        told.append(document["kind"])
        raise ZeroDivisionError("plot")

    def run() -> None:
        with SessionWriter.create(tmp_path / "s", {}) as writer:
            writer.subscribe(bad)
            writer.emit("note")

    with pytest.raises(ZeroDivisionError):
        run()
    assert told == ["note"]
    loaded = load(tmp_path / "s")
    assert loaded.documents[-1]["reason"] == "ZeroDivisionError: plot"
    assert loaded.status == "failed"


@pytest.mark.parametrize(("error", "status"), [(RuntimeError("the \x1b[31mlink"), "failed"), (KeyboardInterrupt(), "interrupted")])
def test_exception_leaves_a_closed_session_with_the_reason(tmp_path: Path, error: BaseException, status: str) -> None:
    def run() -> None:
        with SessionWriter.create(tmp_path / "s", {}) as writer:
            writer.add_sweep(sweep())
            raise error

    with pytest.raises(type(error)):
        run()
    loaded = load(tmp_path / "s")
    assert (loaded.status, loaded.interrupted, len(loaded.sweeps)) == (status, False, 1)
    assert loaded.documents[-1]["reason"].startswith(type(error).__name__)
    assert "\x1b" not in loaded.documents[-1]["reason"]
    assert verify(tmp_path / "s") == []


# Where a session may be, and what it may name


def test_create_refuses_what_is_not_empty(tmp_path: Path, session: Path) -> None:
    before = content(session)
    with pytest.raises(BadInput, match="not an empty folder"):
        SessionWriter.create(session, {})
    with pytest.raises(BadInput, match="not an empty folder"):
        SessionWriter.create(session / "manifest.json", {})
    assert content(session) == before
    (tmp_path / "empty").mkdir()
    SessionWriter.create(tmp_path / "empty", {}).close("done")
    SessionWriter.create(tmp_path / "new" / "deep", {}).close("done")


BAD_NAMES = ["../x", "/tmp/x", "report/../../x", "", ".", "..", "a//b", "a\\b", "C:/x", ".hidden", "a/.b", "x\n", "r/", "a/ "]
OWN_NAMES = ["session.jsonl", "Manifest.json", "traffic.jsonl", "sweeps/short-1.csv", "SPECTRA/x", "analysis/fit.json"]


@pytest.mark.parametrize("name", BAD_NAMES + OWN_NAMES)
def test_save_file_stays_inside_and_off_the_measurement(session: Path, name: str) -> None:
    with reopen(session) as writer, pytest.raises(BadInput):
        writer.save_file(name, b"x")
    assert verify(session) == []
    assert not list(session.parent.glob("x*"))


@pytest.mark.parametrize("name", ["../fit", "a/b", "", ".fit", "fit\n"])
def test_analysis_names(session: Path, name: str) -> None:
    with reopen(session) as writer, pytest.raises(BadInput, match="cannot name"):
        writer.save_analysis(name, {})


def test_links_are_refused(session: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    writer = reopen(session)
    (session / "linked").symlink_to(outside)
    with pytest.raises(BadInput, match="symbolic link"):
        writer.save_file("linked/x.txt", b"x")
    assert not list(outside.iterdir())
    writer.close("done")
    assert verify(session) == ["linked: is not an ordinary file"]
    (session / "linked").unlink()
    assert verify(session) == []
    original = session / "sweeps" / "short-1.csv"
    shutil.move(original, outside / "short-1.csv")
    original.symlink_to(outside / "short-1.csv")
    assert verify(session)
    with pytest.raises(BadInput, match="symbolic link"):
        load(session)


def forged(tmp_path: Path, **document: Any) -> Path:
    """A session without a manifest whose second document was written by somebody else."""
    with SessionWriter.create(tmp_path / "forged", {}) as writer:
        writer.emit(**document)
    (tmp_path / "forged" / "manifest.json").unlink()
    return tmp_path / "forged"


@pytest.mark.parametrize("name", ["../secret.csv", "/etc/passwd", "sweeps/../../secret.csv", None, 7, ["x"], {}])
def test_document_that_names_a_file_outside(tmp_path: Path, name: object) -> None:
    secret = b"# termination: short\nfrequency_hz,resistance_ohm,reactance_ohm\n1,1,1\n"
    (tmp_path / "secret.csv").write_bytes(secret)
    path = forged(tmp_path, kind="sweep", file=name, sha256=hashlib.sha256(secret).hexdigest(), termination="short")
    with pytest.raises(BadInput, match="cannot name a file"):
        load(path)
    assert verify(path)


# Tampering


@pytest.mark.slow
def test_any_changed_byte_is_found(session: Path) -> None:
    for path in all_files(session):
        original = path.read_bytes()
        positions = sorted({*range(0, len(original), max(len(original) // 60, 1)), len(original) - 1})
        for position in positions:
            for flip in (0x01, 0x20, 0x80):
                changed = bytearray(original)
                changed[position] ^= flip
                path.write_bytes(changed)
                assert verify(session), f"{path.name}, byte {position}, flip {flip}"
        path.write_bytes(original)
    assert verify(session) == []


@pytest.mark.slow
def test_every_byte_of_the_manifest_counts(session: Path) -> None:
    path = session / "manifest.json"
    original = path.read_bytes()
    for position in range(len(original)):
        path.write_bytes(original[:position] + bytes([original[position] ^ 0x01]) + original[position + 1 :])
        assert verify(session), position
    for changed in (original + b"\n", original[:-1], b"", b"{}", b"[" * 50_000, original.replace(b" ", b"\t")):
        path.write_bytes(changed)
        assert verify(session)
        with pytest.raises(BadInput, match="verify"):
            load(session)


def test_removed_and_added_files_are_found(session: Path) -> None:
    for path in all_files(session):
        data = path.read_bytes()
        path.unlink()
        assert any(path.name in problem for problem in verify(session))
        path.write_bytes(data)
    for name in ("note.txt", "sweeps/short-9.csv", ".hidden", ".x.pending"):
        (session / name).write_text("x")
        assert verify(session) == [f"{name}: was added"]
        (session / name).unlink()
    assert verify(session) == []


def test_removed_lines_are_found(session: Path) -> None:
    path = session / "session.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    for index in range(len(lines)):
        path.write_bytes(b"".join(lines[:index] + lines[index + 1 :]))
        assert verify(session)
    path.write_bytes(b"".join(lines[::-1]))
    assert verify(session)


def test_changed_line_is_found_without_a_manifest(session: Path) -> None:
    (session / "manifest.json").unlink()
    path = session / "session.jsonl"
    original = path.read_bytes()
    for changed in (original.replace(b'"A17"', b'"A18"'), original.replace(b'"points":10', b'"points":11', 1)):
        path.write_bytes(changed)
        assert any("does not follow" in problem for problem in verify(session))
        with pytest.raises(BadInput, match="does not follow"):
            load(session)


def test_a_number_is_not_used_again_after_its_file_was_removed(session: Path) -> None:
    with reopen(session) as writer:
        (session / "sweeps" / "short-2.csv").unlink()
        assert writer.add_sweep(sweep(gain=1.02)).name == "short-3.csv"
    assert verify(session) == ["sweeps/short-2.csv: is missing"]
    # The manifest lists the files that were there when the session was closed, so the documents are compared as well.
    with pytest.raises(BadInput, match="is missing"):
        reopen(session)


def test_a_measured_file_that_a_later_document_replaces_is_found(session: Path) -> None:
    """As former versions wrote it when somebody removed the folder of the sweeps during the run."""
    with reopen(session) as writer:
        second = impedance_csv(sweep(gain=1.02)).encode()
        (session / "sweeps" / "short-1.csv").write_bytes(second)
        writer.emit("sweep", file="sweeps/short-1.csv", sha256=hashlib.sha256(second).hexdigest(), termination="short")
    assert verify(session) == ["sweeps/short-1.csv: was changed", "sweeps/short-1.csv: was replaced, 2 documents name it"]
    with pytest.raises(BadInput, match="was changed after it was stored"):
        load(session)


@pytest.mark.skipif(sys.platform == "win32", reason="an open folder cannot be moved there")
@pytest.mark.parametrize("remove", [False, True])
def test_a_folder_that_is_moved_or_removed_ends_the_recording(tmp_path: Path, remove: bool) -> None:
    folder, moved = tmp_path / "s", tmp_path / "moved"
    writer = SessionWriter.create(folder, {"motor": "A17"})
    writer.log_traffic({"write": "*IDN?"})
    writer.add_sweep(sweep())
    shutil.rmtree(folder) if remove else folder.rename(moved)
    writer.log_traffic({"read": "4294A"})
    with pytest.raises(StorageError, match="the session's folder was moved or removed while it was written"):
        writer.add_sweep(sweep(gain=1.01))
    with pytest.raises(StorageError, match="moved or removed"):
        writer.close("failed", "by the test")
    assert not folder.exists()
    if not remove:
        # Everything that was recorded, and why it ended, is where the folder is now.
        found = load(moved)
        assert (len(found.sweeps), len(found.traffic()), found.status) == (1, 2, "failed")
        assert all("interrupted" in problem for problem in verify(moved))


@pytest.mark.parametrize("manifest", [True, False])
def test_changed_sweep_is_not_loaded(session: Path, manifest: bool) -> None:
    path = session / "sweeps" / "short-1.csv"
    path.write_bytes(path.read_bytes().replace(b"150000.0", b"150001.0", 1))
    if not manifest:
        (session / "manifest.json").unlink()
    with pytest.raises(BadInput, match="was changed"):
        load(session)
    assert "sweeps/short-1.csv: was changed" in verify(session)


def test_tampered_session_is_never_extended(session: Path) -> None:
    for path in all_files(session):
        original = path.read_bytes()
        path.write_bytes(original[:-2] + bytes([original[-2] ^ 1]) + original[-1:])
        before = content(session)
        with pytest.raises(BadInput, match=r"nothing is added|no session"):
            reopen(session)
        assert content(session) == before
        path.write_bytes(original)
    reopen(session).close("done")


# Adding later


def test_reopen_adds_and_removes_nothing(session: Path) -> None:
    before = content(session)
    with reopen(session) as writer:
        writer.save_analysis("fit", {"chi2": float("inf")})
        writer.save_analysis("ladder", {"steps": [{"n": 1}, {"n": 2}]})
        writer.save_file("report/report.html", b"new")
        writer.add_sweep(sweep("open", 2.0))
        writer.log_traffic({"write": "again"})
    after = content(session)
    assert verify(session) == []
    for name in ("session.jsonl", "traffic.jsonl"):
        assert after[name].startswith(before[name])
    assert after["sweeps/open-1.csv"] == before["sweeps/open-1.csv"]
    loaded = load(session)
    assert loaded.analysis("fit") == {"chi2": None}
    assert loaded.ladder == [{"n": 1}, {"n": 2}]
    assert len(loaded.sweeps) == 4
    assert (loaded.status, loaded.interrupted) == ("done", False)
    assert len(loaded.traffic()) == 3


@pytest.mark.parametrize("end", [b"", b'{"seq":99,"ti'])
def test_crash_while_adding_leaves_a_loadable_session_that_can_be_completed(session: Path, end: bytes) -> None:
    writer = reopen(session)
    writer.save_analysis("ladder", {"steps": [{"n": 1}]})
    writer.save_analysis("fit", {"n": 1})
    writer.log.close()  # what the death of the process does
    with open(session / "session.jsonl", "ab") as file:
        file.write(end)
    (session / "analysis" / ".fit.json.0000.pending").write_text("half")
    loaded = load(session)
    assert (loaded.status, loaded.interrupted, loaded.ladder) == ("done", True, [{"n": 1}])
    problems = verify(session)
    assert any("addition was interrupted" in problem for problem in problems)
    assert not any("changed" in problem or "missing" in problem for problem in problems)
    with reopen(session) as writer:
        writer.emit("note")
    assert verify(session) == []
    found = next(d for d in load(session).documents if d["kind"] == "reopen" and d["found"])
    assert found.get("unfinished_line", "").encode() == end
    assert load(session).analysis("fit") == {"n": 1}


@pytest.mark.parametrize("name", ["sweeps/short-1.csv", "traffic.jsonl", "session.jsonl", "analysis/ladder.json"])
def test_change_behind_an_interrupted_addition_is_found(session: Path, name: str) -> None:
    writer = reopen(session)
    writer.save_analysis("fit", {})
    writer.log.close()
    path = session / name
    data = path.read_bytes()
    path.write_bytes(data[:9] + bytes([data[9] ^ 1]) + data[10:])
    assert any(name in problem for problem in verify(session))
    with pytest.raises(BadInput, match="nothing is added"):
        reopen(session)


def test_only_one_writer_at_a_time(session: Path) -> None:
    writer = reopen(session)
    with pytest.raises(StorageError, match="another process"):
        reopen(session)
    assert load(session).interrupted
    writer.close("done")
    reopen(session).close("done")
    assert verify(session) == []


# Interruption


ADDING = """
import sys
from motoremi.data.session import reopen
for number in range(60):
    with reopen(sys.argv[1]) as writer:
        writer.save_analysis("ladder", {"number": number})
"""


@pytest.mark.slow
def test_a_reader_sees_a_whole_session_while_another_program_adds_to_it(session: Path) -> None:
    """The page and the command line work on the same session: no reader takes an addition for damage."""
    with subprocess.Popen([sys.executable, "-c", ADDING, str(session)]) as writer:
        seen = set()
        while writer.poll() is None:
            seen.add((load(session).analysis("ladder") or {}).get("number"))
            assert [problem for problem in verify(session) if "was changed" in problem or "was added" in problem] == []
        assert writer.returncode == 0
    assert len(seen) > 5
    assert verify(session) == []


def crash(session: Path, tail: bytes = b"") -> Session:
    """Load the session as it was before its stop document, with the beginning of another line."""
    (session / "manifest.json").unlink()
    path = session / "session.jsonl"
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]) + tail)
    return load(session)


@pytest.mark.parametrize("tail", [b"", b'{"seq":8,"time":"20', b"\0\0\0", b"{}"])
def test_interrupted_session_loads(session: Path, tail: bytes) -> None:
    loaded = crash(session, tail)
    assert (loaded.interrupted, loaded.status, len(loaded.sweeps)) == (True, "interrupted", 3)
    problems = verify(session)
    assert any("interrupted" in problem for problem in problems)
    assert any("not finished" in problem for problem in problems) is bool(tail)
    with reopen(session) as writer:
        writer.save_analysis("fit", {})
    assert verify(session) == []
    again = load(session)
    assert (again.interrupted, again.status) == (False, "interrupted")


WRITER = """
import sys, numpy as np
from motoremi.data.session import SessionWriter
from motoremi.data.sweep import ImpedanceSweep, RepeatedSweep
writer = SessionWriter.create(sys.argv[1], {})
frequency = np.arange(1, 401) * 1e5
for n in range(100_000):
    writer.log_traffic({"n": n})
    writer.add_sweep(ImpedanceSweep("short", frequency, np.full(400, n + 1 + 1j)))
    writer.save_analysis("fit", {"n": n})
    print(n, flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL there")
@pytest.mark.parametrize("rounds", [1, 4, 9])
def test_killed_process_loses_no_completed_sweep(tmp_path: Path, rounds: int) -> None:
    path = tmp_path / "killed"
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process.stdout as said:
        for _ in range(rounds):
            said.readline()
        process.send_signal(signal.SIGKILL)
        acknowledged = rounds + len([line for line in said if line.endswith("\n")])
    assert process.wait() == -signal.SIGKILL
    loaded = load(path)
    assert loaded.interrupted
    assert len(loaded.sweeps) in (acknowledged, acknowledged + 1)
    assert [s.impedance_ohm[0] for s in loaded.sweeps] == [n + 1 + 1j for n in range(len(loaded.sweeps))]
    fit = loaded.analysis("fit")
    assert fit is not None
    assert fit["n"] in (acknowledged - 1, acknowledged)
    with reopen(path) as writer:
        writer.emit("note")
    assert verify(path) == []


# A full disk


def no_space(*_: object, **__: object) -> int:
    raise OSError(errno.ENOSPC, "No space left on device")


def short_write(real: Callable[[int, bytes], int]) -> Callable[[int, bytes], int]:
    return lambda descriptor, data: real(descriptor, data[: len(data) // 2])


@pytest.mark.parametrize("call", ["write", "fsync", "short write"])
def test_full_disk_keeps_what_is_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    writer = SessionWriter.create(tmp_path / "s", {})
    writer.add_sweep(sweep())
    before = content(writer.path)
    with monkeypatch.context() as patch:
        name = "fsync" if call == "fsync" else "write"
        patch.setattr(os, name, short_write(os.write) if call == "short write" else no_space)
        with pytest.raises(StorageError) as caught:
            writer.emit("note", text="x" * 100)
        assert caught.value.exit_status == 2
    assert content(writer.path) == before
    writer.emit("note", text="space again")
    writer.close("done")
    assert verify(tmp_path / "s") == []
    assert len(load(tmp_path / "s").sweeps) == 1


def test_full_disk_while_a_file_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = SessionWriter.create(tmp_path / "s", {})
    writer.save_analysis("fit", {"n": 1})
    before = content(writer.path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", no_space)
        with pytest.raises(StorageError, match=r"No space left on device; what was stored before is kept"):
            writer.add_sweep(sweep())
        with pytest.raises(StorageError, match=r"No space left on device; what was stored before is kept"):
            writer.save_analysis("fit", {"n": 2})
    assert content(writer.path) == before
    writer.close("failed", "disk full")
    assert verify(tmp_path / "s") == []
    assert load(tmp_path / "s").analysis("fit") == {"n": 1}


def test_full_log_while_an_analysis_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = SessionWriter.create(tmp_path / "s", {})
    writer.save_analysis("fit", {"n": 1})
    before = content(writer.path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", no_space)  # the log alone is written by this call
        with pytest.raises(StorageError):
            writer.save_analysis("fit", {"n": 2})
    assert content(writer.path) == before
    assert load(tmp_path / "s").analysis("fit") == {"n": 1}
    writer.close("done")


def test_first_error_is_told_when_closing_fails_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run() -> None:
        with SessionWriter.create(tmp_path / "s", {}) as writer:
            writer.add_sweep(sweep())
            monkeypatch.setattr(os, "write", no_space)
            raise RuntimeError("first")

    with pytest.raises(RuntimeError, match="first") as caught:
        run()
    assert "could not be closed" in caught.value.__notes__[0]
    assert load(tmp_path / "s").interrupted
    assert len(load(tmp_path / "s").sweeps) == 1


# What is no session


def lines_of(*documents: object) -> bytes:
    return b"".join(json.dumps(document).encode() + b"\n" for document in documents)


START = {"seq": 0, "time": "t", "kind": "start", "previous_sha256": "0" * 64, "schema": "motoremi.session/1"}


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\n",
        b"\0" * 100,
        b"garbage\n",
        b"[1]\n",
        b"{}\n",
        b"[" * 100_000 + b"\n",
        b'{"seq":' + b"9" * 10_000 + b"}\n",
        b'{"seq": NaN}\n',
        lines_of({**START, "schema": "other/1"}),
        lines_of({**START, "seq": 1}),
        lines_of({**START, "kind": 5}),
        lines_of(START, START),
        lines_of(START)[:-1],
    ],
)
def test_garbage_is_no_session(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "session.jsonl").write_bytes(data)
    with pytest.raises(BadInput) as caught:
        load(tmp_path)
    assert "\n" not in str(caught.value)
    assert verify(tmp_path)
    with pytest.raises(BadInput):
        reopen(tmp_path)
    assert (tmp_path / "session.jsonl").read_bytes() == data


def test_places_without_a_session(tmp_path: Path) -> None:
    for path in (tmp_path / "missing", tmp_path / "a\0b", NATIVE):
        with pytest.raises(BadInput):
            load(path)
        with pytest.raises(BadInput):
            verify(path)
        with pytest.raises(BadInput):
            reopen(path)
    with pytest.raises(BadInput, match=r"session\.jsonl is missing"):
        load(tmp_path)
    assert verify(tmp_path) == ["session.jsonl: is missing"]


@pytest.mark.parametrize(
    "document",
    [
        {"kind": "analysis", "file": "analysis/fit.json", "name": "fit"},
        {"kind": "spectrum", "file": "spectra/peak-1.csv"},
        {"kind": "sweep", "file": "sweeps/short-1.csv", "termination": "short"},
        {"kind": "sweep", "file": "sweeps/short-1.csv", "termination": ["short"]},
    ],
)
@pytest.mark.parametrize("data", [b"[]", b"\0", b"frequency_hz", None])
def test_documented_file_that_is_garbage(tmp_path: Path, document: dict[str, Any], data: bytes | None) -> None:
    path = forged(tmp_path, **document, sha256=hashlib.sha256(data or b"").hexdigest())
    if data is not None:
        (path / document["file"]).parent.mkdir()
        (path / document["file"]).write_bytes(data)
    with pytest.raises(BadInput) as caught:
        load(path)
    assert Path(document["file"]).name in str(caught.value)


def test_the_same_files_are_read_once(tmp_path, monkeypatch):
    sweep = ImpedanceSweep("short", np.geomspace(1e5, 3e7, 21), np.full(21, 50 + 7j))
    with SessionWriter.create(tmp_path / "s", {"title": "x"}) as writer:
        writer.add_sweep(sweep)
        writer.close("done")
    read = []
    monkeypatch.setattr(session_module, "parse_impedance_csv", lambda *given: read.append(given) or parse_impedance_csv(*given))
    first, second = load(tmp_path / "s").sweeps[0], load(tmp_path / "s").sweeps[0]
    assert len(read) == 1
    assert np.array_equal(first.impedance_ohm, second.impedance_ohm)
    # Nobody can change one, which would be seen in the other.
    with pytest.raises(TypeError, match="immutable"):
        first.metadata["note"] = "mine"


def test_the_noise_of_the_same_sweeps_is_estimated_once(monkeypatch):
    rng = np.random.default_rng(3)
    impedance_ohm = 50 * (1 + 1e-3 * rng.standard_normal((3, 41)))
    asked = []
    monkeypatch.setattr(noise_module, "estimated", lambda *given, own=noise_module.estimated: asked.append(given) or own(*given))

    def sigma(factor: float) -> np.ndarray:
        return estimate_noise(RepeatedSweep("short", np.geomspace(1e5, 3e7, 41), impedance_ohm * factor + 0j, None)).sigma

    assert np.array_equal(sigma(1.0), sigma(1.0))
    assert len(asked) == 1
    sigma(1.5)
    assert len(asked) == 2
