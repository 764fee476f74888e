"""A circuit without the skin effect that the sweeps hold: what `fit`, `add` and `predict` say of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import motoremi as me
from motoremi.cli.app import app
from motoremi.data.session import SessionWriter

pytestmark = pytest.mark.slow

FREQUENCY_HZ = np.geomspace(1e3, 10e6, 121)
S = 2j * np.pi * FREQUENCY_HZ


def winding_ohm(rise: float) -> np.ndarray:
    """A winding whose resistance rises with the root of frequency, and whose inner inductance falls; by nodal analysis."""
    branch = 0.4 * np.sqrt(1 + rise * S / (2 * np.pi * 20e3)) + S * 9.6e-6
    return branch / (1 + S * 33e-12 * branch)


def to_the_frame_ohm() -> np.ndarray:
    """R-L-C in series, with a capacitance across."""
    series = 8 + S * 0.5e-6 + 1 / (S * 180e-12)
    return series / (1 + S * 190e-12 * series)


def sweeps(rise: float) -> list[me.ImpedanceSweep]:
    rng = np.random.default_rng(8)
    ohm = {"short": winding_ohm(rise), "open": winding_ohm(rise) + to_the_frame_ohm()}
    return [
        me.ImpedanceSweep(name, FREQUENCY_HZ, value * (1 + 3e-4 * (rng.standard_normal(121) + 1j * rng.standard_normal(121))))
        for name, value in ohm.items()
    ]


def said(*words: object) -> str:
    done = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def test_values_that_the_analyser_might_hide_are_not_called_open_for_want_of_data(tmp_path: Path) -> None:
    """The resistance at low frequencies is plain to see: no value from 0 to 8 Ohm fits it, and no DC measurement is needed."""
    folder = tmp_path / "motor"
    with SessionWriter.create(folder, {"title": "skin effect"}) as writer:
        for sweep in sweeps(rise=1.0):
            writer.add_sweep(sweep)
        writer.close("done")
    text = said("fit", folder)
    assert "its misfit may also be errors of the analyser" in text
    assert "fits Ra" not in text
    assert "measure next" not in text
    # After an effect was added, each value stands with its error bar.
    (row,) = (line for line in said("add", folder, "skin-effect").splitlines() if line.split()[:1] == ["La"])
    assert "->" in row
    assert "± " in row


def test_a_circuit_that_does_not_describe_its_motor_says_so() -> None:
    sound = me.fit(None, sweeps(rise=0.0))
    wrong = me.fit(None, sweeps(rise=0.0), held={"La": 30e-6})
    warned = "its elements are not those of the motor"
    for fit, misses in ((sound, False), (wrong, True)):
        assert (fit.rms_error_percent > 10) == misses
        assert (warned in repr(fit)) == misses
        assert any("the circuit of the motor errs by" in reason for reason in me.predict(fit).reasons) == misses
