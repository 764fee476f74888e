"""Simulated instruments take anything that a client may send, and stay instruments."""

from __future__ import annotations

import functools

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motoremi.virtual.serve import converse
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_device import SimulatedDevice
from motoremi.virtual.simulated_shell import SimulatedShell
from motoremi.virtual.virtual_instruments import VIRTUAL_INSTRUMENTS

ARGUMENTS = [
    "",
    "0",
    "1",
    "-1",
    "2",
    "1e400",
    "-1e400",
    "nan",
    "inf",
    "99999999999999999999",
    "0x",
    "0b111",
    "ON",
    "abc",
    "1 MHZ",
    "1 2 3 4 5",
    "µ",
    "?",
    "TRACE1",
]
BENCH = SimulatedBench(3)


@functools.cache
def device_of(name: str) -> SimulatedDevice:
    """One of each kind for all tests, whatever has been sent to it before."""
    device = VIRTUAL_INSTRUMENTS[name].make(BENCH, BENCH.clock)
    device.resource_name = "TCPIP::127.0.0.1::5025::SOCKET"
    return device


def headers(device: SimulatedDevice) -> list[str]:
    """Everything that the instrument knows."""
    if isinstance(device, SimulatedShell):
        return sorted(device.by_name)
    return sorted({*device.known_commands, *device.settable, *device.known_queries})


def identity(device: SimulatedDevice) -> bytes:
    """Who it says it is, after whatever was left on the line."""
    shell = isinstance(device, SimulatedShell)
    converse(device, b"\r" if shell else b"\n*CLS\n")
    return converse(device, b"version\r" if shell else b"*IDN?\n")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(VIRTUAL_INSTRUMENTS))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_every_command_takes_every_argument(name: str, data: st.DataObject) -> None:
    device = device_of(name)
    healthy = identity(device)
    end = "\r" if isinstance(device, SimulatedShell) else "\n"
    sent = data.draw(st.lists(st.tuples(st.sampled_from(headers(device)), st.sampled_from(ARGUMENTS)), min_size=1, max_size=6))
    for header, argument in sent:
        converse(device, f"{header} {argument}{end}".encode())
    assert identity(device) == healthy


@pytest.mark.parametrize("name", sorted(VIRTUAL_INSTRUMENTS))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=st.binary(max_size=80))
def test_noise_on_the_line_is_no_end(name: str, noise: bytes) -> None:
    device = device_of(name)
    healthy = identity(device)
    converse(device, noise)
    assert identity(device) == healthy


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(VIRTUAL_INSTRUMENTS))
def test_a_line_without_end_does_not_fill_the_memory(name: str) -> None:
    device = device_of(name)
    healthy = identity(device)
    for _ in range(100):
        converse(device, b"x" * 65536)
    assert len(device.incoming) <= 1 << 20
    assert identity(device) == healthy
