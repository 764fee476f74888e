"""The catalogue of effects of source and path for spectra, as changes of the set-up."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.emission.path import Cable
from motoremi.emission.reading import separate
from motoremi.emission.setup import Setup
from motoremi.emission.source import Arc, Chopper
from motoremi.errors import BadInput
from motoremi.model.parameter import Parameter

Values: TypeAlias = Mapping[str, float]


@dataclass(frozen=True)
class SourceEffect:
    """One entry of the catalogue of sources and paths.

    Parameters
    ----------
    name, title : str
    group : {"source", "path", "outside"}
    formula, limit, signature, deciding, source : str
        Descriptions, as in the catalogue of the motor's effects.
    look_alikes : tuple of str
    parameters : tuple of Parameter
        Short names with ranges.
    starts : tuple of mapping
        Start values of a fit.
    change : callable
        `change(setup, values)` returns the set-up with the effect.
    following : tuple of (id, why)
        The next measurement, which decides.
    """

    name: str
    group: str
    title: str
    formula: str
    parameters: tuple[Parameter, ...]
    limit: str
    signature: str
    look_alikes: tuple[str, ...]
    deciding: str
    source: str
    starts: tuple[Values, ...]
    change: Callable[[Setup, Values], Setup]
    following: tuple[str, str]

    @property
    def identifiers(self) -> tuple[str, ...]:
        """Its only name."""
        return (self.name,)

    def to_dict(self) -> JsonDict:
        """Plain data of the description."""
        plain = {key: getattr(self, key) for key in ("name", "group", "title", "formula", "limit", "signature", "deciding", "source")}
        plain["identifiers"] = [self.name]
        plain["repeatable"] = False
        plain["look_alikes"] = list(self.look_alikes)
        plain["parameters"] = [{"name": p.name, "unit": p.unit, "low": p.low, "high": p.high, "reason": p.reason} for p in self.parameters]
        return plain


def _arc(setup: Setup, values: Values) -> Setup:
    return replace(setup, source=replace(setup.source, arc=Arc(values["voltage_v"], values["rise_s"], values["spread"])))


def _jitter(setup: Setup, values: Values) -> Setup:
    # If events do not overlap behind the filter, their exact times have no influence, and the tables for jitter are not needed.
    touching = not separate(setup.source.repetition_hz, setup.receiver.band)
    jitter_s = values["jitter_s"] if touching else 0.0
    return replace(setup, source=replace(setup.source, missing_share=values["missing_share"], jitter_s=jitter_s))


def _chopper(setup: Setup, values: Values) -> Setup:
    frequency = values["frequency_hz"]
    duty = min(values["width_s"] * frequency, 0.99)
    rise = min(values["rise_s"], 0.5 * min(duty, 1 - duty) / frequency)
    return replace(setup, source=replace(setup.source, chopper=Chopper(values["amplitude_v"], frequency, duty, rise)))


def _broadband(setup: Setup, values: Values) -> Setup:
    return replace(setup, broadband_dbuv=values["level_dbuv"], broadband_slope_db=values["slope_db"])


def _lisn(setup: Setup, values: Values) -> Setup:
    return replace(setup, path=replace(setup.path, lisn=setup.path.lisn.deviating(values["inductance_factor"])))


def _cable(setup: Setup, values: Values) -> Setup:
    return replace(setup, path=replace(setup.path, cable=Cable(values["length_m"], values["impedance_ohm"])))


EFFECTS: tuple[SourceEffect, ...] = (
    SourceEffect(
        "arc-breakdown", "source", "arc when a segment leaves the brush",
        "|V| = U/(2 pi f)/sqrt(1 + (2 pi f rise_s/2.2)^2) beside the commutation's own step; highest of n events: U (1 + spread sqrt(2 ln n))",
        (
            Parameter("voltage_v", "V", 8.0, 30.0, "least voltage of an arc between carbon and copper: 12 to 20 V, with a margin"),
            Parameter("rise_s", "s", 5e-9, 4e-7, "10 to 200 ns, with a margin"),
            Parameter("spread", "", 0.0, 0.4, "from one arc to the next", scale="linear"),
        ),
        "voltage_v -> 0",
        "15 to 30 dB above the commutation's own step at 5 to 30 MHz; falls by 20 dB a decade up to 0.35/rise_s; peak - average stays "
        "20 log(9.6 kHz / repetition)",
        ("commutation-jitter", "background-noise"),
        "another current: below the arc's threshold the step vanishes at once, a smooth commutation's fades in proportion",
        "step that settles exponentially; minimum arc voltage and rise time: textbook values",
        tuple({"voltage_v": 15.0, "rise_s": rise, "spread": 0.12} for rise in (1.2e-8, 4e-8, 1.5e-7)),
        _arc,
        (
            "other-current",
            "scan again at half and at twice the current: an arc starts at a threshold; the step of a smooth commutation is proportional to the "
            "current",
        ),
    ),
    SourceEffect(
        "commutation-jitter", "source", "irregular commutation: missing and scattered events (brush bounce)",
        "average: |V| sqrt(2) repetition (1 - missing_share); lines above 1/(2 pi jitter_s) become noise where events overlap",
        (
            Parameter("missing_share", "", 0.02, 0.93, "share of commutations without a voltage step", scale="linear"),
            Parameter("jitter_s", "s", 1e-9, 1e-4, "standard deviation of commutation times; invisible unless events overlap behind the filter"),
        ),
        "missing_share -> 0 and jitter_s -> 0",
        "average lower than expected from speed and segments while peak stays: peak - average exceeds 20 log(9.6 kHz / repetition)",
        ("chopper",),
        "another speed: with regular commutation peak - average follows 20 log of the speed",
        "train of events with random times (textbook); the ranges are estimates",
        tuple({"missing_share": share, "jitter_s": 1e-6} for share in (0.3, 0.7)),
        _jitter,
        ("other-speed", "scan peak and average again at another speed: peak - average must follow the speed if no commutation is missing"),
    ),
    SourceEffect(
        "chopper", "source", "PWM chopper: a comb that does not depend on the speed",
        "line k: 2 A d |sinc(pi k d)| |sinc(pi k frequency_hz rise_s)|, d = width_s frequency_hz",
        (
            Parameter("amplitude_v", "V", 0.02, 80.0, "part of the supply that drives common-mode current"),
            Parameter("frequency_hz", "Hz", 2e3, 60e3, "usual choppers of DC motors"),
            Parameter("width_s", "s", 5e-7, 4.8e-4, "of the pulses: duty cycle over frequency_hz; duty and 1 - duty look alike"),
            Parameter("rise_s", "s", 5e-9, 1e-6, "power switches"),
        ),
        "amplitude_v -> 0",
        "comb with equal peak, quasi-peak and average once its frequency exceeds 9 kHz; corners at 1/(pi d T) and 1/(pi rise_s)",
        ("arc-breakdown", "background-noise"),
        "another speed: the comb stays where it is",
        "spectrum of a trapezoidal pulse train (textbook); the ranges are estimates",
        (),
        _chopper,
        ("other-speed", "scan again at another speed: a chopper's comb stays where it is, commutation moves"),
    ),
    SourceEffect(
        "background-noise", "outside", "noise and stations that are present with the motor off",
        "level_dbuv - slope_db log10(f / 1 MHz) on the average detector, added in power; measured, if there is a scan with the motor off",
        (
            Parameter("level_dbuv", "dBuV", -15.0, 70.0, "ambient at 1 MHz, average in 9 kHz", scale="linear"),
            Parameter("slope_db", "dB", -10.0, 40.0, "fall per decade", scale="linear"),
        ),
        "level_dbuv -> -infinity",
        "peak - average is that of noise (about 9 dB in 50 ms), whatever the speed; stations stand out on all detectors alike",
        ("arc-breakdown", "chopper"),
        "the motor off: it stays",
        "the ranges are estimates without a source",
        tuple({"level_dbuv": level, "slope_db": slope} for level in (10.0, 30.0) for slope in (0.0, 15.0)),
        _broadband,
        ("motor-off", "scan with the motor off: the background stays, everything else vanishes"),
    ),
    SourceEffect(
        "lisn-deviation", "path", "LISN beyond its tolerance",
        "choke of 50 uH times inductance_factor",
        (Parameter("inductance_factor", "", 0.08, 12.0, "from a shorted choke to a wrong LISN"),),
        "inductance_factor -> 1",
        "smooth tilt below 1 MHz, the same on all detectors and at all loads",
        ("cable-resonance",),
        "the LISN's impedance against ground measured with the impedance analyser, or another LISN",
        "circuit and tolerance of 20 %: CISPR 16-1-2 from memory, not checked against the standard",
        ({"inductance_factor": 0.3}, {"inductance_factor": 3.0}),
        _lisn,
        ("lisn-impedance", "measure the LISN's impedance against ground, 150 kHz to 30 MHz, with the receiver connected"),
    ),
    SourceEffect(
        "cable-resonance", "path", "the cable between motor and LISNs is a transmission line",
        "Z_in = Zc (Z_L + j Zc tan(beta l))/(Zc + j Z_L tan(beta l)), v = 2e8 m/s",
        (
            Parameter("length_m", "m", 0.2, 40.0, "from a test table to a long hall"),
            Parameter("impedance_ohm", "Ohm", 20.0, 400.0, "all wires together over ground"),
        ),
        "length_m -> 0",
        "peaks and dips some v/(2 l) apart that move with the cable's length",
        ("lisn-deviation",),
        "another cable length: the peaks move in proportion",
        "uniform line (textbook); the ranges are estimates",
        tuple({"length_m": float(length), "impedance_ohm": ohm} for length in np.geomspace(1.0, 16.0, 9) for ohm in (60.0, 140.0)),
        _cable,
        ("other-cable-length", "scan again with half the cable: resonances of the cable move up, everything else stays"),
    ),
)  # fmt: skip


def source_effects() -> tuple[SourceEffect, ...]:
    """The catalogue in its fixed order."""
    return EFFECTS


def is_source_effect(name: str) -> bool:
    """Whether a name belongs to this catalogue."""
    return any(effect.name == name for effect in EFFECTS)


def find_source_effect(name: str) -> SourceEffect:
    """The effect of that name.

    Raises
    ------
    BadInput
        If there is none; the message suggests the closest name.
    """
    for effect in EFFECTS:
        if effect.name == name:
            return effect
    close = difflib.get_close_matches(name, [effect.name for effect in EFFECTS], n=1)
    hint = f"did you mean {close[0]}?" if close else f"use {', '.join(effect.name for effect in EFFECTS)}"
    raise BadInput(f"unknown source effect {name!r}: {hint}")


def changed(setup: Setup, names: Sequence[str], values: Values) -> Setup:
    """A set-up with effects, whose parameters are called `effect.parameter`."""
    for name in names:
        effect = find_source_effect(name)
        setup = effect.change(setup, {p.name: values[f"{name}.{p.name}"] for p in effect.parameters if f"{name}.{p.name}" in values})
    return setup
