"""`motoremi demo --investigate`: a motor with two explanations, and the measurement that decides between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motoremi.cli.bench import tell
from motoremi.cli.investigate import investigated, show_end

if TYPE_CHECKING:
    from pathlib import Path

    from motoremi.schema.procedure import Procedure

BUDGET_MINUTES, ODDS = 120.0, 20.0


def demo_investigation(folder: Path, seed: int, effect: str, *, as_json: bool) -> None:
    """Measure a simulated motor once, then investigate it."""
    from motoremi.cli.output import emit_json, say
    from motoremi.schema.bench_file import BenchFile
    from motoremi.workflow_on_bench import Plan

    hidden = () if effect == "none" else (effect,)
    if not as_json:
        say("A simulated motor hides something; it is measured once, then the measurements that decide are chosen and made.\n")
    measured_once(folder, seed, hidden, show=not as_json)
    found = investigated(folder, BenchFile(backend="sim"), Plan(BUDGET_MINUTES, ODDS), quiet=as_json)
    if as_json:
        emit_json({**found.to_dict(), "session": str(folder), "hidden": list(hidden), "seed": seed})
        return
    show_end(found, folder)
    say(f"\nWhat the motor hid: {', '.join(hidden) or 'nothing'} (seed {seed})\nsession: {folder}")


def measured_once(folder: Path, seed: int, hidden: tuple[str, ...], *, show: bool = False) -> None:
    """A session with one sweep of each termination of a simulated motor, whose bench is kept with it."""
    from motoremi.data.session import SessionWriter
    from motoremi.run.hidden_bench import keep_bench
    from motoremi.run.runner import run, start_document
    from motoremi.schema.bench_file import BenchFile
    from motoremi.virtual.simulated_bench import SimulatedBench

    bench_file = BenchFile(backend="sim", operator="demo", seed=seed, effects=hidden)
    procedure = _measuring_only()
    bench = SimulatedBench(seed, hidden)
    try:
        writer = SessionWriter.create(folder, {**start_document(procedure, bench_file), "motor": f"simulated motor {seed}"})
        keep_bench(writer, seed, hidden)
        if show:
            writer.subscribe(tell)
        run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    finally:
        bench.close()


def _measuring_only() -> Procedure:
    """The usual impedance test without its analysis steps, with one sweep of each termination."""
    from motoremi.schema.procedure import load_procedure, parse_procedure

    source = load_procedure("impedance_only").source
    steps = [
        {**step, "repeat": 1} if step["do"] == "sweep" else step for step in source["steps"] if step["do"] in ("identify", "compensate", "sweep")
    ]
    return parse_procedure({**source, "steps": steps}, "impedance_only.toml")
