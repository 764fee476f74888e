"""Start values that the data give away.

The short-circuit sweep is b0 + b1 s over 1 + a1 s + a2 s^2, a rational fit. The frame's share of the open-circuit sweep is weaker than
its noise over much of the band, where that way is biased; but with its resonance and damping given it is linear in 1/(Cr + Cf) and
1/Cf, so those two are scanned and the rest solved for.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.measurement import Measurement
from motoremi.fitting.observed import informative_points
from motoremi.model.effects.seen import Seen

FRAME_POINTS = 80
# Around the band: a resonance further away than this shows only by its slope.
BEYOND_BAND = (0.3, 10.0)
RESONANCES = 44
DAMPINGS = np.geomspace(0.01, 100.0, 13)
MOST_FRAMES = 2
# A narrow resonance hides between the points of the scan.
ZOOMS = 4
ZOOM = np.linspace(-1, 1, 5)
# Either of Cr and Cf may be too small to be seen, but none is nothing.
LEAST_SHARE = 0.01


@lru_cache(maxsize=8)
def data_driven_starts(measurement: Measurement) -> tuple[Mapping[str, float], ...]:
    """Sets of start values in SI units, the likeliest first; possibly none, never complete nonsense."""
    winding = _winding(measurement)
    if not winding:
        return ()
    apart = open_and_winding(measurement)
    if apart is None:
        return (winding,)
    at, seen, through = apart
    chosen = informative_points(at, seen, FRAME_POINTS)
    return tuple({**winding, **frame} for frame in _frames(at[chosen], seen[chosen], through[chosen]))


def open_and_winding(measurement: Measurement) -> tuple[FloatArray, ComplexArray, ComplexArray] | None:
    """Frequency in Hz, and in ohms the open-circuit sweep and the winding's share of it; None where it is not known."""
    sweeps = {sweep.termination: (sweep.frequency_hz, sweep.mean_ohm) for sweep in measurement.sweeps}
    winding = _winding(measurement)
    if not winding or "open" not in sweeps:
        return None
    frequency, short = sweeps["short"]
    at, seen = sweeps["open"]
    if at.size == frequency.size and np.allclose(at, frequency):
        return at, seen, short
    s = 2j * np.pi * at
    branch = winding["Ra"] + s * winding["La"]
    return at, seen, branch / (1 + s * winding["Ca"] * branch)


@lru_cache(maxsize=8)
def seen(measurement: Measurement) -> Seen:
    """What start values can be read from."""
    apart = open_and_winding(measurement)
    at, open_ohm, through_ohm = apart if apart is not None else (None, None, None)
    return dataclasses.replace(_short(measurement), frame_hz=at, open_ohm=open_ohm, through_ohm=through_ohm)


def _short(measurement: Measurement) -> Seen:
    for sweep in measurement.sweeps:
        if sweep.termination == "short":
            return Seen(sweep.frequency_hz, sweep.mean_ohm)
    return Seen()


@lru_cache(maxsize=8)
def _winding(measurement: Measurement) -> Mapping[str, float]:
    """Ra, La, Ca from (b0 + b1 s)/(1 + a1 s + a2 s^2)."""
    found = _short(measurement).short_rational((1, 2))
    if found is None:
        return {}
    (b0, b1), a2 = found.numerator, found.denominator[2]
    if b1 <= 0 or a2 <= 0:
        return {}
    return {"Ra": max(float(b0), 1e-3), "La": float(b1 / found.middle), "Ca": float(a2 / b1 / found.middle)}


@dataclass(frozen=True)
class _FrameScan:
    """The frame's impedance for given resonance and damping, the rest solved for.

    With w the resonance of Lr with Cr and Cf in series, d the damping there and q = (s/w)(d + s/w), the frame is
    (1/s) (a + b q/(1 + q)) where a = 1/(Cr + Cf) and b = 1/Cf - a, neither below zero.
    """

    omega: FloatArray
    elastance: ComplexArray
    weight: FloatArray

    def at(self, resonance: FloatArray, damping: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost, a and b for all pairs of resonance and damping, each of shape (resonances, dampings)."""
        p = 1j * self.omega / resonance[:, None, None]
        q = p * (damping[:, None] + p)
        branch = q / (1 + q)
        n11, n12, n22 = self.weight.sum(), branch.real @ self.weight, (branch.real**2 + branch.imag**2) @ self.weight
        r1, r2 = float(self.elastance.real @ self.weight), (branch.conj() @ (self.weight * self.elastance)).real
        both = n11 * n22 - n12**2
        a, b = (n22 * r1 - n12 * r2) / both, (n11 * r2 - n12 * r1) / both
        a, b = np.where(b > 0, a, r1 / n11), np.maximum(b, 0.0)
        a, b = np.maximum(a, 0.0), np.where(a > 0, b, np.maximum(r2, 0.0) / n22)
        cost = n11 * a**2 + 2 * n12 * a * b + n22 * b**2 - 2 * (r1 * a + r2 * b)
        return np.where(np.isfinite(cost), cost, np.inf), a, b


def _frames(frequency_hz: FloatArray, open_ohm: ComplexArray, winding_ohm: ComplexArray) -> list[dict[str, float]]:
    """Rr, Lr, Cr, Cf at the best local minima of a scan over resonance and damping."""
    omega = 2 * np.pi * frequency_hz
    weight = 1 / (omega * np.hypot(np.abs(open_ohm), np.abs(winding_ohm))) ** 2
    scan = _FrameScan(omega, 1j * omega * (open_ohm - winding_ohm), weight)
    resonances = np.geomspace(BEYOND_BAND[0] * omega[0], BEYOND_BAND[1] * omega[-1], RESONANCES)
    cost = scan.at(resonances, DAMPINGS)[0]
    rows, columns = cost.shape
    around = np.pad(cost, 1, constant_values=np.inf)
    lowest = np.min([around[i : i + rows, k : k + columns] for i in range(3) for k in range(3)], axis=0)
    places = np.argwhere((cost == lowest) & np.isfinite(cost))
    best = places[np.argsort(cost[tuple(places.T)])][:MOST_FRAMES]
    found = [_zoomed(scan, resonances[row], DAMPINGS[column]) for row, column in best]
    return [frame for _, frame in sorted(found, key=lambda pair: pair[0])]


def _zoomed(scan: _FrameScan, resonance: float, damping: float) -> tuple[float, dict[str, float]]:
    """Cost and elements at a minimum between the points of the scan."""
    by_resonance = (BEYOND_BAND[1] / BEYOND_BAND[0] * scan.omega[-1] / scan.omega[0]) ** (1 / (RESONANCES - 1))
    by_damping = DAMPINGS[1] / DAMPINGS[0]
    for _ in range(ZOOMS):
        resonances, dampings = resonance * by_resonance**ZOOM, damping * by_damping**ZOOM
        cost, a, b = scan.at(resonances, dampings)
        row, column = np.unravel_index(np.argmin(cost), cost.shape)
        resonance, damping = float(resonances[row]), float(dampings[column])
        by_resonance, by_damping = by_resonance**0.4, by_damping**0.4
    whole, extra = float(a[row, column]), float(b[row, column])
    least = LEAST_SHARE * max(whole + extra, 1.0)
    total, cf = 1 / max(whole, least), 1 / (max(whole, least) + max(extra, least))
    cr = total - cf
    series = cr * cf / total
    return float(cost[row, column]), {"Rr": damping / (resonance * series), "Lr": 1 / (resonance**2 * series), "Cr": cr, "Cf": cf}


def base_starts(parameters: Mapping[str, float], measurement: Measurement, few: bool) -> list[dict[str, float]]:
    """Values of the elements to start an effect from.

    A model that lacks an effect bends its elements, so besides the fit itself there are the values that the data give away (the frame's
    from the difference of the two sweeps, which no effect in the winding touches), and Ra without the losses that it had to carry.
    """
    searched = dict(parameters)
    bases = [searched, *({**searched, **start} for start in data_driven_starts(measurement)[:1])]
    if few:
        return bases
    bases = [{**base, "Ra": base.get("Ra", 1.0) * ra} for base in bases for ra in (1.0, 0.1)]
    if searched.keys() >= {"Cr", "Cf"}:
        bases.append({**searched, **_neutral_frame(searched["Cr"] + searched["Cf"], measurement)})
    return bases


def _neutral_frame(capacitance_f: float, measurement: Measurement) -> dict[str, float]:
    """A frame that keeps its low-frequency capacitance and resonates, well damped, a third of the way below the end of the band."""
    omega = 2 * np.pi * 0.35 * max(sweep.frequency_hz[-1] for sweep in measurement.sweeps)
    cr, cf = 0.6 * capacitance_f, 0.4 * capacitance_f
    in_series = cr * cf / (cr + cf)
    lr = 1 / (omega**2 * in_series)
    return {"Cr": cr, "Cf": cf, "Lr": lr, "Rr": 0.7 * float(np.sqrt(lr / in_series))}
