"""Lists the VISA resources, asks each for its identity, and finds the drivers that fit."""

from __future__ import annotations

import inspect
import re
import warnings
from collections.abc import Iterable
from dataclasses import asdict, dataclass

import pyvisa
from serial.tools import list_ports

from motoremi.arrays import JsonDict
from motoremi.bench.connect import driver_class, driver_names, open_transport
from motoremi.bench.driver import Driver
from motoremi.bench.registers import RegisterDriver
from motoremi.bench.shell import ShellDriver
from motoremi.errors import BadInput, InstrumentError

# An idle instrument answers at once; a busy one can be asked again later.
ANSWER_S = 1.0
# USB vendor and product of NanoVNA and tinySA, and of NanoVNA V2 and LiteVNA. Other serial ports are not asked: another device may take any
# text for a command.
KNOWN_USB_IDS = ((0x0483, 0x5740), (0x04B4, 0x0008))


@dataclass(frozen=True)
class Answer:
    """The answer of one resource.

    Parameters
    ----------
    resource : str
        VISA name.
    identity : str
        Its identity; empty if it did not answer.
    drivers : tuple of str
        Drivers that fit.
    trouble : str
        Why it did not answer.
    """

    resource: str
    identity: str = ""
    drivers: tuple[str, ...] = ()
    trouble: str = ""

    def to_dict(self) -> JsonDict:
        """Plain data."""
        return {**asdict(self), "drivers": list(self.drivers)}


def survey(manager: pyvisa.ResourceManager, named: Iterable[str] = ()) -> list[Answer]:
    """Ask every resource that VISA lists, and those that are named, for its identity.

    Parameters
    ----------
    manager : pyvisa.ResourceManager
    named : iterable of str
        Resources that VISA does not list, such as sockets; asked even if they are serial ports.
    """
    named = list(named)
    with warnings.catch_warnings():
        # PyVISA-py warns if psutil or zeroconf is missing; `motoremi doctor` reports that.
        warnings.simplefilter("ignore")
        instruments = sorted(manager.list_resources("?*::INSTR"))
    # PRLGX resources are Prologix adapters, not instruments.
    listed = [name for name in instruments if name not in named and not name.startswith("PRLGX")]
    return [_ask(manager, name) for name in named] + [
        _ask(manager, name) if _may_be_asked(name) else Answer(name, trouble="not asked: a serial port of no known instrument") for name in listed
    ]


def load_trouble() -> dict[str, str]:
    """Drivers that are installed but cannot be loaded, and why."""
    trouble = {}
    for name in driver_names():
        try:
            driver_class(name)
        except BadInput as error:
            trouble[name] = str(error)
    return trouble


def title(name: str) -> str:
    """One line on a driver: the first line of its module's docstring, or of its class's where a module has several drivers."""
    driver = driver_class(name)
    alone = sum(path.partition(":")[0] == driver.__module__ for path in driver_names().values()) == 1
    text = (alone and inspect.getdoc(inspect.getmodule(driver))) or inspect.getdoc(driver) or name
    return text.splitlines()[0]


def _may_be_asked(resource: str) -> bool:
    if not resource.upper().startswith("ASRL"):
        return True
    port = resource[4:].partition("::")[0]
    return any(entry.device == port and (entry.vid, entry.pid) in KNOWN_USB_IDS for entry in list_ports.comports())


def _ask(manager: pyvisa.ResourceManager, resource: str) -> Answer:
    trouble = ""
    # An instrument without SCPI may have a shell or registers, but only on a serial line or socket.
    for ask in (_ask_scpi, _ask_shell, _ask_registers):
        try:
            return ask(manager, resource)
        except InstrumentError as error:
            trouble = trouble or str(error)
    return Answer(resource, trouble=trouble)


def _ask_scpi(manager: pyvisa.ResourceManager, resource: str) -> Answer:
    link = open_transport(manager, resource, ANSWER_S)
    try:
        if resource.upper().startswith("ASRL"):
            raise InstrumentError(f"{resource}: gave no answer")
        identity = link.query("*IDN?")
    finally:
        link.close()
    fields = [field.strip() for field in identity.split(",")]
    if len(fields) < 4:
        raise InstrumentError(f"{resource}: answered {identity!r} to '*IDN?'")
    return Answer(resource, identity, _fitting(fields[1], Driver))


def _ask_shell(manager: pyvisa.ResourceManager, resource: str) -> Answer:
    link = open_transport(manager, resource, ANSWER_S)
    try:
        if not link.stream:
            raise InstrumentError(f"{resource}: has no shell")
        shell = _AnyShell(link)
        identity = shell.identify()
    finally:
        link.close()
    return Answer(resource, f"{identity.model},{identity.firmware}", _fitting(identity.model, ShellDriver))


def _ask_registers(manager: pyvisa.ResourceManager, resource: str) -> Answer:
    link = open_transport(manager, resource, ANSWER_S)
    try:
        if not link.stream:
            raise InstrumentError(f"{resource}: has no registers")
        identity = _AnyRegisters(link).identify()
    finally:
        link.close()
    return Answer(resource, f"{identity.model},{identity.serial},{identity.firmware}", _fitting(identity.model, RegisterDriver))


class _AnyShell(ShellDriver):
    """A shell of any model."""

    vendor = ""
    model = r"\S.*"
    safe_commands = ()


class _AnyRegisters(RegisterDriver):
    """Registers of any model."""

    model = r".*"
    safe_commands = ()


def _fitting(model: str, language: type[Driver]) -> tuple[str, ...]:
    names = [name for name in driver_names() if name not in load_trouble()]
    return tuple(sorted(name for name in names if _fits(driver_class(name), model, language)))


def _fits(driver: type[Driver], model: str, language: type[Driver]) -> bool:
    spoken = next((base for base in (ShellDriver, RegisterDriver) if issubclass(driver, base)), Driver)
    return spoken is language and re.fullmatch(driver.model, model) is not None
