"""The view Compare: overlays and tables of several sessions, as in their common report; each compared with the first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.report.contents import Materials, Table
from motoremi.report.several_sessions import SessionComparison, build_together, render_together
from motoremi.workbench.desk import Desk
from motoremi.workbench.thinning import Band, seen
from motoremi.workbench.views import rounded


def side_by_side(desks: Sequence[Desk], band_hz: Band | None = None) -> JsonDict:
    """Curves and tables of several sessions.

    Raises
    ------
    BadInput
        For fewer than two sessions, or more than a plot can distinguish.
    """
    together = SessionComparison(_materials(desks))
    parameters, bands = together.parameters(), together.bands()
    return {
        "names": list(together.sweeps),
        "verdicts": _table(together.verdicts()),
        "parameters": None if parameters is None else {**_table(parameters.tables[0]), "texts": list(parameters.texts)},
        "bands": None if bands is None else _table(bands),
        "sweeps": {name: [_sweep(one, band_hz) for one in own.values()] for name, own in together.sweeps.items()},
        "changes": {name: [{"termination": t, **_change(one, band_hz)} for t, one in own.items()] for name, own in together.changes.items()},
        "spectra": {name: [_spectrum(one, band_hz) for one in own] for name, own in together.running.items()},
    }


def report_file(desks: Sequence[Desk], name: str) -> bytes:
    """One file of the report that `motoremi report` writes of several sessions.

    Raises
    ------
    BadInput
        As `side_by_side`, and if there is no such file.
    """
    files = render_together(build_together(_materials(desks)))
    if name not in files:
        raise BadInput(f"the comparison has no file {name!r}; there are {', '.join(files)}")
    return files[name]


def _materials(desks: Sequence[Desk]) -> dict[str, Materials]:
    named: dict[str, Materials] = {}
    for desk in desks:
        if desk.path.name in named:
            raise BadInput(f"two of these sessions are called {desk.path.name}: rename one folder, so that they can be distinguished")
        session, steps = desk.session, desk.steps
        comparison = desk.comparison(steps[-1]) if steps else None
        named[desk.path.name] = Materials(session, tuple(steps), comparison, session.analysis("diagnosis"))
    return named


def _sweep(sweep: Any, band_hz: Band | None) -> JsonDict:
    kept = seen(sweep.frequency_hz, np.log(np.abs(sweep.mean_ohm)), np.angle(sweep.mean_ohm), band_hz=band_hz)
    frequency, impedance = sweep.frequency_hz[kept], sweep.mean_ohm[kept]
    curve = {"frequency_hz": rounded(frequency), "magnitude_ohm": rounded(np.abs(impedance)), "phase_deg": rounded(np.degrees(np.angle(impedance)))}
    return {"termination": sweep.termination, "points": len(sweep.frequency_hz), **curve}


def _change(change: Any, band_hz: Band | None) -> JsonDict:
    kept = seen(change.frequency_hz, change.magnitude_db, band_hz=band_hz)
    band = 20 * np.log10(1 + change.uncertainty[kept])
    return {"frequency_hz": rounded(change.frequency_hz[kept]), "db": rounded(change.magnitude_db[kept]), "uncertainty_db": rounded(band)}


def _spectrum(spectrum: Any, band_hz: Band | None) -> JsonDict:
    kept = seen(spectrum.frequency_hz, spectrum.level_dbuv, band_hz=band_hz)
    curve = {"frequency_hz": rounded(spectrum.frequency_hz[kept]), "level_dbuv": rounded(spectrum.level_dbuv[kept])}
    return {"detector": spectrum.detector, "points": len(spectrum.frequency_hz), **curve}


def _table(table: Table) -> JsonDict:
    return {"title": table.title, "columns": list(table.columns), "rows": [list(row) for row in table.rows], "marked": sorted(table.marked)}
