"""What an operator may answer to a prompt: done, not done, stop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

from motoremi.errors import InstrumentError

Answer = Literal["done", "not done", "stop"]
ANSWERS: tuple[Answer, ...] = get_args(Answer)
# Tells the operator what to do and returns the answer; None where nobody is asked, as on the simulated bench.
Prompt = Callable[[str], Answer | None]
# What may be typed at a terminal; Enter alone means done.
TYPED: dict[str, Answer] = {
    "": "done",
    "d": "done",
    "done": "done",
    "y": "done",
    "yes": "done",
    "n": "not done",
    "no": "not done",
    "not done": "not done",
    "s": "stop",
    "stop": "stop",
}


class NotDone(InstrumentError):
    """The operator could not do what a step needs: the run ends, and nothing is measured for that step."""
