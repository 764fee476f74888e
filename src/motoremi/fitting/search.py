"""The search for solutions: ants, start values, continuation in frequency, and the final refinement (`arrive`) of each.

The search uses the residual `log` on few points, which has fewer local minima; the result is that of the likelihood. The sizes of the
discrepancy and of the analyser's errors are found by iteration: a solution at one pair of sizes gives a more probable pair, until both
agree.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np

from motoremi.arrays import FloatArray, JsonDict, Progress
from motoremi.data.covariance import LEAST_SHARE, ROUGH_SHARE, Sizes
from motoremi.data.measurement import Measurement
from motoremi.fitting import wandering
from motoremi.fitting.aco_r import Colony, scattered
from motoremi.fitting.marginal import NOTHING_LEFT, SMALLEST, Marginal, marginal
from motoremi.fitting.observed import OUT_OF_SIGHT
from motoremi.fitting.polish import Polished, Precision, polish, sharpened
from motoremi.fitting.problem import AS_DECLARED, Problem
from motoremi.fitting.starts import data_driven_starts, frames_across_the_band, starts_without_ca
from motoremi.model.motor import Motor

# Points a sweep for searching; the arrival uses all.
SEARCH_POINTS = 48
# Points a sweep for finding the sizes.
ARRIVAL_POINTS = 100
# How many start values at least go on up the band.
FOLLOWED = 6
GENERATIONS = 12
ROUNDS = 3
# Another round of ants follows if the last one reduced the error by this share.
WORTH_A_ROUND = 0.05
# Of the residual `log`.
ROUGH = Precision(1e-7, 1e-4)
# Start values drawn from the whole ranges if there is only the open-circuit sweep, from which none are computed: it does not show what belongs to
# the winding and what to the path to the frame, and has many minima. Of five motors with an effect the ants alone missed the least error of two, by
# a factor of 1.2 and of 15; 300 starts found all, in 0.3 s.
SCATTERED = 300
# Where sharpening a solution lowers the objective by more than this, its evidence is computed anew.
CURVED = 0.1
# When a polish by the likelihood has converged as far as its sizes are concerned.
CLOSE = Precision(0.05, 1e-4)
# First damping close to the solution, where the linear model is valid.
WARM = 1e-6
# Largest number of iterations of the sizes.
MOST_SIZES = 5
# Steps of a polish on the way; of one of a model that leaves more than a per cent, where only its evidence is asked for.
STEPS, POOR_STEPS = 60, 20
# Discrepancy of the likelihood during a search. In tests 0.001 to 0.01 led to the same solutions.
LITTLE_LEFT = 3e-3
# Where more than a per cent is undescribed, a likelihood would fit what happens to be easy: every point counts alike instead. Likewise where the
# analyser's errors would have to be ten times those declared: they could absorb a motor.
PLAIN = 1e-2
ABSORBING = 10.0
# White noise that is added at first where the analyser may err by so much, and taken away in stages: its errors are then found before every
# point is to be met.
BLURS = (0.3, 0.03)
# Beyond twice what is declared, the analyser's errors may have absorbed what is sought.
MOST_DECLARED = 2.0
# In standard deviations, twice the specification: the largest of a dozen errors within specification does not exceed it by chance.
BEYOND_SIGMA = 6.0
# A circuit comes closer if its error is less than this share of another's: half, as for an effect that is to be named. A smaller difference could
# come from other values of the same elements, which describe the analyser's smooth errors.
CLOSER = 0.5
# Odds of 150 to 1 in log evidence: as much as a parameter at a bound costs.
AS_PROBABLE = 5.0


@dataclass(frozen=True)
class Task:
    """What is to be fitted: a motor's circuit to a measurement, within bounds, some parameters held.

    Sweeps of many thousand points are averaged for search and evidence; errors are shown of all points. Parameters that are `swept` are not
    varied either, but each start keeps its own value.
    """

    motor: Motor
    measurement: Measurement
    bounds: Mapping[str, tuple[float, float]]
    held: Mapping[str, float]
    swept: tuple[str, ...] = ()

    def sweeping(self, name: str) -> Task:
        """The same with one parameter that keeps the value of each start instead of being held."""
        return dataclasses.replace(self, held={own: value for own, value in self.held.items() if own != name}, swept=(*self.swept, name))

    @property
    def _problem(self) -> partial[Problem]:
        return partial(Problem, self.motor, self.measurement.coarse, self.bounds, self.held, swept=self.swept)

    def relative(self) -> Problem:
        """The relative error over all points."""
        return self._problem(weights="relative")

    def thinned(self, points: int | None, highest_hz: float = np.inf) -> Problem:
        """The search problem on about `points` points a sweep."""
        return self._problem(points=points, weights="log", highest_hz=highest_hz)

    def likelihood(self, points: int | None = None, sizes: Sizes = AS_DECLARED, least_share: float = LEAST_SHARE, blur: float = 0.0) -> Problem:
        """The likelihood on all points, or on about `points` points a sweep."""
        return self._problem(points=points, sizes=sizes, least_share=least_share, blur=blur)


@dataclass(frozen=True)
class Solution:
    """The result of a search, as plain data, which may come from another process.

    Parameters
    ----------
    values : dict
        Parameters and nuisances in SI units.
    sizes : Sizes
        Of the likelihood that it solves.
    marginal : Marginal
    converged : bool
    evaluations : int
    rough : bool
        Whether its evidence is `rough`, which on few points is not to be held against that of a likelihood.
    likeliest : dict
        Parameters and nuisances of the likelihood's own solution, if `values` are those of the least relative error: it may be another local
        minimum.
    searched : dict
        Values that a race had reached with equal weights of the points, before the likelihood: near the least relative error.
    """

    values: dict[str, float]
    sizes: Sizes
    marginal: Marginal
    converged: bool
    evaluations: int
    rough: bool = False
    likeliest: Mapping[str, float] = field(default_factory=dict)
    searched: Mapping[str, float] = field(default_factory=dict)

    @property
    def log_evidence(self) -> float:
        """Of its model."""
        return self.marginal.log_evidence


@dataclass(frozen=True)
class Found:
    """A solution on all points, and the best of the search on the way there.

    Parameters
    ----------
    solution : Solution
    history : tuple of dict
    searched : dict
        Parameters of the best solution of the search problem, SI units: where the next effect starts from.
    """

    solution: Solution
    history: tuple[JsonDict, ...]
    searched: dict[str, float]


def arrive(
    task: Task,
    starts: Sequence[Mapping[str, float]],
    points: int | None = None,
    most: int = MOST_SIZES,
    sizes: Sizes | None = None,
    steps: int = STEPS,
) -> Solution:
    """From start values near a solution to the solution, at the sizes that are the most probable with it.

    Parameters
    ----------
    starts : sequence of mapping
        In SI units, each near its own local minimum.
    points : int, optional
        About so many a sweep; all by default.
    most : int
        Largest number of iterations of the sizes.
    sizes : Sizes, optional
        To begin with; by default the most probable ones with the start values.
    steps : int
        Of each polish.
    """
    problem = task.likelihood(points, sizes or AS_DECLARED, ROUGH_SHARE)
    u = problem.vectors(starts)
    evaluations = 0
    if sizes is None:
        if poorly_seen(problem):
            softened = u
            for blur in BLURS:
                ends = polish(task.likelihood(points, AS_DECLARED, ROUGH_SHARE, blur), softened, iterations=steps, precision=CLOSE)
                softened, evaluations = ends.distinct(2), evaluations + ends.evaluations
            u = np.concatenate([u, softened])
        looks = [marginal(problem, row) for row in u]
        sizes = max(looks, key=lambda look: look.log_evidence).likeliest
    best: tuple[FloatArray, Sizes, Marginal, bool] | None = None
    for _ in range(most):
        problem = task.likelihood(points, sizes, ROUGH_SHARE)
        ends = polish(problem, u, iterations=steps, precision=CLOSE, damping=WARM if best else 1e-3)
        evaluations += ends.evaluations
        u = ends.distinct(2)
        found = [(row, sizes, marginal(problem, row), bool(ends.converged[ends.best])) for row in u]
        here = max(found, key=lambda one: one[2].log_evidence)
        previous = best
        if best is None or here[2].log_evidence > best[2].log_evidence:
            best = here
        if here[2].settled(sizes) or (previous is not None and here[2].likeliest == previous[1]):
            break
        sizes = here[2].likeliest
    assert best is not None
    values, at, found_marginal, converged = best
    problem = task.likelihood(points, at)
    return Solution(problem.named(values), at, found_marginal, converged, evaluations)


def poorly_seen(problem: Problem) -> bool:
    """Whether the analyser may err by a large part of Z (the first of `BLURS`) at some points: a resonance there may move by its width."""
    return float(np.max(problem.observed.systematic)) > BLURS[0]


def arrived_on_all(
    task: Task,
    starts: Sequence[Mapping[str, float]],
    sizes: Sizes | None = None,
    searched: Mapping[str, float] | None = None,
    wanders: bool = True,
) -> Solution:
    """`arrive` on all points, to the last digit; if the model errs by much, the least relative error instead, also started from `searched`.

    Without `sizes`, which are those of a similar solution, on few points first: there each step costs a fifth.

    Parameters
    ----------
    wanders : bool
        Whether the evidence of the least relative error may be that of an error that wanders (`rough`). Such an evidence takes the analyser for an
        ideal one, so it is not held against that of a model which describes everything with its fixture: with 30 nH of leads to a NanoVNA up to
        900 MHz, a resonance beyond the band was ahead of all by e^140, with 2.5 times the specification.
    """
    also = [*starts, searched] if searched else starts
    if sizes is None:
        near = arrive(task, starts, ARRIVAL_POINTS)
        solution = arrive(task, [near.values], sizes=near.marginal.likeliest)
        solution = dataclasses.replace(solution, evaluations=solution.evaluations + near.evaluations)
    else:
        poor = sizes.discrepancy >= PLAIN
        solution = arrive(task, starts, sizes=sizes, most=2 if poor else MOST_SIZES, steps=POOR_STEPS if poor else STEPS)
        if poor and solution.sizes.discrepancy < PLAIN:
            solution = arrive(task, [solution.values], sizes=solution.marginal.likeliest)
    if solution.marginal.likeliest.declared >= ABSORBING > solution.sizes.declared:
        # The sizes at which the steps ended need not be the most probable ones: a bead's circuit erred by 15 % with three times the errors of a
        # NanoVNA, while thirty times were more probable by e^890, and by 2.2 % with equal weights of the points.
        solution = dataclasses.replace(solution, sizes=solution.marginal.likeliest)
    if misses_by_far(solution.sizes):
        return least_relative(task, solution, also, wanders)
    if solution.sizes.discrepancy == SMALLEST:
        # Next to no discrepancy and none at all are neighbours on the grid, but the elements may differ by many error bars.
        solution = _continued(task, solution, Sizes(AS_DECLARED.discrepancy, solution.sizes.declared))
    if not solution.converged:
        solution = _continued(task, solution, solution.sizes)
    # The most probable pair of sizes may be the neighbour of the one at which the search ended.
    sizes = solution.marginal.likeliest if solution.marginal.settled(solution.sizes) else solution.sizes
    problem = task.likelihood(None, sizes)
    reached = problem.vector(solution.values)
    u, evaluations = sharpened(problem, reached)
    before, after = problem.objective(np.array([reached, u]))
    # The evidence of a solution includes what a step to the minimum gains, but not along a curve.
    found = marginal(problem, u) if before - after > CURVED else solution.marginal
    sharp = Solution(problem.named(u), sizes, found, solution.converged, solution.evaluations + evaluations, searched=solution.searched)
    beyond = problem.analyser_sigma(u) > BEYOND_SIGMA
    # Of the paper's circuit it stays open what describes the rest; an effect is there to describe it by the circuit.
    if sharp.marginal.nothing_left >= 0.5 and not (beyond and task.motor.effects):
        return sharp
    # The undescribed part may not be smooth: models are comparable only if both descriptions were tried for each.
    plain = least_relative(task, sharp, also, wanders)
    # Errors of the analyser far beyond its specification are not accepted if the circuit alone comes closer.
    absorbed = beyond and _comes_closer(task, plain, sharp)
    if sharp.marginal.nothing_left >= 0.5 and not absorbed:
        return sharp
    if absorbed or plain.log_evidence > sharp.log_evidence:
        return plain
    # Within its specification it may absorb as much: of two minima that are about as probable the one with the smaller circuit error is taken.
    closer = arrive(task, [plain.values], sizes=sizes, most=2)
    alike = closer.log_evidence > sharp.log_evidence - AS_PROBABLE and _comes_closer(task, closer, sharp)
    # A gain of less than one in log evidence is none: the sharpened solution stays.
    return closer if alike or closer.log_evidence > sharp.log_evidence + 1 else sharp


def _continued(task: Task, solution: Solution, sizes: Sizes) -> Solution:
    """A solution after further steps at these sizes, if that is more probable."""
    return max(arrive(task, [solution.values], sizes=sizes, most=1), solution, key=lambda one: one.log_evidence)


def _comes_closer(task: Task, one: Solution, other: Solution, share: float = CLOSER) -> bool:
    """Whether the relative error of one circuit alone is less than a share of another's."""
    relative = task.relative()
    errors = relative.objective(relative.vectors([one.values, other.values]))
    return bool(errors[0] < share**2 * errors[1])


def misses_by_far(sizes: Sizes) -> bool:
    """Whether a model is fitted by its relative error, with equal weights of all points."""
    return sizes.discrepancy >= PLAIN or sizes.declared >= ABSORBING


def rough(found: Marginal, problem: Problem, u: FloatArray) -> Marginal:
    """The same, if that is more probable, for an error that wanders along frequency instead of being smooth, with equal weights of the points.

    A circuit that misses a sharp resonance errs by different amounts from one point to the next, which no smooth discrepancy describes.

    Parameters
    ----------
    problem : Problem
        Of weights `log` or `relative`.
    u : ndarray, shape (k,)
    """
    observed = problem.observed
    kept = observed.weight > 1 / OUT_OF_SIGHT
    if not kept.any():
        return found
    ends = np.cumsum([0, *(np.count_nonzero(kept[sweep]) for sweep in observed.slices.values())])
    sweeps = [slice(int(a), int(b)) for a, b in pairwise(ends)]
    residual, systematic = problem.residual(u), 0.5 * observed.systematic**2
    likelihood = wandering.log_likelihood(residual[kept], observed.frequency_hz[kept], observed.variance[kept], systematic[kept], sweeps)
    evidence = likelihood - 0.5 * len(problem.unknowns) * np.log(2 * np.count_nonzero(kept))
    return dataclasses.replace(found, log_evidence=max(found.log_evidence, float(evidence)))


def least_relative(task: Task, solution: Solution, starts: Sequence[Mapping[str, float]], wanders: bool = True) -> Solution:
    """The same with the circuit that has the least relative error over all points, assuming an ideal analyser."""
    logarithmic, problem = task.thinned(None), task.relative()
    near = polish(logarithmic, logarithmic.vectors([solution.values, *starts]), iterations=100, precision=ROUGH)
    ends = polish(problem, problem.vectors([logarithmic.named(row) for row in near.distinct(3)]), iterations=100, precision=ROUGH)
    if not ends.converged[ends.best]:  # along a curved minimum: the error of a core on a NanoVNA was 18 % after 100 steps, 3.6 % after these
        ends = ends.joined(polish(problem, ends.u[[ends.best]], iterations=400, precision=ROUGH))
    found = _relative(task, problem, ends, solution.sizes, solution.marginal, solution.evaluations, wanders)
    return dataclasses.replace(found, likeliest=solution.values)


def relative_solution(task: Task, ends: Polished, sizes: Sizes) -> Solution:
    """The circuit of the least relative error as a solution; that of the likelihood if it errs by little.

    Parameters
    ----------
    ends : Polished
        Of the relative error over all points.
    sizes : Sizes
        To begin with: those of a model that leaves more.
    """
    problem = task.relative()
    likelihood = task.likelihood(None, sizes)
    found = marginal(likelihood, likelihood.vector(problem.named(ends.u[ends.best])))
    if not misses_by_far(found.likeliest):
        return arrived_on_all(task, [problem.named(ends.u[ends.best])])
    return _relative(task, problem, ends, found.likeliest, found, 0)


def _relative(task: Task, problem: Problem, ends: Polished, sizes: Sizes, found: Marginal, evaluations: int, wanders: bool = True) -> Solution:
    likelihood = task.likelihood(None, sizes)
    u = likelihood.vector(problem.named(ends.u[ends.best]))
    return Solution(
        likelihood.named(u),
        sizes,
        rough(found, problem, ends.u[ends.best]) if wanders else marginal(likelihood, u),
        bool(ends.converged[ends.best]),
        evaluations + ends.evaluations,
    )


def search_base(task: Task, seed: int, progress: Progress | None = None) -> Found:
    """The paper's circuit: start values from the data first, then rounds of ants until everything is described or a round gains nothing."""
    search, full = task.thinned(SEARCH_POINTS), task.thinned(None)
    seeds = search.vectors(data_driven_starts(task.measurement.coarse))
    open_alone = task.measurement.terminations == ("open",)
    first = scattered(search, np.random.default_rng(seed), SCATTERED) if open_alone else seeds
    if not task.measurement.on_the_same_frequencies:
        first = search.vectors([*data_driven_starts(task.measurement.coarse), *starts_without_ca(task.measurement.coarse)])
    colony: Colony | None = None
    best: Solution | None = None
    searched: dict[str, float] = {}
    least = np.inf
    evaluations = 0
    history: list[JsonDict] = []
    # At this objective only noise and analyser errors remain; the likelihood decides whether it is the right minimum.
    likely = 2 * search.observed.expected_objective
    for round_number in range(ROUNDS + 1):
        if progress is not None:
            progress(f"ants, round {round_number}" if round_number else "start values from the data", round_number, ROUNDS + 1)
        if round_number == 0:
            if not len(first):
                continue
            candidates = first
        else:
            if colony is None:
                colony = Colony(search, np.random.default_rng(seed), seeds)
            done = colony.evaluations
            for index, mean_square in enumerate(colony.walk(GENERATIONS)):
                count = evaluations + (index + 1) * (colony.evaluations - done) // GENERATIONS
                history.append({"evaluations": count, "rms_deviation_percent": 100 * float(np.sqrt(mean_square))})
            evaluations += colony.evaluations - done
            candidates = colony.different(8)
        rough = polish(search, candidates, iterations=40, precision=ROUGH, enough=likely)
        if round_number > 0 and rough.objective[rough.best] > likely:
            rough = rough.joined(climb(task, search, candidates))
        evaluations += rough.evaluations
        before, now = least, float(rough.objective[rough.best])
        if now < least:
            searched, least = search.named(rough.u[rough.best]), now
        # On few points noise may favour a wrong minimum: unless the first result is clear, the likelihood chooses among several.
        count = 1 if round_number == 0 and least < likely else 3
        found = arrived_on_all(task, [search.named(row) for row in rough.distinct(count)])
        evaluations += found.evaluations
        if best is None or _better(task, found, best):
            best = found
        mean_square = float(np.mean(np.abs(full.deviation(full.vector(best.values))) ** 2))
        history.append({"evaluations": evaluations, "rms_deviation_percent": 100 * float(np.sqrt(mean_square))})
        described = best.sizes.discrepancy <= NOTHING_LEFT and best.sizes.declared <= MOST_DECLARED
        if described or (round_number > 0 and now > (1 - WORTH_A_ROUND) * before):
            break
    assert best is not None
    leaves_a_little = NOTHING_LEFT < best.sizes.discrepancy < (np.inf if task.measurement.analyser.by_waves else PLAIN)
    if (leaves_a_little or not task.measurement.on_the_same_frequencies) and best.values.keys() >= {"Cr", "Cf", "Lr", "Rr"}:
        found = _frames_tried(task, best)
        evaluations += found.evaluations
        # If these leave an error too, something is missing in the circuit, and the one that errs least was chosen before.
        leaves_little = found.sizes.discrepancy < PLAIN and found.sizes.declared <= MOST_DECLARED
        if leaves_little and found.log_evidence > best.log_evidence:
            best, searched = found, {name: found.values[name] for name in searched}
    return Found(dataclasses.replace(best, evaluations=evaluations), tuple(history), searched)


def _frames_tried(task: Task, best: Solution) -> Solution:
    """By the likelihood from the beginning, from paths to the frame whose resonances are spread over the band.

    A network analyser measures impedances far from its reference inaccurately, and a fixture without compensation changes them: the error of the
    circuit alone, which the search minimises, then has its minimum at wrong elements. So it may for an impedance analyser if hardly anything of
    the path to the frame is seen: of an air coil whose frame resonates beyond the band a branch of 1 MOhm left 0.76 %, and the right one 0.04 %.
    """
    bases = [best.values, *({**best.values, **start} for start in data_driven_starts(task.measurement.coarse)[:1])]
    starts, evaluations = _other_frames(task, bases, best.values, any_end=task.measurement.analyser.by_waves)
    if not starts:
        return dataclasses.replace(best, evaluations=evaluations)
    found = arrived_on_all(task, starts)
    return dataclasses.replace(found, evaluations=found.evaluations + evaluations)


def other_frames(task: Task, values: Mapping[str, float]) -> list[dict[str, float]]:
    """Start values of a model with effects on another path to the frame, if the likelihood ends clearly higher there; few, or none.

    Of a capacitor to the frame the fit had all of the motor's capacitance to the frame in Cf, with a branch of 16 kOhm. A choke at the brushes
    beside it, from there, was less probable by e^220 than with the right path.
    """
    if not {"Cr", "Cf", "Lr", "Rr"} <= values.keys() - task.held.keys():
        return []
    return _other_frames(task, [values], values)[0]


def _other_frames(
    task: Task, bases: Sequence[Mapping[str, float]], values: Mapping[str, float], any_end: bool = False
) -> tuple[list[dict[str, float]], int]:
    """Ends on few points from paths to the frame all over the band, if the best one is clearly better than from `values`; evaluations.

    With `any_end` they are not compared. On all points, which take three times as long, none would be clearly better if none is here.
    """
    starts = [start for base in bases for start in frames_across_the_band(base, task.measurement)]
    problem = task.likelihood(ARRIVAL_POINTS, Sizes(LITTLE_LEFT, 1.0), ROUGH_SHARE)
    ends = polish(problem, problem.vectors(starts), iterations=40, precision=CLOSE)
    evaluations = ends.evaluations
    if not any_end:
        own = polish(problem, problem.vectors([values]), iterations=40, precision=CLOSE)
        evaluations += own.evaluations
        if ends.objective[ends.best] > own.objective[own.best] - 2 * AS_PROBABLE:
            return [], evaluations
    return [problem.named(row) for row in ends.distinct(3)], evaluations


def _better(task: Task, one: Solution, other: Solution) -> bool:
    """Whether one base fit is to be preferred: the more probable one, but of two that err by much the one with the smaller relative error."""
    if misses_by_far(one.sizes) and misses_by_far(other.sizes):
        return _comes_closer(task, one, other, share=1.0)
    return one.log_evidence > other.log_evidence


def climb(task: Task, search: Problem, starts: FloatArray) -> Polished:
    """Fit the low end of the band first and raise its upper edge, so that a wrong resonance at high frequency has no influence at first."""
    lowest, highest = float(search.observed.frequency_hz.min()), float(search.observed.frequency_hz.max())
    u, evaluations = starts, 0
    for share in (0.36, 0.5, 0.63, 0.75, 0.88):
        part = task.thinned(60, lowest * (highest / lowest) ** share)
        stage = polish(part, u, iterations=25, precision=Precision(1e-6, 1e-3))
        evaluations += stage.evaluations
        u = stage.u[np.argsort(stage.objective)[: max(FOLLOWED, len(u) // 2)]]
    last = polish(search, u, iterations=40, precision=ROUGH)
    return dataclasses.replace(last, evaluations=last.evaluations + evaluations)
