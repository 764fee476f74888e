"""A motor between the two ports of a network analyser, by scattering matrices: nothing here is a formula of the error model.

What stands between source and load is a chain of networks of scikit-rf: source mismatch, strays, motor, strays, load mismatch. The analyser
shows its S21 over that of the through connection, with leakage and tracking errors that the calibration left, and noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from skrf import Frequency, Network
from skrf.media import DefinedGammaZ0

from motoremi.blind.disturbances import smooth_error
from motoremi.data.files import read_impedance
from motoremi.data.sweep import TERMINATIONS, ImpedanceSweep
from motoremi.simulate.simulated_motor import SimulatedMotor

FREQUENCY_HZ = np.geomspace(150e3, 30e6, 201)


@dataclass(frozen=True)
class Strays:
    """Strays of a fixture that nobody compensated: lead of the motor, then what each port sees before it."""

    lead_ohm: float = 0.0
    lead_henry: float = 0.0
    across_farad: float = 0.0
    ground_farads: tuple[float, float] = (0.0, 0.0)
    line_henries: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class TwoPorts:
    """A network analyser after calibration with a through connection.

    Parameters
    ----------
    seed : int
        Of the errors, which stay the same, and of the noise.
    leakage, tracking, reflected : float
        Size of what is left of the error terms; the last is that of each port.
    noise : float
        Of S21, real and imaginary part each.
    """

    seed: int
    leakage: float = 2e-4
    tracking: float = 2e-3
    reflected: float = 7e-3
    noise: float = 3e-5

    def s21(self, fixture: str, impedance_ohm: np.ndarray, strays: Strays = Strays(), number: int = 0) -> np.ndarray:
        """What it shows of an impedance between its ports."""
        leak, tracking, source, load = self.errors()
        through = _mismatch(source) ** _mismatch(load, turned=True)
        chain = _mismatch(source) ** _between(fixture, impedance_ohm, strays) ** _mismatch(load, turned=True)
        noise = np.random.default_rng((self.seed, 2, number)).standard_normal((2, FREQUENCY_HZ.size))
        return chain.s[:, 1, 0] / through.s[:, 1, 0] * (1 + tracking) + leak + self.noise * (noise[0] + 1j * noise[1])

    def errors(self) -> Sequence[np.ndarray]:
        """Leakage, tracking, and what source and load reflect."""
        rng = np.random.default_rng((self.seed, 1))
        return [smooth_error(rng, FREQUENCY_HZ, size) for size in (self.leakage, self.tracking, self.reflected, self.reflected)]


def _line() -> DefinedGammaZ0:
    return DefinedGammaZ0(Frequency.from_f(FREQUENCY_HZ, unit="hz"), gamma=np.zeros(FREQUENCY_HZ.size), z0=50)


def _mismatch(reflected: np.ndarray, turned: bool = False) -> Network:
    """A port that reflects so much of what comes back to it."""
    s = np.zeros((FREQUENCY_HZ.size, 2, 2), dtype=np.complex128)
    s[:, 0, 1] = s[:, 1, 0] = 1
    s[:, 0 if turned else 1, 0 if turned else 1] = reflected
    return Network(frequency=_line().frequency, s=s, z0=50)


def _between(fixture: str, impedance_ohm: np.ndarray, strays: Strays) -> Network:
    s = 2j * np.pi * FREQUENCY_HZ
    seen = impedance_ohm + strays.lead_ohm + s * strays.lead_henry
    motor = 1 / (1 / seen + s * strays.across_farad)
    line = _line()
    first, second = (
        line.shunt_capacitor(farad) ** line.inductor(henry) for farad, henry in zip(strays.ground_farads, strays.line_henries, strict=True)
    )
    middle = line.resistor(motor) if fixture == "series-through" else line.shunt(line.load(_reflected(motor)))
    return first**middle ** second.flipped()


def _reflected(impedance_ohm: np.ndarray) -> np.ndarray:
    return (impedance_ohm - 50) / (impedance_ohm + 50)


def s2p(s21: np.ndarray, fixture: str) -> str:
    """A file of it, as a handheld analyser saves it: S12 and S22 are not measured."""
    rows = [f"{f:.6f} 0 0 {t.real:.9g} {t.imag:.9g} 0 0 0 0" for f, t in zip(FREQUENCY_HZ, s21, strict=True)]
    return "\n".join([f"! fixture: {fixture}", "# HZ S RI R 50", *rows]) + "\n"


def measured(
    folder: Path, motor: SimulatedMotor, analyser: TwoPorts, fixture: str, strays: Strays = Strays(), repeats: int = 3
) -> list[ImpedanceSweep]:
    """Both sweeps of a motor, each some times, through files."""
    sweeps = []
    for place, termination in enumerate(TERMINATIONS):
        true = motor.impedance(termination, FREQUENCY_HZ)
        for repeat in range(repeats):
            path = folder / f"{termination}-{repeat}.s2p"
            path.write_text(s2p(analyser.s21(fixture, true, strays, 10 * place + repeat), fixture))
            sweeps.append(read_impedance(path, termination))
    return sweeps
