"""Tables with more columns than two: whose phase it is, and whether they describe one impedance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from motoremi.data.files import read_impedance
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput

FREQUENCY = np.geomspace(150e3, 30e6, 24)
S = 2j * np.pi * FREQUENCY
WINDING = 1 / (1 / (10 + S * 12e-6) + S * 22e-12)
Z = WINDING + 40 + 1 / (S * 600e-12)
G = (Z - 50) / (Z + 50)
COLUMNS = {
    "Frequency(Hz)": FREQUENCY,
    "Return Loss(dB)": 20 * np.log10(np.abs(G)),
    "S11 (dB)": 20 * np.log10(np.abs(G)),
    "S11(DEG)": np.angle(G, deg=True),
    "|S11|": np.abs(G),
    "Phase(deg)": np.angle(G, deg=True),
    "Return Phase(deg)": np.angle(G, deg=True),
    "Rs(Ohm)": Z.real,
    "SWR": (1 + np.abs(G)) / (1 - np.abs(G)),
    "Xs(Ohm)": Z.imag,
    "R(Ohm)": Z.real,
    "X(Ohm)": Z.imag,
    "|Z|(Ohm)": np.abs(Z),
    "Theta(deg)": np.angle(Z, deg=True),
    "Y(S)": 1 / np.abs(Z),
    "theta(deg)": -np.angle(Z, deg=True),
    "G(S)": (1 / Z).real,
    "B(S)": (1 / Z).imag,
}


def table(folder: Path, titles: str, digits: str = ".9g", **other: np.ndarray) -> Path:
    """A table of these columns, in which others may stand in place of some."""
    names = titles.split(",")
    rows = zip(*(other.get(name, COLUMNS.get(name)) for name in names), strict=True)
    path = folder / "table.csv"
    path.write_text("\n".join([titles, *(",".join(f"{cell:{digits}}" for cell in row) for row in rows)]) + "\n")
    return path


@pytest.mark.parametrize(
    ("titles", "read_as"),
    [
        ("Frequency(Hz),Return Loss(dB),Phase(deg),Rs(Ohm),SWR,Xs(Ohm),|Z|(Ohm)", "Rs and Xs"),
        ("Frequency(Hz),Return Loss(dB),Phase(deg),Rs(Ohm),SWR,Xs(Ohm),|Z|(Ohm),Theta(deg)", "|Z| and phase"),
        ("Frequency(Hz),Return Loss(dB),Return Phase(deg),Rs(Ohm),SWR,Xs(Ohm),|Z|(Ohm),Theta(deg)", "|Z| and phase"),
        ("Frequency(Hz),Return Loss(dB),Phase(deg),Rs(Ohm),Xs(Ohm),|Z|(Ohm),R(Ohm),X(Ohm)", "R and X"),
        ("Frequency(Hz),S11 (dB),Phase(deg),|Z|(Ohm)", "S11 in dB and its phase, in 50 Ohm"),
        ("Frequency(Hz),|S11|,Phase(deg),|Z|(Ohm)", "S11 magnitude and phase, in 50 Ohm"),
        ("Frequency(Hz),S11 (dB),S11(DEG)", "S11 in dB and its phase, in 50 Ohm"),
        ("Frequency(Hz),Return Loss(dB),Phase(deg)", "S11 as return loss and phase, in 50 Ohm"),
        ("Frequency(Hz),Y(S),theta(deg)", "|Y| and phase"),
        ("Frequency(Hz),|Z|(Ohm),Theta(deg),Y(S),G(S),B(S)", "|Z| and phase"),
    ],
)
def test_a_phase_belongs_to_the_magnitude_beside_it(tmp_path: Path, titles: str, read_as: str) -> None:
    sweep = read_impedance(table(tmp_path, titles), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-5)  # nine digits of S11, a factor of 1e4 lost where it is near 1
    assert sweep.metadata["read_as"] == read_as
    # The same columns from memory, in which every digit is given.
    frame = pd.DataFrame({name: COLUMNS[name] for name in titles.split(",")})
    np.testing.assert_allclose(ImpedanceSweep.from_frame("open", frame).impedance_ohm, Z, rtol=1e-9)


def test_return_loss_may_have_either_sign(tmp_path: Path) -> None:
    path = table(tmp_path, "Frequency(Hz),Return Loss(dB),Phase(deg)", **{"Return Loss(dB)": -20 * np.log10(np.abs(G))})
    np.testing.assert_allclose(read_impedance(path, "open").impedance_ohm, Z, rtol=1e-5)


def test_columns_without_units_are_not_passed_over_for_a_reflection(tmp_path: Path) -> None:
    named = {"Rs": Z.real, "Xs": Z.imag, "|Z|": np.abs(Z), "Theta": np.angle(Z, deg=True)}
    path = table(tmp_path, "Frequency(Hz),Return Loss(dB),Phase(deg),Rs,SWR,Xs,|Z|,Theta", **named)
    with pytest.raises(BadInput, match=r"--unit Rs=Ohm --unit Xs=Ohm --unit '\|Z\|=Ohm' --unit Theta=deg"):
        read_impedance(path, "open")
    sweep = read_impedance(path, "open", units={"Rs": "Ohm", "Xs": "Ohm", "|Z|": "Ohm", "Theta": "deg"})
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-5)


@pytest.mark.parametrize(
    ("titles", "wrong", "values"),
    [
        ("Frequency(Hz),SWR,|Z|(Ohm),Phase(deg),R(Ohm)", "R(Ohm)", Z.real),
        ("Frequency(Hz),R(Ohm),X(Ohm),|Z|(Ohm)", "|Z|(Ohm)", 1.05 * np.abs(Z)),
        ("Frequency(Hz),R(Ohm),X(Ohm),Theta(deg)", "Theta(deg)", -np.angle(Z, deg=True)),
        ("Frequency(Hz),R(Ohm),X(Ohm),B(S)", "B(S)", -(1 / Z).imag),
        ("Frequency(Hz),R(Ohm),X(Ohm),S11 (dB)", "S11 (dB)", 20 * np.log10(np.abs((Z - 300) / (Z + 300)))),
        ("Frequency(Hz),S11 (dB),Phase(deg),|Z|(Ohm)", "|Z|(Ohm)", np.abs(Z[::-1])),
    ],
)
def test_columns_that_contradict_each_other_are_refused(tmp_path: Path, titles: str, wrong: str, values: np.ndarray) -> None:
    with pytest.raises(BadInput, match=r"line [0-9]+: .* contradict each other: it says .* follows; remove") as caught:
        read_impedance(table(tmp_path, titles, **{wrong: values}), "open")
    assert repr(wrong) in str(caught.value)


def test_one_wrong_cell_is_found(tmp_path: Path) -> None:
    path = table(tmp_path, "Frequency(Hz),R(Ohm),X(Ohm),|Z|(Ohm)")
    lines = path.read_text().splitlines()
    cells = lines[9].split(",")
    lines[9] = ",".join([cells[0], cells[1], f"{10 * float(cells[2]):.9g}", cells[3]])
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(BadInput, match="line 10: R and X and the column"):
        read_impedance(path, "open")


@pytest.mark.parametrize("digits", [".2e", ".3g", ".1f"])
def test_rounding_is_no_contradiction(tmp_path: Path, digits: str) -> None:
    titles = "Frequency(Hz),R(Ohm),X(Ohm),|Z|(Ohm),Theta(deg),S11 (dB),S11(DEG),Y(S),G(S),B(S)"
    path = table(tmp_path, titles, digits)
    # Frequencies in full.
    lines = [line.partition(",")[2] for line in path.read_text().splitlines()]
    path.write_text("\n".join(f"{f},{line}" for f, line in zip(["Frequency(Hz)", *FREQUENCY], lines, strict=True)) + "\n")
    assert len(read_impedance(path, "open")) == FREQUENCY.size


def test_reflections_in_75_ohm_beside_r_and_x(tmp_path: Path) -> None:
    other = (Z - 75) / (Z + 75)
    named = {"S11 (dB)": 20 * np.log10(np.abs(other)), "S11(DEG)": np.angle(other, deg=True)}
    path = table(tmp_path, "Frequency(Hz),R(Ohm),X(Ohm),S11 (dB),S11(DEG)", **named)
    np.testing.assert_allclose(read_impedance(path, "open").impedance_ohm, Z, rtol=1e-8)


def test_a_column_that_is_not_used_may_be_incomplete(tmp_path: Path) -> None:
    path = table(tmp_path, "Frequency(Hz),R(Ohm),X(Ohm),|Z|(Ohm)")
    lines = path.read_text().splitlines()
    lines[5] = ",".join([*lines[5].split(",")[:3], "nan"])
    path.write_text("\n".join(lines) + "\n")
    assert len(read_impedance(path, "open")) == FREQUENCY.size
