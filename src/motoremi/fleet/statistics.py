"""Statistics over a fleet: distributions, drift, outliers, limits from a golden set."""

from __future__ import annotations

import fnmatch
import re
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from scipy import stats

from motoremi.arrays import FloatArray, JsonDict
from motoremi.errors import BadInput
from motoremi.model.motor import BASE_PARAMETERS
from motoremi.report.words import findings_of, serious_of

# Robust distance from the median, in standard deviations, beyond which a motor is an outlier: one in 15 000 of a normal distribution.
OUTLIER = 4.0
# Significance level of a drift, for all parameters and both axes together.
DRIFT_P = 0.01
# Limits contain 95 % of motors like the golden ones, with 95 % confidence (two-sided normal tolerance interval, Howe 1969).
CONTENT, CONFIDENCE = 0.95, 0.95
FEWEST = 5


@dataclass(frozen=True)
class _Row:
    """The values of one session that are used here."""

    session: str
    time: float
    serial: float
    values: dict[str, float]
    # Relative standard deviation of each value by its own fit.
    sigma: dict[str, float]


def _relative_sigma(entry: JsonDict, value: float) -> float:
    """Standard deviation of a value relative to it; zero if none is stored."""
    sigma = entry.get("sigma")
    return abs(float(sigma) / value) if sigma is not None and np.isfinite(sigma) and value else 0.0


def fleet_figures(results: Iterable[JsonDict], golden: str | None = None) -> JsonDict:
    """The fleet's figures.

    Parameters
    ----------
    results : iterable of dict
        Results of `work`.
    golden : str, optional
        Pattern of session names (`golden/*`) whose motors are known to be good.

    Returns
    -------
    dict
        `counts`, `diagnosed` (sessions in which effects and findings were looked for), `verdicts`, `effects`, `findings` (each serious one with its
        sessions), `parameters` (n, median, robust spread, quantiles), `undetermined` (sessions whose data do not determine a parameter, which are
        not compared by it), `drift`, `outliers`, `limits`, `no_limits` (why there are none although golden sessions were named, else empty),
        `beyond_limits`, `troubles`; and `values`, the columns behind them, with `sigma`, their standard deviations, and `answers`, the verdict,
        effects and confidence of each session that was diagnosed.

    Raises
    ------
    BadInput
        If the pattern matches no session.
    """
    rows: list[_Row] = []
    units: dict[str, str] = {}
    verdicts: Counter[str] = Counter()
    effects: Counter[str] = Counter()
    findings: dict[str, list[str]] = defaultdict(list)
    undetermined: dict[str, list[str]] = defaultdict(list)
    troubles: list[JsonDict] = []
    answers: dict[str, JsonDict] = {}
    for result in results:
        if result["status"] != "done":
            troubles.append({"session": result["session"], "status": result["status"], "trouble": result["trouble"]})
            continue
        diagnosis = result.get("diagnosis")
        if diagnosis is not None:
            verdicts[diagnosis["verdict"]] += 1
            effects.update(diagnosis["effects"])
            answers[result["session"]] = {key: diagnosis.get(key) for key in ("verdict", "effects", "confidence")}
            for identifier in dict.fromkeys(finding["id"] for finding in serious_of(findings_of(diagnosis))):
                findings[identifier].append(result["session"])
        best = result["best"]
        if not best["converged"]:
            troubles.append({"session": result["session"], "status": "done", "trouble": "the fit did not converge: left out of the figures"})
            continue
        units.update({name: entry["unit"] for name, entry in best["parameters"].items()})
        # Results that an earlier version stored do not have them.
        for name in best.get("undetermined", ()):
            undetermined[name].append(result["session"])
        values = {name: float(entry["value"]) for name, entry in best["parameters"].items() if entry["value"] > 0}
        sigma = {name: _relative_sigma(best["parameters"][name], value) for name, value in values.items()}
        figures = {**values, "error": best["rms_error_percent"]}
        rows.append(_Row(result["session"], _seconds(result["time"]), _number(result["serial"]), figures, {**sigma, "error": 0.0}))
    units["error"] = "%"
    columns = _columns(rows)
    own = {row.session: row.sigma for row in rows}
    chosen = set() if golden is None else golden_sessions([*own, *(str(trouble["session"]) for trouble in troubles)], golden)
    limits = _limits(columns, chosen)
    return {
        "schema": "motoremi.fleet/1",
        "counts": {"sessions": len(rows) + len(troubles), "in_the_figures": len(rows), "troubled": len(troubles)},
        "diagnosed": verdicts.total(),
        "verdicts": dict(verdicts.most_common()),
        "effects": dict(effects.most_common()),
        "findings": dict(sorted(findings.items(), key=lambda entry: -len(entry[1]))),
        "parameters": {name: {"unit": units[name], **_distribution(column)} for name, column in columns.items()},
        "drift": _drift(rows, columns),
        "undetermined": dict(undetermined),
        "outliers": _outliers(columns, own),
        "golden": golden,
        "limits": limits,
        "no_limits": "" if golden is None or limits else _too_few(len(chosen), len(chosen & own.keys())),
        "beyond_limits": _beyond(columns, limits, own),
        "troubles": troubles,
        "values": {name: dict(column) for name, column in columns.items()},
        "sigma": {
            name: {session: value * own[session][name] for session, value in column.items()} for name, column in columns.items() if name != "error"
        },
        "answers": answers,
        "times": {row.session: row.time for row in rows if np.isfinite(row.time)},
        "serials": {row.session: row.serial for row in rows if np.isfinite(row.serial)},
    }


def golden_sessions(sessions: Iterable[str], golden: str) -> set[str]:
    """The sessions that a pattern matches.

    Raises
    ------
    BadInput
        If it matches none.
    """
    names = sorted(sessions)
    found = {name for name in names if fnmatch.fnmatchcase(name, golden)}
    if not found and names:
        raise BadInput(
            f"the pattern {golden!r} of golden sessions matches none of the {len(names)}, which have names such as {names[0]!r}: correct it"
        )
    return found


def _too_few(named: int, used: int) -> str:
    """Why there are no limits."""
    gave = f"{used} of the {named} golden motors gave a result" if used < named else f"there are {used} golden motors"
    return f"{gave}, and at least {FEWEST} are needed"


def _columns(rows: list[_Row]) -> dict[str, dict[str, float]]:
    """Session -> value of each parameter; the motor's own first."""
    columns: dict[str, dict[str, float]] = defaultdict(dict)
    for name in (*(parameter.name for parameter in BASE_PARAMETERS), "error"):
        columns[name] = {}
    for row in rows:
        for name, value in row.values.items():
            columns[name][row.session] = value
    return {name: column for name, column in columns.items() if column}


def _distribution(column: dict[str, float]) -> JsonDict:
    values = np.array(list(column.values()))
    low, first, median, third, high = np.quantile(values, (0.05, 0.25, 0.5, 0.75, 0.95)).tolist()
    return {
        "n": len(values),
        "median": median,
        "spread_percent": 100 * _robust_sigma(np.log(values)),
        "q05": low,
        "q25": first,
        "q75": third,
        "q95": high,
    }


def _robust_sigma(values: FloatArray) -> float:
    """Standard deviation from the median absolute deviation."""
    return float(1.4826 * np.median(np.abs(values - np.median(values))))


def _drift(rows: list[_Row], columns: dict[str, dict[str, float]]) -> list[JsonDict]:
    """Parameters that depend on time or serial number: Theil-Sen slope, Kendall's tau, p corrected for the number of tests (Holm)."""
    found: list[JsonDict] = []
    for axis, places in (("time", {row.session: row.time for row in rows}), ("serial", {row.session: row.serial for row in rows})):
        for name, column in columns.items():
            pairs = [(places[session], value) for session, value in column.items() if np.isfinite(places[session])]
            if len(pairs) < FEWEST or len({x for x, _ in pairs}) < 3:
                continue
            x, y = np.array(pairs).T
            tau, p = stats.kendalltau(x, y)
            # Thousands of pairs are enough for a slope; all pairs of a large fleet would not fit into memory.
            step = max(1, len(x) // 2000)
            slope = float(stats.theilslopes(np.log(y[::step]), x[::step])[0])
            total = slope * float(np.ptp(x))
            found.append(
                {"parameter": name, "along": axis, "n": len(x), "tau": float(tau), "p": float(p), "change_percent": 100 * float(np.expm1(total))}
            )
    found.sort(key=lambda entry: entry["p"])
    significant = []
    for rank, entry in enumerate(found):
        if not entry["p"] * (len(found) - rank) < DRIFT_P:
            break
        significant.append(entry)
    return significant


def _outliers(columns: dict[str, dict[str, float]], own: dict[str, dict[str, float]]) -> list[JsonDict]:
    """Sessions far from the rest, the farthest first; a value that is known less well may be farther away."""
    found = []
    for name, column in columns.items():
        logs = np.log(np.array(list(column.values())))
        sigma = _robust_sigma(logs)
        if len(logs) < FEWEST or sigma == 0:
            continue
        distance = (logs - np.median(logs)) / np.hypot(sigma, [own[session][name] for session in column])
        for session, value, far in zip(column, column.values(), distance.tolist(), strict=True):
            if abs(far) > OUTLIER:
                found.append({"session": session, "parameter": name, "value": value, "distance": far})
    return sorted(found, key=lambda entry: -abs(entry["distance"]))


def _limits(columns: dict[str, dict[str, float]], golden: set[str]) -> dict[str, JsonDict]:
    """Tolerance interval of each parameter over the golden motors, in its logarithm."""
    limits: dict[str, JsonDict] = {}
    for name, column in columns.items():
        logs = np.log(np.array([value for session, value in column.items() if session in golden]))
        if len(logs) < FEWEST:
            continue
        factor = tolerance_factor(len(logs))
        middle, spread = float(logs.mean()), float(logs.std(ddof=1))
        limits[name] = {
            "n": len(logs),
            "factor": factor,
            "low": float(np.exp(middle - factor * spread)),
            "high": float(np.exp(middle + factor * spread)),
        }
    return limits


def tolerance_factor(count: int) -> float:
    """Howe's factor of the two-sided normal tolerance interval for 95 % content with 95 % confidence."""
    z = stats.norm.ppf((1 + CONTENT) / 2)
    chi2 = stats.chi2.ppf(1 - CONFIDENCE, count - 1)
    return float(z * np.sqrt((count - 1) * (1 + 1 / count) / chi2))


def _beyond(columns: dict[str, dict[str, float]], limits: dict[str, JsonDict], own: dict[str, dict[str, float]]) -> list[JsonDict]:
    """Values outside the limits, which are wider for a value that is known less well."""
    found = []
    for name, limit in limits.items():
        half = 0.5 * np.log(limit["high"] / limit["low"])
        for session, value in columns[name].items():
            # The spread of the golden motors together with the value's own uncertainty, as often as the limits contain that spread.
            farther = float(np.hypot(half, limit["factor"] * own[session][name]) - half)
            # The fit's error has no lower limit.
            if value > limit["high"] * np.exp(farther) or (value < limit["low"] * np.exp(-farther) and name != "error"):
                found.append({"session": session, "parameter": name, "value": value, "low": limit["low"], "high": limit["high"]})
    return found


def _seconds(time: str) -> float:
    try:
        return datetime.fromisoformat(time).timestamp()
    except ValueError:
        return float("nan")


def _number(serial: str) -> float:
    found = re.search(r"(\d{1,15})\D*$", serial)
    return float(found.group(1)) if found else float("nan")
