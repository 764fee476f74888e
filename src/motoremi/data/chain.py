"""The chain of documents: one line of JSON each, with the SHA-256 of the line before."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.plain import object_from_json, plain, to_line
from motoremi.errors import BadInput

FIRST = "0" * 64
_OWN_KEYS = ("seq", "time", "kind", "previous_sha256")


@dataclass(frozen=True)
class Chain:
    """The content of a `session.jsonl`.

    Parameters
    ----------
    documents : tuple of dict
    problems : tuple of str
        Where the chain is broken: at most one, because reading stops there. Empty if it is whole.
    last_sha256 : str
        Of the last whole line.
    torn : bytes
        Bytes after the last line end: a line whose writing was interrupted.
    """

    documents: tuple[JsonDict, ...]
    problems: tuple[str, ...]
    last_sha256: str
    torn: bytes


def make_document(seq: int, time: str, kind: str, previous_sha256: str, content: Mapping[str, Any]) -> JsonDict:
    """A document in plain data.

    Raises
    ------
    BadInput
        If the content uses a key that is reserved for every document.
    """
    taken = [key for key in _OWN_KEYS if key in content]
    if taken:
        raise BadInput(f"a document's content cannot use the key {taken[0]!r}")
    head = {"seq": seq, "time": time, "kind": kind, "previous_sha256": previous_sha256}
    return plain({**head, **content})


def document_line(document: Mapping[str, Any]) -> str:
    """The line that stores it, without the line end."""
    return to_line(document)


def line_sha256(line: str | bytes) -> str:
    """SHA-256 of a line without its line end."""
    return hashlib.sha256(line.encode() if isinstance(line, str) else line).hexdigest()


def read_chain(data: bytes) -> Chain:
    """Read documents up to the first break of the chain."""
    *lines, torn = data.split(b"\n")
    documents: list[JsonDict] = []
    previous = FIRST
    for number, line in enumerate(lines, start=1):
        problem = ""
        try:
            document = object_from_json(line)
        except ValueError:
            problem = "is not a JSON document"
        else:
            if document.get("previous_sha256") != previous:
                problem = "does not follow from the line before; a line was changed, removed or added"
            elif document.get("seq") != number - 1 or not isinstance(document.get("kind"), str):
                problem = "has a wrong sequence number or no kind"
        if problem:
            return Chain(tuple(documents), (f"line {number} {problem}",), previous, torn)
        documents.append(document)
        previous = line_sha256(line)
    return Chain(tuple(documents), (), previous, torn)
