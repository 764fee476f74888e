"""Exported data are the same when they are read back."""

from __future__ import annotations

import io
import json
import sys

import h5py
import numpy as np
import pandas as pd
import pytest
from command_line import motoremi
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter
from motoremi.errors import BadInput
from motoremi.export.extras import needs
from motoremi.export.tables import csv_bytes, parquet_bytes
from motoremi.export.touchstone_file import touchstone_text
from motoremi.workflow import fit_session, opened


@pytest.fixture(scope="module")
def session(tmp_path_factory, measure):
    folder = tmp_path_factory.mktemp("export") / "motor"
    sweeps, _ = measure(5, (), 2)
    with SessionWriter.create(folder, {"title": "export"}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep.with_metadata(analyser="4294a", bias={"V": 0}))
        writer.add_spectrum(me.Spectrum("quasi-peak", [1e6, 2e6, 3e6], [40, 41.5, 39], 9e3, [0, 1, 0]))
        writer.close("done")
    with opened(folder) as store:
        fit_session(store)
    return folder


def invoke(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.stdout


@pytest.mark.slow
def test_every_format_at_once(session, tmp_path):
    files = {name: tmp_path / f"motor.{ending}" for name, ending in (("spice", "cir"), ("touchstone", "s1p"), ("csv", "csv"), ("hdf5", "h5"))}
    told = json.loads(invoke("export", session, *(x for name, file in files.items() for x in (f"--{name}", file)), "--json"))
    assert told["files"] == [str(file) for file in files.values()]
    assert told["spice"]["error_db"] < 0.05
    loaded = me.load(session)
    opens = [s for s in loaded.sweeps if s.termination == "open"]
    again = me.read_impedance(files["touchstone"], "open")
    np.testing.assert_allclose(again.impedance_ohm, np.mean([s.impedance_ohm for s in opens], axis=0), rtol=1e-10)
    np.testing.assert_array_equal(again.frequency_hz, opens[0].frequency_hz)
    table = pd.read_csv(files["csv"])
    second = table[(table.termination == "open") & (table.repeat == 2)]
    np.testing.assert_array_equal(second.resistance_ohm + 1j * second.reactance_ohm, opens[1].impedance_ohm)
    assert {"model_resistance_ohm", "model_reactance_ohm"} <= set(table.columns)
    with h5py.File(files["hdf5"]) as file:
        np.testing.assert_array_equal(file["sweeps/open-2/impedance_ohm"], opens[1].impedance_ohm)
        assert json.loads(file["sweeps/open-2"].attrs["metadata"])["bias"] == {"V": 0}
        assert file["spectra/1"].attrs["detector"] == "quasi-peak"
        assert file["spectra/1/overload"][:].tolist() == [False, True, False]
        assert json.loads(file["analysis/ladder"][()])["steps"]
        assert file["model/short/impedance_ohm"].shape == (401,)


def test_two_formats_in_one_file_are_refused(session, tmp_path):
    (tmp_path / "m").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "m")
    done = motoremi("export", session, "--csv", tmp_path / "m", "--hdf5", tmp_path / "link")
    assert (done.returncode, done.stdout) == (2, "")
    assert "two formats would be written to it" in done.stderr
    assert (tmp_path / "m").read_text() == "mine"


@pytest.mark.parametrize("name", ["m.s1p", "m.z1p"])
def test_touchstone_of_the_model(session, tmp_path, name):
    assert "short-circuit model" in invoke("export", session, "--touchstone", tmp_path / name, "--termination", "short", "--model")
    sweep = me.read_impedance(tmp_path / name, "short")
    model = me.load(session).ladder[-1]["fit"]["parameters"]
    s = 2j * np.pi * sweep.frequency_hz
    ra, la, ca = (model[key]["value"] for key in ("Ra", "La", "Ca"))
    np.testing.assert_allclose(sweep.impedance_ohm, 1 / (1 / (ra + s * la) + s * ca), rtol=1e-9)


@pytest.mark.slow
def test_parquet(session, tmp_path):
    invoke("export", session, "--parquet", tmp_path / "m.parquet")
    loaded = me.load(session)
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "m.parquet"), pd.read_parquet(io.BytesIO(parquet_bytes(loaded, me_fit(session)))))
    assert len(pd.read_parquet(tmp_path / "m.parquet")) == 4 * 401


def test_stated_noise_and_rounding_are_exported_and_read_back(tmp_path):
    frequency = np.geomspace(150e3, 30e6, 101)
    ohm = 5 + 2j * np.pi * frequency * 27e-6
    lines = [f"{f!r},{z.real:.3g},{z.imag:.3g}" for f, z in zip(frequency.tolist(), ohm * (1 + 1e-3 * np.sin(frequency)), strict=True)]
    (tmp_path / "rounded.csv").write_text("frequency_hz,resistance_ohm,reactance_ohm\n" + "\n".join(lines) + "\n")
    stated = [f"{f!r},{z.real!r},{z.imag!r},0.002" for f, z in zip(frequency.tolist(), (1.01 * ohm).tolist(), strict=True)]
    (tmp_path / "stated.csv").write_text("frequency_hz,resistance_ohm,reactance_ohm,sigma_relative\n" + "\n".join(stated) + "\n")
    files = (tmp_path / "rounded.csv", tmp_path / "stated.csv")
    invoke("import", tmp_path / "s", "--short", files[0], "--short", files[1], "--open", files[1], "--analyser", "none")
    invoke("export", tmp_path / "s", "--csv", tmp_path / "all.csv", "--hdf5", tmp_path / "all.h5")
    before = me.load(tmp_path / "s").sweeps
    after = [sweep for termination in ("short", "open") for sweep in me.read_impedances(tmp_path / "all.csv", termination)]
    for sweep, again in zip(before, after, strict=True):
        np.testing.assert_array_equal(sweep.impedance_ohm, again.impedance_ohm)
        for own, read in ((sweep.sigma_relative, again.sigma_relative), (sweep.rounding_relative, again.rounding_relative)):
            assert (own is None) == (read is None)
            if own is not None:
                np.testing.assert_array_equal(own, read)
    assert [sweep.sigma_relative is None for sweep in after] == [True, False, False]
    assert [sweep.rounding_relative is None for sweep in after] == [False, True, True]
    with h5py.File(tmp_path / "all.h5") as file:
        np.testing.assert_array_equal(file["sweeps/short-1/rounding_relative"], before[0].rounding_relative)
        assert "rounding_relative" not in file["sweeps/short-2"]
    arrays = me.to_xarray(me.load(tmp_path / "s"))
    np.testing.assert_array_equal(arrays["open_sigma_relative"], before[2].sigma_relative)
    # Of the two repeats one is rounded.
    np.testing.assert_allclose(arrays["short_rounding_relative"], before[0].rounding_relative / np.sqrt(2))
    assert "short_sigma_relative" not in arrays


def me_fit(session):
    from motoremi.workflow import ladder_of

    return ladder_of(me.load(session))[-1]


@pytest.mark.slow
def test_frames_and_labelled_arrays(session):
    loaded = me.load(session)
    sweep = loaded.sweeps[0]
    assert list(sweep.to_frame().columns) == ["frequency_hz", "resistance_ohm", "reactance_ohm"]
    assert list(loaded.spectra[0].to_frame().columns) == ["frequency_hz", "level_dbuv", "overload"]
    parameters = me_fit(session).to_frame()
    assert parameters.loc["La", "unit"] == "H"
    data = me.to_xarray(loaded)
    np.testing.assert_array_equal(data.short_ohm[0].values, sweep.impedance_ohm)
    assert data.sizes["open_repeat"] == 2
    assert data.spectrum_1_dbuv.attrs["detector"] == "quasi-peak"
    assert b"model" not in csv_bytes(loaded, None)


def test_wrong_use(session, tmp_path, monkeypatch):
    for arguments, says in (
        (("export", session), "nothing to export"),
        (("export", session, "--touchstone", tmp_path / "no" / "such" / "x.s1p", "--spice", tmp_path / "x.cir"), None),
    ):
        if says:
            with pytest.raises(BadInput, match=says):
                invoke(*arguments)
    with pytest.raises(BadInput, match="-50"):
        touchstone_text(np.array([1.0, 2.0]), np.array([-50 + 0j, 1 + 0j]), "S")
    monkeypatch.setitem(sys.modules, "nothing_like_it", None)
    with pytest.raises(BadInput, match=r"pip install 'motoremi\[hdf5\]'"):
        needs("no_such_module_at_all", "HDF5", "hdf5")


def test_a_session_without_a_fit(tmp_path, measure):
    sweeps, _ = measure(5, (), 1)
    with SessionWriter.create(tmp_path / "s", {"title": "x"}) as writer:
        writer.add_sweep(sweeps[0])
        writer.close("done")
    with pytest.raises(BadInput, match="motoremi fit"):
        invoke("export", tmp_path / "s", "--spice", tmp_path / "x.cir")
    assert not (tmp_path / "x.cir").exists()
    assert "short-circuit measurement" in invoke("export", tmp_path / "s", "--touchstone", tmp_path / "x.z1p")
    with pytest.raises(BadInput, match="no open-circuit sweep"):
        invoke("export", tmp_path / "s", "--touchstone", tmp_path / "y.s1p", "--termination", "open")


def paper_ohm(frequency_hz):
    """Both terminations of a motor by the paper's formula."""
    s = 2j * np.pi * frequency_hz
    winding = 1 / (1 / (2.3 + s * 24e-6) + s * 95e-12)
    frame = 1 / (1 / (18 + s * 700e-9 + 1 / (s * 310e-12)) + s * 150e-12)
    return {"short": winding, "open": winding + frame}


def with_one_mislabelled(folder):
    """A session whose third short sweep is an open one: the readings of each repeat, as they were given."""
    frequency, rng = np.geomspace(150e3, 30e6, 101), np.random.default_rng(4)
    given = []
    with SessionWriter.create(folder, {"title": "x"}) as writer:
        for named, seen in (("short", "short"), ("short", "short"), ("short", "open"), ("open", "open"), ("open", "open")):
            noise = 1e-3 * (rng.standard_normal(101) + 1j * rng.standard_normal(101))
            given.append(paper_ohm(frequency)[seen] * (1 + noise))
            writer.add_sweep(me.ImpedanceSweep(named, frequency, given[-1], metadata={"analyser": "none", "source": f"{len(given)}.csv"}))
        writer.close("done")
    return given


def test_touchstone_holds_the_mean_of_the_sweeps_that_a_fit_uses(tmp_path):
    given = with_one_mislabelled(tmp_path / "s")
    said = invoke("export", tmp_path / "s", "--touchstone", tmp_path / "m.z1p", "--termination", "short")

    read = me.read_impedance(tmp_path / "m.z1p", "short")
    np.testing.assert_allclose(read.impedance_ohm, (given[0] + given[1]) / 2, rtol=1e-12)
    assert "mean of 2 sweeps" in (tmp_path / "m.z1p").read_text()
    assert "not used by fits, because of the other termination: short sweep 3.csv" in said
    # Tables hold every sweep as it was given, and say so.
    said = invoke("export", tmp_path / "s", "--csv", tmp_path / "m.csv")
    assert len(pd.read_csv(tmp_path / "m.csv")) == 5 * 101
    assert "not used by fits, because of the other termination: short sweep 3.csv" in said


@pytest.fixture(scope="module")
def under_conditions(tmp_path_factory):
    """A session with sweeps under two conditions, one of them with a value, and a value from another meter; and what was written, in order."""
    from motoremi.data.conditions import parse_condition, parse_value

    folder = tmp_path_factory.mktemp("conditions") / "s"
    frequency, rng = np.geomspace(150e3, 30e6, 41), np.random.default_rng(4)
    written = []
    with SessionWriter.create(folder, {"title": "x"}) as writer:
        for termination, text in (
            ("short", ""),
            ("short", ""),
            ("open", ""),
            ("short", "far-end-grounded"),
            ("open", "second-temperature=53degC"),
            ("open", "second-temperature=53degC"),
        ):
            ohm = paper_ohm(frequency)[termination] * (1 + 1e-3 * (rng.standard_normal(41) + 1j * rng.standard_normal(41)))
            sweep = me.ImpedanceSweep(termination, frequency, ohm, metadata={"analyser": "none"})
            writer.add_sweep(sweep.under(parse_condition(text)) if text else sweep)
            written.append((termination, text, ohm))
        writer.add_value(parse_value("dc-resistance=2.25ohm+-0.01ohm"))
        writer.close("done")
    with opened(folder) as store:
        fit_session(store)
    return folder, written


EXPECTED = [
    ("short", 1, None, None, None),
    ("short", 2, None, None, None),
    ("open", 1, None, None, None),
    ("short", 1, "far-end-grounded", None, None),
    ("open", 1, "second-temperature", 53.0, "degC"),
    ("open", 2, "second-temperature", 53.0, "degC"),
]


def check_table(table, written):
    """Every sweep, in order, with its condition; the model only for the motor as it is."""
    assert len(table) == 6 * 41
    for number, ((termination, repeat, condition, value, unit), (_, _, ohm)) in enumerate(zip(EXPECTED, written, strict=True)):
        rows = table.iloc[41 * number : 41 * (number + 1)]
        assert set(rows.termination) == {termination}
        assert set(rows.repeat) == {repeat}
        for name, expected in (("condition", condition), ("condition_value", value), ("condition_unit", unit)):
            assert rows[name].isna().all() if expected is None else set(rows[name]) == {expected}
        np.testing.assert_array_equal(rows.resistance_ohm + 1j * rows.reactance_ohm, ohm)
        assert rows.model_resistance_ohm.isna().all() == (condition is not None)


@pytest.mark.parametrize(("option", "read"), [("csv", pd.read_csv), ("parquet", pd.read_parquet)])
def test_tables_hold_the_sweeps_under_a_condition(under_conditions, tmp_path, option, read):
    folder, written = under_conditions
    said = invoke("export", folder, f"--{option}", tmp_path / "table")
    check_table(read(tmp_path / "table"), written)
    assert "sweeps (3 of 6 under a condition) and model" in said
    assert "single values are not in a table of sweeps: --hdf5" in said


def test_hdf5_holds_the_sweeps_under_a_condition_and_the_single_values(under_conditions, tmp_path):
    folder, written = under_conditions
    assert "single values" in invoke("export", folder, "--hdf5", tmp_path / "m.h5")
    with h5py.File(tmp_path / "m.h5") as file:
        assert sorted(file["sweeps"]) == ["open-1", "short-1", "short-2"]
        np.testing.assert_array_equal(file["conditions/1/short-1/impedance_ohm"], written[3][2])
        np.testing.assert_array_equal(file["conditions/2/open-2/impedance_ohm"], written[5][2])
        assert dict(file["conditions/1"].attrs) == {"condition": "far-end-grounded"}
        assert dict(file["conditions/2"].attrs) == {"condition": "second-temperature", "condition_value": 53.0, "condition_unit": "degC"}
        assert file["values/1"][()] == 2.25
        assert dict(file["values/1"].attrs) == {"name": "dc-resistance", "unit": "Ohm", "sigma": 0.01}


def test_labelled_arrays_hold_the_sweeps_under_a_condition_and_the_single_values(under_conditions):
    folder, written = under_conditions
    data = me.to_xarray(me.load(folder))
    np.testing.assert_array_equal(data.short_ohm.values, [written[0][2], written[1][2]])
    np.testing.assert_array_equal(data.condition_1_short_ohm.values, [written[3][2]])
    np.testing.assert_array_equal(data.condition_2_open_ohm.values, [written[4][2], written[5][2]])
    assert data.condition_2_open_ohm.attrs == {"units": "ohm", "condition": "second-temperature", "condition_value": 53.0, "condition_unit": "degC"}
    assert float(data.value_1) == 2.25
    assert data.value_1.attrs == {"name": "dc-resistance", "units": "Ohm", "sigma": 0.01}
