"""How each kind of result is drawn: what its method `plot` gives."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motoremi.data.measurement import Measurement
from motoremi.data.session import Session
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.diagnosis.diagnosis import Diagnosis
from motoremi.drawing import figure_of
from motoremi.emission.diagnose import EmissionDiagnosis
from motoremi.emission.predict import Prediction
from motoremi.emission.spectrum_fit import EmissionFit
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.inspection.compare import Comparison
from motoremi.inspection.effect_signature import Signature
from motoremi.inspection.element import Inspection
from motoremi.report.emission_section import emission_fit_figure, prediction_figure
from motoremi.report.inspection_figure import inspection_figure
from motoremi.report.plots import comparison_figure, fit_figure, measured_figure, ranking_figure, spectrum_figure
from motoremi.report.signature_figure import signature_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

figure_of.register(Fit, fit_figure)
figure_of.register(Comparison, comparison_figure)
figure_of.register(Inspection, inspection_figure)
figure_of.register(Signature, signature_figure)
figure_of.register(EmissionFit, emission_fit_figure)


@figure_of.register(Diagnosis)
@figure_of.register(EmissionDiagnosis)
def _ranking(found: Diagnosis | EmissionDiagnosis) -> Figure:
    return ranking_figure(found.to_dict())


@figure_of.register(Prediction)
def _prediction(prediction: Prediction) -> Figure:
    return prediction_figure(prediction.to_dict())


@figure_of.register(ImpedanceSweep)
def _sweep(sweep: ImpedanceSweep) -> Figure:
    return measured_figure(Measurement.of([sweep]))


@figure_of.register(Spectrum)
def _spectrum(spectrum: Spectrum) -> Figure:
    return spectrum_figure([spectrum])


@figure_of.register(Session)
def _session(session: Session) -> Figure:
    if session.sweeps:
        return measured_figure(Measurement.of(session.corrected_sweeps))
    if session.spectra:
        return spectrum_figure(session.corrected_spectra)
    raise BadInput(f"{session.path.name} holds neither sweep nor spectrum")
