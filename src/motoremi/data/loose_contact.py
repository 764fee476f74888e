"""A loose contact: a resistance in series that is in some repeats over some stretches of points, and in others not.

It comes and goes from one point to the next, and stays the same over the points between; a part that differs between repeats changes along
frequency instead.
"""

from __future__ import annotations

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, runs
from motoremi.data.repeats import UNLIKE
from motoremi.data.sweep import RepeatedSweep
from motoremi.quantities import show

# Largest angle of what is added to Z, and largest relative change from one point to the next within a stretch: a resistance seen through cables
# and fixture. Noise has such values at three neighbouring points by a chance of less than one in 10^6.
RESISTIVE, ALIKE = np.deg2rad(15), 0.05
# Least number of points of a stretch, and least change where it begins or ends, relative to the resistance.
LEAST_POINTS, ABRUPT = 3, 0.5
# Share of a sweep's points above which its impedance is not known. With fewer the others decide, and these count as points that stand out.
TOO_MANY = 0.05
TO_FASTEN = "fasten clips and connectors, and measure again"


def loose_contact(sweep: RepeatedSweep) -> str | None:
    """What repeats of a sweep show of a loose contact, in words; None for a single sweep, and if it is at few points only."""
    if sweep.repeats < 2:
        return None
    impedance = sweep.impedance_ohm
    least = np.take_along_axis(impedance, np.argmin(impedance.real, axis=0)[None], axis=0)
    found = np.zeros(sweep.frequency_hz.size, dtype=np.bool_)
    resistances = []
    for added in impedance - least:
        large = added.real > UNLIKE * np.abs(least[0])
        for stretch in _stretches(added, large & (np.abs(np.angle(added)) < RESISTIVE)):
            found[stretch] = True
            resistances.append(float(np.median(added[stretch].real)))
    points = int(np.count_nonzero(found))
    if points <= TOO_MANY * found.size:
        return None
    size = " to ".join(dict.fromkeys(show(ohm, "Ohm", 2) for ohm in (min(resistances), max(resistances))))
    return (
        f"repeats of the {sweep.termination} sweep differ at {points} of {found.size} points by a resistance of {size} that comes and goes, as of "
        "a loose contact"
    )


def _stretches(added: ComplexArray, possible: BoolArray) -> list[slice]:
    """Stretches of neighbouring points with one resistance, which begin and end abruptly; not one over all points."""
    change = np.abs(np.diff(added))
    same = possible[1:] & possible[:-1] & (change <= ALIKE * np.abs(added[:-1]))
    found = []
    for run in runs(same):
        stretch = slice(run.start, run.stop + 1)
        ends = [at for at in (run.start - 1, run.stop) if 0 <= at < change.size]
        abrupt = all(change[at] > ABRUPT * np.abs(added[stretch.start]) for at in ends)
        if ends and abrupt and stretch.stop - stretch.start >= LEAST_POINTS:
            found.append(stretch)
    return found
