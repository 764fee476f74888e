"""Touchstone as its standard allows it: normalised admittances, short option lines, sections of version 2, and a fixture that S11 contradicts."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi

from motoremi.data.declaration import are_reflections
from motoremi.data.files import read_impedance
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput

FREQUENCY = np.geomspace(150e3, 30e6, 16)
S = 2j * np.pi * FREQUENCY
WINDING = 1 / (1 / (10 + S * 12e-6) + S * 22e-12)
OPEN = WINDING + 40 + 1 / (S * 600e-12)


def rows(*columns: np.ndarray) -> str:
    return "".join(" ".join(f"{value:.12e}" for value in row) + "\n" for row in zip(*columns, strict=True))


def parts(*values: np.ndarray) -> list[np.ndarray]:
    return [part for one in values for part in (np.real(one), np.imag(one))]


def read(folder: Path, text: str, fixture: str | None = None, termination: str = "open") -> ImpedanceSweep:
    path = folder / "data.txt"
    path.write_text(text)
    return read_impedance(path, termination, fixture)


def reflected(impedance: np.ndarray, reference: float = 50) -> np.ndarray:
    return (impedance - reference) / (impedance + reference)


# Admittances


@pytest.mark.parametrize("reference", [1, 50, 75])
@pytest.mark.parametrize(("true", "termination"), [(OPEN, "open"), (WINDING, "short")])
@pytest.mark.parametrize("normalised", [True, False])
def test_admittance_of_version_1(tmp_path: Path, reference: float, true: np.ndarray, termination: str, normalised: bool) -> None:
    admittance = (reference if normalised else 1) / true
    sweep = read(tmp_path, f"# HZ Y RI R {reference}\n{rows(FREQUENCY, *parts(admittance))}", termination=termination)
    np.testing.assert_allclose(sweep.impedance_ohm, true, rtol=1e-9)
    if reference != 1:
        assert ("not normalised" in sweep.metadata["read_as"]) is not normalised


@pytest.mark.parametrize(
    ("comment", "ohm"),
    [("! normalized", 50), ("! not normalized", 1), ("! values in siemens", 1), ("! un-normalised", 1)],
)
def test_a_comment_says_what_an_admittance_of_one_is(tmp_path: Path, comment: str, ohm: float) -> None:
    one = np.ones(FREQUENCY.size)
    sweep = read(tmp_path, f"{comment}\n# HZ Y RI R 50\n{rows(FREQUENCY, one, 0 * one)}")
    np.testing.assert_allclose(sweep.impedance_ohm, ohm, rtol=1e-12)
    assert "as its comment says" in sweep.metadata["read_as"]


def test_a_scale_that_nothing_tells_is_told_or_refused(tmp_path: Path) -> None:
    resistor = read(tmp_path, f"# HZ Y RI R 50\n{rows(FREQUENCY, *parts(50 / (4 + S * 1e-7)))}", termination="short")
    np.testing.assert_allclose(resistor.impedance_ohm, 4 + S * 1e-7, rtol=1e-9)
    assert "as the standard says; check the magnitude, and add a comment line '! in siemens'" in resistor.metadata["read_as"]
    with pytest.raises(BadInput, match=r"normalised to 50 Ohm, as the standard says, or in siemens; add a comment line .* '! in siemens'"):
        read(tmp_path, f"# HZ Y RI R 50\n{rows(FREQUENCY, *parts(50 / (3 + 1 / (S * 100e-12))))}")


# Option lines and magnitudes


@pytest.mark.parametrize(("option", "unit_hz"), [("#", 1e9), ("# GHz", 1e9), ("# R 50", 1e9), ("# kHz", 1e3), ("#  ! all by default", 1e9)])
def test_what_an_option_line_leaves_out_has_a_default(tmp_path: Path, option: str, unit_hz: float) -> None:
    s = reflected(OPEN)
    sweep = read(tmp_path, f"! exported\n{option}\n{rows(FREQUENCY / unit_hz, np.abs(s), np.angle(s, deg=True))}")
    np.testing.assert_allclose(sweep.frequency_hz, FREQUENCY, rtol=1e-12)
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-7)
    assert "defaults of the standard" in sweep.metadata["read_as"]


def test_a_comment_behind_the_options(tmp_path: Path) -> None:
    sweep = read(tmp_path, f"# HZ S RI R 50 ! options\n{rows(FREQUENCY, *parts(reflected(OPEN)))}")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)
    assert sweep.metadata["read_as"] == "S parameters in 50 Ohm"


@pytest.mark.parametrize("comment", ["#", "# MHz", "# S"])
def test_a_comment_above_the_names_of_a_table_is_no_option_line(tmp_path: Path, comment: str) -> None:
    names = "frequency_hz resistance_ohm reactance_ohm"
    assert read(tmp_path, f"{comment}\n{names}\n{rows(FREQUENCY, *parts(OPEN))}").metadata["format"] == "csv"


def test_the_reference_as_one_word(tmp_path: Path) -> None:
    s = (OPEN - 75) / (OPEN + 75)
    np.testing.assert_allclose(read(tmp_path, f"# HZ S RI R75\n{rows(FREQUENCY, *parts(s))}").impedance_ohm, OPEN, rtol=1e-7)


@pytest.mark.parametrize(
    ("above", "says"),
    [
        ("", "the option line is missing: put it above the numbers, for example '# HZ S RI R 50'"),
        ("! NanoVNA\n", "the option line is missing"),
        ("# HZ S RI R 50,0\n", "its option line '# HZ S RI R 50,0' cannot be read"),
        ("# Hertz S RI R 50\n", "its option line '# Hertz S RI R 50' cannot be read"),
    ],
)
def test_an_option_line_that_lacks_or_cannot_be_read_is_told(tmp_path: Path, above: str, says: str) -> None:
    (tmp_path / "data.S1P").write_text(above + rows(FREQUENCY, *parts(reflected(OPEN))))
    with pytest.raises(BadInput, match=re.escape(says)):
        read_impedance(tmp_path / "data.S1P", "open")


def test_a_magnitude_below_0_is_refused(tmp_path: Path) -> None:
    s = reflected(OPEN)
    decibels = f"# HZ S MA R 50\n{rows(FREQUENCY, 20 * np.log10(np.abs(s)), np.angle(s, deg=True))}"
    with pytest.raises(BadInput, match=r"line 2: the magnitude -[0-9.e-]+ is below 0; write DB"):
        read(tmp_path, decibels)
    np.testing.assert_allclose(read(tmp_path, decibels.replace(" MA ", " DB ")).impedance_ohm, OPEN, rtol=1e-7)


@pytest.mark.parametrize("style", ["MA", "DB"])
def test_angles_that_may_be_radians_are_told(tmp_path: Path, style: str) -> None:
    s = reflected(5 + S * 3e-6)
    size = np.abs(s) if style == "MA" else 20 * np.log10(np.abs(s))
    for angle, told in ((np.angle(s), True), (np.angle(s, deg=True), False)):
        warnings = read(tmp_path, f"# HZ S {style} R 50\n{rows(FREQUENCY, size, angle)}").metadata.get("warnings", "")
        assert ("are they in radians?" in str(warnings)) == told


# Version 2


def version_2(ports: int, body: str, *sections: str) -> str:
    order = ["[Two-Port Data Order] 21_12"] if ports == 2 else []
    head = ["[Version] 2.0", "# HZ S RI R 50", f"[Number of Ports] {ports}", *order, "[Number of Frequencies] 16", *sections]
    return "\n".join([*head, "[Network Data]", body + "[End]\n"])


def test_information_is_passed_over(tmp_path: Path) -> None:
    block = "[Begin Information]\n[Manufacturer] Nobody\n 1 2 3\n1e6 0.5 0.5\n[End Information]"
    sweep = read(tmp_path, version_2(1, rows(FREQUENCY, *parts(reflected(OPEN))), block))
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)


@pytest.mark.parametrize("stated", ["[Reference] 75", "[Reference]\n75"])
def test_the_reference_of_version_2_is_told(tmp_path: Path, stated: str) -> None:
    sweep = read(tmp_path, version_2(1, rows(FREQUENCY, *parts(reflected(OPEN, 75))), stated))
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)
    assert sweep.metadata["read_as"] == "S parameters in 75 Ohm"


def series(impedance: np.ndarray) -> list[np.ndarray]:
    """S11 and S21 of an impedance between two ports of 50 Ohm: what its side of the divider reflects, and what passes."""
    return [reflected(impedance + 50), 100 / (impedance + 100)]


def shunt(impedance: np.ndarray) -> list[np.ndarray]:
    """The same across the line: port 1 sees it in parallel with 50 Ohm, and S21 is twice the voltage there over that of the source."""
    seen = impedance * 50 / (impedance + 50)
    return [reflected(seen), 2 * seen / (seen + 50)]


def test_noise_parameters_of_version_2_are_passed_over(tmp_path: Path) -> None:
    s11, s21 = series(OPEN)
    text = version_2(2, rows(FREQUENCY, *parts(s11, s21, s21, s11)), "[Number of Noise Frequencies] 2", "[Reference] 50 50")
    noise = "[Noise Data]\n1e6 0.7 0.6 40 0.3\n2e6 0.8 0.6 42 0.3\n"
    sweep = read(tmp_path, text.replace("[End]", noise + "[End]"), "series-through")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)


@pytest.mark.parametrize("triangle", ["Lower", "Upper"])
@pytest.mark.parametrize("order", ["21_12", "12_21"])
def test_a_triangle_of_the_matrix(tmp_path: Path, triangle: str, order: str) -> None:
    s11, s21 = series(OPEN)
    text = version_2(2, rows(FREQUENCY, *parts(s11, s21, 0.5 * s11)), f"[Matrix Format] {triangle}").replace("21_12", order)
    np.testing.assert_allclose(read(tmp_path, text, "series-through").impedance_ohm, OPEN, rtol=1e-8)


# Two ports, where S11 knows how the motor was connected


def two_ports(s11: np.ndarray, s21: np.ndarray) -> str:
    return f"# HZ S RI R 50\n{rows(FREQUENCY, *parts(s11, s21, s21, s11))}"


@pytest.mark.parametrize(("stated", "other"), [("series-through", "shunt-through"), ("shunt-through", "series-through")])
@pytest.mark.parametrize(("true", "termination"), [(OPEN, "open"), (WINDING, "short")])
@pytest.mark.parametrize("error", [0.0, 0.1])
def test_a_fixture_that_s11_contradicts_is_refused(
    tmp_path: Path, stated: str, other: str, true: np.ndarray, termination: str, error: float
) -> None:
    s11, s21 = (series if stated == "series-through" else shunt)(true)
    text = two_ports(s11 * (1 + error * np.exp(3e-8 * S)), s21)
    np.testing.assert_allclose(read(tmp_path, text, stated, termination).impedance_ohm, true, rtol=1e-8)
    for wrong in (other, "reflection"):
        with pytest.raises(BadInput, match=rf"as of a {stated} fixture, but it was given as {wrong}: use --fixture {stated}"):
            read(tmp_path, text, wrong, termination)


@pytest.mark.parametrize("s11", [np.zeros(16), 0.9 * np.exp(-3e-7 * S)])
def test_an_s11_that_decides_nothing_does_not_matter(tmp_path: Path, s11: np.ndarray) -> None:
    """Not measured, or behind a cable that was not calibrated."""
    for fixture, seen in (("series-through", series), ("shunt-through", shunt)):
        np.testing.assert_allclose(read(tmp_path, two_ports(s11, seen(OPEN)[1]), fixture).impedance_ohm, OPEN, rtol=1e-8)


def test_a_motor_at_port_1_alone(tmp_path: Path) -> None:
    leakage = 1e-4 * np.exp(-1e-8 * S)
    text = two_ports(reflected(OPEN), leakage)
    for fixture in ("series-through", "shunt-through"):
        with pytest.raises(BadInput, match="S11 is not that of a motor between two ports: use --fixture reflection"):
            read(tmp_path, text, fixture)
    with pytest.raises(BadInput, match="--fixture reflection reads S11"):
        read(tmp_path, text)
    for stated in (read(tmp_path, text, "reflection"), read(tmp_path, f"! fixture: reflection\n{text}")):
        np.testing.assert_allclose(stated.impedance_ohm, OPEN, rtol=1e-8)
        assert stated.metadata["read_as"] == "S11 of two ports in 50 Ohm"
        assert are_reflections([stated])


def test_import_of_s11_from_two_ports(tmp_path: Path) -> None:
    path = tmp_path / "open.s2p"
    path.write_text(two_ports(reflected(OPEN), np.full(16, 1e-5)))
    done = motoremi("import", tmp_path / "s", "--open", path, "--fixture", "reflection")
    assert (done.returncode, done.stderr) == (0, "")
    assert "S11 of two ports in 50 Ohm" in done.stdout
    assert "Reflections are taken for those of a network analyser" in done.stdout
