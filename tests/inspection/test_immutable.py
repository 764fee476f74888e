"""Results are immutable, their mappings too; they can be sent to another process and written as JSON."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest

import motoremi as me
from motoremi.arrays import FrozenDict
from motoremi.emission.spectrum_fit import EmissionFit


@pytest.mark.parametrize(
    "change",
    [
        lambda held: held.__setitem__("La", 3.0),
        lambda held: held.__delitem__("La"),
        lambda held: held.update(La=3.0),
        lambda held: held.pop("La"),
        lambda held: held.popitem(),
        lambda held: held.clear(),
        lambda held: held.setdefault("Ra", 1.0),
        lambda held: held.__ior__({"La": 3.0}),
    ],
)
def test_a_mapping_of_a_result_cannot_be_changed(change):
    fitted = EmissionFit(None, (), {"La": 1.0}, 1.0, 1.0, 0.0, ())
    with pytest.raises(TypeError, match="immutable"):
        change(fitted.parameters)
    assert fitted.parameters == {"La": 1.0}


def test_it_does_not_follow_the_dictionary_that_it_was_made_of():
    given = {"La": 1.0}
    fitted = EmissionFit(None, (), given, 1.0, 1.0, 0.0, ())
    given["La"] = 3.0
    assert fitted.parameters["La"] == 1.0


@pytest.mark.parametrize("again", [lambda one: pickle.loads(pickle.dumps(one)), copy.copy, copy.deepcopy])
def test_it_is_copied_and_sent_as_it_is(again):
    one = again(FrozenDict({"La": 1.0, "Ra": [1, 2]}))
    assert one == {"La": 1.0, "Ra": [1, 2]}
    with pytest.raises(TypeError):
        one["La"] = 3.0
    assert json.loads(json.dumps(one)) == {"La": 1.0, "Ra": [1, 2]}
    # A copy that may be changed.
    assert type(dict(one)) is dict
    assert {**one, "Cf": 2} == {"La": 1.0, "Ra": [1, 2], "Cf": 2}


def test_a_comparison_cannot_be_changed():
    frequency = np.geomspace(150e3, 30e6, 41)
    s = 2j * np.pi * frequency
    sweep = me.ImpedanceSweep("short", frequency, 1 / (1 / (2.3 + s * 24e-6) + s * 95e-12), metadata={"analyser": "none"})
    comparison = me.compare(me.fit(me.dc_motor(), [sweep]))
    with pytest.raises(TypeError):
        comparison.curves["short"] = None
    with pytest.raises(TypeError):
        comparison.bands[0]["sweep"] = "open"
    assert pickle.loads(pickle.dumps(comparison)).to_dict() == comparison.to_dict()
