"""Engineering quantities as engineers write them: `"150 kHz"`, `12.1 uH`, `22 pF`."""

from __future__ import annotations

import math
import re

from quantiphy import QuantiPhyError, Quantity

from motoremi.errors import BadInput


def parse(text: str | float | int, unit: str) -> float:
    """Read a quantity and return it in SI units.

    Parameters
    ----------
    text : str or number
        For example `"150 kHz"`, `"4.5kHz"`, `"10 dB"`; a bare number is taken to be in `unit` already.
    unit : str
        The unit it must have, for example `"Hz"`.

    Raises
    ------
    BadInput
        If it is not a finite number or carries another unit.
    """
    if isinstance(text, bool):
        raise BadInput(f"expected a quantity in {unit}, got {text}")
    if "," in str(text):
        # QuantiPhy would leave it out.
        raise BadInput(f"{str(text)!r} has a comma: write decimals with a point and thousands without a separator, for example '2.3 Ohm'")
    if ":" in str(text) or "=" in str(text):
        # QuantiPhy would take what is left of them for a name.
        raise BadInput(f"{str(text)!r} is not one quantity in {unit}: write one number with its unit")
    try:
        # QuantiPhy reads "M" as mega and "m" as milli, as SI does; "Ohm" is the field's spelling of Ω.
        quantity = Quantity(str(text).replace("Ω", "Ohm").replace("ohm", "Ohm"))
    except QuantiPhyError as error:
        example = "150 kHz" if unit == "Hz" else f"2.5 {unit}"
        raise BadInput(f"cannot read {str(text)!r} as a quantity in {unit} (write for example '{example}')") from error
    value = float(quantity)
    # Before the unit: QuantiPhy takes the prefix of "nan kHz" for a part of it.
    if not math.isfinite(value):
        raise BadInput(f"{str(text)!r} is not a finite number")
    wanted = unit.replace("Ω", "Ohm").replace("ohm", "Ohm")
    if quantity.units and quantity.units != wanted:
        raise BadInput(f"{str(text)!r} has the unit {quantity.units!r}, expected {unit}")
    return value


def parse_band(text: str) -> tuple[float, float]:
    """Read a frequency span such as `150kHz:30MHz` and return both ends in hertz.

    Raises
    ------
    BadInput
        If an end is missing or no frequency, or the first is not below the second.
    """
    first, colon, second = text.partition(":")
    if not (colon and first.strip() and second.strip()):
        raise BadInput(f"cannot read {text!r} as a band: write for example '150kHz:30MHz'")
    low, high = parse(first, "Hz"), parse(second, "Hz")
    if not 0 <= low < high:
        raise BadInput(f"the band {text!r} is empty: the first frequency must be below the second")
    return low, high


def show(value: float, unit: str, digits: int = 4) -> str:
    """Write a value with an SI prefix: `show(1.21e-5, "H")` gives `12.1 uH`."""
    if not math.isfinite(value):
        return f"{value} {unit}".strip()
    if unit == "%":
        return percent(value, digits)
    if unit in ("", "1", "dB", "deg", "dBuV", "d"):
        return f"{value:.{digits}g} {unit if unit != '1' else ''}".strip()
    return str(Quantity(float(value), unit).render(prec=digits - 1, form="si", strip_zeros=True)).replace("µ", "u")


def percent(value: float, digits: int = 3) -> str:
    """A percentage with that many significant digits; large ones have no exponent."""
    return f"{float(f'{value:.{digits}g}'):.15g} %"


def percent_span(low: float, high: float, digits: int = 3) -> str:
    """Both ends of an interval in percent, the unit once."""
    return f"{percent(low, digits).removesuffix(' %')} - {percent(high, digits)}"


def show_band(low_hz: float, high_hz: float) -> str:
    """Write a frequency span: `150 kHz - 30 MHz`."""
    return f"{show(low_hz, 'Hz')} - {show(high_hz, 'Hz')}"


def error_bar(value: float, sigma: float) -> str:
    """A standard deviation relative to its value, as text."""
    return f"± {100 * sigma / abs(value):.2g} % (1 sigma)"


_MINUTES = {"s": 1 / 60, "sec": 1 / 60, "min": 1.0, "h": 60.0}


def parse_minutes(text: str) -> float:
    """A time such as `30min`, `2h` or `90 s`, in minutes.

    Raises
    ------
    BadInput
        If it cannot be read.
    """
    found = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([a-z]+)\s*", text.lower())
    if found is None or found[2] not in _MINUTES:
        raise BadInput(f"cannot read {text!r} as a time: write for example 30min or 2h")
    return float(found[1]) * _MINUTES[found[2]]
