"""Model against measurement: error over frequency, per band, where it fails, pass or fail."""

from __future__ import annotations

import html
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.stats import binom

from motoremi.arrays import BoolArray, FloatArray, FrozenDict, JsonDict, runs
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit
from motoremi.given import real_number, refuse_other
from motoremi.quantities import percent, show_band

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# The bands of the paper's discussion; frequencies of a sweep outside of them get additional bands.
BAND_EDGES_HZ = (150e3, 500e3, 5e6, 20e6, 30e6)

# The real and imaginary parts of a complex normal error are equally large: this share of points is beyond twice its standard deviation.
BEYOND_BY_CHANCE = float(np.exp(-4))
# More points beyond the uncertainty than chance gives in 99 of 100 measurements are no chance.
LEAST_PROBABILITY = 0.01


@dataclass(frozen=True)
class Tolerance:
    """Largest allowed error of the model at every point; what is None is not judged.

    Parameters
    ----------
    error_percent : float, optional
        Of |Z_model/Z_measured - 1|.
    magnitude_db : float, optional
    phase_deg : float, optional
    """

    error_percent: float | None = None
    magnitude_db: float | None = None
    phase_deg: float | None = None

    def __post_init__(self) -> None:
        for name in ("error_percent", "magnitude_db", "phase_deg"):
            value = getattr(self, name)
            if value is not None and not 0 < real_number(value, f"the tolerance {name}") < np.inf:
                raise BadInput(f"the tolerance {name} must be above 0, got {value}")

    @property
    def in_words(self) -> str:
        """What is judged, with its units."""
        pairs = ((self.error_percent, "% error"), (self.magnitude_db, "dB of magnitude"), (self.phase_deg, "deg of phase"))
        return ", ".join(f"{value:g} {unit}" for value, unit in pairs if value is not None)

    @property
    def judges(self) -> bool:
        """Whether anything is judged."""
        return any(value is not None for value in (self.error_percent, self.magnitude_db, self.phase_deg))


# Twice the 1 dB class of EMI work is too coarse for a model; 10 % is what the paper's stop rule (deviation 0.1) asks of it.
PAPER_TOLERANCE = Tolerance(error_percent=10.0)


@dataclass(frozen=True, eq=False)
class Curve:
    """Error of one sweep over frequency, shape (n,) each.

    Parameters
    ----------
    error_percent, magnitude_db, phase_deg : ndarray
        |Z_model/Z_measured - 1|, and its magnitude and phase.
    uncertainty_percent : ndarray
        Expanded (twice the standard) uncertainty of the measurement: random noise and the analyser's specification.
    fails : ndarray of bool
        Beyond the tolerance and beyond the uncertainty.
    """

    frequency_hz: FloatArray
    error_percent: FloatArray
    magnitude_db: FloatArray
    phase_deg: FloatArray
    uncertainty_percent: FloatArray
    fails: BoolArray

    @property
    def significant(self) -> BoolArray:
        """Where the error exceeds the uncertainty of the measurement."""
        return self.error_percent > self.uncertainty_percent


@dataclass(frozen=True, eq=False)
class Comparison:
    """The verdict of model against measurement. Immutable.

    Parameters
    ----------
    effects : tuple of str
        Effects in the model.
    tolerance : Tolerance
    curves : dict
        Termination -> Curve.
    bands : tuple of dict
        Error per sweep and band.
    where : tuple of dict
        Spans that hold most of the squared error beyond the uncertainty, worst first.
    passed : bool
    """

    effects: tuple[str, ...]
    tolerance: Tolerance
    curves: dict[str, Curve]
    bands: tuple[JsonDict, ...]
    where: tuple[JsonDict, ...]
    passed: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "curves", FrozenDict(self.curves))
        for name in ("bands", "where"):
            object.__setattr__(self, name, tuple(FrozenDict(one) for one in getattr(self, name)))

    @property
    def verdict(self) -> str:
        """`pass` or `fail`."""
        return "pass" if self.passed else "fail"

    @property
    def share_beyond_uncertainty(self) -> float:
        """Share of all points whose error exceeds the uncertainty of the measurement."""
        return float(np.mean(np.concatenate([curve.significant for curve in self.curves.values()])))

    @property
    def within_chance(self) -> bool:
        """Whether an exact model would leave so many points beyond the uncertainty by chance (binomial test at 1 %).

        Errors that neighbouring points share, such as those of an analyser, make large numbers more frequent than the test assumes, so that it
        calls a deviation chance too seldom rather than too often.
        """
        points = sum(curve.significant.size for curve in self.curves.values())
        beyond = sum(int(curve.significant.sum()) for curve in self.curves.values())
        return bool(binom.sf(beyond - 1, points, BEYOND_BY_CHANCE) >= LEAST_PROBABILITY)

    def where_in_words(self, verb: str) -> list[str]:
        """A line for each of the spans `where`, with a verb such as "fails"; only the largest deviation if it is within chance."""
        spans = [f"{span['sweep']} {show_band(*span['band_hz'])}" for span in self.where]
        if spans and self.within_chance:
            shares = f"{percent(100 * self.share_beyond_uncertainty, 2)} of all points are beyond the uncertainty, and chance gives "
            return [f"largest remaining deviation: {spans[0]}; within chance: {shares}{percent(100 * BEYOND_BY_CHANCE, 2)}"]
        shares_of = [f"{100 * span['share']:.0f} % of the squared error beyond the uncertainty" for span in self.where]
        return [f"{verb}: {span}, {share}" for span, share in zip(spans, shares_of, strict=True)]

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "schema": "motoremi.comparison/1",
            "effects": list(self.effects),
            "tolerance": {
                "error_percent": self.tolerance.error_percent,
                "magnitude_db": self.tolerance.magnitude_db,
                "phase_deg": self.tolerance.phase_deg,
            },
            "verdict": self.verdict,
            "bands": [dict(band) for band in self.bands],
            "where": [dict(span) for span in self.where],
        }

    def to_frame(self) -> pd.DataFrame:
        """A pandas table with a row for each sweep and band: sweep, low_hz, high_hz, points, errors in percent, dB and degrees, verdict."""
        import pandas as pd

        rows = []
        for band in self.bands:
            rest = {name: value for name, value in band.items() if name not in ("sweep", "band_hz", "fails_hz")}
            rows.append({"sweep": band["sweep"], "low_hz": band["band_hz"][0], "high_hz": band["band_hz"][1], **rest})
        return pd.DataFrame(rows)

    def _lines(self) -> list[tuple[str, str, str, str, str, str]]:
        return [
            (
                band["sweep"],
                show_band(*band["band_hz"]),
                percent(band["rms_error_percent"]),
                f"{band['max_error_db']:.3g} dB",
                f"{band['max_phase_deg']:.3g} deg",
                f"{band['verdict']}, {100 * band['share_beyond_uncertainty']:.0f} % of points beyond the uncertainty",
            )
            for band in self.bands
        ]

    def __repr__(self) -> str:
        allowed = f"tolerance {self.tolerance.in_words}, or the measurement's uncertainty if larger"
        lines = [f"Model against measurement: {self.verdict.upper()} ({allowed})"]
        lines += ["  {:6s} {:22s} rms {:>9s}  max {:>9s}  {:>10s}  {}".format(*line) for line in self._lines()]
        lines += [f"  {text}" for text in self.where_in_words("deviates most" if self.passed else "fails most")]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{name}</th>" for name in ("sweep", "band", "rms", "max magnitude", "max phase", "verdict"))
        rows = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in line)}</tr>" for line in self._lines())
        return f"<table><tr>{head}</tr>{rows}</table>"

    def plot(self) -> Figure:
        """Error over frequency against the uncertainty, a panel for each sweep."""
        return figure_of(self)


def compare(fit: Fit, tolerance: Tolerance | None = None) -> Comparison:
    """Compare a fitted model with its measurement.

    Parameters
    ----------
    fit : Fit
    tolerance : Tolerance, optional
        By default the paper's own criterion, 10 % at every point.
    """
    refuse_other(fit, Fit, "compare needs a Fit")
    if tolerance is not None:
        refuse_other(tolerance, Tolerance, "a tolerance is a Tolerance(error_percent=5)")
    asked = tolerance if tolerance is not None and tolerance.judges else PAPER_TOLERANCE
    errors = fit.errors()
    curves: dict[str, Curve] = {}
    for sweep, noise in zip(fit.measurement.sweeps, fit.measurement.noise, strict=True):
        ratio = 1 + errors[sweep.termination]
        systematic = fit.measurement.analyser.uncertainty(sweep.frequency_hz, sweep.mean_ohm)
        error = 100 * np.abs(ratio - 1)
        magnitude, phase = 20 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
        uncertainty = 200 * np.sqrt(2 * noise.variance + systematic**2)
        beyond = np.zeros(error.shape, dtype=np.bool_)
        for value, limit in ((error, asked.error_percent), (np.abs(magnitude), asked.magnitude_db), (np.abs(phase), asked.phase_deg)):
            if limit is not None:
                beyond |= value > limit
        curves[sweep.termination] = Curve(sweep.frequency_hz, error, magnitude, phase, uncertainty, beyond & (error > uncertainty))
    bands = tuple(_band(name, curve, low, high) for name, curve in curves.items() for low, high in bands_over(curve.frequency_hz))
    return Comparison(fit.effects, asked, curves, bands, tuple(_where(curves)), not any(np.any(c.fails) for c in curves.values()))


def bands_over(frequency_hz: FloatArray) -> list[tuple[float, float]]:
    """Bands that a sweep covers, its own ends included."""
    first, last = float(frequency_hz[0]), float(frequency_hz[-1])
    edges = [first, *(edge for edge in BAND_EDGES_HZ if first * 1.001 < edge < last * 0.999), last]
    return list(itertools.pairwise(edges))


def _band(sweep: str, curve: Curve, low: float, high: float) -> JsonDict:
    last = high >= curve.frequency_hz[-1]
    inside = (curve.frequency_hz >= low) & ((curve.frequency_hz <= high) if last else (curve.frequency_hz < high))
    if not np.any(inside):
        inside[np.argmin(np.abs(np.log(curve.frequency_hz / np.sqrt(low * high))))] = True
    error, magnitude, phase = curve.error_percent[inside], np.abs(curve.magnitude_db[inside]), np.abs(curve.phase_deg[inside])
    return {
        "sweep": sweep,
        "band_hz": [low, high],
        "points": int(inside.sum()),
        "rms_error_percent": float(np.sqrt(np.mean(error**2))),
        "max_error_percent": float(error.max()),
        "rms_error_db": float(np.sqrt(np.mean(magnitude**2))),
        "max_error_db": float(magnitude.max()),
        "rms_phase_deg": float(np.sqrt(np.mean(phase**2))),
        "max_phase_deg": float(phase.max()),
        "share_beyond_uncertainty": float(np.mean(curve.significant[inside])),
        "verdict": "fail" if np.any(curve.fails[inside]) else "pass",
        "fails_hz": spans_of(curve.frequency_hz, curve.fails & inside),
    }


def spans_of(frequency_hz: FloatArray, marked: BoolArray) -> list[list[float]]:
    """Contiguous spans of marked points."""
    return [[float(frequency_hz[run.start]), float(frequency_hz[run.stop - 1])] for run in runs(marked)]


def _where(curves: dict[str, Curve], most: int = 4) -> Sequence[JsonDict]:
    """The spans that hold most of the significant squared error, worst first."""
    total = sum(float(np.sum(np.where(c.significant, c.error_percent, 0.0) ** 2)) for c in curves.values())
    if total == 0:
        return []
    found: list[JsonDict] = []
    for sweep, curve in curves.items():
        squared = np.where(curve.significant, curve.error_percent, 0.0) ** 2
        # A span is a maximum of the error, smoothed over a fiftieth of the sweep, with its flanks down to a tenth of the maximum.
        smooth = gaussian_filter1d(squared, max(1.0, len(squared) / 50))
        left = smooth.copy()
        for _ in range(most):
            top = int(np.argmax(left))
            if left[top] <= 0:
                break
            inside = np.zeros(len(squared), dtype=np.bool_)
            low = high = top
            while low > 0 and smooth[low - 1] > 0.1 * smooth[top] and left[low - 1] > 0:
                low -= 1
            while high < len(squared) - 1 and smooth[high + 1] > 0.1 * smooth[top] and left[high + 1] > 0:
                high += 1
            inside[low : high + 1] = True
            left[inside] = 0
            share = float(np.sum(squared[inside])) / total
            if share >= 0.05:
                band = [float(curve.frequency_hz[low]), float(curve.frequency_hz[high])]
                rms = float(np.sqrt(np.mean(curve.error_percent[inside] ** 2)))
                found.append({"sweep": sweep, "band_hz": band, "share": share, "rms_error_percent": rms})
    return sorted(found, key=lambda span: -float(span["share"]))[:most]
