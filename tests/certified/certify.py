"""Certified values by 60-digit arithmetic: `pip install mpmath; python tests/certified/certify.py` writes certified.json.

Nothing of motoremi is imported. The formulas are the paper's equations (1) and (2) and the effects' in words of circuits; the objective is
the one that motoremi documents for analyser 'none', noise that the file states and no discrepancy:

    sum over points of |ln(Z_measured / Z_model)|^2 / sigma^2  +  sum over an effect's parameters of ((ln p - c) / w)^2,

where c and w are the middle and the half width of the logarithm of the parameter's range (`motoremi effects`). It is minimised over the
logarithms by Gauss-Newton from the truth, with derivatives by central differences that are exact to 38 digits. The standard deviations are
those of the Gauss-Newton matrix.
"""

from __future__ import annotations

import json

import mpmath as mp
from problems import HERE, PROBLEMS

mp.mp.dps = 60
STEP = mp.mpf(10) ** -20
ELEMENTS = ("Ra", "La", "Ca", "Rr", "Lr", "Cr", "Cf")
RANGES = {
    "lead-inductance": {"resistance_ohm": ("1e-3", "5"), "inductance_h": ("15e-9", "5e-6"), "skin_ohm": ("1e-4", "3")},
    "terminal-capacitance": {"capacitance_f": ("0.8e-12", "400e-12"), "tan_delta": ("1e-4", "0.1")},
    "core-loss": {"resistance_ohm": ("30", "100e3")},
    "eddy-laminations": {"share": ("0.01", "0.999"), "corner_hz": ("300", "1e6")},
    "": {},
}


def impedances(effect: str, values: list, frequency_hz) -> tuple:
    """Short- and open-circuit impedance."""
    ra, la, ca, rr, lr, cr, cf, *more = values
    s = 2j * mp.pi * frequency_hz
    coil = s * la
    if effect == "core-loss":
        coil = 1 / (1 / coil + 1 / more[0])
    elif effect == "eddy-laminations":
        share, corner = more
        x = mp.sqrt(s / (mp.pi * corner))
        coil *= 1 - share + share * mp.tanh(x) / x
    winding = 1 / (1 / (ra + coil) + s * ca)
    frame = 1 / (1 / (rr + s * lr + 1 / (s * cr)) + s * cf)
    if effect == "lead-inductance":
        lead = more[0] + s * more[1] + more[2] * mp.sqrt(2 * s / (2 * mp.pi * 10**6))
        return winding + lead, winding + frame + lead
    if effect == "terminal-capacitance":
        terminal = s * more[0] / (s / (2 * mp.pi * 10**6)) ** (2 / mp.pi * mp.atan(more[1]))
        return 1 / (1 / winding + terminal), 1 / (1 / (winding + frame) + terminal)
    return winding, winding + frame


def read(name: str) -> tuple[list, str]:
    """Rows of exact decimals (frequency, short, open, sigma), and the truth."""
    rows = []
    for termination in ("short", "open"):
        lines = (HERE / name / f"{termination}.csv").read_text().splitlines()
        rows.append([[mp.mpf(cell) for cell in line.split(",")] for line in lines if line[0].isdigit()])
        truth = next(line for line in lines if line.startswith("# truth: ")).removeprefix("# truth: ")
    merged = [(f, mp.mpc(r, x), mp.mpc(r2, x2), sigma) for (f, r, x, sigma), (_, r2, x2, _) in zip(*rows, strict=True)]
    return merged, truth


def residuals(effect: str, rows: list, u: list) -> list:
    """Real and imaginary parts over the noise."""
    values = [mp.exp(x) for x in u]
    parts = []
    for f, short, open_, sigma in rows:
        for measured, model in zip((short, open_), impedances(effect, values, f), strict=True):
            deviation = mp.log(measured / model) / sigma
            parts += [deviation.real, deviation.imag]
    return parts


def certify(name: str) -> dict:
    """Minimum, objective and standard deviations of one problem."""
    effect = PROBLEMS[name][3]
    rows, truth = read(name)
    names = [pair.split()[0] for pair in truth.split(", ")]
    u = [mp.log(mp.mpf(pair.split()[1])) for pair in truth.split(", ")]
    priors = [(names.index(key), mp.log(mp.mpf(a)), mp.log(mp.mpf(b))) for key, (a, b) in RANGES[effect].items()]
    for _ in range(400):
        here = residuals(effect, rows, u)
        columns = []
        for index in range(len(u)):
            ahead, behind = (residuals(effect, rows, [x + sign * STEP * (i == index) for i, x in enumerate(u)]) for sign in (1, -1))
            columns.append([(a - b) / (2 * STEP) for a, b in zip(ahead, behind, strict=True)])
        matrix = mp.matrix([[mp.fdot(a, b) for b in columns] for a in columns])
        gradient = mp.matrix([mp.fdot(a, here) for a in columns])
        objective = mp.fdot(here, here)
        for index, low, high in priors:
            centre, width = (low + high) / 2, (high - low) / 2
            matrix[index, index] += width**-2
            gradient[index] += (u[index] - centre) / width**2
            objective += ((u[index] - centre) / width) ** 2
        step = mp.lu_solve(matrix, -gradient)
        u = [x + dx for x, dx in zip(u, step, strict=True)]
        length = mp.sqrt(-(gradient.T * step)[0])
        if length < mp.mpf(10) ** -18:
            break
    else:
        raise SystemExit(f"{name} did not converge: {mp.nstr(length, 5)}")
    covariance = matrix**-1
    deviation = [mp.sqrt(covariance[i, i]) for i in range(len(u))]
    keys = [*ELEMENTS, *(f"{effect}.{key}" for key in names[7:])]
    return {
        "effect": effect,
        "objective": mp.nstr(objective, 18),
        "parameters": {key: mp.nstr(mp.exp(x), 18) for key, x in zip(keys, u, strict=True)},
        "sigma": {key: mp.nstr(mp.exp(x) * d, 12) for key, x, d in zip(keys, u, deviation, strict=True)},
    }


if __name__ == "__main__":
    found = {}
    for problem in PROBLEMS:
        found[problem] = certify(problem)
        print(problem, found[problem], flush=True)
    (HERE / "certified.json").write_text(json.dumps(found, indent=1) + "\n")
