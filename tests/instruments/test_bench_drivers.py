"""Every driver, walked by the same tests."""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Iterator
from dataclasses import astuple
from typing import Any

import pytest
from places import ROOT

from motoremi.bench.analyser import ImpedanceAnalyser, SweepSettings
from motoremi.bench.connect import BUILT_IN, DRIVER_GROUP, driver_class, driver_names, open_transport
from motoremi.bench.driver import Driver, Setting
from motoremi.bench.meter import Meter
from motoremi.bench.receiver import EmiReceiver, ScanSettings
from motoremi.bench.registers import RegisterDriver
from motoremi.bench.replay import ReplayTransport
from motoremi.bench.shell import ShellDriver
from motoremi.bench.supply import Supply
from motoremi.instruments.keysight_e4990a import KeysightE4990A
from motoremi.instruments.tinysa import TinySa
from motoremi.virtual.simulated_bench import SimulatedBench

UNITS = {"_hz": "Hz", "_volt": "V", "_s": "s", "_db": "dB"}


EVERY_DRIVER = sorted(driver_names())
EVERY_SETTING = [pytest.param(name, setting, id=f"{name}.{key}") for name in EVERY_DRIVER for key, setting in driver_class(name).table().items()]


@pytest.fixture
def bench() -> Iterator[SimulatedBench]:
    made = SimulatedBench(1)
    yield made
    made.close()


@pytest.mark.parametrize("name", EVERY_DRIVER)
def test_a_driver_is_complete(name: str) -> None:
    driver = driver_class(name)
    assert issubclass(driver, Driver)
    assert not inspect.isabstract(driver)
    assert issubclass(driver, ImpedanceAnalyser | EmiReceiver | Meter)
    re.compile(driver.model)
    assert driver.__doc__
    if name == "line-reader":
        # It has no commands at all: it only listens, or sends what the bench file says.
        return
    assert driver.error_query.endswith("?") or issubclass(driver, ShellDriver | RegisterDriver)
    assert driver.safe_commands
    # A supply's settings carry the number of its output, and are read and set by its own methods.
    assert driver.table() or issubclass(driver, Supply)


@pytest.mark.parametrize("name", EVERY_DRIVER)
def test_a_driver_documents_its_methods(name: str) -> None:
    for key, member in inspect.getmembers(driver_class(name), inspect.isfunction):
        if not key.startswith("_"):
            assert inspect.getdoc(member), f"{name}.{key}"


@pytest.mark.parametrize(("name", "setting"), EVERY_SETTING)
def test_a_setting_says_what_it_controls_and_in_which_range(name: str, setting: Setting[Any]) -> None:
    assert setting.__doc__ is not None
    assert re.match(r"Control .*\.$", setting.__doc__)
    expected = next((unit for suffix, unit in UNITS.items() if setting.name.endswith(suffix)), "")
    assert setting.unit == expected
    if setting.span is not None:
        assert setting.span[0] < setting.span[1]
    if expected:
        assert setting.span is not None
    assert "?" not in setting.command


@pytest.mark.parametrize("name", EVERY_DRIVER)
def test_no_command_controls_two_settings(name: str) -> None:
    commands = [setting.command for setting in driver_class(name).table().values()]
    assert len(set(commands)) == len(commands)


def test_the_built_in_drivers_are_the_published_ones() -> None:
    """The list for source trees must not drift from the entry points."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["entry-points"][DRIVER_GROUP] == BUILT_IN


@pytest.mark.parametrize("method", ["configure", "set_up"])
def test_a_driver_may_define_configure_itself_or_set_up(bench: SimulatedBench, method: str) -> None:
    """Drivers outside of this project define `configure`, as they had to before there was `set_up`."""
    seen: list[Any] = []

    class Own(KeysightE4990A):
        """A driver of one's own."""

        if method == "configure":

            def configure(self, start_hz, stop_hz, points, spacing="log", bandwidth_factor=3, oscillator_volt=0.5):  # type: ignore[no-untyped-def]
                seen.append((start_hz, stop_hz, points, spacing, bandwidth_factor, oscillator_volt))
                return {}

        else:

            def set_up(self, asked: SweepSettings) -> dict[str, Any]:
                seen.append(astuple(asked))
                return {}

    driver = Own(open_transport(bench.resource_manager, bench.resources["analyser"], clock=bench.clock))
    driver.configure(1e3, 1e6, 51, "linear")
    assert seen == [(1e3, 1e6, 51, "linear", 3, 0.5)]


def test_the_usual_bandwidth_is_that_of_the_receiver() -> None:
    seen = {}

    class Own(TinySa):
        """A driver of one's own."""

        def set_up(self, asked: ScanSettings) -> dict[str, Any]:
            seen[self.USUAL_BANDWIDTH_HZ] = asked.resolution_bandwidth_hz
            return {}

    Own(ReplayTransport("RECORD", [])).configure(150e3, 30e6, 1e6)
    assert seen == {10e3: 10e3}
    assert EmiReceiver.USUAL_BANDWIDTH_HZ == 9e3
