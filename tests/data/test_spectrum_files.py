"""Files of emission spectra as laboratories write them: what is read, what is told and what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import motoremi
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.cli.arguments import expanded
from motoremi.data.columns import find_columns, unit_trouble
from motoremi.data.corrections import Corrections
from motoremi.data.detectors import SPELLINGS
from motoremi.data.files import read_impedance, read_spectra, read_spectrum
from motoremi.data.import_notes import import_notes
from motoremi.data.recognise import recognise
from motoremi.data.session import load, verify
from motoremi.data.spectrum import DETECTORS, Spectrum
from motoremi.data.table import Table
from motoremi.errors import BadInput
from motoremi.report.emission_section import final_tables
from motoremi.workflow import opened, report_session

ROWS = "150000,40.00\n154500,41.50\n159000,39.25\n"
TWO = "0,150000;40,00;30,00\n0,154500;41,50;31,50\n0,159000;39,25;29,25\n"


def write(folder: Path, text: str, name: str = "spectrum.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def imported(folder: Path, *arguments: object) -> str:
    """What `motoremi import` says of files that become the session `s`."""
    result = CliRunner().invoke(app, expanded(["import", str(folder / "s"), *map(str, arguments)]))
    if result.exception is not None:
        raise result.exception
    return result.stdout


def refusal(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read_spectra(path)
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(f"{path}: ")


# Header


@pytest.mark.parametrize(
    "line",
    [
        "condition: motor off",
        "condition: Motor off",
        "Condition: motor off",
        "CONDITION: ambient",
        "condition: background",
        "condition: off",
        "condition: MOTOR_OFF",
    ],
)
def test_a_background_is_recognised_however_it_is_written(tmp_path: Path, line: str) -> None:
    path = write(tmp_path, f"# detector: quasi-peak\n# rbw_hz: 9000\n# {line}\nfrequency_hz,level_dbuv\n{ROWS}")
    spectrum = read_spectrum(path)
    assert spectrum.is_background
    assert spectrum.metadata["condition"] == "motor off"
    assert "up to 41.5 dBuV, background (motor off)" in imported(tmp_path, "--spectrum", path)
    assert load(tmp_path / "s").spectra[0].is_background


@pytest.mark.parametrize("line", ["Condition: Motor running", "condition: running", "lisn: 5 uH"])
def test_a_running_motor_is_no_background(tmp_path: Path, line: str) -> None:
    spectrum = read_spectrum(write(tmp_path, f"# detector: peak\n# {line}\nfrequency_hz,level_dbuv\n{ROWS}"))
    assert spectrum.condition == "motor running"
    assert "background" not in spectrum.summary()


def test_an_unknown_condition_is_refused(tmp_path: Path) -> None:
    told = refusal(write(tmp_path, f"# detector: peak\n# Condition: idle\nfrequency_hz,level_dbuv\n{ROWS}"))
    assert told.startswith("unknown condition 'idle': write '# condition: motor off' (or background, ambient, off)")
    assert "'# condition: motor running'" in told


@pytest.mark.parametrize("title", ["Level (dBµV)", "Pegel [dBµV]", "level_dbuv"])
def test_a_column_of_levels_whose_detector_is_in_the_header(tmp_path: Path, title: str) -> None:
    rows = ROWS.replace(",", ";").replace(".", ",")
    spectrum = read_spectrum(write(tmp_path, f"# Detector: QP\n# RBW: 9 kHz\nFrequenz (Hz);{title}\n{rows}"))
    assert (spectrum.detector, spectrum.resolution_bandwidth_hz, float(spectrum.level_dbuv.max())) == ("quasi-peak", 9e3, 41.5)


def test_a_background_of_an_earlier_session_is_one() -> None:
    assert Spectrum("peak", [1e6, 2e6], [40, 40], 9e3, None, {"condition": "ambient"}).is_background
    assert Spectrum("peak", [1e6, 2e6], [40, 40], 9e3, None, {"condition": "idle"}).condition == "idle"


@pytest.mark.parametrize(
    ("line", "bandwidth"),
    [
        ("rbw_hz: 9000", 9e3),
        ("rbw_hz: 9 kHz", 9e3),
        ("RBW: 200 Hz", 200.0),
        ("RBW_Hz: 200", 200.0),
        ("rbw: 0.2kHz", 200.0),
        ("RBW [kHz]: 120", 120e3),
        ("Resolution bandwidth: 1 MHz", 1e6),
        ("rbw: 200;Hz", 200.0),
    ],
)
def test_the_bandwidth_is_read_however_its_key_is_written(tmp_path: Path, line: str, bandwidth: float) -> None:
    spectrum = read_spectrum(write(tmp_path, f"# Detector: quasi-peak\n# {line}\nfrequency_hz,level_dbuv\n{ROWS}"))
    assert (spectrum.detector, spectrum.resolution_bandwidth_hz) == ("quasi-peak", bandwidth)
    assert "rbw_assumed" not in spectrum.metadata


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("# rbw: 9", "the resolution bandwidth '9' has no unit; write '# rbw_hz: 9000' or '# rbw: 9 kHz'"),
        ("# RBW: auto", "'auto' is not a frequency"),
        ("# RBW: 200 Hz\n# rbw_hz: 9000", "its header states rbw_hz twice, '200.0' and '9000.0'; keep one line"),
        ("# Detector: average", "its header states detector twice, 'peak' and 'average'"),
    ],
)
def test_a_header_that_contradicts_itself_is_refused(tmp_path: Path, lines: str, says: str) -> None:
    assert says in refusal(write(tmp_path, f"# detector: peak\n{lines}\nfrequency_hz,level_dbuv\n{ROWS}"))


def test_the_transducer_and_the_line_are_found_in_upper_case_too(tmp_path: Path) -> None:
    spectrum = read_spectrum(write(tmp_path, f"# Detector: peak\n# Line: L1\n# Transducer: EZ-17\nfrequency_hz,level_dbuv\n{ROWS}"))
    assert (spectrum.metadata["line"], spectrum.metadata["transducer"]) == ("L1", "EZ-17")


def test_units_that_the_user_gives_for_a_spectrum(tmp_path: Path) -> None:
    path = write(tmp_path, "Frequency,Peak,Average\n" + ROWS.replace("\n", ",30\n"))
    with pytest.raises(BadInput, match="--unit Frequency=Hz --unit Peak=dBuV --unit Average=dBuV"):
        read_spectra(path)
    told = imported(tmp_path, "--spectrum", path, "--unit", "Frequency=Hz", "--unit", "Peak=dBuV", "--unit", "Average=dBuV")
    assert "note: spectrum.csv: units as given: Frequency in Hz, Peak in dBuV, Average in dBuV" in told
    again = read_spectrum(tmp_path / "s" / "spectra" / "peak-1.csv")
    assert again.metadata["header_changes"] == ["units as given: Frequency in Hz, Peak in dBuV, Average in dBuV"]


# Columns


def test_every_spelling_of_a_detector_names_a_column() -> None:
    assert tuple(SPELLINGS) == DETECTORS
    for detector, spellings in SPELLINGS.items():
        for spelling in (*spellings, f"pegel {spellings[-1]}", f"{spellings[-1]} level"):
            assert list(find_columns(Table("file", {}, (f"{spelling} [dBuV]",), [], []))) == [f"level {detector}"]


@pytest.mark.parametrize(
    "title", ["PK- [dBuV]", "PK-_MAXH [dBuV]", "MaxPeak-MinHold (dBuV)", "RMS [dBuV]", "Limit - QPK (dBuV)", "QP Limit (dBuV)", "Pegel [dBuV/m]"]
)
def test_what_is_no_reading_of_a_detector_is_not_taken_for_one(title: str) -> None:
    assert find_columns(Table("file", {}, (title,), [], [])) == {}
    assert unit_trouble(Table("file", {}, ("PK- [dBuV]",), [], [])) == ""


@pytest.mark.parametrize(
    ("head", "detectors"),
    [
        ("Frequency [MHz];PK+ [dBµV];QPK [dBµV]", ("peak", "quasi-peak")),
        ("Frequency [MHz];PK+_MAXH [dBµV];AVG_MAXH [dBµV]", ("peak", "average")),
        ("Frequency;MaxPeak-ClearWrite;Average-ClearWrite\nMHz;dBµV;dBµV", ("peak", "average")),
        ("Frequenz [MHz];Pegel PK [dBµV];Pegel QP [dBµV]", ("peak", "quasi-peak")),
        ("Frequenz [MHz];Pegel AV [dBµV];Pegel CAV [dBµV]", ("average", "cispr-average")),
        ("Frequency [Hz];Quasi-Peak [dBuV];CISPR-AVG [dBuV]", ("quasi-peak", "cispr-average")),
        ("Frequency (MHz);QuasiPeak-MaxHold (dBµV);CAverage Level (dBµV)", ("quasi-peak", "cispr-average")),
    ],
)
def test_titles_of_receiver_programs(tmp_path: Path, head: str, detectors: tuple[str, str]) -> None:
    found = {spectrum.detector: spectrum for spectrum in read_spectra(write(tmp_path, f"{head}\n{TWO}"))}
    assert set(found) == set(detectors)
    assert found[detectors[0]].level_dbuv.tolist() == [40.0, 41.5, 39.25]
    assert found[detectors[1]].level_dbuv.tolist() == [30.0, 31.5, 29.25]


def test_detectors_in_dbm(tmp_path: Path) -> None:
    peak, average = read_spectra(write(tmp_path, "Frequency (Hz),Peak (dBm),Average (dBm)\n150000,-67,-77\n154500,-66,-76\n"))
    # 1 mW in 50 ohm is sqrt(0.05) V.
    offset = 20 * math.log10(math.sqrt(0.05) / 1e-6)
    assert peak.level_dbuv == pytest.approx([-67 + offset, -66 + offset])
    assert average.level_dbuv == pytest.approx([-77 + offset, -76 + offset])
    assert peak.metadata["read_as"] == "dBm in 50 Ohm"


def test_columns_of_levels_that_are_not_read_are_told(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "Frequency [Hz];Peak [dBuV];RMS [dBuV];PK- [dBuV];QP;Limit [dBuV/m];Margin [dB]\n150000;40;20;10;30;66;26\n154500;41;21;11;31;66;25\n",
    )
    told = "not read: the columns 'RMS [dBuV]', 'PK- [dBuV]', 'QP', 'Limit [dBuV/m]'"
    assert read_spectrum(path).metadata["changes"] == [told]
    assert f"note: spectrum.csv: {told}\n" in imported(tmp_path, "--spectrum", path)
    assert load(tmp_path / "s").spectra[0].metadata["changes"] == [told]


@pytest.mark.parametrize("title", ["overload", "OVLD", "Status", "RF Overload"])
def test_marks_of_overload_in_words(tmp_path: Path, title: str) -> None:
    text = f"# detector: peak\nFrequency (Hz),Level (dBuV),{title}\n150000,40,\n154500,41,OVLD\n159000,42,ok\n"
    spectrum = read_spectrum(write(tmp_path, text))
    assert spectrum.overload.tolist() == [False, True, False]
    assert "changes" not in spectrum.metadata


def test_a_status_that_is_not_known_is_told(tmp_path: Path) -> None:
    text = "# detector: peak\nFrequency (Hz),Level (dBuV),Status\n150000,40,PASS\n154500,41,4\n"
    spectrum = read_spectrum(write(tmp_path, text))
    assert not spectrum.overload.any()
    assert spectrum.metadata["changes"] == ["not read: the column 'Status'"]
    assert "overload is 'PASS'; write 0 or 1, or OVLD" in refusal(write(tmp_path, text.replace("Status", "Overload")))


@pytest.mark.parametrize(
    ("head", "says"),
    [
        (
            "Frequency (Hz),Trace1(dBm)",
            "no known detector name in 'Trace1(dBm)': write peak, quasi-peak, average, cispr-average or rms-average, or level",
        ),
        ("Frequency (Hz),MaxPeak-MinHold (dBuV)", "no known detector name in 'MaxPeak-MinHold (dBuV)'"),
        (
            "Frequency (Hz),Level (dBuA)",
            "levels behind a transducer: import the receiver's readings in dBuV, and give the transducer with --corrections",
        ),
        ("Frequency (Hz),Level (dBµV/m)", "levels behind a transducer"),
        ("Frequency (Hz),Level (dBmV)", "in another decibel unit; convert to dBuV"),
        ("Time (s),Level (dBuV)", "an emission spectrum needs the columns frequency_hz,level_dbuv"),
    ],
)
def test_why_levels_are_not_read(tmp_path: Path, head: str, says: str) -> None:
    told = refusal(write(tmp_path, f"# detector: peak\n{head}\n{ROWS}"))
    assert says in told
    assert "107" not in told
    assert "another decibel unit" not in told or "dBmV" in told


@pytest.mark.parametrize(
    ("row", "line"),
    [("150000;40,5", "frequency_hz;peak_dbuv"), ("1,150000,40.5", "frequency_hz,peak_dbuv"), ("150000\t40,5\t3", "frequency_hz peak_dbuv")],
)
def test_rows_without_names_of_a_spectrum(tmp_path: Path, row: str, line: str) -> None:
    path = write(tmp_path, f"{row}\n{row.replace('150', '160')}\n")
    assert f"put a line such as '{line}' above the numbers" in refusal(path)
    with pytest.raises(BadInput, match=r"put a line such as 'frequency_hz.resistance_ohm.reactance_ohm' above the numbers"):
        read_impedance(path, "short")


def test_the_line_that_is_proposed_can_be_read(tmp_path: Path) -> None:
    assert read_spectrum(write(tmp_path, "frequency_hz;peak_dbuv\n150000;40,5\n160000;41,5\n")).level_dbuv.tolist() == [40.5, 41.5]


# One frequency twice


def test_of_two_readings_at_one_frequency_the_higher_is_kept(tmp_path: Path) -> None:
    path = write(tmp_path, "# detector: peak\nfrequency_hz,level_dbuv\n150000,40\n154500,41.05\n154500,41\n159000,42\n159000,42.25\n")
    spectrum = read_spectrum(path)
    assert spectrum.frequency_hz.tolist() == [150e3, 154.5e3, 159e3]
    assert spectrum.level_dbuv.tolist() == [40, 41.05, 42.25]
    told = "2 frequencies, 0.1545 MHz the first, occur twice, readings up to 0.25 dB apart: the higher is kept"
    assert spectrum.metadata["changes"] == [told]
    assert f"note: spectrum.csv: {told}" in imported(tmp_path, "--spectrum", path)


def test_each_detector_keeps_its_own_higher_reading(tmp_path: Path) -> None:
    peak, average = read_spectra(write(tmp_path, "Frequency (Hz),Peak (dBuV),Average (dBuV)\n1e6,40,30\n1e6,39,31\n2e6,40,30\n"))
    assert (peak.level_dbuv[0], average.level_dbuv[0]) == (40, 31)


def test_a_tinysa_keeps_the_higher_reading(tmp_path: Path) -> None:
    spectrum = read_spectrum(write(tmp_path, "150000,-66.5\n154500,-65.25\n154500,-65.00\n"))
    assert spectrum.level_dbuv == pytest.approx([40.4897, 41.9897], abs=1e-4)
    assert spectrum.metadata["changes"] == ["0.1545 MHz occurs twice, readings up to 0.25 dB apart: the higher is kept"]


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("150000,40,0\n150000,41,0\n150000,42,0\n154500,40,0\n", "the frequency 150000 Hz occurs more than twice"),
        ("150000,40,0\n150000,41,1\n154500,40,0\n", "the frequency 150000 Hz occurs twice, once overloaded; keep the row that is not"),
    ],
)
def test_repeated_frequencies_that_are_refused(tmp_path: Path, rows: str, says: str) -> None:
    assert says in refusal(write(tmp_path, f"# detector: peak\nfrequency_hz,level_dbuv,overload\n{rows}"))


# Rohde & Schwarz

DAT = """Type;ESRP-7;
Version;3.36 SP1;
Date;03.Feb 18;
Mode;Receiver;
{head}Scan Count;1;
Transducer;{transducer};
Scan 1:
Start;150000.000000;Hz
Stop;159000.000000;Hz
Step;4500.000000;Hz
RBW;9000.000000;Hz
Meas Time;0.050000;s
TRACE 1:
Trace Mode;MAX HOLD;
{trace}Values;3;
150000.000000;41.036753;
154500.000000;42.464854;
159000.000000;40.991311;
"""
DETECTOR, UNITS = "Detector;MAX PEAK;\n", "x-Unit;Hz;\ny-Unit;dBµV;\n"
FINAL = """TRACE 1 FINAL:
Trace Mode;CLR/WRITE;
Final Detector;QUASI PEAK;
Final Meas Time;1.0;s
x-Unit;Hz;
y-Unit;dBuV;
Values;2;
1;1270000;79.50;GND;N;
1;1280000;78.50;GND;N;
"""


def dat(head: str = "", trace: str = DETECTOR + UNITS, transducer: str = ";;;") -> str:
    return DAT.format(head=head, trace=trace, transducer=transducer)


@pytest.mark.parametrize(
    ("head", "trace"),
    [(DETECTOR, UNITS), (UNITS, DETECTOR), ("Trace Mode;CLR/WRITE;\n" + DETECTOR + UNITS, ""), ("Detector;AVERAGE;\n", DETECTOR + UNITS)],
)
def test_settings_of_the_trace_in_the_head_of_the_file(tmp_path: Path, head: str, trace: str) -> None:
    spectrum = read_spectrum(write(tmp_path, dat(head, trace)))
    assert (spectrum.detector, spectrum.resolution_bandwidth_hz) == ("peak", 9e3)
    assert spectrum.level_dbuv.tolist() == [41.036753, 42.464854, 40.991311]
    # The settings of one trace are not kept as those of the file.
    assert not {"detector", "x-unit", "trace mode"} & set(spectrum.metadata)


def test_a_detector_in_the_head_is_not_that_of_several_traces(tmp_path: Path) -> None:
    text = dat(DETECTOR, UNITS)
    second = text[text.index("TRACE 1:") :].replace("TRACE 1", "TRACE 2")
    assert "the detector 'MAX PEAK' is stated for the file and not for each of its traces" in refusal(write(tmp_path, text + second))
    assert "its y-unit is 'not stated'" in refusal(write(tmp_path, dat("", DETECTOR + "x-Unit;Hz;\n")))


def test_head_and_trace_of_a_spectrum_analyser(tmp_path: Path) -> None:
    """The layout of an FPL1000: the units in the head, no scans, blanks behind semicolons."""
    text = (
        "Type;R&S FPL1000;\nVersion;1.90;\nDate;01.Oct 2023;\nMode;ANALYZER;\nPreamplifier;OFF\nTransducer; OFF\nStart;150000;Hz\nStop;159000;Hz\n"
        "RBW;9000;Hz\nVBW;30000;Hz\nx-Axis;LIN;\ny-Axis;LOG;\nx-Unit;Hz;\ny-Unit;dBuV;\nWindow;1;Frequency Sweep\nTrace 1;;\nTrace Mode;MAXHOLD;\n"
        "Detector;MAXPEAK;\nValues; 3;\n150000;40.5\n154500;41.5\n159000;42.5\n"
    )
    path = write(tmp_path, text)
    assert read_spectrum(path).level_dbuv.tolist() == [40.5, 41.5, 42.5]
    assert "its transducer" not in imported(tmp_path, "--spectrum", path)


@pytest.mark.parametrize("transducer", [";;;", "OFF", " OFF", "none;OFF;", "-"])
def test_a_transducer_that_is_off_is_none(tmp_path: Path, transducer: str) -> None:
    path = write(tmp_path, dat(transducer=transducer))
    assert "its transducer" not in imported(tmp_path, "--spectrum", path)
    chain = Corrections.of([{"name": "LISN", "role": "receiver", "kind": "transducer", "db": 10.0}], "test")
    assert chain.corrected_spectrum(read_spectrum(path)).level_dbuv[0] == pytest.approx(51.036753)


def test_a_transducer_that_is_on_is_told_and_not_applied_twice(tmp_path: Path) -> None:
    path = write(tmp_path, dat(transducer="OFF;ENV216;"))
    assert "note: peak: the receiver has applied its transducer 'ENV216'; it must not be in --corrections" in imported(tmp_path, "--spectrum", path)
    chain = Corrections.of([{"name": "LISN", "role": "receiver", "kind": "transducer", "db": 10.0}], "test")
    with pytest.raises(BadInput, match="transducer 'ENV216' already"):
        chain.corrected_spectrum(read_spectrum(path))


def test_final_values_are_left_out_and_told(tmp_path: Path) -> None:
    average = FINAL.replace("QUASI PEAK", "CISPR AV").replace("TRACE 1", "TRACE 2").replace("79.50", "61.00")
    path = write(tmp_path, dat() + FINAL + average)
    told = "4 final values in the file are left out, the highest 79.5 dBuV at 1.27 MHz (quasi-peak) and 78.5 dBuV at 1.28 MHz (cispr-average)"
    spectrum = read_spectrum(path)
    assert spectrum.metadata["final_values_left_out"] == told
    assert spectrum.level_dbuv.max() == 42.464854


def test_final_values_of_a_receiver_are_imported_and_judged(tmp_path: Path) -> None:
    """Final values at 1.27 and 1.28 MHz beside a prescan whose peak is above the quasi-peak limit there."""
    axis = 150e3 + 4.5e3 * np.arange(6634)
    average = FINAL.replace("QUASI PEAK", "CISPR AV").replace("TRACE 1", "TRACE 2")
    finals = (FINAL + average).replace("79.50", "50,00").replace("78.50", "40,00")
    levels = np.where(np.abs(axis - 1.275e6) < 10e3, 60.0, 30.0)

    def file(final: str, name: str) -> Path:
        rows = "".join(f"{hertz:.1f};{level:.2f};\n".replace(".", ",") for hertz, level in zip(axis, levels, strict=True))
        head = "Type;ESR7;\nScan 1:\nStart;150000;Hz\nStop;30000000;Hz\nRBW;9000;Hz\nTRACE 1:\n"
        (tmp_path / name).write_text(f"{head}{DETECTOR}{UNITS}Values;{axis.size};\n{rows}{final}", encoding="utf-8")
        return tmp_path / name

    done = motoremi("import", tmp_path / "s", "--spectrum", file(finals, "good.dat"), "--limit", "cispr32-b")
    assert "quasi-peak good.dat: 2 final values, up to 50.0 dBuV at 1.27 MHz\n" in done.stdout
    assert "left out" not in done.stdout
    stored = load(tmp_path / "s")
    assert [(one.detector, one.frequency_hz.tolist(), one.level_dbuv.tolist()) for one in stored.finals] == [
        (detector, [hertz], [level]) for detector in ("quasi-peak", "cispr-average") for hertz, level in ((1.27e6, 50.0), (1.28e6, 40.0))
    ]
    assert stored.finals[0].metadata["dwell_s"] == 1.0
    assert stored.finals[0].metadata["phase"] == "N"
    assert stored.finals[0].resolution_bandwidth_hz == 9e3
    # The average final value is above its limit of 46 dBuV.
    assert done.returncode == 1
    verdict = stored.analysis("prediction")
    assert verdict is not None
    assert verdict["verdict"] == "fail"
    assert [one["line"] for one in verdict["finals"]] == ["N"] * 4
    assert "final value above the average limit by 4.0 dB at 1.27 MHz" in " ".join(verdict["reasons"])

    lower = finals.replace("50,00", "41,00")
    done = motoremi("import", tmp_path / "pass", "--spectrum", file(lower, "lower.dat"), "--limit", "cispr32-b", "--json")
    assert json.loads(done.stdout)["verdict"] == "pass"
    assert [one["frequency_hz"] for one in json.loads(done.stdout)["finals"]] == [1.27e6, 1.28e6] * 2
    assert verify(tmp_path / "pass") == []
    # A stored final value is read back as one, and needs its scans.
    one = tmp_path / "pass" / "spectra" / "final-quasi-peak-1.csv"
    spectra, again = me.read_emission(one)
    assert (spectra, again[0].level_dbuv.tolist(), again[0].metadata["maximum_hz"]) == ([], [41.0], 1.27e6)
    assert repr(again[0]) == "Spectrum('quasi-peak', 1 point, 1.27 MHz, quasi-peak in 9 kHz, up to 41.0 dBuV)"
    again[0].plot()
    with pytest.raises(BadInput, match="a final value of a single point, and no spectrum"):
        me.read_spectra(one)
    done = motoremi("import", tmp_path / "alone", "--spectrum", one)
    assert (done.returncode, done.stderr.startswith("motoremi: final values alone show nothing of the rest of the span")) == (2, True)
    # The workbench recognises them too.
    assert len(recognise((tmp_path / "good.dat").read_bytes(), "good.dat").finals) == 4
    # Without them the peak leaves it open.
    done = motoremi("import", tmp_path / "open", "--spectrum", file("", "none.dat"), "--limit", "cispr32-b", "--json")
    assert json.loads(done.stdout)["verdict"] == "marginal"


@pytest.mark.parametrize(("time", "dwell"), [("Final Meas Time;1.0;s\n", "1 s"), ("", "-")])
def test_a_measuring_time_that_is_not_stated_is_none_in_the_report(tmp_path: Path, time: str, dwell: str) -> None:
    path = write(tmp_path, dat().replace("159000", "1590000") + FINAL.replace("Final Meas Time;1.0;s\n", time))
    motoremi("import", tmp_path / "s", "--spectrum", path, "--limit", "cispr32-b")
    (table,) = final_tables(load(tmp_path / "s").analysis("prediction") or {})
    assert [dict(zip(table.columns, row, strict=True))["dwell"] for row in table.rows] == [dwell, dwell]


@pytest.mark.parametrize("lost", [len(";GND;N;\n"), len("8.50;GND;N;\n"), len(";N;\n")])
def test_a_file_that_is_cut_off_in_its_final_values_is_refused(tmp_path: Path, lost: int) -> None:
    """The level of the last row could be read as 7 dBuV instead of 78.5."""
    whole = dat() + FINAL
    path = write(tmp_path, whole[:-lost])
    for read in (me.read_emission, me.read_spectra):
        with pytest.raises(BadInput, match="the file is cut off"):
            read(path)
    # Without semicolons at the ends of its rows too.
    bare = whole.replace("GND;N;", "GND;N")
    with pytest.raises(BadInput, match="the file is cut off"):
        me.read_emission(write(tmp_path, bare[: 1 - lost]))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (
            "Final Meas Time;1.0;s",
            "Final Meas Time;50;ms",
            ", the highest 79.5 dBuV at 1.27 MHz (quasi-peak): they were measured for 50 ms where 1 s are needed",
        ),
        ("QUASI PEAK", "MIN PEAK", ": their detector is "),
        ("1;1280000", "1;9280000", ": spectrum.csv: some points lie in none of its scans"),
        ("78.50", "", "; their levels cannot be read"),
    ],
)
def test_final_values_that_cannot_be_used_leave_the_verdict_open(tmp_path: Path, old: str, new: str, why: str) -> None:
    scans = "Scan 1:\nStart;150000;Hz\nStop;500000;Hz\nRBW;200;Hz\nScan 2:\nStart;500000;Hz\nStop;2000000;Hz\nRBW;9000;Hz\n"
    rows = "".join(f"{hertz};20.00;\n" for hertz in (150000, 300000, 500000, 1000000, 2000000))
    head = f"Type;ESR7;\n{scans}TRACE 1:\n{DETECTOR}{UNITS}Values;5;\n{rows}"
    path = write(tmp_path, head + FINAL.replace(old, new))
    spectra, finals = me.read_emission(path)
    assert finals == []
    told = spectra[0].metadata["final_values_left_out"]
    assert told.startswith("2 final values in the file are left out")
    assert why in told
    assert f"note: spectrum.csv: {told}\n" in imported(tmp_path, "--spectrum", path)
    # The bandwidth is that of the scan in which they lie.
    spectra, finals = me.read_emission(write(tmp_path, head + FINAL))
    assert [one.resolution_bandwidth_hz for one in finals] == [9e3, 9e3]
    assert "final_values_left_out" not in spectra[0].metadata


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("1;1280000;78.50;GND;N;\n", "", "1 final value in the file is left out, 79.5 dBuV at 1.27 MHz (quasi-peak)"),
        ("79.50", "", "2 final values in the file are left out; their levels cannot be read"),
        (
            "y-Unit;dBuV;\nValues;2",
            "y-Unit;dBm;\nValues;2",
            "2 final values in the file are left out, the highest 186.5 dBuV at 1.27 MHz (quasi-peak)",
        ),
        ("x-Unit;Hz;\ny-Unit;dBuV;\nValues;2", "Values;2", "2 final values in the file are left out; their levels cannot be read"),
    ],
)
def test_what_is_told_of_final_values(tmp_path: Path, old: str, new: str, told: str) -> None:
    final = FINAL.replace(old, new).replace("Values;2", "Values;1" if told.startswith("1") else "Values;2")
    assert read_spectrum(write(tmp_path, dat() + final)).metadata["final_values_left_out"] == told


def test_two_scans_of_one_bandwidth_meet_at_one_frequency(tmp_path: Path) -> None:
    scans = "Scan 1:\nStart;150000;Hz\nStop;500000;Hz\nRBW;9000;Hz\nScan 2:\nStart;500000;Hz\nStop;1000000;Hz\nRBW;9000;Hz\n"
    rows = "150000;40.00;\n500000;44.00;\n500000;43.00;\n1000000;42.00;\n"
    path = write(tmp_path, f"Type;ESR7;\n{scans}TRACE 1:\n{DETECTOR}{UNITS}Values;4;\n{rows}")
    spectrum = read_spectrum(path)
    assert spectrum.frequency_hz.tolist() == [150e3, 500e3, 1e6]
    assert spectrum.level_dbuv.tolist() == [40, 44, 42]
    assert import_notes([spectrum]) == ["spectrum.csv: 0.5 MHz occurs twice, readings up to 1 dB apart: the higher is kept"]


# Keysight

KEYSIGHT = """Trace
Swept SA
A.25.08,N9038A
526 CR3 DP2 EDP EMC LSN NFE P26 PFR TDS ,01
Segment,0
Number of Points,3
Average Type,LogPower(Video)
RBW,9000
RBW Filter,Gaussian
RBW Filter BW,6dB
Ref Level Offset,0
External Gain,0
Trace Type,Maxhold
Detector,Peak
Trace Math,Off
Normalize,Off
Trace Name,Trace1
X Axis Units,Hz
Y Axis Units,dBuV
DATA
150000,12.7683034120476
154500,8.69782545038416
159000,8.70406796244437
"""


def test_one_trace_of_a_keysight_receiver(tmp_path: Path) -> None:
    spectrum = read_spectrum(write(tmp_path, KEYSIGHT.replace("\n", "\r\n")))
    assert (spectrum.detector, spectrum.resolution_bandwidth_hz) == ("peak", 9e3)
    assert spectrum.frequency_hz.tolist() == [150e3, 154.5e3, 159e3]
    assert spectrum.level_dbuv[0] == 12.7683034120476
    assert spectrum.metadata == {"trace": "Trace1", "source": "spectrum.csv", "format": "keysight-trace"}
    in_dbm = read_spectrum(write(tmp_path, KEYSIGHT.replace("dBuV", "dBm").replace("150000,12.7", "150000,-94.2")))
    assert in_dbm.level_dbuv[0] == pytest.approx(-94.2683034120476 + 106.98970004336019)
    with pytest.raises(BadInput, match="is the spectrum of a receiver"):
        read_impedance(write(tmp_path, KEYSIGHT), "short")


def test_a_bandwidth_at_3_db_is_told_at_6_db(tmp_path: Path) -> None:
    path = write(tmp_path, KEYSIGHT.replace("BW,6dB", "BW,3dB").replace("Offset,0", "Offset,10"))
    spectrum = read_spectrum(path)
    # A Gaussian filter falls by 6 dB at sqrt(2) times the distance at which it falls by 3 dB.
    assert spectrum.resolution_bandwidth_hz == pytest.approx(9e3 * np.sqrt(2))
    told = imported(tmp_path, "--spectrum", path)
    assert "note: spectrum.csv: its bandwidth is stated at 3 dB; at 6 dB, where CISPR 16-1-1 defines it, the filter has 12.73 kHz" in told
    assert "note: spectrum.csv: the analyser has applied a ref level offset of 10 dB; it must not be in --corrections" in told


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("Trace\n", "AllTrace\n", "save each trace by itself"),
        ("Type,Maxhold", "Type,Minhold", "the setting 'trace type' is 'Minhold'; set it to maxhold"),
        ("Detector,Peak", "Detector,Normal", "the detector is 'normal'"),
        ("Detector,Peak", "Detector,Average", "the setting 'average type' is 'LogPower(Video)'; set it to voltage"),
        ("Math,Off", "Math,PDiff", "the setting 'trace math' is 'PDiff'"),
        ("Units,dBuV", "Units,dBuA", "the setting 'y axis units' is 'dBuA'; set it to dbuv or dbm"),
        ("Units,Hz", "Units,s", "the setting 'x axis units' is 's'; set it to hz"),
        ("RBW,9000\n", "", "does not state the resolution bandwidth"),
        ("BW,6dB", "BW,Noise", "the setting 'rbw filter bw' is 'Noise'"),
        ("159000,8.70406796244437\n", "", "2 rows, 3 announced; the file is cut off"),
        ("44437\n", "", "the file is cut off"),
        (",8.70406796244437\n", "", "1 values where frequency and level are needed"),
    ],
)
def test_a_keysight_trace_that_is_refused(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert KEYSIGHT.count(old) >= 1
    assert says in refusal(write(tmp_path, KEYSIGHT.replace(old, new, 1)))


def test_an_import_tells_every_gap_of_a_limit_also_to_machines(tmp_path: Path) -> None:
    path = write(tmp_path, "Frequency (Hz),QP (dBuV),AV (dBuV)\n150e3,50,30\n154.5e3,40,20\n")
    rest = "the verdict is on the rest, 1.1 % of the limit's span"
    gaps = [f"{detector}: not measured at 159 kHz - 30 MHz; {rest}" for detector in ("quasi-peak", "average")]
    told = json.loads(imported(tmp_path / "j", "--spectrum", path, "--limit", "cispr32-b", "--json"))
    assert (told["verdict"], told["caveats"]) == ("pass", gaps)
    assert "; ".join(gaps) in imported(tmp_path / "t", "--spectrum", path, "--limit", "cispr32-b")
    with opened(tmp_path / "t" / "s") as store:
        files = {file.name: file for file in report_session(store)}
    skipped = [case.get("name") for case in ElementTree.parse(files["junit.xml"]).findall("testsuite[@name='emission']/testcase[skipped]")]
    assert skipped == ["quasi-peak limit, 159 kHz - 30 MHz", "average limit, 159 kHz - 30 MHz"]
    assert [gap["detector"] for gap in json.loads(files["report.json"].read_bytes())["prediction"]["not_measured"]] == ["quasi-peak", "average"]
