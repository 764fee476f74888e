"""ngspice as an independent referee of networks: one AC analysis, 1 A driven between two nodes."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from numpy.typing import ArrayLike

from motoremi.arrays import ComplexArray

Test = TypeVar("Test", bound=Callable[..., Any])

HAS_NGSPICE = shutil.which("ngspice") is not None


def needs_ngspice(test: Test) -> Test:
    """Mark a test that starts ngspice: skipped without it, and not among the quick ones."""
    return pytest.mark.slow(pytest.mark.skipif(not HAS_NGSPICE, reason="ngspice is not installed; it is only a second opinion on networks")(test))


def solve(netlist_lines: Iterable[str], positive: str, negative: str, frequency_hz: ArrayLike) -> ComplexArray:
    """Impedance between two nodes of a netlist.

    Parameters
    ----------
    netlist_lines : iterable of str
        Element lines; none of the nodes is `0`.
    positive, negative : str
    frequency_hz : array_like, shape (n,)

    Returns
    -------
    ndarray of complex, shape (n,)
        In ohm, to twelve printed digits.
    """
    frequencies = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    with tempfile.TemporaryDirectory() as folder:
        deck, data = Path(folder) / "network.cir", Path(folder) / "out.data"
        deck.write_text(
            "\n".join(
                (
                    "driving point impedance",
                    *netlist_lines,
                    f"Iprobe 0 {positive} ac 1",
                    f"Vreturn {negative} 0 dc 0",
                    # A network of capacitors alone has no operating point, and a linear one needs none. The shunts hold nodes
                    # that only mutual coupling joins to the rest.
                    ".options noopac rshunt=1e18 gmin=1e-30",
                    ".control",
                    "set numdgt=14",
                    "set wr_singlescale",
                    "set appendwrite",
                    *(line for f in frequencies for line in (f"ac lin 1 {f:.16g} {f:.16g}", f"wrdata {data} v({positive})", "destroy all")),
                    "quit",
                    ".endc",
                    ".end",
                    "",
                )
            )
        )
        run = subprocess.run(["ngspice", "-b", str(deck)], capture_output=True, text=True, timeout=300, check=False)
        if not data.exists():
            raise RuntimeError(f"ngspice gave no data:\n{run.stdout}\n{run.stderr}")
        rows = np.loadtxt(data, ndmin=2)
    np.testing.assert_allclose(rows[:, 0], frequencies, rtol=1e-9)
    impedance: ComplexArray = rows[:, 1] + 1j * rows[:, 2]
    return impedance
