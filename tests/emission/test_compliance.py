"""The verdict on all levels together, and what of the limit they leave open."""

from __future__ import annotations

import time

import numpy as np
import pytest

from motoremi.data.corrections import Corrections
from motoremi.data.spectrum import Spectrum
from motoremi.emission.compliance import Compliance, compliance
from motoremi.emission.finals import Rules, choose_maxima, final_values, judge_with_finals
from motoremi.emission.judge import judge_spectra
from motoremi.emission.limit import Limit, LimitLine, find_limit
from motoremi.emission.predict import predict
from motoremi.emission.setup import Setup
from motoremi.emission.spectrum_problem import Problem

CISPR32 = find_limit("cispr32-b")
CISPR25 = find_limit("cispr25-class5")
AXIS = 150e3 + 4.5e3 * np.arange(6634)


def flat(detector: str, level_dbuv: float, axis=AXIS, **more) -> Spectrum:
    settings = {name: more.pop(name) for name in ("resolution_bandwidth_hz", "overload") if name in more}
    return Spectrum(detector, axis, np.full(axis.shape, level_dbuv), metadata=more, **settings)


def with_level(spectrum: Spectrum, level_dbuv: float, low_hz: float, high_hz: float) -> Spectrum:
    inside = (spectrum.frequency_hz >= low_hz) & (spectrum.frequency_hz <= high_hz)
    return Spectrum(spectrum.detector, spectrum.frequency_hz, np.where(inside, level_dbuv, spectrum.level_dbuv), metadata=spectrum.metadata)


def verdict(spectra, limit: Limit = CISPR32, finals=()) -> Compliance:
    judged = judge_with_finals(final_values(finals, Corrections(), limit), finals, spectra, limit, 3.4) if finals else judge_spectra(spectra, limit)
    return compliance(spectra, finals, judged, limit, 3.4)


def final(detector: str, hertz: float, level_dbuv: float, **more) -> Spectrum:
    """A final value at a frequency of the scans."""
    at_hz = float(AXIS[np.argmin(np.abs(AXIS - hertz))])
    axis = at_hz + np.array([-4.5e3, -2.25e3, 0, 2.25e3, 4.5e3])
    return Spectrum(detector, axis, level_dbuv - np.array([6, 2, 0, 2, 6]), metadata={"maximum_hz": at_hz, **more})


def line_at(detector: str, hertz: float, level_dbuv: float, **more) -> Spectrum:
    """A scan of 20 dBuV with one line."""
    return with_level(flat(detector, 20, **more), level_dbuv, hertz - 2.2e3, hertz + 2.2e3)


def test_low_levels_of_both_detectors_over_the_whole_span_pass_without_a_remark():
    assert verdict([flat("quasi-peak", 40), flat("average", 30)]) == Compliance("pass", ())


def test_a_line_that_was_only_scanned_with_peak_above_the_limit_is_not_shown_to_comply():
    n = with_level(flat("peak", 30, line="N"), 90, 1e6, 1.1e6)
    found = verdict([flat("quasi-peak", 40, line="L1"), flat("average", 30, line="L1"), n])
    assert found.verdict == "marginal"
    assert found.reasons[0] == (
        "line N: quasi-peak: peak is not below that limit by the guard band at 998.2 kHz - 1.102 MHz; measure quasi-peak there"
    )


def test_the_failing_line_is_named():
    spectra = [
        flat(detector, level, line=line)
        for line, high in (("L1", 0), ("N", 22))
        for detector, level in (("quasi-peak", 40 + high), ("average", 30))
    ]
    found = verdict(spectra)
    assert found.verdict == "fail"
    assert found.reasons == ("line N: quasi-peak: above the quasi-peak limit by 6.0 dB at 0.501 MHz",)
    assert {one.what for one in judge_spectra(spectra, CISPR32)} == {
        f"{detector}, line {line}" for detector in ("quasi-peak", "average") for line in ("L1", "N")
    }


def test_a_part_of_the_span_is_judged_and_the_rest_is_told():
    part = AXIS[(AXIS >= 1e6) & (AXIS <= 2e6)]
    found = verdict([flat("quasi-peak", 40, part), flat("average", 30, part)])
    assert found.verdict == "pass"
    assert (
        "quasi-peak: not measured at 150 kHz - 996 kHz, 2.004 MHz - 30 MHz; the verdict is on the rest, 13 % of the limit's span" in found.reasons
    )


def test_every_gap_of_every_detector_is_told_as_numbers():
    part = AXIS[(AXIS >= 1e6) & (AXIS <= 2e6)]
    found = predict(None, spectra=[flat("quasi-peak", 40, part, line="N"), flat("average", 30, line="N")], limit=CISPR32).to_dict()
    assert [(gap["detector"], gap["conductor"], np.round(np.array(gap["band_hz"]), -3).tolist()) for gap in found["not_measured"]] == [
        ("quasi-peak", "N", [150e3, 996e3]),
        ("quasi-peak", "N", [2.004e6, 30e6]),
    ]
    assert [gap.detector for gap in verdict([flat("average", 30)]).gaps] == ["quasi-peak"]
    assert verdict([flat("quasi-peak", 40), flat("average", 30)]).gaps == ()


def test_two_scans_of_one_detector_are_one():
    low, high = AXIS[AXIS < 1e6], AXIS[AXIS >= 1e6]
    spectra = [flat("quasi-peak", 40, low), flat("quasi-peak", 40, high), flat("average", 30)]
    assert verdict(spectra) == Compliance("pass", ())
    assert [(one.detector, one.points) for one in judge_spectra(spectra, CISPR32) if one.detector == "quasi-peak"] == [
        ("quasi-peak", AXIS.size)
    ] * 2


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("part", [AXIS, AXIS[(AXIS > 400e3) & (AXIS < 900e3)]])
def test_a_repeat_that_reads_less_does_not_cancel_a_peak(first, part):
    """At 600 kHz the limits are 56 dBuV (quasi-peak) and 46 dBuV (average)."""
    scans = [with_level(flat("peak", 16, line="L1"), 60, 599e3, 601e3), flat("peak", 16, part, line="L1")]
    found = verdict(scans if first else scans[::-1])
    assert found.verdict == "marginal"
    assert found.reasons == tuple(
        f"line L1: {line}: peak is not below that limit by the guard band at 597.8 kHz - 602.2 kHz; measure {line} there"
        for line in ("quasi-peak", "average")
    )


def test_another_detector_below_the_limit_decides_where_every_peak_scan_is_above_it():
    scans = [with_level(flat("peak", 16), 60, 599e3, 601e3), flat("peak", 16), flat("quasi-peak", 30), flat("average", 20)]
    assert verdict(scans) == Compliance("pass", ())


def test_a_repeat_with_the_right_bandwidth_replaces_one_that_reads_too_high():
    assert verdict([flat("peak", 60, resolution_bandwidth_hz=120e3), flat("peak", 30)]).verdict == "pass"


@pytest.mark.slow
def test_a_long_scan_that_crosses_the_limit_at_every_point_is_judged_quickly():
    axis = np.linspace(150e3, 30e6, 100_001)
    zigzag = Spectrum("peak", axis, np.where(np.arange(axis.size) % 2, 80.0, 20.0))
    begin = time.perf_counter()
    assert verdict([zigzag, zigzag]).verdict == "marginal"
    assert time.perf_counter() - begin < 20


def test_a_gap_inside_a_spectrum_is_not_measured():
    axis = AXIS[(AXIS < 1e6) | (AXIS > 5e6)]
    found = verdict([flat("quasi-peak", 40, axis), flat("average", 30, axis)])
    assert found.reasons[0] == "quasi-peak: not measured at 1 MHz - 4.996 MHz; the verdict is on the rest, 70 % of the limit's span"


def test_overloaded_readings_leave_the_verdict_open():
    overload = (AXIS > 200e3) & (AXIS < 20e6)
    found = verdict([flat("quasi-peak", 40, overload=overload), flat("average", 30)])
    assert found.verdict == "marginal"
    assert found.reasons == ("quasi-peak: the receiver was overloaded at 201.8 kHz - 20 MHz",)


@pytest.mark.parametrize("first", [True, False])
def test_a_clean_repeat_does_not_cancel_an_overloaded_scan_above_the_limit(first):
    loud = Spectrum("quasi-peak", AXIS, np.where(AXIS < 1e6, 70, 16), overload=AXIS < 1e6)
    found = verdict([loud, flat("quasi-peak", 16)] if first else [flat("quasi-peak", 16), loud])
    assert found.verdict == "marginal"
    assert found.reasons[0].startswith("quasi-peak: a scan reads up to 70.0 with the receiver overloaded at 150 kHz - 998.2 kHz")


def test_a_clean_repeat_replaces_an_overloaded_scan_below_the_limit():
    assert verdict([flat("quasi-peak", 20, overload=AXIS < 1e6), flat("quasi-peak", 16)]) == Compliance("pass", ())


@pytest.mark.parametrize(
    ("bandwidth_hz", "level_dbuv", "wanted", "says"),
    [
        (200.0, 40, "marginal", "reads too low: measure with 9 kHz"),
        (200.0, 80, "fail", "above the quasi-peak limit"),
        (10e3, 80, "fail", "above the quasi-peak limit"),
        (120e3, 80, "marginal", "reads too high: measure with 9 kHz"),
    ],
)
def test_a_bandwidth_of_another_band_shows_only_what_it_can(bandwidth_hz, level_dbuv, wanted, says):
    found = verdict([flat("quasi-peak", level_dbuv, resolution_bandwidth_hz=bandwidth_hz), flat("average", 30)])
    assert found.verdict == wanted
    assert says in found.reasons[0]


def test_band_a_is_measured_with_its_own_bandwidth():
    low = 9e3 + 100 * np.arange(1411)
    assert verdict([flat("quasi-peak", 40, low, resolution_bandwidth_hz=200.0), flat("quasi-peak", 40), flat("average", 30)]).verdict == "pass"


def test_a_wide_bandwidth_that_passes_has_passed():
    assert verdict([flat("quasi-peak", 40, resolution_bandwidth_hz=120e3), flat("average", 30, resolution_bandwidth_hz=120e3)]).verdict == "pass"


def test_a_peak_limit_is_an_alternative_to_the_quasi_peak_limit():
    assert verdict([flat("peak", 30), flat("average", 10)], CISPR25) == Compliance("pass", ())
    assert verdict([flat("peak", 60), flat("quasi-peak", 20), flat("average", 10)], CISPR25).verdict == "pass"
    assert verdict([flat("peak", 60), flat("average", 10)], CISPR25).verdict == "marginal"
    assert verdict([flat("peak", 90), flat("quasi-peak", 80), flat("average", 10)], CISPR25).verdict == "fail"


def test_a_missing_detector_is_the_reason():
    assert verdict([flat("average", 30)]) == Compliance("marginal", ("quasi-peak: not measured",))


@pytest.mark.parametrize("detector", ["peak", "quasi-peak"])
def test_a_scan_outside_of_the_limit_shows_nothing(detector):
    found = verdict([flat(detector, 0, AXIS + 40e6)])
    assert found == Compliance("marginal", ("quasi-peak: not measured", "average: not measured"))


def test_a_maximum_above_the_limit_without_a_final_value_is_not_shown_to_comply():
    peaks = with_level(with_level(flat("peak", 30), 70, 1.2749e6, 1.2751e6), 70, 2.998e6, 2.9986e6)
    spectra = [peaks, flat("average", 20)]
    finals = [Spectrum("quasi-peak", [1.2705e6, 1.275e6], [50, 50], metadata={"maximum_hz": hertz}) for hertz in (1.275e6, 2.9985e6)]
    assert verdict(spectra, finals=finals).verdict == "pass"
    found = verdict(spectra, finals=finals[:1])
    assert found.verdict == "marginal"
    assert found.reasons[0].startswith(
        "quasi-peak: 1 maximum of the scans is above that limit and has no final value, the highest by 14.0 dB at 2.9985 MHz"
    )


LONG, SHORT = {"dwell_s": 1.0}, {"dwell_s": 0.02}


@pytest.mark.parametrize(
    ("scanned", "level_dbuv", "settings", "read", "says"),
    [
        ("quasi-peak", 67, LONG, 38, "29.0 dB below the quasi-peak scan, which is 7.0 dB above that limit: was the motor still running?"),
        ("cispr-average", 57, LONG, 38, "19.0 dB below the cispr-average scan, which is 7.0 dB above that limit: was the motor still running?"),
        ("average", 57, LONG, 38, "19.0 dB below the average scan, which is 7.0 dB above that limit: was the motor still running?"),
        ("quasi-peak", 64, SHORT, 56, "8.0 dB below the quasi-peak scan, which is 4.0 dB above that limit: was the motor still running?"),
        # Both below the guard band, but not of the same disturbance.
        ("quasi-peak", 55, LONG, 38, "17.0 dB below the quasi-peak scan, which is 5.0 dB below that limit: was the motor still running?"),
        ("quasi-peak", 58, LONG, 56, "2.0 dB below the quasi-peak scan, which is 2.0 dB below that limit: the higher reading counts"),
    ],
)
def test_a_final_value_does_not_cancel_a_higher_scan_by_the_same_detector(scanned, level_dbuv, settings, read, says):
    """At 20 MHz the limits are 60 dBuV (quasi-peak) and 50 dBuV (average)."""
    detector = "quasi-peak" if scanned == "quasi-peak" else "cispr-average"
    spectra = [line_at("peak", 20e6, 68), line_at(scanned, 20e6, level_dbuv, settings=settings)]
    found = verdict(spectra, finals=[final("quasi-peak", 20e6, min(read, 59)), final(detector, 20e6, read)])
    assert found.verdict == "marginal"
    assert f"at 19.9995 MHz the {detector} final value is {says}" in found.reasons[0]


@pytest.mark.parametrize(
    ("scanned", "level_dbuv", "settings", "read"),
    [
        # A few dB are usual.
        ("quasi-peak", 55, LONG, 52),
        # A part of a burst.
        ("average", 57, SHORT, 38),
        # Noise of the receiver.
        ("quasi-peak", 45, LONG, 30),
    ],
)
def test_a_final_value_may_be_below_a_scan(scanned, level_dbuv, settings, read):
    spectra = [line_at("peak", 20e6, 68), line_at(scanned, 20e6, level_dbuv, settings=settings)]
    finals = [final("quasi-peak", 20e6, read), final("cispr-average", 20e6, min(read, 40))]
    assert verdict(spectra, finals=finals).verdict == "pass"


def test_an_overloaded_scan_below_the_limit_does_not_contradict_a_final_value():
    lines = line_at("quasi-peak", 20e6, 55, settings=LONG)
    overloaded = Spectrum("quasi-peak", AXIS, lines.level_dbuv, overload=lines.level_dbuv > 50)
    spectra = [overloaded, flat("quasi-peak", 20), flat("average", 20)]
    assert verdict(spectra, finals=[final("quasi-peak", 20e6, 38)]) == Compliance("pass", ())


def test_a_maximum_inside_the_guard_band_of_the_limits_own_detector_needs_a_final_value():
    lines = with_level(line_at("cispr-average", 20e6, 45), 49.9, 6.998e6, 7.002e6)
    spectra, finals = [line_at("peak", 20e6, 59), lines], [final("quasi-peak", 20e6, 50), final("cispr-average", 20e6, 44)]
    found = verdict(spectra, finals=finals)
    assert found.verdict == "marginal"
    assert found.reasons[0].startswith(
        "average: 1 maximum of the scans is inside the guard band of that limit and has no final value, the highest 0.1 dB below the limit at 6.9"
    )
    assert verdict(spectra, finals=[*finals, final("cispr-average", 7e6, 45)]).reasons[0].endswith("the higher reading counts")


def test_a_maximum_beside_one_that_was_measured_again_is_not_measured_again():
    """20 kHz apart, and the final measurement is 9 kHz wide."""
    lines = with_level(line_at("quasi-peak", 20e6, 55), 59.5, 20.018e6, 20.022e6)
    found = verdict([line_at("peak", 20e6, 68), lines, flat("average", 20)], finals=[final("quasi-peak", 20e6, 54)])
    assert found.reasons[0].startswith("quasi-peak: 1 maximum of the scans is inside the guard band")


def test_a_line_without_final_values_is_judged_by_its_scans():
    scans = [flat("quasi-peak", 70 if line == "N" else 40, line=line) for line in ("L1", "N")] + [flat("average", 20, line="L1")]
    found = verdict(scans, finals=[final("quasi-peak", 20e6, 38, line="L1")])
    assert found.verdict == "fail"
    assert found.reasons[0].startswith("line N: quasi-peak: above the quasi-peak limit by 14.0 dB")


def test_final_values_and_scans_are_compared_with_their_corrections():
    pad = Corrections.of([{"name": "pad", "role": "receiver", "kind": "loss", "db": 10.0}], "test")
    spectra = [line_at("quasi-peak", 20e6, 45, settings=LONG), flat("average", 20)]
    told = predict(None, spectra=spectra, finals=[final("quasi-peak", 20e6, 44)], limit=CISPR32, corrections=pad)
    assert (told.verdict, told.reasons) == ("pass", ())


def noise(detector: str, seed: int, resolution_db: float = 0.01, **more) -> Spectrum:
    level = np.random.default_rng(seed).normal(16, 2, AXIS.size)
    return Spectrum(detector, AXIS, np.round(level / resolution_db) * resolution_db, metadata=more)


def test_scans_with_different_detectors_that_are_equal_at_every_point_pass_nothing():
    spectra = [noise(detector, 1, line="L1") for detector in ("peak", "quasi-peak", "average")]
    told = predict(None, spectra=[noise("peak", 1, condition="motor off"), *spectra], limit=CISPR32)
    assert told.verdict == "marginal"
    assert told.reasons == (
        "peak with the motor off; peak, line L1; quasi-peak, line L1 and average, line L1 have the same level at every point, so the receiver did "
        "not measure anew: set its trace to clear/write and measure again",
    )
    assert predict(None, spectra=[noise("peak", 1, condition="motor off"), noise("peak", 1)], limit=CISPR32).verdict == "marginal"


@pytest.mark.parametrize(
    "spectra",
    [
        [noise("quasi-peak", 1), noise("average", 2)],
        # 1 and 3 dB steps: most points are equal.
        [noise("quasi-peak", 1, 1.0), noise("average", 2, 1.0)],
        [noise("quasi-peak", 1, 3.0), noise("average", 2, 3.0)],
        # The lowest level that the receiver shows.
        [flat("quasi-peak", 10), flat("average", 10)],
        # A repeat is of the same detector.
        [noise("quasi-peak", 1), noise("quasi-peak", 1), noise("average", 2)],
    ],
)
def test_scans_that_are_equal_at_most_points_are_no_finding(spectra):
    assert predict(None, spectra=spectra, limit=CISPR32).reasons == ()


def test_final_values_on_a_line_without_scans_are_judged():
    """Such a value 34 dB above the limit passed."""
    high = [final("quasi-peak", 1e6, 90, line="L1"), final("average", 1e6, 20, line="L1")]
    low = [final("quasi-peak", 1e6, 40, line="L1"), final("average", 1e6, 20, line="L1")]
    above = "quasi-peak: final value above the quasi-peak limit by 34.0 dB at 1.0005 MHz"
    # Scans of which the line is not stated are those of L1 too.
    assert verdict([flat("peak", 30)], finals=high) == Compliance("fail", (above,))
    assert verdict([flat("peak", 30)], finals=low) == Compliance("pass", ())
    # Those of another line are not.
    assert verdict([flat("peak", 30, line="N")], finals=high) == Compliance("fail", (f"line L1: {above}", "line L1: average: not measured"))
    assert verdict([flat("peak", 30, line="N")], finals=low).verdict == "marginal"
    state = [flat("peak", 30, operating="full load")]
    assert verdict(state, finals=[final("quasi-peak", 1e6, 90, line="L1", operating="full load")]).verdict == "fail"
    assert verdict(state, finals=[final("quasi-peak", 1e6, 90)]).verdict == "fail"


def test_final_values_that_the_receivers_file_holds_leave_it_open():
    spectra = [flat("quasi-peak", 40, final_values_left_out="2 final values in the file are left out"), flat("average", 30)]
    assert verdict(spectra) == Compliance("marginal", ("2 final values in the file are left out",))


def test_every_part_with_a_limit_has_a_maximum():
    """On the slope of a peak between two limited parts the highest points are at the edges of these parts."""
    limit = Limit("notch", "notch", (LimitLine("quasi-peak", ((1.226e6, 1.235e6, 60, 60), (1.26e6, 1.29e6, 84, 84)), False, "test"),))
    slope = Spectrum("quasi-peak", AXIS, np.maximum(90 - np.abs(AXIS - 1.275e6) / 10e3, 0))
    chosen, _ = choose_maxima([slope], limit, Rules(apart_hz=5e3, margin_db=30))
    assert [one.frequency_hz for one in chosen] == [1.2345e6, 1.275e6]


def test_a_prediction_has_the_highest_level_of_every_detector_at_all_frequencies():
    low = 9e3 + 1e3 * np.arange(141)
    spectra = [flat("quasi-peak", 40, low, resolution_bandwidth_hz=200.0), flat("quasi-peak", 40, line="L1"), flat("quasi-peak", 62, line="N")]
    told = predict(None, spectra=spectra, limit=CISPR32)
    level = told.measured_dbuv()["quasi-peak"]
    assert (told.frequency_hz[0], told.frequency_hz[-1]) == (9e3, AXIS[-1])
    assert np.unique(level[told.frequency_hz > 151e3]) == pytest.approx([62.0])
    assert np.unique(level[told.frequency_hz < 147e3]) == pytest.approx([40.0])


def test_a_list_of_maxima_is_no_scan_of_the_whole_span():
    """Five levels in 30 MHz passed, and only one of the gaps between them was reported."""
    maxima = np.array([154.5e3, 411e3, 1.275e6, 8.55e6, 21.1e6])
    found = verdict([flat("quasi-peak", 20, maxima), flat("average", 10, maxima)])
    assert found.verdict == "pass"
    assert found.reasons == tuple(
        f"{detector}: not measured at 163.5 kHz - 402 kHz, 420 kHz - 1.266 MHz, 1.284 MHz - 8.541 MHz, 8.559 MHz - 21.09 MHz and 1 more span; "
        "the verdict is on the rest, 2.8 % of the limit's span"
        for detector in ("quasi-peak", "average")
    )


def test_steps_wider_than_half_the_bandwidth_are_told():
    coarse = AXIS[::2]
    told = predict(None, spectra=[flat("quasi-peak", 40, coarse), flat("average", 30)], limit=CISPR32).remarks()
    assert "quasi-peak: steps of 9 kHz are wider than half the bandwidth of 9 kHz: lines may be missed or read too low" in told
    assert not any(text.startswith("average: steps") for text in told)


def test_a_fit_of_spectra_uses_no_level_outside_of_a_scan():
    inside = AXIS <= 1e6
    problem = Problem([flat("peak", 60), flat("average", 40, AXIS[inside])], lambda hertz: np.full(hertz.shape, 50.0 + 0j), Setup())
    # A step beyond its end the nearest point is still the last one.
    assert problem.grid_hz[-1] <= AXIS[inside][-1] + 4.5e3
    assert np.unique(problem.measured_dbuv) == pytest.approx([40.0, 60.0])
