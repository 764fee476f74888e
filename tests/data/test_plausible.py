"""A phase that no passive part has, and values without the right unit: told on import, and the verdict is `data`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi
from conftest import simulated_sweeps
from few_effects import seeking
from places import DATA

import motoremi as me
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.files import read_impedance
from motoremi.data.plausible import implausible, phase_against_slope, wrong_phase

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
S = 2j * np.pi * FREQUENCY_HZ


def radians_called_degrees(impedance_ohm: np.ndarray) -> np.ndarray:
    return np.abs(impedance_ohm) * np.exp(1j * np.deg2rad(np.angle(impedance_ohm)))


def motor_like() -> np.ndarray:
    """A winding with a resonance of quality 40 above a capacitance."""
    branch = 5 + S * 80e-6
    return branch / (1 + S * 20e-12 * branch) + 1 / (S * 400e-12)


@pytest.mark.parametrize(
    "impedance_ohm",
    [1 / (S * 1e-10), 3 + S * 1e-5, np.sqrt(S), motor_like(), np.full(201, 50 + 0j), 50 + S * 1e-9],
    ids=["capacitor", "coil", "skin effect", "motor", "resistor", "resistor with a lead"],
)
def test_a_passive_part_has_the_phase_of_its_slope(impedance_ohm: np.ndarray) -> None:
    assert implausible(FREQUENCY_HZ, impedance_ohm) == ()


@pytest.mark.parametrize("impedance_ohm", [1 / (S * 1e-10), np.sqrt(S), motor_like()], ids=["capacitor", "skin effect", "motor"])
@pytest.mark.parametrize(("spoilt", "found"), [(np.conj, "wrong sign"), (radians_called_degrees, "radians")])
def test_what_is_wrong_is_told(impedance_ohm: np.ndarray, spoilt: Callable[[np.ndarray], np.ndarray], found: str) -> None:
    noise = np.exp(1e-3 * np.random.default_rng(5).standard_normal(201))
    assert wrong_phase(FREQUENCY_HZ, spoilt(impedance_ohm * noise)) == found


def decibels_called_ohms(impedance_ohm: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.abs(impedance_ohm)) * np.exp(1j * np.angle(impedance_ohm))


def exchanged(impedance_ohm: np.ndarray) -> np.ndarray:
    return impedance_ohm.imag + 1j * impedance_ohm.real


@pytest.mark.parametrize(
    "impedance_ohm", [1 / (S * 1e-10), 3 + S * 1e-5, 1e-2 * np.sqrt(S), motor_like()], ids=["capacitor", "coil", "skin", "motor"]
)
def test_decibels_called_ohms_are_told(impedance_ohm: np.ndarray) -> None:
    noise = np.exp(1e-3 * np.random.default_rng(5).standard_normal(201))
    assert wrong_phase(FREQUENCY_HZ, decibels_called_ohms(impedance_ohm * noise)) == "decibels"
    (sentence,) = implausible(FREQUENCY_HZ, decibels_called_ohms(impedance_ohm))
    assert "is |Z| in dBOhm, and called Ohm?" in sentence


@pytest.mark.parametrize(
    ("impedance_ohm", "told"), [(30 + motor_like(), True), (30 + S * 1e-5, True), (np.full(201, 50 + 0j), False)], ids=["motor", "coil", "resistor"]
)
def test_exchanged_columns_are_told(impedance_ohm: np.ndarray, told: bool) -> None:
    """What would be a capacitance after the exchange could be one before it."""
    noise = np.exp(1e-3 * np.random.default_rng(5).standard_normal(201))
    assert (wrong_phase(FREQUENCY_HZ, exchanged(impedance_ohm * noise)) == "exchanged") == told
    assert any("if they are exchanged" in sentence for sentence in implausible(FREQUENCY_HZ, exchanged(impedance_ohm))) == told


@pytest.mark.parametrize("noise", [0.0, 1e-2])
@pytest.mark.parametrize("points", [31, 201, 5001])
def test_a_reactance_without_its_sign_is_told(points: int, noise: float) -> None:
    """Of a motor; a coil has none to lose."""
    s = 2j * np.pi * np.geomspace(150e3, 30e6, points)
    rng = np.random.default_rng(3)
    branch = 5 + s * 80e-6
    for impedance_ohm, found in ((branch / (1 + s * 20e-12 * branch) + 1 / (s * 400e-12), "no sign"), (branch, None)):
        noisy = impedance_ohm * (1 + noise * rng.standard_normal(points))
        unsigned = noisy.real + 1j * np.abs(noisy.imag)
        assert wrong_phase(s.imag / (2 * np.pi), unsigned) == found
        assert any("without its sign" in text for text in implausible(s.imag / (2 * np.pi), unsigned)) == (found is not None)


@pytest.mark.parametrize("quality", [1.5, 3.0, 6.0])
def test_resonances_behind_an_inductance_keep_their_sign(quality: float) -> None:
    """|Z| falls above each of five cells, and the coil before them keeps the reactance positive."""
    rates = 2 * np.pi * np.geomspace(400e3, 10e6, 5)[:, None]
    cells = 100 * (S * rates / quality) / (S**2 + S * rates / quality + rates**2)
    impedance_ohm = 1 + S * 100 / (2 * np.pi * 1e6) + np.sum(cells, axis=0)
    assert np.all(impedance_ohm.imag > 0)
    assert np.any(np.diff(np.abs(impedance_ohm)) < 0) or quality < 3
    assert wrong_phase(FREQUENCY_HZ, impedance_ohm) is None


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 0.5, -0.5])
@pytest.mark.parametrize(
    "impedance_ohm", [1 / (S * 1e-10), 3 + S * 1e-5, np.sqrt(S), motor_like()], ids=["capacitor", "coil", "skin effect", "motor"]
)
def test_a_magnitude_without_phase_is_told(impedance_ohm: np.ndarray, degrees: float) -> None:
    """Whatever noise |Z| has, and if another constant was written instead of the phase."""
    noise = np.exp(1e-2 * np.random.default_rng(8).standard_normal(201))
    alone = np.abs(impedance_ohm) * noise * np.exp(1j * np.deg2rad(degrees))
    # In a constant phase of a part whose slope is constant, radians that were called degrees are as likely.
    assert wrong_phase(FREQUENCY_HZ, alone) in (("no phase",) if degrees == 0.0 else ("no phase", "radians"))
    assert len(implausible(FREQUENCY_HZ, alone)) == 1


@pytest.mark.parametrize("points", [9, 201, 20001])
@pytest.mark.parametrize("span", [1.01, 200.0, 2.75e6])
def test_a_noisy_resistor_is_not_told(points: int, span: float) -> None:
    rng = np.random.default_rng(9)
    for noise in (1e-4, 1e-2, 0.1):
        relative = 1 + noise * (rng.standard_normal(points) + 1j * rng.standard_normal(points))
        assert wrong_phase(np.geomspace(40, 40 * span, points), 50 * relative) is None
        # With a phase of few digits, which are all 0.
        assert wrong_phase(np.geomspace(40, 40 * span, points), 50 * np.abs(relative) + 0j) is None


def test_noise_alone_is_not_told() -> None:
    rng = np.random.default_rng(6)
    assert wrong_phase(FREQUENCY_HZ, rng.standard_normal(201) + 1j * rng.standard_normal(201)) is None


def test_measured_parts_are_far_from_the_limits() -> None:
    """The real sweeps that the tests have: the wrong sign is told below -0.5."""
    for path in (DATA / "eth_4294A_inductor/impedance.txt", next(DATA.glob("motor*/*.csv"))):
        sweep = read_impedance(path, "short")
        assert phase_against_slope(sweep.frequency_hz, sweep.impedance_ohm).correlation > 0.8


def test_a_file_without_phase_is_told(tmp_path: Path) -> None:
    rows = [f"{f!r},{z!r},0.0" for f, z in zip(FREQUENCY_HZ.tolist(), np.abs(motor_like()).tolist(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["frequency_hz,impedance_ohm,phase_deg", *rows, ""]))
    (warning,) = read_impedance(tmp_path / "a.csv", "short").metadata["warnings"]
    assert "|Z| alone is not enough" in warning


@pytest.mark.case
@pytest.mark.slow
def test_the_verdict_on_magnitudes_is_data() -> None:
    sweeps = [me.ImpedanceSweep(s.termination, s.frequency_hz, np.abs(s.impedance_ohm)) for s in simulated_sweeps(3)[0]]
    with seeking():
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.verdict == "data"
    (finding,) = (one for one in found.findings if one.id == "wrong-phase")
    assert finding.serious
    assert "|Z| alone is not enough" in finding.why


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_values_in_another_unit_are_told(tmp_path: Path, factor: float) -> None:
    write_impedance_csv(tmp_path / "a.csv", me.ImpedanceSweep("short", FREQUENCY_HZ, factor * motor_like()))
    (warning,) = read_impedance(tmp_path / "a.csv", "short").metadata["warnings"]
    assert "is the unit of its columns right?" in warning


@pytest.mark.parametrize(("factor", "span"), [(1e-6, "150 mHz - 30 Hz"), (1e6, "150 GHz - 30 THz"), (1.0, "")])
def test_frequencies_in_another_unit_are_reported(factor: float, span: str) -> None:
    frequency = np.geomspace(150e3, 30e6, 101)
    expected = (f"the frequencies are {span}: is their unit right?",) if span else ()
    assert implausible(factor * frequency, 3 + 2j * np.pi * frequency * 27e-6) == expected


def test_kilohertz_called_megahertz_are_reported() -> None:
    frequency = np.geomspace(150e3, 30e6, 101)
    impedance = 3 + 2j * np.pi * frequency * 27e-6
    (told,) = implausible(1e3 * frequency, impedance)
    assert told == "the frequencies are 150 MHz - 30 GHz, and no motor is measured up to 30 GHz: is their unit right?"
    assert implausible(100 * frequency, impedance) == ()


@pytest.mark.usefixtures("catalogue")
@pytest.mark.slow
def test_the_verdict_is_data(tmp_path: Path) -> None:
    for sweep in simulated_sweeps(3)[0]:
        write_impedance_csv(
            tmp_path / f"{sweep.termination}.csv", me.ImpedanceSweep(sweep.termination, sweep.frequency_hz, sweep.impedance_ohm.conj())
        )
    imported = motoremi("import", tmp_path / "s", "--short", tmp_path / "short.csv", "--open", tmp_path / "open.csv")
    assert imported.stdout.count("warning: |Z| rises where the phase is negative") == 2
    with seeking():
        done = motoremi("diagnose", tmp_path / "s")
    assert "Diagnosis: data" in done.stdout
    assert "has the wrong sign" in done.stdout
    assert "found, serious: wrong-phase (short sweep" in done.stdout


@pytest.mark.parametrize(("unit", "told"), [("Hz", True), ("kHz", False)])
def test_separators_of_thousands_are_told(tmp_path: Path, unit: str, told: bool) -> None:
    rows = [f"{150 + 10 * number}.000;2.345;{23 + number}.595" for number in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([f"Frequency ({unit});R (Ohm);X (Ohm)", *rows, ""]))
    warnings = read_impedance(tmp_path / "a.csv", "short").metadata.get("warnings", [])
    assert any("frequencies such as 150.000 are read as 150 Hz - 340 Hz" in text for text in warnings) == told
