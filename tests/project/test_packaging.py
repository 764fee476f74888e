"""What is in the wheel is what is in the folders, and it runs from an empty environment."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
import venv
import zipfile
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from places import ROOT

pytestmark = pytest.mark.slow

MAPPED = ("instruments", "procedures", "sim_profiles")


def test_package_list_names_every_folder():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    found = {".".join(p.parent.relative_to(ROOT / "src").parts) for p in (ROOT / "src").rglob("__init__.py")}
    found |= {".".join(("motoremi", *p.parent.relative_to(ROOT).parts)) for top in MAPPED for p in (ROOT / top).rglob("__init__.py")}
    assert set(settings["packages"]) == found


def test_data_files_are_declared():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    for package, folder in (
        ("motoremi.procedures", ROOT / "procedures"),
        ("motoremi.sim_profiles", ROOT / "sim_profiles"),
        ("motoremi.report", ROOT / "src" / "motoremi" / "report"),
        ("motoremi.workbench", ROOT / "src" / "motoremi" / "workbench"),
    ):
        data = [p.relative_to(folder) for p in folder.rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc")]
        assert data
        for file in data:
            assert any(file.parent == Path(pattern).parent and file.match(pattern) for pattern in declared[package]), file


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("wheel")
    # A copy, so that the build does not touch the strict editable installation's link tree in build/.
    copy = tmp_path_factory.mktemp("source") / "motoremi"
    copy.mkdir()
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
    for name in listed or [str(p.relative_to(ROOT)) for p in ROOT.rglob("*") if p.is_file()]:
        target = copy / name
        if (ROOT / name).is_file() and not name.startswith((".venv", "build/")):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((ROOT / name).read_bytes())
    subprocess.run([sys.executable, "-m", "build", "--outdir", str(out), str(copy)], check=True, capture_output=True)
    assert list(out.glob("*.tar.gz"))
    return next(out.glob("*.whl"))


def test_wheel_holds_drivers_procedures_and_profiles(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    for top in MAPPED:
        for file in (ROOT / top).iterdir():
            if file.is_file() and file.suffix != ".pyc":
                assert f"motoremi/{top}/{file.name}" in names
    assert "motoremi/py.typed" in names
    assert "motoremi/report/template.html.j2" in names
    assert "motoremi/workbench/static/index.html" in names
    # Its licence goes where it goes.
    assert "motoremi/workbench/static/vendor/uPlot.LICENSE" in names
    # The bare name belongs to InstrumentKit.
    assert not any(name.startswith("instruments/") for name in names)


def needed(name: str, extras: frozenset[str] = frozenset()) -> set[str]:
    """All that a distribution declares to need, directly or through others, each by its canonical name."""
    found: set[str] = set()
    open_ = [(name, extras)]
    while open_:
        one, wanted = open_.pop()
        for text in metadata.requires(one) or []:
            requirement = Requirement(text)
            if requirement.marker is None or any(requirement.marker.evaluate({"extra": extra}) for extra in ("", *wanted)):
                other = canonicalize_name(requirement.name)
                if other not in found:
                    found.add(other)
                    open_.append((other, frozenset(requirement.extras)))
    return found


def link(name: str, into: Path) -> None:
    """The files of an installed distribution in another environment, by links."""
    home = Path(str(metadata.distribution(name).locate_file("")))
    for top in {file.parts[0] for file in metadata.files(name) or [] if file.parts[0] != ".."}:
        if not (into / top).exists():
            (into / top).symlink_to(home / top)


def test_installed_wheel_runs_the_demo(wheel, tmp_path):
    """In an environment that holds what the wheel declares to need, and nothing else of ours; `pip check` says whether that is all."""
    venv.create(tmp_path / "env")
    python = tmp_path / "env" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--quiet", "--no-compile", "--no-deps", str(wheel)], check=True, capture_output=True)
    place = next((tmp_path / "env").glob("lib/python*/site-packages"))
    # Installing numpy, SciPy and pandas once more would take most of a minute, and be a test of pip.
    for name in needed("motoremi"):
        link(name, place)
    checked = subprocess.run([*pip, "check"], capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout
    command = [tmp_path / "env" / "bin" / "motoremi", "demo", "--effect", "lead-inductance", "--seed", "3", "--out", tmp_path / "d", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env={"PATH": "/usr/bin:/bin", "OMP_NUM_THREADS": "1"}, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert Path(told["report"]).exists()
    assert "lead-inductance" in {*told["named"], *(m for family in told["families"] for m in family)}
    bare = subprocess.run([python, "-c", "import instruments"], capture_output=True, cwd=tmp_path, check=False)
    assert bare.returncode != 0
