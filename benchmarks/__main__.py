"""`python -m benchmarks [--motors 100] [--budget 1.5] [--out FOLDER]`: the fitter against its peers, and how its cost grows."""

from __future__ import annotations

import argparse
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import motoremi as me
from benchmarks.motors import GROUPS, NAMES, cases, chi_squared
from benchmarks.peers import PEERS, run_peer
from motoremi.fitting.paper import paper_colony
from motoremi.model.effects import find_effect

OURS = "motoremi"
PAPER = "the paper's colony, 200 loops"


def run_ours(case) -> tuple[bool, float, int]:
    """Our fitter as users call it: it is not told the target and stops by its own judgement."""
    sweeps = case.sweeps
    started = time.process_time()
    fit = me.fit(me.dc_motor(), sweeps, bounds=case.bounds, analyser="none", seed=case.number)
    spent = time.process_time() - started
    found = np.log([fit.parameters[name] for name in NAMES])
    return bool(chi_squared(case, found) <= 1.1 * chi_squared(case, case.truth)), spent, fit.evaluations


def run_paper(case) -> tuple[bool, float, int]:
    """The printed algorithm."""
    from motoremi.data.measurement import Measurement
    from motoremi.fitting.problem import Problem

    problem = Problem(me.dc_motor(), Measurement.of(case.sweeps, "none"), case.bounds, weights="log")
    started = time.process_time()
    outcome = paper_colony(problem, np.random.default_rng(case.number), loops=200)
    spent = time.process_time() - started
    found = np.array([problem.named(outcome.u)[name] for name in NAMES])
    return bool(chi_squared(case, np.log(found)) <= 1.1 * chi_squared(case, case.truth)), spent, outcome.evaluations


def run_one(method: str, group: str, count: int, budget_s: float) -> tuple[str, str, list[tuple[bool, float, int]]]:
    """One method on one group, in a process of its own."""
    members = list(cases(group, count))
    if method == OURS:
        run_ours(members[0])  # imports and first-call costs are not the fitter's
        return method, group, [run_ours(case) for case in members]
    if method == PAPER:
        return method, group, [run_paper(case) for case in members[: max(5, count // 10)]]
    return method, group, [run_peer(method, case, budget_s) for case in members]


def summary(results: list[tuple[bool, float, int]]) -> dict[str, float]:
    """Success rate, median time to success, expected running time, median evaluations to success."""
    good = [entry for entry in results if entry[0]]
    total = sum(entry[1] for entry in results)
    return {
        "successes": len(good),
        "runs": len(results),
        "median_ms": 1e3 * float(np.median([entry[1] for entry in good])) if good else np.nan,
        "ert_ms": 1e3 * total / len(good) if good else np.inf,
        "evaluations": float(np.median([entry[2] for entry in good])) if good else np.nan,
    }


def growth() -> list[tuple[str, float]]:
    """Milliseconds of one fit against points, and of adding an effect from its candidates' start values."""
    rows = []

    def timed(work, repeat: int = 5) -> float:
        spans = []
        for _ in range(repeat):
            started = time.process_time()
            work()
            spans.append(time.process_time() - started)
        return 1e3 * min(spans)

    for points in (201, 801, 3201, 12801):
        case = next(cases("damped", 1, points=points))
        rows.append((f"fit, {points} points a sweep", timed(lambda case=case: me.fit(me.dc_motor(), case.sweeps, analyser="none"))))
    case = next(cases("damped", 1))
    base = me.fit(me.dc_motor(), case.sweeps, analyser="none")
    for effect in ("lead-inductance", "core-loss", "eddy-laminations", "second-resonance"):
        starts = len(find_effect(effect).effect.starts)
        rows.append((f"add {effect} ({starts} start values)", timed(lambda effect=effect: base.add(effect, thorough=False))))
    return rows


def picture(table: dict[tuple[str, str], dict[str, float]], methods: list[str], path: Path) -> None:
    """Expected running time of each method in each group."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    for index, group in enumerate(GROUPS):
        heights = [table[method, group]["ert_ms"] for method in methods]
        axes.bar(np.arange(len(methods)) + 0.27 * (index - 1), np.where(np.isfinite(heights), heights, np.nan), width=0.25, label=group)
    axes.set_yscale("log")
    axes.set_xticks(range(len(methods)), methods, rotation=20, ha="right", fontsize=8)
    axes.set_ylabel("expected running time (ms); no bar: never")
    axes.legend()
    figure.savefig(path)


def main() -> None:
    """Print the tables and write them with the plot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motors", type=int, default=100)
    parser.add_argument("--budget", type=float, default=1.5, help="CPU seconds a peer may take for one motor")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/out"))
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    methods = [OURS, *PEERS, PAPER]
    table: dict[tuple[str, str], dict[str, float]] = {}
    with ProcessPoolExecutor(options.jobs) as pool:
        futures = [pool.submit(run_one, method, group, options.motors, options.budget) for group in GROUPS for method in methods]
        for future in futures:
            method, group, results = future.result()
            table[method, group] = summary(results)
            print(f"{group:7s} {method:48s} {table[method, group]}", flush=True)
    lines = ["| method | " + " | ".join(f"{g}: success, median, ERT, evaluations" for g in GROUPS) + " |", "|---" * 4 + "|"]
    for method in methods:
        cells = []
        for group in GROUPS:
            row = table[method, group]
            cells.append(f"{row['successes']:.0f}/{row['runs']:.0f}, {row['median_ms']:.0f} ms, {row['ert_ms']:.0f} ms, {row['evaluations']:.0f}")
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    lines.append("")
    for group in GROUPS:
        best = min(table[method, group]["ert_ms"] for method in PEERS)
        lines.append(f"{group}: best peer's expected running time is {best / table[OURS, group]['ert_ms']:.1f} times ours")
    lines += ["", "| work | ms |", "|---|---|", *(f"| {name} | {value:.1f} |" for name, value in growth())]
    lines += ["", f"peak memory of the main process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"]
    text = "\n".join(lines) + "\n"
    (options.out / "fitters.md").write_text(text)
    picture(table, methods, options.out / "fitters.png")
    print(text)


if __name__ == "__main__":
    main()
