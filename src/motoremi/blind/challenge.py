"""A sealed challenge: a session whose motor may hide an effect, with the truth encoded and its hash in the first document."""

from __future__ import annotations

import base64
import binascii
import hashlib
import secrets
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.blind.cases import draw
from motoremi.blind.scoring import Answer, Outcome, outcome
from motoremi.data.plain import from_json, to_line
from motoremi.data.session import SessionWriter, load
from motoremi.errors import BadInput
from motoremi.simulate.hidden_effects import split_effects
from motoremi.simulate.simulated_motor import SimulatedMotor

SEALED = "challenge/truth.sealed"


@dataclass(frozen=True)
class Revealed:
    """An opened seal.

    Parameters
    ----------
    hidden : tuple of str
    elements : dict
        The seven elements, SI units.
    effects : dict
        Sizes of the hidden effects, SI units.
    answer : Answer or None
        The session's diagnosis, or the user's answer.
    outcome : str or None
        Score of the answer.
    """

    hidden: tuple[str, ...]
    elements: dict[str, float]
    effects: JsonDict
    answer: Answer | None
    outcome: Outcome | None


def make_challenge(out: Path, seed: int) -> Path:
    """Make a session folder with three repeats of each sweep; its first document holds the hash of the salted truth.

    The truth is encoded, so that it is not read by accident, and the hash shows that it was not changed afterwards. It is not protected
    against deliberate reading.
    """
    case = draw(seed, 0)
    in_motor, _ = split_effects(case.hidden)
    truth = SimulatedMotor.random(case.motor_seed, in_motor).truth()
    text = to_line({"salt": secrets.token_hex(16), "hidden": case.hidden, "elements": truth["elements"], "effects": truth["effects"]})
    start = {"simulated": True, "title": "Challenge", "motor": "a motor that may hide something", "analyser": "4294a", "sealed_sha256": _hash(text)}
    with SessionWriter.create(out, start) as writer:
        writer.save_file(SEALED, base64.b64encode(zlib.compress(text.encode())))
        for sweep in case.sweeps():
            writer.add_sweep(sweep)
        writer.close("done")
    return out


def reveal(folder: Path, said: Sequence[str] = ()) -> Revealed:
    """Open the seal and score the stored diagnosis, or the user's answer.

    Raises
    ------
    BadInput
        If the folder is not a challenge, or the truth does not match the hash.
    """
    session = load(folder)
    if "sealed_sha256" not in session.start:
        raise BadInput(f"{folder} is not a challenge: 'motoremi challenge OUT' makes one")
    try:
        text = zlib.decompress(base64.b64decode((folder / SEALED).read_bytes(), validate=True)).decode()
    except (OSError, binascii.Error, zlib.error, UnicodeDecodeError) as error:
        raise BadInput(f"{folder / SEALED} cannot be read: the seal is damaged") from error
    if _hash(text) != session.start["sealed_sha256"]:
        raise BadInput(f"{folder}: the truth does not match the hash that was written first: it was changed")
    truth = from_json(text)
    answer = _stated(said) if said else _diagnosed(session.analysis("diagnosis"))
    hidden = tuple(truth["hidden"])
    return Revealed(hidden, truth["elements"], truth["effects"], answer, None if answer is None else outcome(hidden, answer))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _stated(names: Sequence[str]) -> Answer:
    verdicts = [name for name in names if name in ("adequate", "unexplained")]
    if verdicts and len(names) > 1:
        raise BadInput("say 'adequate' or 'unexplained' alone, or name effects")
    return Answer(verdicts[0], (), (), 1.0) if verdicts else Answer("missing-effect", tuple(names), (), 1.0)


def _diagnosed(stored: JsonDict | None) -> Answer | None:
    if stored is None:
        return None
    return Answer(stored["verdict"], tuple(stored["effects"]), tuple(tuple(family) for family in stored["families"]), stored["confidence"])
