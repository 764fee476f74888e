"""What the drivers say on the wire, exchange by exchange, and how they take nonsense for an answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
import pytest

from motoremi.bench.driver import Driver
from motoremi.bench.replay import ReplayTransport
from motoremi.bench.traffic import encode_bytes
from motoremi.errors import InstrumentError
from motoremi.instruments.agilent_4294a import Agilent4294A
from motoremi.instruments.rohde_schwarz_esr import RohdeSchwarzESR

D = TypeVar("D", bound=Driver)
FINE_4294A = ("OUTPERRO?", '0,"NO ERRORS"')
FINE_ESR = ("SYST:ERR?", '0,"No error"')
Exchange = tuple[str, str | bytes | None]


@contextmanager
def script(driver: type[D], *exchanges: Exchange) -> Iterator[D]:
    """A driver whose instrument expects exactly these commands and gives these answers."""
    records = []
    for command, answer in exchanges:
        records.append({"direction": "write", "text": f"{command}\n"})
        if answer is not None:
            data = answer if isinstance(answer, bytes) else answer.encode("latin-1") + b"\n"
            records.append({"direction": "read", **encode_bytes(data)})
    transport = ReplayTransport("SCRIPT", records)
    yield driver(transport)
    transport.finish()


def acknowledged(fine: Exchange, *commands: str) -> list[Exchange]:
    """Commands, each followed by a look at an empty error queue."""
    return [exchange for command in commands for exchange in ((command, None), fine)]


def block(*values: float) -> bytes:
    payload = np.array(values, dtype=">f8").tobytes()
    return f"#{len(str(len(payload)))}{len(payload)}".encode() + payload + b"\n"


def test_setting_and_reading_one_value() -> None:
    with script(Agilent4294A, *acknowledged(FINE_4294A, "STAR 150000 HZ"), ("STAR?", "+1.5E+05"), FINE_4294A) as analyser:
        analyser.start_hz = 150e3
        assert analyser.start_hz == 150e3


@pytest.mark.parametrize("answer", ["201", "+201", "2.01E+02"])
def test_whole_numbers_in_every_legal_spelling(answer: str) -> None:
    with script(Agilent4294A, ("POIN?", answer), FINE_4294A) as analyser:
        assert analyser.points == 201


def test_configuring_the_4294a() -> None:
    answers = [
        ("STAR?", "150000"),
        ("STOP?", "30000000"),
        ("POIN?", "401"),
        ("SWPT?", "LOG"),
        ("BWFACT?", "3"),
        ("POWE?", "0.5"),
        ("MEAS?", "IRIM"),
        ("E4TP?", "OFF"),
        ("AVER?", "0"),
        ("AVERFACT?", "16"),
        ("PAVER?", "0"),
        ("PAVERFACT?", "4"),
    ]
    expected = [
        *acknowledged(FINE_4294A, "MEAS IRIM", "SWPP FREQ", "SWPT LOG", "STAR 150000 HZ", "STOP 30000000 HZ", "POIN 401"),
        *acknowledged(FINE_4294A, "POWMOD VOLT", "POWE 0.5 V", "BWFACT 3"),
        *[exchange for pair in answers for exchange in (pair, FINE_4294A)],
    ]
    with script(Agilent4294A, *expected) as analyser:
        assert analyser.configure(150e3, 30e6, 401)["points"] == 401


def test_a_sweep_of_the_4294a_clears_the_status_before_the_trigger() -> None:
    deadline = [("POIN?", "2"), FINE_4294A, ("BWFACT?", "5"), FINE_4294A]
    expected = [
        *acknowledged(FINE_4294A, "*CLS", "ESNB 1", "SING"),
        *deadline,
        ("ESB?", "0"),
        ("ESB?", "+1"),
        FINE_4294A,
        *acknowledged(FINE_4294A, "TRAC A"),
        ("FORM3", None),
        ("OUTPDTRC?", block(1.0, 0.0, 2.0, 0.0)),
        FINE_4294A,
        *acknowledged(FINE_4294A, "TRAC B"),
        ("FORM3", None),
        ("OUTPDTRC?", block(-3.0, 0.0, 4.0, 0.0)),
        FINE_4294A,
    ]
    with script(Agilent4294A, *expected) as analyser:
        analyser.trigger()
        analyser.wait_until_complete()
        assert analyser.read_impedance().tolist() == [1 - 3j, 2 + 4j]


@pytest.mark.parametrize(("standard", "measure", "enable"), [("open", "COMA", "COMSTA ON"), ("short", "COMB", "COMSTB ON")])
def test_a_compensation_of_the_4294a(standard: str, measure: str, enable: str) -> None:
    expected = [
        *acknowledged(FINE_4294A, "CALP USER", "*CLS", "ESNB 256", measure),
        ("POIN?", "2"),
        FINE_4294A,
        ("BWFACT?", "1"),
        FINE_4294A,
        ("ESB?", "256"),
        FINE_4294A,
        *acknowledged(FINE_4294A, enable),
        ("FORM3", None),
        ("OUTPSWPRM?", block(1e5, 2e5)),
        FINE_4294A,
    ]
    with script(Agilent4294A, *expected) as analyser:
        analyser.compensate(standard)  # type: ignore[arg-type]


def test_the_safe_state_of_the_4294a() -> None:
    records = [
        {"direction": "clear"},
        {"direction": "write", "text": "*CLS\n"},
        {"direction": "write", "text": "DCO OFF\n"},
        {"direction": "write", "text": "OUTPERRO?\n"},
        {"direction": "read", "text": "0\n"},
        {"direction": "write", "text": "HOLD\n"},
        {"direction": "write", "text": "OUTPERRO?\n"},
        {"direction": "read", "text": "0\n"},
        {"direction": "write", "text": "POWE 0.005 V\n"},
        {"direction": "write", "text": "OUTPERRO?\n"},
        {"direction": "read", "text": "0\n"},
    ]
    transport = ReplayTransport("SCRIPT", records)
    Agilent4294A(transport).safe()
    transport.finish()


def test_a_refused_command_does_not_keep_the_others_of_the_safe_state_from_being_sent() -> None:
    records: list[dict[str, str]] = [{"direction": "clear"}, {"direction": "write", "text": "*CLS\n"}]
    for command in ("DCO OFF", "HOLD", "POWE 0.005 V"):
        records += [
            {"direction": "write", "text": f"{command}\n"},
            {"direction": "write", "text": "OUTPERRO?\n"},
            {"direction": "read", "text": '21,"OUT OF RANGE"\n' if command == "DCO OFF" else "0\n"},
        ]
        if command == "DCO OFF":
            records += [{"direction": "write", "text": "OUTPERRO?\n"}, {"direction": "read", "text": "0\n"}]
    transport = ReplayTransport("SCRIPT", records)
    with pytest.raises(InstrumentError, match=r"OUT OF RANGE.*DCO OFF"):
        Agilent4294A(transport).safe()
    transport.finish()


def test_a_scan_of_the_esr() -> None:
    settings = [
        ("SCAN1:STAR?", "150000"),
        ("SCAN1:STOP?", "160000"),
        ("SCAN1:STEP?", "4500"),
        ("BAND:TYPE?", "PULS"),
        ("SCAN1:BAND:RES?", "9000"),
        ("SCAN1:TIME?", "0.01"),
        ("SCAN1:INP:ATT?", "10"),
        ("CALC:UNIT:POW?", "DBUV"),
        ("SCAN1:INP:GAIN:STAT?", "0"),
        ("CORR:TRAN?", "0"),
        ("DET1:REC?", "AVER"),
    ]
    expected = [
        *acknowledged(FINE_ESR, "DET1:REC AVER"),
        *[exchange for pair in settings for exchange in (pair, FINE_ESR)],
        *acknowledged(FINE_ESR, "*CLS"),
        ("INIT2;*OPC", None),
        ("*ESR?", "0"),
        ("*ESR?", "1"),
        FINE_ESR,
        ("TRAC? TRACE1", "41.2,40.9,40.1"),
        FINE_ESR,
        ("STAT:QUES:POW:EVEN?", "4"),
        FINE_ESR,
        ("STAT:QUES:POW:COND?", "0"),
        FINE_ESR,
    ]
    with script(RohdeSchwarzESR, *expected) as receiver:
        spectrum = receiver.scan("average")
    assert spectrum.frequency_hz.tolist() == [150e3, 154.5e3, 159e3]
    assert spectrum.level_dbuv.tolist() == [41.2, 40.9, 40.1]
    assert spectrum.overload.all()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ("12", "expected a 4294A, but '12' answers"),
        ("AGILENT TECHNOLOGIES,4395A,JP1KG1,REV1.06", "expected a 4294A"),
        ("HEWLETT-PACKARD,4294A", "expected a 4294A"),
    ],
)
def test_wrong_identities(answer: str, message: str) -> None:
    with script(Agilent4294A, ("*IDN?", answer)) as analyser, pytest.raises(InstrumentError, match=message):
        analyser.identify()


def test_both_vendor_spellings_are_the_same_4294a() -> None:
    with script(Agilent4294A, ("*IDN?", "AGILENT TECHNOLOGIES,4294A,JP1KG00001,REV1.10")) as analyser:
        assert analyser.identify().vendor == "AGILENT TECHNOLOGIES"


def test_a_value_that_is_none() -> None:
    expected = "cannot read 'LOUD' as start_hz in answer to 'STAR\\?'"
    with script(Agilent4294A, ("STAR?", "LOUD"), FINE_4294A) as analyser, pytest.raises(InstrumentError, match=expected):
        _ = analyser.start_hz


def test_an_error_queue_that_is_none() -> None:
    with (
        script(Agilent4294A, ("HOLD", None), ("OUTPERRO?", "hello")) as analyser,
        pytest.raises(InstrumentError, match="'hello' is no entry of an error queue"),
    ):
        analyser.tell("HOLD")


def test_an_error_queue_that_never_empties_ends() -> None:
    endless = [("OUTPERRO?", '-113,"AGAIN"')] * 50
    with (
        script(Agilent4294A, ("HOLD", None), *endless) as analyser,
        pytest.raises(InstrumentError, match="AGAIN") as caught,
    ):
        analyser.tell("HOLD")
    # Once, not fifty times.
    told = "Agilent4294A at SCRIPT: error -113 \"AGAIN\" after 'HOLD', and its error queue does not empty: switch it off and on"
    assert str(caught.value) == told


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (b"#15\x00\x00\x00\x00\x00\n", "5 bytes, not 8 for each value"),
        (block(1.0, float("nan")), "not finite"),
        (block(1.0, 0.0, 2.0), "trace A has 3 values"),
    ],
)
def test_traces_that_are_none(answer: bytes, message: str) -> None:
    exchanges = [*acknowledged(FINE_4294A, "TRAC A"), ("FORM3", None), ("OUTPDTRC?", answer), FINE_4294A]
    if "5 bytes" in message:
        exchanges.pop()
    with script(Agilent4294A, *exchanges) as analyser:
        analyser.complete = True
        with pytest.raises(InstrumentError, match=message):
            analyser.read_impedance()


def test_an_ascii_trace_that_is_none() -> None:
    with script(Agilent4294A, ("FORM4", None), ("OUTPSWPRM?", "1.0,two,3.0")) as analyser:
        analyser.binary = False
        with pytest.raises(InstrumentError, match="no list of numbers"):
            analyser.read_axis()


@pytest.mark.parametrize(
    ("answer", "message"),
    [("9.91E37,40.0", "not measured"), ("loud", "no list of levels")],
)
def test_levels_that_are_none(answer: str, message: str) -> None:
    with (
        script(RohdeSchwarzESR, ("TRAC? TRACE1", answer), FINE_ESR) as receiver,
        pytest.raises(InstrumentError, match=message),
    ):
        receiver.read_levels("TRAC? TRACE1")
