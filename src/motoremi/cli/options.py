"""Arguments and options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

SessionPath: TypeAlias = Annotated[Path, typer.Argument(metavar="SESSION", help="A session folder.", show_default=False)]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="One JSON document on standard output, for machines.")]
Out: TypeAlias = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder to make.", show_default=False)]


def command(app: typer.Typer, name: str, function: Callable[..., None], example: str) -> None:
    """Add a command whose help ends with an example."""
    app.command(name, epilog=f"Example: {example}")(function)
