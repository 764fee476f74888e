"""Fits as tables, and fits that were stored with effects of which a later run knows nothing."""

from __future__ import annotations

import numpy as np
import pytest

import motoremi as me
from motoremi.errors import BadInput
from motoremi.fitting.result import Fit, restore

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 101)


@pytest.fixture(scope="module")
def held() -> Fit:
    """A winding whose resistance is held, with an inductance that may not be what it is."""
    s = 2j * np.pi * FREQUENCY_HZ
    noise = 1e-3 * np.random.default_rng(1).standard_normal((101, 2)) @ [1, 1j]
    sweep = me.ImpedanceSweep("short", FREQUENCY_HZ, 1 / (1 / (0.8 + s * 25e-6) + s * 60e-12) * (1 + noise))
    return me.fit(me.dc_motor(), [sweep], held={"Ra": 0.8}, bounds={"La": (30e-6, 60e-6)})


def test_a_table_says_what_is_held_and_what_is_at_its_bound(held: Fit) -> None:
    table = held.to_frame()
    assert table["held"].to_dict() == {"Ra": True, "La": False, "Ca": False}
    assert table["at_bound"].to_dict() == {"Ra": False, "La": True, "Ca": False}
    assert table["sigma"].isna().to_dict() == {"Ra": True, "La": True, "Ca": False}


def test_a_stored_fit_with_an_effect_of_the_users_own_asks_for_its_file(held: Fit) -> None:
    stored = {**held.to_dict(), "effects": ["ferrite-bead"]}
    with pytest.raises(BadInput, match=r"has the effect 'ferrite-bead', which is not in the catalogue: give its file, --effects-from FILE\.py"):
        restore(stored, held.measurement)
