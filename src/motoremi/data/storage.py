"""Write files so that after a crash or on a full disk either the old content or the new one is there."""

from __future__ import annotations

import os
import secrets
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from motoremi.errors import MotoremiError

# Ending of the names of unfinished files, by which they are recognised after a crash.
PENDING_SUFFIX = ".pending"


class StorageError(MotoremiError):
    """A file could not be written, or another process is writing it; the stored content is unchanged.

    Parameters
    ----------
    what : str
        What failed.
    and_now : str
        What that means for what was stored before, if the message says so.
    """

    exit_status = 2

    def __init__(self, what: str, and_now: str = "") -> None:
        super().__init__(f"{what}; {and_now}" if and_now else what)
        self.what = what


@contextmanager
def as_storage_error(target: Path) -> Iterator[None]:
    """Turn an `OSError` into one clear line about `target`."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise StorageError(f"cannot write {target}: {reason}", "what was stored before is kept") from error


@contextmanager
def replacing(target: Path, data: bytes) -> Iterator[None]:
    """Write `data` to a file beside `target`, run the block, then rename the file to `target`.

    If the block fails, `target` is unchanged. A file that is replaced passes on its permissions.
    """
    pending = target.with_name(f".{target.name}.{secrets.token_hex(4)}{PENDING_SUFFIX}")
    try:
        with as_storage_error(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with open(pending, "xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            with suppress(FileNotFoundError):
                shutil.copymode(target, pending)
        yield
        with as_storage_error(target):
            os.replace(pending, target)
            sync_folder(target.parent)
    except BaseException:
        with suppress(OSError):
            pending.unlink(missing_ok=True)
        raise


def write_whole(target: Path, data: bytes) -> None:
    """Write a file completely or not at all.

    Raises
    ------
    StorageError
        If the disk is full or the folder cannot be written.
    """
    with replacing(target, data):
        pass


def sync_folder(folder: Path) -> None:
    """Sync a folder, so that a new name in it survives a power cut; Windows has no such call and does not need it."""
    if sys.platform == "win32":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


class AppendFile:
    """A file to which complete lines are appended; a line that could not be written completely is removed.

    Parameters
    ----------
    path : Path
    new : bool
        True: the file must not exist yet. False: it is opened, or created.
    """

    def __init__(self, path: Path, *, new: bool) -> None:
        self.path = path
        flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | (os.O_EXCL if new else 0)
        flags |= getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        with as_storage_error(path):
            self._descriptor = os.open(path, flags, 0o666)
            if not os.fstat(self._descriptor).st_size:
                sync_folder(path.parent)

    def append(self, line: str, *, sync: bool) -> None:
        """Add one line in one write.

        Raises
        ------
        StorageError
            If it could not be written; the file is then unchanged.
        """
        data = line.encode() + b"\n"
        with as_storage_error(self.path):
            # Read each time: a counter would be wrong after Ctrl-C between writing and counting.
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

    def is_in_place(self) -> bool:
        """Whether the file is still found under its path: neither it nor its folder was moved, removed or replaced since it was opened."""
        try:
            return os.path.samestat(os.fstat(self._descriptor), os.stat(self.path))
        except OSError:
            return False

    def cut(self, size: int) -> None:
        """Remove everything after `size` bytes."""
        with as_storage_error(self.path):
            os.ftruncate(self._descriptor, size)

    def sync(self) -> None:
        """Wait until the content is on disk."""
        with as_storage_error(self.path):
            os.fsync(self._descriptor)

    def lock(self) -> None:
        """Become the only writer until `close`; the system releases the lock of a process that has ended.

        Raises
        ------
        StorageError
            If another process has the lock.
        """
        try:
            _lock(self._descriptor)
        except OSError as error:
            raise StorageError(f"{self.path.parent}: another process is writing to it; wait for it") from error

    def close(self) -> None:
        """Close the file and release the lock."""
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
        # On Windows a locked region cannot be read by others, so a byte far behind the data is locked.
        os.lseek(descriptor, 0x7FFF0000, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
