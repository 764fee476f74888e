"""Packages with a circuit language of their own, as they are shipped: impedance.py and pyimpspec.

Neither fits two sweeps that share parameters, so each is given the open-circuit sweep, which depends on all seven elements, and its result is
judged by both. They cannot be interrupted during a fit, and a hundred motors would take minutes, so only a few motors are used, with more time.
"""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable

import numpy as np

from benchmarks.motors import NAMES
from benchmarks.peers import Judge
from motoremi.arrays import FloatArray

# Number of motors, and time as a multiple of that of the other methods: one fit of pyimpspec with all its methods and weights takes 20 s.
MOTORS = {"impedance.py, many starts": 3, "pyimpspec leastsq boukamp, many starts": 3, "pyimpspec auto, many starts": 2}
MORE_TIME = {"impedance.py, many starts": 4, "pyimpspec leastsq boukamp, many starts": 4, "pyimpspec auto, many starts": 20}


def impedance_py(judge: Judge, rng: np.random.Generator) -> None:
    """impedance.py's `fit`, weighted by modulus, from random starts."""
    from impedance.models.circuits import CustomCircuit

    low, high = np.exp(judge.low), np.exp(judge.high)
    while True:
        start = judge.start(rng)
        circuit = CustomCircuit("p(R0-L0,C0)-p(R1-L1-C1,C2)", initial_guess=list(np.exp(start)))
        try:
            circuit.fit(judge.case.frequency_hz, judge.case.open_ohm, bounds=(list(low), list(high)), weight_by_modulus=True)
        except RuntimeError:  # it did not converge
            judge.see(start)
        else:
            judge.see(np.log(circuit.parameters_))


def pyimpspec_with(method: str, weight: str) -> Callable[[Judge, np.random.Generator], None]:
    """pyimpspec's `fit_circuit` from random starts."""

    def run(judge: Judge, rng: np.random.Generator) -> None:
        from pyimpspec import DataSet, fit_circuit, parse_cdc
        from pyimpspec.exceptions import FittingError

        data = DataSet(frequencies=judge.case.frequency_hz, impedances=judge.case.open_ohm)
        while True:
            start = judge.start(rng)
            try:
                found = fit_circuit(parse_cdc(circuit_text(judge, start)), data, method=method, weight=weight, num_procs=1)
            except FittingError:
                judge.see(start)
            else:
                judge.see(np.log(found.to_parameters_dataframe()["Value"].to_numpy(dtype=np.float64)))

    return run


def circuit_text(judge: Judge, start: FloatArray) -> str:
    """The circuit with start values and limits in pyimpspec's language; the elements come in the order of `NAMES`."""
    parts = {
        name: f"{name[0]}{{{name[0]}={float(value)!r}/{float(low)!r}/{float(high)!r}}}"
        for name, value, low, high in zip(NAMES, np.exp(start), np.exp(judge.low), np.exp(judge.high), strict=True)
    }
    return "([{Ra}{La}]{Ca})([{Rr}{Lr}{Cr}]{Cf})".format(**parts)


PACKAGES: dict[str, Callable[[Judge, np.random.Generator], None]] = {}
if importlib.util.find_spec("impedance"):
    PACKAGES["impedance.py, many starts"] = impedance_py
if importlib.util.find_spec("pyimpspec"):
    PACKAGES["pyimpspec leastsq boukamp, many starts"] = pyimpspec_with("leastsq", "boukamp")
    PACKAGES["pyimpspec auto, many starts"] = pyimpspec_with("auto", "auto")
warnings.filterwarnings("ignore", module=r"(impedance|pyimpspec|lmfit|uncertainties)\b")
