"""The simulated analyser and receiver."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.arrays import ComplexArray, FloatArray
from motoremi.data.sweep import TERMINATIONS, Termination
from motoremi.errors import BadInput
from motoremi.simulate.analyser_errors import SimulatedAnalyser, behind_line, noise_sd_ohm, tolerance_percent
from motoremi.simulate.hidden_effects import ANALYSER_FAULTS
from motoremi.simulate.simulated_motor import SimulatedMotor

BAND = np.geomspace(150e3, 30e6, 401)
TRUE = SimulatedMotor.random(1).impedance("short", BAND)


def mean_of_repeats(analyser: SimulatedAnalyser, connection: int, repeats: int = 50) -> ComplexArray:
    mean: ComplexArray = np.mean([analyser.measure("short", BAND, TRUE, connection) for _ in range(repeats)], axis=0)
    return mean


@pytest.mark.parametrize(
    ("ohm", "hertz", "percent"),
    [
        (1, 150e3, 0.33),
        (1, 10e6, 1.25),
        (10, 1e6, 0.10),
        (100, 5e6, 0.50),
        (1e3, 150e3, 0.08),
        (1e4, 10e6, 1.05),
        (1e4, 25e6, 2.0),
        (1e5, 15e6, 2.0),
        (1e5, 20e6, 6.5),
    ],
)
def test_tolerance_is_that_of_a_table_computed_independently(ohm: float, hertz: float, percent: float) -> None:
    """From the project's physics notes (not in this repository), section B.1, by the formula of the 4294A's operation manual."""
    assert float(tolerance_percent(hertz, ohm, 5, 0.5)) == pytest.approx(percent, abs=0.012 if percent < 1 else 0.06)


def test_tolerance_grows_with_speed_and_low_level() -> None:
    best = tolerance_percent(BAND, 100.0)
    for factor in (4, 3, 2, 1):
        faster = tolerance_percent(BAND, 100.0, factor)
        assert np.all(faster > best)
        best = faster
    for volt in (0.3, 0.2, 0.1, 0.02, 1.0):
        assert np.all(tolerance_percent(BAND, 100.0, 5, volt) > tolerance_percent(BAND, 100.0))
    with pytest.raises(BadInput, match="bandwidth"):
        tolerance_percent(1e6, 1.0, 6)
    with pytest.raises(BadInput, match="oscillator"):
        tolerance_percent(1e6, 1.0, 5, 0.0)


@pytest.mark.parametrize("factor", [1, 3, 5])
def test_noise_is_as_stated(factor: int) -> None:
    analyser = SimulatedAnalyser(1)
    repeats = np.array([analyser.measure("short", BAND, TRUE, 0, factor) for _ in range(100)])
    stated = noise_sd_ohm(BAND, repeats.mean(axis=0), factor)
    for part in (repeats.real, repeats.imag):
        assert np.mean(part.var(axis=0, ddof=1) / stated**2) == pytest.approx(1, abs=0.03)
    scale = stated / np.abs(repeats.mean(axis=0))
    assert {5: 6e-5, 3: 2.45e-4, 1: 1e-3}[factor] == pytest.approx(float(scale.min()), rel=0.05)


def test_residuals_belong_to_a_connection_and_gain_to_the_calibration() -> None:
    analyser = SimulatedAnalyser(1)
    first, second, other = (mean_of_repeats(analyser, connection) for connection in (0, 0, 1))
    noise = noise_sd_ohm(BAND, TRUE, 5) / np.sqrt(50)
    assert np.max(np.abs(first - second) / noise) < 8
    assert np.max(np.abs(first - other) / noise) > 20
    gain = first / TRUE - 1
    # Where neither floor nor residual matters, what is left is the gain error.
    quiet = np.abs(TRUE) < 300
    np.testing.assert_allclose(gain[quiet], analyser.gain_error(BAND)[quiet], atol=2e-3)


def test_gain_error_is_within_the_specification() -> None:
    errors = np.array([SimulatedAnalyser(seed).gain_error(BAND) for seed in range(300)])
    third = tolerance_percent(BAND, 100.0) / 300
    rms = np.sqrt(np.mean(errors.real**2, axis=0)) / third
    assert np.all((rms > 0.4) & (rms < 1.4))
    # Smooth but for small steps at 1 and 15 MHz.
    assert np.max(np.abs(np.diff(errors, axis=1))) < 0.0022


def test_same_calls_same_data() -> None:
    def run(seed: int) -> list[ComplexArray]:
        analyser = SimulatedAnalyser(seed)
        return [analyser.measure(t, BAND, TRUE, c) for t in TERMINATIONS for c in (0, 0, 1)]

    first, again, other = run(4), run(4), run(5)
    for one, two, three in zip(first, again, other, strict=True):
        assert np.array_equal(one, two)
        assert not np.any(one == three)
    assert not np.any(first[0] == first[1])


def ratio(faults: tuple[str, ...], true: ComplexArray, termination: Termination = "short", compensated: bool = True) -> ComplexArray:
    """A faulty analyser against a sound one of the same seed, noise removed by using the same stream."""
    faulty, sound = SimulatedAnalyser(3, faults=faults, compensated=compensated), SimulatedAnalyser(3)
    value: ComplexArray = faulty.measure(termination, BAND, true) / sound.measure(termination, BAND, true)
    return value


@pytest.mark.parametrize("fault", ANALYSER_FAULTS)
def test_every_fault_is_beyond_the_specification(fault: str) -> None:
    motor = SimulatedMotor.random(1)
    beyond = 0.0
    for termination in TERMINATIONS:
        true = motor.impedance(termination, BAND)
        excess = np.abs(ratio((fault,), true, termination) - 1) / (tolerance_percent(BAND, np.abs(true)) / 100)
        beyond = max(beyond, float(excess.max()))
    assert beyond > 1.5
    assert list(SimulatedAnalyser(3, faults=(fault,)).truth()["faults"]) == [fault]


def test_faults_do_what_they_say() -> None:
    low = np.full(BAND.shape, 1 + 0j)
    matched = np.full(BAND.shape, 50 + 0j)
    assert np.max(np.abs(ratio(("cable-delay",), matched) - 1)) < 1e-5
    contact = SimulatedAnalyser(3, faults=("contact-resistance",)).truth()["faults"]["contact-resistance"]
    for termination in TERMINATIONS:
        expected = 1 + contact["resistance_ohm"] * (termination == contact["sweep"])
        # At the lowest frequency, where residual inductance does not matter.
        assert np.abs(ratio(("contact-resistance",), low, termination))[0] == pytest.approx(expected, rel=1e-2)
    step = SimulatedAnalyser(3, faults=("range-step",)).truth()["faults"]["range-step"]
    expected_step: FloatArray = np.where(step["frequency_hz"] < BAND, 1 + step["step"], 1.0)
    np.testing.assert_allclose(ratio(("range-step",), matched).real, expected_step, atol=1e-3)


@pytest.mark.parametrize("ohm", [1.0, 50.0, 1e4])
def test_cable_turns_the_reflection(ohm: float) -> None:
    delay = 3e-10
    seen = behind_line(np.full(BAND.shape, ohm + 0j), BAND, delay)
    turned = (ohm - 50) / (ohm + 50) * np.exp(-4j * np.pi * BAND * delay)
    np.testing.assert_allclose((seen - 50) / (seen + 50), turned, atol=1e-5)


def test_raw_fixture_is_much_worse() -> None:
    low = np.full(BAND.shape, 1 + 0j)
    assert np.max(np.abs(ratio((), low, compensated=False) - 1)) > 1


def test_bad_input() -> None:
    with pytest.raises(BadInput, match="unknown analyser"):
        SimulatedAnalyser(1, "abacus")
    with pytest.raises(BadInput, match=r"unknown fault.*range-step"):
        SimulatedAnalyser(1, faults=("core-loss",))
    with pytest.raises(BadInput, match="seed"):
        SimulatedAnalyser(-1)
    with pytest.raises(BadInput, match="termination"):
        SimulatedAnalyser(1).measure("half", BAND, TRUE)  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="impedances"):
        SimulatedAnalyser(1).measure("short", BAND, TRUE[1:])
