"""Files dropped on the page, kept in memory until they become a session or are removed."""

from __future__ import annotations

import hashlib
import re
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from motoremi.arrays import JsonDict
from motoremi.data.conditions import Condition
from motoremi.data.corrections import NO_CORRECTIONS, Corrections, entries_of, read_corrections
from motoremi.data.import_notes import final_summaries
from motoremi.data.recognise import Recognised, recognise
from motoremi.data.sweep import TERMINATIONS
from motoremi.data.text import clean_text
from motoremi.data.text_file import decode, refuse_empty
from motoremi.data.toml_file import parse_toml
from motoremi.data.touchstone import FIXTURES
from motoremi.errors import BadInput
from motoremi.quantities import show_band
from motoremi.workflow_import import Addition, Import, ImportOptions, addition, prepared

MOST_FILES = 60
MOST_BYTES = 256 * 1024**2
LONGEST_NAME, LONGEST_TEXT = 120, 200
LEFT_OUT, SPECTRUM, CORRECTIONS = "leave out", "spectrum", "corrections"
# What the form on the page may state about the files.
TEXTS = ("analyser", "band", "accuracy", "motor", "serial", "operator", "ambient")


@dataclass
class Dropped:
    """One dropped file.

    Parameters
    ----------
    name : str
        The last part of its name, control characters escaped.
    data : bytes
    used_as : str
        "short", "open", "spectrum", "corrections" or "leave out".
    found : Recognised, optional
        The sweep or spectra read from it.
    tables : frozenset of str, optional
        For a corrections file: the tables that it names.
    trouble : str
        Why the file cannot be used; empty if it can.
    """

    name: str
    data: bytes
    used_as: str = ""
    found: Recognised | None = None
    tables: frozenset[str] | None = None
    trouble: str = ""

    @property
    def choices(self) -> tuple[str, ...]:
        """The uses that can be chosen for it."""
        if self.tables is not None:
            return CORRECTIONS, LEFT_OUT
        if self.found is None:
            return (LEFT_OUT,)
        return (*(TERMINATIONS if self.found.sweep is not None else (SPECTRUM,)), LEFT_OUT)

    def look(self, fixture: str | None) -> None:
        """Read the file for its chosen use; the first time, recognise what it is."""
        given = next((termination for termination in TERMINATIONS if termination == self.used_as), None)
        unknown = self.found is None and self.tables is None
        self.trouble = ""
        try:
            if self.name.lower().endswith(".toml"):
                self.tables = _tables(self.data, self.name)
            else:
                self.found = recognise(self.data, self.name, given, fixture)
        except BadInput as error:
            self.trouble = str(error)
        if unknown:
            self.used_as = CORRECTIONS if self.tables is not None else LEFT_OUT if self.found is None else self.found.used_as

    def to_dict(self) -> JsonDict:
        """Plain data for the page."""
        data = {"name": self.name, "bytes": len(self.data), "used_as": self.used_as, "choices": self.choices, "trouble": self.trouble}
        found = self.found
        if found is None:
            return {**data, "kind": CORRECTIONS if self.tables is not None else ""}
        ones = [found.sweep] if found.sweep is not None else [*found.spectra, *found.finals]
        detectors = ", ".join(one.detector for one in found.spectra)
        first = ones[0].metadata
        notes = [found.doubt, *(str(note) for key in ("changes", "warnings") for note in first.get(key, []))]
        notes += [f"{text} is assumed" for key, text in _ASSUMED.items() if any(one.metadata.get(key) for one in ones)]
        notes += [*final_summaries(found.finals), str(first.get("final_values_left_out", ""))]
        return {
            **data,
            "kind": "impedance sweep" if found.sweep is not None else f"spectrum: {detectors}" if detectors else "final values",
            "points": sum(len(one) for one in found.spectra or ones),
            "span": show_band(float(ones[0].frequency_hz[0]), float(ones[0].frequency_hz[-1])),
            "format": ", ".join(str(first[key]) for key in ("format", "read_as") if key in first),
            "analyser": str(first.get("analyser", "")),
            "notes": [note for note in notes if note],
        }


_ASSUMED = {"detector_assumed": "the detector", "rbw_assumed": "a bandwidth of 9 kHz"}


class Tray:
    """All dropped files.

    Parameters
    ----------
    changed : callable
        Called after every change.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._turn = threading.RLock()
        self._files: dict[int, Dropped] = {}
        self._fixture: str | None = None
        self._next = 1

    def to_dict(self) -> JsonDict:
        """Plain data for the page."""
        with self._turn:
            tables = {name for one in self._files.values() if one.used_as == CORRECTIONS for name in one.tables or ()}
            files = [{"id": number, **one.to_dict()} for number, one in self._files.items()]
            for one in files:
                if one["name"] in tables:
                    one |= {"kind": "table of the corrections", "trouble": ""}
            return {"files": files, "fixture": self._fixture or "", "fixtures": list(FIXTURES)}

    def take(self, name: str, data: bytes) -> JsonDict:
        """Read a file and keep it in memory; a text file that cannot be used is kept with the reason.

        Raises
        ------
        BadInput
            If it is not text, is in the list already, or the list is full.
        """
        shown = last_part(name)
        refuse_empty(data, shown)
        decode(data, shown)
        one = Dropped(shown, data)
        with self._turn:
            self._refuse(one)
            one.look(self._fixture)
            self._files[self._next] = one
            self._next += 1
        return self._changed_list()

    def change(self, number: int, used_as: object) -> JsonDict:
        """Change the use of a file."""
        with self._turn:
            one = self._one(number)
            if used_as not in one.choices:
                raise BadInput(f"{one.name}: can be used as {', '.join(one.choices)}")
            one.used_as = str(used_as)
            if one.used_as in TERMINATIONS:
                one.look(self._fixture)
            elif one.found is not None:
                one.trouble = ""
        return self._changed_list()

    def choose_fixture(self, fixture: object) -> JsonDict:
        """Choose how the motor was connected between the two ports of Touchstone files."""
        if fixture not in FIXTURES:
            raise BadInput(f"the fixture must be one of {', '.join(FIXTURES)}")
        with self._turn:
            self._fixture = str(fixture)
            for one in self._files.values():
                if one.found is None or one.found.sweep is not None:
                    one.look(self._fixture)
        return self._changed_list()

    def remove(self, number: int) -> JsonDict:
        """Remove one file."""
        with self._turn:
            self._one(number)
            del self._files[number]
        return self._changed_list()

    def clear(self) -> JsonDict:
        """Remove all files."""
        with self._turn:
            self._files.clear()
        return self._changed_list()

    def imported(self, body: Mapping[str, Any]) -> Import:
        """The session that the chosen files become, as `motoremi import` would make it.

        Raises
        ------
        BadInput
            If no file is chosen, or the form does not fit these files.
        """
        with self._turn:
            chosen = self._chosen((*TERMINATIONS, SPECTRUM))
            if not chosen:
                raise BadInput("choose at least one file as short, open or spectrum")
            stated = _stated(body, self._corrections())
        found = [one.found for one in chosen if one.found is not None]
        sweeps = [one.sweep for one in found if one.sweep is not None]
        spectra, finals = [item for one in found for item in one.spectra], [item for one in found for item in one.finals]
        return prepared(sweeps, spectra, stated, [one.name for one in chosen], finals=finals)

    def added(self, folder: Path, condition: Condition | None, body: Mapping[str, Any]) -> Addition:
        """What the chosen sweeps add to a session, as `motoremi import --append` would add them.

        Raises
        ------
        BadInput
            If no sweep is chosen, or it does not fit the session.
        """
        with self._turn:
            chosen = self._chosen(TERMINATIONS)
        sweeps = [one.found.sweep for one in chosen if one.found is not None and one.found.sweep is not None]
        if not sweeps:
            raise BadInput("choose at least one file as short-circuit or open-circuit sweep")
        return addition(folder, sweeps, (), condition, _stated(body, NO_CORRECTIONS))

    def _chosen(self, uses: Sequence[str]) -> list[Dropped]:
        """The files with one of these uses, in their order.

        Raises
        ------
        BadInput
            If one of them cannot be used.
        """
        chosen = [one for used_as in uses for one in self._files.values() if one.used_as == used_as]
        for one in chosen:
            if one.trouble:
                raise BadInput(one.trouble)
        return chosen

    def _changed_list(self) -> JsonDict:
        self._changed()
        return self.to_dict()

    def _one(self, number: int) -> Dropped:
        if number not in self._files:
            raise BadInput("this file is not in the list any more")
        return self._files[number]

    def _refuse(self, new: Dropped) -> None:
        digest = hashlib.sha256(new.data).digest()
        for one in self._files.values():
            if len(one.data) == len(new.data) and hashlib.sha256(one.data).digest() == digest:
                raise BadInput(f"{new.name}: is the same file as {one.name}, which is in the list already")
        if len(self._files) >= MOST_FILES:
            raise BadInput(f"{new.name}: there are {MOST_FILES} files in the list already; make a session of them first, or use motoremi import")
        if sum(len(one.data) for one in self._files.values()) + len(new.data) > MOST_BYTES:
            raise BadInput(f"{new.name}: the files are larger than {MOST_BYTES // 1024**2} MiB together; use motoremi import for such files")

    def _corrections(self) -> Corrections:
        """The corrections; the tables that the file names are looked up among the dropped files only."""
        files = [one for one in self._files.values() if one.used_as == CORRECTIONS]
        if not files:
            return NO_CORRECTIONS
        if len(files) > 1:
            raise BadInput(f"{files[0].name} and {files[1].name} both hold corrections; leave one out")
        chosen, beside = files[0], {one.name: one.data for one in self._files.values()}
        for table in chosen.tables or ():
            if table not in beside:
                raise BadInput(f"{chosen.name}: names the table {clean_text(table, 80)!r}; drop that file here as well")
        with tempfile.TemporaryDirectory() as folder:
            for name in (chosen.name, *(chosen.tables or ())):
                (Path(folder) / name).write_bytes(beside[name])
            try:
                return read_corrections(Path(folder) / chosen.name)
            except BadInput as error:
                raise BadInput(str(error).replace(f"{folder}/", "")) from error


def _stated(body: Mapping[str, Any], corrections: Corrections) -> ImportOptions:
    """What the form on the page states about the files."""
    texts = {key: body.get(key, "") for key in TEXTS}
    for key, text in texts.items():
        if not isinstance(text, str) or len(text) > LONGEST_TEXT:
            raise BadInput(f"{key} must be text of at most {LONGEST_TEXT} characters")
    analyser, compensated = texts.pop("analyser") or None, body.get("compensated", False)
    if not isinstance(compensated, bool):
        raise BadInput("compensated must be true or false")
    return ImportOptions(analyser=analyser, corrections=corrections, compensated=compensated, **{key: text.strip() for key, text in texts.items()})


def _tables(data: bytes, name: str) -> frozenset[str]:
    """The tables that a corrections file names.

    Raises
    ------
    BadInput
        If it holds no corrections.
    """
    listed = entries_of(parse_toml(data, name), name, " (a laboratory's profile is chosen on the view Report)")
    return frozenset(str(entry["file"]) for entry in listed if isinstance(entry, dict) and entry.get("file"))


def last_part(name: str) -> str:
    """The last part of a file's name, safe to show and to record; a browser may send any text."""
    shown = clean_text(re.split(r"[/\\]", name)[-1], LONGEST_NAME).strip()
    return shown if shown.strip(".") else "unnamed"
