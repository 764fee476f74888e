"""`motoremi fleet`: fit and diagnose thousands of sessions."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, command

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict


def fleet_(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder with sessions, at any depth.", show_default=False)],
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Results; by default DIR-fleet beside DIR.", show_default=False)] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="An existing Dask cluster, tcp://HOST:PORT (extra fleet).", show_default=False)
    ] = None,
    jobs: Annotated[int, typer.Option(help="Number of processes on this machine.", min=1)] = max(1, os.cpu_count() or 1),
    golden: Annotated[
        str | None, typer.Option(metavar="PATTERN", help='Sessions of motors known to be good, such as "golden/*": limits for the rest.')
    ] = None,
    fit_only: Annotated[bool, typer.Option("--fit-only", help="Fit the paper's circuit and do not look for missing effects.")] = False,
    reports: Annotated[bool, typer.Option("--reports", help="Write each session's own report as well, into reports/ of the results.")] = False,
    seed: Annotated[int, typer.Option(help="Start of the random numbers; the same seed gives the same result.", min=0)] = 1,
    as_json: AsJson = False,
) -> None:
    """Fit and diagnose all sessions below a folder, then write one report on all; run again to continue where it stopped."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, say
    from motoremi.data.plain import to_page
    from motoremi.data.storage import write_whole
    from motoremi.fleet.page import NOT_LOOKED_FOR, fleet_html
    from motoremi.fleet.run import RESULTS, DaskCluster, LocalProcesses, run_fleet, sessions_in, settled
    from motoremi.fleet.statistics import fleet_figures, golden_sessions
    from motoremi.fleet.work import Job

    root = folder.resolve()
    target = out if out is not None else root.with_name(f"{root.name}-fleet")
    pages = str(target.resolve() / "reports") if reports else ""
    sessions = sessions_in(root)
    if golden is not None:
        # A mistyped pattern is reported before hours of work.
        golden_sessions(sessions, golden)
    work = [Job(session, str(root), not fit_only, seed, pages) for session in sessions]
    maker = DaskCluster(scheduler) if scheduler is not None else LocalProcesses(jobs)
    try:
        with progress_bars(as_json) as bars:
            computed = run_fleet(work, target, maker, bars.bar("fleet"))
    finally:
        if isinstance(maker, DaskCluster):
            maker.close()
    figures = fleet_figures(settled(work, target / RESULTS), golden)
    # The values of each session are in the table.
    shown = {key: value for key, value in figures.items() if key not in ("values", "sigma", "answers", "times", "serials")}
    write_whole(target / "fleet.json", to_page(shown).encode())
    write_whole(target / "parameters.csv", _parameter_table(figures).encode())
    write_whole(target / "fleet.html", fleet_html(figures, folder.name).encode())
    if as_json:
        emit_json({**shown, "computed_now": computed, "folder": str(target), "report": str(target / "fleet.html")})
        return
    counts = figures["counts"]
    say(f"{counts['sessions']} sessions, {computed} computed now, {counts['troubled']} troubled")
    if not figures["diagnosed"]:
        say(f"  missing effects and findings: {NOT_LOOKED_FOR}")
    for name, number in figures["effects"].items():
        say(f"  {name:28s} {number}")
    for name, sessions in figures["findings"].items():
        say(f"  found, serious: {name:12s} {len(sessions)}")
    if figures["no_limits"]:
        say(f"  no limits from the golden set: {figures['no_limits']}")
    elif golden is not None:
        say(f"  beyond the golden set's limits: {len({entry['session'] for entry in figures['beyond_limits']})} motors")
    for trouble in figures["troubles"][:10]:
        say(f"  {trouble['session']}: {trouble['trouble']}")
    say(f"report: {target / 'fleet.html'}\ntables: {target / 'fleet.json'}, {target / 'parameters.csv'}")


def _parameter_table(figures: JsonDict) -> str:
    from motoremi.fleet.fleet_frames import table_of

    return str(table_of(figures).to_csv(lineterminator="\n"))


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "fleet", fleet_, 'motoremi fleet production --golden "golden/*"')
