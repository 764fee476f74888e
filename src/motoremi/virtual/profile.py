"""Profiles of simulated instruments: YAML files in PyVISA-sim's format, in `motoremi.sim_profiles`."""

from __future__ import annotations

import functools
from importlib import resources
from typing import Any

from pyvisa_sim import parser


@functools.cache
def read_profile(file: str) -> dict[str, Any]:
    """The device that a profile describes; the result is shared, so do not change it.

    A profile with the key `like` holds only what differs from the profile that it names. The result is cached, because reading YAML takes
    longer than a simulated sweep.
    """
    with resources.as_file(resources.files("motoremi.sim_profiles") / file) as path:
        content = parser.parse_file(path)
    (device,) = content["devices"].values()
    return _merged(read_profile(content["like"]), device) if "like" in content else device


def _merged(base: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Tables are merged key by key; anything else replaces the value in the base."""
    merged = {key: _merged(base[key], value) if isinstance(value, dict) and key in base else value for key, value in own.items()}
    return {**base, **merged}
