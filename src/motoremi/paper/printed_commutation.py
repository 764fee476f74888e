"""The paper's commutation of one coil, eq. (13) - (15): closed form, stiff solver, and explicit Euler as a warning.

With tau = t/Tk, i = is/ia and A = Rd Tk / Ls, eq. (14) reads di/dtau = -A ((1 + i)/(1 - tau) - (1 - i)/tau), i(0) = 1. Its solution is
1 + i = (1 - tau)(2 + tau g), 1 - i = tau (2 - (1 - tau) g), with g = 2/(A + 1) 2F1(1, 2; A + 2; tau).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import hyp2f1

from motoremi.arrays import FloatArray


@dataclass(frozen=True)
class Commutation:
    """One coil under one brush.

    Parameters
    ----------
    inductance_h, resistance_ohm : float
        Ls and Rd.
    time_s : float
        Tk.
    current_a : float
        ia.
    """

    inductance_h: float
    resistance_ohm: float
    time_s: float
    current_a: float

    @property
    def ratio(self) -> float:
        """A = Rd Tk / Ls, which alone determines the shape of the current; below 1 the current does not reverse in time."""
        return self.resistance_ohm * self.time_s / self.inductance_h

    def current(self, tau: FloatArray) -> FloatArray:
        """Is over ia."""
        return (1 - tau) * (2 + tau * self._g(tau)) - 1

    def contact_voltage(self, tau: FloatArray) -> FloatArray:
        """Eq. (15) in volt."""
        return self.resistance_ohm * self.current_a * (4 + (2 * tau - 1) * self._g(tau))

    def _g(self, tau: FloatArray) -> FloatArray:
        return np.asarray(2 / (self.ratio + 1) * hyp2f1(1, 2, self.ratio + 2, tau), dtype=np.float64)

    def steepest_v_per_s(self, steps: int = 20_000) -> float:
        """Largest slope of the contact voltage."""
        tau = np.linspace(0, 1, steps + 1)[:-1]
        return float(np.max(np.abs(np.diff(self.contact_voltage(tau)))) * steps / self.time_s)

    def solver_difference(self) -> float:
        """Largest difference in is/ia between the closed form and a stiff solver (Radau)."""
        first = 1e-6

        def slope(tau: float, i: FloatArray) -> FloatArray:
            return -self.ratio * ((1 + i) / (1 - tau) - (1 - i) / tau)

        start = [1 - 2 * first * self.ratio / (self.ratio + 1)]
        times = np.linspace(first, 1 - 1e-3, 500)
        solved = solve_ivp(slope, (first, times[-1]), start, method="Radau", t_eval=times, rtol=1e-10, atol=1e-12)
        return float(np.max(np.abs(solved.y[0] - self.current(times))))

    def euler_contact_voltage(self, step_s: float, steps: int) -> FloatArray:
        """The contact voltage in volt, explicit Euler from t = `step_s` with is = ia."""
        i, volts = 1.0, []
        for count in range(1, steps + 1):
            tau = count * step_s / self.time_s
            leaving, entering = (1 + i) / (1 - tau), (1 - i) / tau
            volts.append(self.resistance_ohm * self.current_a * (leaving + entering))
            i -= self.ratio * (leaving - entering) * step_s / self.time_s
        return np.array(volts)
