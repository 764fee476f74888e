"""Spectra that are withdrawn, used again or added: verdict, models and diagnosis of other spectra do not stay."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi

from motoremi.data.csvfiles import write_spectrum_csv
from motoremi.data.session import is_up_to_date, load, reopen, verify
from motoremi.data.spectrum import Spectrum
from motoremi.workflow_emission import DIAGNOSIS, STATE
from motoremi.workflow_withdraw import restore_withdrawn, withdraw

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 500)
LIMIT = "cispr14-1"
REMOVED = "note: verdict, models and diagnosis of the spectra were of other spectra and are removed"


def spectrum(folder: Path, name: str, level_dbuv: float) -> Path:
    file = folder / f"{name}.csv"
    write_spectrum_csv(file, Spectrum("quasi-peak", FREQUENCY_HZ, np.full(500, level_dbuv)))
    return file


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """A scan below the limit, and one with the attenuator forgotten."""
    files = [spectrum(tmp_path, "right", 30.0), spectrum(tmp_path, "wrong", 80.0)]
    done = motoremi("import", tmp_path / "motor", "--spectrum", *files, "--limit", LIMIT)
    assert done.returncode == 1, done.stderr
    return tmp_path / "motor"


def test_the_verdict_with_a_withdrawn_spectrum_does_not_stay(session: Path) -> None:
    assert load(session).analysis("prediction")["verdict"] == "fail"
    done = motoremi("withdraw", session, "quasi-peak-2", "--why", "attenuator not entered")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[-2:] == [REMOVED, f"next: motoremi predict {session}"]
    after = load(session)
    assert after.analysis("prediction") is None
    assert [float(one.level_dbuv[0]) for one in after.spectra] == [30.0]
    assert [one["name"] for one in after.withdrawn] == ["quasi-peak-2"]
    assert verify(session) == []
    # The limit that was chosen is kept.
    judged = document(motoremi("predict", session, "--json"))
    assert (judged["verdict"], judged["limit"]["name"]) == ("pass", LIMIT)


def test_the_report_gives_the_reason_and_no_old_verdict(session: Path) -> None:
    withdraw(session, ["spectra/quasi-peak-2.csv"], "attenuator not entered")
    assert motoremi("report", session).returncode == 0
    data = json.loads((session / "report" / "report.json").read_text())
    assert data["prediction"] is None
    assert [one["why"] for one in data["withdrawn"]] == ["attenuator not entered"]
    page = (session / "report" / "report.html").read_text()
    assert "quasi-peak-2 was measured and withdrawn on 2" in page
    assert "the spectra were not judged against a limit" in page


def test_restored_ones_are_judged_again(session: Path) -> None:
    withdraw(session, ["quasi-peak-2"], "by mistake")
    assert document(motoremi("predict", session, "--json"))["verdict"] == "pass"
    done = document(motoremi("withdraw", session, "quasi-peak-2", "--restore", "--json"))
    assert done["discards_emission"]
    assert load(session).analysis("prediction") is None
    again = motoremi("predict", session, "--json")
    assert (again.returncode, json.loads(again.stdout)["verdict"]) == (1, "fail")


def test_models_and_diagnosis_of_the_spectra_are_removed_and_the_set_up_stays(session: Path) -> None:
    with reopen(session) as writer:
        writer.save_analysis(STATE, {"schema": "motoremi.emission/1", "setup": {"kept": 1}, "limit": LIMIT, "steps": [{"effects": []}]})
        writer.save_analysis(DIAGNOSIS, {"verdict": "adequate"})
        writer.save_analysis("diagnosis", {"schema": "motoremi.diagnosis/2"})
    assert withdraw(session, ["quasi-peak-2"], "attenuator not entered").discarded
    after = load(session)
    assert after.analysis(DIAGNOSIS) is None
    assert after.analysis(STATE) == {"schema": "motoremi.emission/1", "setup": {"kept": 1}, "limit": LIMIT, "steps": []}
    # The diagnosis of the motor does not use spectra.
    assert is_up_to_date(after)


def test_what_was_never_judged_has_nothing_to_remove(tmp_path: Path) -> None:
    files = [spectrum(tmp_path, "one", 30.0), spectrum(tmp_path, "other", 31.0)]
    assert motoremi("import", tmp_path / "motor", "--spectrum", *files).returncode == 0
    assert not withdraw(tmp_path / "motor", ["quasi-peak-1"], "interrupted").discarded
    assert not restore_withdrawn(tmp_path / "motor", ["quasi-peak-1"]).discarded


def test_the_last_spectrum_of_a_session_of_spectra_is_not_withdrawn(session: Path) -> None:
    before = (session / "session.jsonl").read_bytes()
    done = motoremi("withdraw", session, "quasi-peak-1", "quasi-peak-2", "--why", "x")
    assert done.returncode == 2
    assert "no spectrum would be left: add the right one first (motoremi import SESSION --append --spectrum FILE)" in done.stderr
    assert (session / "session.jsonl").read_bytes() == before


def test_a_spectrum_is_added_and_judged_with_the_others(session: Path, tmp_path: Path) -> None:
    withdraw(session, ["quasi-peak-2"], "attenuator not entered")
    assert document(motoremi("predict", session, "--json"))["verdict"] == "pass"
    done = motoremi("import", session, "--append", "--spectrum", spectrum(tmp_path, "again", 52.0))
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("quasi-peak again.csv (")
    assert lines[-2:] == [REMOVED, f"next: motoremi predict {session}"]
    after = load(session)
    assert [float(one.level_dbuv[0]) for one in after.spectra] == [30.0, 52.0]
    assert after.analysis("prediction") is None
    assert verify(session) == []


def test_the_session_s_corrections_apply_to_added_spectra(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text('[[correction]]\nname = "attenuator"\nrole = "receiver"\nkind = "loss"\ndb = 10.0\n')
    session = tmp_path / "motor"
    assert motoremi("import", session, "--spectrum", spectrum(tmp_path, "first", 30.0), "--corrections", tmp_path / "lab.toml").returncode == 0
    done = motoremi("import", session, "--append", "--spectrum", spectrum(tmp_path, "second", 31.0))
    assert "41.0 dBuV" in done.stdout
    assert [float(one.level_dbuv[0]) for one in load(session).corrected_spectra] == [40.0, 41.0]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--spectrum", "FILE", "--limit", LIMIT], "--limit is for a new session: leave it out with --append"),
        (["--spectrum", "FILE", "--condition", "dc-bias=1A"], "--condition dc-bias=1A is for sweeps"),
        (["--spectrum", "FILE", "--accuracy", "1"], "band, accuracy and compensation are for impedance sweeps"),
        (["--value", "dc-resistance=21mohm"], "holds no impedance sweep of the motor as it is"),
    ],
)
def test_options_that_are_not_for_added_spectra(session: Path, tmp_path: Path, words: list[str], told: str) -> None:
    file = spectrum(tmp_path, "again", 52.0)
    before = (session / "session.jsonl").read_bytes()
    done = motoremi("import", session, "--append", *(str(file) if word == "FILE" else word for word in words))
    assert done.returncode == 2
    assert told in done.stderr
    assert (session / "session.jsonl").read_bytes() == before
