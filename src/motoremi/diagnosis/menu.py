"""What can be measured next, and what each measurement would do to the elements of a model; what it does to an effect, the effect says.

How strongly an effect answers to temperature, bias or handling is an estimate from textbooks (unconfirmed for any one motor), so that
only the pattern over frequency counts, its size within a factor of two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["sweep", "change", "value", "standard"]


@dataclass(frozen=True)
class Option:
    """One measurement of the menu.

    Parameters
    ----------
    name : str
        Identifier.
    action : str
        What to do, as one would say it at the bench.
    kind : {"sweep", "change", "value", "standard"}
        `sweep`: more of the same motor. `change`: the same sweeps after a change, which the analyser's systematic errors survive unchanged.
        `value`: a single number from another meter. `standard`: a known part in the motor's place.
    effort : float
        In units of one sweep.
    elements : mapping
        Factor on each element of the paper's circuit that the change moves.
    procedure : str
        Bench procedure that does it, if the bench can.
    """

    name: str
    action: str
    kind: Kind
    effort: float
    elements: Mapping[str, float] = field(default_factory=dict)
    procedure: str = ""


MENU = (
    Option("wide-sweep", "sweep as wide as the analyser goes, both terminations", "sweep", 1.0, procedure="wide_sweep"),
    Option("far-end-grounded", "tie the far end of the winding to the frame and sweep from the terminal to the frame", "sweep", 2.0),
    Option("dc-resistance", "measure the winding's DC resistance with four wires", "value", 1.5),
    Option("insulation-resistance", "measure the insulation resistance from winding to frame at DC", "value", 1.5),
    Option("repeat-first-sweep", "repeat the first sweep after the last one", "change", 1.0, procedure="impedance_only"),
    Option("sweep-downwards", "sweep once more from the top down, or at another level", "change", 1.0),
    Option("shaft-turned", "turn the shaft a little and repeat both sweeps", "change", 1.5),
    Option("contacts-cleaned", "clean and tighten the contacts and repeat both sweeps", "change", 2.0),
    Option("field-winding", "open the field winding's terminals (short them if they were open) and repeat both sweeps", "change", 2.0),
    Option("standards", "put a 50 Ohm and a 100 pF standard on the fixture in the motor's place", "standard", 2.5),
    Option("repeat-compensation", "repeat open, short and load compensation and both sweeps", "change", 2.5),
    Option("longer-lead", "add a known length to the test lead and repeat both sweeps", "change", 3.0),
    Option("longer-strap", "double the length of the strap to the frame and repeat the open-circuit sweep", "change", 3.0),
    Option("terminal-block", "lift the lead off the terminal block and sweep the motor without it", "change", 3.0),
    Option("end-turn-touched", "tape a strip of foil on the end turns and repeat both sweeps", "change", 3.0, elements={"Cf": 1.02}),
    Option("dc-bias", "repeat both sweeps with a DC bias through the winding", "change", 4.0, elements={"La": 0.9}),
    Option("second-temperature", "warm the motor by 30 K and repeat both sweeps", "change", 5.0, elements={"Ra": 1.12}),
    Option("rotor-out", "take the rotor out and repeat both sweeps", "change", 8.0, elements={"La": 0.6}),
    Option("dried", "dry the motor at 60 - 80 °C, let it cool, and repeat both sweeps", "change", 6.0),
)
