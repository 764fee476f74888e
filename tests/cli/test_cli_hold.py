"""Values that are held: what a later fit does with them is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi

from motoremi.data.session import load
from motoremi.workflow import fit_session, opened

pytestmark = pytest.mark.slow
FREQUENCY = np.geomspace(150e3, 30e6, 81)
RA_OHM = 2.4


def imported(folder: Path) -> Path:
    """A session of a motor by the paper's formula with Ra = 2.3 ohm."""
    s, rng = 2j * np.pi * FREQUENCY, np.random.default_rng(5)
    winding = 1 / (1 / (2.3 + s * 24e-6) + s * 95e-12)
    frame = 1 / (1 / (18 + s * 700e-9 + 1 / (s * 310e-12)) + s * 150e-12)
    for name, ohm in (("short", winding), ("open", winding + frame)):
        noisy = (ohm * (1 + 1e-3 * (rng.standard_normal(81) + 1j * rng.standard_normal(81)))).tolist()
        rows = "".join(f"{f!r},{z.real!r},{z.imag!r}\n" for f, z in zip(FREQUENCY.tolist(), noisy, strict=True))
        (folder / f"{name}.csv").write_text(f"frequency_hz,resistance_ohm,reactance_ohm\n{rows}")
    files = ("--short", folder / "short.csv", "--open", folder / "open.csv")
    assert motoremi("import", folder / "s", *files, "--analyser", "none").returncode == 0
    return folder / "s"


def test_a_value_that_is_no_longer_held_is_told_with_how_to_hold_both(tmp_path):
    session = imported(tmp_path)
    first = motoremi("fit", session, "--hold", f"Ra={RA_OHM}Ohm")
    assert "no longer held" not in first.stdout
    motoremi("add", session, "core-loss")
    assert load(session).held == {"Ra": RA_OHM}

    second = motoremi("fit", session, "--hold", "core-loss.resistance_ohm=100kOhm")
    (told,) = (line for line in second.stdout.splitlines() if "no longer held" in line)
    assert f"to hold all: motoremi fit {session} --hold Ra=2.4Ohm --hold core-loss.resistance_ohm=100kOhm" in told
    (told,) = (line for line in second.stdout.splitlines() if "every step of the ladder was fitted again" in line)
    assert "error of the paper's circuit" in told
    assert load(session).ladder[0]["fit"]["held"] == {}

    # What it proposes holds both, and nothing is released.
    words = second.stdout.split("to hold all: motoremi ")[1].splitlines()[0].split()
    both = document(motoremi(*words, "--json"))
    assert both["held"] == {"Ra": RA_OHM, "core-loss.resistance_ohm": 1e5}
    assert both["released"] == {}
    assert both["ladder_changes"][0]["model"] == "the paper's circuit"
    none = document(motoremi("fit", session, "--json"))
    assert none["released"] == {"Ra": RA_OHM, "core-loss.resistance_ohm": 1e5}


def test_a_fit_that_nobody_asked_for_keeps_what_is_held(tmp_path):
    session = imported(tmp_path)
    motoremi("fit", session, "--hold", f"Ra={RA_OHM}Ohm")
    # Further repeats empty the ladder, and the next command fits again.
    motoremi("import", session, "--append", "--short", changed(tmp_path / "short.csv"))
    assert load(session).ladder == []
    motoremi("compare", session)
    assert load(session).ladder[0]["fit"]["held"] == {"Ra": RA_OHM}
    # The button of the workbench.
    with opened(session) as store:
        assert fit_session(store).held == {"Ra": RA_OHM}


def test_what_was_held_of_an_effect_is_forgotten_with_it(tmp_path):
    session = imported(tmp_path)
    motoremi("fit", session, "--hold", f"Ra={RA_OHM}Ohm")
    motoremi("add", session, "core-loss")
    motoremi("fit", session, "--hold", f"Ra={RA_OHM}Ohm", "--hold", "core-loss.resistance_ohm=100kOhm")
    motoremi("drop", session)
    assert load(session).held == {"Ra": RA_OHM}


def changed(file: Path) -> Path:
    """The same sweep with other noise."""
    head, *rows = file.read_text().splitlines()
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    values[:, 1:] *= 1 + 1e-3 * np.random.default_rng(9).standard_normal((len(rows), 1))
    other = file.with_name("again.csv")
    other.write_text("\n".join([head, *(",".join(map(repr, row)) for row in values.tolist())]) + "\n")
    return other


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ("--hold", "Cf=120pF:130pF"),
            "--hold takes one value, not the range 'Cf=120pF:130pF': limits of a value that is fitted are given with --bound",
        ),
        (("--hold", "Cf=150pF:1"), "--hold takes one value"),
        (("--hold", "Ra=2:3Ohm"), "--hold takes one value"),
        (("--hold", "Cf=150"), "the held value of Cf, 150 F, is outside of what motors have: 100 fF - 1 uF"),
        (("--hold", "Cf=150F"), "the held value of Cf, 150 F, is outside of what motors have: 100 fF - 1 uF"),
        (("--hold", "Cf=150pF=3pF"), "is not one quantity in F"),
        (("--hold", "Cf=130pF", "--hold", "Cf=120pF"), "--hold is given twice for Cf"),
        (("--bound", "La=1uH:2uH:3uH"), "cannot read the bound 'La=1uH:2uH:3uH'"),
        (("--bound", "Cf=120:140"), "the bounds of Cf, 120 - 140 F, are outside of what motors have"),
        (("--bound", "La=1:100"), "the bounds of La, 1 - 100 H, are outside of what motors have: 1 nH - 1 H"),
        (("--bound", "Cf=120F:140F"), "the bounds of Cf, 120 - 140 F, are outside of what motors have"),
        (("--bound", "La=1uH:2uH", "--bound", "La=1uH:3uH"), "--bound is given twice for La"),
        (("--hold", "La=2uH", "--bound", "La=1uH:3uH"), "La is held and has bounds: leave out one of them"),
    ],
)
def test_a_value_or_bound_that_would_be_taken_for_another_is_refused(tmp_path, options, says):
    session = imported(tmp_path)
    refused = motoremi("fit", session, *options)
    assert refused.returncode == 2
    assert says in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert load(session).ladder == []


def test_what_is_no_longer_held_or_bounded_is_told_with_the_command_that_keeps_both(tmp_path):
    session = imported(tmp_path)
    motoremi("fit", session, "--hold", f"Ra={RA_OHM}Ohm")
    bounded = motoremi("fit", session, "--bound", "La=1 uH:100 uH")
    assert "limits given for La: 1 uH - 100 uH" in bounded.stdout
    (told,) = (line for line in bounded.stdout.splitlines() if "no longer held" in line)
    assert told.endswith(f"to hold all: motoremi fit {session} --hold Ra=2.4Ohm --bound La=1uH:100uH")
    held = motoremi("fit", session, "--hold", f"Ra={RA_OHM}Ohm")
    (told,) = (line for line in held.stdout.splitlines() if "no longer bounded" in line)
    assert told.endswith(f"to bound all: motoremi fit {session} --hold Ra=2.4Ohm --bound La=1uH:100uH")
    both = document(motoremi(*told.split("motoremi ")[1].split(), "--json"))
    assert (both["held"], both["bounds"], both["released"], both["unbounded"]) == ({"Ra": RA_OHM}, {"La": [1e-6, 1e-4]}, {}, {})
    assert document(motoremi("fit", session, "--json"))["unbounded"] == {"La": [1e-6, 1e-4]}


def test_a_bound_that_leaves_out_the_motor_is_told_everywhere(tmp_path):
    """The motor has 24 uH."""
    session = imported(tmp_path)
    told = motoremi("fit", session, "--bound", "La=1uH:5uH").stdout
    (row,) = (line for line in told.splitlines() if line.split()[:1] == ["La"])
    assert row.split() == ["La", "5", "uH", "at", "its", "bound"]
    assert "note: La is at its bound, 5 uH: this value is not measured" in told
    assert motoremi("report", session).returncode == 0
    page = (session / "report" / "report.html").read_text()
    assert "La is at its bound, 5 \u00b5H" in page
    assert ">at its bound</td>" in page
    (line,) = (line for line in (session / "report" / "parameters.csv").read_text().splitlines() if ",La," in line)
    assert line.endswith(",H,,at its bound")
