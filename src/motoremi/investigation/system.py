"""The least-squares problem of new data and what is known, round one point, with the integral of the likelihood over all unknowns.

Unknown are the model's parameters, the response numbers of a condition, the analyser's smooth errors, and what no model describes of the change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np

from motoremi.arrays import BoolArray, FloatArray, IntArray
from motoremi.fitting.polish import GENTLE
from motoremi.fitting.problem import AHEAD
from motoremi.investigation.known import NEARLY_SINGULAR, Known, Learnt, solved, within

# In the corner of a matrix whose root has the misfit: more than any misfit that a solution can gain.
LARGE = 1e6
# Size of what no model describes, and shares of the unpredictable changes of elements and of effects.
Scale: TypeAlias = tuple[float, float, float]


class Prediction(Protocol):
    """The common interface of `Outcome` and `ValueOutcome`."""

    @property
    def size(self) -> int:
        """Number of response numbers."""

    @property
    def moving(self) -> BoolArray:
        """The model's unknowns on which it depends by more than a little, shape (k,)."""

    @property
    def elsewhere(self) -> bool:
        """Whether the circuit or span differs from that of the fit."""

    @property
    def unpredicted(self) -> IntArray:
        """Which response numbers belong to changes that cannot be predicted, shape (size,): 1 of an element, 2 of an effect, 0 elsewhere."""

    @property
    def sigma(self) -> FloatArray:
        """White noise of each number, shape (n,)."""

    @property
    def density(self) -> float:
        """Logarithm of what turns a density of these numbers into one of ln Z; 0 where they are that."""

    @property
    def smooth(self) -> FloatArray:
        """Columns, shape (p, n), of what no model describes, for a size of one."""

    @property
    def errors(self) -> FloatArray:
        """Columns, shape (p, n), of the analyser's smooth errors."""

    def at(self, u: FloatArray, eta: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Prediction and its derivatives for the model's unknowns and for the response numbers."""

    def residual(self, mean: FloatArray) -> FloatArray:
        """Data less a prediction."""


class Whitening:
    """Numbers relative to white noise, to which a blur may be added, and the analyser's smooth errors together.

    The errors have few columns C, so the symmetric root of the inverse of I + C^T C leaves all but their directions V unchanged:
    I - V (1 - 1/sqrt(1 + s^2)) V^T with the singular values s of C.
    """

    def __init__(self, prediction: Prediction, blur: float = 0.0) -> None:
        self._weight = 1 / np.hypot(prediction.sigma, blur)
        columns = prediction.errors * self._weight
        _, singular, self._directions = np.linalg.svd(columns, full_matrices=False)
        self._less = 1 - 1 / np.hypot(1, singular)
        together = float(np.sum(np.log(np.hypot(1, singular))))
        self.log_density = float(np.sum(np.log(self._weight))) - together - 0.5 * self._weight.size * float(np.log(2 * np.pi))

    def __call__(self, rows: FloatArray) -> FloatArray:
        """Rows, shape (m, n), with unit covariance."""
        weighted: FloatArray = rows * self._weight
        if not self._less.size:
            return weighted
        return weighted - ((weighted @ self._directions.T) * self._less) @ self._directions


class Smooth(NamedTuple):
    """Smooth columns, shape (p, n), and their inner products, which are the same at every point of a search."""

    rows: FloatArray
    gram: FloatArray

    @classmethod
    def of(cls, rows: FloatArray) -> Smooth:
        return cls(rows, rows @ rows.T)


class Point(NamedTuple):
    """Values of the unknowns, what is left of the data there, and the derivatives of the prediction."""

    u: FloatArray
    eta: FloatArray
    left: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, prediction: Prediction, u: FloatArray, eta: FloatArray) -> Point:
        mean, by_u, by_eta = prediction.at(u, eta)
        return cls(u, eta, prediction.residual(mean), np.concatenate([by_u, by_eta]))


class System:
    """The least-squares problem round one point: unknowns are u less its centre, eta, and coefficients of the smooth columns."""

    def __init__(self, prediction: Prediction, known: Known, here: Point, white: Callable[[FloatArray], FloatArray], smooth: Smooth) -> None:
        self.prediction, self.known, self.here = prediction, known, here
        slopes = white(here.slopes)
        away = np.concatenate([here.u - known.centre, here.eta])
        self._slopes, self._smooth, self._white = slopes, smooth, white
        # The prediction as if it were linear from the centre on.
        self._left = white(here.left[None])[0] + away @ slopes
        self._own, self._undescribed = len(slopes), len(smooth.rows)
        self._gram = np.empty((self._own + self._undescribed,) * 2)
        self._gram[: self._own, : self._own] = slopes @ slopes.T
        self._gram[: self._own, self._own :] = crossed = slopes @ smooth.rows.T
        self._gram[self._own :, : self._own] = crossed.T
        self._gram[self._own :, self._own :] = smooth.gram
        self._pull = np.concatenate([slopes @ self._left, smooth.rows @ self._left])
        self._squares = float(self._left @ self._left)
        prior = np.eye(len(self._pull))
        k = known.centre.size
        self._before = near = known.near(here.u)
        prior[:k, :k] = near.precision
        self._pull[:k] += near.pull
        self._squares += near.squares
        self._prior = prior
        self._k = k
        self._unpredicted = np.zeros(len(self._pull), dtype=np.intp)
        self._unpredicted[k : k + here.eta.size] = prediction.unpredicted
        self._equations: dict[Scale, tuple[FloatArray, FloatArray]] = {}
        # Response numbers and coefficients have no bounds.
        self._low, self._high = np.full(len(self._pull), -np.inf), np.full(len(self._pull), np.inf)
        self._low[:k], self._high[:k] = known.low - known.centre, known.high - known.centre
        self._away = np.concatenate([away, np.zeros(len(smooth.rows))])
        # In these the prediction is looked at where they are, in all others it is linear.
        self._moving = np.arange(len(self._pull)) < self._own
        self._moving[:k] &= prediction.moving

    def moved_to(self, u: FloatArray, eta: FloatArray) -> System:
        """The same problem round another point."""
        return System(self.prediction, self.known, Point.of(self.prediction, u, eta), self._white, self._smooth)

    def _scales(self, at: Scale) -> FloatArray:
        """The unit of each unknown in the normal equations: a width for unpredictable changes, and the size of what no model describes."""
        size, *widths = at
        return np.concatenate([np.ones(self._own), np.full(self._undescribed, size)]) * np.array([1.0, *widths])[self._unpredicted]

    def _normal(self, at: Scale) -> tuple[FloatArray, FloatArray]:
        """Matrix, priors included, and right-hand side of the normal equations, for unknowns in the units of `_scales`."""
        if at not in self._equations:
            scales = self._scales(at)
            self._equations[at] = self._gram * scales * scales[:, None] + self._prior, self._pull * scales
        return self._equations[at]

    def _held(self, matrix: FloatArray, damping: float) -> FloatArray:
        """What damping adds to the diagonal: the unknowns in which the prediction is linear are free."""
        return np.where(self._moving, damping * np.diag(matrix), 0.0)

    def damped(self, at: Scale, damping: float) -> FloatArray:
        """The best of the model's unknowns, less their centre, and of eta, if the prediction were linear and a step cost something."""
        matrix, pull = self._normal(at)
        scales = self._scales(at)
        held = self._held(matrix, damping)
        solution = within(matrix + np.diag(held), pull + held * self._away / scales, self._low / scales, self._high / scales)
        return (solution * scales)[: self._own]

    def corrected(self, at: Scale, damping: float, wanted: FloatArray) -> FloatArray:
        """The end of a step after a geodesic correction (Transtrum and Sethna 2012), or the same end if the correction is large."""
        k, own = self._k, self._own
        step = wanted - self._away[:own]
        ahead, _, _ = self.prediction.at(self.here.u + AHEAD * step[:k], self.here.eta + AHEAD * step[k:])
        turned = self._white((self.here.left - self.prediction.residual(ahead))[None])[0]
        second = (2 / AHEAD) * (turned / AHEAD - step @ self._slopes)
        bend = np.concatenate([self._slopes @ second, self._smooth.rows @ second])
        bend[:k] += self.known.bend(self.here.u, step[:k])
        matrix, _ = self._normal(at)
        scales, diagonal = self._scales(at), np.diag(matrix)
        turn = -0.5 * (solved(matrix + np.diag(self._held(matrix, damping)), bend * scales) * scales)[:own]
        weights = np.where(self._moving, diagonal / scales**2, 0.0)[:own]
        return wanted + turn if turn**2 @ weights < GENTLE * (step**2 @ weights) else wanted

    def least(self, at: Scale) -> float:
        """The lowest cost by the linear model."""
        matrix, pull = self._normal(at)
        best = self._best(at)
        return self._squares - float(2 * pull @ best - best @ matrix @ best)

    def _best(self, at: Scale) -> FloatArray:
        """The best of all unknowns by the linear model, in the units of `_scales`."""
        scales = self._scales(at)
        return within(*self._normal(at), self._low / scales, self._high / scales)

    def cost(self, at: Scale, there: FloatArray | None = None) -> float:
        """Minus twice the log of likelihood times prior at this very point, or at another one by the linear model.

        All in which the prediction is linear is at its best.
        """
        matrix, pull = self._normal(at)
        moving, still = np.flatnonzero(self._moving), np.flatnonzero(~self._moving)
        point = self._away if there is None else np.concatenate([there, self._away[self._own :]])
        away = (point / self._scales(at))[moving]
        left = pull[still] - matrix[np.ix_(still, moving)] @ away
        squares = self._squares - 2 * float(away @ pull[moving]) + float(away @ matrix[np.ix_(moving, moving)] @ away)
        taken = float(left @ np.linalg.solve(matrix[np.ix_(still, still)], left)) if left.size else 0.0
        return squares - taken

    def log_integrals(self, scales: Sequence[Scale]) -> FloatArray:
        """Log of likelihood times prior, integrated over all unknowns, less the noise's own term; for each of the scales."""
        units = np.array([self._scales(at) for at in scales])
        matrix = self._gram * units[:, :, None] * units[:, None, :] + self._prior
        inverse = 1 / np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
        count = inverse.shape[1]
        # One more row, the right-hand side, so that the root also has the solution's share of the misfit.
        wider = np.empty((len(units), count + 1, count + 1))
        wider[:, :count, :count] = matrix * inverse[:, :, None] * inverse[:, None, :] + NEARLY_SINGULAR * np.eye(count)
        wider[:, count, :count] = wider[:, :count, count] = self._pull * units * inverse
        wider[:, count, count] = 2 * abs(self._squares) + LARGE
        root = np.linalg.cholesky(wider)
        least = self._squares - np.sum(root[:, count, :count] ** 2, axis=1)
        for number in self._beyond(root[:, :count, :count], root[:, count, :count], inverse):
            least[number] = self.least(scales[number])
        diagonal = np.diagonal(root, axis1=1, axis2=2)[:, :count]
        logdet = 2 * np.sum(np.log(diagonal), axis=1) - 2 * np.sum(np.log(inverse), axis=1)
        found: FloatArray = -0.5 * least - 0.5 * logdet - self.known.log_integral
        return found

    def _beyond(self, root: FloatArray, share: FloatArray, inverse: FloatArray) -> IntArray:
        """For which of some scales, given by the roots of their matrices and the right-hand sides divided by these, the best is out of bounds."""
        k = self._k
        best = np.linalg.solve(np.swapaxes(root, -1, -2), share[..., None])[..., 0][:, :k] * inverse[:, :k]
        return np.flatnonzero(np.any((best < self._low[:k]) | (best > self._high[:k]), axis=1))

    def likeliest(self, scales: Sequence[Scale], log_priors: FloatArray | float = 0.0) -> Scale:
        """The most probable one of some scales."""
        return scales[int(np.argmax(self.log_integrals(scales) + log_priors))]

    def learnt(self, at: Scale) -> Learnt:
        """What is then known of the model's own unknowns."""
        matrix, pull = self._normal(at)
        solution = self._best(at)
        k = self._k
        inner, known = matrix[k:, k:], self.known
        others = np.linalg.solve(inner, np.column_stack([matrix[k:, :k], pull[k:]]))
        precision = matrix[:k, :k] - matrix[:k, k:] @ others[:, :k]
        precision = 0.5 * (precision + precision.T)
        # Where the prediction was looked at is a point of the search; a last step of the linear model could lead far from it.
        centre = np.where(self._moving[:k], self.here.u, np.clip(known.centre + solution[:k], known.low, known.high))
        # These data taught the difference from what was known before.
        taught = precision - self._before.precision
        towards = pull[:k] - matrix[:k, k:] @ others[:, k] - self._before.pull + taught @ known.centre
        return Learnt(centre, precision, taught, towards)
