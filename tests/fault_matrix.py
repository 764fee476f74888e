"""Every fault at every step of the full procedure that talks to an instrument: how each run ends. `make faults` prints the table."""

from __future__ import annotations

import copy
import functools
import itertools
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.data.session import Session, SessionWriter, load, verify
from motoremi.data.state import STATE_QUANTITIES, marks_of
from motoremi.errors import InstrumentError, MotoremiError
from motoremi.run.runner import run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure, parse_procedure
from motoremi.virtual.faults import FAULTS, FaultLayer
from motoremi.virtual.simulated_bench import SimulatedBench

SEED = 5
# Largest difference of a repeated sweep, due to another draw of the analyser's noise, whose largest sigma here is about 0.1 %.
NOISE = 0.02
# A motor that was waited for a little longer is a little warmer.
STATE_NOISE = 0.02
MEASURED = ("sweep", "spectrum", "final")
BENCH_FILE = BenchFile(backend="sim", seed=SEED)


@functools.cache
def small(name: str = "full_motor_test") -> Procedure:
    """A ready procedure with few points: every step, little data."""
    data = copy.deepcopy(load_procedure(name).source)
    if "sweep" in data:
        data["sweep"]["points"] = 11
    if "spectrum" in data:
        data["spectrum"]["step"] = "1 MHz"
    for step in data["steps"]:
        if step["do"] == "wait-for" and step["hold"] == "300 s":
            step["every"] = "100 s"
    return parse_procedure(data, name)


def measured(folder: Path, procedure: Procedure, bench: SimulatedBench) -> Session:
    """A run on the simulated bench, without the analysing steps."""
    writer = SessionWriter.create(folder, start_document(procedure, BENCH_FILE))
    run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    return load(folder)


@dataclass(frozen=True)
class Cell:
    """Where a fault is applied: the exchanges of one instrument in one step, or in the safe state after the last step.

    `stored` is how many sweeps and spectra a run without the fault has stored before.
    """

    step: int
    do: str
    role: str
    exchanges: tuple[int, ...]
    stored: int

    @property
    def title(self) -> str:
        return f"{self.step} {self.do} {self.role}" if self.step else f"{self.do} {self.role}"


def cells(session: Session) -> list[Cell]:
    """The exchanges of each instrument in each step, from what a healthy run recorded."""
    found: dict[tuple[int, str, str], list[int]] = {}
    counts: Counter[str] = Counter()
    left: set[str] = set()
    starts, before, stored = [], {0: len(session.sweeps) + len(session.spectra) + len(session.finals)}, 0
    for document in session.documents:
        stored += document["kind"] in MEASURED
        if document["kind"] == "step-start":
            starts.append((document["time"], int(document["step"]), str(document["do"])))
            before[int(document["step"])] = stored
    for record in session.traffic():
        role = str(record["instrument"])
        if record["direction"] == "leave":
            left.add(role)
        if record["direction"] != "write":
            continue
        counts[role] += 1
        # A step's document is written before its first exchange.
        step, do = (0, "leaving") if role in left else [(number, name) for time, number, name in starts if time <= record["time"]][-1]
        found.setdefault((step, do, role), []).append(counts[role])
    return [Cell(step, do, role, tuple(exchanges), before[step]) for (step, do, role), exchanges in found.items()]


def places(cell: Cell, count: int) -> list[int]:
    """`count` exchanges of a cell, first and last among them; all of them if `count` is 0."""
    if not count or count >= len(cell.exchanges):
        return list(cell.exchanges)
    return [cell.exchanges[round(i)] for i in np.linspace(0, len(cell.exchanges) - 1, count)]


def placed(procedure: Procedure) -> SimulatedBench:
    """A bench that has every instrument of the procedure from the start."""
    bench = SimulatedBench(SEED)
    for role, spec in procedure.instruments.items():
        bench.open(role, spec.driver, spec.resource, lambda record: None, {role: spec.options}).close()
    return bench


def ending(kind: str, cell: Cell, at: int, reference: Session, folder: Path, name: str = "full_motor_test") -> str:
    """How a run with this fault ends: "error", "recovered", "marked", "no fault", or "BAD: ..."."""
    procedure = small(name)
    bench = placed(procedure)
    layer = FaultLayer(bench.devices[cell.role], kind, at)
    writer = SessionWriter.create(folder, start_document(procedure, BENCH_FILE))
    acknowledged: list[JsonDict] = []
    writer.subscribe(acknowledged.append)
    error: MotoremiError | None = None
    try:
        run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    except MotoremiError as trouble:
        error = trouble
    except Exception as trouble:
        return f"BAD: {type(trouble).__name__}: {trouble}"
    finally:
        bench.close()
    if not layer.occurred:
        return "no fault"
    # Without a supply on the bench, the operator switches the motor's supply.
    if (
        "supply" in procedure.instruments
        and bench.stand.driven
        and not any("switch the supply off by hand" in document.get("problem", "") for document in acknowledged)
    ):
        return "BAD: the motor is left running without a message"
    return _judged(error, acknowledged, reference, folder, cell.stored)


def _judged(error: MotoremiError | None, acknowledged: list[JsonDict], reference: Session, folder: Path, least: int) -> str:
    if problems := verify(folder):
        return f"BAD: {problems[0]}"
    session = load(folder)
    shown = [document["file"] for document in acknowledged if document["kind"] in MEASURED]
    stored = [document["file"] for document in session.documents if document["kind"] in MEASURED]
    if shown != stored:
        return "BAD: the documents shown to listeners and those stored differ"
    if len(stored) < least:
        return f"BAD: {len(stored)} stored, {least} were measured before"
    if wrong := _wrong_data(session, reference):
        return f"BAD: {wrong}"
    if error is not None:
        line = str(error)
        if error.exit_status != InstrumentError.exit_status or not line or "\n" in line or len(line) > 500:
            return f"BAD: error {line!r} with status {error.exit_status}"
        return "error" if session.status == "failed" else f"BAD: status {session.status}"
    if session.status != "done" or len(stored) != len(reference.sweeps) + len(reference.spectra) + len(reference.finals):
        return "BAD: ended well without all data"
    marked = any(spectrum.overload.any() or marks_of(spectrum.metadata.get("state")) for spectrum in (*session.spectra, *session.finals))
    return "marked" if marked else "recovered"


def _wrong_data(session: Session, reference: Session) -> str:
    for mine, theirs in zip(session.sweeps, reference.sweeps, strict=False):
        if mine.frequency_hz.shape != theirs.frequency_hz.shape or not np.array_equal(mine.frequency_hz, theirs.frequency_hz):
            return f"{mine.termination} sweep on other frequencies"
        if (worst := np.max(np.abs(mine.impedance_ohm / theirs.impedance_ohm - 1))) > NOISE:
            return f"{mine.termination} sweep wrong by {100 * worst:.3g} %"
        if {**mine.metadata["settings"]} != {**theirs.metadata["settings"]}:
            return f"{mine.termination} sweep with other settings"
    scans = itertools.chain(zip(session.spectra, reference.spectra, strict=False), zip(session.finals, reference.finals, strict=False))
    for ours, other in scans:
        if not np.array_equal(ours.frequency_hz, other.frequency_hz):
            return f"{ours.detector} spectrum on other frequencies"
        if wrong := _wrong_state(ours.metadata.get("state", {}), other.metadata.get("state", {})):
            return f"{ours.detector} spectrum: {wrong}"
        if (off := np.max(np.abs(ours.level_dbuv - other.level_dbuv))) > NOISE:
            return f"{ours.detector} spectrum wrong by {off:.3g} dB"
    return ""


def _wrong_state(mine: JsonDict, theirs: JsonDict) -> str:
    """A reading that is another one than on the healthy bench, and is not marked."""
    if "outside" in mine:
        return ""
    wrong = [key for key in STATE_QUANTITIES if key in mine and abs(mine[key] - theirs[key]) > STATE_NOISE * max(1.0, abs(theirs[key]))]
    return f"{wrong[0]} is {mine[wrong[0]]} instead of {theirs[wrong[0]]}, and not marked" if wrong else ""


def matrix(
    per_cell: int,
    kinds: Iterable[str] = FAULTS,
    steps: Collection[str] = (),
    name: str = "full_motor_test",
    roles: Collection[str] = (),
) -> tuple[dict[str, dict[str, Counter[str]]], list[str]]:
    """Kind -> cell -> how often which ending; and every bad one in words. `steps` and `roles` limit it to cells of these."""
    root = Path(tempfile.mkdtemp(prefix="motoremi-faults-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
    table: dict[str, dict[str, Counter[str]]] = {}
    bad: list[str] = []
    try:
        bench = SimulatedBench(SEED)
        reference = measured(root / "reference", small(name), bench)
        bench.close()
        for kind in kinds:
            for cell in (cell for cell in cells(reference) if (not steps or cell.do in steps) and (not roles or cell.role in roles)):
                count = table.setdefault(kind, {}).setdefault(cell.title, Counter())
                for at in places(cell, per_cell):
                    folder = root / "run"
                    end = ending(kind, cell, at, reference, folder, name)
                    shutil.rmtree(folder)
                    count[end.split(":")[0]] += 1
                    if end.startswith("BAD"):
                        bad.append(f"{kind} at exchange {at} of {cell.title}: {end}")
    finally:
        shutil.rmtree(root)
    return table, bad


def rendered(table: dict[str, dict[str, Counter[str]]]) -> str:
    """The table in Markdown; in each cell how many runs ended in which way, empty where the fault cannot occur."""
    columns = list(next(iter(table.values())))
    letters = {"error": "e", "recovered": "r", "marked": "m", "BAD": "BAD"}
    lines = ["| fault | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for kind, row in table.items():
        entries = [" ".join(f"{row[column][end]}{letter}" for end, letter in letters.items() if row[column][end]) for column in columns]
        lines.append(f"| {kind} | " + " | ".join(entries) + " |")
    return "\n".join(lines)


def main() -> int:
    """Print the table; the number of runs that ended badly."""
    found, problems = matrix(int(sys.argv[1]) if len(sys.argv) > 1 else 0, sys.argv[2:] or FAULTS)
    total = Counter(end for row in found.values() for count in row.values() for end in count.elements())
    with_fault = sum(count for end, count in total.items() if end != "no fault")
    summary = (
        f"{with_fault} runs with a fault: {total['error']} end in one clear error (e), {total['recovered']} with the same data as without (r), "
    )
    summary += f"{total['marked']} with the doubtful points marked (m), {total['BAD']} badly"
    sys.stdout.write("\n".join([rendered(found), "", summary, *problems]) + "\n")
    return total["BAD"]


if __name__ == "__main__":
    sys.exit(1 if main() else 0)
