"""Commands that a command proposes can be pasted into a shell, and what cannot be fitted is refused in one line."""

from __future__ import annotations

import shlex
from pathlib import Path

from conftest import simulated_sweeps
from typer.testing import CliRunner

from motoremi.cli.app import app
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.errors import BadInput


def imported(folder: Path) -> Path:
    """A session of one short-circuit sweep, in a folder whose name a shell would divide."""
    write_impedance_csv(folder / "short.csv", simulated_sweeps(1)[0][0])
    session = folder / "my motor"
    done = CliRunner().invoke(app, ["import", str(session), "--short", str(folder / "short.csv")])
    assert done.exit_code == 0
    assert shlex.split(done.stdout.splitlines()[-1]) == ["next:", "motoremi", "fit", str(session)]
    return session


def test_the_next_command_can_be_pasted(tmp_path: Path) -> None:
    session = imported(tmp_path)
    done = CliRunner().invoke(app, ["fit", str(session)])
    assert shlex.split(done.stdout.splitlines()[-1]) == ["next:", "motoremi", "diagnose", str(session)]


def test_nothing_is_fitted_if_every_element_is_held(tmp_path: Path) -> None:
    session = imported(tmp_path)
    refused = CliRunner().invoke(app, ["fit", str(session), "--hold", "Ra=2.3Ohm", "--hold", "La=25uH", "--hold", "Ca=40pF"])
    assert isinstance(refused.exception, BadInput)
    assert "nothing is left to fit" in str(refused.exception)
