"""The laboratory profile for reports: named when the workbench starts, or chosen on the page and stored in the workbench's own folder."""

from __future__ import annotations

import base64
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.data.laboratory import Laboratory, read_laboratory
from motoremi.data.session import Session
from motoremi.data.storage import write_whole
from motoremi.data.text import clean_text
from motoremi.data.text_file import show_name
from motoremi.data.toml_file import parse_toml
from motoremi.errors import BadInput
from motoremi.workbench.tray import last_part
from motoremi.workflow_issue import laboratory_in

FOLDER, PROFILE = "laboratory", "profile.toml"
WANTED = "choose the laboratory's profile, a TOML file, and the logo that it names with it"
# File names that are valid on any system.
_PLAIN = re.compile(r"\w[\w .()+-]*")


class Letterhead:
    """The profile in use: name, number series and logo for reports.

    Parameters
    ----------
    folder : Path
        The workbench's own folder: a profile chosen on the page is stored here, with the register of its report numbers.
    named : Path or None
        The profile named at the start; if there is one, no other can be chosen.
    changed : callable
        Called when another profile was chosen.
    """

    def __init__(self, folder: Path, named: Path | None, changed: Callable[[], None]) -> None:
        self._kept = folder / FOLDER
        self._named = named
        self._changed = changed

    @property
    def profile(self) -> Path | None:
        """The path of the profile, if there is one."""
        kept = self._kept / PROFILE
        return self._named or (kept if kept.is_file() else None)

    def to_dict(self, session: Session) -> JsonDict:
        """The laboratory's name for the report of a session, and whether another can be chosen."""
        laboratory = laboratory_in(session) if self.profile is None else read_laboratory(self.profile)
        return {"laboratory": "" if laboratory is None else laboratory.name, "choosable": self._named is None}

    def choose(self, body: Mapping[str, object]) -> JsonDict:
        """Store a profile and its logo, and use them from now on.

        Parameters
        ----------
        body : mapping
            `files`: the profile and, if it names one, its logo; each with `name` and `data` (base64).

        Raises
        ------
        BadInput
            If they cannot be used, or the workbench was started with a profile; the profile stored before stays in use.
        """
        if self._named is not None:
            raise BadInput(f"this workbench was started with the profile {show_name(self._named)}: start it without --profile to choose one here")
        files = _files(body)
        profiles = [name for name in files if name.lower().endswith(".toml")]
        if len(profiles) != 1:
            raise BadInput(WANTED)
        laboratory, logo = _checked(profiles[0], files)
        if logo:
            write_whole(self._kept / logo, files[logo])
        write_whole(self._kept / PROFILE, files[profiles[0]])
        self._changed()
        return {"laboratory": laboratory.name}


def _files(body: Mapping[str, object]) -> dict[str, bytes]:
    """The files that were sent, by the last part of their names."""
    listed = body.get("files")
    if not isinstance(listed, list):
        raise BadInput(WANTED)
    try:
        return {last_part(one["name"]): base64.b64decode(one["data"], validate=True) for one in listed}
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(WANTED) from error


def _checked(profile: str, files: Mapping[str, bytes]) -> tuple[Laboratory, str]:
    """The laboratory, and the name of its logo's file.

    Raises
    ------
    BadInput
        If the profile or its logo cannot be used; the message uses the names under which the files were sent.
    """
    logo = parse_toml(files[profile], profile).get("logo", "")
    needed = {PROFILE: files[profile]}
    if isinstance(logo, str) and logo:
        # Only files that were chosen on the page are used, none from this machine's disk.
        if logo not in files:
            raise BadInput(f"{profile}: names the logo {clean_text(logo, 80)!r}; choose that file together with the profile")
        if not _PLAIN.fullmatch(logo):
            raise BadInput(f"{logo}: name the logo with letters and digits only, such as logo.svg")
        needed[logo] = files[logo]
    with tempfile.TemporaryDirectory() as folder:
        for name, data in needed.items():
            (Path(folder) / name).write_bytes(data)
        try:
            return read_laboratory(Path(folder) / PROFILE), logo
        except BadInput as error:
            raise BadInput(str(error).replace(f"{folder}/{PROFILE}", profile).replace(f"{folder}/", "")) from error
