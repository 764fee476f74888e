"""Which simple law a dispersive value over frequency follows: constant, relaxation, diffusion, resonance, leakage, constant angle.

The laws are those of the catalogue, so that a law found in a curve says which effect to add, and a few that materials follow but no effect
of the catalogue has. All are written for a complex inductance Z/s, a complex capacitance Y/s or an impedance, so that one law serves an element of
the circuit and, with permeability and permittivity in place of L and C, a material.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from scipy.optimize import least_squares

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.model import laws, materials
from motoremi.model.effects import catalogue

# (s, size, parameters) -> complex value over s
Shape: TypeAlias = Callable[..., ComplexArray]
TWO_PI = 2 * np.pi
# Corner frequencies are sought up to this factor beyond the sweep.
BEYOND = 30.0
# A law describes a curve if its chi2_reduced is below this: above 1, because the model's other elements are not exact either.
DESCRIBES = 9.0
# A constant with a chi2_reduced below this is accepted, even if a law with more parameters fits better.
CONSTANT_ENOUGH = 1.5
# Difference in BIC by which a law has to be better than a constant to be named: odds of 150 to 1.
CLEARLY_BETTER = 10.0


@dataclass(frozen=True)
class DispersiveLaw:
    """One law.

    Parameters
    ----------
    name : str
        In words.
    formula : str
    shape : callable
        (s, size, own parameters) -> complex value.
    starts : mapping
        Own parameter -> start values; `*span` stands for a few frequencies over the sweep.
    kinds : tuple of str
        What an effect of the catalogue that has this law is `seen_as`; several if one of each is needed.
    """

    name: str
    formula: str
    shape: Shape
    starts: Mapping[str, Sequence[float] | str] = field(default_factory=dict)
    kinds: tuple[str, ...] = ()

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects of the catalogue that have this law; `one + other` where both are needed."""
        names = [[effect.name for effect in catalogue() if kind in effect.seen_as] for kind in self.kinds]
        return tuple(" + ".join(one) for one in itertools.product(*names)) if names else ()


def _scaled(factor: laws.Law, inverse: bool = False) -> Shape:
    """Size times a factor of the catalogue; those of capacitances are factors of the impedance."""

    def shape(s: ComplexArray, size: float, *own: float) -> ComplexArray:
        value = factor(s, *own)[0]
        return size / value if inverse else size * value

    return shape


def _constant(s: ComplexArray, size: float) -> ComplexArray:
    return np.full(s.shape, size, dtype=np.complex128)


def _shunted_inductance(s: ComplexArray, size: float, resistance_ohm: float) -> ComplexArray:
    return size / (1 + s * size / resistance_ohm)


def _lorentz(s: ComplexArray, size: float, share: float, resonance_hz: float, quality: float) -> ComplexArray:
    ratio = s / (TWO_PI * resonance_hz)
    return size * (1 - share + share / (1 + ratio / quality + ratio**2))


def _leaking(s: ComplexArray, size: float, leak_hz: float) -> ComplexArray:
    return size * (1 + TWO_PI * leak_hz / s)


def _leaking_cole_cole(s: ComplexArray, size: float, leak_hz: float, strength: float, corner_hz: float, exponent: float) -> ComplexArray:
    relaxing = size / materials.relaxation_factor(s, strength, corner_hz, exponent)[0]
    return relaxing + size * TWO_PI * leak_hz / s


def _leaking_skewed(s: ComplexArray, size: float, leak_hz: float, strength: float, corner_hz: float, exponent: float, skew: float) -> ComplexArray:
    """Havriliak and Negami (Polymer 8 (1967) 161): passive as long as neither the exponent nor its product with the skew exceeds 1."""
    relaxing = size * (1 + strength / (1 + (s / (TWO_PI * corner_hz)) ** exponent) ** skew)
    return relaxing + size * TWO_PI * leak_hz / s


def _leaking_debye(s: ComplexArray, size: float, leak_hz: float, strength: float, corner_hz: float) -> ComplexArray:
    return _leaking_cole_cole(s, size, leak_hz, strength, corner_hz, 1.0)


def _leaking_diffusion(s: ComplexArray, size: float, leak_hz: float, corner_hz: float) -> ComplexArray:
    """A conducting sheet whose field is confined to the surface at high frequencies: both parts of the admittance decrease together."""
    value = materials.lamination_factor(s, 1.0, corner_hz)[0]
    return (size + size * TWO_PI * leak_hz / s) * value


def _film(s: ComplexArray, size: float, resistance_ohm: float, corner_hz: float) -> ComplexArray:
    return size + resistance_ohm / (1 + s / (TWO_PI * corner_hz))


def _with_inductance(s: ComplexArray, size: float, inductance_h: float) -> ComplexArray:
    return size + s * inductance_h


def _cell(s: ComplexArray, size: float, resonance_hz: float, quality: float) -> ComplexArray:
    """A parallel cell by its resistance at resonance."""
    ratio = s / (TWO_PI * resonance_hz)
    return size / (1 + quality * (ratio + 1 / ratio))


CONSTANT = DispersiveLaw("constant", "x", _constant)
RELAXATION = DispersiveLaw(
    "relaxation",
    "L (1 - k + k / (1 + s/w))",
    _scaled(materials.debye_factor),
    {"share": (0.1, 0.6), "corner_hz": "*span"},
    ("inductance-relaxation",),
)
LORENTZ = DispersiveLaw(
    "damped resonance of the material (Lorentz)",
    "L (1 - k + k / (1 + s/(Q w) + (s/w)^2))",
    _lorentz,
    {"share": (0.3, 0.9), "resonance_hz": "*span", "quality": (0.3, 1.5)},
    ("inductance-relaxation",),
)
DIFFUSION = DispersiveLaw(
    "diffusion",
    "L (1 - k + k tanh(x)/x), x = sqrt(s/(pi f))",
    _scaled(materials.lamination_factor),
    {"share": (0.3, 0.8), "corner_hz": "*span"},
    ("inductance-diffusion",),
)
COUPLED_RESONANCE = DispersiveLaw(
    "resonance",
    "L (1 - k^2 s^2 / (s^2 + s w/Q + w^2))",
    _scaled(laws.coupled_winding_factor),
    {"coupling": (0.1,), "resonance_hz": "*span", "quality": (3.0, 30.0)},
    ("inductance-resonance",),
)
SHUNT_RESISTANCE = DispersiveLaw(
    "resistance across it", "L / (1 + s L/R)", _shunted_inductance, {"resistance_ohm": (100.0, 1e3, 1e4, 1e5)}, ("inductance-shunted",)
)
CONSTANT_ANGLE = DispersiveLaw(
    "constant loss angle",
    "C (s/w0)^(-2 delta/pi)",
    _scaled(materials.constant_phase_factor, True),
    {"tan_delta": (0.003, 0.03)},
    ("capacitance-angle",),
)
COLE_COLE = DispersiveLaw(
    "relaxation",
    "C (1 + d / (1 + (s/w)^a))",
    _scaled(materials.relaxation_factor, True),
    {"strength": (0.03, 0.5), "corner_hz": "*span", "exponent": (0.9,)},
    ("capacitance-relaxation",),
)
LEAKAGE = DispersiveLaw("leakage", "C + G/s", _leaking, {"leak_hz": (1e2, 1e4, 1e6)}, ("capacitance-leakage",))
LEAKING_DEBYE = DispersiveLaw(
    "leakage and a Debye relaxation",
    "C (1 + d / (1 + s/w)) + G/s",
    _leaking_debye,
    {"leak_hz": (1e4,), "strength": (0.3, 3.0), "corner_hz": "*span"},
    ("capacitance-leakage", "capacitance-relaxation"),
)
LEAKING_COLE_COLE = DispersiveLaw(
    "leakage and a Cole-Cole relaxation",
    "C (1 + d / (1 + (s/w)^a)) + G/s",
    _leaking_cole_cole,
    {"leak_hz": (1e4,), "strength": (0.3, 3.0), "corner_hz": "*span", "exponent": (0.8,)},
    ("capacitance-leakage", "capacitance-relaxation"),
)
LEAKING_HAVRILIAK_NEGAMI = DispersiveLaw(
    "leakage and a Havriliak-Negami relaxation",
    "C (1 + d / (1 + (s/w)^a)^b) + G/s",
    _leaking_skewed,
    {"leak_hz": (1e4,), "strength": (0.3, 3.0), "corner_hz": "*span", "exponent": (0.8,), "skew": (0.6,)},
)
LEAKING_DIFFUSION = DispersiveLaw(
    "leakage and diffusion", "(C + G/s) tanh(x)/x, x = sqrt(s/(pi f))", _leaking_diffusion, {"leak_hz": (1e4,), "corner_hz": "*span"}
)
SKIN = DispersiveLaw("skin effect", "R x I0(x) / (2 I1(x))", _scaled(materials.skin_factor), {"radius_m": (5e-5, 2e-4, 8e-4)}, ("conductor-skin",))
LAYERS = DispersiveLaw(
    "layers of wire (Dowell)",
    "R (M + (m^2 - 1)/3 D)",
    _scaled(materials.dowell_factor),
    {"height_m": (3e-5, 1e-4, 3e-4), "layers": (3.0, 10.0)},
    ("conductor-layers",),
)
FILM = DispersiveLaw("film, R parallel C", "R + R1 / (1 + s/w)", _film, {"resistance_ohm": (1.0, 100.0), "corner_hz": "*span"}, ("film",))
LEAD = DispersiveLaw("an inductance in series", "R + s L", _with_inductance, {"inductance_h": (1e-8, 1e-6)}, ("series-inductance",))
CELL = DispersiveLaw("resonance", "R / (1 + Q (s/w + w/s))", _cell, {"resonance_hz": "*span", "quality": (1.0, 10.0)}, ("cell",))

# Laws that an element or a part may follow, by its unit: henry for Z/s, farad for Y/s, ohm for an impedance.
BY_UNIT: Mapping[str, tuple[DispersiveLaw, ...]] = {
    "H": (CONSTANT, RELAXATION, DIFFUSION, SHUNT_RESISTANCE, COUPLED_RESONANCE),
    "F": (CONSTANT, CONSTANT_ANGLE, LEAKAGE, COLE_COLE),
    "Ohm": (CONSTANT, SKIN, LAYERS, FILM, LEAD, CELL),
}


@dataclass(frozen=True, eq=False)
class DispersionFit:
    """A law fitted to a curve.

    Parameters
    ----------
    law : DispersiveLaw
    parameters : dict
        Size and own parameters, SI units.
    chi2_reduced, bic : float
        Over the curve's uncertainty.
    rms_error_percent : float
        Of |law/value - 1|.
    """

    law: DispersiveLaw
    parameters: dict[str, float]
    chi2_reduced: float
    bic: float
    rms_error_percent: float

    def value(self, frequency_hz: FloatArray) -> ComplexArray:
        """The law over frequency."""
        return self.law.shape(_s(frequency_hz), *self.parameters.values())

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "law": self.law.name,
            "formula": self.law.formula,
            "effects": list(self.law.effects),
            "parameters": dict(self.parameters),
            "chi2_reduced": self.chi2_reduced,
            "rms_error_percent": self.rms_error_percent,
        }


def _s(frequency_hz: FloatArray) -> ComplexArray:
    return np.asarray(2j * np.pi * frequency_hz, dtype=np.complex128)


def fit_laws(candidates: Sequence[DispersiveLaw], frequency_hz: FloatArray, value: ComplexArray, sigma_relative: FloatArray) -> list[DispersionFit]:
    """Fit each law to a curve by least squares; the best BIC first.

    Parameters
    ----------
    frequency_hz : ndarray, shape (n,)
    value : ndarray, shape (n,)
        Complex.
    sigma_relative : ndarray, shape (n,)
        Standard uncertainty of the real and of the imaginary part, relative to the magnitude.
    """
    return sorted((_fitted(law, frequency_hz, value, sigma_relative) for law in candidates), key=lambda fit: fit.bic)


def _fitted(law: DispersiveLaw, frequency_hz: FloatArray, value: ComplexArray, sigma: FloatArray) -> DispersionFit:
    s = _s(frequency_hz)
    weight = 1 / (sigma * np.abs(value))

    def residual(u: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            left = (law.shape(s, *np.exp(np.clip(u, -200, 200))) - value) * weight
        parts = np.concatenate([left.real, left.imag])
        return parts if np.isfinite(parts).all() else np.nan_to_num(parts, nan=1e8, posinf=1e8, neginf=-1e8)

    low, high = _limits(law, frequency_hz)
    best: Any = None
    for start in _starts(law, frequency_hz, value):
        found = least_squares(residual, np.clip(start, np.add(low, 1e-6), np.subtract(high, 1e-6)), bounds=(low, high), x_scale="jac", max_nfev=200)
        if best is None or found.cost < best.cost:
            best = found
    count = 2 * value.size
    chi2 = 2 * float(best.cost)
    parameters = dict(zip(("size", *law.starts), np.exp(best.x).tolist(), strict=True))
    error = np.abs(law.shape(s, *parameters.values()) / value - 1)
    return DispersionFit(
        law=law,
        parameters=parameters,
        chi2_reduced=chi2 / (count - len(parameters)),
        bic=chi2 + len(parameters) * float(np.log(count)),
        rms_error_percent=float(100 * np.sqrt(np.mean(error**2))),
    )


def _starts(law: DispersiveLaw, frequency_hz: FloatArray, value: ComplexArray) -> list[FloatArray]:
    """Logarithms of start values: all combinations."""
    span = np.geomspace(frequency_hz[0], frequency_hz[-1], 7)
    choices = [span if values == "*span" else np.asarray(values, dtype=np.float64) for values in law.starts.values()]
    size = np.array([max(float(np.median(np.abs(value.real))), 1e-300)])
    grids = np.meshgrid(size, *choices, indexing="ij")
    return [np.log(np.array(start)) for start in zip(*(grid.ravel() for grid in grids), strict=True)]


# Ranges outside of which a law would become another one; all other parameters are not limited.
_RANGES: Mapping[str, tuple[float, float]] = {
    "share": (1e-6, 1.0),
    "coupling": (1e-6, 1.0),
    "exponent": (0.2, 1.0),
    "skew": (0.1, 1.0),
    "quality": (1e-3, 1e4),
    "tan_delta": (1e-7, 10.0),
    "layers": (1.0, 100.0),
}


def _limits(law: DispersiveLaw, frequency_hz: FloatArray) -> tuple[list[float], list[float]]:
    """Logarithms of the range of each parameter."""
    pairs: list[tuple[float, float]] = [(1e-30, 1e30)]
    for name, start in law.starts.items():
        span = (float(frequency_hz[0]) / BEYOND, float(frequency_hz[-1]) * BEYOND)
        pairs.append(span if start == "*span" else _RANGES.get(name, (1e-30, 1e30)))
    return [math.log(low) for low, _ in pairs], [math.log(high) for _, high in pairs]
