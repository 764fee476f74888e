"""Output of commands: text, or one JSON document."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Any

from motoremi.data.plain import plain
from motoremi.data.text import clean_text


def emit_json(document: Any) -> None:
    """One JSON document on standard output."""
    # Escaped where the output cannot hold every character.
    escaped = not str(sys.stdout.encoding).lower().startswith("utf")
    sys.stdout.write(json.dumps(plain(document), ensure_ascii=escaped, allow_nan=False, indent=1) + "\n")


def say(text: str = "") -> None:
    """Print text, with control characters made visible."""
    sys.stdout.write("\n".join(clean_text(line) for line in text.splitlines()) + "\n")


def quoted(path: Path) -> str:
    """A path as a shell takes it, for a command that is proposed."""
    return shlex.quote(str(path))
