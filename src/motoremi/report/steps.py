"""The steps of a session's procedure and the state of each."""

from __future__ import annotations

from collections.abc import Iterator

from motoremi.arrays import JsonDict
from motoremi.data.session import Session
from motoremi.quantities import show

# Units of settings whose names do not contain them, as in `schema.procedure_steps`.
UNITS = {
    "nominal": "Ohm", "resistance": "Ohm", "inductance": "H", "conductance": "S", "capacitance": "F",
    "dwell": "s", "time": "s", "apart": "Hz", "margin": "dB", "uncertainty": "dB", "guard_band": "dB",
}  # fmt: skip


def being_written(session: Session) -> bool:
    """Whether the report is being written as a step of its own run."""
    last = [d for d in session.documents if d["kind"] in ("step-start", "step-stop", "stop")][-1:]
    return bool(last) and last[0]["kind"] == "step-start" and last[0].get("do") == "report"


def planned_steps(session: Session) -> list[tuple[int, str, str, str]]:
    """Number, name, settings and state of every step of the procedure, begun or not."""
    begun = {d.get("step"): d for d in session.documents if d["kind"] == "step-start"}
    ended = {d.get("step") for d in session.documents if d["kind"] == "step-stop"}
    planned = list(_unrolled((session.start.get("procedure") or {}).get("steps", ())))
    total = max([len(planned), *(int(d.get("of") or 0) for d in begun.values())])
    rows = []
    for number in range(1, total + 1):
        document = begun.get(number)
        plan = planned[number - 1] if number <= len(planned) else {}
        settings: JsonDict = document.get("parameters") or {} if document else {k: v for k, v in plan.items() if k != "do"}
        name = str((document or plan).get("do", "not known"))
        if number in ended:
            state = "done"
        elif document is None:
            state = "not begun"
        else:
            state = "this report" if name == "report" and being_written(session) else "not finished"
        rows.append((number, name, ", ".join(f"{key} {_setting(key, value)}" for key, value in settings.items()), state))
    return rows


def _setting(key: str, value: object) -> str:
    if isinstance(value, list | tuple):
        return " and ".join(map(str, value))
    unit = UNITS.get(key)
    return show(value, unit) if unit and isinstance(value, int | float) else str(value)


def _unrolled(steps: object) -> Iterator[JsonDict]:
    """The steps as written, those of a `repeat` as many times as they are done."""
    for step in steps if isinstance(steps, list | tuple) else ():
        if isinstance(step, dict) and step.get("do") == "repeat":
            for _ in range(int(step.get("times", 1))):
                yield from _unrolled(step.get("steps"))
        elif isinstance(step, dict):
            yield step
