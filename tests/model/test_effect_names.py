"""The effects of a model as text."""

from motoremi.model.effects.names import as_sum, what_is_more


def test_an_effect_that_occurs_several_times_stands_once_with_the_number() -> None:
    assert as_sum(()) == ""
    assert as_sum(("the circuit", "lead-inductance", "winding-modes", "winding-modes")) == "the circuit + lead-inductance + 2 winding-modes"


def test_what_a_larger_set_has_besides():
    assert what_is_more(("bearing-film", *3 * ("winding-modes",)), ("winding-modes",)) == "bearing-film and 2 more winding-modes"
    assert what_is_more(("bearing-film", "core-loss"), ("core-loss",)) == "bearing-film"
