"""`python -m benchmarks.real_motor FILE.csv [--out docs/real_motor.md]`: a measured 1.5 HP machine, from the command's own steps.

Takes a few minutes. FILE is the winding's impedance between its terminals, 100 Hz - 100 MHz; `tests/data/motor_1p5hp_dm_cc_by` has it.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import motoremi as me
from benchmarks.page import make
from motoremi.data.files import read_impedance
from motoremi.diagnosis.ladder_step import further
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band

MODES = "winding-modes"
# Fitted by the owners of the data: complex error of their universal-motor model over the whole span.
OWNERS_PERCENT = 21.6


@dataclass(frozen=True)
class Part:
    """A part of the span, the effects that are added there, and the largest number of parameters for an error of 5 %."""

    title: str
    band_hz: tuple[float, float]
    effects: Sequence[str]
    most: int


PARTS = (
    Part("The winding as a machine", (90.0, 150e3), ("machine-winding",), 12),
    Part("The band of conducted emission", (149e3, 30.1e6), ("lead-inductance", MODES), 20),
    Part("The whole span", (90.0, 110e6), ("machine-winding", "winding-sections", MODES), 30),
)
# Required accuracy, as with `motoremi import --accuracy 5`: no further mode is added below.
ENOUGH_PERCENT = 5.0


def within(sweep: me.ImpedanceSweep, keep: np.ndarray) -> me.ImpedanceSweep:
    stated = {"accuracy_percent": str(ENOUGH_PERCENT)}
    return me.ImpedanceSweep("short", sweep.frequency_hz[keep], sweep.impedance_ohm[keep], metadata=stated)


def fitted(fit: me.Fit) -> int:
    """Number of fitted parameters."""
    return len(fit.parameters) - len(fit.held)


def grown(sweep: me.ImpedanceSweep, effects: Sequence[str]) -> list[me.Fit]:
    """The ladder of the commands `fit` and `add` for each effect."""
    steps = [me.fit(me.dc_motor(), [sweep])]
    for effect in effects:
        steps.append(steps[-1].add(effect))
        if find_effect(effect).effect.describes:
            steps += [fit for portion in further(steps[-1], effect) for fit in portion]
    return steps


def held_out(sweep: me.ImpedanceSweep, part: Part) -> str:
    """Errors on alternate half-decades that were fitted, and on those that were not."""
    number = np.floor(2 * np.log10(sweep.frequency_hz)).astype(int)
    half = number % 2 == 0
    fit = grown(within(sweep, half), part.effects)[-1]
    errors = np.abs(fit.model_ohm("short", sweep.frequency_hz) / sweep.impedance_ohm - 1)

    def percent(where: np.ndarray) -> float:
        return 100 * float(np.sqrt(np.mean(errors[where] ** 2)))

    known = sweep.frequency_hz[half]
    between = ~half & (sweep.frequency_hz > known.min()) & (sweep.frequency_hz < known.max())
    left_out = "; ".join(f"{show_band(*sweep.frequency_hz[number == n][[0, -1]])} {percent(number == n):.3g} %" for n in np.unique(number[~half]))
    return (
        f"Fitted to every other half-decade only, the same steps leave {percent(half):.3g} % there ({fitted(fit)} parameters) and "
        f"{percent(~half):.3g} % in those left out, {percent(between):.3g} % in those of them that lie between fitted ones ({left_out})."
    )


def page(path: Path) -> Iterator[str]:
    sweep = read_impedance(path, "short")
    yield from introduction(path, sweep)
    for part in PARTS:
        yield from section(sweep, part)
    yield ""
    yield "## Open questions"
    yield ""
    yield (
        "Modes describe the resonances of the winding without a cause. Transmission line, cage and iron of the machine are causes, but this one "
        "sweep cannot prove them. A mode within a half-decade without points cannot be determined, and one that is fitted there is worse than "
        "none. A measurement without the rotor would exclude the cage; a second termination would show the capacitance to the frame separately. "
        "Already at 100 Hz the resistance of the copper is small compared with that of iron and cage. "
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
        f"Each part of the span is imported with `--accuracy {ENOUGH_PERCENT:g}` and fitted with `motoremi fit` and `motoremi add`, without start "
        "values by hand. Parameters that the data do not determine are kept fixed: a resistance without influence at the low end of its range, the "
        "number of sections at a whole number. Errors are rms of "
        f"|model/measured - 1|; the model of the data's authors, with 14 parameters, has {OWNERS_PERCENT} % over the whole span (complex)."
    )


def section(sweep: me.ImpedanceSweep, part: Part) -> Iterator[str]:
    low, high = part.band_hz
    some = within(sweep, (sweep.frequency_hz >= low) & (sweep.frequency_hz <= high))
    started = sum(os.times()[:4])
    steps = grown(some, part.effects)
    seconds = sum(os.times()[:4]) - started
    yield ""
    yield f"## {part.title}: {show_band(*some.span_hz)}"
    yield ""
    yield f"{len(some)} points; {' and '.join(part.effects)} added to the paper's circuit in {seconds:.0f} s of one core."
    yield ""
    yield "| model | fitted parameters | error (%) |"
    yield "|---|---|---|"
    for fit in steps:
        yield f"| {model_name(fit)} | {fitted(fit)} | {fit.rms_error_percent:.3g} |"
    enough = next((fit for fit in steps if fit.rms_error_percent <= ENOUGH_PERCENT), None)
    within_most = min((fit.rms_error_percent for fit in steps if fitted(fit) <= part.most), default=np.nan)
    yield ""
    reached = f"5 % are reached with {fitted(enough)} parameters" if enough is not None else "5 % are not reached"
    yield f"{reached}; with at most {part.most} parameters {within_most:.3g} % are left."
    last = next((fit for fit in steps if fit is enough), steps[-1])
    yield ""
    yield from parameter_table(last)
    yield held_out(some, part)
    yield largest_errors(last)


def parameter_table(fit: me.Fit) -> Iterator[str]:
    """Each parameter with its error bar and the reason of its range, and the parameters that the data do not determine."""
    yield f"Parameters of {model_name(fit)}:"
    yield ""
    yield "| parameter | value | error bar | range |"
    yield "|---|---|---|---|"
    reasons = {parameter.name: parameter.reason for parameter in fit.motor.parameters}
    for name, value, bar in fit.rows():
        yield f"| {name} | {value} | {bar} | {reasons[name]} |"
    loose = fit.undetermined()
    yield ""
    yield f"Not determined: {', '.join(loose)}." if loose else "All of them are determined."


def largest_errors(fit: me.Fit) -> str:
    """The frequencies with the largest errors, as a sentence."""
    sweep = fit.measurement.sweeps[0]
    errors, frequency_hz = np.abs(fit.errors()[sweep.termination]), sweep.frequency_hz
    places = ", ".join(f"{show(float(frequency_hz[i]), 'Hz')} ({100 * errors[i]:.2g} %)" for i in sorted(np.argsort(-errors)[:4]))
    return f"Largest errors: {places}."


def model_name(fit: me.Fit) -> str:
    """Name of the model, with the number of effects that occur several times."""
    return " + ".join(["the paper's circuit", *(_counted(name, count) for name, count in Counter(fit.effects).items())])


def _counted(name: str, count: int) -> str:
    if name == MODES:
        return f"{count} mode{'s' if count > 1 else ''}"
    return name if count == 1 else f"{count} x {name}"


if __name__ == "__main__":
    make(__doc__, page, "path")
