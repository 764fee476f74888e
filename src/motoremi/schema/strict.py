"""The base of every table of a procedure or bench file."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from motoremi.arrays import JsonDict


class Strict(BaseModel):
    """A table that refuses unknown keys and cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def parameters(self) -> JsonDict:
        """The keys of a step that have a value, for the record."""
        return self.model_dump(exclude={"do"}, exclude_none=True)
