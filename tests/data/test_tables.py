"""Tables as programs write them: several sweeps in one, from high to low, with text below, with decimal commas in quotes, with signed losses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi
from conftest import simulated_sweeps

from motoremi.data.files import read_impedance, read_impedances, read_spectra
from motoremi.data.session import SessionWriter, load
from motoremi.errors import BadInput

FREQUENCY = np.geomspace(150e3, 30e6, 24)
W = 2 * np.pi * FREQUENCY
WINDING = 1 / (1 / (10 + 1j * W * 12e-6) + 1j * W * 22e-12)
Z = WINDING + 40 + 1 / (1j * W * 600e-12)
HEAD = "frequency_hz,resistance_ohm,reactance_ohm"


def lines(*columns: np.ndarray, separator: str = ",") -> list[str]:
    return [separator.join(f"{cell:.9g}" for cell in row) for row in zip(*columns, strict=True)]


def table(folder: Path, *text: str, name: str = "table.csv") -> Path:
    path = folder / name
    path.write_text("\n".join(text) + "\n")
    return path


# Several sweeps in one table


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    """All sweeps of a session in one table, as `export --csv` writes it."""
    with SessionWriter.create(tmp_path / "first", {"title": "test"}) as writer:
        for seed in (1, 2, 3):
            for sweep in simulated_sweeps(seed)[0]:
                writer.add_sweep(sweep)
        writer.close("done")
    assert motoremi("export", tmp_path / "first", "--csv", tmp_path / "all.csv").returncode == 0
    return tmp_path / "all.csv"


@pytest.mark.slow
def test_an_exported_table_is_imported_again(tmp_path: Path, exported: Path) -> None:
    done = motoremi("import", tmp_path / "again", "--short", exported, "--open", exported, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(json.loads(done.stdout)["sweeps"]) == len(load(tmp_path / "first").sweeps)
    for termination in ("short", "open"):
        first, again = ([one for one in load(tmp_path / name).sweeps if one.termination == termination] for name in ("first", "again"))
        for one, other in zip(first, again, strict=True):
            np.testing.assert_array_equal(other.frequency_hz, one.frequency_hz)
            np.testing.assert_array_equal(other.impedance_ohm, one.impedance_ohm)


def test_one_sweep_is_not_chosen_silently(exported: Path) -> None:
    with pytest.raises(BadInput, match=r"its table holds [0-9]+ open sweeps; motoremi import and read_impedances read them all"):
        read_impedance(exported, "open")


def test_terminations_and_conditions_of_a_table(tmp_path: Path) -> None:
    head = f"termination,condition,condition_value,condition_unit,{HEAD}"
    rows = lines(FREQUENCY, Z.real, Z.imag)
    path = table(tmp_path, head, *(f"open,,,,{row}" for row in rows), *(f"open,second-temperature,53.0,degC,{row}" for row in rows))
    plain, warm = read_impedances(path, "open")
    assert plain.condition is None
    assert str(warm.condition) == "second-temperature=53degC"
    np.testing.assert_allclose(warm.impedance_ohm, Z, rtol=1e-8)
    with pytest.raises(BadInput, match="none of its rows is of the short sweep"):
        read_impedances(path, "short")
    # A column of that name with other words says nothing.
    other = table(tmp_path, f"termination,{HEAD}", *(f"frame,{row}" for row in rows))
    np.testing.assert_allclose(read_impedance(other, "short").impedance_ohm, Z, rtol=1e-8)


# The order of rows


def test_rows_from_high_to_low_are_turned_round(tmp_path: Path) -> None:
    rows = lines(FREQUENCY, Z.real, Z.imag)[::-1]
    sweep = read_impedance(table(tmp_path, HEAD, *rows), "open")
    np.testing.assert_allclose(sweep.frequency_hz, FREQUENCY, rtol=1e-8)
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-8)
    assert sweep.metadata["changes"] == ["measured from high to low frequencies: rows turned round"]
    with_zero = read_impedance(table(tmp_path, HEAD, *rows, "0,1,1"), "open")
    assert with_zero.metadata["changes"][1] == "the row at 0 Hz is left out"
    np.testing.assert_allclose(with_zero.frequency_hz, FREQUENCY, rtol=1e-8)


@pytest.mark.parametrize("at", [1, 12, 22])
def test_only_rows_that_fall_throughout_are_turned_round(tmp_path: Path, at: int) -> None:
    rows = lines(FREQUENCY, Z.real, Z.imag)[::-1]
    rows[at], rows[at + 1] = rows[at + 1], rows[at]
    with pytest.raises(BadInput, match="frequencies must increase"):
        read_impedance(table(tmp_path, HEAD, *rows), "open")
    rows = lines(FREQUENCY, Z.real, Z.imag)[::-1]
    rows.insert(at, rows[at])
    with pytest.raises(BadInput, match="frequencies must increase"):
        read_impedance(table(tmp_path, HEAD, *rows), "open")


# Text below the rows, and decimal commas


@pytest.mark.parametrize("end", [["End of sweep"], ["", "Operator: A. Engineer", "---", "Checked,by,B"]])
def test_text_below_the_rows_is_left_out_and_told(tmp_path: Path, end: list[str]) -> None:
    told = next(line for line in end if line)
    text = [line for line in end if line != "---"]
    sweep = read_impedance(table(tmp_path, HEAD, *lines(FREQUENCY, Z.real, Z.imag), *text), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-8)
    assert sweep.metadata["changes"] == [f"the text below the rows is left out ({told!r})"]


@pytest.mark.parametrize("end", ["4e7", "4e7,", "4e7,1,", "nan,nan,nan", "Mean,1,2", "---", "4.0e", "-"])
def test_what_may_be_part_of_a_row_is_not_left_out(tmp_path: Path, end: str) -> None:
    with pytest.raises(BadInput):
        read_impedance(table(tmp_path, HEAD, *lines(FREQUENCY, Z.real, Z.imag), end), "open")


def test_text_below_a_spectrum_is_told(tmp_path: Path) -> None:
    path = table(tmp_path, "# detector: peak", "frequency_hz,level_dbuv", *(f"{f:.0f},40.5" for f in FREQUENCY), "End")
    (spectrum,) = read_spectra(path)
    assert len(spectrum) == FREQUENCY.size
    assert "the text below the rows is left out ('End')" in spectrum.metadata["changes"]


def test_decimal_commas_in_quotes(tmp_path: Path) -> None:
    rows = [",".join(f'"{cell:.6e}"'.replace(".", ",") for cell in row) for row in zip(FREQUENCY, Z.real, Z.imag, strict=True)]
    sweep = read_impedance(table(tmp_path, HEAD, *rows), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-6)
    with pytest.raises(BadInput, match="a decimal comma, but line 2 has a decimal point"):
        read_impedance(table(tmp_path, HEAD, *(f'"{f:,.0f}",1.5,2.5' for f in range(150_000, 158_000, 1000))), "open")


# A resistance below 0


@pytest.mark.parametrize(
    ("titles", "element", "loss"),
    [
        ("Ls (H),Q", Z.imag / W, Z.imag / Z.real),
        ("Cs (F),D", -1 / (W * Z.imag), -Z.real / Z.imag),
        ("Cs (F),D", -1 / (W * Z.imag), Z.real / Z.imag),
        ("Cp (F),D", (1 / Z).imag / W, (1 / Z).real / (1 / Z).imag),
        ("Lp (H),Q", -1 / (W * (1 / Z).imag), Z.imag / Z.real),
    ],
)
def test_losses_with_the_sign_of_the_reactance(tmp_path: Path, titles: str, element: np.ndarray, loss: np.ndarray) -> None:
    assert np.any(loss < 0)
    sweep = read_impedance(table(tmp_path, f"frequency_hz,{titles}", *lines(FREQUENCY, element, loss)), "open")
    np.testing.assert_allclose(sweep.impedance_ohm, Z, rtol=1e-6)
    assert f"is below 0 at {np.sum(loss < 0)} points, with the sign of the reactance; used without it" in sweep.metadata["changes"][0]


@pytest.mark.parametrize(
    ("impedance", "told"),
    [(-np.conj(Z), True), (Z - 2 * Z.real * (FREQUENCY > 20e6), True), (Z, False), (Z * np.exp(-0.02j), False), (0.001j * W * 1e-6, False)],
)
def test_a_resistance_below_0_is_told(tmp_path: Path, impedance: np.ndarray, told: bool) -> None:
    sweep = read_impedance(table(tmp_path, HEAD, *lines(FREQUENCY, impedance.real, impedance.imag)), "open")
    warnings = [text for text in sweep.metadata.get("warnings", []) if text.startswith("the resistance is below 0")]
    assert bool(warnings) is told
    if told:
        assert f"below 0 at {np.sum(impedance.real < 0)} of 24 points" in warnings[0]


def test_a_loss_below_0_beside_one_element_is_told(tmp_path: Path) -> None:
    path = table(tmp_path, "frequency_hz,Cs (F),D", *lines(FREQUENCY, np.full(24, 1e-10), np.full(24, -0.02)))
    assert any("the resistance is below 0 at 24 of 24 points" in text for text in read_impedance(path, "open").metadata["warnings"])


# The header


def test_an_accuracy_that_is_none_has_an_example_of_one(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"cannot read 'good' as a quantity in % \(write for example '2.5 %'\)"):
        read_impedance(table(tmp_path, "# accuracy_percent: good", HEAD, *lines(FREQUENCY, Z.real, Z.imag)), "open")
