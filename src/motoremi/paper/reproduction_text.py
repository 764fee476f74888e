"""The reproduction as text: the same Markdown on the terminal and in docs/paper.md."""

from __future__ import annotations

from motoremi.paper.printed import TABLE_1_OHM
from motoremi.paper.reproduction import Reproduction, training
from motoremi.quantities import show


def markdown(result: Reproduction) -> str:
    """Both tables: what the fits found, and every disagreement."""
    units = {p.name: p.unit for p in result.ours.motor.parameters}
    fits = result.fits
    lines = ["| | simulated | " + " | ".join(fits) + " |", "|---" * (len(fits) + 2) + "|"]
    for name, true in TABLE_1_OHM.items():
        cells = [_cell(one.parameters[name], units[name], one.determined(name) or one.method == "paper") for one in fits.values()]
        lines.append(f"| {name} | {show(true, units[name], 3)} | " + " | ".join(cells) + " |")
    figures = list(result.to_dict()["fits"].values())
    for title, key, unit in (
        ("rms error below 20 MHz", "below_20_mhz_percent", " %"),
        ("rms error above 20 MHz", "above_20_mhz_percent", " %"),
        ("chi2_reduced", "chi2_reduced", ""),
    ):
        lines.append(f"| {title} | | " + " | ".join(f"{fit[key]:.2g}{unit}" for fit in figures) + " |")
    loops = result.printed.history[-1]["loop"]
    count, best = training(result.printed)
    lines += [
        "",
        f"The colony as printed stopped after {loops} loops of 150 ants ({count[-1]:.0f} evaluations of the model) at a deviation of "
        f"{best[-1] / 100:.2g}; the noise alone would leave {result.printed.noise_percent / 100:.1g}.",
        "",
        "| what | printed | computed | conclusion |",
        "|---|---|---|---|",
    ]
    lines += [f"| {one.name} | {_safe(one.printed)} | {_safe(one.computed)} | {_safe(one.meaning)} |" for one in result.disagreements]
    return "\n".join(lines) + "\n"


def _cell(value: float, unit: str, known: bool) -> str:
    return show(value, unit, 3) if known else "not determined"


def _safe(text: str) -> str:
    return text.replace("|", "\\|")
