"""Motors as SPICE decks, and what ngspice makes of them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np

from motoremi.model.effects import find_effect
from motoremi.model.effects.start import with_start
from motoremi.model.motor import Motor, dc_motor

BASE = {"Ra": 12.0, "La": 12e-6, "Ca": 25e-12, "Rr": 40.0, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}
SPAN = (150e3, 30e6)
# What the issue asks of the netlist over the fitted span.
DB, DEG = 0.05, 0.5


def motor_with(*identifiers: str) -> tuple[Motor, dict[str, float]]:
    """A motor with effects of a size in the middle of their start values."""
    motor, values = dc_motor(), dict(BASE)
    for identifier in identifiers:
        added = find_effect(identifier)
        label = added.label_in(motor)
        values = with_start(values, added.effect.starts[len(added.effect.starts) // 2], label)
        motor = added.added_to(motor)
    return motor, values


def run(deck: list[str], folder: Path) -> np.ndarray:
    """What ngspice wrote to out.data."""
    (folder / "deck.cir").write_text("\n".join(deck) + "\n")
    done = subprocess.run(["ngspice", "-b", "deck.cir"], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    assert (folder / "out.data").exists(), done.stdout + done.stderr
    return np.loadtxt(folder / "out.data")


def control(*lines: str) -> list[str]:
    """The end of a deck, which says what is computed and written."""
    return [".control", "set numdgt=14", "set wr_singlescale", *lines, "quit", ".endc", ".end"]
