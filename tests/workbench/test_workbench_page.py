"""How the page behaves in a real browser when things change around it: other tabs, the command line, a server that goes."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import expect
from workbench_browser import Watched, needs_chromium
from workbench_tools import bench_of, make_session, served, until

from motoremi.data.session import load
from motoremi.workbench.doorway import doorway
from motoremi.workflow import add_to_session, compare_session, drop_from_session, fit_session, opened

pytestmark = [needs_chromium, pytest.mark.slow]
MOTOREMI = Path(sys.executable).with_name("motoremi")


def test_the_local_file_opens_the_page(browser, tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    with served(bench_of(tmp_path)) as address, doorway(address) as file:
        page = browser.new_page()
        page.goto(file.as_uri())
        page.wait_for_selector("main[data-view=files]")
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
        page.wait_for_selector("main[data-view=files]")
        page.close()


def test_reload_and_back_keep_session_and_view(browser, fitted):
    other = make_session(fitted.parent / "other", motor="Other motor 8")
    workbench = bench_of(fitted.parent, other, fitted)
    with served(workbench) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.drawn("story")
        watched.see("fails")
        page.select_option("#session-choice", workbench.shelf.place(other))
        expect(page.locator("main")).to_contain_text("fit this session first")
        page.reload()
        watched.drawn("fails")
        expect(page.locator("#session-choice option:checked")).to_contain_text("Other motor 8")
        expect(page.locator("main")).to_contain_text("fit this session first")
        page.go_back()
        expect(page.locator("#bands")).to_be_visible()
        assert page.input_value("#session-choice") == workbench.shelf.first
        # Another tab opens the same.
        second = watched.context.new_page()
        second.goto(page.url)
        second.wait_for_selector("main[data-view=fails] #bands")
        watched.close()


def test_a_session_that_is_not_there_is_told(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        watched.drawn("story")
        watched.page.goto(f"{watched.base}/?session=0123456789ab#fails")
        watched.drawn("fails")
        expect(watched.page.locator("#trouble")).to_contain_text("not on this workbench's list")
        watched.close()


def test_the_list_names_motor_date_and_state(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        choice = watched.page.locator("#session-choice")
        expect(choice.locator("option").first).to_have_text(re.compile(r"^motor · \d{4}-\d\d-\d\d \d\d:\d\d · diagnosed$"))
        make_session(fitted.parent / "later", motor="Later motor")
        expect(choice.locator("option").first).to_contain_text("Later motor")
        assert choice.input_value() == watched.page.evaluate("new URLSearchParams(location.search).get('session')")
        # Two of one motor, made within a minute, differ by their folders.
        make_session(fitted.parent / "once-more", motor="Later motor")
        expect(choice.locator("option")).to_have_count(3)
        expect(choice).not_to_contain_text("measuring")
        told = choice.locator("option").all_inner_texts()
        assert len(set(told)) == 3
        # A folder that vanishes is told where its curves are still seen; nothing is lost when it comes back.
        watched.see("story")
        away = fitted.rename(fitted.parent.parent / "away")
        expect(watched.page.locator("#trouble")).to_contain_text("The folder of this session is gone")
        away.rename(fitted)
        expect(choice.locator("option")).to_have_count(3)
        watched.page.click("#trouble button")
        watched.page.click("[data-effect='skin-effect']")
        expect(watched.page.locator(".ladder .step-name")).to_have_count(2)
        # A file that changed on disk too.
        file = next((fitted / "sweeps").glob("*.csv"))
        file.write_bytes(file.read_bytes() + b"1,2,3\n")
        expect(watched.page.locator("#trouble")).to_contain_text("changed")
        watched.trouble.clear()
        watched.close()


@pytest.mark.parametrize("view", ["story", "session", "fails", "inspect", "emission", "next"])
def test_every_view_follows_the_command_line(browser, fitted, view):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see(view)
        with opened(fitted) as store:
            add_to_session(store, "eddy-laminations")
        expect(page.locator("#stands")).to_contain_text("eddy-laminations")
        follows = {
            "session": "main table:has-text('corner_hz')",
            "story": ".ladder:has-text('eddy-laminations')",
            "inspect": "#element option:has-text('eddy')",
        }
        if view in follows:
            expect(page.locator(follows[view]).first).to_be_attached()
        with opened(fitted) as store:
            drop_from_session(store)
        expect(page.locator("#stands")).not_to_contain_text("eddy-laminations")
        watched.close()


def test_two_tabs_do_not_change_what_they_do_not_show(browser, fitted):
    """The first tab's click arrives at a ladder that another has just moved: nothing is done, and the tab shows what there is."""
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("story")
        # This tab does not hear of it in time.
        page.route("**/api/sessions/*/drop", lambda route: (change(), route.continue_()))

        def change() -> None:
            with opened(fitted) as store:
                add_to_session(store, "core-loss")

        page.click("[data-effect='eddy-laminations']")
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        page.click("#drop")
        expect(page.locator("#trouble")).to_contain_text("the ladder was changed since this page showed it")
        expect(page.locator(".ladder .step-name")).to_have_count(3)
        assert load(fitted).ladder[-1]["fit"]["effects"] == ["eddy-laminations", "core-loss"]
        watched.trouble.clear()
        watched.close()


def test_a_change_elsewhere_leaves_zoom_focus_and_signature(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("session")
        page.locator(".plots").first.focus()
        for key in ("ArrowRight", "a", "+"):
            page.keyboard.press(key)
        before = page.inner_text(".readout >> nth=0")
        assert "A " in before
        with opened(fitted) as store:
            add_to_session(store, "eddy-laminations")
        expect(page.locator("main")).to_contain_text("corner_hz")
        expect(page.locator(".plots").first).to_be_focused()
        assert page.inner_text(".readout >> nth=0").partition("A ")[2].split()[0] == before.partition("A ")[2].split()[0]
        watched.see("fails")
        page.fill("#tolerance", "12.5")
        with opened(fitted) as store:
            compare_session(store)
        page.wait_for_timeout(1500)
        expect(page.locator("#tolerance")).to_have_value("12.5")
        expect(page.locator("#tolerance")).to_be_focused()
        watched.close()


def test_a_workbench_that_is_gone_is_seen_and_its_return_too(browser, fitted):
    workbench = bench_of(fitted.parent, fitted)
    with served(workbench) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("story")
        page.focus("#next-step")
        port = int(address.split(":")[2].partition("/")[0])
    # "within 2 s": Playwright looks until then.
    expect(page.locator("#gone")).to_contain_text("does not answer", timeout=2000)
    expect(page.locator("#next-step")).to_be_disabled()
    expect(page.locator("[data-effect='eddy-laminations']")).to_be_disabled()
    with opened(fitted) as store:
        add_to_session(store, "eddy-laminations")
    with served(workbench, port):
        expect(page.locator("#gone")).to_be_hidden()
        expect(page.locator("#next-step")).to_be_enabled()
        expect(page.locator("#next-step")).to_be_focused()
        expect(page.locator("#stands")).to_contain_text("eddy-laminations")
        with opened(fitted) as store:
            drop_from_session(store)
        expect(page.locator("#stands")).not_to_contain_text("eddy-laminations")
        watched.trouble.clear()
        watched.close()


def test_a_workbench_that_hangs_is_seen(browser, tmp_path):
    """Its connections stay open, but nothing comes any more."""
    process = subprocess.Popen([MOTOREMI, "workbench", "--folder", tmp_path, "--json"], stdout=subprocess.PIPE, text=True)
    try:
        text = ""
        while not text.rstrip().endswith("}"):
            line = process.stdout.readline()
            assert line
            text += line
        watched = Watched(browser, json.loads(text)["address"])
        page = watched.page
        watched.see("bench")
        process.send_signal(signal.SIGSTOP)
        expect(page.locator("#gone")).to_be_visible(timeout=2000)
        expect(page.locator("#run")).to_be_disabled()
        process.send_signal(signal.SIGCONT)
        expect(page.locator("#gone")).to_be_hidden()
        expect(page.locator("#run")).to_be_enabled()
        watched.trouble.clear()
        watched.close()
    finally:
        process.kill()
        process.communicate()


def test_a_reload_in_the_middle_of_a_run_shows_the_run(browser, tmp_path):
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("bench")
        page.select_option("#bench-procedure", "fixture_check")
        page.fill("#bench-motor", "Reloaded 9")
        page.check("#bench-ask")
        page.click("#run")
        expect(page.locator("#prompt")).to_contain_text("Leave the fixture open")
        expect(page.locator("#session-choice option:checked")).to_contain_text(re.compile("Reloaded 9.*measuring"))
        page.reload()
        watched.see("bench")
        expect(page.locator("#prompt")).to_contain_text("Leave the fixture open")
        expect(page.locator("#run-log")).to_contain_text("analyser:")
        expect(page.locator("#bench-motor")).to_have_value("Reloaded 9")
        watched.see("session")
        expect(page.locator("#measuring")).to_be_visible()
        assert page.locator("button:text-is('Resume this run')").count() == 0
        watched.see("bench")
        page.click("#stop")
        expect(page.locator("#run-status")).to_contain_text("the instruments are safe")
        expect(page.locator("#session-choice option:checked")).to_contain_text("interrupted")
        watched.close()


# How many points of the first plot have the colour that curves of models have now.
COLOURED = """() => {
    const plot = document.querySelector("canvas"), { data } = plot.getContext("2d").getImageData(0, 0, plot.width, plot.height);
    const now = getComputedStyle(document.documentElement).getPropertyValue("--model").trim().slice(1).match(/../g).map((one) => parseInt(one, 16));
    let count = 0;
    for (let at = 0; at < data.length; at += 4) if (now.every((value, index) => data[at + index] === value)) count++;
    return count;
}"""


def test_plots_follow_a_machine_that_turns_dark_by_itself(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address, color_scheme="light")
        page = watched.page
        watched.see("session")
        assert page.evaluate(COLOURED) > 50
        page.emulate_media(color_scheme="dark")
        until(lambda: page.evaluate(COLOURED) > 50)
        # The browser complains of a test that reads what is drawn.
        watched.trouble.clear()
        watched.close()


def test_what_the_bench_asks_for_can_be_read_to_its_end(browser, tmp_path):
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address, viewport={"width": 390, "height": 844})
        page = watched.page
        watched.see("bench")
        page.select_option("#bench-procedure", "impedance_only")
        page.check("#bench-ask")
        page.click("#run")
        for expected in ("Leave the fixture open", "Connect", "Connect"):
            expect(page.locator(".prompt p")).to_contain_text(expected)
            assert page.eval_on_selector(".prompt p", "(one) => one.scrollWidth <= one.clientWidth")
            # The drawing keeps its lines.
            assert page.inner_text(".prompt pre").strip()
            assert page.eval_on_selector(".prompt pre", "(one) => getComputedStyle(one).whiteSpace === 'pre' && one.scrollWidth <= one.clientWidth")
            # One run at a time.
            expect(page.locator("#run")).to_be_disabled()
            before = page.inner_text(".prompt p")
            page.click("#connected")
            expect(page.locator(".prompt p")).not_to_have_text(before)
        page.click("#stop")
        expect(page.locator("#run-status")).to_contain_text("safe")
        expect(page.locator("#run")).to_be_enabled()
        watched.close()


def test_a_change_that_the_page_did_not_see_begin_is_told_as_what_it_is(browser, tmp_path):
    """A fit that this page began before it was loaded again, for example: it cannot know whose work it is."""
    session = make_session(tmp_path / "s")
    with served(bench_of(tmp_path, session)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.drawn("story")
        expect(page.locator("#outcome")).to_have_text("no model yet")
        with opened(session) as store:
            fit_session(store)
        expect(page.locator("#outcome")).to_have_text(re.compile(r"^error [0-9.]+\s%$"))
        with opened(session) as store:
            add_to_session(store, "lead-inductance")
        expect(page.locator("#outcome")).to_have_text(re.compile(r"^The ladder has changed: 1 → 2 steps, error [0-9.]+\s% → [0-9.]+\s%$"))
        watched.close()
