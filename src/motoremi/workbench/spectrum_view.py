"""The view Emission: the predicted spectrum, the measured one and the limit."""

from __future__ import annotations

from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.emission.judge import place_of
from motoremi.emission.limit import find_limit, limit_names
from motoremi.errors import BadInput
from motoremi.workbench.desk import Desk
from motoremi.workbench.thinning import Band, seen
from motoremi.workbench.views import rounded
from motoremi.workflow_emission import has_motor, limit_of, predict_session


def spectra(desk: Desk, band_hz: Band | None = None) -> JsonDict:
    """Measured spectra, the prediction with its limit if there is one, and the limits to choose from."""
    session = desk.session
    return {
        "spectra": [
            {
                "detector": one.detector,
                "condition": one.condition,
                "line": place_of(one)[0],
                "operating": place_of(one)[1],
                "background": one.is_background,
                "points": len(one),
                "frequency_hz": rounded(one.frequency_hz[kept]),
                "level_dbuv": rounded(one.level_dbuv[kept]),
                "overload": int(one.overload.sum()),
                "summary": one.summary(),
            }
            for one in session.corrected_spectra
            for kept in (seen(one.frequency_hz, one.level_dbuv, band_hz=band_hz),)
        ],
        "prediction": session.analysis("prediction"),
        "modelled": has_motor(session),
        "limit": limit_of(session),
        "limits": _limits(limit_of(session)),
    }


def _limits(chosen: str) -> dict[str, str]:
    """Titles of the built-in limits, and of the user's own if the session has one."""
    titles = {name: find_limit(name).title for name in limit_names()}
    if chosen not in titles:
        try:
            titles[chosen] = find_limit(chosen).title
        except BadInput:  # its file was moved
            titles[chosen] = Path(chosen).stem
    return titles


def predict(desk: Desk, limit: str) -> None:
    """Judge the spectra against a limit, and predict them from the current model; without an open-circuit sweep there is no prediction.

    Raises
    ------
    BadInput
        For any limit that is neither built in nor the session's own: a page cannot name files.
    """
    if limit and limit not in (*limit_names(), limit_of(desk.session)):
        raise BadInput(f"there is no limit of that name; choose one of {', '.join(limit_names())}")
    if has_motor(desk.session) and not desk.steps:
        raise BadInput("a prediction needs the motor's model: fit this session first (view Story)")
    desk.change(lambda store: predict_session(store, None, limit or None))
