"""The 4294A driver against the simulated 4294A, through PyVISA, and the simulated 4294A against its manual."""

from __future__ import annotations

from importlib.resources import as_file, files

import numpy as np
import pytest
import pyvisa

from motoremi.bench.connect import open_transport
from motoremi.data.sweep import TERMINATIONS
from motoremi.errors import BadInput, InstrumentError
from motoremi.instruments.agilent_4294a import Agilent4294A
from motoremi.virtual.simulated_bench import SimulatedBench


@pytest.fixture
def analyser(bench: SimulatedBench) -> Agilent4294A:
    link = open_transport(bench.resource_manager, bench.resources["analyser"], clock=bench.clock)
    analyser = Agilent4294A(link)
    analyser.reset()
    analyser.configure(150e3, 30e6, 51)
    return analyser


@pytest.fixture
def raw(bench: SimulatedBench) -> pyvisa.resources.MessageBasedResource:
    """A stock client: PyVISA and nothing of ours."""
    resource = bench.resource_manager.open_resource("GPIB0::17::INSTR", write_termination="\n")
    assert isinstance(resource, pyvisa.resources.MessageBasedResource)
    return resource


def compensate(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    bench.connect("open-standard")
    analyser.compensate("open")
    bench.connect("short-standard")
    analyser.compensate("short")


def test_identity(analyser: Agilent4294A) -> None:
    identity = analyser.identify()
    assert (identity.model, identity.firmware) == ("4294A", "REV1.11")


def test_the_wrong_instrument_is_named(bench: SimulatedBench) -> None:
    link = open_transport(bench.resource_manager, bench.resources["receiver"])
    with pytest.raises(InstrumentError, match=r"expected a 4294A, but 'Rohde&Schwarz,ESR3"):
        Agilent4294A(link).identify()


def test_settings_are_what_the_instrument_says(analyser: Agilent4294A) -> None:
    settings = analyser.configure(200e3, 20e6, 101, "linear", 5, 0.25)
    assert settings == {
        "start_hz": 200e3,
        "stop_hz": 20e6,
        "points": 101,
        "spacing": "linear",
        "bandwidth_factor": 5,
        "oscillator_volt": 0.25,
        "measurement": "resistance-reactance",
        "adapter": "none",
        "sweep_averaging": False,
        "sweep_averages": 16,
        "point_averaging": False,
        "point_averages": 4,
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_hz": 10.0}, "start_hz = 10 Hz is outside the range 40 Hz to 110 MHz"),
        ({"stop_hz": 200e6}, "stop_hz = 200 MHz"),
        ({"points": 802}, "points = 802 is outside the range 2 to 801"),
        ({"bandwidth_factor": 0}, "bandwidth_factor"),
        ({"oscillator_volt": 2.0}, "oscillator_volt = 2 V is outside the range 5 mV to 1 V"),
        ({"spacing": "cubic"}, "spacing = 'cubic' is unknown; use one of log, linear"),
    ],
)
def test_settings_out_of_range_are_refused_before_the_wire(analyser: Agilent4294A, change: dict[str, float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        analyser.configure(**{"start_hz": 150e3, "stop_hz": 30e6, "points": 51, **change})  # type: ignore[arg-type]


def test_an_error_carries_number_text_and_command(analyser: Agilent4294A) -> None:
    with pytest.raises(InstrumentError, match=r"Agilent4294A at GPIB0::17::INSTR: error -113 \"UNDEFINED HEADER\" after 'WOBBLE'"):
        analyser.tell("WOBBLE")
    analyser.tell("HOLD")


def test_all_errors_are_told_and_the_queue_keeps_ten(analyser: Agilent4294A) -> None:
    for _ in range(12):
        analyser.transport.write("WOBBLE")
    with pytest.raises(InstrumentError) as caught:
        analyser.check_errors("WOBBLE")
    assert str(caught.value).count("-113") == 10


def test_a_compensated_sweep_finds_the_motor(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    compensate(bench, analyser)
    for termination in TERMINATIONS:
        bench.connect(termination)
        sweep = analyser.sweep(termination)
        assert sweep.termination == termination
        assert sweep.metadata["analyser"] == "4294a"
        assert sweep.metadata["settings"]["points"] == len(sweep) == 51
        truth = bench.motor.impedance(termination, sweep.frequency_hz)
        assert np.median(np.abs(sweep.impedance_ohm / truth - 1)) < 5e-3


def test_without_compensation_the_fixture_shows(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    bench.connect("open")
    sweep = analyser.sweep("open")
    truth = bench.motor.impedance("open", sweep.frequency_hz)
    assert np.max(np.abs(sweep.impedance_ohm / truth - 1)) > 2e-2
    assert sweep.metadata["compensated"] == []


def test_the_wrong_standard_spoils_the_sweep(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    """The simulated operator can make mistakes: the short is measured with the motor still connected."""
    bench.connect("open")
    analyser.compensate("short")
    bench.connect("open")
    sweep = analyser.sweep("open")
    assert np.median(np.abs(sweep.impedance_ohm / bench.motor.impedance("open", sweep.frequency_hz) - 1)) > 0.9


@pytest.mark.parametrize("change", [(150e3, 30e6, 61), (150e3, 29e6, 51)])
def test_compensation_at_other_frequencies_is_refused(bench: SimulatedBench, analyser: Agilent4294A, change: tuple[float, float, int]) -> None:
    compensate(bench, analyser)
    analyser.configure(*change)
    bench.connect("open")
    with pytest.raises(InstrumentError, match=r"compensation was measured at 51 points .* compensate again"):
        analyser.sweep("open")
    compensate(bench, analyser)
    bench.connect("open")
    assert len(analyser.sweep("open")) == change[2]


def test_data_are_refused_before_the_sweep_is_complete(analyser: Agilent4294A) -> None:
    analyser.trigger()
    with pytest.raises(InstrumentError, match="sweep is not complete"):
        analyser.read_impedance()
    analyser.wait_until_complete()
    assert analyser.read_impedance().size == 51


def test_binary_and_ascii_transfer_agree(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    bench.connect("short")
    analyser.trigger()
    analyser.wait_until_complete()
    binary = analyser.read_impedance()
    analyser.binary = False
    np.testing.assert_allclose(analyser.read_impedance(), binary, rtol=1e-10)
    np.testing.assert_allclose(analyser.read_axis(), np.geomspace(150e3, 30e6, 51), rtol=1e-10)


@pytest.mark.parametrize("bandwidth", [1, 5])
def test_a_slow_sweep_takes_virtual_time_only(bench: SimulatedBench, analyser: Agilent4294A, bandwidth: int) -> None:
    analyser.configure(150e3, 30e6, 801, bandwidth_factor=bandwidth)
    before = bench.clock.now()
    bench.connect("open")
    analyser.sweep("open")
    assert bench.clock.now() - before > 801 * analyser.SECONDS_PER_POINT[bandwidth - 1]


def test_a_sweep_that_never_ends_meets_its_deadline(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    analyser.trigger()
    analyser.tell("HOLD")
    with pytest.raises(InstrumentError, match="'SING' is not complete after 12 s"):
        analyser.wait_until_complete()


def test_a_silent_instrument_meets_the_deadline(bench: SimulatedBench, analyser: Agilent4294A, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench.devices["analyser"], "write", lambda data: None)
    with analyser.transport.deadline(0.02), pytest.raises(InstrumentError, match=r"no answer to 'STAR\?' within 0.02 s"):
        _ = analyser.start_hz


def test_the_safe_state_is_held_with_the_lowest_level(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    analyser.trigger()
    analyser.transport.write("*IDN?")
    analyser.safe()
    assert analyser.oscillator_volt == 0.005
    assert bench.devices["analyser"].busy_until() == bench.clock.now()


def test_a_stock_client_may_write_units(raw: pyvisa.resources.MessageBasedResource) -> None:
    for written, hertz in (("STAR 150000 HZ", 150e3), ("STAR 0.2MHZ", 200e3), ("star 40e3", 40e3)):
        raw.write(written)
        assert float(raw.query("STAR?")) == hertz
    raw.write("STAR 1 OHM")
    assert raw.query("OUTPERRO?").startswith("-222")
    raw.write("POIN 802")
    assert raw.query("OUTPERRO?").startswith("-222")
    assert raw.query("OUTPERRO?").startswith("0")


def test_a_stock_client_sees_status_bits(bench: SimulatedBench, raw: pyvisa.resources.MessageBasedResource) -> None:
    raw.write("*CLS;POIN 11;ESNB 1;*SRE 4;SING")
    assert raw.read_stb() == 0
    bench.clock.sleep(1.0)
    assert raw.read_stb() == 0x44
    assert int(raw.query("ESB?")) == 1
    assert raw.read_stb() == 0
    raw.write("COMA")
    bench.clock.sleep(1.0)
    assert int(raw.query("ESB?")) == 256


def test_clearing_after_the_trigger_loses_the_bit(bench: SimulatedBench, raw: pyvisa.resources.MessageBasedResource) -> None:
    """What a public script does, and why `*CLS` comes before `SING` in ours."""
    raw.write("POIN 2;SING")
    bench.clock.sleep(1.0)
    raw.write("*CLS")
    bench.clock.sleep(1.0)
    assert int(raw.query("ESB?")) == 0


def test_the_compensation_cannot_be_enabled_before_it_is_measured(raw: pyvisa.resources.MessageBasedResource) -> None:
    raw.write("COMSTA ON")
    assert raw.query("OUTPERRO?").startswith("15")
    assert raw.query("COMSTA?").strip() == "0"


def test_a_new_message_before_the_answer_is_read_is_a_query_error(raw: pyvisa.resources.MessageBasedResource) -> None:
    raw.write("POIN?")
    assert raw.query("STAR?").strip().startswith("+4.0")
    assert raw.query("OUTPERRO?").startswith("-420")


@pytest.mark.parametrize(("command", "datatype", "big"), [("FORM2", "f", True), ("FORM3", "d", True), ("FORM5", "f", False)])
def test_pyvisa_reads_every_binary_format(raw: pyvisa.resources.MessageBasedResource, command: str, datatype: str, big: bool) -> None:
    raw.write(f"STAR 1E3;STOP 2E3;POIN 3;{command}")
    values = raw.query_binary_values("OUTPSWPRM?", datatype=datatype, is_big_endian=big)  # type: ignore[arg-type]
    np.testing.assert_allclose(values, [1e3, 1.5e3, 2e3], rtol=1e-6)


def test_each_connection_has_its_own_residuals(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    compensate(bench, analyser)
    analyser.configure(150e3, 30e6, 51, bandwidth_factor=5)
    bench.connect("short")
    first, same = (analyser.sweep("short").impedance_ohm for _ in range(2))
    bench.connect("short")
    other = analyser.sweep("short").impedance_ohm
    assert np.max(np.abs(other / first - 1)) > 3 * np.max(np.abs(same / first - 1))


def test_effects_go_to_the_motor_or_to_the_meter() -> None:
    bench = SimulatedBench(1, ("eddy-laminations", "open-residual"))
    truth = bench.truth()
    assert set(truth["effects"]) == {"eddy-laminations"}
    assert set(truth["faults"]) == {"open-residual"}
    bench.close()
    with pytest.raises(BadInput, match="unknown effect 'gremlins'"):
        SimulatedBench(1, ("gremlins",))


@pytest.mark.parametrize(
    ("name", "resource", "model"),
    [("agilent_4294a", "GPIB0::17::INSTR", "4294A"), ("rohde_schwarz_esr", "GPIB0::20::INSTR", "ESR3")],
)
def test_the_profiles_are_valid_for_stock_pyvisa_sim(name: str, resource: str, model: str) -> None:
    with as_file(files("motoremi.sim_profiles") / f"{name}.yaml") as path:
        manager = pyvisa.ResourceManager(f"{path}@sim")
    stock = manager.open_resource(resource, write_termination="\n", read_termination="\n")
    assert isinstance(stock, pyvisa.resources.MessageBasedResource)
    assert stock.query("*IDN?").split(",")[1] == model
    manager.close()


def test_the_simulated_bench_has_two_instruments(bench: SimulatedBench) -> None:
    assert set(bench.resource_manager.list_resources()) == set(bench.resources.values())
    with pytest.raises(BadInput, match="no 'oscilloscope'"):
        bench.open("oscilloscope", "4294a", "", lambda record: None)
    with pytest.raises(BadInput, match="unknown connection 'motor'"):
        bench.connect("motor")  # type: ignore[arg-type]


def test_two_benches_do_not_share_anything(bench: SimulatedBench, analyser: Agilent4294A) -> None:
    other = SimulatedBench(8)
    link = open_transport(other.resource_manager, other.resources["analyser"], clock=other.clock)
    assert Agilent4294A(link).points == 201
    assert analyser.points == 51
    other.close()


def test_an_empty_answer_is_an_answer(raw: pyvisa.resources.MessageBasedResource) -> None:
    assert raw.query("TITL?").strip() == ""
    raw.write('TITL "Motor 7"')
    assert raw.query("TITL?").strip() == '"Motor 7"'


def test_every_pair_of_quantities_is_of_the_same_impedance(bench: SimulatedBench, raw: pyvisa.resources.MessageBasedResource) -> None:
    """A stock client reads R and X, and then what each other word of MEAS makes of them, in the definitions of the manual."""
    bench.connect("open")
    raw.write("STAR 1MHZ;STOP 2MHZ;POIN 3;SING")

    def traces(word: str) -> tuple[np.ndarray, np.ndarray]:
        raw.write(f"MEAS {word}")
        shown = []
        for trace in "AB":
            raw.write(f"TRAC {trace}")
            shown.append(np.array([float(value) for value in raw.query("OUTPDTRC?").split(",")]).reshape(-1, 2))
        return shown[0], shown[1]

    resistance, reactance = (trace[:, 0] for trace in traces("IRIM"))
    omega = 2 * np.pi * np.array([1e6, 1.5e6, 2e6])
    conductance = resistance / (resistance**2 + reactance**2)
    susceptance = -reactance / (resistance**2 + reactance**2)
    expected = {
        "CSR": (-1 / (omega * reactance), resistance),
        "LSQ": (reactance / omega, np.abs(reactance) / resistance),
        "CPG": (susceptance / omega, conductance),
        "LPR": (-1 / (omega * susceptance), 1 / conductance),
        "CPD": (susceptance / omega, conductance / np.abs(susceptance)),
        "AMPH": (np.hypot(conductance, susceptance), np.degrees(np.arctan2(susceptance, conductance))),
    }
    for word, pair in expected.items():
        for shown, wanted in zip(traces(word), pair, strict=True):
            np.testing.assert_allclose(shown[:, 0], wanted, rtol=1e-8, err_msg=word)
            assert not shown[:, 1].any()
    impedance, admittance = traces("COMP")
    np.testing.assert_allclose(impedance, np.column_stack([resistance, reactance]), rtol=1e-9)
    np.testing.assert_allclose(admittance, np.column_stack([conductance, susceptance]), rtol=1e-8)
