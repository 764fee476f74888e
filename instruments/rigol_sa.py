"""Rigol DSA800 and RSA3000 / RSA5000 spectrum analysers; with their EMI options, EMI receivers for pre-compliance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from motoremi.bench.swept import EMI_FILTER, GAUSS_FILTER, SweptAnalyser, either


class RigolDSA800(SweptAnalyser):
    """Rigol DSA800 and DSA800E, 9 kHz to 7.5 GHz.

    Sources: DSA800E programming guide (pages 2-64 and 2-181: traces as text in a block, 601 points), DSA800 user's guide (page 2-26:
    detectors), public programs for all other commands. It does not report an overload. docs/instruments.md lists the
    source of each command.
    """

    name = "dsa800"
    model = r"DSA8\d\d.*"
    points_possible: ClassVar[Sequence[int]] = (601,)
    emi_bandwidths_hz: ClassVar[tuple[float, ...]] = (200.0, 9e3, 120e3)
    emi_option = "the option DSA800-EMI"
    mode_commands = (":CONF:SAN", ":INIT:CONT OFF", ":FORM ASC")

    filter_shape = either(":BAND:EMIF:STAT", {EMI_FILTER: ("ON", "1"), GAUSS_FILTER: ("OFF", "0")}, "Control the shape of the resolution filter.")
    detector = either(
        ":DET",
        {"peak": ("POS",), "quasi-peak": ("QPE", "QPEAK"), "average": ("VAV", "VAVERAGE")},
        "Control the detector.",
    )


class RigolRSA(RigolDSA800):
    """Rigol RSA3000, RSA3000E and RSA5000 in swept mode (GPSA), 9 kHz to 6.5 GHz.

    Sources: RSA5000 programming guide (page 2-134: detectors), public programs for mode, points and traces. Unconfirmed: the header of the
    EMI filter, which is that of the DSA800. The EMI mode, with its scan table, is not used.
    """

    name = "rsa"
    model = r"RSA[35]\d\d\d.*"
    points_possible = (201, 401, 601, 801, 1001)
    points_command = ":SWE:POIN"
    emi_bandwidths_hz = (200.0, 9e3, 120e3, 1e6)
    emi_option = "the EMI option"
    # A reset leaves it in real-time mode.
    mode_commands = (":INST:SEL SA", ":INIT:CONT OFF", ":FORM ASC")

    detector = either(
        ":DET:TRAC1",
        {"peak": ("POS",), "quasi-peak": ("QPE",), "average": ("AVER",), "rms-average": ("RAV",)},
        "Control the detector of trace 1.",
    )
