"""A simulated motor under each condition: the true values of everything that can be measured."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.conditions import STANDARDS, VALUES
from motoremi.data.sweep import Termination
from motoremi.errors import BadInput
from motoremi.simulate.hidden import log_uniform, uniform
from motoremi.simulate.hidden_connection import CONNECTION_EFFECTS, DRIFT_EFFECTS
from motoremi.simulate.hidden_suppressor import SUPPRESSOR_EFFECTS
from motoremi.simulate.network import Network, impedance
from motoremi.simulate.response import Responses
from motoremi.simulate.simulated_motor import GROUND, TERMINAL, SimulatedMotor

FAR_END_GROUNDED = "far-end-grounded"
OPEN_OHM, SHORT_OHM = 1e12, 1e-6
USUAL_LEAD_H, USUAL_CAPACITOR_F, USUAL_LOAD_OHM = 50e-9, 100e-12, 50.0
# Inductance added by a longer strap if the motor hides none.
_STRAP_H = (15e-9, 60e-9)
# Tolerances of known parts.
_LEAD_TOLERANCE, _CAPACITOR_TOLERANCE, _LOAD_TOLERANCE = 0.05, 0.01, 2e-3
# Frequencies that are low enough for pure resistance of the winding and of the insulation, and the frequency of a bridge.
_DIRECT_HZ, _INSULATION_HZ, _BRIDGE_HZ = 1e-3, 1e-7, 1e3
_SOUND_INSULATION_OHM = (3e9, 1e11)
# Inductance of a test lead per metre, and length of the lead if none is hidden.
_LEAD_H_PER_M, _SHORT_LEAD_M = (7e-7, 1.2e-6), (0.02, 0.1)
_OWN_LEADS = {kind.name for kind in (*CONNECTION_EFFECTS, *DRIFT_EFFECTS)}

_AT_THE_TERMINALS = {"brush-contact", "terminal-capacitance", *(kind.name for kind in SUPPRESSOR_EFFECTS)}


@dataclass(frozen=True)
class Specimen:
    """A motor with its responses to conditions.

    Parameters
    ----------
    motor : SimulatedMotor
        The motor without a condition.
    seed : int
        Seed of its responses, and of the true values of known parts.
    """

    motor: SimulatedMotor
    seed: int

    @cached_property
    def responses(self) -> Responses:
        """Responses of its parts."""
        return Responses(self.motor, self.seed)

    def network(self, termination: Termination, condition: str = "", value: float | None = None, turn: int = 0) -> Network:
        """The network between X and G.

        Parameters
        ----------
        termination : {"short", "open"}
        condition : str
            Identifier; empty for the motor as it is.
        value : float, optional
            SI unit; a temperature in degree Celsius.
        turn : int
            Number of earlier times.
        """
        motor = self.responses.under(condition, value, turn)
        if condition == "brushes-lifted":
            # Measured at the bars, effects of the brushes and of the terminals are not in the circuit.
            motor = replace(motor, effects=tuple(effect for effect in motor.effects if effect.name not in _AT_THE_TERMINALS))
        network = motor.with_free_end(termination)
        if condition == "repeat-first-sweep" and termination == "short" and (drift := motor.effect("temperature-drift")):
            # When the first sweep is repeated, the motor is as warm as during the last sweep.
            network = drift.apply(network, motor.elements, "open")
        if condition == FAR_END_GROUNDED:
            frame = "frame" if "frame" in _nodes(network) else GROUND
            network = network.with_node("Y", frame)
        elif termination == "short":
            network = network.with_node("Y", GROUND)
        return self._outside(network, termination, condition, value)

    def impedance(
        self, termination: Termination, frequency_hz: FloatArray, condition: str = "", value: float | None = None, turn: int = 0
    ) -> ComplexArray:
        """Impedance under a condition, in ohm, of the standard if the condition is one of `STANDARDS`; the arguments are those of `network`."""
        if condition in STANDARDS:
            return self._standard(condition, value, frequency_hz)
        return impedance(self.network(termination, condition, value, turn), TERMINAL, GROUND, frequency_hz)

    def single_value(self, name: str) -> float:
        """True value of what another meter measures, SI unit.

        Parameters
        ----------
        name : str
            One of `data.conditions.VALUES`; measured at the motor's terminals, without the leads of the sweeps.

        Raises
        ------
        BadInput
            For any other name.
        """
        bare = replace(self.motor, effects=tuple(effect for effect in self.motor.effects if effect.name not in _OWN_LEADS))
        match name:
            case "dc-resistance":
                return float(impedance(bare.network("short"), TERMINAL, GROUND, [_DIRECT_HZ])[0].real)
            case "insulation-resistance":
                network = bare.network("open").resistor("sound insulation", TERMINAL, GROUND, log_uniform(self._rng(name), *_SOUND_INSULATION_OHM))
                return float(impedance(network, TERMINAL, GROUND, [_INSULATION_HZ])[0].real)
            case "capacitance-1khz" | "tan-delta-1khz":
                admittance = 1 / bare.impedance("open", [_BRIDGE_HZ])[0]
                return float(admittance.imag / (2 * np.pi * _BRIDGE_HZ) if name == "capacitance-1khz" else admittance.real / admittance.imag)
            case "lead-length":
                lead, rng = self.motor.effect("lead-inductance"), self._rng(name)
                return uniform(rng, *_SHORT_LEAD_M) if lead is None else lead.sizes["inductance_h"] / uniform(rng, *_LEAD_H_PER_M)
        raise BadInput(f"the simulation knows no single value {name!r}: use one of {', '.join(VALUES)}")

    def _outside(self, network: Network, termination: Termination, condition: str, value: float | None) -> Network:
        """The network with the part that a condition adds between motor and analyser."""
        rng = self._rng(condition)
        if condition == "longer-lead":
            henry = (USUAL_LEAD_H if value is None else value) * (1 + _LEAD_TOLERANCE * float(rng.standard_normal()))
            return network.with_node("X", "lead end").inductor("longer lead", "X", "lead end", henry)
        if condition == "longer-strap" and termination == "open" and self.motor.effect("ground-strap-inductance") is None:
            return network.with_node("G", "strap end").inductor("longer strap", "strap end", "G", log_uniform(rng, *_STRAP_H))
        if condition == "known-capacitor":
            farad = (USUAL_CAPACITOR_F if value is None else value) * (1 + _CAPACITOR_TOLERANCE * float(rng.standard_normal()))
            return network.capacitor("known capacitor", "X", "G", farad)
        return network

    def _standard(self, condition: str, value: float | None, frequency_hz: FloatArray) -> ComplexArray:
        load = (USUAL_LOAD_OHM if value is None else value) * (1 + _LOAD_TOLERANCE * float(self._rng("load").standard_normal()))
        return np.full(frequency_hz.shape, {"fixture-open": OPEN_OHM, "fixture-short": SHORT_OHM}.get(condition, load), dtype=np.complex128)

    def _rng(self, purpose: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, zlib.crc32(f"specimen {purpose}".encode())])


def _nodes(network: Network) -> set[str]:
    return {node for item in network.items for node in (item.positive, item.negative)}
