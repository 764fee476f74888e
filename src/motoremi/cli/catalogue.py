"""The command that tells what effects there are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, command

if TYPE_CHECKING:
    from motoremi.emission.effects import SourceEffect
    from motoremi.model.effects import Effect


def effects_(
    identifier: Annotated[str | None, typer.Argument(metavar="[ID]", help="One effect in full.", show_default=False)] = None,
    as_json: AsJson = False,
) -> None:
    """The catalogue of effects; one effect with formula, parameters, range, signature, look-alikes and source."""
    from motoremi.cli.output import emit_json, say
    from motoremi.emission.effects import source_effects
    from motoremi.model.effects import catalogue, find_effect
    from motoremi.quantities import show

    known: list[Effect | SourceEffect] = [*catalogue(), *source_effects()]
    if identifier is None:
        if as_json:
            emit_json({"schema": "motoremi.effects/1", "effects": [effect.to_dict() for effect in known]})
            return
        for entry in known:
            say(f"{entry.group:11s} {', '.join(entry.identifiers):78s} {entry.title}")
        return
    names = [one for one in known if one.name == identifier]
    effect = names[0] if names else find_effect(identifier).effect
    if as_json:
        emit_json({"schema": "motoremi.effect/1", **effect.to_dict()})
        return
    say(f"{', '.join(effect.identifiers)}: {effect.title} ({effect.group})")
    say(f"  formula      {effect.formula}")
    for parameter in effect.parameters:
        span = f"{show(parameter.low, parameter.unit)} to {show(parameter.high, parameter.unit)}"
        say(f"  {parameter.name:20s} {span}: {parameter.reason}")
    for title, text in (
        ("vanishes for", effect.limit),
        ("signature", effect.signature),
        ("look-alikes", ", ".join(effect.look_alikes)),
        ("decided by", effect.deciding),
        ("source", effect.source),
    ):
        say(f"  {title:12s} {text}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "effects", effects_, "motoremi effects eddy-laminations")
