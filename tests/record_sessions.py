"""Records the sessions in `tests/sessions/`, one for each driver: `python tests/record_sessions.py [DRIVER...]`.

Each is a measurement of few points on the simulated bench, kept so that later versions prove they can replay what earlier ones recorded.
A name that ends in `-requests` is recorded with service requests, any other as on a link that carries none.
A driver that asks something else on purpose needs its session recorded anew; the difference then shows in the history.
"""

from __future__ import annotations

import copy
import shutil
import sys
from contextlib import nullcontext
from pathlib import Path
from unittest import mock

from fault_matrix import SEED, measured, small

from motoremi.arrays import JsonDict
from motoremi.schema.procedure import Procedure, parse_procedure
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.virtual_instruments import virtual_instrument
from motoremi.virtual.visa_library import BenchLibrary

SESSIONS = Path(__file__).parent / "sessions"
# Driver -> the ready procedure in which it takes the place of the driver of its role.
PROCEDURES = {
    "4294a": "impedance_only",
    "e4990a": "impedance_only",
    "nanovna": "impedance_only",
    **dict.fromkeys(("esr", "esrp", "esw", "esci", "esu", "mxe", "n6141", "xseries", "dsa800", "rsa", "ssa3000x"), "emission_only"),
    **dict.fromkeys(("nanovna-v2", "librevna"), "impedance_only"),
    "tinysa": "nanovna_bench",
    "34461a": "emission_warm_motor",
    "e36300": "emission_warm_motor",
    "hmp4000": "emission_warm_motor",
    "line-reader": "emission_warm_motor",
}
# A state is measured beside something: these are recorded with a receiver.
RECEIVER = "esr"
REQUESTS = "-requests"
WITH_REQUESTS = ("4294a-requests", "esr-requests")


def procedure(driver: str) -> Procedure:
    """The ready procedure with this driver in its role."""
    data = copy.deepcopy(small(PROCEDURES[driver]).source)
    role = virtual_instrument(driver).role
    if role not in ("analyser", "receiver"):
        return with_state(data, role, driver)
    data["instruments"] = {role: {**data["instruments"][role], "driver": driver}}
    if driver == "nanovna-v2":
        first = next(at for at, step in enumerate(data["steps"]) if step["do"] == "compensate")
        data["steps"].insert(first, {"do": "compensate", "standard": "load", "nominal": "100 Ohm"})
    if role == "receiver":
        data.pop("sweep", None)
        data["steps"] = [step for step in data["steps"] if step["do"] in ("identify", "connect", "wait", "spectrum", "report")]
    return parse_procedure(data, driver)


def with_state(data: JsonDict, role: str, driver: str) -> Procedure:
    """The procedure with one instrument beside the receiver, and the steps that these two can do."""
    data["instruments"] = {"receiver": data["instruments"]["receiver"], role: {**data["instruments"][role], "driver": driver}}
    if driver == "line-reader":
        # An instrument that is asked, because a fault can only change the answer to a message.
        data["instruments"][role]["lines"]["ask"] = "?"
    quantity = {"tachometer": "speed", "supply": "voltage", "voltmeter": "voltage"}[role]
    data["steps"] = [step for step in data["steps"] if step["do"] != "wait-for" and (step["do"] != "supply" or role == "supply")]
    wait = {"do": "wait-for", "quantity": quantity, "within": "1 %", "hold": "10 s", "longest": "60 s"}
    data["steps"].insert(4 if role == "supply" else 3, wait)
    return parse_procedure(data, driver)


def record(name: str) -> None:
    """Measure with one driver and keep the session."""
    folder, driver = SESSIONS / name, name.removesuffix(REQUESTS)
    if folder.exists():
        shutil.rmtree(folder)
    refused = mock.patch.object(BenchLibrary, "enable_event", side_effect=NotImplementedError)
    bench = SimulatedBench(SEED)
    with refused if driver == name else nullcontext():
        measured(folder, procedure(driver), bench)
    bench.close()


if __name__ == "__main__":
    for kept in sys.argv[1:] or (*PROCEDURES, *WITH_REQUESTS):
        record(kept)
