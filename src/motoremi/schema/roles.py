"""The roles that instruments play in a procedure."""

from __future__ import annotations

from typing import Literal

Role = Literal["analyser", "receiver", "supply", "voltmeter", "ammeter", "tachometer", "thermometer"]
