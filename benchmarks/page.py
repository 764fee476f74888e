"""The command of a benchmark that makes a page of the documentation."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path


def make(description: str, page: Callable[..., Iterable[str]], *places: str) -> None:
    """Write a page to the file of `--out`, or to standard output.

    Parameters
    ----------
    description : str
        Its first line describes the command.
    page : callable
        Takes a path for each place, and gives the lines of the page.
    places : str
        Names of the files or folders that the command line gives.
    """
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    for place in places:
        parser.add_argument(place, type=Path)
    parser.add_argument("--out", type=Path, help="write the page here instead of printing it")
    arguments = parser.parse_args()
    text = "\n".join(page(*(getattr(arguments, place) for place in places))) + "\n"
    if arguments.out is None:
        print(text, end="")
    else:
        arguments.out.write_text(text, encoding="utf-8")
