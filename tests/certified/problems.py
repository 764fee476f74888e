"""The certified motors: what each problem is. `python tests/certified/problems.py` drew the sweeps once; they are data now.

Motors come from the benchmark's groups: *hard* is lightly damped (Ra 0.02 - 20 Ohm), *damped* has Ra of 10 - 200 Ohm, and *wide* is the
motors of *hard* behind wider bounds, so that without bounds the two are one.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
POINTS = 201
BENCH, INSTRUMENT = 0.01, 6e-5  # relative noise: of the benchmark, and of a 4294A's own export

# name: group, number of the motor within it, noise, effect, its true parameters.
PROBLEMS: dict[str, tuple[str, int, float, str, dict[str, float]]] = {
    "hard-0-bench": ("hard", 0, BENCH, "", {}),
    "hard-3-bench": ("hard", 3, BENCH, "", {}),
    "wide-7-bench": ("wide", 7, BENCH, "", {}),
    "damped-0-bench": ("damped", 0, BENCH, "", {}),
    "hard-5-instrument": ("hard", 5, INSTRUMENT, "", {}),
    "wide-9-instrument": ("wide", 9, INSTRUMENT, "", {}),
    "damped-4-instrument": ("damped", 4, INSTRUMENT, "", {}),
    "damped-4-terminal-bench": ("damped", 4, BENCH, "terminal-capacitance", {"capacitance_f": 12e-12, "tan_delta": 0.02}),
    "hard-8-lead-instrument": ("hard", 8, INSTRUMENT, "lead-inductance", {"resistance_ohm": 0.15, "inductance_h": 150e-9, "skin_ohm": 0.02}),
    "damped-6-core-loss-instrument": ("damped", 6, INSTRUMENT, "core-loss", {"resistance_ohm": 3000.0}),
    "hard-4-core-loss-bench": ("hard", 4, BENCH, "core-loss", {"resistance_ohm": 2000.0}),
    "damped-9-laminations-instrument": ("damped", 9, INSTRUMENT, "eddy-laminations", {"share": 0.4, "corner_hz": 4e5}),
}


def draw() -> None:
    """Write the sweeps, with nine digits."""
    import mpmath
    import numpy as np

    sys.path[:0] = [str(HERE), str(HERE.parents[1])]
    from certify import impedances

    from benchmarks.motors import NAMES, cases

    for index, (name, (group, number, noise, effect, extra)) in enumerate(PROBLEMS.items()):
        *_, case = cases(group, number + 1, points=POINTS)
        values = [*np.exp(case.truth).tolist(), *extra.values()]
        rng = np.random.default_rng((2011, index))
        folder = HERE / name
        folder.mkdir(exist_ok=True)
        exact = np.array([[complex(z) for z in impedances(effect, [mpmath.mpf(v) for v in values], mpmath.mpf(f))] for f in case.frequency_hz])
        for column, termination in enumerate(("short", "open")):
            z = exact[:, column] * (1 + noise * (rng.normal(size=POINTS) + 1j * rng.normal(size=POINTS)))
            truth = ", ".join(f"{n} {v:.6g}" for n, v in zip((*NAMES, *extra), values, strict=True))
            lines = [f"# truth: {truth}", "frequency_hz,resistance_ohm,reactance_ohm,sigma_relative"]
            lines += [f"{f:.9g},{w.real:.9g},{w.imag:.9g},{noise:g}" for f, w in zip(case.frequency_hz.tolist(), z.tolist(), strict=True)]
            (folder / f"{termination}.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    draw()
