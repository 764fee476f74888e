"""The board of investigations as text and files."""

from __future__ import annotations

import json
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.blind.scoreboard_text import calibration_lines, goal_lines, reliability_figure, wrong_line
from motoremi.data.plain import plain
from motoremi.data.storage import write_whole


def markdown(result: JsonDict) -> str:
    """All tables of a board."""
    lines = [f"# Investigations: {result['cases']} sealed motors, seed {result['seed']}", "", *goal_lines(result["goals"])]
    if result["too_weak_to_see"]:
        lines += ["", f"{result['too_weak_to_see']} motors hide something too weak to be seen in their two sweeps: they count in no figure here."]
    for title, key in (("policy", "by_policy"), ("start", "by_start")):
        lines += [
            "",
            f"| {title} | motors | named or inseparable | wrong | median minutes | median steps | stops |",
            "|---|---|---|---|---|---|---|",
        ]
        for name, row in result[key].items():
            stops = ", ".join(f"{stop or 'crashed'} {count}" for stop, count in sorted(row["stops"].items(), key=lambda pair: -pair[1]))
            lines.append(
                f"| {name} | {row['motors']} | {100 * row['settled']:.0f} % | {100 * row['wrong']:.0f} % | {row['median_minutes']:.1f} | "
                f"{row['median_steps']:.0f} | {stops} |"
            )
    lines += calibration_lines(result)
    mistakes = result["mistakes"]
    lines += ["", f"Operator's mistakes: {mistakes['made']} made, {mistakes['found']} noticed, {mistakes['false_alarms']} false alarms."]
    for what, key in (("One decision", "seconds"), ("One search for explanations in reference sweeps", "search_seconds")):
        if result[key]["count"]:
            lines.append(f"{what}: median {result[key]['median']:.1f} s, longest {result[key]['largest']:.1f} s.")
    if result["unsettled"]:
        lines += ["", "Neither named nor proven inseparable (`index: hidden -> answer`):", ""]
        lines += [f"{wrong_line(one)}, {one['start']}, after {', '.join(one['steps']) or 'nothing'}, {one['stop']}" for one in result["unsettled"]]
    return "\n".join(lines) + "\n"


def write_all(result: JsonDict, folder: Path) -> None:
    """Tables, data and picture into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / "scoreboard-investigation.md", markdown(result).encode())
    write_whole(folder / "scoreboard-investigation.json", json.dumps(plain(result), indent=1, allow_nan=False).encode())
    reliability_figure(result).savefig(folder / "reliability-investigation.png", dpi=110)
