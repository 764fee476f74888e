"""Files of analysers, receivers and other programs: exact results, clear refusals, and never a wrong number from a damaged file."""

from __future__ import annotations

import functools
import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import DATA

from motoremi.data.files import read_impedance, read_spectra, read_spectrum
from motoremi.errors import BadInput

FREQUENCY = np.geomspace(150e3, 30e6, 16)
S = 2j * np.pi * FREQUENCY
# A winding with its resonance and a capacitive insulation, of ordinary size.
WINDING = 1 / (1 / (10 + S * 12e-6) + S * 22e-12)
OPEN = WINDING + 40 + 1 / (S * 600e-12)


def write(folder: Path, text: str | bytes, name: str = "data.txt") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rows(*columns: np.ndarray, delimiter: str = " ") -> str:
    return "".join(delimiter.join(f"{value:.12e}" for value in row) + "\n" for row in zip(*columns, strict=True))


def touchstone(values: np.ndarray, option: str = "# HZ S RI R 50", comments: str = "") -> str:
    return f"! exported\n{comments}{option}\n{rows(FREQUENCY, values.real, values.imag)}"


def reflection(impedance: np.ndarray) -> np.ndarray:
    return (impedance - 50) / (impedance + 50)


# Touchstone


def test_reflection(tmp_path: Path) -> None:
    sweep = read_impedance(write(tmp_path, touchstone(reflection(OPEN))), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)  # twelve digits of S, a factor of 1e3 lost where |Z| is high
    np.testing.assert_allclose(sweep.frequency_hz, FREQUENCY, rtol=1e-12)
    assert sweep.metadata["format"] == "touchstone"
    assert sweep.metadata["read_as"] == "S parameters in 50 Ohm"


def test_reflection_in_other_formats_units_and_reference(tmp_path: Path) -> None:
    s = (OPEN - 75) / (OPEN + 75)
    angle = np.angle(s, deg=True)
    for option, first in (("# MHz S MA R 75", np.abs(s)), ("# mhz db s r 75", 20 * np.log10(np.abs(s)))):
        text = f"{option}\n{rows(FREQUENCY / 1e6, first, angle)}"
        np.testing.assert_allclose(read_impedance(write(tmp_path, text), "open").impedance_ohm, OPEN, rtol=1e-7)


@pytest.mark.parametrize(("true", "termination"), [(OPEN, "open"), (WINDING, "short")])
@pytest.mark.parametrize("normalised", [True, False])
def test_impedance_normalised_or_not_is_told_apart(tmp_path: Path, true: np.ndarray, termination: str, normalised: bool) -> None:
    sweep = read_impedance(write(tmp_path, touchstone(true / 50 if normalised else true, "# HZ Z RI R 50")), termination)
    np.testing.assert_allclose(sweep.impedance_ohm, true, rtol=1e-9)
    assert ("not normalised" in sweep.metadata["read_as"]) is not normalised


@pytest.mark.parametrize(
    ("option", "comments", "factor"),
    [
        ("# HZ Z RI R 50", "! values in ohm\n", 1),
        ("# HZ Z RI R 50", "! NOT normalized\n", 1),
        ("# HZ Z RI R 50", "! normalised to 50\n", 50),
        ("# HZ Z RI R 1", "", 1),
    ],
)
def test_what_the_file_says_decides(tmp_path: Path, option: str, comments: str, factor: float) -> None:
    values = 3 + 1 / (S * 10e-9)  # 10 nF as ohm, 200 pF as normalised: both possible
    sweep = read_impedance(write(tmp_path, touchstone(values, option, comments)), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, values * factor, rtol=1e-9)


def test_impedance_whose_scale_nothing_tells_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="normalised"):
        read_impedance(write(tmp_path, touchstone(3 + 1 / (S * 5e-9), "# HZ Z RI R 50")), "open")


def test_version_2_is_in_ohm(tmp_path: Path) -> None:
    head = "[Version] 2.0\n# HZ Z RI R 50\n[Number of Ports] 1\n[Number of Frequencies] 16\n[Reference] 50\n[Network Data]\n"
    text = head + rows(FREQUENCY, OPEN.real, OPEN.imag) + "[End]\n"
    np.testing.assert_allclose(read_impedance(write(tmp_path, text), "open").impedance_ohm, OPEN, rtol=1e-9)
    with pytest.raises(BadInput, match="cut off"):
        read_impedance(write(tmp_path, text.replace("Frequencies] 16", "Frequencies] 17")), "open")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (touchstone(WINDING, "# HZ G RI R 50"), "G parameters"),
        ("# HZ S RI R 50\n" + rows(*[FREQUENCY] * 5), "5 values"),
        ("[Version] 2.0\n# HZ S RI R 50\n[Number of Ports] 3\n", "has 3 ports"),
        (touchstone(reflection(OPEN)) + "4e7 1\n", "2 values"),
        ("# HZ S RI R 50\n" + rows(*[FREQUENCY] * 9), "two ports"),
        (touchstone(reflection(OPEN)) + "3e7 nan 1\n", "not a finite"),
        (touchstone(reflection(OPEN)) + "1e3 1 1\n", "increas"),
        (touchstone(reflection(OPEN)) + "4e7 1_0 1\n", "1_0"),
        (touchstone(reflection(OPEN)) + "4e7 1 0\n", "finite"),
        ("# HZ S RI R 50\n", "data"),
        ("# HZ S RI R 0\n1 2 3\n", "above 0 Ohm"),
        (touchstone(reflection(OPEN)).rstrip()[:-6], "cut off"),
    ],
)
def test_touchstone_that_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        read_impedance(write(tmp_path, text), "open")


@pytest.mark.parametrize("comment", ["Params: S21", "S12", "Freq ReS21 ImS21", "Frequency (Hz)  |S21| (dB)", "Meas Type = S21"])
def test_a_transmission_in_a_file_of_one_port_is_refused(tmp_path: Path, comment: str) -> None:
    text = touchstone(reflection(OPEN), comments=f"! {comment}\n")
    with pytest.raises(BadInput, match=r"names a transmission, .* save S11, or both ports") as caught:
        read_impedance(write(tmp_path, text), "open")
    assert comment in str(caught.value)


@pytest.mark.parametrize("comment", ["Params: S11", "Params: S11 S21", "S21 not measured", "Sample: S2100", "measured after S21 of the cable"])
def test_other_comments_of_a_file_of_one_port(tmp_path: Path, comment: str) -> None:
    assert len(read_impedance(write(tmp_path, touchstone(reflection(OPEN), comments=f"! {comment}\n")), "open")) == 16


# Two ports with the motor between them


def two_ports(through: np.ndarray, option: str = "# HZ S RI R 50", comments: str = "") -> str:
    """Some programs write zeros for what they do not measure, so nothing but S21 may be used."""
    nothing = np.zeros(FREQUENCY.size)
    columns = (FREQUENCY, nothing, nothing, through.real, through.imag, nothing, nothing, nothing, nothing)
    return f"! exported\n{comments}{option}\n{rows(*columns)}"


def through_series(impedance: np.ndarray, reference: float = 50) -> np.ndarray:
    """A voltage divider: source and load resistance with the motor between them, doubled."""
    return 2 * reference / (2 * reference + impedance)


def through_shunt(impedance: np.ndarray, reference: float = 50) -> np.ndarray:
    """A voltage divider: source resistance above motor and load resistance across each other, doubled."""
    across = impedance * reference / (impedance + reference)
    return 2 * across / (across + reference)


@pytest.mark.parametrize(("fixture", "through"), [("series-through", through_series), ("shunt-through", through_shunt)])
def test_two_ports(tmp_path: Path, fixture: str, through: Callable[..., np.ndarray]) -> None:
    sweep = read_impedance(write(tmp_path, two_ports(through(OPEN))), "open", fixture)
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)  # twelve digits of S21, a factor of 1e3 lost where it is near 0 or 1
    assert sweep.metadata["fixture"] == fixture
    assert sweep.metadata["read_as"].startswith(f"S21 of a {fixture} fixture, Z = ")
    assert sweep.metadata["read_as"].endswith("Z0 = 50 Ohm")
    other = read_impedance(write(tmp_path, two_ports(through(OPEN, 75), "# HZ S RI R 75", f"! Fixture: {fixture}\n")), "open")
    np.testing.assert_allclose(other.impedance_ohm, OPEN, rtol=1e-8)


def test_two_ports_of_version_2(tmp_path: Path) -> None:
    head = "[Version] 2.0\n# HZ S RI R 50\n[Number of Ports] 2\n[Two-Port Data Order] 21_12\n[Number of Frequencies] 16\n[Reference] 75 75\n"
    text = head + "[Network Data]\n" + two_ports(through_series(OPEN, 75)).split("R 50\n")[1] + "[End]\n"
    sweep = read_impedance(write(tmp_path, text), "open", "series-through")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)
    assert sweep.metadata["read_as"].endswith("Z0 = 75 Ohm")
    with pytest.raises(BadInput, match="different reference impedances"):
        read_impedance(write(tmp_path, text.replace("75 75", "75 50")), "open", "series-through")


@pytest.mark.parametrize(
    ("text", "fixture", "says"),
    [
        (two_ports(through_series(OPEN)), None, "--fixture series-through .* or --fixture shunt-through"),
        (two_ports(through_series(OPEN)), "sideways", "unknown fixture 'sideways'"),
        (two_ports(through_series(OPEN), comments="! fixture: shunt-through\n"), "series-through", "comment says shunt-through"),
        (two_ports(OPEN, "# HZ Z RI R 50"), "series-through", "Z parameters of two ports"),
        (two_ports(0 * OPEN), "series-through", "S21 at 150000 Hz gives no finite impedance"),
        (two_ports(0 * OPEN + 1), "shunt-through", "S21 at 150000 Hz gives no finite impedance"),
        (two_ports(through_series(OPEN)) + "4e7 1 0\n", "series-through", "3 values where 9"),
        (two_ports(through_series(OPEN)) + "1e6 1 0 0 1\n", "series-through", "line 19: noise parameters"),
        (two_ports(through_series(OPEN)) + "4e7 1 0 0 1\n", "series-through", "line 19: 5 values where 9 .* cut off"),
        (
            # Rows of two ports at frequencies that begin anew were taken for noise parameters and left out.
            two_ports(through_series(OPEN)) + "15e6 0 0 1 0 0 0 0 0\n",
            "series-through",
            "line 19: frequencies must increase, but 15000000 Hz follows 30000000 Hz; sort the rows",
        ),
    ],
)
def test_two_ports_that_are_refused(tmp_path: Path, text: str, fixture: str | None, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        read_impedance(write(tmp_path, text), "open", fixture)


# E4990A and its kin


def e4990a(titles: str, first: np.ndarray, second: np.ndarray, maker: str = "Keysight Technologies,E4990A,MY1,A.03.00") -> str:
    head = f"!CSV A.01.01\n!{maker}\n!Date: Tue Feb 03 10:00:00 2024\n!Data Source: DATA\nBEGIN CH1_DATA\n{titles}\n"
    return head + rows(FREQUENCY, first, second, delimiter=",") + "END\n"


W = 2 * np.pi * FREQUENCY
PAIRS: dict[str, tuple[np.ndarray, np.ndarray]] = {
    "Frequency(Hz), |Z|(Ohm)-data, theta-z(deg)-data": (np.abs(OPEN), np.angle(OPEN, deg=True)),
    "Frequency(Hz),|Z|(Ohm)-data,theta-z(rad)-data": (np.abs(OPEN), np.angle(OPEN)),
    "Frequency(Hz), R(Ohm)-data, X(Ohm)-data": (OPEN.real, OPEN.imag),
    "Frequency(Hz), |Y|(S)-data, theta-y(deg)-data": (1 / np.abs(OPEN), -np.angle(OPEN, deg=True)),
    "Frequency(Hz), G(S)-data, B(S)-data": ((1 / OPEN).real, (1 / OPEN).imag),
    "Frequency(Hz), Ls(H)-data, Rs(Ohm)-data": (OPEN.imag / W, OPEN.real),
    "Frequency(Hz), Cs(F)-data, Rs(Ohm)-data": (-1 / (OPEN.imag * W), OPEN.real),
    "Frequency(Hz), Cp(F)-data, Rp(Ohm)-data": ((1 / OPEN).imag / W, 1 / (1 / OPEN).real),
    "Frequency(Hz), Lp(H)-data, Rp(Ohm)-data": (-1 / ((1 / OPEN).imag * W), 1 / (1 / OPEN).real),
    "Frequency(Hz), Cp(F)-data, G(S)-data": ((1 / OPEN).imag / W, (1 / OPEN).real),
    "Frequency(Hz), Cp(F)-data, D()-data": ((1 / OPEN).imag / W, np.abs(OPEN.real / OPEN.imag)),
    "Frequency(Hz), Cs(F)-data, D()-data": (-1 / (OPEN.imag * W), np.abs(OPEN.real / OPEN.imag)),
    "Frequency(Hz), Ls(H)-data, Q()-data": (OPEN.imag / W, np.abs(OPEN.imag / OPEN.real)),
    "Frequency(Hz), Lp(H)-data, Q()-data": (-1 / ((1 / OPEN).imag * W), np.abs(OPEN.imag / OPEN.real)),
    "Frequency(Hz), Z-Real(Ohm)-data, Z-Imag(Ohm)-data": (OPEN.real, OPEN.imag),
    "Frequency(Hz), Y-Real(S)-data, Y-Imag(S)-data": ((1 / OPEN).real, (1 / OPEN).imag),
}


@pytest.mark.parametrize("titles", PAIRS)
def test_analyser_csv(tmp_path: Path, titles: str) -> None:
    sweep = read_impedance(write(tmp_path, e4990a(titles, *PAIRS[titles])), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)
    assert (sweep.metadata["format"], sweep.metadata["analyser"]) == ("e4990a-csv", "e4990a")
    assert sweep.metadata["Data Source"] == "DATA"


def test_analyser_csv_of_the_older_maker_without_begin(tmp_path: Path) -> None:
    titles = "Frequency(Hz), |Z|(Ohm)-data, theta-z(deg)-data"
    text = e4990a(titles, *PAIRS[titles], maker="Agilent Technologies,E4990A").replace("BEGIN CH1_DATA\n", "").replace("!CSV A.01.01\n", "")
    np.testing.assert_allclose(read_impedance(write(tmp_path, text), "open").impedance_ohm, OPEN, rtol=1e-9)


BIAS = "Title label, motor, left\nDCV(V), +5.0e-002, DCI(A), -2.0e-005\n"
FOUR: dict[str, tuple[np.ndarray, ...]] = {
    "|Z|(Ohm)-data, theta-z(deg)-data, R(Ohm)-data, X(Ohm)-data": (np.abs(OPEN), np.angle(OPEN, deg=True), OPEN.real, OPEN.imag),
    "Cp(F)-data, D()-data, |Z|(Ohm)-data, theta-z(deg)-data": (OPEN.real, OPEN.imag, np.abs(OPEN), np.angle(OPEN, deg=True)),
    "R(Ohm)-data, R(Ohm)-mem, X(Ohm)-data, X(Ohm)-mem": (OPEN.real, OPEN.imag, OPEN.imag, OPEN.real),
    "R(Ohm)-data, X(Ohm)-data, DCV(V), DCI(A)": (OPEN.real, OPEN.imag, OPEN.real, OPEN.imag),
}


@pytest.mark.parametrize("titles", FOUR)
@pytest.mark.parametrize("block", ["", BIAS])
def test_analyser_csv_with_bias_and_four_traces(tmp_path: Path, titles: str, block: str) -> None:
    head = f"!Agilent Technologies,E4990A\n!Date: Tue Feb 03 10:00:00 2024\n\nBEGIN CH1_DATA\n{block}Frequency(Hz), {titles}\n"
    sweep = read_impedance(write(tmp_path, head + rows(FREQUENCY, *FOUR[titles], delimiter=", ") + "END\n"), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-9)
    if block:
        assert (sweep.metadata["DCV(V)"], sweep.metadata["DCI(A)"], sweep.metadata["Title label"]) == (0.05, -2e-5, "motor, left")


def test_analyser_csv_that_is_refused(tmp_path: Path) -> None:
    text = e4990a("Frequency(Hz), R(Ohm)-data, X(Ohm)-data", OPEN.real, OPEN.imag)
    for bad, says in (
        (text.removesuffix("END\n"), "END is missing"),
        (text.replace("R(Ohm)", "Q()"), "columns"),
        (text + "BEGIN CH2_DATA\n" + "END\n", "several channels|after END"),
        (text.replace("Frequency", "Time"), "columns"),
    ):
        with pytest.raises(BadInput, match=says):
            read_impedance(write(tmp_path, bad), "open")


# Plain CSV of other programs


@pytest.mark.parametrize(
    ("titles", "columns"),
    [
        ("Frequency (MHz);Re(Z) [Ω];Im(Z) [Ω]", (FREQUENCY / 1e6, OPEN.real, OPEN.imag)),
        ("f [kHz];|Z| [kOhm];θ [°]".replace("θ", "theta"), (FREQUENCY / 1e3, np.abs(OPEN) / 1e3, np.angle(OPEN, deg=True))),
        ("freq_hz;S11_real;S11_imag", (FREQUENCY, reflection(OPEN).real, reflection(OPEN).imag)),
        ("Frequency (Hz);Ls (uH);Rs (Ohm)", (FREQUENCY, OPEN.imag / W * 1e6, OPEN.real)),
        ("Frequency (Hz);Cp (pF);G (mS)", (FREQUENCY, (1 / OPEN).imag / W * 1e12, (1 / OPEN).real * 1e3)),
    ],
)
@pytest.mark.parametrize("comma", [False, True])
def test_usual_headers_and_units(tmp_path: Path, titles: str, columns: tuple[np.ndarray, ...], comma: bool) -> None:
    body = rows(*columns, delimiter=";")
    text = titles + "\n" + (body.replace(".", ",") if comma else body)
    np.testing.assert_allclose(read_impedance(write(tmp_path, text), "open").impedance_ohm, OPEN, rtol=1e-7)


BARE = "frequency_hz{0}resistance_ohm{0}reactance_ohm\n"


@pytest.mark.parametrize(
    ("head", "delimiter"),
    [
        (BARE.format(" "), " "),
        (BARE.format("  "), "\t "),
        (BARE.format(", "), "   "),
        ("Frequency (Hz)  R (Ohm)  X (Ohm)\n", "  "),
        ("Frequency in Hz   Re Z [Ohm]   Im Z [Ohm]\n", " "),
        ("% made by hand\n% Frequency (Hz), R (Ohm), X (Ohm)\n", ", "),
        ("****\n* made by hand\n* f_hz R_ohm X_ohm\n****\n", "  "),
        ("; made by hand\nf_hz,R_ohm,X_ohm\n", ","),
        ("! made by hand\nf_hz;R_ohm;X_ohm\n", ";"),
        ("Machine A\nStart Frequency,+1.0E+08\nFormat,Smith,R+jX\n\n\nTrace Data\nf_hz,R_ohm,X_ohm\n", ","),
        ("motor A\n2024-02-03\n401 points\nf_hz\tR_ohm\tX_ohm\n", "\t"),
    ],
)
def test_text_above_the_numbers_and_blanks_between_them(tmp_path: Path, head: str, delimiter: str) -> None:
    sweep = read_impedance(write(tmp_path, head + rows(FREQUENCY, OPEN.real, OPEN.imag, delimiter=delimiter)), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-9)
    np.testing.assert_allclose(sweep.frequency_hz, FREQUENCY, rtol=1e-9)


def test_decimal_commas_between_blanks(tmp_path: Path) -> None:
    text = BARE.format(" ") + rows(FREQUENCY, OPEN.real, OPEN.imag, delimiter="  ").replace(".", ",")
    np.testing.assert_allclose(read_impedance(write(tmp_path, text), "open").impedance_ohm, OPEN, rtol=1e-9)


NO_NAMES = r"put a line such as 'frequency_hz,resistance_ohm,reactance_ohm' above the numbers"


@pytest.mark.parametrize(
    ("head", "row", "says"),
    [
        (
            "Meas Type,S11\nTrace Data\nFrequency,Formatted Data\n",
            "1e5,1,2,3,F",
            rf"line 4: no row .* line 3 \(Frequency, .*\) has 2 .* for 5 values; {NO_NAMES}",
        ),
        ("Meas Type,S11\nTrace Data\nFrequency,Formatted Data\n", "1e5,-8.7", "'Frequency' has no unit.*no two of them give an impedance"),
        (
            "* INFO: A\n* Data: Impedance (ohms), Phase (degrees)\n****\n",
            "  1e5  +1  +2",
            rf"line 4: no row .* line 2 .* has 2 of them for 3 values; {NO_NAMES}",
        ),
        ("% made by hand\n", "1e5,1,2", "no row of column names with units; found made, by, hand, .* frequency_hz with resistance_ohm"),
        ("% made by a hand\n", "1e5,1,2", rf"line 2: no row .* line 1 .* has 4 of them for 3 values; {NO_NAMES}"),
        ("% hand\n", "1e5,1,2", rf"line 2: numbers where the column names are needed; {NO_NAMES}"),
        ("% Frequency (Hz), A Magnitude (dBm), A Phase (deg)\n", "1e5, 1, 2", "another decibel unit"),
        ("frequency_hz,resistance_ohm,reactance_ohm\n", "1,5,2,5,3,5", "6 values for 3 columns; decimal commas need ';'"),
        ("frequency_hz resistance_ohm reactance_ohm\n", "*1e5 1 2", "line 2.*is not a number"),
    ],
)
def test_text_above_the_numbers_that_does_not_name_them(tmp_path: Path, head: str, row: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        read_impedance(write(tmp_path, head + f"{row}\n" * 10), "open")


def test_a_mark_of_a_comment_among_the_rows_is_refused(tmp_path: Path) -> None:
    text = BARE.format(",") + rows(FREQUENCY, OPEN.real, OPEN.imag, delimiter=",")
    for mark in "*%!":
        with pytest.raises(BadInput, match=r"line 18.*is not a number"):
            read_impedance(write(tmp_path, text + f"{mark}4e7,1,2\n"), "open")
        with pytest.raises(BadInput, match=r"line 2.*is not a number"):
            read_impedance(write(tmp_path, text.replace("\n", f"\n{mark}1e5,1,2\n", 1)), "open")
    assert len(read_impedance(write(tmp_path, text.replace("\n", "\n! sorted\n#1e5,1,2\n", 1)), "open")) == 16


def test_a_first_row_that_is_cut_off_is_told(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"line 2: 2 values for 3 columns; the row or the file is cut off"):
        read_impedance(write(tmp_path, BARE.format(",") + "1e5,1\n"), "open")


@pytest.mark.parametrize(
    "head",
    [
        "#Impedance Analyzer\n#Resistor: 100 Ohm\n\nFrequency (Hz),Trace θ (deg),Trace |Z| (Ohm),Trace Rs (Ohm),Trace Xs (Ohm)\n",
        "Frequency (Hz);Trace 2: Impedance: Phase (°);Trace 1: Impedance: Magnitude (Ω)\n",
        "Frequenz (Hz);Trace 2: Impedanz: Phase (°);Trace 1: Impedanz: Betrag (Ω)\n",
    ],
)
def test_titles_that_begin_with_trace(tmp_path: Path, head: str) -> None:
    columns = [FREQUENCY, np.angle(OPEN, deg=True), np.abs(OPEN)]
    german = "Frequenz" in head
    body = (
        rows(*columns, delimiter=";").replace(".", ",")
        if german
        else rows(*columns, delimiter=";")
        if ";" in head
        else rows(*columns, OPEN.real, OPEN.imag, delimiter=",")
    )
    sweep = read_impedance(write(tmp_path, head + body), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-9)
    assert sweep.metadata["read_as"] == "|Z| and phase"


def test_two_traces_of_one_sweep_are_one(tmp_path: Path) -> None:
    """As an analyser saves them that shows magnitude in one trace and phase in the other, each with real and imaginary part."""
    parts = "Trace {0}: Impedance: Real (Ω);Trace {0}: Impedance: Imaginary (Ω)"
    head = f"Frequency (Hz);{parts.format(1)};Trace 1: Impedance: Magnitude (Ω);{parts.format(2)};Trace 2: Impedance: Phase (°)\n"
    columns = [FREQUENCY, OPEN.real, OPEN.imag, np.abs(OPEN), OPEN.real, OPEN.imag, np.angle(OPEN, deg=True)]
    sweep = read_impedance(write(tmp_path, head + rows(*columns, delimiter=";")), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-9)
    columns[4] = columns[4] * 1.001
    with pytest.raises(BadInput, match="both hold the resistance"):
        read_impedance(write(tmp_path, head + rows(*columns, delimiter=";")), "open")


def test_a_trace_that_is_saved_twice_is_one(tmp_path: Path) -> None:
    """As an analyser saves it that shows R and X in one trace, and R again for a cursor; the title is the analyser's own."""
    real = "Trace 1: Impedance: Real (Ω)"
    head = f"Frequency (Hz);{real};Trace 1: Impedance: Imaginary (Ω);{real}\n"
    sweep = read_impedance(write(tmp_path, head + rows(FREQUENCY, OPEN.real, OPEN.imag, OPEN.real, delimiter=";")), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-9)
    with pytest.raises(BadInput, match="both hold the resistance"):
        read_impedance(write(tmp_path, head + rows(FREQUENCY, OPEN.real, OPEN.imag, OPEN.real + 1, delimiter=";")), "open")


def test_a_line_that_loses_less_than_the_calibration_shows(tmp_path: Path) -> None:
    """A short line of hardly any loss: its reflection is above 1 by a few tenths of a per cent, which no sign of a column explains."""
    beyond = 1.003 * np.exp(-2j * np.pi * np.linspace(0.1, 0.9, FREQUENCY.size))
    sweep = read_impedance(write(tmp_path, touchstone(beyond), "line.s1p"), "short")
    (warning,) = sweep.metadata["warnings"]
    assert "calibrate again" in warning
    assert "column" not in warning


def complex_table(titles: str, spelling: str, *columns: np.ndarray) -> str:
    cells = [[spelling.format(value.real, value.imag) for value in row] for row in zip(*columns, strict=True)]
    return titles + "\n" + "".join(", ".join([repr(float(f)), *row]) + "\n" for f, row in zip(FREQUENCY, cells, strict=True))


@pytest.mark.parametrize("spelling", ["({:.12e}{:+.12e}j)", "{:.12e}{:+.12e}i", "{:.12e} {:+.12e}*i"])
def test_columns_of_complex_numbers(tmp_path: Path, spelling: str) -> None:
    for titles, columns, read_as in (
        ("#f_hz, S11, Z_kohm", (reflection(OPEN), OPEN / 1e3), "R and X"),
        ("f_hz, Y (mS), other", (1e3 / OPEN, OPEN), "G and B"),
        ("f_hz, S11, Z", (reflection(OPEN), OPEN), "S11 in 50 Ohm"),
    ):
        sweep = read_impedance(write(tmp_path, complex_table(titles, spelling, *columns)), "open")
        np.testing.assert_allclose(sweep.impedance_ohm, OPEN, rtol=1e-8)
        assert sweep.metadata["read_as"] == read_as


@pytest.mark.parametrize("spelling", ["{}{}j{}", "({} {} j{})", "{}{}j*{}", "{}{}i {}"])
def test_complex_numbers_as_engineers_write_them(tmp_path: Path, spelling: str) -> None:
    """With j in front of the imaginary part."""
    cells = [spelling.format(repr(z.real), "-" if z.imag < 0 else "+", repr(abs(z.imag))) for z in OPEN.tolist()]
    text = "f_hz,Z (Ohm)\n" + "".join(f"{f!r},{cell}\n" for f, cell in zip(FREQUENCY.tolist(), cells, strict=True))
    np.testing.assert_array_equal(read_impedance(write(tmp_path, text), "open").impedance_ohm, OPEN)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("f_hz,R (Ohm),|X| (Ohm)\n1e5,1,2\n2e5,1,3\n", "|X| has lost the sign of the reactance"),
        ("f_hz,R (Ohm),abs(X) (Ohm)\n1e5,1,2\n2e5,1,3\n", "|X| has lost the sign of the reactance"),
        ("f_hz,|Z| (Ohm)\n1e5,1\n2e5,2\n", "|Z| alone is not enough: save its phase too"),
        ("<Qucs Dataset 0.0.22>\n<indep frequency 2>\n  1e5\n  2e5\n</indep>\n", "a dataset of Qucs is not read; export the impedance"),
    ],
)
def test_what_is_missing_is_told(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(BadInput) as caught:
        read_impedance(write(tmp_path, text), "open")
    assert words in str(caught.value)


def test_columns_of_complex_numbers_that_are_refused(tmp_path: Path) -> None:
    text = complex_table("#f, S11_short, Zin, Z", "({:.6e}{:+.6e}j)", OPEN, OPEN, OPEN)
    with pytest.raises(BadInput) as caught:
        read_impedance(write(tmp_path, text), "open")
    for part in ("'f' has no unit", "'Z' has no unit", "'S11_short', 'Zin' hold complex numbers of no known name: write 'Z (Ohm)'"):
        assert part in str(caught.value)
    assert "no two" not in str(caught.value)
    whole = complex_table("f_hz, Z (Ohm)", "({:.6e}{:+.6e}j)", OPEN)
    with pytest.raises(BadInput, match=r"line 18, column 'Z .Ohm.': '5' is not a complex number"):
        read_impedance(write(tmp_path, whole + "4e7, 5\n"), "open")
    with pytest.raises(BadInput, match=r"'\(1\+2' is not a complex number"):
        read_impedance(write(tmp_path, whole + "4e7, (1+2\n"), "open")


def test_all_that_is_missing_is_told_at_once(tmp_path: Path) -> None:
    text = "Frequency,Impedance,ESR\n" + rows(FREQUENCY, np.abs(OPEN), OPEN.real, delimiter=",")
    with pytest.raises(BadInput) as caught:
        read_impedance(write(tmp_path, text), "open")
    for part in ("'Frequency' has no unit: add Hz", "'Impedance', 'ESR' have no unit: add uOhm", "no two of them give an impedance", "phase_deg"):
        assert part in str(caught.value)


# Receiver


def dat(traces: list[tuple[str, str, np.ndarray]], frequency: np.ndarray, *, esu: bool = False, scans: str | None = None) -> str:
    scan = scans or "Scan 1:;\nStart;150000.0;Hz;\nStop;30000000.0;Hz;\nStep;4500.0;Hz;\nRBW;9000.0;Hz;\nMeas Time;0.01;s;\n"
    lines = ["Type;ESU8;" if esu else "Type;ESR3;", "Version;2.28;", "Date;03.Feb 2024;", "Mode;Receiver;"]
    lines += ["X-Axis;LOG;" if esu else "x-Axis;LIN;", "Scan Count;1;", "Transducer;;;;;;;;", *scan.splitlines()]
    for number, (detector, unit, level) in enumerate(traces, start=1):
        lines += [f"Trace {number}:" if esu else f"TRACE {number}:", "Trace Mode;CLR/WRITE;"]
        lines += [f"{'Scan Detector' if esu else 'Detector'};{detector};", "x-Unit;Hz;", f"y-Unit;{unit};", f"Values;{level.size};"]
        lines += [f"{f:.6f};{x:.6f};" for f, x in zip(frequency, level, strict=True)]
    return "\r\n".join(lines) + "\r\n"


GRID = 150e3 + 4500 * np.arange(20)
LEVEL = np.round(60 - 2 * np.sqrt(np.arange(20)), 6)


@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("esu", [False, True])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_receiver_export(tmp_path: Path, comma: bool, esu: bool, encoding: str) -> None:
    text = dat([("MAX PEAK", "dBµV", LEVEL), ("QUASI PEAK", "dBµV", LEVEL - 3), ("CISPR AVERAGE", "dBµV", LEVEL - 9)], GRID, esu=esu)
    if comma:
        # The firmware's version keeps its point.
        text = re.sub(r"(\d)\.(\d)", r"\1,\2", text).replace("2,28", "2.28", 1)
    peak, quasi, average = read_spectra(write(tmp_path, text.encode(encoding)))
    assert [s.detector for s in (peak, quasi, average)] == ["peak", "quasi-peak", "cispr-average"]
    np.testing.assert_array_equal(peak.frequency_hz, GRID)
    np.testing.assert_array_equal(average.level_dbuv, [float(f"{x:.6f}") for x in LEVEL - 9])
    assert peak.resolution_bandwidth_hz == 9e3
    assert peak.metadata["format"] == "receiver-dat"
    assert peak.metadata["type"] == ("ESU8" if esu else "ESR3")


def test_receiver_export_in_dbm(tmp_path: Path) -> None:
    spectrum = read_spectrum(write(tmp_path, dat([("AVERAGE", "dBm", LEVEL - 107)], GRID)))
    np.testing.assert_allclose(spectrum.level_dbuv, LEVEL - 107 + 106.9897, atol=1e-4)


def test_receiver_export_over_two_bandwidths(tmp_path: Path) -> None:
    frequency = np.array([9e3, 50e3, 149e3, 150e3, 1e6, 30e6])
    scans = "Scan 1:\nStart;9000;Hz\nStop;150000;Hz\nRBW;200;Hz\nScan 2:\nStart;150000;Hz\nStop;30000000;Hz\nRBW;9;kHz"
    low, high = read_spectra(write(tmp_path, dat([("MAX PEAK", "dBuV", LEVEL[:6])], frequency, scans=scans)))
    assert (low.resolution_bandwidth_hz, high.resolution_bandwidth_hz) == (200, 9e3)
    assert low.frequency_hz.tolist() == [9e3, 50e3, 149e3]
    assert high.frequency_hz.tolist() == [150e3, 1e6, 30e6]
    twice = np.array([9e3, 50e3, 150e3, 150e3, 1e6, 30e6])
    low, high = read_spectra(write(tmp_path, dat([("MAX PEAK", "dBuV", LEVEL[:6])], twice, scans=scans)))
    assert (low.frequency_hz[-1], high.frequency_hz[0]) == (150e3, 150e3)


def test_receiver_export_of_a_single_trace_without_heading(tmp_path: Path) -> None:
    text = dat([("QUASI PEAK", "dBuV", LEVEL)], GRID).replace("TRACE 1:\r\n", "")
    spectrum = read_spectrum(write(tmp_path, text))
    assert (spectrum.detector, len(spectrum), spectrum.resolution_bandwidth_hz) == ("quasi-peak", 20, 9e3)


def test_final_list_is_left_out(tmp_path: Path) -> None:
    final = "TRACE 1 FINAL:\r\nFinal Detector;QUASI PEAK;\r\ny-Unit;dBuV;\r\nValues;1;\r\n1;159000.000000;44.0;-3.1;N;GND;\r\n"
    assert len(read_spectra(write(tmp_path, dat([("MAX PEAK", "dBuV", LEVEL)], GRID) + final))) == 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("MAX PEAK", "MIN PEAK", "detector"),
        ("dBuV", "dBuA", "y-unit"),
        ("x-Unit;Hz", "x-Unit;s", "x-unit"),
        ("Values;20", "Values;21", "cut off"),
        ("Values;20", "Values;19", "more rows"),
        ("Values;20", "Values;many", "number of rows"),
        ("RBW;9000.0;Hz;\r\n", "", "RBW"),
        ("60.000000", "nan", "finite|announced"),
        ("60.000000", "60,000000", "decimal comma"),
        ("60.000000", "", "needed|cut off"),
    ],
)
def test_receiver_export_that_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    text = dat([("MAX PEAK", "dBuV", LEVEL)], GRID)
    assert old in text
    with pytest.raises(BadInput, match=says):
        read_spectra(write(tmp_path, text.replace(old, new, 1)))


@pytest.mark.parametrize("lost", range(3, 11))
def test_receiver_export_cut_inside_the_last_number(tmp_path: Path, lost: int) -> None:
    text = dat([("MAX PEAK", "dBuV", LEVEL)], GRID)
    for whole in (text, text.replace(";\r\n", "\r\n")):
        with pytest.raises(BadInput, match=r"cut off|needed"):
            read_spectra(write(tmp_path, whole[:-lost]))


# tinySA, and tables of receivers' programs


@pytest.mark.parametrize(("delimiter", "unit"), [(",", 1.0), (", ", 1.0), (";", 1.0), ("\t", 1.0), (" ", 1.0), (",", 1e6)])
def test_tinysa(tmp_path: Path, delimiter: str, unit: float) -> None:
    text = "".join(f"{f / unit!r}{delimiter}{x!r}\n" for f, x in zip(GRID.tolist(), (LEVEL - 130).tolist(), strict=True))
    spectrum = read_spectrum(write(tmp_path, text))
    np.testing.assert_allclose(spectrum.frequency_hz, GRID, rtol=1e-12)
    np.testing.assert_allclose(spectrum.level_dbuv, LEVEL - 130 + 106.9897, atol=1e-4)
    assert spectrum.metadata["format"] == "tinysa-csv"
    assert spectrum.metadata["detector_assumed"] is True


@pytest.mark.parametrize("empty", ["", "---", "-"])
def test_final_values_with_one_detector_in_each_row(tmp_path: Path, empty: str) -> None:
    """As EMI software writes them: the other detector's cell is empty."""
    quasi_peak = "".join(f"{0.5 + at};{60 - at}.5;{empty};66.0;5.5\n" for at in range(4))
    average = "".join(f"{10.5 + at};{empty};{40 - at}.5;56.0;15.5\n" for at in range(3))
    text = f"Frequency (MHz);QuasiPeak (dBµV);CAverage (dBµV);Limit (dBµV);Margin (dB)\n{quasi_peak}{average}"
    first, second = read_spectra(write(tmp_path, text))
    assert (first.detector, second.detector) == ("quasi-peak", "cispr-average")
    assert first.level_dbuv.tolist() == [60.5, 59.5, 58.5, 57.5]
    assert second.frequency_hz.tolist() == [10.5e6, 11.5e6, 12.5e6]
    assert "3 of 7 rows have no quasi-peak level" in first.metadata["changes"]
    # With a single detector a row without a level is a mistake.
    with pytest.raises(BadInput, match="a value is missing"):
        read_spectra(write(tmp_path, "# detector: peak\nFrequency (MHz);Level (dBµV)\n0.5;60\n0.6;\n"))
    nothing = f"Frequency (MHz);QuasiPeak (dBµV);CAverage (dBµV)\n0.5;{empty};{empty}\n"
    with pytest.raises(BadInput):
        read_spectra(write(tmp_path, nothing))


def test_two_columns_that_begin_below_9_khz_are_refused(tmp_path: Path) -> None:
    """150 kHz to 108 MHz, written in kHz."""
    text = "".join(f"{f:.3f},-56.1\n" for f in np.geomspace(150.0, 108000.0, 50))
    with pytest.raises(BadInput, match="the unit of its frequencies is not stated"):
        read_spectrum(write(tmp_path, text))


def test_levels_that_may_be_dbuv_are_refused(tmp_path: Path) -> None:
    text = "".join(f"{f!r},{x!r}\n" for f, x in zip(GRID.tolist(), LEVEL.tolist(), strict=True))
    with pytest.raises(BadInput, match="dBm or in dBuV"):
        read_spectrum(write(tmp_path, text))


def test_dbm_with_a_header(tmp_path: Path) -> None:
    text = "# detector: peak\nFrequency (Hz),Level (dBm)\n" + "".join(f"{f},{x}\n" for f, x in zip(GRID, LEVEL - 130, strict=True))
    np.testing.assert_allclose(read_spectrum(write(tmp_path, text)).level_dbuv, LEVEL - 23.0103, atol=1e-3)


def test_real_table_with_a_column_for_each_detector() -> None:
    peak, average = read_spectra(DATA / "emi_spectra_baltic_lab" / "baltic-lab-cm.csv")
    assert (peak.detector, average.detector) == ("peak", "average")
    assert (peak.frequency_hz[0], peak.level_dbuv[0], average.level_dbuv[0]) == (151070.0, 15.0, 6.63)
    assert peak.metadata["rbw_assumed"] is True


def test_table_of_a_receiver_program(tmp_path: Path) -> None:
    text = "Frequency (MHz);QuasiPeak (dBµV);CAverage (dBµV);Limit (dBµV);Margin (dB)\n" + "".join(
        f"{f / 1e6:.4f};{x:.2f};{x - 9:.2f};66,0;6,0\n".replace(".", ",") for f, x in zip(GRID, LEVEL, strict=True)
    )
    quasi, average = read_spectra(write(tmp_path, text.encode("latin-1")))
    assert (quasi.detector, average.detector) == ("quasi-peak", "cispr-average")
    assert quasi.level_dbuv[0] == 60.0
    with pytest.raises(BadInput, match="2 spectra"):
        read_spectrum(write(tmp_path, text.encode("latin-1")))


# Never a wrong number


def spectra_table(path: Path) -> list[tuple[float, complex]]:
    return [(f, complex(x)) for s in read_spectra(path) for f, x in zip(s.frequency_hz.tolist(), s.level_dbuv.tolist(), strict=True)]


def sweep_table(path: Path) -> list[tuple[float, complex]]:
    sweep = read_impedance(path, "open")
    return list(zip(sweep.frequency_hz.tolist(), sweep.impedance_ohm.tolist(), strict=True))


KEYSIGHT = (
    "Trace\nSwept SA\nA.25.08,N9038A\nNumber of Points,20\nRBW,9000\nRBW Filter,Gaussian\nRBW Filter BW,6dB\nTrace Type,Maxhold\nDetector,Peak\n"
    "Trace Math,Off\nNormalize,Off\nX Axis Units,Hz\nY Axis Units,dBuV\nDATA\n"
)


READERS: dict[str, tuple[str, Callable[[Path], list[tuple[float, complex]]]]] = {
    "s1p": (touchstone(reflection(OPEN)), sweep_table),
    "s2p": (two_ports(through_series(OPEN), comments="! fixture: series-through\n"), sweep_table),
    "z1p": (touchstone(OPEN / 50, "# HZ Z RI R 50"), sweep_table),
    "e4990a": (e4990a("Frequency(Hz), R(Ohm)-data, X(Ohm)-data", OPEN.real, OPEN.imag), sweep_table),
    "dat": (dat([("MAX PEAK", "dBuV", LEVEL), ("AVERAGE", "dBuV", LEVEL - 9)], GRID), spectra_table),
    "keysight": (KEYSIGHT + rows(GRID, LEVEL, delimiter=","), spectra_table),
    "tinysa": ("".join(f"{f:.1f},{x:.6f}\n" for f, x in zip(GRID, LEVEL - 130, strict=True)), spectra_table),
    "blanks": ("% by hand\nMachine A\n" + BARE.format(" ") + rows(FREQUENCY, OPEN.real, OPEN.imag), sweep_table),
    "complex": (complex_table("# f_hz, Z (Ohm)", "({:.6e}{:+.6e}j)", OPEN), sweep_table),
    "csv": ("Frequency (Hz),Peak (dBuV),Average (dBuV)\n" + rows(GRID, LEVEL, LEVEL - 9, delimiter=","), spectra_table),
}


@functools.cache
def in_the_whole_file(kind: str) -> set[tuple[float, complex]]:
    """What is read of the file before anything happens to it."""
    text, read = READERS[kind]
    with tempfile.TemporaryDirectory() as folder:
        return set(read(write(Path(folder), text, "file")))


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_a_file_cut_anywhere_gives_right_numbers_or_none(kind: str, data: st.DataObject) -> None:
    (text, read), whole = READERS[kind], in_the_whole_file(kind)
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder), text[: data.draw(st.integers(1, len(text) - 1))], "file")
        try:
            assert set(read(path)) <= whole
        except BadInput:
            return


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=80, deadline=None)
@given(data=st.data())
def test_lost_doubled_and_swapped_lines_give_right_numbers_or_none(kind: str, data: st.DataObject) -> None:
    (text, read), whole = READERS[kind], in_the_whole_file(kind)
    lines = text.splitlines(keepends=True)
    first, second = data.draw(st.integers(0, len(lines) - 1)), data.draw(st.integers(0, len(lines) - 1))
    what = data.draw(st.sampled_from(["lose", "double", "swap"]))
    with tempfile.TemporaryDirectory() as folder:
        if what == "lose":
            del lines[first]
        elif what == "double":
            lines.insert(second, lines[first])
        else:
            lines[first], lines[second] = lines[second], lines[first]
        try:
            assert set(read(write(Path(folder), "".join(lines), "file"))) <= whole
        except BadInput:
            return


@pytest.mark.slow
@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=120, deadline=None)
@given(data=st.data())
def test_any_damage_is_read_or_refused(kind: str, data: st.DataObject) -> None:
    text, _ = READERS[kind]
    damaged = text.encode()
    pieces = st.one_of(
        st.sampled_from([b";", b",", b"!", b"#", b"[", b"\n", b"nan", b"1e999", b"Values;3;", b"R 50", b"END\n"]), st.binary(max_size=3)
    )
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(damaged)))
        damaged = damaged[:place] + data.draw(pieces) + damaged[place + data.draw(st.integers(0, 6)) :]
    with tempfile.TemporaryDirectory() as folder:
        path = write(Path(folder), damaged, "file")
        for read in (sweep_table, spectra_table):
            message = ""
            try:
                assert all(np.isfinite(value) for _, value in read(path))
            except BadInput as error:
                message = str(error)
            assert "\n" not in message
