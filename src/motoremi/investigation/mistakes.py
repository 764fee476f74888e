"""Possible mistakes of the operator: each is an explanation of a sweep, with a small prior."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from motoremi.data.conditions import STANDARDS, Condition
from motoremi.data.kernels import interpolated, smooth_basis
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import RepeatedSweep
from motoremi.fitting.result import Fit
from motoremi.investigation.known import Known
from motoremi.investigation.menu import Option
from motoremi.investigation.outcome import SMOOTH, Observed, Outcome
from motoremi.investigation.weighing import anything, weigh

# Prior of a mistake: one action in twenty. An assumption; unconfirmed.
WRONG = 0.05
# Prior of a sweep that no known mistake explains.
STRANGE = 0.005
# What such a sweep may be off by at each point, as a logarithm; and what a repeated one is.
STRANGE_BY = (0.3, 1.0, 3.0)
THE_SAME = {5e-4: 0.5, 2e-3: 0.5}
# A sweep of the motor as it was, once more.
AGAIN = Condition("sweep-downwards")
# Measurements that cannot leave a sweep as it was, beside those that move elements of the motor.
MUST_SHOW = ("far-end-grounded", "longer-lead", "known-capacitor", *STANDARDS)


# The kind of a value that was probably read or written wrongly.
STRANGE_VALUE = "strange-value"


@dataclass(frozen=True)
class Mistake:
    """A mistake that may explain a sweep.

    Parameters
    ----------
    kind : str
    says : str
        The mistake in words, for the operator.
    log_likelihood : float
        Of the sweep, the prior of the mistake included.
    used : bool
        Whether the sweep is used nevertheless.
    """

    kind: str
    says: str
    log_likelihood: float
    used: bool = False


def mistakes(sweep: Observed, option: Option, measurement: Measurement, likeliest: Fit, known: Known, again: float, strange: float) -> Mistake:
    """The most probable mistake that would give a sweep, with the likelihood of all; `again` as from `repeated`, `strange` as from `of_no_kind`."""
    asked = f"{sweep.termination} sweep, {sweep.condition}"
    shows = option.name in MUST_SHOW or bool(option.elements) or Outcome(likeliest, [sweep]).elsewhere
    found: list[Mistake] = []
    for reference in measurement.sweeps:
        same = reference.termination == sweep.termination
        if option.name == "far-end-grounded" and not same:
            # With its far end on the frame the winding is measured as in the short-circuit sweep.
            continue
        if (same and not shows) or not _covers(reference.frequency_hz, sweep.frequency_hz):
            continue
        log = again if same else _as(reference, sweep, likeliest, known, strange)
        says = f"it is the {reference.termination} sweep of the motor as it was, again"
        if not same and option.name not in (*MUST_SHOW, "second-temperature"):
            # The far end alone is certain: what was asked for may have been done, and changed nothing.
            says = f"the far end of the winding was as for the {reference.termination} sweep, and nothing else changed"
        found.append(Mistake("nothing-changed" if same else "wrong-termination", f"{asked}: {says}", log))
    if option.kind == "standard":
        for name in ("fixture-open", "fixture-short", "fixture-load"):
            if name != option.name and not (option.name == "standards" and name == "fixture-load"):
                value = 50.0 if name == "fixture-load" else None
                other = Condition(name, value, "Ohm" if value else "")
                log = weigh(Outcome(likeliest, [replace(sweep, condition=other)]), known, least=strange).log_likelihood
                found.append(Mistake("wrong-standard", f"{asked}: it is that of {other}", log))
    elif option.name != "far-end-grounded":
        other_end = "open" if sweep.termination == "short" else "short"
        if other_end in measurement.terminations:
            log = weigh(Outcome(likeliest, [replace(sweep, termination=other_end)]), known, least=strange).log_likelihood
            found.append(Mistake("wrong-termination", f"{asked}: the far end of the winding was as for the {other_end} sweep", log))
    share = np.log(WRONG / max(len(found), 1))
    weighed = [replace(one, log_likelihood=one.log_likelihood + share) for one in found]
    weighed.append(Mistake("strange", f"{asked}: neither the request nor any known mistake explains it", strange))
    best = max(weighed, key=lambda one: one.log_likelihood)
    return replace(best, log_likelihood=float(np.logaddexp.reduce([one.log_likelihood for one in weighed])))


def of_no_kind(sweep: Observed, likeliest: Fit, known: Known) -> float:
    """Log likelihood, prior included, of a sweep that neither the request nor any known mistake explains."""
    return anything(Outcome(likeliest, [sweep]), known, STRANGE_BY) + float(np.log(STRANGE))


def repeated(sweep: Observed, fit: Fit, known: Known, strange: float) -> float:
    """Log likelihood of a sweep that is its reference sweep again, although a condition was requested; minus infinity if that does not cover it.

    `strange` as from `of_no_kind`.
    """
    reference = next((one for one in fit.measurement.sweeps if one.termination == sweep.termination), None)
    if reference is None or not _covers(reference.frequency_hz, sweep.frequency_hz):
        return float("-inf")
    return _as(reference, sweep, fit, known, strange)


def _as(reference: RepeatedSweep, sweep: Observed, fit: Fit, known: Known, strange: float) -> float:
    """Log likelihood of a sweep that is another one again: that sweep itself, or a fit's prediction of it with a new connection.

    The residuals of a connection move a sharp resonance by more than the sweep's noise, which only a fit can predict.
    """
    itself = _log_likelihood(sweep, interpolated(reference.frequency_hz, reference.mean_ohm, sweep.frequency_hz), THE_SAME)
    anew = replace(sweep, termination=reference.termination, condition=AGAIN)
    return float(np.logaddexp(itself, weigh(Outcome(fit, [anew]), known, least=strange).log_likelihood) - np.log(2))


def _covers(own_hz: FloatArray, wanted_hz: FloatArray) -> bool:
    return bool(own_hz[0] <= wanted_hz[0] * 1.001 and own_hz[-1] >= wanted_hz[-1] * 0.999)


def _impedance(sweep: Observed) -> ComplexArray:
    assert sweep.impedance_ohm is not None
    return sweep.impedance_ohm


class _Given:
    """A prediction without unknowns."""

    size = 0
    moving: BoolArray = np.zeros(0, dtype=np.bool_)
    elsewhere = False
    density = 0.0
    unpredicted: IntArray = np.zeros(0, dtype=np.intp)

    def __init__(self, sweep: Observed, impedance_ohm: ComplexArray) -> None:
        ratio = np.log(_impedance(sweep) / impedance_ohm)
        self._left: FloatArray = np.concatenate([ratio.real, ratio.imag])
        self.sigma: FloatArray = np.concatenate([sweep.sigma, sweep.sigma])
        columns = smooth_basis(sweep.frequency_hz, SMOOTH).T
        nothing = np.zeros_like(columns)
        self.smooth: FloatArray = np.concatenate([np.concatenate([columns, nothing], axis=1), np.concatenate([nothing, columns], axis=1)])
        self.errors: FloatArray = np.zeros((0, self.sigma.size))

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        nothing = np.zeros((0, self.sigma.size))
        return np.zeros(self.sigma.size), nothing, nothing

    def residual(self, mean: FloatArray) -> FloatArray:
        return self._left - mean


def _log_likelihood(sweep: Observed, impedance_ohm: ComplexArray, sizes: dict[float, float]) -> float:
    empty = Known(np.zeros(0), np.zeros((0, 0)), np.zeros(0), np.zeros(0))
    return weigh(_Given(sweep, impedance_ohm), empty, sizes).log_likelihood
