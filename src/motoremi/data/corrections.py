"""Corrections of readings for the parts between motor and instrument: attenuators, limiters, cables, transducers, fixtures.

Reading + loss - gain + transducer = corrected level. Readings are stored uncorrected; corrections are applied before anything is judged or
shown.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.correction_tables import DB_OHM, read_decibels, read_two_port, standard_unit
from motoremi.data.model_errors import problems
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.data.text import clean_text
from motoremi.data.text_file import show_name
from motoremi.data.toml_file import read_toml
from motoremi.errors import BadInput
from motoremi.quantities import parse, show_band

Role = Literal["receiver", "analyser"]
# Unit of a transducer factor -> unit of the corrected level: voltage divider or LISN, current probe, antenna.
UNITS = {"dB": "dBuV", DB_OHM: "dBuA", "dB(1/Ohm)": "dBuA", "dB(S)": "dBuA", "dB/m": "dBuV/m", "dB(1/m)": "dBuV/m"}
# The frequencies of a sweep and of a table may be written with different numbers of digits.
_ROUNDING = 1e-6
_SIGNS = {"loss": 1.0, "gain": -1.0, "transducer": 1.0}
# What the header of a receiver's file says if no transducer was switched on.
_NO_TRANSDUCER = ("", "-", "off", "none")
_OTHER = {"loss": "gain", "gain": "loss"}
# Neighbouring values of a table that are further apart than this factor in frequency cause a remark.
WIDE_GAP = 10.0


# Limits of a value in dB; what is beyond them is not a value in dB.
_LOWEST, _HIGHEST = -200.0, 200.0


def _decibels(value: object) -> object:
    number = parse(value, "dB") if isinstance(value, str) else value
    # Here, so that the message names value, unit and both limits; nan is outside too.
    if isinstance(number, int | float) and not _LOWEST <= number <= _HIGHEST:
        raise BadInput(f"{number:g} dB is out of range ({_LOWEST:g} to {_HIGHEST:g} dB)")
    return number


Decibels = Annotated[float, BeforeValidator(_decibels), Field(ge=_LOWEST, le=_HIGHEST, allow_inf_nan=False)]
Hertz = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Correction(BaseModel):
    """One part between motor and instrument; a value, a list of values, or a file over frequency."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(min_length=1, max_length=200, description="what it is, for the report, such as 10 dB pad")
    role: Role = Field(default="receiver", description="whose readings it changes")
    kind: Literal["loss", "gain", "transducer"] = Field(description="reading + loss - gain + transducer = corrected level")
    db: Decibels | tuple[Decibels, ...] | None = Field(default=None, description="value in dB, or values at frequency_hz")
    frequency_hz: tuple[Hertz, ...] = Field(default=(), description="frequencies of the values, increasing")
    file: str = Field(default="", description="CSV with frequency_hz,db, or Touchstone of two ports, beside the file that names it")
    unit: Annotated[Literal["dB", "dB(Ohm)", "dB(1/Ohm)", "dB(S)", "dB/m", "dB(1/m)"], BeforeValidator(standard_unit)] = Field(
        default="dB",
        description="of a transducer: dB(1/Ohm) for a current probe makes dBuA, dB(Ohm) for its transfer impedance, which is subtracted, too; "
        "dB/m for an antenna makes dBuV/m",
    )
    serial: str = Field(default="", max_length=200, description="serial number")
    calibrated: date | None = Field(default=None, description="date of the last calibration")
    due: date | None = Field(default=None, description="date by which it has to be calibrated again, for the report")
    uncertainty_db: float = Field(default=0.0, ge=0, le=40, description="expanded uncertainty (k = 2) in dB; widens the guard band")
    s_parameters: tuple[tuple[float, ...], ...] = Field(
        default=(), description="of a fixture from its Touchstone file: real and imaginary S11, S21, S12, S22 in 50 Ohm at each frequency"
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.kind != "transducer" and self.unit != "dB":
            raise BadInput(f"{self.name}: a {self.kind} is in dB; only a transducer has the unit {self.unit}")
        if self.s_parameters:
            return self
        if self.db is None and not self.file:
            raise BadInput(f'{self.name}: give db = 10.0, or file = "table.csv"')
        if isinstance(self.db, tuple):
            if len(self.db) != len(self.frequency_hz) or len(self.db) < 2:
                raise BadInput(f"{self.name}: {len(self.frequency_hz)} frequencies but {len(self.db)} values in dB; give as many, two at least")
            if any(after <= before for before, after in zip(self.frequency_hz, self.frequency_hz[1:], strict=False)):
                raise BadInput(f"{self.name}: frequency_hz must increase")
        elif self.frequency_hz:
            raise BadInput(f"{self.name}: frequency_hz belongs to a list of values: db = [...]")
        return self

    def loaded(self, folder: Path) -> Correction:
        """The same correction with the content of its file read.

        Raises
        ------
        BadInput
            If the file cannot be used.
        """
        if not self.file or self.frequency_hz:
            return self
        if self.db is not None:
            raise BadInput(f"{self.name}: has both db and file; keep one")
        path = folder / self.file
        if self.role == "analyser" and path.suffix.lower() == ".s2p":
            frequency_hz, s = read_two_port(path)
            rows = np.stack([s[:, i, j] for i, j in ((0, 0), (1, 0), (0, 1), (1, 1))], axis=1)
            flat = np.stack([rows.real, rows.imag], axis=2).reshape(len(rows), 8)
            return self.model_copy(update={"frequency_hz": tuple(frequency_hz.tolist()), "s_parameters": tuple(map(tuple, flat.tolist()))})
        frequency_hz, db, unit = read_decibels(path, self.kind)
        if unit and "unit" in self.model_fields_set and (UNITS[unit], unit == DB_OHM) != (UNITS[self.unit], self.unit == DB_OHM):
            raise BadInput(f"{show_name(path)}: its values are in {unit}, but {self.name} says unit = {self.unit!r}; correct one of them")
        content = self.model_dump(exclude={"frequency_hz", "db"}) | {"frequency_hz": frequency_hz.tolist(), "db": db.tolist()}
        content |= {"unit": unit} if unit else {}
        try:
            return Correction.model_validate(content)
        except ValidationError as error:
            raise BadInput(f"{show_name(path)}: {problems(error, content)}") from error

    @property
    def least_db(self) -> float:
        """Its lowest value, in dB; 0 for a two-port."""
        return float(np.min(self.db)) if self.db is not None else 0.0

    @property
    def is_negative(self) -> bool:
        """Whether a loss or gain is negative on average: the other kind is meant, or the sign is wrong."""
        return self.kind in _OTHER and self.db is not None and float(np.mean(self.db)) < 0

    def with_other_kind(self) -> Correction:
        """A negative loss as a positive gain, and the other way round."""
        db = tuple(-value for value in self.db) if isinstance(self.db, tuple) else -(self.db or 0.0)
        return self.model_copy(update={"kind": _OTHER[self.kind], "db": db})

    def added_db(self, frequency_hz: FloatArray) -> FloatArray:
        """The correction that is added to a reading, in dB, shape (n,); interpolated linearly over the logarithm of frequency.

        Raises
        ------
        BadInput
            For frequencies outside its table, because nothing is extrapolated.
        """
        self.refuse_outside(float(frequency_hz[0]), float(frequency_hz[-1]))
        if isinstance(self.db, tuple):
            values = np.interp(np.log(frequency_hz), np.log(self.frequency_hz), self.db)
        else:
            values = np.full(frequency_hz.shape, self.db or 0.0)
        sign = -1.0 if self.unit == DB_OHM else _SIGNS[self.kind]
        return sign * np.asarray(values, dtype=np.float64)

    def refuse_outside(self, low_hz: float, high_hz: float) -> None:
        """Raise `BadInput` if its table does not cover a span."""
        if not self.frequency_hz:
            return
        first, last = self.frequency_hz[0], self.frequency_hz[-1]
        if low_hz < first * (1 - _ROUNDING) or high_hz > last * (1 + _ROUNDING):
            raise BadInput(
                f"the correction {clean_text(self.name, 60)!r} is known at {show_band(first, last)} only, but {show_band(low_hz, high_hz)} is "
                "needed; nothing is extrapolated: calibrate it there, or measure where it is known"
            )

    def widest_gap(self) -> tuple[float, float] | None:
        """The widest gap in the table, in hertz, if it is wider than `WIDE_GAP`; else None."""
        pairs = list(zip(self.frequency_hz, self.frequency_hz[1:], strict=False))
        return max((pair for pair in pairs if pair[1] > WIDE_GAP * pair[0]), key=lambda pair: pair[1] / pair[0], default=None)

    def de_embedded(self, frequency_hz: FloatArray, impedance_ohm: ComplexArray) -> ComplexArray:
        """Impedance at the motor's side of the fixture from that at the analyser's side, in ohm; with 50 Ohm S-parameters.

        A two-port terminated by the reflection coefficient g has the input reflection coefficient S11 + S12 S21 g / (1 - S22 g)
        (Pozar, Microwave Engineering, section 4.5).
        """
        self.refuse_outside(float(frequency_hz[0]), float(frequency_hz[-1]))
        table = np.array(self.s_parameters)
        parts = [np.interp(frequency_hz, self.frequency_hz, table[:, column]) for column in range(8)]
        s11, s21, s12, s22 = (parts[2 * k] + 1j * parts[2 * k + 1] for k in range(4))
        front = (impedance_ohm - 50) / (impedance_ohm + 50)
        behind = (front - s11) / (s12 * s21 + s22 * (front - s11))
        return 50 * (1 + behind) / (1 - behind)

    def describe(self) -> str:
        """One line for a person."""
        if self.s_parameters:
            value = f"two-port of {len(self.s_parameters)} points"
        elif isinstance(self.db, tuple):
            value = f"{self.kind} of {min(self.db):.4g} to {max(self.db):.4g} {self.unit}"
        else:
            value = f"{self.kind} of {self.db:g} {self.unit}"
        span = f", {show_band(self.frequency_hz[0], self.frequency_hz[-1])}" if self.frequency_hz else ""
        details = [f"serial {self.serial}" if self.serial else "", f"calibrated {self.calibrated}" if self.calibrated else ""]
        details.append(f"uncertainty {self.uncertainty_db:g} dB" if self.uncertainty_db else "")
        return ", ".join([f"{clean_text(self.name, 80)}: {value}{span}", *(clean_text(text, 80) for text in details if text)])

    def to_dict(self) -> JsonDict:
        """Plain data; keys with default values are left out."""
        return self.model_dump(mode="json", exclude_none=True, exclude_defaults=True) | {"role": self.role, "kind": self.kind}


def _correction(entry: JsonDict, where: str) -> Correction:
    try:
        return Correction.model_validate(entry)
    except ValidationError as error:
        told = problems(error, entry)
        name = f"{entry.get('name')}: " if isinstance(entry.get("name"), str) else ""
        raise BadInput(f"{where}: {told if told.startswith(name) else name + told}") from error


@dataclass(frozen=True)
class Corrections:
    """All corrections of a session or a bench.

    Parameters
    ----------
    entries : tuple of Correction
        With their tables read.
    """

    entries: tuple[Correction, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.entries)

    @classmethod
    def of(cls, content: Iterable[Mapping[str, Any]], where: str) -> Corrections:
        """From plain data; `where` names the source in errors.

        Raises
        ------
        BadInput
            If an entry is not a correction.
        """
        try:
            return cls(tuple(_correction(dict(entry), where) for entry in content))
        except BadInput:
            raise
        except (TypeError, ValueError) as error:
            raise BadInput(f"{where}: its corrections cannot be read ({error})") from error

    def role(self, role: Role) -> tuple[Correction, ...]:
        """Those of one role."""
        return tuple(entry for entry in self.entries if entry.role == role)

    def added_db(self, role: Role, frequency_hz: FloatArray) -> FloatArray:
        """The sum of all corrections of a role, in dB, shape (n,)."""
        total: FloatArray = np.zeros(frequency_hz.shape)
        for entry in self.role(role):
            if not entry.s_parameters:
                total = total + entry.added_db(frequency_hz)
        return total

    def refuse_outside(self, role: Role, low_hz: float, high_hz: float) -> None:
        """Raise `BadInput` if a table does not cover a span."""
        for entry in self.role(role):
            entry.refuse_outside(low_hz, high_hz)

    def uncertainty_db(self, role: Role = "receiver") -> float:
        """Expanded uncertainty (k = 2) of all corrections of a role together, in dB."""
        return float(np.sqrt(sum(entry.uncertainty_db**2 for entry in self.role(role))))

    @property
    def level_unit(self) -> str:
        """Unit of corrected levels."""
        others = [entry.unit for entry in self.role("receiver") if entry.unit != "dB"]
        if len(others) > 1:
            raise BadInput(f"two transducers that change the unit ({' and '.join(others)}); a level is a voltage, a current or a field")
        return UNITS[others[0]] if others else "dBuV"

    def corrected_spectrum(self, spectrum: Spectrum) -> Spectrum:
        """The spectrum with corrected levels; `level_unit` of the metadata holds their unit."""
        if not self.role("receiver"):
            return spectrum
        self._refuse_twice(spectrum)
        level = spectrum.level_dbuv + self.added_db("receiver", spectrum.frequency_hz)
        metadata = {**spectrum.metadata, "level_unit": self.level_unit, "corrected": [entry.name for entry in self.role("receiver")]}
        return Spectrum(spectrum.detector, spectrum.frequency_hz, level, spectrum.resolution_bandwidth_hz, spectrum.overload, metadata)

    def _refuse_twice(self, spectrum: Spectrum) -> None:
        """Refuse a correction that the receiver has already applied, according to the header of its file."""
        applied = applied_transducer(spectrum)
        names = [name.lower() for name in applied.split("; ")]
        for entry in self.role("receiver"):
            if applied and (entry.kind == "transducer" or entry.name.lower() in names):
                raise BadInput(
                    f"{spectrum.metadata.get('source', 'the receiver')}: its header says that the receiver has applied the transducer "
                    f"{clean_text(applied, 60)!r} already; take {clean_text(entry.name, 60)!r} out of the corrections, or export without it"
                )

    def corrected_sweep(self, sweep: ImpedanceSweep) -> ImpedanceSweep:
        """The sweep with corrected impedance: fixtures are de-embedded in order, then |Z| is corrected by the values in dB."""
        entries = self.role("analyser")
        if not entries:
            return sweep
        impedance = sweep.impedance_ohm
        for entry in entries:
            if entry.s_parameters:
                impedance = entry.de_embedded(sweep.frequency_hz, impedance)
        impedance = impedance * 10 ** (self.added_db("analyser", sweep.frequency_hz) / 20)
        metadata = {**sweep.metadata, "corrected": [entry.name for entry in entries]}
        return replace(sweep, impedance_ohm=impedance, metadata=metadata)

    def remarks(self) -> list[str]:
        """Remarks for the report."""
        found = []
        for entry in self.entries:
            if gap := entry.widest_gap():
                found.append(f"the correction {entry.name!r} has no value between {show_band(*gap)}: it is interpolated there")
            if entry.unit == "dB" and (least := entry.least_db) < 0:
                found.append(f"the {entry.kind} {entry.name!r} is negative, down to {least:g} dB, where it has the opposite effect: check its sign")
        repeated = [entry.name for index, entry in enumerate(self.entries) if entry in self.entries[:index]]
        return found + [f"the correction {name!r} is entered twice with the same values, and both are applied" for name in dict.fromkeys(repeated)]

    def to_list(self) -> list[JsonDict]:
        """Plain data; `of` reads it back."""
        return [entry.to_dict() for entry in self.entries]


NO_CORRECTIONS = Corrections()


def applied_transducer(spectrum: Spectrum) -> str:
    """Names of the transducers that the receiver has applied, according to the header of its file; empty if there is none."""
    names = [name.strip() for name in str(spectrum.metadata.get("transducer", "")).split(";")]
    return "; ".join(name for name in names if name.lower() not in _NO_TRANSDUCER)


def read_corrections(path: str | Path, confirm: Callable[[str], bool] | None = None) -> Corrections:
    """Corrections from a file: `[[correction]]` tables, alone or in a bench file.

    Parameters
    ----------
    path : path-like
    confirm : callable, optional
        Called with a question if a loss is negative: is it a gain? Without it, a negative loss is an error.

    Raises
    ------
    BadInput
        If the file, or a table that it names, cannot be used.
    """
    shown = show_name(path)
    return with_tables(Corrections.of(entries_of(read_toml(path), shown), shown), Path(path).parent, confirm)


def entries_of(content: JsonDict, where: str, hint: str = "") -> list[Any]:
    """The `[[correction]]` tables of a TOML file, not checked one by one; `hint` ends the message if there are none.

    Raises
    ------
    BadInput
        If there are none.
    """
    listed = content.get("correction")
    if isinstance(listed, dict):
        raise BadInput(f"{where}: correction: write [[correction]], with two brackets")
    if not isinstance(listed, list) or not listed:
        raise BadInput(f"{where}: holds no [[correction]]; each has name, kind and db or file{hint}")
    return listed


def with_tables(corrections: Corrections, folder: Path, confirm: Callable[[str], bool] | None = None) -> Corrections:
    """The same corrections with every file read from `folder` and signs checked; see `read_corrections`."""
    found = []
    for entry in corrections.entries:
        loaded = entry.loaded(folder)
        if loaded.is_negative:
            value = f"{float(np.mean(loaded.db)):g} dB"  # type: ignore[arg-type]
            if confirm is None or not confirm(f"{entry.name}: a {entry.kind} of {value} is a {_OTHER[entry.kind]}. Is it one?"):
                raise BadInput(
                    f"{entry.name}: a {entry.kind} of {value}? A {entry.kind} is written as a positive number; write kind = "
                    f'"{_OTHER[entry.kind]}" with positive values if that is meant'
                )
            loaded = loaded.with_other_kind()
        found.append(loaded)
    made = Corrections(tuple(found))
    _ = made.level_unit
    return made
