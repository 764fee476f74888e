"""`python -m benchmarks.real_cores FOLDER [--out docs/cores.md]`: published measurements of coils, cores, a cable and a choke.

Takes a few minutes. Most of these curves have no clear licence and are not part of motoremi: FOLDER contains those that you downloaded, with the
file names in `CURVES`, which also gives the origin of each; the one with an open licence is in `tests/data`.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import motoremi as me
from benchmarks.page import make
from benchmarks.real_motor import largest_errors, model_name, parameter_table, within
from motoremi.data.files import read_impedance
from motoremi.quantities import show_band

IN_THE_REPOSITORY = Path(__file__).parents[1] / "tests" / "data" / "eth_4294A_inductor"


@dataclass(frozen=True)
class Curve:
    """A measured part, and the physics that it should show.

    Parameters
    ----------
    title, file : str
        `file` is the name in the folder.
    origin : str
        Repository, path and licence.
    analyser : str
        As in `motoremi import --analyser`.
    band_hz : tuple of float
        The part of the span that is used.
    physics : str
        Its materials, and the reason for the limits of the band.
    effects : tuple of str
        Effects that its physics requires, in the order of adding.
    member : str
        Name of the curve within a collection.
    """

    title: str
    file: str
    origin: str
    analyser: str
    band_hz: tuple[float, float]
    physics: str
    effects: tuple[str, ...]
    member: str = ""


COILS = "github.com/ahweyalex/phd_2019, `Matlab/2021_04_01/`, 0.5 in x 0.5 in, {} turns; no licence stated"
CORES = "github.com/ikatkov/ferrite-cores, `{}`; no licence stated"
COPPER_AND_AIR = (
    "Copper and air: skin effect of the wire, and the constant loss angle of enamel and former beside the turns. Below 100 kHz the curve "
    "scatters by 1 to 10 % from point to point and is left out."
)
CURVES = (
    Curve(
        "An air coil of five turns",
        "air_coil_N5.txt",
        COILS.format(5),
        "unknown",
        (1e5, 20e6),
        COPPER_AND_AIR,
        ("skin-effect", "dielectric-loss@Ca"),
    ),
    Curve(
        "An air coil of ten turns",
        "air_coil_N10.txt",
        COILS.format(10),
        "unknown",
        (1e5, 20e6),
        COPPER_AND_AIR,
        ("skin-effect", "dielectric-loss@Ca"),
    ),
    Curve(
        "A binocular core of #43 ferrite",
        "binocular43.s1p",
        CORES.format("binocular43.s1p"),
        "nanovna",
        (1e6, 300e6),
        "NiZn ferrite on which nearly all flux runs: its permeability relaxes, with more than one time constant.",
        ("permeability-relaxation", "permeability-relaxation"),
    ),
    Curve(
        "A toroid of #43 ferrite",
        "ft37-43-torroid.s1p",
        CORES.format("ft37-43-torroid.s1p"),
        "nanovna",
        (1e6, 300e6),
        "The same ferrite. Below 1 MHz the impedance is some milliohms to an ohm, which this analyser cannot tell from zero.",
        ("permeability-relaxation", "permeability-relaxation"),
    ),
    Curve(
        "A binocular core of #43 ferrite with four turns",
        "BN43-2402_4t_26AWG.s1p",
        "github.com/in3otd/vectfit_python, `tests/BN43-2402_4t_26AWG.s1p`; repository GPL-2, licence of the data not stated",
        "unknown",
        (3e5, 3e7),
        "The same ferrite below 30 MHz, measured by another person with another network analyser.",
        ("permeability-relaxation", "permeability-relaxation"),
    ),
    Curve(
        "A powder core with two turns",
        "unknown-torroid-15.5x8x6-2-2loops.s1p",
        CORES.format("unknown-torroid-15.5x8x6-2-2loops.s1p"),
        "nanovna",
        (3e6, 60e6),
        "Grains of iron of many sizes in a binder: eddy currents with many time constants. Above 60 MHz the fixture resonates.",
        ("permeability-relaxation",),
    ),
    Curve(
        "A large toroid of #43 ferrite",
        "ft240-43.s1p",
        "github.com/NanoVNA-Saver/nanovna-saver, `tests/data/ft240-43.s1p`; repository GPL-3, what was wound is told by the name of the file only",
        "nanovna",
        (1e6, 1e8),
        "The ferrite of the small toroid in a size whose own dimensions resonate nearer to the band.",
        ("permeability-relaxation", "permeability-relaxation"),
    ),
    Curve(
        "A ferrite bead",
        "smd-bead.s1p",
        "github.com/ikatkov/ferrite-beads, `smd-bead.s1p`; repository GPL-3",
        "nanovna",
        (1e6, 1e8),
        "A salvaged bead of unknown make: ferrite around one conductor.",
        ("permeability-relaxation", "permeability-relaxation"),
    ),
    Curve(
        "Two turns on the core of a ballast",
        "transformer.s1p",
        "github.com/ikatkov/transformer-cores, `transformer.s1p`; no licence stated",
        "nanovna",
        (1.5e5, 15e6),
        "Manganese-zinc ferrite from the ballast of a fluorescent lamp. From 0.8 to 20 ohm this analyser may err by 1 to 25 %, most at low "
        "frequencies, and its error has fine structure.",
        ("permeability-relaxation",),
    ),
    Curve(
        "A printed coil of six turns",
        "L1N6ORG.csv",
        "github.com/JCCopyrights/MIF3, `designs/originals/L1N6ORG.csv`; repository GPL-3",
        "unknown",
        (1.5e5, 30e6),
        "Copper tracks and glass-epoxy laminate (Bode 100): skin and proximity effect of flat tracks, the loss of the laminate, and a long track "
        "along which inductance and capacitance are distributed.",
        ("skin-effect", "dielectric-loss@Ca"),
    ),
    Curve(
        "A coaxial cable, far end shorted",
        "RG58C_U_short.s1p",
        "github.com/jnthek/nanovna-codes, `COAX_measurements/RG58C_U_short.s1p`; no licence stated",
        "nanovna",
        (1e7, 1e8),
        "Five metres of RG58: a line with the skin effect of its conductors, behind which there is next to nothing.",
        ("supply-cable",),
    ),
    Curve(
        "A coil with iron, 20 Hz - 1 kHz",
        "E4990A-example1.csv",
        "github.com/mph-/zfitpy, `demo/E4990A-example1.csv`; licence of the data not stated",
        "e4990a",
        (1.0, 1e6),
        "Iron at audio frequencies: eddy currents in sheet and hysteresis, which spread over decades.",
        ("permeability-relaxation", "permeability-relaxation"),
    ),
    Curve(
        "An inductor of 204 uH",
        "impedance.txt",
        "github.com/ethz-pes/impedance_analyzer_4294A_matlab, `data/impedance.txt`; © 2016-2020 ETH Zurich, PES, T. Guillod, BSD 2-clause "
        "(in `tests/data/eth_4294A_inductor`)",
        "4294a",
        (1e3, 1.1e5),
        "Copper: its resistance rises with frequency; what the core adds is not documented.",
        ("skin-effect",),
    ),
    Curve(
        "A common-mode choke (Murata DLW32MH201XK2)",
        "hertz-cmc-curves.v1.json",
        "github.com/OpenConverters/Hertz, `web/public/kelvin/hertz-cmc-curves.v1.json`, common mode; repository MIT, the maker's data",
        "unknown",
        (3e5, 1e8),
        "Ferrite again. Above 100 MHz the choke is a chain of resonances of its winding.",
        ("permeability-relaxation", "permeability-relaxation"),
        "DLW32MH201XK2",
    ),
)


def sweep_of(curve: Curve, path: Path) -> me.ImpedanceSweep:
    """The part of a curve that is used."""
    if curve.member:
        table = json.loads(path.read_text(encoding="utf-8"))["curves"][curve.member]["cm"]
        whole = me.ImpedanceSweep("short", np.array(table["f"]), np.array(table["re"]) + 1j * np.array(table["im"]))
    else:
        whole = read_impedance(path, "short")
    low, high = curve.band_hz
    return within(whole, (whole.frequency_hz >= low) & (whole.frequency_hz <= high))


def page(folder: Path) -> Iterator[str]:
    found = []
    for curve in CURVES:
        place = next((one for one in (folder / curve.file, IN_THE_REPOSITORY / curve.file) if one.is_file()), None)
        if place is None:
            print(f"left out: {curve.file} is not in {folder}; it is {curve.origin}", file=sys.stderr)
        else:
            found.append((curve, place))
    yield "# Real cores, coils and a cable: how far the catalogue goes"
    yield ""
    yield "Made by `python -m benchmarks.real_cores FOLDER --out docs/cores.md`; nothing in it is written by hand."
    yield ""
    yield (
        "Published measurements of parts, one sweep each, of a single winding or line and not of a motor. Curves without a clear licence are not "
        "part of motoremi: `FOLDER` contains the files as downloaded; each section names repository, path and SHA-256. Every part is fitted with "
        "`motoremi fit` and `motoremi add`, without start values by hand, assuming an ideal analyser, so that the error is that of the circuit "
        "alone (rms of |model/measured - 1|). The verdict is that of `motoremi diagnose` for the analyser that was used. "
        "Permittivity and permeability of a ferrite as a material are in [Laws against measured materials](materials.md)."
    )
    summary, sections = [], []
    for curve, path in found:
        line, lines = section(curve, path)
        summary.append(line)
        sections += lines
    yield ""
    yield "| part | error of the paper's circuit (%) | with the effects of its physics (%) | first candidate | verdict |"
    yield "|---|---|---|---|---|"
    yield from summary
    yield from sections
    yield ""
    yield "## Open questions"
    yield ""
    yield (
        "The circuits that follow from the physics describe these parts, but the diagnosis does not always name them. For an air coil, a core with "
        "many time constants imitates skin effect and dielectric loss together, with a slightly smaller error; a sweep of a winding alone is also "
        "compared with these two together, which are more probable. If a sweep far from 50 ohm is declared as measured by a network analyser, the "
        "assumed errors of the analyser describe a part of the impedance, and the circuit then has a larger error than the one fitted here."
    )


def section(curve: Curve, path: Path) -> tuple[str, list[str]]:
    """A row of the summary, and the section."""
    sweep = sweep_of(curve, path)
    steps = [me.fit(me.dc_motor(), [sweep], analyser="none")]
    for effect in curve.effects:
        steps.append(steps[-1].add(effect))
    diagnosis = me.diagnose(me.fit(me.dc_motor(), [sweep], analyser=curve.analyser))
    leading = diagnosis.candidates[0] if diagnosis.candidates else None
    first = "none" if leading is None else f"{leading.effect}, {leading.fit.rms_error_percent:.3g} %"
    named = f"{diagnosis.verdict} ({', '.join(diagnosis.effects)})" if diagnosis.effects else diagnosis.verdict
    last = steps[-1]
    row = f"| {curve.title} | {steps[0].rms_error_percent:.3g} | {last.rms_error_percent:.3g} | {first} | {named} |"
    return row, [
        "",
        f"## {curve.title}",
        "",
        f"{curve.origin}. SHA-256 `{hashlib.sha256(path.read_bytes()).hexdigest()}`. {len(sweep)} points, {show_band(*sweep.span_hz)}.",
        "",
        f"{curve.physics}",
        "",
        "| model | parameters | error (%) |",
        "|---|---|---|",
        *(f"| {model_name(fit)} | {len(fit.parameters)} | {fit.rms_error_percent:.3g} |" for fit in steps),
        "",
        *parameter_table(last),
        largest_errors(last),
        "",
        f"`motoremi diagnose` ({curve.analyser}): {named}, confidence {diagnosis.confidence:.2g}; first candidate {first}. "
        + sentences(diagnosis.reasons),
    ]


def sentences(reasons: Sequence[str]) -> str:
    """What a diagnosis gives as reasons."""
    return " ".join(f"{reason[:1].upper()}{reason[1:]}." for reason in reasons)


if __name__ == "__main__":
    make(__doc__, page, "folder")
