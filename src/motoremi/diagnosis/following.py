"""The next measurement: what would tell the standing candidates apart, found by simulating each under it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from motoremi.arrays import JsonDict
from motoremi.fitting.result import Fit
from motoremi.model.effects import find_effect
from motoremi.quantities import show, show_band

WIDE_HZ = (40.0, 110e6)


def next_measurement(fit: Fit, rivals: Sequence[Fit]) -> JsonDict:
    """What to measure next.

    Parameters
    ----------
    fit : Fit
        The model that stands.
    rivals : sequence of Fit
        Models that these data cannot tell apart (or the best of those that fail); may be empty.

    Returns
    -------
    dict
        `id` and `why`.
    """
    if len(fit.measurement.sweeps) == 1:
        missing = "open" if fit.measurement.terminations == ("short",) else "short"
        return {"id": f"{missing}-sweep", "why": f"measure the {missing}-circuit sweep too: one sweep cannot locate an effect"}
    if len(rivals) > 1:
        return _separating(fit, rivals)
    if fit.effects:
        effect = find_effect(fit.effects[-1]).effect
        return {"id": f"confirm-{effect.name}", "why": f"to confirm {effect.name}: {effect.deciding}"}
    undetermined = fit.undetermined()
    if "Ra" in undetermined:
        return {"id": "dc-resistance", "why": "these sweeps do not determine Ra: measure it at DC with four wires and hold it in the fit"}
    if undetermined:
        return {"id": "wide-sweep", "why": f"these sweeps do not determine {', '.join(undetermined)}: sweep {show_band(*WIDE_HZ)}"}
    return {"id": "repeat", "why": "nothing is missing; repeat after turning the shaft or warming up to see what changes"}


def _separating(fit: Fit, rivals: Sequence[Fit]) -> JsonDict:
    """Where in a wider sweep the rivals' predictions part most, in units of the analyser's uncertainty."""
    frequency = np.geomspace(*WIDE_HZ, 400)
    low = min(sweep.frequency_hz[0] for sweep in fit.measurement.sweeps)
    high = max(sweep.frequency_hz[-1] for sweep in fit.measurement.sweeps)
    outside = (frequency < low) | (frequency > high)
    first, second = rivals[0], rivals[1]
    best_ratio, best_f = 0.0, float(frequency[0])
    for termination in fit.measurement.terminations:
        one, other = (model.model_ohm(termination, frequency) for model in (first, second))
        uncertainty = np.hypot(fit.measurement.analyser.uncertainty(frequency, one), fit.floor_percent / 100)
        ratio = np.where(outside, np.abs(one / other - 1) / uncertainty, 0.0)
        if ratio.max() > best_ratio:
            best_ratio, best_f = float(ratio.max()), float(frequency[np.argmax(ratio)])
    names = f"{first.effects[-1]} and {second.effects[-1]}" if first.effects and second.effects else "the candidates"
    if best_ratio > 5:
        why = f"sweep {show_band(*WIDE_HZ)}: near {show(best_f, 'Hz')} {names} differ by {best_ratio:.0f} times the uncertainty"
        return {"id": "wide-sweep", "why": why}
    effect = find_effect(first.effects[-1]).effect if first.effects else None
    why = f"even {show_band(*WIDE_HZ)} would not separate {names}" + (f"; {effect.deciding}" if effect else "")
    return {"id": f"decide-{effect.name}" if effect else "wide-sweep", "why": why}
