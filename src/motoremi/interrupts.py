"""What stops work: signals, heard wherever a program was started from and held back for what must not stop half-way; and a user's Cancel."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType

from motoremi.errors import MotoremiError

# Those that the command line turns into an exception.
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Ctrl-C, a polite kill and a closed terminal raise `KeyboardInterrupt` while the block runs.

    The handlers are set even where a signal was ignored from the start, as Ctrl-C is in a program that a script started in the background:
    otherwise nothing but a hard kill would end it. Only a hang-up that is ignored stays so, because `nohup` asks for exactly that.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    hang_up = getattr(signal, "SIGHUP", None)
    heard = [number for number in _SIGNALS if not (number == hang_up and signal.getsignal(number) is signal.SIG_IGN)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in heard}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def unbroken() -> Iterator[None]:
    """Hold signals back while the block runs; they are heard at its end.

    Python raises `KeyboardInterrupt` between any two instructions of the main thread: also between a line that is written and
    the note that it was. Other threads are never interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: dict[int, FrameType | None] = {}
    before = {number: handler for number in _SIGNALS if callable(handler := signal.getsignal(number))}
    try:
        for number in before:
            signal.signal(number, waiting.__setitem__)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number, frame in waiting.items():
            before[number](number, frame)


class Cancelled(MotoremiError):
    """The user gave up waiting; nothing was stored."""

    exit_status = 130


_asked: ContextVar[Callable[[], bool] | None] = ContextVar("_asked", default=None)


@contextmanager
def cancelled_by(asked: Callable[[], bool]) -> Iterator[None]:
    """`checkpoint` raises `Cancelled` while the block runs, in this thread, once `asked` says so."""
    token = _asked.set(asked)
    try:
        yield
    finally:
        _asked.reset(token)


def checkpoint() -> None:
    """Long computations call this at least every second, where stopping harms nothing."""
    asked = _asked.get()
    if asked is not None and asked():
        raise Cancelled("cancelled: nothing was stored")
