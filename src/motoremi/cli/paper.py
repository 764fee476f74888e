"""`motoremi paper`: the paper's Fig. 6 - 8 on simulated data, and checks of its numbers."""

from __future__ import annotations

import typer

from motoremi.cli.options import AsJson, Out, command


def paper_(out: Out = None, as_json: AsJson = False) -> None:
    """Reproduce Fig. 6 - 8 of Liu, Wang and Nan (2011) on simulated data and show where its numbers disagree; --out draws the figures."""
    from motoremi.cli.output import emit_json, say
    from motoremi.paper.paper_figures import prepare, write_figures
    from motoremi.paper.reproduction import reproduce
    from motoremi.paper.reproduction_text import markdown

    if out is not None:
        prepare(out)
    result = reproduce()
    files = write_figures(result, out) if out is not None else []
    if as_json:
        emit_json({**result.to_dict(), "files": [str(path) for path in files]})
        return
    say(markdown(result))
    for path in files:
        say(str(path))


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "paper", paper_, "motoremi paper --out figures")
