"""Other methods for circuit fitting, each with the same data, the same bounds and the same vectorised model.

Each is stopped as soon as it has succeeded, which is decided by the chi-squared of the true parameters (not known to our own fitter), and starts
again from another random point until its time is up.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from scipy.optimize import differential_evolution, dual_annealing, least_squares

from benchmarks.motors import NAMES, NOISE, Case, chi_squared, impedances
from motoremi.arrays import FloatArray


class Done(Exception):
    """Raised inside the objective function when time is up or the target is reached."""


class Judge:
    """Counts evaluations, keeps the best one, and stops a method that has succeeded or has used up its time.

    Parameters
    ----------
    case : Case
    budget_s : float
        CPU time.
    """

    def __init__(self, case: Case, budget_s: float) -> None:
        self.case = case
        self.target = 1.1 * float(chi_squared(case, case.truth))
        self.low = np.log([case.bounds[name][0] for name in NAMES])
        self.high = np.log([case.bounds[name][1] for name in NAMES])
        self.deadline = time.process_time() + budget_s
        self.best = np.inf
        self.evaluations = 0

    @property
    def succeeded(self) -> bool:
        """Within 1.1 of the truth's chi-squared."""
        return self.best <= self.target

    def see(self, logarithms: FloatArray) -> FloatArray:
        """Chi-squared of one point or a batch, shape (..., 7)."""
        with np.errstate(all="ignore"):
            value = np.nan_to_num(np.asarray(chi_squared(self.case, logarithms)), nan=1e30, posinf=1e30)
        self.evaluations += int(np.size(value))
        self.best = min(self.best, float(np.min(value)))
        if self.succeeded or time.process_time() > self.deadline:
            raise Done
        return value

    def relative(self, logarithms: FloatArray) -> FloatArray:
        """Residuals over 1 % of |Z_measured|, real and imaginary parts."""
        self.see(logarithms)
        short, open_ = impedances(logarithms, self.case.frequency_hz)
        parts = [
            (short - self.case.short_ohm) / (NOISE * np.abs(self.case.short_ohm)),
            (open_ - self.case.open_ohm) / (NOISE * np.abs(self.case.open_ohm)),
        ]
        joined = np.concatenate(parts)
        return np.concatenate([joined.real, joined.imag])

    def logarithmic(self, logarithms: FloatArray) -> FloatArray:
        """Residuals ln(Z_model/Z_measured), real and imaginary parts."""
        self.see(logarithms)
        short, open_ = impedances(logarithms, self.case.frequency_hz)
        joined = np.log(np.concatenate([short / self.case.short_ohm, open_ / self.case.open_ohm]))
        return np.concatenate([joined.real, joined.imag])

    def log_cost(self, logarithms: FloatArray) -> FloatArray:
        """Mean square of ln(Z_model/Z_measured) for a batch."""
        self.see(logarithms)
        short, open_ = impedances(logarithms, self.case.frequency_hz)
        squares = [np.mean(np.abs(np.log(m / z)) ** 2, axis=-1) for m, z in ((short, self.case.short_ohm), (open_, self.case.open_ohm))]
        return squares[0] + squares[1]

    def start(self, rng: np.random.Generator) -> FloatArray:
        """A random point within the bounds."""
        return self.low + rng.random(7) * (self.high - self.low)


def multistart_relative(judge: Judge, rng: np.random.Generator) -> None:
    """SciPy least squares from random starts."""
    while True:
        least_squares(judge.relative, judge.start(rng), bounds=(judge.low, judge.high), max_nfev=300)


def multistart_log(judge: Judge, rng: np.random.Generator) -> None:
    """SciPy least squares from random starts, first on the complex logarithm."""
    while True:
        rough = least_squares(judge.logarithmic, judge.start(rng), bounds=(judge.low, judge.high), max_nfev=300)
        least_squares(judge.relative, rough.x, bounds=(judge.low, judge.high), max_nfev=300)


def evolution(judge: Judge, rng: np.random.Generator) -> None:
    """SciPy differential evolution, vectorised."""
    bounds = list(zip(judge.low, judge.high, strict=True))
    while True:
        differential_evolution(lambda x: judge.see(x.T), bounds, vectorized=True, updating="deferred", rng=rng, maxiter=2000, tol=1e-8)


def annealing(judge: Judge, rng: np.random.Generator) -> None:
    """SciPy dual annealing."""
    while True:
        dual_annealing(lambda x: float(judge.see(x)), list(zip(judge.low, judge.high, strict=True)), rng=rng)


def cma_restarts(judge: Judge, rng: np.random.Generator) -> None:
    """CMA-ES with growing restarts, on the complex logarithm."""
    import cma

    span, size = judge.high - judge.low, 9
    while True:
        options = {"bounds": [0, 1], "verbose": -9, "popsize": size, "seed": int(rng.integers(1, 2**31)), "maxiter": 400}
        strategy = cma.CMAEvolutionStrategy(rng.random(7), 0.3, options)
        while not strategy.stop():
            points = strategy.ask()
            strategy.tell(points, list(judge.log_cost(judge.low + np.array(points) * span)))
        least_squares(judge.relative, np.clip(judge.low + strategy.result.xbest * span, judge.low, judge.high), bounds=(judge.low, judge.high))
        size *= 2


def colony_and_polish(judge: Judge, rng: np.random.Generator) -> None:
    """ACO_R (archive 50, 20 ants) on the complex logarithm, then least squares: the best combination found in earlier tests."""
    ranks = np.exp(-0.5 * (np.arange(50) / 5) ** 2)
    while True:
        archive = judge.low + rng.random((50, 7)) * (judge.high - judge.low)
        cost = judge.log_cost(archive)
        for _ in range(40):
            archive, cost = archive[np.argsort(cost)], np.sort(cost)
            origin = archive[rng.choice(50, 20, p=ranks / ranks.sum())]
            width = 0.85 * np.mean(np.abs(archive[None] - origin[:, None]), axis=1)
            ants = np.clip(origin + rng.standard_normal((20, 7)) * width, judge.low, judge.high)
            archive, cost = np.concatenate([archive, ants]), np.concatenate([cost, judge.log_cost(ants)])
            keep = np.argsort(cost)[:50]
            archive, cost = archive[keep], cost[keep]
        rough = least_squares(judge.logarithmic, archive[0], bounds=(judge.low, judge.high), max_nfev=200)
        least_squares(judge.relative, rough.x, bounds=(judge.low, judge.high), max_nfev=200)


def lmfit_multistart(judge: Judge, rng: np.random.Generator) -> None:
    """lmfit's leastsq from random starts."""
    import lmfit

    while True:
        parameters = lmfit.Parameters()
        for name, value, low, high in zip(NAMES, judge.start(rng), judge.low, judge.high, strict=True):
            parameters.add(name, value=value, min=low, max=high)
        lmfit.minimize(lambda p: judge.relative(np.array([p[name].value for name in NAMES])), parameters, method="leastsq", max_nfev=1500)


PEERS: dict[str, Callable[[Judge, np.random.Generator], None]] = {
    "SciPy least squares, many starts, relative": multistart_relative,
    "SciPy least squares, many starts, complex log": multistart_log,
    "SciPy differential evolution": evolution,
    "SciPy dual annealing": annealing,
    "ACO_R + Levenberg-Marquardt": colony_and_polish,
}
# These use up their time on most motors and are run on every second one, so that the whole benchmark takes at most a quarter of an hour.
HALVED = ("SciPy least squares, many starts, relative", "cma, growing restarts", "lmfit leastsq, many starts")
if importlib.util.find_spec("cma"):
    PEERS["cma, growing restarts"] = cma_restarts
if importlib.util.find_spec("lmfit"):
    PEERS["lmfit leastsq, many starts"] = lmfit_multistart


def run_peer(peer: Callable[[Judge, np.random.Generator], None], case: Case, budget_s: float) -> tuple[bool, float, int]:
    """Success, CPU seconds and evaluations of one peer on one case."""
    judge = Judge(case, budget_s)
    started = time.process_time()
    with suppress(Done):
        peer(judge, np.random.default_rng((case.number, 7)))
    return judge.succeeded, time.process_time() - started, judge.evaluations
