"""Quantities as engineers write them."""

from __future__ import annotations

import pytest

from motoremi.errors import BadInput
from motoremi.quantities import parse, parse_band


@pytest.mark.parametrize("text", ["2,3 Ohm", "2,3", "1,000 Ohm", "1.000,5 Ohm"])
def test_a_comma_is_refused(text: str) -> None:
    """Left out, as QuantiPhy does it, a decimal comma makes a value ten times as large or more."""
    with pytest.raises(BadInput, match="has a comma: write decimals with a point"):
        parse(text, "Ohm")


def test_so_it_is_in_a_band() -> None:
    with pytest.raises(BadInput, match="has a comma"):
        parse_band("0,15MHz:3,5MHz")


@pytest.mark.parametrize("text", ["2:3Ohm", "2=3Ohm", "Ra: 3 Ohm"])
def test_what_stands_before_a_colon_is_not_left_out(text: str) -> None:
    with pytest.raises(BadInput, match="is not one quantity in Ohm"):
        parse(text, "Ohm")


def test_a_band_has_two_ends() -> None:
    with pytest.raises(BadInput, match="is not one quantity in Hz"):
        parse_band("150kHz:1MHz:30MHz")
