"""The operator's answers to a prompt: done, not done, stop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

from motoremi.errors import InstrumentError

Answer = Literal["done", "not done", "stop"]
ANSWERS: tuple[Answer, ...] = get_args(Answer)
# Shows the operator an instruction and returns the answer; None where there is no operator, as on the simulated bench.
Prompt = Callable[[str], Answer | None]
# Answers that may be typed in a terminal; Enter alone means done.
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
