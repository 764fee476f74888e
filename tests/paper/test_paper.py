"""The paper's reproduction: the docs show what the command prints, and its numbers agree with calculations that share no formula with it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from command_line import document, motoremi
from places import ROOT
from scipy.integrate import quad

pytestmark = pytest.mark.slow

DOCS = ROOT / "docs" / "paper.md"
BEGIN, END = "<!-- motoremi paper: begin -->\n", "<!-- motoremi paper: end -->"


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper") / "figures"
    done = motoremi("paper", "--out", folder, "--json")
    assert done.returncode == 0, done.stderr
    return document(done)


@pytest.fixture(scope="module")
def numbers(drawn):
    return {one["id"]: one["numbers"] for one in drawn["disagreements"]}


def test_docs_show_what_the_command_prints():
    done = motoremi("paper")
    assert done.returncode == 0, done.stderr
    shown = DOCS.read_text().split(BEGIN)[1].split(END)[0]
    assert done.stdout == shown, "docs/paper.md is stale: put what `motoremi paper` prints between its marks"


def test_figures_are_drawn(drawn):
    files = [Path(name) for name in drawn["files"]]
    assert [f.name for f in files] == [f"{n}.{k}" for n in ("fig6_training", "fig7_impedance", "fig8_error") for k in ("svg", "png")]
    for file in files:
        if file.suffix == ".svg":
            assert ElementTree.parse(file).getroot().tag.endswith("svg")
        else:
            assert file.read_bytes().startswith(b"\x89PNG")


def test_the_printed_colony_misses_its_own_rule_and_ours_leaves_only_the_leads(drawn):
    fits = drawn["fits"]
    printed, ours, completed = fits.values()
    # The printed colony meets its own rule far from the noise; ours ends where only the hidden leads are left; with them at the noise.
    assert printed["chi2_reduced"] > 20 * ours["chi2_reduced"]
    # Where a circuit misses by far every point counts alike, which spreads the error of the leads a little.
    assert ours["above_20_mhz_percent"] > 2.5 * ours["below_20_mhz_percent"]
    assert completed["rms_error_percent"] < 1.1 * completed["floor_percent"]
    for name in list(fits)[:2]:
        assert drawn["figure_6"][name]
    # The curves of Fig. 8 agree with the errors that are reported.
    frequency = np.array(drawn["figure_8"]["frequency_hz"])
    for name, fit in fits.items():
        curves = np.array([drawn["figure_8"]["error_percent"][name][t] for t in ("short", "open")])
        assert np.sqrt(np.mean(curves[:, frequency > 20e6] ** 2)) == pytest.approx(fit["above_20_mhz_percent"])


def test_every_disagreement_is_there(numbers):
    circuit = {"rr-unit", "ra-invisible", "no-loss", "above-20-mhz", "stop-rule"}
    assert set(numbers) == circuit | {"la-ls", "tk", "uc", "euler", "lisn", "emission-notch"}


def test_circuit_numbers_by_hand(numbers):
    """Textbook formulas on Table 1, and the Cramer-Rao bounds from differences of equations (1) and (2)."""
    loss = numbers["no-loss"]
    assert loss["resonance_hz"] == pytest.approx(1 / (2 * np.pi * np.sqrt(12.1e-6 * 22e-12)))
    # Z of a coil with Q in parallel with its capacitor: Q squared times Ra, to 1/Q squared.
    assert loss["impedance_ohm"] == pytest.approx(loss["q"] ** 2 * 21.3e-3, rel=1e-6)
    f = np.geomspace(150e3, 30e6, 401)

    def impedances(p: np.ndarray) -> np.ndarray:
        ra, la, ca, rr, lr, cr, cf = np.exp(p)
        s = 2j * np.pi * f
        winding = 1 / (1 / (ra + s * la) + s * ca)
        return np.log(np.concatenate([winding, winding + 1 / (1 / (rr + s * lr + 1 / (s * cr)) + s * cf)]))

    centre = np.log([21.3e-3, 12.1e-6, 22e-12, 39.8, 1.6e-6, 424e-12, 210e-12])
    step = 1e-5
    rows = [(impedances(centre + step * e) - impedances(centre - step * e)) / (2 * step) / 0.005 for e in np.eye(7)]
    jacobian = np.concatenate([np.real(rows), np.imag(rows)], axis=1)
    bounds = 100 * np.sqrt(np.diag(np.linalg.inv(jacobian @ jacobian.T)))
    assert numbers["ra-invisible"]["ra_bound_percent"] == pytest.approx(bounds[0], rel=1e-3)
    assert numbers["rr-unit"]["lr_bound_ohm_percent"] == pytest.approx(bounds[4], rel=1e-3)
    assert numbers["rr-unit"]["lr_bound_kohm_percent"] > 1e5


def test_commutation_by_quadrature(numbers):
    """Eq. (14) is linear: an integrating factor solves it without the closed form. With A = Rd Tk / Ls and x = t/Tk,
    i = 1 - 2 A ((1 - x)/x)^A times the integral of (y/(1 - y))^A / (1 - y) dy from 0 to x."""
    ratio = 21.3e-3 * 38.4e-3 / 121e-6
    assert numbers["tk"]["a_printed"] == pytest.approx(ratio)

    def contact_v(x: float) -> float:
        integral = quad(lambda y: (y / (1 - y)) ** ratio / (1 - y), 0, x, epsabs=0, epsrel=1e-12)[0]
        i = 1 - 2 * ratio * ((1 - x) / x) ** ratio * integral
        return 21.3e-3 * 10 * ((1 + i) / (1 - x) + (1 - i) / x)

    # At the ends the contact voltage runs straight: half a percent of Tk away it is within 0.5 % of its end value.
    assert numbers["uc"]["first_v"] == pytest.approx(contact_v(0.005), rel=5e-3)
    assert numbers["uc"]["last_v"] == pytest.approx(contact_v(0.995), rel=5e-3)
    assert numbers["uc"]["steepest_v_per_s"] < 10
    steps = [numbers["euler"][f"euler_step_{n}_v"] for n in (1, 2, 3, 4)]
    assert min(steps) < 0 < 2 < max(steps)


def test_lisn_by_hand(numbers):
    branch = 5 + 2j * np.pi * 150e3 * 50e-6
    assert numbers["lisn"]["at_150_khz_ohm"] == pytest.approx(abs(50 * branch / (50 + branch)) / 2)


def test_help_and_bad_folder(tmp_path):
    helped = motoremi("paper", "--help")
    assert helped.returncode == 0
    assert "Example: motoremi paper" in helped.stdout
    file = tmp_path / "file"
    file.write_text("kept")
    done = motoremi("paper", "--out", file, "--json")
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    assert file.read_text() == "kept"
