"""The result for each motor of a fleet: within the limits or not, and why."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from typing import Literal

from motoremi.arrays import JsonDict
from motoremi.quantities import show

Outcome = Literal["beyond limits", "no result", "data in doubt", "not judged", "within limits", "golden"]
# A larger deviation is told as a factor.
FAR_PERCENT = 900.0
# The order in which motors are listed.
OUTCOMES: tuple[Outcome, ...] = ("beyond limits", "no result", "data in doubt", "not judged", "within limits", "golden")


def to_look_at(figures: JsonDict) -> list[JsonDict]:
    """The motors that are not as they should be, and say why, the worst first."""
    return [one for one in figures["motors"] if one["result"] not in ("within limits", "golden") and one["reasons"]]


def counted(figures: JsonDict) -> str:
    """How many motors have each result, in words."""
    counts = Counter(one["result"] for one in figures["motors"])
    return ", ".join(f"{name} {counts[name]}" for name in OUTCOMES if counts[name])


def deviation(beyond: JsonDict) -> str:
    """How far a value beyond the limits is from the golden motors, in words."""
    percent = float(beyond["deviation_percent"])
    factor = float(f"{1 + percent / 100:.3g}")
    return f"{percent:+.3g} % from golden" if percent < FAR_PERCENT else f"{factor:.15g} times that of golden"


def each_motor(figures: JsonDict, sessions: Sequence[str], golden: Collection[str], serials: Mapping[str, str]) -> list[JsonDict]:
    """Result and reasons for each session, the worst first.

    Parameters
    ----------
    figures : dict
        Of `fleet_figures`, as far as it is known.
    sessions : sequence of str
        All of them.
    golden : collection of str
        Sessions of motors that are known to be good.
    serials : mapping
        Serial number by session, where it is known.

    Returns
    -------
    list of dict
        `session`, `serial`, `result` and `reasons`. A value beyond the limits counts before doubts about the data.
    """
    beyond: dict[str, list[str]] = defaultdict(list)
    for entry in figures["beyond_limits"]:
        unit = figures["parameters"][entry["parameter"]]["unit"]
        value, low, high = (show(entry[key], unit) for key in ("value", "low", "high"))
        beyond[entry["session"]].append(f"{entry['parameter']} {value}, limits {low} - {high} ({deviation(entry)})")
    doubts: dict[str, list[str]] = defaultdict(list)
    for identifier, sessions in figures["findings"].items():
        for session in sessions:
            doubts[session].append(identifier)
    for session, text in figures["unlike"].items():
        doubts[session].append(text)
    troubles = {trouble["session"]: str(trouble["trouble"]) for trouble in figures["troubles"]}
    missing = {name: sessions for name, sessions in figures["undetermined"].items() if name in figures["limits"]}
    motors = []
    for session in sessions:
        unknown = [name for name, sessions in missing.items() if session in sessions]
        # Of a motor without its open-circuit sweep nothing is known of its frame.
        unseen = [name for name in figures["limits"] if "." not in name and name not in unknown and session not in figures["values"].get(name, ())]
        reasons = [*beyond[session], *doubts[session], *(f"{name} is not determined" for name in unknown)]
        if unseen:
            reasons.append(f"its sweeps do not show {', '.join(unseen)}: not compared")
        result: Outcome
        if session in troubles:
            result, reasons = "no result", [troubles[session]]
        elif beyond[session]:
            result = "beyond limits"
        elif session in golden:
            result = "golden"
        elif doubts[session]:
            result = "data in doubt"
        else:
            result = "within limits" if figures["limits"] and not (unknown or unseen) else "not judged"
        motors.append({"session": session, "serial": serials.get(session, ""), "result": result, "reasons": reasons})
    order = {entry["session"]: number for number, entry in reversed(list(enumerate(figures["beyond_limits"])))}
    return sorted(motors, key=lambda one: (OUTCOMES.index(one["result"]), order.get(one["session"], 0)))
