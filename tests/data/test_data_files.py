"""Users' files: every good one is read exactly, every bad one is refused in one line."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from places import DATA

from motoremi.data.csvfiles import write_impedance_csv, write_spectrum_csv
from motoremi.data.files import read_impedance, read_spectrum
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import LEAST_OHM, ImpedanceSweep
from motoremi.data.text import clean_text
from motoremi.data.text_file import MAXIMUM_BYTES
from motoremi.errors import BadInput

NATIVE = DATA / "eth_4294A_inductor" / "impedance.txt"
MOTOR = DATA / "motor_1p5hp_dm_cc_by" / "motor_1p5hp_A1_B1C1_subset.csv"
FREQUENCY = np.geomspace(150e3, 30e6, 12)
IMPEDANCE = 3.3 + 2j * np.pi * FREQUENCY * 1.2e-5
HEAD = "frequency_hz,resistance_ohm,reactance_ohm"


def rows(count: int = 10, delimiter: str = ",") -> list[str]:
    return [delimiter.join((f"{(n + 1) * 1e5:.1f}", f"{n + 1.25}", f"{-n - 0.5}")) for n in range(count)]


def write(tmp_path: Path, text: str | bytes, name: str = "sweep.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def table(tmp_path: Path, *lines: str, end: str = "\n") -> Path:
    return write(tmp_path, end.join(lines) + end)


def refusal(path: Path, kind: str = "short") -> str:
    """The one line that says why a file is refused."""
    with pytest.raises(BadInput) as caught:
        _ = read_spectrum(path) if kind == "spectrum" else read_impedance(path, kind)
    message = str(caught.value)
    assert path.name in message
    assert clean_text(message) == message
    return message


# Real files


def test_native_4294a_file() -> None:
    sweep = read_impedance(NATIVE, "short")
    assert len(sweep) == 534
    assert sweep.span_hz == (1e3, 1e5)
    assert abs(sweep.impedance_ohm[0]) == pytest.approx(1.324238, rel=1e-12)
    assert np.angle(sweep.impedance_ohm[0], deg=True) == pytest.approx(75.85065, rel=1e-9)
    # 204 uH in the middle, as its owners say
    assert sweep.impedance_ohm[300].imag / (2 * np.pi * sweep.frequency_hz[300]) == pytest.approx(204e-6, rel=0.02)
    expected = {"analyser": "4294a", "OSC LEVEL": "500 mVolt", "BW": "5", "DATE": "Jan 25 2018", "source": NATIVE.name}
    assert expected.items() <= sweep.metadata.items()
    assert sweep.metadata["format"] == "4294a-ascii"


def test_real_motor_file() -> None:
    sweep = read_impedance(MOTOR, "short")
    assert len(sweep) == 171
    assert sweep.frequency_hz[1] == 150.476
    assert sweep.impedance_ohm[1] == 28.9237 + 116.261j
    assert sweep.metadata == {"source": MOTOR.name, "format": "csv", "read_as": "R and X"}


def test_name_says_nothing_about_the_format(tmp_path: Path) -> None:
    renamed = write(tmp_path, NATIVE.read_bytes(), "wrong.csv")
    assert read_impedance(renamed, "open").metadata["format"] == "4294a-ascii"


# 4294A variants


def native(parameter: str, a: list[str], b: list[str], points: int | None = None) -> str:
    def section(letter: str, values: list[str]) -> list[str]:
        data = [f"{1e5 * (n + 1):.11e}\t{value}\t0.000000e+00" for n, value in enumerate(values)]
        return [f'"TRACE: {letter}"', '"FORMAT: LINEAR"', "", '"Frequency"\t"Data Trace Real"\t"Data Trace Imag"', *data]

    head = ["4294A REV1.11", '"DATE: Feb 03 2024"', "", f'"MEASURE PARAMETER: {parameter}"']
    head.append(f'"NUMBER of POINTS: {len(a) if points is None else points}"')
    return "\n".join([*head, *section("A", a), "", *section("B", b), ""])


R = [f"{n + 1.5:.6e}" for n in range(9)]
X = [f"{-n - 2.5:.6e}" for n in range(9)]


@pytest.mark.parametrize("parameter", ["IMPEDANCE R X", "RESISTANCE REACTANCE", "R X"])
def test_native_resistance_and_reactance(tmp_path: Path, parameter: str) -> None:
    sweep = read_impedance(write(tmp_path, native(parameter, R, X).replace("\n", "\r\n")), "open")
    assert sweep.impedance_ohm[3] == 4.5 - 5.5j


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (native("IMPEDANCE MAG LS", R, X), "IMPEDANCE MAG LS"),
        (native("COMPLEX Z Y", R, X), "COMPLEX Z Y"),
        (native("", R, X), "R and X"),
        (native("R X", R, X, points=10), "10 points"),
        (native("R X", R, X[:-1]), "trace B has 8"),
        (native("R X", R, X).split('"TRACE: B"')[0], "trace B is missing"),
        (native("R X", R, X).replace("-1.050000e+01\t0.000000e+00", "-1.05"), "cut off"),
        (native("R X", R, X).replace("-1.050000e+01", "+9.91000e+37"), "not measured"),
        (native("R X", R, X).replace("-1.050000e+01\t0.0", "-1.050000e+01\t1.0"), "complex"),
        (native("R X", R, X).replace("TRACE: B", "TRACE: A"), "occurs twice"),
        (native("R X", R, X).replace("Data Trace", "Memory Trace"), "data trace"),
        (native("MAG PHASE (DEG)", X, R), "below 0"),
        (native("R X", R, X).replace("9.00000000000e+05", "9.10000000000e+05", 1), "same frequencies"),
        ("4294A REV1.11\n", "trace A is missing"),
    ],
)
def test_native_file_that_is_refused(tmp_path: Path, text: str, says: str) -> None:
    assert says in refusal(write(tmp_path, text))


@pytest.mark.parametrize("cut", [20, 300, 3000, 20000, 40000, 47000, 47426])
def test_native_file_cut_anywhere_is_refused(tmp_path: Path, cut: int) -> None:
    refusal(write(tmp_path, NATIVE.read_bytes()[:cut]))


# CSV variants

MAGNITUDE = np.abs(IMPEDANCE)
PHASE = np.angle(IMPEDANCE, deg=True)


@pytest.mark.parametrize(
    "titles",
    ["frequency_hz,impedance_ohm,phase_deg", "Frequency (Hz),|Z| (Ohm),Phase (deg)", "freq[Hz],Zmag [Ω],theta [°]"],
)
def test_magnitude_and_phase(tmp_path: Path, titles: str) -> None:
    lines = [f"{f!r},{m!r},{p!r}" for f, m, p in zip(*(a.tolist() for a in (FREQUENCY, MAGNITUDE, PHASE)), strict=True)]
    sweep = read_impedance(table(tmp_path, titles, *lines), "short")
    np.testing.assert_array_equal(sweep.frequency_hz, FREQUENCY)
    np.testing.assert_allclose(sweep.impedance_ohm, IMPEDANCE, rtol=1e-14)


@pytest.mark.parametrize("titles", ["freq_mhz,r_kohm,x_kohm", "Frequency (MHz),Z_re (kΩ),Z_im (kΩ)"])
def test_units_in_the_header(tmp_path: Path, titles: str) -> None:
    sweep = read_impedance(table(tmp_path, titles, *(f"{n + 1},0.5,-0.25" for n in range(8))), "short")
    assert sweep.span_hz == (1e6, 8e6)
    assert sweep.impedance_ohm[0] == 500 - 250j


def test_radians(tmp_path: Path) -> None:
    path = table(tmp_path, "frequency_hz,impedance_ohm,phase_rad", *(f"{n + 1},2,{np.pi / 2}" for n in range(8)))
    np.testing.assert_allclose(read_impedance(path, "short").impedance_ohm, 2j, atol=1e-15)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", ", ", " ; "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_delimiters_line_ends_and_byte_order_mark(tmp_path: Path, delimiter: str, end: str, mark: str) -> None:
    lines = [mark + HEAD.replace(",", delimiter), *(row.replace(",", delimiter) for row in rows()), ""]
    sweep = read_impedance(table(tmp_path, *lines, end=end), "short")
    assert sweep.impedance_ohm[2] == 3.25 - 2.5j


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_comma(tmp_path: Path, delimiter: str) -> None:
    lines = [row.replace(".", ",") for row in rows(delimiter=delimiter)]
    sweep = read_impedance(table(tmp_path, HEAD.replace(",", delimiter), *lines), "short")
    assert sweep.frequency_hz[0] == 1e5
    assert sweep.impedance_ohm[2] == 3.25 - 2.5j


def test_comments_metadata_blank_lines_and_extra_columns(tmp_path: Path) -> None:
    lines = ["# made by hand", "# motor: A17: left", "# temperature_c: 23.5", "", HEAD + ",sigma_relative,remark"]
    lines += [row + ',0.001,"a, b"' for row in rows()]
    lines.insert(8, "# operator: Ω")
    sweep = read_impedance(table(tmp_path, *lines, ",,,,"), "open")
    assert sweep.metadata["motor"] == "A17: left"
    assert sweep.metadata["temperature_c"] == 23.5
    assert sweep.metadata["operator"] == "Ω"
    assert sweep.sigma_relative is not None
    assert sweep.sigma_relative[4] == 0.001
    assert len(sweep) == 10


def test_column_names_in_a_comment(tmp_path: Path) -> None:
    assert len(read_impedance(table(tmp_path, "# " + HEAD, *rows()), "short")) == 10


def test_latin_1(tmp_path: Path) -> None:
    path = write(tmp_path, "\n".join(["# Prüfer: Jürgen", HEAD, *rows(), ""]).encode("latin-1"))
    assert read_impedance(path, "short").metadata["Prüfer"] == "Jürgen"


def test_header_text_cannot_command_a_terminal(tmp_path: Path) -> None:
    path = table(tmp_path, "# note: \x1b[31mred\u202e", '# json: "\\u001b[0m"', HEAD, *rows())
    metadata = read_impedance(path, "short").metadata
    assert metadata["note"] == "\\x1b[31mred\\u202e"
    assert metadata["json"] == "\\x1b[0m"


# Refusals


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ([HEAD, *rows(8), "900000.0,1.5"], ["line 10", "cut off"]),
        ([HEAD, *rows(8), "900000.0,1.5,"], ["line 10", "missing"]),
        ([HEAD, *rows(8), "900000.0,1.5,nan"], ["line 10", "reactance_ohm", "not a finite number"]),
        ([HEAD, *rows(8), "900000.0,-inf,1"], ["line 10", "resistance_ohm", "not a finite number"]),
        ([HEAD, *rows(8), "900000.0,1e999,1"], ["line 10", "not measured"]),
        ([HEAD, *rows(8), "900000.0,9.91E37,1"], ["line 10", "not measured"]),
        ([HEAD, *rows(8), "900000.0,-9.9e+37,1"], ["line 10", "not measured"]),
        ([HEAD, *rows(8), "900000.0,12 Ohm,1"], ["line 10", "12 Ohm"]),
        ([HEAD, *rows(8), "900000.0,1_000,1"], ["line 10", "1_000"]),
        ([HEAD, *rows(8), "900000.0,١,1"], ["line 10", "is not a number"]),
        ([HEAD, *rows(8), "900000.0,\x1b[31m,1"], ["line 10", "\\x1b[31m"]),
        ([HEAD, *rows(8), "850000.0,1.0,1", "840000.0,1.0,1"], ["line 11", "must increase"]),
        ([HEAD, *rows(8), "800000.0,1.0,1"], ["line 10", "occurs twice"]),
        ([HEAD, *rows(7)], ["at least 8 points, got 7"]),
        ([HEAD, *rows(8), "900000.0,0,0"], ["not measured"]),
        ([HEAD, "0,1,1", "0,1,1", *rows(8)], ["above 0 Hz"]),
        ([HEAD, "-5,1,1", *rows(8)], ["above 0 Hz"]),
        ([HEAD, *rows(8), "1,5,2,5,3,5"], ["line 10", "6 values for 3", "';'"]),
        ([HEAD.replace(",", ";"), *rows(8, ";"), "900000,0;1;1"], ["decimal comma", "decimal point"]),
        ([HEAD.replace(",", ";"), *("1,000,000;1;1" for _ in range(8))], ["line 2", "1,000,000"]),
        (["frequency_hz,resistance_ohm", *(r.rsplit(",", 1)[0] for r in rows())], ["found", "reactance_ohm"]),
        (["a,b,c", *rows()], ["a, b, c", "frequency_hz", "phase_deg"]),
        (["frequency,resistance_ohm,reactance_ohm", *rows()], ["'frequency' has no unit", "--unit frequency=Hz"]),
        (["time_s,resistance_ohm,reactance_ohm", *rows()], ["time_s", "frequency_hz"]),
        ([HEAD + ",r_ohm", *(r + ",1" for r in rows())], ["'r_ohm'", "keep one"]),
        (["frequency_hz,impedance_db,phase_deg", *rows()], ["decibel", "ohm"]),
        (["frequency_hz,|Z| (dBOhm),phase_deg", *rows()], ["decibel", "ohm"]),
        (["frequency_hz,s11_dbm,phase_deg", *rows()], ["decibel"]),
        (["frequency_hz,resistance_MOHM,reactance_ohm", *rows()], ["'MOHM' of column 'resistance_MOHM' may be milli or mega"]),
        (["frequency_hz,R[furlong],X[Ohm]", *rows()], ["the unit 'furlong' of column 'R[furlong]' is not known: use uOhm, mOhm, Ohm"]),
        (["frequency_hz,|Z| (Ohm),phase", *rows()], ["column 'phase' has no unit: add deg or rad"]),
        (["frequency_hz,impedance_ohm,phase_deg", *rows(8), "900000.0,-1,0"], ["line 10", "below 0"]),
        (["frequency_hz,impedance_ohm,phase_deg", *rows(8), "900000.0,1,361"], ["line 10", "full turn"]),
        (["frequency_hz,level_dbuv", *(f"{n},40" for n in range(1, 11))], ["emission spectrum"]),
        (rows(), ["line 1", "column names"]),
        ([HEAD], ["no numbers"]),
        (["# only", "# comments"], ["comments only"]),
        (["# termination: open", HEAD, *rows()], ["open sweep", "given as the short sweep"]),
        (["# points: 11", HEAD, *rows()], ["11 points", "10 rows", "cut off"]),
        ([HEAD + ",sigma_relative", *(r + ",-0.1" for r in rows())], ["sigma_relative"]),
        (["! made", "# MHZ Z MA R 50", *rows()], ["line 3", "1 values"]),
        (["!Agilent Technologies,E4990A", *rows()], ["END", "cut off"]),
        (["Type;ESR3;", "Version;2.28;"], ["spectrum of a receiver"]),
    ],
)
def test_bad_impedance_table(tmp_path: Path, lines: list[str], says: list[str]) -> None:
    message = refusal(table(tmp_path, *lines))
    for part in says:
        assert part in message


@pytest.mark.parametrize("lost", range(1, 12))
def test_file_cut_inside_the_last_number(tmp_path: Path, lost: int) -> None:
    lines = "\n".join([HEAD, *(f"{f:.6e},{z.real:.6e},{z.imag:.6e}" for f, z in zip(FREQUENCY, IMPEDANCE, strict=True))])
    read_impedance(write(tmp_path, lines), "short")
    assert "cut off" in refusal(write(tmp_path, lines[:-lost]))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "empty"),
        (b"\xef\xbb\xbf\r\n \n", "empty"),
        (bytes(range(256)) * 20, "binary"),
        (b"PK\x03\x04\x14\0\0\0\x08\0", "ZIP archive"),
        (b"\x01\x02\x03\x04\x05\x06", "binary"),
        ("\n".join([HEAD, *rows()]).encode("utf-16")[:-1], "damaged UTF-16"),
        ("\0".join([HEAD, *rows()]).encode("utf-16"), "binary"),
        ("\n".join(["# note: \u20ac\u2013", HEAD, *rows()]).encode("cp1252"), "UTF-8"),
    ],
)
def test_bytes_that_are_no_text(tmp_path: Path, content: bytes, says: str) -> None:
    assert says in refusal(write(tmp_path, content))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_text_in_the_encodings_of_usual_programs(tmp_path: Path, encoding: str) -> None:
    text = "\r\n".join(["# Gerät: Prüfling", HEAD, *rows(), ""])
    sweep = read_impedance(write(tmp_path, text.encode(encoding)), "short")
    np.testing.assert_array_equal(sweep.impedance_ohm, read_impedance(write(tmp_path, text.encode()), "short").impedance_ohm)


def test_files_that_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "no such file" in refusal(tmp_path / "missing.csv")
    assert "folder" in refusal(tmp_path)
    assert "not an ordinary file" in refusal(Path("/dev/null"))
    os.mkfifo(tmp_path / "pipe")
    assert "not an ordinary file" in refusal(tmp_path / "pipe")
    with pytest.raises(BadInput, match="not a file name"):
        read_impedance("a\0b", "short")

    def forbidden(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    good = table(tmp_path, HEAD, *rows())
    monkeypatch.setattr("builtins.open", forbidden)
    assert "Permission denied" in refusal(good)


def test_file_that_is_too_large(tmp_path: Path) -> None:
    path = tmp_path / "huge.csv"
    with open(path, "wb") as file:
        file.truncate(MAXIMUM_BYTES + 1)
    assert "200 MB" in refusal(path)


def test_unknown_termination(tmp_path: Path) -> None:
    assert "use 'short' or 'open'" in refusal(table(tmp_path, HEAD, *rows()), "middle")


def test_long_lines_are_read_in_reasonable_work(tmp_path: Path) -> None:
    # Each of these would take hours with a pattern that backtracks.
    refusal(write(tmp_path, "#" + " " * 300_000 + "\n"))
    refusal(write(tmp_path, "! " * 300_000 + "\n"))
    refusal(write(tmp_path, '4294A\n"a:' + " " * 300_000 + "\n"))
    refusal(write(tmp_path, '"' * 300_000 + "\n"))


# Spectra

LEVELS = [f"{150_000 + 4500 * n},{40 - n / 8}" for n in range(10)]


def test_spectrum(tmp_path: Path) -> None:
    path = table(tmp_path, "# detector: quasi-peak", "# rbw_hz: 9000", "# lisn: 5 uH", "frequency_hz,level_dbuv", *LEVELS)
    spectrum = read_spectrum(path)
    assert (spectrum.detector, spectrum.resolution_bandwidth_hz) == ("quasi-peak", 9e3)
    assert spectrum.level_dbuv[2] == 39.75
    assert spectrum.metadata == {"lisn": "5 uH", "source": "sweep.csv", "format": "csv"}


@pytest.mark.parametrize(("written", "detector"), [("QP", "quasi-peak"), ("Max Peak", "peak"), ("AVG", "average")])
def test_spectrum_variants(tmp_path: Path, written: str, detector: str) -> None:
    lines = [f"{0.15 + n / 100:.2f};{30 + n},5".replace(".", ",") for n in range(9)]
    spectrum = read_spectrum(table(tmp_path, f"# detector: {written}", "Frequency (MHz);Level (dBµV)", *lines))
    assert spectrum.detector == detector
    assert spectrum.frequency_hz[0] == 150e3
    assert spectrum.level_dbuv[0] == 30.5
    assert spectrum.metadata["rbw_assumed"] is True


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (["frequency_hz,level_dbuv", *LEVELS], "detector"),
        (["# detector: loud", "frequency_hz,level_dbuv", *LEVELS], "loud"),
        (["# detector: peak", "# rbw_hz: wide", "frequency_hz,level_dbuv", *LEVELS], "bandwidth"),
        (["# detector: peak", "# rbw_hz: 0", "frequency_hz,level_dbuv", *LEVELS], "bandwidth"),
        (["# detector: peak", "frequency_hz,level_db", *LEVELS], "dBuV"),
        (["# detector: peak", "frequency_hz,level_dbuv", "1,nan", *LEVELS], "line 3"),
        (["# detector: peak", "frequency_hz,level_dbuv", *LEVELS, LEVELS[0]], "must increase"),
        (["# detector: peak", "frequency_hz,level_dbuv", "1,300", *LEVELS], "dBuV"),
        (["# detector: peak", "frequency_hz,level_dbuv,overload", *(row + ",2" for row in LEVELS)], "write 0 or 1"),
        ([HEAD, *rows()], "impedance sweep"),
    ],
)
def test_bad_spectrum(tmp_path: Path, lines: list[str], says: str) -> None:
    assert says in refusal(table(tmp_path, *lines), "spectrum")


def test_native_sweep_is_no_spectrum() -> None:
    assert "4294A" in refusal(NATIVE, "spectrum")


# Round trips

finite = st.floats(min_value=-1e14, max_value=1e14, allow_nan=False).filter(bool)
scalars = st.one_of(st.text(max_size=20), st.integers(-(2**60), 2**60), finite, st.booleans(), st.none())


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    # Frequencies closer than a millionth count as one when a user's file is read.
    frequency=st.lists(st.floats(1e-3, 1e12), min_size=8, max_size=15, unique=True).map(sorted).filter(lambda f: min(np.diff(f) / f[1:]) > 1e-6),
    resistance=finite.filter(lambda ohm: abs(ohm) >= LEAST_OHM),
    reactance=finite,
    metadata=st.dictionaries(st.text(max_size=10).filter(str.strip), st.one_of(scalars, st.lists(scalars, max_size=3))),
)
def test_sweep_round_trip_is_exact(
    tmp_path: Path, frequency: list[float], resistance: float, reactance: float, metadata: dict[str, object]
) -> None:
    metadata = {k: v for k, v in metadata.items() if clean_text(k) == k and k == k.strip()}
    sweep = ImpedanceSweep("open", frequency, np.full(len(frequency), complex(resistance, reactance)), 1e-3, metadata)
    path = tmp_path / "out.csv"
    write_impedance_csv(path, sweep)
    again = read_impedance(path, "open")
    np.testing.assert_array_equal(again.frequency_hz, sweep.frequency_hz)
    np.testing.assert_array_equal(again.impedance_ohm, sweep.impedance_ohm)
    np.testing.assert_array_equal(again.sigma_relative, sweep.sigma_relative)
    for key, value in metadata.items():
        if key not in ("source", "format", "points", "termination") and "\\" not in repr(value):
            assert again.metadata[key] == value
            assert type(again.metadata[key]) is type(value)


@pytest.mark.parametrize("key", ["null", "0E0", "12", "a:b", "#x", '"q"', "osc level", "-"])
@pytest.mark.parametrize("value", ["", "5", "null", " blank ", "a: b", '"', "[1", 5, 0.1, None, True, [1, {"a": "Ω"}]])
def test_metadata_keep_key_value_and_type(tmp_path: Path, key: str, value: object) -> None:
    path = tmp_path / "out.csv"
    write_impedance_csv(path, ImpedanceSweep("short", FREQUENCY, IMPEDANCE, None, {key: value}))
    again = read_impedance(path, "short").metadata
    assert again == {key: value, "source": "out.csv", "format": "csv", "read_as": "R and X"}
    assert type(again[key]) is type(value)


def test_native_sweep_survives_as_csv(tmp_path: Path) -> None:
    sweep = read_impedance(NATIVE, "short")
    write_impedance_csv(tmp_path / "copy.csv", sweep)
    again = read_impedance(tmp_path / "copy.csv", "short")
    np.testing.assert_array_equal(again.impedance_ohm, sweep.impedance_ohm)
    assert again.metadata["BW"] == "5"
    assert again.metadata["header_source"] == NATIVE.name


@pytest.mark.parametrize("marked", [False, True])
def test_spectrum_round_trip(tmp_path: Path, marked: bool) -> None:
    overload = np.arange(12) == 3 if marked else None
    spectrum = Spectrum("average", FREQUENCY, 40 + np.sqrt(np.arange(12)), 200.0, overload, {"lisn": {"uH": 5}})
    path = tmp_path / "spectrum.csv"
    write_spectrum_csv(path, spectrum)
    assert ("overload" in path.read_text()) is marked
    again = read_spectrum(path)
    np.testing.assert_array_equal(again.level_dbuv, spectrum.level_dbuv)
    np.testing.assert_array_equal(again.overload, spectrum.overload)
    assert again.resolution_bandwidth_hz == 200
    assert again.metadata["lisn"] == {"uH": 5}


@pytest.mark.parametrize("lost_lines", [1, 2, 5])
def test_own_file_that_lost_whole_rows_is_refused(tmp_path: Path, lost_lines: int) -> None:
    path = tmp_path / "out.csv"
    write_impedance_csv(path, ImpedanceSweep("short", np.arange(1, 21) * 1e5, np.full(20, 5 + 1j)))
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-lost_lines]))
    assert "cut off" in refusal(path)


# Anything at all

SEEDS = [
    MOTOR.read_bytes()[:600],
    native("R X", R, X).encode(),
    "\n".join(["# points: 10", HEAD, *rows(), ""]).encode(),
    "\n".join(["# detector: peak", "# rbw_hz: 9000", "frequency_hz;level_dbuv", *LEVELS]).replace(",", ";").encode(),
]
PIECES = [b"", b"\0", b"\n", b"\r", b",", b";", b"\t", b'"', b"#", b":", b"nan", b"1e999", b"9.91E37", b"\xff", b"{" * 5000]


def read_or_refuse(path: Path) -> None:
    for read in (lambda: read_impedance(path, "short"), lambda: read_spectrum(path)):
        message = ""
        try:
            assert len(read()) >= 2
        except BadInput as error:
            message = str(error)
        assert clean_text(message) == message


@pytest.mark.slow
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.one_of(st.binary(max_size=300), st.text(max_size=200).map(lambda t: t.encode("utf-8", "replace"))))
def test_random_bytes_are_read_or_refused(tmp_path: Path, data: bytes) -> None:
    read_or_refuse(write(tmp_path, data))


@pytest.mark.slow
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.sampled_from(SEEDS),
    changes=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 8), st.one_of(st.sampled_from(PIECES), st.binary(max_size=4))),
        min_size=1,
        max_size=4,
    ),
)
def test_mutated_files_are_read_or_refused(tmp_path: Path, seed: bytes, changes: list[tuple[float, int, bytes]]) -> None:
    for place, length, piece in changes:
        start = int(place * len(seed))
        seed = seed[:start] + piece + seed[start + length :]
    read_or_refuse(write(tmp_path, seed))


def test_clean_text() -> None:
    assert clean_text("plain Ω µ") == "plain Ω µ"
    assert clean_text("a\nb\x1b\x9b\u202e\u2028\ud800") == "a\\x0ab\\x1b\\x9b\\u202e\\u2028\\ud800"
    assert clean_text("x" * 50, 10) == "x" * 7 + "..."
