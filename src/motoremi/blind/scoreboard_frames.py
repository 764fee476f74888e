"""Scoreboards as pandas tables."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict
from motoremi.data.plain import object_from_json
from motoremi.errors import BadInput

if TYPE_CHECKING:
    import pandas as pd


def scoreboard_frames(scoreboard: JsonDict | str | os.PathLike[str]) -> dict[str, pd.DataFrame]:
    """The tables of a scoreboard of any kind. Values and rates are shares of one; times are in seconds (`_s`).

    Parameters
    ----------
    scoreboard : dict or path
        What `motoremi scoreboard --json` writes, or the JSON file of its `--out`.

    Returns
    -------
    dict
        `goals`: value, wanted, cases, reached; `outcomes`: how many cases of each kind (or departure) ended how; `confusion`: hidden, said,
        cases; `reliability` and `kinds_of_verdict`: stated confidence against hit rate; `wrong`: the cases to look at. Those that the
        scoreboard has.

    Raises
    ------
    BadInput
        If it is no scoreboard.
    """
    import pandas as pd

    result = scoreboard if isinstance(scoreboard, dict) else _read(Path(scoreboard))
    if not str(result.get("schema")).startswith("motoremi.scoreboard") or "goals" not in result:
        raise BadInput("this is no scoreboard: it has no goals")
    frames = {"goals": pd.DataFrame.from_dict(result["goals"], orient="index")}
    if (kinds := _outcomes(result)) is not None:
        frames["outcomes"] = pd.DataFrame.from_dict(kinds, orient="index").fillna(0).astype(int)
    if "confusion" in result:
        rows = [(hidden, said, cases) for hidden, answers in result["confusion"].items() for said, cases in answers.items()]
        frames["confusion"] = pd.DataFrame(rows, columns=["hidden", "said", "cases"])
    for name in ("reliability", "kinds_of_verdict", "wrong"):
        if name in result:
            frames[name] = pd.DataFrame(result[name]).rename(columns={"seconds": "diagnosis_s"})
    return frames


def _outcomes(result: JsonDict) -> JsonDict | None:
    if "by_kind" in result:
        return dict(result["by_kind"])
    if "by_departure" in result:
        return {departure: row["outcomes"] for departure, row in result["by_departure"].items()}
    return None


def _read(path: Path) -> JsonDict:
    try:
        return object_from_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: cannot be read as a scoreboard: {error}") from error
