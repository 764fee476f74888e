"""A report's number and date of issue: given once, kept with the session, so that the same session gives the same report for ever.

A report that says something else than the one issued before it, because an analysis or the profile changed since, is an amendment: it has
the number with A1, A2 ... behind it, and names what it replaces (ISO/IEC 17025:2017, 7.8.8).
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
# Without a series, so much of the data's digest is the number.
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
    """Who issues the report of a session, and its number and date; nothing is stored in the session.

    Parameters
    ----------
    session : Session
    profile : Path, optional
        In place of the profile that is kept with the session.

    Returns
    -------
    laboratory : Laboratory or None
    issue : dict or None
        `number`, `date`, `content_sha256` and, of an amendment, what it `replaces`.

    Raises
    ------
    BadInput
        If the profile, or what is stored of an earlier issue, cannot be used.
    """
    laboratory = laboratory_in(session) if profile is None else read_laboratory(profile)
    if laboratory is None:
        return None, None
    content = _content_sha256(session, laboratory)
    before = session.analysis(ISSUE)
    today = date.today()
    if before is None:
        digest = session_hash(session)
        numbered = profile is not None and laboratory.series
        number = take_number(profile, laboratory.series, digest, today) if profile is not None and numbered else digest[:DIGEST_DIGITS]
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
    """The profile as a session keeps it."""
    return {"schema": "motoremi.laboratory/1", "laboratory": laboratory.to_dict()}


def _issue(first: str, issued: date, content: str, amendment: int, replaces: JsonDict | None) -> JsonDict:
    number = f"{first} A{amendment}" if amendment else first
    known = {"schema": "motoremi.issue/1", "number": number, "date": issued.isoformat(), "series_number": first, "amendment": amendment}
    return {**known, "replaces": replaces, "content_sha256": content}


def _content_sha256(session: Session, laboratory: Laboratory) -> str:
    """A digest of what the report is made of, whatever version of this software makes it."""
    analyses = {str(d["name"]): str(d["sha256"]) for d in session.documents if d["kind"] == "analysis" and d.get("name") in SHOWN}
    told = {"data": session_hash(session), "analyses": analyses, "laboratory": laboratory.to_dict()}
    return hashlib.sha256(to_line(told).encode()).hexdigest()
