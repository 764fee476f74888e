"""Names of detectors as people and receivers write them."""

from __future__ import annotations

import re

from motoremi.data.text import clean_text

# 0 dBm in 50 ohm in dBuV: 10 lg(50 Ohm * 1 mW / (1 uV)^2).
DBUV_OF_0_DBM = 106.98970004336019
_SPELLINGS = {
    "max-peak": "peak", "maxpeak": "peak", "pk": "peak", "pk+": "peak", "pos": "peak", "positive": "peak",
    "quasipeak": "quasi-peak", "qp": "quasi-peak", "qpk": "quasi-peak",
    "av": "average", "avg": "average",
    "cispr-av": "cispr-average", "caverage": "cispr-average", "cav": "cispr-average", "emi-average": "cispr-average", "eav": "cispr-average",
    "cispr-rms": "rms-average", "crms": "rms-average", "rms-avg": "rms-average", "cispr-rms-average": "rms-average",
    "rms-av": "rms-average",
}  # fmt: skip


def detector_name(written: str) -> str:
    """The standard name of a detector (`DETECTORS`), or the text as written if it is none of them."""
    spelling = clean_text(re.sub(r"[\s_-]+", "-", written.strip().lower()), 40)
    return _SPELLINGS.get(spelling, spelling)
