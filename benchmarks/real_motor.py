"""`python -m benchmarks.real_motor FILE.csv [--out docs/real_motor.md]`: the ladder on the measured 1.5 HP motor, step by step.

Takes several minutes. FILE is the winding's impedance between its terminals, 100 Hz - 100 MHz; `tests/data/motor_1p5hp_dm_cc_by` has it.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import motoremi as me
from motoremi.data.files import read_impedance
from motoremi.data.measurement import Measurement
from motoremi.diagnosis.causal import check_causality
from motoremi.diagnosis.ladder import LEAST_GAIN
from motoremi.diagnosis.motors import MotorBoard
from motoremi.diagnosis.steps import find_steps
from motoremi.fitting.fit import refit_without
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band

EDGES_HZ = (100.0, 2e3, 50e3, 270e3, 3e6, 100e6)
# Fitted by the motor's owners: complex error of their universal-motor model over its two lines of 50 - 270 kHz.
OWNERS_PERCENT = "5 - 14 %"
# What a model is asked to describe. The instrument and its calibration are not documented, and 171 of 1590 points leave structure unseen.
STATED_SIGMA = 0.01
MOST_EFFECTS = 15


@dataclass(frozen=True, eq=False)
class Rung:
    """A model on the way, how it came about and what else was near."""

    fit: me.Fit
    below: Rung | None
    added: str
    parameters: str
    rivals: str

    def path(self) -> list[Rung]:
        """From the base to here."""
        return [*(self.below.path() if self.below else []), self]


def walked(measurement: Measurement) -> Rung:
    """The best model found by adding effects one by one; the best two are carried on at each step, for the first choice may not last."""
    kept = [Rung(me.fit(me.dc_motor(), measurement), None, "the paper's circuit", "", "")]
    for _ in range(MOST_EFFECTS):
        grown = sorted((step for rung in kept for step in one_more(rung)), key=lambda rung: -rung.fit.log_evidence)
        best = grown[0]
        if best.fit.log_evidence - kept[0].fit.log_evidence < LEAST_GAIN:
            break
        kept = [best, *[rung for rung in grown if sorted(rung.fit.effects) != sorted(best.fit.effects)][:1]]
    return kept[0]


def one_more(rung: Rung) -> list[Rung]:
    """The models with one more effect of the motor; the instrument's are sought apart."""
    board = MotorBoard(rung.fit)
    found = sorted(board.added(board.start(), None), key=lambda candidate: -candidate.score)
    ranked = [candidate for candidate in found if find_effect(candidate.effect).effect.group != "instrument"]
    rivals = ", ".join(candidate.effect for candidate in ranked[1:3])
    # The search for candidates is quick; the two that are carried on are searched once more at length.
    searched = [(c, max(c.fit, rung.fit.add(c.effect), key=lambda fit: fit.log_evidence)) for c in ranked[:2]]
    return [Rung(fit, rung, c.effect, dataclasses.replace(c, fit=fit).describe(), rivals) for c, fit in searched]


def errors(fit: me.Fit) -> list[float]:
    """rms error in percent in each band."""
    frequency = fit.measurement.sweeps[0].frequency_hz
    squared = np.abs(fit.errors()["short"]) ** 2
    bands = itertools.pairwise(EDGES_HZ)
    return [100 * float(np.sqrt(np.mean(squared[(frequency >= low) & (frequency <= high)]))) for low, high in bands]


def pruned(fit: me.Fit) -> tuple[me.Fit, list[str]]:
    """The model without the effects that have lost their support, and their names."""
    gone: list[str] = []
    while fit.effects:
        tried = [(effect, refit_without(fit, effect, thorough=False)) for effect in dict.fromkeys(fit.effects)]
        effect, without = max(tried, key=lambda pair: pair[1].log_evidence)
        if fit.log_evidence - without.log_evidence >= LEAST_GAIN:
            break
        gone.append(effect)
        fit = without
    return fit, gone


def row(number: int, rung: Rung) -> str:
    bands = " | ".join(f"{error:.3g}" for error in errors(rung.fit))
    fit = rung.fit
    return f"| {number} | {rung.added} | {fit.rms_error_percent:.3g} | {bands} | {fit.chi2_reduced:.3g} | {rung.parameters} | {rung.rivals} |"


def page(path: Path) -> Iterator[str]:
    sweep = read_impedance(path, "short")
    stated = dataclasses.replace(sweep, sigma_relative=np.full(len(sweep), STATED_SIGMA))
    measurement = Measurement.of([stated], "none")
    yield from introduction(path, sweep)
    yield (
        "| step | added | error (%) | "
        + " | ".join(show_band(a, b) for a, b in itertools.pairwise(EDGES_HZ))
        + (" | chi2 | its parameters | next best |")
    )
    yield "|" + "---|" * (len(EDGES_HZ) + 5)
    path = walked(measurement).path()
    yield from (row(number, rung) for number, rung in enumerate(path))
    last, gone = pruned(path[-1].fit)
    yield ""
    taken_over = f"Unneeded at the end (the others have taken their part over): {', '.join(gone)}."
    yield taken_over if gone else "No step has lost its support at the end."
    if len(path) > MOST_EFFECTS:
        yield f"The walk was stopped after {MOST_EFFECTS} steps; the evidence would carry further ones."
    yield from outcome(last)
    yield from unexplained(last, measurement)


def introduction(path: Path, sweep: me.ImpedanceSweep) -> Iterator[str]:
    yield "# A real motor: how far the ladder goes"
    yield ""
    yield f"Made by `python -m benchmarks.real_motor {path.name} --out docs/real_motor.md`; nothing in it is written by hand."
    yield ""
    yield (
        "Data: terminal impedance of a 1.5 HP three-phase induction motor, one line against the other two, "
        f"{len(sweep)} points over {show_band(*sweep.span_hz)}, a subset of 1590. © 2026 Xu Fengyifei, ECE, National University of Singapore, "
        "CC BY 4.0, github.com/Arash279/Link; values to six digits, otherwise unchanged. "
        "The owner says that instrument file, calibration and operating state are not documented."
    )
    yield ""
    yield (
        f"So no analyser's specification is assumed, and a model is asked to describe the points to {100 * STATED_SIGMA:.0f} % each in real "
        "and imaginary part. "
        "There is only this one sweep, and it is not a DC motor: the paper's winding circuit Ra, La, Ca is the base, and where an effect sits "
        "(which of Ra, La and Ca bends) cannot be told from one sweep. At each step the effect with the best evidence is added, "
        "the two best models being carried on; "
        "start values and ranges of all effects go with the band (six decades) and the impedance. "
        "Errors are rms of |model/measured - 1| in percent."
    )
    yield ""
    yield "## The ladder"
    yield ""


def outcome(fit: me.Fit) -> Iterator[str]:
    yield ""
    yield "## What it reaches"
    yield ""
    yield (
        f"The last model, {len(fit.effects)} effects, leaves {fit.rms_error_percent:.3g} % over the whole span and {errors(fit)[2]:.3g} % over "
        f"{show_band(EDGES_HZ[2], EDGES_HZ[3])}, where the universal-motor model that the owners of the data fitted misses it by "
        f"{OWNERS_PERCENT} (complex)."
    )
    yield ""
    yield "| parameter | value | error bar |"
    yield "|---|---|---|"
    for name, value, bar in fit.rows():
        if value != "-":
            yield f"| {name} | {value} | {bar} |"
    steps = find_steps(fit)
    yield ""
    yield "## The instrument"
    yield ""
    yield (
        "Steps of gain between two neighbouring points, in what the last model leaves over (`motoremi.diagnosis.steps`). The owner of the data "
        "names two that look like range switches, 1417.9 -> 1430.3 Hz and 5.2007 -> 5.2461 MHz; the search is told neither."
    )
    yield ""
    yield from (f"- {step}" for step in steps)
    if not steps:
        yield "- none found"
        return
    yield ""
    yield (
        "These are the instrument's: no circuit turns between two points that lie so close together, and the intervals beside them are smooth. "
        "They are smaller than the 1 % asked of the model."
    )


def unexplained(fit: me.Fit, measurement: Measurement) -> Iterator[str]:
    check = check_causality(measurement).models["short"]
    frequency, error = measurement.sweeps[0].frequency_hz, 100 * np.abs(fit.errors()["short"])
    points = ", ".join(f"{show(float(frequency[i]), 'Hz')} ({error[i]:.2g} %)" for i in sorted(np.argsort(-error)[:6]))
    yield ""
    yield "## What stays unexplained"
    yield ""
    yield (
        f"Left over: {np.sqrt(fit.chi2_reduced):.2g} times the 1 % asked. A free rational model with {check.order} poles leaves "
        f"{check.rms_error_percent:.3g} % ({check.noise_multiple:.2g} times). "
        f"Worst points: {points}."
    )
    yield ""
    yield (
        "Resonances are what the evidence asks for again and again: a winding of many turns has many. Each is a local description, not a "
        "cause; a resonance beyond the sweep's end stands for an inductance. The circuit's own elements have given their part away to them "
        f"(La ends at {show(fit.parameters['La'], 'H')}), so what this page shows is how far the catalogue describes such a sweep, not which "
        "effects this motor has. What would tell more: the other 1419 points, a second "
        "termination (common mode), a second temperature, and a file with the instrument's name and calibration."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", type=Path)
    parser.add_argument("--out", type=Path, help="write the page here instead of printing it")
    arguments = parser.parse_args()
    text = "\n".join(page(arguments.path)) + "\n"
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
