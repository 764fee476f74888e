"""Keysight X-series signal analysers (CXA, EXA, MXA, PXA, UXA) in spectrum analyser mode."""

from __future__ import annotations

from motoremi.bench.driver import choice, number
from motoremi.bench.swept import EMI_FILTER, GAUSS_FILTER, SweptAnalyser


class KeysightXSeries(SweptAnalyser):
    """Keysight N9000 to N9041 by their swept measurement; with the application N6141 the driver `n6141` uses the frequency scan instead.

    Sources: X-Series spectrum analyser mode reference (pages 248 to 256: bandwidth), N9030A reference (page 1347: detectors), status
    registers of the X-Series (page 2498: bits of the integrity register), public programs for corrections. Unconfirmed: the header of the
    EMC standard. The instrument can sweep more than 1001 points, but not within its longest sweep time at the dwell of quasi-peak.
    """

    name = "xseries"
    model = r"N90([0123]0|21|4[01])[AB]"
    safe_commands = (":INIT:CONT OFF", ":ABOR")
    points_possible = range(2, 1002)
    points_command = ":SWE:POIN"
    emi_option = "the option EMC"
    # The voltage is averaged, as CISPR 16-1-1 requires.
    mode_commands = (":INST:SEL SA", ":CONF:SAN", ":INIT:CONT OFF", ":FORM ASC", ":AVER:TYPE SCAL")
    gains = ("level_offset_db", "external_gain_db")
    # Bits for input overload and measurement over range; the event register latches a rise, the condition register holds the present state.
    overload_queries = (":STAT:QUES:INT:EVEN?", ":STAT:QUES:INT:COND?")
    overload_bits = 16 | 32

    filter_shape = choice(
        ":EMC:STAN", {EMI_FILTER: "CISP", GAUSS_FILTER: "NONE"}, "Control the shape of the resolution filter by the EMC standard."
    )
    detector = choice(
        ":DET:TRAC1",
        {"peak": "POS", "quasi-peak": "QPE", "average": "AVER", "cispr-average": "EAV", "rms-average": "RAV"},
        "Control the detector of trace 1.",
    )
    external_gain_db = number(":CORR:SA:GAIN", "dB", (-120.0, 120.0), "Control the gain of a preamplifier in front of the analyser.")
