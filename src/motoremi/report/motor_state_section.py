"""The report's section on the motor's state during each sweep and spectrum."""

from __future__ import annotations

from collections.abc import Mapping

from motoremi.data.session import Session
from motoremi.data.state import STATE_QUANTITIES, marks_of, state_line, states_of
from motoremi.report.contents import Section, Table


def state_section(session: Session) -> Section | None:
    """One row for each sweep and spectrum with a recorded state; None if there is none."""
    states = states_of(session.used_documents)
    if not states:
        return None
    rows, marked = [], set()
    for index, (file, state) in enumerate(states):
        marks = marks_of(state)
        rows.append((file, state_line(state), state_line(state.get("at_end")), str(state.get("time", "-")), "; ".join(marks) or "-"))
        if marks:
            marked.add(index)
    readers = dict.fromkeys(text for _, state in states for text in _readers(state))
    table = Table("Motor's state", ("file", "at its start", "at its end", "read at (UTC)", "marked"), tuple(rows), frozenset(marked))
    return Section("Motor's state", (f"Read by {'; '.join(readers)}.",) if readers else (), (table,))


def _readers(state: Mapping[str, object]) -> list[str]:
    """The quantities, and by what each was read."""
    read_by = state.get("read_by")
    if not isinstance(read_by, Mapping):
        return []
    return [f"{STATE_QUANTITIES[key][0]}: {who}" for key, who in read_by.items() if key in STATE_QUANTITIES]
