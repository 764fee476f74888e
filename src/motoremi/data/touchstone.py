"""Touchstone files: .s1p as network analysers and NanoVNA programs save, .z1p, .y1p, and .s2p of a fixture between two ports; version 1 and 2."""

from __future__ import annotations

import io
import math
import re
import warnings
from dataclasses import dataclass
from typing import Literal, cast, get_args

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.numbers import looks_cut, parse_number
from motoremi.data.rows import Band, Rows, reflection_warnings, refuse_between_ports, used_rows
from motoremi.data.sweep import check_order, checked_frequency
from motoremi.data.text import clean_text
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

_UNITS = {"HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "GHZ": 1e9}
_PARAMETERS = {"S", "Y", "Z", "G", "H"}
_FORMATS = {"RI", "MA", "DB"}
_PLAIN = re.compile(r"not[ -]normali[sz]ed|un-?normali[sz]ed|\bin ohms?\b|\[ohms?\]|\(ohms?\)|Ω", re.IGNORECASE)
_NORMALISED = re.compile(r"normali[sz]ed", re.IGNORECASE)
# Capacitances that tell normalised data from ohms, in farad, of the winding (inductive at the low end) and of the insulation (capacitive
# there). With normalised data assumed, less than the first is impossible for a motor and more than the second is likely; between them the
# file has to state it.
_WINDING_F = (4e-12, 8e-12)
_INSULATION_F = (60e-12, 200e-12)
Scale = Literal["normalised", "ohm"]
# Connection of the motor between two ports: in series between them, or across the line from one to the other.
Fixture = Literal["series-through", "shunt-through"]
FIXTURES: tuple[Fixture, ...] = get_args(Fixture)
_HOW = "--fixture series-through (motor from port to port) or --fixture shunt-through (motor across the line)"
# Numbers in a row of a file of one port and of two, the frequency among them.
_PORTS = {3: 1, 9: 2}
_TWO_PORTS = 9
# Numbers in a row of noise parameters, which may follow those of two ports at frequencies that begin anew.
_NOISE = 5
# A comment that names a transmission as the content of the file: `Params: S21`, `S12`, `Freq ReS21 ImS21`.
_TRANSMISSION = re.compile(r"(?:[^:=]{1,40}[:=]\s*|freq.{0,20}?[\s,;]+)?(?:re|im|mag|ang|db)?[ (|]*S(?:21|12)(?![0-9])", re.IGNORECASE)
_NOT_THAT = re.compile(r"S(?:11|22)(?![0-9])|\b(?:not|no|without|unused)\b", re.IGNORECASE)


def is_touchstone(text: str) -> bool:
    """Whether the first line that is no comment is Touchstone's option line or version."""
    first = next((line.strip() for line in split_lines(text[:50_000]) if line.strip() and not line.strip().startswith("!")), "")
    if first.lower().startswith("[version]"):
        return True
    return _options(first) is not None


@dataclass(frozen=True)
class _Options:
    unit: str
    parameter: str
    style: str
    reference: float

    def line(self) -> str:
        """The option line in the order that every program takes."""
        return f"# {self.unit} {self.parameter} {self.style} R {self.reference!r}"


def _options(line: str) -> _Options | None:
    """The entries of an option line, in any order; None for another line."""
    if not line.startswith("#"):
        return None
    words = line[1:].upper().split()
    unit, parameter, style, reference = "GHZ", "S", "MA", 50.0
    known = 0
    position = 0
    while position < len(words):
        word = words[position]
        if word in _PARAMETERS:
            parameter = word
        elif word in _FORMATS:
            style = word
        elif word == "R" and position + 1 < len(words):
            position += 1
            try:
                reference = parse_number(words[position], "")
            except BadInput:
                return None
        elif word in _UNITS:
            unit = word
        else:
            return None
        known += 1
        position += 1
    return _Options(unit, parameter, style, reference) if known >= 2 else None


def parse_touchstone(text: str, name: str, fixture: str | None = None, band: Band | None = None) -> tuple[Rows, JsonDict]:
    """The rows and the header of a file with one port, or with two ports and the motor between them.

    In version 1 the standard normalises Z and Y data to the reference resistance, but some programs write ohms. A comment in the file
    decides; without one, the data are taken as normalised if that gives a possible motor.

    Parameters
    ----------
    text, name : str
    fixture : {"series-through", "shunt-through"}, optional
        Connection of the motor between two ports; a comment line `! fixture: series-through` states it as well. Not used for one port.
    band : (float, float), optional
        Both ends in hertz; rows outside are not used.

    Raises
    ------
    BadInput
        If a row has the wrong length, the rows are not sorted, the file is cut off, a file of one port holds a transmission, or it is not
        stated whether its data are normalised or how the motor was connected between two ports.
    """
    file = _checked(text, name)
    options = file.options
    if options.parameter not in ("S", "Y", "Z"):
        raise BadInput(f"{name}: holds {options.parameter} parameters; save S, Z or Y")
    if not (options.reference > 0 and math.isfinite(options.reference)):
        raise BadInput(f"{name}: the reference resistance must be above 0 Ohm")
    header: JsonDict = {key: value for comment in file.comments for key, value in [_key_value(comment)] if key}
    fixture = _fixture_of(file, header, fixture, name)
    every_hz, every_s, every_z0 = _by_library(file, name)
    used, changes = used_rows(every_hz, band, name)
    frequency, s, z0 = every_hz[used], every_s[used], every_z0[used]
    warnings: tuple[str, ...] = ()
    if fixture is not None:
        impedance, read_as = _between_ports(frequency, s, z0, fixture, name)
        header["fixture"] = fixture
    else:
        impedance, read_as = _of_one_port(file, frequency, s, z0, name)
        warnings = reflection_warnings(s[:, 0, 0]) if options.parameter == "S" else ()
    rows = Rows(frequency, impedance, None, lambda row: f"{name}, line {file.lines[used[row]]}", changes, warnings)
    return rows, {**header, "read_as": read_as}


def _of_one_port(file: _File, frequency: FloatArray, s: ComplexArray, z0: ComplexArray, name: str) -> tuple[ComplexArray, str]:
    """Impedance in ohm, and how it was found."""
    parameter, reference = file.options.parameter, file.options.reference
    if parameter == "S":
        _refuse_transmission(file.comments, name)
    with np.errstate(all="ignore"):
        impedance: ComplexArray = z0[:, 0] * (1 + s[:, 0, 0]) / (1 - s[:, 0, 0])
    if parameter == "S" or file.version >= 2 or reference == 1:
        return impedance, f"{parameter} parameters in {reference:g} Ohm"
    scale, why = _scale(file.comments, frequency, impedance, reference, name)
    if scale == "ohm":
        impedance = impedance / reference
    scaling = "not normalised" if scale == "ohm" else f"normalised to {reference:g} Ohm"
    return impedance, f"{parameter} parameters, {scaling} ({why})"


def _refuse_transmission(comments: list[str], name: str) -> None:
    """Raise `BadInput` if a comment of a file of one port names S21 or S12 as its content."""
    for comment in comments:
        if _TRANSMISSION.match(comment) and not _NOT_THAT.search(comment):
            raise BadInput(
                f"{name}: its comment {clean_text(comment, 60)!r} names a transmission, but a file of one port is read as the reflection S11; "
                "save S11, or both ports (.s2p) with the motor between them (if it is S11, correct the comment)"
            )


@dataclass(frozen=True)
class _File:
    options: _Options
    version: float
    ports: int
    comments: list[str]
    body: list[str]
    lines: list[int]  # number of the line of each row


def _checked(text: str, name: str) -> _File:
    """Options, version, ports, comments and the lines without comments, after every number is checked.

    The library accepts `1_000`, `nan` and short rows, takes a row of two ports whose frequency is lower than that of the row before it for the
    begin of noise parameters, requires the options in one order, and searches comments for settings of other programs.
    """
    options: _Options | None = None
    version, comments, body = 1.0, [], []
    frequencies: int | None = None
    rows: list[list[str]] = []
    numbers: list[int] = []
    lines = split_lines(text)
    for number, raw in enumerate(lines, start=1):
        line, mark, comment = raw.strip().partition("!")
        if mark:
            comments.append(clean_text(comment.strip(), 200))
        line = line.strip()
        where = f"{name}, line {number}"
        if not line:
            continue
        if line.startswith("#"):
            # According to the standard only the first option line counts.
            if options is None:
                options = _options(line)
                body += [options.line()] if options else []
            continue
        body.append(line)
        if line.startswith("["):
            key, _, value = line.lower().partition("]")
            if key == "[version":
                version = parse_number(value, where)
            elif key == "[number of ports" and value.strip() not in ("1", "2"):
                raise BadInput(
                    f"{where}: has {clean_text(value.strip(), 20)} ports; save one port (.s1p), or two with the motor between them (.s2p)"
                )
            elif key == "[number of frequencies":
                frequencies = int(parse_number(value, where))
        elif options is None:
            raise BadInput(f"{where}: data before the option line '# HZ S RI R 50'")
        else:
            rows.append(_checked_row(line.split(), rows, _UNITS[options.unit], where))
            numbers.append(number)
    if options is None or not rows:
        raise BadInput(f"{name}: a Touchstone file without {'option line' if options is None else 'data'}")
    if frequencies is not None and frequencies != len(rows):
        raise BadInput(f"{name}: announces {frequencies} frequencies but has {len(rows)}; the file is cut off")
    last_column = [cells[-1] for cells in rows]
    if lines[-1].strip() and looks_cut(last_column[-1], last_column[:-1]):
        raise BadInput(f"{name}: the last number {last_column[-1]!r} is shorter than all others and no line end follows; the file is cut off")
    return _File(options, version, _PORTS[len(rows[0])], comments, body, numbers)


def _checked_row(cells: list[str], before: list[list[str]], unit_hz: float, where: str) -> list[str]:
    """The cells of a row, as many as those of the rows before it, numbers all, and at no lower frequency."""
    length = len(before[0]) if before else len(cells)
    if length not in _PORTS:
        raise BadInput(f"{where}: {length} values where a frequency and two numbers (one port) or eight (two ports) are needed")
    numbers = [parse_number(cell, where) for cell in cells]
    frequency = numbers[0] * unit_hz
    last = float(before[-1][0]) * unit_hz if before else frequency
    if length == _TWO_PORTS and len(cells) == _NOISE and frequency <= last:
        raise BadInput(f"{where}: noise parameters follow the S parameters; remove them")
    if len(cells) != length:
        raise BadInput(f"{where}: {len(cells)} values where {length} are needed; the row or the file is cut off")
    check_order(frequency, last, where)
    return cells


def _fixture_of(file: _File, header: JsonDict, given: str | None, name: str) -> str | None:
    """The fixture of a file of two ports; None for one port."""
    if file.ports == 1:
        refuse_between_ports(header, name)
        return None
    if file.options.parameter != "S":
        raise BadInput(f"{name}: holds {file.options.parameter} parameters of two ports; save S parameters")
    return _fixture(header, given, name)


def _between_ports(frequency: FloatArray, s: ComplexArray, z0: ComplexArray, fixture: str, name: str) -> tuple[ComplexArray, str]:
    """Impedance of the motor between two ports, from the transmission S21, and how it was found."""
    if np.any(z0 != z0[:1, :1]):
        raise BadInput(f"{name}: the ports have different reference impedances; save them with one")
    through, reference = s[:, 1, 0], z0[:, 0]
    with np.errstate(all="ignore"):
        if fixture == "series-through":
            formula, impedance = "Z = 2 Z0 (1 - S21)/S21", 2 * reference * (1 - through) / through
        else:
            formula, impedance = "Z = Z0/2 S21/(1 - S21)", reference / 2 * through / (1 - through)
    for point in np.flatnonzero(~np.isfinite(impedance))[:1]:
        raise BadInput(f"{name}: S21 at {frequency[point]:g} Hz gives no finite impedance of a {fixture} fixture; was it measured?")
    at = f", Z0 = {reference[0].real:g} Ohm" if reference.size else ""
    return impedance, f"S21 of a {fixture} fixture, {formula}{at}"


def parse_two_port(text: str, name: str) -> tuple[FloatArray, ComplexArray]:
    """Frequencies in hertz and the S parameters, shape (n, 2, 2), of a two-port, renormalised to 50 Ohm.

    Raises
    ------
    BadInput
        If the file does not have two ports, holds other parameters, or its frequencies do not increase.
    """
    from skrf.network import renormalize_s

    file = _checked(text, name)
    if file.ports != 2 or file.options.parameter != "S":
        raise BadInput(f"{name}: a correction needs the S parameters of two ports (.s2p)")
    frequency, s, z0 = _by_library(file, name)
    if not np.all(np.isfinite(s)) or np.any(s[:, 1, 0] == 0):
        raise BadInput(f"{name}: S21 is zero or not a number at some frequency; was it measured?")
    return checked_frequency(frequency, name, 2), np.asarray(renormalize_s(s, z0, np.full(z0.shape, 50.0)), dtype=np.complex128)


def _fixture(header: JsonDict, given: str | None, name: str) -> str:
    """The fixture that the user states or a comment of the file names."""
    written = next((str(value).lower() for key, value in header.items() if key.lower() == "fixture"), None)
    if given is not None and written in FIXTURES and written != given:
        raise BadInput(f"{name}: its comment says {written}, but it was given as {given}; correct one of them")
    fixture = given if given is not None else written
    if fixture is None:
        raise BadInput(f"{name}: holds two ports; state how the motor was connected between them: {_HOW}")
    if fixture not in FIXTURES:
        raise BadInput(f"{name}: unknown fixture {clean_text(fixture, 40)!r}; use {_HOW}")
    return fixture


def _by_library(file: _File, name: str) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Frequencies, S parameters of shape (n, ports, ports), and reference impedances of shape (n, ports)."""
    from skrf.network import Network

    text = io.StringIO("\n".join(file.body) + "\n")
    text.name = f"data.s{file.ports}p"
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            network = Network(cast(str, text))  # takes open files too, though its type does not say so
            s, z0 = np.asarray(network.s, dtype=np.complex128), np.asarray(network.z0, dtype=np.complex128)
    except Exception as error:  # the library's parser raises exceptions of many kinds
        raise BadInput(f"{name}: a Touchstone file that cannot be read: {clean_text(str(error), 120)}") from error
    if network.f.size != len(file.lines):
        raise BadInput(f"{name}: {network.f.size} of its {len(file.lines)} rows could be read; save it again")
    return np.asarray(network.f, dtype=np.float64), s, z0


def _scale(comments: list[str], frequency: FloatArray, standard: ComplexArray, reference: float, name: str) -> tuple[Scale, str]:
    for comment in comments:
        if _PLAIN.search(comment):
            return "ohm", "as its comment says"
        if _NORMALISED.search(comment):
            return "normalised", "as its comment says"
    capacitive = standard.imag < 0
    if not capacitive.any():
        return "normalised", "as the standard says; check the magnitude"
    capacitance = float(np.median(-1 / (2 * np.pi * frequency[capacitive] * standard.imag[capacitive])))
    impossible, likely = _INSULATION_F if capacitive[0] else _WINDING_F
    if capacitance >= likely:
        return "normalised", "as the standard says"
    if capacitance < impossible:
        return "ohm", f"if they were normalised, the motor would have {1e12 * capacitance:.2g} pF"
    raise BadInput(
        f"{name}: its values could be normalised to {reference:g} Ohm, as the standard says, or in ohm; "
        "add a comment line '! normalised' or '! in ohm'"
    )


def _key_value(comment: str) -> tuple[str, str]:
    key, colon, value = comment.partition(":")
    return (key.strip(), value.strip()) if colon and key.strip() and len(key) < 40 else ("", "")
