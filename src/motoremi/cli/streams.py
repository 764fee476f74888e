"""Standard streams that may be closed, at the start or while a command runs: a long measurement goes on without its output."""

from __future__ import annotations

import io
import os
import sys
from typing import Any, TextIO


class LastingOutput(io.FileIO):
    """The file of a standard stream. When the program that reads it has closed it, what is written from then on is discarded.

    Attributes
    ----------
    lost : bool
        Whether nobody reads it any more.
    """

    lost = False

    def write(self, data: Any, /) -> int:
        """Write as `io.FileIO` does."""
        try:
            return super().write(data)
        except BrokenPipeError:
            self.lost = True
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return super().write(data)


def secure() -> None:
    """Make the standard streams usable whatever the caller has closed."""
    # In the order of their numbers: opened, each takes the lowest that is free, so that no file of a session becomes the standard output.
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: SIM115
    sys.stdout, sys.stderr = _lasting(sys.stdout), _lasting(sys.stderr)


def is_lost(stream: TextIO) -> bool:
    """Whether nobody reads what is written to a standard stream."""
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)
    return isinstance(raw, LastingOutput) and raw.lost


def _lasting(stream: TextIO | None) -> TextIO:
    if stream is None:
        file = LastingOutput(os.open(os.devnull, os.O_WRONLY), "w", closefd=False)
        file.lost = True
        return io.TextIOWrapper(io.BufferedWriter(file), "utf-8", errors="replace")
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    # A terminal or pipe that cannot hold a character (Ohm sign, a name) gets a question mark for it.
    stream.reconfigure(errors="replace")
    raw: Any = getattr(stream.buffer, "raw", stream.buffer)
    if type(raw) is not io.FileIO:
        return stream
    stream.flush()
    file = LastingOutput(raw.fileno(), "w", closefd=False)
    # With python -u there is no buffer.
    inner: Any = file if raw is stream.buffer else io.BufferedWriter(file)
    return io.TextIOWrapper(inner, stream.encoding, errors="replace", line_buffering=stream.line_buffering, write_through=stream.write_through)
