"""Checks the content of TOML files against their schema; errors are one line with file, step and key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from motoremi.errors import BadInput

Model = TypeVar("Model", bound=BaseModel)


def checked(model: type[Model], data: Mapping[str, Any], where: str) -> Model:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problems = "; ".join(_one_problem(problem, data) for problem in error.errors())
        raise BadInput(f"{where}: {problems}") from error


def _one_problem(problem: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    place = [str(part) for part in problem["loc"]]
    if place[:1] == ["steps"] and len(place) > 1:
        number = int(place[1])
        kind = data["steps"][number].get("do", "?") if isinstance(data["steps"][number], Mapping) else "?"
        # The union's tag stands between the number and the key.
        key = [part for part in place[2:] if part != kind]
        place = [f"step {number + 1} ({kind})", *key]
    message = str(problem["msg"]).removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        message = "unknown key"
    elif problem["type"] in ("tuple_type", "frozen_set_type"):
        message = "must be a list, in brackets"
    elif problem["type"] == "union_tag_not_found":
        message = "the key 'do' is missing: it says what the step does"
    return ": ".join(part for part in (".".join(place).replace(").", "): "), message) if part)
