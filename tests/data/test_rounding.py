"""Numbers rounded to few digits: their error is known from the file, belongs to the noise of each point, and is no interference."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi

from motoremi.arrays import ComplexArray
from motoremi.data.csvfiles import impedance_csv
from motoremi.data.files import parse_impedance, parse_impedance_csv
from motoremi.data.measurement import Measurement
from motoremi.data.noise import estimate_noise
from motoremi.data.rounding import OF_ONE_UNIT, steps
from motoremi.data.session import load
from motoremi.data.sweep import ImpedanceSweep, group_repeats

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
S = 2j * np.pi * FREQUENCY_HZ
# A parallel resonance of Q 50 behind a small inductance: sharp extremes of R and X, and much smaller R beside them.
TRUE_OHM = S * 0.3e-6 + 1 / (1 / (2.3 + S * 24e-6) + S * 95e-12)


def three_digits(value: float) -> str:
    return f"{value:.3g}"


def as_text(ohm: ComplexArray, written: Callable[[float], str] = three_digits) -> str:
    rows = zip(FREQUENCY_HZ.tolist(), ohm.tolist(), strict=True)
    return "frequency_hz,resistance_ohm,reactance_ohm\n" + "".join(f"{f!r},{written(z.real)},{written(z.imag)}\n" for f, z in rows)


def measured(seed: int, noise: float) -> ComplexArray:
    rng = np.random.default_rng(seed)
    return TRUE_OHM * (1 + noise * (rng.normal(size=201) + 1j * rng.normal(size=201)))


def units_of_three_digits(values: np.ndarray) -> np.ndarray:
    return 10.0 ** (np.floor(np.log10(np.abs(values))) - 2)


@pytest.mark.parametrize(
    ("cells", "units"),
    [
        # Three significant digits, the zeros at the end not written, one without a decimal point and one with an exponent.
        ("1.23 45.6 789 0.012 1.2 500 1.23e+03 3 -0.0456", "0.01 0.1 1 0.0001 0.01 1 10 0.01 0.0001"),
        # Two decimals.
        ("1.23 45.67 789.12 0.01 1.2 500.0 0.0 3.05 -0.04", "0.01 " * 9),
        # Four digits of which a range may use fewer, zeros written.
        ("1.230 0.456 12.34 12.30 0.500 123.4 99.99 1.000 0.789", "0.001 0.001 0.01 0.01 0.001 0.1 0.01 0.001 0.001"),
        # Three digits, padded with zeros that say nothing.
        ("1.230000 4.560000 7.890000 1.200000 5.550000 12.300000 45.600000 3.000000 9.110000", "0.01 0.01 0.01 0.01 0.01 0.1 0.1 0.01 0.01"),
        # All digits that a program has.
        ("0.1234567890123 1.5 2.25 3.123456789 4.0 5.5 6.75 7.0 8.0", "1e-13 " + "1e-12 " * 8),
        # A constant says nothing of its digits.
        ("50 " * 9, "0 " * 9),
    ],
)
def test_the_unit_of_the_last_digit_is_that_of_the_column(cells: str, units: str) -> None:
    np.testing.assert_allclose(steps(cells.split()), [float(unit) for unit in units.split()])


def test_rounding_is_carried_to_the_impedance() -> None:
    sweep = parse_impedance(as_text(TRUE_OHM), "meter.csv", "short")
    parts = np.array([sweep.impedance_ohm.real, sweep.impedance_ohm.imag])
    expected = OF_ONE_UNIT * np.sqrt(np.mean(units_of_three_digits(parts) ** 2, axis=0)) / np.abs(sweep.impedance_ohm)
    assert sweep.rounding_relative is not None
    np.testing.assert_allclose(sweep.rounding_relative, expected, rtol=1e-6)
    # The true errors are as large.
    errors = np.abs(sweep.impedance_ohm / TRUE_OHM - 1) / (np.sqrt(2) * sweep.rounding_relative)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.1)


def test_that_of_magnitude_and_phase_too() -> None:
    # With noise, so that a phase near 90 degrees is not rounded alike at many points.
    ohm = measured(4, 2e-3)
    phase = np.rad2deg(np.angle(ohm))
    rows = "".join(f"{f!r};{abs(z):.4g};{p:.1f}\n" for f, z, p in zip(FREQUENCY_HZ.tolist(), ohm, phase, strict=True))
    sweep = parse_impedance("Frequency (Hz);|Z| (Ohm);Phase (deg)\n" + rows, "meter.csv", "short")
    assert sweep.rounding_relative is not None
    errors = np.abs(sweep.impedance_ohm / ohm - 1) / (np.sqrt(2) * sweep.rounding_relative)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.1)
    assert sweep.rounding_relative.min() > OF_ONE_UNIT * np.deg2rad(0.1) / np.sqrt(2) * 0.99


def touchstone(style: str, values: ComplexArray, digits: str, two_ports: str = "") -> str:
    """The text of a file of one port; of two with S21 at the place that `two_ports` says and other numbers beside it."""
    pairs = {
        "RI": np.array([values.real, values.imag]),
        "MA": np.array([np.abs(values), np.angle(values, deg=True)]),
        "DB": np.array([20 * np.log10(np.abs(values)), np.angle(values, deg=True)]),
    }[style]
    cells = [" ".join(format(number, digits) for number in pair) for pair in pairs.T]
    head = f"# HZ S {style} R 50\n"
    if two_ports:
        head = f"[Version] 2.0\n{head}[Number of Ports] 2\n[Two-Port Data Order] {two_ports}\n[Number of Frequencies] 201\n[Network Data]\n"
        others = ("0.123456789 0.2", "{}", "0.5 0.123456789") if two_ports == "21_12" else ("0.123456789 0.2", "0.5 0.123456789", "{}")
        # A constant, as of S11 and S12 that were not measured, says nothing of digits.
        cells = [f"{' '.join(others).format(cell)} 0.123456789 0.1" for cell in cells]
    return head + "".join(f"{f!r} {cell}\n" for f, cell in zip(FREQUENCY_HZ.tolist(), cells, strict=True))


@pytest.mark.parametrize(("style", "digits"), [("RI", ".5f"), ("MA", ".6g"), ("DB", ".4f")])
def test_that_of_a_reflection_too(style: str, digits: str) -> None:
    ohm = measured(5, 1e-3)
    sweep = parse_impedance(touchstone(style, (ohm - 50) / (ohm + 50), digits), "vna.s1p", "short")
    assert sweep.rounding_relative is not None
    errors = np.abs(sweep.impedance_ohm / ohm - 1) / (np.sqrt(2) * sweep.rounding_relative)
    # Where a rounding error is not small beside 1 - S11, that of Z is not in proportion to it.
    small = sweep.rounding_relative < 0.1
    assert small.sum() > 150
    assert np.sqrt(np.mean(errors[small] ** 2)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("order", ["21_12", "12_21"])
@pytest.mark.parametrize(
    ("fixture", "through"), [("series-through", lambda ohm: 100 / (ohm + 100)), ("shunt-through", lambda ohm: 2 * ohm / (2 * ohm + 50))]
)
def test_that_of_a_transmission_too(fixture: str, through: Callable[[ComplexArray], ComplexArray], order: str) -> None:
    ohm = measured(6, 1e-3)
    text = touchstone("RI", through(ohm), ".5f", order)
    # S11 of a constant fits neither fixture.
    sweep = parse_impedance(text, "vna.s2p", "short", fixture)
    assert sweep.rounding_relative is not None
    errors = np.abs(sweep.impedance_ohm / ohm - 1) / (np.sqrt(2) * sweep.rounding_relative)
    small = sweep.rounding_relative < 0.1
    assert small.sum() > 120
    assert np.sqrt(np.mean(errors[small] ** 2)) == pytest.approx(1.0, abs=0.15)


def test_that_of_admittances_in_a_band_too() -> None:
    ohm = measured(7, 1e-3)
    rows = "".join(f"{f!r} {y.real:.3g} {y.imag:.3g}\n" for f, y in zip(FREQUENCY_HZ.tolist(), (50 / ohm).tolist(), strict=True))
    sweep = parse_impedance("# HZ Y RI R 50\n! normalised\n" + rows, "vna.y1p", "short", band=(1e6, 10e6))
    inside = (FREQUENCY_HZ >= 1e6) & (FREQUENCY_HZ <= 10e6)
    assert sweep.rounding_relative is not None
    errors = np.abs(sweep.impedance_ohm / ohm[inside] - 1) / (np.sqrt(2) * sweep.rounding_relative)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.15)


def traces_of_4294a(parameter: str, first: list[str], second: list[str]) -> str:
    text = f'4294A REV1.11\n"MEASURE PARAMETER: {parameter}"\n"NUMBER of POINTS: 201"\n'
    for letter, cells in (("A", first), ("B", second)):
        text += f'"TRACE: {letter}"\n"Frequency"\t"Data Trace Real"\t"Data Trace Imag"\n'
        text += "".join(f"{f!r}\t{cell}\t0\n" for f, cell in zip(FREQUENCY_HZ.tolist(), cells, strict=True)) + "\n"
    return text


@pytest.mark.parametrize(("parameter", "in_degrees"), [("IMPEDANCE MAG PHASE (DEG)", True), ("IMPEDANCE MAG PHASE (RAD)", False)])
def test_that_of_a_4294a_too(parameter: str, in_degrees: bool) -> None:
    ohm = measured(8, 2e-3)
    phase = [f"{one:.1f}" for one in np.angle(ohm, deg=True)] if in_degrees else [f"{one:.3f}" for one in np.angle(ohm)]
    sweep = parse_impedance(traces_of_4294a(parameter, [f"{one:.4g}" for one in np.abs(ohm)], phase), "a.txt", "short")
    assert sweep.rounding_relative is not None
    errors = np.abs(sweep.impedance_ohm / ohm - 1) / (np.sqrt(2) * sweep.rounding_relative)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(1.0, abs=0.15)


def test_those_files_of_full_precision_have_none() -> None:
    ohm = measured(1, 1e-4)
    reflection = (ohm - 50) / (ohm + 50)
    texts = [touchstone(style, reflection, ".9e") for style in ("RI", "MA", "DB")]
    texts += [traces_of_4294a("R X", [f"{one:.6e}" for one in ohm.real], [f"{one:.6e}" for one in ohm.imag])]
    assert [parse_impedance(text, "analyser", "short").rounding_relative for text in texts] == [None] * 4


@pytest.mark.parametrize("written", [repr, lambda value: f"{value:.6e}"])
def test_a_file_of_full_precision_has_none(written: Callable[[float], str]) -> None:
    sweep = parse_impedance(as_text(measured(1, 1e-4), written), "analyser.csv", "short")
    assert sweep.rounding_relative is None
    assert "rounding" not in impedance_csv(sweep)


@pytest.mark.parametrize("noise", [5e-5, 5e-4])
@pytest.mark.parametrize("repeats", [1, 3])
def test_rounded_points_do_not_stand_out(repeats: int, noise: float) -> None:
    for termination in ("short", "open"):
        texts = [as_text(measured(seed, noise)) for seed in range(repeats)]
        (group,) = group_repeats(parse_impedance(text, f"{number}.csv", termination) for number, text in enumerate(texts))
        found = estimate_noise(group)
        assert found.regular.all()
        assert group.rounding_relative is not None
        assert np.all(found.sigma >= group.rounding_relative)
        # The noise is not larger than both together either: that of a point, not the largest of all.
        assert np.median(found.sigma / np.hypot(group.rounding_relative, noise)) < 1.5


def test_a_station_among_rounded_points_is_still_seen() -> None:
    disturbed = measured(3, 5e-5)
    disturbed[60] *= 1.2
    (group,) = group_repeats([parse_impedance(as_text(disturbed), "meter.csv", "short")])
    np.testing.assert_array_equal(np.flatnonzero(~estimate_noise(group).regular), [60])


def test_a_session_keeps_it(tmp_path: Path) -> None:
    for number in range(2):
        (tmp_path / f"{number}.csv").write_text(as_text(measured(number, 1e-3)))
    read = [parse_impedance((tmp_path / f"{number}.csv").read_text(), "meter.csv", "short").rounding_relative for number in range(2)]
    files = [tmp_path / "0.csv", tmp_path / "1.csv"]
    assert motoremi("import", tmp_path / "s", "--short", *files, "--analyser", "none").returncode == 0
    stored = load(tmp_path / "s").sweeps
    for sweep, own in zip(stored, read, strict=True):
        np.testing.assert_array_equal(sweep.rounding_relative, own)
    (noise,) = Measurement.of(stored).noise
    assert np.all(noise.sigma >= np.sqrt(np.mean(np.square(read), axis=0)) * (1 - 1e-12))


def test_a_session_without_it_is_as_before() -> None:
    sweep = ImpedanceSweep("short", FREQUENCY_HZ, np.array([complex(three_digits(z.real)) + 1j * float(three_digits(z.imag)) for z in TRUE_OHM]))
    assert parse_impedance_csv(impedance_csv(sweep), "short-1.csv", "short").rounding_relative is None
    part = parse_impedance(as_text(TRUE_OHM), "meter.csv", "short").within(1e6, 1e7)
    assert part.rounding_relative is not None
    assert part.rounding_relative.size == len(part)
    np.testing.assert_array_equal(ImpedanceSweep.from_frame("short", part.to_frame()).rounding_relative, part.rounding_relative)
