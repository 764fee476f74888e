"""Checks the calibration dates of the bench file on the day of a run: doubts are reported before the first sweep, or stop the run."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date

from motoremi.data.calibration import calibration_doubt
from motoremi.errors import BadInput
from motoremi.quantities import show
from motoremi.run.writer import Writer
from motoremi.schema.bench_file import BenchFile
from motoremi.schema.procedure import Procedure


def calibration_doubts(procedure: Procedure, bench_file: BenchFile) -> Iterator[str]:
    """A sentence for each instrument of the procedure whose calibration is too old, lies in the future, or is not stated though it must be."""
    within = procedure.calibration_within
    for role in procedure.instruments:
        calibrated = bench_file.calibrated.get(role)
        if calibrated is not None:
            doubt = calibration_doubt(role, (date.today() - calibrated).days, within)
            if doubt:
                yield doubt
        elif within is not None and bench_file.backend != "sim":
            yield f"the bench file does not say when the {role} was calibrated"


def refuse_unless_calibrated(procedure: Procedure, bench_file: BenchFile) -> None:
    """Refuse a run whose procedure requires calibrated instruments, if there is a doubt about one of them.

    Raises
    ------
    BadInput
        With every doubt in one line.
    """
    doubts = list(calibration_doubts(procedure, bench_file))
    if procedure.calibration_within is not None and doubts:
        asked = show(procedure.calibration_within, "d")
        raise BadInput(
            f"{'; '.join(doubts)}; the procedure asks for a calibration within {asked}: use a calibrated instrument, "
            "or correct the date under [calibrated] in the bench file"
        )


def tell_doubts(procedure: Procedure, bench_file: BenchFile, writer: Writer) -> None:
    """Write every doubt into the session; listeners of the session, such as the command line, show it."""
    for doubt in calibration_doubts(procedure, bench_file):
        writer.emit("doubt", about="calibration", says=doubt)
