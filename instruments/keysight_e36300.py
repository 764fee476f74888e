"""Keysight E36311A, E36312A, E36313A, programmable supplies with three outputs."""

from __future__ import annotations

from motoremi.bench.supply import Supply


class KeysightE36300(Supply):
    """An output of the E36300 family by its channel list.

    Sources: the headers `VOLT`, `CURR`, `OUTP`, `MEAS:VOLT?`, `MEAS:CURR?` with `(@n)` as in PyMeasure's KeysightE36312A, with which the
    simulator is tested; outputs as in the data sheet 5992-2124EN. `STAT:QUES:INST:ISUMn:COND?` with 1 for constant current, 2 for constant voltage
    and 3 for a failure is what the E364xA guide (page 120) prints and what sigrok reads from an E36300. Unconfirmed: the guide of the E36300
    itself, and that `OUTP?` answers 0 after a protection has tripped.
    """

    model = r"E3631[123]A"
    on_commands = ("OUTP ON",)
    off_commands = ("OUTP OFF",)
    on_query = "OUTP?"
    safe_commands = off_commands
    ratings = {  # noqa: RUF012
        "E36311A": ((6.0, 5.0), (25.0, 1.0), (25.0, 1.0)),
        "E36312A": ((6.0, 5.0), (25.0, 1.0), (25.0, 1.0)),
        "E36313A": ((6.0, 10.0), (25.0, 2.0), (25.0, 2.0)),
    }
