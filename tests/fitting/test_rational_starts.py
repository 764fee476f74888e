"""Start values read off the sweeps: true elements within the noise's reach, for circuits written out here; nothing where nothing can be read."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import motoremi as me
from motoremi.data.measurement import Measurement
from motoremi.fitting.starts import seen
from motoremi.model.effects import catalogue
from motoremi.model.effects.open_alone import divisions
from motoremi.model.effects.start import Set, Subtract

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 401)
S = 2j * np.pi * FREQUENCY_HZ
RA, LA, CA, RR, LR, CR, CF = 20.0, 12.1e-6, 22e-12, 39.8, 1.6e-6, 424e-12, 210e-12
READERS = [effect.name for effect in catalogue() if effect.reader is not None and not effect.describes]
# One part in a thousand of noise, averaged over 400 points, and the bias of the linearised fit.
NOISE, NEAR = 1e-3, 0.1


def beside(*parts: np.ndarray) -> np.ndarray:
    return 1 / sum(1 / part for part in parts)


def frame(film: np.ndarray | float = 0.0) -> np.ndarray:
    return beside(RR + S * LR + 1 / (S * CR) + film, 1 / (S * CF))


def measured(winding: np.ndarray, rotor: np.ndarray, terminations: tuple[str, ...] = ("short", "open"), added: bool = True) -> Measurement:
    """The second is the path to the frame, or what the open-circuit sweep shows if it is not to be `added` to the winding."""
    rng = np.random.default_rng(5)
    true = {"short": winding, "open": winding + rotor if added else rotor}
    return Measurement.of([
        me.ImpedanceSweep(t, FREQUENCY_HZ, true[t] * (1 + NOISE * (rng.normal(size=401) + 1j * rng.normal(size=401))))
        for t in terminations for _ in range(3)
    ])  # fmt: skip


def read_start(measurement: Measurement, effect: str, place: str = "") -> dict[str, float]:
    """The first start values of an effect that can be read; empty where there are none."""
    reader = next(one.reader for one in catalogue() if one.name == effect)
    assert reader is not None
    return dict(next(iter(reader(dataclasses.replace(seen(measurement), place=place))), {}))


def winding(inside: np.ndarray) -> np.ndarray:
    return beside(RA + inside, 1 / (S * CA))


def coupled(k: float, resonance_hz: float, quality: float) -> np.ndarray:
    """A mesh of its own: the other winding of 3 mH, closed by a capacitance and a resistance in series."""
    inductance = 3e-3
    w = 2 * np.pi * resonance_hz
    mesh = S * inductance + w * inductance / quality + w**2 * inductance / S
    return S * LA - (S * k * np.sqrt(LA * inductance)) ** 2 / mesh


def relaxing(share: float, corner_hz: float) -> np.ndarray:
    """(1 - k) La in series with k La beside a resistance."""
    return S * LA * (1 - share) + beside(S * LA * share, np.full_like(S, 2 * np.pi * corner_hz * LA * share))


def test_a_second_cell_is_read_off_the_short_sweep():
    cell = beside(S * 4e-7, 1 / (S * 3e-10), np.full_like(S, 500.0))
    found = read_start(measured(winding(S * LA) + cell, frame()), "second-resonance")
    truth = {Set("Ra"): RA, Set("La"): LA, Set("Ca"): CA, "inductance_h": 4e-7, "resistance_ohm": 500.0}
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=NEAR)
    assert found["resonance_hz"] == pytest.approx(1 / (2 * np.pi * np.sqrt(4e-7 * 3e-10)), rel=NEAR)


def test_a_coupled_winding_is_read_off_the_short_sweep():
    found = read_start(measured(winding(coupled(0.25, 3e6, 8.0)), frame()), "field-coupling")
    assert found.pop("across_share") == 0
    assert found == pytest.approx({Set("Ra"): RA, Set("La"): LA, Set("Ca"): CA, "coupling": 0.25, "resonance_hz": 3e6, "quality": 8.0}, rel=NEAR)


def test_a_relaxing_core_is_read_off_the_short_sweep():
    found = read_start(measured(winding(relaxing(0.4, 3e6)), frame()), "permeability-relaxation")
    assert found == pytest.approx(
        {Set("Ra"): RA, Set("La"): LA, Set("Ca"): CA, "share": 0.4, "corner_hz": 3e6, "exponent": 1.0, "quality": 0.02}, rel=NEAR
    )


def test_a_damped_core_is_read_off_the_short_sweep():
    share, corner_hz, quality = 0.56, 1.6e6, 1.7
    x = S / (2 * np.pi * corner_hz)
    core = S * LA * (1 - share + share / (1 + x + (quality * x) ** 2))
    reader = next(one.reader for one in catalogue() if one.name == "permeability-relaxation")
    assert reader is not None
    found = list(reader(seen(measured(winding(core), frame()))))[-1]
    truth = {Set("Ra"): RA, Set("La"): LA, Set("Ca"): CA, "share": share, "corner_hz": corner_hz, "quality": quality}
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=NEAR)


def test_a_choke_is_read_off_the_short_sweep():
    rod = S * 7.6e-6 * 0.24 + beside(S * 7.6e-6 * 0.76, np.full_like(S, 2 * np.pi * 5e6 * 7.6e-6 * 0.76))
    found = read_start(measured(winding(S * LA) + rod, frame()), "suppressor-choke")
    truth = {Set("La"): LA, Set("Ca"): CA, "inductance_h": 7.6e-6, "share": 0.76, "corner_hz": 5e6}
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=NEAR)


def test_a_line_is_read_off_its_resonances():
    """Five metres of cable, its far end shorted, with the loss of 3 ohm; one half-wave more makes no difference to what it is."""
    inductance, capacitance = 1.25e-6, 5e-10
    for highest_hz in (1e8, 1.15e8):
        frequency = np.linspace(1e7, highest_hz, 401)
        series, shunt = 3.0 + 2j * np.pi * frequency * inductance, 2j * np.pi * frequency * capacitance
        impedance = np.sqrt(series / shunt) * np.tanh(np.sqrt(series * shunt))
        found = read_start(Measurement.of([me.ImpedanceSweep("short", frequency, impedance)]), "distributed-winding")
        assert found[Set("La")] == pytest.approx(inductance, rel=NEAR)
        assert found["share"] * found[Set("Cf")] == pytest.approx(capacitance, rel=NEAR)
        assert found[Set("Ra")] == pytest.approx(3.0, rel=0.3)


def test_resonances_that_are_not_evenly_spaced_are_no_line():
    cells = sum(beside(S * 1e-7, 1 / (S * c), np.full_like(S, 900.0)) for c in (1e-8, 2e-10, 1e-9))
    assert not read_start(measured(winding(S * LA) + cells, frame(), ("short",)), "distributed-winding")


def test_a_distributed_winding_starts_from_the_low_ends_of_both_sweeps():
    found = read_start(measured(winding(S * LA), frame()), "distributed-winding")
    assert found[Set("La")] == pytest.approx(LA, rel=NEAR)
    assert found[Set("Cf")] + found[Set("Cr")] == pytest.approx(CF + CR, rel=NEAR)


def test_a_bearing_film_is_read_off_the_difference_of_the_sweeps():
    film = beside(np.full_like(S, 2e3), 1 / (S * 1.5e-10))
    found = read_start(measured(winding(S * LA), frame(film)), "bearing-film")
    assert (found[Set("Cf")], found[Set("Lr")]) == pytest.approx((CF, LR), rel=NEAR)
    # Of these the noise of the low end, where the frame is far above the winding, leaves more.
    assert (found[Set("Cr")], found["resistance_ohm"], found["capacitance_f"]) == pytest.approx((CR, 2e3, 1.5e-10), rel=4 * NEAR)


def test_a_leak_beside_cf_is_read_off_the_difference_of_the_sweeps():
    found = read_start(measured(winding(S * LA), beside(frame(), np.full_like(S, 3e3))), "insulation-leakage", "Cf")
    assert (found[Set("Cf")], found[Set("Cr")], found["resistance_ohm"]) == pytest.approx((CF, CR, 3e3), rel=NEAR)
    assert found[Set("Lr")] == pytest.approx(LR, rel=4 * NEAR)


def test_a_leak_beside_cr_is_read_off_the_difference_of_the_sweeps():
    leaking = beside(RR + S * LR + beside(1 / (S * CR), np.full_like(S, 800.0)), 1 / (S * CF))
    found = read_start(measured(winding(S * LA), leaking), "insulation-leakage", "Cr")
    assert (found[Set("Cf")], found[Set("Lr")], found[Set("Cr")]) == pytest.approx((CF, LR, CR), rel=NEAR)
    assert found["resistance_ohm"] == pytest.approx(800, rel=4 * NEAR)


def test_a_relaxation_of_cr_is_read_off_the_difference_of_the_sweeps():
    """A branch of R and C beside Cr: 0.4 Cr and 1 MHz."""
    branch = 1 / (S * 0.4 * CR) + 1 / (2 * np.pi * 1e6 * 0.4 * CR)
    relaxing_cr = beside(RR + S * LR + beside(1 / (S * CR), branch), 1 / (S * CF))
    found = read_start(measured(winding(S * LA), relaxing_cr), "dielectric-relaxation", "Cr")
    assert (found[Set("Cf")], found[Set("Lr")], found[Set("Cr")]) == pytest.approx((CF, LR, CR), rel=NEAR)
    assert (found["strength"], found["corner_hz"]) == pytest.approx((0.4, 1e6), rel=4 * NEAR)


def test_a_film_slower_than_the_band_still_gives_a_start():
    film = beside(np.full_like(S, 3e4), 1 / (S * 1.8e-10))  # 29 kHz
    found = read_start(measured(winding(S * LA), frame(film)), "bearing-film")
    assert found[Set("Cf")] == pytest.approx(CF, rel=NEAR)
    in_series = 1 / (1 / found[Set("Cr")] + 1 / found["capacitance_f"])
    assert in_series == pytest.approx(1 / (1 / CR + 1 / 1.8e-10), rel=2 * NEAR)


@pytest.mark.slow
def test_one_sweep_gives_what_it_shows():
    everything = winding(relaxing(0.4, 3e6)), frame()
    assert not read_start(measured(*everything, ("short",)), "bearing-film")
    assert read_start(measured(*everything, ("short",)), "permeability-relaxation")
    assert not any(read_start(measured(*everything, ("open",)), effect) for effect in READERS)


@pytest.mark.parametrize("effect", READERS)
def test_what_is_read_where_nothing_hides_can_be_started_from(effect):
    """All values are of the right sign, whatever the noise looked like."""
    start = read_start(measured(winding(S * LA), frame()), effect)
    assert all(np.isfinite(value) and value > 0 for value in start.values())


@pytest.mark.parametrize("effect", READERS)
@pytest.mark.parametrize("impedance", [10 + S * 1e-5 + 1 / (S * 1e-10), 1 / (S * 1e-12), S * 1e-3, 0.05 + 0 * S])
def test_what_is_no_motor_gives_no_trouble(impedance, effect):
    """Without noise a quotient of lower degree is exact, and the columns of the linear system vanish."""
    start = read_start(Measurement.of([me.ImpedanceSweep(t, FREQUENCY_HZ, impedance) for t in ("short", "open")]), effect)
    assert all(np.isfinite(value) and value > 0 for value in start.values())


SUPPRESSOR = {"capacitance_f": 3e-9, "esr_ohm": 0.3, "esl_h": 1.2e-8}


def suppressor() -> np.ndarray:
    return SUPPRESSOR["esr_ohm"] + S * SUPPRESSOR["esl_h"] + 1 / (S * SUPPRESSOR["capacitance_f"])


def suppressed(place: str) -> Measurement:
    """One capacitor across the terminals, from the terminal to the frame, or from either terminal to the frame."""
    own, way = winding(S * LA), frame()
    if not place:
        return measured(beside(own, suppressor()), way)
    return measured(beside(own, suppressor()), beside(suppressor(), own + (beside(way, suppressor()) if place == "pair" else way)), added=False)


@pytest.mark.parametrize("place", ["", "frame", "pair"])
def test_a_suppressor_is_read_off_with_the_frame_behind_it(place):
    reader = next(one.reader for one in catalogue() if one.name == "suppressor-capacitor")
    assert reader is not None
    found = dict(reader(dataclasses.replace(seen(suppressed(place)), place=place))[0])
    assert {name: found[name] for name in SUPPRESSOR} == pytest.approx(SUPPRESSOR, rel=2 * NEAR)
    assert (found[Set("Ra")], found[Set("La")]) == pytest.approx((RA, LA), rel=NEAR)
    # Behind a capacitor little shows of the frame but its capacitance.
    assert found[Set("Cr")] + found[Set("Cf")] == pytest.approx(CR + CF, rel=2 * NEAR)


def test_a_pair_starts_from_one_suppressor_whose_frame_holds_the_other():
    reader = next(one.reader for one in catalogue() if one.name == "suppressor-capacitor")
    assert reader is not None
    starts = list(reader(dataclasses.replace(seen(suppressed("pair")), place="pair")))
    assert any(start.get(Subtract("Cf")) == pytest.approx(SUPPRESSOR["capacitance_f"], rel=2 * NEAR) for start in starts)
    assert not any(Subtract("Cf") in start for start in reader(dataclasses.replace(seen(suppressed("frame")), place="frame")))


def capacitor(part: dict[str, float]) -> np.ndarray:
    return part["esr_ohm"] + S * part["esl_h"] + 1 / (S * part["capacitance_f"])


def all_starts(measurement: Measurement, effect: str, place: str, parameters: dict[str, float]) -> list[dict[str, float]]:
    """All start values of an effect for a model that has these parameters."""
    reader = next(one.reader for one in catalogue() if one.name == effect)
    assert reader is not None
    return [dict(start) for start in reader(dataclasses.replace(seen(measurement), place=place, parameters=parameters))]


@pytest.mark.parametrize("place", ["frame", "pair"])
def test_two_suppressors_are_read_off_together_each_at_its_place(place):
    across = {"capacitance_f": 8e-9, "esr_ohm": 0.2, "esl_h": 2e-8}
    own, way = beside(winding(S * LA), capacitor(across)), frame()
    inner = beside(way, suppressor()) if place == "pair" else way
    measurement = measured(beside(own, suppressor()), beside(suppressor(), own + inner), added=False)
    # The model has the first one, with values that are not yet right.
    before = {f"suppressor-capacitor.{name}": 2 * value for name, value in across.items()}
    truth = {**{Set(f"suppressor-capacitor.{name}"): value for name, value in across.items()}, **SUPPRESSOR, Set("La"): LA}
    starts = all_starts(measurement, "suppressor-capacitor", place, before)
    right = [one for one in starts if {name: one.get(name) for name in truth} == pytest.approx(truth, rel=2 * NEAR)]
    assert right
    assert any(one[Set("Cr")] + one[Set("Cf")] == pytest.approx(CR + CF, rel=2 * NEAR) for one in right)


def rod(inductance_h: float, share: float, corner_hz: float) -> np.ndarray:
    ferrite = share * inductance_h
    return S * (inductance_h - ferrite) + beside(S * ferrite, np.full_like(S, 2 * np.pi * corner_hz * ferrite))


def test_a_suppressor_behind_a_choke_is_read_off_with_the_choke():
    choke = rod(5.7e-6, 0.8, 5e6)
    part = {**SUPPRESSOR, "esl_h": 2e-9}
    own, way = winding(S * LA), frame()
    measurement = measured(choke + beside(own, capacitor(part)), choke + beside(capacitor(part), own + way), added=False)
    starts = all_starts(measurement, "suppressor-capacitor", "frame", {"suppressor-choke.inductance_h": 1e-6, "suppressor-choke.share": 0.5})
    truth = {"capacitance_f": part["capacitance_f"], Set("La"): LA}
    truth |= {Set("suppressor-choke.inductance_h"): 5.7e-6, Set("suppressor-choke.share"): 0.8}
    right = [one for one in starts if {name: one.get(name) for name in truth} == pytest.approx(truth, rel=NEAR)]
    assert any(one[Set("Cr")] + one[Set("Cf")] == pytest.approx(CR + CF, rel=2 * NEAR) for one in right)


def test_a_choke_behind_a_suppressor_is_read_off_what_the_capacitor_leaves():
    own = winding(S * LA) + rod(7.6e-6, 0.76, 5e6)
    measurement = measured(beside(own, suppressor()), beside(own, suppressor()) + frame(), added=False)
    known = {f"suppressor-capacitor.{name}": value for name, value in SUPPRESSOR.items()}
    found = all_starts(measurement, "suppressor-choke", "brushes", known)[0]
    truth = {Set("La"): LA, "inductance_h": 7.6e-6, "share": 0.76, "corner_hz": 5e6}
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=2 * NEAR)


def divided(winding: np.ndarray, rotor: np.ndarray, effect: str) -> list[dict[str, float]]:
    """All start values of an effect that the open-circuit sweep alone gives."""
    (sweep,) = measured(winding, rotor, ("open",)).sweeps
    reader = next(one.reader for one in catalogue() if one.name == effect)
    assert reader is not None
    return [{**one.elements, **start} for one in divisions(sweep.frequency_hz, sweep.mean_ohm) for start in reader(one.seen)]


def test_the_open_sweep_alone_gives_a_second_cell_in_one_division_of_its_resonances():
    cell = beside(S * 4e-7, 1 / (S * 3e-10), np.full_like(S, 500.0))
    truth = {Set("Ra"): RA, Set("La"): LA, Set("Ca"): CA, Set("Rr"): RR, Set("Lr"): LR, Set("Cr"): CR, Set("Cf"): CF, "inductance_h": 4e-7}
    found = divided(winding(S * LA) + cell, frame(), "second-resonance")
    assert any({name: start[name] for name in truth} == pytest.approx(truth, rel=NEAR) for start in found)


@pytest.mark.parametrize(
    ("effect", "inside", "of_frame"), [("permeability-relaxation", relaxing(0.4, 3e6), frame()), ("bearing-film", S * LA, None)]
)
def test_a_relaxation_in_the_open_sweep_alone_is_tried_in_winding_and_frame(effect, inside, of_frame):
    film = beside(np.full_like(S, 300.0), 1 / (S * 1e-9))
    own = {"share": 0.4, "corner_hz": 3e6} if of_frame is not None else {"resistance_ohm": 300.0, "capacitance_f": 1e-9}
    found = divided(winding(inside), frame(film) if of_frame is None else of_frame, effect)
    truth = {Set("La"): LA, Set("Ca"): CA, Set("Lr"): LR, **own}
    assert any({name: start[name] for name in truth} == pytest.approx(truth, rel=2 * NEAR) for start in found)


@pytest.mark.parametrize("impedance", [10 + S * 1e-5 + 1 / (S * 1e-10), 1 / (S * 1e-12), S * 1e-3, 0.05 + 0 * S, -1 / (S * 1e-10)])
def test_an_open_sweep_that_is_no_motor_gives_no_trouble(impedance):
    for one in divisions(FREQUENCY_HZ, impedance):
        assert all(np.isfinite(value) and value > 0 for value in one.elements.values())
