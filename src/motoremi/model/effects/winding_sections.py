"""A winding in sections that are coupled by their flux; its limits are the lumped circuit and the uniform line."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from motoremi.model.effects import rational_starts
from motoremi.model.effects.effect import Effect
from motoremi.model.effects.start import Scale
from motoremi.model.effects.winding import END_SHARE, NO_END_SHARE
from motoremi.model.motor import Motor
from motoremi.model.parameter import Parameter


def _sections(motor: Motor, place: str, parameters: Mapping[str, Parameter]) -> Motor:
    # A capacitance that is already distributed is divided into the sections; otherwise a share of Cf is.
    share = None if motor.spread is not None else motor.distribution or parameters["share"]
    ends = None if share is None else motor.ends or parameters["end_share"]
    return dataclasses.replace(motor, distribution=share, ends=ends, coupled=(parameters["sections"], parameters["coupling"]))


EFFECTS = (
    Effect(
        name="winding-sections",
        group="winding",
        kin="winding-resonance",
        title="a winding in sections: flux that links neighbours, capacitance to the frame, between turns and between sections",
        formula=(
            "1 / (1 / inv(Y)[0, 0] + s * end_share * Ca), "
            "Y = A.T @ (inv(Ra / n * I + s * La / sum(T) * T) + n * s * (1 - end_share) * Ca * I) @ A + share * s * Cf / n * W, n = sections"
        ),
        parameters=(
            Parameter("share", "", 0.002, 0.999, "share of Cf that is not at the far end; none of its own in a line that is cut into sections"),
            Parameter("sections", "", 1.0, 128.0, "coils in series; 1 is the lumped circuit, many are a line", vary=False),
            Parameter(
                "coupling",
                "",
                -0.9,
                0.98,
                "of neighbours, to the power of their distance for others: coils of one slot 0.9; opposed poles below 0",
                "linear",
            ),
            END_SHARE,
        ),
        limit="sections -> 1, share -> 0",
        limit_values={"share": 1e-12, "sections": 1.0, "coupling": 0.3, "end_share": NO_END_SHARE},
        signature="a row of resonances that crowd less than a line's: linked flux leaves the higher ones less inductance",
        look_alikes=("distributed-winding", "machine-winding", "second-resonance"),
        deciding="count the coils; sweep from well below the first resonance to several beyond it, once with the far end open",
        source=(
            "sections with mutual inductance: Abetti and Maginniss, AIEE Trans. 72 (1953) 495 (not read again: unconfirmed); "
            "that coupling is a power of distance is an assumption"
        ),
        change=_sections,
        starts=tuple(
            {"share": k, "sections": 8.0, "coupling": c, "end_share": NO_END_SHARE, Scale("Ca"): rest}
            for k, rest in ((0.02, 1.0), (0.08, 0.8), (0.25, 0.5), (0.8, 0.3))
            for c in (0.02, 0.5)
        ),
        # Further apart the more there are: on all points the fit compares the numbers between.
        tried={"sections": (2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0)},
        reader=rational_starts.winding_sections,
        # The coupling of sections changes the inductance between low frequency and the first resonance.
        shows_below_hz=20e3,
        hides=("Ra",),
    ),
)
