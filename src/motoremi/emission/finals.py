"""Final measurement: choice of the maxima of a prescan that are measured again with the detectors of the limit, and the final values."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, JsonDict
from motoremi.data.corrections import Corrections
from motoremi.data.spectrum import Spectrum
from motoremi.emission.judge import ORDER, Judged, judge_spectra, line_for, place_of, verdict_of
from motoremi.emission.limit import Limit
from motoremi.errors import BadInput


@dataclass(frozen=True)
class Rules:
    """Rules for the choice of maxima.

    Parameters
    ----------
    margin_db : float
        Only maxima above the limit, or less than this below it, are chosen.
    maxima : int
        Largest number of maxima; those nearest to the limit first.
    apart_hz : float
        Least distance between two maxima.
    subranges : int
        Number of parts of the span, equally wide on a logarithmic axis, from which maxima are taken in turn, so that they do not all come
        from one part.
    """

    margin_db: float = 10.0
    maxima: int = 6
    apart_hz: float = 50e3
    subranges: int = 10


@dataclass(frozen=True)
class Maximum:
    """A maximum of the prescan.

    Parameters
    ----------
    frequency_hz, level_dbuv : float
        Corrected level.
    margin_db : float
        Limit minus level, for the nearest limit line.
    detector, line, operating : str
        Detector, line and operating state of the spectrum in which it was found.
    """

    frequency_hz: float
    level_dbuv: float
    margin_db: float
    detector: str
    line: str
    operating: str

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return dict(vars(self))


def choose_maxima(spectra: Sequence[Spectrum], limit: Limit, rules: Rules) -> tuple[tuple[Maximum, ...], int]:
    """The maxima to measure again, by frequency, and the number of further maxima within the margin.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Corrected; spectra with the motor off are ignored. Overloaded points are included, because their true level is higher.
    limit : Limit
    rules : Rules

    Raises
    ------
    BadInput
        If no spectrum of the running motor can be compared with the limit.
    """
    found = [one for spectrum in spectra if not spectrum.is_background for one in _maxima_of(spectrum, limit)]
    if not found:
        raise BadInput(f"there is no prescan of the running motor that {limit.title} covers; add a step 'spectrum' before 'final'")
    near = sorted((one for one in found if one.margin_db < rules.margin_db), key=lambda one: one.margin_db)
    chosen: list[Maximum] = []
    for one in near:
        if all(abs(one.frequency_hz - other.frequency_hz) >= rules.apart_hz for other in chosen):
            chosen.append(one)
    span = [one.frequency_hz for one in found]
    edges = np.geomspace(min(span), max(span) * (1 + 1e-9), rules.subranges + 1)
    groups: dict[int, list[Maximum]] = {}
    for one in chosen:
        groups.setdefault(int(np.searchsorted(edges, one.frequency_hz, "right")), []).append(one)
    # First the nearest to the limit of each subrange, then the second of each subrange, and so on.
    turns = [(turn, one) for group in groups.values() for turn, one in enumerate(group)]
    turns.sort(key=lambda of: (of[0], of[1].margin_db, of[1].frequency_hz))
    taken = sorted((one for _, one in turns[: rules.maxima]), key=lambda one: one.frequency_hz)
    return tuple(taken), len(chosen) - len(taken)


def _maxima_of(spectrum: Spectrum, limit: Limit) -> Iterable[Maximum]:
    """Local maxima with their margins to the limit lines of the same detector and of detectors that read lower."""
    level = spectrum.level_dbuv
    rank = ORDER.index(spectrum.detector)
    lines = [line for line in limit.lines if line is line_for(limit, spectrum.detector) or rank < ORDER.index(line.detector)]
    for line in lines:
        margin = line.level_dbuv(spectrum.frequency_hz) - level
        for index in np.flatnonzero(tops(level, np.isfinite(margin))):
            yield Maximum(
                float(spectrum.frequency_hz[index]),
                float(level[index]),
                float(margin[index]),
                spectrum.detector,
                str(spectrum.metadata.get("line", "")),
                str(spectrum.metadata.get("operating", "")),
            )


def tops(level_dbuv: FloatArray, limited: BoolArray) -> BoolArray:
    """Local maxima within each part of a spectrum that has a limit; an end of such a part is one if it is higher than the point beside it."""
    padded = np.concatenate([[-np.inf], np.where(limited, level_dbuv, -np.inf), [-np.inf]])
    return limited & (padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:])


@dataclass(frozen=True)
class Final:
    """One final value: the highest reading over lines and operating states.

    Parameters
    ----------
    frequency_hz : float
        Frequency of the highest reading near the maximum.
    detector : str
    reading_dbuv, correction_db, level_dbuv : float
        Reading of the receiver, correction, and their sum.
    limit_dbuv, margin_db : float, optional
        None if the limit has no line for the detector, or none at this frequency.
    resolution_bandwidth_hz, dwell_s : float
    line, operating : str
        Line and operating state of the highest reading; empty if not stated.
    overload : bool
        The receiver was overloaded: the true level is higher.
    """

    frequency_hz: float
    detector: str
    reading_dbuv: float
    correction_db: float
    level_dbuv: float
    limit_dbuv: float | None
    margin_db: float | None
    resolution_bandwidth_hz: float
    dwell_s: float
    line: str
    operating: str
    overload: bool

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return dict(vars(self))


def final_values(finals: Sequence[Spectrum], corrections: Corrections, limit: Limit) -> tuple[Final, ...]:
    """The table of final values, by frequency and detector.

    Parameters
    ----------
    finals : sequence of Spectrum
        Short scans around the maxima, uncorrected, with `maximum_hz` in their metadata.
    corrections : Corrections
    limit : Limit
    """
    best: dict[tuple[float, str], Final] = {}
    for spectrum in finals:
        one = _final(spectrum, corrections, limit)
        key = float(spectrum.metadata.get("maximum_hz", one.frequency_hz)), one.detector
        if key not in best or one.level_dbuv > best[key].level_dbuv:
            best[key] = one
    return tuple(best[key] for key in sorted(best, key=lambda key: (key[0], ORDER.index(key[1]))))


def _final(spectrum: Spectrum, corrections: Corrections, limit: Limit) -> Final:
    added: FloatArray = corrections.added_db("receiver", spectrum.frequency_hz)
    level = spectrum.level_dbuv + added
    top = int(np.argmax(level))
    line = line_for(limit, spectrum.detector)
    bound = float(line.level_dbuv(spectrum.frequency_hz[top : top + 1])[0]) if line is not None else np.nan
    limit_dbuv = bound if np.isfinite(bound) else None
    return Final(
        float(spectrum.frequency_hz[top]),
        spectrum.detector,
        float(spectrum.level_dbuv[top]),
        float(added[top]),
        float(level[top]),
        limit_dbuv,
        None if limit_dbuv is None else limit_dbuv - float(level[top]),
        spectrum.resolution_bandwidth_hz,
        float(spectrum.metadata.get("dwell_s", 0.0)),
        # A receiver that switches the LISN by itself states the phase with each value, and its scans are the highest of all lines.
        str(spectrum.metadata.get("line", spectrum.metadata.get("phase", ""))),
        str(spectrum.metadata.get("operating", "")),
        bool(spectrum.overload.any()),
    )


def judge_with_finals(
    values: Sequence[Final], finals: Sequence[Spectrum], running: Sequence[Spectrum], limit: Limit, expanded_uncertainty_db: float
) -> list[Judged]:
    """Final values against the limit; a scan is judged only against limit lines without final values on its line and in its operating state."""
    judged = judge_finals(values, limit, expanded_uncertainty_db)
    lines = {one.detector: one.line for one in judged}
    settled = {(lines[final.detector], *place_of(final)) for final in finals if final.detector in lines}
    scans = judge_spectra(running, limit, expanded_uncertainty_db)
    return judged + [one for one in scans if (one.line, one.conductor, one.operating) not in settled]


def judge_finals(values: Sequence[Final], limit: Limit, expanded_uncertainty_db: float) -> list[Judged]:
    """Final values against the limit line of their detector; an overloaded value below its limit is not judged."""
    judged = []
    for detector in dict.fromkeys(value.detector for value in values):
        line = line_for(limit, detector)
        own = [value for value in values if value.detector == detector and value.margin_db is not None]
        if line is None or not own:
            continue
        usable = [value for value in own if not (value.overload and (value.margin_db or 0.0) >= 0)]
        if not usable:
            why = "the receiver was overloaded at every final value: measure again with more attenuation"
            judged.append(Judged(detector, line.detector, None, None, None, 0, len(own), why))
            continue
        worst = min(usable, key=lambda value: value.margin_db or 0.0)
        margin = worst.margin_db or 0.0
        side = "below" if margin >= 0 else "above"
        why = f"final value {side} the {line.detector} limit by {abs(margin):.1f} dB at {worst.frequency_hz / 1e6:.6g} MHz"
        left_out = len(own) - len(usable)
        verdict = verdict_of(margin, expanded_uncertainty_db)
        if left_out and verdict == "pass":
            verdict, why = "marginal", f"{why}; {left_out} overloaded not judged"
        judged.append(Judged(detector, line.detector, verdict, margin, worst.frequency_hz, len(usable), left_out, why, worst.line, worst.operating))
    return judged
