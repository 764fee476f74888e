"""Statistics over a fleet: distributions, drift, outliers, limits from a golden set."""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

import numpy as np
from scipy import stats

from motoremi.arrays import FloatArray, JsonDict
from motoremi.fleet.limits import ERROR, FEWEST, beyond_limits, golden_sessions, limits_of
from motoremi.fleet.motors import each_motor
from motoremi.model.motor import BASE_PARAMETERS
from motoremi.quantities import show_band
from motoremi.report.words import findings_of, serious_of

# Robust distance from the median, in standard deviations, beyond which a motor is an outlier: one in 15 000 of a normal distribution.
OUTLIER = 4.0
# Significance level of a drift, for all parameters and both axes together.
DRIFT_P = 0.01


@dataclass(frozen=True)
class _Row:
    """The values of one session that are used here."""

    session: str
    time: float
    serial: float
    values: dict[str, float]
    # Relative standard deviation of each value by its own fit.
    sigma: dict[str, float]
    # The error that noise and analyser would leave with a perfect circuit, in percent.
    floor: float


@dataclass
class _Seen:
    """What is collected from the results, one by one, to limit the memory."""

    sessions: list[str] = field(default_factory=list)
    rows: list[_Row] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    verdicts: Counter[str] = field(default_factory=Counter)
    effects: Counter[str] = field(default_factory=Counter)
    findings: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    undetermined: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    troubles: list[JsonDict] = field(default_factory=list)
    answers: dict[str, JsonDict] = field(default_factory=dict)
    serials: dict[str, str] = field(default_factory=dict)
    spans: dict[str, tuple[float, float]] = field(default_factory=dict)
    # Sessions with the same fit, by that fit.
    alike: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))

    def take(self, result: JsonDict) -> None:
        """One result of `work`."""
        session = str(result["session"])
        self.sessions.append(session)
        if serial := str(result.get("serial") or ""):
            self.serials[session] = serial
        if result["status"] != "done":
            self.troubles.append({"session": session, "status": result["status"], "trouble": result["trouble"]})
            return
        best = result["best"]
        self.alike[_fingerprint(best)].append(session)
        if "span_hz" in result:
            self.spans[session] = tuple(result["span_hz"])
        if (diagnosis := result.get("diagnosis")) is not None:
            self.verdicts[diagnosis["verdict"]] += 1
            self.effects.update(diagnosis["effects"])
            self.answers[session] = {key: diagnosis.get(key) for key in ("verdict", "effects", "confidence")}
            for identifier in dict.fromkeys(finding["id"] for finding in serious_of(findings_of(diagnosis))):
                self.findings[identifier].append(session)
        if not best["converged"]:
            self.troubles.append({"session": session, "status": "done", "trouble": "the fit did not converge: left out of the figures"})
            return
        self.units.update({name: entry["unit"] for name, entry in best["parameters"].items()})
        for name in best.get("undetermined", ()):
            self.undetermined[name].append(session)
        values = {name: float(entry["value"]) for name, entry in best["parameters"].items() if entry["value"] > 0}
        sigma = {name: _relative_sigma(best["parameters"][name], value) for name, value in values.items()}
        figures = {**values, ERROR: best["rms_error_percent"]}
        place = _seconds(result["time"]), _number(result["serial"])
        self.rows.append(_Row(session, *place, figures, {**sigma, ERROR: 0.0}, float(best.get("floor_percent", 0.0))))


def _relative_sigma(entry: JsonDict, value: float) -> float:
    """Standard deviation of a value relative to it; zero if none is stored."""
    sigma = entry.get("sigma")
    return abs(float(sigma) / value) if sigma is not None and np.isfinite(sigma) and value else 0.0


def fleet_figures(results: Iterable[JsonDict], golden: str | None = None, tolerances: Mapping[str, float] | None = None) -> JsonDict:
    """The fleet's figures.

    Parameters
    ----------
    results : iterable of dict
        Results of `work`.
    golden : str, optional
        Pattern of session names (`golden/*`) whose motors are known to be good.
    tolerances : mapping, optional
        Stated limits, as in `limits.limits_of`; by default they are made of the spread of the golden motors.

    Returns
    -------
    dict
        `counts`, `diagnosed` (sessions in which effects and findings were looked for), `verdicts`, `effects`, `findings` (each serious one with its
        sessions), `parameters` (n, median, robust spread, quantiles), `undetermined` (sessions whose data do not determine a parameter, which are
        not compared by it), `drift`, `outliers`, `limits`, `no_limits` (why there are none although golden sessions were named, else empty),
        `beyond_limits`, `troubles`, `motors` (result and reasons of each, `motors.each_motor`), `alike` (sessions with the same serial number, and
        with the same data), `unlike` (by session, that its sweeps have quite another span than most), `undated` (number of sessions without a
        date of measurement), `testable` (axes along which enough sessions lie for a drift to be significant); and `values`, the columns behind
        them, with `sigma`, their standard deviations, and `answers`, the verdict, effects and confidence of each session that was diagnosed.

    Raises
    ------
    BadInput
        If the pattern matches no session.
    """
    seen = _Seen()
    for result in results:
        seen.take(result)
    rows = seen.rows
    units = {**seen.units, ERROR: "%"}
    columns = _columns(rows)
    own = {row.session: row.sigma for row in rows}
    chosen = set() if golden is None else golden_sessions([*own, *(str(trouble["session"]) for trouble in seen.troubles)], golden)
    limits = limits_of(columns, chosen, tolerances or {})
    floors = {row.session: row.floor for row in rows}
    axes = _axes(rows)
    figures = {
        "schema": "motoremi.fleet/1",
        "counts": {"sessions": len(rows) + len(seen.troubles), "in_the_figures": len(rows), "troubled": len(seen.troubles)},
        "diagnosed": seen.verdicts.total(),
        "verdicts": dict(seen.verdicts.most_common()),
        "effects": dict(seen.effects.most_common()),
        "findings": dict(sorted(seen.findings.items(), key=lambda entry: -len(entry[1]))),
        "parameters": {name: {"unit": units[name], **_distribution(column)} for name, column in columns.items()},
        "drift": _drift(axes, columns),
        "undetermined": dict(seen.undetermined),
        "testable": [axis for axis, places in axes.items() if len(set(places.values())) >= _least_for_drift(len(columns))],
        "undated": sum(not np.isfinite(row.time) for row in rows),
        "outliers": _outliers(columns, own, floors),
        "golden": golden,
        "limits": limits,
        "no_limits": "" if golden is None or limits else _too_few(len(chosen), len(chosen & own.keys()), 1 if tolerances else FEWEST),
        "tolerances": dict(tolerances or {}),
        "beyond_limits": beyond_limits(columns, limits, own, chosen, floors),
        "troubles": seen.troubles,
        "values": {name: dict(column) for name, column in columns.items()},
        "sigma": {
            name: {session: value * own[session][name] for session, value in column.items()} for name, column in columns.items() if name != ERROR
        },
        "answers": seen.answers,
        "times": axes["time"],
        "numbers": axes["serial"],
        "serials": seen.serials,
        "unlike": _unlike(seen.spans),
        "alike": {"serial": _repeated(seen.serials), "data": [sessions for sessions in seen.alike.values() if len(sessions) > 1]},
    }
    return {**figures, "motors": each_motor(figures, seen.sessions, chosen, seen.serials)}


def _fingerprint(best: JsonDict) -> str:
    """The same for two sessions with the same data, and for no others: their fits agree to the last digit."""
    return repr((best["rms_error_percent"], sorted((name, entry["value"]) for name, entry in best["parameters"].items())))


def _unlike(spans: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """Sessions whose span has another order of magnitude than those of most, such as numbers in kHz that were read as Hz."""
    if len(spans) < FEWEST:
        return {}
    usual = np.median(np.log10(list(spans.values())), axis=0)
    other = {session: span for session, span in spans.items() if np.max(np.abs(np.log10(span) - usual)) > 1}
    low, high = 10.0**usual
    return {session: f"swept over {show_band(*span)}, most motors over {show_band(low, high)}" for session, span in other.items()}


def _repeated(serials: Mapping[str, str]) -> list[list[str]]:
    """Sessions that have the same serial number."""
    found: dict[str, list[str]] = defaultdict(list)
    for session, serial in serials.items():
        found[serial].append(session)
    return [sessions for sessions in found.values() if len(sessions) > 1]


def _axes(rows: list[_Row]) -> dict[str, dict[str, float]]:
    """The places of the sessions along time and serial number, where they are known."""
    return {axis: {row.session: place for row in rows if np.isfinite(place := getattr(row, axis))} for axis in ("time", "serial")}


def _least_for_drift(parameters: int) -> int:
    """The smallest number of sessions for which a rank test can find a drift: n in perfect order have a probability of 2 / n!."""
    return next(n for n in range(FEWEST, 20) if 2 / math.factorial(n) * 2 * parameters < DRIFT_P)


def _too_few(named: int, used: int, least: int) -> str:
    """Why there are no limits."""
    there = "there is 1 golden motor" if used == 1 else f"there are {used} golden motors"
    gave = f"{used} of the {named} golden motors gave a result" if used < named else there
    return f"{gave}, and at least {least} {'is' if least == 1 else 'are'} needed"


def _columns(rows: list[_Row]) -> dict[str, dict[str, float]]:
    """Session -> value of each parameter; the motor's own first."""
    columns: dict[str, dict[str, float]] = defaultdict(dict)
    for name in (*(parameter.name for parameter in BASE_PARAMETERS), ERROR):
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


def _drift(axes: dict[str, dict[str, float]], columns: dict[str, dict[str, float]]) -> list[JsonDict]:
    """Parameters that depend on time or serial number: Theil-Sen slope, Kendall's tau, p corrected for the number of tests (Holm)."""
    found: list[JsonDict] = []
    for axis, places in axes.items():
        for name, column in columns.items():
            pairs = [(places[session], value) for session, value in column.items() if session in places]
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


def _outliers(columns: dict[str, dict[str, float]], own: dict[str, dict[str, float]], floors: dict[str, float]) -> list[JsonDict]:
    """Sessions far from the rest, the farthest first; a value that is known less well may be farther away.

    An error is none if it is small, or no larger than noise and analyser would leave.
    """
    found = []
    for name, column in columns.items():
        logs = np.log(np.array(list(column.values())))
        sigma = _robust_sigma(logs)
        if len(logs) < FEWEST or sigma == 0:
            continue
        distance = (logs - np.median(logs)) / np.hypot(sigma, [own[session][name] for session in column])
        for session, value, far in zip(column, column.values(), distance.tolist(), strict=True):
            if abs(far) > OUTLIER and (name != ERROR or (far > 0 and value > floors[session])):
                found.append({"session": session, "parameter": name, "value": value, "distance": far})
    return sorted(found, key=lambda entry: -abs(entry["distance"]))


def _seconds(time: str) -> float:
    try:
        return datetime.fromisoformat(time).timestamp()
    except ValueError:
        return float("nan")


def _number(serial: str) -> float:
    found = re.search(r"(\d{1,15})\D*$", serial)
    return float(found.group(1)) if found else float("nan")
