"""Levels that contradict each other, the background, or the physics of a receiver: they show no pass, whatever the limit.

No detector reads more than one that reads higher by its definition, a running motor no less than the same set-up with the motor off, and no
receiver less than the thermal noise at its input. Where levels do, files were exchanged, a column has another unit, or the disturbance was not
there all the time; a bound that rests on the higher detector then bounds nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.data.kernels import nearest_points, within_half_a_step
from motoremi.data.spectrum import Spectrum
from motoremi.emission.band import BANDWIDTH_TOLERANCE
from motoremi.emission.finals import Rules
from motoremi.emission.judge import ORDER, Judged, judge_levels, levels_in_words, line_for, place_of
from motoremi.emission.limit import Limit
from motoremi.quantities import show_band

# With less time at a point the linear average is no final value.
FINAL_DWELL_S = 1.0
# Readings of a running motor, one after the other, differ by a few dB.
SCATTER_DB = 6.0
# Lower levels are often noise of the receiver, which its attenuator shifts.
NEAR_DB = Rules().margin_db
# The surroundings count as quiet if they are lower than this below the limit (CISPR 16-2-1, from memory, not checked against the standard).
QUIET_DB = 6.0
# Thermal noise at 290 K in 1 Hz, in dBuV across 50 Ohm: -174 dBm and 107 dB.
THERMAL_DBUV = -67.0
# Averages of noise in decibels scatter below it by a few dB; what is this much lower is no reading.
NO_READING_DB = 10.0
# 10 V at the LISN: CISPR limits end at 130 dBuV.
MOST_DBUV = 140.0


def contradictions(spectra: Sequence[Spectrum], finals: Sequence[Spectrum], background: Sequence[Spectrum], limit: Limit) -> list[str]:
    """Why corrected levels of one line of the LISN and operating state cannot all be right together, each in a sentence."""
    return [*_out_of_order(spectra, finals, limit), *_below_the_background(spectra, background, limit)]


def surroundings(spectra: Sequence[Spectrum], background: Sequence[Spectrum], judged: Sequence[Judged]) -> list[str]:
    """Where the surroundings may be why levels do not pass: the level with the motor off is hardly lower there."""
    found = []
    for one in judged:
        if one.verdict == "pass" or one.worst_hz is None or one.worst_margin_db is None:
            continue
        at_hz = np.array([one.worst_hz])
        quiet = [level for other in background if other.detector == one.detector for level in _near(other, at_hz) if np.isfinite(level)]
        running = [level for other in spectra if other.detector == one.detector for level in _near(other, at_hz) if np.isfinite(level)]
        if quiet and running and one.worst_margin_db < QUIET_DB and max(running) - max(quiet) < QUIET_DB:
            less_db = max(running) - max(quiet)
            how = f"{less_db:.1f} dB lower" if less_db > 0 else "no lower"
            found.append(
                f"{one.detector}: at {one.worst_hz / 1e6:.4g} MHz the level with the motor off is {how}: the surroundings may be the cause; "
                "measure in a shielded room"
            )
    return list(dict.fromkeys(found))


def of_the_background(background: Sequence[Spectrum], limit: Limit) -> list[str]:
    """How far the levels with the motor off are below each limit line, the worst of a detector and place; so far below is wanted of them."""
    worst: dict[tuple[str, str], Judged] = {}
    for one in background:
        for judged in judge_levels(one.detector, one.frequency_hz, one.level_dbuv, limit, QUIET_DB, one.overload, one.resolution_bandwidth_hz):
            key = levels_in_words(one.detector, *place_of(one)), judged.line
            if judged.worst_margin_db is not None and (key not in worst or judged.worst_margin_db < (worst[key].worst_margin_db or 0.0)):
                worst[key] = judged
    wanted = f"{QUIET_DB:g} dB below are wanted"
    return [
        f"{what} with the motor off: {one.why.split(':')[0]}; {wanted}" + ("" if one.verdict == "pass" else ": measure in a shielded room")
        for (what, _), one in worst.items()
    ]


def _out_of_order(spectra: Sequence[Spectrum], finals: Sequence[Spectrum], limit: Limit) -> Iterator[str]:
    """Detectors that read more than one that reads higher by definition."""
    for higher, lower in product((*spectra, *finals), (*filter(reads_as_final, spectra), *finals)):
        if ORDER.index(higher.detector) < ORDER.index(lower.detector) and (excess := _excess(lower, higher, limit)) is not None:
            yield (
                f"{lower.detector}: at {excess} more than {higher.detector}, which reads no less of a steady disturbance: was the motor running "
                "for both, was the time at each point long enough, and are the files what they are called? Measure both again"
            )


def reads_as_final(scan: Spectrum) -> bool:
    """Whether a scan reads no higher than a final value by its detector would.

    A meter that had too little time reads lower; only the linear average over a part of a burst reads higher than over a second.
    """
    settings = scan.metadata.get("settings")
    dwell = settings.get("dwell_s") if isinstance(settings, Mapping) else None
    return scan.detector != "average" or not isinstance(dwell, (int, float)) or dwell >= FINAL_DWELL_S


def _below_the_background(spectra: Sequence[Spectrum], background: Sequence[Spectrum], limit: Limit) -> Iterator[str]:
    """Scans with the motor off that read more than those with the motor running."""
    for off, running in product(background, spectra):
        if off.detector == running.detector and (excess := _excess(off, running, limit)) is not None:
            yield (
                f"{off.detector} with the motor off: at {excess} more than with the motor running: are the files exchanged, or did the "
                "surroundings change? Measure both again"
            )


def _excess(one: Spectrum, other: Spectrum, limit: Limit) -> str | None:
    """Where, and by how much at most, a spectrum reads more than another one although it cannot; None if it does not, within their scatter.

    Only levels near the limit of its detector, or above it, count.
    """
    line = line_for(limit, one.detector)
    if line is None or abs(one.resolution_bandwidth_hz / other.resolution_bandwidth_hz - 1) > BANDWIDTH_TOLERANCE:
        return None
    matters = (line.level_dbuv(one.frequency_hz) - one.level_dbuv < NEAR_DB) & ~one.overload
    more = np.where(matters, one.level_dbuv - _near(other, one.frequency_hz), np.nan)
    if not np.any(more > SCATTER_DB):
        return None
    top = int(np.nanargmax(more))
    return f"{one.frequency_hz[top] / 1e6:.6g} MHz it reads {more[top]:.1f} dB"


def impossible_levels(spectra: Sequence[Spectrum], limit: Limit) -> Iterator[str]:
    """Levels that no receiver reads; they are those of a voltage at 50 Ohm, so not of a probe or an antenna."""
    for one in spectra if limit.unit == "dBuV" else ():
        what, typical, highest = one.detector, float(np.median(one.level_dbuv)), float(one.level_dbuv.max())
        noise = THERMAL_DBUV + 10 * np.log10(one.resolution_bandwidth_hz)
        none = one.level_dbuv < noise - NO_READING_DB
        if typical >= noise and none.any():
            where = show_band(*one.frequency_hz[none][[0, -1]])
            yield (
                f"{what}: points within {where} (number: {np.count_nonzero(none)}) read down to {one.level_dbuv.min():.0f} dBuV, far below the "
                f"thermal noise of 50 Ohm ({noise:.0f} dBuV), so they were not measured: remove these rows"
            )
        if typical < noise:
            below = f"below {typical:.0f} dBuV, less than the thermal noise of 50 Ohm ({noise:.0f} dBuV)"
            yield f"{what}: half of the levels are {below}: is the unit dBm?"
        if highest > MOST_DBUV:
            yield f"{what}: up to {highest:.0f} dBuV, more than 10 V: is the unit right, and was a correction applied twice?"


def _near(spectrum: Spectrum, frequency_hz: FloatArray) -> FloatArray:
    """The highest level at the nearest point and the two beside it; NaN where the nearest is more than half a step away, or overloaded.

    A single final value is of its bandwidth.
    """
    own = spectrum.frequency_hz
    if len(spectrum) > 1:
        nearest, near = within_half_a_step(own, frequency_hz)
    else:
        nearest, near = nearest_points(own, frequency_hz), np.abs(own - frequency_hz) <= spectrum.resolution_bandwidth_hz / 2
    padded = np.concatenate([[-np.inf], spectrum.level_dbuv, [-np.inf]])
    highest = np.max([padded[nearest], padded[nearest + 1], padded[nearest + 2]], axis=0)
    return np.where(near & ~spectrum.overload[nearest], highest, np.nan)
