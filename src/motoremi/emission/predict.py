"""The predicted spectrum, compared with the measured one and with the limit."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import FloatArray, JsonDict
from motoremi.data.corrections import NO_CORRECTIONS, Corrections
from motoremi.data.kernels import within_half_a_step
from motoremi.data.spectrum import Detector, Spectrum
from motoremi.drawing import figure_of
from motoremi.emission.background import ambient_of, split
from motoremi.emission.compliance import Compliance, Gap, compliance, of_prediction
from motoremi.emission.doubts import of_the_background
from motoremi.emission.finals import Final, final_values, judge_with_finals
from motoremi.emission.judge import EXPANDED_UNCERTAINTY_DB, Judged, Verdict, judge_prediction, judge_spectra
from motoremi.emission.limit import Limit, find_limit
from motoremi.emission.observe import unsuitable
from motoremi.emission.setup import MotorImpedance, Setup, scan_frequencies
from motoremi.errors import BadInput
from motoremi.fitting.result import MUCH_PERCENT, Fit
from motoremi.given import real_numbers, refuse_other
from motoremi.quantities import percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DEFAULT_LIMIT = "cispr32-b"
SHOWN: tuple[Detector, ...] = ("peak", "quasi-peak", "average", "cispr-average", "rms-average")
# Frequencies of two files that differ by less are the same, written with other digits.
SAME_FREQUENCY = 1e-9
# Bands for the table of errors, as discussed in the paper.
BANDS_HZ = ((150e3, 500e3), (500e3, 5e6), (5e6, 20e6), (20e6, 30e6))


@dataclass(frozen=True, eq=False)
class Prediction:
    """A predicted spectrum. Immutable.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
        Those of all measured spectra, or of the usual scan.
    predicted_dbuv : dict
        Detector -> levels.
    spectra : tuple of Spectrum
        Measured with the motor running, corrected.
    readings : tuple of Spectrum
        The same spectra, uncorrected.
    setup : Setup
    limit : Limit
    judged : tuple of Judged
        Verdicts on the final values and the measured spectra if there are any, else on the prediction.
    judged_what : {"final", "measured", "background", "predicted"}
        "background" if all was measured with the motor off.
    verdict : {"pass", "marginal", "fail"}
    reasons : tuple of str
        Why it is no pass, and where nothing was measured.
    effects : tuple of str
        Source-side effects in the model.
    expanded_uncertainty_db : float
        With the uncertainty of the corrections, k = 2.
    corrections : Corrections
    finals : tuple of Final
    gaps : tuple of Gap
        Parts of the limit's span in which nothing was measured, for each limit line; empty without measured spectra.
    guard_band_db : float
        Of the verdicts; 0 is simple acceptance.
    """

    frequency_hz: FloatArray
    predicted_dbuv: dict[Detector, FloatArray]
    spectra: tuple[Spectrum, ...]
    readings: tuple[Spectrum, ...]
    setup: Setup
    limit: Limit
    judged: tuple[Judged, ...]
    judged_what: str
    verdict: Verdict
    reasons: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    expanded_uncertainty_db: float = EXPANDED_UNCERTAINTY_DB
    corrections: Corrections = NO_CORRECTIONS
    finals: tuple[Final, ...] = ()
    gaps: tuple[Gap, ...] = ()
    guard_band_db: float = EXPANDED_UNCERTAINTY_DB

    def measured_dbuv(self) -> dict[str, FloatArray]:
        """Measured, corrected levels at the frequencies of the prediction, the highest of all spectra of a detector.

        NaN at frequencies that are not within half a step of a measured one.
        """
        return self._on_axis(self.spectra)

    def _on_axis(self, spectra: Sequence[Spectrum]) -> dict[str, FloatArray]:
        """The highest level of each detector; lines of the LISN, operating states and parts of the span are spectra of their own."""
        found: dict[str, FloatArray] = {}
        for spectrum in spectra:
            level = _nearest_level(spectrum, self.frequency_hz)
            found[spectrum.detector] = np.fmax(found[spectrum.detector], level) if spectrum.detector in found else level
        return found

    def limit_dbuv(self) -> dict[str, FloatArray]:
        """Limit lines at the frequencies of the prediction; NaN if there is none."""
        return {line.detector: line.level_dbuv(self.frequency_hz) for line in self.limit.lines}

    def error_bands(self) -> list[JsonDict]:
        """Measured minus predicted, per detector and band: mean and rms in dB, without overloaded points."""
        rows = []
        for spectrum in self.spectra if self.predicted_dbuv else ():
            model = np.interp(spectrum.frequency_hz, self.frequency_hz, self.predicted_dbuv[spectrum.detector])
            inside = (spectrum.frequency_hz >= self.frequency_hz[0]) & (spectrum.frequency_hz <= self.frequency_hz[-1]) & ~spectrum.overload
            error = spectrum.level_dbuv - model
            for low, high in BANDS_HZ:
                where = inside & (spectrum.frequency_hz >= low) & (spectrum.frequency_hz < high)
                if where.any():
                    part = error[where]
                    rows.append(
                        {
                            "detector": spectrum.detector,
                            "band_hz": [low, high],
                            "mean_error_db": float(part.mean()),
                            "rms_error_db": float(np.sqrt(np.mean(part**2))),
                        }
                    )
        return rows

    def remarks(self) -> list[str]:
        """Remarks for the report."""
        parts = self.setup.assumed if self.predicted_dbuv else ()
        found = [f"the {part} was not described: typical values are assumed" for part in parts]
        found += [f"{one.what}: {one.left_out} of {one.points + one.left_out} points not judged" for one in self.judged if one.left_out]
        if self.limit.lisn != self.setup.path.lisn.name:
            found.append(f"{self.limit.title} is for the {self.limit.lisn} LISN, but the path has the {self.setup.path.lisn.name} one")
        if self.judged_what == "predicted":
            found.append(
                "the guard band contains the uncertainty of a measurement, not the errors of source, path and motor's model: a prediction shows no "
                "compliance"
            )
        assumed = float(np.hypot(EXPANDED_UNCERTAINTY_DB, self.corrections.uncertainty_db()))
        if not self.limit.is_of_mains_ports and np.isclose(self.expanded_uncertainty_db, assumed):
            found.append(
                f"an expanded uncertainty of {EXPANDED_UNCERTAINTY_DB:g} dB is that of mains ports from 150 kHz to 30 MHz: state yours for this "
                "limit (--uncertainty)"
            )
        if self.finals and (late := [one for one in self.finals if one.overload]):
            found.append(f"{len(late)} of {len(self.finals)} final values were overloaded: their true level is higher")
        found += [str(one["text"]) for spectrum in self.spectra for one in unsuitable(spectrum)]
        return list(dict.fromkeys([*found, *self.corrections.remarks(), *self.limit.remarks()]))

    def to_dict(self) -> JsonDict:
        """Plain data in the schema `motoremi.prediction/1`; levels that do not exist are None."""
        return {
            "schema": "motoremi.prediction/1",
            "frequency_hz": self.frequency_hz.tolist(),
            "predicted_dbuv": _lists(self.predicted_dbuv),
            "measured_dbuv": _lists(self.measured_dbuv()),
            "limit_dbuv": _lists(self.limit_dbuv()),
            "verdict": self.verdict,
            "reasons": list(self.reasons),
            "not_measured": [gap.to_dict() for gap in self.gaps],
            "judged_what": self.judged_what,
            "judged": [one.to_dict() for one in self.judged],
            "limit": self.limit.to_dict(),
            "effects": list(self.effects),
            "expanded_uncertainty_db": self.expanded_uncertainty_db,
            "guard_band_db": self.guard_band_db,
            "corrections": self.corrections.to_list(),
            "correction_db": self.corrections.added_db("receiver", self.frequency_hz).tolist(),
            "readings_dbuv": _lists(self._on_axis(self.readings)),
            "finals": [one.to_dict() for one in self.finals],
            "setup": self.setup.to_dict(),
            "error_bands": self.error_bands(),
            "remarks": self.remarks(),
        }

    def __repr__(self) -> str:
        what, guard = "Prediction" if self.judged_what == "predicted" else "Levels", f"guard band {self.guard_band_db:.3g} dB"
        lines = [f"{what}: {self.verdict} ({self.judged_what}, {self.limit.title}, {guard})"]
        lines += [f"  corrected for {one.name} ({one.kind})" for one in self.corrections.role("receiver")]
        lines += [f"  why: {reason}" for reason in self.reasons]
        lines += [f"  {one.what}: {one.verdict or 'no verdict'}, {one.why}" for one in self.judged]
        for row in self.error_bands():
            low, high = row["band_hz"]
            lines.append(
                f"  {row['detector']:10s} {low / 1e6:6.2f} - {high / 1e6:5.2f} MHz: measured is {row['mean_error_db']:+.1f} dB "
                f"from predicted, rms {row['rms_error_db']:.1f} dB"
            )
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>"

    def plot(self) -> Figure:
        """Predicted and measured levels with the limit."""
        return figure_of(self)


def _nearest_level(spectrum: Spectrum, frequency_hz: FloatArray) -> FloatArray:
    """Level of the nearest point; NaN where that is more than half a step away."""
    nearest, near = within_half_a_step(spectrum.frequency_hz, frequency_hz)
    return np.where(near, spectrum.level_dbuv[nearest], np.nan)


def _all_frequencies(spectra: Sequence[Spectrum]) -> FloatArray:
    """The frequencies of all spectra, in order, each once."""
    frequency = np.unique(np.concatenate([spectrum.frequency_hz for spectrum in spectra]))
    return frequency[np.concatenate([[True], np.diff(frequency) > SAME_FREQUENCY * frequency[1:]])]


def _lists(levels: dict[Detector, FloatArray] | dict[str, FloatArray]) -> dict[str, list[float | None]]:
    return {name: [value if np.isfinite(value) else None for value in array.tolist()] for name, array in levels.items()}


def predict(
    motor: Fit | MotorImpedance | None,
    setup: Setup | None = None,
    spectra: Sequence[Spectrum] = (),
    limit: Limit | str | File = DEFAULT_LIMIT,
    frequency_hz: ArrayLike | None = None,
    expanded_uncertainty_db: float = EXPANDED_UNCERTAINTY_DB,
    effects: Sequence[str] = (),
    corrections: Corrections = NO_CORRECTIONS,
    finals: Sequence[Spectrum] = (),
    guard_band_db: float | None = None,
) -> Prediction:
    """Predict the spectrum at the LISN, and compare the measured levels with a limit.

    Parameters
    ----------
    motor : Fit or callable, optional
        A fitted motor, or its impedance in ohm as a function of frequencies in hertz. Without it nothing is predicted, and only the
        measured levels are judged.
    setup : Setup, optional
        Source, path and receiver; by default typical values, which the remarks of the result mention.
    spectra : sequence of Spectrum
        Measured, uncorrected. Those with the motor off (`condition: motor off`) are the background, which is added to the prediction.
    limit : Limit, str or path
        A limit, its name, or the path of a file.
    frequency_hz : array_like, shape (n,), optional
        By default those of all measured spectra, or 150 kHz to 30 MHz in 4.5 kHz.
    expanded_uncertainty_db : float
        Of the levels before corrections, k = 2.
    effects : sequence of str
        Names of the effects that `setup` already contains, for the record.
    corrections : Corrections
        Corrections for the parts between LISN and receiver, for all measured levels. Their uncertainty is added to that of the levels.
    finals : sequence of Spectrum
        Short scans around the maxima, uncorrected. If there are any, their detectors are judged by them.
    guard_band_db : float, optional
        Of the verdicts: below the limit by as much is a pass, above by more a fail. By default the expanded uncertainty; 0 is simple acceptance.

    Raises
    ------
    BadInput
        If the motor, a limit or a spectrum cannot be used.
    """
    if motor is not None and not callable(motor):
        refuse_other(motor, Fit, "predict needs first a Fit, or a function that gives the motor's impedance")
    if setup is not None:
        refuse_other(setup, Setup, "predict needs a Setup after the motor")
    refuse_other(spectra, Sequence, "spectra are a list of Spectrum")
    for spectrum in spectra:
        refuse_other(spectrum, Spectrum, "spectra are a list of Spectrum, and nothing else in it")
    chosen = replace(setup if setup is not None else Setup(), corrections=corrections)
    bound = limit if isinstance(limit, Limit) else find_limit(limit)
    refuse_other_unit(corrections, bound)
    uncertainty_db = float(np.hypot(expanded_uncertainty_db, corrections.uncertainty_db()))
    guard_db = uncertainty_db if guard_band_db is None else guard_band_db
    readings, quiet = split(spectra)
    running, background = split([corrections.corrected_spectrum(spectrum) for spectrum in spectra])
    if motor is None and not running and not background:
        raise BadInput("there is neither a motor's model nor a measured spectrum of the running motor: nothing to predict or judge")
    if motor is not None and corrections.level_unit != "dBuV":
        motor = None
    off_only = motor is None and not running and bool(background)
    shown = background if off_only else running
    if frequency_hz is not None:
        frequency: FloatArray = real_numbers(frequency_hz, "the frequencies of a prediction")
        if frequency.ndim != 1 or frequency.size < 2 or np.any(np.diff(frequency) <= 0) or frequency[0] <= 0:
            raise BadInput("the frequencies of a prediction must increase and be above 0")
    else:
        frequency = _all_frequencies(shown) if shown else scan_frequencies(chosen.receiver.band)
    if background and chosen.ambient is None:
        chosen = replace(chosen, ambient=ambient_of(background))
    levels = {} if motor is None else chosen.levels(frequency, motor_function(motor, chosen)(frequency))
    values = final_values(finals, corrections, bound)
    if values:
        judged = judge_with_finals(values, finals, running, bound, guard_db)
    elif running:
        judged = judge_spectra(running, bound, guard_db)
    else:
        judged = judge_prediction(frequency, {str(name): level for name, level in levels.items()}, bound, guard_db)
    corrected_finals = [corrections.corrected_spectrum(final) for final in finals]
    found = compliance(running, corrected_finals, judged, bound, guard_db, background) if running else of_prediction(judged, bound)
    if off_only:
        nothing = "measured with the motor off only, which shows nothing of the motor"
        found = Compliance("marginal", (nothing, *of_the_background(background, bound)))
    if isinstance(motor, Fit) and not running:
        found = replace(found, reasons=(*_of_the_motor(motor), *found.reasons))
    return Prediction(
        frequency,
        levels,
        tuple(shown),
        tuple(quiet if off_only else readings),
        chosen,
        bound,
        tuple(judged),
        "final" if values else "measured" if running else "background" if off_only else "predicted",
        found.verdict,
        found.reasons,
        tuple(effects),
        uncertainty_db,
        corrections,
        values,
        found.gaps,
        guard_db,
    )


def _of_the_motor(fit: Fit) -> list[str]:
    """How far the motor's circuit errs, where predicted levels err with it by decibels."""
    error = fit.rms_error_percent
    if error < MUCH_PERCENT:
        return []
    return [f"the circuit of the motor errs by {percent(error, 2)} rms, and the predicted levels err with it: look for what is missing (diagnose)"]


def refuse_other_unit(corrections: Corrections, limit: Limit) -> None:
    """Refuse a limit in another unit than the corrected levels."""
    if corrections.level_unit != limit.unit:
        raise BadInput(f"the corrected levels are in {corrections.level_unit}, but {limit.title} is in {limit.unit}: choose a limit for them")


def motor_function(motor: Fit | MotorImpedance, setup: Setup) -> Callable[[FloatArray], np.ndarray]:
    """Impedance of the motor for the source: terminal to frame in the common mode, between the terminals in the differential mode."""
    if isinstance(motor, Fit):
        fit, termination = motor, "open" if setup.path.mode == "common" else "short"
        return lambda frequency_hz: fit.model_ohm(termination, frequency_hz)
    return motor
