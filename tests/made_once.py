"""What takes long to make and many tests read is made once in a test run, by whichever process needs it first; the others wait for it."""

from __future__ import annotations

import fcntl
import hashlib
import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Result = TypeVar("Result")

# Names the folder to all processes of a run: the one that starts the workers makes it and removes it.
VARIABLE = "FOLDER_OF_THINGS_MADE_ONCE"


def begin() -> Callable[[], None] | None:
    """Make the folder, unless the process that started this one has; gives what removes it."""
    if VARIABLE in os.environ:
        return None
    folder = tempfile.mkdtemp(prefix="tests-")
    os.environ[VARIABLE] = folder

    def end() -> None:
        del os.environ[VARIABLE]
        shutil.rmtree(folder, ignore_errors=True)

    return end


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """The path that `make` wrote a file or a folder to. Tests do not change it: one that wants to copies it.

    Parameters
    ----------
    name : str
        Another one for every other content.
    make : callable
        Given a path that does not exist yet, in a folder of its own.
    """
    home = Path(os.environ[VARIABLE]) / name
    home.parent.mkdir(parents=True, exist_ok=True)
    with open(f"{home}.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not home.exists():
            unfinished = Path(f"{home}.unfinished")
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.mkdir()
            make(unfinished / home.name)
            unfinished.rename(home)
    return home / home.name


def worked_out_once(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """The function with its results made once for each of its arguments; it must depend on nothing else."""

    @wraps(function)
    def once(*arguments: Given.args, **named: Given.kwargs) -> Result:
        asked = hashlib.sha256(pickle.dumps((arguments, named))).hexdigest()
        made = made_once(f"{function.__name__}-{asked}", lambda path: path.write_bytes(pickle.dumps(function(*arguments, **named))))
        return pickle.loads(made.read_bytes())

    return once
