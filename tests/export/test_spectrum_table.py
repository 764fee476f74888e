"""Spectra as a table: readings, corrections, levels, limit and margin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from command_line import motoremi

import motoremi as me
from motoremi.data.csvfiles import write_spectrum_csv
from motoremi.data.spectrum import Spectrum
from motoremi.emission.limit import find_limit

PAD = "[[correction]]\nname = 'pad'\nrole = 'receiver'\nkind = 'loss'\ndb = 10\n"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """Quasi-peak on one line of the LISN and peak with the motor off, behind a pad of 10 dB."""
    (tmp_path / "lab.toml").write_text(PAD)
    axis = np.array([0.3e6, 1e6, 6e6, 31e6])
    files = []
    for detector, level, more in (("quasi-peak", 30.0, {"line": "L1", "operating": "idle"}), ("peak", 20.0, {"condition": "motor off"})):
        write_spectrum_csv(tmp_path / f"{detector}.csv", Spectrum(detector, axis, level + np.arange(4), metadata=more))
        files.append(tmp_path / f"{detector}.csv")
    done = motoremi("import", tmp_path / "s", "--spectrum", *files, "--corrections", tmp_path / "lab.toml")
    assert done.returncode == 0, done.stderr
    return tmp_path / "s"


def test_levels_with_corrections_limit_and_margin(session: Path) -> None:
    table = me.spectrum_table(me.load(session), find_limit("cispr32-b"))
    assert len(table) == 8
    quasi_peak = table[table.detector == "quasi-peak"]
    assert quasi_peak.reading_dbuv.tolist() == [30, 31, 32, 33]
    assert quasi_peak.correction_db.tolist() == [10, 10, 10, 10]
    assert quasi_peak.level.tolist() == [40, 41, 42, 43]
    # 66 to 56 dBuV, straight over the logarithm of frequency, from 150 to 500 kHz; 56, then 60 dBuV; none above 30 MHz.
    expected = [66 - 10 * np.log(0.3 / 0.15) / np.log(0.5 / 0.15), 56, 60, np.nan]
    np.testing.assert_allclose(quasi_peak.limit, expected)
    np.testing.assert_allclose(quasi_peak.margin_db, expected - quasi_peak.level)
    assert set(quasi_peak.line) == {"L1"}
    assert set(quasi_peak.operating) == {"idle"}
    peak = table[table.detector == "peak"]
    assert set(peak.condition) == {"motor off"}
    assert peak.limit.isna().all()


def test_the_command_adds_the_limit_that_the_session_was_judged_against(session: Path, tmp_path: Path) -> None:
    done = motoremi("export", session, "--spectra", tmp_path / "levels.csv")
    assert done.returncode == 0, done.stderr
    assert "levels.csv: spectra, not compared with a limit" in done.stdout
    assert "margin_db" not in pd.read_csv(tmp_path / "levels.csv").columns
    assert motoremi("predict", session, "--limit", "cispr14-1").returncode == 0
    assert "margins to CISPR 14-1 household appliances" in motoremi("export", session, "--spectra", tmp_path / "levels.csv").stdout
    pd.testing.assert_frame_equal(
        pd.read_csv(tmp_path / "levels.csv"),
        me.spectrum_table(me.load(session), find_limit("cispr14-1")).replace("", np.nan),
        check_dtype=False,
    )


def test_without_spectra_there_is_nothing_to_export(tmp_path: Path) -> None:
    rows = "".join(f"{n}e5,1,{2 * n}\n" for n in range(1, 10))
    (tmp_path / "z.csv").write_text(f"frequency_hz,resistance_ohm,reactance_ohm\n{rows}")
    assert motoremi("import", tmp_path / "s", "--short", tmp_path / "z.csv").returncode == 0
    done = motoremi("export", tmp_path / "s", "--spectra", tmp_path / "levels.csv")
    assert done.returncode == 2
    assert "s holds no spectrum: there is nothing to export" in done.stderr
    assert not (tmp_path / "levels.csv").exists()
