"""The verdict on all levels together: what is above the limit, and what of the limit the measurements do not show.

A pass needs, on every line of the LISN and in every operating state that was measured, levels below each limit line wherever there are scans. Where
there are final values, a maximum of the scans above the limit needs one; so does one inside the guard band that the limit's own detector shows. If
that is not shown, the verdict is marginal at best. It is on the part of the limit's span that was measured; the rest is named with it.

Where scans were repeated, the highest reading of a detector counts, and a final value does not cancel a higher scan by the same detector.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from motoremi.arrays import BoolArray, JsonDict
from motoremi.data.final_list import SCAN_STEP
from motoremi.data.kernels import steps_beside
from motoremi.data.spectrum import Spectrum
from motoremi.emission.band import misread
from motoremi.emission.doubts import NEAR_DB, SCATTER_DB, contradictions, impossible_levels, reads_as_final, surroundings
from motoremi.emission.finals import Rules, tops
from motoremi.emission.judge import ORDER, WORST_FIRST, Judged, Verdict, levels_in_words, line_for, overall, place_of, where_in_words
from motoremi.emission.limit import Limit, LimitLine
from motoremi.quantities import percent, show_band

Span: TypeAlias = tuple[float, float]
# Line of the LISN and operating state.
Place: TypeAlias = tuple[str, str]
NOT_STATED: Place = ("", "")
# A step so many times wider than the bandwidth is a gap: a disturbance between its two points is in neither reading. It is that between two scans
# in one spectrum, or between the rows of a list of maxima.
GAP = SCAN_STEP
# Spans that a reason lists.
LISTED = 4
# A maximum of a scan is the same as one that was measured again if it is nearer than this.
APART_HZ = Rules().apart_hz
# Noise is equal at two points in a row of two scans at most every second time, however coarse the resolution: at so many once in a million.
CHANGES = 20


@dataclass(frozen=True)
class Gap:
    """A part of the span of a limit line in which nothing was measured that decides on it.

    Parameters
    ----------
    detector : str
        Detector of the limit line.
    low_hz, high_hz : float
    conductor, operating : str
        Line of the LISN and operating state of the motor; empty if not stated.
    """

    detector: str
    low_hz: float
    high_hz: float
    conductor: str = ""
    operating: str = ""

    def to_dict(self) -> JsonDict:
        """Plain data."""
        band = [self.low_hz, self.high_hz]
        return {"detector": self.detector, "band_hz": band, "conductor": self.conductor, "operating": self.operating}


@dataclass(frozen=True)
class Compliance:
    """A verdict; why it is no pass, and of what span it is, the most serious first.

    `gaps` are the spans that the reasons call not measured, all of them and as numbers.
    """

    verdict: Verdict
    reasons: tuple[str, ...]
    gaps: tuple[Gap, ...] = field(default=(), compare=False)


@dataclass(frozen=True)
class _OnLine:
    """What the levels of one place show of one limit line; a verdict of None is open."""

    verdict: Verdict | None
    reason: str
    missing: tuple[Span, ...]


def compliance(
    spectra: Sequence[Spectrum],
    finals: Sequence[Spectrum],
    judged: Sequence[Judged],
    limit: Limit,
    guard_db: float,
    background: Sequence[Spectrum] = (),
) -> Compliance:
    """The verdict on measured levels.

    Parameters
    ----------
    spectra : sequence of Spectrum
        Scans of the running motor, corrected.
    finals : sequence of Spectrum
        Short scans around the maxima, corrected.
    judged : sequence of Judged
        Verdicts on their levels, one by one.
    limit : Limit
    guard_db : float
        Expanded uncertainty.
    background : sequence of Spectrum, optional
        Scans with the motor off, corrected.
    """
    found: list[tuple[Verdict | None, str]] = []
    gaps: list[Gap] = []
    scanned = list(dict.fromkeys(place_of(spectrum) for spectrum in spectra))
    with_finals = [_home(place_of(final), scanned) for final in finals if place_of(final) != NOT_STATED]
    for place in dict.fromkeys([*scanned, *with_finals]):
        own = [spectrum for spectrum in spectra if place_of(spectrum) == place]
        own_finals = [spectrum for spectrum in finals if _home(place_of(spectrum), scanned) == place]
        places = [(one, (one.conductor, one.operating)) for one in judged]
        of_place = [one for one, own_place in places if own_place == NOT_STATED or _home(own_place, scanned) == place]
        lines = {line.detector: _on_line(own, own_finals, of_place, line, limit, guard_db) for line in limit.lines}
        if "peak" in lines and "quasi-peak" in lines:
            # A peak limit beside a quasi-peak limit is an alternative to it (CISPR 25): either is enough, and quasi-peak decides if peak does not.
            peak = lines.pop("peak")
            lines["quasi-peak"] = peak if peak.verdict == "pass" else lines["quasi-peak"]
        at = f"{where}: " if (where := where_in_words(*place)) else ""
        own_background = [spectrum for spectrum in background if _home(place_of(spectrum), scanned) == place]
        found += [(one.verdict, f"{at}{one.reason}" if one.reason else "") for one in lines.values()]
        # Beside a level that fails, others that read too little change nothing.
        fails = any(one.verdict == "fail" for one in lines.values())
        doubts = [*(() if fails else contradictions(own, own_finals, own_background, limit)), *impossible_levels(own, limit)]
        found += [(None, f"{at}{text}") for text in doubts]
        found += [("pass", f"{at}{text}") for text in surroundings(own, own_background, of_place)]
        gaps += [Gap(detector, *span, *place) for detector, one in lines.items() for span in _joined(one.missing)]
    found += [("marginal", text) for text in (*_unchanged([*background, *spectra]), *_left_out(spectra))]
    worst = min((verdict for verdict, _ in found), key=WORST_FIRST.index, default=None)
    ranked = sorted((one for one in found if one[1]), key=lambda one: WORST_FIRST.index(one[0]))
    return Compliance(worst or "marginal", tuple(dict.fromkeys(reason for _, reason in ranked)), tuple(gaps))


def _home(place: Place, scanned: Sequence[Place]) -> Place:
    """The place of scans that a final value belongs to: its own, else one of which line or state is not stated; its own without such scans."""
    if place in scanned:
        return place
    return next((one for one in scanned if all(part in ("", own) for part, own in zip(one, place, strict=True))), place)


def of_prediction(judged: Sequence[Judged], limit: Limit) -> Compliance:
    """The verdict on predicted levels."""
    return Compliance(overall(judged, limit), tuple(f"{one.detector}: {one.why}" for one in judged if one.verdict != "pass"))


def _on_line(
    spectra: Sequence[Spectrum], finals: Sequence[Spectrum], judged: Sequence[Judged], line: LimitLine, limit: Limit, guard_db: float
) -> _OnLine:
    """Verdict of the levels of one place against one limit line, with the reason."""
    own = [one for one in judged if one.line == line.detector and line_for(limit, one.detector) is line and (one.points or one.left_out)]
    worst = min(own, key=lambda one: (WORST_FIRST.index(one.verdict), one.worst_margin_db or 0.0), default=None)
    exact = [spectrum for spectrum in spectra if line_for(limit, spectrum.detector) is line]
    higher = [spectrum for spectrum in spectra if ORDER.index(spectrum.detector) < ORDER.index(line.detector) and spectrum not in exact]
    limited = [(low, high) for low, high, _, _ in line.segments]
    missing = _without(limited, [span for one in (*exact, *higher) for span in _around(one, np.ones(len(one), dtype=np.bool_))])
    measured = _without(limited, missing)
    if worst is not None and worst.verdict == "fail":
        return _OnLine("fail", f"{worst.detector}: {worst.why}", tuple(missing))
    if not measured:
        return _OnLine(None, f"{line.detector}: not measured", tuple(missing))
    final = [spectrum for spectrum in finals if line_for(limit, spectrum.detector) is line]
    left = _not_valid([*exact, *higher], line, measured) or _overloaded(exact, line, measured, guard_db)
    if not left and final:
        found = _contradicted(exact, final, line, guard_db), _not_read_again(exact, higher, final, line, guard_db)
        left = "; ".join(text for text in found if text)
    elif not left:
        left = _not_below(exact, higher, line, measured, guard_db)
    verdict: Verdict | None = worst.verdict if worst is not None and worst.verdict != "pass" else None if left else "pass"
    said = [f"{worst.detector}: {worst.why}"] if worst is not None and worst.verdict != "pass" else []
    said += [left] if left and (worst is None or worst.verdict is not None) else []
    if missing:
        share = percent(100 * decades(measured) / decades(limited), 2)
        said.append(f"{line.detector}: not measured at {_listed(missing)}; the verdict is on the rest, {share} of the limit's span")
    return _OnLine(verdict, "; ".join(said), tuple(missing))


def decades(spans: Iterable[Sequence[float]]) -> float:
    """The width of spans (low, high) in hertz, all together, in decades as on the axis of a limit: half of 150 kHz - 30 MHz lies below 2.1 MHz."""
    return sum(math.log10(high / low) for low, high in spans)


def _not_valid(speaking: Sequence[Spectrum], line: LimitLine, measured: Sequence[Span]) -> str:
    """Where all readings are of an overloaded receiver or of a bandwidth that reads too low; empty if that is nowhere."""
    left = _without(measured, [span for one in speaking for span in _around(one, _valid(one))])
    if not left:
        return ""
    why = "the receiver was overloaded" if any(one.overload.any() for one in speaking) else "the bandwidth reads too low"
    return f"{line.detector}: {why} at {_listed(left)}"


def _overloaded(exact: Sequence[Spectrum], line: LimitLine, measured: Sequence[Span], guard_db: float) -> str:
    """Where a limit's own detector was not below it while the receiver was overloaded; empty if that is nowhere.

    Another scan that reads less does not settle that: the disturbance may have been there in the first one only.
    """
    too_high = [(one, one.overload & ~_below(one, line, guard_db)) for one in exact]
    spans = [span for one, points in too_high for span in _around(one, points)]
    where = _without(measured, _without(measured, spans))
    if not where:
        return ""
    highest = max(float(one.level_dbuv[points].max()) for one, points in too_high if points.any())
    return (
        f"{line.detector}: a scan reads up to {highest:.1f} with the receiver overloaded at {_listed(where)}, which a scan that reads "
        "less does not settle: measure all of it again with more attenuation in a new session"
    )


def _not_below(exact: Sequence[Spectrum], higher: Sequence[Spectrum], line: LimitLine, measured: Sequence[Span], guard_db: float) -> str:
    """Where levels of a detector that reads higher are not below a limit line and its own detector was not used; empty if that is nowhere."""
    spans = [span for one in exact for span in _around(one, _valid(one))]
    for detector in dict.fromkeys(one.detector for one in higher):
        own = [(one, _below(one, line, guard_db)) for one in higher if one.detector == detector]
        below = [span for one, points in own for span in _around(one, _valid(one) & points)]
        # A bandwidth that reads too high does not contradict the right one.
        above = [span for one, points in own for span in _around(one, ~points & ~_reads(one, low=False))]
        spans += _without(_joined(below), above)
    left = _without(measured, spans)
    if not left:
        return ""
    detector = higher[0].detector if higher else line.detector
    return f"{line.detector}: {detector} is not below that limit by the guard band at {_listed(left)}; measure {line.detector} there"


def _contradicted(exact: Sequence[Spectrum], finals: Sequence[Spectrum], line: LimitLine, guard_db: float) -> str:
    """Where a final value is much lower than a scan by a limit's own detector, or only the scan is too high to pass; empty if that is nowhere.

    Both are measurements of the same, so the higher reading counts.
    """
    found: list[tuple[float, str]] = []
    for scan in (one for one in exact if reads_as_final(one)):
        margin = line.level_dbuv(scan.frequency_hz) - scan.level_dbuv
        comparable = np.isfinite(margin) & ~scan.overload & ~_reads(scan, low=False)
        for final in finals:
            same = comparable & _within(scan, final)
            if not same.any():
                continue
            top = int(np.argmin(np.where(same, margin, np.inf)))
            lower_db = float(scan.level_dbuv[top] - final.level_dbuv.max())
            alone = not _below(scan, line, guard_db)[top] and bool(_below(final, line, guard_db).all())
            impossible = lower_db > SCATTER_DB and ORDER.index(final.detector) <= ORDER.index(scan.detector)
            if alone or (impossible and margin[top] < NEAR_DB):
                side = f"{abs(margin[top]):.1f} dB {'below' if margin[top] >= 0 else 'above'} that limit"
                what = "was the motor still running? measure both again" if impossible else "the higher reading counts"
                what = f"the {final.detector} final value is {lower_db:.1f} dB below the {scan.detector} scan, which is {side}: {what}"
                found.append((float(margin[top]), f"{line.detector}: at {scan.frequency_hz[top] / 1e6:.6g} MHz {what}"))
    return min(found)[1] if found else ""


def _within(scan: Spectrum, final: Spectrum) -> BoolArray:
    """Points of a scan that a final measurement covers."""
    before, after = steps_beside(scan.frequency_hz)
    return (scan.frequency_hz + after / 2 >= final.frequency_hz[0]) & (scan.frequency_hz - before / 2 <= final.frequency_hz[-1])


def _not_read_again(exact: Sequence[Spectrum], higher: Sequence[Spectrum], finals: Sequence[Spectrum], line: LimitLine, guard_db: float) -> str:
    """How many maxima of the scans, above a limit line or by its own detector inside the guard band, have no final value; empty for none."""
    known_hz = np.array([float(spectrum.metadata.get("maximum_hz", spectrum.frequency_hz.mean())) for spectrum in finals])
    margins: list[tuple[float, float]] = []
    for scan in (*exact, *higher):
        margin = line.level_dbuv(scan.frequency_hz) - scan.level_dbuv
        if scan in exact and reads_as_final(scan):
            known = np.any([_within(scan, final) for final in finals], axis=0)
        else:
            known = np.min(np.abs(known_hz[:, None] - scan.frequency_hz), axis=0) < APART_HZ
        # What the limit's own detector would read is lower than a reading of a higher detector, so that one needs no guard band.
        too_high = ~_below(scan, line, guard_db if scan in exact else 0.0)
        left = tops(-margin, np.isfinite(margin)) & too_high & ~known
        margins += zip(margin[left].tolist(), scan.frequency_hz[left].tolist(), strict=True)
    if not margins:
        return ""
    margin_db, hertz = min(margins)
    above = sum(one < 0 for one, _ in margins)
    at = f"at {hertz / 1e6:.6g} MHz"
    if above:
        side, highest = "above that limit", f"the highest by {-margin_db:.1f} dB {at}"
        highest += f", and {len(margins) - above} inside its guard band" if above < len(margins) else ""
    else:
        side, highest = "inside the guard band of that limit", f"the highest {margin_db:.1f} dB below the limit {at}"
    count = above or len(margins)
    what = f"1 maximum of the scans is {side} and has" if count == 1 else f"{count} maxima of the scans are {side} and have"
    return f"{line.detector}: {what} no final value, {highest}: measure more maxima again"


def _unchanged(spectra: Sequence[Spectrum]) -> Iterable[str]:
    """Scans with different detectors, or with the motor off and running, that are equal at every point."""
    same: dict[tuple[bytes, bytes], dict[tuple[str, bool], str]] = {}
    for one in spectra:
        # Scans in which the level hardly changes may be equal by chance, or because the receiver shows no less.
        if np.count_nonzero(np.diff(one.level_dbuv)) >= CHANGES:
            name = levels_in_words(one.detector, *place_of(one)) + (" with the motor off" if one.is_background else "")
            same.setdefault((one.frequency_hz.tobytes(), one.level_dbuv.tobytes()), {})[one.detector, one.is_background] = name
    for names in same.values():
        if len(names) > 1:
            *others, last = names.values()
            yield (
                f"{'; '.join(others)} and {last} have the same level at every point, so the receiver did not measure anew: "
                "set its trace to clear/write and measure again"
            )


def _left_out(spectra: Sequence[Spectrum]) -> Iterable[str]:
    """Final values of the receiver that an imported file holds and that are not judged."""
    return [str(text) for spectrum in spectra if (text := spectrum.metadata.get("final_values_left_out"))]


def _valid(spectrum: Spectrum) -> BoolArray:
    """Points that show what a detector reads: not overloaded, and not in a bandwidth that reads too low."""
    return ~spectrum.overload & ~_reads(spectrum, low=True)


def _reads(spectrum: Spectrum, low: bool) -> BoolArray:
    """Points that the bandwidth reads too low, or too high."""
    return misread(spectrum.frequency_hz, spectrum.resolution_bandwidth_hz, low)


def _below(spectrum: Spectrum, line: LimitLine, guard_db: float) -> BoolArray:
    """Points that are below a limit line by at least the guard band; points without a limit count as well."""
    margin = line.level_dbuv(spectrum.frequency_hz) - spectrum.level_dbuv
    return ~(margin < guard_db - 1e-9)


def _around(spectrum: Spectrum, usable: BoolArray) -> list[Span]:
    """Spans around the usable points of a spectrum; each reaches half way to its neighbours, and beside a gap to the bandwidth at most."""
    frequency = spectrum.frequency_hz
    before, after = steps_beside(frequency)
    widest = GAP * spectrum.resolution_bandwidth_hz
    # At the ends a whole step: a scan ends at the last multiple of its step.
    reach = np.array([before, after]) / 2
    reach[0, 0], reach[1, -1] = before[0], after[-1]
    reach = np.where(np.array([before, after]) > widest, np.minimum(np.minimum(before, after), spectrum.resolution_bandwidth_hz), reach)
    low, high = (frequency - reach[0])[usable], (frequency + reach[1])[usable]
    return list(zip(low.tolist(), high.tolist(), strict=True))


def _without(segments: Sequence[Span], spans: Sequence[Span]) -> list[Span]:
    """What of the segments no span covers."""
    left: list[Span] = []
    ordered = _joined(spans)
    starts = [begin for begin, _ in ordered]
    for low, high in segments:
        at = low
        for begin, end in ordered[max(bisect_right(starts, low) - 1, 0) : bisect_right(starts, high)]:
            if begin > at * (1 + 1e-9):
                left.append((at, begin))
            at = max(at, end)
        if at < high * (1 - 1e-9):
            left.append((at, high))
    return left


def _joined(spans: Sequence[Span]) -> list[Span]:
    """The same spans in order, those that touch or overlap each other as one."""
    joined: list[Span] = []
    for low, high in sorted(spans):
        if joined and low <= joined[-1][1] * (1 + 1e-9):
            joined[-1] = joined[-1][0], max(joined[-1][1], high)
        else:
            joined.append((low, high))
    return joined


def _listed(spans: Sequence[Span]) -> str:
    """Spans as text."""
    joined = _joined(spans)
    beyond = len(joined) - LISTED
    more = f" and {beyond} more span{'s' if beyond > 1 else ''}" if beyond > 0 else ""
    return ", ".join(show_band(*span) for span in joined[:LISTED]) + more
