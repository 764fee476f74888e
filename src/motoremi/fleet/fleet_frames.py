"""A fleet's results as pandas tables."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict
from motoremi.errors import BadInput
from motoremi.fleet.run import RESULTS, stored_results
from motoremi.fleet.statistics import fleet_figures
from motoremi.model.effects.names import as_sum

if TYPE_CHECKING:
    import pandas as pd


def fleet_frames(folder: str | os.PathLike[str], golden: str | None = None) -> dict[str, pd.DataFrame]:
    """The tables of a fleet's results.

    Parameters
    ----------
    folder : path
        Where `motoremi fleet` put its results; the last result of each session counts.
    golden : str, optional
        As in `motoremi fleet --golden`.

    Returns
    -------
    dict
        `values`: a row for each session, a column for each parameter with its unit at the end (`La_h`, `rms_error_percent`), `time_s`
        (since 1970) and `serial` where they are known, and `verdict`, `effects` and `confidence` if the fleet was diagnosed; `sigma`: the standard
        deviations of the same parameters; `parameters`: distribution of each column over the sessions; `drift`, `outliers`,
        `limits`, `beyond_limits` and `troubles`, in SI units.

    Raises
    ------
    BadInput
        If there are no results, or the pattern matches no session.
    """
    log = Path(folder) / RESULTS
    last = {str(result["session"]): result for result in stored_results(log)}
    if not last:
        raise BadInput(f"{folder}: no results of a fleet (a file {RESULTS}) in this folder")
    return frames_of(fleet_figures(last.values(), golden))


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
    sigma = pd.DataFrame(figures["sigma"]).reindex(values.index).rename(columns=titles)
    parameters = pd.DataFrame.from_dict(figures["parameters"], orient="index").rename(index=titles)
    limits = pd.DataFrame.from_dict(figures["limits"], orient="index").rename(index=titles)
    lists = {name: pd.DataFrame(figures[name]) for name in ("drift", "outliers", "beyond_limits", "troubles")}
    return {"values": values, "sigma": sigma, "parameters": parameters, "limits": limits, **lists}


def table_of(figures: JsonDict) -> pd.DataFrame:
    """Values and standard deviations in one table: a row for each session, `Ra_ohm` and after it `Ra_ohm_sigma`."""
    frames = frames_of(figures)
    values, sigma = frames["values"], frames["sigma"]
    order = [title for name in values for title in (name, f"{name}_sigma" if name in sigma else None) if title is not None]
    return values.join(sigma.add_suffix("_sigma"))[order]


def _title(name: str, unit: str) -> str:
    """The name of a parameter with its unit at the end, where it does not stand there already."""
    if name == "error":
        return "rms_error_percent"
    ending = f"_{unit.lower()}"
    return name if not unit or name.endswith(ending) else f"{name}{ending}"
