"""`motoremi fleet`: fit and diagnose thousands of sessions."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, command
from motoremi.data.text import clean_text

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict, Progress

# Number of motors that are listed, and seconds between two lines of progress in a log.
SHOWN, LOGGED_S = 10, 10.0


def logged() -> Progress:
    """Progress for a log file, where no bars are shown: a line now and then on standard error, with the time."""
    last = -LOGGED_S

    def advance(name: str, done: int, total: int) -> None:
        nonlocal last
        if time.monotonic() > last + LOGGED_S or done == total:
            last = time.monotonic()
            now = datetime.now().astimezone().isoformat(timespec="seconds")
            sys.stderr.write(f"{now} {done} of {total} sessions, last {clean_text(name)}\n")
            sys.stderr.flush()

    return advance


@contextmanager
def continuable(results: Path) -> Iterator[None]:
    """If the block is stopped, say how many results are kept and how to continue."""
    from motoremi.errors import Stopped

    try:
        yield
    except KeyboardInterrupt as stop:
        kept = results.read_bytes().count(b"\n") if results.is_file() else 0
        raise Stopped(f"stopped; {kept} results are kept in {results}: the same command continues") from stop


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
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TEXT",
            help="With --golden: allowed deviation from the golden motors, 10% for all elements or Ca=20% for one; may be repeated. "
            "One golden motor is enough then.",
            show_default=False,
        ),
    ] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit status 1 if a motor is beyond the limits, or a session has no result or serious findings.")
    ] = False,
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
    from motoremi.errors import BadInput
    from motoremi.fleet.fleet_frames import motors_of, table_of
    from motoremi.fleet.limits import golden_sessions, parse_tolerances
    from motoremi.fleet.page import fleet_html
    from motoremi.fleet.run import FIGURES, RESULTS, DaskCluster, LocalProcesses, run_fleet, sessions_in, settled
    from motoremi.fleet.statistics import fleet_figures
    from motoremi.fleet.work import Job
    from motoremi.interrupts import stopped_by_signals

    root = folder.resolve()
    target = out if out is not None else root.with_name(f"{root.name}-fleet")
    pages = str(target.resolve() / "reports") if reports else ""
    sessions = sessions_in(root)
    tolerances = parse_tolerances(tolerance or ())
    if tolerances and golden is None:
        raise BadInput("--tolerance needs the motors that it is counted from: --golden PATTERN")
    if golden is not None:
        # A mistyped pattern is reported before hours of work.
        golden_sessions(sessions, golden)
    work = [Job(session, str(root), not fit_only, seed, pages) for session in sessions]
    maker = DaskCluster(scheduler) if scheduler is not None else LocalProcesses(jobs)
    try:
        with stopped_by_signals(), continuable(target / RESULTS), progress_bars(as_json) as bars:
            computed = run_fleet(work, target, maker, bars.bar("fleet") or logged())
    finally:
        if isinstance(maker, DaskCluster):
            maker.close()
    figures = fleet_figures(settled(work, target / RESULTS), golden, tolerances)
    # The values of each session are in the table.
    shown = {key: value for key, value in figures.items() if key not in ("values", "sigma", "answers", "times", "numbers", "serials")}
    write_whole(target / FIGURES, to_page(shown).encode())
    write_whole(target / "parameters.csv", table_of(figures).to_csv(lineterminator="\n").encode())
    # Spreadsheets need the mark at the beginning to read names with umlauts.
    write_whole(target / "motors.csv", motors_of(figures).to_csv(lineterminator="\n").encode("utf-8-sig"))
    write_whole(target / "fleet.html", fleet_html(figures, folder.name).encode())
    results = Counter(one["result"] for one in figures["motors"])
    doubtful = results["beyond limits"] + results["no result"] + results["data in doubt"]
    if as_json:
        emit_json({**shown, "computed_now": computed, "folder": str(target), "report": str(target / "fleet.html")})
    else:
        _say(figures, results["beyond limits"], computed)
        say(f"report: {target / 'fleet.html'}\ntables: {', '.join(str(target / name) for name in (FIGURES, 'motors.csv', 'parameters.csv'))}")
    raise typer.Exit(int(results["no result"] == len(sessions) or (strict and doubtful > 0)))


def _say(figures: JsonDict, beyond: int, computed: int) -> None:
    """The most important of the figures."""
    from motoremi.cli.output import say
    from motoremi.fleet.motors import counted, to_look_at
    from motoremi.fleet.page import NOT_LOOKED_FOR

    counts, told = figures["counts"], to_look_at(figures)
    say(f"{counts['sessions']} sessions, {computed} computed now, {counts['troubled']} troubled")
    if not figures["diagnosed"]:
        say(f"  missing effects and findings: {NOT_LOOKED_FOR}")
    for name, number in figures["effects"].items():
        say(f"  {name:28s} {number}")
    for name, sessions in figures["findings"].items():
        say(f"  found, serious: {name:12s} {len(sessions)}")
    if figures["no_limits"]:
        say(f"  no limits from the golden set: {figures['no_limits']} (or state what may differ: --tolerance 10%)")
    elif figures["golden"]:
        say(f"  beyond the golden set's limits: {beyond} motors")
    say(f"  {counted(figures)}")
    for one in told[:SHOWN]:
        say(f"  {one['session']}: {one['result']}: {'; '.join(one['reasons'])}")
    if len(told) > SHOWN:
        say(f"  and {len(told) - SHOWN} more")
    for what, groups in (("serial number", figures["alike"]["serial"]), ("data", figures["alike"]["data"])):
        for sessions in groups[:SHOWN]:
            say(f"  the same {what}: {', '.join(sessions)}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "fleet", fleet_, 'motoremi fleet production --golden "golden/*"')
