"""Output of commands: text, or one JSON document."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Any

from motoremi.cli.streams import is_lost
from motoremi.data.plain import plain
from motoremi.data.text import clean_text
from motoremi.errors import BadInput


def emit_json(document: Any) -> None:
    """One JSON document on standard output."""
    # Escaped where the output cannot hold every character.
    escaped = not str(sys.stdout.encoding).lower().startswith("utf")
    sys.stdout.write(json.dumps(plain(document), ensure_ascii=escaped, allow_nan=False, indent=1) + "\n")


def say(text: str = "") -> None:
    """Print text, with control characters made visible."""
    sys.stdout.write("\n".join(clean_text(line) for line in text.splitlines()) + "\n")


def ask_in_writing(text: str) -> None:
    """Write a question to standard error.

    Raises
    ------
    BadInput
        If nobody can read it there: an answer would belong to a question that the operator has not seen.
    """
    sys.stderr.write(text)
    sys.stderr.flush()
    if is_lost(sys.stderr):
        raise BadInput("the operator cannot be asked: standard error is closed; run from a terminal")


def quoted(path: Path) -> str:
    """A path as a shell takes it, for a command that is proposed."""
    return shlex.quote(str(path))
