"""A step of the ladder in detail: error per band before and after, changes of parameters, and effects that are no longer needed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.diagnosis.candidates import prior_of_values
from motoremi.fitting.refit import refit_without
from motoremi.fitting.result import Fit
from motoremi.fitting.search import misses_by_far
from motoremi.inspection.compare import compare
from motoremi.model.effects import find_effect
from motoremi.quantities import show

# A change is reported if it exceeds this factor and this number of standard deviations of the later value.
REPORTED_FACTOR = 1.2
REPORTED_SIGMA = 5.0
# Smallest gain in log evidence (with the prior of its values) for which an effect is needed: odds of 50 to 1.
LEAST_GAIN = 4.0
# Largest number of modes that are added: more would describe noise.
MOST_MORE = 15
# The search for further modes goes on after this many that lower the error too little. With two it ended at 4 % on a winding where three led to
# 1.5 %, with three at 5.2 % on another one where four led to 1.9 %; each costs a second.
PATIENCE = 5
# Largest correlation of neighbouring errors: about forty points then count as one.
MOST_SHARED = 0.95
# A resistance is back at its DC value within this share: copper changes by 0.4 % per kelvin, contacts by a little more.
AT_DC = 0.1


@dataclass(frozen=True, eq=False)
class LadderStep:
    """One model of the ladder against the one before. Immutable.

    Parameters
    ----------
    before : Fit or None
        None for the base.
    fit : Fit
    unneeded : tuple of str
        Effects without which the data would be described as well.
    dc_resistance_ohm : float or None
        The winding's, if it was measured.
    """

    before: Fit | None
    fit: Fit
    unneeded: tuple[str, ...]
    dc_resistance_ohm: float | None

    @property
    def added(self) -> str | None:
        """The effect that this step added."""
        return self.fit.effects[-1] if self.before is not None and self.fit.effects else None

    @property
    def changes(self) -> tuple[JsonDict, ...]:
        """Each parameter before and after, SI units; None where the model had or has it not."""
        old = {} if self.before is None else self.before.parameters
        names = [p.name for p in self.fit.motor.parameters if p.name in self.fit.parameters]
        units = {p.name: p.unit for p in self.fit.motor.parameters}
        return tuple({"name": n, "unit": units[n], "before": old.get(n), "after": self.fit.parameters[n]} for n in names)

    @property
    def bands(self) -> tuple[JsonDict, ...]:
        """Error per sweep and band, with the one before as `rms_error_percent_before`."""
        old = {} if self.before is None else {(b["sweep"], *b["band_hz"]): b["rms_error_percent"] for b in compare(self.before).bands}
        return tuple({**b, "rms_error_percent_before": old.get((b["sweep"], *b["band_hz"]))} for b in compare(self.fit).bands)

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on this step."""
        said = [note for change in self.changes if (note := self._reported(change))]
        for effect in self.unneeded:
            without = "the data are described as well without it"
            said.append(f"{effect} is {'not needed' if effect == self.added else 'no longer needed'}: {without}")
        return tuple(said)

    def _reported(self, change: JsonDict) -> str | None:
        """A parameter of the circuit that moved; for Ra, whether it went back to its DC value."""
        name, before, after = change["name"], change["before"], change["after"]
        if before is None or "." in name or name in self.fit.held:
            return None
        if max(before / after, after / before) < REPORTED_FACTOR or abs(after - before) < REPORTED_SIGMA * self.fit.sigma[name]:
            return None
        moved = f"{name} {'falls' if after < before else 'rises'} from {show(before, change['unit'])} to {show(after, change['unit'])}"
        if name != "Ra":
            return moved
        dc = self.dc_resistance_ohm
        if dc is not None and abs(after / dc - 1) < max(AT_DC, 3 * self.fit.sigma["Ra"] / dc):
            return f"{moved}: back at its DC value ({show(dc, 'Ohm')}); before, it included the losses of {self.added}"
        if dc is not None:
            return f"{moved}; its DC value is {show(dc, 'Ohm')}"
        if after < before:
            return f"{moved}: it no longer includes the losses of {self.added}; compare it with a DC measurement"
        return moved

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        return {
            "fit": self.fit.to_dict(),
            "added": self.added,
            "bands": [dict(band) for band in self.bands],
            "changes": [dict(change) for change in self.changes],
            "unneeded": list(self.unneeded),
            "notes": list(self.notes),
        }


def ladder_step(before: Fit | None, fit: Fit, dc_resistance_ohm: float | None = None) -> LadderStep:
    """A step of the ladder; the fit is repeated without each of its effects.

    Parameters
    ----------
    before : Fit or None
        The step below; None for the base.
    fit : Fit
    dc_resistance_ohm : float, optional
        The winding's, measured at DC.
    """
    unneeded = tuple(effect for effect in dict.fromkeys(fit.effects) if not _supported(effect, before, fit))
    return LadderStep(before, fit, unneeded, dc_resistance_ohm)


def accumulates(effect: str) -> bool:
    """Whether an effect is added as often as it lowers the error: it only describes, and a motor may have several."""
    entry = find_effect(effect).effect
    return entry.describes and entry.repeatable


def further(fit: Fit, effect: str, progress: Progress | None = None) -> Iterator[list[Fit]]:
    """More of a repeatable effect that only describes, in portions that each lower the circuit's own error by more than chance would.

    Nothing for any other effect.

    Evidence cannot be used here: as long as resonances are missing, the error is far larger than noise and far from smooth. The measure is the
    Bayesian information criterion (BIC) of the relative error, over the number of independent values. A portion may contain several effects:
    of two neighbouring modes neither gains much alone.
    """
    if not accumulates(effect):
        return
    portion: list[Fit] = []
    best, enough = fit, fit.measurement.accuracy_percent or 0.0
    for number in range(MOST_MORE):
        if best.rms_error_percent <= enough:
            return
        if progress is not None:
            progress(f"one more of {effect}", number, MOST_MORE)
        fit = fit.add(effect)
        portion.append(fit)
        if _worth_more(fit, best) or fit.rms_error_percent <= enough:
            yield portion
            portion, best = [], fit
        elif len(portion) > PATIENCE:
            return


def _worth_more(fit: Fit, before: Fit) -> bool:
    # Where resonances are missing, errors are alike over wide spans, which says nothing of how many values the larger model was compared with.
    values = _independent(fit)
    gained = 2 * values * np.log(before.rms_error_percent / fit.rms_error_percent)
    return bool(gained > (len(fit.parameters) - len(before.parameters)) * np.log(values))


def _independent(fit: Fit) -> float:
    """Number of independent real values of the relative error, given the correlation of neighbours (that of an autoregressive series)."""
    values = 0.0
    for error in fit.errors().values():
        along = float(np.vdot(error[1:], error[:-1]).real / np.vdot(error, error).real)
        shared = min(max(along, 0.0), MOST_SHARED)
        values += 2 * np.size(error) * (1 - shared) / (1 + shared)
    # With fewer values BIC would reward parameters.
    return max(values, 2.0)


def _supported(effect: str, before: Fit | None, fit: Fit) -> bool:
    below = before is not None and before.effects == fit.effects[:-1] and effect == fit.effects[-1]
    without = before if below and before is not None else refit_without(fit, effect, thorough=False)
    if misses_by_far(fit.sizes):
        return _worth_more(fit, without)
    return _weight(fit) - _weight(without) >= LEAST_GAIN


def _weight(fit: Fit) -> float:
    """Log evidence of a model, with the prior of the values of its elements and effects."""
    return fit.log_evidence + prior_of_values(fit, fit.effects)
