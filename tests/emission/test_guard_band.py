"""Guard band and expanded uncertainty: two numbers, since a laboratory may judge without a guard band and still state its uncertainty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi

from motoremi.data.spectrum import Spectrum
from motoremi.emission.predict import predict

AXIS = 150e3 + 4.5e3 * np.arange(6634)


@pytest.fixture
def session(tmp_path: Path) -> Path:
    """Quasi-peak 2.9 dB above its limit of 56 dBuV at 1.05 MHz."""
    level = np.where(np.abs(AXIS - 1.05e6) < 1, 58.9, 30.0)
    rows = "".join(f"{hertz:.0f},{dbuv:.1f},20\n" for hertz, dbuv in zip(AXIS, level, strict=True))
    (tmp_path / "scan.csv").write_text(f"Frequency (Hz),QP (dBuV),AV (dBuV)\n{rows}")
    assert motoremi("import", tmp_path / "s", "--spectrum", tmp_path / "scan.csv").returncode == 0
    return tmp_path / "s"


def test_simple_acceptance_fails_what_is_above_the_limit(session: Path) -> None:
    told = document(motoremi("predict", session, "--limit", "cispr32-b", "--json"))
    assert (told["verdict"], told["guard_band_db"], told["expanded_uncertainty_db"]) == ("marginal", 3.4, 3.4)
    simple = motoremi("predict", session, "--guard-band", "0", "--json")
    told = document(simple)
    assert simple.returncode == 1
    assert (told["verdict"], told["guard_band_db"], told["expanded_uncertainty_db"]) == ("fail", 0.0, 3.4)
    assert document(motoremi("predict", session, "--json"))["guard_band_db"] == 0.0


def test_a_level_at_the_limit_is_accepted(session: Path, tmp_path: Path) -> None:
    own = 'title = "own"\n[[line]]\ndetector = "quasi-peak"\nsegments = [[150e3, 30e6, 58.9, 58.9]]\n'
    (tmp_path / "own.toml").write_text(own)
    assert document(motoremi("predict", session, "--limit", tmp_path / "own.toml", "--guard-band", "0", "--json"))["verdict"] == "pass"
    assert document(motoremi("predict", session, "--guard-band", "0.1", "--json"))["verdict"] == "marginal"


@pytest.mark.parametrize(("limit", "said"), [("cispr32-b", False), ("cispr25-class3", True)])
def test_the_uncertainty_of_mains_ports_is_told_where_it_is_used_elsewhere(limit: str, said: bool) -> None:
    spectra = [Spectrum("quasi-peak", AXIS, np.full(AXIS.size, 20.0))]
    remark = "an expanded uncertainty of 3.4 dB is that of mains ports from 150 kHz to 30 MHz: state yours for this limit (--uncertainty)"
    assert (remark in predict(None, spectra=spectra, limit=limit).remarks()) == said
    assert remark not in predict(None, spectra=spectra, limit=limit, expanded_uncertainty_db=2.9).remarks()


def test_the_report_says_by_which_rule_it_was_judged(session: Path, tmp_path: Path) -> None:
    rule = '[decision_rule]\nrule = "Simple acceptance."\nsource = "agreed with the customer"\n'
    (tmp_path / "lab.toml").write_text(f'name = "Lab"\n{rule}')
    for option, said in (
        ((), "guard band 3.4 dB: below the limit by as much"),
        (("--guard-band", "0"), "simple acceptance: at or below the limit"),
    ):
        motoremi("predict", session, "--limit", "cispr32-b", *option)
        done = motoremi("report", session, "--profile", tmp_path / "lab.toml")
        assert done.returncode == 0, done.stderr
        page = next((session / "report").glob("*.html")).read_text(encoding="utf-8")
        assert f"The emission verdicts of this report: {said}" in page
