"""The SPICE subcircuit: ngspice reads back every effect, and a transient run is stable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ngspice import needs_ngspice
from spice_decks import BASE, DB, DEG, SPAN, control, motor_with, run

from motoremi.errors import BadInput
from motoremi.export.law_ladders import ladder_of
from motoremi.export.realise import deviation, impedance_of, realise
from motoremi.export.spice import spice_model, subcircuit
from motoremi.fitting.fit import fit
from motoremi.model.circuit import Leaf, Parallel, Series
from motoremi.model.effects import catalogue
from motoremi.model.motor import dc_motor
from motoremi.model.parameter import Parameter

# La differs between the sweeps, so one network cannot represent both.
TWO_NETWORKS = "common-mode-flux"
IN_MOTOR = [
    identifier for effect in catalogue() if effect.group != "instrument" and effect.name != TWO_NETWORKS for identifier in effect.identifiers
]

TOGETHER = [
    ("eddy-laminations", "dielectric-loss@Cf", "lead-inductance"),
    ("eddy-laminations", "field-coupling"),
    ("distributed-winding", "skin-effect"),
    ("terminal-capacitance", "second-resonance", "second-resonance"),
    ("machine-winding", "winding-modes", "suppressor-choke", "suppressor-capacitor@pair"),
    ("distributed-winding", "winding-modes"),
    ("distributed-winding", "suppressor-capacitor"),
    ("winding-sections", "winding-modes", "suppressor-capacitor"),
    ("second-resonance", "suppressor-capacitor"),
    ("distributed-winding", "ground-strap-inductance"),
    ("winding-sections", "suppressor-capacitor", "ground-strap-inductance"),
]


def in_ngspice(netlist: list[str], folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, and the impedance of the short- and the open-circuit sweep."""
    wiring = ["V1 a 0 dc 0 ac 1", "X1 a 0 0 motoremi_motor", "V2 b 0 dc 0 ac 1", "X2 b far 0 motoremi_motor"]
    rows = run(["read back", *netlist, *wiring, *control(f"ac dec 80 {SPAN[0]:g} {SPAN[1]:g}", "wrdata out.data i(v1) i(v2)")], folder)
    return rows[:, 0], -1 / (rows[:, 1] + 1j * rows[:, 2]), -1 / (rows[:, 3] + 1j * rows[:, 4])


def step_in_ngspice(netlist: list[str], folder: Path) -> np.ndarray:
    """Voltage at the terminal after a step of 10 V behind 50 ohm, far end open."""
    wiring = ["V1 src 0 pulse(0 10 100n 10n 10n 1 2)", "Rs src t 50", "X1 t far 0 motoremi_motor"]
    rows = run(["step", *netlist, *wiring, *control("tran 5n 20u", "wrdata out.data v(t)")], folder)
    return rows[:, 1]


@pytest.mark.slow
@needs_ngspice
@pytest.mark.parametrize("effects", [(), *((name,) for name in IN_MOTOR), *TOGETHER])
def test_ngspice_reads_back_every_effect(effects: tuple[str, ...], tmp_path: Path) -> None:
    motor, values = motor_with(*effects)
    netlist = list(subcircuit(realise(motor, values, SPAN)))
    frequency, short, open_ = in_ngspice(netlist, tmp_path)
    for termination, got in (("short", short), ("open", open_)):
        if termination == "short" and effects == ("suppressor-capacitor@guarded",):
            # No guard takes the capacitor's current here.
            motor, values = motor_with("suppressor-capacitor@frame")
        db, deg = deviation(got, impedance_of(motor.circuit(termination), values, frequency))
        assert db < DB, (termination, db)
        assert deg < DEG, (termination, deg)


@pytest.mark.slow
@needs_ngspice
@pytest.mark.parametrize("effects", [(), *((name,) for name in IN_MOTOR if "@" not in name or "@Cf" in name)])
def test_a_transient_run_is_stable(effects: tuple[str, ...], tmp_path: Path) -> None:
    motor, values = motor_with(*effects)
    voltage = step_in_ngspice(list(subcircuit(realise(motor, values, SPAN))), tmp_path)
    assert np.all(np.isfinite(voltage))
    # A passive network behind 50 ohm: no ringing beyond twice the step, and none left at the end.
    assert np.abs(voltage).max() < 20
    tail = voltage[-len(voltage) // 20 :]
    assert np.ptp(tail) < 0.1
    assert 0 < tail.mean() <= 10.01


def test_two_laws_on_one_element_become_one_ladder() -> None:
    motor, values = motor_with("skin-effect", "proximity-effect")
    network = realise(motor, values, SPAN)
    frequency = np.geomspace(*SPAN, 500)
    db, deg = deviation(network.impedance("short", frequency), impedance_of(motor.circuit("short"), values, frequency))
    assert db < DB
    assert deg < DEG


@pytest.mark.parametrize("beside", [(), ("permeability-relaxation",), ("eddy-laminations",), ("field-coupling",)])
@pytest.mark.parametrize("quality", [0.01, 0.7, 6.0])
@pytest.mark.parametrize("exponent", [0.6, 1.0])
def test_a_damped_resonance_of_the_core_is_in_the_network(beside: tuple[str, ...], quality: float, exponent: float) -> None:
    """R and L alone cannot resonate: without a capacitor in the core's cell this is 10 to 20 dB off."""
    motor, values = motor_with("permeability-relaxation", *beside)
    own = {"share": 0.45, "corner_hz": 1e6, "exponent": exponent, "quality": quality}
    values |= {f"permeability-relaxation.{name}": value for name, value in own.items()}
    network = realise(motor, values, SPAN)
    frequency = np.geomspace(*SPAN, 2000)
    for termination in ("short", "open"):
        db, deg = deviation(network.impedance(termination, frequency), impedance_of(motor.circuit(termination), values, frequency))
        assert db < 1e-4, termination
        assert deg < 1e-3, termination


def test_an_own_law_becomes_a_ladder() -> None:
    def half_power(s, scale):
        value = scale * np.sqrt(s / 1e6)
        return value, (value / scale,)

    law = Leaf("own", half_power, (Parameter("own.scale", "Ohm", 0.1, 10, "test"),))
    motor = dc_motor().replaced("Ra", lambda leaf: Series((leaf, law)))
    values = {**BASE, "own.scale": 3.0}
    network = realise(motor, values, SPAN)
    frequency = np.geomspace(*SPAN, 500)
    db, deg = deviation(network.impedance("short", frequency), impedance_of(motor.circuit("short"), values, frequency))
    assert db < 1e-3
    assert deg < 1e-2
    assert network.ladder_errors["own"] < 1e-4


def test_a_law_that_is_not_passive_is_not_made_passive_silently() -> None:
    frequency = np.geomspace(1e5, 1e7, 100)
    assert ladder_of("odd", frequency, -5 + 2j * np.pi * frequency * 1e-6).error > 0.1


def test_what_has_no_parts_is_refused() -> None:
    motor = dc_motor().attached(lambda node: Parallel((Series((node, node)),)))
    with pytest.raises(BadInput, match="equivalent"):
        realise(motor, BASE, SPAN)


def test_what_differs_between_the_sweeps_is_refused() -> None:
    motor, values = motor_with(TWO_NETWORKS)
    with pytest.raises(BadInput, match=r"La differs .* drop common-mode-flux"):
        realise(motor, values, SPAN)


def test_a_machine_without_an_open_sweep_has_its_capacitance_across_the_line() -> None:
    motor, values = motor_with("machine-winding")
    network = realise(motor, values, SPAN, with_frame=False)
    frequency = np.geomspace(*SPAN, 500)
    db, deg = deviation(network.impedance("short", frequency), impedance_of(motor.circuit("short"), values, frequency))
    assert db < DB
    assert deg < DEG
    assert network.across is not None


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [("eddy-laminations",), ("cable-delay",)])
def test_netlist_of_a_fit_states_its_error(measure, hidden) -> None:
    sweeps, _ = measure(3, hidden, 1)
    fitted = fit(dc_motor(), sweeps).add(hidden[0])
    model = spice_model(fitted)
    assert 0 < model.error_db < DB or hidden == ("cable-delay",)
    assert model.error_deg < DEG
    assert f"at most {model.error_db:.2g} dB" in model.text
    assert ".subckt motoremi_motor terminal far_end frame" in model.text
    assert model.left_out == (hidden if hidden == ("cable-delay",) else ())
    assert model.text.isascii()


def test_netlist_without_an_open_sweep_says_so(measure) -> None:
    sweeps, _ = measure(3, (), 1)
    text = spice_model(fit(dc_motor(), [sweep for sweep in sweeps if sweep.termination == "short"])).text
    assert "no open-circuit sweep" in text
    assert "Cf" not in text.split(".subckt")[1]
