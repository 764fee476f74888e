"""Writing so that a crash or a full disk leaves either the old bytes or the new ones."""

from __future__ import annotations

import os
import secrets
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from motoremi.errors import MotoremiError

# Names of files that are not finished yet; what is left of one after a crash is recognised by this ending.
PENDING_SUFFIX = ".pending"


class StorageError(MotoremiError):
    """A file could not be written, or is being written by somebody else; what was stored before is kept."""

    exit_status = 2


@contextmanager
def told_as_storage_error(target: Path) -> Iterator[None]:
    """Turn an `OSError` into one clear line about `target`."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise StorageError(f"cannot write {target}: {reason}; what was stored before is kept") from error


@contextmanager
def replacing(target: Path, data: bytes) -> Iterator[None]:
    """Prepare `data` beside `target`, run the block, then put it in place in one step.

    If the block fails, `target` stays as it was.
    """
    pending = target.with_name(f".{target.name}.{secrets.token_hex(4)}{PENDING_SUFFIX}")
    try:
        with told_as_storage_error(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with open(pending, "xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        yield
        with told_as_storage_error(target):
            os.replace(pending, target)
            sync_folder(target.parent)
    except BaseException:
        with suppress(OSError):
            pending.unlink(missing_ok=True)
        raise


def write_whole(target: Path, data: bytes) -> None:
    """Write a file whole or not at all.

    Raises
    ------
    StorageError
        If the disk is full or the folder cannot be written.
    """
    with replacing(target, data):
        pass


def sync_folder(folder: Path) -> None:
    """Make a new name in a folder survive a power cut; Windows has no such call and needs none."""
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class AppendFile:
    """A file that only grows, by whole lines; a line that could not be written completely is taken back.

    Parameters
    ----------
    path : Path
    new : bool
        True: the file must not exist yet. False: it is opened, or made.
    """

    def __init__(self, path: Path, *, new: bool) -> None:
        self.path = path
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | (os.O_EXCL if new else 0)
        flags |= getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        with told_as_storage_error(path):
            self._descriptor = os.open(path, flags, 0o666)
            if not os.fstat(self._descriptor).st_size:
                sync_folder(path.parent)

    def append(self, line: str, *, sync: bool) -> None:
        """Add one line in one write.

        Raises
        ------
        StorageError
            If it could not be written; the file then ends where it ended before.
        """
        data = line.encode() + b"\n"
        with told_as_storage_error(self.path):
            # Asked anew each time: a count kept here would be wrong after Ctrl-C between writing and counting.
            before = os.fstat(self._descriptor).st_size
            try:
                written = os.write(self._descriptor, data)
                if written != len(data):
                    raise OSError(f"only {written} of {len(data)} bytes could be written")
                if sync:
                    os.fsync(self._descriptor)
            except BaseException:
                self.cut(before)
                raise

    def cut(self, size: int) -> None:
        """Drop what is beyond `size` bytes."""
        with told_as_storage_error(self.path):
            os.ftruncate(self._descriptor, size)

    def sync(self) -> None:
        """Wait until the disk has it."""
        with told_as_storage_error(self.path):
            os.fsync(self._descriptor)

    def lock(self) -> None:
        """Become the only writer until `close`; the lock of a process that died is gone with it.

        Raises
        ------
        StorageError
            If another writer has it.
        """
        try:
            _lock(self._descriptor)
        except OSError as error:
            raise StorageError(f"{self.path.parent}: another process is writing this session; wait for it") from error

    def close(self) -> None:
        """Give the file, and the lock, back."""
        os.close(self._descriptor)


def is_being_written(path: Path) -> bool:
    """Whether a writer has this file locked."""
    try:
        descriptor = os.open(path, os.O_RDWR)
    except OSError:
        return False
    try:
        _lock(descriptor)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int) -> None:
        # Windows forbids others to read a locked region, so the lock sits on a byte far behind the data.
        os.lseek(descriptor, 0x7FFF0000, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
