"""The view Challenge: diagnose a sealed motor; the user answers first, then the software."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from motoremi.arrays import JsonDict, Progress
from motoremi.blind.challenge import make_challenge, reveal
from motoremi.data.session import Session
from motoremi.errors import BadInput
from motoremi.model.effects import find_effect
from motoremi.workbench.desk import Desk

# The analysis that stores the user's answer.
ANSWER = "challenge-answer"
VERDICTS = ("adequate", "unexplained")


def is_open_challenge(session: Session) -> bool:
    """Whether this is a challenge that the user has not answered yet."""
    return "sealed_sha256" in session.start and session.analysis(ANSWER) is None


def refuse_sealed(session: Session) -> None:
    """Refuse to diagnose a challenge that the user has not answered yet."""
    if is_open_challenge(session):
        raise BadInput("this motor is sealed: give your own answer first (view Challenge)")


def new_challenge(folder: Path, seed: int) -> Path:
    """Make a session with a sealed truth."""
    return make_challenge(folder, seed)


def play(desk: Desk, said: Sequence[str], progress: Progress | None) -> JsonDict:
    """Take the user's answer, diagnose from the paper's circuit, and open the seal.

    Raises
    ------
    BadInput
        If the session is no challenge, was answered before, or the answer names an unknown effect.
    """
    session = desk.session
    if "sealed_sha256" not in session.start:
        raise BadInput("this session is no challenge: begin one first")
    if not is_open_challenge(session):
        raise BadInput("this challenge was answered already")
    if not said:
        raise BadInput("name what the motor hides, or say that nothing is missing")
    for name in said:
        if name not in VERDICTS:
            find_effect(name)
    # Scored before it is stored: an answer that cannot be scored leaves the seal closed.
    reveal(desk.path, said)
    if not desk.steps:
        desk.fit()
    if session.analysis("diagnosis") is None:
        desk.diagnose(progress)
    desk.save(ANSWER, {"schema": "motoremi.challenge-answer/1", "answer": list(said)})
    return revealed(desk)


def revealed(desk: Desk) -> JsonDict:
    """The hidden truth, the user's answer and the software's."""
    session = desk.session
    stored = session.analysis(ANSWER)
    if stored is None:
        raise BadInput("this motor is sealed: give your own answer first")
    said = [str(name) for name in stored.get("answer", [])]
    yours, tool = reveal(desk.path, said), reveal(desk.path)
    return {
        "hidden": list(yours.hidden),
        "elements": yours.elements,
        "yours": {"answer": said, "outcome": yours.outcome},
        "tool": {"answer": None if tool.answer is None else asdict(tool.answer), "outcome": tool.outcome},
    }
