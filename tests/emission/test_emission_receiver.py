"""The receiver twice, by formula and in the time domain: against the standard's pulse table, a public waveform, and each other."""

from __future__ import annotations

import numpy as np
import pytest
from places import DATA

from motoremi.emission.band import BAND_A, BAND_B, PULSE_TABLE_DB, REFERENCE_PULSE_VS, band_of
from motoremi.emission.reading import noise_unit, pulses_on_noise, read_comb, read_events, rician_mean
from motoremi.emission.receiver_formula import Receiver
from motoremi.emission.source import Arc, Chopper, HighPass, Source
from motoremi.emission.weighting import pulse_weight
from motoremi.errors import BadInput
from motoremi.simulate.receiver_in_time import TimeDomainReceiver, read_waveform

pytestmark = pytest.mark.slow

DETECTORS = ("peak", "quasi_peak", "average", "rms_average")


def dbuv(volt):
    return 20 * np.log10(np.asarray(volt) / 1e-6)


def pulse_train(rate_hz: float, sample_rate_hz: float, duration_s: float, area_vs: float) -> np.ndarray:
    samples = np.zeros(round(duration_s * sample_rate_hz))
    samples[np.round(np.arange(0.3 / rate_hz, duration_s, 1 / rate_hz) * sample_rate_hz).astype(int)] = area_vs * sample_rate_hz
    return samples


@pytest.mark.parametrize(("band", "reference_hz"), [(BAND_A, 25.0), (BAND_B, 100.0)])
def test_formula_follows_the_pulse_table(band, reference_hz):
    at_reference = pulse_weight(band, reference_hz)
    for rate_hz, wanted_db in PULSE_TABLE_DB[band.name].items():
        if rate_hz == 100.0 and band is BAND_A:
            weight = read_events(np.array([50e3]), np.ones(1), rate_hz, band).quasi_peak[0] / (np.sqrt(2) * band.impulse_bandwidth_hz)
        else:
            weight = pulse_weight(band, rate_hz)
        assert -20 * np.log10(weight / at_reference) == pytest.approx(wanted_db, abs=1.0), rate_hz


@pytest.mark.parametrize(("band", "reference_hz"), [(BAND_A, 25.0), (BAND_B, 100.0)])
def test_formula_reads_the_reference_pulse_as_a_sine_of_66_dbuv(band, reference_hz):
    reading = read_events(np.array([100e3]), np.array([REFERENCE_PULSE_VS[band.name]]), reference_hz, band)
    assert dbuv(reading.quasi_peak[0]) == pytest.approx(66.0, abs=1.0)


# Long enough for the detector to charge up and the meter to follow; one frequency, so that a low sample rate will do.
@pytest.mark.parametrize(("rate_hz", "duration_s"), [(1000.0, 1.2), (100.0, 1.4), (20.0, 1.5), (10.0, 1.6), (2.0, 2.2), (1.0, 3.2)])
def test_time_domain_follows_the_pulse_table_from_1_hz_to_1_khz(rate_hz, duration_s):
    sample_rate_hz = 500e3
    read = read_waveform(pulse_train(rate_hz, sample_rate_hz, duration_s, 0.316e-6 / 2), sample_rate_hz, [170e3])
    # The reference pulse at 100 Hz reads 60 dBuV at the input; its EMF is twice the input voltage.
    assert read.quasi_peak[0] == pytest.approx(60.0 - PULSE_TABLE_DB["B"][rate_hz], abs=1.0)
    formula = read_events(np.array([170e3]), np.array([0.158e-6]), rate_hz, BAND_B)
    for name in ("peak", "quasi_peak"):
        assert getattr(read, name)[0] == pytest.approx(dbuv(getattr(formula, name)[0]), abs=0.4), name


def test_public_calibration_waveform_of_band_a():
    period = np.loadtxt(DATA / "cispr_pulse_bandA" / "pulse_bandA_100Hz.txt.gz") / 2  # open-circuit volts
    frequency_hz = np.arange(9e3, 51e3, 1e3)
    read = read_waveform(np.tile(period, 200), 3e6, frequency_hz, "A")
    # 13.5 uVs reads 60 dBuV at 25 Hz, and 4 dB more at 100 Hz.
    np.testing.assert_allclose(read.quasi_peak, 64.0, atol=1.0)
    # Its own density by Fourier transform, behind the formula.
    density = np.abs(np.fft.rfft(period))[np.round(frequency_hz / 100).astype(int)] / 3e6
    formula = read_events(frequency_hz, density, 100.0, BAND_A)
    for name in DETECTORS:
        np.testing.assert_allclose(getattr(read, name), dbuv(getattr(formula, name)), atol=0.25, err_msg=name)


@pytest.mark.parametrize("gap", [4114, 988, 442, 192, 113])
def test_formula_and_time_domain_agree_on_trains(gap):
    """From 560 Hz, pulse by pulse, to 20 kHz, line by line; the pulses stand on samples."""
    sample_rate_hz, frequency_hz = 2.304e6, 150e3 + 4.5e3 * np.arange(40)
    samples = np.zeros(round(1.2 * sample_rate_hz))
    samples[gap // 3 :: gap] = sample_rate_hz * 1e-6
    read = read_waveform(samples, sample_rate_hz, frequency_hz)
    formula = read_events(frequency_hz, np.full(40, 1e-6), sample_rate_hz / gap, BAND_B)
    average = dbuv(np.broadcast_to(formula.average, frequency_hz.shape))
    # Far down on the skirts of the filter the beginning of the record is louder than the lines.
    seen = average > average.max() - 15
    # Envelope samples miss the peak by up to 0.27 dB; the meter is within 0.1 dB of its end.
    for name in DETECTORS:
        error = getattr(read, name) - dbuv(np.broadcast_to(getattr(formula, name), frequency_hz.shape))
        assert np.abs(error[seen]).max() < 0.4, name


def test_lines_between_events_and_combs_are_the_same():
    frequency_hz = 150e3 + 4.5e3 * np.arange(600)
    for rate_hz in (2000.0, 5210.0, 12e3):
        events = read_events(frequency_hz, np.full(600, 1e-6), rate_hz, BAND_B)
        comb = read_comb(frequency_hz, rate_hz, lambda f: np.full(f.shape, 1e-6 + 0j), BAND_B)
        for name in DETECTORS:
            assert np.abs(dbuv(getattr(events, name)) - dbuv(getattr(comb, name))).mean() < 0.15, (rate_hz, name)


def test_a_sine_reads_the_same_on_all_detectors():
    sample_rate_hz = 0.9e6
    time_s = np.arange(round(1.5 * sample_rate_hz)) / sample_rate_hz
    read = read_waveform(1e-3 * np.sqrt(2) * np.sin(2 * np.pi * 300e3 * time_s), sample_rate_hz, 150e3 + 1.5e3 * np.arange(120))
    for name in DETECTORS:
        # The meter is within 0.1 % of its end after 1.5 s; single precision does the rest.
        assert getattr(read, name)[100] == pytest.approx(60.0, abs=0.1), name
    assert read.peak[94] == pytest.approx(60.0 - 24.0 * (9 / 9) ** 2, abs=1.0)  # 9 kHz off: four times the 6 dB at 4.5 kHz


def test_noise_reads_as_the_formula_says():
    sample_rate_hz, sigma_v = 1.125e6, 1e-3
    samples = sigma_v * np.random.default_rng(5).standard_normal(round(1.0 * sample_rate_hz))
    read = read_waveform(samples, sample_rate_hz, 150e3 + 4.5e3 * np.arange(80))
    average = sigma_v * np.sqrt(BAND_B.noise_bandwidth_hz / (sample_rate_hz / 2)) / noise_unit(BAND_B, 1.0).rms_average[0]
    unit = noise_unit(BAND_B, 1.0)
    for name, tolerance in (("peak", 0.4), ("quasi_peak", 0.5), ("average", 0.1), ("rms_average", 0.2)):
        assert np.mean(getattr(read, name)) == pytest.approx(dbuv(average * getattr(unit, name)[0]), abs=tolerance), name
    own = TimeDomainReceiver(sample_rate_hz, [200e3, 400e3], noise_dbuv=7.0, quasi_peak=False)
    own.feed(np.zeros(round(sample_rate_hz)))
    np.testing.assert_allclose(own.read().average, 7.0, atol=0.3)


def test_detectors_differ_by_the_repetition():
    receiver = Receiver(attenuation_db=0.0)
    frequency_hz = np.array([1e6])
    for rate_hz in (560.0, 2333.0):
        read = receiver.read(Source(rate_hz, 12.0, 50e-9), frequency_hz, np.ones(1, dtype=complex))
        assert read["peak"][0] - read["average"][0] == pytest.approx(20 * np.log10(BAND_B.impulse_bandwidth_hz / rate_hz), abs=0.1)
        assert read["peak"][0] >= read["quasi-peak"][0] >= read["rms-average"][0] >= read["average"][0]
    chopped = receiver.read(Source(560.0, 0.0, chopper=Chopper(12.0, 50e3)), np.array([1.05e6]), np.ones(1, dtype=complex))
    assert chopped["peak"][0] == pytest.approx(chopped["average"][0], abs=0.05)
    assert chopped["quasi-peak"][0] == pytest.approx(chopped["average"][0], abs=0.05)
    paper = receiver.read(Source(560.0, 0.0, high_pass=HighPass(1e-3, 1.0)), frequency_hz, np.ones(1, dtype=complex))
    assert paper["quasi-peak"][0] == pytest.approx(60.0, abs=0.05)


def test_missing_and_scattering_events():
    frequency_hz = np.array([1e6])
    receiver, one = Receiver(attenuation_db=0.0), np.ones(1, dtype=complex)
    full, half = (receiver.read(Source(1000.0, 12.0, 50e-9, missing_share=share), frequency_hz, one) for share in (0.0, 0.5))
    assert full["average"][0] - half["average"][0] == pytest.approx(6.02, abs=0.05)
    assert full["peak"][0] == pytest.approx(half["peak"][0], abs=0.05)
    scattered = receiver.read(Source(1000.0, 0.0, arc=Arc(12.0, 50e-9, 0.2)), frequency_hz, one)
    highest = np.mean(1 + 0.2 * np.random.default_rng(6).standard_normal((20000, 50)).max(axis=1))
    assert scattered["peak"][0] - full["peak"][0] == pytest.approx(20 * np.log10(highest), abs=0.05)
    lines, smeared = (receiver.read(Source(12e3, 12.0, 50e-9, jitter_s=jitter), np.array([1.206e6]), one) for jitter in (0.0, 1e-6))
    assert smeared["peak"][0] - lines["peak"][0] > 1.0  # between two lines noise fills the gap


def test_pulses_and_sines_in_noise():
    noise = np.array([1.0])
    assert rician_mean(np.array([0.0]), noise)[0] == pytest.approx(1.0)
    assert rician_mean(np.array([100.0]), noise)[0] == pytest.approx(100.0, rel=1e-3)
    rate_hz = 1000.0
    high = pulses_on_noise(np.array([1e4]), noise, rate_hz, BAND_B)[0]
    assert high == pytest.approx(1e4 * rate_hz / BAND_B.impulse_bandwidth_hz, rel=0.01)
    assert pulses_on_noise(np.array([1e-2]), noise, rate_hz, BAND_B)[0] == pytest.approx(1.0, abs=1e-3)


def test_floor_attenuator_and_preamplifier():
    # kTB with 10 dB is -17.5 dBuV in 9 kHz; the Gaussian filter passes 1.2 dB less, and the mean is 1.05 dB below the rms.
    assert Receiver(attenuation_db=0.0).floor_dbuv == pytest.approx(-19.75, abs=0.1)
    assert Receiver(attenuation_db=20.0).floor_dbuv == pytest.approx(Receiver(attenuation_db=0.0).floor_dbuv + 20)
    assert Receiver(preamplifier=True).floor_dbuv < Receiver().floor_dbuv
    assert Receiver().to_dict()["band"] == "B"


def test_bad_input():
    for make in (
        lambda: TimeDomainReceiver(60e6, [1e6, 2e6, 4e6]),
        lambda: TimeDomainReceiver(60e6, [31e6]),
        lambda: TimeDomainReceiver(-1, [1e6]),
        lambda: TimeDomainReceiver(60e6, [1e6], "C"),
        lambda: TimeDomainReceiver(60e6, [1e6]).read(),
        lambda: Receiver(attenuation_db=-5),
        lambda: Receiver(dwell_s=0),
        lambda: band_of(120e3),
    ):
        with pytest.raises(BadInput):
            make()
    assert band_of(9e3) is BAND_B
    assert band_of(200.0) is BAND_A
