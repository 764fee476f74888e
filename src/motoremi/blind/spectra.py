"""The scoreboard for spectra: motors whose source or path hides an effect, measured in the time domain, diagnosed by the formulas.

Truth: events drawn one by one, a sampled waveform, the network by nodal analysis, a receiver that works on samples
(`motoremi.simulate.emission`). The diagnosis sees impedance sweeps, a peak and an average spectrum, and the stated speed.
"""

from __future__ import annotations

import json
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from motoremi.arrays import JsonDict, Progress
from motoremi.blind.scoring import Answer, Outcome, named_exactly, outcome
from motoremi.data.plain import plain
from motoremi.data.spectrum import Spectrum
from motoremi.data.storage import write_whole
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.emission.diagnose import EmissionDiagnosis, diagnose_emission
from motoremi.emission.fit import Problem
from motoremi.emission.predict import motor_function
from motoremi.emission.setup import Setup, scan_frequencies
from motoremi.emission.source import Source
from motoremi.errors import BadInput
from motoremi.fitting.fit import fit
from motoremi.model.motor import dc_motor
from motoremi.simulate import emission
from motoremi.simulate.analyser import SimulatedAnalyser
from motoremi.simulate.motor import SimulatedMotor

POINTS = 201
REPEATS = 3
SHARE_OF_NONE = 0.25
# A tachometer at the shaft.
SPEED_ERROR = 0.01


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
        """The motor, which hides nothing itself."""
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

    def stand(self) -> emission.Stand:
        """Source, path and receiver as they really are."""
        return emission.Stand.random(self.motor_seed, self.hidden)

    def spectra(self) -> list[Spectrum]:
        """Peak and average of one scan, 150 kHz to 30 MHz in 4.5 kHz."""
        read = emission.measure(self.motor(), self.stand(), scan_frequencies(), self.motor_seed, quasi_peak=False)
        return [Spectrum(detector, read.frequency_hz, read.level(detector)) for detector in ("peak", "average")]

    def stated(self) -> Setup:
        """What the bench book says: the speed, with its error."""
        error = float(np.random.default_rng([self.seed, self.index, 2]).normal(0.0, SPEED_ERROR))
        return Setup(Source(repetition_hz=self.stand().repetition_hz * (1 + error)), assumed=())


def draw(seed: int, index: int) -> SpectrumCase:
    """The case of a number."""
    rng = np.random.default_rng([seed, index, 1])
    hidden = () if rng.random() < SHARE_OF_NONE else (str(rng.choice(list(emission.SOURCE_EFFECTS))),)
    return SpectrumCase(seed, index, hidden, int(rng.integers(1, 2**31)))


@dataclass(frozen=True)
class PlayedSpectrum:
    """A case with its answer; errors in dB rms."""

    case: SpectrumCase
    answer: Answer
    error_before_db: float
    error_after_db: float

    @property
    def outcome(self) -> Outcome:
        """What the answer is worth."""
        return outcome(self.case.hidden, self.answer)

    def to_dict(self) -> JsonDict:
        """As plain data."""
        return {
            **asdict(self.case),
            **asdict(self.answer),
            "outcome": self.outcome,
            "error_before_db": self.error_before_db,
            "error_after_db": self.error_after_db,
        }


def diagnosed(case: SpectrumCase) -> EmissionDiagnosis:
    """The diagnosis of a case as a user would have it: fit the sweeps, then look at the spectra."""
    fitted, stated = fit(dc_motor(), case.sweeps()), case.stated()
    return diagnose_emission(Problem(case.spectra(), motor_function(fitted, stated), stated))


def play(case: SpectrumCase) -> PlayedSpectrum:
    """Diagnose one case."""
    started = time.process_time()
    try:
        found = diagnosed(case)
    except Exception as error:  # a crash is an answer too, and the worst; the others go on
        return PlayedSpectrum(case, Answer("crashed", (), (), 0.0, trouble=f"{type(error).__name__}: {error}"), np.nan, np.nan)
    seconds = time.process_time() - started
    answer = Answer(found.verdict, found.effects, found.families, found.confidence, seconds=seconds)
    return PlayedSpectrum(case, answer, found.base.rms_error_db, found.best.rms_error_db)


def play_all(seed: int, count: int, jobs: int, progress: Progress | None = None) -> list[PlayedSpectrum]:
    """All cases of a seed, in order; the same whatever the number of jobs."""
    if count < 1:
        raise BadInput(f"{count} cases: ask for at least one")
    cases = [draw(seed, index) for index in range(count)]
    if jobs <= 1:
        played = []
        for case in cases:
            if progress is not None:
                progress(f"case {case.index + 1} of {count}", case.index, count)
            played.append(play(case))
        return played
    with ProcessPoolExecutor(jobs) as pool:
        futures = [pool.submit(play, case) for case in cases]
        for done, _ in enumerate(as_completed(futures), start=1):
            if progress is not None:
                progress(f"case {done} of {count}", done, count)
        return [future.result() for future in futures]


def summary(played: Sequence[PlayedSpectrum]) -> JsonDict:
    """The figures of a scoreboard of spectra."""
    with_effect = [one for one in played if one.case.hidden]
    without = [one for one in played if not one.case.hidden]
    named = [one for one in with_effect if one.outcome in ("right", "family")]
    by_kind: dict[str, Counter[str]] = defaultdict(Counter)
    confusion: dict[str, Counter[str]] = defaultdict(Counter)
    for one in played:
        truth = " + ".join(one.case.hidden) or "none"
        by_kind[truth][one.outcome] += 1
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
        "wrong": [one.to_dict() for one in played if one.outcome not in ("right", "family")],
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
    lines += ["", f"One case: median {result['seconds']['median']:.1f} s of processor time, truth and fit of the motor included."]
    outcomes = sorted({key for counts in result["by_kind"].values() for key in counts})
    lines += ["", "| hidden | " + " | ".join(outcomes) + " | named |", "|---" * (len(outcomes) + 2) + "|"]
    for kind, counts in result["by_kind"].items():
        named = ", ".join(f"{name} {count}" for name, count in sorted(result["confusion"][kind].items(), key=lambda pair: -pair[1]))
        lines.append(f"| {kind} | " + " | ".join(str(counts.get(key, "")) for key in outcomes) + f" | {named} |")
    return "\n".join(lines) + "\n"
