"""The view Next: what to measure next, what was measured so far, and the answer as files or as a value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from motoremi.arrays import JsonDict, Progress
from motoremi.data.conditions import CONDITIONS, VALUES, parse_condition, parse_value
from motoremi.data.session import Session, is_up_to_date
from motoremi.errors import BadInput
from motoremi.interrupts import Cancelled
from motoremi.investigation.menu import MENU
from motoremi.investigation.question import NOTHING_ASKED
from motoremi.workbench.challenge_view import refuse_sealed
from motoremi.workbench.desk import Desk
from motoremi.workbench.tray import Tray
from motoremi.workbench.views import readable
from motoremi.workflow import diagnose_session
from motoremi.workflow_ask import chosen, refuse_unknown
from motoremi.workflow_import import ImportOptions, addition
from motoremi.workflow_investigate import ENDS, taught_bits

LONGEST = 200


def content(desk: Desk, benches: Sequence[str], without: Sequence[str] = ()) -> JsonDict:
    """The next measurement, the explanations with their probabilities, and the measurements so far.

    Parameters
    ----------
    desk : Desk
    benches : sequence of str
        The benches on which this session can be investigated.
    without : sequence of str
        Measurements that cannot be made here.

    Raises
    ------
    BadInput
        If there is no diagnosis.
    """
    session = desk.session
    refuse_sealed(session)
    refuse_unknown(without)
    stored = session.analysis("diagnosis")
    if stored is None:
        raise BadInput("there is no diagnosis yet: diagnose this session first (view Story)")
    return readable(lambda: _shown(session, stored, benches, without))


# For a diagnosis by an earlier version, which requests no measurement.
_NO_QUESTION: JsonDict = {**NOTHING_ASKED, "schema": "", "stop": "", "why": "", "alternatives": [], "probabilities": {}}


def _shown(session: Session, stored: JsonDict, benches: Sequence[str], without: Sequence[str]) -> JsonDict:
    asked = chosen(stored.get("question", _NO_QUESTION), without)
    advice = stored["next_measurement"]
    actions = {option.name: option.action for option in MENU}
    return {
        # The measurement that would confirm the diagnosis, if none is requested.
        "advice": {"id": str(advice["id"]), "action": actions.get(advice["id"], ""), "why": str(advice["why"])},
        "stop": asked["stop"],
        "end": ENDS.get(str(asked["stop"]), ""),
        "why": asked["why"],
        "asked": None if asked["asks"] is None else _one(asked),
        "alternatives": [_one(one) for one in asked["alternatives"]],
        "probabilities": [[name, float(share)] for name, share in asked["probabilities"].items()],
        "steps": [_step(step) for step in (session.analysis("investigation") or {}).get("steps", [])],
        "without": list(without),
        # Data were added since the diagnosis, so the request is out of date.
        "newer": not is_up_to_date(session),
        "benches": list(benches),
    }


def _one(entry: JsonDict) -> JsonDict:
    """A measurement: instruction, duration, and how its result is given."""
    asks = entry["asks"]
    name = str(asks["condition"] if asks["kind"] == "value" else entry["condition_id"] or "")
    setting = VALUES[name].setting if asks["kind"] == "value" else CONDITIONS.get(name)
    return {
        "id": str(entry["id"]),
        "kind": str(asks["kind"]),
        "instruction": str(asks["instruction"]),
        "termination": str(asks["termination"] or ""),
        "minutes": float(entry["minutes"]),
        "information_bits": float(entry["information_bits"]),
        # Condition or name of the value under which the result is added; empty for further repeats of the motor as it is.
        "answer": name,
        "example": "" if setting is None else setting.example,
        "wished": "" if asks["value"] is None else f"{float(asks['value']):g}{asks['unit']}",
    }


def _step(step: JsonDict) -> JsonDict:
    """An earlier measurement: made on the bench, or imported from files."""
    shares = sorted(step.get("probabilities", {}).items(), key=lambda pair: -pair[1])
    return {
        "asked": str(step.get("id") or step.get("asked") or ""),
        "brought": str(step.get("brought", "")),
        "minutes": step.get("minutes"),
        "taught_bits": step.get("taught_bits"),
        "then": list(shares[0]) if shares else None,
    }


def bring(desk: Desk, tray: Tray, body: JsonDict, progress: Progress) -> JsonDict:
    """Add the chosen files or a value to the session, and diagnose it anew.

    Parameters
    ----------
    body : dict
        `value`, such as `dc-resistance=21.3mohm`; or for files `condition`, such as `second-temperature=53degC`, empty for repeats.
    """
    refuse_sealed(desk.session)
    value, condition = _text(body, "value"), _text(body, "condition")
    if value:
        added = addition(desk.path, (), [parse_value(value)], None, ImportOptions())
    else:
        added = tray.added(desk.path, parse_condition(condition) if condition else None, body)
    added.store(desk.path)
    if not value:
        tray.clear()
    before = ((desk.session.analysis("diagnosis") or {}).get("question") or {}).get("probabilities", {})
    try:
        desk.work(lambda store: diagnose_session(store, progress=progress))
    except Cancelled:
        return {"notes": [*added.caveats, "The diagnosis was cancelled; what was added is kept."]}
    _store_information(desk, before)
    return {"notes": list(added.caveats)}


def _store_information(desk: Desk, before: Mapping[str, float]) -> None:
    """Store, with the last measurement, the probabilities of the explanations after it and the information that it gave."""
    session = desk.session
    asked, after = session.analysis("investigation"), (session.analysis("diagnosis") or {}).get("question", {}).get("probabilities")
    if asked and asked["steps"] and after:
        last = {**asked["steps"][-1], "probabilities": after, "taught_bits": taught_bits(before, after)}
        desk.save("investigation", {**asked, "steps": [*asked["steps"][:-1], last]})


def _text(body: JsonDict, key: str) -> str:
    text: Any = body.get(key, "")
    if not isinstance(text, str) or len(text) > LONGEST:
        raise BadInput(f"{key} must be text of at most {LONGEST} characters")
    return text.strip()
