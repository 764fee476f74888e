"""Reference of all keys of a procedure and a bench file, with unit, limits, default and help, generated from the schema."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import date
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from motoremi.arrays import JsonDict
from motoremi.data.corrections import Correction
from motoremi.quantities import show
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure
from motoremi.schema.procedure_steps import STEPS
from motoremi.schema.procedure_tables import InstrumentSpec, SegmentSpec, SpectrumSpec, SweepSpec
from motoremi.schema.quantity_field import Quantity
from motoremi.schema.text_lines import Lines

TABLES: tuple[tuple[str, type[BaseModel]], ...] = (
    ("procedure", Procedure),
    ("[instruments] by role", InstrumentSpec),
    ("[instruments.ROLE.lines]", Lines),
    ("[sweep]", SweepSpec),
    ("[[sweep.segments]]", SegmentSpec),
    ("[spectrum]", SpectrumSpec),
)


_NUMBERS: dict[Any, str] = {int: "whole number", float: "number"}


@dataclass(frozen=True)
class Key:
    """One key.

    Parameters
    ----------
    name : str
    takes : str
        Allowed values: words, a number, or a quantity with its limits.
    default : str
        Empty if the key must be given.
    help : str
    """

    name: str
    takes: str
    default: str
    help: str


@dataclass(frozen=True)
class Table:
    """One table of a file, or one kind of step."""

    title: str
    help: str
    keys: tuple[Key, ...]

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {"title": self.title, "help": self.help, "keys": [asdict(key) for key in self.keys]}


def reference() -> tuple[Table, ...]:
    """All tables and steps."""
    tables = [_table(title, model) for title, model in TABLES]
    tables += [_table(f'do = "{get_args(model.model_fields["do"].annotation)[0]}"', model) for model in STEPS]
    return (*tables, _table("bench file", BenchFile), _table("bench file or corrections.toml: [[correction]]", Correction))


def markdown() -> str:
    """The reference as Markdown."""
    parts = []
    for table in reference():
        rows = ["| " + " | ".join(_cell(text) for text in _row(key)) + " |" for key in table.keys]
        head = ["", "| key | takes | default | is |", "|---|---|---|---|"] if rows else []
        parts.append("\n".join([f"### {table.title}", "", table.help, *head, *rows]))
    return "\n\n".join(parts) + "\n"


def _row(key: Key) -> tuple[str, ...]:
    return f"`{key.name}`", key.takes, key.default or "must be given", key.help


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _table(title: str, model: type[BaseModel]) -> Table:
    return Table(title, " ".join((model.__doc__ or "").split()), tuple(_keys(model)))


def _keys(model: type[BaseModel]) -> Iterator[Key]:
    for name, field in model.model_fields.items():
        if name in ("do", "s_parameters") or (model is Procedure and name in ("sweep", "spectrum")):
            continue
        yield Key(name, _takes(field), _default(field), field.description or "")


def _takes(field: FieldInfo) -> str:
    quantity = _quantity(field)
    if quantity is not None:
        return f"text with unit, {quantity.span()}"
    kinds = [kind for kind in _alternatives(field.annotation) if kind is not NoneType]
    number = next((_NUMBERS[kind] for kind in kinds if kind in _NUMBERS), "")
    limits = {key: value for entry in field.metadata for key, value in _limits(entry)}
    low, high = limits.get("ge", limits.get("gt")), limits.get("le")
    if number and low is not None and high is not None:
        return f"{number}, {'above ' if 'gt' in limits else ''}{low} to {high}"
    if number and low is not None:
        return f"{number}, {'above' if 'gt' in limits else 'at least'} {low}"
    return " or ".join(dict.fromkeys(_plain(kind) for kind in kinds))


def _alternatives(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) in (Union, UnionType) else (annotation,)


def _limits(entry: Any) -> Iterator[tuple[str, Any]]:
    for name in ("ge", "gt", "le"):
        if (value := getattr(entry, name, None)) is not None:
            yield name, value


def _quantity(field: FieldInfo) -> Quantity | None:
    # `Annotated[float, Quantity] | None` keeps its metadata inside the union.
    entries = [*field.metadata, *(m for part in get_args(field.annotation) for m in getattr(part, "__metadata__", ()))]
    return next((entry for entry in entries if isinstance(entry, Quantity)), None)


def _plain(kind: Any) -> str:
    origin = get_origin(kind)
    if origin is Literal:
        return ", ".join(f'"{word}"' if "," in str(word) else str(word) for word in get_args(kind))
    if kind in _NUMBERS:
        return _NUMBERS[kind]
    if origin is dict:
        return "table by role"
    if origin is not None:
        return "list"
    if kind is date:
        return "date"
    return "table" if isinstance(kind, type) and issubclass(kind, BaseModel) else "text"


def _default(field: FieldInfo) -> str:
    if field.default_factory is not None:
        return "none"
    if field.default is PydanticUndefined:
        return ""
    if field.default in (None, "", ()):
        return "none"
    if isinstance(field.default, tuple):
        return ", ".join(map(str, field.default))
    quantity = _quantity(field)
    return show(float(field.default), quantity.unit) if quantity is not None else str(field.default)
