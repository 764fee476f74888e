"""When data were measured and whether they are simulated, as the header of their file says it."""

from __future__ import annotations

import pytest
from laboratory_cases import measured_session, spectrum
from typer.testing import CliRunner

from motoremi.cli.app import app
from motoremi.data.origin import is_simulated, measured_on
from motoremi.data.session import load


@pytest.mark.parametrize(
    ("header", "day"),
    [
        ({"DATE": "Jan 25 2018"}, "2018-01-25"),
        ({"Date": "Tue Feb 03 10:00:00 2024"}, "2024-02-03 10:00:00"),
        ({"date": "03.Feb 2024", "time": "11:12:13"}, "2024-02-03 11:12:13"),
        ({"date": "03.02.2024;"}, "2024-02-03"),
        ({"measured": "2024-02-03T10:00:00+00:00"}, "2024-02-03 10:00:00"),
        ({"date": "3 March 2024"}, "2024-03-03"),
        ({"date": "02/03/2024"}, "02/03/2024 (as the file writes it)"),
        ({"date": "Feb 31 2024"}, "Feb 31 2024 (as the file writes it)"),
        ({"date": ""}, ""),
        ({"rbw_hz": 9000}, ""),
    ],
)
def test_dates_as_instruments_write_them(header, day):
    assert measured_on(header) == day


def test_what_says_that_it_is_simulated():
    assert all(is_simulated({"Simulated": value}) for value in (True, "true", "TRUE", 1))
    assert not any(is_simulated({"simulated": value}) for value in (False, "false", "", 0))


@pytest.mark.slow
def test_simulated_files_say_so_and_so_do_their_exports(tmp_path, measure):
    sweeps, _ = measure(2)
    session = measured_session(tmp_path / "sim", sweeps, [spectrum()], backend="sim", simulated=True)
    real = measured_session(tmp_path / "real", sweeps[:1], [spectrum()])
    assert all("# simulated: true" in file.read_text() for file in session.glob("s*/*.csv"))
    assert not any("simulated" in file.read_text() for file in real.glob("s*/*.csv"))
    assert not load(real).simulated

    def done(*words: object) -> None:
        result = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert result.exit_code == 0, result.output

    exported = tmp_path / "open.s1p"
    done("export", session, "--touchstone", exported, "--csv", tmp_path / "all.csv")
    assert (tmp_path / "all.csv").read_text().splitlines()[0].endswith(",simulated")
    done("import", tmp_path / "files", "--short", *sorted(session.glob("sweeps/short-*.csv"))[:1], "--open", exported)
    done("import", tmp_path / "touchstone", "--open", exported)
    done("import", tmp_path / "spectra", "--spectrum", *session.glob("spectra/*.csv"))
    for name in ("files", "touchstone", "spectra"):
        assert load(tmp_path / name).simulated, name
    done("import", tmp_path / "again", "--open", *(tmp_path / "touchstone" / "sweeps").iterdir())
    assert load(tmp_path / "again").simulated
