"""Commands of the blind test: challenge, scoreboard."""

from __future__ import annotations

import os
import secrets
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from motoremi.cli.options import AsJson, Out, command
from motoremi.errors import BadInput


def challenge_(
    out: Annotated[Path | None, typer.Argument(metavar="[OUT]", help="Session folder to make.", show_default=False)] = None,
    seed: Annotated[int | None, typer.Option(help="Which motor and what it hides; by default nobody knows.", min=0)] = None,
    opened: Annotated[Path | None, typer.Option("--reveal", metavar="DIR", help="Open the seal of a challenge and score the answer.")] = None,
    answer: Annotated[
        list[str] | None,
        typer.Option("--answer", metavar="EFFECT", help="Your own answer, instead of the session's diagnosis; may be repeated."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make a sealed session whose motor may hide something, or open the seal and score the answer."""
    from motoremi.blind.challenge import make_challenge, reveal
    from motoremi.cli.output import emit_json, say
    from motoremi.model.effects import find_effect

    if (out is None) == (opened is None):
        raise BadInput("give a folder to make, or --reveal DIR to open one")
    if out is not None:
        if answer:
            raise BadInput("--answer goes with --reveal")
        make_challenge(out, seed if seed is not None else secrets.randbelow(2**31))
        if as_json:
            emit_json({"schema": "motoremi.challenge/1", "session": str(out)})
        else:
            say(f"session: {out}\nnext: motoremi diagnose {out}, then motoremi challenge --reveal {out}")
        return
    assert opened is not None
    for name in answer or []:
        if name not in ("adequate", "unexplained"):
            find_effect(name)
    found = reveal(opened, answer or [])
    if as_json:
        emit_json({"schema": "motoremi.revealed/1", **asdict(found)})
        return
    say(f"hidden: {', '.join(found.hidden) or 'nothing'}")
    if found.answer is None:
        say(f"no answer yet: motoremi diagnose {opened}")
    else:
        say(f"answer: {' + '.join(found.answer.effects) or found.answer.verdict}: {found.outcome}")


def scoreboard_(
    cases: Annotated[int, typer.Option(help="How many blind cases.", min=1)] = 300,
    seed: Annotated[int | None, typer.Option(help="Which cases; by default nobody knows, and it is printed.", min=0)] = None,
    jobs: Annotated[int, typer.Option(help="Processes. With 1 a diagnosis has two cores, as at the bench.", min=1)] = max(1, os.cpu_count() or 1),
    spectra: Annotated[bool, typer.Option("--spectra", help="Hidden effects of source and path, seen in emission spectra.")] = False,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Diagnose many simulated motors with hidden effects and count how often the answer is right."""
    from motoremi.blind import spectra as of_spectra
    from motoremi.blind.scoreboard import play_all, summary
    from motoremi.blind.table import markdown, write_all
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, say

    chosen = seed if seed is not None else secrets.randbelow(1_000_000)
    if spectra:
        with progress_bars(as_json) as bars:
            played = of_spectra.play_all(chosen, cases, jobs, bars.bar("blind test of spectra"))
        found = {"seed": chosen, **of_spectra.summary(played)}
        if out is not None:
            of_spectra.write_all(found, out)
        if as_json:
            emit_json(found)
        else:
            say(of_spectra.markdown(found))
        return
    with progress_bars(as_json) as bars:
        result = {"seed": chosen, **summary(play_all(chosen, cases, jobs, bars.bar("blind test")))}
    if out is not None:
        write_all(result, out)
    if as_json:
        emit_json(result)
        return
    say(markdown(result))
    if out is not None:
        say(f"tables, data and picture: {out}")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "challenge", challenge_, "motoremi challenge blind --seed 3")
    command(app, "scoreboard", scoreboard_, "motoremi scoreboard --cases 60 --out scores")
