"""Levels that contradict each other, the background, or the physics of a receiver show no pass."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from motoremi.data.corrections import Corrections
from motoremi.data.spectrum import Spectrum
from motoremi.emission.compliance import Compliance, compliance
from motoremi.emission.finals import final_values, judge_with_finals
from motoremi.emission.judge import judge_spectra
from motoremi.emission.limit import find_limit
from motoremi.emission.predict import predict

CISPR32 = find_limit("cispr32-b")
AXIS = 150e3 + 4.5e3 * np.arange(6634)


def flat(detector: str, level_dbuv: float, line_dbuv: float | None = None, **metadata: str) -> Spectrum:
    """A scan of one level, with one line at 1.05 MHz, where the limits are 56 (quasi-peak) and 46 dBuV (average)."""
    level = np.where(np.abs(AXIS - 1.05e6) < 1, level_dbuv if line_dbuv is None else line_dbuv, level_dbuv)
    return Spectrum(detector, AXIS, level, metadata=metadata)


def final(detector: str, level_dbuv: float) -> Spectrum:
    axis = 1.05e6 + np.array([-4.5e3, 0, 4.5e3])
    return Spectrum(detector, axis, level_dbuv - np.array([6, 0, 6]), metadata={"maximum_hz": 1.05e6})


def verdict(spectra: list[Spectrum], finals: list[Spectrum] | None = None, background: tuple[Spectrum, ...] = ()) -> Compliance:
    short = finals or []
    values = final_values(short, Corrections(), CISPR32)
    judged = judge_with_finals(values, short, spectra, CISPR32, 3.4) if short else judge_spectra(spectra, CISPR32)
    return compliance(spectra, short, judged, CISPR32, 3.4, background)


def test_a_quasi_peak_final_value_below_the_average_scan_shows_nothing() -> None:
    scans = [flat("peak", 30, 62), flat("average", 20, 42)]
    found = verdict(scans, [final("quasi-peak", 20), final("average", 41)])
    assert found.verdict == "marginal"
    assert "average: at 1.05 MHz it reads 22.0 dB more than quasi-peak" in "\n".join(found.reasons)
    assert verdict(scans, [final("quasi-peak", 50), final("average", 41)]) == Compliance("pass", ())


@pytest.mark.parametrize(
    ("higher", "lower", "excess_db"),
    [
        (flat("peak", 40), flat("quasi-peak", 49), 9.0),
        (flat("peak", 36), flat("average", 42.5), 6.5),
        (flat("quasi-peak", 36), flat("average", 42.5), 6.5),
    ],
)
def test_a_detector_that_reads_less_than_it_can_bounds_nothing(higher: Spectrum, lower: Spectrum, excess_db: float) -> None:
    """The peak scan alone would pass against both limits."""
    assert verdict([higher]).verdict == "pass"
    found = verdict([higher, lower])
    assert found.verdict == "marginal"
    assert f"it reads {excess_db:.1f} dB more than {higher.detector}, which reads no less of a steady disturbance" in "\n".join(found.reasons)


def test_a_final_value_far_above_the_peak_scan_shows_nothing_of_the_rest() -> None:
    found = verdict([flat("peak", 40, 46.5), flat("average", 20)], [final("quasi-peak", 52.6)])
    assert found.verdict == "marginal"
    assert "quasi-peak: at 1.05 MHz it reads 6.1 dB more than peak" in found.reasons[0]


@pytest.mark.parametrize(
    "spectra",
    [
        # A few dB from one scan to the next.
        [flat("peak", 40), flat("quasi-peak", 45.9)],
        # Noise of the receiver with more attenuation, far below the limit.
        [flat("peak", 20), flat("average", 30)],
        # The average over a part of a burst.
        [flat("quasi-peak", 30), Spectrum("average", AXIS, np.full(AXIS.size, 42.0), metadata={"settings": {"dwell_s": 0.02}})],
    ],
)
def test_what_may_be(spectra: list[Spectrum]) -> None:
    assert verdict(spectra) == Compliance("pass", ())


def test_bandwidths_that_differ_are_not_compared() -> None:
    wide = Spectrum("average", AXIS, np.full(AXIS.size, 42.0), resolution_bandwidth_hz=120e3)
    assert "reads 6" not in "\n".join(verdict([flat("peak", 35), wide]).reasons)


def test_lines_of_the_lisn_are_not_compared() -> None:
    assert verdict([flat("peak", 35, line="L1"), flat("average", 42, line="N"), flat("peak", 42, line="N")]) == Compliance("pass", ())


def test_a_background_above_the_running_motor_shows_nothing() -> None:
    off = flat("quasi-peak", 20, 75, condition="motor off")
    found = verdict([flat("quasi-peak", 30, 40.1), flat("average", 10)], background=(off,))
    assert found.verdict == "marginal"
    assert found.reasons == (
        "quasi-peak with the motor off: at 1.05 MHz it reads 34.9 dB more than with the motor running: are the files exchanged, or did the "
        "surroundings change? Measure both again",
    )


def test_surroundings_that_may_be_the_cause_of_a_fail_are_named() -> None:
    running = [flat("quasi-peak", 30, 75.1), flat("average", 10)]
    found = verdict(running, background=(flat("quasi-peak", 20, 75, condition="motor off"),))
    assert found.verdict == "fail"
    assert found.reasons[-1] == (
        "quasi-peak: at 1.05 MHz the level with the motor off is 0.1 dB lower: the surroundings may be the cause; measure in a shielded room"
    )
    quiet = verdict(running, background=(flat("quasi-peak", 20, 65, condition="motor off"),))
    assert "surroundings" not in "\n".join(quiet.reasons)


def test_levels_below_thermal_noise_show_nothing() -> None:
    found = verdict([flat("quasi-peak", -60), flat("average", -65)])
    assert found.verdict == "marginal"
    assert found.reasons[0] == (
        "quasi-peak: half of the levels are below -60 dBuV, less than the thermal noise of 50 Ohm (-27 dBuV): is the unit dBm?"
    )
    assert verdict([flat("quasi-peak", -20), flat("average", -25)]).verdict == "pass"


def test_points_far_below_thermal_noise_were_not_measured() -> None:
    """Programs write -200 where a receiver gave no level."""
    holes = flat("quasi-peak", 30)
    marked = np.where((AXIS > 0.95e6) & (AXIS < 1.05e6), -200.0, holes.level_dbuv)
    found = verdict([Spectrum("quasi-peak", AXIS, marked, 9e3), flat("average", 10)])
    assert found.verdict == "marginal"
    assert (
        "read down to -200 dBuV, far below the thermal noise of 50 Ohm (-27 dBuV), so they were not measured: remove these rows" in found.reasons[0]
    )


def test_levels_above_ten_volts_are_doubted() -> None:
    found = verdict([flat("quasi-peak", 155), flat("average", 10)])
    assert found.verdict == "fail"
    assert "quasi-peak: up to 155 dBuV, more than 10 V: is the unit right, and was a correction applied twice?" in found.reasons


def test_where_nothing_was_measured_no_background_is_told() -> None:
    """A current is not predicted, so that a model of the motor alone shows nothing of it."""
    probe = Corrections.of([{"name": "probe", "kind": "transducer", "unit": "dB(1/Ohm)", "db": 5.0}], "test")
    limit = dataclasses.replace(CISPR32, unit="dBuA")
    told = predict(lambda hertz: np.full(np.shape(hertz), 50.0 + 0j), limit=limit, corrections=probe)
    assert (told.verdict, told.judged_what) == ("marginal", "predicted")
    assert not any("motor off" in reason for reason in told.reasons)


def test_a_background_alone_is_compared_with_the_limit_and_passes_nothing() -> None:
    off = flat("peak", 20, 43, condition="motor off")
    told = predict(None, spectra=[off], limit=CISPR32)
    assert (told.verdict, told.judged_what) == ("marginal", "background")
    assert told.reasons == (
        "measured with the motor off only, which shows nothing of the motor",
        "peak with the motor off: peak is below the quasi-peak limit by 13.0 dB at 1.05 MHz; 6 dB below are wanted",
        "peak with the motor off: peak is below the average limit by 3.0 dB at 1.05 MHz; 6 dB below are wanted: measure in a shielded room",
    )
    assert told.measured_dbuv()["peak"].max() == 43
