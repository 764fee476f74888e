"""Commands that run a bench: run, replay."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.options import AsJson, Out, SessionPath, command

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict


def run_(
    procedure: Annotated[str, typer.Argument(metavar="PROCEDURE", help="A TOML file, or a ready one: full_motor_test, impedance_only.")],
    bench: Annotated[str | None, typer.Option(help="Bench file with resources and calibration dates; 'sim' is the embedded bench.")] = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Run a bench procedure; a session folder is the result. FAIL if a comparison in it fails."""
    from motoremi.bench.procedure import BenchFile, load_bench_file, load_procedure
    from motoremi.bench.runner import make_bench, run, start_document
    from motoremi.cli.output import emit_json, progress_bar, say
    from motoremi.data.session import SessionWriter
    from motoremi.workflow import analyse

    steps = load_procedure(procedure)
    bench_file = load_bench_file(bench) if bench is not None else BenchFile()
    folder = out if out is not None else fresh_folder("run")
    made = make_bench(bench_file)
    try:
        writer = SessionWriter.create(folder, start_document(steps, bench_file))
        if not as_json:
            writer.subscribe(tell)
        with progress_bar("diagnosing", as_json) as progress:
            outcome = run(steps, made, writer, analyse=analyse(progress), prompt=_ask if bench_file.backend != "sim" else lambda text: None)
    finally:
        made.close()
    if as_json:
        emit_json({"schema": "motoremi.run/1", "session": str(folder), "verdict": "pass" if outcome.passed else "fail", **outcome.to_dict()})
    else:
        say(f"{'PASS' if outcome.passed else 'FAIL'}: session {folder}")
    raise typer.Exit(0 if outcome.passed else 1)


def _ask(text: str) -> None:
    """Tell the operator what to connect and wait."""
    typer.prompt(f"{text}\nPress Enter when done", default="", show_default=False, err=True)


def replay_(path: SessionPath, out: Out = None, as_json: AsJson = False) -> None:
    """Run a session's procedure again, its recorded traffic answering; any difference is an error."""
    from motoremi.bench.procedure import parse_procedure
    from motoremi.bench.replay import ReplayBench
    from motoremi.bench.runner import run
    from motoremi.cli.output import emit_json, say
    from motoremi.data.session import SessionWriter, load
    from motoremi.errors import BadInput
    from motoremi.workflow import analyse

    session = load(path)
    if "procedure" not in session.start:
        raise BadInput(f"{path} was imported, not measured: there is no traffic to replay")
    steps = parse_procedure(session.start["procedure"], str(path))
    folder = out if out is not None else fresh_folder("replay")
    bench = ReplayBench(session.traffic())
    start = {key: value for key, value in session.start.items() if key in ("title", "procedure", "operator", "backend", "calibrated")}
    writer = SessionWriter.create(folder, {**start, "replay_of": path.name})
    if not as_json:
        writer.subscribe(tell)
    outcome = run(steps, bench, writer, analyse=analyse(), prompt=lambda text: None)
    bench.finish()
    if as_json:
        emit_json({"schema": "motoremi.replay/1", "session": str(folder), "same": True, **outcome.to_dict()})
    else:
        say(f"replayed without a difference: session {folder}")


def tell(document: JsonDict) -> None:
    """What a run says of itself, a line for each thing worth knowing."""
    from motoremi.cli.output import say
    from motoremi.quantities import show_band

    kind = document["kind"]
    if kind == "instrument":
        identity = document["identity"]
        say(f"  {document['role']}: {identity['vendor']} {identity['model']} serial {identity['serial']} at {document['resource']}")
    elif kind in ("sweep", "spectrum"):
        what = document.get("termination") or document.get("detector")
        say(f"  {what} {kind}: {document['points']} points, {show_band(*document['span_hz'])} -> {document['file']}")
    elif kind == "step-start":
        detail = " ".join(str(value) for value in document["parameters"].values())
        say(f"[{document['step']}/{document['of']}] {document['do']} {detail}".rstrip())
    elif kind == "verdict":
        effects = ", ".join(document["result"].get("effects", []))
        say(f"  {document['do']}: {document['result'].get('verdict')}" + (f" ({effects})" if effects else ""))


def fresh_folder(prefix: str) -> Path:
    """A new folder name in the current directory."""
    return Path(f"motoremi-{prefix}-{datetime.now(UTC):%Y%m%dT%H%M%S%f}Z")


def register(app: typer.Typer) -> None:
    """Add these commands."""
    command(app, "run", run_, "motoremi run full_motor_test --bench sim --out session")
    command(app, "replay", replay_, "motoremi replay session --out again")
