"""Names of detectors as people and receivers write them, alone and in the titles of columns."""

from __future__ import annotations

import re

from motoremi.data.text import clean_text

# 0 dBm in 50 ohm in dBuV: 10 lg(50 Ohm * 1 mW / (1 uV)^2).
DBUV_OF_0_DBM = 106.98970004336019
# Detectors by their standard names (`DETECTORS`), with their other spellings in lower case.
SPELLINGS = {
    "peak": ("peak", "max-peak", "maxpeak", "pk", "pk+", "pos", "positive", "pos-peak", "positive-peak"),
    "quasi-peak": ("quasi-peak", "quasipeak", "qp", "qpk"),
    "average": ("average", "av", "avg"),
    "cispr-average": ("cispr-average", "cispr-av", "cispr-avg", "c-average", "caverage", "cavg", "cav", "emi-average", "eav"),
    "rms-average": ("rms-average", "rms-avg", "rms-av", "cispr-rms", "crms", "cispr-rms-average"),
}
_BY_SPELLING = {spelling: detector for detector, spellings in SPELLINGS.items() for spelling in spellings}
# What stands beside the detector in a title: the word level, and modes of a trace that leave no reading above the stored one.
_BESIDE = re.compile(r"^(?:level|pegel)-|-(?:level|pegel|max-?h(?:old)?|cl(?:ea)?r-?w(?:r(?:ite)?)?)$")


def detector_name(written: str) -> str:
    """The standard name of a detector (`DETECTORS`), or the text as written if it is none of them."""
    spelling = clean_text(re.sub(r"[\s_-]+", "-", written.strip().lower()), 40)
    return _BY_SPELLING.get(spelling, spelling)


def detector_in_title(title: str) -> str | None:
    """The standard name of the detector in a title of levels without its unit, such as `PK+_MAXH` or `Pegel QP`; None if there is none."""
    name = re.sub(r"[\s_-]+", "-", title.lower())
    while (bare := _BESIDE.sub("", name)) != name:
        name = bare
    return _BY_SPELLING.get(name)
