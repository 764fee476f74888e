"""Commands on the models of a session: fit, compare, diagnose, inspect, add, drop, ladder, next, report, plot."""

from __future__ import annotations

import gc
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import typer

from motoremi.cli.options import AsJson, Menu, SessionPath, Without, command, is_typed, plot_file, save_plot
from motoremi.errors import BadInput
from motoremi.report.kinds import PLOTS, SECTIONS

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict
    from motoremi.diagnosis.diagnosis import Diagnosis
    from motoremi.fitting.result import Fit
    from motoremi.model.motor import Motor

# What may be inspected, in the help of two commands.
INSPECTED = "Ra, La, Ca, Rr, Lr, Cr, Cf, or an effect of the model that is one part of the circuit (a cell, a film)."
Value = TypeVar("Value")


def fit_(
    path: SessionPath,
    method: Annotated[str, typer.Option(help="ant-colony, or paper for the algorithm as printed in the paper.")] = "ant-colony",
    seed: Annotated[
        int, typer.Option(help="Start of the random numbers; the same seed, ladder and stored diagnosis give the same result.", min=0)
    ] = 1,
    bound: Annotated[
        list[str] | None, typer.Option("--bound", metavar="NAME=LOW:HIGH", help='For example "La=1 uH:100 uH"; may be repeated.')
    ] = None,
    hold: Annotated[
        list[str] | None,
        typer.Option(
            "--hold",
            metavar="NAME=VALUE",
            help="A known value that is not fitted, for example Ra=2.3Ohm; may be repeated. Values held by an earlier fit are fitted again unless "
            "they are given again.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fit every model of the session's ladder again; at first only the paper's circuit."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.data.session import load
    from motoremi.investigation.next_measurement import next_measurement
    from motoremi.quantities import error_bar, show
    from motoremi.workflow import fit_session, model_of, opened, refitted

    bounds = _by_name("--bound", (_bound(text) for text in bound or []))
    with opened(path) as store, progress_bars(as_json) as bars:
        before = load(store.path)
        model = model_of(before)
        held = _by_name("--hold", (_held(text, model) for text in hold or []))
        result = fit_session(store, method, seed, bounds, held, bars.bar("fitting"))
        changed = refitted(before, load(store.path))
    if as_json:
        emit_json({**result.to_dict(), **changed.to_dict()})
        return
    say(repr(result))
    for quantity in result.derived():
        bar = error_bar(quantity.value, quantity.sigma) if quantity.sigma < 0.5 * quantity.value else "not determined"
        say(f"  {quantity.name:40s} {show(quantity.value, quantity.unit):>14s}  {bar}")
    absorbed = result.said_of_absorbing
    if absorbed:
        say(f"  {absorbed}")
    elif result.converged:
        for name in result.undetermined():
            say(f"  the data do not determine {name}: {result.interval(name)}")
    if result.converged and (other := result.another_solution()):
        say(f"  {other}")
    units = {parameter.name: parameter.unit for parameter in model.parameters}
    for name, (low, high) in bounds.items():
        # A number without a unit is in SI units, and 1 H is easily meant to be 1 uH.
        say(f"  limits given for {name}: {show(low, units[name])} - {show(high, units[name])}")
    if result.undetermined() and not absorbed:
        say(f"  measure next: {next_measurement(result)['why']}")
    holds = {**changed.released, **held}
    limits = {name: pair for name, pair in {**changed.unbounded, **bounds}.items() if name not in holds}
    again = " ".join([*(_hold_option(name, holds[name], model) for name in holds), *(_bound_option(name, limits[name], model) for name in limits)])
    for what, option, released in (("held", "hold", changed.released), ("bounded", "bound", changed.unbounded)):
        if released:
            names = ", ".join(released)
            say(f"note: no longer {what}, because --{option} was not given again: {names}; to {option} all: motoremi fit {quoted(path)} {again}")
    if changed.errors:
        shown = "; ".join(f"error of {name} {show(old, '%')} -> {show(new, '%')}" for name, old, new in changed.errors)
        say(f"note: every step of the ladder was fitted again: {shown}")
    say(f"next: motoremi diagnose {quoted(path)}")


def _bound(text: str) -> tuple[str, tuple[float, float]]:
    from motoremi.model.motor import BASE_PARAMETERS
    from motoremi.quantities import parse

    name, equals, pair = (part.strip() for part in text.partition("="))
    units = {parameter.name: parameter.unit for parameter in BASE_PARAMETERS}
    if not equals or pair.count(":") != 1:
        raise BadInput(f"cannot read the bound {text!r}: write for example 'La=1 uH:100 uH'")
    if name not in units:
        raise BadInput(f"bounds for the unknown parameter {name!r}; the circuit has {', '.join(units)}")
    low, high = pair.split(":")
    return name, (parse(low, units[name]), parse(high, units[name]))


def _held(text: str, model: Motor) -> tuple[str, float]:
    from motoremi.quantities import parse

    name, equals, value = (part.strip() for part in text.partition("="))
    known = {parameter.name: parameter for parameter in model.parameters}
    if not equals or not value:
        raise BadInput(f"cannot read {text!r} as a value to hold: write for example Ra=2.3Ohm")
    if ":" in value:
        raise BadInput(f"--hold takes one value, not the range {text!r}: limits of a value that is fitted are given with --bound")
    if name not in known:
        raise BadInput(f"cannot hold the unknown parameter {name!r}; the model has {', '.join(known)}")
    return name, parse(value, known[name].unit)


def _by_name(option: str, pairs: Iterable[tuple[str, Value]]) -> dict[str, Value]:
    """What an option that may be repeated gives, each name once."""
    given: dict[str, Value] = {}
    for name, value in pairs:
        if name in given:
            raise BadInput(f"{option} is given twice for {name}: keep one")
        given[name] = value
    return given


def _hold_option(name: str, value: float, model: Motor) -> str:
    return f"--hold {name}={_exactly(value, name, model)}"


def _bound_option(name: str, pair: tuple[float, float], model: Motor) -> str:
    return f"--bound {name}={':'.join(_exactly(value, name, model) for value in pair)}"


def _exactly(value: float, name: str, model: Motor) -> str:
    """A value of a parameter with its unit, which is read back exactly."""
    from motoremi.quantities import parse, show

    unit = next(parameter.unit for parameter in model.parameters if parameter.name == name)
    text = show(value, unit, 12).replace(" ", "")
    return text if parse(text, unit) == value else f"{value!r}{unit}"


def compare_(
    path: SessionPath,
    error_percent: Annotated[float | None, typer.Option(help="Largest error allowed beyond the measurement's uncertainty, in percent.")] = None,
    magnitude_db: Annotated[float | None, typer.Option(help="Largest error of magnitude allowed, in dB; likewise.")] = None,
    phase_deg: Annotated[float | None, typer.Option(help="Largest error of phase allowed, in degrees; likewise.")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare model and measurement: error per sweep and band, where it fails, PASS or FAIL.

    A point fails if its error is beyond a tolerance and beyond the measurement's own uncertainty. Without a tolerance: the last one, at first 10 %.
    """
    from motoremi.cli.output import emit_json, say
    from motoremi.inspection.compare import Tolerance
    from motoremi.workflow import compare_session, opened

    with opened(path) as store:
        result = compare_session(store, Tolerance(error_percent, magnitude_db, phase_deg))
    if as_json:
        emit_json(result.to_dict())
    else:
        say(repr(result))
    raise typer.Exit(0 if result.passed else 1)


def diagnose_(
    path: SessionPath,
    start: Annotated[
        Literal["ladder", "base"], typer.Option("--from", help="Start from the last model of the ladder, or from the paper's circuit.")
    ] = "ladder",
    emission: Annotated[bool, typer.Option("--emission", help="Diagnose the spectra: which effect of source or path is missing.")] = False,
    as_json: AsJson = False,
) -> None:
    """Find the missing physical effect: evidence, effects that cannot be distinguished, next measurement."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.emission import diagnose_spectra
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.diagnosis.belief import after_verdict
    from motoremi.diagnosis.candidates import own_labels
    from motoremi.inspection.compare import compare
    from motoremi.model.effects.names import as_sum
    from motoremi.workflow import diagnose_session, opened

    if emission:
        diagnose_spectra(path, start == "base", as_json)
        return
    with opened(path) as store, progress_bars(as_json) as bars:
        result = diagnose_session(store, start, bars.bar("diagnosing"))
    if as_json:
        emit_json(result.to_dict())
        return
    say(repr(result).replace("SESSION", quoted(path)))
    _say_findings(result)
    # The spans are those of the model that was diagnosed, not of the one with the effects that were found.
    model = as_sum(("paper's circuit", *result.base.effects))
    for text in compare(result.base).where_in_words("deviates most" if result.verdict == "adequate" else "fails"):
        say(f"  {model}: {text}")
    say("  single effects, those named or in a family first (p: share of the probability of all sets of effects that were found):")
    for candidate in result.candidates[:6]:
        probability = after_verdict(result.probabilities[candidate.effect], result.verdict, result.confidence)
        say(f"    {candidate.effect:28s} p {probability:<9.3g} {_errors(candidate.fit)}  {candidate.describe()}")
    if len(result.effects) > 1:
        say(f"  together: {as_sum(result.effects)}  {_errors(result.best)}")
    if result.effects:
        say(f"  values of {as_sum(result.effects)} in that circuit (add shows those of all elements):")
        labels = own_labels(result.best.effects, result.effects)
        for name, value, bar in result.best.rows():
            if name.rpartition(".")[0] in labels:
                say(f"    {name:34s} {value:>14s}  {bar}")
        say(f"next: motoremi add {quoted(path)} {' '.join(result.effects)}")


def _errors(fit: Fit) -> str:
    from motoremi.quantities import percent

    return f"chi2 {fit.chi2_reduced:<9.4g} error {percent(fit.rms_error_percent)}  undescribed {percent(fit.unexplained_percent['value'], 2)}"


def _say_findings(result: Diagnosis) -> None:
    """Print the errors of the model, the stated accuracy, and the findings about the data."""
    from motoremi.cli.output import say
    from motoremi.quantities import percent
    from motoremi.report.words import beside_the_error, findings_of, place_of

    say(f"  error of the model {percent(result.best.rms_error_percent)}; {'; '.join(beside_the_error(result.best))}")
    if result.base.measurement.accuracy_percent is not None:
        say(f"  accuracy stated for these data: {result.base.measurement.accuracy_percent:g} %")
    for finding in findings_of(result.to_dict()):
        say(f"  found{', serious' if finding['serious'] else ''}: {finding['id']} ({place_of(finding)}); do: {finding['remedy']}")


def inspect_(
    path: SessionPath,
    element: Annotated[
        str,
        typer.Option(
            "--element",
            metavar="NAME",
            help=INSPECTED,
            show_default=False,
        ),
    ],
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="SVG, PNG or PDF of the curve with its uncertainty.")] = None,
    as_json: AsJson = False,
) -> None:
    """Show the value that an element would need at each frequency for the model to be exact."""
    from motoremi.cli.output import emit_json, say
    from motoremi.workflow import inspect_session, opened

    file = None if plot is None else plot_file(plot)
    with opened(path) as store:
        found = inspect_session(store, element)
    if file is not None:
        save_plot(found.plot(), file)
    if as_json:
        emit_json(found.to_dict())
        return
    say(repr(found))
    if file is not None:
        say(str(file))


def add_(
    path: SessionPath,
    effects: Annotated[
        list[str],
        typer.Argument(metavar="EFFECT", help="From the catalogue: motoremi effects. Several are fitted at once.", show_default=False),
    ],
    as_json: AsJson = False,
) -> None:
    """Add an effect to the model, fit again and show the errors before and after; effects of source and path are added to the spectra's model."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.emission import show_emission_step
    from motoremi.data.session import load
    from motoremi.emission.source_effects import is_source_effect
    from motoremi.errors import BadInput
    from motoremi.workflow import add_several_to_session, add_to_session, opened
    from motoremi.workflow_emission import add_source_effects

    of_spectra = [effect for effect in effects if is_source_effect(effect)]
    if of_spectra and len(of_spectra) < len(effects):
        raise BadInput(f"{of_spectra[0]} belongs to the spectra's model: add it alone")
    if of_spectra:
        with opened(path) as store:
            spectra = add_source_effects(store, effects)
        show_emission_step(*spectra, as_json)
        return
    with opened(path) as store, progress_bars(as_json) as bars:
        bar = bars.bar("adding")
        before, after = add_to_session(store, effects[0], bar) if len(effects) == 1 else add_several_to_session(store, effects, bar)
    _show_step(before, after, as_json, load(path).ladder[-1])


def drop_(
    path: SessionPath,
    emission: Annotated[bool, typer.Option("--emission", help="The last effect of the model of the spectra.")] = False,
    as_json: AsJson = False,
) -> None:
    """Go one step back on the ladder: remove the effect that was added last."""
    from motoremi.cli.emission import show_emission_step
    from motoremi.workflow import drop_from_session, opened
    from motoremi.workflow_emission import drop_source_effect

    if emission:
        with opened(path) as store:
            steps = drop_source_effect(store)
        show_emission_step(*steps, as_json)
        return
    with opened(path) as store:
        before, after = drop_from_session(store)
    _show_step(before, after, as_json)


def _show_step(before: Fit, after: Fit, as_json: bool, details: JsonDict | None = None) -> None:
    from motoremi.cli.output import emit_json, say
    from motoremi.quantities import percent, show
    from motoremi.report.words import beside_the_error

    if as_json:
        step = {} if details is None else {name: details[name] for name in ("bands", "changes", "unneeded", "notes")}
        emit_json({"schema": "motoremi.step/1", "before": before.to_dict(), "after": after.to_dict(), **step})
        return
    say(
        f"error {percent(before.rms_error_percent)} -> {percent(after.rms_error_percent)}, "
        f"chi2_reduced {before.chi2_reduced:.4g} -> {after.chi2_reduced:.4g}"
    )
    for text in beside_the_error(after):
        say(f"  {text}")
    units = {p.name: p.unit for p in before.motor.parameters}
    rows = {name: (value, bar) for name, value, bar in after.rows()}
    for name in {**before.parameters, **after.parameters}:
        old = show(before.parameters[name], units[name]) if name in before.parameters else "-"
        value, bar = rows.get(name, ("-", ""))
        say(f"  {name:34s} {old:>14s} -> {value:14s} {bar}".rstrip())
    if details is not None:
        _say_details(details)


def _say_details(step: JsonDict) -> None:
    """Print the error per band and the notes of a step of the ladder."""
    from motoremi.cli.output import say
    from motoremi.quantities import percent, show_band

    for band in step["bands"]:
        before = band["rms_error_percent_before"]
        was = "" if before is None else f"{before:8.4g} % ->"
        say(f"     {band['sweep']:5s} {show_band(*band['band_hz']):22s} {was:>13s} {percent(band['rms_error_percent'], 4)}")
    for note in step["notes"]:
        say(f"     {note}")


def ladder_(path: SessionPath, as_json: AsJson = False) -> None:
    """Show the ladder: the models so far and their errors."""
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.data.session import load
    from motoremi.model.effects.names import as_sum
    from motoremi.report.words import described, would_leave

    steps = load(path).ladder
    if as_json:
        emit_json({"schema": "motoremi.ladder/1", "steps": steps})
        return
    if not steps:
        say(f"the ladder is empty: motoremi fit {quoted(path)}")
    for number, step in enumerate(steps):
        fit = step["fit"]
        model = as_sum(("paper's circuit", *fit["effects"]))
        say(f"{number}  error {fit['rms_error_percent']:8.4g} %  chi2_reduced {fit['chi2_reduced']:10.4g}  {model}")
        _say_details(step)
        if "unexplained_percent" in fit:
            say(f"     the circuit {described(fit['unexplained_percent'])}")
    if steps and "unexplained_percent" in steps[-1]["fit"]:
        say(f"   {would_leave(steps[-1]['fit']['floor_percent'], steps[-1]['fit']['noise_percent'])}")
    elif steps:
        say(f"   fitted by an earlier version: motoremi fit {quoted(path)}")


def next_(
    path: SessionPath,
    without: Without = None,
    menu: Menu = None,
    as_json: AsJson = False,
) -> None:
    """Show the measurement with the most information about the possible explanations per minute at the bench."""
    from motoremi.cli.output import emit_json, say
    from motoremi.workflow_ask import question_of

    asked = question_of(path, without or [], menu)
    if as_json:
        emit_json(asked)
        return
    say(f"{asked['id'] or asked['stop']}: {asked['why']}")
    for one in asked["alternatives"][:5]:
        say(f"  or {one['id']:22s} {one['information_bits']:.2g} bits in {one['minutes']:.3g} min")
    if asked["asks"] is not None:
        say(f"then: {_answer(path, asked)}")


def _answer(path: Path, asked: JsonDict) -> str:
    """The command that imports the answer."""
    from motoremi.cli.output import quoted

    asks, session = asked["asks"], quoted(path)
    if asks["kind"] == "value":
        return f"motoremi import {session} --append --value {asks['condition']}=VALUE{asks['unit']}"
    files = {"short": "--short FILE...", "open": "--open FILE..."}
    named = files.get(asks["termination"], "--short FILE... --open FILE...")
    if asks["condition"] is None:
        return f"motoremi import {session} --append {named}"
    value = f"=VALUE{asks['unit']}" if asks["unit"] else ""
    return f"motoremi import {session} --append --condition {asked['condition_id']}{value} {named}"


def report_(
    context: typer.Context,
    paths: Annotated[list[Path], typer.Argument(metavar="SESSION", help="A session folder; several are compared.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the comparison of several sessions.")] = None,
    profile: Annotated[
        Path | None,
        typer.Option("--profile", metavar="FILE", help="Profile of the laboratory: TOML, kept with the session (docs/howto/report.md)."),
    ] = None,
    form: Annotated[str, typer.Option("--form", metavar="FORM", help="long, or short: two pages for a customer.")] = "long",
    sections: Annotated[
        str, typer.Option("--sections", metavar="NAMES", help=f"Sections of the long form, with commas between: {', '.join(SECTIONS)}.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Write the report as HTML, PDF, JSON, JUnit XML and CSV; for several sessions a comparison, each with the first."""
    from motoremi.report.contents import Choice

    if len(paths) == 1 and out is not None:
        raise BadInput("--out is for several sessions; the report of one goes into its own report folder")
    for name in ("profile", "form", "sections") if len(paths) > 1 else ():
        # In a settings file these options are allowed: they apply to reports of one session.
        if is_typed(context, name):
            raise BadInput(f"--{name} is for the report of one session")
    choice = Choice(form, frozenset(name.strip() for name in sections.split(",") if name.strip()))
    # A report creates half a million objects that live until its end; garbage collection would take a tenth of its time.
    gc.disable()
    try:
        from motoremi.cli.output import emit_json, say
        from motoremi.report.pdf import NOT_INSTALLED, can_render_pdf
        from motoremi.workflow import opened, report_session, report_together

        if len(paths) > 1:
            if out is None:
                raise BadInput("for a comparison of several sessions give a folder: --out DIR")
            files = report_together(paths, out)
        else:
            with opened(paths[0]) as store:
                files = report_session(store, profile, choice)
    finally:
        gc.enable()
    if as_json:
        emit_json({"schema": "motoremi.files/1", "files": [str(file) for file in files]})
        return
    for file in files:
        say(str(file))
    if not can_render_pdf():
        say(NOT_INSTALLED)


def plot_(
    path: SessionPath,
    what: Annotated[
        str, typer.Argument(metavar="WHAT", help="; ".join(f"{name}: {text}" for name, text in PLOTS.items()) + ".", show_default=False)
    ],
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="SVG, PNG or PDF; by default WHAT.svg.")] = None,
    element: Annotated[
        str | None,
        typer.Option(
            "--element",
            metavar="NAME",
            help=f"For inspection: {INSPECTED}",
        ),
    ] = None,
    effect: Annotated[str | None, typer.Option("--effect", metavar="ID", help="For signature: an effect of the catalogue.")] = None,
    as_json: AsJson = False,
) -> None:
    """Write one plot of the report."""
    from motoremi.cli.output import emit_json, say
    from motoremi.workflow_plots import figure_of

    file = plot_file(out if out is not None else Path(f"{what}.svg"))
    save_plot(figure_of(path, what, element, effect), file)
    if as_json:
        emit_json({"schema": "motoremi.files/1", "files": [str(file)]})
    else:
        say(str(file))


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "fit", fit_, 'motoremi fit my_motor --bound "La=1 uH:100 uH" --hold Ra=2.3Ohm')
    command(app, "compare", compare_, "motoremi compare my_motor --error-percent 5")
    command(app, "diagnose", diagnose_, "motoremi diagnose my_motor --json")
    command(app, "inspect", inspect_, "motoremi inspect my_motor --element La --plot la.svg")
    command(app, "add", add_, "motoremi add my_motor eddy-laminations")
    command(app, "drop", drop_, "motoremi drop my_motor")
    command(app, "ladder", ladder_, "motoremi ladder my_motor")
    command(app, "next", next_, "motoremi next my_motor")
    command(app, "report", report_, "motoremi report my_motor --profile laboratory.toml; motoremi report before after --out comparison")
    command(app, "plot", plot_, "motoremi plot my_motor fit --out fit.png")
