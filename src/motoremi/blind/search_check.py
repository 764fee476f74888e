"""Whether a wrong answer is the search's fault: the model with the hidden effects, fitted directly, against the best model that was found."""

from __future__ import annotations

import numpy as np

from motoremi.diagnosis.diagnosis import Diagnosis
from motoremi.errors import MotoremiError
from motoremi.fitting.fit import fit
from motoremi.model.effects import add_effects
from motoremi.model.motor import dc_motor
from motoremi.simulate.hidden_effects import OUTSIDE_EFFECTS
from motoremi.simulate.uncatalogued import UNCATALOGUED_EFFECTS


def hidden_ahead_nats(found: Diagnosis, hidden: tuple[str, ...]) -> float | None:
    """Log evidence of the model with the hidden effects above that of the best model that the search found, natural logarithm.

    If it is clearly above 0, the search missed a better model. Otherwise the decision or the data are the cause of a wrong answer.

    Returns
    -------
    float or None
        None if nothing is hidden, if an effect is not in the catalogue, or if these data cannot show one of them.
    """
    if not hidden or found.searched is None or {*hidden} & {*OUTSIDE_EFFECTS, *UNCATALOGUED_EFFECTS}:
        return None
    judgement = found.searched.declared.judgement
    try:
        true = fit(add_effects(dc_motor(), hidden), judgement.base.measurement)
    except (MotoremiError, np.linalg.LinAlgError):
        # The board's other cases go on.
        return None
    best = max(judgement.base.log_evidence, *(one.fit.log_evidence for one in judgement.found.values()))
    return true.log_evidence - best
