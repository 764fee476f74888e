"""How processor time grows with the number of points, ants and candidates; and the time to add an effect and fit again."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from unittest.mock import patch

import numpy as np

import motoremi as me
from benchmarks.motors import cases
from motoremi.data.measurement import Measurement
from motoremi.data.sweep import ImpedanceSweep
from motoremi.fitting import aco_r, paper_colony
from motoremi.fitting.problem import Problem
from motoremi.fitting.search import SEARCH_POINTS
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.hidden_effects import ANALYSER_FAULTS, HIDDEN_EFFECTS, OUTSIDE_EFFECTS, split_effects
from motoremi.simulate.simulated_motor import SimulatedMotor

POINTS = (201, 801, 3201, 12801)
COUNTS = (30, 60, 120, 240)
LOOPS = 10
MOTORS = 3


def spent_ms(work: Callable[[], object], repeat: int = 5) -> float:
    """Processor time, the minimum of several repeats."""
    spans = []
    for _ in range(repeat):
        started = time.process_time()
        work()
        spans.append(time.process_time() - started)
    return 1e3 * min(spans)


def series(title: str, sizes: Sequence[int], costs: Sequence[float]) -> list[str]:
    """A table row: costs, and the exponent of the best power law of size."""
    slope = float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])
    cells = " | ".join(f"{size}: {cost:.1f}" for size, cost in zip(sizes, costs, strict=True))
    return [f"| {title} | {cells} | {slope:.2f} |"]


def growth() -> list[str]:
    """The table of costs against sizes."""
    lines = ["| milliseconds as a function of | | | | | exponent (1 is linear) |", "|---" * 6 + "|"]
    costs = []
    for points in POINTS:
        case = next(cases("damped", 1, points=points))
        costs.append(spent_ms(lambda case=case: me.fit(me.dc_motor(), case.sweeps, analyser="none")))
    lines += series("points a sweep, one fit", POINTS, costs)
    case = next(cases("damped", 1))
    measurement = Measurement.of(case.sweeps, "none")
    full = Problem(me.dc_motor(), measurement, case.bounds, weights="log")
    thinned = Problem(me.dc_motor(), measurement, points=SEARCH_POINTS, weights="log")

    def printed() -> None:
        with patch.object(paper_colony, "STOP_DEVIATION", 0.0):
            paper_colony.paper_colony(full, np.random.default_rng(1), loops=LOOPS)

    def ours() -> None:
        aco_r.Colony(thinned, np.random.default_rng(1), np.empty((0, 7))).walk(LOOPS)

    for title, module, name, work in (
        (f"ants, {LOOPS} loops of the printed colony, 30 candidates", paper_colony, "ANTS", printed),
        (f"candidates, {LOOPS} loops of the printed colony, 150 ants", paper_colony, "CANDIDATES", printed),
        (f"ants, {LOOPS} generations of our colony, archive of 60", aco_r, "ANTS", ours),
        (f"archive, {LOOPS} generations of our colony, 60 ants", aco_r, "ARCHIVE", ours),
    ):
        costs = []
        for count in COUNTS:
            with patch.object(module, name, count):
                costs.append(spent_ms(work, 3))
        lines += series(title, COUNTS, costs)
    return lines


def simulated(seed: int, effect: str) -> list[ImpedanceSweep]:
    """Three repeats of two sweeps of 401 points, measured by the simulated 4294A on a motor with a hidden effect."""
    in_motor, in_analyser = split_effects((effect,))
    motor, analyser = SimulatedMotor.random(seed, in_motor), SimulatedAnalyser(seed + 1000, faults=in_analyser)
    frequency = np.geomspace(150e3, 30e6, 401)
    return [
        ImpedanceSweep(t, frequency, analyser.measure(t, frequency, motor.impedance(t, frequency), connection=connection, bandwidth_factor=3))
        for connection, t in enumerate(("short", "open"))
        for _ in range(3)
    ]


def refits() -> list[str]:
    """Time of adding each effect to data in which it is hidden: median over motors, and over all effects."""
    lines = [f"| added effect (2 x 401 points, median of {MOTORS} motors with it) | time to fit again, ms | chi2_reduced |", "|---|---|---|"]
    medians = []
    for effect in HIDDEN_EFFECTS:
        if effect in OUTSIDE_EFFECTS:  # not in the catalogue
            continue
        spans, left = [], []
        for seed in range(MOTORS):
            base = me.fit(me.dc_motor(), simulated(seed, effect))
            started = time.process_time()
            left.append(base.add(effect).chi2_reduced)
            spans.append(1e3 * (time.process_time() - started))
        medians.append(float(np.median(spans)))
        where = "analyser" if effect in ANALYSER_FAULTS else "motor"
        lines.append(f"| {effect} ({where}) | {medians[-1]:.0f} | {np.median(left):.2f} |")
    lines.append(f"| **all effects, median; share within 20 ms** | {np.median(medians):.0f} | {np.mean(np.array(medians) < 20):.0%} |")
    return lines
