"""Everything a fit needs to know about the data: mean sweeps, their random noise, and the analyser that made them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from motoremi.arrays import FloatArray
from motoremi.data.analyser import DEFAULT_ANALYSER, Analyser, find_analyser
from motoremi.data.noise import SCATTER_DOUBT, Noise, estimate_noise
from motoremi.data.sweep import ImpedanceSweep, RepeatedSweep, group_repeats

# What a user states, or what is taken from one sweep's scatter, is seldom better known than this.
ERROR_OF_OTHER_NOISE = 0.05


@dataclass(frozen=True, eq=False)
class Measurement:
    """Sweeps of one motor, ready to be fitted. Compared by identity, so that what is derived from one can be kept.

    Parameters
    ----------
    sweeps : tuple of RepeatedSweep
        One for each termination, the short-circuit sweep first.
    noise : tuple of Noise
        Of the mean of each.
    analyser : Analyser
    """

    sweeps: tuple[RepeatedSweep, ...]
    noise: tuple[Noise, ...]
    analyser: Analyser

    @classmethod
    def of(cls, sweeps: Iterable[ImpedanceSweep], analyser: str | None = None) -> Measurement:
        """Group repeats, estimate noise, and take the analyser from the argument, the sweeps' metadata, or the default."""
        members = list(sweeps)
        groups = tuple(group_repeats(members))
        named = analyser or next((m.metadata["analyser"] for m in members if m.metadata.get("analyser")), DEFAULT_ANALYSER)
        return cls(groups, tuple(estimate_noise(group) for group in groups), find_analyser(str(named)))

    @property
    def points(self) -> int:
        """Number of complex points."""
        return sum(sweep.frequency_hz.size for sweep in self.sweeps)

    @property
    def terminations(self) -> tuple[str, ...]:
        """Which sweeps there are."""
        return tuple(sweep.termination for sweep in self.sweeps)

    @property
    def floor_percent(self) -> float:
        """Noise floor: what |Z_model/Z_measured - 1| would be, rms in percent, were the model perfect."""
        sigma: FloatArray = np.concatenate([noise.sigma for noise in self.noise])
        return float(100 * np.sqrt(np.mean(2 * sigma**2)))

    @property
    def noise_error(self) -> float:
        """Relative standard deviation of the noise's variance, averaged over all points."""
        if any(noise.source != "repeats" for noise in self.noise):
            return ERROR_OF_OTHER_NOISE
        # Each repeat beyond the first gives two real numbers a point.
        return float(np.sqrt(2 / sum(2 * sweep.frequency_hz.size * (sweep.repeats - 1) for sweep in self.sweeps)))

    @property
    def doubt(self) -> float:
        """Factor by which the variance of the noise may be larger than estimated: 1 where repeats or the user vouch for it."""
        return SCATTER_DOUBT if any(noise.source == "scatter" for noise in self.noise) else 1.0

    def caveats(self) -> list[str]:
        """What a reader has to know about the noise and the sweeps, in words."""
        remarks = []
        for sweep, noise in zip(self.sweeps, self.noise, strict=True):
            if noise.source == "scatter":
                remarks.append(
                    f"only one {sweep.termination} sweep: its noise is taken from its own scatter, which misses slow drift; repeat it three times"
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
