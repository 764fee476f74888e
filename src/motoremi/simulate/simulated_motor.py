"""The simulated motor: the paper's seven elements as a network of ideal parts, with hidden effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import ComplexArray, JsonDict
from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.errors import BadInput
from motoremi.simulate.hidden import ELEMENTS, Elements, log_uniform, uniform
from motoremi.simulate.hidden_effects import MOTOR_EFFECTS, HiddenEffect, draw_effects
from motoremi.simulate.network import Network, impedance, to_spice

TERMINAL, GROUND = "X", "G"


@dataclass(frozen=True)
class SimulatedMotor:
    """A motor under test.

    Terminal X - (Ra, La in series) || Ca - far end Y - (Rr, Lr, Cr in series) || Cf - frame G, the circuit of Liu, Wang and Nan
    (2011), Fig. 2. The defaults are their Table 1 with Rr in ohm.

    Parameters
    ----------
    Ra, La, Ca, Rr, Lr, Cr, Cf : float
        Ohm, henry, farad.
    effects : tuple of HiddenEffect
    """

    Ra: float = 21.3e-3
    La: float = 12.1e-6
    Ca: float = 22e-12
    Rr: float = 39.8
    Lr: float = 1.6e-6
    Cr: float = 424e-12
    Cf: float = 210e-12
    effects: tuple[HiddenEffect, ...] = ()

    @classmethod
    def random(cls, seed: int, effects: Sequence[str] = ()) -> SimulatedMotor:
        """Draw a plausible damped motor; the elements of a seed do not depend on the hidden effects, except where an effect sets one.

        Parameters
        ----------
        seed : int
        effects : sequence of str
            Any of `MOTOR_EFFECTS`, drawn large enough to be detected.

        Raises
        ------
        BadInput
            For an unknown effect; the message lists the known ones.
        """
        if seed < 0:
            raise BadInput(f"the seed is {seed}; it must be 0 or above")
        rng = np.random.default_rng([seed, 0])
        # Ra includes the eddy-current loss of the core: a real winding resonates with a Q of 10 to 100.
        base = {
            "Ra": log_uniform(rng, 5.0, 50.0),
            "La": uniform(rng, 8e-6, 20e-6),
            "Ca": uniform(rng, 15e-12, 40e-12),
            "Rr": uniform(rng, 20.0, 60.0),
            "Lr": uniform(rng, 1e-6, 3e-6),
            "Cr": uniform(rng, 200e-12, 600e-12),
            "Cf": uniform(rng, 120e-12, 400e-12),
        }
        elements, hidden = draw_effects(seed, effects, base)
        return cls(**elements, effects=hidden)

    @property
    def elements(self) -> Elements:
        """The seven element values, SI units."""
        return {name: getattr(self, name) for name in ELEMENTS}

    def effect(self, name: str) -> HiddenEffect | None:
        """The hidden effect of that name, or None."""
        return next((effect for effect in self.effects if effect.name == name), None)

    def network(self, termination: Termination) -> Network:
        """The network between X and G; in the short-circuit sweep the far end Y is connected to G."""
        network = self.with_free_end(termination)
        return network.with_node("Y", GROUND) if termination == "short" else network

    def with_free_end(self, termination: Termination) -> Network:
        """The network of one sweep before the far end Y is connected to anything."""
        if termination not in TERMINATIONS:
            raise BadInput(f"unknown termination {termination!r}: use 'short' or 'open'")
        network = (
            Network()
            .resistor("Ra", "X", "W", self.Ra)
            .inductor("La", "W", "Y", self.La)
            .capacitor("Ca", "X", "Y", self.Ca)
            .resistor("Rr", "Y", "rotor", self.Rr)
            .inductor("Lr", "rotor", "core", self.Lr)
            .capacitor("Cr", "core", "G", self.Cr)
            .capacitor("Cf", "Y", "G", self.Cf)
        )
        for effect in sorted(self.effects, key=lambda effect: MOTOR_EFFECTS.index(effect.name)):
            network = effect.apply(network, self.elements, termination)
        return network

    def impedance(self, termination: Termination, frequency_hz: ArrayLike) -> ComplexArray:
        """True impedance in one sweep.

        Parameters
        ----------
        termination : {"short", "open"}
            `short`: winding, X to Y. `open`: X to the frame with Y open.
        frequency_hz : array_like, shape (n,)

        Returns
        -------
        ndarray of complex, shape (n,)
            In ohm.
        """
        return impedance(self.network(termination), TERMINAL, GROUND, frequency_hz)

    def netlist(self, termination: Termination) -> str:
        """The network as SPICE lines, between the nodes `X` and `G`."""
        return to_spice(self.network(termination))

    def truth(self) -> JsonDict:
        """The truth of a blind test: elements and effects with their sizes, SI units."""
        return {
            "elements": dict(self.elements),
            "effects": {effect.name: dict(effect.sizes) for effect in self.effects},
        }
