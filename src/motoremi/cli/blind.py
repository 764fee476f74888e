"""Commands of the blind test: challenge, scoreboard."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motoremi.cli.options import AsJson, Out, command
from motoremi.errors import BadInput

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict, Progress


def challenge_(
    out: Annotated[Path | None, typer.Argument(metavar="OUT", help="Session folder to make.", show_default=False)] = None,
    seed: Annotated[int | None, typer.Option(help="Determines the motor and what it hides; random by default.", min=0)] = None,
    opened: Annotated[Path | None, typer.Option("--reveal", metavar="DIR", help="Open the seal of a challenge and score the answer.")] = None,
    answer: Annotated[
        list[str] | None,
        typer.Option(
            "--answer",
            metavar="EFFECT",
            help="Your own answer instead of the session's diagnosis: effects (may be repeated), or adequate, or unexplained.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make a sealed session whose motor may hide something, or open the seal and score the answer."""
    from motoremi.blind.challenge import make_challenge, reveal
    from motoremi.cli.output import emit_json, quoted, say
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
            say(f"session: {out}\nnext: motoremi diagnose {quoted(out)}, then motoremi challenge --reveal {quoted(out)}")
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
    seed: Annotated[int | None, typer.Option(help="Determines the cases; random by default, and printed.", min=0)] = None,
    jobs: Annotated[int, typer.Option(help="Number of processes. With 1, each diagnosis of a motor uses all cores.", min=1)] = max(
        1, os.cpu_count() or 1
    ),
    hard: Annotated[bool, typer.Option("--hard", help="Motors measured outside the protocol, one departure each.")] = False,
    departure: Annotated[
        str | None, typer.Option("--departure", metavar="NAME", help="With --hard: only motors with this departure from the protocol.")
    ] = None,
    spectra: Annotated[bool, typer.Option("--spectra", help="Hidden effects of source and path, in emission spectra.")] = False,
    investigate: Annotated[
        bool, typer.Option("--investigate", help="Sealed motors investigated by several policies: minutes at the bench, names, mistakes found.")
    ] = False,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Diagnose many simulated motors with hidden effects and count how often the answer is right."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, say

    if hard + spectra + investigate > 1:
        raise BadInput("--hard, --spectra and --investigate are different scoreboards: give one of them")
    if departure is not None and not hard:
        raise BadInput("--departure goes with --hard")
    chosen = seed if seed is not None else secrets.randbelow(1_000_000)
    board = _boards(departure)["hard" if hard else "spectra" if spectra else "investigate" if investigate else "usual"]
    with progress_bars(as_json) as bars:
        result = {"seed": chosen, **board.summary(board.play(chosen, cases, jobs, bars.bar(board.label)))}
    if out is not None:
        board.write(result, out)
    if as_json:
        emit_json(result)
        return
    say(board.text(result))
    if out is not None:
        say(f"tables, data and picture: {out}")


@dataclass(frozen=True)
class _Board:
    """A kind of scoreboard: functions that play it, summarise it, format it and write it."""

    label: str
    play: Callable[[int, int, int, Progress | None], Any]
    summary: Callable[[Any], JsonDict]
    text: Callable[[JsonDict], str]
    write: Callable[[JsonDict, Path], None]


def _boards(departure: str | None) -> dict[str, _Board]:
    from motoremi.blind import hard, hard_table, investigation, investigation_table, scoreboard, scoreboard_text, spectra

    return {
        "usual": _Board("blind test", scoreboard.play_all, scoreboard.summary, scoreboard_text.markdown, scoreboard_text.write_all),
        "hard": _Board(
            "blind test outside the protocol", partial(hard.play_all, departure=departure), hard.summary, hard_table.markdown, hard_table.write_all
        ),
        "investigate": _Board(
            "investigations", investigation.play_all, investigation.summary, investigation_table.markdown, investigation_table.write_all
        ),
        "spectra": _Board("blind test of spectra", spectra.play_all, spectra.summary, spectra.markdown, spectra.write_all),
    }


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "challenge", challenge_, "motoremi challenge blind --seed 3")
    command(app, "scoreboard", scoreboard_, "motoremi scoreboard --cases 60 --out scores")
