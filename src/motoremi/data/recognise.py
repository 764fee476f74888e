"""Recognise a file without a description: impedance sweep or spectrum, and the termination of a sweep."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from motoremi.data.files import parse_emission, parse_impedance
from motoremi.data.spectrum import Spectrum
from motoremi.data.spectrum_table import SPECTRUM_COLUMNS
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep, Termination
from motoremi.data.text_file import WrongKind, decode, refuse_empty
from motoremi.errors import BadInput

Kind: TypeAlias = Literal["impedance", "spectrum"]
# Words in file names, in several languages; a word of two letters must stand alone.
_NAMES: tuple[tuple[Termination, re.Pattern[str]], ...] = (
    ("short", re.compile(r"short|kurz|court|(?<![a-z])(?:sc|ks)(?![a-z])")),
    ("open", re.compile(r"open|leerlauf|ouvert|(?<![a-z])(?:oc|ll)(?![a-z])")),
)
# Share of a sweep that counts as its low end.
_LOW_END = 0.1


@dataclass(frozen=True, eq=False)
class Recognised:
    """The content of a file.

    Parameters
    ----------
    kind : {"impedance", "spectrum"}
    sweep : ImpedanceSweep, optional
    spectra, finals : tuple of Spectrum
        Scans, and the final values that a receiver's file holds beside them.
    doubt : str
        A sentence if the termination stated by the file's name or header does not agree with the curve.
    """

    kind: Kind
    sweep: ImpedanceSweep | None = None
    spectra: tuple[Spectrum, ...] = ()
    finals: tuple[Spectrum, ...] = ()
    doubt: str = ""

    @property
    def used_as(self) -> str:
        """Termination of a sweep, or `spectrum`."""
        return self.sweep.termination if self.sweep is not None else "spectrum"


def recognise(data: bytes, name: str, termination: Termination | None = None, fixture: str | None = None) -> Recognised:
    """Read a file with the reader for its content.

    Parameters
    ----------
    data : bytes
        The whole file.
    name : str
        Name for messages and records.
    termination : {"short", "open"}, optional
        As stated by its owner; without it the header decides, then the file's name, then the low end of the sweep: a winding is resistive
        or inductive there, the path to the frame is capacitive.
    fixture : str, optional
        As for `read_impedance`.

    Raises
    ------
    BadInput
        In one line, if it is neither an impedance sweep nor a spectrum, or cannot be used.
    """
    refuse_empty(data, name)
    text = decode(data, name)
    try:
        sweep = _sweep(text, name, termination, fixture)
    except BadInput as error:
        spectra, finals = _emission(text, name, error)
        return Recognised("spectrum", spectra=tuple(spectra), finals=tuple(finals))
    return Recognised("impedance", sweep, doubt=_doubt(sweep))


def _emission(text: str, name: str, no_sweep: BadInput) -> tuple[list[Spectrum], list[Spectrum]]:
    try:
        return parse_emission(text, name)
    except WrongKind:
        # It is a sweep that cannot be used.
        raise no_sweep from None
    except BadInput as no_spectrum:
        if isinstance(no_sweep, WrongKind):
            raise
        raise BadInput(f"{no_sweep}; an emission spectrum needs {SPECTRUM_COLUMNS}") from no_spectrum


def _sweep(text: str, name: str, termination: Termination | None, fixture: str | None) -> ImpedanceSweep:
    if termination is not None:
        return parse_impedance(text, name, termination, fixture)
    named = _named(name)
    try:
        sweep = parse_impedance(text, name, named or "short", fixture)
    except WrongKind:
        raise
    except BadInput as error:
        # Its header may state the other termination.
        other = next(one for one in TERMINATIONS if one != (named or "short"))
        try:
            return parse_impedance(text, name, other, fixture)
        except BadInput:
            raise error from None
    if named or _looks(sweep) == "short":
        return sweep
    try:
        return parse_impedance(text, name, "open", fixture)
    except BadInput:
        # Its header states that it is the short-circuit sweep.
        return sweep


def _named(name: str) -> Termination | None:
    """Termination in the file's name; None if it contains none or both."""
    found = [termination for termination, pattern in _NAMES if pattern.search(name.lower())]
    return found[0] if len(found) == 1 else None


def _looks(sweep: ImpedanceSweep) -> Termination:
    low = sweep.impedance_ohm[: max(3, int(_LOW_END * len(sweep)))]
    return "open" if float(np.median(np.degrees(np.angle(low)))) < -45 else "short"


def _doubt(sweep: ImpedanceSweep) -> str:
    looks = _looks(sweep)
    if looks == sweep.termination:
        return ""
    if looks == "open":
        return "capacitive at its low end, like the path to the frame: is this the open-circuit sweep?"
    return "not capacitive at its low end, like a winding: is this the short-circuit sweep?"
