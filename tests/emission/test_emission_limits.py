"""Limits and verdicts."""

from __future__ import annotations

import numpy as np
import pytest

from motoremi.data.spectrum import Spectrum
from motoremi.emission.band import misread
from motoremi.emission.judge import EXPANDED_UNCERTAINTY_DB, judge_prediction, judge_spectra, overall
from motoremi.emission.limit import Limit, LimitLine, find_limit, limit_names
from motoremi.errors import BadInput


def level(name: str, detector: str, frequency_hz: float) -> float:
    line = find_limit(name).line(detector)
    assert line is not None
    return float(line.level_dbuv(np.array([frequency_hz]))[0])


@pytest.mark.parametrize(
    ("name", "detector", "frequency_hz", "wanted"),
    [
        ("cispr32-b", "quasi-peak", 150e3, 66),
        ("cispr32-b", "quasi-peak", np.sqrt(150e3 * 500e3), 61),
        ("cispr32-b", "average", 500e3, 46),
        ("cispr32-b", "quasi-peak", 5e6, 56),  # the lower one at a step
        ("cispr32-b", "quasi-peak", 5.001e6, 60),
        ("cispr32-a", "quasi-peak", 500e3, 73),
        ("cispr32-a", "average", 400e3, 66),
        ("cispr14-1", "average", 150e3, 59),
        ("cispr14-1-tools-1000w", "quasi-peak", 1e6, 63),
        ("cispr25-class5", "peak", 200e3, 70),
        ("cispr25-class3", "quasi-peak", 1e6, 57),
        ("cispr25-class1", "average", 6e6, 57),
        ("cispr25-class3", "quasi-peak", 27e6, 43),
    ],
)
def test_levels(name, detector, frequency_hz, wanted):
    assert level(name, detector, frequency_hz) == pytest.approx(wanted)


@pytest.mark.parametrize("name", [name for name in limit_names() if name.startswith("cispr25")])
def test_the_bands_of_the_standard_that_a_limit_lacks_are_noted(name):
    limit = find_limit(name)
    assert max(segment[1] for line in limit.lines for segment in line.segments) == 28e6
    assert any("the bands of the standard above 28 MHz, up to 108 MHz, are not in this limit" in remark for remark in limit.remarks())


def test_gaps_have_no_limit():
    for frequency_hz in (100e3, 400e3, 2e6, 10e6, 29e6, 35e6):
        assert np.isnan(level("cispr25-class5", "average", frequency_hz))


def test_every_file_says_where_its_values_come_from():
    assert {"cispr32-a", "cispr32-b", "cispr11-a", "cispr11-b", "cispr14-1", "cispr25-class5"} <= set(limit_names())
    for name in limit_names():
        limit = find_limit(name)
        assert all(line.source for line in limit.lines)
        assert len(limit.remarks()) >= len(limit.unconfirmed)
    # As the references have it: only these were found in a second source.
    confirmed = {(name, line.detector) for name in limit_names() for line in find_limit(name).lines if line.confirmed}
    assert confirmed == {("cispr32-b", "quasi-peak"), ("cispr32-b", "average"), ("cispr32-a", "quasi-peak")}


def spectrum(detector: str, level_dbuv: float, overload=None) -> Spectrum:
    frequency_hz = np.linspace(600e3, 4.9e6, 100)
    return Spectrum(detector, frequency_hz, np.full(100, level_dbuv), overload=overload)


def test_guard_band():
    limit = find_limit("cispr32-b")  # 56 and 46 dBuV between 0.5 and 5 MHz
    for below_db, wanted in ((4.0, "pass"), (3.4, "pass"), (3.3, "marginal"), (-3.3, "marginal"), (-3.5, "fail")):
        judged = judge_spectra([spectrum("quasi-peak", 56 - below_db), spectrum("average", 30)], limit)
        assert overall(judged, limit) == wanted, below_db
    assert EXPANDED_UNCERTAINTY_DB == 3.4
    tight = judge_spectra([spectrum("quasi-peak", 55.0), spectrum("average", 30)], limit, 0.5)
    assert overall(tight, limit) == "pass"


def test_a_limit_line_belongs_to_a_detector():
    limit = find_limit("cispr32-b")
    low = judge_spectra([spectrum("peak", 40.0)], limit)
    assert {one.line: one.verdict for one in low} == {"quasi-peak": "pass", "average": "pass"}
    assert overall(low, limit) == "pass"
    middle = judge_spectra([spectrum("peak", 50.0)], limit)
    assert {one.line: one.verdict for one in middle} == {"quasi-peak": "pass", "average": None}
    assert overall(middle, limit) == "marginal"
    high = judge_spectra([spectrum("peak", 90.0)], limit)
    assert [one.verdict for one in high] == [None, None]
    assert "measure with the quasi-peak detector" in high[0].why
    assert overall(high, limit) == "marginal"
    # Average tells nothing on quasi-peak.
    assert [one.line for one in judge_spectra([spectrum("average", 30.0)], limit)] == ["average"]
    assert overall(judge_spectra([spectrum("average", 30.0)], limit), limit) == "marginal"


def test_overloaded_points_are_not_judged():
    limit, marks = find_limit("cispr32-b"), np.zeros(100, dtype=bool)
    marks[50] = True
    bad = np.full(100, 30.0)
    bad[50] = 120.0
    marked = Spectrum("average", np.linspace(600e3, 4.9e6, 100), bad, overload=marks)
    (judged,) = judge_spectra([marked], limit)
    assert judged.verdict == "pass"
    assert judged.left_out == 1


def test_a_limit_that_covers_nothing_says_so():
    limit = find_limit("cispr25-class5")
    (peak, *_) = judge_spectra([Spectrum("peak", [2e6, 3e6, 5e6], [90, 90, 90])], limit)
    assert peak.verdict is None
    assert "does not cover" in peak.why
    assert overall([peak], limit) == "marginal"


def test_predictions_are_judged_detector_by_detector():
    limit, frequency_hz = find_limit("cispr32-b"), np.linspace(150e3, 30e6, 500)
    levels = {"peak": np.full(500, 100.0), "quasi-peak": np.full(500, 40.0), "average": np.full(500, 20.0)}
    judged = judge_prediction(frequency_hz, levels, limit)
    assert [(one.detector, one.line) for one in judged] == [("quasi-peak", "quasi-peak"), ("average", "average")]
    assert overall(judged, limit) == "pass"


def test_limits_of_ones_own(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('title = "mine"\n[[line]]\ndetector = "average"\nsegments = [[150e3, 30e6, 50, 40]]\n')
    mine = find_limit(file)
    assert mine.unconfirmed == ("average",)
    assert mine.lines[0].level_dbuv(np.array([30e6]))[0] == 40
    for text, words in (
        ("x = [", "not TOML"),
        ('title = "a"', r"at least one \[\[line\]\]"),
        ('[[line]]\ndetector = "loud"', "belongs to a detector"),
        ('[[line]]\ndetector = "peak"', "no segments"),
        ('[[line]]\ndetector = "peak"\nsegments = [[3, 2, 1, 1]]', "0 < low < high"),
        ('[[line]]\ndetector = "peak"\nsegments = [[1, 3, 1, 1], [2, 4, 1, 1]]', "overlap"),
        ('[[line]]\ndetector = "peak"\nsegments = [[1, 3, 1, 1]]\n[[line]]\ndetector = "peak"\nsegments = [[1, 3, 1, 1]]', "two lines"),
    ):
        file.write_text(text)
        with pytest.raises(BadInput, match=words):
            find_limit(file)
    with pytest.raises(BadInput, match="unknown limit"):
        find_limit("cispr99")
    with pytest.raises(BadInput, match="no such file"):
        find_limit(tmp_path / "none.toml")
    with pytest.raises(BadInput, match="uncertainty"):
        judge_spectra([spectrum("average", 30.0)], find_limit("cispr32-b"), -1)


def test_at_30_mhz_the_bandwidth_of_the_band_above_is_right_too():
    """Every scan of radiated disturbances begins there, with 120 kHz."""
    at_30_mhz = np.array([29.9e6, 30e6, 30.1e6])
    assert misread(at_30_mhz, 120e3, low=False).tolist() == [True, False, False]
    assert not misread(at_30_mhz, 9e3, low=False).any()
    assert misread(at_30_mhz, 9e3, low=True).tolist() == [False, False, True]
    assert misread(at_30_mhz, 1e3, low=True).tolist() == [True, True, True]


@pytest.mark.parametrize(
    ("bandwidth_hz", "top_hz", "verdict", "why"),
    [
        (9e3, 1e6, "fail", "above the quasi-peak limit by 30.0 dB at 1 MHz"),
        (9e3, 50e3, None, "a bandwidth of 9 kHz reads too high: measure with 200 Hz (band A, 9 kHz - 150 kHz)"),
        (120e3, 40e6, "fail", "above the quasi-peak limit by 30.0 dB at 40 MHz"),
        (120e3, 1e6, None, "a bandwidth of 120 kHz reads too high: measure with 9 kHz (band B, 150 kHz - 30 MHz)"),
        (9e3, None, "pass", ""),
    ],
)
def test_a_bandwidth_that_is_wrong_elsewhere_does_not_hide_a_level_that_fails(bandwidth_hz, top_hz, verdict, why):
    hertz = np.geomspace(9e3, 30e6 if bandwidth_hz < 20e3 else 60e6, 400)
    levels = np.full(hertz.shape, 30.0)
    if top_hz is not None:
        hertz[np.argmin(np.abs(hertz - top_hz))] = top_hz
        levels[hertz == top_hz] = 90.0
    limit = Limit("own", "own", (LimitLine("quasi-peak", ((9e3, 60e6, 60.0, 60.0),), False, "test"),))
    found = judge_spectra([Spectrum("quasi-peak", hertz, levels, bandwidth_hz)], limit)[0]
    assert found.verdict == verdict
    assert why in found.why


@pytest.mark.parametrize(("bandwidth_hz", "verdict"), [(1e3, None), (9e3, None), (120e3, "pass")])
def test_a_narrow_bandwidth_passes_nothing_above_30_mhz(bandwidth_hz, verdict):
    hertz = np.linspace(76e6, 108e6, 500)
    limit = Limit("own", "own", (LimitLine("average", ((76e6, 108e6, 18.0, 18.0),), False, "test"),))
    found = judge_spectra([Spectrum("average", hertz, np.full(hertz.shape, 5.0), bandwidth_hz)], limit)[0]
    assert found.verdict == verdict
    assert ("measure with 120 kHz (band C and D, 30 MHz - 1 GHz)" in found.why) == (verdict is None)
