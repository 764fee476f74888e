"""What is on the bus and what answers, and drivers from other packages."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
import pyvisa
from serving import served

from motoremi.bench.connect import driver_class, driver_names, open_manager
from motoremi.bench.survey import load_trouble, survey, title
from motoremi.cli import main
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.virtual_instruments import VIRTUAL_INSTRUMENTS

pytestmark = pytest.mark.slow

DRIVER = '''
"""The Scope-o-Matic 9000 measures impedance, too."""
from motoremi.instruments.agilent_4294a import Agilent4294A

class Scope(Agilent4294A):
    """Its driver."""
    model = "9000"
'''


# A line reader has no identity to ask for.
RECOGNISED = sorted(set(VIRTUAL_INSTRUMENTS) - {"line-reader"})


@pytest.fixture
def manager() -> Iterator[pyvisa.ResourceManager]:
    manager = open_manager("@py")
    yield manager
    manager.close()


@pytest.fixture
def other_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Somebody else's distribution with a driver that works and one that does not."""
    (tmp_path / "scope_o_matic.py").write_text(DRIVER)
    metadata = tmp_path / "scope_o_matic-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: scope-o-matic\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text("[motoremi.instruments]\nscope = scope_o_matic:Scope\nbroken = no_such_module:Thing\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    driver_names.cache_clear()
    yield
    driver_names.cache_clear()
    sys.modules.pop("scope_o_matic", None)


def test_the_simulated_bench_answers() -> None:
    bench = SimulatedBench(1)
    answers = {answer.resource: answer for answer in survey(bench.resource_manager)}
    bench.close()
    assert answers["GPIB0::17::INSTR"].drivers == ("4294a",)
    assert answers["GPIB0::20::INSTR"].drivers == ("esr",)
    assert answers["GPIB0::20::INSTR"].identity.startswith("Rohde&Schwarz,ESR3")


@pytest.mark.parametrize(("name", "over"), [*((name, "tcp") for name in RECOGNISED), ("nanovna", "pty"), ("tinysa", "pty")])
def test_every_instrument_is_recognised_on_a_real_link(name: str, over: str, manager: pyvisa.ResourceManager) -> None:
    with served(name, over) as (server, _):
        answer = survey(manager, [server.resource])[0]
    # An X-series analyser may have the EMI application or not.
    assert answer.drivers == (("n6141", "xseries") if name in ("n6141", "xseries") else (name,)), answer


def test_who_is_silent_is_told(manager: pyvisa.ResourceManager) -> None:
    answer = survey(manager, ["TCPIP::127.0.0.1::9::SOCKET"])[0]
    assert (answer.identity, answer.drivers) == ("", ())
    assert "TCPIP" in answer.trouble


@pytest.mark.parametrize(("vendor", "product", "asked"), [(0x0483, 0x5740, True), (0x04B4, 0x0008, True), (0x0403, 0x6001, False)])
def test_only_serial_ports_of_known_instruments_are_asked(
    vendor: int, product: int, asked: bool, manager: pyvisa.ResourceManager, monkeypatch: pytest.MonkeyPatch
) -> None:
    with served("nanovna-v2", "pty") as (server, _):
        port = SimpleNamespace(device=server.path, vid=vendor, pid=product)  # type: ignore[attr-defined]
        monkeypatch.setattr("motoremi.bench.survey.list_ports.comports", lambda: [port])
        monkeypatch.setattr(manager, "list_resources", lambda query: (server.resource,))
        answer = survey(manager)[0]
    assert answer.drivers == (("nanovna-v2",) if asked else ())
    assert answer.trouble == ("" if asked else "not asked: a serial port of no known instrument")


@pytest.mark.usefixtures("other_package")
def test_a_driver_of_another_package_is_known_and_a_broken_one_is_told() -> None:
    assert driver_class("scope").model == "9000"
    assert "no_such_module" in load_trouble()["broken"]
    assert "scope" not in load_trouble()


@pytest.mark.usefixtures("other_package")
def test_doctor_and_instruments_tell_it(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    with served("4294a") as (server, _):
        for command in ("instruments", "doctor"):
            monkeypatch.setattr(sys, "argv", ["motoremi", command, "--json", "--ask", server.resource])
            with pytest.raises(SystemExit) as ended:
                main()
            assert not ended.value.code
            document = json.loads(capsys.readouterr().out)
            assert document["answers"][0]["drivers"] == ["4294a"]
            assert document["resources"][0] == server.resource
            assert list(document["broken"]) == ["broken"]
        assert document["backends"]["ASRL INSTR"].startswith("Available")
        monkeypatch.setattr(sys, "argv", ["motoremi", "instruments", "--ask", server.resource])
        with pytest.raises(SystemExit):
            main()
    text = capsys.readouterr().out
    assert "scope      The Scope-o-Matic 9000 measures impedance, too." in text
    assert "broken     CANNOT BE LOADED" in text
    assert f"{server.resource}: HEWLETT-PACKARD,4294A,JP1KG00123,REV1.11 -> driver 4294a" in text


def test_drivers_of_one_module_are_told_apart() -> None:
    titles = [title(name) for name in driver_names()]
    assert len(set(titles)) == len(titles)
    assert title("esw").startswith("R&S ESW")
    assert title("esr").startswith("Rohde & Schwarz ESR")
