"""The command that shows the catalogue of effects."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, command, plot_file, save_plot

if TYPE_CHECKING:
    from motoremi.emission.source_effects import SourceEffect
    from motoremi.inspection.effect_signature import Signature
    from motoremi.model.effects import Effect


def effects_(
    identifier: Annotated[str | None, typer.Argument(metavar="ID", help="One effect in full.", show_default=False)] = None,
    session: Annotated[
        Path | None,
        typer.Option("--session", metavar="SESSION", help="Show the effect on this motor, with its fitted circuit.", show_default=False),
    ] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="SVG, PNG or PDF of its signature on that motor.")] = None,
    as_json: AsJson = False,
) -> None:
    """The catalogue of effects; one effect with formula, parameters, range, signature, look-alikes and source."""
    from motoremi.cli.output import emit_json, say
    from motoremi.emission.source_effects import source_effects
    from motoremi.errors import BadInput
    from motoremi.model.effects import catalogue, find_effect
    from motoremi.quantities import show

    known: list[Effect | SourceEffect] = [*catalogue(), *source_effects()]
    file = None if plot is None else plot_file(plot)
    if plot is not None and session is None:
        raise BadInput("a signature is plotted for a motor: give --session SESSION")
    if identifier is None:
        if session is not None:
            raise BadInput("give the effect to show: motoremi effects ID --session SESSION")
        if as_json:
            emit_json({"schema": "motoremi.effects/1", "effects": [effect.to_dict() for effect in known]})
            return
        for entry in known:
            say(f"{entry.group:11s} {', '.join(entry.identifiers):78s} {entry.title}")
        return
    names = [one for one in known if one.name == identifier]
    effect = names[0] if names else find_effect(identifier).effect
    own = None if session is None else _signature(session, identifier, file)
    if as_json:
        on_motor = {} if own is None else {"on_motor": own.to_dict()}
        emit_json({"schema": "motoremi.effect/1", **effect.to_dict(), **on_motor})
        return
    say(f"{', '.join(effect.identifiers)}: {effect.title} ({effect.group})")
    say(f"  formula      {effect.formula}")
    for parameter in effect.parameters:
        span = f"{show(parameter.low, parameter.unit)} to {show(parameter.high, parameter.unit)}"
        usual = "" if parameter.usual is None else f" (usually {' to '.join(show(value, parameter.unit) for value in parameter.usual)})"
        say(f"  {parameter.name:20s} {span}{usual}: {parameter.reason}")
    for title, text in (
        ("vanishes for", effect.limit),
        ("signature", effect.signature),
        ("look-alikes", ", ".join(effect.look_alikes)),
        ("decided by", effect.deciding),
        ("source", effect.source),
    ):
        say(f"  {title:12s} {text}")
    if own is not None:
        _say_signature(own)
    if file is not None:
        say(str(file))


def _signature(session: Path, identifier: str, file: Path | None) -> Signature:
    """The effect on the session's motor; a name without a place means its first place."""
    from motoremi.emission.source_effects import is_source_effect
    from motoremi.errors import BadInput
    from motoremi.model.effects import catalogue
    from motoremi.workflow import opened, signature_on

    if is_source_effect(identifier):
        raise BadInput(f"{identifier} changes spectra, not the impedance: motoremi diagnose {session} --emission")
    first = {effect.name: effect.identifiers[0] for effect in catalogue()}
    with opened(session) as store:
        found = signature_on(store, first.get(identifier, identifier))
    if file is not None:
        save_plot(found.plot(), file)
    return found


def _say_signature(found: Signature) -> None:
    """Print where the effect would change the motor's impedance."""
    import numpy as np

    from motoremi.cli.output import say
    from motoremi.quantities import percent, show

    say(f"  on this motor, as {found.effect} (in brackets: after the elements are fitted again)")
    for size in found.sizes:
        values = ", ".join(f"{name} {value:.3g}" for name, value in size.parameters.items())
        for termination, change in size.change.items():
            top = int(np.argmax(np.abs(change)))
            left = size.remaining[termination]
            at = show(float(found.frequency_hz[termination][top]), "Hz")
            most = 100 * float(np.abs(left).max())
            say(f"    {values}: {termination} up to {percent(100 * abs(np.expm1(change[top])))} at {at} ({percent(most)})")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "effects", effects_, "motoremi effects eddy-laminations --session my_motor --plot laminations.svg")
