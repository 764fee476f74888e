"""Sweeps of the other termination: a repeat is recognised because it is the other sweep again, an exchange of both at low frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.kernels import interpolated, logarithm
from motoremi.data.sweep import SAME_READINGS, RepeatedSweep, Termination

# Two sweeps that differ by less at 90 % of the points may be one sweep measured twice: the far end of a winding changes more of the band, unless a
# capacitor across it hides it.
THE_SAME, OF_POINTS = 0.02, 0.9
# They are not if neighbouring points differ by more than so many times what noise and specification allow of both (of simulated repeats on another
# connection none differed by more than once that), or by so much where that is not known. A resonance may have moved by so much between them.
BEYOND_FLOORS, PLAINLY, MOVED = 5.0, 0.1, 0.01
# The two sweeps may be exchanged only if they begin below this frequency and within this ratio of each other,
BEGIN_BELOW_HZ, SAME_START = 0.5e6, 1.5
# the short one is a capacitance (phase below -70 degrees) and the open one is none (above -20), the slopes of ln |Z| over ln f are those of a
# capacitance and of a resistance or an inductance, and the short one has the larger impedance by this factor. With these values 1058 of 1080
# simulated motors with exchanged sweeps from 10, 100 or 150 kHz are recognised, and none with the right ones. Of sweeps from 1 MHz upwards, where
# motors have their first resonances, 8 of 2880 were recognised, and two with the right ones.
PLAIN_DEG, OF_SLOPE, LARGER = 70.0, 0.35, 2.0
# Below a resonance both slopes are steeper, by up to this. Of 3000 motors with exchanged sweeps from 100, 150 or 400 kHz, their elements spread
# over decades, this recognises 1783 instead of 1409, and none of those with the right ones.
STEEPER = 1.5
EXCHANGED = "the short and the open sweeps seem to be exchanged: at low frequencies the short one is a capacitance and the open one is not"


@dataclass(frozen=True)
class MeasuredTwice:
    """That the open-circuit and the short-circuit sweep are the same.

    Parameters
    ----------
    apart : float
        Largest relative difference at `OF_POINTS` of the points.
    wrong : {"short", "open"}
        The sweep that is more likely the wrong one.
    """

    apart: float
    wrong: Termination


def measured_twice(sweeps: Sequence[RepeatedSweep], floors: Sequence[FloatArray]) -> MeasuredTwice | None:
    """Whether the sweeps of both terminations are the same; None if they differ, or if there is only one.

    Parameters
    ----------
    sweeps : sequence of RepeatedSweep
    floors : sequence of ndarray
        What noise and specification allow at each point of each sweep, as a ratio.
    """
    if len(sweeps) < 2:
        return None
    short, opened = sweeps
    allowed = BEYOND_FLOORS * np.hypot(floors[0], np.interp(short.frequency_hz, opened.frequency_hz, floors[1]))
    apart = _apart(short.frequency_hz, short.mean_ohm, opened.frequency_hz, opened.mean_ohm, allowed)
    if apart > THE_SAME:
        return None
    # Without a path through the far end a motor is a capacitance at low frequencies. Where both sweeps are one, either may be wrong,
    # and the one that was repeated less often is doubted.
    inductive = bool(short.mean_ohm.imag[0] > 0)
    return MeasuredTwice(apart, "open" if inductive or opened.repeats < short.repeats else "short")


def without_mislabelled(sweeps: Sequence[RepeatedSweep]) -> tuple[tuple[RepeatedSweep, ...], tuple[Termination, ...]]:
    """The sweeps without repeats that are the other termination's, and the termination of each repeat that was left out.

    A repeat is left out only if others of its termination differ plainly from the other sweep, since they show what it should have been: behind a
    filter both sweeps are nearly the same, and repeats may differ as much.
    """
    if len(sweeps) < 2:
        return tuple(sweeps), ()
    kept, left_out = [], []
    for own, other in (tuple(sweeps), tuple(reversed(sweeps))):
        away = _nearest(own, other)
        good = away > THE_SAME
        if good.all() or np.max(away) < PLAINLY:
            kept.append(own)
            continue
        names = [tuple(name for name, chosen in zip(own.names, which, strict=True) if chosen) for which in (good, ~good)]
        kept.append(replace(own, impedance_ohm=own.impedance_ohm[good], names=names[0], left_out=names[1]))
        left_out += [own.termination] * int(np.sum(~good))
    return tuple(kept), tuple(left_out)


def label_remarks(sweeps: Sequence[RepeatedSweep]) -> list[str]:
    """A sentence for each termination with repeats that were left out, and one if the two terminations seem to be exchanged."""
    remarks = []
    for sweep in sweeps:
        if sweep.left_out:
            other = "open" if sweep.termination == "short" else "short"
            several = len(sweep.left_out) > 1
            which = f"{sweep.termination} sweep{'s' if several else ''} {', '.join(sweep.left_out)} {'are' if several else 'is'} not used"
            remarks.append(
                f"{which}: the same curve as the {other} sweep, so measured with the other termination or given with the wrong option; import "
                f"again with --{other} for {'them' if several else 'it'}, or without {'them' if several else 'it'}"
            )
    if len(sweeps) > 1 and _hold_the_same(*sweeps):
        remarks.append("the short-circuit and the open-circuit sweep hold the same readings: was one file given for both?")
    if exchanged(sweeps):
        remarks.append(f"{EXCHANGED}; check the far end of the winding, and if so import again with the files of --short and --open exchanged")
    return remarks


def exchanged(sweeps: Sequence[RepeatedSweep]) -> bool:
    """Whether each of the two sweeps looks at the low end of their common band as the other one must.

    At low frequencies a winding with its far end at the frame is a resistance and an inductance, and with its far end open it is the capacitance
    to the frame, of larger impedance. Above the first resonances both may look otherwise, so a band that begins there shows nothing.
    """
    if len(sweeps) < 2:
        return False
    short, opened = sweeps
    low = float(max(short.frequency_hz[0], opened.frequency_hz[0]))
    if low > BEGIN_BELOW_HZ or low > SAME_START * min(short.frequency_hz[0], opened.frequency_hz[0]):
        return False
    capacitive, other = (_low_end(sweep, low) for sweep in (short, opened))
    return bool(
        capacitive.phase_deg < -PLAIN_DEG
        and -1 - STEEPER < capacitive.slope < -1 + OF_SLOPE
        and other.phase_deg > PLAIN_DEG - 90
        and -OF_SLOPE < other.slope < 1 + STEEPER
        and capacitive.ohm > LARGER * other.ohm
    )


def _hold_the_same(short: RepeatedSweep, opened: RepeatedSweep) -> bool:
    """Whether both sweeps are one file: no other measurement of one motor gives the same digits."""
    alike = np.array_equal(short.frequency_hz, opened.frequency_hz) and short.mean_ohm.shape == opened.mean_ohm.shape
    return bool(alike and np.all(np.abs(short.mean_ohm - opened.mean_ohm) <= SAME_READINGS * np.abs(opened.mean_ohm)))


class _LowEnd(NamedTuple):
    """The low end of a sweep: median of phase and of |Z|, and the slope of ln |Z| over ln f."""

    phase_deg: float
    ohm: float
    slope: float


def _low_end(sweep: RepeatedSweep, low_hz: float) -> _LowEnd:
    """The octave above a frequency, or three points if there are fewer in it."""
    first = int(np.searchsorted(sweep.frequency_hz, low_hz * (1 - 1e-9)))
    last = max(int(np.searchsorted(sweep.frequency_hz, 2 * low_hz, side="right")), first + 3)
    frequency, impedance = sweep.frequency_hz[first:last], sweep.mean_ohm[first:last]
    if frequency.size < 3:
        return _LowEnd(np.nan, np.nan, np.nan)
    magnitude = np.abs(impedance)
    slope = float(np.polyfit(np.log(frequency), np.log(magnitude), 1)[0])
    return _LowEnd(float(np.median(np.degrees(np.angle(impedance)))), float(np.median(magnitude)), slope)


def _nearest(own: RepeatedSweep, other: RepeatedSweep) -> FloatArray:
    """Difference of each repeat of a sweep from the nearest one of another."""
    differences = [[_apart(own.frequency_hz, one, other.frequency_hz, each) for each in other.impedance_ohm] for one in own.impedance_ohm]
    return np.min(differences, axis=1)


def _apart(
    one_hz: FloatArray, one_ohm: ComplexArray, other_hz: FloatArray, other_ohm: ComplexArray, allowed: FloatArray | float = PLAINLY
) -> float:
    """Largest relative difference at `OF_POINTS` of the common points.

    Infinite if there are none, or if neighbours differ by more than is allowed.
    """
    low, high = max(one_hz[0], other_hz[0]), min(one_hz[-1], other_hz[-1])
    common = (one_hz >= low) & (one_hz <= high)
    if not common.any():
        return float("inf")
    at, own = one_hz[common], one_ohm[common]
    difference = np.abs(np.log(own / interpolated(other_hz, other_ohm, at)))
    # Of ln Z over ln f, beyond that of an inductance or a capacitance.
    steep = np.maximum(np.abs(np.gradient(logarithm(own), np.log(at))) - 1, 0.0) if at.size > 1 else 0.0
    beyond = difference > np.broadcast_to(allowed, one_hz.shape)[common] + MOVED * steep
    if np.any(beyond[1:] & beyond[:-1]):
        return float("inf")
    return float(np.quantile(difference, OF_POINTS))
