"""Leads that moved between the repeats of a sweep: a series R and L and a shunt G and C that differ from one repeat to the next.

The repeats then differ in a known way along frequency: 1 pF changes |Z| by 60 % at 3 kOhm and 30 MHz, and by nothing at 10 Ohm. As white noise,
these differences would be an error of a correct model at every point; as noise that is correlated along frequency, they would be overestimated
elsewhere. Each repeat is therefore converted to the average position of the leads, and only the error of that position remains.
"""

from __future__ import annotations

import dataclasses
from functools import lru_cache

import numpy as np
from scipy.special import stdtrit

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.noise import ByContent, Noise, noise_anew, noise_of, repeats_log_likelihood
from motoremi.data.quantity import Quantity
from motoremi.data.repeats import contrasts
from motoremi.data.sweep import RepeatedSweep

# At most; fewer if a step is within its noise. Noise and what moved depend on each other, and large shunts change Z by more than in proportion.
ROUNDS = 5
# Points on which they are estimated: four values need no more, and ten thousand points would take seconds.
ENOUGH_POINTS = 800
# Combinations of R, L, G and C whose effect on a sweep is smaller than that of others by this factor are taken for none.
UNSEEN = 1e-6


def at_average_leads(sweep: RepeatedSweep, quantity: Quantity | None = None) -> RepeatedSweep:
    """The repeats as if the leads had stayed in their average position, with the size of what moved; the sweep itself if nothing did.

    Parameters
    ----------
    sweep : RepeatedSweep
    quantity : Quantity, optional
        What a network analyser measures, for its noise.
    """
    found = None if sweep.repeats < 2 else _leads(ByContent.of(_thinned(sweep), quantity))
    return sweep if found is None else dataclasses.replace(_without(sweep, found[0]), moved=found[1])


# Cached like the noise, because the workbench needs it repeatedly.
@lru_cache(maxsize=8)
def _leads(key: ByContent) -> tuple[FloatArray, FloatArray] | None:
    """R, L, G and C of each repeat, shape (repeats, 4), and their standard deviation as in `RepeatedSweep.moved`; None if nothing moved."""
    sweep, quantity = key.sweep, key.quantity
    noise = noise_of(key)
    # A drifting motor changes itself, not its leads; that is described by the noise's drift.
    if noise.drift is not None:
        return None
    combine = contrasts(np.eye(sweep.repeats, dtype=np.complex128)).real
    leads, still = np.zeros((sweep.repeats, 4)), sweep
    for _ in range(ROUNDS):
        step, by_noise = _moved(still, noise, combine)
        leads += combine.T @ step
        still = _without(sweep, leads)
        if not np.isfinite(still.impedance_ohm).all():
            return None
        if np.all(step**2 <= by_noise):
            break
        noise = noise_anew(ByContent.of(still, quantity))
    # Each estimated value costs half the logarithm of the number of data (Schwarz 1978).
    cost = 0.5 * step.size * np.log(2 * len(combine) * sweep.frequency_hz.size)
    if repeats_log_likelihood(ByContent.of(still, quantity)) - cost < repeats_log_likelihood(key):
        return None
    variance = np.mean((combine @ leads) ** 2, axis=0) - by_noise
    return leads, student_factor(len(combine)) * np.sqrt(np.maximum(variance, 0.0))


def student_factor(differences: int) -> float:
    """Factor on a standard deviation estimated from so few differences, so that a normal distribution keeps the 95 % limits of Student's.

    Source: Guide to the expression of uncertainty in measurement (JCGM 100:2008), G.3.
    """
    return float(-stdtrit(differences, 0.025) / 1.96)


def _moved(sweep: RepeatedSweep, noise: Noise, combine: FloatArray) -> tuple[FloatArray, FloatArray]:
    """R, L, G and C of the contrasts by least squares, shape (m, 4), and the variance of each because of noise, shape (4,)."""
    inside = noise.regular
    sigma = np.sqrt(sweep.repeats) * np.hypot(noise.sigma, noise.correlated_sigma)[inside]
    columns = sweep.changes_by_leads[inside] / sigma[:, None]
    lengths = np.linalg.norm(columns, axis=0)
    # R, L, G and C are real: the real and the imaginary part of a contrast are an equation each.
    inverse = np.linalg.pinv(_parts(columns.T / lengths[:, None]).T, rcond=UNSEEN)
    weighted = (combine @ (sweep.impedance_ohm / sweep.mean_ohm - 1))[:, inside] / sigma
    return _parts(weighted) @ inverse.T / lengths, np.sum(inverse**2, axis=1) / lengths**2


def _thinned(sweep: RepeatedSweep) -> RepeatedSweep:
    """Every so many points of a sweep, if it has many: they show four values as well as all of them."""
    step = -(-sweep.frequency_hz.size // ENOUGH_POINTS)
    stated, rounding = (None if own is None else own[::step] for own in (sweep.sigma_relative, sweep.rounding_relative))
    return RepeatedSweep(sweep.termination, sweep.frequency_hz[::step], sweep.impedance_ohm[:, ::step], stated, rounding_relative=rounding)


def _without(sweep: RepeatedSweep, leads: FloatArray) -> RepeatedSweep:
    """The repeats without leads of R, L, G and C, shape (repeats, 4)."""
    s = 2j * np.pi * sweep.frequency_hz
    resistance, inductance, conductance, capacitance = leads.T[..., None]
    with np.errstate(all="ignore"):
        impedance = 1 / (1 / sweep.impedance_ohm - conductance - s * capacitance) - resistance - s * inductance
    return dataclasses.replace(sweep, impedance_ohm=impedance)


def _parts(rows: ComplexArray) -> FloatArray:
    """Real parts and after them imaginary parts, shape (m, 2 n)."""
    return np.concatenate([rows.real, rows.imag], axis=1)
