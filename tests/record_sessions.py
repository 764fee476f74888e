"""Records the sessions in `tests/sessions/`, one for each driver: `python tests/record_sessions.py [DRIVER...]`.

Each is a measurement of few points on the simulated bench, kept so that later versions prove they can replay what earlier ones recorded.
A driver that asks something else on purpose needs its session recorded anew; the difference then shows in the history.
"""

from __future__ import annotations

import copy
import shutil
import sys
from pathlib import Path

from fault_matrix import SEED, measured, small

from motoremi.bench.procedure import Procedure, parse_procedure
from motoremi.bench.simulated import SimulatedBench
from motoremi.bench.virtual import virtual_instrument

SESSIONS = Path(__file__).parent / "sessions"
# Driver -> the ready procedure in which it takes the place of the driver of its role.
PROCEDURES = {
    "4294a": "impedance_only",
    "e4990a": "impedance_only",
    "nanovna": "impedance_only",
    "esr": "emission_only",
    "mxe": "emission_only",
    "tinysa": "nanovna_bench",
}


def procedure(driver: str) -> Procedure:
    """The ready procedure with this driver in its role."""
    data = copy.deepcopy(small(PROCEDURES[driver]).source)
    role = virtual_instrument(driver).role
    data["instruments"] = {role: {**data["instruments"][role], "driver": driver}}
    if role == "receiver":
        data.pop("sweep", None)
        data["steps"] = [step for step in data["steps"] if step["do"] in ("identify", "connect", "wait", "spectrum", "report")]
    return parse_procedure(data, driver)


def record(driver: str) -> None:
    """Measure with one driver and keep the session."""
    folder = SESSIONS / driver
    if folder.exists():
        shutil.rmtree(folder)
    bench = SimulatedBench(SEED)
    measured(folder, procedure(driver), bench)
    bench.close()


if __name__ == "__main__":
    for name in sys.argv[1:] or PROCEDURES:
        record(name)
