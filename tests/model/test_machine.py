"""Effects of larger machines on a measured one and on circuits written out here; laws of materials as positive-real functions."""

from __future__ import annotations

import numpy as np
import pytest
from places import DATA
from scipy.optimize import least_squares

import motoremi as me
from motoremi.data.files import read_impedance
from motoremi.diagnosis.ladder_step import further
from motoremi.errors import BadInput
from motoremi.model import materials
from motoremi.model.effects import add_effects, find_effect
from motoremi.model.motor import dc_motor

MACHINE = DATA / "motor_1p5hp_dm_cc_by" / "motor_1p5hp_A1_B1C1_subset.csv"


def measured_machine(low_hz: float, high_hz: float) -> me.ImpedanceSweep:
    sweep = read_impedance(MACHINE, "short")
    keep = (sweep.frequency_hz >= low_hz) & (sweep.frequency_hz <= high_hz)
    return me.ImpedanceSweep("short", sweep.frequency_hz[keep], sweep.impedance_ohm[keep])


@pytest.mark.slow
def test_a_measured_machine_below_150_khz_is_eight_parameters():
    base = me.fit(me.dc_motor(), [measured_machine(90, 150e3)])
    machine = base.add("machine-winding")
    # A fit of the same structure by hand leaves 3.3 %; the paper's circuit 84 %.
    assert base.rms_error_percent > 50
    assert machine.rms_error_percent < 4
    assert len(machine.parameters) == 9
    assert 0.1 < machine.parameters["La"] < 0.2
    # Copper hides below iron and cage at 100 Hz: it is held where it is next to nothing.
    assert set(machine.held) == {"Ra"}
    assert machine.parameters["Ra"] == pytest.approx(1e-3)
    assert not machine.undetermined()
    assert machine.unseen() == ["Rr", "Lr", "Cr", "Cf"]
    assert "not in these sweeps: Rr, Lr, Cr, Cf" in repr(machine)


@pytest.mark.slow
def test_a_measured_machine_from_150_khz_to_30_mhz_is_twenty_parameters():
    sweep = measured_machine(149e3, 30.1e6)
    stated = me.ImpedanceSweep("short", sweep.frequency_hz, sweep.impedance_ohm, metadata={"accuracy_percent": "5"})
    first = me.fit(me.dc_motor(), [stated]).add("lead-inductance").add("winding-modes")
    last = [fit for portion in further(first, "winding-modes") for fit in portion][-1]
    # A fit of the same structure by hand leaves 4.8 % with 20.
    assert last.rms_error_percent < 5
    assert len(last.parameters) - len(last.held) <= 20
    assert not last.undetermined()


@pytest.mark.slow
def test_what_was_held_for_want_of_showing_is_free_again_in_the_next_step():
    machine = me.fit(me.dc_motor(), [measured_machine(90, 150e3)]).add("machine-winding")
    assert "Ra" in machine.held
    cut = machine.add("winding-sections")
    assert cut.rms_error_percent <= machine.rms_error_percent * 1.05
    assert cut.held["winding-sections.sections"] == round(cut.held["winding-sections.sections"])


def modal_winding(frequency_hz: np.ndarray) -> np.ndarray:
    """R and L beside a capacitance and three series branches of one quality."""
    s = 2j * np.pi * frequency_hz
    admittance = 1 / (40 + s * 1e-4) + s * 20e-12
    for resonance_hz, capacitance in ((3e6, 30e-12), (7e6, 20e-12), (15e6, 15e-12)):
        w = 2 * np.pi * resonance_hz
        inductance = 1 / (w**2 * capacitance)
        admittance = admittance + 1 / (s * inductance + w * inductance / 6.0 + 1 / (s * capacitance))
    return 1 / admittance


@pytest.mark.slow
def test_modes_are_added_while_they_lower_the_error_and_no_further():
    frequency = np.geomspace(150e3, 30e6, 201)
    rng = np.random.default_rng(3)
    noise = 1e-3 * (rng.normal(size=201) + 1j * rng.normal(size=201))
    first = me.fit(me.dc_motor(), [me.ImpedanceSweep("short", frequency, modal_winding(frequency) * (1 + noise))]).add("winding-modes")
    portions = list(further(first, "winding-modes"))
    last = portions[-1][-1]
    assert last.effects == ("winding-modes",) * 3
    assert last.rms_error_percent < 0.2
    assert last.parameters["winding-modes.quality"] == pytest.approx(6.0, rel=0.02)
    found = sorted(value for name, value in last.parameters.items() if name.endswith("resonance_hz"))
    assert found == pytest.approx([3e6, 7e6, 15e6], rel=0.01)


@pytest.mark.slow
def test_the_accuracy_that_was_stated_ends_the_adding_of_modes():
    frequency = np.geomspace(150e3, 30e6, 101)
    stated = 50.0
    sweep = me.ImpedanceSweep("short", frequency, modal_winding(frequency), metadata={"accuracy_percent": str(stated)})
    first = me.fit(me.dc_motor(), [sweep]).add("winding-modes")
    grown = [fit for portion in further(first, "winding-modes") for fit in portion]
    errors = [fit.rms_error_percent for fit in (first, *grown)]
    assert errors[-1] <= stated < min(errors[:-1])
    assert len(errors) < 3  # a third mode would leave nothing
    assert not list(further(grown[-1], "winding-modes"))


def test_modes_share_one_quality():
    motor = add_effects(dc_motor(), ("winding-modes",) * 3)
    names = [parameter.name for parameter in motor.parameters]
    assert sum(name.endswith(".quality") for name in names) == 1
    assert sum(name.endswith(".resonance_hz") for name in names) == 3


def test_two_descriptions_of_one_thing_are_refused():
    with pytest.raises(BadInput, match="describe the same thing"):
        add_effects(dc_motor(), ("distributed-winding", "machine-winding"))


def test_a_suppressor_has_a_usual_place():
    assert find_effect("suppressor-capacitor").identifier == "suppressor-capacitor"
    assert find_effect("suppressor-capacitor@pair").place == "pair"
    with pytest.raises(BadInput, match="cannot be at Cf"):
        find_effect("suppressor-capacitor@Cf")


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (materials.skin_factor, [(1e-5, 2e-3)]),
        (materials.dowell_factor, [(5e-5, 2e-3), (1.0, 60.0)]),
    ],
)
def test_laws_of_conductors_are_positive_real(law, ranges):
    """No pole and no negative resistance anywhere in the right half-plane: causal and passive."""
    for s, values in drawn(ranges):
        assert np.all(law(s, *values)[0].real >= 0)


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (materials.lamination_factor, [(0.01, 0.999), (300.0, 1e6)]),
        (materials.debye_factor, [(0.01, 1.0), (1e3, 1e9)]),
        (materials.cole_cole_factor, [(0.01, 1.0), (5e5, 3e8), (0.6, 1.0)]),
        (materials.permeability_factor, [(0.01, 0.9999), (5e4, 1e9), (0.3, 1.0), (0.01, 10.0)]),
        (materials.shorted_loop_factor, [(0.02, 0.95), (5.0, 5e3), (10.0, 1e7)]),
        (materials.machine_core_factor, [(1e-3, 0.95), (5.0, 2e4), (300.0, 1e7), (0.3, 1.0)]),
    ],
)
def test_laws_of_cores_are_positive_real(law, ranges):
    for s, values in drawn(ranges):
        assert np.all((s * law(s, *values)[0]).real >= -1e-12 * np.abs(s))


@pytest.mark.parametrize(
    ("law", "ranges"), [(materials.constant_phase_factor, [(5e-4, 1.0)]), (materials.relaxation_factor, [(0.005, 1.0), (1e4, 6e7), (0.4, 1.0)])]
)
def test_laws_of_dielectrics_are_positive_real(law, ranges):
    for s, values in drawn(ranges):
        assert np.all((law(s, *values)[0] / s).real >= -1e-12 / np.abs(s))


def drawn(ranges):
    """Complex frequencies in the right half-plane and parameters, ends of the ranges included."""
    rng = np.random.default_rng(1)
    for _ in range(60):
        size, angle = 10 ** rng.uniform(2, 9, 200), rng.uniform(-0.5, 0.5, 200) * np.pi
        share = np.array([rng.choice([0.0, 1.0, rng.uniform()]) for _ in ranges])
        yield size * np.exp(1j * angle), [np.array([low * (high / low) ** x]) for (low, high), x in zip(ranges, share, strict=True)]


def plain_rlc_error_percent(sweep: me.ImpedanceSweep) -> float:
    """Relative rms error of the best R + L beside C, from many starts, by a fit that knows nothing of motors."""
    s, measured = 2j * np.pi * sweep.frequency_hz, sweep.impedance_ohm

    def error(logs: np.ndarray) -> np.ndarray:
        ohm, henry, farad = np.exp(logs)
        share = 1 / (1 / (ohm + s * henry) + s * farad) / measured - 1
        return np.concatenate([share.real, share.imag])

    starts = [np.log([ohm, henry, farad]) for ohm in (1.0, 30.0) for henry in (1e-4, 1e-2, 0.2) for farad in (1e-11, 1e-10, 1e-9)]
    low, high = np.log([1e-3, 1e-9, 1e-14]), np.log([1e4, 10.0, 1e-6])
    best = min(least_squares(error, start, bounds=(low, high)).cost for start in starts)
    return float(100 * np.sqrt(2 * best / len(measured)))


@pytest.mark.slow
def test_a_circuit_that_misses_by_far_is_no_worse_than_a_plain_fit():
    sweep = measured_machine(90, 101e6)
    plain = plain_rlc_error_percent(sweep)
    assert plain > 50
    # The ranges of the seven elements keep it 0.2 % above; a fit of the likelihood alone leaves 8 % more.
    assert me.fit(me.dc_motor(), [sweep]).rms_error_percent <= 1.01 * plain
