"""What a run asks of a session."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Protocol

from motoremi.arrays import JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep


class Writer(Protocol):
    """What a run asks of a session; `motoremi.data.session.SessionWriter` is one."""

    def emit(self, kind: str, **content: Any) -> JsonDict:
        """Append one document and tell the listeners."""
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
        """Store what was measured with a standard."""
        ...

    def add_compensation(self, standard: str, sweep: ImpedanceSweep) -> Path:
        """Store what the instrument itself holds of a standard."""
        ...

    def log_traffic(self, record: Mapping[str, Any]) -> None:
        """Store one exchange."""
        ...

    def end(self) -> None:
        """Write the stop document of a measurement that is done; only its report follows."""
        ...

    def close(self, status: Literal["done", "failed", "interrupted"], reason: str = "") -> None:
        """Write the stop document, unless the measurement has ended well and so has what followed, and the manifest."""
        ...
