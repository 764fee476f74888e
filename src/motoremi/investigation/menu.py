"""The menu of measurements: for each the instruction, the time, and its effect on the elements of a motor.

The response of an effect to a measurement is stated by the effect (`Effect.responds`). The size of responses to temperature, bias or
handling is an estimate from textbooks (unconfirmed for any one motor): it is known within a factor, and the factor is part of the row.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from motoremi.data.conditions import CONDITIONS

Kind: TypeAlias = Literal["sweep", "change", "value", "standard", "reference"]
# Repeatability of a motor and its contacts after they were touched: change of the logarithm of each element; an estimate.
REPEATABILITY = 5e-4
# Change of effects that a condition should not influence, as an allowance for unknown influences in every explanation.
UNREACHED = 3e-3
# Duration of one sweep in minutes if the settings of the instrument are not known.
SWEEP_MINUTES = 0.5


class Moved(NamedTuple):
    """Change of the logarithm of an element: mean and standard deviation."""

    mean: float
    sigma: float


@dataclass(frozen=True)
class Option:
    """One measurement of the menu.

    Parameters
    ----------
    name : str
        Identifier, and that of the condition that its sweeps carry.
    action : str
        The instruction to the operator.
    kind : {"sweep", "change", "value", "standard", "reference"}
        `sweep`: the same motor in another circuit or over another span. `change`: the same sweeps after a change, which the analyser's
        smooth errors survive. `value`: a single number from another meter. `standard`: a known part in the motor's place. `reference`: what
        the state that the motor is judged in still lacks.
    minutes : float
        Of operator, warming and cooling, beside the sweeps. An estimate.
    sweeps : tuple of str
        Terminations that are swept.
    asked : float, optional
        Value to ask for, in the unit of the condition; of a temperature, above that of the room.
    elements : mapping
        What the change does to elements of the paper's circuit, beyond what they repeat to.
    others : float
        Standard deviation of the logarithm of every parameter of an effect that the change reaches and that names no response.
    reaches : tuple of str
        Groups of effects that the change reaches.
    predicted : bool
        Whether the models can predict its outcome; otherwise it is listed, never requested, and its sweeps are only stored.
    procedure : str
        Bench procedure that does it, if the bench can.
    either_way : bool
        Whether it leads from one arbitrary state to another, so that a response may have either sign.
    """

    name: str
    action: str
    kind: Kind
    minutes: float
    sweeps: tuple[str, ...] = ("short", "open")
    asked: float | None = None
    elements: Mapping[str, Moved] = field(default_factory=dict)
    others: float = UNREACHED
    reaches: tuple[str, ...] = ()
    predicted: bool = True
    procedure: str = ""
    either_way: bool = False

    @property
    def reaches_motor(self) -> bool:
        """Whether it measures the motor in another state or circuit, in which an effect outside the catalogue may deviate from every model."""
        return self.kind == "sweep" or bool(self.elements)

    @property
    def may_change_nothing(self) -> bool:
        """Whether the motor may be unchanged under it; with a change of temperature it never is, because of the copper."""
        return bool(self.elements) and self.name != "second-temperature"

    @property
    def unit(self) -> str:
        """Of the value that goes with it; empty without one."""
        setting = CONDITIONS.get(self.name)
        return "" if setting is None else setting.unit


# Changes of insulation, iron and mechanics, which cannot be predicted better than this.
_WARM = {
    "La": Moved(0.0, 0.01),
    "Ca": Moved(0.01, 0.015),
    "Cr": Moved(0.01, 0.02),
    "Cf": Moved(0.01, 0.02),
    "Rr": Moved(0.0, 0.15),
    "Lr": Moved(0.0, 0.02),
}
_BIASED = {"Ra": Moved(0.0, 0.01), "La": Moved(-0.105, 0.1), "Rr": Moved(0.0, 0.02), "Lr": Moved(0.0, 0.03)}
_TURNED = {"Ra": Moved(0.0, 0.01), "La": Moved(0.0, 0.01), "Cr": Moved(0.0, 0.02), "Rr": Moved(0.0, 0.1), "Lr": Moved(0.0, 0.01)}
_FIELD = {"Ra": Moved(0.0, 0.1), "La": Moved(0.0, 0.1), "Ca": Moved(0.0, 0.03), "Cr": Moved(0.0, 0.01), "Cf": Moved(0.0, 0.01)}
_FOIL = {"Cf": Moved(0.02, 0.015), "Cr": Moved(0.005, 0.01), "Ca": Moved(0.002, 0.003)}
_DRY = {"Cf": Moved(-0.01, 0.02), "Cr": Moved(-0.01, 0.02), "Ca": Moved(-0.01, 0.02), "Rr": Moved(0.0, 0.1)}
# Groups of effects that a change reaches.
COPPER_AND_IRON = ("winding", "connection")
EVERYTHING = (*COPPER_AND_IRON, "rotor", "insulation")

MENU = (
    Option("short-sweep", "join the far terminal to the frame and sweep between the two terminals", "reference", 2.0, ("short",)),
    Option("open-sweep", "leave the far end of the winding open and sweep from the terminal to the frame", "reference", 2.0, ("open",)),
    Option("repeats", "repeat both sweeps twice without touching anything", "reference", 2.0),
    Option("wide-sweep", "sweep as wide as the analyser goes, both terminations", "sweep", 1.0, procedure="wide_sweep"),
    Option(
        "far-end-grounded",
        "tie the far end of the winding to the frame, with the leads and strap of the open-circuit sweep, and sweep from the terminal to the frame",
        "sweep",
        2.0,
        ("open",),
    ),
    Option("dc-resistance", "measure the winding's DC resistance with four wires", "value", 3.0, ()),
    Option("insulation-resistance", "measure the insulation resistance from winding to frame at DC", "value", 3.0, ()),
    Option("repeat-first-sweep", "repeat the first sweep after the last one", "change", 1.0, ("short",), procedure="impedance_only"),
    Option("sweep-downwards", "sweep once more from the top down, or at another level", "change", 1.0),
    Option(
        "shaft-turned",
        "turn the shaft a little and repeat both sweeps",
        "change",
        1.5,
        asked=30.0,
        elements=_TURNED,
        others=0.02,
        reaches=("rotor",),
        either_way=True,
    ),
    Option("contacts-cleaned", "clean and tighten the contacts and repeat both sweeps", "change", 5.0),
    Option(
        "field-winding",
        "open the field winding's terminals (short them if they were open) and repeat both sweeps",
        "change",
        4.0,
        elements=_FIELD,
    ),
    Option("standards", "put a 50 Ohm standard on the fixture in the motor's place and sweep it", "standard", 4.0, asked=50.0),
    Option("fixture-open", "take the motor off the fixture, leave it open and sweep", "standard", 2.0, ("open",)),
    Option("fixture-short", "take the motor off the fixture, put the shorting bar on and sweep", "standard", 2.0, ("short",)),
    Option(
        "fixture-load",
        "put a 50 Ohm standard on the fixture in the motor's place and sweep it",
        "standard",
        3.0,
        ("short",),
        50.0,
    ),
    Option("repeat-compensation", "repeat open, short and load compensation and both sweeps", "change", 6.0),
    Option(
        "longer-lead",
        "add a lead of known inductance between fixture and terminal and repeat both sweeps",
        "change",
        4.0,
        asked=50e-9,
    ),
    Option("longer-strap", "double the length of the strap to the frame and repeat the open-circuit sweep", "change", 4.0, ("open",)),
    Option(
        "known-capacitor",
        "put a capacitor of known value across the analyser's terminals and repeat both sweeps",
        "change",
        4.0,
        asked=100e-12,
    ),
    Option("terminal-block", "lift the lead off the terminal block and sweep the motor without it", "change", 6.0),
    Option(
        "end-turn-touched",
        "tape a strip of foil on the end turns and repeat both sweeps",
        "change",
        15.0,
        elements=_FOIL,
        others=0.03,
        reaches=("winding",),
    ),
    Option(
        "dc-bias",
        "repeat both sweeps with a DC bias through the winding",
        "change",
        6.0,
        asked=1.0,
        elements=_BIASED,
        others=0.03,
        reaches=COPPER_AND_IRON,
    ),
    Option(
        "brushes-lifted",
        "lift the brushes, clip the leads to the commutator bars under them and repeat both sweeps",
        "change",
        10.0,
        predicted=False,
    ),
    Option(
        "second-temperature",
        "warm the motor by 30 K and repeat both sweeps",
        "change",
        24.0,
        asked=30.0,
        elements=_WARM,
        others=0.1,
        reaches=EVERYTHING,
    ),
    Option("rotor-out", "take the rotor out and repeat both sweeps", "change", 60.0, predicted=False),
    Option(
        "dried",
        "dry the motor at 60 - 80 °C, let it cool, and repeat both sweeps",
        "change",
        240.0,
        elements=_DRY,
        others=0.05,
        reaches=("insulation", "rotor"),
    ),
)
BY_NAME: Mapping[str, Option] = {option.name: option for option in MENU}
