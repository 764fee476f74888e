"""`motoremi demo`: all steps from measurement to report on the embedded simulated bench."""

from __future__ import annotations

import secrets
from random import Random
from typing import TYPE_CHECKING, Annotated

import typer

from motoremi.cli.bench import fresh_folder, keeping, tell
from motoremi.cli.options import AsJson, Out, command

if TYPE_CHECKING:
    from motoremi.arrays import JsonDict
    from motoremi.fitting.result import Fit
    from motoremi.schema.procedure import Procedure

# If the user chooses neither seed nor effect, one of these effects is hidden in a motor that the paper's circuit then misses by at least this
# error; both are drawn at random until it does. Noise and analyser leave 0.5 to 2 %.
PLAIN_EFFECTS = ("distributed-winding", "second-resonance", "eddy-laminations", "insulation-leakage@Cf", "lead-inductance")
PLAIN_PERCENT = 5.0
# Number of points that is enough to compute this error.
PLAIN_POINTS = 51
# Seed and effect of a motor whose sweeps have two explanations, which one further measurement distinguishes.
INVESTIGATED = (5, "bearing-film")


def demo_(
    out: Out = None,
    effect: Annotated[
        str | None,
        typer.Option(metavar="ID", help="Effect to hide; 'none' hides nothing; by default, without --seed, one whose error is plain to see."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(help="Determines motor, analyser errors and noise, and without --effect also the effect, which may be hardly visible.", min=0),
    ] = None,
    investigate: Annotated[
        bool, typer.Option("--investigate", help="Measure once, then choose and make the measurements that decide between the explanations.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Measure a simulated motor that hides an effect, fit, see where it fails, diagnose, add, watch the error fall, report."""
    from motoremi.cli.bars import progress_bars
    from motoremi.cli.output import emit_json, say
    from motoremi.data.session import SessionWriter, load
    from motoremi.run.hidden_bench import keep_bench
    from motoremi.run.runner import run, start_document
    from motoremi.schema.bench_file import BenchFile
    from motoremi.simulate.hidden_effects import DEMO_EFFECTS
    from motoremi.virtual.simulated_bench import SimulatedBench
    from motoremi.workflow import add_to_session, compare_session, diagnosis_in, ladder_of, opened, report_session
    from motoremi.workflow_emission import emission_story
    from motoremi.workflow_steps import analyse

    if investigate:
        from motoremi.cli.demo_investigate import demo_investigation

        motor = INVESTIGATED if seed is None and effect is None else (1 if seed is None else seed, effect or INVESTIGATED[1])
        demo_investigation(out if out is not None else fresh_folder("demo"), *motor, as_json=as_json)
        return
    plain = seed is None and effect is None
    chosen_seed, chosen = plain_story(secrets.SystemRandom()) if plain else (secrets.randbelow(100_000) if seed is None else seed, effect or "")
    chosen = chosen or DEMO_EFFECTS[chosen_seed % len(DEMO_EFFECTS)]
    hidden = () if chosen == "none" else (chosen,)
    bench = SimulatedBench(chosen_seed, hidden)
    folder = out if out is not None else fresh_folder("demo")
    procedure = story_procedure(chosen)
    bench_file = BenchFile(backend="sim", operator="demo", seed=chosen_seed)
    try:
        writer = SessionWriter.create(folder, {**start_document(procedure, bench_file), "motor": f"simulated motor {chosen_seed}"})
        keep_bench(writer, chosen_seed, hidden)
        if not as_json:
            say("A simulated motor on the embedded bench hides something; motoremi does not know what.")
            if plain:
                say("The motor was drawn so that it is plain to see: the paper's circuit misses it by several per cent.")
            say()
            writer.subscribe(tell)
        with keeping(folder), progress_bars(as_json) as bars:
            run(procedure, bench, writer, analyse=analyse(bars.bar("diagnosing")), prompt=lambda text: None)
    finally:
        bench.close()
    found = diagnosis_in(load(folder))
    with opened(folder) as store:
        base = ladder_of(load(folder))[0]
        last: Fit = base
        for name in found["effects"]:
            _, last = add_to_session(store, name)
        if found["effects"]:
            compare_session(store)
        emission = emission_story(store)
        report_session(store)
    report = folder / "report" / "report.html"
    if as_json:
        emit_json(
            {
                "schema": "motoremi.demo/1",
                "session": str(folder),
                "report": str(report),
                "hidden": list(hidden),
                "verdict": found["verdict"],
                "named": list(found["effects"]),
                "families": found["families"],
                "confidence": found["confidence"],
                "error_before_percent": base.rms_error_percent,
                "error_after_percent": last.rms_error_percent,
                "floor_percent": last.floor_percent,
                "emission": emission,
                "seed": chosen_seed,
                "drawn": "plain to see" if plain else "as asked",
            }
        )
        return
    _story(found, base, last)
    _emission_story(emission)
    hint = f" --effect {chosen}" if plain or effect is not None else ""
    say(f"\nWhat the motor hid: {', '.join(hidden) or 'nothing'} (seed {chosen_seed}; 'motoremi demo --seed {chosen_seed}{hint}' shows it again)")
    if plain:
        say("Harder ones: 'motoremi demo --seed 1', or any other number, draws any effect, even one that is hardly visible;")
        say("'motoremi demo --effect dielectric-loss@Cf' hides an effect that is hardly visible, 'motoremi demo --effect none' hides none.")
    say(f"session: {folder}\nreport:  {report}")


def plain_story(random: Random) -> tuple[int, str]:
    """Seed of a motor and an effect, drawn at random, that the paper's circuit misses by several per cent."""
    while True:
        seed, effect = random.randrange(100_000), random.choice(PLAIN_EFFECTS)
        if _missed_percent(seed, effect) >= PLAIN_PERCENT:
            return seed, effect


def _missed_percent(seed: int, effect: str) -> float:
    """The error of the paper's circuit, fitted to this motor with this effect."""
    import numpy as np

    from motoremi.data.sweep import ImpedanceSweep
    from motoremi.fitting.fit import fit
    from motoremi.model.motor import dc_motor
    from motoremi.simulate.analyser_errors import SimulatedAnalyser
    from motoremi.simulate.simulated_motor import SimulatedMotor

    frequency_hz = np.geomspace(150e3, 30e6, PLAIN_POINTS)
    motor, analyser = SimulatedMotor.random(seed, (effect,)), SimulatedAnalyser(seed)
    sweeps = [
        ImpedanceSweep(termination, frequency_hz, analyser.measure(termination, frequency_hz, motor.impedance(termination, frequency_hz)))
        for termination in ("short", "open")
    ]
    return fit(dc_motor(), sweeps).rms_error_percent


def story_procedure(effect: str) -> Procedure:
    """The full motor test; from 100 Hz for an effect that is visible only below the usual band. Its report is made at the end of the demo."""
    from motoremi.model.effects import find_effect, identifiers
    from motoremi.schema.procedure import load_procedure, parse_procedure

    full = load_procedure("full_motor_test")
    usual = parse_procedure({**full.source, "steps": [step for step in full.source["steps"] if step["do"] != "report"]}, "full_motor_test.toml")
    if effect not in identifiers() or usual.sweep is None or usual.sweep.start < find_effect(effect).effect.shows_below_hz:
        return usual
    lower = {"title": "Full motor test, 100 Hz to 30 MHz", "sweep": {**usual.source["sweep"], "start": "100 Hz"}}
    return parse_procedure({**usual.source, **lower}, "full_motor_test.toml")


def _story(found: JsonDict, base: Fit, last: Fit) -> None:
    """Print what was found in the impedance."""
    from motoremi.cli.output import say
    from motoremi.quantities import percent, show_band
    from motoremi.report.words import beside_the_error, in_words, would_leave

    left = would_leave(base.floor_percent, base.noise_percent)
    say(f"\nThe paper's circuit misses the measurement by {percent(base.rms_error_percent)} rms ({left}).")
    for span in found["where"]:
        say(
            f"  it fails in the {span['sweep']}-circuit sweep, {show_band(*span['band_hz'])}: {percent(span['rms_error_percent'])}, "
            f"{100 * span['share']:.0f} % of the squared error beyond the uncertainty"
        )
    say(f"Diagnosis: {found['verdict']}, {in_words(found)}; confidence {found['confidence']:.2f}")
    for reason in found["reasons"]:
        say(f"  {reason}")
    if found["effects"]:
        say(f"Added {', '.join(found['effects'])}: the error falls to {percent(last.rms_error_percent)}.")
    for text in beside_the_error(last):
        say(f"  {text}")
    say(f"Next: {found['next_measurement']['why']}")


def _emission_story(emission: JsonDict) -> None:
    """Print what was found in the spectrum."""
    from motoremi.cli.output import say

    say(f"\nThe spectrum: source and fitted motor alone miss it by {emission['error_before_db']:.1f} dB rms.")
    say(f"Diagnosis: {emission['verdict']}, confidence {emission['confidence']:.2f}")
    for text in (*emission["reasons"], *emission["observations"]):
        say(f"  {text}")
    if emission["named"]:
        say(f"Added {', '.join(emission['named'])}: the error falls to {emission['error_after_db']:.1f} dB rms.")
    say(f"Against {emission['limit']}: {str(emission['limit_verdict']).upper()}")
    say(f"Next: {emission['next']}")


def register(app: typer.Typer) -> None:
    """Add this command."""
    command(app, "demo", demo_, "motoremi demo --effect eddy-laminations --seed 7")
