"""Measured sweeps, spectra and values that were withdrawn: they stay in the session with the reason, and no analysis uses them.

A "withdrawn" document gives the sequence numbers of the documents that it withdraws; a "restored" one those that are used again. Analyses that
rest on withdrawn spectra are withdrawn in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath

from motoremi.arrays import JsonDict
from motoremi.data.text import clean_text
from motoremi.errors import BadInput

# Kinds of documents that can be withdrawn by name: those of sweeps and values, which the diagnosis of the motor uses, and those of spectra.
OF_THE_MOTOR = ("sweep", "value")
OF_SPECTRA = ("spectrum", "final")
KINDS = (*OF_THE_MOTOR, *OF_SPECTRA)


def withdrawals(documents: Sequence[JsonDict]) -> dict[int, JsonDict]:
    """Sequence number of each withdrawn document -> the document that withdraws it."""
    found: dict[int, JsonDict] = {}
    for document in documents:
        for number in concerned(document):
            if document["kind"] == "withdrawn":
                found[number] = document
            else:
                found.pop(number, None)
    return found


def concerned(document: JsonDict) -> list[int]:
    """Sequence numbers of the documents that a document withdraws or restores; none of one of another kind."""
    numbers = document.get("documents") if document["kind"] in ("withdrawn", "restored") else None
    return [one for one in numbers if isinstance(one, int)] if isinstance(numbers, list) else []


def name_of(document: JsonDict) -> str:
    """The name by which a user calls a measurement: `short-2`, `open-second-temperature-1`, `peak-1`, `final-quasi-peak-3`, `dc-resistance`."""
    return str(document.get("name")) if document["kind"] == "value" else PurePosixPath(str(document.get("file"))).stem


def names_of(documents: Sequence[JsonDict]) -> dict[int, str]:
    """Sequence number -> name of each measurement of a session; of several values with one name each has its number."""
    measured = [document for document in documents if document["kind"] in KINDS]
    names = [name_of(document) for document in measured]
    every = {document["seq"]: name for document, name in zip(measured, names, strict=True)}
    for at, document in enumerate(measured):
        if document["kind"] == "value" and names.count(names[at]) > 1:
            every[document["seq"]] = f"{names[at]}-{names[: at + 1].count(names[at])}"
    return every


def called(documents: Sequence[JsonDict], name: str, withdrawn: bool) -> list[int]:
    """Sequence numbers of the withdrawn, or of the used, measurements of this name.

    Parameters
    ----------
    documents : sequence of dict
        All of the session.
    name : str
        As in `name_of`, or the file of a sweep or spectrum; `dc-resistance-2` is the second of several values.
    withdrawn : bool
        Whether those that are withdrawn are sought.

    Raises
    ------
    BadInput
        If there are none, with what there is.
    """
    gone = withdrawals(documents)
    measured = [document for document in documents if document["kind"] in KINDS]
    wanted = name.removeprefix("./").removeprefix("sweeps/").removeprefix("spectra/").removesuffix(".csv")
    own = names_of(documents)
    of_name = [document for document in measured if wanted in (name_of(document), own[document["seq"]])]
    found = [int(document["seq"]) for document in of_name if (document["seq"] in gone) == withdrawn]
    if found:
        return found
    shown = clean_text(repr(name), 80)
    if of_name:
        raise BadInput(f"{shown} {'is not withdrawn' if withdrawn else 'is withdrawn already'}")
    names = dict.fromkeys(own[document["seq"]] for document in measured if not withdrawn or document["seq"] in gone)
    what = "withdrawn sweep, spectrum or value" if withdrawn else "sweep, spectrum or single value"
    raise BadInput(f"no {what} is called {shown}; there {'is' if len(names) == 1 else 'are'} {', '.join(names) or 'none'}")
