"""The part of a session that a run uses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Protocol

from motoremi.arrays import JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep


class Writer(Protocol):
    """What a run uses of a session; `motoremi.data.session.SessionWriter` is one."""

    def emit(self, kind: str, **content: Any) -> JsonDict:
        """Append one document and pass it to the listeners."""
        ...

    def add_sweep(self, sweep: ImpedanceSweep) -> Path:
        """Store a sweep."""
        ...

    def add_spectrum(self, spectrum: Spectrum) -> Path:
        """Store a spectrum."""
        ...

    def add_final(self, spectrum: Spectrum) -> Path:
        """Store a short scan around a maximum."""
        ...

    def add_standard(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Store the sweep of a standard."""
        ...

    def add_compensation(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Store the compensation data that the instrument measured with a standard."""
        ...

    def log_traffic(self, record: Mapping[str, Any]) -> None:
        """Store one record of traffic."""
        ...

    def end(self) -> None:
        """Write the stop document of a completed measurement; only its report follows."""
        ...

    def close(self, status: Literal["done", "failed", "interrupted"], reason: str = "") -> None:
        """Write the manifest, and before it the stop document, unless `end` has written it and nothing has failed since."""
        ...
