"""Windings in sections that link each other's flux, against the nodal equations written out, and against both ends of the family."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import motoremi as me
from motoremi.errors import BadInput
from motoremi.export.realise import impedance_of, realise
from motoremi.fitting.result import on_fits
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.effects.start import own_values
from motoremi.model.effects.winding import NO_END_SHARE
from motoremi.model.motor import dc_motor
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(100, 100e6, 121)
S = 2j * np.pi * FREQUENCY_HZ
RA, LA, CA, RR, LR, CR, CF = 8.0, 3e-3, 60e-12, 40.0, 1.6e-6, 424e-12, 900e-12
# Of Ca from one end of the winding to the other.
END = 0.3
ELEMENTS = {"Ra": RA, "La": LA, "Ca": CA, "Rr": RR, "Lr": LR, "Cr": CR, "Cf": CF}


def chain(s: complex, share: float, n: int, coupling: float, bridge: complex = 0.0) -> np.ndarray:
    """Admittance of all nodes of n sections, shape (n + 1, n + 1), a branch from end to end."""
    order = np.arange(n)
    flux = coupling ** np.abs(order[:, None] - order)
    sections = np.linalg.inv(RA / n * np.eye(n) + s * LA * flux / flux.sum()) + s * (1 - END) * CA * n * np.eye(n)
    drop = np.eye(n, n + 1) - np.eye(n, n + 1, 1)
    slots = np.full(n + 1, s * share * CF / n)
    slots[[0, -1]] /= 2
    ends = np.zeros((n + 1, n + 1), dtype=complex)
    ends[np.ix_([0, n], [0, n])] = (bridge + s * END * CA) * np.array([[1, -1], [-1, 1]])
    return drop.T @ sections @ drop + np.diag(slots) + ends


def frame(s: complex, share: float) -> complex:
    return 1 / (RR + s * LR + 1 / (s * CR)) + s * (1 - share) * CF


def seen(termination: str, share: float, n: int, coupling: float, bridge=lambda s: 0.0) -> np.ndarray:
    found = []
    for s in S:
        whole = chain(s, share, n, coupling, bridge(s))
        if termination == "short":
            whole = whole[:-1, :-1]
        else:
            whole[-1, -1] += frame(s, share)
        found.append(np.linalg.inv(whole)[0, 0])
    return np.array(found)


def modelled(termination: str, effects: tuple[str, ...], **values: float) -> np.ndarray:
    motor = add_effects(dc_motor(), effects)
    return impedance_of(motor.circuit(termination), {**ELEMENTS, **values}, FREQUENCY_HZ)


def sections(share: float, n: int, coupling: float, end_share: float = END) -> dict[str, float]:
    own = {"share": share, "sections": n, "coupling": coupling, "end_share": end_share}
    return {f"winding-sections.{name}": value for name, value in own.items()}


@pytest.mark.parametrize("termination", ["short", "open"])
@pytest.mark.parametrize(("n", "coupling"), [(1, 0.5), (2, 0.9), (3, 0.01), (5, 0.3), (8, 0.7), (20, 0.98)])
def test_the_closed_form_is_the_nodal_equations(termination, n, coupling):
    got = modelled(termination, ("winding-sections",), **sections(0.6, n, coupling))
    # Of the nodal equations: near-equal currents at 100 Hz, and a resonance of little loss.
    np.testing.assert_allclose(got, seen(termination, 0.6, n, coupling), rtol=1e-7)


def suppressor_admittance(s):
    return 1 / (0.3 + s * 1e-8 + (s / (2e6 * np.pi)) ** (2 / np.pi * np.arctan(0.02)) / (s * 2e-9))


@pytest.mark.parametrize("termination", ["short", "open"])
def test_a_suppressor_lies_across_the_ends_of_all_sections(termination):
    sizes = {"capacitance_f": 2e-9, "esr_ohm": 0.3, "esl_h": 1e-8, "tan_delta": 0.02}
    part = {f"suppressor-capacitor.{name}": value for name, value in sizes.items()}
    got = modelled(termination, ("winding-sections", "suppressor-capacitor"), **sections(0.5, 6, 0.6), **part)
    expected = seen(termination, 0.5, 6, 0.6, suppressor_admittance)
    np.testing.assert_allclose(got, expected, rtol=1e-7)


@pytest.mark.parametrize("termination", ["short", "open"])
def test_one_section_is_the_lumped_circuit_and_many_unlinked_ones_are_the_line(termination):
    lumped, one = modelled(termination, ()), modelled(termination, ("winding-sections",), **sections(1e-9, 1, 0.5))
    np.testing.assert_allclose(one, lumped, rtol=1e-5)
    low = FREQUENCY_HZ < 3e6
    line = modelled(termination, ("distributed-winding",), **{"distributed-winding.share": 0.6, "distributed-winding.end_share": NO_END_SHARE})
    errors = [
        np.abs(modelled(termination, ("winding-sections",), **sections(0.6, n, 0.01, NO_END_SHARE)) / line - 1)[low].max() for n in (8, 32, 128)
    ]
    # Neighbours that link a hundredth leave 2 % of a section's inductance to the ends.
    assert errors[2] < errors[1] < errors[0]
    assert errors[2] < 0.05


@pytest.mark.parametrize("termination", ["short", "open"])
@pytest.mark.parametrize("law", ["distributed-winding", "winding-sections"])
@pytest.mark.parametrize("end_share", [0.0, 1.0])
def test_all_of_a_capacitance_may_lie_between_turns_or_across_the_ends(law, termination, end_share):
    """Where one of the two is a capacitance of zero, whose impedance is infinite."""
    own = {"distributed-winding": {"distributed-winding.share": 0.6}, "winding-sections": sections(0.6, 5, 0.3)}[law]
    got, near = (modelled(termination, (law,), **own | {f"{law}.end_share": value}) for value in (end_share, abs(end_share - 1e-14)))
    # At 100 MHz, far above the resonance of La with Ca, a change of Ca counts a hundred thousand times and more.
    np.testing.assert_allclose(got, near, rtol=1e-7)


@pytest.mark.parametrize(("line", "own"), [("distributed-winding", {"share": 0.6}), ("machine-winding", {})])
def test_a_line_that_is_there_already_is_cut_into_sections(line, own):
    start = own_values(find_effect(line).effect.starts[0]) | own
    values = {f"{line}.{name}": value for name, value in start.items()}
    cut = {"winding-sections.sections": 128.0, "winding-sections.coupling": 0.0}
    low = FREQUENCY_HZ < 1e6
    for termination in ("short", "open"):
        whole = modelled(termination, (line,), **values)
        for effects in ((line, "winding-sections"), ("winding-sections", line)):
            got = modelled(termination, effects, **values, **cut)
            np.testing.assert_allclose(got[low], whole[low], rtol=2e-2)
    names = {p.name for p in add_effects(dc_motor(), (line, "winding-sections")).parameters}
    assert "winding-sections.share" not in names


def test_linked_flux_leaves_higher_resonances_less_inductance():
    """With all flux in common the sections are an autotransformer: no resonance but the first is left where it was."""

    def resonances(coupling: float) -> np.ndarray:
        magnitude = np.abs(modelled("short", ("winding-sections",), **sections(0.9, 16, coupling)))
        fine = magnitude[1:-1]
        return FREQUENCY_HZ[1:-1][(fine > magnitude[:-2]) & (fine > magnitude[2:])]

    apart, linked = resonances(0.01), resonances(0.9)
    assert linked[1] / linked[0] > 1.5 * apart[1] / apart[0]


def test_laws_of_copper_and_core_act_in_every_section():
    effects = ("winding-sections", "rotor-cage", "skin-effect")
    cage = {"rotor-cage.share": 0.5, "rotor-cage.corner_hz": 300.0, "rotor-cage.skin_hz": 1e4}
    values = {**cage, "skin-effect.radius_m": 4e-4, "skin-effect.share": 0.7}
    got = modelled("short", effects, **sections(0.5, 1, 0.5), **values)
    branch = modelled("short", ("rotor-cage", "skin-effect"), **values)
    # A single section: the winding with half of the spread capacitance at its open end.
    np.testing.assert_allclose(got, 1 / (1 / branch + S * 0.5 * 0.5 * CF), rtol=1e-9)


def wide_sweep(n: int, coupling: float) -> me.ImpedanceSweep:
    frequency = np.geomspace(1e3, 30e6, 151)
    values = {**ELEMENTS, **sections(0.7, n, coupling)}
    clean = impedance_of(add_effects(dc_motor(), ("winding-sections",)).circuit("short"), values, frequency)
    rng = np.random.default_rng(2)
    return me.ImpedanceSweep("short", frequency, clean * (1 + 1e-3 * (rng.normal(size=151) + 1j * rng.normal(size=151))))


@pytest.mark.slow
def test_more_sections_than_points_can_tell_are_refused():
    base = me.fit(me.dc_motor(), [wide_sweep(4, 0.5)])
    for many in (60.0, 2.5, 0.0):
        with pytest.raises(BadInput, match="hold a whole number"):
            base.add("winding-sections", held={"winding-sections.sections": many})


@pytest.mark.slow
def test_sections_and_coupling_are_found_in_a_wide_sweep(monkeypatch):
    found = me.fit(me.dc_motor(), [wide_sweep(4, 0.5)]).add("winding-sections")
    name = "winding-sections.coupling"
    assert found.held["winding-sections.sections"] == 4
    assert found.parameters[name] == pytest.approx(0.5, rel=0.03)
    assert found.rms_error_percent < 0.3
    # A signed number that may be none is known within a tenth of its range. With values that are no solution, every other one would be as good.
    monkeypatch.setattr(on_fits, "alternatives", lambda fit: np.empty((0, len(fit.unknowns))))
    nearly_none = {**found.parameters, name: 0.01}
    assert dataclasses.replace(found, parameters=nearly_none, local_sigma={**found.local_sigma, name: 0.1}).determined(name)
    assert not dataclasses.replace(found, parameters=nearly_none, local_sigma={**found.local_sigma, name: 0.3}).determined(name)


def test_coupled_coils_under_a_law_of_the_core_are_not_exported():
    motor = add_effects(dc_motor(), ("winding-sections", "rotor-cage"))
    values = {**ELEMENTS, **sections(0.5, 4, 0.5), "rotor-cage.share": 0.5, "rotor-cage.corner_hz": 300.0, "rotor-cage.skin_hz": 1e4}
    with pytest.raises(BadInput, match="coupled coils"):
        realise(motor, values, (1e3, 30e6))


def test_the_simulator_hides_sections_beside_nothing_else_of_the_winding():
    with pytest.raises(BadInput, match="hide one of them"):
        SimulatedMotor.random(1, ["winding-sections", "core-loss"])
