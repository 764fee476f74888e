"""Quantities that analysers display, from the complex impedance z and the angular frequency w, and the pairs of the 4294A's traces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray

QUANTITIES: dict[str, Callable[[ComplexArray, FloatArray], ComplexArray | FloatArray]] = {
    "|Z|": lambda z, w: np.abs(z),
    "phase of Z": lambda z, w: np.degrees(np.angle(z)),
    "R": lambda z, w: z.real,
    "X": lambda z, w: z.imag,
    "|Y|": lambda z, w: np.abs(1 / z),
    "phase of Y": lambda z, w: np.degrees(np.angle(1 / z)),
    "G": lambda z, w: (1 / z).real,
    "B": lambda z, w: (1 / z).imag,
    "Ls": lambda z, w: z.imag / w,
    "Cs": lambda z, w: -1 / (w * z.imag),
    "Lp": lambda z, w: -1 / (w * (1 / z).imag),
    "Cp": lambda z, w: (1 / z).imag / w,
    "Rp": lambda z, w: 1 / (1 / z).real,
    "Q": lambda z, w: np.abs(z.imag) / z.real,
    "D": lambda z, w: z.real / np.abs(z.imag),
    "Z": lambda z, w: z,
    "Y": lambda z, w: 1 / z,
}
# Words of MEAS: what trace A and trace B show.
PAIRS: dict[str, tuple[str, str]] = {
    "IMPH": ("|Z|", "phase of Z"),
    "IRIM": ("R", "X"),
    "LSR": ("Ls", "R"),
    "LSQ": ("Ls", "Q"),
    "CSR": ("Cs", "R"),
    "CSQ": ("Cs", "Q"),
    "CSD": ("Cs", "D"),
    "AMPH": ("|Y|", "phase of Y"),
    "ARIM": ("G", "B"),
    "LPG": ("Lp", "G"),
    "LPQ": ("Lp", "Q"),
    "CPG": ("Cp", "G"),
    "CPQ": ("Cp", "Q"),
    "CPD": ("Cp", "D"),
    "COMP": ("Z", "Y"),
    "IMLS": ("|Z|", "Ls"),
    "IMCS": ("|Z|", "Cs"),
    "IMLP": ("|Z|", "Lp"),
    "IMCP": ("|Z|", "Cp"),
    "IMRS": ("|Z|", "R"),
    "IMQ": ("|Z|", "Q"),
    "IMD": ("|Z|", "D"),
    "LPR": ("Lp", "Rp"),
    "CPR": ("Cp", "Rp"),
}
