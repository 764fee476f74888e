"""The hard scoreboard as text and files."""

from __future__ import annotations

import json
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.blind.scoreboard_text import calibration_lines, confusion_lines, goal_lines, reliability_figure, wrong_line
from motoremi.data.plain import plain
from motoremi.data.storage import write_whole

OUTCOMES = ("right", "family", "unexplained", "wrong", "missed", "false alarm", "crashed")


def markdown(result: JsonDict) -> str:
    """All tables of a hard scoreboard."""
    lines = [f"# Blind test outside the protocol: {result['cases']} cases, seed {result['seed']}", "", *goal_lines(result["goals"])]
    lines += ["", f"| departure | cases | {' | '.join(OUTCOMES)} | good | median |", "|---" * (len(OUTCOMES) + 4) + "|"]
    for departure, row in result["by_departure"].items():
        counts = " | ".join(str(row["outcomes"].get(outcome, "")) for outcome in OUTCOMES)
        time = "-" if row["seconds"] is None else f"{row['seconds']:.1f} s"
        lines.append(f"| {departure} | {row['cases']} | {counts} | {100 * row['good']:.0f} % | {time} |")
    lines += calibration_lines(result)
    lines += ["", "| departure | cases compared | 95 % intervals | that contain the true value | misses |", "|---|---|---|---|---|"]
    for departure, row in result["coverage"].items():
        if row["intervals"]:
            misses = ", ".join(f"{name} {count}" for name, count in row["missed"].items())
            lines.append(f"| {departure} | {row['cases']} | {row['intervals']} | {100 * row['inside']:.1f} % | {misses} |")
    lines += ["", *confusion_lines(result["confusion"], "hidden", "named")]
    lines += ["", *confusion_lines(result["findings"], "departure", "serious findings")]
    for title, key in (("Sure and wrong", "sure_and_wrong"), ("Cases to look at", "wrong")):
        if result[key]:
            lines += ["", f"{title} (`index: hidden -> answer`):", ""]
            lines += [f"{wrong_line(one)}, {one['departure']}, stated {one['confidence']:.2f}" for one in result[key]]
    time = result["seconds"]
    if time["cases"]:
        lines += ["", f"One diagnosis: median {time['median']:.1f} s, 90 % within {time['most']:.1f} s, longest {time['largest']:.1f} s."]
    return "\n".join(lines) + "\n"


def write_all(result: JsonDict, folder: Path) -> None:
    """Tables, data and picture into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / "scoreboard-hard.md", markdown(result).encode())
    write_whole(folder / "scoreboard-hard.json", json.dumps(plain(result), indent=1, allow_nan=False).encode())
    reliability_figure(result).savefig(folder / "reliability-hard.png", dpi=110)
