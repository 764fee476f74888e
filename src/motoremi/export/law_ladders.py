"""Dispersive laws as passive networks: sums of simple cells whose sizes are found by non-negative least squares.

A loss that grows with frequency in a conductor or a core is represented by R parallel L cells in series (Foster's first form), one in a
dielectric by R series C cells in parallel (the second form). Sizes cannot be negative, so the result is always passive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.export.ideal_network import Element, InParallel, InSeries, Part, resonant_loop

# Cells that change the result by less than this are left out; the poles are not refined further below the second error.
_NEGLIGIBLE = 1e-9
_GOOD_ENOUGH = 3e-6
_REFINEMENTS = 8


@dataclass(frozen=True)
class Ladder:
    """A passive network for a named element, and its largest relative error over the span it was fitted on."""

    name: str
    part: Part
    error: float


def ladder_of(name: str, frequency_hz: FloatArray, impedance: ComplexArray, resonances: tuple[tuple[float, float], ...] = ()) -> Ladder:
    """The passive network for an impedance: R parallel L cells or R series C cells, whichever has the smaller error.

    Parameters
    ----------
    name : str
        Name of the element, for the names of the cells.
    frequency_hz : ndarray, shape (n,)
    impedance : ndarray of complex, shape (n,)
        In ohm.
    resonances : tuple of (float, float)
        Angular frequency and quality of loops that are coupled to the element.
    """
    s: ComplexArray = np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)
    inductive = _foster(s, impedance, _loops(name, resonances))
    capacitive = _foster(s, 1 / impedance, ())
    candidates = []
    for part in (_inductive(name, inductive), _capacitive(name, capacitive)):
        if part is not None:
            candidates.append(Ladder(name, part, float(np.abs(part.impedance(s) / impedance - 1).max())))
    return min(candidates, key=lambda ladder: ladder.error)


def _loops(name: str, resonances: tuple[tuple[float, float], ...]) -> tuple[Part, ...]:
    """Resonant cells of unit size around each resonance, because losses in parallel shift and damp it."""
    parts: list[Part] = []
    for w, quality in resonances:
        for at in w * np.exp(np.linspace(-0.15, 0.15, 31)):
            for damping in at / quality * np.geomspace(0.2, 5.0, 15):
                parts.append(resonant_loop(name, 1.0, float(at), float(damping)))
                inner = (
                    Element("R", f"{name}_loop", 1.0),
                    Element("L", f"{name}_loop", damping / at**2),
                    Element("C", f"{name}_loop", 1 / damping),
                )
                parts.append(InParallel(inner))
    return tuple(parts)


@dataclass(frozen=True)
class _Foster:
    """`constant + slope s + sum of weights s / (s + poles)`, and extra cells."""

    poles: FloatArray
    weights: FloatArray
    constant: float
    slope: float
    extra: tuple[Part, ...]


def _foster(s: ComplexArray, target: ComplexArray, extra: tuple[Part, ...]) -> _Foster:
    """The best sum with non-negative sizes; the poles are refined near those with a size above 0."""
    w = np.abs(s)
    step = np.log(10) / 8
    poles = np.exp(np.arange(np.log(w.min() / 100), np.log(w.max() * 100), step))
    others = np.column_stack((np.ones_like(s), s / w.max(), *(part.impedance(s) for part in extra)))
    fixed = others.shape[1]
    best: tuple[float, FloatArray, FloatArray] | None = None
    for _ in range(_REFINEMENTS):
        basis = np.column_stack((others, s[:, None] / (s[:, None] + poles))) / target[:, None]
        rows = np.vstack((basis.real, basis.imag))
        wanted = np.concatenate((np.ones(s.size), np.zeros(s.size)))
        size = np.linalg.norm(rows, axis=0)
        sizes = nnls(rows / size, wanted, maxiter=100 * rows.shape[1])[0] / size
        error = float(np.abs(basis @ sizes - 1).max())
        if best is None or error < best[0]:
            best = error, poles, sizes
        active = poles[np.abs(basis[:, fixed:] * sizes[fixed:]).max(axis=0) > _NEGLIGIBLE]
        if error < _GOOD_ENOUGH or not active.size:
            break
        step /= 3
        poles = np.unique((active[:, None] * np.exp(step * np.arange(-2, 3))).ravel())
    assert best is not None
    _, poles, sizes = best
    weights = sizes[fixed:]
    kept = np.abs(s[:, None] / (s[:, None] + poles) * weights / target[:, None]).max(axis=0) > _NEGLIGIBLE
    used = tuple(part.scaled(size) for part, size in zip(extra, sizes[2:fixed].tolist(), strict=True) if size > 0)
    return _Foster(poles[kept], weights[kept], float(sizes[0]), float(sizes[1] / w.max()), used)


def _inductive(name: str, sum_of: _Foster) -> Part | None:
    members: list[Part] = [*sum_of.extra]
    if sum_of.constant > 0:
        members.append(Element("R", name, sum_of.constant))
    if sum_of.slope > 0:
        members.append(Element("L", name, sum_of.slope))
    for pole, resistance in zip(sum_of.poles.tolist(), sum_of.weights.tolist(), strict=True):
        members.append(InParallel((Element("R", f"{name}_cell", resistance), Element("L", f"{name}_cell", resistance / pole))))
    return InSeries(tuple(members)) if members else None


def _capacitive(name: str, sum_of: _Foster) -> Part | None:
    members: list[Part] = []
    if sum_of.constant > 0:
        members.append(Element("R", name, 1 / sum_of.constant))
    if sum_of.slope > 0:
        members.append(Element("C", name, sum_of.slope))
    for pole, conductance in zip(sum_of.poles.tolist(), sum_of.weights.tolist(), strict=True):
        members.append(InSeries((Element("R", f"{name}_cell", 1 / conductance), Element("C", f"{name}_cell", conductance / pole))))
    return InParallel(tuple(members)) if members else None
