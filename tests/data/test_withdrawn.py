"""Sweeps and values that are withdrawn: kept in the session with the reason, used by no analysis, and used again when they are restored."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi
from few_effects import seeking

from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.session import is_up_to_date, load, reopen, verify
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput
from motoremi.fleet.work import Job
from motoremi.workbench.desk import Desk
from motoremi.workbench.views import head
from motoremi.workflow import diagnose_session, ladder_of, measurement_of, opened
from motoremi.workflow_withdraw import restore_withdrawn, withdraw

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 101)
RNG = np.random.default_rng(11)


def winding(la: float = 25e-6) -> ImpedanceSweep:
    s = 2j * np.pi * FREQUENCY_HZ
    impedance = 1 / (1 / (0.8 + s * la) + s * 60e-12)
    return ImpedanceSweep("short", FREQUENCY_HZ, impedance * (1 + 5e-4 * (RNG.normal(size=101) + 1j * RNG.normal(size=101))))


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """Three repeats, the third of another winding, and a resistance in the wrong unit."""
    for number, la in enumerate((25e-6, 25e-6, 40e-6), start=1):
        write_impedance_csv(tmp_path / f"repeat-{number}.csv", winding(la))
    files = [tmp_path / f"repeat-{number}.csv" for number in (1, 2, 3)]
    done = motoremi("import", tmp_path / "motor", "--short", *files, "--value", "dc-resistance=21.3ohm")
    assert done.returncode == 0, done.stderr
    return tmp_path / "motor"


def test_a_withdrawn_sweep_stays_in_the_session_and_is_not_used(session: Path) -> None:
    done = motoremi("withdraw", session, "short-3", "--why", "the clip was on\nanother winding")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "short-3 withdrawn: the clip was on another winding; kept in the session, and no analysis uses it"
    after = load(session)
    assert len(after.sweeps) == 2
    assert (session / "sweeps" / "short-3.csv").exists()
    assert verify(session) == []
    assert measurement_of(after).sweeps[0].repeats == 2
    assert after.summary().startswith("2 sweeps, 1 single values, short-3 withdrawn, ")
    (one,) = after.to_dict()["withdrawn"]
    assert (one["name"], one["why"]) == ("short-3", "the clip was on another winding")


def test_a_value_is_withdrawn_and_given_anew(session: Path) -> None:
    withdraw(session, ["dc-resistance"], "ohm in place of milliohm")
    assert load(session).values == ()
    assert motoremi("import", session, "--append", "--value", "dc-resistance=21.3mohm").returncode == 0
    (value,) = load(session).values
    assert value.value_si == pytest.approx(0.0213)


def test_restored_ones_are_used_again(session: Path) -> None:
    before = load(session)
    withdraw(session, ["sweeps/short-3.csv", "dc-resistance"], "by mistake")
    restored = document(motoremi("withdraw", session, "short-3", "dc-resistance", "--restore", "--json"))
    assert restored["withdrawn"] == []
    after = load(session)
    assert [one.metadata["source"] for one in after.sweeps] == [one.metadata["source"] for one in before.sweeps]
    assert after.values == before.values


def test_models_fitted_with_it_are_removed_and_the_diagnosis_is_out_of_date(session: Path) -> None:
    assert motoremi("fit", session).returncode == 0
    with_third = ladder_of(load(session))[0].parameters["La"]
    done = document(motoremi("withdraw", session, "short-3", "--why", "another winding", "--json"))
    assert done["empties_ladder"]
    assert load(session).ladder == []
    assert motoremi("fit", session).returncode == 0
    assert with_third > 1.03 * 25e-6
    assert ladder_of(load(session))[0].parameters["La"] == pytest.approx(25e-6, rel=0.01)


def test_a_value_leaves_the_models_of_the_ladder(session: Path) -> None:
    assert motoremi("fit", session).returncode == 0
    assert not withdraw(session, ["dc-resistance"], "ohm in place of milliohm").emptied_ladder
    assert len(load(session).ladder) == 1


def test_a_diagnosis_with_it_is_out_of_date(session: Path) -> None:
    with reopen(session) as writer:
        writer.save_analysis("diagnosis", {"schema": "motoremi.diagnosis/2"})
    assert is_up_to_date(load(session))
    withdraw(session, ["short-3"], "another winding")
    assert not is_up_to_date(load(session))


def test_a_fleet_works_on_the_session_again(session: Path) -> None:
    job = Job(session.name, str(session.parent), True, 1)
    keys = [job.key()]
    withdraw(session, ["dc-resistance"], "ohm in place of milliohm")
    keys.append(job.key())
    restore_withdrawn(session, ["dc-resistance"])
    keys.append(job.key())
    assert motoremi("import", session, "--append", "--value", "dc-resistance=21.3mohm").returncode == 0
    keys.append(job.key())
    assert len(set(keys)) == 4


def test_documents_that_no_version_wrote_withdraw_nothing(session: Path) -> None:
    with reopen(session) as writer:
        writer.emit("withdrawn", documents=[["short-3"], None, "1"], why="hostile")
        writer.emit("restored", documents="all")
    assert len(load(session).sweeps) == 3


def test_the_report_gives_what_was_withdrawn_and_why(session: Path) -> None:
    assert motoremi("report", session).returncode == 0
    before = json.loads((session / "report" / "report.json").read_text())
    withdraw(session, ["short-3"], "<b>clip</b> on another winding")
    assert motoremi("report", session).returncode == 0
    data = json.loads((session / "report" / "report.json").read_text())
    assert [one["name"] for one in data["withdrawn"]] == ["short-3"]
    assert data["session_sha256"] != before["session_sha256"]
    page = (session / "report" / "report.html").read_text()
    assert "short-3 was measured and withdrawn on 2" in page
    assert "&lt;b&gt;clip&lt;/b&gt; on another winding" in page
    assert "<b>clip</b>" not in page


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["short-9", "--why", "x"], "no sweep, spectrum or single value is called 'short-9'; there are short-1, short-2, short-3, dc-resistance"),
        (["short-3"], "say why: --why TEXT; the report gives the reason"),
        (["short-3", "--why", " \n "], "say why: --why TEXT; the report gives the reason"),
        (["short-3", "--restore"], "'short-3' is not withdrawn"),
        (["short-3", "--restore", "--why", "x"], "--why is for what is withdrawn: leave it out with --restore"),
        (["short-1", "short-2", "short-3", "--why", "x"], "no sweep of the motor as it is would be left"),
    ],
)
def test_what_cannot_be_withdrawn_is_one_line_and_nothing_is_changed(session: Path, words: list[str], told: str) -> None:
    before = (session / "session.jsonl").read_bytes()
    done = motoremi("withdraw", session, *words)
    assert done.returncode == 2
    assert told in done.stderr
    assert "Traceback" not in done.stderr
    assert (session / "session.jsonl").read_bytes() == before


def test_twice_is_told(session: Path) -> None:
    withdraw(session, ["short-3"], "another winding")
    with pytest.raises(BadInput, match="'short-3' is withdrawn already"):
        withdraw(session, ["short-3"], "another winding")
    restore_withdrawn(session, ["short-3"])
    with pytest.raises(BadInput, match="'short-3' is not withdrawn"):
        restore_withdrawn(session, ["short-3"])


def test_a_withdrawn_file_that_was_changed_is_still_refused(session: Path) -> None:
    withdraw(session, ["short-3"], "another winding")
    file = session / "sweeps" / "short-3.csv"
    file.write_text(file.read_text().replace("1", "2"))
    with pytest.raises(BadInput, match="was changed after it was stored"):
        load(session)


def test_one_of_two_values_of_one_name_is_withdrawn_by_its_number(session: Path) -> None:
    added = motoremi("import", session, "--append", "--value", "dc-resistance=21.3mohm+-0.1mohm")
    assert "note: dc-resistance was measured as 21.3 Ohm and as 21.3 mOhm, " in added.stdout
    assert "standard deviations apart; withdraw the wrong one: motoremi withdraw SESSION NAME-2 for the second that was given" in added.stdout
    with pytest.raises(BadInput, match="there are short-1, short-2, short-3, dc-resistance-1, dc-resistance-2"):
        withdraw(session, ["dc-resistance-3"], "x")
    withdraw(session, ["dc-resistance-1"], "ohm in place of milliohm")
    (value,) = load(session).values
    assert value.value_si == pytest.approx(0.0213)
    assert [one["name"] for one in load(session).withdrawn] == ["dc-resistance-1"]
    assert [one["name"] for one in head(Desk(session), "")["values"]] == ["dc-resistance-2"]
    restore_withdrawn(session, ["dc-resistance-1"])
    assert len(load(session).values) == 2


@pytest.mark.slow
def test_values_that_contradict_each_other_are_a_serious_finding(session: Path) -> None:
    withdraw(session, ["short-3", "dc-resistance"], "another winding; ohm in place of milliohm")
    assert (
        motoremi("import", session, "--append", "--value", "dc-resistance=0.8ohm+-5mohm", "--value", "dc-resistance=1.2ohm+-5mohm").returncode == 0
    )
    with seeking({"skin-effect", "core-loss"}), opened(session) as store:
        found = diagnose_session(store)
    (finding,) = (one for one in found.findings if one.id == "values-disagree")
    assert finding.serious
    assert finding.why == "dc-resistance was measured as 800 mOhm and as 1.2 Ohm, 57 standard deviations apart"
    assert found.verdict == "adequate"
    assert found.confidence <= 0.96
