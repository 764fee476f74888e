"""The figures of `docs/emission.md`: `python -m benchmarks.emission`."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
from pathlib import Path as File

import numpy as np

from motoremi.emission.band import BAND_A, BAND_B, PULSE_TABLE_DB, REFERENCE_PULSE_VS
from motoremi.emission.commutation import Commutation
from motoremi.emission.netlist import emission_netlist
from motoremi.emission.path import LISN_5UH, Cable, Path
from motoremi.emission.reading import read_events
from motoremi.emission.setup import Setup, scan_frequencies
from motoremi.emission.source import Arc, Chopper, Source
from motoremi.model.circuit import Tape
from motoremi.model.motor import dc_motor
from motoremi.simulate.emission_in_time import Stand, measure
from motoremi.simulate.receiver_in_time import read_waveform
from motoremi.simulate.simulated_motor import SimulatedMotor

MOTOR = {"Ra": 10.0, "La": 12.1e-6, "Ca": 22e-12, "Rr": 39.8, "Lr": 1.6e-6, "Cr": 424e-12, "Cf": 210e-12}


def commutation() -> None:
    """The paper's numbers."""
    print("\n| Ls, Tk | A | uc(0) | uc at Tk - 50 ns | largest duc/dt |\n|---|---|---|---|---|")
    for henry, time_s in ((121e-6, 38.4e-3), (12.1e-6, 38.4e-3), (121e-6, 3.79e-3), (12.1e-6, 3.79e-3), (121e-6, 0.384e-3)):
        coil = Commutation(inductance_h=henry, time_s=time_s)
        tau = np.linspace(0, 1 - 5e-8 / time_s, 20001)
        volt, rate = coil.contact_voltage(tau), np.abs(coil.contact_voltage_rate(tau)).max()
        print(f"| {henry * 1e6:g} uH, {time_s * 1e3:g} ms | {coil.ratio:.3g} | {volt[0]:.3f} V | {volt[-1]:.3g} V | {rate:.2g} V/s |")


def against_ngspice() -> None:
    """The path as a netlist."""
    if shutil.which("ngspice") is None:
        print("\nngspice is not installed")
        return
    frequency = np.linspace(150e3, 30e6, 2000)
    print("\n| path | largest difference from ngspice |\n|---|---|")
    for name, path in (
        ("two 50 uH networks", Path()),
        ("two 5 uH networks", Path(LISN_5UH)),
        ("5 m of cable", Path(cable=Cable(5.0, 80.0))),
        ("cable and stray capacitance", Path(cable=Cable(1.5), stray_f=100e-12)),
        ("differential mode, 5 uH, cable", Path(LISN_5UH, Cable(2.0, 120.0), mode="differential")),
    ):
        motor = dc_motor()
        termination = "open" if path.mode == "common" else "short"
        names = [p.name for p in motor.parameters if p.name in motor.used_parameters(termination)]
        ohm = Tape(motor.circuit(termination), names).impedance(2j * np.pi * frequency, np.array([MOTOR[n] for n in names]))
        with tempfile.TemporaryDirectory() as folder:
            deck, data = File(folder) / "path.cir", File(folder) / "out.data"
            control = f".control\nset numdgt=12\nset wr_singlescale\nac lin 2000 150k 30meg\nwrdata {data} v(receiver)\nquit\n.endc\n.end\n"
            deck.write_text(f"path\n{emission_netlist(motor, MOTOR, path)}.options noopac\n{control}")
            subprocess.run(["ngspice", "-b", str(deck)], capture_output=True, check=False, timeout=300)
            rows = np.loadtxt(data)
        error = 20 * np.log10(np.hypot(rows[:, 1], rows[:, 2])) - 20 * np.log10(np.abs(path.transfer(frequency, ohm)))
        print(f"| {name} | {np.abs(error).max():.1e} dB |")


def pulse_response() -> None:
    """Comparison with the table of the standard (as recalled): quasi-peak reading of the reference pulse in dBuV at the input."""
    print("\n| band, rate | table | formula | time domain |\n|---|---|---|---|")
    for band, tuned_hz, sample_rate_hz in ((BAND_A, 50e3, 200e3), (BAND_B, 170e3, 500e3)):
        for rate_hz, below_db in PULSE_TABLE_DB[band.name].items():
            area = REFERENCE_PULSE_VS[band.name] / 2
            formula = 20 * np.log10(float(read_events(np.array([tuned_hz]), np.array([area]), rate_hz, band).quasi_peak[0]) / 1e-6)
            samples = np.zeros(round((2.0 + 2 / rate_hz) * sample_rate_hz))
            samples[np.round(np.arange(0.3 / rate_hz, samples.size / sample_rate_hz, 1 / rate_hz) * sample_rate_hz).astype(int)] = (
                area * sample_rate_hz
            )
            read = read_waveform(samples, sample_rate_hz, [tuned_hz], band.name)
            print(f"| {band.name}, {rate_hz:g} Hz | {60 - below_db:.1f} | {formula:.1f} | {read.quasi_peak[0]:.1f} |")


def formulas_against_time_domain() -> None:
    """The complete chain, formulas compared with the time domain: rms difference over 6634 points."""
    frequency = scan_frequencies()
    print("\n| source, path | peak | quasi-peak | average | RMS-average |\n|---|---|---|---|---|")
    for seed, effects in ((2, ()), (1, ("arc-breakdown",)), (4, ("chopper",)), (7, ("cable-resonance",))):
        motor, stand = SimulatedMotor.random(seed), Stand.random(seed, effects)
        read = measure(motor, stand, frequency, seed)
        arc = Arc(stand.arc_v, stand.arc_rise_s, stand.arc_spread) if stand.arc_v else None
        chopper = Chopper(stand.chopper_v, stand.chopper_hz, stand.chopper_duty, stand.chopper_rise_s) if stand.chopper_v else None
        path = Path(Path().lisn.deviating(stand.lisn_factor), Cable(stand.cable_m, stand.cable_ohm) if stand.cable_m else None)
        setup = Setup(Source(stand.repetition_hz, stand.step_v, stand.rise_s, arc, chopper=chopper), path, floor_dbuv=stand.floor_dbuv)
        levels = setup.levels(frequency, motor.impedance("open", frequency))
        errors = [np.sqrt(np.mean((read.level(d) - stand.offset_db - levels[d]) ** 2)) for d in ("peak", "quasi-peak", "average", "rms-average")]
        print(f"| {', '.join(effects) or 'commutation alone'} | " + " | ".join(f"{error:.2f} dB" for error in errors) + " |")


def speed() -> None:
    """Seconds on this machine."""
    frequency = scan_frequencies()
    ohm = SimulatedMotor.random(1).impedance("open", frequency)
    print("\n| what | time |\n|---|---|")
    for name, source in (
        ("prediction of 6634 points, arcs at 560 Hz", Source(arc=Arc())),
        ("the same with a chopper of 20 kHz", Source(arc=Arc(), chopper=Chopper(12.0, 20e3))),
        ("the same with a chopper of 3 kHz", Source(arc=Arc(), chopper=Chopper(12.0, 3e3))),
    ):
        Setup(source).levels(frequency, ohm)
        taken = []
        for _ in range(7):
            started = time.perf_counter()
            Setup(source).levels(frequency, ohm)
            taken.append(time.perf_counter() - started)
        print(f"| {name} | {1e3 * min(taken):.1f} ms |")
    rng = np.random.default_rng(1)
    blocks = (1e-5 * rng.standard_normal(1_200_000) for _ in range(50))
    started, cpu = time.perf_counter(), time.process_time()
    read_waveform(blocks, 60e6, frequency[:-1])
    wall, own = time.perf_counter() - started, time.process_time() - cpu
    print(f"| 1 s at 60 MS/s through all detectors, 6633 frequencies | {wall:.1f} s ({own:.1f} s of processor time) |")


if __name__ == "__main__":
    for part in (commutation, against_ngspice, pulse_response, formulas_against_time_domain, speed):
        part()
