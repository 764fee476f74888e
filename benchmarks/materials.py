"""`python -m benchmarks.materials FOLDER [--out docs/materials.md]`: comparison of the dispersive laws with a measured ferrite.

FOLDER holds `N87_mu_small`, `N87_eps_small` and `N87_eps_temperature` of github.com/otvam/large_signal_ferrite_apec24 (`dataset/`).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.page import make
from motoremi.arrays import ComplexArray, FloatArray
from motoremi.inspection import dispersion as laws
from motoremi.inspection.dispersion import DispersionFit, fit_laws
from motoremi.quantities import show, show_band

EPSILON_0 = 8.8541878128e-12
# The data state no uncertainty; this is typical of digitised curves and small-signal bridges.
SIGMA = 0.01
PERMEABILITY = (laws.CONSTANT, laws.RELAXATION, laws.DIFFUSION, laws.SHUNT_RESISTANCE, laws.COUPLED_RESONANCE, laws.LORENTZ)
PERMITTIVITY = (
    laws.CONSTANT_ANGLE,
    laws.COLE_COLE,
    laws.LEAKAGE,
    laws.LEAKING_DEBYE,
    laws.LEAKING_DIFFUSION,
    laws.LEAKING_COLE_COLE,
    laws.LEAKING_HAVRILIAK_NEGAMI,
)


def numbers(path: Path, kind: type = float) -> np.ndarray:
    """One column or row of numbers; complex ones as `2155-9i`."""
    text = path.read_text(encoding="utf-8").replace("i", "j").replace("\n", ",")
    return np.array([kind(word) for word in text.split(",") if word.strip()])


def materials(folder: Path) -> Iterator[tuple[str, FloatArray, ComplexArray, tuple[laws.DispersiveLaw, ...]]]:
    """Name, frequency in Hz, complex value and the laws to try."""
    mu = folder / "N87_mu_small"
    yield "permeability, 25 °C (data sheet)", numbers(mu / "var_f_vec.csv"), numbers(mu / "var_mu_vec.csv", complex), PERMEABILITY
    for title, place, mark in (
        ("25 °C", "N87_eps_small", ""),
        ("25 °C, second set", "N87_eps_temperature", "_25"),
        ("55 °C", "N87_eps_temperature", "_55"),
        ("85 °C", "N87_eps_temperature", "_85"),
    ):
        frequency = numbers(folder / place / "var_f_vec.csv")
        relative, conductivity = (numbers(folder / place / f"var_{name}{mark}_vec.csv") for name in ("eps", "sigma"))
        yield f"permittivity, {title}", frequency, relative - 1j * conductivity / (2 * np.pi * frequency * EPSILON_0), PERMITTIVITY


def parameters(fit: DispersionFit) -> str:
    """Values with units where they are frequencies."""
    texts = {name: show(value, "Hz", 3) if name.endswith("_hz") else f"{value:.3g}" for name, value in fit.parameters.items()}
    return ", ".join(f"{name} {text}" for name, text in texts.items())


def page(folder: Path) -> Iterator[str]:
    yield "# Which dispersive law fits which material"
    yield ""
    yield "Made by `python -m benchmarks.materials FOLDER --out docs/materials.md`; nothing in it is written by hand."
    yield ""
    yield (
        "Data (in `tests/data/n87_ferrite_material`): TDK N87 MnZn ferrite. Permittivity and conductivity measured by Guillod, Roberts and "
        "Sullivan (APEC 2024, doi 10.1109/APEC48139.2024.10509366), permeability digitised by them from the manufacturer's data sheet; "
        "© 2023 Thomas Guillod, "
        "Dartmouth College, MIT licence, github.com/otvam/large_signal_ferrite_apec24. "
        "Conductivity counts as the imaginary part of the permittivity."
    )
    yield ""
    yield (
        f"Each law is fitted to the complex value with {100 * SIGMA:.0f} % weight at every point (the data state no uncertainty), so chi2 below 1 "
        "means "
        "better than 1 %. Laws of the catalogue are marked with their effect; the others show what the catalogue lacks. "
        "Magnetic laws are written for L and stand for the permeability, dielectric ones for C and the permittivity. "
        "The law of Havriliak and Negami describes these permittivities best, but the difference is below their accuracy of 1 %. No effect uses "
        "it: one sweep of a motor cannot distinguish its second exponent from a second relaxation, and `dielectric-relaxation` can be added twice."
    )
    warming = []
    for name, frequency, value, candidates in materials(folder):
        fits = fit_laws(candidates, frequency, value, np.full(frequency.size, SIGMA))
        yield ""
        yield f"## N87 {name}, {show_band(frequency[0], frequency[-1])}"
        yield ""
        yield "| law | effect | formula | rms error (%) | chi2 | parameters |"
        yield "|---|---|---|---|---|---|"
        for fit in fits:
            effects = ", ".join(fit.law.effects) or "-"
            yield f"| {fit.law.name} | {effects} | `{fit.law.formula}` | {fit.rms_error_percent:.3g} | {fit.chi2_reduced:.3g} | {parameters(fit)} |"
        own = next(fit for fit in fits if fit.law.effects)
        yield ""
        yield (
            f"Best: {fits[0].law.name}, {fits[0].rms_error_percent:.2g} %. Best of the catalogue: {own.law.name} ({', '.join(own.law.effects)}), "
            f"{own.rms_error_percent:.2g} %."
        )
        if candidates is PERMITTIVITY:
            warming.append((name, next(fit for fit in fits if fit.law is laws.LEAKING_COLE_COLE)))
    yield from with_temperature(warming)


def with_temperature(warming: list[tuple[str, DispersionFit]]) -> Iterator[str]:
    """Parameters of one law as a function of temperature."""
    yield ""
    yield "## With temperature"
    yield ""
    yield "The deciding measurement for a dielectric relaxation is a second temperature: the corner frequency changes, the strength does not."
    yield ""
    yield "| material | leakage equals capacitance at | corner | strength | exponent |"
    yield "|---|---|---|---|---|"
    for name, fit in warming:
        own = fit.parameters
        yield f"| {name} | {show(own['leak_hz'], 'Hz', 3)} | {show(own['corner_hz'], 'Hz', 3)} | {own['strength']:.3g} | {own['exponent']:.3g} |"


if __name__ == "__main__":
    make(__doc__, page, "folder")
