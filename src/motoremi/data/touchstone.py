"""Touchstone files: .s1p as network analysers and NanoVNA programs save, .z1p, .y1p, and .s2p of a fixture between two ports; version 1 and 2."""

from __future__ import annotations

import io
import math
import re
import warnings
from dataclasses import dataclass
from itertools import islice
from typing import Literal, cast, get_args

import numpy as np

from motoremi.arrays import ComplexArray, FloatArray, JsonDict
from motoremi.data.numbers import looks_cut, looks_numeric, parse_number
from motoremi.data.rounding import rounding_of_complex
from motoremi.data.rows import Band, Rows, reflection_warnings, refuse_between_ports, used_rows
from motoremi.data.sweep import check_order, checked_frequency
from motoremi.data.text import clean_text
from motoremi.data.text_file import split_lines
from motoremi.errors import BadInput

_UNITS = {"HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "GHZ": 1e9}
# How the names of Touchstone files end.
_ENDING = re.compile(r"\.[sygzh][0-9]p$", re.IGNORECASE)
_REFERENCE = re.compile(r"R[0-9.]+")
_PARAMETERS = {"S", "Y", "Z", "G", "H"}
_FORMATS = {"RI", "MA", "DB"}
# Largest angle of S11 of a motor whose angles are in radians: from near pi, at the low end of the band or where it resonates, to pi as rounded.
_NEAR_PI, _PI_ROUNDED = 2.5, 3.1417
_PLAIN = re.compile(r"not[ -]normali[sz]ed|un-?normali[sz]ed|\bin (?:ohms?|siemens)\b|\[ohms?\]|\(ohms?\)|Ω", re.IGNORECASE)
_NORMALISED = re.compile(r"normali[sz]ed", re.IGNORECASE)
# Capacitances that tell normalised data from ohms, in farad, of the winding (inductive at the low end) and of the insulation (capacitive
# there). With normalised data assumed, less than the first is impossible for a motor and more than the second is likely; between them the
# file has to state it.
_WINDING_F = (4e-12, 8e-12)
_INSULATION_F = (60e-12, 200e-12)
# What impedances and admittances are in, if they are not normalised.
_PLAIN_UNIT = {"Z": "ohm", "Y": "siemens"}
# Connection of the motor to two ports: in series between them, across the line from one to the other, or at port 1 alone.
Fixture = Literal["series-through", "shunt-through", "reflection"]
FIXTURES: tuple[Fixture, ...] = get_args(Fixture)
_BETWEEN_PORTS = FIXTURES[:2]
_HOW = (
    "--fixture series-through (motor from port to port) or --fixture shunt-through (motor across the line); "
    "--fixture reflection reads S11 (motor at port 1 alone)"
)
# A fixture that is stated is refused if S11 fits another one so many times better.
_FAR_BETTER = 4
# Between two ports no motor transmits less at all frequencies: in series it would have more than 5 kOhm, across the line less than half an ohm.
_LEAKAGE = 0.02
# Least difference of S11 to that of a motor between two ports, relative to 1 - S21, which says that it was not there.
_UNLIKE = 0.3
# Numbers in a row of a file of one port and of two, the frequency among them, and of two of which one off-diagonal element is left out.
_PORTS = {3: 1, 9: 2}
_TWO_PORTS, _TRIANGLE = 9, 7
# Column of the first number of S21 in a row of two ports: version 1 has it before S12, version 2 either way.
_S21_FIRST, _S12_FIRST = 3, 5
# Numbers in a row of noise parameters, which may follow those of two ports at frequencies that begin anew.
_NOISE = 5
# A comment that names a transmission as the content of the file: `Params: S21`, `S12`, `Freq ReS21 ImS21`.
_TRANSMISSION = re.compile(r"(?:[^:=]{1,40}[:=]\s*|freq.{0,20}?[\s,;]+)?(?:re|im|mag|ang|db)?[ (|]*S(?:21|12)(?![0-9])", re.IGNORECASE)
_NOT_THAT = re.compile(r"S(?:11|22)(?![0-9])|\b(?:not|no|without|unused)\b", re.IGNORECASE)


def is_touchstone(text: str) -> bool:
    """Whether the first line that is no comment is Touchstone's option line or version.

    An option line of less than two entries may be the comment of another table: it counts above a row of one port or of two.
    """
    first, second = _first_lines(text)
    if first.lower().startswith("[version]"):
        return True
    options = _options(first)
    if options is None:
        return False
    cells = second.split()
    return options.stated >= 2 or (len(cells) in _PORTS and all(map(looks_numeric, cells)))


def option_trouble(text: str, name: str) -> str:
    """Why a file that is named as Touchstone, and holds rows as such files do, is none; empty for any other file."""
    first, second = _first_lines(text)
    row = second if first.startswith("#") else first
    cells = row.split()
    if not _ENDING.search(name) or len(cells) not in _PORTS or not all(map(looks_numeric, cells)):
        return ""
    if first.startswith("#"):
        return f"its option line {clean_text(first, 60)!r} cannot be read: write for example '# HZ S RI R 50'"
    return "the option line is missing: put it above the numbers, for example '# HZ S RI R 50' (or MA, DB; with the unit of the frequencies)"


def _first_lines(text: str) -> tuple[str, str]:
    """The first two lines that are more than a comment; empty where there are fewer."""
    lines = (line.partition("!")[0].strip() for line in split_lines(text[:50_000]))
    first, second, *_ = *islice(filter(None, lines), 2), "", ""
    return first, second


@dataclass(frozen=True)
class _Options:
    unit: str
    parameter: str
    style: str
    reference: float
    stated: int  # number of entries in the file; the others are the defaults of the standard

    def line(self) -> str:
        """The option line for the library, in the order that it takes: numbers of whatever parameter are left as they are, like S."""
        return f"# {self.unit} S {self.style} R {self.reference!r}"


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
        if _REFERENCE.fullmatch(word):
            # Written as one word, `R50`.
            words[position : position + 1] = ["R", word[1:]]
            continue
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
    return _Options(unit, parameter, style, reference, known)


def parse_touchstone(text: str, name: str, fixture: str | None = None, band: Band | None = None) -> tuple[Rows, JsonDict]:
    """The rows and the header of a file with one port, or with two ports and the motor between them.

    In version 1 the standard normalises Z and Y data to the reference resistance, but some programs write ohms. A comment in the file
    decides; without one, the data are taken as normalised if that gives a possible motor.

    Parameters
    ----------
    text, name : str
    fixture : {"series-through", "shunt-through", "reflection"}, optional
        Connection of the motor to two ports, the last at port 1 alone; a comment line `! fixture: series-through` states it as well. Not used
        for one port.
    band : (float, float), optional
        Both ends in hertz; rows outside are not used.

    Raises
    ------
    BadInput
        If a row has the wrong length, the rows are not sorted, the file is cut off, a file of one port holds a transmission, or it is not
        stated whether its data are normalised or how the motor was connected between two ports, or S11 contradicts what is stated.
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
        _refuse_other_fixture(s, fixture, name)
    through = fixture in _BETWEEN_PORTS
    values = s[:, 1, 0] if through else s[:, 0, 0]
    if fixture in _BETWEEN_PORTS:
        impedance, read_as = _between_ports(frequency, s, z0, fixture, name)
        header["fixture"] = fixture
    else:
        impedance, read_as = _of_one_port(file, frequency, s, z0, name)
        if options.parameter == "S":
            warnings = reflection_warnings(values)
            if options.style != "RI":
                warnings += _maybe_radians(values)
    first = file.transmission if through else 1
    written = [[file.rows[row][column] for row in used] for column in (first, first + 1)]
    slope = _relative_slope(values, "through" if through else options.parameter)
    rounding = rounding_of_complex(options.style, values, written[0], written[1], slope) if len(used) else None
    if options.stated < 2:
        read_as += f", with the defaults of the standard: {options.unit} {options.parameter} {options.style}"
    rows = Rows(frequency, impedance, None, lambda row: f"{name}, line {file.lines[used[row]]}", changes, warnings, rounding)
    return rows, {**header, "read_as": read_as}


def _maybe_radians(s11: ComplexArray) -> tuple[str, ...]:
    """A sentence if all angles, read in degrees, lie within pi and come near it, as those of a motor do in radians."""
    farthest = float(np.max(np.abs(np.angle(s11, deg=True)), initial=0.0))
    if not _NEAR_PI <= farthest <= _PI_ROUNDED:
        return ()
    large = f"the angles of S11 lie within ±{farthest:.3g}, which makes |Z| large at all frequencies"
    return (f"{large}: are they in radians? A Touchstone file has degrees",)


def _relative_slope(values: ComplexArray, kind: str) -> FloatArray:
    """Relative change of Z for a change of a reflection (`S`), an impedance (`Z`), an admittance (`Y`) or a transmission (`through`) by 1."""
    with np.errstate(all="ignore"):
        if kind == "S":
            return 2 / np.abs(1 - values**2)
        # Z is in proportion to (1 - S21)/S21 of a part in series, and to S21/(1 - S21) of one across the line.
        return 1 / np.abs(values * (1 - values)) if kind == "through" else 1 / np.abs(values)


def _of_one_port(file: _File, frequency: FloatArray, s: ComplexArray, z0: ComplexArray, name: str) -> tuple[ComplexArray, str]:
    """Impedance in ohm, and how it was found."""
    parameter, reference, values = file.options.parameter, file.options.reference, s[:, 0, 0]
    with np.errstate(all="ignore"):
        if parameter == "S":
            _refuse_transmission(file.comments, name)
            what = "S parameters" if file.ports == 1 else "S11 of two ports"
            return z0[:, 0] * (1 + values) / (1 - values), f"{what} in {z0[0, 0].real if len(z0) else reference:g} Ohm"
        plain: ComplexArray = values if parameter == "Z" else 1 / values
    if file.version >= 2 or reference == 1:
        return plain, f"{parameter} parameters in {_PLAIN_UNIT[parameter]}"
    # z = Z / R and y = Y R.
    scale, why = _scale(file, frequency, plain * reference, name)
    if scale == "plain":
        return plain, f"{parameter} parameters, not normalised ({why})"
    return plain * reference, f"{parameter} parameters, normalised to {reference:g} Ohm ({why})"


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
    rows: list[list[str]]
    lines: list[int]  # number of the line of each row
    transmission: int  # column of the first number of S21 in the rows of two ports


def _checked(text: str, name: str) -> _File:
    """Options, version, ports, comments and the lines without comments, after every number is checked.

    Information and noise parameters of version 2 are passed over, and a matrix of which a triangle is saved is completed. The library accepts
    `1_000`, `nan` and short rows, takes a row of two ports whose frequency is lower than that of the row before it for the
    begin of noise parameters, requires the options in one order, and searches comments for settings of other programs.
    """
    options: _Options | None = None
    version, comments, body = 1.0, [], []
    frequencies: int | None = None
    # Whether rows of version 2 have begun, information or noise parameters are passed over, and only a triangle of the matrix is saved.
    network = passed = triangle = False
    transmission = _S21_FIRST
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
        if passed:
            passed = not line.lower().startswith("[end")
            continue
        if line.startswith("#"):
            # According to the standard only the first option line counts.
            if options is None:
                options = _options(line)
                body += [options.line()] if options else []
            continue
        if line.startswith("["):
            key, _, value = line.lower().partition("]")
            if key in ("[begin information", "[noise data"):
                passed = True
                continue
            if key == "[matrix format":
                # Rows of a triangle are completed below, because the library leaves gaps in those of two ports.
                triangle = value.strip() in ("lower", "upper")
                continue
            if key == "[two-port data order" and value.strip() == "12_21":
                transmission = _S12_FIRST
            body.append(line)
            network = network or key == "[network data"
            if key == "[version":
                version = parse_number(value, where)
            elif key == "[number of ports" and value.strip() not in ("1", "2"):
                raise BadInput(
                    f"{where}: has {clean_text(value.strip(), 20)} ports; save one port (.s1p), or two with the motor between them (.s2p)"
                )
            elif key == "[number of frequencies":
                frequencies = int(parse_number(value, where))
        elif version >= 2 and not network:
            body.append(line)  # the reference impedances may stand below their keyword
        elif options is None:
            raise BadInput(f"{where}: data before the option line '# HZ S RI R 50'")
        else:
            cells = line.split()
            if triangle and len(cells) == _TRIANGLE:
                cells = [*cells[:5], *cells[3:]]
            rows.append(_checked_row(cells, rows, options, where))
            numbers.append(number)
            body.append(" ".join(cells))
    if options is None or not rows:
        raise BadInput(f"{name}: a Touchstone file without {'option line' if options is None else 'data'}")
    if frequencies is not None and frequencies != len(rows):
        raise BadInput(f"{name}: announces {frequencies} frequencies but has {len(rows)}; the file is cut off")
    last_column = [cells[-1] for cells in rows]
    if lines[-1].strip() and looks_cut(last_column[-1], last_column[:-1]):
        raise BadInput(f"{name}: the last number {last_column[-1]!r} is shorter than all others and no line end follows; the file is cut off")
    return _File(options, version, _PORTS[len(rows[0])], comments, body, rows, numbers, transmission)


def _checked_row(cells: list[str], before: list[list[str]], options: _Options, where: str) -> list[str]:
    """The cells of a row, as many as those of the rows before it, numbers all, magnitudes not below 0, and at no lower frequency."""
    unit_hz = _UNITS[options.unit]
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
    for magnitude in numbers[1::2] if options.style == "MA" else ():
        if magnitude < 0:
            raise BadInput(f"{where}: the magnitude {magnitude:g} is below 0; write DB in the option line, in place of MA, if it is in decibels")
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


def _refuse_other_fixture(s: ComplexArray, fixture: str, name: str) -> None:
    """Raise `BadInput` if S11 says that the motor was connected otherwise than stated; zeros are not measured and say nothing.

    In series between two ports S11 = 1 - S21, across the line S11 = S21 - 1.
    """
    reflected, lost = s[:, 0, 0], 1 - s[:, 1, 0]
    if not reflected.any() or not s[:, 1, 0].any():
        return
    size, *misfits = (float(np.sqrt(np.mean(np.abs(one) ** 2))) for one in (lost, reflected - lost, reflected + lost))
    fits = dict(zip(_BETWEEN_PORTS, misfits, strict=True))
    best = min(fits, key=lambda one: fits[one])
    leaks_only = bool(np.abs(s[:, 1, 0]).max() < _LEAKAGE)
    if leaks_only and fixture in fits and fits[best] > _UNLIKE * size:
        raise BadInput(
            f"{name}: S21 is below {_LEAKAGE:g} everywhere, and S11 is not that of a motor between two ports: use --fixture reflection if the "
            "motor was at port 1 alone (if S11 was not calibrated, write zeros for it)"
        )
    decided = _FAR_BETTER * fits[best] < max(fits.values())
    if decided and best != fixture and (fixture in fits or not leaks_only):
        formula = "1 - S21" if best == "series-through" else "S21 - 1"
        raise BadInput(f"{name}: S11 is {formula}, as of a {best} fixture, but it was given as {fixture}: use --fixture {best}")


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


def _scale(file: _File, frequency: FloatArray, standard: ComplexArray, name: str) -> tuple[Literal["normalised", "plain"], str]:
    """Whether Z or Y data are normalised, and why; `standard` is the impedance in ohm if they are."""
    for comment in file.comments:
        if _PLAIN.search(comment):
            return "plain", "as its comment says"
        if _NORMALISED.search(comment):
            return "normalised", "as its comment says"
    options = file.options
    plain = f"'! in {_PLAIN_UNIT[options.parameter]}'"
    capacitive = standard.imag < 0
    if not capacitive.any():
        return (
            "normalised",
            f"as the standard says; check the magnitude, and add a comment line {plain} if it is {options.reference:g} times too high",
        )
    capacitance = float(np.median(-1 / (2 * np.pi * frequency[capacitive] * standard.imag[capacitive])))
    impossible, likely = _INSULATION_F if capacitive[0] else _WINDING_F
    if capacitance >= likely:
        return "normalised", "as the standard says"
    if capacitance < impossible:
        return "plain", f"if they were normalised, the motor would have {1e12 * capacitance:.2g} pF"
    raise BadInput(
        f"{name}: its values could be normalised to {options.reference:g} Ohm, as the standard says, or in {_PLAIN_UNIT[options.parameter]}; "
        f"add a comment line '! normalised' or {plain}"
    )


def _key_value(comment: str) -> tuple[str, str]:
    key, colon, value = comment.partition(":")
    return (key.strip(), value.strip()) if colon and key.strip() and len(key) < 40 else ("", "")
