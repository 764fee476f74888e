"""Settings from a file and from the environment, global options, completion, and a quick start."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import command_line
import pytest

from motoremi.cli.settings import hoisted

pytestmark = pytest.mark.slow


def motoremi(*arguments: object, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """With a home that holds no settings but those of the test."""
    return command_line.motoremi(*arguments, cwd=cwd, HOME=str(cwd), **environment)


def test_a_file_of_settings(tmp_path):
    (tmp_path / "motoremi.toml").write_text("[challenge]\nseed = 5\n")
    assert motoremi("challenge", "a", cwd=tmp_path).returncode == 0
    assert motoremi("challenge", "b", "--seed", "5", cwd=tmp_path).returncode == 0
    assert motoremi("challenge", "c", "--seed", "6", cwd=tmp_path).returncode == 0
    a, b, c = ((tmp_path / name / "sweeps" / "open-1.csv").read_bytes() for name in "abc")
    assert a == b != c


def test_a_named_file_and_a_variable(tmp_path):
    (tmp_path / "mine.toml").write_text("[effects]\njson = true\n")
    assert motoremi("effects", "core-loss", "--config", "mine.toml", cwd=tmp_path).stdout.startswith("{")
    assert motoremi("effects", "core-loss", cwd=tmp_path, MOTOREMI_CONFIG="mine.toml").stdout.startswith("{")
    assert motoremi("effects", "core-loss", cwd=tmp_path, MOTOREMI_EFFECTS_JSON="1").stdout.startswith("{")
    assert motoremi("effects", "core-loss", cwd=tmp_path).stdout.startswith("core-loss")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[fitt]\nseed = 1", "did you mean fit?"),
        ("[fit]\nsede = 1", "did you mean seed?"),
        ("fit = 1", "write a table"),
        ("[fit", "is not TOML"),
        ("effects-from = 'x.py'", "runs code"),
    ],
)
def test_bad_settings_are_one_line(tmp_path, text, says):
    (tmp_path / "motoremi.toml").write_text(text)
    done = motoremi("effects", cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert "no such configuration" in motoremi("effects", "--config", "other.toml", cwd=tmp_path).stderr


def test_global_options_may_stand_anywhere():
    assert hoisted(["fit", "s", "--config", "c.toml", "--seed", "1"]) == (["--config", "c.toml"], ["fit", "s", "--seed", "1"])
    assert hoisted(["fit", "--effects-from=a.py", "--", "--config"]) == (["--effects-from=a.py"], ["fit", "--", "--config"])


def test_completion(tmp_path):
    done = command_line.motoremi_process(cwd=tmp_path, _MOTOREMI_COMPLETE="complete_bash", COMP_WORDS="motoremi fl", COMP_CWORD="1")
    assert done.stdout.split() == ["fleet"]
    assert (
        "_MOTOREMI_COMPLETE"
        in command_line.motoremi_process("--show-completion", "bash", cwd=tmp_path, _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1").stdout
    )


def test_a_start_loads_nothing_heavy(tmp_path):
    # Times differ from machine to machine; what makes an import slow does not.
    code = (
        "import sys, motoremi, motoremi.cli.app; print(' '.join(m for m in ('numpy', 'scipy', 'pandas', 'matplotlib', 'skrf') if m in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
