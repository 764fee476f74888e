"""A discrepancy of next to nothing, the smallest of the grid, and none at all have their own best values of the elements."""

from __future__ import annotations

import pytest

from motoremi.blind.cases import Case
from motoremi.data.covariance import Sizes
from motoremi.fitting.fit import fit
from motoremi.fitting.marginal import SMALLEST
from motoremi.fitting.search import arrived_on_all
from motoremi.model.effects import add_effects
from motoremi.model.motor import dc_motor


@pytest.mark.slow
def test_a_fit_that_ends_at_the_smallest_discrepancy_is_also_refined_without_any():
    """From there its log evidence was 9 lower than that of the same model fitted directly, and a look-alike was named."""
    found = fit(add_effects(dc_motor(), ("eddy-laminations",)), Case(26113103, 18, "one", ("eddy-laminations",), 557767337).sweeps())
    # The end of that fit, which is the minimum for the smallest discrepancy.
    ended = {
        "Ra": 8.53501850507, "La": 1.21084637981e-05, "Ca": 3.84439163885e-11, "Rr": 35.7269672745, "Lr": 1.6465013916e-06,
        "Cr": 5.42286747562e-10, "Cf": 3.22145242801e-10, "eddy-laminations.share": 0.643093304451, "eddy-laminations.corner_hz": 2431.02671362,
    }  # fmt: skip
    again = arrived_on_all(found.task, [ended], Sizes(SMALLEST, 1.0))
    # Differences of one in log evidence decide nothing.
    assert again.log_evidence == pytest.approx(found.log_evidence, abs=1.0)
    assert again.sizes == found.sizes
