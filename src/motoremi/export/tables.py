"""Data as tables: pandas for Python, CSV and Parquet for everything else, xarray for labelled arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.data.session import Session
from motoremi.data.sweep import group_repeats
from motoremi.errors import BadInput
from motoremi.export.extras import needs
from motoremi.fitting.result import Fit

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def sweep_table(session: Session, fit: Fit | None = None) -> pd.DataFrame:
    """All sweeps in one table, with the model's impedance if there is a fit.

    Returns
    -------
    DataFrame
        `termination, repeat, frequency_hz, resistance_ohm, reactance_ohm`, with a fit also `model_resistance_ohm, model_reactance_ohm`, for
        simulated data also `simulated`.

    Raises
    ------
    BadInput
        If the session holds no sweep.
    """
    import pandas as pd

    if not session.sweeps:
        raise BadInput(f"{session.path.name} holds no impedance sweep: there is nothing to export")
    frames = []
    count: dict[str, int] = {}
    for sweep in session.corrected_sweeps:
        count[sweep.termination] = count.get(sweep.termination, 0) + 1
        columns = {
            "termination": sweep.termination,
            "repeat": count[sweep.termination],
            "frequency_hz": sweep.frequency_hz,
            "resistance_ohm": sweep.impedance_ohm.real,
            "reactance_ohm": sweep.impedance_ohm.imag,
        }
        if fit is not None:
            model = fit.model_ohm(sweep.termination, sweep.frequency_hz)
            columns |= {"model_resistance_ohm": model.real, "model_reactance_ohm": model.imag}
        if session.simulated:
            columns["simulated"] = True
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def csv_bytes(session: Session, fit: Fit | None) -> bytes:
    """The table as CSV; every number is read back exactly."""
    return sweep_table(session, fit).to_csv(index=False, lineterminator="\n").encode()


def parquet_bytes(session: Session, fit: Fit | None) -> bytes:
    """The table as Parquet."""
    import io

    needs("pyarrow", "Parquet", "parquet")
    buffer = io.BytesIO()
    sweep_table(session, fit).to_parquet(buffer, engine="pyarrow", index=False)
    return buffer.getvalue()


def to_xarray(session: Session) -> xr.Dataset:
    """Sweeps as labelled arrays: `short_ohm` and `open_ohm` over `repeat` and their own frequencies, spectra over theirs.

    Raises
    ------
    BadInput
        If the repeats of a termination are not on the same frequencies, or xarray is not installed.
    """
    needs("xarray", "labelled arrays", "hdf5")
    import xarray as xr

    arrays = {}
    for group in group_repeats(session.corrected_sweeps):
        axis = f"{group.termination}_frequency_hz"
        arrays[f"{group.termination}_ohm"] = xr.DataArray(
            group.impedance_ohm,
            dims=(f"{group.termination}_repeat", axis),
            coords={axis: group.frequency_hz, f"{group.termination}_repeat": np.arange(1, group.repeats + 1)},
            attrs={"units": "ohm"},
        )
    for number, spectrum in enumerate(session.corrected_spectra, start=1):
        axis = f"spectrum_{number}_frequency_hz"
        attributes = {"detector": spectrum.detector, "resolution_bandwidth_hz": spectrum.resolution_bandwidth_hz}
        arrays[f"spectrum_{number}_dbuv"] = xr.DataArray(spectrum.level_dbuv, dims=(axis,), coords={axis: spectrum.frequency_hz}, attrs=attributes)
    return xr.Dataset(arrays, attrs={"session": session.path.name, "simulated": int(session.simulated)})
