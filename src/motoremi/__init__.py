"""Common-mode impedance and conducted emission of DC motors: measure, fit, find the missing effect, report.

>>> import motoremi as me
>>> fit = me.fit(me.dc_motor(), [short, open_])   # doctest: +SKIP
>>> me.diagnose(fit)                              # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from motoremi import drawing

if TYPE_CHECKING:
    from motoremi.blind.scoreboard_frames import scoreboard_frames
    from motoremi.data.files import read_emission, read_impedance, read_impedances, read_spectra
    from motoremi.data.session import Session, load, verify
    from motoremi.data.spectrum import Spectrum
    from motoremi.data.sweep import ImpedanceSweep
    from motoremi.diagnosis.diagnosis import Diagnosis, diagnose
    from motoremi.emission.predict import Prediction, predict
    from motoremi.emission.setup import Setup
    from motoremi.errors import BadInput, InstrumentError, MotoremiError
    from motoremi.export.spectrum_table import spectrum_table
    from motoremi.export.spice import spice_model
    from motoremi.export.tables import sweep_table, to_xarray
    from motoremi.fitting.fit import fit
    from motoremi.fitting.result import Fit
    from motoremi.fleet.fleet_frames import fleet_frames
    from motoremi.inspection.compare import Comparison, Tolerance, compare
    from motoremi.inspection.element import Inspection, inspect
    from motoremi.model.effects import effects_from
    from motoremi.model.motor import Motor, dc_motor

__version__ = "0.1.0"

# The module that registers how results are drawn; see `motoremi.drawing`.
drawing.DRAWN_BY.append("motoremi.report.figures")

# Imported at first use, so that `import motoremi` and `motoremi --help` stay quick.
_HOMES = {
    "Session": "motoremi.data.session",
    "load": "motoremi.data.session",
    "verify": "motoremi.data.session",
    "Spectrum": "motoremi.data.spectrum",
    "ImpedanceSweep": "motoremi.data.sweep",
    "Comparison": "motoremi.inspection.compare",
    "Tolerance": "motoremi.inspection.compare",
    "compare": "motoremi.inspection.compare",
    "Diagnosis": "motoremi.diagnosis.diagnosis",
    "diagnose": "motoremi.diagnosis.diagnosis",
    "Inspection": "motoremi.inspection.element",
    "inspect": "motoremi.inspection.element",
    "BadInput": "motoremi.errors",
    "InstrumentError": "motoremi.errors",
    "MotoremiError": "motoremi.errors",
    "predict": "motoremi.emission.predict",
    "Prediction": "motoremi.emission.predict",
    "Setup": "motoremi.emission.setup",
    "Fit": "motoremi.fitting.result",
    "fit": "motoremi.fitting.fit",
    "fleet_frames": "motoremi.fleet.fleet_frames",
    "Motor": "motoremi.model.motor",
    "dc_motor": "motoremi.model.motor",
    "effects_from": "motoremi.model.effects",
    "read_emission": "motoremi.data.files",
    "read_impedance": "motoremi.data.files",
    "read_impedances": "motoremi.data.files",
    "read_spectra": "motoremi.data.files",
    "scoreboard_frames": "motoremi.blind.scoreboard_frames",
    "spice_model": "motoremi.export.spice",
    "sweep_table": "motoremi.export.tables",
    "spectrum_table": "motoremi.export.spectrum_table",
    "to_xarray": "motoremi.export.tables",
}
__all__ = [
    "BadInput",
    "Comparison",
    "Diagnosis",
    "Fit",
    "ImpedanceSweep",
    "Inspection",
    "InstrumentError",
    "Motor",
    "MotoremiError",
    "Prediction",
    "Session",
    "Setup",
    "Spectrum",
    "Tolerance",
    "__version__",
    "compare",
    "dc_motor",
    "diagnose",
    "effects_from",
    "fit",
    "fleet_frames",
    "inspect",
    "load",
    "predict",
    "read_emission",
    "read_impedance",
    "read_impedances",
    "read_spectra",
    "scoreboard_frames",
    "spectrum_table",
    "spice_model",
    "sweep_table",
    "to_xarray",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(importlib.import_module(_HOMES[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'motoremi' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
