"""Sweeps that were taken with the other termination: each is recognised because it is the other sweep again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.kernels import interpolated, logarithm
from motoremi.data.sweep import RepeatedSweep, Termination

# Two sweeps that differ by less at 90 % of the points may be one sweep measured twice: the far end of a winding changes more of the band, unless a
# capacitor across it hides it.
THE_SAME, OF_POINTS = 0.02, 0.9
# They are not if neighbouring points differ by more than so many times what noise and specification allow of both (of simulated repeats on another
# connection none differed by more than once that), or by so much where that is not known. A resonance may have moved by so much between them.
BEYOND_FLOORS, PLAINLY, MOVED = 5.0, 0.1, 0.01


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
        kept.append(replace(own, impedance_ohm=own.impedance_ohm[good]))
        left_out += [own.termination] * int(np.sum(~good))
    return tuple(kept), tuple(left_out)


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
