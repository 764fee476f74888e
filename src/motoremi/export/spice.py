"""The fitted motor as a SPICE subcircuit of R, L, C and K, for ngspice and LTspice."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from motoremi import __version__
from motoremi.errors import BadInput
from motoremi.export.ideal_network import Coils
from motoremi.export.realise import Realisation, deviation, impedance_of, realise
from motoremi.fitting.result import Fit
from motoremi.given import refuse_other
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.effects.names import as_sum
from motoremi.model.motor import Motor, dc_motor
from motoremi.quantities import show, show_band
from motoremi.threads import one_blas_thread

# A netlist with a larger difference from the model is not written.
_WORST_DB, _WORST_DEG = 0.5, 5.0
SUBCIRCUIT = "motoremi_motor"


@dataclass(frozen=True)
class SpiceModel:
    """A netlist and its largest difference from the fitted model.

    Parameters
    ----------
    text : str
    error_db, error_deg : float
        Largest over the fitted span and both terminations.
    left_out : tuple of str
        Effects of the analyser, which do not belong to the motor.
    """

    text: str
    error_db: float
    error_deg: float
    left_out: tuple[str, ...]


@one_blas_thread
def spice_model(fit: Fit) -> SpiceModel:
    """The motor of a fit as `.subckt motoremi_motor terminal far_end frame`.

    Raises
    ------
    BadInput
        If the fit did not converge, or a user's effect has no equivalent of resistors, inductors and capacitors.
    """
    refuse_other(fit, Fit, "spice_model needs a Fit")
    if not fit.converged:
        raise BadInput("the fit did not converge: fit again before the model is used elsewhere")
    groups = {name: find_effect(name).effect.group for name in fit.effects}
    left_out = tuple(name for name in fit.effects if groups[name] == "instrument")
    motor = add_effects(dc_motor(), [name for name in fit.effects if name not in left_out])
    spans = [(float(sweep.frequency_hz[0]), float(sweep.frequency_hz[-1])) for sweep in fit.measurement.sweeps]
    span = min(low for low, _ in spans), max(high for _, high in spans)
    with_frame = motor.used_parameters("open") <= set(fit.parameters)
    network = realise(motor, fit.parameters, span, with_frame)
    errors = _errors(motor, fit, network, span)
    if errors[0] > _WORST_DB or errors[1] > _WORST_DEG:
        worst = max(network.ladder_errors, key=lambda name: network.ladder_errors[name], default="the winding's sections")
        raise BadInput(f"no passive network comes near the model ({errors[0]:.2g} dB, {errors[1]:.2g} degree): {worst} does not fit a ladder")
    text = "\n".join((*_header(fit, motor, network, span, errors, left_out), *subcircuit(network), ""))
    return SpiceModel(text, errors[0], errors[1], left_out)


def _errors(motor: Motor, fit: Fit, network: Realisation, span: tuple[float, float]) -> tuple[float, float]:
    frequency = np.unique(np.concatenate([np.geomspace(*span, 2001), *(sweep.frequency_hz for sweep in fit.measurement.sweeps)]))
    terminations = ("short", "open") if network.frame is not None else ("short",)
    pairs = [
        deviation(network.impedance(termination, frequency), impedance_of(motor.circuit(termination), fit.parameters, frequency))
        for termination in terminations
    ]
    return max(db for db, _ in pairs), max(deg for _, deg in pairs)


def subcircuit(network: Realisation) -> Iterator[str]:
    """The lines of the subcircuit."""
    used: Counter[str] = Counter()

    def fresh(stem: str) -> str:
        used[stem] += 1
        return f"{stem}{used[stem]}" if stem == "n" or used[stem] > 1 else stem

    yield f".subckt {SUBCIRCUIT} terminal far_end frame"
    here = "terminal"
    housing = "frame" if network.strap is None else "housing"
    for kind, part in network.outside:
        if kind != "series":
            yield from part.lines(fresh, here, housing if kind == "housing" else "frame")
        else:
            inner = fresh("n")
            yield from part.lines(fresh, here, inner)
            here = inner
    nodes = [here, *(fresh("n") for _ in range(network.sections - 1)), "far_end"]
    if isinstance(network.winding, Coils):
        yield from network.winding.lines(fresh, nodes)
    else:
        for left, right in pairwise(nodes):
            yield from network.winding.lines(fresh, left, right)
    if network.spread is not None:
        for node in nodes:
            at_end = node in (nodes[0], nodes[-1])
            yield from (network.spread.scaled(2) if at_end else network.spread).lines(fresh, node, housing)
    if network.across is not None:
        yield from network.across.lines(fresh, here, "far_end")
    if network.frame is not None:
        yield from network.frame.lines(fresh, "far_end", housing)
    if network.strap is not None:
        yield from network.strap.lines(fresh, housing, "frame")
    yield f".ends {SUBCIRCUIT}"


def _header(
    fit: Fit, motor: Motor, network: Realisation, span: tuple[float, float], errors: tuple[float, float], left_out: tuple[str, ...]
) -> Iterator[str]:
    yield f"* DC motor, common mode, fitted by motoremi {__version__}"
    yield "* model: " + as_sum(("the paper's circuit", *motor.effects))
    yield f"* fit: error {fit.rms_error_percent:.3g} % rms against the measurement, {show_band(*span)}"
    yield f"*   noise and analyser would leave {fit.floor_percent:.2g} %"
    yield f"* this netlist against that model: at most {errors[0]:.2g} dB and {errors[1]:.2g} degree over the same span"
    for name, error in network.ladder_errors.items():
        yield f"*   {name}: passive ladder, relative error at most {error:.1e}"
    if network.sections > 1:
        yield f"*   winding: {network.sections} sections"
    for name in left_out:
        yield f"* left out: {name} is an error of the meter, not of the motor"
    if network.frame is None:
        yield "* nothing between far_end and frame: there was no open-circuit sweep"
    units = {parameter.name: parameter.unit for parameter in motor.parameters}
    for name, value in fit.parameters.items():
        if name in units:
            yield f"*   {name} = {show(value, units[name])}"
    yield "* short-circuit sweep: terminal against frame, far_end joined to frame; open-circuit sweep: far_end open"
