"""The simulated instruments: class, role and VISA resource on the simulated bench, by the name of the driver that each is for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module

from motoremi.bench.clock import Clock
from motoremi.errors import BadInput
from motoremi.schema.roles import Role
from motoremi.virtual.simulated_device import SimulatedDevice, Wiring


@dataclass(frozen=True)
class VirtualInstrument:
    """A simulated instrument.

    Parameters
    ----------
    simulator : str
        `module:class` of a `SimulatedDevice` that is made from wiring and clock; the module is one of this package.
    resource : str
        Its VISA name on the simulated bench.
    role : str
        Its role in a procedure.
    others : mapping of str to str
        Further roles of such an instrument, and its resource in each.
    """

    simulator: str
    resource: str
    role: Role
    others: Mapping[Role, str] = field(default_factory=dict)

    def resource_as(self, role: str) -> str | None:
        """Its resource in that role; None if it cannot have the role."""
        return self.resource if role == self.role else next((name for other, name in self.others.items() if other == role), None)

    def make(self, wiring: Wiring, clock: Clock) -> SimulatedDevice:
        """Make one, as after power-on."""
        module, _, attribute = self.simulator.partition(":")
        device = getattr(import_module(f"{__package__}.{module}"), attribute)(wiring, clock)
        if not isinstance(device, SimulatedDevice):
            raise BadInput(f"{self.simulator} is no simulated instrument")
        return device


# By the name of the driver.
VIRTUAL_INSTRUMENTS: dict[str, VirtualInstrument] = {
    "4294a": VirtualInstrument("simulated_4294a:Simulated4294A", "GPIB0::17::INSTR", "analyser"),
    "e4990a": VirtualInstrument("simulated_e4990a:SimulatedE4990A", "GPIB0::18::INSTR", "analyser"),
    "nanovna": VirtualInstrument("simulated_nanovna:SimulatedNanoVna", "ASRL1::INSTR", "analyser"),
    "nanovna-v2": VirtualInstrument("simulated_nanovna_v2:SimulatedNanoVnaV2", "ASRL3::INSTR", "analyser"),
    "librevna": VirtualInstrument("simulated_librevna:SimulatedLibreVna", "TCPIP0::127.0.0.1::19542::SOCKET", "analyser"),
    "esr": VirtualInstrument("simulated_esr:SimulatedESR", "GPIB0::20::INSTR", "receiver"),
    "esrp": VirtualInstrument("simulated_esr:SimulatedESRP", "GPIB1::20::INSTR", "receiver"),
    "esw": VirtualInstrument("simulated_esr:SimulatedESW", "GPIB1::21::INSTR", "receiver"),
    "esci": VirtualInstrument("simulated_esr:SimulatedESCI", "GPIB1::22::INSTR", "receiver"),
    "esu": VirtualInstrument("simulated_esr:SimulatedESU", "GPIB1::23::INSTR", "receiver"),
    "mxe": VirtualInstrument("simulated_mxe:SimulatedMxe", "GPIB0::21::INSTR", "receiver"),
    "n6141": VirtualInstrument("simulated_mxe:SimulatedN6141", "GPIB1::24::INSTR", "receiver"),
    "xseries": VirtualInstrument("simulated_swept:SimulatedXSeries", "GPIB1::25::INSTR", "receiver"),
    "dsa800": VirtualInstrument("simulated_swept:SimulatedDSA800", "USB0::0x1AB1::0x0960::DSA8A134700016::0::INSTR", "receiver"),
    "rsa": VirtualInstrument("simulated_swept:SimulatedRSA", "USB0::0x1AB1::0x0968::RSA5A191200123::0::INSTR", "receiver"),
    "ssa3000x": VirtualInstrument("simulated_swept:SimulatedSSA3000X", "USB0::0xF4EC::0x1300::SSA3XAAX1R0001::0::INSTR", "receiver"),
    "tinysa": VirtualInstrument("simulated_tinysa:SimulatedTinySa", "ASRL2::INSTR", "receiver"),
    "34461a": VirtualInstrument(
        "simulated_meter:Simulated34461A",
        "GPIB0::22::INSTR",
        "voltmeter",
        {"ammeter": "GPIB0::23::INSTR", "thermometer": "GPIB0::24::INSTR"},
    ),
    "e36300": VirtualInstrument("simulated_supply:SimulatedE36313A", "GPIB0::5::INSTR", "supply"),
    "hmp4000": VirtualInstrument("simulated_supply:SimulatedHmp4040", "GPIB0::6::INSTR", "supply"),
    "line-reader": VirtualInstrument(
        "simulated_lines:SimulatedLineReader",
        "ASRL3::INSTR",
        "tachometer",
        {"thermometer": "ASRL4::INSTR", "voltmeter": "ASRL5::INSTR", "ammeter": "ASRL6::INSTR"},
    ),
}


def virtual_instrument(name: str) -> VirtualInstrument:
    """The simulated instrument for that driver.

    Raises
    ------
    BadInput
        If there is none.
    """
    if name not in VIRTUAL_INSTRUMENTS:
        raise BadInput(f"there is no simulated {name!r}: use one of {', '.join(sorted(VIRTUAL_INSTRUMENTS))}")
    return VIRTUAL_INSTRUMENTS[name]
