"""How the page behaves in a real browser when things change around it: other tabs, the command line, a server that goes."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import expect
from workbench_browser import needs_chromium
from workbench_tools import bench_of, served

from motoremi.workbench.doorway import doorway

pytestmark = needs_chromium


def test_the_local_file_opens_the_page(browser, tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    with served(bench_of(tmp_path)) as address, doorway(address) as file:
        page = browser.new_page()
        page.goto(file.as_uri())
        page.wait_for_selector("main[data-view=bench]")
        assert page.url.startswith(address.partition("?")[0])
        assert "token" not in page.url
        page.close()


def test_a_wrong_key_and_a_missing_page_are_pages(browser, tmp_path):
    with served(bench_of(tmp_path)) as address:
        page = browser.new_page()
        page.goto(address.partition("?")[0])
        expect(page.locator("h1")).to_have_text("This page needs its key")
        page.goto(address)
        page.goto(address.partition("?")[0] + "nowhere")
        expect(page.locator("h1")).to_have_text("There is no such page")
        page.click("a")
        page.wait_for_selector("main[data-view=bench]")
        page.close()
