"""A report's number and date of issue: assigned once and kept with the session, so that the same session always gives the same report.

A report whose content differs from the one issued before it, because an analysis or the profile has changed, is an amendment: its number ends
with A1, A2 ..., and it names the report that it replaces (ISO/IEC 17025:2017, 7.8.8).
"""

from __future__ import annotations

import hashlib
from datetime import date
from pathlib import Path

from motoremi.arrays import JsonDict
from motoremi.data.laboratory import Laboratory, laboratory_of, read_laboratory
from motoremi.data.plain import to_line
from motoremi.data.register import take_number
from motoremi.data.session import Session
from motoremi.errors import BadInput
from motoremi.report.gaps import STORED
from motoremi.report.model import session_hash

LABORATORY, ISSUE = "laboratory", "issue"
# Analyses that a report shows.
SHOWN = frozenset((*STORED, "ladder", "comparison", "corrections"))
# Without a series, the number is the beginning of the data's digest, with so many digits.
DIGEST_DIGITS = 16


def laboratory_in(session: Session) -> Laboratory | None:
    """The profile that is kept with a session.

    Raises
    ------
    BadInput
        If it cannot be used.
    """
    stored = session.analysis(LABORATORY)
    if stored is None:
        return None
    try:
        return laboratory_of(stored.get("laboratory") or {}, session.path.name)
    except (BadInput, AttributeError, TypeError, ValueError) as error:
        raise BadInput(
            f"the laboratory profile kept with {session.path.name} cannot be used ({error}); give it again with --profile FILE"
        ) from error


def issue_for(session: Session, profile: Path | None) -> tuple[Laboratory | None, JsonDict | None]:
    """The laboratory that issues the report of a session, and the report's number and date; nothing is stored in the session.

    Parameters
    ----------
    session : Session
    profile : Path, optional
        Replaces the profile that is kept with the session.

    Returns
    -------
    laboratory : Laboratory or None
    issue : dict or None
        `number`, `date`, `content_sha256` and, for an amendment, the report that it `replaces`.

    Raises
    ------
    BadInput
        If the profile, or the stored number of an earlier report, cannot be used.
    """
    laboratory = laboratory_in(session) if profile is None else read_laboratory(profile)
    if laboratory is None:
        return None, None
    content = _content_sha256(session, laboratory)
    before = session.analysis(ISSUE)
    today = date.today()
    if before is None:
        digest = session_hash(session)
        number = digest[:DIGEST_DIGITS]
        if profile is not None and laboratory.series:
            number = take_number(profile, laboratory.series, digest, today)
        return laboratory, _issue(number, today, content, 0, None)
    try:
        if before["content_sha256"] == content:
            return laboratory, before
        first, amendment = str(before["series_number"]), int(before["amendment"]) + 1
        replaces = {"number": str(before["number"]), "date": str(before["date"])}
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"the number of the report issued before, {ISSUE}.json, cannot be read by this version ({type(error).__name__})") from error
    return laboratory, _issue(first, today, content, amendment, replaces)


def stored_laboratory(laboratory: Laboratory) -> JsonDict:
    """The profile as it is stored in a session."""
    return {"schema": "motoremi.laboratory/1", "laboratory": laboratory.to_dict()}


def _issue(first: str, issued: date, content: str, amendment: int, replaces: JsonDict | None) -> JsonDict:
    number = f"{first} A{amendment}" if amendment else first
    known = {"schema": "motoremi.issue/1", "number": number, "date": issued.isoformat(), "series_number": first, "amendment": amendment}
    return {**known, "replaces": replaces, "content_sha256": content}


def _content_sha256(session: Session, laboratory: Laboratory) -> str:
    """A digest of the report's content, independent of the version of this software."""
    analyses = {str(d["name"]): str(d["sha256"]) for d in session.used_documents if d["kind"] == "analysis" and d.get("name") in SHOWN}
    content = {"data": session_hash(session), "analyses": analyses, "laboratory": laboratory.to_dict()}
    return hashlib.sha256(to_line(content).encode()).hexdigest()
