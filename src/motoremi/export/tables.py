"""Data as tables: pandas for Python, CSV and Parquet for everything else, xarray for labelled arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from motoremi.data.conditions import Condition
from motoremi.data.session import Session
from motoremi.data.sweep import ImpedanceSweep, group_repeats
from motoremi.errors import BadInput
from motoremi.export.extras import needs
from motoremi.fitting.result import Fit
from motoremi.given import refuse_other

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


def sweep_table(session: Session, fit: Fit | None = None) -> pd.DataFrame:
    """All sweeps in one table, with the model's impedance if there is a fit.

    Returns
    -------
    DataFrame
        `termination, repeat, frequency_hz, resistance_ohm, reactance_ohm`; `sigma_relative` and `rounding_relative` if a sweep has them, without
        a value in the rows of sweeps that do not; with a fit also `model_resistance_ohm, model_reactance_ohm`, for simulated data also
        `simulated`. If sweeps were measured under a condition, also `condition, condition_value, condition_unit`, without a
        value in the rows of the motor as it is. The model is that of the motor as it is: it has no value in rows under a condition.

    Raises
    ------
    BadInput
        If the session holds no sweep.
    """
    import pandas as pd

    refuse_other(session, Session, "sweep_table needs a session, load(folder)")
    sweeps = (*session.corrected_sweeps, *session.corrected_conditioned)
    if not sweeps:
        instead = "its levels are exported with --spectra FILE" if session.spectra else "there is nothing to export"
        raise BadInput(f"{session.path.name} holds no impedance sweep: {instead}")
    errors = [name for name in ("sigma_relative", "rounding_relative") if any(getattr(sweep, name) is not None for sweep in sweeps)]
    frames = []
    for repeat, sweep in zip(repeat_numbers(sweeps), sweeps, strict=True):
        columns: dict[str, object] = {"termination": sweep.termination, "repeat": repeat}
        if session.conditioned:
            own = sweep.condition
            columns |= {
                "condition": pd.Series([None if own is None else own.id] * len(sweep), dtype=object),
                "condition_value": np.full(len(sweep), np.nan if own is None or own.value is None else own.value),
                "condition_unit": pd.Series([None if own is None or not own.unit else own.unit] * len(sweep), dtype=object),
            }
        columns |= {
            "frequency_hz": sweep.frequency_hz,
            "resistance_ohm": sweep.impedance_ohm.real,
            "reactance_ohm": sweep.impedance_ohm.imag,
        }
        for name in errors:
            own_errors = getattr(sweep, name)
            columns[name] = np.full(len(sweep), np.nan) if own_errors is None else own_errors
        if fit is not None:
            known = sweep.condition is None
            model = fit.model_ohm(sweep.termination, sweep.frequency_hz) if known else np.full(len(sweep), complex(np.nan, np.nan))
            columns |= {"model_resistance_ohm": model.real, "model_reactance_ohm": model.imag}
        if session.simulated:
            columns["simulated"] = True
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


def repeat_numbers(sweeps: Sequence[ImpedanceSweep]) -> list[int]:
    """The number of each sweep among those of its condition and termination, from 1."""
    count: Counter[tuple[Condition | None, str]] = Counter()
    numbers = []
    for sweep in sweeps:
        count[sweep.condition, sweep.termination] += 1
        numbers.append(count[sweep.condition, sweep.termination])
    return numbers


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

    `short_sigma_relative` and `short_rounding_relative` (also `open_`) are the stated noise of one repeat and the error of its rounded numbers,
    over frequency, where they are known.

    Spectra are `spectrum_1_dbuv` and so on, short scans of a final measurement `final_1_dbuv`. Sweeps under a condition are
    `condition_1_short_ohm` and so on, with attributes that name the condition; values from other meters are `value_1` and so on, with attributes
    for name, unit and standard deviation.

    Raises
    ------
    BadInput
        If the repeats of a termination are not on the same frequencies, or xarray is not installed.
    """
    refuse_other(session, Session, "to_xarray needs a session, load(folder)")
    needs("xarray", "labelled arrays", "hdf5")
    import xarray as xr

    arrays = {}
    conditions = list(dict.fromkeys(sweep.condition for sweep in session.corrected_conditioned))
    named = [("", None), *((f"condition_{number}_", condition) for number, condition in enumerate(conditions, start=1))]
    for prefix, condition in named:
        own = [sweep for sweep in (*session.corrected_sweeps, *session.corrected_conditioned) if sweep.condition == condition]
        # An emission test may have no sweep.
        for group in group_repeats(own) if own else ():
            name = f"{prefix}{group.termination}"
            axis = f"{name}_frequency_hz"
            arrays[f"{name}_ohm"] = xr.DataArray(
                group.impedance_ohm,
                dims=(f"{name}_repeat", axis),
                coords={axis: group.frequency_hz, f"{name}_repeat": np.arange(1, group.repeats + 1)},
                attrs={"units": "ohm", **condition_attributes(condition)},
            )
            for error, values in (("sigma_relative", group.sigma_relative), ("rounding_relative", group.rounding_relative)):
                if values is not None:
                    attributes = {"units": "1", **condition_attributes(condition)}
                    arrays[f"{name}_{error}"] = xr.DataArray(values, dims=(axis,), coords={axis: group.frequency_hz}, attrs=attributes)
    for number, value in enumerate(session.values, start=1):
        arrays[f"value_{number}"] = xr.DataArray(value.value_si, attrs={"name": value.name, "units": value.unit, "sigma": value.sigma})
    for kind, spectra in (("spectrum", session.corrected_spectra), ("final", session.corrected_finals)):
        for number, spectrum in enumerate(spectra, start=1):
            axis = f"{kind}_{number}_frequency_hz"
            of_detector = {
                "detector": spectrum.detector,
                "units": spectrum.level_unit,
                "resolution_bandwidth_hz": spectrum.resolution_bandwidth_hz,
            }
            coordinates = {axis: spectrum.frequency_hz}
            arrays[f"{kind}_{number}_dbuv"] = xr.DataArray(spectrum.level_dbuv, dims=(axis,), coords=coordinates, attrs=of_detector)
    return xr.Dataset(arrays, attrs={"session": session.path.name, "simulated": int(session.simulated)})


def condition_attributes(condition: Condition | None) -> dict[str, str | float]:
    """Attributes that name a condition; none for the motor as it is."""
    if condition is None:
        return {}
    value: dict[str, str | float] = {} if condition.value is None else {"condition_value": condition.value, "condition_unit": condition.unit}
    return {"condition": condition.id, **value}
