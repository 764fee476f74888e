"""Interruption of work: signals, which are handled in background programs too and delayed in critical sections, and a user's Cancel."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from types import FrameType

from motoremi.errors import MotoremiError

# Signals that the command line turns into an exception.
_SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextmanager
def stopped_by_signals() -> Iterator[None]:
    """Ctrl-C, SIGTERM and a closed terminal (SIGHUP) raise `KeyboardInterrupt` while the block runs.

    The handlers are set even if a signal was ignored from the start, as Ctrl-C is in a program that a script started in the background;
    otherwise only SIGKILL could end it. An ignored SIGHUP stays ignored, because that is the purpose of `nohup`.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    hang_up = getattr(signal, "SIGHUP", None)
    handled = [number for number in _SIGNALS if not (number == hang_up and signal.getsignal(number) is signal.SIG_IGN)]
    before = {number: signal.signal(number, signal.default_int_handler) for number in handled}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def unbroken() -> Iterator[None]:
    """Delay signals until the end of the block.

    Python raises `KeyboardInterrupt` between any two instructions of the main thread, for example between writing a line and
    recording that it was written. Other threads are never interrupted.
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
    """The user cancelled the work; nothing was stored."""

    exit_status = 130


_asked: ContextVar[Callable[[], bool] | None] = ContextVar("_asked", default=None)


@contextmanager
def cancelled_by(asked: Callable[[], bool]) -> Iterator[None]:
    """While the block runs, `checkpoint` raises `Cancelled` in this thread as soon as `asked` returns True."""
    token = _asked.set(asked)
    try:
        yield
    finally:
        _asked.reset(token)


def checkpoint() -> None:
    """Raise `Cancelled` if the user asked for it; long computations call this at least every second, where stopping is safe."""
    asked = _asked.get()
    if asked is not None and asked():
        raise Cancelled("cancelled: nothing was stored")
