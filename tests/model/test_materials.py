"""The dispersive laws against measured ferrite (TDK N87; Guillod, Roberts and Sullivan 2024, MIT licence)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from places import DATA

from benchmarks import real_cores
from motoremi.inspection import dispersion as laws
from motoremi.inspection.dispersion import fit_laws

DATA = DATA / "n87_ferrite_material"


def numbers(path: Path, kind: type = float) -> np.ndarray:
    words = path.read_text().replace("i", "j").replace("\n", ",").split(",")
    return np.array([kind(word) for word in words if word.strip()])


def permittivity(temperature: int) -> tuple[np.ndarray, np.ndarray]:
    folder = DATA / "N87_eps_temperature"
    frequency = numbers(folder / "var_f_vec.csv")
    relative, conductivity = (numbers(folder / f"var_{name}_{temperature}_vec.csv") for name in ("eps", "sigma"))
    return frequency, relative - 1j * conductivity / (2 * np.pi * frequency * 8.8541878128e-12)


@pytest.mark.slow
def test_leakage_and_a_cole_cole_relaxation_describe_the_permittivity_at_all_temperatures():
    found = {}
    for temperature in (25, 55, 85):
        frequency, value = permittivity(temperature)
        thinned = slice(None, None, 4)
        sigma = np.full(frequency[thinned].size, 0.01)
        first, second = fit_laws((laws.LEAKING_COLE_COLE, laws.LEAKING_DEBYE), frequency[thinned], value[thinned], sigma)
        assert first.law is laws.LEAKING_COLE_COLE
        assert first.rms_error_percent < 1.0
        assert second.rms_error_percent > 4.0  # one relaxation time is not enough
        found[temperature] = first.parameters
    corners = [found[t]["corner_hz"] for t in (25, 55, 85)]
    assert corners[0] < corners[1] / 1.5 < corners[2] / 3  # warming moves the corner up
    assert found[85]["strength"] == pytest.approx(found[25]["strength"], rel=0.2)  # and leaves the strength


def test_a_second_exponent_describes_the_permittivity_below_what_it_is_good_to():
    frequency, value = permittivity(25)
    thinned = slice(None, None, 20)
    (found,) = fit_laws((laws.LEAKING_HAVRILIAK_NEGAMI,), frequency[thinned], value[thinned], np.full(frequency[thinned].size, 0.01))
    assert found.rms_error_percent < 0.4  # the law of Cole and Cole leaves 0.74 %


def test_the_law_of_havriliak_and_negami_is_positive_real():
    """Cole-Cole is its limit; its admittance has no negative real part in the right half-plane."""
    rng = np.random.default_rng(2)
    s = 10 ** rng.uniform(0, 9, 400) * np.exp(0.5j * np.pi * rng.uniform(-1, 1, 400))
    shape = laws.LEAKING_HAVRILIAK_NEGAMI.shape
    for exponent, skew in ((1.0, 1.0), (1.0, 0.1), (0.2, 1.0), (0.6, 0.4)):
        admittance = s * shape(s, 1e-9, 0.0, 3.0, 1e4, exponent, skew)
        assert np.all(admittance.real >= -1e-12 * np.abs(admittance))
    np.testing.assert_allclose(shape(s, 1e-9, 1e3, 3.0, 1e4, 0.7, 1.0), laws.LEAKING_COLE_COLE.shape(s, 1e-9, 1e3, 3.0, 1e4, 0.7), rtol=1e-9)


@pytest.mark.slow
def test_a_damped_resonance_describes_the_permeability():
    folder = DATA / "N87_mu_small"
    frequency, value = numbers(folder / "var_f_vec.csv"), numbers(folder / "var_mu_vec.csv", complex)
    fits = fit_laws((laws.LORENTZ, laws.RELAXATION, laws.DIFFUSION, laws.CONSTANT), frequency, value, np.full(frequency.size, 0.01))
    assert fits[0].law is laws.LORENTZ
    assert fits[0].rms_error_percent < 0.2
    # Its permeability rises before it falls, which neither relaxation nor diffusion does.
    assert min(fit.rms_error_percent for fit in fits[1:]) > 1.5


def test_the_page_of_real_cores_tells_which_curves_are_not_at_hand(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(real_cores, "section", lambda curve, path: (f"| {curve.title} |", ["", f"## {curve.title}"]))
    frequencies = [1e5, *(n * 1e6 for n in range(1, 11)), 2e8]
    table = {"DLW32MH201XK2": {"cm": {"f": frequencies, "re": [1.0] * 12, "im": [f * 1e-6 for f in frequencies]}}}
    (tmp_path / "hertz-cmc-curves.v1.json").write_text(json.dumps({"curves": table}))
    text = "\n".join(real_cores.page(tmp_path))
    # The one with an open licence comes with the repository.
    assert "## An inductor of 204 uH" in text
    assert "## A common-mode choke" in text
    missing = capsys.readouterr().err.splitlines()
    assert len(missing) == len(real_cores.CURVES) - 2
    assert all("is not in" in line and "github.com" in line for line in missing)
    choke = real_cores.sweep_of(real_cores.CURVES[-1], tmp_path / "hertz-cmc-curves.v1.json")
    assert choke.impedance_ohm.tolist() == [1 + 1j * n for n in range(1, 11)]  # within the band that is used
