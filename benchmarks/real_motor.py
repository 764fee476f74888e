"""`python -m benchmarks.real_motor FILE.csv [--out docs/real_motor.md]`: a measured 1.5 HP machine, from the command's own steps.

Takes a few minutes. FILE is the winding's impedance between its terminals, 100 Hz - 100 MHz; `tests/data/motor_1p5hp_dm_cc_by` has it.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import motoremi as me
from motoremi.data.files import read_impedance
from motoremi.diagnosis.ladder import further
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band

MODES = "winding-modes"
# Fitted by the owners of the data: complex error of their universal-motor model over the whole span.
OWNERS_PERCENT = 21.6


@dataclass(frozen=True)
class Part:
    """A part of the span, what is added there, and how many parameters may be spent on 5 %."""

    title: str
    band_hz: tuple[float, float]
    effects: Sequence[str]
    most: int


PARTS = (
    Part("The winding as a machine", (90.0, 150e3), ("machine-winding",), 12),
    Part("The band of conducted emission", (149e3, 30.1e6), ("lead-inductance", MODES), 20),
    Part("The whole span", (90.0, 110e6), ("machine-winding", MODES), 30),
)


def within(sweep: me.ImpedanceSweep, keep: np.ndarray) -> me.ImpedanceSweep:
    return me.ImpedanceSweep("short", sweep.frequency_hz[keep], sweep.impedance_ohm[keep])


def grown(sweep: me.ImpedanceSweep, effects: Sequence[str]) -> list[me.Fit]:
    """The ladder of the commands `fit` and `add` for each effect."""
    steps = [me.fit(me.dc_motor(), [sweep])]
    for effect in effects:
        steps.append(steps[-1].add(effect))
        if find_effect(effect).effect.describes:
            steps += [fit for portion in further(steps[-1], effect) for fit in portion]
    return steps


def held_out(sweep: me.ImpedanceSweep, part: Part) -> tuple[float, float]:
    """Errors in percent on alternate half-decades that were fitted, and on those that were not."""
    half = np.floor(2 * np.log10(sweep.frequency_hz)).astype(int) % 2 == 0
    fit = grown(within(sweep, half), part.effects)[-1]
    errors = np.abs(fit.model_ohm("short", sweep.frequency_hz) / sweep.impedance_ohm - 1)
    seen, unseen = (100 * float(np.sqrt(np.mean(errors[where] ** 2))) for where in (half, ~half))
    return seen, unseen


def page(path: Path) -> Iterator[str]:
    sweep = read_impedance(path, "short")
    yield from introduction(path, sweep)
    for part in PARTS:
        yield from section(sweep, part)
    yield ""
    yield "## What stays open"
    yield ""
    yield (
        "Modes say that the winding resonates and how strongly, not why; a machine's line, cage and iron are causes, but this one sweep cannot "
        "prove them: with the rotor out the cage would go, with a second termination the capacitance to the frame would be seen for itself. "
        "The copper's resistance hides below the iron's and the cage's already at 100 Hz. "
        "Instrument, calibration and operating state are not documented."
    )


def introduction(path: Path, sweep: me.ImpedanceSweep) -> Iterator[str]:
    yield "# A real machine: how far the catalogue goes"
    yield ""
    yield f"Made by `python -m benchmarks.real_motor {path.name} --out docs/real_motor.md`; nothing in it is written by hand."
    yield ""
    yield (
        f"Data: terminal impedance of a 1.5 HP three-phase induction motor, one line against the other two, {len(sweep)} points over "
        f"{show_band(*sweep.span_hz)}, a subset of 1590. © 2026 Xu Fengyifei, ECE, National University of Singapore, CC BY 4.0, "
        "github.com/Arash279/Link; values to six digits, otherwise unchanged."
    )
    yield ""
    yield (
        "Each part of the span is fitted with `motoremi fit` and `motoremi add`, without start values by hand. Errors are rms of "
        f"|model/measured - 1|; the owners' own model of 14 parameters leaves {OWNERS_PERCENT} % of the whole span (complex)."
    )


def section(sweep: me.ImpedanceSweep, part: Part) -> Iterator[str]:
    low, high = part.band_hz
    some = within(sweep, (sweep.frequency_hz >= low) & (sweep.frequency_hz <= high))
    started = time.perf_counter()
    steps = grown(some, part.effects)
    seconds = time.perf_counter() - started
    yield ""
    yield f"## {part.title}: {show_band(*some.span_hz)}"
    yield ""
    yield f"{len(some)} points; {' and '.join(part.effects)} added to the paper's circuit in {seconds:.0f} s."
    yield ""
    yield "| model | parameters | error (%) |"
    yield "|---|---|---|"
    for fit in steps:
        yield f"| {told(fit)} | {len(fit.parameters)} | {fit.rms_error_percent:.3g} |"
    enough = next((fit for fit in steps if fit.rms_error_percent <= 5), None)
    within_most = min((fit.rms_error_percent for fit in steps if len(fit.parameters) <= part.most), default=np.nan)
    yield ""
    reached = f"5 % are reached with {len(enough.parameters)} parameters" if enough is not None else "5 % are not reached"
    yield f"{reached}; with at most {part.most} parameters {within_most:.3g} % are left."
    last = next((fit for fit in steps if fit is enough), steps[-1])
    yield ""
    yield from parameter_table(last)
    seen, unseen = held_out(some, part)
    yield f"Fitted to every other half-decade only, the same steps leave {seen:.3g} % there and {unseen:.3g} % in those left out."
    yield largest_errors(last)


def parameter_table(fit: me.Fit) -> Iterator[str]:
    """Each parameter with its error bar and meaning, and what the data leave open."""
    yield f"Parameters of {told(fit)}:"
    yield ""
    yield "| parameter | value | error bar | is |"
    yield "|---|---|---|---|"
    reasons = {parameter.name: parameter.reason for parameter in fit.motor.parameters}
    for name, value, bar in fit.rows():
        yield f"| {name} | {value} | {bar} | {reasons[name]} |"
    loose = fit.undetermined()
    yield ""
    yield f"Not determined: {', '.join(loose)}." if loose else "All of them are determined."


def largest_errors(fit: me.Fit) -> str:
    """Where the circuit errs most, in words."""
    errors = np.abs(fit.errors()["short"])
    frequency_hz = fit.measurement.sweeps[0].frequency_hz
    places = ", ".join(f"{show(float(frequency_hz[i]), 'Hz')} ({100 * errors[i]:.2g} %)" for i in sorted(np.argsort(-errors)[:4]))
    return f"Largest errors: {places}."


def told(fit: me.Fit) -> str:
    """The model in words, modes and what else occurs twice counted."""
    return " + ".join(["the paper's circuit", *(_counted(name, count) for name, count in Counter(fit.effects).items())])


def _counted(name: str, count: int) -> str:
    if name == MODES:
        return f"{count} mode{'s' if count > 1 else ''}"
    return name if count == 1 else f"{count} x {name}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", type=Path)
    parser.add_argument("--out", type=Path, help="write the page here instead of printing it")
    arguments = parser.parse_args()
    write(page(arguments.path), arguments.out)


def write(lines: Iterable[str], out: Path | None) -> None:
    """A page to a file, or to standard output."""
    text = "\n".join(lines) + "\n"
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
