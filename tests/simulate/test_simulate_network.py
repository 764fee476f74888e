"""The network solver against circuits solved by hand and against ngspice."""

from __future__ import annotations

import numpy as np
import pytest
from ngspice import needs_ngspice, solve
from numpy.typing import ArrayLike

from motoremi.errors import BadInput
from motoremi.simulate.network import Network, impedance, to_spice
from motoremi.simulate.parts import IN, OUT

FREQUENCY = np.geomspace(150e3, 30e6, 101)
S = 2j * np.pi * FREQUENCY


def worst(value: ArrayLike, expected: ArrayLike) -> float:
    return float(np.max(np.abs(np.asarray(value) / np.asarray(expected) - 1)))


def test_single_parts() -> None:
    for network, expected in (
        (Network().resistor("r", "a", "b", 40.0), 40.0 + 0 * S),
        (Network().inductor("l", "a", "b", 2e-6), S * 2e-6),
        (Network().capacitor("c", "a", "b", 3e-12), 1 / (S * 3e-12)),
    ):
        assert worst(impedance(network, "a", "b", FREQUENCY), expected) < 1e-14


def test_unbalanced_bridge() -> None:
    """Five resistors that no series or parallel rule solves: a star in place of one triangle does."""
    bridge = (
        Network()
        .resistor("r1", "a", "b", 1.0)
        .resistor("r2", "a", "c", 2.0)
        .resistor("r3", "b", "d", 3.0)
        .resistor("r4", "c", "d", 4.0)
        .resistor("r5", "b", "c", 5.0)
    )
    # Star of (r1, r2, r5): 1*2/8, 1*5/8, 2*5/8; then 0.25 + (0.625 + 3) || (1.25 + 4).
    expected = 0.25 + 3.625 * 5.25 / (3.625 + 5.25)
    assert worst(impedance(bridge, "a", "d", [1e6]), np.array([expected + 0j])) < 1e-14


def test_complete_graph_needs_the_dense_solver() -> None:
    """Between two of n nodes that are all joined by r the resistance is 2 r / n."""
    nodes = [f"n{number}" for number in range(7)]
    network = Network()
    for i, first in enumerate(nodes):
        for second in nodes[i + 1 :]:
            network = network.resistor(f"{first}{second}", first, second, 7e3)
    assert worst(impedance(network, "n0", "n3", FREQUENCY), 2e3 + 0 * S) < 1e-13


@pytest.mark.parametrize("coupling", [-1.0, -0.3, 0.0, 0.5, 0.999, 1.0])
def test_transformer(coupling: float) -> None:
    """Loaded secondary: Z = s L1 - s^2 M^2 / (s L2 + R); the secondary shares no node with the primary."""
    first, second, load = 12e-6, 3e-3, 50.0
    network = Network().inductor("p", "a", "b", first).inductor("q", "c", "d", second).resistor("r", "c", "d", load).couple("p", "q", coupling)
    expected = S * first - S**2 * coupling**2 * first * second / (S * second + load)
    # With k = 1 the two terms nearly cancel, so the error is relative to the size of the terms.
    error = np.abs(impedance(network, "a", "b", FREQUENCY) - expected) / np.abs(S * first)
    assert error.max() < 1e-12


def test_coupled_inductors_in_series() -> None:
    network = Network().inductor("p", "a", "m", 2e-6).inductor("q", "m", "b", 8e-6).capacitor("c", "a", "b", 22e-12).couple("p", "q", 0.4)
    total = 10e-6 + 2 * 0.4 * 4e-6
    assert worst(impedance(network, "a", "b", FREQUENCY), 1 / (1 / (S * total) + S * 22e-12)) < 1e-11


def test_ladder_of_cells() -> None:
    """200 cells against the product of their chain matrices."""
    network = Network().resistor("end", "n200", "g", 50.0)
    chain = np.broadcast_to(np.eye(2, dtype=complex), (S.size, 2, 2))
    for number in range(200):
        network = network.inductor(f"l{number}", f"n{number}", f"n{number + 1}", 5e-8)
        network = network.capacitor(f"c{number}", f"n{number + 1}", "g", 2e-12)
        cell = np.empty((S.size, 2, 2), dtype=complex)
        cell[:, 0, 0], cell[:, 0, 1] = 1 + S**2 * 5e-8 * 2e-12, S * 5e-8
        cell[:, 1, 0], cell[:, 1, 1] = S * 2e-12, 1
        chain = chain @ cell
    expected = (chain[:, 0, 0] * 50 + chain[:, 0, 1]) / (chain[:, 1, 0] * 50 + chain[:, 1, 1])
    assert worst(impedance(network, "n0", "g", FREQUENCY), expected) < 1e-9


def test_blocks_scale_and_nest() -> None:
    cell = Network().resistor("r", IN, "m", 10.0).inductor("l", "m", OUT, 1e-6).capacitor("c", IN, OUT, 1e-11)
    pair = Network().block("one", IN, "m", cell).block("two", "m", OUT, cell, 2.0)
    network = Network().block("all", "a", "b", pair, 0.5).capacitor("c", "a", "b", 1e-11)
    single = 1 / (1 / (10.0 + S * 1e-6) + S * 1e-11)
    assert worst(impedance(network, "a", "b", FREQUENCY), 1 / (1 / (1.5 * single) + S * 1e-11)) < 1e-13


def test_dangling_and_floating_parts_do_not_matter() -> None:
    network = (
        Network()
        .resistor("r", "a", "b", 40.0)
        .inductor("dangling", "a", "nowhere", 1e-6)
        .resistor("loop", "b", "b", 5.0)
        .resistor("island", "p", "q", 1.0)
    )
    assert worst(impedance(network, "a", "b", FREQUENCY), 40.0 + 0 * S) < 1e-14


def test_bad_networks() -> None:
    network = Network().resistor("r", "a", "b", 1.0).inductor("l", "c", "d", 1.0)
    with pytest.raises(BadInput, match="no path"):
        impedance(network, "a", "c", [1e6])
    with pytest.raises(BadInput, match="name two nodes"):
        impedance(network, "a", "a", [1e6])
    with pytest.raises(BadInput, match="no inductor"):
        impedance(network.couple("r", "l", 0.5), "a", "b", [1e6])
    with pytest.raises(BadInput, match="outside"):
        network.couple("l", "l", 1.5)
    with pytest.raises(BadInput, match="above 0"):
        network.capacitor("c", "a", "b", 0.0)
    with pytest.raises(BadInput, match="no part"):
        network.item("x")


@needs_ngspice
def test_ngspice_agrees_on_coupling_and_blocks() -> None:
    cell = (
        Network()
        .inductor("p", IN, "m", 2e-6)
        .inductor("q", "m", OUT, 8e-6)
        .inductor("third", "x", "y", 1e-3)
        .resistor("load", "x", "y", 300.0)
        .couple("p", "q", 0.4)
        .couple("q", "third", -0.5)
        .couple("p", "third", 0.2)
    )
    network = (
        Network().block("upper", "a", "m", cell, 0.3).block("lower", "m", "b", cell).capacitor("c", "a", "b", 22e-12).resistor("r", "m", "b", 5e3)
    )
    frequency = [150e3, 2.2e6, 30e6]
    spice = solve(to_spice(network).splitlines(), "a", "b", frequency)
    assert worst(impedance(network, "a", "b", frequency), spice) < 1e-9
