"""`python -m benchmarks.real_windings FOLDER [--out docs/real_windings.md]`: the windings of a real induction motor, sound and with shorted turns.

Takes seven minutes on two cores. The curves have no licence and are not part of motoremi: FOLDER is the folder `Omicron-lab-bode 100 HF` of the
repository that the page names.
"""

from __future__ import annotations

import hashlib
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import motoremi as me
from benchmarks.page import make
from benchmarks.real_cores import sentences
from benchmarks.real_motor import largest_errors, model_name, parameter_table
from motoremi.data.files import read_impedance
from motoremi.data.sweep import Termination
from motoremi.fitting.seen_by import MODES
from motoremi.quantities import show, show_band

BAND_HZ = (150e3, 30e6)
# As with `motoremi import --accuracy 2`: no further mode is added below.
ENOUGH_PERCENT = 2.0


@dataclass(frozen=True)
class Winding:
    """A measured winding, its file within the folder, and the sweep as which it is imported."""

    title: str
    file: str
    termination: Termination = "short"


SOUND, FIVE, TEN = "healthy motor impedance/csv", "Fault maybe 5%/csv", "10%/csv"
WINDINGS = (
    Winding("One phase, sound", f"{SOUND}/L1.csv"),
    Winding("Another phase, sound", f"{SOUND}/L2.csv"),
    Winding("Two phases in series, sound", f"{SOUND}/L1toL2.csv"),
    Winding("The first phase with about 5 % of its turns shorted", f"{FIVE}/L1.csv"),
    Winding("The first phase with about 10 % of its turns shorted", f"{TEN}/L1.csv"),
    Winding("Two phases in series, about 10 % of the turns of one shorted", f"{TEN}/L1toL2.csv"),
    Winding("From the terminal of a phase to the frame, sound", f"{SOUND}/L1toGND.csv", "open"),
    Winding("From the terminal of that phase to the frame, about 10 % of its turns shorted", f"{TEN}/L1toGND.csv", "open"),
)


def page(folder: Path) -> Iterator[str]:
    found = [one for one in WINDINGS if (folder / one.file).is_file()]
    for one in WINDINGS:
        if one not in found:
            print(f"left out: {one.file} is not in {folder}", file=sys.stderr)
    yield "# Windings of a real motor: what a diagnosis makes of them"
    yield ""
    yield "Made by `python -m benchmarks.real_windings FOLDER --out docs/real_windings.md`; nothing in it is written by hand."
    yield ""
    yield (
        "Data: terminal impedances of a three-phase induction motor, measured with a Bode 100 from 10 kHz to 40 MHz, sound and with turns of one "
        "phase shorted; github.com/Refiloe-Leanya/EEE4022S-, no licence stated and therefore not part of motoremi: `FOLDER` is the folder "
        "`Omicron-lab-bode 100 HF` of that repository. None of these curves was used while the catalogue and the search were written; the step "
        "that adds modes was written with the first and the seventh. Windings are imported as short-circuit sweeps, "
        "terminal to frame as open-circuit ones, with "
        f"`--band 150kHz:30MHz --accuracy {ENOUGH_PERCENT:g}` and given to `motoremi diagnose`. Errors are rms of |model/measured - 1|."
    )
    rows, sections = [], []
    for one in found:
        row, lines = section(one, folder / one.file)
        rows.append(row)
        sections += lines
    yield ""
    yield (
        "| winding | error of the paper's circuit (%) | best single effect (%) | with the machine's parts and modes (%) | modes | leads "
        "| verdict | seconds |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    yield from rows
    yield from sections
    yield ""
    yield "## Open questions"
    yield ""
    yield (
        "Modes describe the resonances without a cause: slots, coils and phases resonate against each other, and no geometry is known. The shorted "
        "turns are not named, since the sound winding is no circuit of the catalogue either: compare two windings of one machine instead. "
        "How the motor was connected for the curves to the frame is read from their names."
    )


def section(one: Winding, path: Path) -> tuple[str, list[str]]:
    """A row of the summary, and the section."""
    read = read_impedance(path, one.termination, band=BAND_HZ)
    sweep = replace(read, metadata={**read.metadata, "accuracy_percent": str(ENOUGH_PERCENT)})
    base = me.fit(me.dc_motor(), [sweep])
    started = time.perf_counter()
    found = me.diagnose(base)
    seconds = time.perf_counter() - started
    best, single = found.best, min(found.candidates, key=lambda candidate: candidate.fit.rms_error_percent)
    leads_h = best.parameters.get("lead-inductance.inductance_h")
    leads = "-" if leads_h is None else show(leads_h, "H")
    row = (
        f"| {one.title} | {base.rms_error_percent:.3g} | {single.effect}, {single.fit.rms_error_percent:.3g} | {best.rms_error_percent:.3g} | "
        f"{best.effects.count(MODES)} | {leads} | {found.verdict} | {seconds:.0f} |"
    )
    return row, [
        "",
        f"## {one.title}",
        "",
        f"`{one.file}`, SHA-256 `{hashlib.sha256(path.read_bytes()).hexdigest()}`. {len(sweep)} points, {show_band(*sweep.span_hz)}.",
        "",
        f"Model: {model_name(best)}.",
        "",
        *parameter_table(best),
        largest_errors(best),
        "",
        f"`motoremi diagnose`: {found.verdict}. {sentences(found.reasons)}",
    ]


if __name__ == "__main__":
    make(__doc__, page, "folder")
