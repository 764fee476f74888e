"""Rohde & Schwarz HMP2020, HMP2030, HMP4030, HMP4040, programmable supplies with two to four outputs."""

from __future__ import annotations

from motoremi.bench.supply import Supply


class RohdeSchwarzHmp4000(Supply):
    """An output of the HMP family, which is selected before each command.

    Sources: `INST:NSEL`, `OUTP:SEL`, `OUTP:GEN`, `VOLT`, `CURR`, `MEAS:VOLT?`, `MEAS:CURR?` as in the SCPI programmers manual of the HMP series
    and in PyMeasure's HMP4040, with which the simulator is tested; bits 0 (constant current) and 1 (constant voltage) of
    `STAT:QUES:INST:ISUMn:COND?` by table 7-2 of the user manual, quoted from a secondary source. `OUTP:SEL OFF` switches this output off;
    `OUTP:GEN ON` also switches on all other outputs that are selected on the front panel. Unconfirmed: the number of decimals of an answer
    (three or four are accepted), and the outputs' ratings of HMP2020 and HMP2030 beyond 5 A.
    """

    model = r"HMP(20[23]0|40[34]0)"
    number_format = r"-?\d+\.\d{3,4}"
    select = "INST:NSEL {channel}"
    on_commands = ("OUTP:SEL ON", "OUTP:GEN ON")
    off_commands = ("OUTP:SEL OFF",)
    on_query = "OUTP:SEL?"
    safe_commands = off_commands
    ratings = {  # noqa: RUF012
        "HMP4040": ((32.0, 10.0),) * 4,
        "HMP4030": ((32.0, 10.0),) * 3,
        "HMP2030": ((32.0, 5.0),) * 3,
        "HMP2020": ((32.0, 10.0), (32.0, 5.0)),
    }
