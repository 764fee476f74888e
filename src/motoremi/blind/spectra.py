"""The scoreboard for spectra: effects of source or path, simulated in the time domain and diagnosed by formulas.

The spectra are simulated with single events, a sampled waveform, nodal analysis of the network, and a receiver that processes the samples
(`motoremi.simulate.emission_in_time`). The diagnosis has impedance sweeps, a peak and an average spectrum, and the stated speed.
"""

from __future__ import annotations

import json
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.blind.rounds import play_each
from motoremi.blind.scoring import Answer, Outcome, named_exactly, outcome
from motoremi.data.plain import plain
from motoremi.data.spectrum import Spectrum
from motoremi.data.storage import write_whole
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.emission.diagnose import diagnose_emission
from motoremi.emission.predict import motor_function
from motoremi.emission.setup import Setup, scan_frequencies
from motoremi.emission.source import Source
from motoremi.emission.spectrum_problem import Problem
from motoremi.errors import BadInput
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor
from motoremi.simulate import emission_in_time
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.simulated_motor import SimulatedMotor

POINTS = 201
REPEATS = 3
SHARE_OF_NONE = 0.25
# Relative error of the stated speed, as of a tachometer.
SPEED_ERROR = 0.01
# An effect that changes the readings by less than the receiver's own error cannot be detected.
LEAST_CHANGE_DB = float(np.hypot(emission_in_time.OFFSET_DB, emission_in_time.RIPPLE_DB))


@dataclass(frozen=True)
class SpectrumCase:
    """One running motor.

    Parameters
    ----------
    seed, index : int
        A case depends on these two only.
    hidden : tuple of str
    motor_seed : int
    """

    seed: int
    index: int
    hidden: tuple[str, ...]
    motor_seed: int

    def motor(self) -> SimulatedMotor:
        """The motor, which has no hidden effect itself."""
        return SimulatedMotor.random(self.motor_seed)

    def sweeps(self) -> list[ImpedanceSweep]:
        """Three repeats of each termination."""
        analyser = SimulatedAnalyser(self.motor_seed + 1)
        frequency = np.geomspace(150e3, 30e6, POINTS)
        measured = []
        for connection, termination in enumerate(TERMINATIONS):
            true = self.motor().impedance(termination, frequency)
            for _ in range(REPEATS):
                seen = analyser.measure(termination, frequency, true, connection=connection, bandwidth_factor=3)
                measured.append(ImpedanceSweep(termination, frequency, seen, metadata={"analyser": "4294a"}))
        return measured

    def stand(self) -> emission_in_time.Stand:
        """True source, path and receiver."""
        return emission_in_time.Stand.random(self.motor_seed, self.hidden)

    def spectra(self) -> list[Spectrum]:
        """Peak and average of one scan, 150 kHz to 30 MHz in 4.5 kHz."""
        return _scanned(self.motor_seed, self.hidden)

    def detectable(self) -> bool:
        """Whether the hidden effect changes a detector's readings by more than the receiver's own error, rms over some octave.

        It is decided by simulations with and without the effect, with the same random numbers, without the formulas of the catalogue.
        """
        if not self.hidden:
            return True
        return largest_change_db(self.spectra(), _scanned(self.motor_seed, ())) >= LEAST_CHANGE_DB

    def stated(self) -> Setup:
        """The set-up as the user states it: the speed, with its error."""
        error = float(np.random.default_rng([self.seed, self.index, 2]).normal(0.0, SPEED_ERROR))
        return Setup(Source(repetition_hz=self.stand().repetition_hz * (1 + error)), assumed=())


@lru_cache(maxsize=4)
def _scanned(motor_seed: int, hidden: tuple[str, ...]) -> list[Spectrum]:
    stand = emission_in_time.Stand.random(motor_seed, hidden)
    read = emission_in_time.measure(SimulatedMotor.random(motor_seed), stand, scan_frequencies(), motor_seed, quasi_peak=False)
    return [Spectrum(detector, read.frequency_hz, read.level(detector)) for detector in ("peak", "average")]


def largest_change_db(one: Sequence[Spectrum], other: Sequence[Spectrum]) -> float:
    """Difference of two scans: rms over the octave and of the detector for which it is largest."""
    largest = 0.0
    for first, second in zip(one, other, strict=True):
        difference = first.level_dbuv - second.level_dbuv
        for low in np.arange(np.log2(first.frequency_hz[0]), np.log2(first.frequency_hz[-1]) - 1 + 1e-9, 0.5):
            inside = (first.frequency_hz >= 2**low) & (first.frequency_hz < 2 ** (low + 1))
            largest = max(largest, float(np.sqrt(np.mean(difference[inside] ** 2))))
    return largest


def draw(seed: int, index: int) -> SpectrumCase:
    """The case with this number."""
    rng = np.random.default_rng([seed, index, 1])
    hidden = () if rng.random() < SHARE_OF_NONE else (str(rng.choice(list(emission_in_time.SOURCE_EFFECTS))),)
    return SpectrumCase(seed, index, hidden, int(rng.integers(1, 2**31)))


@dataclass(frozen=True)
class PlayedSpectrum:
    """A case with its answer; errors in dB rms."""

    case: SpectrumCase
    answer: Answer
    error_before_db: float
    error_after_db: float
    detectable: bool = True

    @property
    def outcome(self) -> Outcome:
        """Score of the answer."""
        return outcome(self.case.hidden, self.answer)

    def to_dict(self) -> JsonDict:
        """As plain data."""
        return {
            **asdict(self.case),
            **asdict(self.answer),
            "detectable": self.detectable,
            "outcome": self.outcome,
            "error_before_db": self.error_before_db,
            "error_after_db": self.error_after_db,
        }


def problem_of(case: SpectrumCase) -> Problem:
    """The problem that a user would have: fitted sweeps, spectra, stated speed."""
    fitted, stated = fit(dc_motor(), case.sweeps()), case.stated()
    return Problem(case.spectra(), motor_function(fitted, stated), stated)


def play(case: SpectrumCase) -> PlayedSpectrum:
    """Diagnose one case; the time is that of the diagnosis alone."""
    detectable = case.detectable()
    try:
        problem = problem_of(case)
        started = time.process_time()
        found = diagnose_emission(problem)
    except Exception as error:  # a crash is scored as an answer and must not stop the other cases
        return PlayedSpectrum(case, Answer("crashed", (), (), 0.0, trouble=f"{type(error).__name__}: {error}"), np.nan, np.nan, detectable)
    seconds = time.process_time() - started
    answer = Answer(found.verdict, found.effects, found.families, found.confidence, seconds=seconds)
    return PlayedSpectrum(case, answer, found.base.rms_error_db, found.best.rms_error_db, detectable)


def play_all(seed: int, count: int, jobs: int, progress: Progress | None = None) -> list[PlayedSpectrum]:
    """All cases of a seed, in order; the result does not depend on the number of jobs."""
    if count < 1:
        raise BadInput(f"{count} cases: ask for at least one")
    return play_each(play, [draw(seed, index) for index in range(count)], jobs, progress)


def summary(played: Sequence[PlayedSpectrum]) -> JsonDict:
    """The figures of a scoreboard of spectra; effects that are too weak to be detected are counted, but are in no goal."""
    with_effect = [one for one in played if one.case.hidden and one.detectable]
    without = [one for one in played if not one.case.hidden]
    named = [one for one in with_effect if one.outcome in ("right", "family")]
    by_kind: dict[str, Counter[str]] = defaultdict(Counter)
    confusion: dict[str, Counter[str]] = defaultdict(Counter)
    for one in played:
        truth = " + ".join(one.case.hidden) or "none"
        by_kind[truth][one.outcome if one.detectable else "too weak to see"] += 1
        if one.detectable:
            confusion[truth][" + ".join(one.answer.effects) or one.answer.verdict] += 1
    errors = np.array([one.error_after_db for one in named])
    return {
        "schema": "motoremi.scoreboard-spectra/1",
        "cases": len(played),
        "goals": {
            "effect hidden: name, or family of at most three": _goal([one.outcome in ("right", "family") for one in with_effect], 0.90),
            "effect hidden: exact name, no family": _goal(
                [named_exactly(one.case.hidden, one.answer) and not one.answer.families for one in with_effect]
            ),
            "false alarms, nothing hidden": _goal([one.outcome == "false alarm" for one in without], 0.02, at_most=True),
            "error after adding at most 2 dB rms": _goal([bool(error <= 2.0) for error in errors], 0.90),
        },
        "error_after_db": {"median": float(np.median(errors)), "largest": float(errors.max())} if errors.size else None,
        "error_before_db": {"median": float(np.median([one.error_before_db for one in named]))} if named else None,
        "by_kind": {kind: dict(counts) for kind, counts in sorted(by_kind.items())},
        "confusion": {kind: dict(counts) for kind, counts in sorted(confusion.items())},
        "seconds": {"median": float(np.nanmedian([one.answer.seconds for one in played]))},
        "wrong": [one.to_dict() for one in played if one.detectable and one.outcome not in ("right", "family")],
    }


def _goal(results: Sequence[bool], wanted: float | None = None, at_most: bool = False) -> JsonDict:
    value = float(np.mean(results)) if results else None
    reached = None if value is None or wanted is None else value <= wanted if at_most else value >= wanted
    return {"value": value, "wanted": wanted, "at_most": at_most, "cases": len(results), "reached": reached}


def write_all(result: JsonDict, folder: Path) -> None:
    """Tables and data into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / "scoreboard-spectra.md", markdown(result).encode())
    write_whole(folder / "scoreboard-spectra.json", json.dumps(plain(result), indent=1, allow_nan=False).encode())


def markdown(result: JsonDict) -> str:
    """The tables of a scoreboard of spectra."""
    lines = [
        f"# Blind test of spectra: {result['cases']} cases, seed {result['seed']}",
        "",
        "| goal | wanted | reached | cases | |",
        "|---|---|---|---|---|",
    ]
    for name, goal in result["goals"].items():
        wanted = "" if goal["wanted"] is None else f"{'<=' if goal['at_most'] else '>='} {100 * goal['wanted']:.0f} %"
        value = "-" if goal["value"] is None else f"{100 * goal['value']:.1f} %"
        state = "" if goal["reached"] is None else "yes" if goal["reached"] else "NO"
        lines.append(f"| {name} | {wanted} | {value} | {goal['cases']} | {state} |")
    if result["error_after_db"] is not None:
        after, before = result["error_after_db"], result["error_before_db"]
        lines += [
            "",
            f"Error before adding: median {before['median']:.2f} dB rms; after: median {after['median']:.2f}, largest {after['largest']:.2f} dB.",
        ]
    weak = sum(counts.get("too weak to see", 0) for counts in result["by_kind"].values())
    if weak:
        seen = f"changes the readings of no detector by {LEAST_CHANGE_DB:.1f} dB rms in any octave, which is the receiver's own error"
        lines += ["", f"Too weak to see, and not counted: {weak} cases in which the hidden effect {seen}."]
    lines += ["", f"One diagnosis: median {result['seconds']['median']:.1f} s of processor time."]
    outcomes = sorted({key for counts in result["by_kind"].values() for key in counts})
    lines += ["", "| hidden | " + " | ".join(outcomes) + " | named |", "|---" * (len(outcomes) + 2) + "|"]
    for kind, counts in result["by_kind"].items():
        named = ", ".join(f"{name} {count}" for name, count in sorted(result["confusion"].get(kind, {}).items(), key=lambda pair: -pair[1]))
        lines.append(f"| {kind} | " + " | ".join(str(counts.get(key, "")) for key in outcomes) + f" | {named} |")
    return "\n".join(lines) + "\n"
