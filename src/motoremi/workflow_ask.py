"""The next measurement of a session, without measurements that a bench cannot make, and with those of a laboratory's own menu."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.session import is_up_to_date, load
from motoremi.data.text import clean_text
from motoremi.data.text_file import show_name
from motoremi.data.toml_file import read_toml
from motoremi.errors import BadInput
from motoremi.investigation.menu import BY_NAME
from motoremi.investigation.question import NOTHING_ASKED, NOTHING_BITS
from motoremi.workflow import diagnose_session, opened

_KEYS = {"id", "like", "minutes", "instruction", "hands"}


def question_of(path: Path, without: Iterable[str] = (), menu: Path | None = None) -> JsonDict:
    """The next measurement as `motoremi.next/2`; the session is diagnosed first if sweeps or values were added since the last diagnosis.

    Parameters
    ----------
    path : Path
        Of the session.
    without : iterable of str
        Measurements that cannot be made.
    menu : Path, optional
        TOML with `[[measurement]]` tables: `id`, `minutes`, and, for a measurement of the laboratory's own, `like` (the measurement of the
        menu that it replaces), `instruction`, and `hands = false` if it is set up without an operator.

    Raises
    ------
    BadInput
        For an unknown measurement, or a menu that cannot be read.
    """
    own = [] if menu is None else own_measurements(menu)
    refused = set(without)
    refuse_unknown(refused, own)
    session = load(path)
    stored = session.analysis("diagnosis") if is_up_to_date(session) else None
    if stored is None or "question" not in stored:
        with opened(path) as store:
            stored = diagnose_session(store).to_dict()
    return chosen(stored["question"], refused, own)


def refuse_unknown(without: Iterable[str], own: Iterable[Mapping[str, Any]] = ()) -> None:
    """Refuse names of measurements that are neither on the menu nor among the laboratory's own."""
    known = {*BY_NAME, *(str(one["id"]) for one in own)}
    for name in sorted(set(without) - known):
        raise BadInput(f"unknown measurement {clean_text(name, 40)!r}; known are {', '.join(sorted(known))}")


def chosen(question: JsonDict, without: Iterable[str], own: Iterable[Mapping[str, Any]] = ()) -> JsonDict:
    """The next measurement chosen again, without some measurements and with a laboratory's own."""
    refused, own = set(without), list(own)
    if not refused and not own:
        return question
    asked = [] if question["id"] is None else [{key: question[key] for key in _ENTRY if key in question}]
    entries = {str(one["id"]): one for one in (*asked, *question["alternatives"])}
    for mine in own:
        like = str(mine.get("like", mine["id"]))
        if like in entries:
            entry = dict(entries[like])
            entry["id"], entry["like"] = str(mine["id"]), like
            entry["minutes"] = float(mine["minutes"])
            if not mine.get("hands", True):
                entry["hands"] = False
            if "instruction" in mine:
                entry["asks"] = {**entry["asks"], "instruction": str(mine["instruction"])}
            entries[entry["id"]] = entry
    kept = [one for name, one in entries.items() if name not in refused]
    kept.sort(key=_order, reverse=True)
    rest = {"schema": question["schema"], "probabilities": question["probabilities"]}
    if question["stop"] is not None and not (question["stop"] == "inseparable" and own):
        return {**question, "alternatives": kept}
    if not kept:
        return {**rest, **NOTHING_ASKED, "why": "no measurement is left on the menu", "alternatives": [], "stop": "inseparable"}
    first = kept[0]
    if first["information_bits"] < NOTHING_BITS:
        why = f"no measurement left on the menu distinguishes them: {first['id']} would give most information, {first['information_bits']:.2g} bits"
        return {**rest, **NOTHING_ASKED, "why": why, "alternatives": kept, "stop": "inseparable"}
    if first["id"] == question["id"]:
        why = question["why"]
    else:
        why = f"{first['asks']['instruction']}: expected information {first['information_bits']:.2g} bits in {first['minutes']:.3g} minutes"
    return {**rest, **first, "why": why, "alternatives": kept[1:], "stop": None}


def _order(entry: JsonDict) -> tuple[bool, bool, float]:
    """Sort key: first a sweep that the session lacks, then measurements with information, by bits per minute."""
    lacking = entry["id"] in ("short-sweep", "open-sweep")
    return lacking, entry["information_bits"] >= NOTHING_BITS, entry["information_bits"] / entry["minutes"]


_ENTRY = ("id", "like", "hands", "condition_id", "asks", "minutes", "information_bits", "separates", "then")


def own_measurements(path: Path) -> list[JsonDict]:
    """The measurements of a laboratory, from a menu file.

    Raises
    ------
    BadInput
        If it cannot be read.
    """
    name = show_name(path)
    tables = read_toml(path).get("measurement", [])
    if not isinstance(tables, list) or not tables:
        raise BadInput(f"{name}: holds no [[measurement]] table with id and minutes")
    for table in tables:
        _check(name, table)
    return tables


def _check(name: str, table: object) -> None:
    if not isinstance(table, dict) or not isinstance(table.get("id"), str):
        raise BadInput(f"{name}: each [[measurement]] needs its id")
    label = clean_text(table["id"], 40)
    for key in sorted(set(table) - _KEYS):
        raise BadInput(f"{name}: [[measurement]] {label}: unknown key {clean_text(str(key), 40)!r}; known are {', '.join(sorted(_KEYS))}")
    minutes = table.get("minutes")
    if isinstance(minutes, bool) or not isinstance(minutes, int | float) or not 0 < minutes < 1e5:
        raise BadInput(f"{name}: [[measurement]] {label}: minutes must be a number above 0")
    if not isinstance(table.get("hands", True), bool):
        raise BadInput(f"{name}: [[measurement]] {label}: hands must be true or false")
    if (like := table.get("like", table["id"])) not in BY_NAME:
        raise BadInput(f"{name}: [[measurement]] {label}: like must be one of {', '.join(BY_NAME)}, not {clean_text(str(like), 40)!r}")
