"""A fleet's results as pandas tables."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict
from motoremi.data.plain import object_from_json
from motoremi.data.text import in_a_cell
from motoremi.errors import BadInput
from motoremi.fleet.limits import parse_tolerances
from motoremi.fleet.run import FIGURES, RESULTS, stored_results
from motoremi.fleet.statistics import fleet_figures
from motoremi.model.effects.names import as_sum

if TYPE_CHECKING:
    import pandas as pd


def fleet_frames(folder: str | os.PathLike[str], golden: str | None = None, tolerances: Sequence[str] = ()) -> dict[str, pd.DataFrame]:
    """The tables of a fleet's results.

    Parameters
    ----------
    folder : path
        Where `motoremi fleet` put its results; the last result of each session counts.
    golden : str, optional
        As in `motoremi fleet --golden`; by default as in the run that made the results.
    tolerances : sequence of str, optional
        As in `motoremi fleet --tolerance`, such as `10%` or `Ca=20%`; by default as in that run, if `golden` is not given either.

    Returns
    -------
    dict
        `values`: a row for each session, a column for each parameter with its unit at the end (`La_h`, `rms_error_percent`), `time_s`
        (of the measurement, since 1970) and `serial` (text) where they are known, and `verdict`, `effects` and `confidence` if the fleet was
        diagnosed; `sigma`: the standard deviations of the same parameters; `from_golden`: deviations of those that have limits, in percent;
        `motors`: `result` and `reasons` of each session, also of those without values, the worst first; `parameters`: distribution of each column
        over the sessions; `drift`, `outliers`, `limits`, `beyond_limits` and `troubles`, in SI units.

    Raises
    ------
    BadInput
        If there are no results, or the pattern matches no session.
    """
    log = Path(folder) / RESULTS
    last = {str(result["session"]): result for result in stored_results(log)}
    if not last:
        raise BadInput(f"{folder}: no results of a fleet (a file {RESULTS}) in this folder")
    shares = parse_tolerances(tolerances)
    if golden is None and (stored := Path(folder) / FIGURES).is_file():
        golden, shares = _limits_of_the_run(stored)
    return frames_of(fleet_figures(last.values(), golden, shares))


def _limits_of_the_run(stored: Path) -> tuple[str | None, dict[str, float]]:
    """The golden set and the tolerances with which a fleet was run."""
    try:
        figures = object_from_json(stored.read_bytes())
        golden, shares = figures.get("golden"), {str(name): float(share) for name, share in dict(figures.get("tolerances") or {}).items()}
    except (ValueError, TypeError) as error:
        raise BadInput(f"{stored}: damaged ({error}); run motoremi fleet again") from error
    return None if golden is None else str(golden), shares


def frames_of(figures: JsonDict) -> dict[str, pd.DataFrame]:
    """The same from the figures of `fleet_figures`."""
    import pandas as pd

    titles = {name: _title(name, entry["unit"]) for name, entry in figures["parameters"].items()}
    values = pd.DataFrame(figures["values"]).sort_index().rename(columns=titles)
    values.index.name = "session"
    for title, known in (("time_s", figures["times"]), ("serial", figures["serials"])):
        if known:
            values[title] = pd.Series(known)
    for title in ("verdict", "effects", "confidence") if figures["answers"] else ():
        told = {session: as_sum(answer[title]) if title == "effects" else answer[title] for session, answer in figures["answers"].items()}
        values[title] = pd.Series(told)
    from_golden = pd.DataFrame({titles[name]: 100 * (values[titles[name]] / limit["middle"] - 1) for name, limit in figures["limits"].items()})
    motors = pd.DataFrame(figures["motors"], columns=["session", "serial", "result", "reasons"]).set_index("session")
    sigma = pd.DataFrame(figures["sigma"]).reindex(values.index).rename(columns=titles)
    parameters = pd.DataFrame.from_dict(figures["parameters"], orient="index").rename(index=titles)
    limits = pd.DataFrame.from_dict(figures["limits"], orient="index").rename(index=titles)
    lists = {name: pd.DataFrame(figures[name]) for name in ("drift", "outliers", "beyond_limits", "troubles")}
    return {"values": values, "sigma": sigma, "from_golden": from_golden, "motors": motors, "parameters": parameters, "limits": limits, **lists}


def table_of(figures: JsonDict) -> pd.DataFrame:
    """Values, standard deviations and deviations in one table: `Ra_ohm`, after it `Ra_ohm_sigma` and `Ra_ohm_from_golden_percent`, and so on.

    Names of sessions and serial numbers are escaped for spreadsheets.
    """
    frames = frames_of(figures)
    table, beside = frames["values"], {"_sigma": frames["sigma"], "_from_golden_percent": frames["from_golden"]}
    order = [title for name in table for title in (name, *(f"{name}{ending}" for ending, frame in beside.items() if name in frame))]
    for ending, frame in beside.items():
        table = table.join(frame.add_suffix(ending))
    return _for_spreadsheets(table[order])


def motors_of(figures: JsonDict) -> pd.DataFrame:
    """Serial number, result and reasons of each session, as text; escaped for spreadsheets."""
    motors = frames_of(figures)["motors"]
    return _for_spreadsheets(motors.assign(reasons=motors["reasons"].map("; ".join)))


def _for_spreadsheets(table: pd.DataFrame) -> pd.DataFrame:
    """The same with text from outside, names of sessions and serial numbers, escaped (`in_a_cell`)."""
    outside = [name for name in ("serial", "reasons") if name in table]
    escaped = table.assign(**{name: table[name].map(in_a_cell, na_action="ignore") for name in outside})
    return escaped.rename(index=in_a_cell)


def _title(name: str, unit: str) -> str:
    """The name of a parameter with its unit at the end, where it does not stand there already."""
    if name == "error":
        return "rms_error_percent"
    ending = f"_{unit.lower()}"
    return name if not unit or name.endswith(ending) else f"{name}{ending}"
