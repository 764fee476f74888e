"""Checks of the paper's numbers of interference source and LISN."""

from __future__ import annotations

import numpy as np

from motoremi.paper import printed
from motoremi.paper.circuit_checks import resonance_hz
from motoremi.paper.data import simulated
from motoremi.paper.disagreement import Disagreement
from motoremi.paper.printed_commutation import Commutation
from motoremi.quantities import show
from motoremi.simulate.network import Network, impedance

# CISPR 16-1-2: 50 uH and 5 Ohm against ground, in parallel with the receiver's 50 Ohm; one in each line.
LISN = Network().inductor("L", "line", "damped", 50e-6).resistor("R", "damped", "ground", 5.0).resistor("receiver", "line", "ground", 50.0)


def commutation(inductance_h: float = printed.COIL_INDUCTANCE_H, time_s: float = printed.COMMUTATION_S) -> Commutation:
    """The printed commutation, or with another inductance or time."""
    return Commutation(inductance_h, printed.CONTACT_RESISTANCE_OHM, time_s, printed.CURRENT_A)


def computed_time_s() -> float:
    """Tk by eq. (12)."""
    return printed.COMMUTATOR_WIDTH_M / surface_speed_m_per_s()


def surface_speed_m_per_s() -> float:
    """Surface speed of the commutator."""
    return float(np.pi * printed.COMMUTATOR_DIAMETER_M * printed.SPEED_RPM / 60)


def inductance() -> Disagreement:
    """La in Table 1, Ls in section 5.2."""
    la, ls = printed.TABLE_1["La"], printed.COIL_INDUCTANCE_H
    return Disagreement(
        "la-ls",
        f"La = {show(la, 'H')} in Table 1; Ls = {show(ls, 'H')} in section 5.2, said to come from the fit",
        f"Ls / La = {ls / la:.3g}",
        "a slip of the decimal point in one of them",
        {"ratio": ls / la},
    )


def time() -> Disagreement:
    """Tk from the dimensions and the speed."""
    speed, time_s = surface_speed_m_per_s(), computed_time_s()
    share = printed.COMMUTATOR_WIDTH_M / (np.pi * printed.COMMUTATOR_DIAMETER_M)
    as_printed, both = commutation(), commutation(printed.TABLE_1["La"], time_s)
    one = commutation(time_s=time_s)
    end_v = float(one.contact_voltage(np.array([1 - printed.STEP_S / one.time_s]))[0])
    return Disagreement(
        "tk",
        f"Tk = {show(printed.COMMUTATION_S, 's')} from bk = 100 mm, Dk = 360 mm, 1400 rpm",
        f"the commutator's surface runs at {speed:.1f} m/s, so Tk = {show(time_s, 's', 3)}; A = Rd Tk / Ls is {as_printed.ratio:.3g} as printed, "
        f"{both.ratio:.3g} with Tk and Ls corrected, {one.ratio:.3g} with Tk alone",
        f"the two factors of ten cancel; with A below 1 the current does not reverse in time and the contact voltage ends at {end_v:.2g} V "
        f"one step before Tk and rising: the trailing edge sparks (a width of 100 mm is {100 * share:.0f} % of the circumference, also unlikely)",
        {
            "surface_speed_m_per_s": speed,
            "tk_s": time_s,
            "a_printed": as_printed.ratio,
            "a_both_corrected": both.ratio,
            "a_tk_corrected": one.ratio,
            "end_voltage_tk_corrected_v": end_v,
            "width_share_percent": 100 * share,
        },
    )


def contact_voltage() -> Disagreement:
    """The uc of Fig. 11."""
    coil = commutation()
    first, last = coil.contact_voltage(np.array([0.0, 1 - printed.STEP_S / coil.time_s]))
    steepest = coil.steepest_v_per_s()
    return Disagreement(
        "uc",
        f"uc is almost 1 V at the end; its rate reaches {printed.CONTACT_VOLTAGE_RATE:g} V",
        f"uc is a smooth ramp from {first:.2f} V to {last:.2f} V, at most {steepest:.2g} V/s",
        "the end value agrees, the rate cannot be reproduced; a smooth ramp cannot emit at MHz: what is missing is the arc when the contact "
        "breaks, a step of 10 - 20 V within 10 - 200 ns",
        {"first_v": float(first), "last_v": float(last), "steepest_v_per_s": steepest},
    )


def euler() -> Disagreement:
    """The printed time step near t = 0."""
    coil = commutation()
    volts = coil.euler_contact_voltage(printed.STEP_S, 4)
    exact = float(coil.contact_voltage(np.array([0.0]))[0])
    rate = float(np.max(np.abs(np.diff(volts)))) / printed.STEP_S
    difference = coil.solver_difference()
    digits = min(9, int(-np.log10(difference)))  # the solver's tolerance is 1e-10
    return Disagreement(
        "euler",
        f"solved in time steps of {show(printed.STEP_S, 's')}",
        f"explicit Euler gives uc = {', '.join(f'{v:.2f}' for v in volts)} V in the first steps ({rate:.2g} V/s) where uc is {exact:.2f} V; "
        f"the closed form and a stiff solver agree to {digits} digits",
        "unstable near t = 0, where the time constant is t/A: any large rate found there is made by the solver",
        {
            **{f"euler_step_{n + 1}_v": float(v) for n, v in enumerate(volts)},
            "exact_v": exact,
            "euler_rate_v_per_s": rate,
            "solver_difference": difference,
        },
    )


def lisn() -> Disagreement:
    """25 Ohm, or what two LISNs are."""
    low, high = (abs(complex(impedance(LISN, "line", "ground", [f])[0])) / 2 for f in (printed.LOWEST_HZ, printed.HIGHEST_HZ))
    decibel = float(20 * np.log10(printed.LISN_OHM / low))
    return Disagreement(
        "lisn",
        f"the LISN is {printed.LISN_OHM:g} Ohm over the whole band",
        f"two 50 uH || 50 Ohm networks in parallel are {low:.1f} Ohm at 150 kHz and {high:.1f} Ohm at 30 MHz",
        f"the lowest frequencies are predicted up to {decibel:.1f} dB too high",
        {"at_150_khz_ohm": low, "at_30_mhz_ohm": high, "difference_db": decibel},
    )


def notch() -> Disagreement:
    """Emission through the undamped resonance."""
    f0 = resonance_hz(printed.TABLE_1["La"], printed.TABLE_1["Ca"])
    places = [f0, printed.EMISSION_END_HZ]
    common_mode = impedance(LISN, "line", "ground", places) / 2
    motor = simulated(printed.TABLE_1_OHM).impedance("open", places)
    at_notch, at_end = (float(x) for x in 20 * np.log10(np.abs(common_mode / (common_mode + motor))))
    return Disagreement(
        "emission-notch",
        f"the emission stays strong up to {show(printed.EMISSION_END_HZ, 'Hz')}",
        f"from the motor (Rr in Ohm) to the LISN: {at_notch:.0f} dB at {show(f0, 'Hz', 3)}, "
        f"{at_end:.0f} dB at {show(printed.EMISSION_END_HZ, 'Hz')}",
        "an undamped winding would cut a deep notch just below the end of the emission: once more the missing loss",
        {"notch_hz": f0, "transfer_at_notch_db": at_notch, "transfer_at_end_db": at_end},
    )


CHECKS = (inductance, time, contact_voltage, euler, lisn, notch)
