"""Titles of columns: every usual spelling of names and units has one meaning, or is refused by name."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from motoremi.data.columns import find_columns, unit_trouble, with_units, without_description
from motoremi.data.files import read_impedance
from motoremi.data.table import Table
from motoremi.errors import BadInput


def table(*titles: str) -> Table:
    return Table("file", {}, titles, [], [])


@pytest.mark.parametrize(
    ("title", "meaning", "factor"),
    [
        ("f [MHz]", "frequency", 1e6),
        ("Frequency/kHz", "frequency", 1e3),
        ("freq_mhz", "frequency", 1e6),
        ("FREQ (HZ)", "frequency", 1.0),
        ("R[mΩ]", "resistance", 1e-3),
        ("R[µΩ]", "resistance", 1e-6),
        ("R (MΩ)", "resistance", 1e6),
        ("R_mohm", "resistance", 1e-3),
        ("R (Mohm)", "resistance", 1e6),
        ("R [megohm]", "resistance", 1e6),
        ("R in MilliOhms", "resistance", 1e-3),
        ("R (uOhm)", "resistance", 1e-6),
        ("R (KOHM)", "resistance", 1e3),
        ("Re{Z}/Ohm", "resistance", 1.0),
        ("Re(Z) [Ohm]", "resistance", 1.0),
        ("Z' (Ohm)", "resistance", 1.0),
        ("Im{Z}/mOhm", "reactance", 1e-3),
        ("-Im(Z) [Ohm]", "reactance", -1.0),
        # Exports of a Bode 100, of Analog Discovery and of LCR meters.
        ("TR2: Impedance (Real) [Ohm]", "resistance", 1.0),
        ("TR1: Impedance (absolut) [Ohm]", "magnitude", 1.0),
        ("TR2: Impedance (Ls) [H]", "series_inductance", 1.0),
        ("Impedance: Rs (Ω)", "series_resistance", 1.0),
        ("Impedance: Xs (kΩ)", "reactance", 1e3),
        ("Trace th (deg)", "phase", 1.0),
        ("-(Im Z) [Ohm]", "reactance", -1.0),
        ("−Z'' (kOhm)", "reactance", -1e3),
        ("|Z| in kOhm", "magnitude", 1e3),
        ("Z (mOhm)", "magnitude", 1e-3),
        ("Z magnitude, Ohm", "magnitude", 1.0),
        ("Phase/°", "phase", 1.0),
        ("theta [rad]", "phase", 180 / math.pi),
        ("θ_z (deg)", "phase", 1.0),
        ("Phase(Z) [Degrees]", "phase", 1.0),
        ("∠Z (deg.)", "phase", 1.0),
        ("Re{Y}/µS", "conductance", 1e-6),
        ("Y in uS", "admittance", 1e-6),
        ("G [mS]", "conductance", 1e-3),
        ("Cp [pF]", "parallel_capacitance", 1e-12),
        ("Ls (MH)", "series_inductance", 1e-3),
        ("ESR/mOhm", "series_resistance", 1e-3),
        ("D()-data", "dissipation_factor", 1.0),
        ("S11(REAL)", "s11_real", 1.0),
        ("Trace |Z| (Ohm)", "magnitude", 1.0),
        ("Trace θ (deg)", "phase", 1.0),
        ("Trace Phase (deg)", "phase", 1.0),
        ("Trace Rs (Ω)", "series_resistance", 1.0),
        ("Trace 1: Impedance: Magnitude (Ω)", "magnitude", 1.0),
        ("Trace 2: Impedance: Phase (°)", "phase", 1.0),
        ("Frequenz (Hz)", "frequency", 1.0),
        ("Trace 1: Impedanz: Betrag (kΩ)", "magnitude", 1e3),
        ("Trace 2: Impedanz: Phase (°)", "phase", 1.0),
        ("Level dB(µV)", "level", 1.0),
        ("Level (dBm)", "level_dbm", 1.0),
        ("QuasiPeak (dBµV)", "level quasi-peak", 1.0),
    ],
)
def test_usual_spellings(title: str, meaning: str, factor: float) -> None:
    found = find_columns(table("other", title))
    assert list(found) == [meaning]
    assert (found[meaning].index, found[meaning].factor) == (1, pytest.approx(factor, rel=1e-15))


@pytest.mark.parametrize(
    "title",
    [
        "R",
        "R (MOHM)",
        "R_dc [Ohm]",
        "R min (Ohm)",
        "1/Z [S]",
        "R(Ohm)-mem",
        "Level (dBµV/m)",
        "Z (mS)",
        "f0 [Hz]",
        "Trace 1 (Memory): R (Ohm)",
        "R" + "(" * 100_000 + "Ohm",
    ],
)
def test_doubtful_titles_are_not_taken(title: str) -> None:
    assert find_columns(table(title)) == {}


@pytest.mark.parametrize(
    ("titles", "says"),
    [
        (("f [Hz]", "R[furlong]"), "the unit 'furlong' of column 'R[furlong]' is not known: use uOhm, mOhm, Ohm, kOhm or MOhm"),
        (("f [Hz]", "R (MOHM)"), "the unit 'MOHM' of column 'R (MOHM)' may be milli or mega: write mOhm or MOhm"),
        (("f [Hz]", "phase"), "the column 'phase' has no unit: add deg or rad; or tell the units to motoremi import, for example --unit phase=deg"),
        (
            ("f", "Z", "ESR"),
            "the column 'f' has no unit: add Hz, kHz, MHz or GHz; the columns 'Z', 'ESR' have no unit: add uOhm, mOhm, Ohm, kOhm or "
            "MOhm; or tell the units to motoremi import, for example --unit f=Hz --unit Z=Ohm --unit ESR=Ohm",
        ),
        (("S11_short", "S11 (dB)"), ""),
        (("level",), "the column 'level' has no unit: add dBuV or dBm; or tell the units to motoremi import, for example --unit level=dBuV"),
        (("f [Hz]", "R of the lead", "R(Ohm)-mem", "level_db", "remark"), ""),
    ],
)
def test_the_unit_that_is_not_known_is_named(titles: tuple[str, ...], says: str) -> None:
    assert unit_trouble(table(*titles)) == says


@pytest.mark.parametrize(
    ("titles", "meaning"),
    [
        (("Frequency (Hz)", "Trace 1: Impedance: Real (Ω)", "Trace 1: Impedance: Imag (Ω)"), {"frequency", "resistance", "reactance"}),
        (("Trace 2: Admittance: Magnitude (S)", "Trace 2: Admittance: Phase (°)"), {"admittance", "admittance_phase"}),
        (("f / Hz", "|Z| / Ohm", "phi / Grad"), {"frequency", "magnitude", "phase"}),
        (("Frequenz [kHz]", "Betrag (Ω)", "Phase (°)"), {"frequency", "magnitude", "phase"}),
        (("Frequenz [kHz]", "Z Realteil (Ω)", "Z Imaginärteil (Ω)"), {"frequency", "resistance", "reactance"}),
        (("Fréquence (kHz)", "Module (Ω)", "Phase (degrés)"), {"frequency", "magnitude", "phase"}),
        (("Frecuencia (Hz)", "Módulo (Ω)", "Fase (grados)"), {"frequency", "magnitude", "phase"}),
        (("Frequenza (MHz)", "Modulo (ohm)", "Fase (gradi)"), {"frequency", "magnitude", "phase"}),
        (("Frequency in kHz", "Real part in Ohm", "Imaginary part in Ohm"), {"frequency", "resistance", "reactance"}),
        (("Frequenz [Hz]", "Wirkwiderstand [Ω]", "Blindwiderstand [Ω]"), {"frequency", "resistance", "reactance"}),
        (("f [Hz]", "Scheinwiderstand [Ω]", "Phasenwinkel [°]"), {"frequency", "magnitude", "phase"}),
        (("Frequency(Hz)", "Z(ohm)", "θz(°)"), {"frequency", "magnitude", "phase"}),
        (("Frecuencia (Hz)", "Resistencia (Ω)", "Reactancia (Ω)"), {"frequency", "resistance", "reactance"}),
    ],
)
def test_names_as_laboratories_write_them(titles: tuple[str, ...], meaning: set[str]) -> None:
    found = find_columns(table(*titles))
    assert set(found) == meaning
    assert all(found[one].factor == 1 for one in meaning - {"frequency"})


def test_units_that_the_user_gives() -> None:
    given, told = with_units(table("No", "FREQ", "Z", "PHASE"), {"freq": "kHz", "Z": "mOhm", "PHASE": "deg", "level": "dBuV"})
    assert {meaning: column.factor for meaning, column in find_columns(given).items()} == {"frequency": 1e3, "magnitude": 1e-3, "phase": 1.0}
    assert told == ("units as given: FREQ in kHz, Z in mOhm, PHASE in deg",)
    assert with_units(table("f [Hz]"), {"f": "kHz"}) == (table("f [Hz]"), ())
    assert "unit 'furlong'" in unit_trouble(with_units(table("f", "Z"), {"Z": "furlong"})[0])


@pytest.mark.parametrize("words", ["Coil of 4.7 uH - ", "Columns: ", "Part 12-3: measured – "])
def test_words_before_the_first_name_are_no_part_of_it(words: str) -> None:
    """As in the last comment of a published file, `# ... inductor impedance - f, Re(Z), Im(Z)`."""
    described = without_description(table(f"{words}f (Hz)", "Re(Z) (Ohm)", "Im(Z) (Ohm)"))
    assert set(find_columns(described)) == {"frequency", "resistance", "reactance"}


def test_a_first_name_with_a_dash_in_it_stays() -> None:
    for title in ("frequency - Hz", "Trace 1: Impedance: Magnitude (Ohm)", "Point - number"):
        assert without_description(table(title, "R (Ohm)")).columns[0] == title


@pytest.mark.parametrize(
    "titles",
    [
        "Frequency (MHz),Mag (Ohm),Phase (deg)",
        "Freq. (MHz),Z (Ohm),Ph (deg)",
        "F/MHz,Z/Ohm,Ph/deg",
        "Frequency (MHz),Trace A |Z| (Ohm),Trace B Theta (deg)",
    ],
)
def test_common_english_titles_are_read(tmp_path: Path, titles: str) -> None:
    rows = "".join(f"{number},{20 * number},90\n" for number in range(1, 11))
    (tmp_path / "a.csv").write_text(f"{titles}\n{rows}")
    sweep = read_impedance(tmp_path / "a.csv", "short")
    assert sweep.frequency_hz == pytest.approx([1e6 * number for number in range(1, 11)])
    assert sweep.impedance_ohm == pytest.approx([20j * number for number in range(1, 11)])


def test_titles_that_are_not_understood_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Frequency (MHz),|Z| (Ohm),Wobble (deg)\n0.15,3,90\n1,20,90\n30,600,90\n")
    with pytest.raises(BadInput, match=r"not understood: 'Wobble \(deg\)'"):
        read_impedance(tmp_path / "a.csv", "short")


def test_names_between_dots_above_rows_with_semicolons(tmp_path: Path) -> None:
    """As Solartron SMaRT exports them; one of its files has a comma among the dots."""
    names = (
        "Result Number,Sweep Number.Time.Frequency (Hz).Set Point ('C).Impedance Magnitude (Ohms).Impedance Real (Ohms).Impedance Imaginary (Ohms)"
    )
    rows = [f"{n};1;00:00:0{n};{10 ** (n + 1)};-;{abs(3 + 4j * n)};3;{4 * n};" for n in range(1, 9)]
    (tmp_path / "smart.csv").write_text("\n".join(["Exported SMaRT Impedance Data", "", names, *rows, ""]))
    sweep = read_impedance(tmp_path / "smart.csv", "short")
    assert sweep.frequency_hz.tolist() == [10.0 ** (n + 1) for n in range(1, 9)]
    assert sweep.impedance_ohm.tolist() == [3 + 4j * n for n in range(1, 9)]


def test_sweeps_below_each_other_are_not_to_be_sorted_into_one(tmp_path: Path) -> None:
    rows = [f"{f},3,{f / 1e4}" for f in (1e3, 2e3, 3e3, 4e3, 5e3, 6e3)]
    (tmp_path / "three.csv").write_text("\n".join(["frequency_hz,resistance_ohm,reactance_ohm", *rows, *rows, *rows, ""]))
    with pytest.raises(
        BadInput, match=r"line 8: frequencies must increase, but begin again at 1000 Hz: 3 sweeps stand below each other; save each"
    ):
        read_impedance(tmp_path / "three.csv", "short")


@pytest.mark.parametrize("phase", ["theta-z (deg)", "Z phase (deg)", "Impedance phase (deg)"])
@pytest.mark.parametrize("size", ["S11 (dB)", "Return loss (dB)", "|S11|"])
def test_a_phase_of_z_is_not_that_of_a_reflection(size, phase, tmp_path):
    assert "reflection_phase" not in find_columns(table("f (Hz)", size, phase))
    rows = "\n".join(f"{1e6 + 1e5 * at:.0f},0.5,{10 + at}" for at in range(10))
    (tmp_path / "s.csv").write_text(f"f (Hz),{size},{phase}\n{rows}\n")
    with pytest.raises(BadInput, match="the phase is that of Z and the magnitude that of S11"):
        read_impedance(tmp_path / "s.csv", "short")


def test_a_phase_of_z_beside_an_admittance_has_the_other_sign():
    assert find_columns(table("f (Hz)", "|Y| (S)", "theta-z (deg)"))["admittance_phase"].factor == -1.0
    assert find_columns(table("f (Hz)", "|Y| (S)", "theta (deg)"))["admittance_phase"].factor == 1.0


def written(path: Path, title: str, rows: list[str]) -> Path:
    path.write_text("\n".join([title, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("title", "rows", "doubted"),
    [
        # 1 MHz to 1.9 MHz in kHz with commas, and the same with decimals elsewhere: then they are decimals everywhere.
        ("Frequency (kHz),R (Ohm),X (Ohm)", [f'"1,{at}00",13,{80 + at}' for at in range(10)], True),
        ("Frequency (kHz);R (Ohm);X (Ohm)", [f"1.{at}00;13.5;{80 + at}" for at in range(10)], False),
        # 15 915 Ohm down to 961 Ohm, and numbers that have decimals only where they need them.
        ("f (Hz);R (Ohm);X (Ohm)", [f"{1000 + at};1;-{15 - at}.9{at}5" for at in range(1, 8)] + ["2000;1;-961", "2001;1;-905"], True),
        ("f (Hz);R (Ohm);X (Ohm)", [f"{1000 + at};1;-{15 - at}.9{at}5" for at in range(1, 8)] + ["2000;1;-9.61", "2001;1;-9"], False),
    ],
)
def test_separators_of_thousands_are_told(title, rows, doubted, tmp_path):
    sweep = read_impedance(written(tmp_path / "s.csv", title, rows), "short")
    assert any("separator of thousands" in one for one in sweep.metadata.get("warnings", [])) == doubted


@pytest.mark.parametrize("line", ["# Z0: 75 Ohm", "# Reference impedance: 75 Ohm", "# reference_impedance_ohm: 75"])
def test_another_reference_impedance_is_refused(line, tmp_path):
    rows = [f"{1e6 + 1e5 * at:.0f},0.5,0.1" for at in range(10)]
    with pytest.raises(BadInput, match="a reference impedance of 75 Ohm, but S11 of a table is read in 50 Ohm"):
        read_impedance(written(tmp_path / "s.csv", f"{line}\nf (Hz),S11_real,S11_imag", rows), "short")
    assert len(read_impedance(written(tmp_path / "t.csv", f"{line.replace('75', '50')}\nf (Hz),S11_real,S11_imag", rows), "short")) == 10


def test_a_table_without_numbers_is_refused(tmp_path):
    (tmp_path / "s.csv").write_bytes("°\n#".encode())
    with pytest.raises(BadInput, match="no numbers"):
        read_impedance(tmp_path / "s.csv", "short")


def test_an_impedance_of_next_to_nothing_is_no_reading(tmp_path):
    rows = [f"{1e6 + 1e5 * at:.0f},{1e-160 if at == 4 else 1.0},0" for at in range(10)]
    with pytest.raises(BadInput, match=r"point 5, 1.4e\+06 Hz\); remove the row"):
        read_impedance(written(tmp_path / "s.csv", "f (Hz),R (Ohm),X (Ohm)", rows), "short")
