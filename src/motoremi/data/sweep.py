"""An impedance sweep: one termination, one connection, one pass of the analyser."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from motoremi.arrays import BoolArray, ComplexArray, FloatArray, JsonDict, ReadOnlyArrays
from motoremi.data.conditions import Condition, parse_condition
from motoremi.data.frame import impedance_in
from motoremi.data.text import clean_text
from motoremi.drawing import figure_of
from motoremi.errors import BadInput
from motoremi.given import complex_numbers, frozen_metadata, real_number, real_numbers, refuse_other
from motoremi.quantities import parse, percent, show, show_band

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Termination = Literal["short", "open"]
TERMINATIONS: tuple[Termination, ...] = get_args(Termination)
# Fewest points of a sweep: a fit of seven parameters needs more points than parameters to be judged.
MINIMUM_POINTS = 8
# Impedances beyond these are no readings: contacts have a microohm, insulators 1e15 Ohm.
LEAST_OHM, MOST_OHM = 1e-12, 1e15
# Repeats of the analyser with the lowest noise at hand scatter by 6e-5: readings this close, relative to |Z|, are those of one measurement, in the
# same file or in another format with fewer digits.
SAME_READINGS = 1e-5
# Frequencies this close, relative to themselves and to the distance of the next point, are the same: files round them differently, to hertz or to
# millionths of a megahertz. |Z| of an inductance or a capacitance differs by as much as the frequency, which is less than the lowest noise above.
SAME_FREQUENCY, OF_SPACING = 1e-5, 0.01


@dataclass(frozen=True, eq=False)
class ImpedanceSweep(ReadOnlyArrays):
    """Complex impedance against frequency at one termination of the motor.

    Parameters
    ----------
    termination : {"short", "open"}
        `short`: winding between its two terminals, eq. (1) of Liu, Wang and Nan (2011); `open`: terminal to frame, eq. (2).
    frequency_hz : array_like, shape (n,)
        Strictly increasing, in hertz.
    impedance_ohm : array_like, shape (n,)
        Complex, in ohm.
    sigma_relative : array_like, optional
        Standard deviation of the real and of the imaginary part of the relative noise, per point or one for all: 0.01 is 1 %.
        It takes the place of a noise estimated from the sweep's own scatter.
    metadata : mapping, optional
        Origin of the data: file, instrument, settings.
    condition : Condition or str, optional
        What was set up for it, for example "second-temperature=53degC"; None is the motor as it is. Sweeps under a condition do not count as
        repeats of those without.
    rounding_relative : array_like, optional
        The same for the error because numbers were rounded to few digits, which scatter and repeats need not show: the noise is never below it.

    Raises
    ------
    BadInput
        For an unknown termination or condition, arrays that do not match, masked points, NaN, unsorted or repeated frequencies, or too few points.
    """

    termination: Termination
    frequency_hz: FloatArray
    impedance_ohm: ComplexArray
    sigma_relative: FloatArray | None = None
    metadata: Mapping[str, Any] = field(default_factory=dict)
    condition: Condition | None = None
    rounding_relative: FloatArray | None = None

    def __init__(
        self,
        termination: str,
        frequency_hz: ArrayLike,
        impedance_ohm: ArrayLike,
        sigma_relative: ArrayLike | None = None,
        metadata: Mapping[str, Any] | None = None,
        condition: Condition | str | None = None,
        rounding_relative: ArrayLike | None = None,
    ) -> None:
        if termination not in TERMINATIONS:
            raise BadInput(f"unknown termination {termination!r}: use 'short' or 'open'")
        frequency = checked_frequency(frequency_hz, f"{termination} sweep", MINIMUM_POINTS)
        impedance = complex_numbers(impedance_ohm, f"{termination} sweep: the impedances")
        if impedance.shape != frequency.shape:
            raise BadInput(f"{termination} sweep: {frequency.size} frequencies but {impedance.size} impedances")
        if not np.all(np.isfinite(impedance)):
            where = int(np.flatnonzero(~np.isfinite(impedance))[0])
            raise BadInput(
                f"{termination} sweep: the impedance at point {where + 1} ({frequency[where]:g} Hz) is not a finite number; remove the row"
            )
        unmeasured = np.flatnonzero((np.abs(impedance) > MOST_OHM) | (np.abs(impedance) < LEAST_OHM))
        if unmeasured.size:
            at = f"point {int(unmeasured[0]) + 1}, {frequency[unmeasured[0]]:g} Hz"
            raise BadInput(
                f"{termination} sweep: an impedance of 0 (below {LEAST_OHM:g} Ohm) or above {MOST_OHM:g} Ohm marks a point that was not measured "
                f"({at}); remove the row"
            )
        sigma = _relative(sigma_relative, frequency.size, f"{termination} sweep", "sigma_relative")
        rounding = _relative(rounding_relative, frequency.size, f"{termination} sweep", "rounding_relative")
        if condition is not None:
            refuse_other(condition, (str, Condition), f"{termination} sweep: a condition is a text such as 'second-temperature=53degC'")
        for array in (frequency, impedance, sigma, rounding):
            if array is not None:
                array.flags.writeable = False
        for name, value in (
            ("termination", termination),
            ("frequency_hz", frequency),
            ("impedance_ohm", impedance),
            ("sigma_relative", sigma),
            ("metadata", frozen_metadata(metadata, f"{termination} sweep")),
            ("condition", parse_condition(condition) if isinstance(condition, str) else condition),
            ("rounding_relative", rounding),
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    def __repr__(self) -> str:
        return f"ImpedanceSweep({self.termination!r}, {self.summary()})"

    def _repr_html_(self) -> str:
        return f"<b>{self.termination} sweep</b>: {self.summary()}"

    @property
    def span_hz(self) -> tuple[float, float]:
        """First and last frequency in hertz."""
        return float(self.frequency_hz[0]), float(self.frequency_hz[-1])

    def extent(self) -> JsonDict:
        """Plain data without the values: termination, points and span, and the condition of one that has any."""
        condition = {} if self.condition is None else {"condition": self.condition.to_dict()}
        return {"termination": self.termination, **condition, "points": len(self), "span_hz": list(self.span_hz)}

    def summary(self) -> str:
        """One line for a person: points, span and range of |Z|."""
        magnitude = np.abs(self.impedance_ohm)
        under = f", {self.condition}" if self.condition is not None else ""
        return f"{len(self)} points, {show_band(*self.span_hz)}, |Z| {show(magnitude.min(), 'Ohm', 3)} - {show(magnitude.max(), 'Ohm', 3)}{under}"

    def with_metadata(self, **extra: Any) -> ImpedanceSweep:
        """The same sweep with more metadata."""
        return dataclasses.replace(self, metadata={**self.metadata, **extra})

    def under(self, condition: Condition | None) -> ImpedanceSweep:
        """The same sweep, taken under a condition."""
        return dataclasses.replace(self, condition=condition)

    def with_change(self, what: str) -> ImpedanceSweep:
        """The same sweep with one more entry in its metadata `changes`, which list what was changed in the instrument's data."""
        return self.with_metadata(changes=[*self.metadata.get("changes", []), what])

    def within(self, low_hz: float, high_hz: float) -> ImpedanceSweep:
        """The points of a band, both ends included; the metadata `changes` record what was left out.

        Raises
        ------
        BadInput
            If fewer than `MINIMUM_POINTS` remain, or an end is not a number.
        """
        low_hz, high_hz = (real_number(end, "an end of the band") for end in (low_hz, high_hz))
        inside, change = inside_band(self.frequency_hz, low_hz, high_hz)
        if not change:
            return self
        sigma, rounding = (None if own is None else own[inside] for own in (self.sigma_relative, self.rounding_relative))
        part = ImpedanceSweep(
            self.termination, self.frequency_hz[inside], self.impedance_ohm[inside], sigma, self.metadata, self.condition, rounding
        )
        return part.with_change(change)

    @classmethod
    def from_frame(
        cls, termination: str, frame: pd.DataFrame, metadata: Mapping[str, Any] | None = None, condition: Condition | str | None = None
    ) -> ImpedanceSweep:
        """A sweep from a pandas table, whose columns are named as in files: `frequency_hz, resistance_ohm, reactance_ohm`, `f (MHz)` ...

        Parameters
        ----------
        termination, metadata, condition
            As in `ImpedanceSweep`.
        frame : DataFrame
            With `sigma_relative` that is taken too, and `rounding_relative`, else the rounding is that of the numbers' digits; columns of
            other names are left alone. Rows from high to low frequencies are turned round; the metadata `changes` record that.

        Raises
        ------
        BadInput
            As `ImpedanceSweep`, and if a column or its unit is missing or not known.
        """
        frequency_hz, impedance_ohm, sigma_relative, rounding_relative, changes = impedance_in(frame)
        sweep = cls(termination, frequency_hz, impedance_ohm, sigma_relative, metadata, condition, rounding_relative)
        for change in changes:
            sweep = sweep.with_change(change)
        return sweep

    def to_frame(self) -> pd.DataFrame:
        """A pandas table: frequency_hz, resistance_ohm, reactance_ohm, and sigma_relative and rounding_relative where they are known."""
        import pandas as pd

        columns = {"frequency_hz": self.frequency_hz, "resistance_ohm": self.impedance_ohm.real, "reactance_ohm": self.impedance_ohm.imag}
        if self.sigma_relative is not None:
            columns["sigma_relative"] = self.sigma_relative
        if self.rounding_relative is not None:
            columns["rounding_relative"] = self.rounding_relative
        return pd.DataFrame(columns)

    def to_dict(self) -> JsonDict:
        """Plain data, SI units."""
        return {
            "termination": self.termination,
            "frequency_hz": self.frequency_hz.tolist(),
            "resistance_ohm": self.impedance_ohm.real.tolist(),
            "reactance_ohm": self.impedance_ohm.imag.tolist(),
            "sigma_relative": None if self.sigma_relative is None else self.sigma_relative.tolist(),
            "metadata": dict(self.metadata),
            **({} if self.condition is None else {"condition": self.condition.to_dict()}),
            **({} if self.rounding_relative is None else {"rounding_relative": self.rounding_relative.tolist()}),
        }

    def plot(self) -> Figure:
        """Magnitude and phase over frequency, resonances marked."""
        return figure_of(self)


def _relative(values: ArrayLike | None, points: int, what: str, name: str) -> FloatArray | None:
    """A relative standard deviation of each point after its check; None if there is none."""
    if values is None:
        return None
    sigma = real_numbers(values, f"{what}: the values of {name}")
    if sigma.shape not in ((), (1,), (points,)):
        raise BadInput(f"{what}: {sigma.size} values of {name} for {points} points: give one, or one for each")
    if not np.all(np.isfinite(sigma)) or np.any(sigma <= 0):
        raise BadInput(f"{what}: {name} must be finite and above 0")
    if np.any(sigma > 1):
        raise BadInput(f"{what}: {name} of {sigma.max():g} is more than |Z| itself: it is a fraction, 0.01 for 1 %")
    return np.broadcast_to(sigma, points).copy()


def checked_accuracy(percent: object) -> float:
    """The accuracy that a user states for a sweep, in percent of |Z|; stored as the metadata `accuracy_percent`.

    Raises
    ------
    BadInput
        If it is not a number above 0 and below 100.
    """
    value = parse(percent, "%") if isinstance(percent, (str, int, float)) else 0.0
    if not 0 < value < 100:
        raise BadInput(f"the accuracy {clean_text(str(percent), 40)!r} cannot be used: give percent of |Z|, above 0 and below 100")
    return value


def inside_band(frequency_hz: FloatArray, low_hz: float, high_hz: float) -> tuple[BoolArray, str]:
    """The points of a band, both ends included, shape (n,), and what is left out in words; empty if nothing is.

    Raises
    ------
    BadInput
        If fewer than `MINIMUM_POINTS` are inside.
    """
    # An end that was converted from kHz or MHz may differ in its last digit.
    inside: BoolArray = (frequency_hz >= low_hz * (1 - 1e-9)) & (frequency_hz <= high_hz * (1 + 1e-9))
    count, points, band = int(inside.sum()), frequency_hz.size, show_band(low_hz, high_hz)
    if count < MINIMUM_POINTS:
        span = f" ({show_band(float(frequency_hz[0]), float(frequency_hz[-1]))})" if points else ""
        raise BadInput(f"{count} of {points} points{span} are within {band}; at least {MINIMUM_POINTS} are needed")
    return inside, "" if count == points else f"{points - count} of {points} points outside {band} left out"


def check_order(frequency_hz: float, before_hz: float, where: str) -> None:
    """Raise `BadInput` if the frequency of a row is lower than that of the row before it."""
    if frequency_hz < before_hz:
        raise BadInput(f"{where}: frequencies must increase, but {frequency_hz:.12g} Hz follows {before_hz:.12g} Hz; sort the rows")


def checked_frequency(frequency_hz: ArrayLike, what: str, minimum_points: int) -> FloatArray:
    """A copy of a frequency axis after its check; raises `BadInput` if it cannot be one."""
    frequency = real_numbers(frequency_hz, f"{what}: the frequencies")
    if frequency.ndim != 1 or frequency.size < minimum_points:
        raise BadInput(f"{what}: needs at least {minimum_points} points, got {frequency.size}")
    if not np.all(np.isfinite(frequency)) or frequency[0] <= 0:
        raise BadInput(f"{what}: frequencies must be finite and above 0 Hz")
    steps = np.diff(frequency)
    if np.any(steps == 0):
        where = int(np.flatnonzero(steps == 0)[0])
        raise BadInput(f"{what}: the frequency {frequency[where]:g} Hz occurs twice; keep one row for each frequency")
    if np.any(steps < 0):
        where = int(np.flatnonzero(steps < 0)[0])
        check_order(frequency[where + 1], frequency[where], what)
    return frequency


def same_frequencies(first_hz: FloatArray, other_hz: FloatArray) -> bool:
    """Whether two frequency axes are the same but for the rounding of files."""
    if first_hz.size != other_hz.size:
        return False
    steps = np.diff(first_hz, prepend=-np.inf, append=np.inf)
    spacing = np.minimum(steps[:-1], steps[1:])
    return bool(np.all(np.abs(other_hz - first_hz) <= np.minimum(SAME_FREQUENCY * first_hz, OF_SPACING * spacing)))


@dataclass(frozen=True, eq=False)
class RepeatedSweep:
    """All repeats of one termination, on one frequency axis.

    Parameters
    ----------
    termination : {"short", "open"}
    frequency_hz : ndarray, shape (n,)
    impedance_ohm : ndarray, shape (repeats, n)
    sigma_relative : ndarray, shape (n,), or None
        Noise of one repeat as stated by the user.
    counts : ndarray, shape (n,), or None
        Number of measured points that each point is the mean of; None: one each.
    moved : ndarray, shape (4,), or None
        Standard deviation in one repeat of the R, L, G and C of leads that moved between the repeats, in SI units, widened because few repeats
        show it (`data.moved.student_factor`); `impedance_ohm` is then with the leads in their average position.
    copies : int
        Number of sweeps that were left out because they hold the readings of another one.
    names : tuple of str
        Of each repeat: its file, or its place among the sweeps of the termination.
    left_out : tuple of str
        Names of the repeats that were left out because they are the other termination's sweep again (`data.mislabelled`).
    rounding_relative : ndarray, shape (n,), or None
        Error of one repeat because its numbers were rounded; with little noise all repeats have the same one, so that their mean has it too.
    """

    termination: Termination
    frequency_hz: FloatArray
    impedance_ohm: ComplexArray
    sigma_relative: FloatArray | None
    counts: FloatArray | None = None
    moved: FloatArray | None = None
    copies: int = 0
    names: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()
    rounding_relative: FloatArray | None = None

    @property
    def repeats(self) -> int:
        """Number of repeats."""
        return int(self.impedance_ohm.shape[0])

    @property
    def mean_ohm(self) -> ComplexArray:
        """Mean of the repeats, in ohm."""
        return self.impedance_ohm.mean(axis=0)

    @property
    def moved_of_mean(self) -> FloatArray:
        """Standard deviation of the average R, L, G and C of the leads, shape (4,)."""
        return np.zeros(4) if self.moved is None else self.moved / np.sqrt(self.repeats)

    @property
    def changes_by_leads(self) -> ComplexArray:
        """Relative change of Z for a series ohm and henry and a shunt siemens and farad, shape (n, 4)."""
        s, impedance = 2j * np.pi * self.frequency_hz, self.mean_ohm
        return np.column_stack([1 / impedance, s / impedance, -impedance, -s * impedance])


def _unlike(first: ImpedanceSweep, other: ImpedanceSweep) -> str:
    """How the frequencies of two repeats differ, in words."""
    if len(first) != len(other):
        return f"but have {len(first)} and {len(other)} points"
    apart = np.abs(other.frequency_hz / first.frequency_hz - 1)
    worst = int(np.argmax(apart))
    return f"but differ by {percent(100 * apart[worst])} at point {worst + 1}"


def _without_copies(repeats: Sequence[ComplexArray]) -> list[int]:
    """The places of the repeats whose readings are not those of an earlier one."""
    kept: list[int] = []
    for place, one in enumerate(repeats):
        if not any(np.all(np.abs(one - repeats[other]) <= SAME_READINGS * np.abs(repeats[other])) for other in kept):
            kept.append(place)
    return kept


def group_repeats(sweeps: Iterable[ImpedanceSweep]) -> list[RepeatedSweep]:
    """Group the repeats of each termination; the short-circuit sweep comes first. A copy of a repeat counts once.

    The frequencies are those of the first repeat.

    Raises
    ------
    BadInput
        If there is no sweep, or repeats of one termination are not on the same frequencies.
    """
    gathered: dict[Termination, list[ImpedanceSweep]] = {"short": [], "open": []}
    for sweep in sweeps:
        if not isinstance(sweep, ImpedanceSweep):
            raise BadInput(f"expected an ImpedanceSweep, got {type(sweep).__name__}")
        gathered[sweep.termination].append(sweep)
    groups = []
    for termination, members in gathered.items():
        if not members:
            continue
        first = members[0]
        for other in members[1:]:
            if not same_frequencies(first.frequency_hz, other.frequency_hz):
                shown = f"{first.summary()} against {other.summary()}"
                raise BadInput(
                    f"repeats of the {termination} sweep must have the same frequencies, {_unlike(first, other)}: measure them with the same "
                    f"start, stop and number of points, or import one of them ({shown})"
                )
        stated = [member.sigma_relative for member in members if member.sigma_relative is not None]
        sigma = np.sqrt(np.mean(np.square(stated), axis=0)) if len(stated) == len(members) else None
        rounded = [np.zeros(len(first)) if member.rounding_relative is None else member.rounding_relative for member in members]
        rounding = np.sqrt(np.mean(np.square(rounded), axis=0)) if np.any(rounded) else None
        kept = _without_copies([member.impedance_ohm for member in members])
        repeats = np.array([members[place].impedance_ohm for place in kept])
        sources = [str(member.metadata.get("source") or "") for member in members]
        # One file may hold several repeats.
        names = tuple(
            sources[place] if sources[place] and sources.count(sources[place]) == 1 else f"{sources[place]} number {place + 1}".lstrip()
            for place in kept
        )
        copies = len(members) - len(kept)
        groups.append(RepeatedSweep(termination, first.frequency_hz, repeats, sigma, copies=copies, names=names, rounding_relative=rounding))
    if not groups:
        raise BadInput("no impedance sweep: give a short-circuit sweep, an open-circuit sweep, or better both")
    return groups
