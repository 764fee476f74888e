"""Repeats that differ by a resistance which comes and goes: told on import, and the verdict is `data`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import motoremi
from conftest import simulated_sweeps
from few_effects import seeking

import motoremi as me
from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.loose_contact import loose_contact
from motoremi.data.sweep import RepeatedSweep

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)
S = 2j * np.pi * FREQUENCY_HZ


def winding(inductance_h: float = 80e-6, ohm: float = 5.0) -> np.ndarray:
    """With a resonance above a path to the frame."""
    branch = ohm + S * inductance_h
    return 20 + branch / (1 + S * 20e-12 * branch) + 1 / (S * 400e-12)


def repeated(*impedance_ohm: np.ndarray, noise: float = 1e-4) -> RepeatedSweep:
    rng = np.random.default_rng(4)
    relative = rng.standard_normal((2, len(impedance_ohm), 201))
    return RepeatedSweep("short", FREQUENCY_HZ, np.array(impedance_ohm) * (1 + noise * (relative[0] + 1j * relative[1])), None)


def with_contact(impedance_ohm: np.ndarray, *stretches: tuple[int, int, float]) -> np.ndarray:
    worse = impedance_ohm.copy()
    for first, last, share in stretches:
        worse[first:last] += share * np.abs(impedance_ohm[first])
    return worse


BAD = (20, 31, 1.5), (90, 96, 0.4), (150, 158, 3.0)


@pytest.mark.parametrize("repeats", [2, 3])
@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_a_resistance_that_comes_and_goes_is_told(repeats: int, noise: float) -> None:
    told = loose_contact(repeated(with_contact(winding(), *BAD), *[winding()] * (repeats - 1), noise=noise))
    assert told is not None
    assert told.startswith("repeats of the short sweep differ at 25 of 201 points by a resistance of ")


def test_a_contact_that_fails_for_the_rest_of_a_sweep_is_told() -> None:
    assert "differ at 61 of 201 points" in str(loose_contact(repeated(winding(), with_contact(winding(), (140, 201, 2.0)))))


@pytest.mark.parametrize(
    "other",
    [
        winding,
        lambda: winding(1.02 * 80e-6),
        lambda: winding(1.3 * 80e-6),
        lambda: winding(ohm=40.0),
        lambda: winding() + 100,
        lambda: with_contact(winding(), (20, 25, 1.5)),
        lambda: 1.5 * winding(),
        lambda: np.where(np.arange(201) % 25 == 3, 2.0, 1.0) * winding(),
    ],
    ids=["alike", "resonance moved", "other winding", "other loss", "other leads", "few points", "other gain", "stations"],
)
def test_other_differences_are_none(other: Callable[[], np.ndarray]) -> None:
    assert loose_contact(repeated(winding(), other())) is None


def test_noise_is_none() -> None:
    assert loose_contact(repeated(*[winding()] * 3, noise=0.3)) is None


def test_a_single_sweep_shows_none() -> None:
    assert loose_contact(repeated(with_contact(winding(), *BAD))) is None


@pytest.mark.slow
@pytest.mark.case
def test_the_verdict_is_data(tmp_path: Path) -> None:
    files: dict[str, list[Path]] = {"short": [], "open": []}
    sweeps = []
    for sweep in simulated_sweeps(3)[0]:
        number = len(files[sweep.termination])
        bad = with_contact(sweep.impedance_ohm, *((first + 7 * number, last + 7 * number, share) for first, last, share in BAD))
        sweeps.append(me.ImpedanceSweep(sweep.termination, sweep.frequency_hz, bad))
        files[sweep.termination].append(tmp_path / f"{sweep.termination}{number}.csv")
        write_impedance_csv(files[sweep.termination][-1], sweeps[-1])
    imported = motoremi("import", tmp_path / "s", "--short", *files["short"], "--open", *files["open"]).stdout
    assert "that comes and goes, as of a loose contact; fasten clips and connectors, and measure again" in imported
    with seeking():
        found = me.diagnose(me.fit(me.dc_motor(), sweeps))
    assert found.verdict == "data"
    (finding,) = (one for one in found.findings if one.id == "sweeps-disagree")
    assert finding.serious
    assert "loose contact" in finding.why
