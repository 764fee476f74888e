"""Commutation in closed form against a stiff solver and against what the paper prints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from motoremi.emission.commutation import Commutation, commutation_time
from motoremi.errors import BadInput

# As printed, Tk corrected, both corrected, and well beyond either side of A = 1.
CASES = {
    "printed": Commutation(),
    "Tk corrected": Commutation(time_s=3.79e-3),
    "both corrected": Commutation(time_s=3.79e-3, inductance_h=12.1e-6),
    "Ls corrected": Commutation(inductance_h=12.1e-6),
    "Tk 0.384 ms": Commutation(time_s=0.384e-3),
}


def stiff(coil: Commutation, tau: np.ndarray) -> np.ndarray:
    """Eq. (14) as printed, by an implicit solver; started beside the 0/0 at t = 0 with the first term of the series."""
    a, first = coil.ratio, 1e-9

    def slope(t: float, i: np.ndarray) -> np.ndarray:
        return a * ((1 - i) / t - (1 + i) / (1 - t))

    done = solve_ivp(slope, (first, tau[-1]), [1 - 2 * first * a / (a + 1)], method="Radau", t_eval=tau, rtol=1e-12, atol=1e-13)
    assert done.success
    return coil.current_a * done.y[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_current_follows_the_stiff_solver(name):
    coil = CASES[name]
    tau = np.array([1e-4, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999])
    # The solver's own tolerance, grown over the integration.
    np.testing.assert_allclose(coil.current(tau), stiff(coil, tau), atol=1e-8 * coil.current_a)


@pytest.mark.parametrize("name", CASES)
def test_voltages_obey_kirchhoff_and_the_rate_is_their_slope(name):
    coil = CASES[name]
    tau = np.linspace(0.05, 0.95, 37)
    step = 1e-6
    slope = (coil.current(tau + step) - coil.current(tau - step)) / (2 * step * coil.time_s)
    np.testing.assert_allclose(coil.coil_voltage(tau), -coil.inductance_h * slope, rtol=1e-6, atol=1e-9)
    rate = (coil.contact_voltage(tau + step) - coil.contact_voltage(tau - step)) / (2 * step * coil.time_s)
    np.testing.assert_allclose(coil.contact_voltage_rate(tau), rate, rtol=1e-5, atol=1e-6)


def test_the_printed_values_give_a_smooth_ramp_and_not_1500_volt():
    coil = CASES["printed"]
    assert coil.ratio == pytest.approx(6.76, abs=0.01)
    assert coil.current(0.0) == pytest.approx(10)
    assert coil.current(1.0) == pytest.approx(-10)
    assert not coil.sparks
    tau = np.linspace(0, 1 - 5e-8 / coil.time_s, 2001)
    voltage = coil.contact_voltage(tau)
    assert voltage[[0, -1]] == pytest.approx([0.797, 0.926], abs=1e-3)
    assert np.abs(coil.contact_voltage_rate(tau)).max() == pytest.approx(4.7, abs=0.1)
    assert coil.end_step_v() == pytest.approx(0.926, abs=1e-3)


def test_below_one_the_trailing_edge_grows_until_it_arcs():
    coil = CASES["Tk corrected"]
    assert coil.ratio == pytest.approx(0.667, abs=1e-3)
    assert coil.sparks
    assert coil.end_step_v() == np.inf
    # Steinmetz: 1 + i goes as (1 - tau)^A, so the voltage as (1 - tau)^(A - 1).
    one, ten = coil.trailing_voltage(1 - np.array([1e-6, 1e-7]))
    assert ten / one == pytest.approx(10 ** (1 - coil.ratio), rel=0.02)
    spark = coil.spark(12.0)
    assert spark is not None
    assert float(coil.trailing_voltage(spark.tau)) == pytest.approx(12.0, rel=1e-6)
    assert spark.current_a == pytest.approx(10 + float(coil.current(spark.tau)), rel=1e-6)
    assert spark.energy_j == pytest.approx(0.5 * 121e-6 * spark.current_a**2)
    assert CASES["printed"].spark(12.0) is None
    assert 10 + float(coil.current(0.99)) == pytest.approx(1.86, abs=0.01)


def test_the_last_time_step_makes_the_paper_kilovolt():
    coil = CASES["Tk 0.384 ms"]
    assert float(coil.contact_voltage(1 - 5e-8 / coil.time_s)) == pytest.approx(1800, rel=0.05)


def test_commutation_time_of_the_paper_is_a_tenth_of_what_it_prints():
    assert commutation_time(0.1, 0.36, 1400) == pytest.approx(3.79e-3, abs=5e-6)
    for bad in ((0, 0.36, 1400), (0.1, -1, 1400), (0.1, 0.36, float("nan"))):
        with pytest.raises(BadInput):
            commutation_time(*bad)


def test_bad_input():
    with pytest.raises(BadInput, match="resistance_ohm"):
        Commutation(resistance_ohm=0)
    with pytest.raises(BadInput, match="tau"):
        Commutation().current([0.5, 1.2])
    with pytest.raises(BadInput, match="arc_voltage_v"):
        Commutation().spark(0)
