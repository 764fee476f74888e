"""Values that the user holds: whether the sweeps deny them."""

from __future__ import annotations

import dataclasses

from motoremi.diagnosis.findings import Finding
from motoremi.fitting.result import Fit, summarise
from motoremi.fitting.search import Found, arrived_on_all
from motoremi.quantities import show

# Standard deviations from the value that the sweeps show, beyond which a held value is denied.
DENIED = 4.0


def of_the_held(fit: Fit) -> list[Finding]:
    """The finding that a held value is why a circuit leaves an error; none if the circuit leaves none, or also does with the values free.

    A circuit that lacks an effect would move any value to describe a part of it: that does not deny a value.
    """
    parameters = {parameter.name: parameter for parameter in fit.motor.parameters if parameter.vary and parameter.name in fit.held}
    if not parameters or fit.marginal.nothing_left >= 0.5:
        return []
    task = dataclasses.replace(fit.task, held={name: value for name, value in fit.held.items() if name not in parameters})
    solution = arrived_on_all(task, [{**fit.parameters, **fit.nuisance}])
    if solution.marginal.nothing_left < 0.5:
        return []
    free = summarise(task, Found(solution, fit.history, dict(fit.parameters)), fit.method, fit.seed)
    found = []
    for name, parameter in parameters.items():
        value, sigma = free.parameters[name], free.sigma[name]
        if abs(value - fit.held[name]) > DENIED * sigma:
            shown = f"{show(value, parameter.unit, 4)} with a standard deviation of {show(sigma, parameter.unit, 2)}"
            why = f"{name} is held at {show(fit.held[name], parameter.unit)}, but the sweeps show {shown}: with that the circuit leaves nothing"
            found.append(Finding("held-value", why, f"fit without holding {name}, or find out why it differs", True))
    return found
