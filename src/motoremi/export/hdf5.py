"""A whole session in one HDF5 file: sweeps, spectra, the model and all analyses."""

from __future__ import annotations

import io

from motoremi.data.conditions import Condition
from motoremi.data.plain import to_page
from motoremi.data.session import Session
from motoremi.export.extras import needs
from motoremi.export.tables import condition_attributes, repeat_numbers
from motoremi.fitting.result import Fit


def hdf5_bytes(session: Session, fit: Fit | None) -> bytes:
    """Groups `sweeps/<termination>-<repeat>`, `spectra/<number>`, `model/<termination>` and `analysis/<name>` (JSON text).

    Short scans of a final measurement are `finals/<number>`, with the same content as `spectra/<number>`. Sweeps under a condition are
    `conditions/<number>/<termination>-<repeat>`, with the condition as attributes of `conditions/<number>`; values from other meters are
    `values/<number>`, with attributes for name, unit and standard deviation.

    Impedances are complex datasets in ohm; the attribute `metadata` of each group holds its metadata as JSON.

    Raises
    ------
    BadInput
        If h5py is not installed.
    """
    needs("h5py", "HDF5", "hdf5")
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["session"] = session.path.name
        file.attrs["simulated"] = session.simulated
        sweeps = (*session.corrected_sweeps, *session.corrected_conditioned)
        places: dict[Condition | None, str] = {None: "sweeps"}
        for number, condition in enumerate(dict.fromkeys(sweep.condition for sweep in session.conditioned), start=1):
            places[condition] = f"conditions/{number}"
            file.create_group(places[condition]).attrs.update(condition_attributes(condition))
        for repeat, sweep in zip(repeat_numbers(sweeps), sweeps, strict=True):
            group = file.create_group(f"{places[sweep.condition]}/{sweep.termination}-{repeat}")
            group["frequency_hz"], group["impedance_ohm"] = sweep.frequency_hz, sweep.impedance_ohm
            for name, error in (("sigma_relative", sweep.sigma_relative), ("rounding_relative", sweep.rounding_relative)):
                if error is not None:
                    group[name] = error
            group.attrs["metadata"] = to_page(sweep.metadata)
        for number, value in enumerate(session.values, start=1):
            file[f"values/{number}"] = value.value_si
            file[f"values/{number}"].attrs.update(name=value.name, unit=value.unit, sigma=value.sigma)
        for place, corrected, readings in (
            ("spectra", session.corrected_spectra, session.spectra),
            ("finals", session.corrected_finals, session.finals),
        ):
            for number, (spectrum, read) in enumerate(zip(corrected, readings, strict=True), start=1):
                group = file.create_group(f"{place}/{number}")
                group["reading_dbuv"] = read.level_dbuv
                group["frequency_hz"], group["level_dbuv"], group["overload"] = spectrum.frequency_hz, spectrum.level_dbuv, spectrum.overload
                group.attrs["detector"], group.attrs["level_unit"] = spectrum.detector, spectrum.level_unit
                group.attrs["resolution_bandwidth_hz"] = spectrum.resolution_bandwidth_hz
                group.attrs["metadata"] = to_page(spectrum.metadata)
        if fit is not None:
            for repeated in fit.measurement.sweeps:
                group = file.create_group(f"model/{repeated.termination}")
                group["frequency_hz"], group["impedance_ohm"] = repeated.frequency_hz, fit.model_ohm(repeated.termination)
        for name in session.analyses:
            file[f"analysis/{name}"] = to_page(session.analysis(name) or {})
    return buffer.getvalue()
