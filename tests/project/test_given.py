"""What callers give to constructors and public functions: anything else is refused in one sentence, and what is stored cannot be changed."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest
from conftest import simulated_sweeps

import motoremi as me

FREQUENCY = np.geomspace(150e3, 30e6, 41)
IMPEDANCE = 2.3 + 2j * np.pi * FREQUENCY * 24e-6
LEVELS = np.linspace(60.0, 40.0, 41)
MASK = np.arange(41) == 5
Given = Any


@cache
def fitted() -> me.Fit:
    return me.fit(me.dc_motor(), simulated_sweeps(3)[0], analyser="4294a")


def sweep(frequency: Given = FREQUENCY, impedance: Given = IMPEDANCE, **more: Given) -> me.ImpedanceSweep:
    return me.ImpedanceSweep("short", frequency, impedance, **more)


def spectrum(frequency: Given = FREQUENCY, level: Given = LEVELS, **more: Given) -> me.Spectrum:
    return me.Spectrum("peak", frequency, level, **more)


def fit(sweeps: Given = None, model: Given = None, **more: Given) -> me.Fit:
    return me.fit(me.dc_motor() if model is None else model, [sweep()] if sweeps is None else sweeps, **more)


def masked(values: np.ndarray) -> np.ma.MaskedArray:
    return np.ma.masked_array(values, mask=MASK)


LEAVE_OUT = "are masked at 1 of 41 points: leave these points out of all arrays"
REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "impedance masked": (lambda: sweep(impedance=masked(IMPEDANCE)), f"short sweep: the impedances {LEAVE_OUT}"),
    "frequency masked": (lambda: sweep(masked(FREQUENCY)), f"short sweep: the frequencies {LEAVE_OUT}"),
    "sigma masked": (lambda: sweep(sigma_relative=masked(np.full(41, 1e-3))), LEAVE_OUT),
    "levels masked": (lambda: spectrum(level=masked(LEVELS)), f"peak spectrum: the levels {LEAVE_OUT}"),
    "spectrum's frequency masked": (lambda: spectrum(masked(FREQUENCY)), LEAVE_OUT),
    "impedance of texts": (lambda: sweep(impedance=["a"] * 41), "short sweep: the impedances are not numbers"),
    "impedance of dates": (lambda: sweep(impedance=np.full(41, "2026-01-01", dtype="M8[D]")), "are not numbers"),
    "ragged": (lambda: sweep(impedance=[[1, 2], [3]]), "are not an array of numbers"),
    "complex frequency": (lambda: sweep(FREQUENCY + 0j), "the frequencies are complex numbers"),
    "sigma of another shape": (lambda: sweep(sigma_relative=[1e-3] * 7), "7 values of sigma_relative for 41 points"),
    "sigma of text": (lambda: sweep(sigma_relative="x"), "sigma_relative are not numbers"),
    "sigma complex": (lambda: sweep(sigma_relative=1e-3 + 0j), "sigma_relative are complex numbers"),
    "sigma in percent": (lambda: sweep(sigma_relative=500), "it is a fraction, 0.01 for 1 %"),
    "metadata of text": (lambda: sweep(metadata="x"), "metadata are a dictionary"),
    "condition a number": (lambda: sweep(condition=5), "a condition is a text such as 'second-temperature=53degC', not a value of type int"),
    "band of texts": (lambda: sweep().within("1MHz", "2MHz"), "an end of the band must be a number in SI units, not '1MHz'"),
    "frame a dictionary": (lambda: me.ImpedanceSweep.from_frame("short", {}), "a table of pandas"),
    "frame an array": (lambda: me.ImpedanceSweep.from_frame("short", np.ones((9, 3))), "a table of pandas"),
    "frame none": (lambda: me.ImpedanceSweep.from_frame("short", None), "a table of pandas (pandas.DataFrame), not None"),
    "levels of texts": (lambda: spectrum(level=["x"] * 41), "peak spectrum: the levels are not numbers"),
    "levels complex": (lambda: spectrum(level=LEVELS + 1j), "the levels are complex numbers"),
    "spectrum's metadata": (lambda: spectrum(metadata=[1]), "metadata are a dictionary"),
    "bandwidth of text": (lambda: spectrum(resolution_bandwidth_hz="9kHz"), "the resolution bandwidth must be a number"),
    "fit of one sweep": (lambda: fit(sweep()), "fit needs a list of ImpedanceSweep, not a value of type ImpedanceSweep"),
    "fit of none": (lambda: me.fit(me.dc_motor(), None), "fit needs a list of ImpedanceSweep, not None"),
    "fit of lists": (lambda: fit([IMPEDANCE.tolist()]), "fit needs a list of ImpedanceSweep, and nothing else in it, not a value of type list"),
    "fit exchanged": (lambda: fit(me.dc_motor(), [sweep()]), "fit needs a model first, dc_motor()"),
    "held of text": (lambda: fit(held={"La": "48uH"}), "the held value of La must be a number in SI units, not '48uH'"),
    "held a list": (lambda: fit(held=["La"]), "held are a dictionary"),
    "bounds a list": (lambda: fit(bounds=[("La", 1, 2)]), "bounds are a dictionary"),
    "seed negative": (lambda: fit(seed=-1), "the seed must be a whole number from 0 upwards, not -1"),
    "seed no whole number": (lambda: fit(seed=1.5), "the seed must be a whole number"),
    "seed none": (lambda: fit(seed=None), "the seed must be a whole number"),
    "compare with a number": (lambda: me.compare(fitted(), 5), "a tolerance is a Tolerance(error_percent=5)"),
    "compare of sweeps": (lambda: me.compare([sweep()]), "compare needs a Fit"),
    "tolerance of text": (lambda: me.Tolerance("5"), "the tolerance error_percent must be a number"),
    "diagnose with a number as map": (lambda: me.diagnose(fitted(), map=2), "map must be a function such as the built-in map"),
    "diagnose of sweeps": (lambda: me.diagnose([sweep()]), "diagnose needs a Fit, not a value of type list"),
    "inspect of sweeps": (lambda: me.inspect([sweep()], "La"), "inspect needs a Fit"),
    "spice of sweeps": (lambda: me.spice_model([sweep()]), "spice_model needs a Fit"),
    "add none": (lambda: fitted().add(None), "an effect is a name such as 'eddy-laminations', not None"),
    "drop a number": (lambda: fitted().drop(1), "an effect is a name"),
    "load none": (lambda: me.load(None), "load needs the path of a session folder, not None"),
    "verify none": (lambda: me.verify(None), "verify needs the path of a session folder"),
    "read none": (lambda: me.read_impedance(None, "short"), "a file is read from its path, not None"),
    "xarray of a fit": (lambda: me.to_xarray(fitted()), "to_xarray needs a session, load(folder)"),
    "table of sweeps": (lambda: me.sweep_table([sweep()]), "sweep_table needs a session, load(folder)"),
    "predict exchanged": (lambda: me.predict(me.Setup(), fitted()), "predict needs first a Fit"),
    "predict a motor": (lambda: me.predict(fitted(), me.dc_motor()), "predict needs a Setup after the motor"),
    "predict with arrays": (lambda: me.predict(fitted(), spectra=[LEVELS]), "spectra are a list of Spectrum"),
}


@pytest.mark.parametrize(("call", "says"), REFUSED.values(), ids=REFUSED.keys())
def test_anything_else_is_refused_in_one_sentence(call: Callable[[], object], says: str) -> None:
    with pytest.raises(me.BadInput) as refused:
        call()
    assert says in str(refused.value)
    assert len(str(refused.value).splitlines()) == 1


def test_what_is_as_good_is_taken() -> None:
    plain = sweep()
    for impedance in (IMPEDANCE.tolist(), pd.Series(IMPEDANCE), np.ma.masked_array(IMPEDANCE)):
        assert np.array_equal(sweep(impedance=impedance).impedance_ohm, plain.impedance_ohm)
    assert np.array_equal(sweep(np.ma.masked_array(FREQUENCY)).frequency_hz, FREQUENCY)
    for sigma in (1e-3, [1e-3], np.full(41, 1e-3)):
        assert sweep(sigma_relative=sigma).sigma_relative.tolist() == [1e-3] * 41
    assert len(sweep().within(np.float64(1e6), 10**7)) < 41
    assert fit(iter(simulated_sweeps(3)[0]), seed=np.int64(1), analyser="4294a").parameters == fitted().parameters


def test_what_is_stored_cannot_be_changed() -> None:
    one = sweep(metadata={"source": "a"}, sigma_relative=1e-3)
    for mapping in (one.metadata, spectrum(metadata={"source": "a"}).metadata, fitted().history[0]):
        with pytest.raises(TypeError, match="immutable"):
            mapping["source"] = "b"
    assert one.to_dict()["metadata"] == {"source": "a"}
    assert type(one.to_dict()["metadata"]) is dict


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy, lambda one: pickle.loads(pickle.dumps(one))], ids=["deepcopy", "copy", "pickle"])
def test_copies_cannot_be_changed_either(copied: Callable[[Any], Any]) -> None:
    one, level = copied(sweep(metadata={"source": "a"}, sigma_relative=1e-3)), copied(spectrum())
    for array in (one.frequency_hz, one.impedance_ohm, one.sigma_relative, level.frequency_hz, level.level_dbuv, level.overload):
        assert not array.flags.writeable
    with pytest.raises(TypeError, match="immutable"):
        one.metadata["source"] = "b"
    assert np.array_equal(one.impedance_ohm, IMPEDANCE)


def test_a_table_from_high_to_low_frequencies_is_turned_round_as_in_files() -> None:
    table = sweep(sigma_relative=np.linspace(1e-3, 2e-3, 41)).to_frame()
    turned = me.ImpedanceSweep.from_frame("short", table.iloc[::-1])
    assert np.array_equal(turned.frequency_hz, FREQUENCY)
    assert np.array_equal(turned.impedance_ohm, IMPEDANCE)
    assert turned.sigma_relative.tolist() == table.sigma_relative.tolist()
    assert turned.metadata["changes"] == ["measured from high to low frequencies: rows turned round"]
    assert "changes" not in me.ImpedanceSweep.from_frame("short", table).metadata
    with pytest.raises(me.BadInput, match="frequencies must increase"):
        me.ImpedanceSweep.from_frame("short", table.sample(frac=1, random_state=1))
