"""Base class of the drivers of impedance analysers, and the checks that all of them share."""

from __future__ import annotations

import abc
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.bench.driver import Driver
from motoremi.bench.sweep_options import SweepOptions
from motoremi.bench.transport import Transport
from motoremi.data.analyser import specification
from motoremi.data.sweep import ImpedanceSweep
from motoremi.errors import BadInput, InstrumentError
from motoremi.quantities import show_band

Standard = Literal["open", "short", "load"]
Spacing = Literal["log", "linear"]


@dataclass(frozen=True)
class SweepSettings:
    """Settings of an impedance sweep.

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

    start_hz: float
    stop_hz: float
    points: int
    spacing: Spacing
    bandwidth_factor: int
    oscillator_volt: float


class ImpedanceAnalyser(Driver):
    """An analyser that sweeps impedance against frequency.

    Attributes
    ----------
    analyser : str
        Name of its error model in the analysis.
    """

    analyser: ClassVar[str]
    # Standards that its compensation uses, and options of a sweep that it has, by their keys in a procedure.
    COMPENSATES: ClassVar[frozenset[Standard]] = frozenset({"open", "short"})
    OPTIONS: ClassVar[frozenset[str]] = frozenset()
    # Standards without which it cannot measure at all.
    REQUIRED: ClassVar[frozenset[Standard]] = frozenset()

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        # Frequencies at which each standard was measured. Compensation with data of other frequencies would falsify every point silently.
        self._compensated: dict[Standard, FloatArray] = {}
        self.options = SweepOptions()

    def configure(
        self,
        start_hz: float,
        stop_hz: float,
        points: int,
        spacing: Spacing = "log",
        bandwidth_factor: int = 3,
        oscillator_volt: float = 0.5,
    ) -> JsonDict:
        """Set the sweep up and return the settings as the instrument reports them; parameters as in `SweepSettings`."""
        return self.set_up(SweepSettings(start_hz, stop_hz, points, spacing, bandwidth_factor, oscillator_volt))

    def set_up(self, asked: SweepSettings) -> JsonDict:
        """Set the sweep up and return the settings as the instrument reports them; every driver defines this, or `configure`."""
        raise NotImplementedError

    def prepare(self, options: SweepOptions) -> JsonDict | None:
        """Set the options of a sweep, after `configure`, and return all settings as the instrument reports them; None if none has changed.

        Raises
        ------
        BadInput
            If this analyser lacks an option that is asked for.
        """
        refuse_without(type(self), options, str(self))
        self.options = options
        return None

    def define_load(self, ohm: float, henry: float) -> None:
        """Set the value of the load standard, before it is measured."""
        raise BadInput(f"{self}: its compensation takes no load standard")

    @abc.abstractmethod
    def measure_standard(self, standard: Standard) -> None:
        """Measure the standard that is connected and switch its compensation on."""

    @abc.abstractmethod
    def trigger(self) -> None:
        """Start one sweep."""

    @abc.abstractmethod
    def wait_until_complete(self) -> None:
        """Return when the sweep is complete; `InstrumentError` if it takes too long."""

    @abc.abstractmethod
    def read_axis(self) -> FloatArray:
        """Frequencies of the sweep in hertz."""

    @abc.abstractmethod
    def read_impedance(self) -> ComplexArray:
        """Impedance of the last complete sweep in ohm; refused before it is complete."""

    def stimulus(self) -> AbstractContextManager[None]:
        """Context in which the motor is measured, for example with a bias across it; the bias is removed even if the sweep fails."""
        return nullcontext()

    def read_compensation(self, standard: Standard) -> ImpedanceSweep | None:
        """What the instrument measured with a standard; None if it cannot be read out."""
        return None

    def metadata(self) -> JsonDict:
        """Further metadata of the sweep that has just been read."""
        return {}

    def compensate(self, standard: Standard) -> None:
        """Measure the fixture with the standard that is connected now, at the frequencies of the sweep."""
        self._compensated.pop(standard, None)
        self.measure_standard(standard)
        self._compensated[standard] = self.read_axis()

    def sweep(self, termination: str, *, of_a_standard: bool = False) -> ImpedanceSweep:
        """Measure the motor once.

        Parameters
        ----------
        termination : {"short", "open"}
            How the motor is connected.
        of_a_standard : bool
            Whether a standard is connected instead of the motor; no bias is applied to it.

        Raises
        ------
        InstrumentError
            If the compensation belongs to other frequencies, the sweep takes too long, or data are missing.
        """
        frequency_hz = self.read_axis()
        self._refuse_other_axis(frequency_hz)
        with nullcontext() if of_a_standard else self.stimulus():
            self.trigger()
            self.wait_until_complete()
        impedance_ohm = self.read_impedance()
        if impedance_ohm.size != frequency_hz.size:
            raise InstrumentError(f"{self}: {frequency_hz.size} frequencies but {impedance_ohm.size} impedances were received")
        settings = self.settings()
        # An adapter or fixture that the instrument reports takes precedence over the one in the procedure.
        between = {name: settings.get(name, getattr(self.options, name)) for name in ("adapter", "fixture")}
        metadata = {
            "analyser": specification(self.analyser, **between),
            **{name: word for name, word in between.items() if word != "none" or name in settings},
            "resource": self.transport.resource_name,
            "settings": settings,
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


def refuse_without(kind: type[ImpedanceAnalyser], options: SweepOptions, who: str) -> None:
    """Raise `BadInput` if that kind of analyser lacks an option that is asked for; `who` names it."""
    lacking = [name for name in options.needed() if name not in kind.OPTIONS]
    if lacking:
        raise BadInput(f"{who}: has no {', '.join(lacking)}; leave it out of the sweep, or use an analyser that has it")
