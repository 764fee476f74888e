"""What `motoremi import` does to sweeps beyond reading them: repeated frequencies, a band, a stated accuracy, a fixture."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from motoremi.cli.app import app
from motoremi.cli.arguments import expanded
from motoremi.data.files import read_impedance
from motoremi.data.measurement import Measurement
from motoremi.data.session import load
from motoremi.errors import BadInput

FREQUENCY = np.geomspace(100e3, 100e6, 31)
IMPEDANCE = 10 + 2j * np.pi * FREQUENCY * 12e-6


def table(path: Path, frequency: np.ndarray, impedance: np.ndarray, head: str = "") -> Path:
    lines = [f"{f!r},{z.real!r},{z.imag!r}\n" for f, z in zip(frequency.tolist(), impedance.tolist(), strict=True)]
    path.write_text(head + "frequency_hz,resistance_ohm,reactance_ohm\n" + "".join(lines))
    return path


def touchstone(path: Path, frequency: np.ndarray, impedance: np.ndarray) -> Path:
    s = (impedance - 50) / (impedance + 50)
    lines = [f"{f!r} {x.real!r} {x.imag!r}\n" for f, x in zip(frequency.tolist(), s.tolist(), strict=True)]
    path.write_text("# HZ S RI R 50\n" + "".join(lines))
    return path


@pytest.fixture
def short(tmp_path: Path) -> Path:
    return table(tmp_path / "short.csv", FREQUENCY, IMPEDANCE)


def imported(tmp_path: Path, *arguments: object) -> str:
    """What the command says of files that become the session `s`."""
    words = expanded(["import", str(tmp_path / "s"), *(str(a) for a in arguments)])
    result = CliRunner().invoke(app, words)
    if result.exception is not None:
        raise result.exception
    return result.stdout


def twice(row: int, step_hz: float, factor: complex) -> tuple[np.ndarray, np.ndarray]:
    """The sweep with one row behind itself, at nearly its frequency and with nearly its value."""
    return np.insert(FREQUENCY, row + 1, FREQUENCY[row] + step_hz), np.insert(IMPEDANCE, row + 1, IMPEDANCE[row] * factor)


@pytest.mark.parametrize("write", [table, touchstone])
@pytest.mark.parametrize("step_hz", [0.0, 0.25])
def test_rows_of_one_frequency_are_averaged(tmp_path: Path, write, step_hz: float) -> None:
    sweep = read_impedance(write(tmp_path / "file", *twice(20, step_hz, 1.0003)), "short")
    np.testing.assert_allclose(np.delete(sweep.frequency_hz, 20), np.delete(FREQUENCY, 20), rtol=1e-15)
    assert sweep.frequency_hz[20] == pytest.approx(FREQUENCY[20] + step_hz / 2, rel=1e-15)
    assert sweep.impedance_ohm[20] == pytest.approx(IMPEDANCE[20] * 1.00015, rel=1e-9)  # double precision through S of 1 - 1e-3
    (told,) = sweep.metadata["changes"]
    assert told == f"{sweep.frequency_hz[20] / 1e6:.9g} MHz occurs twice, values up to 0.03 % apart: averaged"


def test_stated_noise_of_averaged_rows_is_the_larger(tmp_path: Path) -> None:
    lines = [f"{n + 1},5,{n},{1e-3 * (n + 1)}" for n in range(9)]
    path = tmp_path / "file"
    path.write_text("\n".join(["frequency_hz,resistance_ohm,reactance_ohm,sigma_relative", *lines, "9,5,8,0.02", ""]))
    sweep = read_impedance(path, "short")
    assert sweep.sigma_relative is not None
    np.testing.assert_allclose(sweep.sigma_relative, [*(1e-3 * np.arange(1, 9)), 0.02])


@pytest.mark.parametrize(
    ("factors", "says"),
    [((1.05,), "line 23: the frequency 10000000 Hz occurs twice, with values 4.8 % apart"), ((1.0, 1.0), "occurs more than twice")],
)
def test_rows_that_contradict_each_other_are_refused(tmp_path: Path, factors: tuple[float, ...], says: str) -> None:
    frequency, impedance = FREQUENCY, IMPEDANCE
    for factor in factors:
        frequency, impedance = np.insert(frequency, 21, frequency[20]), np.insert(impedance, 21, IMPEDANCE[20] * factor)
    with pytest.raises(BadInput, match=says):
        read_impedance(table(tmp_path / "file", frequency, impedance), "short")


def test_fine_steps_are_not_taken_for_repeats(tmp_path: Path) -> None:
    frequency = 30e6 + np.arange(31.0)
    sweep = read_impedance(table(tmp_path / "file", frequency, IMPEDANCE[0] * np.ones(31)), "short")
    np.testing.assert_array_equal(sweep.frequency_hz, frequency)


def test_tables_below_each_other_are_refused_as_such(tmp_path: Path, short: Path) -> None:
    both = tmp_path / "both.csv"
    both.write_text(short.read_text() * 2)
    with pytest.raises(BadInput, match=r"both\.csv, line \d+: the column names occur again, so the file holds several tables"):
        read_impedance(both, "short")


def test_band_accuracy_and_repeats_are_told_and_stored(tmp_path: Path, short: Path) -> None:
    open_ = table(tmp_path / "open.csv", *twice(20, 0.0, 1.0003))
    files = ("--short", short, "--open", open_)
    told = imported(tmp_path, *files, "--band", "150kHz:30MHz", "--accuracy", "2 %").splitlines()
    part, end = "points outside 150 kHz - 30 MHz left out", "accuracy stated: 2 %"
    assert told[0].startswith("short short.csv (csv, R and X): 23 points, ")
    assert told[0].endswith(f"Ohm; 8 of 31 {part}; {end}")
    assert told[1].endswith(f"Ohm; 8 of 32 {part}; 10 MHz occurs twice, values up to 0.03 % apart: averaged; {end}")
    for sweep in load(tmp_path / "s").sweeps:
        assert sweep.metadata["accuracy_percent"] == 2.0
        assert (sweep.frequency_hz >= 150e3).all()
        assert (sweep.frequency_hz <= 30e6).all()
    again = json.loads(imported(tmp_path / "again", *files, "--band", "100k:100M", "--json"))
    assert "changes" not in again["sweeps"][0]
    assert again["sweeps"][0]["points"] == 31


def test_a_repeat_of_another_motor_or_unit_is_reported(tmp_path: Path) -> None:
    """A repeat that was a thousand times too large was averaged without a word, and the verdict was `adequate`."""
    frequency = np.geomspace(150e3, 30e6, 101)
    ohm = 3 + 2j * np.pi * frequency * 27e-6
    files = [table(tmp_path / f"{name}.csv", frequency, ohm * factor) for name, factor in (("a", 1.0), ("b", 1.001), ("c", 1000), ("d", 1.3))]
    told = imported(tmp_path / "two", "--short", files[0], files[2])
    assert "note: c.csv differs from a.csv by a factor of 1e+03 (median over the points); repeats are averaged" in told
    told = imported(tmp_path / "three", "--short", files[3], *files[:2])
    assert told.count("differs from") == 1
    assert "note: d.csv differs from the other short sweeps by 30 % of |Z| (median over the points)" in told
    assert "differs from" not in imported(tmp_path / "alike", "--short", *files[:2])


def test_a_calibration_at_the_motors_terminals_is_stated_once(tmp_path: Path) -> None:
    files = {name: touchstone(tmp_path / f"{name}.s1p", FREQUENCY, ohm) for name, ohm in (("short", IMPEDANCE), ("open", IMPEDANCE + 5))}
    told = imported(tmp_path / "plain", "--short", files["short"])
    assert "give --analyser NAME if you know it, and --compensated if it was" in told
    assert "Reflections are taken for those of a network analyser" in told
    assert Measurement.of(load(tmp_path / "plain" / "s").sweeps).analyser.fixture is not None
    told = imported(tmp_path, "--short", files["short"], "--compensated")
    assert told.splitlines()[0].endswith("calibrated at the motor's terminals")
    assert "--compensated" not in told
    assert "Reflections are taken for those of a network analyser" in told
    assert Measurement.of(load(tmp_path / "s").sweeps).analyser.fixture is None
    # What is added to the session was measured in the same way, unless its file says otherwise.
    imported(tmp_path, "--append", "--open", files["open"])
    assert Measurement.of(load(tmp_path / "s").sweeps).analyser.fixture is None
    spectrum = tmp_path / "peak.csv"
    spectrum.write_text("# detector: peak\nfrequency_hz,level_dbuv\n" + "".join(f"{f:.0f},40\n" for f in FREQUENCY))
    with pytest.raises(BadInput, match="compensation are for impedance sweeps"):
        imported(tmp_path / "none", "--spectrum", spectrum, "--compensated")


def two_ports(path: Path, frequency: np.ndarray, through: np.ndarray, end: str = "") -> Path:
    lines = [f"{f!r} 0 0 {x.real!r} {x.imag!r} 0 0 0 0\n" for f, x in zip(frequency.tolist(), through.tolist(), strict=True)]
    path.write_text("# HZ S RI R 50\n" + "".join(lines) + end)
    return path


@pytest.mark.parametrize("write", [table, touchstone])
def test_a_row_at_0_hz_is_left_out(tmp_path: Path, write) -> None:
    path = write(tmp_path / "file", np.concatenate([[0.0], FREQUENCY]), np.concatenate([[10], IMPEDANCE]))
    sweep = read_impedance(path, "short")
    np.testing.assert_array_equal(sweep.frequency_hz, FREQUENCY)
    np.testing.assert_allclose(sweep.impedance_ohm, IMPEDANCE, rtol=1e-9)
    assert sweep.metadata["changes"] == ["the row at 0 Hz is left out"]
    assert imported(tmp_path, "--short", path).splitlines()[0].endswith("; the row at 0 Hz is left out")


@pytest.mark.parametrize("fixture", ["series-through", "shunt-through"])
def test_two_ports_from_0_hz_on(tmp_path: Path, fixture: str) -> None:
    through = 100 / (100 + IMPEDANCE) if fixture == "series-through" else IMPEDANCE / (IMPEDANCE + 25)
    # At 0 Hz a part across the line may pass all, which no impedance does.
    path = two_ports(tmp_path / "file", np.concatenate([[0.0], FREQUENCY]), np.concatenate([[1], through]))
    sweep = read_impedance(path, "short", fixture)
    np.testing.assert_allclose(sweep.impedance_ohm, IMPEDANCE, rtol=1e-9)
    assert sweep.metadata["changes"] == ["the row at 0 Hz is left out"]


def test_the_band_comes_before_the_checks_of_values(tmp_path: Path) -> None:
    frequency, impedance = np.concatenate([[-5.0, 0.0], FREQUENCY]), np.concatenate([[1, 1], IMPEDANCE])
    path = table(tmp_path / "file", frequency, impedance)
    with pytest.raises(BadInput, match="above 0 Hz"):
        imported(tmp_path, "--short", path)
    told = imported(tmp_path, "--short", path, "--band", "100k:100M")
    assert "31 points, 100 kHz - 100 MHz" in told
    assert "2 of 33 points outside 100 kHz - 100 MHz left out" in told
    assert "0 Hz is" not in told
    path.write_text(path.read_text().replace(repr(float(IMPEDANCE[-1].imag)), "nan"))
    assert "nan" in path.read_text()
    assert "27 points" in imported(tmp_path / "again", "--short", path, "--band", "100k:50M")


def test_a_reflection_above_1_is_told(tmp_path: Path) -> None:
    negative = IMPEDANCE.copy()
    negative[:1] = -0.5 + 3j  # 1 of 31
    told = imported(tmp_path, "--short", touchstone(tmp_path / "file", FREQUENCY, negative))
    size = abs((negative[0] - 50) / (negative[0] + 50))
    warning = f"|S11| reaches {size:.3g} at 1 of 31 points: a passive part never reflects more than it receives; calibrate again"
    assert f"; warning: {warning}" in told.splitlines()[0]
    assert load(tmp_path / "s").sweeps[0].metadata["warnings"] == [warning]
    s = (negative - 50) / (negative + 50)
    lines = [f"{f!r},{x.real!r},{x.imag!r}\n" for f, x in zip(FREQUENCY.tolist(), s.tolist(), strict=True)]
    (tmp_path / "s11.csv").write_text("frequency_hz,S11_real,S11_imag\n" + "".join(lines))
    assert read_impedance(tmp_path / "s11.csv", "short").metadata["warnings"] == [warning]
    assert "warnings" not in read_impedance(touchstone(tmp_path / "file", FREQUENCY, IMPEDANCE), "short").metadata
    many, few = np.geomspace(1e5, 1e8, 100), np.full(100, 10 + 5j)
    few[0] = -0.5  # 1 % of the points, no more
    assert "warnings" not in read_impedance(touchstone(tmp_path / "file", many, few), "short").metadata


@pytest.mark.parametrize("head", ["# accuracy_percent: 2\n", "# accuracy_percent: 2 %\n"])
def test_accuracy_may_stand_in_the_file(tmp_path: Path, head: str) -> None:
    sweep = read_impedance(table(tmp_path / "file", FREQUENCY, IMPEDANCE, head), "short")
    assert sweep.metadata["accuracy_percent"] == 2.0
    with pytest.raises(BadInput, match=r"file: the accuracy .* cannot be used"):
        read_impedance(table(tmp_path / "file", FREQUENCY, IMPEDANCE, head.replace("2", "0")), "short")


def test_an_earlier_import_keeps_its_changes_apart(tmp_path: Path, short: Path) -> None:
    imported(tmp_path, "--short", short, "--band", "1MHz:100MHz")
    sweep = read_impedance(tmp_path / "s" / "sweeps" / "short-1.csv", "short")
    assert "changes" not in sweep.metadata
    assert sweep.metadata["header_changes"] == ["10 of 31 points outside 1 MHz - 100 MHz left out"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--band", "1MHz:2MHz"), r"short.csv: 4 of 31 points \(100 kHz - 100 MHz\) are within 1 MHz - 2 MHz; at least 8"),
        (("--band", "1GHz:2GHz"), "0 of 31 points"),
        (("--band", "2MHz:1MHz"), "is empty"),
        (("--band", "1MHz"), "write for example '150kHz:30MHz'"),
        (("--band", "1MHz:"), "write for example '150kHz:30MHz'"),
        (("--band", "1 Ohm:2MHz"), "expected Hz"),
        (("--accuracy", "0"), "above 0 and below 100"),
        (("--accuracy", "100"), "above 0 and below 100"),
        (("--accuracy", "nan"), "not a finite number"),
        (("--accuracy", "good"), "cannot read 'good'"),
        (("--fixture", "shunt-through"), "none of the files is one"),
    ],
)
def test_options_that_no_file_can_use_are_one_line(tmp_path: Path, short: Path, arguments: tuple[str, ...], says: str) -> None:
    with pytest.raises(BadInput, match=says) as caught:
        imported(tmp_path, "--short", short, *arguments)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "s").exists()


def test_band_without_a_sweep_is_refused(tmp_path: Path) -> None:
    (tmp_path / "any.csv").write_text("# detector: peak\nfrequency_hz,level_dbuv\n1e6,40\n2e6,50\n")
    with pytest.raises(BadInput, match="are for impedance sweeps"):
        imported(tmp_path, "--spectrum", tmp_path / "any.csv", "--band", "1MHz:2MHz")
    assert not (tmp_path / "s").exists()


def test_fixture_of_two_ports(tmp_path: Path, short: Path) -> None:
    two_ports(tmp_path / "open.s2p", FREQUENCY, 100 / (100 + IMPEDANCE))
    told = imported(tmp_path, "--short", short, "--open", tmp_path / "open.s2p", "--fixture", "series-through")
    assert "open.s2p (touchstone, S21 of a series-through fixture, Z = 2 Z0 (1 - S21)/S21, Z0 = 50 Ohm): 31 points" in told
    np.testing.assert_allclose(load(tmp_path / "s").sweeps[1].impedance_ohm, IMPEDANCE, rtol=1e-9)


def rows_of_names(tmp_path: Path, *names: str) -> Path:
    """A file with these lines above its rows of frequency, resistance and reactance."""
    path = tmp_path / "rows.csv"
    path.write_text("\n".join([*names, *(f"{f!r},{z.real!r},{z.imag!r}" for f, z in zip(FREQUENCY.tolist(), IMPEDANCE.tolist(), strict=True))]))
    return path


@pytest.mark.parametrize(
    "names",
    [
        ("Frequency,Resistance,Reactance", "Hz,Ohm,Ohm"),
        ("# f,R,X", "# [Hz],[Ohm],[Ohm]"),
        ("# f,R,X", "Hz,Ohm,Ohm"),
        ("# f,R,X", "#", "Hz,Ohm,Ohm"),
    ],
)
def test_names_and_units_in_two_rows(tmp_path: Path, names: tuple[str, ...]) -> None:
    imported(tmp_path, "--short", rows_of_names(tmp_path, *names))
    np.testing.assert_array_equal(load(tmp_path / "s").sweeps[0].impedance_ohm, IMPEDANCE)


@pytest.mark.parametrize(
    ("names", "units", "beside"),
    [
        ("Frequency\tQuasiPeak\tCAverage\tLine", "(MHz)\t(dBµV)\t(dBµV)\t", "L1"),
        ("Frequency\tQuasiPeak\tCAverage\tCorr.", "(MHz)\t(dBµV)\t(dBµV)\t(dB)", "9,6"),
        ("Frequency\tQuasiPeak\tCAverage\tMeas. Time", "MHz\tdBµV\tdBµV\tms", "1000,0"),
    ],
)
def test_columns_beside_the_levels_may_have_other_units_or_none(tmp_path: Path, names: str, units: str, beside: str) -> None:
    rows = "".join(f"{0.15 + 0.0045 * n:.6f}\t{40 + n % 3},000\t30,000\t{beside}\n".replace(".", ",") for n in range(50))
    (tmp_path / "final.txt").write_text(f"{names}\n{units}\n{rows}", encoding="latin-1")
    imported(tmp_path, "--spectrum", tmp_path / "final.txt")
    quasi_peak, average = load(tmp_path / "s").spectra
    assert (quasi_peak.detector, average.detector) == ("quasi-peak", "cispr-average")
    np.testing.assert_allclose(quasi_peak.level_dbuv, 40 + np.arange(50) % 3)
    np.testing.assert_allclose(average.frequency_hz, 1e6 * (0.15 + 0.0045 * np.arange(50)), rtol=1e-9)


def test_units_that_the_file_does_not_name(tmp_path: Path) -> None:
    path = rows_of_names(tmp_path, "f,R,X")
    with pytest.raises(BadInput, match="--unit f=Hz --unit R=Ohm --unit X=Ohm"):
        imported(tmp_path, "--short", path)
    with pytest.raises(BadInput, match="no file has a column 'FREQ'"):
        imported(tmp_path, "--short", touchstone(tmp_path / "file", FREQUENCY, IMPEDANCE), "--unit", "FREQ=Hz")
    with pytest.raises(BadInput, match="--unit 'f': write the column's name"):
        imported(tmp_path, "--short", path, "--unit", "f")
    told = imported(tmp_path, "--unit", "f=kHz", "--unit", "R=mOhm", "--unit", "X=mOhm", "--short", path)
    assert "units as given: f in kHz, R in mOhm, X in mOhm" in told
    (sweep,) = load(tmp_path / "s").sweeps
    np.testing.assert_allclose(sweep.impedance_ohm, 1e-3 * IMPEDANCE, rtol=1e-15)
    np.testing.assert_allclose(sweep.frequency_hz, 1e3 * FREQUENCY, rtol=1e-15)


@pytest.mark.skipif(sys.platform == "win32", reason="no file size limit there")
@pytest.mark.parametrize("is_there", [False, True])
@pytest.mark.parametrize("limit", [20, 3000])
def test_an_import_that_cannot_be_stored_leaves_nothing_and_can_be_repeated(tmp_path: Path, is_there: bool, limit: int) -> None:
    frequency = np.geomspace(1e5, 3e7, 20)
    few = table(tmp_path / "few.csv", frequency, 1 + 2j * frequency / 1e5)
    frequency = np.geomspace(1e5, 3e7, 400)
    many = table(tmp_path / "many.csv", frequency, 1 + 2j * frequency / 1e5)
    session = tmp_path / "s"
    if is_there:
        session.mkdir()
    code = (
        f"import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}));"
        "sys.argv = ['motoremi', 'import', *sys.argv[1:]]; from motoremi.cli import main; main()"
    )
    arguments = [str(session), "--short", str(few), "--open", str(many)]
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("motoremi: cannot write")
    assert "nothing is left of this import, repeat it when that is mended" in done.stderr
    assert "is kept" not in done.stderr
    assert session.exists() == is_there
    assert not is_there or list(session.iterdir()) == []
    assert CliRunner().invoke(app, ["import", *arguments]).exit_code == 0
    assert len(load(session).sweeps) == 2
