"""Commands that tell what there is: effects, instruments, doctor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, command, plot_file

if TYPE_CHECKING:
    from motoremi.diagnosis.signature import Signature
    from motoremi.model.effects import Effect


def effects_(
    identifier: Annotated[str | None, typer.Argument(metavar="[ID]", help="One effect in full.", show_default=False)] = None,
    session: Annotated[
        Path | None, typer.Option("--session", metavar="SESSION", help="Show it on this motor: its fitted circuit is used.", show_default=False)
    ] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="SVG, PNG or PDF of its signature on that motor.")] = None,
    as_json: AsJson = False,
) -> None:
    """The catalogue of effects; one effect with formula, parameters, range, signature, look-alikes and source."""
    from motoremi.cli.output import emit_json, say
    from motoremi.errors import BadInput
    from motoremi.model.effects import catalogue, find_effect
    from motoremi.quantities import show

    file = None if plot is None else plot_file(plot)
    if plot is not None and session is None:
        raise BadInput("a signature is plotted on a motor: say --session SESSION")
    if identifier is None:
        if session is not None:
            raise BadInput("say which effect to show: motoremi effects ID --session SESSION")
        if as_json:
            emit_json({"schema": "motoremi.effects/1", "effects": [effect.to_dict() for effect in catalogue()]})
            return
        for effect in catalogue():
            say(f"{effect.group:11s} {', '.join(effect.identifiers):78s} {effect.title}")
        return
    names = [effect for effect in catalogue() if effect.name == identifier]
    effect = names[0] if names else find_effect(identifier).effect
    own = None if session is None else _signature(session, identifier, effect, file)
    if as_json:
        on_motor = {} if own is None else {"on_motor": own.to_dict()}
        emit_json({"schema": "motoremi.effect/1", **effect.to_dict(), **on_motor})
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
    if own is not None:
        _say_signature(own)
    if file is not None:
        say(str(file))


def _signature(session: Path, identifier: str, effect: Effect, file: Path | None) -> Signature:
    """The effect on the session's motor; a name without its place stands for the first one."""
    from motoremi.workflow import opened, signature_on

    with opened(session) as store:
        found = signature_on(store, effect.identifiers[0] if identifier == effect.name else identifier)
    if file is not None:
        found.plot().savefig(file)
    return found


def _say_signature(found: Signature) -> None:
    """Where it would show on the motor, in words."""
    import numpy as np

    from motoremi.cli.output import say
    from motoremi.quantities import show

    say(f"  on this motor, as {found.effect} (in brackets: what is left once the elements have adapted)")
    for size in found.sizes:
        values = ", ".join(f"{name} {value:.3g}" for name, value in size.parameters.items())
        for termination, change in size.change.items():
            top = int(np.argmax(np.abs(change)))
            left = size.remaining[termination]
            at = show(float(found.frequency_hz[termination][top]), "Hz")
            most = 100 * float(np.abs(left).max())
            say(f"    {values}: {termination} up to {100 * abs(np.expm1(change[top])):.3g} % at {at} ({most:.3g} %)")


def instruments_(as_json: AsJson = False) -> None:
    """Known drivers and what answers on the bus."""
    from motoremi.bench.connect import driver_class, driver_names
    from motoremi.cli.output import emit_json, say

    known = {name: (driver_class(name).__doc__ or "").strip().splitlines()[0] for name in driver_names()}
    found, trouble = _bus()
    if as_json:
        emit_json({"schema": "motoremi.instruments/1", "drivers": known, "resources": found, "trouble": trouble})
        return
    for name, title in known.items():
        say(f"{name:10s} {title}")
    say(f"on the bus: {', '.join(found) or 'nothing'}" + (f" ({trouble})" if trouble else ""))


def _bus() -> tuple[list[str], str]:
    """Resources that VISA sees, and why it sees none."""
    from motoremi.bench.connect import open_manager
    from motoremi.errors import InstrumentError

    try:
        manager = open_manager()
        try:
            return sorted(manager.list_resources("?*")), ""
        finally:
            manager.close()
    except InstrumentError as error:
        return [], str(error)


def doctor_(as_json: AsJson = False) -> None:
    """What is installed, what is not, and what answers."""
    import platform
    import shutil
    from importlib.metadata import PackageNotFoundError, version

    from motoremi.cli.output import emit_json, say

    packages: dict[str, str | None] = {}
    for name in ("motoremi", "numpy", "scipy", "pandas", "pyvisa", "pyvisa-py", "pyvisa-sim", "pyserial", "matplotlib", "jinja2"):
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = None
    programs = {name: shutil.which(name) is not None for name in ("ngspice", "chromium")}
    found, trouble = _bus()
    if as_json:
        emit_json(
            {
                "schema": "motoremi.doctor/1",
                "python": platform.python_version(),
                "packages": packages,
                "programs": programs,
                "resources": found,
                "trouble": trouble,
            }
        )
        return
    say(f"Python {platform.python_version()}")
    for name, number in packages.items():
        say(f"  {name:12s} {number or 'MISSING: pip install ' + name}")
    for name, present in programs.items():
        say(f"  {name:12s} {'found' if present else 'not found (only the tests need it)'}")
    say(f"on the bus: {', '.join(found) or 'nothing'}" + (f" ({trouble})" if trouble else ""))


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "effects", effects_, "motoremi effects eddy-laminations --session my_motor --plot laminations.svg")
    command(app, "instruments", instruments_, "motoremi instruments")
    command(app, "doctor", doctor_, "motoremi doctor")
