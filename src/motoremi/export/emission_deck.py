"""The whole emission test as one SPICE deck: source, the motor's subcircuit, stray capacitance, cable, both LISNs."""

from __future__ import annotations

import math
from collections.abc import Iterator

from motoremi.emission.netlist import path_lines
from motoremi.emission.setup import Setup
from motoremi.emission.source import Source
from motoremi.errors import BadInput
from motoremi.export.spice import SUBCIRCUIT

# Edge of the ideal step; the rise time of the source follows from an RC element behind it.
_EDGE_S = 1e-9


def emission_deck(subcircuit: str, setup: Setup) -> str:
    """A deck that ngspice and LTspice run without changes.

    AC analysis: the source is one volt, so the voltage at node `receiver` is the transfer function. Transient analysis: the source's steps, one
    edge for each commutation, alternately up and down.

    Parameters
    ----------
    subcircuit : str
        Lines with `.subckt motoremi_motor`.
    setup : Setup

    Raises
    ------
    BadInput
        If the subcircuit has no path to the frame and the set-up is for the common mode.
    """
    common = setup.path.mode == "common"
    if common and "nothing between far_end and frame" in subcircuit:
        raise BadInput("no open-circuit sweep: the frame's side of the motor is not known, and common-mode current goes through it")
    home = "0" if common else "back"
    lines = ["* emission test: source, motor, LISNs; read node receiver", *subcircuit.splitlines(), *_source(setup.source, home)]
    # The source drives the frame; the LISNs are at the terminal.
    lines.append(f"Xmotor terminal {'far' if common else 'emf'} emf {SUBCIRCUIT}")
    lines += path_lines(setup.path)
    period = 2 / setup.source.repetition_hz
    lines += [".ac dec 100 150k 30meg", f"* .tran 10n {period:.6g}   for a whole period of the source", ".end", ""]
    return "\n".join(lines)


def _source(source: Source, home: str) -> Iterator[str]:
    """Voltage between `emf` and `home`: 1 V AC in series with the switching sources."""
    random = [("jitter", source.jitter_s), ("missing commutations", source.missing_share), ("spread of the arc", source.arc and source.arc.spread)]
    for name, size in random:
        if size:
            yield f"* left out: {name}, which is random"
    if source.high_pass is not None:
        yield "* left out: the high-pass source, which has a spectrum but no events"
    yield "Vac emf after_ac dc 0 ac 1"
    steps = [("step", source.step_v, source.rise_s)] if source.step_v else []
    if source.arc is not None:
        steps.append(("arc", source.arc.voltage_v, source.arc.rise_s))
    node, period = "after_ac", 2 / source.repetition_hz
    for name, height, rise in steps:
        following = f"after_{name}"
        # The 10 to 90 % time of an exponential is ln 9 time constants.
        yield f"V{name} {name}_edge 0 pulse(0 {height:.6g} 1u {_EDGE_S:g} {_EDGE_S:g} {period / 2:.9g} {period:.9g})"
        yield f"R{name} {name}_edge {name}_settled 1"
        yield f"C{name} {name}_settled 0 {rise / math.log(9):.9g}"
        yield f"E{name} {node} {following} {name}_settled 0 1"
        node = following
    if source.chopper is None:
        yield f"Vend {node} {home} dc 0"
        return
    chopper = source.chopper
    width = chopper.duty / chopper.frequency_hz - chopper.rise_s
    pulse = f"0 {chopper.amplitude_v:.6g} 1u {chopper.rise_s:.6g} {chopper.rise_s:.6g} {width:.9g} {1 / chopper.frequency_hz:.9g}"
    yield f"Vchopper {node} {home} pulse({pulse})"
