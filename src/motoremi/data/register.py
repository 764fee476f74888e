"""The register of report numbers: a file beside the laboratory's profile with one line for each number that was assigned."""

from __future__ import annotations

import csv
import io
import time
from datetime import date
from pathlib import Path

from motoremi.data.storage import AppendFile, StorageError
from motoremi.data.text_file import decode, read_bytes, show_name
from motoremi.errors import BadInput

ENDING = ".register.csv"
DIGITS = 4
# Longest wait for another process that writes the register, which takes milliseconds.
LOCK_TIMEOUT_S = 5.0


def register_of(profile: Path) -> Path:
    """The register that belongs to a profile."""
    return profile.with_suffix(ENDING)


def take_number(profile: Path, series: str, data_sha256: str, issued: date) -> str:
    """The next number of a series, entered into the register; data that already have a number keep it.

    Parameters
    ----------
    profile : Path
    series : str
        Beginning of the number.
    data_sha256 : str
        Digest of the measured data.
    issued : date

    Raises
    ------
    BadInput
        If the register is damaged.
    StorageError
        If it cannot be written.
    """
    path = register_of(profile)
    file = AppendFile(path, new=False)
    try:
        _lock(file, path)
        entries = _entries(path)
        known = next((number for number, _, digest in entries if digest == data_sha256 and number.startswith(series)), None)
        if known is not None:
            return known
        counts = [int(count) for number, *_ in entries if number.startswith(series) and (count := number.removeprefix(series)).isdecimal()]
        number = f"{series}{max(counts, default=0) + 1:0{DIGITS}d}"
        line = io.StringIO()
        csv.writer(line, lineterminator="").writerow((number, issued.isoformat(), data_sha256))
        file.append(line.getvalue(), sync=True)
        return number
    finally:
        file.close()


def _lock(file: AppendFile, path: Path) -> None:
    deadline = time.monotonic() + LOCK_TIMEOUT_S
    while True:
        try:
            file.lock()
            return
        except StorageError as error:
            if time.monotonic() > deadline:
                raise StorageError(f"{show_name(path)}: another process has locked the register for {LOCK_TIMEOUT_S:g} s; try again") from error
            time.sleep(0.02)


def _entries(path: Path) -> list[tuple[str, str, str]]:
    if not path.stat().st_size:
        return []
    shown = show_name(path)
    rows = list(csv.reader(io.StringIO(decode(read_bytes(path), shown))))
    for number, row in enumerate(rows, start=1):
        if len(row) != 3:
            raise BadInput(
                f"{shown}, line {number}: is not an entry of the register (number, date of issue, SHA-256 of the data); correct it by hand"
            )
    return [(row[0], row[1], row[2]) for row in rows]
