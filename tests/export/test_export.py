"""Exported data are the same when they are read back."""

from __future__ import annotations

import io
import json
import sys

import h5py
import numpy as np
import pandas as pd
import pytest
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
