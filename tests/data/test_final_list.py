"""Tables of levels in which each row states its line of the LISN, bandwidth and measuring time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi

from motoremi.data.corrections import read_corrections
from motoremi.data.files import read_emission
from motoremi.errors import BadInput

HEAD = "Frequency (MHz);QuasiPeak (dBµV);CAverage (dBµV);Limit (dBµV);Margin (dB);Meas. Time (ms);Bandwidth (kHz);Line;PE;Corr. (dB)"
ROWS = """0,154500;52,31;---;65,75;13,44;1000,0;9,000;N;GND;10,1
0,154500;---;38,12;55,75;17,63;1000,0;9,000;L1;GND;10,1
1,203000;60,90;44,20;56,00;-4,90;15000,0;9,000;L1;GND;10,2
"""
AXIS = 150e3 + 4.5e3 * np.arange(6634)


def written(folder: Path, head: str = HEAD, rows: str = ROWS, name: str = "finals.csv") -> Path:
    path = folder / name
    path.write_text(f"{head}\n{rows}", encoding="utf-8")
    return path


def scan(folder: Path) -> Path:
    """A peak scan with the maxima that the list holds."""
    level = np.full(AXIS.size, 25.0)
    for hertz, dbuv in ((154.5e3, 56.0), (1.2030e6, 62.0)):
        level[np.argmin(np.abs(AXIS - hertz))] = dbuv
    rows = "".join(f"{hertz:.0f};{dbuv:.2f}\n" for hertz, dbuv in zip(AXIS, level, strict=True))
    return written(folder, "Frequency (Hz);MaxPeak (dBuV)", rows, "scan.csv")


def test_each_value_has_its_line_bandwidth_and_measuring_time(tmp_path: Path) -> None:
    scans, finals = read_emission(written(tmp_path))
    assert scans == []
    assert [
        (one.detector, one.frequency_hz.tolist(), one.level_dbuv.tolist(), one.metadata["line"], one.metadata["dwell_s"]) for one in finals
    ] == [
        ("quasi-peak", [154500.0], [52.31], "N", 1.0),
        ("quasi-peak", [1203000.0], [60.9], "L1", 15.0),
        ("cispr-average", [154500.0], [38.12], "L1", 1.0),
        ("cispr-average", [1203000.0], [44.2], "L1", 15.0),
    ]
    assert {one.resolution_bandwidth_hz for one in finals} == {9e3}
    assert not any(one.metadata.get("rbw_assumed") for one in finals)


def test_they_are_judged_with_the_scan(tmp_path: Path) -> None:
    judged = motoremi("import", tmp_path / "s", "--spectrum", scan(tmp_path), written(tmp_path), "--limit", "cispr32-b")
    assert judged.returncode == 1
    assert "quasi-peak finals.csv: 2 final values, up to 60.9 dBuV at 1.203 MHz" in judged.stdout
    assert "verdict: fail" in judged.stdout
    assert "final value above the quasi-peak limit by 4.9 dB at 1.203 MHz" in judged.stdout


def test_a_list_alone_is_refused(tmp_path: Path) -> None:
    told = motoremi("import", tmp_path / "s", "--spectrum", written(tmp_path), "--limit", "cispr32-b")
    assert told.returncode == 2
    assert "final values alone show nothing of the rest of the span: import the scans" in told.stderr


def test_levels_that_contain_a_correction_are_not_corrected_again(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('[[correction]]\nname = "LISN"\nkind = "transducer"\ndb = 10.0\n')
    _, finals = read_emission(written(tmp_path))
    with pytest.raises(BadInput, match=r"has applied the transducer .column Corr. \(dB\). already"):
        read_corrections(tmp_path / "c.toml").corrected_spectrum(finals[0])


def test_final_values_of_a_short_time_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="line 4: a final value was measured for 50 ms where 1 s are needed"):
        read_emission(written(tmp_path, rows=ROWS.replace("15000,0", "50,0")))


@pytest.mark.parametrize("line", ["Line", "Phase", "Leiter"])
def test_scans_of_two_lines_below_each_other_are_two_scans(tmp_path: Path, line: str) -> None:
    """They were one scan in which each frequency occurred twice, of which the higher level was kept."""
    rows = "".join(f"{150 + 4.5 * n:.1f};{30 + add + n % 3}.0;{name}\n" for name, add in (("L1", 0), ("N", 5)) for n in range(50))
    scans, finals = read_emission(written(tmp_path, f"Frequency (kHz);QP (dBuV);{line}", rows))
    assert finals == []
    assert [(one.metadata["line"], len(one), float(one.level_dbuv.max())) for one in scans] == [("L1", 50, 32.0), ("N", 50, 37.0)]


def test_lines_that_alternate_row_by_row_are_two_scans(tmp_path: Path) -> None:
    rows = "".join(f"{150 + 4.5 * n:.1f};{30 + add}.0;{name}\n" for n in range(50) for name, add in (("L1", 0), ("N", 5)))
    scans, _ = read_emission(written(tmp_path, "Frequency (kHz);QP (dBuV);Line", rows))
    assert [(one.metadata["line"], len(one)) for one in scans] == [("L1", 50), ("N", 50)]


def test_a_bandwidth_without_its_unit_does_not_take_a_scan_apart(tmp_path: Path) -> None:
    rows = "".join(f"{150 + 4.5 * n:.1f};30.5;L1;9\n" for n in range(50))
    (one,), finals = read_emission(written(tmp_path, "Frequency (kHz);QP (dBuV);Line;RBW", rows))
    assert (len(one), one.resolution_bandwidth_hz, one.metadata["rbw_assumed"], finals) == (50, 9e3, True, [])


def test_a_coarse_scan_in_equal_steps_is_a_scan(tmp_path: Path) -> None:
    rows = "".join(f"{150 + 100 * n};30.{n % 10};L1\n" for n in range(50))
    scans, finals = read_emission(written(tmp_path, "Frequency (kHz);QP (dBuV);Line", rows))
    assert ([len(one) for one in scans], finals) == ([50], [])


def test_a_column_of_numbers_is_no_line(tmp_path: Path) -> None:
    rows = "".join(f"{150 + 4.5 * n:.1f};30.5;{n}\n" for n in range(50))
    (one,), _ = read_emission(written(tmp_path, "Frequency (kHz);QP (dBuV);Phase (deg)", rows))
    assert "line" not in one.metadata
