"""The evidence of a circuit, integrated over the sizes of the discrepancy and of the analyser's errors.

Both sizes have wide priors on a grid; the evidence is summed over them. At each pair of sizes the circuit's parameters are integrated by
Laplace's method round a solution that was found at nearby sizes: there the objective is as good as quadratic in them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.analyser import Analyser
from motoremi.data.covariance import Sizes
from motoremi.fitting.problem import AS_DECLARED, Problem

# Relative size of what no model describes, evenly likely in its logarithm: nothing (far below any noise), then three to a decade.
DISCREPANCIES: FloatArray = np.concatenate([[AS_DECLARED.discrepancy], np.geomspace(3e-5, 1.4, 15)])
# The smallest nonzero size; a search treats it as none.
SMALLEST = float(DISCREPANCIES[1])
# A discrepancy below this is invisible to any analyser.
NOTHING_LEFT = float(DISCREPANCIES[2])
# Sizes that are this many steps of the grid apart are solved alike.
NEAR = 1
# No parameter moves further than this from one size to the next (logarithms of parameters): beyond, the objective is not quadratic.
FARTHEST = 0.5


@dataclass(frozen=True, eq=False)
class Marginal:
    """Posterior of the sizes, and evidence of the model, from one solution.

    Parameters
    ----------
    log_evidence : float
        Of the model, summed over all sizes; comparable among models of the same points.
    probabilities : ndarray, shape (discrepancies, scales)
        Posterior of the sizes.
    scales : tuple of float
        Factors on the analyser's declared errors.
    """

    log_evidence: float
    probabilities: FloatArray
    scales: tuple[float, ...]

    @property
    def of_discrepancy(self) -> FloatArray:
        """Posterior of the discrepancy, shape (discrepancies,)."""
        return self.probabilities.sum(axis=1)

    @property
    def of_scale(self) -> FloatArray:
        """Posterior of the scale of the declared errors, shape (scales,)."""
        return self.probabilities.sum(axis=0)

    @property
    def likeliest(self) -> Sizes:
        """The pair of highest posterior."""
        row, column = np.unravel_index(int(np.argmax(self.probabilities)), self.probabilities.shape)
        return Sizes(float(DISCREPANCIES[row]), self.scales[column])

    @property
    def nothing_left(self) -> float:
        """Probability that the discrepancy is too small to be shown."""
        return float(self.of_discrepancy[DISCREPANCIES <= NOTHING_LEFT].sum())

    def quantile(self, share: float) -> float:
        """Discrepancy below which this share of its posterior lies; between the points of the grid its logarithm is even."""
        below = np.concatenate([[0.0], np.cumsum(self.of_discrepancy)])
        steps = np.log(DISCREPANCIES)
        edges = np.concatenate([[steps[0]], 0.5 * (steps[1:] + steps[:-1]), [steps[-1]]])
        return float(np.exp(np.interp(share, below / below[-1], edges)))

    def to_dict(self) -> JsonDict:
        """Plain data."""
        posterior = {str(scale): column.tolist() for scale, column in zip(self.scales, self.probabilities.T, strict=True)}
        return {"log_evidence": self.log_evidence, "posterior": posterior}

    @classmethod
    def restored(cls, payload: JsonDict) -> Marginal:
        """From what `to_dict` wrote.

        Raises
        ------
        KeyError, TypeError, ValueError
            If it is not such a dictionary.
        """
        columns = {float(scale): np.array(column, dtype=np.float64) for scale, column in payload["posterior"].items()}
        probabilities = np.array(list(columns.values())).T
        if probabilities.shape != (DISCREPANCIES.size, len(columns)) or not np.isclose(probabilities.sum(), 1.0):
            raise ValueError("not a posterior of the sizes")
        return cls(float(payload["log_evidence"]), probabilities, tuple(columns))

    def settled(self, sizes: Sizes) -> bool:
        """Whether these sizes are the most probable ones, or near them."""
        likeliest = self.likeliest
        apart = abs(_step(likeliest.discrepancy) - _step(sizes.discrepancy))
        return likeliest.declared == sizes.declared and apart <= NEAR


def _step(discrepancy: float) -> int:
    return int(np.argmin(np.abs(np.log(DISCREPANCIES / discrepancy))))


def scales_of(analyser: Analyser) -> Mapping[float, float]:
    """Factors on the analyser's declared errors over which the evidence is summed, with their prior probabilities."""
    return {1.0: 1.0} if analyser.ideal else analyser.scales


def marginal(problem: Problem, u: FloatArray) -> Marginal:
    """The evidence of a model from one solution.

    Parameters
    ----------
    problem : Problem
        Of the likelihood; its sizes are those that `u` was found at.
    u : ndarray, shape (k,)
    """
    scales = scales_of(problem.measurement.analyser)
    here = problem.linearised(u[None])
    products = _products(problem, here.deviation[0], here.slopes[0] * here.chain[0][:, None])
    rows = np.array([_log_evidences(problem, u, products, scale) + np.log(prior) for scale, prior in scales.items()]).T
    rows -= np.log(len(DISCREPANCIES))
    total = float(logsumexp(rows))
    return Marginal(total, np.exp(rows - total), tuple(scales))


def log_evidences(problem: Problem, u: FloatArray, residual: ComplexArray, slopes: ComplexArray, declared: float) -> FloatArray:
    """Log evidence at every size of the discrepancy for one scale of the declared errors, shape (discrepancies,).

    Parameters
    ----------
    residual, slopes : ndarray, shapes (n,), (k, n)
        Weighted, and derivatives for the unknowns.
    """
    return _log_evidences(problem, u, _products(problem, residual, slopes), declared)


def _products(problem: Problem, residual: ComplexArray, slopes: ComplexArray) -> ComplexArray:
    return problem.observed.columns.sweep_blocks.products(np.concatenate([residual[None], slopes]), DISCREPANCIES)


def _log_evidences(problem: Problem, u: FloatArray, products: ComplexArray, declared: float) -> FloatArray:
    whitening = problem.observed.columns.whitening(declared)
    inner, analyser = whitening.with_analyser(products, u.size + 1)
    squares, gradients, matrices = inner[:, 0, 0].real, inner[:, 1:, 0].real, inner[:, 1:, 1:].real.copy()
    precision = problem.precision_at(declared)
    away = u - problem.centre
    gradients = gradients + precision * away
    priors = precision + problem.flat_precision
    index = np.arange(u.size)
    matrices[:, index, index] += priors
    scale = np.sqrt(np.maximum(matrices[:, index, index], 1e-300))
    scaled = matrices / (scale[:, :, None] * scale[:, None, :])
    scaled[:, index, index] += 1e-12
    held = ((u <= problem.low) & (gradients > 0)) | ((u >= problem.high) & (gradients < 0))
    pull = np.where(held, 0.0, gradients) / scale
    free = np.where(held[:, :, None] | held[:, None, :], 0.0, scaled)
    free[:, index, index] = scaled[:, index, index]
    step = np.linalg.solve(free, pull[..., None])[..., 0]
    far = np.max(np.abs(step / scale) * problem.own, axis=1, initial=0.0)
    share = np.minimum(1.0, FARTHEST / np.maximum(far, 1e-300))
    # Along the step the objective falls by 2 s - s^2 of what the whole step gains.
    gained = (2 * share - share**2) * np.sum(pull * step, axis=1)
    objective = squares + float(away**2 @ precision) - gained
    determinants = np.linalg.slogdet(scaled)[1] + 2 * np.sum(np.log(scale), axis=1)
    prior = np.sum(np.log(np.maximum(priors, 1e-300)))
    return -0.5 * objective - whitening.log_determinants(DISCREPANCIES) - analyser - 0.5 * determinants + 0.5 * prior
