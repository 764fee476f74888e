"""Cross-validation against refits that really leave the block out, and on what it is for."""

import numpy as np
import pytest
from conftest import simulated_sweeps

import motoremi as me
from motoremi.diagnosis import validation
from motoremi.diagnosis.validation import cross_validated
from motoremi.fitting.marginal import log_evidences
from motoremi.fitting.polish import Precision, polish
from motoremi.fitting.problem import Problem

pytestmark = pytest.mark.slow


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
    # What the short-circuit sweep says of the open one is what both are worth together less what it is worth alone.
    assert cross_validated(full).across == pytest.approx(_evidence(full) - _evidence(only), abs=3)


def _evidence(fit):
    """Of the data at the smallest discrepancy, relative to white noise alone."""
    problem, here = fit.problem, fit.linearised
    found = log_evidences(problem, fit.unknowns, here.deviation, here.slopes * here.chain[:, None], fit.sizes.declared)[0]
    return found + 2 * np.sum(np.log(problem.observed.columns.sigma))


def _raw(fit):
    return [me.ImpedanceSweep(group.termination, group.frequency_hz, row) for group in fit.measurement.sweeps for row in group.impedance_ohm]


def test_left_out_bands_agree_with_real_refits(hidden):
    """What the formula says a band's neighbours do not predict of it is what a fit without the band leaves there, to a tenth of the noise."""
    fit = hidden.add("core-loss")
    frequency = fit.problem.observed.frequency_hz
    block = np.tile((frequency > 5e6) & (frequency < 8e6), 2)
    pulled, columns = validation.inverse_covariance(fit)
    by_formula = np.linalg.solve(np.eye(block.sum()) - columns[block] @ columns[block].T, pulled[block])

    band = {s.termination: (s.frequency_hz > 5e6) & (s.frequency_hz < 8e6) for s in fit.measurement.sweeps}
    without = Problem(fit.motor, fit.measurement.with_outliers(band), sizes=fit.sizes)
    left = polish(without, fit.unknowns[None], precision=Precision(1e-9, 1e-12)).u[0]
    deviation = (without.deviation(left) - without.smooth_error(left)) * fit.problem.observed.weight
    np.testing.assert_allclose(by_formula, np.concatenate([deviation.real, deviation.imag])[block], atol=0.1)


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
