"""Values that the user holds: whether the sweeps deny them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from motoremi.diagnosis.decision import ONE_EFFECT, judge
from motoremi.diagnosis.findings import Finding
from motoremi.fitting.fit import fit as fit_again
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, arrived_on_all
from motoremi.model.effects.names import as_sum
from motoremi.quantities import show
from motoremi.workers import Map

# Standard deviations from the value that the sweeps show, beyond which a held value is denied.
DENIED = 4.0


def of_the_held(fit: Fit) -> list[Finding]:
    """The finding that a held value is why a circuit leaves an error; none if the circuit leaves none, or also does with the values free.

    A circuit that lacks an effect would move any value to describe a part of it: that does not deny a value.
    """
    others = _not_held(fit)
    if len(others) == len(fit.held) or fit.marginal.nothing_left >= 0.5:
        return []
    task = dataclasses.replace(fit.task, held=others)
    solution = arrived_on_all(task, [{**fit.parameters, **fit.nuisance}])
    if solution.marginal.nothing_left < 0.5:
        return []
    return _denied(fit, [summarise(task, Found(solution, fit.history, dict(fit.parameters)), fit.method, fit.seed)])


def of_the_held_beside_an_effect(fit: Fit, each: Map = map) -> list[Finding]:
    """The same if the circuit lacks an effect as well: with the values free, one usual effect describes everything, or none is needed.

    With a wrong value held no effect does: the analyser was blamed for 9 times its specification where Ra was held at twice its value.
    """
    others = _not_held(fit)
    if len(others) == len(fit.held):
        return []
    judgement = judge(fit_again(fit.motor, fit.measurement, seed=fit.seed, bounds=fit.bounds, held=others), budget=ONE_EFFECT, each=each)
    models = [judgement.model, *(judgement.found[key] for key in judgement.alternatives)]
    if not (judgement.accepted and all(one.leaves_nothing for one in models)):
        return []
    return _denied(fit, [one.fit for one in models])


def _not_held(fit: Fit) -> dict[str, float]:
    """The held values without those of elements and parameters that a fit can vary."""
    varied = {parameter.name for parameter in fit.motor.parameters if parameter.vary}
    return {name: value for name, value in fit.held.items() if name not in varied}


def _denied(fit: Fit, free: Sequence[Fit]) -> list[Finding]:
    """A finding for each held value that every one of the models with free values denies; the first one's value is told."""
    found = []
    for parameter in fit.motor.parameters:
        name = parameter.name
        if not (parameter.vary and name in fit.held and all(abs(one.parameters[name] - fit.held[name]) > DENIED * one.sigma[name] for one in free)):
            continue
        value, sigma = free[0].parameters[name], free[0].sigma[name]
        shown = f"{show(value, parameter.unit, 4)} with a standard deviation of {show(sigma, parameter.unit, 2)}"
        beside = free[0].effects[len(fit.effects) :]
        circuit = f"the circuit with {as_sum(beside)}" if beside else "the circuit"
        why = f"{name} is held at {show(fit.held[name], parameter.unit)}, but the sweeps show {shown}: with that {circuit} leaves nothing"
        found.append(Finding("held-value", why, f"fit without holding {name}, or find out why it differs", True))
    return found
