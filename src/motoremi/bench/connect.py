"""Connects the instrument of a role: finds the driver by its name, checks the resource against the allow-list, opens it with VISA."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, Protocol

import pyvisa
from pyvisa.resources import MessageBasedResource

from motoremi.bench.clock import Clock, WallClock
from motoremi.bench.driver import Driver
from motoremi.bench.motor_connections import ConnectionName
from motoremi.bench.traffic import RecordingTransport, TrafficSink
from motoremi.bench.transport import Transport, VisaTransport
from motoremi.errors import BadInput, InstrumentError

DRIVER_GROUP = "motoremi.instruments"
# Used where motoremi is not installed, since a source tree has no entry points.
BUILT_IN = {
    "4294a": "motoremi.instruments.agilent_4294a:Agilent4294A",
    "e4990a": "motoremi.instruments.keysight_e4990a:KeysightE4990A",
    "nanovna": "motoremi.instruments.nanovna:NanoVna",
    "nanovna-v2": "motoremi.instruments.nanovna_v2:NanoVnaV2",
    "librevna": "motoremi.instruments.librevna:LibreVna",
    "esr": "motoremi.instruments.rohde_schwarz_esr:RohdeSchwarzESR",
    "esrp": "motoremi.instruments.rohde_schwarz_receivers:RohdeSchwarzESRP",
    "esw": "motoremi.instruments.rohde_schwarz_receivers:RohdeSchwarzESW",
    "esci": "motoremi.instruments.rohde_schwarz_receivers:RohdeSchwarzESCI",
    "esu": "motoremi.instruments.rohde_schwarz_receivers:RohdeSchwarzESU",
    "mxe": "motoremi.instruments.keysight_mxe:KeysightMXE",
    "n6141": "motoremi.instruments.keysight_mxe:KeysightN6141",
    "xseries": "motoremi.instruments.keysight_xseries:KeysightXSeries",
    "dsa800": "motoremi.instruments.rigol_sa:RigolDSA800",
    "rsa": "motoremi.instruments.rigol_sa:RigolRSA",
    "ssa3000x": "motoremi.instruments.siglent_ssa3000x:SiglentSSA3000X",
    "tinysa": "motoremi.instruments.tinysa:TinySa",
    "34461a": "motoremi.instruments.keysight_34461a:Keysight34461A",
    "e36300": "motoremi.instruments.keysight_e36300:KeysightE36300",
    "hmp4000": "motoremi.instruments.rohde_schwarz_hmp4000:RohdeSchwarzHmp4000",
    "line-reader": "motoremi.instruments.line_reader:LineReader",
}
# Options of an instrument in a procedure or bench file, besides driver and resource, by role.
Options = Mapping[str, Mapping[str, Any]]


class Bench(Protocol):
    """Where a procedure runs: real instruments, simulated ones, or a recording."""

    @property
    def clock(self) -> Clock:
        """Clock of everything that waits."""
        ...

    def open(self, role: str, driver: str, resource: str, sink: TrafficSink, options: Options | None = None) -> Driver:
        """Connect the driver of a role; every exchange is passed to the sink."""
        ...

    def connect(self, what: ConnectionName) -> int:
        """Note that something has been connected; returns the number of the connection."""
        ...

    def at_line(self, line: str) -> None:
        """Note that the LISN has been switched to another line."""
        ...

    def close(self) -> None:
        """Close all links."""
        ...


@cache
def driver_names() -> dict[str, str]:
    """Known drivers: name to `module:class`; installed ones take precedence over the built-in ones."""
    return BUILT_IN | {entry.name: entry.value for entry in entry_points(group=DRIVER_GROUP)}


def driver_class(name: str) -> type[Driver]:
    """The driver of that name.

    Raises
    ------
    BadInput
        If there is none, or it cannot be loaded.
    """
    known = driver_names()
    if name not in known:
        raise BadInput(f"unknown instrument driver {name!r}: known are {', '.join(sorted(known))}")
    module, _, attribute = known[name].partition(":")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise BadInput(f"the driver {name!r} ({known[name]}) cannot be loaded: {error}") from error
    if not (isinstance(found, type) and issubclass(found, Driver)):
        raise BadInput(f"the driver {name!r} ({known[name]}) is no motoremi.bench.driver.Driver")
    return found


def open_manager(backend: str = "") -> pyvisa.ResourceManager:
    """A VISA resource manager.

    Parameters
    ----------
    backend : str
        PyVISA's name of the backend, for example `@py`; empty for the system's VISA, or PyVISA-py where there is none.
    """
    try:
        return pyvisa.ResourceManager(backend)
    except (OSError, ValueError) as error:
        raise InstrumentError(f"no VISA library for backend {backend!r}: {str(error).splitlines()[0]}") from error


def open_transport(manager: pyvisa.ResourceManager, resource: str, timeout_s: float = 5.0, clock: Clock | None = None) -> VisaTransport:
    """Open a VISA resource.

    Raises
    ------
    InstrumentError
        If there is no such resource, it cannot be opened, or it carries no messages.
    """

    def reopen() -> MessageBasedResource:
        return _open_resource(manager, resource)

    return VisaTransport(reopen(), timeout_s, clock, reopen)


def _open_resource(manager: pyvisa.ResourceManager, resource: str) -> MessageBasedResource:
    try:
        opened = manager.open_resource(resource)
    except (pyvisa.Error, OSError, ValueError, NotImplementedError, ImportError) as error:
        raise InstrumentError(f"{resource}: cannot be opened ({str(error).splitlines()[0]}); check its name with 'motoremi instruments'") from error
    if not isinstance(opened, MessageBasedResource):
        opened.close()
        raise InstrumentError(f"{resource}: is no instrument that takes messages")
    return opened


def attach(transport: Transport, role: str, driver: str, sink: TrafficSink, options: Options | None = None) -> Driver:
    """Make a driver for a transport, with every exchange recorded."""
    made = driver_class(driver)(RecordingTransport(transport, role, sink))
    made.use(options or {})
    return made


def refuse_unless_allowed(role: str, resource: str, allow: Collection[str] | None) -> None:
    """Raise `BadInput` for a resource that is not on the bench's allow-list; None allows every one."""
    if allow is not None and resource not in allow:
        raise BadInput(f"{role}: {resource} is not on the bench's allow-list ({', '.join(sorted(allow))})")


class VisaBench:
    """Real instruments.

    Parameters
    ----------
    resources : mapping of str to str, optional
        Role to resource name; overrides what the procedure says.
    backend : str
        See `open_manager`.
    allow : collection of str, optional
        Resources that may be opened at all; None allows every one.
    """

    def __init__(self, resources: Mapping[str, str] | None = None, backend: str = "", allow: Collection[str] | None = None) -> None:
        self._resources = dict(resources or {})
        self._allow = allow
        self._manager = open_manager(backend)
        self._connections = 0
        self.clock: Clock = WallClock()

    def open(self, role: str, driver: str, resource: str, sink: TrafficSink, options: Options | None = None) -> Driver:
        """Connect the driver of a role."""
        wanted = self._resources.get(role, resource)
        refuse_unless_allowed(role, wanted, self._allow)
        return attach(open_transport(self._manager, wanted, clock=self.clock), role, driver, sink, options)

    def connect(self, what: ConnectionName) -> int:
        """Count the connections, which the operator makes."""
        self._connections += 1
        return self._connections

    def at_line(self, line: str) -> None:
        """Nothing to do: the operator or the receiver switches the LISN."""

    def close(self) -> None:
        """Close the resource manager."""
        self._manager.close()
