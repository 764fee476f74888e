"""The fleet's report: the same parts and the same page as a motor's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.fleet.limits import FEWEST
from motoremi.fleet.motors import counted, deviation, to_look_at
from motoremi.quantities import percent, show
from motoremi.report.axes import BLUE, VERMILION
from motoremi.report.contents import Box, Picture, Report, Section, Table
from motoremi.report.html import render_html
from motoremi.report.svg import to_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LONGEST_TABLE = 50
# Standard deviations from the median up to which a distribution is drawn.
FARTHEST = 8.0
_AXES = {"time": "time", "serial": "serial number"}
# What is said of effects and findings if no session was diagnosed.
NOT_LOOKED_FOR = "not looked for"
_NOBODY_LOOKED = "They were not looked for: no session was diagnosed."


def fleet_html(figures: JsonDict, title: str) -> str:
    """One HTML file."""
    return render_html(_report(figures, title))


def _report(figures: JsonDict, title: str) -> Report:
    counts, found = figures["counts"], figures["findings"]
    serious = _listed([f"{name} {len(sessions)}" for name, sessions in found.items()]) if figures["diagnosed"] else NOT_LOOKED_FOR
    headline = [
        ("sessions", f"{counts['sessions']}, {counts['in_the_figures']} of them in the figures", "plain"),
        ("verdicts", ", ".join(f"{verdict} {n}" for verdict, n in figures["verdicts"].items()) or "not diagnosed", "plain"),
        ("serious findings", serious, "bad" if found else "plain"),
        ("drift", _listed([f"{d['parameter']} along {d['along']}: {d['change_percent']:+.2g} %" for d in figures["drift"]]), "plain"),
        ("outliers", f"{len({o['session'] for o in figures['outliers']})} motors", "plain"),
    ]
    if figures["golden"]:
        headline.append(_beyond_limits(figures))
    sections = [_each_motor(figures), _distributions(figures), _missing(figures), _found(figures), _drifts(figures), _strays(figures)]
    if figures["golden"]:
        sections.append(_golden(figures))
    same = [f"{_listed(sessions)}: the same serial number" for sessions in figures["alike"]["serial"]]
    same += [f"{_listed(sessions)}: the same data" for sessions in figures["alike"]["data"]]
    warnings = (*same[:_LONGEST_TABLE], *(f"{t['session']}: {t['trouble']}" for t in figures["troubles"][:_LONGEST_TABLE]))
    more = len(figures["troubles"]) + len(same) - len(warnings)
    return Report(
        "Fleet report",
        title,
        (Box("All sessions", tuple(headline)),),
        (*warnings, *([f"and {more} more"] if more > 0 else [])),
        tuple(sections),
        figures,
    )


def _each_motor(figures: JsonDict) -> Section:
    said = [f"{counted(figures)}."]
    if not figures["limits"]:
        said.append("Whether a motor is good is judged by limits only: name motors that are known to be good (--golden).")
    if figures["diagnosed"]:
        said.append(
            "The verdict of a diagnosis is about the circuit: `adequate` says that it describes the sweeps, not that the motor is a good one."
        )
    told = to_look_at(figures)
    rows = tuple((one["session"], one["serial"], one["result"], "; ".join(one["reasons"])) for one in told[:_LONGEST_TABLE])
    tables = (Table("Motors to look at, the worst first", ("session", "serial", "result", "why"), rows),) if rows else ()
    return Section("Each motor", (*said, *_and_more(len(told))), tables)


def _and_more(count: int) -> tuple[str, ...]:
    """What is said of a table that does not hold all of so many rows."""
    more = count - _LONGEST_TABLE
    return (f"The table holds the first {_LONGEST_TABLE}; {more} more are in fleet.json.",) if more > 0 else ()


def _beyond_limits(figures: JsonDict) -> tuple[str, str, str]:
    """The line of the headline on the golden set's limits."""
    if figures["no_limits"]:
        return "limits from the golden set", f"none: {figures['no_limits']}", "bad"
    beyond = len({entry["session"] for entry in figures["beyond_limits"]})
    return "beyond the golden set's limits", f"{beyond} motors", "bad" if beyond else "good"


def _listed(texts: list[str]) -> str:
    return "; ".join(texts[:6]) + (f"; and {len(texts) - 6} more" if len(texts) > 6 else "") if texts else "none"


def _shown(figures: JsonDict, name: str, value: float) -> str:
    return show(value, figures["parameters"][name]["unit"])


def _distributions(figures: JsonDict) -> Section:
    unknown = figures["undetermined"]
    rows = tuple(
        (
            name,
            str(d["n"]),
            str(len(unknown.get(name, ()))),
            *(show(d[key], d["unit"]) for key in ("q05", "median", "q95")),
            percent(d["spread_percent"], 2),
        )
        for name, d in figures["parameters"].items()
    )
    title = "Parameters of the best model of each session, where its data determine them"
    table = Table(title, ("", "n", "not determined", "5 %", "median", "95 %", "spread"), rows)
    if not rows:
        return Section("Parameters", ("No session gave a result.",))
    texts = tuple(f"{name} is not determined by the data of {_listed(sessions)}: not compared." for name, sessions in unknown.items())
    return Section(
        "Parameters", texts, (table,), (Picture(to_svg(_histograms(figures), "histograms", "distributions"), "Distribution of each parameter."),)
    )


def _missing(figures: JsonDict) -> Section:
    rows = tuple((name, str(n), percent(100 * n / figures["diagnosed"])) for name, n in figures["effects"].items())
    table = Table("How often an effect was named", ("effect", "motors", "share"), rows)
    none = "None was named." if figures["diagnosed"] else _NOBODY_LOOKED
    return Section("Missing effects", () if rows else (none,), (table,) if rows else ())


def _found(figures: JsonDict) -> Section:
    rows = tuple((name, str(len(sessions)), _listed(sessions)) for name, sessions in figures["findings"].items())
    table = Table("Serious findings about the data, which affect the verdict", ("finding", "motors", "sessions"), rows)
    none = "None that is serious." if figures["diagnosed"] else _NOBODY_LOOKED
    return Section("Findings", () if rows else (none,), (table,) if rows else ())


def _drifts(figures: JsonDict) -> Section:
    few = [f"{title} is not tested: too few sessions have one" for axis, title in _AXES.items() if axis not in figures["testable"]]
    if figures["undated"]:
        few.append(f"the files of {figures['undated']} sessions do not state when they were measured")
    few = [f"{text[0].upper()}{text[1:]}." for text in few]
    if not figures["drift"]:
        tested = " or ".join(title for axis, title in _AXES.items() if axis in figures["testable"])
        none = f"No parameter depends on {tested} (significance level 1 %, corrected for the number of tests)." if tested else "Not tested."
        several = ("Reports of several sessions (motoremi report SESSION SESSION ...) compare each with the first.",) if not tested else ()
        return Section("Drift", (none, *few, *several))
    rows = tuple(
        (d["parameter"], d["along"], str(d["n"]), f"{d['change_percent']:+.3g} %", f"{d['tau']:+.2f}", f"{d['p']:.1e}") for d in figures["drift"]
    )
    table = Table("Parameters that depend on time or serial number", ("parameter", "along", "n", "from first to last", "Kendall's tau", "p"), rows)
    return Section("Drift", tuple(few), (table,), (Picture(to_svg(_trends(figures), "drift", "drift"), "Parameters that drift."),))


def _strays(figures: JsonDict) -> Section:
    found = figures["outliers"]
    rows = tuple(
        (o["session"], o["parameter"], _shown(figures, o["parameter"], o["value"]), f"{o['distance']:+.1f}") for o in found[:_LONGEST_TABLE]
    )
    title = "Farthest from the median, in standard deviations: the fleet's, robust, and that of the motor's own value together"
    table = Table(title, ("session", "parameter", "value", "distance"), rows)
    return Section("Outliers", _and_more(len(found)) if rows else ("None.",), (table,) if rows else ())


def _golden(figures: JsonDict) -> Section:
    limits = tuple((name, str(x["n"]), _shown(figures, name, x["low"]), _shown(figures, name, x["high"])) for name, x in figures["limits"].items())
    text = f"Sessions {figures['golden']!r} are the golden set. "
    if figures["tolerances"]:
        stated = ", ".join(f"{name or 'each element'} {percent(100 * share)}" for name, share in figures["tolerances"].items())
        text += f"The limits are stated deviations from their mean: {stated}. "
    else:
        text += "The limits contain all values of 95 % of such motors, with 95 % confidence for each value. "
    text += "A value is beyond them if it is so with its own uncertainty; an error also has to exceed what noise and analyser would leave."
    if figures["no_limits"]:
        return Section("Limits from the golden set", (text, f"No limits: {figures['no_limits']}."))
    without = [name for name in figures["parameters"] if name not in figures["limits"]]
    few = (f"Determined by fewer than {FEWEST} golden motors, so without limits: {', '.join(without)}.",) if without else ()
    found = figures["beyond_limits"]
    beyond = tuple((b["session"], b["parameter"], _shown(figures, b["parameter"], b["value"]), deviation(b)) for b in found[:_LONGEST_TABLE])
    tables = (
        Table("Limits", ("parameter", "golden motors", "low", "high"), limits),
        Table("Beyond the limits, the farthest from the golden motors first", ("session", "parameter", "value", "deviation"), beyond),
    )
    return Section("Limits from the golden set", (text, *few, *_and_more(len(found))), tables if beyond else tables[:1])


def _histograms(figures: JsonDict) -> Figure:
    from matplotlib.figure import Figure

    names = list(figures["values"])[:12]
    across = min(4, len(names))
    down = -(-len(names) // across)
    figure = Figure(figsize=(2.6 * across, 2.0 * down), layout="constrained")
    for number, name in enumerate(names, start=1):
        axes = figure.add_subplot(down, across, number)
        values = np.array(list(figures["values"][name].values()))
        shown = np.clip(values, *usual_span(values, figures["limits"].get(name)))
        bins = np.geomspace(shown.min() * 0.999, shown.max() * 1.001, min(40, 5 + len(values) // 4))
        axes.hist(shown, bins=bins.tolist(), color=BLUE)
        if far := int(np.count_nonzero(shown != values)):
            axes.set_title(f"{far} beyond, at the edge", fontsize=7)
        axes.set_xscale("log")
        axes.minorticks_off()
        unit = figures["parameters"][name]["unit"]
        axes.set_xlabel(f"{name} ({unit})" if unit else name, fontsize=8)
        axes.tick_params(labelsize=7)
        limit = figures["limits"].get(name)
        for edge in (limit["low"], limit["high"]) if limit else ():
            axes.axvline(edge, color=VERMILION, linewidth=1)
    return figure


def usual_span(values: FloatArray, limit: JsonDict | None) -> tuple[float, float]:
    """The span in which a distribution is drawn: so wide that its limits and all but single far values are in it."""
    low, middle, high = np.quantile(np.log(values), (0.25, 0.5, 0.75))
    # Quartiles of a normal distribution are 0.67 standard deviations away; without any spread all values are drawn.
    reach = FARTHEST * (high - low) / 1.35 or np.inf
    edges = [] if limit is None else [limit["low"], limit["high"]]
    return float(min(np.exp(middle - reach), *edges, np.inf)), float(max(np.exp(middle + reach), *edges, 0.0))


def _trends(figures: JsonDict) -> Figure:
    from matplotlib.figure import Figure

    drifts = figures["drift"][:6]
    across = min(3, len(drifts))
    down = -(-len(drifts) // across)
    figure = Figure(figsize=(3.4 * across, 2.4 * down), layout="constrained")
    for number, drift in enumerate(drifts, start=1):
        axes = figure.add_subplot(down, across, number)
        places = figures["times" if drift["along"] == "time" else "numbers"]
        column = figures["values"][drift["parameter"]]
        pairs = sorted((places[session], value) for session, value in column.items() if session in places)
        x, y = np.array(pairs).T
        if drift["along"] == "time":
            x = (x - x[0]) / 86400
        axes.semilogy(x, y, ".", color=BLUE, markersize=3)
        axes.set_xlabel("days" if drift["along"] == "time" else "serial number", fontsize=8)
        axes.set_title(drift["parameter"], fontsize=9)
        axes.tick_params(labelsize=7, which="both")
    return figure
