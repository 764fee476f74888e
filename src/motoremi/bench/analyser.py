"""What every impedance analyser can do, and the rules that do not depend on its maker."""

from __future__ import annotations

import abc
from typing import ClassVar, Literal

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.driver import Driver
from motoremi.bench.transport import Transport
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show_band

Standard = Literal["open", "short", "load"]
Spacing = Literal["log", "linear"]


class ImpedanceAnalyser(Driver):
    """An analyser that sweeps impedance against frequency.

    Attributes
    ----------
    analyser : str
        Name of its error model in the analysis.
    STANDARDS_USED : tuple of str
        Which standards `compensate` takes.
    """

    analyser: ClassVar[str]
    STANDARDS_USED: ClassVar[tuple[Standard, ...]] = ("open", "short")

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        # The axis each fixture compensation was measured on. Coefficients of another axis silently spoil every point.
        self._compensated: dict[Standard, FloatArray] = {}
        self.load_ohm: float | None = None

    @abc.abstractmethod
    def configure(
        self,
        start_hz: float,
        stop_hz: float,
        points: int,
        spacing: Spacing = "log",
        bandwidth_factor: int = 3,
        oscillator_volt: float = 0.5,
    ) -> JsonDict:
        """Set the sweep up and return the settings as the instrument reports them.

        Parameters
        ----------
        start_hz, stop_hz : float
            First and last frequency in hertz.
        points : int
        spacing : {"log", "linear"}
        bandwidth_factor : int
            1 is fastest, 5 most accurate.
        oscillator_volt : float
            Level of the test signal in volt.
        """

    @abc.abstractmethod
    def measure_standard(self, standard: Standard) -> None:
        """Measure the standard that is connected and switch its compensation on."""

    @abc.abstractmethod
    def trigger(self) -> None:
        """Start one sweep."""

    @abc.abstractmethod
    def wait_until_complete(self) -> None:
        """Return when the sweep is complete; `InstrumentError` if it is not in time."""

    @abc.abstractmethod
    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""

    @abc.abstractmethod
    def read_impedance(self) -> ComplexArray:
        """Impedance of the last complete sweep in ohm; refused before it is complete."""

    def metadata(self) -> JsonDict:
        """What else is worth keeping with the sweep that has just been read."""
        return {}

    def compensate(self, standard: Standard, nominal_ohm: float | None = None) -> None:
        """Measure the fixture with the standard that is connected now, on the frequencies of the sweep.

        Parameters
        ----------
        standard : {"open", "short", "load"}
        nominal_ohm : float, optional
            Resistance of the load.

        Raises
        ------
        BadInput
            If this analyser has no use for the standard, or the load's value is missing.
        """
        if standard not in self.STANDARDS_USED:
            raise BadInput(f"{self}: takes no {standard} standard; compensate with {' and '.join(self.STANDARDS_USED)}")
        if standard == "load":
            if nominal_ohm is None:
                raise BadInput(f"{self}: the value of the load standard is missing; say its nominal resistance")
            self.load_ohm = nominal_ohm
        self._compensated.pop(standard, None)
        self.measure_standard(standard)
        self._compensated[standard] = self.read_axis()

    def sweep(self, termination: str) -> ImpedanceSweep:
        """Measure the motor once.

        Parameters
        ----------
        termination : {"short", "open"}
            How the motor is connected.

        Raises
        ------
        InstrumentError
            If the compensation belongs to other frequencies, the sweep does not end in time, or the data are not whole.
        """
        frequency_hz = self.read_axis()
        self._refuse_other_axis(frequency_hz)
        self.trigger()
        self.wait_until_complete()
        impedance_ohm = self.read_impedance()
        if impedance_ohm.size != frequency_hz.size:
            raise InstrumentError(f"{self}: {frequency_hz.size} frequencies but {impedance_ohm.size} impedances came")
        metadata = {
            "analyser": self.analyser,
            "resource": self.transport.resource_name,
            "settings": self.settings(),
            "compensated": sorted(self._compensated),
            **self.metadata(),
        }
        return ImpedanceSweep(termination, frequency_hz, impedance_ohm, metadata=metadata)

    def _refuse_other_axis(self, frequency_hz: FloatArray) -> None:
        for standard, axis in self._compensated.items():
            if axis.size != frequency_hz.size or not np.allclose(axis, frequency_hz, rtol=1e-9, atol=0):
                raise InstrumentError(
                    f"{self}: the {standard} compensation was measured at {axis.size} points in "
                    f"{show_band(float(axis[0]), float(axis[-1]))}, the sweep has {frequency_hz.size} points in "
                    f"{show_band(float(frequency_hz[0]), float(frequency_hz[-1]))}; compensate again"
                )
