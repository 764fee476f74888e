"""Commands on the spectra of a session: predict, limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, SessionPath, command, corrections_of, plot_file, save_plot

if TYPE_CHECKING:
    from motoremi.emission.spectrum_fit import EmissionFit


def predict_(
    path: SessionPath,
    setup: Annotated[
        Path | None, typer.Option("--setup", metavar="FILE", help="TOML: source, path, receiver (see docs/emission.md); kept in the session.")
    ] = None,
    limit: Annotated[str | None, typer.Option("--limit", metavar="NAME", help="A limit ('motoremi limits') or your own .toml; kept.")] = None,
    uncertainty_db: Annotated[
        float | None,
        typer.Option("--uncertainty", metavar="DB", help="Expanded uncertainty (k = 2); 3.4 dB at first; kept.", min=0, max=40),
    ] = None,
    guard_band_db: Annotated[
        float | None,
        typer.Option(
            "--guard-band",
            metavar="DB",
            help="Guard band of the verdicts, instead of the uncertainty with that of the corrections; 0 is simple acceptance; kept.",
            min=0,
            max=40,
        ),
    ] = None,
    corrections: Annotated[
        Path | None,
        typer.Option(
            "--corrections",
            metavar="FILE",
            help="Attenuators, cables, transducers in front of the receiver (TOML with correction tables); replaces earlier ones; kept.",
        ),
    ] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Picture as SVG, PNG or PDF.")] = None,
    as_json: AsJson = False,
) -> None:
    """Predict the spectrum at the LISN from source and fitted motor; compare it with the measured one and the limit; FAIL is exit status 1."""
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.workflow import opened
    from motoremi.workflow_emission import predict_session

    file = None if plot is None else plot_file(plot)
    chain = None if corrections is None else corrections_of(corrections)
    with opened(path) as store:
        result = predict_session(store, setup, limit, uncertainty_db, chain, guard_band_db=guard_band_db)
    if file is not None:
        save_plot(result.plot(), file)
    if as_json:
        emit_json(result.to_dict())
    else:
        say(repr(result))
        for remark in result.remarks():
            say(f"note: {remark}")
        if result.spectra and result.predicted_dbuv:
            say(f"next: motoremi diagnose {quoted(path)} --emission")
    raise typer.Exit(1 if result.verdict == "fail" else 0)


def limits_(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="One limit in full; or the path of your own .toml.", show_default=False)
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Limit lines with their detectors and sources, and which values are not confirmed."""
    from motoremi.cli.output import emit_json, say
    from motoremi.emission.limit import find_limit, limit_names

    limits = [find_limit(one) for one in ([name] if name is not None else limit_names())]
    if as_json:
        emit_json({"schema": "motoremi.limits/1", "limits": [limit.to_dict() for limit in limits]})
        return
    for limit in limits:
        doubt = f"  NOT CONFIRMED: {', '.join(limit.unconfirmed)}" if limit.unconfirmed else ""
        say(f"{limit.name:28s} {limit.title} ({', '.join(line.detector for line in limit.lines)}){doubt}")
        if name is not None:
            if limit.note:
                say(f"  {limit.note}")
            for line in limit.lines:
                say(f"  {line.detector}: {line.source}")
                for low, high, first, last in line.segments:
                    say(f"    {low / 1e6:8.3f} - {high / 1e6:6.3f} MHz  {first:g} -> {last:g} dBuV" if first != last else
                        f"    {low / 1e6:8.3f} - {high / 1e6:6.3f} MHz  {first:g} dBuV")  # fmt: skip


def diagnose_spectra(path: Path, from_base: bool, as_json: bool) -> None:
    """`motoremi diagnose SESSION --emission`."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, quoted, say
    from motoremi.diagnosis.belief import after_verdict
    from motoremi.workflow import opened
    from motoremi.workflow_emission import diagnose_emission_session

    with opened(path) as store, progress_bars(as_json) as bars:
        result = diagnose_emission_session(store, from_base, bars.bar("diagnosing the spectra"))
    if as_json:
        emit_json(result.to_dict())
        return
    say(repr(result))
    say("  evidence (best first):")
    for candidate in result.candidates:
        name = candidate.effect.name
        probability = after_verdict(result.probabilities[name], result.verdict, result.confidence)
        say(f"    {name:20s} p {probability:<9.3g} chi2 {candidate.fit.chi2_reduced:<8.3g} error {candidate.fit.rms_error_db:.2f} dB")
    if result.effects:
        say(f"next: motoremi add {quoted(path)} {' '.join(result.effects)}")


def show_emission_step(before: EmissionFit, after: EmissionFit, as_json: bool) -> None:
    """The error before and after a step of the emission's ladder."""
    from motoremi.cli.output import emit_json, say
    from motoremi.emission.source_effects import find_source_effect
    from motoremi.quantities import show

    if as_json:
        emit_json({"schema": "motoremi.step/1", "of": "emission", "before": before.to_dict(), "after": after.to_dict()})
        return
    say(f"error {before.rms_error_db:.2f} dB -> {after.rms_error_db:.2f} dB rms, chi2 {before.chi2_reduced:.3g} -> {after.chi2_reduced:.3g}")
    for name in after.effects:
        for parameter in find_source_effect(name).parameters:
            value = after.parameters.get(f"{name}.{parameter.name}")
            if value is not None:
                say(f"  {name}.{parameter.name} = {show(value, parameter.unit)}")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "predict", predict_, "motoremi predict my_motor --limit cispr32-b --setup bench_setup.toml")
    command(app, "limits", limits_, "motoremi limits cispr25-class5")
