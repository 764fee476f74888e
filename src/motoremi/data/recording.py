"""Write a session folder, document by document."""

from __future__ import annotations

import importlib.metadata
import os
import re
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, get_args

from motoremi.arrays import JsonDict
from motoremi.data.chain import FIRST, document_line, line_sha256, make_document, read_chain
from motoremi.data.conditions import SingleValue
from motoremi.data.csvfiles import impedance_csv, spectrum_csv
from motoremi.data.manifest import Manifest, list_files, manifest_text, record_bytes, record_file
from motoremi.data.paths import MANIFEST, RESERVED, SESSION, TRAFFIC, inside
from motoremi.data.plain import to_line, to_page
from motoremi.data.spectrum import Spectrum
from motoremi.data.storage import PENDING_SUFFIX, AppendFile, StorageError, as_storage_error, replacing, write_whole
from motoremi.data.sweep import ImpedanceSweep
from motoremi.data.text import clean_text
from motoremi.data.text_file import show_name
from motoremi.data.verify import inspect_session, vouched_sha256
from motoremi.errors import BadInput
from motoremi.interrupts import unbroken

SCHEMA = "motoremi.session/1"
Status = Literal["done", "failed", "interrupted"]
STATUSES: tuple[Status, ...] = get_args(Status)
Listener = Callable[[JsonDict], None]
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_@+.-]*")


class SessionWriter:
    """An open session folder; make one with `SessionWriter.create` or `reopen`.

    As a context manager it closes the session: "done" at the end of the block, "failed" or "interrupted" with the
    reason if an exception leaves it.
    """

    path: Path

    def __init__(
        self, path: Path, log: AppendFile, seq: int, previous_sha256: str, simulated: bool = False, documented: Iterable[str] = ()
    ) -> None:
        self.path = path
        # Every file that a document names. Numbers of measured files are not used again, even if the file was removed.
        self._documented = set(documented)
        # Written into every measured file, so that a copy of it is still marked as simulated.
        self._mark: JsonDict = {"simulated": True} if simulated else {}
        self.log = log
        self._seq = seq
        self._previous = previous_sha256
        self.traffic_log: AppendFile | None = None
        self._listeners: list[Listener] = []
        self._ended = False
        self._closed = False
        # The recorder of an instrument's traffic may run in another thread than the procedure.
        self._turn = threading.RLock()

    @classmethod
    def create(cls, path: str | os.PathLike[str], start: Mapping[str, Any]) -> SessionWriter:
        """Begin a session in a new or empty folder.

        Parameters
        ----------
        path : path-like
        start : mapping
            Content of the "start" document, to which the software's version is added. With `simulated` true every measured file is
            marked as simulated.

        Raises
        ------
        BadInput
            If the folder holds something already.
        StorageError
            If it cannot be made.
        """
        folder = Path(path)
        with as_storage_error(folder):
            is_new = not folder.exists()
            if not is_new and (not folder.is_dir() or any(folder.iterdir())):
                raise BadInput(f"{show_name(folder)}: exists and is not an empty folder; name a new one for the session")
            folder.mkdir(parents=True, exist_ok=True)
        log = AppendFile(folder / SESSION, new=True)
        try:
            log.lock()
            writer = cls(folder, log, 0, FIRST, start.get("simulated") is True)
            writer._append("start", {"schema": SCHEMA, "software": software(), **start})
        except BaseException:
            log.close()
            # Without its first document it is no session, and would stand in the way of the next attempt.
            with suppress(OSError):
                (folder / SESSION).unlink()
                if is_new:
                    folder.rmdir()
            raise
        return writer

    def __enter__(self) -> SessionWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if error is None:
            self.close("done")
            return
        status: Status = "interrupted" if isinstance(error, (KeyboardInterrupt, SystemExit)) else "failed"
        try:
            self.close(status, f"{type(error).__name__}: {error}".removesuffix(": "))
        except StorageError as second:
            # The first error is reported; a full disk is often the cause of both.
            error.add_note(f"the session could not be closed either: {second}")

    def subscribe(self, listener: Listener) -> None:
        """Call `listener` with every document from now on, after it is on disk.

        A listener that raises is removed, and its exception is passed on to the caller of `emit`.
        """
        self._listeners.append(listener)

    def emit(self, kind: str, **content: Any) -> JsonDict:
        """Append one document, wait until it is on disk, and call the listeners.

        Returns
        -------
        dict
            The document as stored: plain data, with None for numbers that are not finite.

        Raises
        ------
        StorageError
            If it cannot be written; the session is then unchanged.
        """
        with self._turn:
            document = self._append(kind, content)
            self._notify(document)
        return document

    def add_sweep(self, sweep: ImpedanceSweep) -> Path:
        """Store a sweep as `sweeps/<termination>-<n>.csv`, or `sweeps/<termination>-<condition>-<n>.csv`, and emit a "sweep" document."""
        low, high = sweep.span_hz
        content = {"termination": sweep.termination, "points": len(sweep), "span_hz": [low, high], **_state(sweep.metadata)}
        stem = f"sweeps/{sweep.termination}"
        if sweep.condition is not None:
            content["condition"] = sweep.condition.to_dict()
            stem = f"{stem}-{sweep.condition.id}"
        return self._add_numbered("sweep", stem, impedance_csv(sweep.with_metadata(**self._mark)), content)

    def add_value(self, value: SingleValue) -> JsonDict:
        """Emit a "value" document: a value from another meter."""
        return self.emit("value", **value.to_dict())

    def add_spectrum(self, spectrum: Spectrum) -> Path:
        """Store a spectrum as `spectra/<detector>-<n>.csv` (a background as `<detector>-motor-off-<n>`) and emit a "spectrum" document."""
        low, high = float(spectrum.frequency_hz[0]), float(spectrum.frequency_hz[-1])
        content = {
            "detector": spectrum.detector,
            "condition": spectrum.condition,
            "points": len(spectrum),
            "span_hz": [low, high],
            **_state(spectrum.metadata),
        }
        stem = f"spectra/{spectrum.detector}{'-motor-off' if spectrum.is_background else ''}"
        return self._add_numbered("spectrum", stem, spectrum_csv(spectrum.with_metadata(**self._mark)), content)

    def add_final(self, spectrum: Spectrum) -> Path:
        """Store a short scan around a maximum as `spectra/final-<detector>-<n>.csv` and emit a "final" document."""
        low, high = float(spectrum.frequency_hz[0]), float(spectrum.frequency_hz[-1])
        maximum = {key: spectrum.metadata[key] for key in ("maximum_hz", "line", "operating") if key in spectrum.metadata}
        maximum["highest_dbuv"] = float(spectrum.level_dbuv.max())
        content = {"detector": spectrum.detector, **maximum, "points": len(spectrum), "span_hz": [low, high], **_state(spectrum.metadata)}
        return self._add_numbered("final", f"spectra/final-{spectrum.detector}", spectrum_csv(spectrum.with_metadata(**self._mark)), content)

    def add_standard(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Store a sweep of a standard in the fixture as `standards/<standard>-<n>.csv`, apart from the sweeps of the motor."""
        low, high = sweep.span_hz
        content = {"standard": standard, "points": len(sweep), "span_hz": [low, high]}
        return self._add_numbered("standard", f"standards/{standard}", impedance_csv(sweep.with_metadata(**self._mark)), content)

    def add_compensation(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Store the instrument's own compensation data of a standard as `compensation/<standard>-<n>.csv`, and emit a "compensation" document."""
        low, high = sweep.span_hz
        content = {"standard": standard, "points": len(sweep), "span_hz": [low, high]}
        return self._add_numbered("compensation", f"compensation/{standard}", impedance_csv(sweep.with_metadata(**self._mark)), content)

    def save_analysis(self, name: str, payload: Mapping[str, Any]) -> Path:
        """Store `analysis/<name>.json`, in place of an older one, and emit an "analysis" document.

        Raises
        ------
        BadInput
            If the name is not letters, digits and `_ @ + . -`.
        """
        if not _NAME.fullmatch(name):
            raise BadInput(f"{clean_text(repr(name), 80)} cannot name an analysis; use letters, digits and _ @ + . -")
        return self._store("analysis", f"analysis/{name}.json", to_page(payload).encode(), {"name": name})

    def save_file(self, relative_path: str, data: bytes) -> Path:
        """Store any other file, for example `report/report.html`, and emit a "file" document.

        Raises
        ------
        BadInput
            If the name leaves the folder, is a link, or is reserved for measured data.
        """
        if relative_path.split("/", 1)[0].casefold() in RESERVED:
            raise BadInput(f"{clean_text(relative_path, 80)}: this name is reserved for the session itself; use another folder")
        return self._store("file", relative_path, data, {})

    def log_traffic(self, record: Mapping[str, Any]) -> None:
        """Append one line to `traffic.jsonl`, which is synced to disk at the next sweep and at the end."""
        with self._turn:
            self._must_be_open()
            if self.traffic_log is None:
                self._must_be_in_place()
                self.traffic_log = AppendFile(inside(self.path, TRAFFIC), new=False)
            self.traffic_log.append(to_line(record), sync=False)

    def end(self) -> None:
        """Emit the "stop" document of a completed measurement, while the session stays open for its report."""
        with self._turn:
            self._sync_traffic()
            self._ended = True
            self.emit("stop", status="done", reason="")

    def close(self, status: Status, reason: str = "") -> None:
        """Emit the "stop" document, unless `end` has done so and the status is "done"; then write the manifest. Closing twice does nothing.

        Parameters
        ----------
        status : {"done", "failed", "interrupted"}
        reason : str, optional
            The reason, in words.
        """
        if status not in STATUSES:
            raise BadInput(f"unknown status {status!r}: use one of {', '.join(STATUSES)}")
        with self._turn:
            if self._closed:
                return
            with unbroken():
                document = self._closing(status, reason)
            if document is not None:
                self._notify(document)

    def _closing(self, status: Status, reason: str) -> JsonDict | None:
        try:
            self._sync_traffic()
            has_stop = self._ended and status == "done"
            document = None if has_stop else self._append("stop", {"status": status, "reason": clean_text(reason)})
            self._must_be_in_place()
            with as_storage_error(self.path / MANIFEST):
                files, _ = list_files(self.path)
                records = {name: record_file(self.path / name) for name in files}
            text = manifest_text(Manifest(self._seq, records), software())
            write_whole(self.path / MANIFEST, text.encode())
            return document
        finally:
            self._closed = True
            if self.traffic_log is not None:
                self.traffic_log.close()
            self.log.close()

    def _must_be_open(self) -> None:
        if self._closed:
            raise StorageError(f"{self.path}: the session is closed; reopen it to add to it")

    def _must_be_in_place(self) -> None:
        # Documents and traffic go to open files, which stay those of a folder that was moved. A new file would make a second, broken session.
        if not self.log.is_in_place():
            raise StorageError(
                f"{self.path}: the session's folder was moved or removed while it was written; what was stored before is in the moved folder, "
                "which motoremi run --resume can continue"
            )

    def _append(self, kind: str, content: Mapping[str, Any]) -> JsonDict:
        self._must_be_open()
        time = datetime.now(UTC).isoformat(timespec="microseconds")
        document = make_document(self._seq, time, kind, self._previous, content)
        line = document_line(document)
        with unbroken():
            self.log.append(line, sync=True)
            self._seq += 1
            self._previous = line_sha256(line)
            if isinstance(file := document.get("file"), str):
                self._documented.add(file)
        return document

    def _notify(self, document: JsonDict) -> None:
        for listener in tuple(self._listeners):
            try:
                listener(document)
            except Exception:
                # It must not be called again with the "stop" document that its own exception causes.
                self._listeners.remove(listener)
                raise

    def _add_numbered(self, kind: str, stem: str, text: str, content: Mapping[str, Any]) -> Path:
        with self._turn:
            self._sync_traffic()
            number = 1
            while (name := f"{stem}-{number}.csv") in self._documented or inside(self.path, name).exists():
                number += 1
            return self._store(kind, name, text.encode(), content)

    def _store(self, kind: str, relative: str, data: bytes, content: Mapping[str, Any]) -> Path:
        with self._turn:
            self._must_be_open()
            self._must_be_in_place()
            target = inside(self.path, relative)
            entry = {"file": relative, "sha256": record_bytes(data).sha256, **content}
            with unbroken():
                if target.exists():
                    # The document is written first: after a crash in between, the old file still agrees with its old document.
                    with replacing(target, data):
                        document = self._append(kind, entry)
                else:
                    # The file is written first: after a crash in between, no document names a file that does not exist.
                    write_whole(target, data)
                    document = self._append(kind, entry)
            self._notify(document)
        return target

    def _sync_traffic(self) -> None:
        if self.traffic_log is not None:
            self.traffic_log.sync()


def reopen(path: str | os.PathLike[str]) -> SessionWriter:
    """Open a session to add analyses and reports; nothing that was stored is removed.

    An interrupted session can be reopened too if all files that its documents name are unchanged: the "reopen" document then
    records what was found, and the unfinished last line if there was one.

    Raises
    ------
    BadInput
        If there is no session, or anything in it was changed since it was stored.
    StorageError
        If another process is writing it.
    """
    folder = Path(path)
    if not (folder / SESSION).is_file():
        raise BadInput(f"{show_name(folder)}: no session here ({SESSION} is missing)")
    log = AppendFile(folder / SESSION, new=False)
    try:
        log.lock()
        findings = inspect_session(folder)
        if findings.damage:
            raise BadInput(
                f"{show_name(folder)}: {findings.damage[0]}; nothing is added to a session that was changed (motoremi verify lists all problems)"
            )
        data = (folder / SESSION).read_bytes()
        chain = read_chain(data)
        if not chain.documents or chain.documents[0].get("schema") != SCHEMA:
            raise BadInput(f"{show_name(folder)}: no session here ({SESSION} has no start document)")
        _remove_unfinished(folder)
        if chain.torn:
            log.cut(len(data) - len(chain.torn))
        is_simulated = chain.documents[0].get("simulated") is True
        writer = SessionWriter(folder, log, len(chain.documents), chain.last_sha256, is_simulated, vouched_sha256(chain))
        found: JsonDict = {"software": software(), "found": list(findings.interruption)}
        if chain.torn:
            found["unfinished_line"] = chain.torn.decode("ascii", "backslashreplace")
        if torn := _cut_torn_traffic(folder):
            found["unfinished_traffic"] = torn.decode("ascii", "backslashreplace")
        writer._append("reopen", found)
    except BaseException:
        log.close()
        raise
    return writer


def _state(metadata: Mapping[str, Any]) -> JsonDict:
    """The motor's state, where it was measured."""
    return {"state": metadata["state"]} if "state" in metadata else {}


def software() -> str:
    """Name and version of this software."""
    return f"motoremi {importlib.metadata.version('motoremi')}"


def _cut_torn_traffic(folder: Path) -> bytes:
    """Remove a last line whose writing was interrupted, because the next line would be appended to it."""
    path = inside(folder, TRAFFIC)
    if not path.exists():
        return b""
    data = path.read_bytes()
    torn = data[data.rfind(b"\n") + 1 :]
    if torn:
        file = AppendFile(path, new=False)
        file.cut(len(data) - len(torn))
        file.close()
    return torn


def _remove_unfinished(folder: Path) -> None:
    for name in list_files(folder)[0]:
        if name.endswith(PENDING_SUFFIX) and Path(name).name.startswith("."):
            (folder / name).unlink(missing_ok=True)
