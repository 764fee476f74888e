"""Effects of the user's own: from a file and from an installed package, in catalogue, ranking, report and netlist."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi, motoremi_process
from conftest import FREQUENCY_HZ
from places import ROOT
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.errors import BadInput
from motoremi.model.effects import catalogue, catalogue_sha256, find_effect
from motoremi.model.effects.own import VARIABLE, effects_in
from motoremi.model.effects.start import Scale
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

EXAMPLE = ROOT / "docs" / "examples" / "ferrite_bead.py"


@pytest.fixture
def forgotten():
    """The catalogue as it was."""
    yield
    os.environ.pop(VARIABLE, None)
    catalogue.cache_clear()


def test_the_example_is_short():
    assert len(EXAMPLE.read_text().splitlines()) < 30


@pytest.mark.slow
def test_own_effect_from_the_command_line_is_named_added_reported_and_exported(tmp_path, forgotten):
    frequency = FREQUENCY_HZ[::4]
    s = 2j * np.pi * frequency
    bead = 1 / (1 / 120.0 + 1 / (s * 1.5e-6))
    motor, analyser = SimulatedMotor.random(6), SimulatedAnalyser(1006)
    for connection, termination in enumerate(("short", "open")):
        for number in range(3):
            seen = analyser.measure(termination, frequency, motor.impedance(termination, frequency) + bead, connection, bandwidth_factor=3)
            write_impedance_csv(tmp_path / f"{termination}{number}.csv", me.ImpedanceSweep(termination, frequency, seen))
    files = [f"--{kind}={tmp_path / f'{kind}{n}.csv'}" for kind in ("short", "open") for n in range(3)]
    assert motoremi("import", tmp_path / "s", *files, "--analyser", "4294a").returncode == 0
    done = motoremi_process("diagnose", tmp_path / "s", "--effects-from", EXAMPLE, "--json")
    assert f"running the code of {EXAMPLE}" in done.stderr
    found = json.loads(done.stdout)
    assert found["effects"][0] == "ferrite-bead"
    bead_values = next(c for c in found["candidates"] if c["effect"] == "ferrite-bead")["parameters"]
    assert bead_values["inductance_h"]["value"] == pytest.approx(1.5e-6, rel=0.1)
    me.effects_from(EXAMPLE)
    for command in (("add", tmp_path / "s", "ferrite-bead"), ("report", tmp_path / "s"), ("export", tmp_path / "s", "--spice", tmp_path / "m.cir")):
        assert CliRunner().invoke(app, [str(word) for word in command]).exit_code == 0
    assert "ferrite-bead" in (tmp_path / "s" / "report" / "report.html").read_text()
    assert "L_bead_L" in (tmp_path / "m.cir").read_text()
    # Without the file its name means nothing, and that is told in a line.
    forgot = motoremi_process("fit", tmp_path / "s")
    assert forgot.returncode == 2
    assert "ferrite-bead" in forgot.stderr


def test_in_python(forgotten):
    before = catalogue_sha256()
    assert [effect.name for effect in me.effects_from(EXAMPLE)] == ["ferrite-bead"]
    assert find_effect("ferrite-bead").effect.group == "connection"
    assert [effect.name for effect in me.effects_from(EXAMPLE)] == ["ferrite-bead"]  # twice is once
    assert catalogue_sha256() != before


@pytest.mark.parametrize(
    ("code", "says"),
    [
        ("x = 1", "defines no Effect"),
        ("import nothing_like_it", "its code fails: ModuleNotFoundError"),
        ("raise SystemError('no')", "SystemError"),
        (EXAMPLE.read_text().replace('"ferrite-bead"', '"core-loss"'), "already used"),
        (EXAMPLE.read_text().replace('"ferrite-bead"', '"Ferrite Bead"'), "lower-case"),
        (EXAMPLE.read_text().replace('{"resistance_ohm": 30.0,', '{"resistance": 30.0,'), "differ in"),
    ],
)
def test_bad_files_are_told_and_change_nothing(forgotten, tmp_path, code, says):
    known = catalogue()
    (tmp_path / "own.py").write_text(code)
    with pytest.raises(BadInput, match=says):
        me.effects_from(tmp_path / "own.py")
    assert catalogue() == known


def test_from_an_installed_package(forgotten, monkeypatch):
    from motoremi.model import effects

    mine = effects.own.effects_in(EXAMPLE)[0]

    class Entry:
        name = "bead"

        def load(self):
            return mine

    monkeypatch.setattr(effects, "entry_points", lambda group: [Entry()] if group == "motoremi.effects" else [])
    catalogue.cache_clear()
    assert find_effect("ferrite-bead").effect is mine
    monkeypatch.setattr(Entry, "load", lambda self: "no effect")
    catalogue.cache_clear()
    with pytest.raises(BadInput, match="not an Effect"):
        catalogue()


def test_the_former_spelling_of_changed_elements_is_read(tmp_path: Path) -> None:
    text = EXAMPLE.read_text("utf-8")
    own = tmp_path / "old.py"
    own.write_text(re.sub(r"starts=\(?\{", lambda found: f'{found.group(0)}"*La": 0.9, ', text, count=1))
    assert '"*La"' in own.read_text()
    (effect,) = effects_in(own)
    assert effect.starts[0][Scale("La")] == 0.9
    assert "*La" not in effect.starts[0]
