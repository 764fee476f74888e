"""Further repeats of a session: compared with those that it has, with the analyser and accuracy of the session, and what becomes of its ladder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from command_line import motoremi
from conftest import simulated_sweeps

from motoremi.data.csvfiles import write_impedance_csv
from motoremi.data.measurement import Measurement
from motoremi.data.session import load
from motoremi.data.sweep import ImpedanceSweep, group_repeats, same_frequencies
from motoremi.errors import BadInput

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 401)
COPPER = 0.00393  # per kelvin
RNG = np.random.default_rng(5)


def winding(termination: str, *, ra: float = 0.8, la: float = 25e-6, ca: float = 60e-12, warmer_kelvin: float = 0.0, noise: float = 5e-4):
    """A sweep of the paper's circuit."""
    s = 2j * np.pi * FREQUENCY_HZ
    impedance = 1 / (1 / (ra * (1 + COPPER * warmer_kelvin) + s * la) + s * ca)
    if termination == "open":
        impedance = impedance + 1 / (s * 150e-12 + 1 / (15 + s * 0.3e-6 + 1 / (s * 400e-12)))
    return ImpedanceSweep(termination, FREQUENCY_HZ, impedance * (1 + noise * (RNG.normal(size=401) + 1j * RNG.normal(size=401))))


def written(folder: Path, name: str, *sweeps: ImpedanceSweep) -> list[object]:
    """Options of the command with files of these sweeps."""
    for sweep in sweeps:
        write_impedance_csv(folder / f"{name}-{sweep.termination}.csv", sweep)
    return [word for sweep in sweeps for word in (f"--{sweep.termination}", folder / f"{name}-{sweep.termination}.csv")]


def both(**elements: float) -> list[ImpedanceSweep]:
    return [winding("short", **elements), winding("open", **elements)]


def made(folder: Path, *options: str) -> Path:
    done = motoremi("import", folder / "s", *written(folder, "first", *both()), *options)
    assert done.returncode == 0, done.stderr
    return folder / "s"


def appended(session: Path, *words: object) -> CompletedProcess[str]:
    return motoremi("import", session, "--append", *words)


def notes(done: CompletedProcess[str]) -> list[str]:
    assert done.returncode == 0, done.stderr
    return [line for line in done.stdout.splitlines() if line.startswith("note: ")]


@pytest.mark.slow
def test_repeats_of_another_motor_are_told(tmp_path: Path) -> None:
    told = notes(appended(made(tmp_path), *written(tmp_path, "other", *both(ra=0.9, la=23e-6, ca=66e-12))))
    assert len(told) == 2
    # La 8 % lower, Ca 10 % higher: most points differ by one of both.
    assert told[0].startswith("note: other-short.csv differs from the stored short sweeps by 8 % of |Z| (median over the points); ")
    assert "if it is of another motor, termination or unit, import it as a session of its own" in told[0]
    assert told[1].startswith("note: other-open.csv differs from the stored open sweeps by 8.")


def test_so_is_another_unit(tmp_path: Path) -> None:
    sweep = winding("short")
    milliohm = ImpedanceSweep("short", FREQUENCY_HZ, 1000 * sweep.impedance_ohm)
    (told,) = notes(appended(made(tmp_path), *written(tmp_path, "milli", milliohm)))
    assert "differs from the stored short sweeps by a factor of 1e+03 (median" in told


@pytest.mark.slow
def test_noise_and_a_motor_that_has_warmed_are_no_other_motor(tmp_path: Path) -> None:
    session = made(tmp_path)
    assert not notes(appended(session, *written(tmp_path, "again", *both())))
    assert not notes(appended(session, *written(tmp_path, "warm", *both(warmer_kelvin=60.0))))


def test_neither_are_repeats_of_a_noisy_analyser(tmp_path: Path) -> None:
    # 3 % of noise at each point is more than what is allowed of a difference.
    assert motoremi("import", tmp_path / "s", *written(tmp_path, "first", *both(noise=0.03))).returncode == 0
    assert not notes(appended(tmp_path / "s", *written(tmp_path, "again", *both(noise=0.03))))


@pytest.mark.parametrize("stored", [(), ("--analyser", "4294a")])
def test_another_analyser_is_refused(tmp_path: Path, stored: Sequence[str]) -> None:
    session = made(tmp_path, *stored)
    before = load(session).documents
    files = written(tmp_path, "again", *both())
    done = appended(session, "--analyser", "nanovna", *files)
    assert done.returncode == 2
    assert "sweeps of nanovna need a session of their own; leave the analyser out, or import all sweeps again with it" in done.stderr
    assert done.stderr.count("\n") == 1
    assert load(session).documents == before
    # The session's own may be said again.
    assert not notes(appended(session, *(stored or ("--analyser", "unknown")), *files))


def test_an_analyser_that_a_file_names_does_not_apply_to_the_stored_sweeps(tmp_path: Path) -> None:
    named = [sweep.with_metadata(analyser="nanovna") for sweep in both()]
    files = written(tmp_path, "again", *named)
    done = appended(made(tmp_path), *files)
    assert done.returncode == 2
    assert "again-short.csv: the analyser of the sweeps of s is not named" in done.stderr
    # With an analyser of its own the session decides, as --analyser does in a new session.
    (tmp_path / "other").mkdir()
    session = made(tmp_path / "other", "--analyser", "4294a")
    assert not notes(appended(session, *files))
    assert Measurement.of(load(session).sweeps).analyser.name == "4294a"


def test_another_accuracy_is_refused(tmp_path: Path) -> None:
    plain = made(tmp_path)
    files = written(tmp_path, "again", *both())
    done = appended(plain, "--accuracy", "3", *files)
    assert done.returncode == 2
    assert "an accuracy of 3 % is stated, but no accuracy for the sweeps of s, and it applies to all" in done.stderr
    (tmp_path / "stated").mkdir()
    stated = made(tmp_path / "stated", "--accuracy", "2")
    assert "an accuracy of 3 % is stated, but 2 % for the sweeps of s" in appended(stated, "--accuracy", "3", *files).stderr
    assert not notes(appended(stated, "--accuracy", "2", *files))


@pytest.mark.parametrize("option", [("--analyser", "4294a"), ("--accuracy", "3"), ("--band", "1MHz:2MHz"), ("--compensated",)])
def test_options_of_sweeps_need_sweeps(tmp_path: Path, option: Sequence[str]) -> None:
    session = made(tmp_path)
    before = load(session).documents
    done = appended(session, "--value", "dc-resistance=0.8ohm", *option)
    assert done.returncode == 2
    assert "for impedance sweeps" in done.stderr
    assert done.stderr.count("\n") == 1
    assert load(session).documents == before


def test_settings_for_new_sessions_do_not_refuse_what_is_appended(tmp_path: Path) -> None:
    session = made(tmp_path)
    (tmp_path / "motoremi.toml").write_text("[import]\nanalyser = 'nanovna'\naccuracy = '3'\nband = '100kHz:40MHz'\n")
    for words in (("--value", "dc-resistance=0.8ohm"), written(tmp_path, "again", *both())):
        done = motoremi("import", session, "--append", *words, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert Measurement.of(load(session).sweeps).analyser.name == "unknown"
    assert Measurement.of(load(session).sweeps).accuracy_percent is None


def test_band_and_accuracy_of_the_session_apply_to_what_is_appended(tmp_path: Path) -> None:
    """A further repeat was refused, since it had more points, and the session's accuracy was stored with the first ones only."""
    session = made(tmp_path, "--band", "200kHz:20MHz", "--accuracy", "2")
    for words in ((), ("--condition", "second-temperature=53degC")):
        done = appended(session, *words, *written(tmp_path, f"again{len(words)}", winding("short")))
        assert done.returncode == 0, done.stderr
        assert "outside 200 kHz - 20 MHz left out; accuracy stated: 2 %" in done.stdout
    sweeps = [*load(session).sweeps, *load(session).conditioned]
    assert [sweep.metadata["accuracy_percent"] for sweep in sweeps] == [2.0] * 4
    inside = (FREQUENCY_HZ >= 200e3) & (FREQUENCY_HZ <= 20e6)
    assert all(np.array_equal(sweep.frequency_hz, FREQUENCY_HZ[inside]) for sweep in sweeps)
    documents = load(session).documents
    low = ImpedanceSweep("short", np.geomspace(1e3, 100e3, 50), np.full(50, 3 + 1j))
    done = appended(session, "--condition", "second-temperature=53degC", *written(tmp_path, "low", low))
    assert done.returncode == 2
    assert "(s was imported with --band 200kHz:20MHz; give --band for another one)" in done.stderr
    assert load(session).documents == documents
    words = written(tmp_path, "low", low)
    assert appended(session, "--condition", "dc-bias=1A", *words, "--band", "1kHz:100kHz").returncode == 0


def megahertz(path: Path, sweep: ImpedanceSweep) -> Path:
    """As a program writes it: megahertz with six decimals."""
    rows = [f"{f / 1e6:.6f},{z.real:.9g},{z.imag:.9g}\n" for f, z in zip(sweep.frequency_hz, sweep.impedance_ohm, strict=True)]
    path.write_text("Frequency (MHz),R (Ohm),X (Ohm)\n" + "".join(rows))
    return path


@pytest.mark.slow
def test_rounded_frequencies_are_the_same(tmp_path: Path) -> None:
    session = made(tmp_path)
    assert not notes(appended(session, "--short", megahertz(tmp_path / "mhz.csv", winding("short"))))
    (group,) = group_repeats(sweep for sweep in load(session).sweeps if sweep.termination == "short")
    assert group.repeats == 2
    np.testing.assert_array_equal(group.frequency_hz, FREQUENCY_HZ)
    # A copy in the other format is still a copy.
    first = next(sweep for sweep in load(session).sweeps if sweep.termination == "short")
    (told,) = notes(appended(session, "--short", megahertz(tmp_path / "copy.csv", first)))
    assert "3 short sweeps hold the readings of only 2" in told
    for words in (written(tmp_path, "warm", winding("short")), ("--short", megahertz(tmp_path / "warm-mhz.csv", winding("short")))):
        assert appended(session, "--condition", "second-temperature=53degC", *words).returncode == 0
    (conditioned,) = Measurement.of((*load(session).sweeps, *load(session).conditioned)).conditioned
    assert conditioned.sweep.repeats == 2


@pytest.mark.parametrize(
    ("first", "other", "same"),
    [
        (FREQUENCY_HZ, FREQUENCY_HZ * (1 + 0.9e-5), True),
        (FREQUENCY_HZ, FREQUENCY_HZ * (1 + 1.1e-5), False),
        (30e6 + np.arange(401.0), 30e6 + np.arange(401.0) + 0.009, True),
        # Steps of 1 Hz: a hundred-thousandth of 30 MHz is 300 of them.
        (30e6 + np.arange(401.0), 30e6 + np.arange(401.0) + 0.011, False),
        (FREQUENCY_HZ, FREQUENCY_HZ[1:], False),
    ],
)
def test_which_frequencies_are_the_same(first: np.ndarray, other: np.ndarray, *, same: bool) -> None:
    assert same_frequencies(first, other) is same
    flat = [ImpedanceSweep("short", axis, np.full(axis.size, 10 + 5j)) for axis in (first, other)]
    if same:
        assert len(group_repeats(flat)) == 1
    else:
        with pytest.raises(BadInput, match="must have the same frequencies"):
            group_repeats(flat)


@pytest.fixture(scope="module")
def with_ladder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ladder")
    first, second = simulated_sweeps(3, repeats=2)[0][:2]
    write_impedance_csv(folder / "first.csv", first)
    write_impedance_csv(folder / "second.csv", second)
    assert motoremi("import", folder / "s", "--short", folder / "first.csv", "--analyser", "4294a").returncode == 0
    assert motoremi("fit", folder / "s").returncode == 0
    return folder


def test_a_copy_keeps_the_ladder_and_a_repeat_says_that_it_is_emptied(with_ladder: Path) -> None:
    session = with_ladder / "s"
    before = load(session).ladder
    assert len(before) == 1
    assert not notes(appended(session, "--value", "dc-resistance=0.8ohm"))
    (told,) = notes(appended(session, "--short", with_ladder / "first.csv"))
    assert "2 short sweeps hold the readings of only 1" in told
    assert load(session).ladder == before
    told = notes(appended(session, "--short", with_ladder / "second.csv"))
    again = f"motoremi fit {session}, then motoremi add {session} EFFECT"
    assert told[-1] == f"note: the models of the ladder were fitted without these sweeps and are removed; fit them again: {again}"
    assert load(session).ladder == []


def test_sweeps_under_a_condition_that_a_diagnosis_cannot_use_are_told(tmp_path: Path) -> None:
    session = made(tmp_path)
    sweep = winding("short")
    beyond = ImpedanceSweep("short", FREQUENCY_HZ * 200.5, sweep.impedance_ohm)
    (told,) = notes(appended(session, *written(tmp_path, "warm", beyond), "--condition", "second-temperature=53degC"))
    assert told == (
        "note: second-temperature=53degC: the short sweep is stored, but a diagnosis does not use it: it has less than two usable points at the "
        "frequencies of the short sweep of the motor as it is"
    )
    (told,) = notes(appended(session, *written(tmp_path, "lifted", sweep), "--condition", "brushes-lifted"))
    assert told.endswith("a diagnosis does not use it: how the effects respond to it is not known")
    assert notes(appended(session, *written(tmp_path, "hot", *both(warmer_kelvin=30)), "--condition", "second-temperature=54degC")) == []


def test_a_value_that_a_diagnosis_cannot_use_is_told(tmp_path: Path) -> None:
    session, files = tmp_path / "s", written(tmp_path, "first", winding("short"))
    assert not any("dc-resistance" in note for note in notes(motoremi("import", session, *files, "--value", "dc-resistance=0.8ohm")))
    assert notes(appended(session, "--value", "insulation-resistance=2Gohm")) == [
        "note: insulation-resistance: the value is stored, but a diagnosis does not use it: the session has no open sweep of the motor as it is to "
        "compare it with"
    ]
