"""Steps of the analyser's gain in what a model leaves over: a jump between two neighbouring points that nothing smooth explains.

The slope of the residual (of ln Z over ln f) across each interval is held against that of its neighbours. Where the residual is smooth,
slopes differ as much across short intervals as across long ones; a jump stands out, most of all where two points lie close together.
Structure that the model lacks turns the slope over several intervals and is told apart by that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.fitting.result import Fit
from motoremi.quantities import show

# Chance of a step in a sweep that has none: a complex Gaussian exceeds x medians with probability 2^(-x^2). The median of 14 intervals is
# itself known to 15 %.
FALSE_ALARM = 0.01
MEDIAN_DOUBT = 1.15
# Once the step is taken out, its neighbours have to be as quiet as others, which they are but once in a thousand.
QUIET = 3.2
# Intervals on either side that give the local median.
AROUND = 7
MOST_STEPS = 4


@dataclass(frozen=True)
class Step:
    """A step of gain.

    Parameters
    ----------
    termination : str
    below_hz, above_hz : float
        The points on either side.
    step : complex
        Change of ln Z: real part relative, imaginary part in radian.
    ratio : float
        Over what the neighbourhood's roughness would make of so short an interval.
    """

    termination: str
    below_hz: float
    above_hz: float
    step: complex
    ratio: float

    def __str__(self) -> str:
        size = f"{100 * self.step.real:+.2g} % and {np.degrees(self.step.imag):+.2g} deg"
        place = f"{self.termination} {show(self.below_hz, 'Hz', 5)} -> {show(self.above_hz, 'Hz', 5)}"
        return f"{place}: {size}, {self.ratio:.2g} times the roughness there"

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {
            "sweep": self.termination,
            "between_hz": [self.below_hz, self.above_hz],
            "real_step": self.step.real,
            "imaginary_step": self.step.imag,
            "ratio": self.ratio,
        }


def find_steps(fit: Fit) -> tuple[Step, ...]:
    """Steps in what a model leaves over, the clearest first.

    Parameters
    ----------
    fit : Fit
        The better it describes the data, the smaller the steps that show.
    """
    problem = fit.problem
    deviation = problem.deviation(fit.unknowns)
    found = [
        step
        for sweep in problem.observed.sweeps
        for step in _steps(sweep.termination, sweep.frequency_hz, deviation[problem.observed.slices[sweep.termination]])
    ]
    return tuple(sorted(found, key=lambda step: -step.ratio))


def _steps(termination: str, frequency_hz: FloatArray, deviation: ComplexArray) -> list[Step]:
    x = np.log(frequency_hz)
    left = deviation.real + 1j * np.unwrap(deviation.imag)
    found: list[Step] = []
    stands_out = MEDIAN_DOUBT * np.sqrt(np.log2(x.size / FALSE_ALARM))
    for _ in range(MOST_STEPS):
        ratio, jump = _slope_deviations(x, left)
        for index in np.argsort(-ratio):
            if ratio[index] < stands_out:
                return found
            without = left.copy()
            without[index + 1 :] -= jump[index]
            beside = [k for k in (index - 2, index - 1, index + 1, index + 2) if 0 <= k < ratio.size]
            if np.all(_slope_deviations(x, without)[0][beside] < QUIET):
                found.append(
                    Step(termination, float(frequency_hz[index]), float(frequency_hz[index + 1]), complex(jump[index]), float(ratio[index]))
                )
                left = without
                break
        else:
            return found
    return found


def _slope_deviations(x: FloatArray, y: ComplexArray) -> tuple[FloatArray, ComplexArray]:
    """For each interval: deviation of its slope from a line through its four neighbours' over the local median, and the jump that makes it."""
    width, middle = np.diff(x), 0.5 * (x[1:] + x[:-1])
    slope = np.diff(y) / width
    inner = np.arange(2, slope.size - 2)
    neighbours = inner[:, None] + np.array([-2, -1, 1, 2])
    at = middle[neighbours] - middle[inner][:, None]
    values = slope[neighbours]
    centre = at.mean(axis=1, keepdims=True)
    tilt = np.sum((at - centre) * values, axis=1) / np.sum((at - centre) ** 2, axis=1)
    deviation = np.zeros(slope.size, dtype=np.complex128)
    deviation[inner] = slope[inner] - (values.mean(axis=1) - tilt * centre[:, 0])
    size = np.abs(deviation)
    ratio = np.zeros(slope.size)
    for index in range(2, slope.size - 2):
        others = [k for k in range(max(2, index - AROUND), min(slope.size - 2, index + AROUND + 1)) if k != index]
        ratio[index] = size[index] / max(float(np.median(size[others])), 1e-300)
    return ratio, deviation * width
