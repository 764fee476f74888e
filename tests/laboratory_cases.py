"""A laboratory's profile with everything in it, and sessions that it signs: shared by the tests of laboratories' reports."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import pypdfium2

import motoremi as me
from motoremi.data.session import SessionWriter

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 20"><rect width="40" height="20" fill="#0072B2"/></svg>'
PROFILE = """
name = "EMC Laboratory North"
address = ["Harbour Road 1", "20457 Hamburg"]
customer = ["Drives Ltd", "Motor Street 5"]
series = "EMC-2026-"
authoriser = "Dr. A. Person, head of the laboratory"
calibration_interval = "365 d"

[decision_rule]
rule = "A verdict needs a distance of the expanded uncertainty from the limit."
source = "ILAC-G8:09/2019, 4.2.2"

[[equipment]]
kind = "LISN"
name = "ENV216"
serial = "101234"
calibrated = 2026-01-15
certificate = "D-K-0815"
used_for = "emission"

[[equipment]]
kind = "fixture"
name = "leads F2"
used_for = "impedance"

[[equipment]]
kind = "instrument"
name = "analyser of the laboratory"
serial = "JP1KG00123"
calibrated = 2020-05-01
certificate = "D-K-0816"
"""


def png(width: int = 4, height: int = 2) -> bytes:
    """A whole PNG without anything but pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    rows = zlib.compress(b"".join(b"\0" + b"\x00\x72\xb2" * width for _ in range(height)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def profile(folder: Path, text: str = PROFILE, name: str = "lab.toml") -> Path:
    """The profile as a file, with a logo where it names one."""
    folder.mkdir(exist_ok=True)
    (folder / "logo.svg").write_text(SVG)
    (folder / "logo.png").write_bytes(png())
    (folder / name).write_text(text)
    return folder / name


def measured_session(path: Path, sweeps: Sequence[me.ImpedanceSweep] = (), spectra: Sequence[me.Spectrum] = (), **start: object) -> Path:
    """A session that was measured and nothing else: its report takes little time."""
    with SessionWriter.create(path, {"title": "A test", "motor": "XQ-7A2", **start}) as writer:
        identity = {"vendor": "HP", "model": "4294A", "serial": "JP1KG00123"}
        writer.emit("instrument", role="analyser", driver="4294a", resource="GPIB0::17::INSTR", identity=identity, settings={"adapter": "1m"})
        for sweep in sweeps:
            writer.add_sweep(sweep)
        for spectrum in spectra:
            writer.add_spectrum(spectrum)
        writer.close("done")
    return path


def spectrum(**metadata: object) -> me.Spectrum:
    return me.Spectrum("peak", [150e3, 154.5e3, 159e3], [40.0, 41.0, 39.0], metadata=metadata)


def pages_of(data: bytes) -> list[str]:
    """The text of each page."""
    return [page.get_textpage().get_text_range().replace("\u200b", "").replace("\ufffe", "") for page in pypdfium2.PdfDocument(io.BytesIO(data))]


def squeezed(text: str) -> str:
    return "".join(text.split())
