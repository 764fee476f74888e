"""Rohde & Schwarz ESRP, ESW, ESCI and ESU EMI test receivers: the ESR's scan table, with the differences of each."""

from __future__ import annotations

from motoremi.bench.driver import choice, switch
from motoremi.instruments.rohde_schwarz_esr import RohdeSchwarzESR, scan_edges


class RohdeSchwarzESRP(RohdeSchwarzESR):
    """R&S ESRP EMI test receiver, 10 Hz to 7 GHz.

    Sources: ESRP user manual (1175.7445.02), a public program for its scan and detectors.
    """

    name = "esrp"
    model = r"ESRP[ -]?\d*"

    start_hz, stop_hz = scan_edges(10.0, 7e9)


class RohdeSchwarzESW(RohdeSchwarzESR):
    """R&S ESW EMI test receiver, 2 Hz to 44 GHz.

    Source: ESW user manual (1177.6298.02), which lists transducers for each input. Unconfirmed: the word for the CISPR filter, and that the
    scan table has the headers of the ESR. Bit 3 of the questionable power register (input overload, the input is disconnected) is that of the
    FSW, on which the ESW is built.
    """

    name = "esw"
    model = r"ESW[ -]?\d*"
    OVERLOAD = 0b1101

    start_hz, stop_hz = scan_edges(2.0, 44e9)
    filter_shape = choice("BAND:TYPE", {"6 dB EMI": "CISP", "3 dB normal": "NORM"}, "Control the shape of the resolution filter.")
    own_correction = switch("CORR:TRAN:INP1", "Control whether the receiver applies a transducer factor to input 1 by itself.")


class RohdeSchwarzESCI(RohdeSchwarzESR):
    """R&S ESCI EMI test receiver, 9 kHz to 7 GHz.

    Sources: ESCI operating manual (1166.6004.12), a public program for its scan table. The manual's page on detectors has
    no RMS-average.
    """

    name = "esci"
    model = r"ESCI[ -]?\d*"

    start_hz, stop_hz = scan_edges(9e3, 7e9)
    detector = choice(
        "DET1:REC",
        {"peak": "POS", "quasi-peak": "QPE", "average": "AVER", "cispr-average": "CAV"},
        "Control the detector of trace 1.",
    )


class RohdeSchwarzESU(RohdeSchwarzESR):
    """R&S ESU EMI test receiver, 20 Hz to 40 GHz.

    Source: ESU operating manual (1302.6163.12).
    """

    name = "esu"
    model = r"ESU[ -]?\d*"

    start_hz, stop_hz = scan_edges(20.0, 40e9)
