"""Records the sessions in `tests/sessions/`, one for each driver: `python tests/record_sessions.py [DRIVER...]`.

Each is a measurement of few points on the simulated bench, kept so that later versions prove they can replay what earlier ones recorded.
A driver that asks something else on purpose needs its session recorded anew; the difference then shows in the history.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from fault_matrix import SEED, measured, small

from motoremi.bench.simulated import SimulatedBench

SESSIONS = Path(__file__).parent / "sessions"
# Driver -> the ready procedure that uses it.
PROCEDURES = {"4294a": "impedance_only", "esr": "emission_only"}


def record(driver: str) -> None:
    """Measure with one driver and keep the session."""
    folder = SESSIONS / driver
    if folder.exists():
        shutil.rmtree(folder)
    bench = SimulatedBench(SEED)
    measured(folder, small(PROCEDURES[driver]), bench)
    bench.close()


if __name__ == "__main__":
    for name in sys.argv[1:] or PROCEDURES:
        record(name)
