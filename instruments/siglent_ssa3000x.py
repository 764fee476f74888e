"""Siglent SSA3000X and SVA1000X spectrum analysers; with the EMI measurement kit, EMI receivers for pre-compliance."""

from __future__ import annotations

from motoremi.bench.swept import EMI_FILTER, GAUSS_FILTER, SweptAnalyser, either


class SiglentSSA3000X(SweptAnalyser):
    """Siglent SSA3000X, SSA3000X Plus and SVA1000X in spectrum analyser mode, 9 kHz to 7.5 GHz.

    Sources: SVA1000X programming guide (page 35: detectors, average type), a public program for the B&K Precision 268x, which has the same
    command set, and public programs for the SSA3000X (751 points, traces as text that ends with a comma). It does not report an
    overload. docs/instruments.md lists the source of each command.
    """

    name = "ssa3000x"
    model = r"SSA3\d\d\dX.*|SVA1\d\d\dX.*"
    points_possible = (751,)
    emi_option = "the EMI measurement kit"
    # The voltage is averaged, as CISPR 16-1-1 requires.
    mode_commands = (":INIT:CONT OFF", ":FORM ASC", ":AVER:TYPE VOLT")
    trace_query = ":TRAC:DATA? 1"

    filter_shape = either(":FILT:TYPE", {EMI_FILTER: ("EMI",), GAUSS_FILTER: ("GAUSS", "GAUS")}, "Control the shape of the resolution filter.")
    detector = either(
        ":DET:TRAC1",
        {"peak": ("POS", "POSITIVE"), "quasi-peak": ("QUAS", "QUASI"), "average": ("AVER", "AVERAGE")},
        "Control the detector of trace 1.",
    )
