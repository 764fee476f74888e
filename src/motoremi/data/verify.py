"""Check a session folder: the chain of documents, the manifest, and every file against both."""

from __future__ import annotations

import os
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from motoremi.data.chain import Chain, read_chain
from motoremi.data.manifest import FileRecord, Manifest, list_files, parse_manifest, record_bytes, record_file
from motoremi.data.paths import MANIFEST, SESSION, TRAFFIC, inside
from motoremi.data.storage import PENDING_SUFFIX
from motoremi.data.text import clean_text
from motoremi.data.text_file import show_name
from motoremi.errors import BadInput
from motoremi.given import refuse_other

# Kinds of documents that name a measured file.
MEASURED = ("sweep", "spectrum", "final", "standard", "compensation")


@dataclass(frozen=True)
class Findings:
    """The problems of a session.

    Parameters
    ----------
    damage : tuple of str
        Files that were changed, removed or added after they were stored.
    interruption : tuple of str
        Signs that the session was not closed; the stored files are unchanged.
    """

    damage: tuple[str, ...]
    interruption: tuple[str, ...]


def verify(path: str | os.PathLike[str]) -> list[str]:
    """Problems of a session folder in words; an empty list means that nothing was changed since the session was closed.

    Raises
    ------
    BadInput
        If there is no such folder or it cannot be read.
    """
    refuse_other(path, (str, os.PathLike), "verify needs the path of a session folder")
    folder = Path(path)
    while True:
        before = _stamps(folder)
        findings = inspect_session(folder)
        # If another program has added to the session meanwhile, some files are newer than others.
        if not findings.damage or _stamps(folder) == before:
            return [*findings.damage, *findings.interruption]


def _stamps(folder: Path) -> list[tuple[int, int] | None]:
    """Size and time of the files that change with every addition; None for one that cannot be read."""
    stamps: list[tuple[int, int] | None] = []
    for name in (SESSION, MANIFEST):
        try:
            found = (folder / name).stat()
            stamps.append((found.st_size, found.st_mtime_ns))
        except (OSError, ValueError):
            stamps.append(None)
    return stamps


def inspect_session(folder: Path) -> Findings:
    """All findings about a session folder.

    Raises
    ------
    BadInput
        If there is no such folder or it cannot be read.
    """
    if not folder.is_dir():
        raise BadInput(f"{show_name(folder)}: no such session folder")
    try:
        return _inspect(folder)
    except OSError as error:
        raise BadInput(f"{show_name(folder)}: cannot be read: {error.strerror or error}") from error


def _inspect(folder: Path) -> Findings:
    files, odd = list_files(folder)
    damage = [f"{clean_text(name)}: is not an ordinary file" for name in odd]
    if SESSION not in files:
        return Findings((*damage, f"{SESSION}: is missing"), ())
    data = (folder / SESSION).read_bytes()
    chain = read_chain(data)
    damage += [f"{SESSION}, {problem}" for problem in chain.problems]
    manifest: Manifest | None = None
    if (folder / MANIFEST).is_file() and MANIFEST not in odd:
        try:
            manifest = parse_manifest((folder / MANIFEST).read_bytes())
        except BadInput as error:
            return Findings((*damage, str(error)), ())
    records = _records(folder, files)
    counted = len(chain.documents)
    # Documents after those that the manifest counts, even an unfinished one, are an addition that was not closed.
    if manifest is not None and (counted < manifest.documents or (counted == manifest.documents and not chain.torn)):
        damage += [*_against_manifest(records, manifest), *_against_documents(folder, records, chain)]
        return Findings(tuple(dict.fromkeys(damage)), ())
    damage += _against_documents(folder, records, chain)
    if manifest is None:
        interruption = [f"{MANIFEST}: is missing; the session was interrupted or is still running"]
    else:
        damage += _against_older_manifest(folder, records, manifest, data, chain)
        interruption = [f"{MANIFEST}: is older than {SESSION}; an addition was interrupted or is still running"]
    if chain.torn:
        interruption.append(f"{SESSION}: the last line was not finished")
    interruption += [f"{clean_text(name)}: was not finished" for name in records if name.endswith(PENDING_SUFFIX)]
    return Findings(tuple(damage), tuple(interruption))


def _records(folder: Path, files: list[str]) -> dict[str, FileRecord]:
    """Sizes and hashes of files; one that another program renamed or removed since they were listed is left out."""
    records = {}
    for name in files:
        with suppress(FileNotFoundError):
            records[name] = record_file(folder / name)
    return records


def _against_manifest(records: dict[str, FileRecord], manifest: Manifest) -> list[str]:
    problems = [f"{clean_text(name)}: was added" for name in records if name not in manifest.files]
    for name, expected in manifest.files.items():
        if name not in records:
            problems.append(f"{clean_text(name)}: is missing")
        elif records[name] != expected:
            problems.append(f"{clean_text(name)}: was changed")
    return problems


def vouched_sha256(chain: Chain) -> dict[str, set[str]]:
    """For each file named in the documents, every SHA-256 that it may have: of a measured file the first one, as it is never written again."""
    vouched: dict[str, set[str]] = {}
    for document in chain.documents:
        name, digest = document.get("file"), document.get("sha256")
        if isinstance(name, str) and isinstance(digest, str) and (document["kind"] not in MEASURED or name not in vouched):
            vouched.setdefault(name, set()).add(digest)
    return vouched


def _against_documents(folder: Path, records: dict[str, FileRecord], chain: Chain) -> list[str]:
    problems = []
    for name, digests in vouched_sha256(chain).items():
        try:
            inside(folder, name)
        except BadInput as error:
            problems.append(str(error))
            continue
        if name not in records:
            problems.append(f"{name}: is missing")
        elif records[name].sha256 not in digests:
            problems.append(f"{name}: was changed")
    named = Counter(str(document.get("file")) for document in chain.documents if document["kind"] in MEASURED)
    return problems + [f"{clean_text(name)}: was replaced, {count} documents name it" for name, count in named.items() if count > 1]


def _against_older_manifest(folder: Path, records: dict[str, FileRecord], manifest: Manifest, data: bytes, chain: Chain) -> list[str]:
    """Problems against the manifest of an earlier closing: logs may only have grown, and changed files need a document."""
    vouched = vouched_sha256(chain)
    problems = []
    for name, expected in manifest.files.items():
        if name not in records:
            problems.append(f"{clean_text(name)}: is missing")
        elif name in (SESSION, TRAFFIC):
            grown = data if name == SESSION else (folder / name).read_bytes()
            if record_bytes(grown[: expected.bytes]) != expected:
                problems.append(f"{name}: was changed")
        elif name not in vouched and records[name] != expected:
            problems.append(f"{clean_text(name)}: was changed")
    return problems
