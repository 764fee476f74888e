"""Pass, marginal or fail: levels against the limit line of their detector, with the expanded uncertainty as guard band.

A level passes if it is below the limit by more than the expanded uncertainty, fails if it is above by more than that, and is marginal in
between. A detector that reads higher can only show a pass: if peak is below the quasi-peak limit, quasi-peak is below it as well, but peak above
the limit leaves the verdict open.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.emission.band import band_at, misread
from motoremi.emission.limit import Limit, LimitLine
from motoremi.errors import BadInput
from motoremi.quantities import show, show_band

Verdict: TypeAlias = Literal["pass", "marginal", "fail"]
# From the worst; levels without a verdict leave it open.
WORST_FIRST: tuple[Verdict | None, ...] = ("fail", "marginal", None, "pass")
# CISPR 16-4-2, conducted at the mains port, k = 2; from memory, not checked against the standard.
EXPANDED_UNCERTAINTY_DB = 3.4
# From the highest reading to the lowest.
ORDER = ("peak", "quasi-peak", "rms-average", "cispr-average", "average")


@dataclass(frozen=True, eq=False)
class Judged:
    """Levels of one detector against one limit line.

    Parameters
    ----------
    detector, line : str
        Detector of the levels, and of the limit line.
    verdict : {"pass", "marginal", "fail"}, optional
        None if it is open: levels of a higher-reading detector above the line, or no point inside the limit's span.
    worst_margin_db : float, optional
        Limit minus level at the worst point; negative if the level is above the limit.
    worst_hz : float, optional
    points, left_out : int
        Numbers of points that were judged, and that were not because the receiver was overloaded or there is no limit.
    why : str
    conductor, operating : str
        Line of the LISN and operating state of the motor; empty if not stated.
    """

    detector: str
    line: str
    verdict: Verdict | None
    worst_margin_db: float | None
    worst_hz: float | None
    points: int
    left_out: int
    why: str
    conductor: str = ""
    operating: str = ""

    @property
    def what(self) -> str:
        """The levels in words: detector, line of the LISN, operating state."""
        return levels_in_words(self.detector, self.conductor, self.operating)

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return dict(vars(self))


def where_in_words(conductor: str, operating: str) -> str:
    """Line of the LISN and operating state as text; empty if neither is stated."""
    return ", ".join(text for text in (f"line {conductor}" if conductor else "", operating) if text)


def levels_in_words(detector: str, conductor: str, operating: str) -> str:
    """Levels as text: detector, line of the LISN, operating state."""
    return ", ".join(text for text in (detector, where_in_words(conductor, operating)) if text)


def line_for(limit: Limit, detector: str) -> LimitLine | None:
    """The limit line of a detector, or None.

    The average limits of CISPR standards are for the CISPR-average detector, which reads no lower than the linear average.
    """
    own = limit.line(detector)
    return limit.line("average") if own is None and detector == "cispr-average" else own


def judge_levels(
    detector: str,
    frequency_hz: FloatArray,
    level_dbuv: FloatArray,
    limit: Limit,
    expanded_uncertainty_db: float = EXPANDED_UNCERTAINTY_DB,
    overload: BoolArray | None = None,
    resolution_bandwidth_hz: float | None = None,
) -> list[Judged]:
    """Levels of one detector against every limit line that applies to them.

    A bandwidth narrower than that of the band reads too low, so such levels pass nothing; a wider one reads too high, so they fail nothing.

    Raises
    ------
    BadInput
        If the uncertainty is below 0.
    """
    if not (np.isfinite(expanded_uncertainty_db) and expanded_uncertainty_db >= 0):
        raise BadInput(f"the expanded uncertainty is {expanded_uncertainty_db} dB; it must be 0 or above")
    found = []
    own = line_for(limit, detector)
    for line in limit.lines:
        higher = ORDER.index(detector) < ORDER.index(line.detector)
        if line is not own and not higher:
            continue
        bound = line.level_dbuv(frequency_hz)
        usable = np.isfinite(bound) & np.isfinite(level_dbuv) & (~overload if overload is not None else True)
        left_out = int(usable.size - usable.sum())
        if not usable.any():
            found.append(Judged(detector, line.detector, None, None, None, 0, left_out, "the limit does not cover any of these points"))
            continue
        margin, inside_hz = (bound - level_dbuv)[usable], frequency_hz[usable]
        worst = int(np.argmin(margin))
        too_high = _misread(inside_hz, resolution_bandwidth_hz, low=False)
        if too_high[worst] and not too_high.all():
            # What a level that reads too high leaves open another one may decide.
            right = int(np.argmin(np.where(too_high, np.inf, margin)))
            worst = right if verdict_of(float(margin[right]), expanded_uncertainty_db) == "fail" else worst
        least, at_hz = float(margin[worst]), float(inside_hz[worst])
        verdict: Verdict | None = verdict_of(least, expanded_uncertainty_db)
        passes = verdict == "pass"
        why = f"{'below' if least >= 0 else 'above'} the {line.detector} limit by {abs(least):.1f} dB at {at_hz / 1e6:.4g} MHz"
        if line is not own:
            if passes:
                why = f"{detector} is {why}: {line.detector} reads no higher, so it passes too"
            else:
                verdict, why = None, f"{detector} is {why}: that does not decide on {line.detector}; measure with the {line.detector} detector"
        wrong_hz = inside_hz[_misread(inside_hz, resolution_bandwidth_hz, low=True)] if passes else inside_hz[[worst]][too_high[[worst]]]
        if verdict is not None and resolution_bandwidth_hz is not None and wrong_hz.size:
            verdict, why = None, f"{why}, but {_wrong_bandwidth(resolution_bandwidth_hz, float(np.median(wrong_hz)), passes)}"
        found.append(Judged(detector, line.detector, verdict, least, at_hz, int(usable.sum()), left_out, why))
    return found


def rule_in_words(guard_db: float, expanded_uncertainty_db: float) -> str:
    """The rule by which levels were judged."""
    if guard_db == 0:
        uncertainty = f"{expanded_uncertainty_db:.3g} dB (k = 2)"
        return f"simple acceptance: at or below the limit is a pass, above it a fail, whatever the uncertainty of {uncertainty}"
    return f"guard band {guard_db:.3g} dB: below the limit by as much is a pass, above by more a fail, between them marginal"


def verdict_of(margin_db: float, uncertainty_db: float) -> Verdict:
    """Verdict on a level that is below its limit by a margin."""
    if margin_db >= uncertainty_db - 1e-9:
        return "pass"
    return "fail" if margin_db < -uncertainty_db else "marginal"


def _misread(frequency_hz: FloatArray, resolution_bandwidth_hz: float | None, low: bool) -> BoolArray:
    """Points that a bandwidth reads too low, or too high; none if it is not known."""
    if resolution_bandwidth_hz is None:
        return np.zeros(frequency_hz.shape, dtype=np.bool_)
    return misread(frequency_hz, resolution_bandwidth_hz, low)


def _wrong_bandwidth(resolution_bandwidth_hz: float, frequency_hz: float, low: bool) -> str:
    """That levels of this bandwidth do not show that they pass (`low`), or fail, and which bandwidth would."""
    band = band_at(frequency_hz)
    return (
        f"a bandwidth of {show(resolution_bandwidth_hz, 'Hz')} reads too {'low' if low else 'high'}: measure with "
        f"{show(band.bandwidth_hz, 'Hz')} (band {band.name}, {show_band(*band.span_hz)})"
    )


def judge_spectra(spectra: Sequence[Spectrum], limit: Limit, expanded_uncertainty_db: float = EXPANDED_UNCERTAINTY_DB) -> list[Judged]:
    """All measured spectra; points at which the receiver was overloaded are left out.

    Spectra of one detector, line of the LISN and operating state, such as the parts of the span, are judged together.
    """
    found: dict[tuple[str, ...], Judged] = {}
    for spectrum in spectra:
        conductor, operating = place_of(spectrum)
        for one in judge_levels(
            spectrum.detector,
            spectrum.frequency_hz,
            spectrum.level_dbuv,
            limit,
            expanded_uncertainty_db,
            spectrum.overload,
            spectrum.resolution_bandwidth_hz,
        ):
            key = one.detector, one.line, conductor, operating
            own = dataclasses.replace(one, conductor=conductor, operating=operating)
            found[key] = _together(found[key], own) if key in found else own
    return list(found.values())


def place_of(spectrum: Spectrum) -> tuple[str, str]:
    """Line of the LISN and operating state of a spectrum; empty if not stated."""
    return str(spectrum.metadata.get("line", "")), str(spectrum.metadata.get("operating", ""))


def _together(one: Judged, other: Judged) -> Judged:
    """The worse of two, with the points of both; one without any point decides nothing beside one with points."""
    if not (one.points and other.points):
        worse = one if one.points else other
    else:
        worse = min((one, other), key=lambda judged: (WORST_FIRST.index(judged.verdict), judged.worst_margin_db or 0.0))
    return dataclasses.replace(worse, points=one.points + other.points, left_out=one.left_out + other.left_out)


def judge_prediction(
    frequency_hz: FloatArray, predicted_dbuv: Mapping[str, FloatArray], limit: Limit, expanded_uncertainty_db: float = EXPANDED_UNCERTAINTY_DB
) -> list[Judged]:
    """Predicted levels, each detector against its own line."""
    judged: list[Judged] = []
    for line in limit.lines:
        if line.detector in predicted_dbuv:
            found = judge_levels(line.detector, frequency_hz, predicted_dbuv[line.detector], limit, expanded_uncertainty_db)
            judged += [one for one in found if one.line == line.detector]
    return judged


def overall(judged: Sequence[Judged], limit: Limit) -> Verdict:
    """The worst verdict; at best marginal if a line of the limit has no verdict, because compliance with it is not shown."""
    verdicts: dict[str, list[Verdict]] = {line.detector: [] for line in limit.lines}
    for one in judged:
        if one.verdict is not None:
            verdicts[one.line].append(one.verdict)
    every = [verdict for found in verdicts.values() for verdict in found]
    if "fail" in every:
        return "fail"
    # A peak limit beside quasi-peak and average ones is an alternative to the quasi-peak limit (CISPR 25).
    needed = [line.detector for line in limit.lines if not (line.detector == "peak" and limit.line("quasi-peak") is not None)]
    return "marginal" if "marginal" in every or any(not verdicts[detector] for detector in needed) else "pass"
