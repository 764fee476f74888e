"""Stores in a session which simulated bench it was measured on, including the hidden effects, so that `--bench sim` can continue on it.

The file is encoded so that it is not read by accident. No analysis reads it.
"""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Sequence

from motoremi.data.paths import inside
from motoremi.data.plain import object_from_json, to_line
from motoremi.data.recording import SessionWriter
from motoremi.data.session import Session
from motoremi.errors import BadInput
from motoremi.schema.bench_file import BenchFile

SEALED = "simulated/bench.sealed"


def keep_bench(writer: SessionWriter, seed: int, effects: Sequence[str]) -> None:
    """Store seed and effects in an open session."""
    writer.save_file(SEALED, base64.b64encode(zlib.compress(to_line({"seed": seed, "effects": list(effects)}).encode())))


def kept_bench(session: Session) -> BenchFile | None:
    """The bench that is stored in a session; None if there is none.

    Raises
    ------
    BadInput
        If the file cannot be read.
    """
    path = inside(session.path, SEALED)
    if not path.is_file():
        return None
    try:
        stored = object_from_json(zlib.decompress(base64.b64decode(path.read_bytes(), validate=True)))
        return BenchFile(backend="sim", seed=int(stored["seed"]), effects=tuple(map(str, stored["effects"])))
    except (OSError, binascii.Error, zlib.error, KeyError, TypeError, ValueError) as error:
        raise BadInput(f"{session.path.name}: {SEALED} cannot be read; give the bench file that the session was made with") from error
