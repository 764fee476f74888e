"""What can be connected to the instruments, and the operator's instruction for each: a sentence and a drawing in text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

ConnectionName = Literal["open-standard", "short-standard", "load-standard", "short", "open", "lisn-motor-off", "lisn-motor-on"]
CONNECTIONS: tuple[ConnectionName, ...] = get_args(ConnectionName)
Condition = Literal["motor running", "motor off"]
# The phase of the LISN that the receiver is on: of an AC supply, or the poles of a DC supply.
Line = Literal["L1", "L2", "L3", "N", "+", "-"]
Standard = Literal["open", "short", "load"]
STANDARDS: dict[Standard, ConnectionName] = {"open": "open-standard", "short": "short-standard", "load": "load-standard"}
# What is connected for a sweep of a known part in the motor's place, by the condition that the sweep is under.
IN_THE_MOTORS_PLACE: dict[str, ConnectionName] = {
    "fixture-open": "open-standard",
    "fixture-short": "short-standard",
    "fixture-load": "load-standard",
    "standards": "load-standard",
}
AT_THE_LISN: dict[Condition, ConnectionName] = {"motor running": "lisn-motor-on", "motor off": "lisn-motor-off"}


@dataclass(frozen=True)
class Instruction:
    """What the operator has to do before the next step.

    Parameters
    ----------
    text : str
        One sentence: which terminals.
    drawing : str
        The same in a few lines of text.
    """

    text: str
    drawing: str

    def __str__(self) -> str:
        return f"{self.text}\n\n{self.drawing}"


_LISN = """\
  supply + -[ LISN ]--- terminal 1 ( motor ) terminal 2 ---[ LISN ]- supply -
               |                    frame                    |
            receiver                  |                   50 Ohm
  ground ======+======================+======================+======="""
_SHORT = """\
  H ----- terminal 1 ( motor ) terminal 2 --+
                       frame                |
  L ---------------------+------------------+"""

INSTRUCTIONS: dict[ConnectionName, Instruction] = {
    "open-standard": Instruction(
        "Leave the fixture open (open standard), with nothing within 10 cm",
        "  H ----o\n              (nothing)\n  L ----o",
    ),
    "short-standard": Instruction(
        "Connect the short standard to the fixture",
        "  H ----o---+\n            |  short standard\n  L ----o---+",
    ),
    "load-standard": Instruction(
        "Connect the load standard to the fixture",
        "  H ----o--+\n          [R]  load standard\n  L ----o--+",
    ),
    "short": Instruction(
        "Connect the analyser between the two terminals of the motor, the far one joined to the frame",
        _SHORT,
    ),
    "open": Instruction(
        "Connect the analyser between one terminal of the motor and its frame, the other terminal left open",
        "  H ----- terminal 1 ( motor ) terminal 2   (open)\n                       frame\n  L ---------------------+",
    ),
    "lisn-motor-off": Instruction(
        "Connect the motor to its supply through the LISN and the receiver to the LISN; the supply stays on, the motor off",
        _LISN,
    ),
    "lisn-motor-on": Instruction(
        "Connect the motor to its supply through the LISN and the receiver to the LISN, and let the motor run",
        _LISN,
    ),
}
