"""pandas where its users are: sweeps in and out, comparisons, diagnoses, fleets and scoreboards out."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import motoremi as me
from motoremi.blind import hard, scoreboard
from motoremi.blind.cases import Case
from motoremi.data.plain import plain
from motoremi.fleet.fleet_frames import frames_of, table_of
from motoremi.fleet.run import FIGURES, RESULTS
from motoremi.fleet.statistics import fleet_figures

FREQUENCY = np.geomspace(150e3, 30e6, 41)
HIDDEN = Case(777, 8, "one", ("terminal-capacitance",), 1233665122)
IMPEDANCE = 0.3 + 2j * np.pi * FREQUENCY * 12e-6 + 1 / 3


@pytest.fixture(scope="module")
def fit() -> me.Fit:
    return me.fit(me.dc_motor(), HIDDEN.sweeps())


def test_a_sweep_goes_out_and_comes_back_exactly():
    sweep = me.ImpedanceSweep("open", FREQUENCY, IMPEDANCE, 1e-3)
    back = me.ImpedanceSweep.from_frame("open", sweep.to_frame(), {"source": "a notebook"}, "second-temperature=53degC")
    np.testing.assert_array_equal(back.frequency_hz, sweep.frequency_hz)
    np.testing.assert_array_equal(back.impedance_ohm, sweep.impedance_ohm)
    np.testing.assert_array_equal(back.sigma_relative, sweep.sigma_relative)
    assert back.metadata == {"source": "a notebook"}
    assert str(back.condition) == "second-temperature=53degC"


def test_names_and_units_are_those_of_files():
    table = pd.DataFrame({"remark": "x", "f (MHz)": FREQUENCY / 1e6, "|Z| in kOhm": np.abs(IMPEDANCE) / 1e3, "theta [rad]": np.angle(IMPEDANCE)})
    sweep = me.ImpedanceSweep.from_frame("short", table.set_index("remark").reset_index())
    np.testing.assert_allclose(sweep.frequency_hz, FREQUENCY, rtol=1e-14)
    np.testing.assert_allclose(sweep.impedance_ohm, IMPEDANCE, rtol=1e-12)
    whole = me.ImpedanceSweep.from_frame("short", pd.DataFrame({"f (Hz)": FREQUENCY, "Z (Ohm)": IMPEDANCE}))
    np.testing.assert_array_equal(whole.impedance_ohm, IMPEDANCE)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda t: t.rename(columns={"reactance_ohm": "reactance"}), "the column 'reactance' has no unit"),
        (lambda t: t.rename(columns={"reactance_ohm": "reactance_volt"}), "unit 'volt'"),
        (lambda t: t.rename(columns={"resistance_ohm": "x1", "reactance_ohm": "x2"}), "frequency_hz, x1, x2"),
        (lambda t: t.drop(columns="frequency_hz"), "needs the columns frequency_hz"),
        (lambda t: pd.concat([t, t[["resistance_ohm"]]], axis=1), "both hold the resistance"),
        (lambda t: t.assign(reactance_ohm=t.reactance_ohm.where(t.index != 3)), "frame, line 4, column 'reactance_ohm': nan"),
        (lambda t: t.astype({"resistance_ohm": object}).replace({"resistance_ohm": {t.resistance_ohm[0]: "0,63"}}), "is not a number"),
        (lambda t: t.sample(frac=1, random_state=1), "increas"),
        (lambda t: t.iloc[:4], "points"),
    ],
)
def test_what_is_in_doubt_is_refused(change, says):
    table = me.ImpedanceSweep("open", FREQUENCY, IMPEDANCE).to_frame()
    with pytest.raises(me.BadInput, match=says):
        me.ImpedanceSweep.from_frame("open", change(table))


@pytest.mark.slow
def test_a_comparison_is_a_row_for_each_sweep_and_band(fit):
    comparison = me.compare(fit)
    table = comparison.to_frame()
    assert len(table) == len(comparison.bands)
    first = comparison.bands[0]
    assert table.loc[0, ["sweep", "low_hz", "high_hz"]].tolist() == [first["sweep"], *first["band_hz"]]
    assert table["rms_error_percent"].tolist() == [band["rms_error_percent"] for band in comparison.bands]
    assert {"points", "max_error_db", "max_phase_deg", "verdict"} <= set(table.columns)


@pytest.mark.slow
@pytest.mark.usefixtures("few_effects")
def test_a_diagnosis_is_a_row_for_each_candidate(fit):
    diagnosis = me.diagnose(fit)
    table = diagnosis.to_frame()
    assert table.index.tolist() == [one.effect for one in diagnosis.candidates]
    assert table.loc["terminal-capacitance", "probability"] == diagnosis.probabilities["terminal-capacitance"]
    assert table["delta_bic"].min() == 0
    told = diagnosis.to_dict()["candidates"]
    assert set(table.columns) == set(told[0]) - {"effect", "parameters"}


def result(number: int, inductance: float) -> dict:
    """One session of a fleet."""
    parameters = {
        "La": {"value": inductance, "unit": "H"},
        "skin-effect.corner_hz": {"value": 2e5, "unit": "Hz"},
        "Cf": {"value": 1e-9, "unit": "F"},
    }
    best = {"converged": True, "parameters": parameters, "rms_error_percent": 0.1 * number}
    return {"session": f"m{number:02d}", "status": "done", "time": f"2026-01-{number:02d}T00:00:00+00:00", "serial": f"A-{number}", "best": best}


def test_a_diagnosed_fleet_has_the_answers_and_the_error_bars_beside_the_values(tmp_path):
    answer = {"verdict": "missing-effect", "effects": ["core-loss", "lead-inductance"], "confidence": 0.75, "findings": []}
    results = [{**result(1, 1e-5), "diagnosis": answer}, result(2, 2e-5)]
    results[0]["best"]["parameters"]["La"]["sigma"] = 2e-8
    figures = fleet_figures(results)
    tables = frames_of(figures)
    assert tables["values"].loc["m01", ["verdict", "effects", "confidence"]].tolist() == ["missing-effect", "core-loss + lead-inductance", 0.75]
    assert tables["values"]["verdict"].isna().tolist() == [False, True]
    assert tables["sigma"].loc["m01", "La_h"] == pytest.approx(2e-8)
    assert list(table_of(figures).columns[:3]) == ["La_h", "La_h_sigma", "Cf_f"]


def test_a_fleet_has_its_units_in_the_names_of_its_columns(tmp_path):
    results = [result(number, 1e-5 * number) for number in range(1, 13)]
    (tmp_path / RESULTS).write_text("".join(f"{json.dumps(one)}\n" for one in [result(2, 7.0), *results]))
    tables = me.fleet_frames(tmp_path, golden="m*")
    values = tables["values"]
    assert values.columns.tolist() == ["La_h", "Cf_f", "rms_error_percent", "skin-effect.corner_hz", "time_s", "serial"]
    assert values["La_h"].tolist() == [1e-5 * number for number in range(1, 13)]  # the last result of a session counts
    assert values.loc["m02", "time_s"] - values.loc["m01", "time_s"] == 86400
    assert tables["parameters"].loc["La_h", "n"] == 12
    assert tables["limits"].loc["La_h", "high"] == fleet_figures(results, "m*")["limits"]["La"]["high"]
    assert set(tables["drift"].columns) >= {"parameter", "along", "change_percent"}
    assert tables["troubles"].empty
    pd.testing.assert_frame_equal(frames_of(fleet_figures(results))["values"], values)
    with pytest.raises(me.BadInput, match="no results of a fleet"):
        me.fleet_frames(tmp_path / "elsewhere")
    # Without a golden set, those of the run count.
    (tmp_path / FIGURES).write_text(json.dumps({"golden": "m0*", "tolerances": {"La": 0.2}}))
    tables = me.fleet_frames(tmp_path)
    assert tables["limits"].index.tolist() == ["La_h"]
    assert tables["from_golden"].loc["m12", "La_h"] > 100
    assert tables["motors"].loc["m12", "result"] == "beyond limits"
    assert me.fleet_frames(tmp_path, golden="m*")["limits"].index.tolist() == ["La_h", "Cf_f", "rms_error_percent", "skin-effect.corner_hz"]
    for damaged in ("{", '{"tolerances": {"La": "x"}}', '{"tolerances": [1]}'):
        (tmp_path / FIGURES).write_text(damaged)
        with pytest.raises(me.BadInput, match=r"fleet.json: damaged"):
            me.fleet_frames(tmp_path)


@pytest.mark.slow
@pytest.mark.usefixtures("few_effects")
def test_scoreboards_of_every_kind(tmp_path):
    # One motor without and one with an effect: which they are is not what is tested, and these are diagnosed soon.
    played = [scoreboard.play(case) for case in (Case(777, 8, "none", (), 1233665122), HIDDEN)]
    board = {"seed": 5, **scoreboard.summary(played)}
    tables = me.scoreboard_frames(board)
    assert tables["goals"].loc["one hidden: exact name", "wanted"] == 0.85
    assert int(tables["outcomes"].to_numpy().sum()) == 2
    assert set(tables) >= {"goals", "outcomes", "confusion", "reliability", "kinds_of_verdict", "wrong"}
    file = tmp_path / "scoreboard.json"
    file.write_text(json.dumps(plain(board)))
    assert me.scoreboard_frames(file)["outcomes"].equals(tables["outcomes"])
    assert "goals" in me.scoreboard_frames(hard.summary([]))
    for other, says in (({"schema": "motoremi.fit/1"}, "no scoreboard"), (tmp_path / "none.json", "cannot be read")):
        with pytest.raises(me.BadInput, match=says):
            me.scoreboard_frames(other)
