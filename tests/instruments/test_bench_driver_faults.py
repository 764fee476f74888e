"""Every fault with every driver, early and late in a measurement: a clear error, or the same data; never another ending."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fault_matrix import BENCH_FILE, NOISE, SEED, measured
from record_sessions import PROCEDURES, procedure

from motoremi.data.session import Session, SessionWriter, load, verify
from motoremi.errors import MotoremiError
from motoremi.run.runner import run, start_document
from motoremi.virtual.faults import FAULTS, FaultLayer
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.virtual_instruments import virtual_instrument

pytestmark = pytest.mark.slow

# Drivers that share their code, each fault given to one of them by turns.
FAMILIES = (("esrp", "esw", "esci", "esu"), ("mxe", "n6141"), ("dsa800", "rsa", "ssa3000x", "xseries"))
# The other two have the whole matrix of their own.
ALONE = sorted(set(PROCEDURES) - {"4294a", "esr"} - {driver for family in FAMILIES for driver in family})
ROWS = (*FAMILIES, *((driver,) for driver in ALONE))


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Session]:
    """A healthy run with a driver, made when it is first needed: a worker that has no test of a driver measures nothing with it."""

    @functools.cache
    def made(driver: str) -> Session:
        bench = SimulatedBench(SEED)
        session = measured(tmp_path_factory.mktemp(driver) / "s", procedure(driver), bench)
        bench.close()
        return session

    return made


# Each driver or family has each fault once, by turns early in the measurement, in the middle and late.
@pytest.mark.parametrize(
    ("driver", "kind", "share"),
    [
        (family[column % len(family)], kind, (0.05, 0.4, 0.8)[(row + column) % 3])
        for row, family in enumerate(ROWS)
        for column, kind in enumerate(sorted(FAULTS))
    ],
)
def test_a_fault_ends_in_an_error_or_the_same_data(tmp_path: Path, healthy: Callable[[str], Session], driver: str, kind: str, share: float) -> None:
    reference = healthy(driver)
    role = virtual_instrument(driver).role
    exchanges = sum(record["direction"] == "write" and record["instrument"] == role for record in reference.traffic())
    bench = SimulatedBench(SEED)
    bench.open(role, driver, "whatever", lambda record: None, {role: procedure(driver).instruments[role].options}).close()
    FaultLayer(bench.devices[role], kind, max(1, int(share * exchanges)))
    writer = SessionWriter.create(tmp_path / "s", start_document(procedure(driver), BENCH_FILE))
    trouble = ""
    try:
        run(procedure(driver), bench, writer, analyse=lambda *_: None, prompt=lambda text: None)
    except MotoremiError as error:
        trouble = str(error) or "?"
    bench.close()
    complete = not trouble
    assert "\n" not in trouble
    came = load(tmp_path / "s")
    assert verify(tmp_path / "s") == []
    assert came.status == ("done" if complete else "failed")
    # What was stored before the fault, or in spite of it, is what a healthy run stores.
    for got, right in zip(came.sweeps, reference.sweeps, strict=complete):
        np.testing.assert_allclose(got.impedance_ohm, right.impedance_ohm, rtol=10 * NOISE)
    for seen, sound in zip(came.spectra, reference.spectra, strict=complete):
        assert seen.overload.any() or np.allclose(seen.level_dbuv, sound.level_dbuv, atol=0.5)
