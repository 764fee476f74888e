"""A motor of which a sweep is missing is not within limits of what that sweep shows."""

from __future__ import annotations

from motoremi.fleet.motors import each_motor


def test_a_motor_without_its_open_sweep_is_not_judged() -> None:
    limits = {name: {"low": 0.9, "high": 1.1} for name in ("La", "Cf")}
    figures = {
        "beyond_limits": [],
        "parameters": {},
        "findings": {},
        "unlike": {},
        "troubles": [],
        "undetermined": {},
        "limits": limits,
        "values": {"La": {"whole": 1.0, "half": 1.0}, "Cf": {"whole": 1.0}},
    }
    told = {one["session"]: (one["result"], one["reasons"]) for one in each_motor(figures, ["whole", "half"], (), {})}
    assert told == {"whole": ("within limits", []), "half": ("not judged", ["its sweeps do not show Cf: not compared"])}
