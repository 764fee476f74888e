"""The manifest: sizes and SHA-256 of all other files of a session, and of itself."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motoremi.data.paths import MANIFEST
from motoremi.data.plain import object_from_json, to_page
from motoremi.errors import BadInput

SCHEMA = "motoremi.manifest/1"


@dataclass(frozen=True)
class FileRecord:
    """Size and SHA-256 of a file."""

    bytes: int
    sha256: str


@dataclass(frozen=True)
class Manifest:
    """Content of a closed session.

    Parameters
    ----------
    documents : int
        Number of lines of `session.jsonl`.
    files : mapping
        From the relative name to its record.
    """

    documents: int
    files: Mapping[str, FileRecord]


def list_files(folder: Path) -> tuple[list[str], list[str]]:
    """Relative names of all ordinary files except the manifest, and of links and everything else that is neither file nor folder."""
    files: list[str] = []
    odd: list[str] = []
    for root, folders, names in os.walk(folder):
        for name in [*folders, *names]:
            path = Path(root, name)
            relative = path.relative_to(folder).as_posix()
            # A file that another program renames meanwhile is none of these.
            if path.is_symlink() or (path.exists() and not (path.is_file() or path.is_dir())):
                odd.append(relative)
            elif path.is_file() and relative != MANIFEST:
                files.append(relative)
    return sorted(files), sorted(odd)


def record_file(path: Path) -> FileRecord:
    """Size and SHA-256 of a file on disk."""
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return FileRecord(file.tell(), digest)


def record_bytes(data: bytes) -> FileRecord:
    """Size and SHA-256 of bytes."""
    return FileRecord(len(data), hashlib.sha256(data).hexdigest())


def manifest_text(manifest: Manifest, software: str) -> str:
    """The text of the manifest, with a hash of its own content."""
    body = {
        "schema": SCHEMA,
        "software": software,
        "documents": manifest.documents,
        "files": {name: {"bytes": r.bytes, "sha256": r.sha256} for name, r in manifest.files.items()},
    }
    return _sealed(body)


def parse_manifest(data: bytes) -> Manifest:
    """Read a manifest.

    Raises
    ------
    BadInput
        If a single byte differs from what `manifest_text` wrote.
    """
    try:
        body = object_from_json(data)
        del body["sha256"]
        # The text is rebuilt from its content and compared, so that any changed byte, even a blank, is noticed.
        if body["schema"] != SCHEMA or _sealed(body).encode() != data:
            raise ValueError("text and hash do not agree")
        files = {name: FileRecord(int(entry["bytes"]), str(entry["sha256"])) for name, entry in body["files"].items()}
        return Manifest(int(body["documents"]), files)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadInput(f"{MANIFEST} was changed or is damaged") from error


def _sealed(body: Mapping[str, Any]) -> str:
    digest = hashlib.sha256(to_page(body).encode()).hexdigest()
    return to_page({**body, "sha256": digest})
