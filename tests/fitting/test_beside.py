"""Where the search for two effects begins."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from covariances import complex_normal
from paper_circuit import DAMPED, impedance

import motoremi as me
from motoremi.fitting.beside import GLANCED, GLANCED_RESONATING, Pairs
from motoremi.fitting.race import Standing
from motoremi.fitting.result import Fit
from motoremi.fitting.trail import trail_to
from motoremi.model.effects import add_effects, find_effect

NAMES = ("skin-effect", "proximity-effect", "range-step", "second-resonance", "dielectric-loss@Cf")


@pytest.fixture(scope="module")
def base() -> Fit:
    rng = np.random.default_rng(4)
    frequency = np.geomspace(150e3, 30e6, 61)
    sweeps = [
        me.ImpedanceSweep(name, frequency, impedance(DAMPED, name, frequency) * (1 + 3e-4 * complex_normal(rng, 61)), 3e-4)
        for name in ("short", "open")
    ]
    return me.fit(me.dc_motor(), sweeps, analyser="4294a")


@pytest.fixture(scope="module")
def pairs(base) -> Pairs:
    alone = {name: trail_to(base, name) for name in NAMES}
    reached = {name: Standing(trail.starts, np.zeros(len(trail.starts))) for name, trail in alone.items()}
    return Pairs(base, alone, reached, {})


def test_each_pair_takes_part_once_and_none_that_excludes_itself(pairs):
    found = pairs.at_a_glance()
    possible = {tuple(sorted(pair)) for pair in product(NAMES, NAMES) if find_effect(pair[1]).fits(add_effects(me.dc_motor(), [pair[0]]))}
    assert ("skin-effect", "skin-effect") not in possible
    assert ("second-resonance", "second-resonance") in possible
    assert sorted(tuple(sorted(pair)) for pair in found) == sorted(possible)
    for pair, trail in found.items():
        assert sorted(trail.task.motor.effects) == sorted(pair)
        # From either effect.
        assert len(trail.starts) <= 2 * (GLANCED_RESONATING if "second-resonance" in pair else GLANCED)


def test_a_step_that_is_looked_for_in_what_is_left_comes_last(pairs):
    assert all(pair[-1] == "range-step" for pair in pairs.at_a_glance() if "range-step" in pair)


def test_a_second_look_begins_where_the_first_ended_and_from_all_starts(pairs):
    pair = ("skin-effect", "dielectric-loss@Cf")
    glance = pairs.at_a_glance()[pair]
    at = {**glance.starts[0], "Ra": 1.2345}
    trail = pairs.in_full({pair: Standing([at], np.zeros(1))})[pair]
    assert trail.starts[0] == at
    assert len(trail.starts) > len(glance.starts)
    assert all(any(one == start for one in trail.starts) for start in glance.starts)
