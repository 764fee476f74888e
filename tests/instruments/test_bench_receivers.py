"""The ESR's sisters and the EMI application of the X-series: the same scan, with what differs; what all receivers correct by themselves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fault_matrix import BENCH_FILE, SEED
from record_sessions import procedure

from motoremi.bench.connect import attach, open_transport
from motoremi.bench.receiver import EmiReceiver
from motoremi.data.session import SessionWriter, load
from motoremi.errors import BadInput, InstrumentError
from motoremi.run.runner import run, start_document
from motoremi.virtual.simulated_bench import SimulatedBench
from motoremi.virtual.simulated_receiver import settling_db

pytestmark = pytest.mark.slow

FAMILY = {"esrp": "ESRP7", "esw": "ESW26", "esci": "ESCI-3", "esu": "ESU-26", "n6141": "N9020A"}
ALL = ("esr", "mxe", *FAMILY)


@pytest.fixture
def bench(bench: SimulatedBench) -> SimulatedBench:
    bench.connect(bench.at_work("receiver"))
    return bench


def ready(bench: SimulatedBench, name: str, traffic: list[Any] | None = None) -> EmiReceiver:
    driver = bench.open("receiver", name, "whatever", (traffic if traffic is not None else []).append)
    assert isinstance(driver, EmiReceiver)
    driver.reset()
    driver.configure(150e3, 30e6, 1e6)
    return driver


@pytest.mark.parametrize("name", FAMILY)
def test_a_sister_scans(bench: SimulatedBench, name: str) -> None:
    driver = ready(bench, name)
    assert driver.identify().model == FAMILY[name]
    spectrum = driver.scan("quasi-peak")
    assert spectrum.metadata["receiver"] == name
    settings = spectrum.metadata["settings"]
    dwell_s = settings["dwell_s"] if "dwell_s" in settings else settings["scan_time_s"] / len(spectrum)
    expected = bench.level_dbuv(spectrum.frequency_hz, "quasi-peak") + settling_db("quasi-peak", dwell_s)
    np.testing.assert_allclose(spectrum.level_dbuv, expected, atol=1e-3)


@pytest.mark.parametrize("name", FAMILY)
def test_another_receiver_at_the_address_is_refused(bench: SimulatedBench, name: str) -> None:
    ready(bench, name).close()
    other = "esr" if name == "n6141" else "n6141"
    driver = attach(open_transport(bench.resource_manager, bench.resources["receiver"], clock=bench.clock), "receiver", other, lambda record: None)
    with pytest.raises(InstrumentError, match=f"'.*{FAMILY[name]}.*' answers; check the resource or choose another driver"):
        driver.identify()


@pytest.mark.parametrize(
    ("name", "sent"), [("esw", "BAND:TYPE CISP"), ("esu", "BAND:TYPE PULS"), ("esw", "CORR:TRAN:INP1 OFF"), ("esci", "CORR:TRAN OFF")]
)
def test_what_differs_is_sent(bench: SimulatedBench, name: str, sent: str) -> None:
    traffic: list[Any] = []
    ready(bench, name, traffic)
    assert f"{sent}\n" in [record.get("text") for record in traffic]


@pytest.mark.parametrize(("name", "start_hz"), [("esci", 8e3), ("esr", 9.0), ("esu", 19.0), ("esw", 1.0)])
def test_the_range_is_that_of_the_family(bench: SimulatedBench, name: str, start_hz: float) -> None:
    with pytest.raises(BadInput, match=r"start_hz = .* is outside the range"):
        ready(bench, name).configure(start_hz, 30e6, 4.5e3)


def test_the_esci_has_no_rms_average(bench: SimulatedBench) -> None:
    with pytest.raises(BadInput, match="detector = 'rms-average' is unknown; use one of peak, quasi-peak, average, cispr-average"):
        ready(bench, "esci").scan("rms-average")


def test_an_esw_whose_input_was_disconnected_is_marked(bench: SimulatedBench, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = ready(bench, "esw")
    monkeypatch.setattr(bench.devices["receiver"], "read_overload", lambda: b"8")
    assert driver.scan("peak").overload.all()
    driver = ready(bench, "esr")
    monkeypatch.setattr(bench.devices["receiver"], "read_overload", lambda: b"8")
    assert not driver.scan("peak").overload.any()


@pytest.mark.parametrize("name", ALL)
def test_a_transducer_factor_inside_the_receiver_is_switched_off(bench: SimulatedBench, name: str) -> None:
    driver: Any = ready(bench, name)
    healthy = driver.scan("peak")
    bench.devices["receiver"].set_value("own_correction", "ON")
    assert driver.own_correction is True
    twice = driver.scan("peak")
    assert twice.metadata["settings"]["own_correction"] is True
    np.testing.assert_allclose(twice.level_dbuv - healthy.level_dbuv, 10.0, atol=2e-3)
    driver.reset()
    assert driver.own_correction is True
    assert driver.configure(150e3, 30e6, 1e6)["own_correction"] is False
    again = driver.scan("peak")
    assert again.metadata["settings"]["own_correction"] is False
    np.testing.assert_allclose(again.level_dbuv, healthy.level_dbuv, atol=2e-3)


def test_the_external_gain_of_a_tinysa_is_set_to_nothing(bench: SimulatedBench) -> None:
    driver: Any = bench.open("receiver", "tinysa", "whatever", lambda record: None)
    driver.reset()
    driver.configure(150e3, 30e6, 1e6, 10e3)
    healthy = driver.scan("peak")
    bench.devices["receiver"].set_value("external_gain", "20")
    again = driver.scan("peak")
    np.testing.assert_allclose(again.level_dbuv, healthy.level_dbuv)
    assert again.metadata["settings"]["own_correction"] is False


@pytest.mark.parametrize("name", ["esr", "n6141", "dsa800"])
def test_a_correction_that_is_switched_on_during_a_run_stops_it(tmp_path: Path, name: str) -> None:
    bench = SimulatedBench(SEED)

    def operator(text: str) -> None:
        if bench.clock.now() > 1.0:
            bench.devices["receiver"].set_value("own_correction", "ON")

    writer = SessionWriter.create(tmp_path / "s", start_document(procedure(name), BENCH_FILE))
    with pytest.raises(InstrumentError, match=r"its settings changed during the run \(own_correction is True, was False\)"):
        run(procedure(name), bench, writer, analyse=lambda *_: None, prompt=operator)
    bench.close()
    assert len(load(tmp_path / "s").spectra) == 2
