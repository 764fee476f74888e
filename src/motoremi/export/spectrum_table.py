"""The levels of a session as a table, with corrections, limit and margin."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.data.session import Session
from motoremi.emission.judge import line_for, place_of
from motoremi.emission.limit import Limit
from motoremi.errors import BadInput
from motoremi.given import refuse_other

if TYPE_CHECKING:
    import pandas as pd


def spectrum_table(session: Session, limit: Limit | None = None) -> pd.DataFrame:
    """All spectra in one table: scans, final scans, and those with the motor off.

    Parameters
    ----------
    session : Session
    limit : Limit, optional
        Limit with which the levels are compared.

    Returns
    -------
    DataFrame
        `kind` (scan or final), `spectrum` (its number among those of its kind), `detector`, `condition`, `line`, `operating`,
        `resolution_bandwidth_hz`, `frequency_hz`, `reading_dbuv`, `correction_db`, `level` in `level_unit`, `overload`; with a limit also
        `limit` and `margin_db` against the line of the same detector, without a value where there is none. A peak level may be compared with
        the lines of other detectors too; see `predict`.

    Raises
    ------
    BadInput
        If the session holds no spectrum.
    """
    import pandas as pd

    refuse_other(session, Session, "spectrum_table needs a session, load(folder)")
    pairs = [
        (kind, number, reading, level)
        for kind, readings, levels in (
            ("scan", session.spectra, session.corrected_spectra),
            ("final", session.finals, session.corrected_finals),
        )
        for number, (reading, level) in enumerate(zip(readings, levels, strict=True), start=1)
    ]
    if not pairs:
        raise BadInput(f"{session.path.name} holds no spectrum: there is nothing to export")
    frames = []
    for kind, number, reading, level in pairs:
        conductor, operating = place_of(level)
        columns: dict[str, object] = {
            "kind": kind,
            "spectrum": number,
            "detector": level.detector,
            "condition": level.condition,
            "line": conductor,
            "operating": operating,
            "resolution_bandwidth_hz": level.resolution_bandwidth_hz,
            "frequency_hz": level.frequency_hz,
            "reading_dbuv": reading.level_dbuv,
            "correction_db": level.level_dbuv - reading.level_dbuv,
            "level": level.level_dbuv,
            "level_unit": level.level_unit,
            "overload": level.overload,
        }
        if limit is not None:
            line = line_for(limit, level.detector)
            bound = np.full(len(level), np.nan) if line is None else line.level_dbuv(level.frequency_hz)
            columns |= {"limit": bound, "margin_db": bound - level.level_dbuv}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)
