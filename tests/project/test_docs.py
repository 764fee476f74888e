"""The documentation: it builds without warnings and without network, and every command and code block in it runs."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from contextlib import nullcontext
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import nbformat
import pytest
from command_line import motoremi
from few_effects import FEW, seeking
from nbclient import NotebookClient
from places import ROOT

from motoremi.diagnosis.informed import NOT_AS_ASKED

pytestmark = pytest.mark.slow

DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if path.name != "architecture.md")
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
# What the page about investigations tells apart.
SHOWN = {"bearing-film", "dielectric-relaxation@Cr"}
# Nothing that a shell makes something else of: it is split at blanks and quotes. A page may allow one exit status beside 0.
PLAIN = re.compile(r"motoremi ((?!.*--effects-from)[^|&;<>$*?~`#\\]+?)(?: \|\| test \$\? = (\d))?")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def environment(home: Path) -> dict[str, str]:
    """Without the user's own settings, and with the command of this environment first."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith("MOTOREMI_")}
    return {**clean, "HOME": str(home), "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "MPLBACKEND": "agg"}


def run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, env=environment(folder), capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, f"{' '.join(command)[:300]}\n{done.stdout}\n{done.stderr}"


def run_commands(block: str, folder: Path) -> None:
    """Commands of motoremi alone run in this process; what needs a shell, or changes the catalogue, in one."""
    for line in block.strip().splitlines():
        command = PLAIN.fullmatch(line)
        if command is None:
            run(["bash", "-euc", line], folder)
            continue
        words, allowed = command.groups(default="0")
        done = motoremi(*shlex.split(words), cwd=folder, HOME=str(folder))
        assert done.returncode in (0, int(allowed)), f"{line}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_runs(page: Path, tmp_path: Path) -> None:
    # The tutorial seeks all effects; what the others show works the same with a few.
    with nullcontext() if page.stem == "tutorial" else seeking(FEW | SHOWN):
        run_page(page, tmp_path)


def run_page(page: Path, tmp_path: Path) -> None:
    if page.stem == "own-effect":
        shutil.copy(DOCS / "examples" / "ferrite_bead.py", tmp_path)
    blocks = BLOCK.findall(page.read_text("utf-8"))
    for language, block in blocks:
        assert language in ("bash", "python", "toml", "text"), f"{page}: a block in {language} is not run by this test"
        if language == "toml":
            tomllib.loads(block)
    program = ""
    for language, row in groupby((one for one in blocks if one[0] in ("bash", "python")), key=itemgetter(0)):
        lines = "".join(block for _, block in row)
        if language == "bash":
            run_commands(lines, tmp_path)
        else:
            # The blocks of a page go on where the one before ended; several in a row are run at once.
            program += lines
            run([sys.executable, "-c", program], tmp_path)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_hold_their_results(notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = nbformat.read(notebook, 4)
    codes = [cell for cell in content.cells if cell.cell_type == "code"]
    assert any(cell.outputs for cell in codes)
    assert not any(output.output_type == "error" for cell in codes for output in cell.outputs)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("MOTOREMI_EFFECTS_FROM", raising=False)
    NotebookClient(content, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()


def test_it_builds_without_warnings_and_refers_to_nothing_outside(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    pages = {path.parent.relative_to(tmp_path / "site").as_posix(): path.read_text("utf-8") for path in (tmp_path / "site").rglob("index.html")}
    assert "motoremi fleet" in pages["reference/commands"]
    assert pages["explanation/effects"].count("<svg role") > 15
    assert "FERRITE_BEAD" in pages["howto/own-effect"]
    for name, text in pages.items():
        assert not re.search(r'<(?:script|link|img)[^>]+(?:src|href)="(?:https?:)?//', text), name


def test_the_table_of_findings_has_every_identifier() -> None:
    told = set(re.findall(r"^\| `([a-z-]+)` \|", (DOCS / "reference" / "findings.md").read_text("utf-8"), re.MULTILINE))
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "src" / "motoremi" / "diagnosis").glob("*.py"))
    assert told == {*re.findall(r'Finding\(\s*"([a-z-]+)"', sources), NOT_AS_ASKED}
