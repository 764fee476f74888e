"""The deck of the whole emission test: ngspice gives the same transfer function as `Path`, and a transient run is stable."""

from __future__ import annotations

import json
from pathlib import Path as File

import numpy as np
import pytest
from ngspice import needs_ngspice
from spice_decks import DB, DEG, SPAN, control, motor_with, run
from typer.testing import CliRunner

from motoremi.cli.app import app
from motoremi.data.session import SessionWriter
from motoremi.emission.path import LISN_5UH, Cable, Path
from motoremi.emission.setup import Setup
from motoremi.emission.source import Arc, Chopper, Source
from motoremi.errors import BadInput
from motoremi.export.emission_deck import emission_deck
from motoremi.export.realise import deviation, impedance_of, realise
from motoremi.export.spice import subcircuit
from motoremi.workflow import fit_session, opened

SOURCE = Source(2e4, 1.0, 1e-6, Arc(15.0, 50e-9), jitter_s=1e-6, chopper=Chopper(12.0, 5e4))
PATHS = [Path(), Path(LISN_5UH, Cable(1.5), stray_f=100e-12), Path(mode="differential")]


def deck_of(path: Path, *effects: str) -> tuple[list[str], object, dict[str, float]]:
    motor, values = motor_with(*effects)
    text = emission_deck("\n".join(subcircuit(realise(motor, values, SPAN))), Setup(SOURCE, path))
    return text.splitlines(), motor, values


def without_analysis(lines: list[str]) -> list[str]:
    return [line for line in lines if line != ".end" and not line.startswith(".ac")]


@needs_ngspice
@pytest.mark.parametrize("path", PATHS, ids=["common", "cable and stray", "differential"])
def test_ngspice_gives_the_path_s_transfer(path: Path, tmp_path: File) -> None:
    lines, motor, values = deck_of(path, "eddy-laminations", "dielectric-loss@Cf")
    rows = run([*without_analysis(lines), *control("ac dec 60 150k 30meg", "wrdata out.data v(receiver)")], tmp_path)
    frequency = rows[:, 0]
    motor_ohm = impedance_of(motor.circuit("open" if path.mode == "common" else "short"), values, frequency)
    db, deg = deviation(rows[:, 1] + 1j * rows[:, 2], path.transfer(frequency, motor_ohm))
    assert db < DB
    assert deg < DEG


@needs_ngspice
def test_a_transient_run_of_the_whole_test_is_stable(tmp_path: File) -> None:
    lines, _, _ = deck_of(Path(), "skin-effect")
    voltage = run([*without_analysis(lines), *control("tran 5n 60u", "wrdata out.data v(receiver)")], tmp_path)[:, 1]
    assert np.all(np.isfinite(voltage))
    # At most the sum of all steps (1 + 15 + 12 V), and not zero.
    assert 0.01 < np.abs(voltage).max() < 28


def test_what_is_random_is_left_out_and_said() -> None:
    text = "\n".join(deck_of(Path())[0])
    assert "left out: jitter" in text
    assert "left out: spread of the arc" in text
    with pytest.raises(BadInput, match="open-circuit"):
        emission_deck("* nothing between far_end and frame: there was no open-circuit sweep", Setup())


@pytest.mark.slow
def test_the_command(tmp_path: File, measure) -> None:
    with SessionWriter.create(tmp_path / "s", {"title": "x"}) as writer:
        for sweep in measure(3, (), 1)[0]:
            writer.add_sweep(sweep)
        writer.close("done")
    with opened(tmp_path / "s") as store:
        fit_session(store)
    result = CliRunner().invoke(app, ["export", str(tmp_path / "s"), "--spice-emission", str(tmp_path / "t.cir"), "--json"])
    assert json.loads(result.stdout)["files"] == [str(tmp_path / "t.cir")]
    assert "Llisn1" in (tmp_path / "t.cir").read_text()
