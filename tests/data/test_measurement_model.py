"""What the data are: the covariance against dense linear algebra, the noise against draws of known size, the analyser's errors."""

from __future__ import annotations

import numpy as np
import pytest
from covariances import complex_normal, dense
from paper_circuit import DAMPED, impedance
from scipy.special import exp1

import motoremi as me
from motoremi.arrays import ComplexArray
from motoremi.data.analyser import ANALYSERS, UNKNOWN, error_basis, find_analyser
from motoremi.data.covariance import LEAST_SHARE, Columns, Part
from motoremi.data.kernels import by_parabolas, matern, smooth_basis
from motoremi.data.measurement import Measurement
from motoremi.data.noise import Noise, estimate_noise
from motoremi.data.quantity import REFLECTION
from motoremi.data.repeats import CORRELATED
from motoremi.data.sweep import group_repeats
from motoremi.fitting.marginal import marginal
from motoremi.fitting.problem import Problem
from motoremi.model.motor import dc_motor

pytestmark = pytest.mark.slow

GRID_HZ = np.geomspace(150e3, 30e6, 201)


# What is smooth along frequency


@pytest.mark.parametrize("span", [(150e3, 30e6), (40.0, 110e6), (1e6, 1.3e6)])
@pytest.mark.parametrize("parts", [((1.0, 0.6),), ((0.8, 0.3), (0.2, 0.08)), CORRELATED])
def test_smooth_basis_reproduces_its_kernel(span, parts):
    frequency = np.exp(np.random.default_rng(1).uniform(*np.log(span), 150))
    place = np.log10(frequency)
    exact = sum(share * matern(place, place, length) for share, length in parts)
    basis = smooth_basis(frequency, parts)
    # Between its knots the process is taken for a straight line, so that halfway it has the variance of a mean of two neighbours, and no
    # other correlation is further off than that.
    knots = max(4, int(np.ceil(4 * np.ptp(place) / min(length for _, length in parts))) + 1)
    step = np.array([np.ptp(place) / (knots - 1)])
    missed = 0.5 * (1 - sum(share * matern(step, 0 * step, length)[0, 0] for share, length in parts))
    assert missed < 0.036
    np.testing.assert_allclose(basis @ basis.T, exact, atol=missed + 1e-4)
    assert basis.shape[1] <= knots


# The covariance against dense linear algebra


def two_sweeps(points: tuple[int, int], quietest: float = 1e-4, wander: float = 2e-4) -> list[Part]:
    """Unlike grids, white noise that varies, correlated noise, a drift, and not all points used."""
    parts = []
    grids = (np.geomspace(100e3, 20e6, 2 * points[0]), np.linspace(300e3, 50e6, points[1]))
    for termination, frequency, chosen in zip(("short", "open"), grids, (slice(0, None, 2), slice(None)), strict=True):
        place = np.log10(frequency / 1e6)
        noise = Noise(
            quietest * (2 + np.sin(5 * place)),
            "repeats",
            np.full(frequency.size, wander),
            3e-4 * (1 + 1j * place) if termination == "short" else None,
        )
        parts.append(Part(frequency, impedance(DAMPED, termination, frequency), noise, np.arange(frequency.size)[chosen]))
    return parts


CASES = [
    ("4294a", (60, 45), 0.0, 1.0),
    ("4294a", (60, 45), 3e-3, 1.0),
    ("4294a", (60, 45), 0.3, 4.0),
    ("none", (60, 45), 1e-3, 1.0),
    ("nanovna", (60, 45), 1e-2, 2.0),
    ("unknown", (60, 45), 1e-3, 30.0),
    ("nanovna", (9, 8), 1e-3, 1.0),  # more directions than points
]


@pytest.mark.parametrize(("analyser", "points", "discrepancy", "declared"), CASES)
def test_whitening_is_the_inverse_of_the_dense_covariance(analyser, points, discrepancy, declared):
    columns = Columns.of(two_sweeps(points), find_analyser(analyser))
    covariance = dense(columns, discrepancy, declared)
    whitening = columns.whitening(declared)
    directions = whitening.directions(discrepancy)
    inverse = (np.eye(columns.sigma.size) - directions @ directions.conj().T) / np.outer(columns.sigma, columns.sigma)
    # In units in which the covariance is one: directions that hold less than LEAST_SHARE of the noise may be left out, of each of two kinds.
    root = np.linalg.cholesky(covariance)
    assert np.max(np.abs(np.linalg.eigvalsh(root.conj().T @ inverse @ root) - 1)) < 2.5 * LEAST_SHARE
    products = columns.sweep_blocks.products(np.zeros((0, columns.sigma.size), dtype=np.complex128), np.array([discrepancy]))
    determinant = whitening.log_determinants(np.array([discrepancy]))[0] + whitening.with_analyser(products, 0)[1][0]
    assert determinant == pytest.approx(np.linalg.slogdet(covariance)[1], abs=columns.sigma.size * LEAST_SHARE)


@pytest.mark.parametrize(("analyser", "points", "discrepancy", "declared"), CASES)
def test_no_sweep_has_more_directions_than_points_and_none_is_lost(analyser, points, discrepancy, declared):
    columns = Columns.of(two_sweeps(points), find_analyser(analyser))
    whitening = columns.whitening(declared)
    directions = whitening.directions(discrepancy, LEAST_SHARE)
    product = np.zeros((columns.sigma.size,) * 2, dtype=np.complex128)
    for where, part in whitening.adjoints(discrepancy, LEAST_SHARE):
        product[where, where] += part @ part.conj().T
        assert part.shape[1] <= part.shape[0] or where == slice(None)
    np.testing.assert_allclose(product, (directions @ directions.conj().T).conj(), atol=1e-12)


@pytest.mark.parametrize(("analyser", "points", "discrepancy", "declared"), CASES)
def test_products_are_those_under_the_inverse_covariance(analyser, points, discrepancy, declared):
    columns = Columns.of(two_sweeps(points), find_analyser(analyser))
    weighted = complex_normal(np.random.default_rng(2), 2 * columns.sigma.size).reshape(2, -1)
    products = columns.sweep_blocks.products(weighted, np.array([discrepancy]))
    left = columns.whitening(declared).with_analyser(products, 2)[0][0]
    values = weighted * columns.sigma
    exact = values.conj() @ np.linalg.solve(dense(columns, discrepancy, declared), values.T)
    np.testing.assert_allclose(left, exact, atol=2.5 * LEAST_SHARE * np.abs(exact).max())


@pytest.mark.parametrize(("analyser", "declared"), [("4294a", 4.0), ("unknown", 30.0), ("nanovna", 4.0)])
@pytest.mark.parametrize(("quietest", "discrepancy"), [(1e-5, 1e-3), (6e-5, 0.03), (3e-4, 1.0)])
def test_whitening_stands_errors_far_above_the_noise(analyser, declared, quietest, discrepancy):
    """Beyond these sizes nobody asks for a likelihood."""
    columns = Columns.of(two_sweeps((100, 101), quietest, 0.0), find_analyser(analyser))
    directions = columns.whitening(declared).directions(discrepancy)
    inverse = np.eye(columns.sigma.size) - directions @ directions.conj().T
    # In units of the noise, below which nothing is; it reaches 1e11, of which sixteen digits are kept.
    variances, vectors = np.linalg.eigh(dense(columns, discrepancy, declared) / np.outer(columns.sigma, columns.sigma))
    root = vectors * np.sqrt(np.maximum(variances, 1.0))
    assert np.max(np.abs(np.linalg.eigvalsh(root.conj().T @ inverse @ root) - 1)) < 1e-2


# Noise from repeats


def repeats_of(seed: int, count: int, white: float, wander: float = 0.0, drift: ComplexArray | None = None) -> list[me.ImpedanceSweep]:
    """Short sweeps of one motor with noise of known size."""
    rng = np.random.default_rng(seed)
    true = impedance(DAMPED, "short", GRID_HZ)
    basis = smooth_basis(GRID_HZ, CORRELATED)
    sweeps = []
    for number in range(count):
        relative = white * complex_normal(rng, GRID_HZ.size) + wander * basis @ complex_normal(rng, basis.shape[1])
        steady = 0.0 if drift is None else number * drift
        sweeps.append(me.ImpedanceSweep("short", GRID_HZ, true * np.exp(relative + steady)))
    return sweeps


def noise_of(sweeps: list[me.ImpedanceSweep]) -> Noise:
    return estimate_noise(group_repeats(sweeps)[0])


SEEDS = 16


@pytest.mark.parametrize("count", [2, 3, 5])
def test_white_repeats_give_back_their_size_and_nothing_else(count):
    found = [noise_of(repeats_of(seed, count, 3e-4)) for seed in range(SEEDS)]
    sizes = np.array([np.median(noise.sigma) for noise in found]) * np.sqrt(count) / 3e-4
    # Two real parts of 201 points in each contrast.
    scatter = 1 / np.sqrt(2 * 2 * GRID_HZ.size * (count - 1))
    assert np.std(sizes) < 2 * scatter
    assert abs(np.mean(sizes) - 1) < 4 * scatter / np.sqrt(SEEDS) + 0.02
    # What is correlated passes once in twenty by chance, and is small then.
    by_chance = np.array([noise.correlated_sigma.max() for noise in found]) * np.sqrt(count) / 3e-4
    assert np.count_nonzero(by_chance) <= 4
    assert np.max(by_chance) < 0.3
    assert not any(noise.outliers is not None for noise in found)
    assert sum(noise.drift is not None for noise in found) <= 1


@pytest.mark.parametrize("ratio", [0.5, 3.0, 30.0])
def test_correlated_repeats_give_back_their_size(ratio):
    white = 2e-4
    found = [noise_of(repeats_of(seed, 3, white, ratio * white)) for seed in range(SEEDS)]
    correlated = np.array([noise.correlated_sigma.max() for noise in found]) * np.sqrt(3) / (ratio * white)
    # The longest of the four processes has one or two independent values in two decades: each draw scatters by a third or so.
    assert np.all((correlated > 0.4) & (correlated < 2.0))
    assert np.exp(np.mean(np.log(correlated))) == pytest.approx(1, abs=0.12)
    sizes = np.array([np.median(noise.sigma) for noise in found]) * np.sqrt(3) / white
    # At thirty times the white noise even neighbours differ by more than that: it drowns.
    assert np.mean(sizes) == pytest.approx(1, abs=0.05 if ratio < 10 else 0.4)
    # Noise that wanders is no motor that warms.
    assert sum(noise.drift is not None for noise in found) <= 2


@pytest.mark.parametrize("count", [3, 5])
def test_a_drift_gives_back_its_size(count):
    white = 2e-4
    place = np.log10(GRID_HZ / 1e6)
    step = 2e-3 * (np.exp(-(place**2)) + 0.5j * np.tanh(2 * place))
    for seed in range(6):
        noise = noise_of(repeats_of(seed, count, white, drift=step))
        assert noise.drift is not None
        # How far the mean may be off: half of the way.
        np.testing.assert_allclose(noise.drift, step * count / 2, atol=5 * white)
        assert np.sqrt(np.mean(np.abs(noise.drift - step * count / 2) ** 2)) < white * count / 2
        # What drifts is not counted a second time.
        assert noise.correlated_sigma.max() < white
        assert np.median(noise.sigma) * np.sqrt(count) == pytest.approx(white, rel=0.2)
        assert np.median(noise.variance) > 0.5 * np.median(np.abs(noise.drift) ** 2)


@pytest.mark.parametrize("count", [3, 5])
def test_leads_that_are_moved_between_repeats_are_no_drift(count):
    """Each repeat has a lead of its own, whose share of Z grows with frequency."""
    rng = np.random.default_rng(11)
    found = []
    for seed in range(40):
        moved = 3e-3 * rng.standard_normal(count)
        sweeps = [
            me.ImpedanceSweep(sweep.termination, GRID_HZ, sweep.impedance_ohm * (1 + share * (GRID_HZ / GRID_HZ[-1]) ** 2))
            for sweep, share in zip(repeats_of(seed, count, 2e-4), moved, strict=True)
        ]
        found.append(noise_of(sweeps))
    # One in ten, and three standard deviations of their number.
    assert sum(noise.drift is not None for noise in found) <= 4 + 3 * 2
    assert all(noise.correlated is not None or noise.drift is not None for noise in found)


@pytest.mark.parametrize("count", [2, 3])
def test_stations_are_flagged_and_count_for_little(count):
    white = 3e-4
    rng = np.random.default_rng(7)
    seen = 0
    for seed in range(8):
        struck = np.sort(rng.choice(GRID_HZ.size, 9, replace=False))
        sweeps = []
        for sweep in repeats_of(seed, count, white):
            z = sweep.impedance_ohm.copy()
            z[struck] *= 1 + 60 * white * np.exp(2j * np.pi * rng.uniform(size=struck.size)) * rng.uniform(0.7, 1.5, struck.size)
            sweeps.append(me.ImpedanceSweep("short", GRID_HZ, z))
        noise = noise_of(sweeps)
        assert noise.outliers is not None
        flagged = np.flatnonzero(noise.outliers)
        assert set(flagged) <= set(struck)
        seen += flagged.size
        quiet = np.median(noise.sigma[~noise.outliers]) * np.sqrt(count)
        assert quiet == pytest.approx(white, rel=0.15)
        assert np.all(noise.sigma[flagged] > 20 * quiet)
    # Two phases within some 15 degrees do not show: one in eight or so of two repeats, hardly one of three.
    assert seen >= (54 if count == 2 else 69)


def test_white_data_are_hardly_ever_flagged():
    assert sum(noise_of(repeats_of(100 + seed, 2 + seed % 2, 3e-4)).outliers is not None for seed in range(40)) == 0


@pytest.mark.parametrize("repeats", [1, 3])
def test_noise_of_a_network_analyser_is_that_of_its_reflection_coefficient(repeats):
    """At a sharp resonance of ten kilohms the noise relative to Z is a hundred times that of the neighbourhood."""
    white = 2e-4
    true = impedance(DAMPED, "short", GRID_HZ)
    reflection = (true - 50) / (true + 50)
    expected = white * np.abs(2 / (1 - reflection**2))
    assert expected.max() > 100 * np.median(white)
    ratios = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        noisy = [reflection + white * complex_normal(rng, GRID_HZ.size) for _ in range(repeats)]
        group = group_repeats(me.ImpedanceSweep("short", GRID_HZ, 50 * (1 + one) / (1 - one)) for one in noisy)[0]
        ratios.append(estimate_noise(group, REFLECTION).sigma * np.sqrt(repeats) / expected)
    # At the peak the mean sweep, whose noise is a few per cent there, says how large the factor is.
    peak = np.argmax(expected)
    assert np.mean(ratios, axis=0)[peak - 3 : peak + 4] == pytest.approx(1, abs=0.2)
    assert np.median(ratios) == pytest.approx(1, abs=0.1)


def test_noise_follows_the_analyser_that_is_supposed():
    group = repeats_of(1, 2, 1e-3)
    bridge, reflection = (Measurement.of(group, analyser) for analyser in ("4294a", "nanovna"))
    supposed = bridge.with_analyser(find_analyser("nanovna"))
    np.testing.assert_array_equal(supposed.noise[0].sigma, reflection.noise[0].sigma)
    assert not np.allclose(supposed.noise[0].sigma, bridge.noise[0].sigma, rtol=0.2)
    struck = np.zeros(GRID_HZ.size, dtype=np.bool_)
    struck[40] = True
    ignored = bridge.with_outliers({"short": struck}).with_analyser(find_analyser("nanovna")).noise[0]
    assert ignored.sigma[40] == 1.0
    assert not ignored.regular[40]
    np.testing.assert_array_equal(bridge.with_analyser(find_analyser("e4990a")).noise[0].sigma, bridge.noise[0].sigma)


# The analyser


def test_errors_in_the_reflection_move_no_parameter_where_the_impedance_is_high():
    """Zm/Z = 1 / (1 - x) with x the error over the distance from full reflection: its logarithm is off by -E1(1 / 2 s^2) / 2 in the mean."""
    frequency = np.geomspace(1, 1.004, 201) / (2 * np.pi * np.sqrt(DAMPED["La"] * DAMPED["Ca"])) / 1.002
    true = impedance(DAMPED, "short", frequency)
    reflection, spread = (true - 50) / (true + 50), 0.55
    assert np.abs(true).min() > 25e3
    rng = np.random.default_rng(4)
    logarithm, white, steps = [], [], []
    for _ in range(100):
        measured = reflection + spread * np.abs(1 - reflection) * complex_normal(rng, true.size)
        sweep = me.ImpedanceSweep("short", frequency, 50 * (1 + measured) / (1 - measured))
        problem = Problem(dc_motor(), Measurement.of([sweep], "nanovna"))
        u = problem.vector(DAMPED)
        here = problem.linearised(u)
        logarithm.append(problem.deviation(u))
        white.append(np.real(here.slopes.conj() @ here.deviation))
        errors = np.linalg.inv(here.matrix)
        steps.append(errors @ here.gradient / np.sqrt(np.diag(errors)))
    bias = -0.5 * exp1(1 / (2 * spread**2))
    scatter = spread / np.sqrt(np.size(logarithm))
    assert abs(bias) > 8 * scatter
    assert np.mean(logarithm).real == pytest.approx(bias, abs=4 * scatter)
    # The pull of white noise on each unknown, and how far all errors move it, in its error bars.
    assert np.all(np.abs(np.mean(white, axis=0)) < 4 * np.std(white, axis=0) / np.sqrt(len(white)))
    assert np.all(np.abs(np.mean(steps, axis=0)) < 0.5)


def test_a_coarse_sweep_is_smoothed_no_further_than_its_noise():
    values, frequency = {**DAMPED, "Ra": 1.0}, np.linspace(150e3, 30e6, 101)
    true, sigma = REFLECTION.coefficient_of(impedance(values, "short", frequency)), np.full(101, 1e-4)
    np.testing.assert_allclose(by_parabolas(true, sigma), true, atol=5e-4)
    # Without its resonances the same noise is averaged.
    noise = 1e-4 * complex_normal(np.random.default_rng(1), 101)
    assert np.std(by_parabolas(noise, sigma)) < 0.6 * np.std(noise)


def test_small_errors_in_the_reflection_are_those_in_the_impedance():
    true = impedance(DAMPED, "short", GRID_HZ)
    sweep = me.ImpedanceSweep("short", GRID_HZ, true * (1 + 1e-5 * np.exp(1j * np.log(GRID_HZ))), 1e-4)
    problem = Problem(dc_motor(), Measurement.of([sweep], "nanovna"))
    u = problem.vector(DAMPED)
    np.testing.assert_allclose(problem.residual(u), problem.deviation(u), atol=3e-7)


@pytest.mark.parametrize(
    ("analyser", "compensated", "seen"),
    [
        ("nanovna", None, True),
        ("nanovna", ["open"], True),
        ("nanovna", 5, True),
        ("nanovna", "open, short", True),
        ("nanovna", ["open", "short"], False),
        ("nanovna", ["open", "short", "load"], False),
        ("4294a", None, False),
        ("unknown", None, False),
        ("none", None, False),
    ],
)
def test_fixture_is_unknown_only_where_nobody_compensated_it(analyser, compensated, seen):
    metadata = {} if compensated is None else {"compensated": compensated}
    sweeps = [me.ImpedanceSweep(t, GRID_HZ, impedance(DAMPED, t, GRID_HZ), 1e-3, metadata) for t in ("short", "open")]
    measurement = Measurement.of(sweeps, analyser)
    names = {p.name for p in Problem(dc_motor(), measurement).unknowns}
    assert {name for name in names if name.startswith("fixture ")} == ({f"fixture {part}" for part in "RLGC"} if seen else set())
    assert any("connection" in name for name in names) == (analyser != "none")
    # One forgotten compensation is enough.
    if compensated is not None and not seen:
        mixed = Measurement.of([sweeps[0], me.ImpedanceSweep("open", GRID_HZ, sweeps[1].impedance_ohm, 1e-3)], analyser)
        assert mixed.analyser.fixture is not None


def test_sizes_of_an_unknown_analyser_come_from_the_data():
    assert find_analyser("unknown").scales == UNKNOWN
    assert sum(UNKNOWN.values()) == pytest.approx(1)
    assert all(sum(analyser.scales.values()) == pytest.approx(1) for analyser in ANALYSERS)
    coarse = GRID_HZ[::3]
    expected: dict[float, list[float]] = {}
    for scale in UNKNOWN:
        for seed in range(4):
            rng = np.random.default_rng((seed, int(scale)))
            true = {t: impedance(DAMPED, t, coarse) for t in ("short", "open")}
            basis = error_basis(find_analyser("4294a"), np.tile(coarse, 2), np.concatenate(list(true.values())))
            error = scale * basis @ complex_normal(rng, basis.shape[1])
            sweeps = [
                me.ImpedanceSweep(t, coarse, z * np.exp(e + 3e-5 * complex_normal(rng, z.size)), 3e-5)
                for (t, z), e in zip(true.items(), np.split(error, 2), strict=True)
            ]
            problem = Problem(dc_motor(), Measurement.of(sweeps))
            assert problem.measurement.analyser.name == "unknown"
            told = marginal(problem, problem.vector(DAMPED))
            assert told.scales == tuple(UNKNOWN)
            expected.setdefault(scale, []).append(float(np.exp(told.of_scale @ np.log(told.scales))))
    for scale, found in expected.items():
        # Half a decade lies between them, and no specification is known better.
        assert all(abs(np.log(value / scale)) < np.log(2.2) for value in found)


def test_floor_is_noise_and_specification():
    sweeps = [me.ImpedanceSweep(t, GRID_HZ, impedance(DAMPED, t, GRID_HZ), 1e-3) for t in ("short", "open")]
    ideal, bridge, handheld = (Measurement.of(sweeps, name) for name in ("none", "4294a", "nanovna"))
    assert ideal.noise_percent == bridge.noise_percent == handheld.noise_percent == pytest.approx(100 * np.sqrt(2) * 1e-3)
    assert ideal.floor_percent == ideal.noise_percent
    variance = [bridge.analyser.uncertainty(s.frequency_hz, s.mean_ohm) ** 2 for s in bridge.sweeps]
    assert bridge.floor_percent == pytest.approx(np.hypot(bridge.noise_percent, 100 * np.sqrt(np.mean(np.concatenate(variance)))))
    assert bridge.noise_percent < bridge.floor_percent < handheld.floor_percent
