"""The predicted spectrum, where the room that computes it is there."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from motoremi.errors import BadInput
from motoremi.workbench.desk import Desk

ROOM = "motoremi.workflow_emission"


def available() -> bool:
    """Whether spectra can be predicted."""
    return find_spec(ROOM) is not None


def predict(desk: Desk, limit: str) -> None:
    """Predict the spectrum from the model that stands, and judge it against a limit."""
    if not available():
        raise BadInput("this version does not predict spectra yet")
    room = import_module(ROOM)
    desk.change(lambda store: room.predict_session(store, None, limit or None))
