"""Parts that are no motor and have little inside: an air coil, a cable with a shorted far end; their sweeps are from textbook formulas."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from few_effects import FEW, seeking
from scipy.special import iv

import motoremi as me
from motoremi.data.analyser import find_analyser
from motoremi.diagnosis.candidates import unusual_values
from motoremi.diagnosis.findings import of_the_analyser
from motoremi.diagnosis.reasons import as_a_cable
from motoremi.fitting.problem import fixture_parameters
from motoremi.model.effects import add_effects
from motoremi.model.effects.cable_starts import winding_behind_cable
from motoremi.model.effects.seen import Across, Seen

IMITATING = {"shorted-turn", "rotor-cage", "permeability-relaxation", "skin-effect", "proximity-effect", "eddy-laminations", "dielectric-loss@Ca"}


def scatter(seed: int, values: np.ndarray, relative: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return values * (1 + relative * (rng.standard_normal(values.size) + 1j * rng.standard_normal(values.size)) / np.sqrt(2))


@cache
def air_coil() -> me.ImpedanceSweep:
    """Ten turns of copper wire of 0.5 mm on a tube of 40 mm: 1.3 m of it, its field within from Bessel's functions, and a former that loses 4 %."""
    frequency = np.linspace(1e5, 16e6, 1200)
    omega = 2 * np.pi * frequency
    wave = (1 + 1j) * np.sqrt(omega * 4e-7 * np.pi * 5.8e7 / 2) * 0.25e-3
    inner = 1.3 / (np.pi * 0.25e-3**2 * 5.8e7) * wave / 2 * iv(0, wave) / iv(1, wave)
    outer = 1j * omega * 6.7e-6
    beside = 1j * omega * 7.6e-12 * (1 - 0.04j)
    impedance = 1 / (1 / (inner + outer) + beside)
    return me.ImpedanceSweep("short", frequency, scatter(3, impedance, 1e-3), metadata={"accuracy_percent": "5"})


@pytest.mark.slow
def test_an_air_coil_has_no_core_and_no_shorted_turn() -> None:
    with seeking({*FEW, *IMITATING}):
        found = me.diagnose(me.fit(me.dc_motor(), [air_coil()]))
    assert found.verdict == "adequate"
    assert {one.effect for one in found.candidates[:2]} <= {"skin-effect", "proximity-effect", "dielectric-loss@Ca"}
    assert found.likeliest_sets[0][0] == ("dielectric-loss@Ca", "skin-effect")


def loop(corner_hz: float, skin_hz: float, sigma: float = 0.0) -> tuple[str, ...]:
    motor = add_effects(me.dc_motor(), ["shorted-turn"])
    values = {"shorted-turn.share": 0.1, "shorted-turn.corner_hz": corner_hz, "shorted-turn.skin_hz": skin_hz}
    return unusual_values(motor, {"shorted-turn"}, values, {name: sigma * value for name, value in values.items()})


def test_a_loop_has_less_inductance_within_its_wire_than_outside() -> None:
    """A ring of 20 mm of wire of 1 mm: 1.2 mOhm, 41 nH outside and 3 nH within, and its skin depth is the radius at 17 kHz."""
    assert loop(corner_hz=4.7e3, skin_hz=17e3) == ()
    assert loop(corner_hz=2e5, skin_hz=9.7e3) == ("shorted-turn.skin_hz",)
    # Where the sweep hardly shows the skin effect, it says nothing about that.
    assert loop(corner_hz=2e5, skin_hz=9.7e3, sigma=1.0) == ()


def shorted_cable(metres: float) -> tuple[np.ndarray, np.ndarray]:
    """RG58 with a shorted far end: 50 ohm, 5 ns a metre, and the loss that its data sheets give (0.16 dB a metre at 100 MHz, as the root of f)."""
    frequency = np.linspace(10e6, 100e6, 400)
    loss = 0.16 / 8.686 * np.sqrt(frequency / 100e6) * (1 + 1j)
    return frequency, 50 * np.tanh((loss + 2j * np.pi * frequency * 5e-9) * metres)


@pytest.mark.parametrize("metres", [1.3, 4.96, 7.8])
def test_start_values_of_a_cable_have_its_number_of_resonances(metres: float) -> None:
    frequency, impedance = shorted_cable(metres)
    starts = winding_behind_cable(Seen(frequency, impedance))
    phases = [2 * np.pi * 100e6 * (start["delay_s"] - 5e-9 * metres) for start in starts if abs(start["wave_ohm"] - 50) < 10]
    assert min(map(abs, phases), default=np.inf) < np.pi / 4


@pytest.mark.parametrize("metres", [0.9, 4.96])
def test_start_values_of_a_cable_without_its_motor(metres: float) -> None:
    """Its open-circuit sweep is the only one, and there is nothing at its far end."""
    frequency, shorted = shorted_cable(metres)
    opened = 50**2 / shorted
    starts = winding_behind_cable(Seen(across=Across(frequency, opened, opened, opened)))
    phases = [2 * np.pi * 100e6 * (start["delay_s"] - 5e-9 * metres) for start in starts if abs(start["wave_ohm"] - 50) < 10]
    assert min(map(abs, phases), default=np.inf) < np.pi / 4


@pytest.mark.case
@pytest.mark.slow
def test_a_cable_with_a_shorted_end_is_found_by_a_network_analyser() -> None:
    frequency, impedance = shorted_cable(4.96)
    # Directivity of -54 dB and 12 mm of connector behind the plane of calibration.
    reflection = (impedance - 50) / (impedance + 50) * np.exp(-4j * np.pi * frequency * 0.06e-9)
    reflection = scatter(5, reflection, 5e-4) + 0.002 * np.exp(2j * np.pi * frequency / 70e6)
    sweep = me.ImpedanceSweep("short", frequency, 50 * (1 + reflection) / (1 - reflection))
    with seeking({*FEW, "supply-cable", "distributed-winding", "winding-sections"}):
        found = me.diagnose(me.fit(me.dc_motor(), [sweep], analyser="nanovna"))
    assert found.effects == ("supply-cable",)
    assert found.best.parameters["supply-cable.delay_s"] == pytest.approx(24.8e-9, rel=0.02)
    assert found.best.unexplained_percent["value"] < 5


def test_a_fixture_is_made_of_wires() -> None:
    """What an analyser reads below zero is its own error, not a capacitance of -2 pF of the fixture."""
    elements = fixture_parameters(find_analyser("nanovna"))
    fit = SimpleNamespace(
        analyser_sigma=1.0,
        fixture_sigma=1.0,
        measurement=SimpleNamespace(analyser=find_analyser("nanovna")),
        problem=SimpleNamespace(unknowns=elements),
        unknowns=np.array([0.0, 0.6, 0.0, -0.5]),
        covariance=np.diag([1e-4] * 4),
    )
    (finding,) = of_the_analyser(fit, accepted=True)  # type: ignore[arg-type]
    assert "L = 18 nH" in finding.why
    assert "C below zero" in finding.why
    assert "-2 pF" not in finding.why


@cache
def bead() -> me.ImpedanceSweep:
    """A chip bead of 110 nH between two ports: its permeability falls in two steps, the second one resonant; 0.15 pF beside it."""
    frequency = np.geomspace(1e6, 1e9, 150)
    s = 2j * np.pi * frequency
    permeability = 0.3 + 0.3 / (1 + (1j * frequency / 3e7) ** 0.7) + 0.4 / (1 + 1j * frequency / 8e8 - (1.2 * frequency / 8e8) ** 2)
    through = 1 / (1 / (0.15 + s * 1.1e-7 * permeability) + s * 0.15e-12)
    return me.ImpedanceSweep("short", frequency, scatter(11, through, 3e-4), metadata={"fixture": "series-through"})


def test_the_errors_of_an_analyser_without_a_name_do_not_take_a_core_over() -> None:
    """Four times what is expected of one describes everything beside a law that is not quite the bead's: the circuit missed by 40 %."""
    both = me.fit(me.dc_motor(), [bead()]).add("permeability-relaxation").add("dielectric-relaxation@Ca")
    assert both.rms_error_percent < 3


@pytest.mark.slow
def test_two_terms_of_a_core_are_told_as_one_cause() -> None:
    frequency_hz = np.geomspace(1e4, 3e7, 201)
    s = 2j * np.pi * frequency_hz
    permeability = 0.25 + 0.45 / (1 + 1j * frequency_hz / 2e5) + 0.3 / (1 + 1j * frequency_hz / 6e6)
    winding = 1 / (1 / (1.2 + s * 400e-6 * permeability) + s * 50e-12)
    sweeps = [me.ImpedanceSweep("short", frequency_hz, scatter(seed, winding, 5e-4), metadata={"analyser": "e4990a"}) for seed in (1, 2, 3)]
    with seeking({"permeability-relaxation", "skin-effect", "dielectric-loss@Ca"}):
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.effects == ("permeability-relaxation", "permeability-relaxation")
    assert "the 2 permeability-relaxation are terms of the permeability of one core, which is one cause" in found.reasons


@pytest.mark.parametrize(
    ("henry", "farad", "said"),
    [
        # An extension cable of 0.12 m behind the compensated plane; two wires far apart.
        (33.08e-9, 12.15e-12, "a cable of 52.18 Ohm and about 0.13 m (634 ps) has both"),
        (120e-9, 1e-12, ""),
    ],
)
def test_a_lead_and_a_capacitance_at_the_terminals_may_be_a_short_cable(henry, farad, said):
    fit = SimpleNamespace(parameters={"lead-inductance.inductance_h": henry, "terminal-capacitance.capacitance_f": farad})
    assert "".join(as_a_cable(("terminal-capacitance", "lead-inductance"), fit)).partition(": is one")[0] == said
    assert as_a_cable(("lead-inductance",), fit) == []


def test_a_named_cable_is_told_with_its_length() -> None:
    """A coil of six printed turns has the impedance of a winding behind a cable, and a user who has none must know what else it may be."""
    fit = SimpleNamespace(parameters={"supply-cable.wave_ohm": 83.5, "supply-cable.delay_s": 5.19e-9})
    (said,) = as_a_cable(("supply-cable",), fit)
    assert said.startswith("that is a cable of 83.5 Ohm and about 1 m (5.19 ns): if there is none, a winding of one layer")
