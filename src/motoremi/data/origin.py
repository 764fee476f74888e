"""Origin of measured data according to the header of their file: date of the measurement, and whether they were simulated."""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import date
from typing import Any

from motoremi.data.text import clean_text

_DATE_KEYS = ("measured", "measurement date", "date measured", "date", "date/time", "datetime", "timestamp")
_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_MONTH = rf"(?P<name>{'|'.join(_MONTHS)})[a-z]*"
_CLOCK = r"(?:[T\s,;]+(?P<clock>\d\d:\d\d(?::\d\d)?)\S*)?"
# Dates such as 02/03/2024 are not read, because day and month cannot be distinguished.
_SPELLINGS = (
    re.compile(rf"(?P<year>\d{{4}})[-/.](?P<month>\d\d?)[-/.](?P<day>\d\d?){_CLOCK}$"),
    re.compile(rf"(?:[a-z]{{3,9}},?\s+)?{_MONTH}\.?\s+(?P<day>\d\d?),?\s+(?:(?P<clock>\d\d:\d\d(?::\d\d)?)\s+)?(?P<year>\d{{4}})$", re.IGNORECASE),
    re.compile(rf"(?:[a-z]{{3,9}},?\s+)?(?P<day>\d\d?)[.\s-]+{_MONTH}[.\s-]+(?P<year>\d{{4}}){_CLOCK}$", re.IGNORECASE),
    re.compile(rf"(?P<day>\d\d?)\.(?P<month>\d\d?)\.(?P<year>\d{{4}}){_CLOCK}$"),
)
LONGEST = 60


def is_simulated(metadata: Mapping[str, Any]) -> bool:
    """Whether a header, or a session's start document, contains `simulated: true`, in upper or lower case."""
    return any(key.lower() == "simulated" and str(value).strip().lower() in ("true", "yes", "1") for key, value in metadata.items())


def measured_on(metadata: Mapping[str, Any]) -> str:
    """Date of the measurement from the header: `2018-01-25`, with the time of day if it is stated.

    Spellings: ISO 8601, `Jan 25 2018` (4294A), `Tue Feb 03 10:00:00 2024` (E4990A), `03.Feb 2024` (R&S receivers), `03.02.2024`.

    Returns
    -------
    str
        A date in another spelling is returned as written, with a remark; empty if the header has no date.
    """
    header = {str(key).strip().lower(): value for key, value in metadata.items()}
    written = next((str(header[key]).strip(" ;") for key in _DATE_KEYS if str(header.get(key, "")).strip(" ;")), "")
    if not written:
        return ""
    for spelling in _SPELLINGS:
        if (found := spelling.match(written)) and (day := _day(found)):
            clock = found["clock"] or _clock(header.get("time"))
            return f"{day} {clock}" if clock else day
    return f"{clean_text(written, LONGEST)} (as the file writes it)"


def _day(found: re.Match[str]) -> str:
    parts = found.groupdict()
    month = _MONTHS.index(parts["name"][:3].lower()) + 1 if parts.get("name") else int(parts["month"])
    try:
        return date(int(parts["year"]), month, int(parts["day"])).isoformat()
    except ValueError:
        return ""


def _clock(written: object) -> str:
    found = re.fullmatch(r"(\d\d:\d\d(?::\d\d)?)(?:\.\d+)?", str(written).strip(" ;"))
    return found[1] if found else ""
