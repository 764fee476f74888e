"""The command line: `motoremi --help` lists the commands."""

from __future__ import annotations

import os
import sys
from typing import NoReturn

# Exit status of a command that was stopped by Ctrl-C, as in shells.
STOPPED = 130


def main() -> None:
    """Run a command; every expected error is one line on standard error and an exit status."""
    from motoremi.cli.streams import secure

    secure()
    try:
        status = _run()
    except KeyboardInterrupt:
        status = STOPPED
    if status == STOPPED:
        fail("stopped", STOPPED)
    sys.exit(status or 0)


def _run() -> int | None:
    """Run the command of the command line; its exit status."""
    import typer

    from motoremi.cli.app import app
    from motoremi.cli.arguments import expanded
    from motoremi.cli.settings import hoisted
    from motoremi.errors import MotoremiError

    try:
        front, rest = hoisted(sys.argv[1:])
        return app(args=[*front, *expanded(rest)], prog_name="motoremi", standalone_mode=False)
    except typer.Exit as error:
        return error.exit_code
    except typer.TyperException as error:  # wrong use of the command line
        fail(error.format_message() or "no command was given; those above can be: motoremi COMMAND --help describes one", 2)
    except MotoremiError as error:
        fail(str(error), error.exit_status)
    except typer.Abort:
        return STOPPED
    except OSError as error:
        fail(f"{error.strerror or error}{f': {error.filename}' if error.filename else ''}", 2)
    except Exception as error:
        if os.environ.get("MOTOREMI_DEBUG"):
            raise
        fail(f"internal error ({type(error).__name__}: {error}); set MOTOREMI_DEBUG=1 for the details and report it", 2)


def fail(message: str, status: int) -> NoReturn:
    """Print an error in one line and exit."""
    from motoremi.data.text import clean_text

    sys.stderr.write(f"motoremi: {clean_text(' '.join(message.split()))}\n")
    sys.exit(status)
