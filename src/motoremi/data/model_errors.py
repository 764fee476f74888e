"""What pydantic found wrong with a user's tables, in plain words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from pydantic import ValidationError

_NO_LIST = ("tuple_type", "frozen_set_type", "list_type")
# Failures of the branches of a union that take one number or text.
_NO_SCALAR = ("float_type", "int_type", "string_type")


class _Problem(NamedTuple):
    place: tuple[str, ...]
    message: str
    kind: str
    value: Any


def problems(error: ValidationError, data: Mapping[str, Any]) -> str:
    """The problems in one line.

    Parameters
    ----------
    error : ValidationError
    data : mapping
        What was checked: the places of the problems are named by its keys.
    """
    found = [_Problem(_place(problem["loc"], data), _message(problem), problem["type"], problem["input"]) for problem in error.errors()]
    return "; ".join(dict.fromkeys(_line(one) for one in found if not _is_of_another_branch(one, found)))


def _place(loc: Sequence[str | int], data: Any) -> tuple[str, ...]:
    """The keys that lead to a problem; pydantic's names for the branches of a union are left out."""
    place: list[str] = []
    for number, part in enumerate(loc):
        if isinstance(part, int) and isinstance(data, Sequence) and not isinstance(data, str) and part < len(data):
            data = data[part]
            place = [_entry(place[0], part, data)] if number == 1 else [*place, str(part)]
        elif isinstance(data, Mapping) and part in data:
            data = data[part]
            place.append(str(part))
        elif isinstance(data, Mapping) and part != "[key]" and not (number == 2 and loc[0] == "steps" and part == data.get("do")):
            # A missing key; the tag of a step at the top is in its name already.
            place.append(str(part))
    return tuple(place)


def _entry(key: str, index: int, data: Any) -> str:
    """An entry of a list of tables as the user knows it, with a colon behind: a step by number and kind, others by their name."""
    own = data if isinstance(data, Mapping) else {}
    if key == "steps":
        return f"step {index + 1} ({own.get('do', '?')}):"
    return f"{own['name']}:" if isinstance(own.get("name"), str) and own["name"] else f"{key}.{index}"


def _message(problem: Mapping[str, Any]) -> str:
    kind = problem["type"]
    if kind == "extra_forbidden":
        return "unknown key"
    if problem["loc"] and problem["loc"][-1] == "[key]" and kind == "literal_error":
        return f"not known; write {problem['ctx']['expected']}".replace("'", "")
    if kind in _NO_LIST:
        is_table = isinstance(problem["input"], Mapping)
        return f"write [[{problem['loc'][-1]}]], with two brackets" if is_table else "must be a list, in brackets"
    if kind == "union_tag_not_found":
        return "the key 'do' is missing: it says what the step does"
    return str(problem["msg"]).removeprefix("Value error, ")


def _is_of_another_branch(one: _Problem, found: Sequence[_Problem]) -> bool:
    """Whether a problem says only that a value is not of the kind that another branch of a union takes."""
    others = [other for other in found if other is not one and other.place[: len(one.place)] == one.place]
    if isinstance(one.value, list | tuple):
        return one.kind in _NO_SCALAR and bool(others)
    return one.kind in _NO_LIST and any(other.place == one.place and other.kind not in _NO_LIST for other in others)


def _line(one: _Problem) -> str:
    place = ".".join(one.place).replace(":.", ": ").removesuffix(":")
    # The message of a whole table may begin with its name.
    return one.message if not place or one.message.startswith(f"{place}: ") else f"{place}: {one.message}"
