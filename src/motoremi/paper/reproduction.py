"""The paper's Fig. 6 - 8 on sweeps simulated from Table 1: its ant colony algorithm and this project's.

The motor has Rr in ohm, and leads of 100 nH that the paper's circuit does not contain: they cause an error above 20 MHz as in the paper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import FloatArray, JsonDict
from motoremi.fitting.fit import fit
from motoremi.fitting.result import Fit
from motoremi.model.motor import dc_motor
from motoremi.paper import circuit_checks, source_checks
from motoremi.paper.circuit_checks import LEAD, candidate_bounds, error_split_percent
from motoremi.paper.data import NOISE, POINTS, sweeps
from motoremi.paper.disagreement import Disagreement
from motoremi.paper.printed import TABLE_1, TABLE_1_OHM


@dataclass(frozen=True, eq=False)
class Reproduction:
    """The results that the command shows.

    Parameters
    ----------
    printed, ours, completed : Fit
        The colony as printed, our colony on the same circuit and candidates, and ours with the leads added.
    disagreements : tuple of Disagreement
    """

    printed: Fit
    ours: Fit
    completed: Fit
    disagreements: tuple[Disagreement, ...]

    @property
    def fits(self) -> dict[str, Fit]:
        """The three fits by their names."""
        return {"the colony as printed": self.printed, "our colony": self.ours, f"ours with {LEAD.name}": self.completed}

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        frequency: FloatArray = self.ours.measurement.sweeps[0].frequency_hz
        measured = {sweep.termination: np.abs(sweep.mean_ohm) for sweep in self.ours.measurement.sweeps}
        return {
            "schema": "motoremi.paper/1",
            "table_1": dict(TABLE_1),
            "simulated": {"elements": dict(TABLE_1_OHM), "hidden": {LEAD.name: dict(LEAD.sizes)}, "noise_relative": NOISE, "points": POINTS},
            "fits": {name: _figures(one) for name, one in self.fits.items()},
            "figure_6": {name: [dict(point) for point in one.history] for name, one in list(self.fits.items())[:2]},
            "figure_7": {
                "frequency_hz": frequency,
                "measured_ohm": measured,
                "model_ohm": {name: {t: np.abs(one.model_ohm(t)) for t in measured} for name, one in self.fits.items()},
            },
            "figure_8": {
                "frequency_hz": frequency,
                "error_percent": {name: {t: 100 * np.abs(e) for t, e in one.errors().items()} for name, one in self.fits.items()},
            },
            "disagreements": [one.to_dict() for one in self.disagreements],
        }


def _figures(one: Fit) -> JsonDict:
    below, above = error_split_percent(one)
    return {
        "parameters": dict(one.parameters),
        "undetermined": one.undetermined(),
        "evaluations": one.evaluations,
        "chi2_reduced": one.chi2_reduced,
        "rms_error_percent": one.rms_error_percent,
        "below_20_mhz_percent": below,
        "above_20_mhz_percent": above,
        "floor_percent": one.floor_percent,
    }


def reproduce() -> Reproduction:
    """Fit the simulated motor in the three ways, and compare the paper's numbers with each other."""
    measured = sweeps(TABLE_1_OHM, LEAD)
    bounds = candidate_bounds()
    printed = fit(dc_motor(), measured, method="paper", analyser="none", bounds=bounds)
    ours = fit(dc_motor(), measured, analyser="none", bounds=bounds)
    checks = (*circuit_checks.CHECKS, *source_checks.CHECKS)
    return Reproduction(printed, ours, ours.add(LEAD.name), tuple(check() for check in checks))


def training(one: Fit) -> tuple[FloatArray, FloatArray]:
    """Evaluations and best deviation so far in percent: the training curve."""
    count = np.array([point["evaluations"] for point in one.history], dtype=np.float64)
    best: FloatArray = np.minimum.accumulate([point["rms_deviation_percent"] for point in one.history])
    return count, best
