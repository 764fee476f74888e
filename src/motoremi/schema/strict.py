"""The base of every table of a procedure or bench file."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

from motoremi.arrays import JsonDict


class Strict(BaseModel):
    """A table whose keys are all known and that does not change."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def parameters(self) -> JsonDict:
        """What a step does it with: its keys that matter."""
        return self.model_dump(exclude={"do"}, exclude_none=True)
