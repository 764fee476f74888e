"""The data of a fit: mean sweeps, their random noise, and the error model of the analyser."""

from __future__ import annotations

import dataclasses
import uuid
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary, WeakValueDictionary

import numpy as np

from motoremi.arrays import BoolArray, FloatArray
from motoremi.data.analyser import Analyser
from motoremi.data.coarse import coarse
from motoremi.data.conditions import Condition, SingleValue
from motoremi.data.declaration import declared_analyser, is_compensated
from motoremi.data.mislabelled import label_remarks, without_mislabelled
from motoremi.data.moved import at_average_leads
from motoremi.data.noise import Noise, estimate_noise, rms_percent
from motoremi.data.quantity import Quantity
from motoremi.data.sweep import ImpedanceSweep, RepeatedSweep, Termination, group_repeats, same_frequencies
from motoremi.errors import BadInput

# Discrepancy that is accepted if no accuracy is stated: no impedance analyser is specified better.
GOOD_ENOUGH_PERCENT = 0.1
# Relative standard deviation given to a point that is to have no weight.
NO_WEIGHT = 1.0


@dataclass(frozen=True, eq=False)
class Conditioned:
    """The repeats of one termination under one condition.

    Parameters
    ----------
    condition : Condition
    sweep : RepeatedSweep
    noise : Noise
        Of its mean.
    """

    condition: Condition
    sweep: RepeatedSweep
    noise: Noise


@dataclass(frozen=True, eq=False)
class Measurement:
    """Sweeps of one motor, ready to be fitted. Compared by identity, so that derived values can be cached.

    Parameters
    ----------
    sweeps : tuple of RepeatedSweep
        One for each termination, the short-circuit sweep first.
    noise : tuple of Noise
        Of the mean of each.
    analyser : Analyser
    accuracy_percent : float, optional
        Accuracy that the owner of the data states: a model with a smaller error is good enough.
    conditioned : tuple of Conditioned
        Sweeps under a condition, in the order in which the conditions were measured, the short-circuit sweep first.
    values : tuple of SingleValue
        Values from other meters.
    mislabelled : tuple of str
        Termination of each repeat that is not used because it is the other termination's sweep again.
    remark : str
        Why `analyser` is not the one that was declared; empty if it is.
    """

    sweeps: tuple[RepeatedSweep, ...]
    noise: tuple[Noise, ...]
    analyser: Analyser
    accuracy_percent: float | None = None
    conditioned: tuple[Conditioned, ...] = ()
    values: tuple[SingleValue, ...] = ()
    mislabelled: tuple[Termination, ...] = ()
    remark: str = ""

    @classmethod
    def of(cls, sweeps: Iterable[ImpedanceSweep], analyser: str | None = None, values: Iterable[SingleValue] = ()) -> Measurement:
        """Group repeats, estimate noise, and take the analyser from the argument, the sweeps' metadata, or the default.

        A fit uses the sweeps without a condition; a diagnosis also uses those under a condition, which are kept in `conditioned`.
        """
        given = list(sweeps)
        members = [sweep for sweep in given if sweep.condition is None]
        if given and not members:
            raise BadInput("every sweep is under a condition: also give sweeps of the motor as it is, without a condition")
        kept, mislabelled = without_mislabelled(group_repeats(members))
        conditioned = [sweep for sweep in given if sweep.condition is not None]
        chosen, remark = declared_analyser(members, analyser, conditioned)
        stated = [float(m.metadata["accuracy_percent"]) for m in members if m.metadata.get("accuracy_percent")]
        compensated = all(is_compensated(sweep) for sweep in members)
        groups = tuple(at_average_leads(group, chosen.quantity) for group in kept)
        return cls(
            groups,
            tuple(estimate_noise(group, chosen.quantity) for group in groups),
            chosen.with_compensated_fixture() if compensated else chosen,
            max(stated) if stated else None,
            _by_condition(conditioned, chosen.quantity),
            tuple(values),
            mislabelled,
            remark,
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """A measurement that is sent to another process repeatedly is one object there, so that what is derived from it is cached there too."""
        token = _tokens.setdefault(self, uuid.uuid4().hex)
        _known[token] = self
        return _arrived, (token, *(getattr(self, own.name) for own in dataclasses.fields(self)))

    @property
    def points(self) -> int:
        """Number of complex points."""
        return sum(sweep.frequency_hz.size for sweep in self.sweeps)

    @property
    def terminations(self) -> tuple[str, ...]:
        """Terminations of the sweeps."""
        return tuple(sweep.termination for sweep in self.sweeps)

    @property
    def on_the_same_frequencies(self) -> bool:
        """Whether all sweeps were measured at the same frequencies."""
        first = self.sweeps[0].frequency_hz
        return all(same_frequencies(first, sweep.frequency_hz) for sweep in self.sweeps)

    @property
    def done(self) -> frozenset[str]:
        """Measurements of the menu that these data contain: conditions and single values."""
        return frozenset({one.condition.id for one in self.conditioned} | {one.name for one in self.values})

    @cached_property
    def noise_percent(self) -> float:
        """Rms of |Z_model/Z_measured - 1| that random noise alone would cause with a correct model, in percent."""
        return rms_percent(noise.variance[noise.regular] for noise in self.noise)

    @cached_property
    def floor_percent(self) -> float:
        """The floor: the same error, caused by noise and by the analyser's errors within its specification."""
        return rms_percent(0.5 * floor[noise.regular] ** 2 for floor, noise in zip(self.floors, self.noise, strict=True))

    @cached_property
    def floors(self) -> tuple[FloatArray, ...]:
        """The floor at each point of each sweep, as a ratio, shape (n,)."""
        pairs = zip(self.sweeps, self.noise, strict=True)
        return tuple(np.sqrt(2 * noise.variance + self.analyser.uncertainty(sweep.frequency_hz, sweep.mean_ohm) ** 2) for sweep, noise in pairs)

    @property
    def good_enough_percent(self) -> float:
        """Accepted discrepancy in percent: the accuracy that the owner states, or `GOOD_ENOUGH_PERCENT`."""
        return self.accuracy_percent if self.accuracy_percent is not None else GOOD_ENOUGH_PERCENT

    @property
    def scale_sigma(self) -> float:
        """Standard deviation of a relative error that all impedances have in common; it shows in the elements and not in the fit.

        That of the analyser, or of the accuracy that the owner states: a bound, within which all values are as likely (JCGM 100:2008, 4.3.7).
        """
        return max(self.analyser.standard_sigma, (self.accuracy_percent or 0.0) / 100 / np.sqrt(3))

    @cached_property
    def coarse(self) -> Measurement:
        """The measurement with sweeps of many points averaged (`data.coarse`), for search and evidence; itself if there is none."""
        pairs = [coarse(sweep, noise, self.analyser.step_frequencies_hz) for sweep, noise in zip(self.sweeps, self.noise, strict=True)]
        if all(sweep is own for (sweep, _), own in zip(pairs, self.sweeps, strict=True)):
            return self
        return dataclasses.replace(self, sweeps=tuple(sweep for sweep, _ in pairs), noise=tuple(noise for _, noise in pairs))

    def with_analyser(self, analyser: Analyser) -> Measurement:
        """The same sweeps with the error model of another analyser, and their noise as that one has it; points without weight stay so."""
        if analyser.quantity == self.analyser.quantity:
            return dataclasses.replace(self, analyser=analyser)
        noise = [
            _without(estimate_noise(sweep, analyser.quantity), before.sigma == NO_WEIGHT)
            for sweep, before in zip(self.sweeps, self.noise, strict=True)
        ]
        conditioned = [dataclasses.replace(one, noise=estimate_noise(one.sweep, analyser.quantity)) for one in self.conditioned]
        return dataclasses.replace(self, analyser=analyser, noise=tuple(noise), conditioned=tuple(conditioned))

    def with_outliers(self, outliers: Mapping[str, BoolArray]) -> Measurement:
        """The same sweeps with points, by termination, that have no weight."""
        changed = [
            _without(noise, outliers[sweep.termination]) if sweep.termination in outliers else noise
            for sweep, noise in zip(self.sweeps, self.noise, strict=True)
        ]
        return dataclasses.replace(self, noise=tuple(changed))

    def copies(self) -> list[str]:
        """Remarks on sweeps that were given more than once."""
        return [
            f"{sweep.copies + sweep.repeats} {sweep.termination} sweeps hold the readings of only {sweep.repeats}: a copy shows no noise and "
            "is left out; a repeat is the measurement done once more"
            for sweep in (*self.sweeps, *(one.sweep for one in self.conditioned))
            if sweep.copies
        ]

    def caveats(self) -> list[str]:
        """Remarks for the report about the noise and the sweeps."""
        remarks = [*([self.remark] if self.remark else []), *self.copies(), *label_remarks(self.sweeps)]
        for sweep, noise in zip(self.sweeps, self.noise, strict=True):
            if noise.source == "scatter":
                left = " is left" if sweep.left_out else ""
                remarks.append(
                    f"only one {sweep.termination} sweep{left}: its noise is taken from its own scatter, which misses slow drift; repeat it three "
                    "times"
                )
        if len(self.sweeps) == 1:
            missing = "open" if self.terminations == ("short",) else "short"
            remarks.append(f"no {missing} sweep: effects cannot be located, and not all seven elements can be known")
        else:
            first, second = (sweep.frequency_hz for sweep in self.sweeps)
            if first[0] > second[-1] or second[0] > first[-1]:
                remarks.append("the two sweeps do not overlap in frequency: they cannot check each other")
            elif not np.isclose(first[0], second[0], rtol=0.05) or not np.isclose(first[-1], second[-1], rtol=0.05):
                remarks.append("the two sweeps have different spans: each is judged over its own")
        return remarks


# Measurements that were sent to other processes or came from them, by a token that is the same everywhere.
_known: WeakValueDictionary[str, Measurement] = WeakValueDictionary()
_tokens: WeakKeyDictionary[Measurement, str] = WeakKeyDictionary()


def _arrived(token: str, *own: Any) -> Measurement:
    """The measurement with that token; made from its parts when it is received for the first time."""
    measurement = _known.get(token)
    if measurement is None:
        measurement = _known[token] = Measurement(*own)
        _tokens[measurement] = token
    return measurement


def _by_condition(sweeps: list[ImpedanceSweep], quantity: Quantity | None) -> tuple[Conditioned, ...]:
    found: list[Conditioned] = []
    for condition in dict.fromkeys(sweep.condition for sweep in sweeps):
        try:
            groups = group_repeats(sweep for sweep in sweeps if sweep.condition == condition)
        except BadInput as error:
            raise BadInput(f"{condition}: {error}") from error
        if condition is not None:
            still = [at_average_leads(group, quantity) for group in groups]
            found += [Conditioned(condition, group, estimate_noise(group, quantity)) for group in still]
    return tuple(found)


def _without(noise: Noise, points: BoolArray) -> Noise:
    if not points.any():
        return noise
    known = points if noise.outliers is None else points | noise.outliers
    return dataclasses.replace(noise, sigma=np.where(points, NO_WEIGHT, noise.sigma), outliers=known)
