"""The effects of a model as text."""

from motoremi.model.effects.names import as_sum


def test_an_effect_that_occurs_several_times_stands_once_with_the_number() -> None:
    assert as_sum(()) == ""
    assert as_sum(("the circuit", "lead-inductance", "winding-modes", "winding-modes")) == "the circuit + lead-inductance + 2 winding-modes"
