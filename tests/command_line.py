"""The command line for tests: in this process, which saves the imports of a second one, or in a process of its own."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any
from unittest import mock

from motoremi.cli import main

# What Python does not show of warnings unless it is asked to.
HIDDEN_WARNINGS = (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning)


def motoremi(*arguments: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in this process: exit status, what it printed and what it warned of are those of a process of its own.

    As there, variables that set options of commands are only those that are given.
    """
    words = [str(argument) for argument in arguments]
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2))
    status: Any = 0
    with contextlib.ExitStack() as stack:
        stack.enter_context(mock.patch.dict(os.environ, _environment(environment), clear=True))
        stack.enter_context(contextlib.chdir(cwd or Path.cwd()))
        stack.enter_context(mock.patch.object(sys, "argv", ["motoremi", *words]))
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("default")
        for category in HIDDEN_WARNINGS:
            warnings.simplefilter("ignore", category)
        warnings.showwarning = lambda *told, **_: err.write(warnings.formatwarning(*told[:4]))
        try:
            main()
        except SystemExit as end:
            status = end.code
    return subprocess.CompletedProcess(words, status, _text_of(out), _text_of(err))


def motoremi_process(*arguments: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own."""
    command = [sys.executable, "-c", "from motoremi.cli import main; main()", *(str(a) for a in arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=cwd, env=_environment(environment), check=False)


def document(done: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    """The JSON document that a command printed, and nothing else with it."""
    assert "Traceback" not in done.stderr
    return json.loads(done.stdout)


def _environment(given: dict[str, str]) -> dict[str, str]:
    """Without the settings of whoever runs the tests."""
    return {key: value for key, value in os.environ.items() if not key.startswith("MOTOREMI_")} | given


def _text_of(stream: io.TextIOWrapper) -> str:
    stream.flush()
    return stream.buffer.getvalue().decode("utf-8")  # type: ignore[attr-defined]
