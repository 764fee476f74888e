"""Numbers, axes and words of the page: what a reader sees of what was computed."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.sync_api import Page, expect
from workbench_browser import Watched, needs_chromium
from workbench_tools import bench_of, client_of, make_fitted_session, make_session, served

from motoremi.data.session import load, reopen
from motoremi.inspection.compare import Tolerance
from motoremi.report.cause import diagnosis_section
from motoremi.report.identity import identity_section
from motoremi.report.overlay import LOOKS
from motoremi.workbench.desk import Desk
from motoremi.workflow import compare_session, opened

pytestmark = [needs_chromium, pytest.mark.slow]


@pytest.fixture(scope="module")
def page(browser, tmp_path_factory) -> Any:
    with served(bench_of(tmp_path_factory.mktemp("empty"))) as address:
        watched = Watched(browser, address)
        watched.see("bench")
        yield watched.page
        watched.close()


LABELLED = """async (unit) => {
    const own = await import('/static/ticks.js'), { all, labelled } = ticks();
    return [all, own.tickLabels(all, labelled, unit)];
}"""


def said(page: Page, file: str, call: str) -> Any:
    """What a function of the page's own answers."""
    return page.evaluate(f"async () => {{ const own = await import('/static/{file}'); return own.{call}; }}")


@pytest.mark.parametrize(
    ("call", "text"),
    [
        ("show(132000000, '', 3)", "132 × 10⁶"),
        ("show(70760, '', 3)", "70.8 × 10³"),
        ("show(0.000123, '', 3)", "123 × 10⁻⁶"),
        ("show(12.345, '', 3)", "12.3"),
        ("show(0, '', 3)", "0"),
        ("show(999999, 'Hz', 4)", "1\u00a0MHz"),
        ("lag(132000000)", "> 1000"),
        ("lag(12.34)", "12.3"),
        ("chance(1)", "> 99\u00a0%"),
        ("chance(0.42)", "42\u00a0%"),
        ("chance(1e-9)", "< 0.1\u00a0%"),
        ("duration(1370)", "22\u00a0min 50\u00a0s"),
        ("duration(42.4)", "42\u00a0s"),
        ("duration(7500)", "2\u00a0h 05\u00a0min"),
        ("symbols('7.094 uH, 24.5 Ohm - 5.58 kOhm, 830 uOhm, 60.0 dBuV, Ohm')", "7.094 µH, 24.5 Ω - 5.58 kΩ, 830 µΩ, 60.0 dBµV, Ohm"),
    ],
)
def test_numbers_as_engineers_write_them(page, call, text):
    assert said(page, "units.js", call) == text


@pytest.mark.parametrize(
    ("low", "high", "most", "ticks"),
    [
        (-100, 95, 6, [-90, -45, 0, 45, 90]),
        (-190, 190, 6, [-180, -90, 0, 90, 180]),
        (-11, 11, 4.3, [-10, 0, 10]),
        (-40, 40, 6, [-30, -15, 0, 15, 30]),
    ],
)
def test_phase_has_ticks_at_right_angles(page, low, high, most, ticks):
    assert said(page, "ticks.js", f"angleTicks({low}, {high}, {most}).all") == ticks


def test_axes_over_decades_have_minor_ticks(page):
    ticks, labels = page.evaluate(LABELLED.replace("ticks()", "own.logTicks(1e5, 3e7, 4)"), "Hz")
    assert len(ticks) == 9 + 9 + 3
    assert [label for label in labels if label] == ["100\u00a0kHz", "1\u00a0MHz", "10\u00a0MHz"]


def test_minor_ticks_of_a_low_axis_do_not_run_into_each_other(page):
    ticks, _ = page.evaluate(LABELLED.replace("ticks()", "own.logTicks(1e-3, 10, 3)"), "%")
    assert [f"{tick:g}" for tick in ticks][:4] == ["0.001", "0.002", "0.005", "0.01"]


@pytest.mark.parametrize(
    ("low", "high", "unit"),
    [(0.00240, 0.00262, "dB"), (-0.0001, 0.0001, "dB"), (1e6, 1.0002e6, "Hz"), (5e-12, 5.00001e-12, "F"), (99.99, 100.01, "%"), (-3, 2e5, "")],
)
def test_no_label_of_an_axis_stands_twice(page, low, high, unit):
    _, labels = page.evaluate(LABELLED.replace("ticks()", f"own.linearTicks({low}, {high}, 6)"), unit)
    assert len(labels) >= 3
    assert len(set(labels)) == len(labels)


def test_sessions_that_are_compared_differ_without_colour(page):
    dashes = said(page, "views/together.js", "LOOKS.map((one) => JSON.stringify(one.dash ?? []))")
    assert len(set(dashes)) == len(dashes) == len(LOOKS)


def test_tolerances_are_drawn_where_they_judge(browser, fitted):
    with opened(fitted) as store:
        compare_session(store, Tolerance(error_percent=5.0, magnitude_db=1.0, phase_deg=3.0))
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        watched.see("session")
        expect(watched.page.locator(".legend:text-is('tolerance')")).to_have_count(2)
        watched.see("fails")
        expect(watched.page.locator(".legend:text-is('tolerance')")).to_have_count(6)
        watched.close()


def test_next_says_what_to_do_and_an_added_effect_keeps_its_title(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        watched.see("next")
        expect(watched.page.locator("#what-to-do")).to_contain_text("What to do: ")
        watched.see("story")
        row = watched.page.locator("#ranking tr", has=watched.page.locator("[data-effect='second-resonance']"))
        title = row.locator(".note").inner_text()
        watched.page.click("[data-effect='second-resonance']")
        expect(row).to_contain_text("in the model")
        expect(row.locator(".note")).to_have_text(title)
        # After success nothing is red: that the ranking is of the model before is a remark.
        expect(watched.page.locator("#verdict")).to_contain_text("the ladder has changed since")
        expect(watched.page.locator("#verdict .bad")).to_have_count(0)
        watched.page.click("#drop")
        expect(row).not_to_contain_text("in the model")
        watched.close()


def test_where_nothing_explains_it_no_effect_is_likely(tmp_path):
    folder = make_fitted_session(tmp_path / "s")
    stored = Desk(folder).session.analysis("diagnosis")
    with reopen(folder) as writer:
        writer.save_analysis("diagnosis", {**stored, "verdict": "unexplained", "effects": [], "families": [], "confidence": 0.92})
        writer.close("done")
    workbench = bench_of(tmp_path, folder)
    told = client_of(workbench).get(f"/api/sessions/{workbench.shelf.first}/story").json()
    assert max(one["probability"] for one in told["diagnosis"]["candidates"]) == pytest.approx(0.08, rel=0.01)
    # The report says the same.
    section = diagnosis_section(Desk(folder).session.analysis("diagnosis"))
    ranking = next(table for table in section.tables if table.title.startswith("Ranking"))
    # A power of ten is a probability of almost none.
    assert max(float(row[2]) for row in ranking.rows if "×" not in row[2]) == pytest.approx(0.08, rel=0.01)
    sets = next(table for table in section.tables if table.title.startswith("Sets"))
    assert max(float(row[1]) for row in sets.rows if "×" not in row[1]) <= 0.081
    # That no effect was named is no explanation.
    assert {one["title"]: one["done"] for one in told["stages"]}["Explained"] is False


def test_what_was_diagnosed_without_a_fit_is_no_step_ahead(tmp_path):
    folder = make_fitted_session(tmp_path / "s")
    stored = Desk(folder).session.analysis("diagnosis")
    measured = make_session(tmp_path / "measured")
    with reopen(measured) as writer:
        # Whoever goes on with a session asks the same instruments again.
        for serial in ("1", "1", "2"):
            writer.emit("instrument", role="analyser", driver="4294a", resource="GPIB0::17::INSTR", identity={"serial": serial}, settings={})
        writer.save_analysis("diagnosis", stored)
        writer.close("done")
    workbench = bench_of(tmp_path, measured)
    at = f"/api/sessions/{workbench.shelf.first}"
    told = client_of(workbench).get(f"{at}/story").json()
    assert [one["done"] for one in told["stages"]] == [True, False, False, False, False, False]
    assert [one["identity"]["serial"] for one in client_of(workbench).get(at).json()["instruments"]] == ["1", "2"]
    settings = next(table for table in identity_section(load(measured), "").tables if table.title.startswith("Settings"))
    assert len(settings.rows) == 1
