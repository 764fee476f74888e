"""Elements of the path to the frame from the difference of the two sweeps: a scan over resonance and damping; the rest is linear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray

# Range of the scan around the band: of a resonance further away only a slope is visible.
BEYOND_BAND = (0.3, 10.0)
RESONANCES = 44
DAMPINGS = np.geomspace(0.01, 100.0, 13)
MOST_FRAMES = 2
# Number of refinements: a narrow resonance may lie between the points of the scan.
ZOOMS = 4
ZOOM = np.linspace(-1, 1, 5)
# Cr or Cf may be too small to be determined, but they are not set to zero.
LEAST_SHARE = 0.01


@dataclass(frozen=True)
class _FrameScan:
    """The frame's impedance for given resonance and damping; the other unknowns are solved for.

    With w the resonance of Lr with Cr and Cf in series, d the damping there and q = (s/w)(d + s/w), the frame is
    (1/s) (a + b q/(1 + q)) where a = 1/(Cr + Cf) and b = 1/Cf - a, neither below zero. A strap in series adds s L with any L.
    """

    omega: FloatArray
    elastance: ComplexArray
    weight: FloatArray
    has_strap: bool

    def at(self, resonance: FloatArray, damping: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cost, a and b for all pairs of resonance and damping, each of shape (resonances, dampings)."""
        branch = self._branch(resonance[:, None, None], damping[:, None])
        n11, n12, n22 = self.weight.sum(), branch.real @ self.weight, (branch.real**2 + branch.imag**2) @ self.weight
        r1, r2 = float(self.elastance.real @ self.weight), (branch.conj() @ (self.weight * self.elastance)).real
        if self.has_strap:
            # With the most likely L for each a and b: times s it is -L omega^2, which is linear too.
            n33, n13, n23, r3 = self._strap_sums(branch)
            n11, n12, n22 = n11 - n13**2 / n33, n12 - n13 * n23 / n33, n22 - n23**2 / n33
            r1, r2 = r1 - n13 * r3 / n33, r2 - n23 * r3 / n33
        both = n11 * n22 - n12**2
        a, b = (n22 * r1 - n12 * r2) / both, (n11 * r2 - n12 * r1) / both
        a, b = np.where(b > 0, a, r1 / n11), np.maximum(b, 0.0)
        a, b = np.maximum(a, 0.0), np.where(a > 0, b, np.maximum(r2, 0.0) / n22)
        cost = n11 * a**2 + 2 * n12 * a * b + n22 * b**2 - 2 * (r1 * a + r2 * b)
        return np.where(np.isfinite(cost), cost, np.inf), a, b

    def _branch(self, resonance: FloatArray | float, damping: FloatArray | float) -> ComplexArray:
        """q/(1 + q) at all points."""
        p = 1j * self.omega / resonance
        q = p * (damping + p)
        return np.asarray(q / (1 + q), dtype=np.complex128)

    def _strap_sums(self, branch: ComplexArray) -> tuple[float, float, FloatArray, float]:
        """Sums over the points of the products of -omega^2 with itself, one, the branch and the data."""
        square = -(self.omega**2)
        weighted = self.weight * square
        return float(weighted @ square), float(weighted.sum()), branch.real @ weighted, float(self.elastance.real @ weighted)

    def strap_h(self, resonance: float, damping: float, a: float, b: float) -> float:
        """The most likely L for given values of the rest."""
        n33, n13, n23, r3 = self._strap_sums(self._branch(resonance, damping))
        return float((r3 - n13 * a - n23 * b) / n33)


def frames(frequency_hz: FloatArray, frame_ohm: ComplexArray, error_ohm: FloatArray, has_strap: bool = False) -> list[dict[str, float]]:
    """Rr, Lr, Cr, Cf at the best local minima of a scan over resonance and damping.

    Parameters
    ----------
    frequency_hz, frame_ohm, error_ohm : ndarray, shape (n,)
        The impedance of the path to the frame, and its uncertainty up to a common factor.
    has_strap : bool
        With an inductance in series, which is added as `inductance_h`; it may come out negative.
    """
    omega = 2 * np.pi * frequency_hz
    scan = _FrameScan(omega, 1j * omega * frame_ohm, 1 / (omega * error_ohm) ** 2, has_strap)
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
    frame = {"Rr": damping / (resonance * series), "Lr": 1 / (resonance**2 * series), "Cr": cr, "Cf": cf}
    strap = {"inductance_h": scan.strap_h(resonance, damping, whole, extra)} if scan.has_strap else {}
    return float(cost[row, column]), {**frame, **strap}
