"""An effect of your own: a ferrite bead on the lead, an inductance and the bead's loss resistance side by side."""

from motoremi.effects import Effect, Leaf, Parallel, Parameter, Series, laws


def bead(motor, place, parameters):
    """The motor with the bead between it and the analyser."""
    resistance = Leaf("bead R", laws.resistor, (parameters["resistance_ohm"],))
    inductance = Leaf("bead L", laws.inductor, (parameters["inductance_h"],))
    return motor.attached(lambda node: Series((node, Parallel((resistance, inductance)))))


FERRITE_BEAD = Effect(
    name="ferrite-bead", group="connection", title="ferrite bead on the lead",
    formula="Z + s * inductance_h * resistance_ohm / (s * inductance_h + resistance_ohm)",
    parameters=(
        Parameter("resistance_ohm", "Ohm", 5.0, 2000.0, "20 - 600 Ohm for common beads"),
        Parameter("inductance_h", "H", 50e-9, 20e-6, "one turn through a bead"),
    ),
    limit="inductance_h -> 0", limit_values={"resistance_ohm": 100.0, "inductance_h": 1e-15},
    signature="a lead inductance that turns resistive", look_alikes=("lead-inductance",),
    deciding="take the bead off", source="maker's data sheet", change=bead,
    starts=({"resistance_ohm": 100.0, "inductance_h": 1e-6}, {"resistance_ohm": 30.0, "inductance_h": 2e-7}),
)  # fmt: skip
