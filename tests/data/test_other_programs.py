"""Exports of other programs: traces of a 4294A, titles of a ZNB and of LCR meters, AntScope, LTspice, ZView, Gamry and .zma."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from motoremi.data.files import read_impedance
from motoremi.data.recognise import recognise
from motoremi.errors import BadInput

FREQUENCY = np.geomspace(150e3, 30e6, 24)
W = 2 * np.pi * FREQUENCY
Z = 1 / (1 / (10 + 1j * W * 12e-6) + 1j * W * 22e-12) + 40 + 1 / (1j * W * 600e-12)
Y = 1 / Z
G = (Z - 50) / (Z + 50)
DEGREES = np.angle(Z, deg=True)


def rows(template: str, *columns: np.ndarray) -> list[str]:
    return [template.format(*row) for row in zip(*columns, strict=True)]


def write(folder: Path, *lines: str, name: str = "file.txt", encoding: str = "utf-8") -> Path:
    path = folder / name
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return path


def check(path: Path, kind: str, read_as: str, rtol: float = 1e-6) -> None:
    sweep = read_impedance(path, "open")
    np.testing.assert_allclose(sweep.frequency_hz, FREQUENCY, rtol=1e-8)
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=rtol)
    assert (sweep.metadata["format"], sweep.metadata["read_as"]) == (kind, read_as)
    assert recognise(path.read_bytes(), path.name).used_as == "open"


@pytest.mark.parametrize(
    ("parameter", "first", "second", "read_as"),
    [
        ("G-B", Y.real, Y.imag, "G and B"),
        ("ADMITTANCE G B", Y.real, Y.imag, "G and B"),
        ("CP-D", Y.imag / W, np.abs(Y.real / Y.imag), "Cp and D"),
        ("CP-G", Y.imag / W, Y.real, "Cp and G"),
        ("CP-RP", Y.imag / W, 1 / Y.real, "Cp and Rp"),
        ("CS-D", -1 / (W * Z.imag), np.abs(Z.real / Z.imag), "Cs and D"),
        ("CS-RS", -1 / (W * Z.imag), Z.real, "Cs and Rs"),
        ("LS-RS", Z.imag / W, Z.real, "Ls and Rs"),
        ("LP-RP", -1 / (W * Y.imag), 1 / Y.real, "Lp and Rp"),
        ("LP-G", -1 / (W * Y.imag), Y.real, "Lp and G"),
        ("LP-Q", -1 / (W * Y.imag), np.abs(Y.imag / Y.real), "Lp and Q"),
        ("LS-Q", Z.imag / W, np.abs(Z.imag / Z.real), "Ls and Q"),
        ("CS-Q", -1 / (W * Z.imag), np.abs(Z.imag / Z.real), "Cs and Q"),
        ("CP-Q", Y.imag / W, np.abs(Y.imag / Y.real), "Cp and Q"),
        ("ADMITTANCE MAG PHASE (DEG)", np.abs(Y), np.angle(Y, deg=True), "|Y| and phase"),
        ("ADMITTANCE MAG PHASE (RAD)", np.abs(Y), np.angle(Y), "|Y| and phase"),
    ],
)
def test_traces_of_a_4294a(tmp_path: Path, parameter: str, first: np.ndarray, second: np.ndarray, read_as: str) -> None:
    lines = ["4294A REV1.11", f'"MEASURE PARAMETER: {parameter}"', '"NUMBER of POINTS: 24"']
    for letter, values in (("A", first), ("B", second)):
        lines += ["", f'"TRACE: {letter}"', '"Frequency"\t"Data Trace Real"\t"Data Trace Imag"', *rows("{:.11e}\t{:.9e}\t0", FREQUENCY, values)]
    check(write(tmp_path, *lines), "4294a-ascii", read_as)


@pytest.mark.parametrize(
    ("titles", "columns", "read_as"),
    [
        ("freq[Hz];re:Trc1_S11;im:Trc1_S11", (G.real, G.imag), "S11 in 50 Ohm"),
        ("NO.,FREQ(Hz),Z(Ω),θr(rad)", (np.abs(Z), np.angle(Z)), "|Z| and phase"),
        ("NO.,FREQ(Hz),Z(Ω),θd(°)", (np.abs(Z), DEGREES), "|Z| and phase"),
        ("Freq (Hz),Zmod (ohm),Zphz (deg)", (np.abs(Z), DEGREES), "|Z| and phase"),
        ("Freq. [Hz],Primary |Z| [Ohm],Secondary Theta [deg]", (np.abs(Z), DEGREES), "|Z| and phase"),
    ],
)
def test_titles_of_meters_and_analysers(tmp_path: Path, titles: str, columns: tuple[np.ndarray, ...], read_as: str) -> None:
    separator = ";" if ";" in titles else ","
    number = [np.arange(24)] if titles.startswith("NO.") else []
    template = separator.join(["{:d}"] * len(number) + ["{:.9e}"] * 3)
    check(write(tmp_path, titles, *rows(template, *number, FREQUENCY, *columns)), "csv", read_as, 1e-5)


def test_impedance_traces_of_a_znb_need_a_unit(tmp_path: Path) -> None:
    path = write(tmp_path, "freq[Hz];re:Trc1_Z<-S11;im:Trc1_Z<-S11", *rows("{:.9e};{:.9e};{:.9e}", FREQUENCY, Z.real, Z.imag))
    with pytest.raises(BadInput, match="--unit 're:Trc1_Z<-S11=Ohm'"):
        read_impedance(path, "open")
    sweep = read_impedance(path, "open", units={"re:Trc1_Z<-S11": "Ohm", "im:Trc1_Z<-S11": "Ohm"})
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-6)


def test_antscope(tmp_path: Path) -> None:
    points = [{"fq": f / 1e6, "r": z.real, "x": z.imag} for f, z in zip(FREQUENCY.tolist(), Z.tolist(), strict=True)]
    text = json.dumps({"DotsNumber": 24, "Measurements": points})
    check(write(tmp_path, text, name="a.asd"), "rigexpert-asd", "R and X")
    for damaged in (text[:-30], json.dumps({"Measurements": [{"fq": 1, "r": 2}] * 9}), json.dumps({"Measurements": {"fq": 1}})):
        with pytest.raises(BadInput, match="points with fq, r and x are missing or cut off"):
            read_impedance(write(tmp_path, damaged, name="a.asd"), "open")
    for value in ("true", "null"):
        with pytest.raises(BadInput, match="is not a number"):
            read_impedance(write(tmp_path, text.replace(repr(float(Z[3].real)), value), name="a.asd"), "open")


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
def test_ltspice(tmp_path: Path, encoding: str) -> None:
    cartesian = rows("{:.11e}\t{:.9e},{:.9e}", FREQUENCY, Z.real, Z.imag)
    decibels = rows("{:.11e}\t({:.9e}dB,{:.9e}°)", FREQUENCY, 20 * np.log10(np.abs(Z)), DEGREES)
    check(write(tmp_path, "Freq.\tV(x)/I(V1)", *cartesian, encoding=encoding), "ltspice-text", "R and X")
    check(write(tmp_path, "Freq.\tV(x)/-I(V1)", *decibels, encoding=encoding), "ltspice-text", "|Z| and phase")
    other = ["Freq.\tV(x)\tV(x)/I(R1)", *rows("{:.11e}\t1,0\t{:.9e},{:.9e}", FREQUENCY, Z.real, Z.imag)]
    check(write(tmp_path, *other), "ltspice-text", "R and X")


def test_a_current_into_a_source_is_told(tmp_path: Path) -> None:
    path = write(tmp_path, "Freq.\tV(x)/I(V1)", *rows("{:.11e}\t{:.9e},{:.9e}", FREQUENCY, -Z.real, -Z.imag))
    assert any(text.startswith("the resistance is below 0 at 24 of 24") for text in read_impedance(path, "open").metadata["warnings"])


@pytest.mark.parametrize(
    ("names", "line", "says"),
    [
        ("Freq.\tV(x)", "1e5\t1,2", "holds the traces V.x.; export one trace that is an impedance"),
        ("Freq.\tV(x)/I(V1)\tV(y)/I(V1)", "1e5\t1,2\t1,2", "export one trace that is an impedance"),
        ("Freq.\tV(x)/I(V1)", "Step Information: R=1", "line 2: 1 values for 2 traces; export one step only"),
        ("Freq.\tV(x)/I(V1)", "1e5\t1", "line 2: '1' is not a complex number"),
        ("Freq.\tV(x)/I(V1)", "1e5\t1,2,3", "is not a complex number"),
        ("Freq.\tV(x)/I(V1)", "1e5\t1,2\n2e5\t(1dB,2°)", "line 3: .* is written otherwise than the numbers above it"),
    ],
)
def test_ltspice_that_is_refused(tmp_path: Path, names: str, line: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        read_impedance(write(tmp_path, names, line), "open")


def test_zview_and_gamry_from_high_to_low(tmp_path: Path) -> None:
    turned = (FREQUENCY[::-1], Z.real[::-1], Z.imag[::-1])
    head = ["ZPlot2 ASCII", "Freq(Hz)\tAmpl\tBias\tTime(Sec)\tZ'(a)\tZ''(b)\tGD\tErr\tRange", "End Comments"]
    check(write(tmp_path, *head, *rows("{:.9e}\t0\t0\t0\t{:.9e}\t{:.9e}\t0\t0\t0", *turned)), "zview", "R and X")
    names = ["\tPt\tTime\tFreq\tZreal\tZimag\tZsig\tZmod\tZphz", "\t#\ts\tHz\tohm\tohm\tV\tohm\t°"]
    polar = (np.abs(Z)[::-1], DEGREES[::-1])
    gamry = rows("\t{:d}\t0\t{:.9e}\t{:.9e}\t{:.9e}\t1\t{:.9e}\t{:.9e}", np.arange(24), *turned, *polar)
    check(write(tmp_path, "EXPLAIN", "TAG\tEISPOT", "ZCURVE\tTABLE", *names, *gamry), "csv", "R and X")


@pytest.mark.parametrize("comments", [("* FILE: woofer", "* Data: Impedance (ohms), Phase (degrees)", "*****"), ("* woofer at 27 mV",), ()])
def test_zma_whose_columns_have_no_names(tmp_path: Path, comments: tuple[str, ...]) -> None:
    path = write(tmp_path, *comments, *rows("{:11.6e} {:+.9e} {:+.9f}", FREQUENCY, np.abs(Z), DEGREES), name="motor.ZMA")
    sweep = read_impedance(path, "open")
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-6)
    assert (sweep.metadata["format"], sweep.metadata["read_as"]) == ("zma", "|Z| and phase")


@pytest.mark.parametrize("line", ["150000 12.5", "150000 12.5 phase", "150000 12.5 3.1 4"])
def test_zma_that_is_refused(tmp_path: Path, line: str) -> None:
    path = write(tmp_path, "* motor", *rows("{:.9e} {:.9e} {:.9f}", FREQUENCY, np.abs(Z), DEGREES), line, name="motor.zma")
    with pytest.raises(BadInput, match=r"line 26: three numbers are needed"):
        read_impedance(path, "open")
