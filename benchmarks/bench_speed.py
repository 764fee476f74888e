"""`make speed`: how fast the simulated bench and a replay are, and how much time the recording of all traffic takes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from motoremi.bench.connect import driver_class, open_transport
from motoremi.bench.traffic import RecordingTransport
from motoremi.data.session import SessionWriter, load
from motoremi.run.rerun import rerun
from motoremi.run.runner import run, start_document
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure, load_procedure, ready_procedures
from motoremi.virtual.simulated_bench import SimulatedBench

BENCH_FILE = BenchFile(backend="sim", seed=5)
SWEEPS = 60
ROUNDS = 7


def seconds(work: Callable[[], object]) -> float:
    """Wall time."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def measure(procedure: Procedure, folder: Path) -> tuple[float, float]:
    """Run the measuring steps; seconds on the virtual clock of the instruments, and seconds that the simulation took."""
    bench = SimulatedBench(BENCH_FILE.seed)
    writer = SessionWriter.create(folder, start_document(procedure, BENCH_FILE))
    took = seconds(lambda: run(procedure, bench, writer, analyse=lambda *_: None, prompt=lambda text: None))
    bench.close()
    return bench.clock.now(), took


def sweep_seconds(folder: Path | None) -> tuple[float, float]:
    """One sweep of 401 points on the simulated 4294A, recorded into a session in that folder, or not recorded without a folder.

    Seconds of processor time, and seconds on the virtual clock of the instrument.
    """
    bench = SimulatedBench(BENCH_FILE.seed)
    transport = open_transport(bench.resource_manager, bench.resources["analyser"], clock=bench.clock)
    writer = SessionWriter.create(folder, {"title": "speed"}) if folder is not None else None
    driver = driver_class("4294a")(transport if writer is None else RecordingTransport(transport, "analyser", writer.log_traffic))
    driver.identify()
    driver.reset()
    driver.configure(150e3, 30e6, 401)
    bench.connect("open")
    before_s = bench.clock.now()
    driver.sweep("open")
    on_the_bench_s = bench.clock.now() - before_s
    # Processor time, because other programs may run at the same time.
    began = time.process_time()
    for _ in range(SWEEPS):
        driver.sweep("open")
    took = (time.process_time() - began) / SWEEPS
    if writer is not None:
        writer.close("done")
    bench.close()
    return took, on_the_bench_s


def main() -> None:
    """Print both tables."""
    with tempfile.TemporaryDirectory(prefix="motoremi-speed-") as place:
        root = Path(place)
        print("| procedure | on the bench | simulated | times faster | replayed |")
        print("|---|---|---|---|---|")
        for name in ready_procedures():
            measure(load_procedure(name), root / f"first-{name}")  # imports and costs of the first call do not count
            bench_s, took_s = measure(load_procedure(name), root / name)
            session = load(root / name)
            again_s = seconds(lambda session=session, name=name: rerun(session, root / f"again-{name}", lambda: lambda *_: None))
            print(f"| {name} | {bench_s:.0f} s | {took_s:.2f} s | {bench_s / took_s:.0f} | {again_s:.2f} s |")
        plain, recorded, bench_s = [], [], 0.0
        for number in range(ROUNDS):
            plain.append(sweep_seconds(None)[0])
            took_s, bench_s = sweep_seconds(root / f"sweep-{number}")
            recorded.append(took_s)
    # The fastest round was the least disturbed by other programs.
    without_s, with_s = min(plain), min(recorded)
    cost_s = with_s - without_s
    print(f"\nOne sweep is {bench_s:.1f} s on the bench and {1e3 * without_s:.2f} ms of processor time in the simulator.")
    print(f"Recording takes {1e3 * cost_s:.2f} ms: {100 * cost_s / bench_s:.2f} % of the sweep.")


if __name__ == "__main__":
    main()
