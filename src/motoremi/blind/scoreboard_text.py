"""The scoreboard as text and picture."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from motoremi.arrays import JsonDict
from motoremi.blind.cases import SHOWING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Labels of goals whose keys in the JSON are less plain.
LABELS = {
    "error after at most 1.3 noise floors": "error after adding, at most 1.3 times the noise",
    "calibration of the kind of verdict that is furthest off": "largest calibration error of a kind of verdict",
    "95 % intervals that hold the truth, worst departure": "95 % intervals that contain the true value, worst departure",
    "mistakes behind a wrong name stated above 0.8": "operator's mistakes that caused a wrong name stated above 0.8",
}
OUTCOMES = ("right", "family", "wrong", "missed", "unexplained", "false alarm", "crashed", "too weak to see")


def markdown(result: JsonDict) -> str:
    """All tables of a scoreboard."""
    lines = [f"# Blind test: {result['cases']} cases, seed {result['seed']}", ""]
    lines += goal_lines(result["goals"])
    lines += ["", "| hidden | diagnoses | median | 90 % within | longest |", "|---|---|---|---|---|"]
    for sort, seconds in (*result["seconds"]["by_sort"].items(), ("all", result["seconds"])):
        if seconds["cases"]:
            lines.append(f"| {sort} | {seconds['cases']} | {seconds['median']:.1f} s | {seconds['most']:.1f} s | {seconds['largest']:.1f} s |")
    lines += ["", "| hidden | " + " | ".join(OUTCOMES) + " |", "|---" * (len(OUTCOMES) + 1) + "|"]
    for kind, counts in result["by_kind"].items():
        lines.append(f"| {kind} | " + " | ".join(str(counts.get(outcome, "")) for outcome in OUTCOMES) + " |")
    lines += calibration_lines(result)
    lines += ["", "Named instead (single effects):", "", *confusion_lines(result["confusion"], "hidden", "named")]
    if result["wrong"]:
        lines += ["", "Cases to look at (`index: hidden -> answer`):", ""]
        lines += [wrong_line(one) for one in result["wrong"]]
    return "\n".join(lines) + "\n"


def goal_lines(goals: JsonDict) -> list[str]:
    """The table of goals."""
    lines = ["| goal | wanted | reached | cases | |", "|---|---|---|---|---|"]
    for name, goal in goals.items():
        sign = "<=" if goal["at_most"] else ">="
        value = "-" if goal["value"] is None else f"{100 * goal['value']:.1f} %"
        state = "" if goal["reached"] is None else "yes" if goal["reached"] else "NO"
        label = LABELS.get(name, name).replace("median minutes, of those of", "median minutes relative to the policy")
        lines.append(f"| {label} | {sign} {100 * goal['wanted']:.0f} % | {value} | {goal['cases']} | {state} |")
    return lines


def calibration_lines(result: JsonDict) -> list[str]:
    """Stated confidence against hit rate: in bins, and by kind of verdict."""
    lines = ["", "| stated confidence | cases | mean stated | hit rate |", "|---|---|---|---|"]
    for row in result["reliability"]:
        lines.append(f"| {row['low']:.2f} - {row['high']:.2f} | {row['cases']} | {row['stated']:.3f} | {row['hit_rate']:.3f} |")
    lines += ["", "| kind of verdict | cases | mean stated | hit rate | difference |", "|---|---|---|---|---|"]
    for row in result["kinds_of_verdict"]:
        lines.append(f"| {row['kind']} | {row['cases']} | {row['stated']:.3f} | {row['hit_rate']:.3f} | {row['difference']:+.3f} |")
    return lines


def confusion_lines(confusion: JsonDict, hidden: str, named: str) -> list[str]:
    """Hidden effect and named effects, the most frequent first."""
    lines = [f"| {hidden} | {named} |", "|---|---|"]
    for kind, counts in confusion.items():
        lines.append(f"| {kind} | {', '.join(f'{name} {count}' for name, count in sorted(counts.items(), key=lambda pair: -pair[1]))} |")
    return lines


def wrong_line(one: JsonDict) -> str:
    """One case to examine: hidden effects, answer, and whether the search missed a better model."""
    answer = " + ".join(one["effects"]) or one["trouble"] or one["verdict"]
    families = "; ".join(", ".join(family) for family in one["families"])
    ahead = one.get("hidden_ahead_nats")
    missed = (
        f", the hidden model, fitted directly, is more probable than all found by e^{ahead:.0f}" if ahead is not None and ahead > SHOWING else ""
    )
    return f"- {one['index']}: {' + '.join(one['hidden']) or 'none'} -> {answer}" + (f" ({families})" if families else "") + missed


def reliability_figure(result: JsonDict) -> Figure:
    """Stated confidence against hit rate; the area of a point is its share of the cases."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.5, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], color="0.6", linestyle="--", label="stated = reached")
    rows = result["reliability"]
    axes.scatter([r["stated"] for r in rows], [r["hit_rate"] for r in rows], s=[20 + 400 * r["cases"] / result["cases"] for r in rows], alpha=0.7)
    axes.set_xlabel("stated confidence")
    axes.set_ylabel("hit rate")
    axes.set_xlim(0, 1.02)
    axes.set_ylim(0, 1.02)
    axes.legend(loc="upper left")
    return figure


def write_all(result: JsonDict, folder: Path) -> None:
    """Tables, data and picture into a folder."""
    import json

    from motoremi.data.plain import plain
    from motoremi.data.storage import write_whole

    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / "scoreboard.md", markdown(result).encode())
    write_whole(folder / "scoreboard.json", json.dumps(plain(result), indent=1, allow_nan=False).encode())
    reliability_figure(result).savefig(folder / "reliability.png", dpi=110)
