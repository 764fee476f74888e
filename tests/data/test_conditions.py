"""What was set up for a sweep, and single values: read from text, stored, and kept beside the sweeps of the motor as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from motoremi.data.conditions import CONDITIONS, VALUES, Condition, condition, parse_condition, parse_value
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.files import read_impedance
from motoremi.data.measurement import Measurement
from motoremi.data.session import SessionWriter, load, verify
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.workflow import measurement_of

FREQUENCY = np.geomspace(1e4, 1e7, 40)


def sweep(termination: str = "short", under: str | None = None, factor: float = 1.0) -> ImpedanceSweep:
    return ImpedanceSweep(termination, FREQUENCY, factor * (1 + 2j * np.pi * FREQUENCY * 1e-5), condition=under)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("second-temperature=53degC", Condition("second-temperature", 53.0, "degC")),
        ("second-temperature = 53 °C", Condition("second-temperature", 53.0, "degC")),
        ("longer-lead=50nH", Condition("longer-lead", 50e-9, "H")),
        ("dc-bias=500mA", Condition("dc-bias", 0.5, "A")),
        ("fixture-load=50Ω", Condition("fixture-load", 50.0, "Ohm")),
        ("known-capacitor=100 pF", Condition("known-capacitor", 100e-12, "F")),
        ("far-end-grounded", Condition("far-end-grounded")),
        ("shaft-turned", Condition("shaft-turned")),
        ("shaft-turned=-30deg", Condition("shaft-turned", -30.0, "deg")),
        ("repeats", None),
    ],
)
def test_a_condition_is_read_as_people_write_it(text: str, expected: Condition | None) -> None:
    found = parse_condition(text)
    assert found == expected
    assert found is None or parse_condition(found.text) == found


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("second-temperature", "needs its value"),
        ("second-temperature=", "needs its value"),
        ("second-temperature=53", "is not in degC"),
        ("second-temperature=326K", "is not in degC"),
        ("second-temperature=-300degC", "absolute zero"),
        ("second-temperature=nandegC", "cannot read"),
        ("longer-lead=50pF", "is not in H"),
        ("longer-lead=50H", "out of range"),
        ("dc-bias=0A", "no bias"),
        ("far-end-grounded=1", "takes no value"),
        ("dc-resistance=1ohm", "--value"),
        ("second temperature\n", "unknown condition"),
    ],
)
def test_a_condition_that_cannot_be_is_one_line(text: str, told: str) -> None:
    with pytest.raises(BadInput, match=told) as error:
        parse_condition(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "value", "sigma"),
    [
        ("dc-resistance=21.3mohm", 21.3e-3, 0.005 * 21.3e-3),
        ("dc-resistance=21.3mohm+-0.1mohm", 21.3e-3, 0.1e-3),
        ("dc-resistance = 21.3 mΩ ± 0.5%", 21.3e-3, 0.005 * 21.3e-3),
        ("insulation-resistance=2Gohm", 2e9, 0.2e9),
        ("capacitance-1khz=320pF+-1pF", 320e-12, 1e-12),
        ("tan-delta-1khz=0.012+-0.001", 0.012, 0.001),
        # Metres here, not milli.
        ("lead-length=0.3m", 0.3, 0.03),
        ("lead-length=30cm+-5mm", 0.3, 0.005),
    ],
)
def test_a_single_value_is_read_with_its_uncertainty(text: str, value: float, sigma: float) -> None:
    found = parse_value(text)
    assert (found.value_si, found.sigma) == pytest.approx((value, sigma), rel=1e-12)
    assert parse_value(found.text) == found


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("dc-resistance", "needs its value"),
        ("dc-resistance=1", "is not in Ohm"),
        ("dc-resistance=1ohm+-0.1", "is not in Ohm"),
        ("dc-resistance=1ohm+-", "needs its value"),
        ("dc-resistance=1ohm+-2ohm", "uncertainty"),
        ("dc-resistance=1ohm+-1%+-2%", "one uncertainty"),
        ("dc-resistance=-1ohm", "out of range"),
        ("lead-length=12inch", "as a length"),
        ("resistance=1ohm", "unknown value"),
    ],
)
def test_a_single_value_that_cannot_be_is_one_line(text: str, told: str) -> None:
    with pytest.raises(BadInput, match=told) as error:
        parse_value(text)
    assert "\n" not in str(error.value)


def test_every_example_in_the_tables_is_read() -> None:
    for name, setting in CONDITIONS.items():
        assert parse_condition(f"{name}={setting.example}" if setting else name) is not None
    for name, quantity in VALUES.items():
        assert parse_value(f"{name}={quantity.setting.example}").name == name


@pytest.mark.parametrize("value", [1 / 3e7, 5e-8, 1.23456789012345e-7])
def test_text_keeps_every_digit(value: float) -> None:
    assert parse_condition(condition("longer-lead", value).text) == Condition("longer-lead", value, "H")


def test_a_file_says_its_condition(tmp_path: Path) -> None:
    write_impedance_csv(tmp_path / "warm.csv", sweep(under="second-temperature=53degC"))
    found = read_impedance(tmp_path / "warm.csv", "short")
    assert found.condition == Condition("second-temperature", 53.0, "degC")
    assert "condition" not in found.metadata
    assert "second-temperature=53degC" in found.summary()
    (tmp_path / "warm.s1p").write_text("! Condition: dc-bias=1A\n# HZ S RI R 50\n" + "".join(f"{f:.6e} 0.5 0.1\n" for f in FREQUENCY))
    assert read_impedance(tmp_path / "warm.s1p", "short").condition == Condition("dc-bias", 1.0, "A")


def test_a_file_with_a_condition_that_is_none_is_refused(tmp_path: Path) -> None:
    text = "# condition: second-temperature\nfrequency_hz,resistance_ohm,reactance_ohm\n" + "".join(f"{f},1,1\n" for f in FREQUENCY)
    (tmp_path / "warm.csv").write_text(text)
    with pytest.raises(BadInput, match=r"warm\.csv: the condition second-temperature needs its value"):
        read_impedance(tmp_path / "warm.csv", "short")


def test_a_session_keeps_conditions_and_values_beside_the_sweeps(tmp_path: Path) -> None:
    own = [sweep("short"), sweep("open", factor=100), sweep("short", "second-temperature=53degC", 1.1)]
    value = parse_value("dc-resistance=21.3mohm+-0.1mohm")
    with SessionWriter.create(tmp_path / "motor", {"title": "motor"}) as writer:
        for one in own:
            writer.add_sweep(one)
        writer.add_value(value)
        writer.close("done")
    session = load(tmp_path / "motor")
    assert verify(tmp_path / "motor") == []
    assert [one.termination for one in session.sweeps] == ["short", "open"]
    assert [one.condition for one in session.conditioned] == [Condition("second-temperature", 53.0, "degC")]
    assert session.values == (value,)
    assert (tmp_path / "motor/sweeps/short-second-temperature-1.csv").is_file()
    measurement, alone = measurement_of(session), Measurement.of(own[:2])
    assert np.array_equal(measurement.sweeps[0].mean_ohm, alone.sweeps[0].mean_ohm)
    assert np.array_equal(measurement.noise[0].sigma, alone.noise[0].sigma)
    assert [one.condition.id for one in measurement.conditioned] == ["second-temperature"]
    assert np.array_equal(measurement.conditioned[0].sweep.mean_ohm, own[2].impedance_ohm)
    assert measurement.values == (value,)


def test_a_remark_of_an_older_session_is_no_condition(tmp_path: Path) -> None:
    with SessionWriter.create(tmp_path / "motor", {"title": "motor"}) as writer:
        writer.add_sweep(sweep("short").with_metadata(condition="brushes new"))
        writer.close("done")
    session = load(tmp_path / "motor")
    assert session.sweeps[0].metadata["condition"] == "brushes new"
    assert session.conditioned == ()


def test_sweeps_under_conditions_alone_are_refused() -> None:
    with pytest.raises(BadInput, match="every sweep is under a condition"):
        Measurement.of([sweep("short", "dc-bias=1A")])


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("dc-resistance=2.3Ohm+-5%", "dc-resistance=2.3Ohm+-115mOhm"),
        ("capacitance-1khz=1nF", "capacitance-1khz=1nF+-10pF"),
        ("capacitance-1khz=950pF", "capacitance-1khz=950pF+-9.5pF"),
    ],
)
def test_an_uncertainty_in_percent_is_shown_without_binary_rounding(given: str, text: str) -> None:
    assert parse_value(given).text == text
    assert parse_value(text) == parse_value(given)
