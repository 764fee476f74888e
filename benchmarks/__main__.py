"""`python -m benchmarks [--motors 100] [--budget 1.5] [--out FOLDER]`: comparison of the fitter with other methods, and how its cost grows."""

from __future__ import annotations

import argparse
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import motoremi as me
from benchmarks.growth import growth, refits
from benchmarks.motors import GROUPS, NAMES, cases, chi_squared
from benchmarks.packages import MORE_TIME, MOTORS, PACKAGES
from benchmarks.peers import HALVED, PEERS, run_peer
from motoremi.fitting.paper_colony import paper_colony

OURS = "motoremi"
PAPER = "the paper's colony, 200 loops"


def run_ours(case) -> tuple[bool, float, int]:
    """Our fitter as users call it: it does not know the target and stops by its own criterion."""
    sweeps = case.sweeps
    started = time.process_time()
    fit = me.fit(me.dc_motor(), sweeps, bounds=case.bounds, analyser="none", seed=case.number)
    spent = time.process_time() - started
    found = np.log([fit.parameters[name] for name in NAMES])
    return bool(chi_squared(case, found) <= 1.1 * chi_squared(case, case.truth)), spent, fit.evaluations


def run_paper(case) -> tuple[bool, float, int]:
    """The algorithm as printed in the paper."""
    from motoremi.data.measurement import Measurement
    from motoremi.fitting.problem import Problem

    problem = Problem(me.dc_motor(), Measurement.of(case.sweeps, "none"), case.bounds, weights="log")
    started = time.process_time()
    outcome = paper_colony(problem, np.random.default_rng(case.number), loops=200)
    spent = time.process_time() - started
    found = np.array([problem.named(outcome.u)[name] for name in NAMES])
    return bool(chi_squared(case, np.log(found)) <= 1.1 * chi_squared(case, case.truth)), spent, outcome.evaluations


def run_one(method: str, group: str, count: int, budget_s: float) -> tuple[str, str, list[tuple[bool, float, int]]]:
    """All results of one method for one group; runs in a process of its own."""
    members = list(cases(group, count))
    if method == OURS:
        run_ours(members[0])  # imports and costs of the first call do not count
        return method, group, [run_ours(case) for case in members]
    if method == PAPER:
        return method, group, [run_paper(case) for case in members[: max(5, count // 20)]]
    if method in PACKAGES:
        return method, group, [run_peer(PACKAGES[method], case, MORE_TIME[method] * budget_s) for case in members[: MOTORS[method]]]
    return method, group, [run_peer(PEERS[method], case, budget_s) for case in members[:: 2 if method in HALVED else 1]]


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
    started = time.monotonic()
    methods = [OURS, *PEERS, PAPER, *PACKAGES]
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
    lines += [
        "",
        "Success: chi-squared within 1.1 of that at the truth. ERT: expected running time, all time spent over successes. Processor time.",
        f"Every other method had {options.budget:g} s per motor and was stopped as soon as it had succeeded; ours was not. Slow methods were run "
        f"on some of the motors only (successes/runs): {', '.join(HALVED)} on every second one.",
        "Packages with a circuit language of their own were given only the open-circuit sweep, because they cannot fit two sweeps that share "
        "parameters: "
        + ("; ".join(f"{name} {MOTORS[name]} motors, {MORE_TIME[name] * options.budget:g} s" for name in PACKAGES) or "none is installed")
        + ".",
        "",
    ]
    for group in GROUPS:
        best = min([*PEERS, *PACKAGES], key=lambda method: table[method, group]["ert_ms"])
        ratio = table[best, group]["ert_ms"] / table[OURS, group]["ert_ms"]
        lines.append(f"- {group}: the expected running time of the best other method ({best}) is {ratio:.1f} times ours")
    lines += ["", *growth(), "", *refits(), ""]
    memory_mb = [resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    lines += [
        f"Peak memory: {memory_mb[0]:.0f} MB of the main process, which fits and draws; {memory_mb[1]:.0f} MB of the largest process of a method, "
        f"including the other packages. The whole run took {(time.monotonic() - started) / 60:.0f} minutes with {options.jobs} processes."
    ]
    text = "\n".join(lines) + "\n"
    (options.out / "fitters.md").write_text(text)
    picture(table, methods, options.out / "fitters.png")
    print(text)


if __name__ == "__main__":
    main()
