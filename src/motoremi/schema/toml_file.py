"""Checks the content of TOML files against their schema; errors are one line with file, step and key."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from motoremi.data.model_errors import problems
from motoremi.errors import BadInput

Model = TypeVar("Model", bound=BaseModel)


def checked(model: type[Model], data: Mapping[str, Any], where: str) -> Model:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise BadInput(f"{where}: {problems(error, data)}") from error
