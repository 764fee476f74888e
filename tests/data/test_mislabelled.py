"""Sweeps that were measured with the wrong termination."""

from __future__ import annotations

import numpy as np
import pytest
from command_line import motoremi

from motoremi.data.measurement import Measurement
from motoremi.data.mislabelled import measured_twice
from motoremi.data.sweep import ImpedanceSweep
from motoremi.diagnosis.diagnosis import diagnose
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY = np.geomspace(150e3, 30e6, 101)
MOTOR = SimulatedMotor.random(11, ())


def taken(termination: str, named: str, connection: int) -> ImpedanceSweep:
    """A sweep of one termination under the name of another or the same, on a connection of its own."""
    seen = SimulatedAnalyser(7).measure(termination, FREQUENCY, MOTOR.impedance(termination, FREQUENCY), connection=connection)
    return ImpedanceSweep(named, FREQUENCY, seen, metadata={"analyser": "4294a"})


SHORT = taken("short", "short", 1)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_repeat_that_is_the_other_termination_is_left_out_whenever_it_was_taken(order):
    opened = [taken("short", "open", 2), taken("open", "open", 3)]
    measurement = Measurement.of([SHORT, *(opened[place] for place in order)])

    assert measurement.mislabelled == ("open",)
    assert measurement.sweeps[1].repeats == 1
    np.testing.assert_array_equal(measurement.sweeps[1].mean_ohm, opened[1].impedance_ohm)
    assert measured_twice(measurement.sweeps, measurement.floors) is None


def test_where_both_terminations_are_nearly_the_same_every_repeat_is_used():
    """Behind a filter they differ by 1 to 3 %, and repeats of one of them by 2 %."""
    ohm = SHORT.impedance_ohm
    shorts = [ImpedanceSweep("short", FREQUENCY, (1 + away) * ohm) for away in (0.0, 0.02)]
    opened = [ImpedanceSweep("open", FREQUENCY, (1 + away) * ohm) for away in (0.01, 0.05)]
    assert Measurement.of([*shorts, *opened]).mislabelled == ()


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_what_was_left_out_is_a_finding_and_changes_no_verdict():
    found = diagnose(fit(dc_motor(), [SHORT, taken("open", "open", 3), taken("short", "open", 2)]))

    told = [finding for finding in found.findings if finding.id == "not-as-asked"]
    assert found.verdict == "adequate"
    assert [(finding.sweep, finding.serious) for finding in told] == [("open", False)]


def test_of_two_inductive_sweeps_the_open_one_is_wrong_and_of_two_capacitive_ones_the_short_one():
    inductive = Measurement.of([SHORT, taken("short", "open", 2)])
    capacitive = Measurement.of([taken("open", "short", 1), taken("open", "open", 2)])

    assert measured_twice(inductive.sweeps, inductive.floors).wrong == "open"
    assert measured_twice(capacitive.sweeps, capacitive.floors).wrong == "short"
    assert inductive.mislabelled == capacitive.mislabelled == ()


def test_sweeps_without_a_common_band_are_not_the_same():
    high = np.geomspace(40e6, 60e6, 31)
    elsewhere = ImpedanceSweep("open", high, MOTOR.impedance("short", high))

    assert measured_twice(Measurement.of([SHORT, elsewhere]).sweeps, Measurement.of([SHORT, elsewhere]).floors) is None


def test_the_repeat_that_is_left_out_is_named_with_what_to_do():
    shorts = [SHORT.with_metadata(source="s1.csv"), taken("open", "short", 3).with_metadata(source="o3.csv")]
    measurement = Measurement.of([*shorts, taken("open", "open", 2)])

    told = [remark for remark in measurement.caveats() if "o3.csv" in remark]
    assert len(told) == 1
    assert "short sweep o3.csv is not used" in told[0]
    assert "--open" in told[0]
    assert "s1.csv" not in told[0]
    # Two short sweeps were given.
    assert any("only one short sweep is left" in remark for remark in measurement.caveats())


def test_a_repeat_without_a_file_is_named_by_its_place():
    measurement = Measurement.of([taken("short", "open", 2), SHORT, taken("open", "open", 3)])

    assert any("open sweep number 1 is not used" in remark for remark in measurement.caveats())


def test_repeats_of_one_file_are_named_by_their_places_in_it():
    shorts = [sweep.with_metadata(source="all.csv") for sweep in (SHORT, taken("open", "short", 3))]
    measurement = Measurement.of([*shorts, taken("open", "open", 2)])

    assert any("short sweep all.csv number 2 is not used" in remark for remark in measurement.caveats())


def circuit(frequency_hz, across_farad=0.0, scale=1.0):
    """Both terminations of a motor by the paper's formula; the capacitor is a suppressor from the terminal to the frame."""
    s = 2j * np.pi * frequency_hz
    winding = 1 / (1 / (2.3 + s * 24e-6 * scale) + s * 95e-12)
    frame = 1 / (1 / (18 + s * 700e-9 + 1 / (s * 310e-12 * scale)) + s * 150e-12 * scale)
    return {name: 1 / (1 / ohm + s * across_farad) for name, ohm in (("short", winding), ("open", winding + frame))}


def told_exchanged(frequency_hz, short_ohm, open_ohm, open_hz=None):
    sweeps = [ImpedanceSweep("short", frequency_hz, short_ohm), ImpedanceSweep("open", frequency_hz if open_hz is None else open_hz, open_ohm)]
    remarks = Measurement.of(sweeps).caveats()
    return any("exchanged" in remark for remark in remarks)


@pytest.mark.parametrize("space", [np.geomspace, np.linspace])
def test_exchanged_terminations_are_told(space):
    frequency = space(150e3, 30e6, 201)
    ohm = circuit(frequency)

    assert told_exchanged(frequency, ohm["open"], ohm["short"])
    assert not told_exchanged(frequency, ohm["short"], ohm["open"])


@pytest.mark.parametrize("across_farad", [1e-9, 10e-9, 100e-9, 1e-6])
def test_a_suppressor_capacitor_is_not_taken_for_an_exchange(across_farad):
    frequency = np.geomspace(10e3, 30e6, 201)
    ohm = circuit(frequency, across_farad)

    assert not told_exchanged(frequency, ohm["short"], ohm["open"])


@pytest.mark.parametrize("start_hz", [1e3, 100e3, 1e6, 3e6, 5e6, 11e6, 20e6])
@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0, 1000.0])
def test_no_band_makes_right_labels_look_exchanged(start_hz, scale):
    frequency = np.geomspace(start_hz, 30 * start_hz, 101)
    ohm = circuit(frequency, scale=scale)

    assert not told_exchanged(frequency, ohm["short"], ohm["open"])


def test_sweeps_of_different_bands_or_alike_are_not_told_exchanged():
    low, high = np.geomspace(150e3, 1e6, 101), np.geomspace(5e6, 30e6, 101)
    assert not told_exchanged(low, circuit(low)["open"], circuit(high)["short"], high)
    assert not told_exchanged(low, circuit(low)["open"], circuit(low)["open"])
    assert not told_exchanged(low, circuit(low)["short"], circuit(low)["short"])


def test_import_and_fit_name_the_sweep_that_is_left_out(tmp_path):
    def written(name, sweep):
        rows = zip(FREQUENCY.tolist(), sweep.impedance_ohm.tolist(), strict=True)
        lines = "".join(f"{f!r},{z.real!r},{z.imag!r}\n" for f, z in rows)
        (tmp_path / name).write_text(f"frequency_hz,resistance_ohm,reactance_ohm\n{lines}")
        return tmp_path / name

    short, opened = written("s1.csv", SHORT), written("o1.csv", taken("open", "open", 2))
    wrong, later = written("o2.csv", taken("open", "open", 3)), written("o3.csv", taken("open", "open", 4))
    done = motoremi("import", tmp_path / "s", "--short", short, "--short", wrong, "--open", opened, "--analyser", "4294a")
    assert [line for line in done.stdout.splitlines() if "short sweep o2.csv is not used" in line]
    assert "short sweep o2.csv is not used" in motoremi("fit", tmp_path / "s").stdout

    # What is appended is told as left out, not as a repeat that is averaged.
    done = motoremi("import", tmp_path / "s", "--append", "--short", later)
    assert "o3.csv are not used" in done.stdout
    assert "repeats are averaged" not in done.stdout


def test_exchanged_terminations_are_told_just_below_a_resonance():
    """A motor of 180 W whose frame and winding resonate at 0.5 MHz: from 150 kHz both sweeps are steeper than a capacitor and an inductor."""
    frequency = np.geomspace(150e3, 30e6, 151)
    s = 2j * np.pi * frequency
    winding = 1 / (1 / (57 + s * 290e-6) + s * 49e-12)
    frame = 1 / (1 / (27 + s * 1.2e-6 + 1 / (s * 200e-12)) + s * 170e-12)

    assert told_exchanged(frequency, winding + frame, winding)
    assert not told_exchanged(frequency, winding, winding + frame)


def test_one_file_for_both_terminations_is_told():
    frequency = np.geomspace(150e3, 30e6, 51)
    ohm = circuit(frequency)
    same = [ImpedanceSweep(termination, frequency, ohm["short"]) for termination in ("short", "open")]

    assert any("hold the same readings" in remark for remark in Measurement.of(same).caveats())
    assert not any(
        "hold the same readings" in remark for remark in Measurement.of([same[0], ImpedanceSweep("open", frequency, ohm["open"])]).caveats()
    )
