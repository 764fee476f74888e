"""Commands that tell what there is: effects, instruments, doctor."""

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
    command(app, "effects", effects_, "motoremi effects eddy-laminations")
    command(app, "instruments", instruments_, "motoremi instruments")
    command(app, "doctor", doctor_, "motoremi doctor")
