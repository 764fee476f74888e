"""Pads, cables, transducers and fixtures: what is added to a reading, what is refused, and that verdicts rest on corrected levels."""

from __future__ import annotations

import io
import json
import math
import sys
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from skrf.io.touchstone import Touchstone

import motoremi as me
from motoremi.cli import main
from motoremi.data.corrections import Corrections, read_corrections
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.emission.limit import find_limit
from motoremi.emission.setup import Setup
from motoremi.errors import BadInput
from motoremi.run.runner import start_document
from motoremi.schema.bench_file import load_bench_file
from motoremi.schema.procedure import load_procedure

PAD = '[[correction]]\nname = "pad"\nrole = "receiver"\nkind = "loss"\ndb = 10.0\n'
AXIS = 150e3 + 4.5e3 * np.arange(400)


def corrections_file(folder: Path, text: str) -> Path:
    path = folder / "corrections.toml"
    path.write_text(text)
    return path


def spectrum_file(folder: Path, margin_db: float, detector: str = "quasi-peak") -> Path:
    """A reading that stays below its class B limit by `margin_db` everywhere."""
    line = find_limit("cispr32-b").line(detector)
    assert line is not None
    levels = line.level_dbuv(AXIS) - margin_db
    path = folder / f"{detector}.csv"
    rows = "".join(f"{f!r},{level!r}\n" for f, level in zip(AXIS.tolist(), levels.tolist(), strict=True))
    path.write_text(f"# detector: {detector}\n# rbw_hz: 9000\nfrequency_hz,level_dbuv\n{rows}")
    return path


def command(*arguments: object) -> tuple[int, str, str]:
    """Exit status and what was said on both outputs, without another process."""
    out, told, status = io.StringIO(), io.StringIO(), 0
    with mock.patch.object(sys, "argv", ["motoremi", *map(str, arguments)]), redirect_stdout(out), redirect_stderr(told):
        try:
            main()
        except SystemExit as ended:
            status = int(ended.code or 0)
    return status, out.getvalue(), told.getvalue().strip()


def test_reading_plus_loss_minus_gain_plus_transducer(tmp_path: Path) -> None:
    (tmp_path / "cable.csv").write_text("frequency_hz,db\n100e3,1\n10e6,3\n")
    text = PAD + (
        '[[correction]]\nname = "amplifier"\nkind = "gain"\ndb = "20 dB"\n'
        '[[correction]]\nname = "divider"\nkind = "transducer"\ndb = -4.5\n'
        '[[correction]]\nname = "cable"\nkind = "loss"\nfile = "cable.csv"\n'
    )
    chain = read_corrections(corrections_file(tmp_path, text))
    # Half way between the ends of the cable's table on a logarithmic axis it loses 2 dB.
    assert chain.added_db("receiver", np.array([1e6])) == pytest.approx([10 - 20 - 4.5 + 2], abs=1e-12)
    assert chain.added_db("analyser", np.array([1e6])) == pytest.approx([0.0])


@pytest.mark.slow
def test_a_motor_over_the_limit_behind_a_pad_fails(tmp_path: Path) -> None:
    """6 dB below the limit at the receiver, 4 dB above it at the LISN."""
    files = [spectrum_file(tmp_path, 6.0), spectrum_file(tmp_path, 30.0, "average")]
    assert command("import", tmp_path / "bare", "--spectrum", *files)[0] == 0
    assert command("predict", tmp_path / "bare")[0] == 0
    chain = corrections_file(tmp_path, PAD)
    assert command("import", tmp_path / "told", "--spectrum", *files, "--corrections", chain)[0] == 0
    status, out, _ = command("predict", tmp_path / "told", "--json")
    told = json.loads(out)
    assert status == 1
    assert told["verdict"] == "fail"
    assert [entry["name"] for entry in told["corrections"]] == ["pad"]
    raw, level = (np.array(told[key]["quasi-peak"]) for key in ("readings_dbuv", "measured_dbuv"))
    assert level - raw == pytest.approx(np.full(AXIS.size, 10.0), abs=1e-9)
    # Told and judged in one go.
    assert command("import", tmp_path / "once", "--spectrum", *files, "--limit", "cispr32-b")[0] == 0
    status, out, _ = command("import", tmp_path / "both", "--spectrum", *files, "--corrections", chain, "--limit", "cispr32-b", "--json")
    assert (status, json.loads(out)["verdict"]) == (1, "fail")
    stored = me.load(tmp_path / "told")
    assert stored.spectra[0].level_dbuv == pytest.approx(me.load(tmp_path / "bare").spectra[0].level_dbuv)
    assert stored.corrected_spectra[0].level_dbuv == pytest.approx(stored.spectra[0].level_dbuv + 10)


@pytest.mark.slow
def test_corrections_given_to_predict_take_the_place_of_those_before(tmp_path: Path) -> None:
    """The same file told twice is applied once."""
    chain = corrections_file(tmp_path, PAD)
    files = [spectrum_file(tmp_path, 6.0), spectrum_file(tmp_path, 30.0, "average")]
    command("import", tmp_path / "s", "--spectrum", *files, "--corrections", chain)
    worst = []
    for again in (["--corrections", chain], []):
        status, out, _ = command("predict", tmp_path / "s", "--json", *again)
        assert status == 1
        worst.append(min(one["worst_margin_db"] for one in json.loads(out)["judged"] if one["line"] == "quasi-peak"))
    assert worst == pytest.approx([-4.0, -4.0], abs=1e-6)


def test_uncertainty_of_a_correction_widens_the_guard_band(tmp_path: Path) -> None:
    files = [spectrum_file(tmp_path, 14.0), spectrum_file(tmp_path, 30.0, "average")]
    command("import", tmp_path / "s", "--spectrum", *files, "--corrections", corrections_file(tmp_path, PAD))
    assert json.loads(command("predict", tmp_path / "s", "--json")[1])["verdict"] == "pass"
    wide = corrections_file(tmp_path, PAD + "uncertainty_db = 3.0\n")
    told = json.loads(command("predict", tmp_path / "s", "--json", "--corrections", wide)[1])
    # 4 dB below the limit, with 3.4 dB and 3 dB in quadrature.
    assert told["expanded_uncertainty_db"] == pytest.approx(math.hypot(3.4, 3.0))
    assert told["verdict"] == "marginal"


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("frequency_hz,db\n1e5,1\n1e6,\n30e6,2\n", "a value is missing"),
        ("frequency_hz,db\n1e5,1\n30e6,nan\n", "nan"),
        ("frequency_hz,db\n1e5,1\n1e5,2\n30e6,2\n", "occurs twice"),
        ("frequency_hz,db\n30e6,1\n1e5,2\n", "must increase"),
        ("frequency_hz,loss\n1e5,1\n30e6,2\n", "needs one column in dB"),
        ("frequency_hz,np\n1e5,1\n30e6,2\n", "needs one column in dB"),
        ("# unit: V\nfrequency_hz,db\n1e5,1\n30e6,2\n", "'V' is not in decibel"),
        ("frequency_hz,db\n1e6,1\n30e6,2\n", "nothing is extrapolated"),
        ("frequency_hz,db\n1e5,1\n1e6,2\n", "nothing is extrapolated"),
        ("frequency_hz,db\n1e5,-1\n30e6,-2\n", 'kind = "gain"'),
        ("", "cable.csv"),
    ],
)
def test_a_table_that_cannot_be_used_is_one_line(tmp_path: Path, table: str, says: str) -> None:
    (tmp_path / "cable.csv").write_text(table)
    chain = corrections_file(tmp_path, '[[correction]]\nname = "cable"\nkind = "loss"\nfile = "cable.csv"\n')
    status, _, told = command("import", tmp_path / "s", "--spectrum", spectrum_file(tmp_path, 6.0), "--corrections", chain)
    assert status != 0
    assert says in told
    assert "\n" not in told
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[[correction]]\nname = "pad"\nkind = "loss"\n', "give db"),
        ('[[correction]]\nname = "pad"\nkind = "loss"\ndb = 10\nfile = "x.csv"\n', "keep one"),
        ('[[correction]]\nname = "pad"\nkind = "loss"\ndb = -10\n', 'kind = "gain"'),
        ('[[correction]]\nname = "pad"\nkind = "loss"\ndb = "10 dBm"\n', "expected dB"),
        ('[[correction]]\nname = "pad"\nkind = "atten"\ndb = 10\n', "loss"),
        ('[[correction]]\nname = "pad"\nkind = "loss"\ndb = 10\ncolour = "red"\n', "unknown key"),
        ('[[correction]]\nname = "pad"\nkind = "loss"\nunit = "dB/m"\ndb = 10\n', "only a transducer"),
        ('[[correction]]\nname = "pad"\nkind = "loss"\ndb = [1, 2]\nfrequency_hz = [2e5, 1e5]\n', "must increase"),
        ('[[correction]]\nname = "pad"\nkind = "loss"\ndb = 1000\n', "toml: pad: db: 1000 dB is out of range (-200 to 200 dB)"),
        ('[correction]\nname = "pad"\nkind = "loss"\ndb = 10\n', "write [[correction]], with two brackets"),
        ("db = 10\n", "[[correction]]"),
        ("[[correction]\n", "not TOML"),
    ],
)
def test_a_correction_that_cannot_be_used_is_one_line(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(BadInput) as told:
        read_corrections(corrections_file(tmp_path, text))
    assert says in str(told.value)
    assert "\n" not in str(told.value)


def test_a_wrong_sign_is_asked_about_once(tmp_path: Path) -> None:
    asked: list[str] = []
    path = corrections_file(tmp_path, PAD.replace("10.0", "-10.0"))
    chain = read_corrections(path, lambda question: not asked.append(question))
    assert len(asked) == 1
    assert "gain" in asked[0]
    assert (chain.entries[0].kind, chain.entries[0].db) == ("gain", 10.0)
    assert chain.added_db("receiver", AXIS)[0] == -10.0


def test_levels_behind_a_current_probe_are_held_against_a_limit_of_currents(tmp_path: Path) -> None:
    text = '[[correction]]\nname = "probe"\nkind = "transducer"\ndb = -15.0\nunit = "dB(1/Ohm)"\n'
    chain = read_corrections(corrections_file(tmp_path, text))
    assert chain.level_unit == "dBuA"
    files = [spectrum_file(tmp_path, 6.0)]
    command("import", tmp_path / "s", "--spectrum", *files, "--corrections", tmp_path / "corrections.toml")
    status, _, told = command("predict", tmp_path / "s")
    assert status != 0
    assert "dBuA" in told
    assert "limit" in told
    own = tmp_path / "own.toml"
    own.write_text('title = "currents"\nunit = "dBuA"\n[[line]]\ndetector = "quasi-peak"\nsegments = [[150e3, 30e6, 20, 20]]\n')
    assert command("predict", tmp_path / "s", "--limit", own)[0] == 1


PROBE = '[[correction]]\nname = "probe"\nkind = "transducer"\nfile = "probe.csv"\n'


def probe_factor(folder: Path, table: str, text: str = PROBE) -> Corrections:
    (folder / "probe.csv").write_text(f"{table}\n100e3,10\n30e6,10\n", encoding="utf-8")
    return read_corrections(corrections_file(folder, text))


@pytest.mark.parametrize(
    "table",
    [
        "Frequency (Hz),Zt (dBOhm)",
        "Frequency (Hz),Zt dB(Ohm)",
        "Frequency (Hz),Zt [dBΩ]",
        "Frequency (Hz),factor dB(\u2126)",
        "frequency_hz,zt_db",
        "# Unit: dB Ohm\nfrequency_hz,db",
    ],
)
def test_a_transfer_impedance_is_subtracted(tmp_path: Path, table: str) -> None:
    """Zt of 10 dB(Ohm) is sqrt(10) ohm: 40 dBuV, 100 uV, are 31.6 uA, 30 dBuA."""
    chain = probe_factor(tmp_path, table)
    assert chain.level_unit == "dBuA"
    spectrum = chain.corrected_spectrum(Spectrum("peak", AXIS, np.full(AXIS.size, 40.0)))
    current_ua = 10 ** (40 / 20) / math.sqrt(10)
    assert spectrum.level_dbuv == pytest.approx(np.full(AXIS.size, 20 * math.log10(current_ua)))
    assert spectrum.level_dbuv[0] == pytest.approx(30.0)
    assert spectrum.summary().endswith("up to 30.0 dBuA")
    assert chain.entries[0].describe().startswith("probe: transducer of 10 to 10 dB(Ohm)")
    again = Corrections.of(chain.to_list(), "stored")
    assert again.added_db("receiver", AXIS) == pytest.approx(chain.added_db("receiver", AXIS))


def test_a_transfer_admittance_is_added(tmp_path: Path) -> None:
    assert probe_factor(tmp_path, "Frequency (Hz),factor dB(1/Ohm)").added_db("receiver", AXIS)[0] == 10.0


def test_a_transfer_impedance_without_a_file(tmp_path: Path) -> None:
    text = '[[correction]]\nname = "probe"\nkind = "transducer"\nunit = "dBΩ"\ndb = 10.0\n'
    chain = read_corrections(corrections_file(tmp_path, text))
    assert (chain.entries[0].unit, chain.level_unit, chain.added_db("receiver", AXIS)[0]) == ("dB(Ohm)", "dBuA", -10.0)


@pytest.mark.parametrize(
    ("table", "text", "says"),
    [
        ("# unit: dB(1/Ohm)\nFrequency (Hz),Zt dB", PROBE, r"a transfer impedance .* is in dB\(Ohm\), not in dB\(1/Ohm\)"),
        ("Frequency (Hz),Zt dB(Ohm)", PROBE + 'unit = "dB(1/Ohm)"\n', r"its values are in dB\(Ohm\), but probe says unit = 'dB\(1/Ohm\)'"),
        ("Frequency (Hz),factor dB(1/Ohm)", PROBE + 'unit = "dB/m"\n', "correct one of them"),
        ("Frequency (Hz),Zt (dBOhm)", PROBE.replace("transducer", "loss"), "a loss is in dB; only a transducer has the unit dB"),
    ],
)
def test_a_transfer_impedance_that_contradicts_its_unit_is_refused(tmp_path: Path, table: str, text: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        probe_factor(tmp_path, table, text)


@pytest.mark.parametrize(
    ("kind", "title", "other"),
    [
        ("loss", "Gain (dB)", "gain"),
        ("transducer", "preamp gain dB", "gain"),
        ("gain", "Insertion Loss (dB)", "loss"),
        ("gain", "attenuation_db", "loss"),
    ],
)
def test_a_title_that_says_the_other_sign_is_refused(tmp_path: Path, kind: str, title: str, other: str) -> None:
    """A gain of 20 dB as a loss is an error of 40 dB."""
    with pytest.raises(BadInput, match=f'would apply with the wrong sign; set kind = "{other}"'):
        probe_factor(tmp_path, f"Frequency (MHz),{title}", PROBE.replace("transducer", kind))
    own = {"loss": "Insertion Loss (dB)", "gain": "Gain (dB)", "transducer": "factor (dB)"}[kind]
    assert probe_factor(tmp_path, f"Frequency (Hz),{own}", PROBE.replace("transducer", kind))


def test_negative_values_that_may_be_right_are_told(tmp_path: Path) -> None:
    text = '[[correction]]\nname = "LISN"\nkind = "transducer"\ndb = -10.0\n'
    (remark,) = read_corrections(corrections_file(tmp_path, text)).remarks()
    assert remark == "the transducer 'LISN' is negative, down to -10 dB, where it has the opposite effect: check its sign"
    assert not any("negative" in one for one in probe_factor(tmp_path, "Frequency (Hz),factor (dB)").remarks())


def test_currents_are_told_in_their_unit(tmp_path: Path) -> None:
    probe_factor(tmp_path, "Frequency (Hz),Zt (dBOhm)")
    status, out, _ = command("import", tmp_path / "s", "--spectrum", spectrum_file(tmp_path, 6.0), "--corrections", tmp_path / "corrections.toml")
    assert status == 0
    assert "up to 50.0 dBuA" in out


def test_what_the_receiver_applied_itself_is_not_applied_twice() -> None:
    chain = Corrections.of([{"name": "LISN", "role": "receiver", "kind": "transducer", "db": 10.0}], "test")
    spectrum = Spectrum("peak", AXIS, np.zeros(AXIS.size), 9e3, None, {"transducer": "ENV216"})
    with pytest.raises(BadInput, match="ENV216"):
        chain.corrected_spectrum(spectrum)


def test_a_fixture_is_de_embedded_by_its_touchstone_file(tmp_path: Path) -> None:
    """A lead of 100 nH and 20 pF in front of a load, as a two-port of ideal parts worked out by chain matrices."""
    frequency = np.geomspace(100e3, 40e6, 2001)
    w = 2 * np.pi * frequency
    series, shunt = 1j * w * 100e-9, 1j * w * 20e-12
    a, b, c, d = 1 + series * shunt, series, shunt, np.ones_like(series)
    total = a + b / 50 + c * 50 + d
    s11, s21, s22 = (a + b / 50 - c * 50 - d) / total, 2 / total, (-a + b / 50 - c * 50 + d) / total
    rows = zip(frequency, s11, s21, s21, s22, strict=True)
    text = "# HZ S RI R 50\n" + "".join(f"{f!r} " + " ".join(f"{v.real!r} {v.imag!r}" for v in vs) + "\n" for f, *vs in rows)
    (tmp_path / "fixture.s2p").write_text(text.replace("np.float64(", "").replace(")", ""))
    assert Touchstone(str(tmp_path / "fixture.s2p")).rank == 2
    chain = read_corrections(
        corrections_file(tmp_path, '[[correction]]\nname = "fixture"\nrole = "analyser"\nkind = "loss"\nfile = "fixture.s2p"\n')
    )
    axis = np.geomspace(150e3, 30e6, 50)
    load = 3 + 1j * 2 * np.pi * axis * 20e-6
    w = 2 * np.pi * axis
    seen = (load + 1j * w * 100e-9 * (1 + load * 1j * w * 20e-12)) / (1 + load * 1j * w * 20e-12)
    found = chain.corrected_sweep(ImpedanceSweep("open", axis, seen)).impedance_ohm
    # 2001 points over 2.6 decades: what is straight between them is off by (ln(400)/2000)^2/8 of the S-parameters, 1e-6,
    # which an impedance of up to 3.8 kOhm multiplies by |Z|/50.
    assert np.max(np.abs(found / load - 1)) < 2e-4


def test_a_run_is_refused_before_anything_is_connected_where_a_table_ends(tmp_path: Path) -> None:
    bench = tmp_path / "bench.toml"
    (tmp_path / "cable.csv").write_text("frequency_hz,db\n1e6,1\n30e6,2\n")
    bench.write_text('backend = "sim"\n[[correction]]\nname = "cable"\nkind = "loss"\nfile = "cable.csv"\n')
    with pytest.raises(BadInput, match="150 kHz"):
        start_document(load_procedure("emission_only"), load_bench_file(bench))


def test_a_receivers_noise_behind_a_pad_is_predicted_higher_by_the_pad(tmp_path: Path) -> None:
    chain = read_corrections(corrections_file(tmp_path, PAD))
    setup = Setup()
    silent = replace(setup, source=replace(setup.source, step_v=0.0))
    motor = np.full(AXIS.size, 1e3 + 0j)
    bare = silent.levels(AXIS, motor, weigh=False)["average"]
    padded = replace(silent, corrections=chain).levels(AXIS, motor, weigh=False)["average"]
    assert padded - bare == pytest.approx(np.full(AXIS.size, 10.0), abs=1e-9)


def test_the_same_correction_twice_is_noted(tmp_path: Path) -> None:
    pad = "[[correction]]\nname = 'pad'\nrole = 'receiver'\nkind = 'loss'\ndb = 10\n"
    assert read_corrections(corrections_file(tmp_path, pad)).remarks() == []
    assert read_corrections(corrections_file(tmp_path, 2 * pad)).remarks() == [
        "the correction 'pad' is entered twice with the same values, and both are applied"
    ]


def test_a_table_without_column_names_is_told_which_it_needs(tmp_path: Path) -> None:
    (tmp_path / "cable.csv").write_text("150000,1.0\n30000000,2.0\n")
    text = "[[correction]]\nname = 'cable'\nrole = 'receiver'\nkind = 'loss'\nfile = 'cable.csv'\n"
    with pytest.raises(BadInput, match="frequency_hz,db"):
        read_corrections(corrections_file(tmp_path, text))
