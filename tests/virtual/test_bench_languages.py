"""What every instrument of its kind answers, and the order in which public programs ask it."""

from __future__ import annotations

import numpy as np
import pytest
import pyvisa

from motoremi.bench.clock import VirtualClock
from motoremi.virtual.simulated_band import about, as_wide_as
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_shell import SimulatedShell
from motoremi.virtual.simulated_tinysa import SimulatedTinySa
from motoremi.virtual.virtual_instruments import virtual_instrument

Resource = pyvisa.resources.MessageBasedResource
SCPI = ("e4990a", "esr", "mxe")


def stock(bench: SimulatedBench, name: str) -> Resource:
    """A client with nothing of ours, connected to that instrument."""
    role = virtual_instrument(name).role
    bench.open(role, name, "", lambda record: None).close()
    resource = bench.resource_manager.open_resource(bench.resources[role], write_termination="\n", read_termination="\n")
    assert isinstance(resource, Resource)
    return resource


def errors(client: Resource, name: str) -> list[str]:
    """All that waits in the error queue."""
    query = "OUTPERRO?" if name == "4294a" else "SYST:ERR?"
    found = []
    while int((entry := client.query(query)).partition(",")[0]):
        found.append(entry)
    return found


def accepted(client: Resource, name: str, *messages: str) -> None:
    """None of them leaves an error."""
    for message in messages:
        _ = client.query(message) if message.partition(" ")[0].endswith("?") else client.write(message)
        assert errors(client, name) == [], message


@pytest.mark.parametrize("name", ["4294a", *SCPI])
def test_common_queries_are_answered(bench: SimulatedBench, name: str) -> None:
    client = stock(bench, name)
    assert client.query("*TST?") == "0"
    assert errors(client, name) == []


@pytest.mark.parametrize("name", SCPI)
def test_scpi_queries_are_answered(bench: SimulatedBench, name: str) -> None:
    client = stock(bench, name)
    assert client.query("SYST:VERS?") == "1999.0"
    assert client.query("STAT:OPER:COND?") == client.query("STATus:QUEStionable:CONDition?") == "0"
    client.write("NONSENSE;FREQ:CENT 1 WOBBLE")
    assert client.query("SYST:ERR:COUN?") == "2"
    both = client.query(":SYSTem:ERRor:ALL?")
    assert "-113" in both
    assert "-222" in both
    assert int(client.query("SYST:ERR:ALL?").partition(",")[0]) == 0
    accepted(client, name, "INIT:CONT OFF", "INIT:CONT?", "INIT:CONT 1", "STAT:PRES")
    accepted(client, name, "FREQ:STAR 1 MHZ", "FREQ:STOP 3 MHZ")
    assert (float(client.query("FREQ:CENT?")), float(client.query("FREQ:SPAN?"))) == (2e6, 2e6)
    for wrong in ("FREQ:SPAN -1e400", "FREQ:SPAN -2e6", "FREQ:CENT 1e400"):
        client.write(wrong)
        assert not client.query("SYST:ERR?").startswith("+0")
    assert (float(client.query("FREQ:CENT?")), float(client.query("FREQ:SPAN?"))) == (2e6, 2e6)
    client.write("FREQ:CENT 10 MHZ;:FREQ:SPAN 4 MHZ")
    assert (float(client.query("FREQ:STAR?")), float(client.query("FREQ:STOP?"))) == (8e6, 12e6)
    # Whatever start and stop were before, also the wrong way round, a centre beyond the range is one at its end.
    for end in ("0", "99999999999999999999"):
        client.write(f"FREQ:STAR 20 MHZ;:FREQ:STOP 1 MHZ;:FREQ:CENT {end}")
        assert client.query("*OPC?") == "1"


@pytest.mark.parametrize("name", ["4294a", *SCPI])
def test_what_is_learnt_sets_the_instrument_again(bench: SimulatedBench, name: str) -> None:
    client = stock(bench, name)
    start = {"4294a": "STAR", "e4990a": "FREQ:STAR", "esr": "SCAN1:STAR", "mxe": "FSC:SCAN2:STAR"}[name]
    client.write(f"{start} 1234567")
    learnt = client.query("*LRN?")
    client.write("*RST")
    assert float(client.query(f"{start}?")) != 1234567
    client.write(learnt)
    # A list or trigger that is not there is no part of what is learnt.
    assert errors(client, name) == []
    assert client.query("*LRN?") == learnt


def test_centre_and_span_stay_within_the_instrument() -> None:
    assert about(50.0, 30.0, 0.0, 100.0) == (20.0, 80.0)
    assert about(90.0, 30.0, 0.0, 100.0) == (80.0, 100.0)
    assert as_wide_as(90.0, 30.0, 0.0, 100.0) == (40.0, 100.0)
    assert as_wide_as(50.0, 80.0, 0.0, 100.0) == (0.0, 100.0)


def test_the_4294a_moves_the_other_edge(bench: SimulatedBench) -> None:
    client = stock(bench, "4294a")
    client.write("STAR 1MHZ;STOP 2MHZ;STAR 5MHZ")
    assert (float(client.query("STAR?")), float(client.query("STOP?"))) == (5e6, 5e6)
    client.write("STOP 3MHZ")
    assert (float(client.query("STAR?")), float(client.query("STOP?"))) == (3e6, 3e6)
    client.write("CENT 10MHZ;SPAN 2MHZ")
    assert (float(client.query("STAR?")), float(client.query("STOP?"))) == (9e6, 11e6)
    assert (float(client.query("CENT?")), float(client.query("SPAN?"))) == (10e6, 2e6)
    assert errors(client, "4294a") == []


def test_the_4294a_knows_what_its_programs_send(bench: SimulatedBench) -> None:
    """What public programs send to it and the manual lists, beside what our own driver sends."""
    client = stock(bench, "4294a")
    accepted(client, "4294a", "AVER ON", "AVERFACT 10", "AVERREST", "PAVER 1", "PAVERFACT 4", "SWED DOWN", "SWED?", "CALP FIXED", "CALP?")
    accepted(client, "4294a", "DCOMOPENG 0", "DCOMOPENC 0", "DCOMSHORR 0", "DCOMSHORL 0", "DCOMLOADR 100", "DCOMLOADL 1E-9")
    accepted(client, "4294a", "DCMOD CVOLT", "DCV 1", "DCRNG M100", "DCO OFF", "SDELT 0", "PDELT 0", "CWFREQ 1E6", "BEEPWARN ON")
    assert (client.query("AVER?"), client.query("SWED?"), float(client.query("DCOMLOADR?"))) == ("1", "DOWN", 100.0)


def test_the_4294a_hands_its_compensation_out_and_takes_it_back(bench: SimulatedBench) -> None:
    client = stock(bench, "4294a")
    client.write("OUTPCOMC1?")
    assert [entry.partition(",")[0] for entry in errors(client, "4294a")] == ["15"]
    client.write("STAR 1MHZ;STOP 2MHZ;POIN 3")
    bench.connect("short-standard")
    client.write("COMB")
    bench.connect("open-standard")
    client.write("COMA")
    conductance, susceptance = np.array(client.query("OUTPCOMC1?").split(","), dtype=float).reshape(-1, 2).T
    resistance, reactance = np.array(client.query("OUTPCOMC2?").split(","), dtype=float).reshape(-1, 2).T
    # The simulated fixture: 30 mOhm, 15 nH, 10 nS, 4 pF.
    omega = 2 * np.pi * np.array([1e6, 1.5e6, 2e6])
    np.testing.assert_allclose(resistance, 0.03, rtol=1e-6)
    np.testing.assert_allclose(reactance, omega * 15e-9, rtol=1e-6)
    np.testing.assert_allclose(susceptance, omega * 4e-12, rtol=1e-4)
    # Its resistance in series with its capacitance adds up to a hundredth.
    np.testing.assert_allclose(conductance, 1e-8, rtol=1e-2)
    kept = client.query("OUTPCOMC2?")
    client.write("COMA")
    client.write(f"INPUCOMC2 {kept}")
    assert client.query("OUTPCOMC2?") == kept
    client.write("INPUCOMC2 1,2,3")
    assert errors(client, "4294a")[0].startswith("-222")


def test_a_list_of_the_4294a_is_swept(bench: SimulatedBench) -> None:
    client = stock(bench, "4294a")
    client.write("SWPT LIST")
    assert errors(client, "4294a")[0].startswith("-221")
    assert client.query("SWPT?") == "LIN"
    accepted(
        client, "4294a", "EDITLIST", "CLEL", "SADD", "STAR 150E3", "STOP 1E6", "POIN 3", "SDON", "SADD", "STAR 2E6", "STOP 3E6", "POIN 2", "SDON"
    )
    accepted(client, "4294a", "EDITDONE", "SWPT LIST")
    assert int(client.query("POIN?")) == 5
    axis = np.array(client.query("OUTPSWPRM?").split(","), dtype=float)
    np.testing.assert_allclose(axis, [150e3, 575e3, 1e6, 2e6, 3e6])
    client.write("SING")
    assert client.query("*OPC?") == "1"
    assert len(client.query("OUTPDTRC?").split(",")) == 10
    # Outside of a segment the same words set the sweep again, and a segment without its edges is none.
    accepted(client, "4294a", "STAR 1E6", "SWPT LOG")
    assert float(client.query("STAR?")) == 1e6
    client.write("EDITLIST;CLEL;SADD;STAR 1E6;SDON")
    assert errors(client, "4294a")[0].startswith("-222")
    client.write("CLEL;EDITDONE")
    assert errors(client, "4294a")[0].startswith("-222")


def test_averaging_takes_longer_and_quietens(bench: SimulatedBench) -> None:
    client = stock(bench, "4294a")
    bench.connect("open")
    client.write("MEAS IRIM;STAR 1MHZ;STOP 2MHZ;POIN 401;TRGS INT;HOLD")

    def scatter(*setup: str) -> tuple[float, float]:
        client.write(";".join(setup))
        began = bench.clock.now()
        assert client.query("*OPC?") == "1"
        taken = bench.clock.now() - began
        values = np.array(client.query("OUTPDTRC?").split(","), dtype=float)[::2]
        return taken, float(np.std(np.diff(values, 2)))

    plain_s, plain = scatter("SING")
    points_s, points = scatter("PAVERFACT 64;PAVER ON", "SING")
    sweeps_s, sweeps = scatter("PAVER OFF;AVERFACT 16;AVER ON;AVERREST", "NUMG 16")
    # The first factor of the times is the number of readings; a fixed 40 ms a sweep are on top.
    assert points_s == pytest.approx(64 * plain_s, rel=0.05)
    assert sweeps_s == pytest.approx(16 * plain_s, rel=0.05)
    # Standard deviations of 399 second differences scatter by some 5 %.
    assert points == pytest.approx(plain / 8, rel=0.3)
    assert sweeps == pytest.approx(plain / 4, rel=0.3)


def test_a_bias_that_needs_more_than_its_range_is_error_137(bench: SimulatedBench) -> None:
    """The ladder of ranges that a public program climbs."""
    client = stock(bench, "4294a")
    bench.connect("load-standard")
    client.write("DCMOD CVOLT;DCRNG M1;DCV 0.5;*CLS;DCO ON")
    assert errors(client, "4294a")[0].startswith("137")
    assert client.query("DCO?") == "0"
    client.write("DCRNG M10;*CLS;DCO ON")
    assert errors(client, "4294a") == []
    client.write("DCV 20")
    assert errors(client, "4294a")[0].startswith("137")


def test_the_set_up_of_an_adapter_measures_what_it_needs(bench: SimulatedBench) -> None:
    client = stock(bench, "4294a")
    client.write("ECALP")
    assert errors(client, "4294a")[0].startswith("-221")
    accepted(client, "4294a", "E4TP M1", "ECALP", "ECALC", "ECALDON")
    for message in ("ECALA", "ECALDON"):
        client.write(message)
        assert errors(client, "4294a")[0].startswith("-221"), message
    accepted(client, "4294a", "E4TP PROBE", "ECALP", "ECALA", "ECALB", "ECALC", "ECALDON", "ECALQUI")
    assert client.query("E4TP?") == "PROBE"


@pytest.mark.parametrize("segments", ["", "500E3,1400E3,19,1410E3,2400E3,22,2500E3,5000E3,10"])
def test_the_order_of_a_public_acquisition_program_on_an_e4990a(bench: SimulatedBench, segments: str) -> None:
    """The messages of the acquisition program rjollos/e4990a 2.6 in its order: compensation, then a sweep with averages and a bias."""
    client = stock(bench, "e4990a")
    points = 51

    def configure() -> None:
        accepted(client, "e4990a", ":INIT1:CONT ON", ":TRIG:SOUR BUS", ":CALC1:PAR1:DEF R", ":CALC1:PAR2:DEF X")
        if segments:
            accepted(client, "e4990a", f":SENS1:SEGM:DATA 7,0,0,0,0,0,0,0,3,{segments}", ":SENS1:SWE:TYPE SEGM")
            assert int(client.query(":SENS1:SEGM:SWE:POIN?")) == points
            accepted(client, "e4990a", ":DISP:WIND1:X:SPAC LIN")
        else:
            accepted(client, "e4990a", ":SENS1:SWE:TYPE LIN", ":SENS1:FREQ:START 500000", ":SENS1:FREQ:STOP 5000000", f":SENS1:SWE:POIN {points}")
        accepted(client, "e4990a", ":SENS1:AVER:COUN 2", ":SENS1:AVER:STAT ON", ":SENS1:APER:TIME 1")
        accepted(client, "e4990a", ":TRIG:SEQ:AVER ON", ":CALC1:AVER ON", ":CALC1:AVER:COUN 4")

    def numbers(query: str) -> np.ndarray:
        return np.array(client.query_ascii_values(query, separator=","))

    assert numbers(":SENS1:CORR2:ZME:OPEN:FREQ?").size == 1
    assert int(float(client.query(":SENS1:CORR2:ZME:OPEN:POIN?"))) == 0
    accepted(client, "e4990a", ":SYST:PRES")
    configure()
    accepted(client, "e4990a", ":SENS1:CORR:COLL:FPO USER", ":SOUR1:MODE VOLT", ":SOUR1:VOLT 0.5")
    for standard, message in (("open-standard", ":SENS1:CORR2:COLL:ACQ:OPEN"), ("short-standard", ":SENS1:CORR2:COLL:ACQ:SHOR")):
        bench.connect(standard)  # type: ignore[arg-type]
        client.write(message)
        assert client.query("*OPC?") == "1"
    bench.connect("open")
    accepted(client, "e4990a", "*IDN?", "*OPT?", "*CLS", ":SENS:FIXT:SEL?")
    assert int(float(client.query(":SENS1:CORR2:OPEN?"))) == int(float(client.query(":SENS1:CORR2:SHOR?"))) == 1
    configure()
    frequency_hz = numbers(":SENS1:FREQ:DATA?")
    assert np.array_equal(frequency_hz, numbers(":SENS1:CORR2:ZME:OPEN:FREQ?"))
    assert int(float(client.query(":SENS1:CORR2:ZME:OPEN:POIN?"))) == points
    short = numbers(":SENS1:CORR2:ZME:SHOR:DATA?")
    assert numbers(":SENS1:CORR2:ZME:OPEN:DATA?").size == short.size == 2 * points
    np.testing.assert_allclose(short[::2], 0.03, rtol=1e-6)
    accepted(client, "e4990a", ":SOUR1:MODE VOLT", ":SOUR1:VOLT 0.5", ":SOUR1:BIAS:MODE VOLT", ":SOUR1:BIAS:VOLT 5.0", ":SOUR:BIAS:STAT ON")
    accepted(client, "e4990a", ":SENS1:DC:MEAS:ENAB ON", ":CALC1:MARK1 ON", ":CALC1:MARK1:FUNC:TYPE PEAK")
    for _ in range(2):
        accepted(client, "e4990a", ":SENS1:DC:MEAS:CLE", ":TRIG:SING")
        assert client.query("*OPC?") == "1"
        accepted(client, "e4990a", ":DISP:WIND1:TRAC1:Y:AUTO", ":DISP:WIND1:TRAC2:Y:AUTO", ":CALC1:MARK1:FUNC:EXEC")
        measured = numbers(":CALC1:DATA:RDAT?")
        assert abs(float(client.query(":SENS1:DC:MEAS:DATA:DCI?"))) < 1e-3
        assert float(client.query(":SENS1:DC:MEAS:DATA:DCV?")) == 5.0
        for trace in ("TRAC1:Y:RLEV", "TRAC2:Y:RLEV", "Y:DIV", "TRAC1:Y:PDIV", "TRAC2:Y:PDIV"):
            float(client.query(f":DISP:WIND1:{trace}?"))
    accepted(client, "e4990a", ":SOUR:BIAS:STAT OFF")
    truth = bench.motor.impedance("open", frequency_hz)
    assert np.median(np.abs((measured[::2] + 1j * measured[1::2]) / truth - 1)) < 5e-3


def test_a_list_of_the_e4990a_is_needed_and_checked(bench: SimulatedBench) -> None:
    client = stock(bench, "e4990a")
    client.write(":SENS1:SWE:TYPE SEGM")
    assert errors(client, "e4990a")[0].startswith("-221")
    for wrong in ("7,0,0,0,0,0,0,0,2,1E6,2E6,3", "7,0,0,0,0,0,0,0,1,2E6,1E6,3", "7,0,0,1,0,0,0,0,1,1E6,2E6,3,1", "words"):
        client.write(f":SENS1:SEGM:DATA {wrong}")
        assert errors(client, "e4990a")[0].startswith("-222"), wrong
    client.write(":SENS1:SEGM:DATA 7,0,0,0,0,0,0,0,1,1E6,2E6,3")
    assert [float(text) for text in client.query(":SENS1:SEGM:DATA?").split(",")] == [7, 0, 0, 0, 0, 0, 0, 0, 1, 1e6, 2e6, 3]


def typed(device: SimulatedShell, line: str) -> list[str]:
    """What the shell prints on a line."""
    device.take_answers()
    device.write(line.encode() + b"\r")
    return device.take_answers().decode().replace("ch> ", "").split("\r\n")[1:-1]


def test_the_tinysa_lists_the_frequencies_of_its_sweep(bench: SimulatedBench) -> None:
    device = SimulatedTinySa(bench, VirtualClock())
    typed(device, "sweep 150000 30000000 290")
    frequencies = [int(line) for line in typed(device, "frequencies")]
    assert (len(frequencies), frequencies[0], frequencies[-1]) == (290, 150_000, 30_000_000)
    assert len(typed(device, "data 0")) == 290
    for line, edges in (
        ("sweep center 20000000", "5075000 34925000"),
        ("sweep span 2000000", "19000000 21000000"),
        ("sweep center 500000", "0 1000000"),
        ("sweep cw 10000000", "10000000 10000000"),
    ):
        assert typed(device, line) == []
        assert typed(device, "sweep") == [f"{edges} 290"]
    assert typed(device, "sweep sideways 3")[0].startswith("usage")
