"""Error bars of a model with effects whose laws are not exactly the motor's."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.fitting.inexact import CHANGES, pulls_of_laws

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 101)
RANGES = {
    "Ra": (5.0, 100.0), "La": (4e-6, 40e-6), "Ca": (8e-12, 60e-12), "Rr": (10.0, 120.0),
    "Lr": (0.5e-6, 5e-6), "Cr": (150e-12, 1000e-12), "Cf": (80e-12, 600e-12),
}  # fmt: skip


def relaxing_twice(seed: int) -> tuple[dict[str, float], list[me.ImpedanceSweep]]:
    """A slot liner of two layers, each with a relaxation of its own: nearly one, so that the law of one describes it."""
    rng = np.random.default_rng((7, seed))
    truth = {name: float(np.exp(rng.uniform(np.log(low), np.log(high)))) for name, (low, high) in RANGES.items()}
    s = 2j * np.pi * FREQUENCY_HZ
    corner = 2 * np.pi * float(np.exp(rng.uniform(np.log(3e5), np.log(3e6))))
    liner = 1 + 0.06 / (1 + s / corner) + 0.04 / (1 + s / (2 * corner))
    winding = 1 / (s * truth["Ca"] + 1 / (truth["Ra"] + s * truth["La"]))
    frame = 1 / (s * truth["Cf"] * liner + 1 / (truth["Rr"] + s * truth["Lr"] + 1 / (s * truth["Cr"])))
    sweeps = []
    for name, true in (("short", winding), ("open", winding + frame)):
        for _ in range(3):
            noise = 2e-4 * (rng.normal(size=s.size) + 1j * rng.normal(size=s.size))
            sweeps.append(me.ImpedanceSweep(name, FREQUENCY_HZ, true * (1 + noise), metadata={"analyser": "none"}))
    return truth, sweeps


@pytest.mark.slow
def test_elements_beside_a_law_that_is_nearly_the_motors_are_within_their_error_bars():
    held: dict[str, list[bool]] = {"exact": [], "shown": []}
    for seed in range(8):
        truth, sweeps = relaxing_twice(seed)
        fit = me.fit(me.dc_motor(), sweeps, seed=seed).add("dielectric-relaxation@Cf")
        for name in ("Rr", "Lr", "Cr"):
            away = abs(fit.parameters[name] - truth[name])
            held["exact"].append(away < 1.96 * fit.exact_sigma[name])
            held["shown"].append(away < 1.96 * fit.sigma[name])
    assert np.mean(held["exact"]) < 0.8 < np.mean(held["shown"])


@pytest.fixture(scope="module")
def relaxing() -> me.Fit:
    _, sweeps = relaxing_twice(0)
    return me.fit(me.dc_motor(), sweeps).add("dielectric-relaxation@Cf")


def test_a_circuit_without_effects_has_no_law_that_could_be_inexact():
    base = me.fit(me.dc_motor(), relaxing_twice(0)[1])
    assert not len(pulls_of_laws(base.weighed, base.unknowns, base.linearised, 0.1))
    assert dict(base.local_sigma) == pytest.approx(dict(base.exact_sigma))


def test_nor_has_an_effect_that_only_describes():
    base = me.fit(me.dc_motor(), relaxing_twice(0)[1]).add("winding-modes")
    assert not len(pulls_of_laws(base.weighed, base.unknowns, base.linearised, 0.1))


def test_the_change_is_as_large_as_what_stays_undescribed(relaxing):
    def pulls(left):
        return pulls_of_laws(relaxing.weighed, relaxing.unknowns, relaxing.linearised, left)

    assert pulls(0.0) == pytest.approx(pulls(1e-9))
    assert pulls(0.02) == pytest.approx(10 * pulls(0.002))
    assert np.linalg.norm(pulls(0.002)) > np.linalg.norm(pulls(0.0))
    # Of a relative change of one parameter, by finite differences, times the first of the changes along frequency.
    of_one = pulls(0.0) / CHANGES
    steps = 1e-4
    problem, u = relaxing.weighed, relaxing.unknowns
    own = [index for index, parameter in enumerate(problem.unknowns) if parameter.name.startswith("dielectric-relaxation")]
    assert len(of_one) == len(own) * round(2 * np.log10(30e6 / 150e3))
    for place, index in enumerate(own):
        moved = u.copy()
        moved[index] += steps
        changed = (problem.residual(moved) - problem.residual(u)) / steps * problem.observed.weight
        along = np.log10(problem.observed.frequency_hz / 150e3) / np.log10(200)
        first = np.sqrt(2 / 5) * np.cos(np.pi * along)
        assert of_one[5 * place] == pytest.approx(problem.pull(relaxing.linearised, changed * first), rel=1e-2, abs=1e-3 * np.abs(of_one).max())
