"""Accessibility: axe-core finds nothing in any view, light or dark, wide or on a telephone; what it cannot see is asserted by itself."""

from __future__ import annotations

import pytest
from playwright.sync_api import expect
from workbench_browser import VIEWS, Watched, findings, needs_chromium
from workbench_tools import bench_of, make_fitted_session, served

from motoremi.workflow import add_to_session, opened
from motoremi.workflow_emission import predict_session

pytestmark = [needs_chromium, pytest.mark.slow]
PHONE = {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    path = make_fitted_session(tmp_path_factory.mktemp("axe") / "fitted")
    with opened(path) as store:
        predict_session(store)
        add_to_session(store, "eddy-laminations")
    return path


@pytest.mark.parametrize(("scheme", "size"), [("light", {"width": 1440, "height": 900}), ("dark", PHONE)])
def test_axe_finds_nothing(browser, session, scheme, size):
    with served(bench_of(session.parent, session)) as address:
        watched = Watched(browser, address, color_scheme=scheme, viewport=size)
        found = {}
        for view in VIEWS:
            watched.see(view)
            if view == "story":
                watched.page.locator("[data-effect='skin-effect']").focus()
                watched.page.keyboard.press("ArrowDown")
                expect(watched.page.locator("#signature-of")).to_be_visible()
            found[view] = findings(watched.page)
        assert found == {view: [] for view in VIEWS}
        watched.page.keyboard.press("?")
        assert findings(watched.page) == []
        watched.close()


def test_axe_finds_nothing_in_a_run_and_in_an_error_page(browser, tmp_path):
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("bench")
        page.select_option("#bench-procedure", "fixture_check")
        page.check("#bench-ask")
        page.click("#look")
        expect(page.locator("#found")).to_contain_text("4294A")
        page.click("#run")
        page.wait_for_selector("#connected")
        assert findings(page) == []
        page.click("#stop")
        expect(page.locator("#run-status")).to_contain_text("safe")
        page.goto(watched.base + "/nowhere")
        assert findings(page) == []
        watched.trouble.clear()
        watched.close()


def test_the_row_of_tabs_shows_the_active_one(browser, session):
    with served(bench_of(session.parent, session)) as address:
        watched = Watched(browser, address, viewport=PHONE)
        page = watched.page
        watched.drawn("story")
        for key, view in (("9", "challenge"), ("1", "bench"), ("8", "report")):
            page.keyboard.press(key)
            watched.drawn(view)
            box = page.locator("nav a[aria-current]").bounding_box()
            assert box["x"] >= 0, view
            assert box["x"] + box["width"] <= PHONE["width"], view
        watched.close()
