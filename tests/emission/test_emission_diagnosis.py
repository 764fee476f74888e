"""Diagnosis of spectra: what is seen, what is missing, and the blind test itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from places import DATA
from typer.testing import CliRunner

from motoremi.blind.scoring import Answer
from motoremi.blind.spectra import PlayedSpectrum, SpectrumCase, draw, largest_change_db, markdown, summary
from motoremi.cli.app import app
from motoremi.data.files import read_spectra
from motoremi.data.spectrum import Spectrum
from motoremi.diagnosis.belief import believe
from motoremi.diagnosis.explore import best_of
from motoremi.emission.background import ambient_of
from motoremi.emission.band import BAND_B
from motoremi.emission.board import Candidate
from motoremi.emission.diagnose import add_effect, answer_from, diagnose_emission, fit_base, without_doubtful_pairs
from motoremi.emission.observe import find_comb, observations, repetition_from, sums_of_cosines
from motoremi.emission.scatter import ripple_columns, scatter_db
from motoremi.emission.setup import Setup, scan_frequencies
from motoremi.emission.source import Source
from motoremi.emission.source_effects import changed, find_source_effect, is_source_effect, source_effects
from motoremi.emission.source_starts import chopper_starts
from motoremi.emission.spectrum_fit import EmissionFit, restored
from motoremi.emission.spectrum_problem import Problem
from motoremi.emission.stations import find_stations
from motoremi.errors import BadInput
from motoremi.simulate.emission_in_time import OFFSET_DB, RIPPLE_DB, SOURCE_EFFECTS, Stand, measure, motor_off
from motoremi.simulate.simulated_motor import SimulatedMotor

pytestmark = pytest.mark.slow

SCAN_HZ = scan_frequencies()


def problem(seed: int, effects: tuple[str, ...] = (), stated: bool = True, with_background: bool = False, **changes: float) -> Problem:
    motor, stand = SimulatedMotor.random(seed), replace(Stand.random(seed, effects), **changes)
    read = measure(motor, stand, SCAN_HZ, seed, quasi_peak=False)
    setup = Setup(Source(repetition_hz=stand.repetition_hz), assumed=() if stated else ("source",))
    ambient = None
    if with_background:
        off = motor_off(stand, SCAN_HZ, seed + 1, quasi_peak=False)
        ambient = ambient_of([Spectrum(d, SCAN_HZ, off.level(d), metadata={"condition": "motor off"}) for d in ("peak", "average")])
    spectra = [Spectrum(detector, SCAN_HZ, read.level(detector)) for detector in ("peak", "average")]
    return Problem(spectra, lambda f: motor.impedance("open", f), setup, ambient)


def test_the_catalogue_is_that_of_the_contract():
    assert tuple(effect.name for effect in source_effects()) == SOURCE_EFFECTS
    for effect in source_effects():
        told = effect.to_dict()
        assert all(told[key] for key in ("title", "formula", "limit", "signature", "deciding", "source", "parameters"))
        for start in effect.starts:
            for parameter in effect.parameters:
                assert parameter.low <= start[parameter.name] <= parameter.high
        assert set(effect.look_alikes) <= set(SOURCE_EFFECTS)
    assert is_source_effect("chopper")
    assert not is_source_effect("eddy-laminations")
    with pytest.raises(BadInput, match="arc-breakdown"):
        find_source_effect("arc-brakdown")


@pytest.mark.parametrize("effect", source_effects(), ids=lambda effect: effect.name)
def test_effects_vanish_in_their_limit(effect):
    limits = {
        "arc-breakdown": {"voltage_v": 1e-9, "rise_s": 1e-8, "spread": 0.0},
        "commutation-jitter": {"missing_share": 0.0, "jitter_s": 1e-12},
        "chopper": {"amplitude_v": 1e-9, "frequency_hz": 2e4, "width_s": 2.5e-5, "rise_s": 1e-7},
        "background-noise": {"level_dbuv": -200.0, "slope_db": 0.0},
        "lisn-deviation": {"inductance_factor": 1.0},
        "cable-resonance": {"length_m": 1e-6, "impedance_ohm": 100.0},
    }[effect.name]
    base, frequency_hz = Setup(Source(repetition_hz=900.0)), SCAN_HZ[::30]
    ohm = SimulatedMotor.random(1).impedance("open", frequency_hz)
    without = base.levels(frequency_hz, ohm)
    with_it = changed(base, [effect.name], {f"{effect.name}.{key}": value for key, value in limits.items()}).levels(frequency_hz, ohm)
    for detector in ("peak", "average"):
        np.testing.assert_allclose(with_it[detector], without[detector], atol=0.02)


# Seeds that were not used while the method was made; the time domain against the formulas.
@pytest.mark.parametrize("effect", [None, "arc-breakdown", pytest.param("chopper", marks=pytest.mark.case)])
def test_a_hidden_effect_is_named_and_the_error_falls(effect):
    case = problem(1004, (effect,) if effect else ())
    found = diagnose_emission(case)
    told = found.to_dict()
    assert told["schema"] == "motoremi.diagnosis/2"
    assert set(told) >= {"verdict", "effects", "families", "confidence", "findings", "base", "best", "where", "candidates", "next_measurement"}
    assert sum(one["probability"] for one in told["candidates"]) <= 1 + 1e-9
    assert {"effects", "chi2_reduced", "rms_error_percent", "rms_error_db"} <= set(told["best"])
    if effect is None:
        assert found.verdict == "adequate"
        assert found.base.rms_error_db < 1.0
        return
    assert effect in {*found.effects, *(name for family in found.families for name in family)}
    assert found.best.rms_error_db < 2.0
    assert found.best.rms_error_db < found.base.rms_error_db
    assert told["candidates"][0]["delta_bic"] == pytest.approx(0.0)
    assert found.where
    assert effect in repr(found)


# Lines 12 kHz apart are hardly wider apart than the receiver's bandwidth; at 4 kHz the pulses run together in pairs.
@pytest.mark.parametrize(
    ("rate_hz", "duty"), [(12.0e3, 0.31), pytest.param(4.0e3, 0.72, marks=pytest.mark.case), pytest.param(27e3, 0.45, marks=pytest.mark.case)]
)
def test_a_chopper_is_found_line_by_line(rate_hz, duty):
    case = problem(1011, ("chopper",), chopper_hz=rate_hz, chopper_duty=duty)
    starts = chopper_starts(case, (), fit_base(case).parameters)
    if rate_hz > 9e3:
        # Line 1000 of the comb within a tenth of the spacing.
        assert min(abs(start["frequency_hz"] / rate_hz - 1) for start in starts) < 1e-4
    found = diagnose_emission(case)
    assert found.effects == ("chopper",)
    # What the receiver's offset and ripple leave, three standard deviations of them.
    assert found.best.rms_error_db < 3 * np.hypot(OFFSET_DB, RIPPLE_DB)
    parameters = found.best.own_parameters("chopper")
    width = parameters["width_s"]["value"] * rate_hz
    assert min(abs(width - duty), abs(1 - width - duty)) < 1e-3


def test_two_effects_are_named_by_their_evidence():
    found = diagnose_emission(problem(1013, ("arc-breakdown", "cable-resonance"), cable_m=6.0, cable_ohm=120.0))
    assert set(found.effects) == {"arc-breakdown", "cable-resonance"}
    assert found.best.rms_error_db < 3 * np.hypot(OFFSET_DB, RIPPLE_DB)
    assert 0 < found.confidence < 1


def weighed(added: tuple[str, ...], score: float, chi2: float = 1.0, rms_error_db: float = 1.0) -> Candidate:
    return Candidate(added, EmissionFit(None, added, {}, chi2, rms_error_db, score, ()), score)


def answer_to(*models: Candidate):
    found = without_doubtful_pairs({tuple(sorted(one.added)): one for one in models})
    singles = sorted((one for key, one in found.items() if len(key) == 1), key=lambda one: -one.score)
    return answer_from(models[0].fit, best_of(found.values()).fit, singles, believe(found))


def test_what_is_said_of_the_models_found():
    arc, jitter, cable = ("arc-breakdown",), ("commutation-jitter",), ("cable-resonance",)
    none = weighed((), 0.0, chi2=5.0, rms_error_db=6.0)
    # Odds of less than 20 to 1 name nothing.
    assert answer_to(weighed((), 0.0), weighed(arc, 2.0)).verdict == "adequate"
    assert answer_to(none, weighed(arc, 2.0)).verdict == "unexplained"
    sure = answer_to(none, weighed(arc, 50.0), weighed(jitter, 20.0))
    assert (sure.verdict, sure.named, sure.families) == ("missing-effect", arc, ())
    alike = answer_to(none, weighed(arc, 50.0), weighed(jitter, 49.0))
    assert (alike.verdict, alike.families) == ("family", ((*arc, *jitter),))
    assert alike.confidence == pytest.approx(sure.confidence)
    # What leaves something is named only where it is most of it, and nothing else comes near.
    most = weighed(arc, 500.0, chi2=4.0, rms_error_db=2.0)
    assert answer_to(none, most, weighed(jitter, 20.0)).confidence < sure.confidence
    near = answer_to(none, most, weighed(jitter, 450.0))
    assert (near.verdict, near.named, len(near.reasons)) == ("unexplained", (), 2)
    # A second effect has to pay for itself, and to leave nothing.
    first = weighed(arc, 50.0)
    assert answer_to(none, first, weighed(jitter, 5.0), weighed((*arc, *cable), 52.0)).named == arc
    assert answer_to(none, first, weighed(jitter, 5.0), weighed((*arc, *cable), 60.0, chi2=4.0)).named == arc
    assert answer_to(none, first, weighed(jitter, 5.0), weighed((*arc, *cable), 60.0)).named == (*arc, *cable)


def test_scatter_and_ripple():
    rng = np.random.default_rng(4)
    slope = np.linspace(60, 20, 3000)
    measured = scatter_db(slope + rng.normal(0.0, 0.5, 3000))
    # The middle of 61 absolute values of a normal distribution is known to 10 to 15 %.
    assert np.median(measured) == pytest.approx(0.5, rel=0.05)
    assert measured.min() > 0.25
    assert scatter_db(slope).max() == pytest.approx(0.1)
    assert scatter_db(slope + 20 * (np.arange(3000) % 3 == 0)).max() == pytest.approx(1.2)
    columns = ripple_columns(SCAN_HZ, 2)
    assert columns.shape[0] == 2 * SCAN_HZ.size
    size = np.sqrt(np.sum(columns**2, axis=1))
    # Half a decibel of the receiver and a fifth of each detector, at the knots.
    assert size[0] == pytest.approx(np.hypot(0.5, 0.2))
    assert 0.4 < size.min() < size.max() < 0.7


def test_stations_are_told_from_a_comb():
    rng = np.random.default_rng(5)
    noise = rng.normal(10.0, 0.4, SCAN_HZ.size)

    def with_lines(lines_hz, dbuv):
        fall = -6.02 * ((SCAN_HZ[:, None] - np.asarray(lines_hz)) / 4.5e3) ** 2
        return 10 * np.log10(10 ** (noise / 10) + np.sum(10 ** ((dbuv + fall) / 10), axis=1))

    levels = {"peak": with_lines([801.2e3, 6.0534e6], 43.0) + 9.0, "average": with_lines([801.2e3, 6.0534e6], 40.0)}
    found = find_stations(SCAN_HZ, levels, BAND_B)
    assert [station.frequency_hz for station in found] == pytest.approx([801.2e3, 6.0534e6], abs=300.0)
    assert [station.average_dbuv for station in found] == pytest.approx([40.0, 40.0], abs=0.5)
    gap = np.delete(np.arange(SCAN_HZ.size), slice(1000, 1003))
    assert len(find_stations(SCAN_HZ[gap], {name: level[gap] for name, level in levels.items()}, BAND_B)) == 2
    comb = with_lines(np.arange(1, 40) * 31e3 + 150e3, 40.0)
    assert find_stations(SCAN_HZ, {"peak": comb, "average": comb}, BAND_B) == ()
    assert find_stations(SCAN_HZ, {"average": noise}, BAND_B) == ()
    assert find_stations(SCAN_HZ[::3], {"average": comb[::3]}, BAND_B) == ()


def test_stations_are_part_of_the_background():
    case = problem(1012, ("background-noise",), broadband_dbuv=12.0, broadband_slope_db=0.0, floor_dbuv=0.0)
    assert case.stations
    found = diagnose_emission(case)
    assert found.effects == ("background-noise",)
    assert found.best.setup().stations == case.stations
    assert not found.base.setup().stations
    assert found.best.rms_error_db < 3 * np.hypot(OFFSET_DB, RIPPLE_DB)


@pytest.mark.case
def test_a_background_sweep_explains_itself():
    case = problem(1005, ("background-noise",), with_background=True)
    base = fit_base(case)
    added = add_effect(case, base, "background-noise")
    assert not any(name.startswith("background-noise") for name in added.parameters)
    assert added.rms_error_db < 0.6 * base.rms_error_db
    again = restored(case, added.to_dict())
    assert again.parameters == dict(added.parameters)
    np.testing.assert_allclose(again.error_db()["peak"][1], added.error_db()["peak"][1])


@pytest.mark.case
def test_without_a_stated_speed_missing_commutations_are_not_named():
    found = diagnose_emission(problem(1006, stated=False))
    assert "commutation-jitter" not in {c.effect.name for c in found.candidates}


def test_too_little_to_work_on():
    with pytest.raises(BadInput, match="no spectrum"):
        Problem([], lambda f: f + 0j, Setup())
    few = Spectrum("peak", SCAN_HZ[:40], np.full(40, 50.0), overload=np.arange(40) > 20)
    with pytest.raises(BadInput, match="too few"):
        Problem([few], lambda f: f + 0j, Setup())


def test_combs():
    rng = np.random.default_rng(3)
    frequency_hz = 150e3 + 4.5e3 * np.arange(1000)
    noise = rng.normal(20.0, 1.0, 1000)
    assert find_comb(frequency_hz, noise) is None
    spacing = 21076.3
    distance = frequency_hz - spacing * np.round(frequency_hz / spacing)
    level = np.maximum(noise, 60.0 - 6 * (distance / 4.5e3) ** 2)
    comb = find_comb(frequency_hz, level)
    assert comb is not None
    assert comb.spacing_hz == pytest.approx(spacing, rel=2e-3)


@pytest.mark.parametrize("points", [20, 1000, 6634])
def test_the_correlation_with_combs_is_a_sum_of_cosines(points):
    """At equal steps it is summed in rows, at others directly."""
    rng = np.random.default_rng(points)
    detail, spacings = rng.normal(0.0, 1.0, points), np.array([9.7e3, 401e3, 2.3e6])
    equal = 150e3 + 4.5e3 * np.arange(points)
    for frequency_hz in (equal, equal + rng.uniform(0, 2e3, points)):
        wanted = [sum(detail * np.cos(2 * np.pi * frequency_hz / spacing)) for spacing in spacings]
        assert sums_of_cosines(frequency_hz, detail, spacings) == pytest.approx(wanted, abs=1e-7)


def test_noise_is_no_comb():
    """Of 20 such spectra one had a comb, when the score that noise has by chance was not considered."""
    frequency_hz = np.linspace(150e3, 30e6, 1500)
    for seed in range(20):
        assert find_comb(frequency_hz, np.random.default_rng(seed).normal(40.0, 3.0, frequency_hz.size), 9e3) is None


def test_what_the_converter_spectra_show():
    spectra = read_spectra(DATA / "emi_spectra_baltic_lab" / "baltic-lab-cispr25-bench.csv")
    seen = {one["id"]: one for one in observations(spectra)}
    assert seen["comb"]["spacing_hz"] == pytest.approx(401e3, rel=0.01)
    assert "not-a-commutator" in seen
    assert "repetition" not in seen
    flyback = {one["id"] for one in observations(read_spectra(DATA / "emi_spectrum_flyback_mdpi" / "mdpi-qrf-flyback.csv"))}
    assert "uneven-steps" in flyback
    assert observations([]) == []


def test_repetition_from_two_detectors():
    frequency_hz = 150e3 + 4.5e3 * np.arange(500)
    level = np.linspace(70, 20, 500)
    peak, average = Spectrum("peak", frequency_hz, level), Spectrum("average", frequency_hz, np.maximum(level - 20, -5))
    assert repetition_from(peak, average) == pytest.approx(958, rel=0.02)
    assert repetition_from(peak, Spectrum("average", frequency_hz, level)) is None
    assert repetition_from(peak, Spectrum("average", frequency_hz[1:], level[1:])) is None


def test_cases_of_the_blind_test():
    assert draw(5, 3) == draw(5, 3)
    cases = [draw(5, index) for index in range(300)]
    assert {name for case in cases for name in case.hidden} == set(SOURCE_EFFECTS)
    assert 0.15 < np.mean([not case.hidden for case in cases]) < 0.35
    stated = cases[0].stated().source.repetition_hz / cases[0].stand().repetition_hz
    assert stated != 1.0
    assert abs(stated - 1) < 0.05


def test_summary_counts():
    def played(hidden: tuple[str, ...], verdict: str, effects: tuple[str, ...] = (), after: float = 0.5) -> PlayedSpectrum:
        return PlayedSpectrum(SpectrumCase(1, 0, hidden, 1), Answer(verdict, effects, (), 0.9, seconds=1.0), 5.0, after)

    weak = replace(played(("lisn-deviation",), "adequate"), detectable=False)
    result = {
        "seed": 1,
        **summary(
            [
                played(("chopper",), "missing-effect", ("chopper",)),
                played(("chopper",), "unexplained", after=4.0),
                played(("arc-breakdown",), "missing-effect", ("chopper",)),
                played((), "adequate"),
                played((), "missing-effect", ("chopper",)),
                weak,
            ]
        ),
    }
    goals = {name.split(":")[0].split(",")[0]: goal["value"] for name, goal in result["goals"].items()}
    assert goals["false alarms"] == 0.5
    assert result["goals"]["effect hidden: name, or family of at most three"]["value"] == pytest.approx(1 / 3)
    assert result["goals"]["error after adding at most 2 dB rms"]["value"] == 1.0
    assert len(result["wrong"]) == 3
    assert "| chopper |" in markdown(result)
    assert "not counted: 1 cases" in markdown(result)


def test_what_is_too_weak_to_see_is_told_from_the_truth():
    assert draw(5, 0).detectable()
    case = SpectrumCase(1, 0, ("chopper",), 1004)
    assert case.detectable()
    frequency_hz = np.geomspace(1e6, 8e6, 1000)
    flat = [Spectrum("average", frequency_hz, np.full(1000, 30.0))]
    bent = [Spectrum("average", frequency_hz, 30.0 + 2.0 * (frequency_hz > 4e6))]
    assert largest_change_db(flat, flat) == 0.0
    assert largest_change_db(flat, bent) == pytest.approx(2.0, rel=0.1)


def test_scoreboard_command(tmp_path):
    done = CliRunner().invoke(app, ["scoreboard", "--spectra", "--cases", "1", "--seed", "2", "--jobs", "1", "--out", str(tmp_path / "board")])
    assert done.exit_code == 0, done.output
    assert "Blind test of spectra: 1 cases, seed 2" in done.output
    assert (tmp_path / "board" / "scoreboard-spectra.json").exists()
