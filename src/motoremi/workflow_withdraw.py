"""Withdraw sweeps, spectra and values of a session, or use them again; nothing that was measured is removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from motoremi.data.session import Session, load, refuse_unfinished, reopen
from motoremi.data.text import clean_text
from motoremi.data.withdrawn import OF_SPECTRA, called
from motoremi.errors import BadInput
from motoremi.workflow import measurement_of
from motoremi.workflow_emission import discard_of_other_spectra, has_analyses_of_spectra
from motoremi.workflow_import import same_repeats


@dataclass(frozen=True)
class Withdrawal:
    """What was withdrawn from a session, or is used again.

    Parameters
    ----------
    names : tuple of str
    restored : bool
        Whether they are used again.
    why : str
    emptied_ladder : bool
        Whether the models of the ladder were removed, since they were fitted to other data.
    discarded : bool
        Whether verdict, models and diagnosis of the spectra were removed, since they were of other spectra.
    of_spectra : bool
        Whether only spectra were withdrawn, or used again.
    session : Session
        Afterwards.
    """

    names: tuple[str, ...]
    restored: bool
    why: str
    emptied_ladder: bool
    discarded: bool
    of_spectra: bool
    session: Session


def withdraw(folder: Path, names: Sequence[str], why: str) -> Withdrawal:
    """Withdraw sweeps, spectra and values: they stay in the session, and no analysis uses them.

    Parameters
    ----------
    folder : Path
    names : sequence of str
        A sweep or spectrum by its file (`short-2` or `sweeps/short-2.csv`); a name of single values, of which all are
        withdrawn, or `dc-resistance-2` for the second of several.
    why : str
        The reason, which the report gives.

    Raises
    ------
    BadInput
        Without a reason, if there is no such measurement in use, or if no sweep of the motor as it is, or no spectrum of a session of spectra
        alone, would be left. Nothing is changed then.
    """
    reason = clean_text(" ".join(why.split()))
    if not reason:
        raise BadInput("say why: --why TEXT; the report gives the reason")
    return _changed(folder, names, reason, restored=False)


def restore_withdrawn(folder: Path, names: Sequence[str]) -> Withdrawal:
    """Use measurements again that were withdrawn; as `withdraw`."""
    return _changed(folder, names, "", restored=True)


def _changed(folder: Path, names: Sequence[str], why: str, restored: bool) -> Withdrawal:
    before = load(folder)
    if "procedure" in before.start:
        # A resumed run counts the sweeps that are stored.
        refuse_unfinished(before)
    numbers = {name: called(before.documents, name, withdrawn=restored) for name in dict.fromkeys(names)}
    concerned = {number for own in numbers.values() for number in own}
    if not restored:
        _refuse_the_last(before, concerned)
    with reopen(folder) as writer:
        for name, own in numbers.items():
            writer.emit("restored" if restored else "withdrawn", name=name, documents=own, **({} if restored else {"why": why}))
        after = load(folder)
        emptied = bool(after.ladder) and not same_repeats(measurement_of(before), measurement_of(after))
        if emptied:
            writer.save_analysis("ladder", after.emptied_ladder())
        kinds = {document["kind"] for document in before.documents if document["seq"] in concerned}
        discarded = not kinds.isdisjoint(OF_SPECTRA) and has_analyses_of_spectra(before)
        if discarded:
            discard_of_other_spectra(writer)
    return Withdrawal(tuple(numbers), restored, why, emptied, discarded, kinds.issubset(OF_SPECTRA), load(folder))


def _refuse_the_last(session: Session, numbers: set[int]) -> None:
    reference = {document["seq"] for document in session.used_documents if document["kind"] == "sweep" and "condition" not in document}
    if reference and reference <= numbers:
        raise BadInput(
            "no sweep of the motor as it is would be left: add the right one first (motoremi import SESSION --append), or make a new session"
        )
    spectra = {document["seq"] for document in session.used_documents if document["kind"] == "spectrum"}
    if spectra and spectra <= numbers and not reference:
        raise BadInput("no spectrum would be left: add the right one first (motoremi import SESSION --append --spectrum FILE)")
