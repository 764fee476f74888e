"""The packages of the bench depend on each other in one direction only: bench, schema, virtual, run."""

from __future__ import annotations

import ast

import pytest
from places import ROOT

# Modules directly below `motoremi` that every package may use.
PLAIN = {"arrays", "errors", "interrupts", "quantities"}
MAY_IMPORT = {
    "src/motoremi/bench": {"bench", "data"},
    "src/motoremi/schema": {"schema", "bench", "data", "emission"},
    "src/motoremi/virtual": {"virtual", "schema", "bench", "data", "simulate"},
    "src/motoremi/run": {"run", "virtual", "schema", "bench", "data"},
    "instruments": {"instruments", "schema", "bench", "data"},
}


@pytest.mark.parametrize("folder", MAY_IMPORT)
def test_a_package_of_the_bench_imports_only_what_lies_below_it(folder: str):
    used = {}
    for path in (ROOT / folder).glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("motoremi."):
                used[str(node.module).split(".")[1]] = f"{path.name} imports {node.module}"
    assert used.keys() >= {"bench"}
    assert [line for package, line in used.items() if package not in MAY_IMPORT[folder] | PLAIN] == []
