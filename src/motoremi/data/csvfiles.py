"""Write sweeps and spectra in the public CSV format; every float survives the round trip exactly."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from motoremi.data.output_file import write_output
from motoremi.data.plain import plain
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.data.table import read_key_value
from motoremi.data.text import clean_text

_PLAIN_KEY = re.compile(r'[^\s:#"](?:[^:]*[^\s:])?')


def write_impedance_csv(path: str | Path, sweep: ImpedanceSweep) -> None:
    """Write a sweep whole or not at all.

    Raises
    ------
    BadInput
        If it is the name of a file of a session.
    StorageError
        If it cannot be written.
    """
    write_output(Path(path), impedance_csv(sweep).encode())


def write_spectrum_csv(path: str | Path, spectrum: Spectrum) -> None:
    """Write a spectrum whole or not at all; a column `overload` only if a point is marked.

    Raises
    ------
    BadInput
        If it is the name of a file of a session.
    StorageError
        If it cannot be written.
    """
    write_output(Path(path), spectrum_csv(spectrum).encode())


def impedance_csv(sweep: ImpedanceSweep) -> str:
    """The text of a sweep's file."""
    titles = ["frequency_hz", "resistance_ohm", "reactance_ohm"]
    columns = [sweep.frequency_hz.tolist(), sweep.impedance_ohm.real.tolist(), sweep.impedance_ohm.imag.tolist()]
    for title, own in (("sigma_relative", sweep.sigma_relative), ("rounding_relative", sweep.rounding_relative)):
        if own is not None:
            titles.append(title)
            columns.append(own.tolist())
    header: dict[str, Any] = {"termination": sweep.termination, "points": len(sweep)}
    if sweep.condition is not None:
        header["condition"] = sweep.condition.text
    return _text(header, sweep.metadata, titles, columns)


def spectrum_csv(spectrum: Spectrum) -> str:
    """The text of a spectrum's file."""
    titles = ["frequency_hz", "level_dbuv"]
    columns: list[list[Any]] = [spectrum.frequency_hz.tolist(), spectrum.level_dbuv.tolist()]
    if spectrum.overload.any():
        titles.append("overload")
        columns.append(spectrum.overload.astype(int).tolist())
    header = {
        "detector": spectrum.detector,
        "rbw_hz": spectrum.resolution_bandwidth_hz,
        "points": len(spectrum),
    }
    return _text(header, spectrum.metadata, titles, columns)


def _text(header: Mapping[str, Any], metadata: Mapping[str, Any], titles: list[str], columns: Iterable[list[Any]]) -> str:
    entries = {**metadata, **header}
    lines = [_key_value(str(key), plain(value)) for key, value in entries.items()]
    lines.append(",".join(titles))
    lines.extend(",".join(map(repr, row)) for row in zip(*columns, strict=True))
    return "\n".join(lines) + "\n"


def _key_value(key: str, value: Any) -> str:
    written_key = key if _PLAIN_KEY.fullmatch(key) and clean_text(key) == key else json.dumps(key)
    if isinstance(value, str) and clean_text(value) == value:
        line = f"# {written_key}: {value}"
        read_back: dict[str, Any] = {}
        read_key_value(line, read_back)
        # Text that would be read back as a number, or without its outer blanks, is quoted below.
        if read_back == {key: value}:
            return line
    return f"# {written_key}: {json.dumps(value, allow_nan=False)}"
