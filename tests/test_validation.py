"""Cross-validation against refits that really leave the block out, and on what it is for."""

import numpy as np
import pytest
from conftest import simulated_sweeps

import motoremi as me
from motoremi.diagnosis.validation import cross_validated
from motoremi.fitting.polish import Precision, polish
from motoremi.fitting.problem import Problem


@pytest.fixture(scope="module")
def hidden():
    sweeps, _ = simulated_sweeps(3, ("core-loss",))
    return me.fit(me.dc_motor(), sweeps)


def test_a_left_out_sweep_is_predicted_as_by_a_fit_without_it(hidden):
    """The short-circuit sweep alone determines the winding: its refit must agree with the formula's implied parameters."""
    full = hidden.add("core-loss")
    short = [sweep for sweep in full.measurement.sweeps if sweep.termination == "short"]
    assert len(short) == 1
    only = me.fit(None, [s for s in _raw(full) if s.termination == "short"]).add("core-loss")
    for name in ("La", "Ca", "core-loss.resistance_ohm"):
        assert only.parameters[name] == pytest.approx(full.parameters[name], abs=6 * only.sigma[name])
    # What the winding alone cannot predict costs little per point: the density is that of the noise, but for the frame's few unknowns.
    points = 2 * full.problem.observed.slices["open"].stop - 2 * full.problem.observed.slices["open"].start
    assert cross_validated(full).across > -0.5 * points * 1.3 - 80


def _raw(fit):
    return [me.ImpedanceSweep(group.termination, group.frequency_hz, row) for group in fit.measurement.sweeps for row in group.impedance_ohm]


def test_left_out_bands_agree_with_real_refits(hidden):
    """The formula's residuals in one block are those of a fit to all other points, to within a tenth of the noise."""
    from motoremi.diagnosis import validation

    fit = hidden.add("core-loss")
    problem = fit.problem
    here = problem.linearised(fit.unknowns)
    residual, jacobian = validation._white(fit, here.residual), validation._white(fit, here.jacobian)
    frequency = np.tile(problem.observed.frequency_hz, 2)
    block = (frequency > 5e6) & (frequency < 8e6)
    slopes = jacobian[:, block]
    hat = slopes.T @ np.linalg.solve(here.matrix, slopes)
    by_formula = np.linalg.solve(np.eye(block.sum()) - hat, residual[block])

    class Without(Problem):
        def linearised(self, u):
            found = super().linearised(u)
            rows = validation._white(fit, found.residual)[..., ~block], validation._white(fit, found.jacobian)[..., ~block]
            found.objective = np.sum(rows[0] ** 2, axis=-1) + self._penalty(u)
            found.gradient = (rows[1] @ rows[0][..., None])[..., 0] + self.precision * (u - self.centre)
            found.matrix = rows[1] @ np.swapaxes(rows[1], -1, -2) + np.diag(self.precision)
            return found

    left = polish(Without(problem.motor, fit.measurement), fit.unknowns[None], precision=Precision(1e-9, 1e-12))
    by_refit = validation._white(fit, problem.linearised(left.u[0]).residual)[block]
    np.testing.assert_allclose(by_formula, by_refit, atol=0.1)


def test_the_hidden_effect_predicts_what_was_left_out(hidden):
    gain = cross_validated(hidden.add("core-loss")).gain_over(cross_validated(hidden))
    assert gain["bands"] > 100
    assert gain["short_to_open"] > 100


def test_an_effect_that_is_not_there_predicts_nothing():
    """More freedom alone must not look better: a tenth of a nat a parameter is what luck brings."""
    sweeps, _ = simulated_sweeps(3, ())
    base = me.fit(me.dc_motor(), sweeps)
    for effect in ("lead-inductance", "dielectric-relaxation@Cf"):
        gain = cross_validated(base.add(effect)).gain_over(cross_validated(base))
        assert gain["bands"] < 3


def test_one_sweep_has_no_other(hidden):
    only = me.fit(None, [s for s in _raw(hidden) if s.termination == "short"])
    assert cross_validated(only).across is None
