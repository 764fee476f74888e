"""Profile of the laboratory that issues a report: name, customer, decision rule, and equipment that a session does not record."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from motoremi.data.logo import MAXIMUM_BYTES, PNG_START, checked_png, png_logo, svg_logo
from motoremi.data.model_errors import problems
from motoremi.data.text_file import read_bytes, show_name
from motoremi.data.toml_file import read_toml
from motoremi.errors import BadInput
from motoremi.quantities import parse

ONLY_THE_ITEM = "The results relate only to the item tested."


def _lines(value: object) -> object:
    return [line for line in value.splitlines() if line.strip()] if isinstance(value, str) else value


def _days(value: object) -> object:
    return parse(value, "d") if isinstance(value, str) else value


Line = Annotated[str, Field(min_length=1, max_length=200)]
Lines = Annotated[tuple[Line, ...], BeforeValidator(_lines), Field(max_length=8)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class DecisionRule(_Table):
    """The rule by which a verdict follows from a result and its uncertainty."""

    rule: str = Field(min_length=1, max_length=1000, description="the rule, in words")
    source: str = Field(min_length=1, max_length=300, description="its source: a standard, a guide, an agreement with the customer")


class Equipment(_Table):
    """A part of the set-up that the session does not record, or the calibration of an instrument that it records by serial number."""

    kind: str = Field(min_length=1, max_length=60, description="LISN, fixture, adapter, cable, instrument ...")
    name: str = Field(min_length=1, max_length=200, description="maker and type")
    serial: str = Field(
        default="", max_length=200, description="serial or inventory number; an instrument of the session with this number gets this calibration"
    )
    calibrated: date | None = Field(default=None, description="date of the last calibration")
    due: date | None = Field(default=None, description="date by which it has to be calibrated again")
    certificate: str = Field(default="", max_length=200, description="number of the calibration certificate")
    used_for: Literal["both", "impedance", "emission"] = Field(default="both", description="which reports list it")


class Laboratory(_Table):
    """A laboratory's profile."""

    name: Line = Field(description="name of the laboratory")
    address: Lines = Field(default=(), description="its address, a list of lines")
    logo: str = Field(default="", max_length=300, description="PNG or SVG, beside the profile")
    customer: Lines = Field(default=(), description="name and address of the customer, a list of lines")
    series: str = Field(default="", max_length=60, description="how report numbers begin, such as EMC-2026-; a running number follows")
    authoriser: str = Field(default="", max_length=200, description="who authorises the report: name and function")
    statement: str = Field(default=ONLY_THE_ITEM, min_length=1, max_length=1000, description="what the results relate to")
    decision_rule: DecisionRule | None = Field(default=None, description="rule and source, see [decision_rule]")
    calibration_interval: Annotated[float, BeforeValidator(_days), Field(ge=1, le=3650)] | None = Field(
        default=None, description='for equipment without a due date of its own, such as "365 d"'
    )
    equipment: tuple[Equipment, ...] = Field(default=(), max_length=100, description="[[equipment]] tables")
    logo_png: str = Field(default="", max_length=3 * MAXIMUM_BYTES, description="of a stored profile: the logo's pixels")
    logo_svg: str = Field(default="", max_length=3 * MAXIMUM_BYTES, description="of a stored profile: the logo's drawing")

    @model_validator(mode="after")
    def _logo_is_image(self) -> Self:
        # A session may come from anywhere, so a stored logo is checked like a file.
        if self.logo_png:
            checked_png(self.logo_png, "logo_png")
        if self.logo_svg:
            svg_logo(self.logo_svg, "logo_svg")
        return self

    def to_dict(self) -> dict[str, Any]:
        """Plain data; keys with default values are left out."""
        return self.model_dump(mode="json", exclude_none=True, exclude_defaults=True)


def laboratory_of(content: Mapping[str, Any], where: str) -> Laboratory:
    """A laboratory from plain data; `where` names the source in errors.

    Raises
    ------
    BadInput
        If it is not a profile.
    """
    try:
        return Laboratory.model_validate(dict(content))
    except ValidationError as error:
        raise BadInput(f"{where}: {problems(error, content)}") from error


def read_laboratory(path: Path) -> Laboratory:
    """A laboratory from its profile, with the logo that it names.

    Raises
    ------
    BadInput
        With file and key in one line if the profile, or its logo, cannot be used.
    """
    shown = show_name(path)
    content = read_toml(path)
    for key in ("logo_png", "logo_svg"):
        if key in content:
            raise BadInput(f'{shown}: {key} is for stored profiles; name the file: logo = "logo.svg"')
    laboratory = laboratory_of(content, shown)
    return laboratory.model_copy(update=_logo(path.parent / laboratory.logo)) if laboratory.logo else laboratory


def _logo(path: Path) -> dict[str, str]:
    name = show_name(path)
    data = read_bytes(path)
    if len(data) > MAXIMUM_BYTES:
        raise BadInput(f"{name}: {len(data) / 1e6:.1f} MB are too large for a logo; the limit is {MAXIMUM_BYTES / 1e6:g} MB")
    if data.startswith(PNG_START):
        return {"logo_png": png_logo(data, name)}
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = ""
    return {"logo_svg": svg_logo(text, name)}
