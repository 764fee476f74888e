"""Limits for the motors of a fleet, from motors that are known to be good, and the values beyond them."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Iterable, Mapping

import numpy as np
from scipy import stats

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.model.motor import BASE_PARAMETERS

# Limits from golden motors contain all values of 95 % of such motors, with 95 % confidence for each value (two-sided normal tolerance interval,
# Howe 1969; Bonferroni's correction for the number of values).
CONTENT, CONFIDENCE = 0.95, 0.95
FEWEST = 5
# The circuit's error, which is no property of a motor.
ERROR = "error"
# Stands for all elements in a stated tolerance.
EVERY = ""


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


def parse_tolerances(texts: Iterable[str]) -> dict[str, float]:
    """Tolerances such as `10%`, for all elements, and `Ca=20%`, for one; as shares, by element or `EVERY`.

    Raises
    ------
    BadInput
        If one cannot be read, or names no element of the motor.
    """
    known = [parameter.name for parameter in BASE_PARAMETERS]
    found: dict[str, float] = {}
    for text in texts:
        name, equals, share = text.rpartition("=")
        if equals and name.strip() not in known:
            raise BadInput(f"--tolerance {text}: {name.strip()!r} is no element of the motor: use one of {', '.join(known)}")
        try:
            percent = float(share.strip().removesuffix("%"))
        except ValueError:
            percent = np.nan
        # The lower limit of a tolerance of 100 % would be zero.
        if not (share.strip().endswith("%") and 0 < percent < 100):
            raise BadInput(f"--tolerance {text}: write a percentage below 100 %, for example 10% for all elements or Ca=20% for one")
        found[name.strip()] = percent / 100
    return found


def limits_of(columns: Mapping[str, Mapping[str, float]], golden: Collection[str], tolerances: Mapping[str, float]) -> dict[str, JsonDict]:
    """Limits of each parameter, from the golden motors.

    Parameters
    ----------
    columns : mapping
        Session -> value of each parameter.
    golden : collection of str
        Sessions of motors that are known to be good.
    tolerances : mapping
        Stated deviations from the golden motors' geometric mean, as shares (`parse_tolerances`). If there are any, only these are limits.

    Returns
    -------
    dict
        By parameter `n`, `middle`, `low`, `high`, and `factor`, how many standard deviations of the golden motors the limits are away: 2, the
        usual coverage factor, for stated tolerances.
    """
    good = {name: np.log([value for session, value in column.items() if session in golden]) for name, column in columns.items()}
    limits: dict[str, JsonDict] = {}
    if tolerances:
        for name, logs in good.items():
            share = tolerances.get(name, tolerances.get(EVERY))
            if share is not None and name != ERROR and logs.size:
                middle = float(np.exp(logs.mean()))
                limits[name] = {"n": len(logs), "factor": 2.0, "middle": middle, "low": middle * (1 - share), "high": middle * (1 + share)}
        return limits
    enough = {name: logs for name, logs in good.items() if len(logs) >= FEWEST}
    for name, logs in enough.items():
        factor = tolerance_factor(len(logs), 1 - (1 - CONTENT) / len(enough))
        middle, spread = float(logs.mean()), float(logs.std(ddof=1))
        low, high = (float(np.exp(middle + sign * factor * spread)) for sign in (-1, 1))
        limits[name] = {"n": len(logs), "factor": factor, "middle": float(np.exp(middle)), "low": low, "high": high}
    return limits


def tolerance_factor(count: int, content: float = CONTENT) -> float:
    """Howe's factor of the two-sided normal tolerance interval with 95 % confidence."""
    z = stats.norm.ppf((1 + content) / 2)
    chi2 = stats.chi2.ppf(1 - CONFIDENCE, count - 1)
    return float(z * np.sqrt((count - 1) * (1 + 1 / count) / chi2))


def beyond_limits(
    columns: Mapping[str, Mapping[str, float]],
    limits: Mapping[str, JsonDict],
    own: Mapping[str, Mapping[str, float]],
    golden: Collection[str],
    floors: Mapping[str, float],
) -> list[JsonDict]:
    """Values outside the limits, the farthest from the golden motors first; limits are wider for a value that is known less well.

    Parameters
    ----------
    columns, limits
        As in `limits_of`, and its result.
    own : mapping
        Relative standard deviations by session and parameter.
    golden : collection of str
        Not compared: the limits are made of them.
    floors : mapping
        By session, the error that noise and analyser would leave with a perfect circuit, in percent: a smaller error is none of the motor.
    """
    found = []
    for name, limit in limits.items():
        half = 0.5 * np.log(limit["high"] / limit["low"])
        for session, value in columns[name].items():
            # The spread of the golden motors together with the value's own uncertainty, as often as the limits contain that spread.
            farther = float(np.hypot(half, limit["factor"] * own[session][name]) - half)
            above = value > limit["high"] * np.exp(farther)
            below = value < limit["low"] * np.exp(-farther) and name != ERROR
            if session in golden or not (above or below) or (name == ERROR and value <= floors.get(session, 0.0)):
                continue
            deviation = 100 * (value / limit["middle"] - 1)
            found.append(
                {"session": session, "parameter": name, "value": value, "low": limit["low"], "high": limit["high"], "deviation_percent": deviation}
            )
    return sorted(found, key=lambda entry: -abs(float(np.log1p(entry["deviation_percent"] / 100))))
