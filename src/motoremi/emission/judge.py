"""Pass, marginal or fail: levels against the limit line of their detector, with the expanded uncertainty as guard band.

A level passes if it is below the limit by more than the expanded uncertainty, fails if it is above by more than that, and is marginal in
between. A detector that reads higher can only show a pass: if peak is below the quasi-peak limit, quasi-peak is below it as well, but peak above
the limit leaves the verdict open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, JsonDict
from motoremi.data.spectrum import Spectrum
from motoremi.emission.limit import Limit, LimitLine
from motoremi.errors import BadInput

Verdict: TypeAlias = Literal["pass", "marginal", "fail"]
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
    """

    detector: str
    line: str
    verdict: Verdict | None
    worst_margin_db: float | None
    worst_hz: float | None
    points: int
    left_out: int
    why: str

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return dict(vars(self))


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
) -> list[Judged]:
    """Levels of one detector against every limit line that applies to them.

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
        margin = (bound - level_dbuv)[usable]
        worst = int(np.argmin(margin))
        least, at_hz = float(margin[worst]), float(frequency_hz[usable][worst])
        verdict: Verdict | None = verdict_of(least, expanded_uncertainty_db)
        why = f"{'below' if least >= 0 else 'above'} the {line.detector} limit by {abs(least):.1f} dB at {at_hz / 1e6:.4g} MHz"
        if line is not own:
            if verdict == "pass":
                why = f"{detector} is {why}: {line.detector} reads no higher, so it passes too"
            else:
                verdict, why = None, f"{detector} is {why}: that does not decide on {line.detector}; measure with the {line.detector} detector"
        found.append(Judged(detector, line.detector, verdict, least, at_hz, int(usable.sum()), left_out, why))
    return found


def verdict_of(margin_db: float, uncertainty_db: float) -> Verdict:
    """Verdict on a level that is below its limit by a margin."""
    if margin_db >= uncertainty_db - 1e-9:
        return "pass"
    return "fail" if margin_db < -uncertainty_db else "marginal"


def judge_spectra(spectra: Sequence[Spectrum], limit: Limit, expanded_uncertainty_db: float = EXPANDED_UNCERTAINTY_DB) -> list[Judged]:
    """All measured spectra; points at which the receiver was overloaded are left out."""
    return [
        judged
        for spectrum in spectra
        for judged in judge_levels(spectrum.detector, spectrum.frequency_hz, spectrum.level_dbuv, limit, expanded_uncertainty_db, spectrum.overload)
    ]


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
