"""What takes long to make and many tests read is made once in a test run, by whichever process needs it first; the others wait for it."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

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
