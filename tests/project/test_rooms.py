"""Rooms depend on each other in one direction only: no import, wherever it stands, runs back."""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from places import ROOT

PACKAGE = ROOT / "src" / "motoremi"
# Modules directly below `motoremi` that every room may use.
PLAIN = {"arrays", "drawing", "errors", "given", "interrupts", "progress", "quantities", "threads", "workers"}
# What each room may import; what it may import stands above it. `workflow` are all modules of that name.
MAY_IMPORT: dict[str, set[str]] = {
    "data": set(),
    "model": set(),
    "fitting": {"model", "data"},
    "inspection": {"fitting", "model", "data"},
    "investigation": {"fitting", "model", "data"},
    "diagnosis": {"investigation", "inspection", "fitting", "model", "data"},
    "emission": {"diagnosis", "fitting", "model", "data"},
    "bench": {"data"},
    "schema": {"bench", "data", "emission"},
    "instruments": {"schema", "bench", "data"},
    "simulate": {"data"},
    "virtual": {"schema", "bench", "data", "simulate"},
    "run": {"virtual", "schema", "bench", "data"},
    "export": {"emission", "fitting", "model", "data"},
    "report": {"emission", "diagnosis", "inspection", "fitting", "model", "data"},
    "paper": {"report", "fitting", "model", "data", "simulate"},
    "workflow": {
        "export",
        "report",
        "run",
        "virtual",
        "schema",
        "bench",
        "emission",
        "diagnosis",
        "investigation",
        "inspection",
        "fitting",
        "model",
        "data",
    },
    "fleet": {"workflow", "export", "report", "diagnosis", "inspection", "fitting", "model", "data"},
    "blind": {"workflow", "emission", "diagnosis", "investigation", "fitting", "model", "data", "simulate"},
    "workbench": {
        "blind",
        "workflow",
        "report",
        "run",
        "schema",
        "bench",
        "emission",
        "diagnosis",
        "investigation",
        "inspection",
        "fitting",
        "model",
        "data",
        "simulate",
    },
}
MAY_IMPORT["cli"] = {*MAY_IMPORT}


def modules() -> dict[str, Path]:
    """All modules by name."""
    found = {f"motoremi.{path.relative_to(PACKAGE).with_suffix('').as_posix().replace('/', '.')}": path for path in PACKAGE.rglob("*.py")}
    found |= {f"motoremi.instruments.{path.stem}": path for path in (ROOT / "instruments").glob("*.py")}
    return {name.removesuffix(".__init__"): path for name, path in found.items()}


MODULES = modules()


@functools.cache
def imports(path: Path) -> tuple[str, ...]:
    """Modules that a module imports, those inside of its functions as well."""
    return tuple(_imported(path))


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] == "motoremi":
            assert node.level == 0
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                yield inside if inside in MODULES else str(node.module)


def room_of(module: str) -> str:
    """The room of a module; its own name where it stands alone, empty for the package itself."""
    name = module.partition(".")[2].partition(".")[0]
    return "workflow" if name.startswith("workflow") else name


def test_every_folder_is_a_room():
    folders = {path.name for path in PACKAGE.iterdir() if any(path.glob("*.py"))}
    alone = {path.stem for path in PACKAGE.glob("*.py") if not path.stem.startswith(("workflow", "__"))}
    assert folders | {"instruments", "workflow"} == set(MAY_IMPORT)
    # The catalogue's own entry for users: `motoremi.effects`.
    assert alone == PLAIN | {"effects"}


def test_the_map_in_the_documentation_is_this_one():
    """The last column of the table of packages names the rooms that each may import, or all."""
    stated: dict[str, set[str]] = {}
    for line in (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").splitlines():
        if not line.startswith("| `"):
            continue
        _, packages, _, uses, _ = line.split("|")
        name = re.search(r"`(?:src/motoremi/)?(\w+)", packages)
        assert name is not None
        if name[1] in MAY_IMPORT:
            stated[name[1]] = set(MAY_IMPORT) - {"cli"} if uses.strip() == "all" else set(re.findall(r"\w+", uses)) & set(MAY_IMPORT)
    assert stated == MAY_IMPORT


def test_rooms_stand_in_an_order():
    above: set[str] = set()
    for room, used in MAY_IMPORT.items():
        assert used <= above, room
        above.add(room)


@pytest.mark.parametrize("room", MAY_IMPORT)
def test_a_room_imports_only_what_it_may(room: str):
    used = [(module, other) for module, path in MODULES.items() if room_of(module) == room for other in imports(path)]
    allowed = MAY_IMPORT[room] | PLAIN | {room, ""}
    assert [f"{module} imports {other}" for module, other in used if room_of(other) not in allowed] == []
    # What nobody uses is not allowed either, but to the command line.
    assert room == "cli" or MAY_IMPORT[room] <= {room_of(other) for _, other in used}


def test_what_every_room_may_use_uses_no_room():
    assert {room_of(other) for module, path in MODULES.items() if room_of(module) in PLAIN for other in imports(path)} <= PLAIN


def test_no_module_needs_itself():
    """Also through others, and by an import inside a function: `graphlib` says which."""
    TopologicalSorter({module: set(imports(path)) - {"motoremi", module} for module, path in MODULES.items()}).prepare()
