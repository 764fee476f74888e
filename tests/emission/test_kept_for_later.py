"""What `predict` keeps in a session: limit, uncertainty and corrections; nothing of a call that is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi

from motoremi.data.csvfiles import write_impedance_csv, write_spectrum_csv
from motoremi.data.session import load
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.emission.limit import find_limit
from motoremi.errors import BadInput
from motoremi.workbench.desk import Desk
from motoremi.workbench.spectrum_view import predict, spectra

ANTENNA = '[[correction]]\nname = "antenna"\nrole = "receiver"\nkind = "transducer"\nunit = "dB(1/m)"\ndb = 15\n'
LEVELS = "title = 'Own'\n{keys}\n[[line]]\ndetector = 'quasi-peak'\nsegments = [[150000, 30000000, 56, 56]]\n{more}"


@pytest.fixture
def session(tmp_path: Path) -> Path:
    axis = 150e3 + 4.5e3 * np.arange(6634)
    for detector, level in (("quasi-peak", 40.0), ("average", 30.0)):
        write_spectrum_csv(tmp_path / f"{detector}.csv", Spectrum(detector, axis, np.full(axis.size, level)))
    files = [tmp_path / f"{detector}.csv" for detector in ("quasi-peak", "average")]
    assert motoremi("import", tmp_path / "s", "--spectrum", *files).returncode == 0
    return tmp_path / "s"


def test_a_refused_call_keeps_nothing(session: Path, tmp_path: Path) -> None:
    (tmp_path / "antenna.toml").write_text(ANTENNA)
    assert document(motoremi("predict", session, "--limit", "cispr32-a", "--json"))["verdict"] == "pass"
    before = load(session)
    for words in (("--corrections", tmp_path / "antenna.toml"), ("--limit", tmp_path / "none.toml"), ("--uncertainty", "1000")):
        done = motoremi("predict", session, *words)
        assert done.returncode == 2
        assert "Traceback" not in done.stderr
    after = load(session)
    assert (after.analysis("emission"), after.corrections.entries) == (before.analysis("emission"), ())
    assert document(motoremi("predict", session, "--json"))["limit"]["name"] == "cispr32-a"


def test_a_session_that_nothing_can_be_predicted_from_keeps_nothing(tmp_path: Path) -> None:
    """A short-circuit sweep alone: no current flows to the frame."""
    frequency = np.geomspace(150e3, 30e6, 41)
    write_impedance_csv(tmp_path / "short.csv", ImpedanceSweep("short", frequency, 3 + 2j * np.pi * frequency * 27e-6))
    assert motoremi("import", tmp_path / "s", "--short", tmp_path / "short.csv").returncode == 0
    done = motoremi("predict", tmp_path / "s", "--limit", "cispr32-a")
    assert done.returncode == 2
    assert "needs the open-circuit sweep" in done.stderr
    assert load(tmp_path / "s").analysis("emission") is None


def test_the_uncertainty_is_kept_and_shown(session: Path) -> None:
    assert "guard band 3.4 dB" in motoremi("predict", session).stdout
    first = motoremi("predict", session, "--uncertainty", "20").stdout
    assert first.splitlines()[0] == "Levels: marginal (measured, CISPR 32 / EN 55032 class B, guard band 20 dB)"
    assert motoremi("predict", session).stdout.splitlines()[0] == first.splitlines()[0]


def test_a_limit_that_nobody_checked_says_so_wherever_it_is_used(session: Path, tmp_path: Path) -> None:
    file = tmp_path / "quasi-peak.csv"
    done = motoremi("import", tmp_path / "t", "--spectrum", file, tmp_path / "average.csv", "--limit", "cispr14-1")
    assert "verdict: pass, CISPR 14-1 household appliances, values NOT CONFIRMED (guard band 3.4 dB)" in done.stdout
    assert "quasi-peak limit: NOT CONFIRMED" in done.stdout
    told = json.loads(motoremi("import", tmp_path / "u", "--spectrum", file, "--limit", "cispr14-1", "--json").stdout)
    assert any("NOT CONFIRMED" in caveat for caveat in told["caveats"])
    assert motoremi("report", tmp_path / "t", "--form", "short").returncode == 0
    assert "CISPR 14-1 household appliances (values not confirmed)" in (tmp_path / "t" / "report" / "short.html").read_text()
    assert motoremi("report", tmp_path / "t").returncode == 0
    assert 'name="limit_confirmed" value="no: check' in (tmp_path / "t" / "report" / "junit.xml").read_text()
    assert "NOT CONFIRMED" not in motoremi("import", tmp_path / "v", "--spectrum", file, "--limit", "cispr32-b").stdout


@pytest.mark.parametrize(
    ("keys", "more", "told"),
    [
        ("interpolation = 'linear'", "", "the key 'interpolation' is unknown; use title, port"),
        ("", "segmets = 3", "quasi-peak: the key 'segmets' is unknown; use detector"),
    ],
)
def test_keys_without_a_meaning_are_refused(tmp_path: Path, keys: str, more: str, told: str) -> None:
    (tmp_path / "own.toml").write_text(LEVELS.format(keys=keys, more=more))
    with pytest.raises(BadInput, match=told):
        find_limit(tmp_path / "own.toml")


@pytest.mark.parametrize(
    ("segments", "end"),
    [
        ("[0.15, 30, 66, 56]", "30 Hz"),
        # Only the first one in megahertz: what it limits would be lost.
        ("[0.15, 0.5, 66, 56], [500000, 30000000, 56, 56]", "0.5 Hz"),
    ],
)
def test_segments_in_megahertz_are_refused(tmp_path: Path, segments: str, end: str) -> None:
    line = f'[[line]]\ndetector = "peak"\nsegments = [{segments}]\n'
    (tmp_path / "own.toml").write_text(f'title = "Own"\nport = "mains"\n\n{line}')
    with pytest.raises(BadInput, match=f"a segment ends at {end}; frequencies are in hertz"):
        find_limit(tmp_path / "own.toml")


def test_the_page_keeps_a_limit_of_the_users_own(session: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.toml"
    own.write_text(LEVELS.format(keys="", more=""))
    assert motoremi("predict", session, "--limit", own, "--uncertainty", "5").returncode == 0
    desk = Desk(session)
    shown = spectra(desk)
    assert (shown["limit"], shown["limits"][str(own)]) == (str(own), "Own")
    predict(desk, str(own))
    prediction = load(session).analysis("prediction")
    assert (prediction["limit"]["title"], prediction["expanded_uncertainty_db"]) == ("Own", 5.0)
    with pytest.raises(BadInput, match="there is no limit of that name"):
        predict(desk, str(tmp_path / "other.toml"))
    own.unlink()
    assert spectra(desk)["limits"][str(own)] == "own"
