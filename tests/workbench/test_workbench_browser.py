"""The workbench in a real browser: the whole story by clicks and by keys, a narrow window, hostile names; nothing leaves the machine.

With MOTOREMI_SCREENSHOTS=DIR the story leaves a picture of each view there (`make screenshots`).
"""

from __future__ import annotations

import csv
import re
from pathlib import Path
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect
from workbench_browser import PATIENCE_MS, VIEWS, Watched, keep, needs_chromium
from workbench_tools import ATTACKS, bench_of, make_session, measuring_only, served, until

from motoremi.data.session import SessionWriter, load, reopen
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.workbench import routes
from motoremi.workbench.desk import Desk
from motoremi.workflow import opened
from motoremi.workflow_emission import predict_session

pytestmark = [needs_chromium, pytest.mark.slow, pytest.mark.usefixtures("few_effects", "few_source_effects")]
# What the page itself never makes.
FOREIGN = "main :is(img, iframe, script, b, object, [onmouseover], [onerror], a[href^=javascript]), body > script"

# Seed of a challenge.
HIDES_NOTHING = 3


def percents(text: str) -> list[float]:
    """The percentages in a text."""
    return [float(word) for word in text.replace("%", " ").replace("→", " ").split() if word.replace(".", "").isdigit()]


def test_the_story_by_clicks(browser, tmp_path, monkeypatch):
    # The sealed motor is drawn by chance, and the diagnosis of some takes minutes beside other tests; this one hides nothing.
    monkeypatch.setattr(routes.secrets, "randbelow", lambda limit: HIDES_NOTHING)
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("bench")
        assert "token" not in page.url
        page.fill("#bench-motor", "Story motor 7")
        page.fill("#bench-operator", "A. Engineer")
        page.fill("#bench-seed", "7")
        page.select_option("#bench-hides", "eddy-laminations")
        page.click("#look")
        expect(page.locator("#found")).to_contain_text("4294A")
        page.click("#run")
        expect(page.locator("#run-log")).to_contain_text("short sweep: 401 points", timeout=PATIENCE_MS)
        page.wait_for_selector("#show-session", timeout=PATIENCE_MS)
        # Simulated sweeps come faster than they are drawn: the last one is seen for certain.
        expect(page.locator("#arriving")).to_contain_text("average motor running spectrum")
        expect(page.locator("#run-status")).to_have_text("the run is complete")
        assert page.locator(".plots canvas").count() == 1
        keep(page, "bench")

        page.click("#show-session")
        watched.drawn("story")
        watched.see("session")
        expect(page.locator("main")).to_contain_text("Story motor 7")
        assert page.locator(".plots canvas").count() == 6
        keep(page, "session")

        watched.see("fails")
        page.click("#where tbody tr >> nth=0")
        assert page.locator("#bands .bad").count() > 0
        keep(page, "fails")

        watched.see("story")
        expect(page.locator("#verdict")).to_contain_text("eddy-laminations")
        page.hover("[data-effect='eddy-laminations']")
        expect(page.locator("#signature-of")).to_have_text("eddy-laminations")
        page.click("[data-effect='eddy-laminations']")
        page.wait_for_selector("#outcome:has-text('→')")
        before, after = percents(page.inner_text("#outcome"))
        assert after < before / 10
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        expect(page.locator("#stands")).to_contain_text("eddy-laminations")
        keep(page, "story")
        page.click("#drop")
        expect(page.locator(".ladder .step-name")).to_have_count(1)
        assert percents(page.inner_text("#outcome"))[::-1] == [before, after]

        watched.see("inspect")
        expect(page.locator("main")).to_contain_text("La as the short-circuit sweep requires it")
        assert "\\x" not in page.inner_text("main")
        keep(page, "inspect")

        watched.see("story")
        page.click("[data-effect='eddy-laminations']")
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        watched.see("next")
        assert page.inner_text("#next-id")
        keep(page, "next")
        watched.see("emission")
        assert page.locator(".plots canvas").count() == 2
        page.click("#predict")
        expect(page.locator("#limit-verdict")).to_have_text(re.compile("PASS|MARGINAL|FAIL"))
        expect(page.locator("figcaption").first).to_contain_text("predicted")
        # Told apart without colour: only the limit is dashed.
        assert page.locator(".legend:text-is('predicted') line").first.get_attribute("stroke-dasharray") == ""
        assert page.locator(".legend:has-text('limit') line").first.get_attribute("stroke-dasharray") != ""
        keep(page, "emission")

        watched.see("report")
        with page.expect_response(lambda answer: answer.request.method == "POST" and answer.url.endswith("/report"), timeout=PATIENCE_MS):
            page.click("#write-report")
        expect(page.locator("main:not([aria-busy]) #report-files a").first).to_be_visible()
        with page.expect_download() as download:
            page.click("#report-files a:text-is('report.html')")
        text = Path(download.value.path()).read_text()
        assert "Story motor 7" in text
        assert "eddy-laminations" in text
        keep(page, "report")

        watched.see("challenge")
        page.click("#new-challenge")
        page.wait_for_selector("#say-adequate")
        # Beside long names on a phone, too.
        page.set_viewport_size({"width": 390, "height": 844})
        assert min(page.locator(".choices input").evaluate_all("(all) => all.map((one) => one.offsetWidth)")) > 10
        page.set_viewport_size({"width": 1280, "height": 800})
        keep(page, "challenge")
        page.click("#say-adequate")
        page.wait_for_selector("#score")
        expect(page.locator("#score")).to_contain_text("the tool")
        expect(page.locator("#hidden")).to_have_text("nothing was hidden")
        keep(page, "challenge-answered")
        watched.close()
    stories = [path for path in tmp_path.iterdir() if path.name.startswith("motoremi-run")]
    assert load(stories[0]).ladder[-1]["fit"]["effects"] == ["eddy-laminations"]


def test_the_story_by_keys(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address, color_scheme="dark")
        page = watched.page
        watched.drawn("story")
        page.keyboard.press("3")
        watched.drawn("session")
        page.keyboard.press("u")
        expect(page.locator("#units")).to_have_value("decibel")
        page.locator(".plots").first.focus()
        for key in ("ArrowRight", "a", "Shift+ArrowRight", "b"):
            page.keyboard.press(key)
        expect(page.locator(".readout").first).to_contain_text(re.compile("B - A: .*, ratio .*; measured .Z. "))
        expect(page.locator(".beside-cursor:visible")).to_contain_text("measured |Z|")
        expect(page.locator(".beside-cursor:visible")).to_have_count(1)
        spans = [page.evaluate("document.querySelector('.readout').textContent")]
        page.keyboard.press("+")
        # All plots of the view show the same span, and what is shown is what is saved.
        expect(page.locator(".tools")).to_have_count(2)
        for group in (0, 1):
            rows = saved_table(page, group)
            shown = [float(row["frequency_hz"]) for row in rows]
            assert 200e3 < min(shown) < max(shown) < 20e6, group
            assert {"measured |Z|", "model |Z|", "error", "uncertainty"} <= {row["curve"] for row in rows}
        with page.expect_download() as download:
            page.click(".tools >> nth=0 >> text=Save picture")
        assert download.value.suggested_filename == "fitted-session.png"
        with Image.open(download.value.path()) as picture:
            assert picture.width > 300
            assert len(picture.convert("RGB").getcolors(1 << 20)) > 20
        page.locator(".plots").first.focus()
        page.keyboard.press("0")
        assert spans[0].startswith(("1", "2", "3", "4", "5", "6", "7", "8", "9"))
        keep(page, "session-dark")

        page.keyboard.press("2")
        watched.drawn("story")
        page.keyboard.press("ArrowDown")
        expect(page.locator("button.effect").first).to_be_focused()
        expect(page.locator("#signature-of")).to_have_text("eddy-laminations")
        page.keyboard.press("Enter")
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        expect(page.locator("button.effect").first).to_be_focused()
        page.keyboard.press("d")
        expect(page.locator(".ladder .step-name")).to_have_count(1)

        page.keyboard.press("4")
        watched.drawn("fails")
        page.locator("#where tbody tr").first.focus()
        page.keyboard.press("Enter")
        page.keyboard.press("t")
        assert page.evaluate("document.documentElement.dataset.theme") == "light"
        page.keyboard.press("?")
        expect(page.locator("#keys")).to_be_visible()
        page.keyboard.press("Escape")
        expect(page.locator("#keys")).to_be_hidden()
        page.locator("dfn[data-term='rms error']").first.focus()
        # A pointer that crosses other elements does not hide the explanation of the focused term.
        page.mouse.move(300, 5)
        page.mouse.move(5, 300)
        expect(page.locator("#tip")).to_be_visible()
        expect(page.locator("#tip")).to_contain_text("all points")
        page.keyboard.press("Escape")
        expect(page.locator("#tip")).to_be_hidden()
        watched.close()


def saved_table(page: Page, group: int) -> list[dict[str, str]]:
    """What a group of plots saves as data."""
    with page.expect_download() as download:
        page.click(f".tools >> nth={group} >> text=Save data")
    with Path(download.value.path()).open(newline="") as file:
        return list(csv.DictReader(file))


def test_zooming_in_brings_the_points_that_were_left_out(browser, tmp_path):
    frequency = np.geomspace(1e5, 3e7, 10_001)
    with SessionWriter.create(tmp_path / "long", {"title": "long", "motor": "=M"}) as writer:
        for termination in ("short", "open"):
            writer.add_sweep(ImpedanceSweep(termination, frequency, 50 + 2j * np.pi * frequency * 1e-6))
        writer.close("done")
    with served(bench_of(tmp_path, tmp_path / "long")) as address:
        watched = Watched(browser, address, viewport={"width": 1440, "height": 900})
        page = watched.page
        for view, asked in (("story", "/panels?"), ("session", "/curves?")):
            watched.see(view)
            # On a busy machine the page asks between two of the keys as well; the last answer is of the sixteenth part.
            with page.expect_response(lambda answer, asked=asked: asked in answer.url and asked_for(answer.url, frequency) < 700) as told:
                page.locator(".plots").first.focus()
                for _ in range(4):
                    page.keyboard.press("+")
            there = asked_for(told.value.url, frequency)
            assert there > 500
            rows: list[dict[str, str]] = []
            until(lambda rows=rows, there=there: rows.extend(saved_table(page, 0)) or count_of(rows) == there or rows.clear())
        watched.close()


def asked_for(url: str, frequency: np.ndarray) -> int:
    """Points within the span that a request names; all without one."""
    span = parse_qs(urlparse(url).query)
    low, high = (float(span[name][0]) if name in span else far for name, far in (("low", 0.0), ("high", np.inf)))
    return int(np.count_nonzero((frequency >= low) & (frequency <= high)))


def count_of(rows: list[dict[str, str]]) -> int:
    """Points of the first curve."""
    return sum(row["curve"] == rows[0]["curve"] and row["plot"] == rows[0]["plot"] for row in rows)


# Values that are broken over two lines.
BROKEN = """() => [...document.querySelectorAll('td.brief')].filter((cell) => {
  const range = document.createRange();
  range.selectNodeContents(cell);
  return new Set([...range.getClientRects()].map((box) => Math.round(box.top / 4))).size > 1;
}).map((cell) => cell.textContent)"""


def test_a_narrow_window(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address, viewport={"width": 360, "height": 700})
        for view in VIEWS:
            watched.see(view)
            assert watched.page.evaluate("document.documentElement.scrollWidth") <= 360, view
            assert watched.page.evaluate(BROKEN) == [], view
            assert watched.page.locator("#session-choice").bounding_box()["width"] > 200, view
            if view == "fails":
                verdict = watched.page.locator("#bands tbody tr >> nth=0").locator("td >> nth=2").bounding_box()
                assert verdict["x"] + verdict["width"] <= 360
            if view == "story":
                keep(watched.page, "narrow")
        watched.close()


def test_errors_are_sentences_on_the_page(browser, fitted):
    with served(bench_of(fitted.parent, fitted)) as address:
        watched = Watched(browser, address)
        watched.see("story")
        with reopen(fitted):
            watched.page.click("[data-effect='core-loss']")
            expect(watched.page.locator("#trouble")).to_contain_text("another process")
        # A refusal is what the browser itself calls an error.
        assert all("400" in line for line in watched.trouble)
        watched.trouble.clear()
        watched.page.click("#trouble button")
        expect(watched.page.locator("#trouble")).to_be_hidden()
        watched.close()


def hostile(folder: Path, attack: str) -> Path:
    """A session in which everything that a file or an instrument can say is an attack."""
    make_session(folder, motor=attack, title=attack, operator=attack)
    desk = Desk(folder)
    desk.fit()
    effect = {
        "effect": attack,
        "family": attack,
        "probability": 1.0,
        "chi2_reduced": 1.0,
        "rms_error_percent": 1.0,
        "delta_bic": 0.0,
        "plausible": False,
    }
    fit = {"effects": [attack], "chi2_reduced": 1.0, "rms_error_percent": 1.0, "rms_error_db": 1.0}
    with reopen(folder) as writer:
        identity = dict.fromkeys(("vendor", "model", "serial", "firmware"), attack)
        writer.emit("instrument", role=attack, driver=attack, resource=attack, identity=identity, settings={})
        writer.add_spectrum(Spectrum("average", [1e6, 2e6], [1.0, 2.0], metadata={"condition": attack}))
        writer.save_analysis(
            "diagnosis",
            {
                "verdict": attack, "effects": [attack], "families": [[attack, attack]], "confidence": 0.5, "base": fit, "best": fit,
                "reasons": [attack], "caveats": [attack], "where": [],
                "next_measurement": {"id": attack, "why": attack, "menu": [{"id": attack, "action": attack, "separates": 1, "ratio": 1}]},
                "candidates": [{**effect, "parameters": {attack: {"value": 1.0, "sigma": None, "at_bound": False, "unit": attack}}}],
            },
        )  # fmt: skip
        writer.close("done")
    with opened(folder) as store:
        told = predict_session(store).to_dict()
        told["remarks"], told["judged_what"], told["predicted_dbuv"][attack] = [attack], attack, told["predicted_dbuv"]["peak"]
        told["limit"]["title"] = told["judged"][0]["why"] = told["judged"][0]["conductor"] = attack
        told["reasons"] = [attack]
        store.save_analysis("prediction", told)
    return folder


def test_hostile_names_are_text(browser, tmp_path):
    attack = " ".join(ATTACKS)
    folder = hostile(tmp_path / "hostile", attack)
    with served(bench_of(tmp_path, folder)) as address:
        watched = Watched(browser, address)
        page = watched.page
        for view in VIEWS:
            watched.see(view)
            # The effect that is no effect is asked about, and refused in a sentence.
            assert page.evaluate("window.hacked") is None, view
            assert page.locator(FOREIGN).count() == 0, view
            if view in ("story", "session", "next", "emission"):
                assert ATTACKS[0] in page.inner_text("main"), view
                assert "\u202e" not in page.inner_text("main"), view
        watched.see("story")
        page.locator("button.effect").first.hover()
        page.locator("button.effect").first.click()
        expect(page.locator("#trouble")).to_contain_text("is not an effect")
        watched.see("report")
        page.click("#write-report")
        page.wait_for_selector("#report-files a")
        page.goto(watched.base + page.get_attribute("#report-files a[target]", "href"))
        assert ATTACKS[0] in page.inner_text("body")
        assert page.locator("script, img, iframe, b >> text=bold").count() == 0
        # On a telephone a box is read in words, not letter by letter; at night the page is dark.
        page.set_viewport_size({"width": 390, "height": 844})
        page.emulate_media(color_scheme="dark")
        assert min(page.locator(".box td").evaluate_all("(all) => all.map((one) => one.clientWidth)")) > 130
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 27)"
        assert page.evaluate("window.hacked") is None
        assert all("400" in line for line in watched.trouble), watched.trouble
        watched.trouble.clear()
        watched.close()


def test_a_hostile_motor_in_a_run_of_this_page(browser, tmp_path, monkeypatch):
    monkeypatch.setattr("motoremi.workbench.bench_view.load_procedure", measuring_only)
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address)
        page = watched.page
        watched.see("bench")
        page.select_option("#bench-procedure", "impedance_only")
        page.fill("#bench-motor", ATTACKS[1])
        page.check("#bench-ask")
        page.click("#run")
        expect(page.locator("#prompt")).to_contain_text("Leave the fixture open")
        # A page that comes in the middle sees the same; closing it stops nothing.
        late = Watched(browser, address)
        late.see("bench")
        expect(late.page.locator("#prompt")).to_contain_text("Leave the fixture open")
        expect(late.page.locator("#run-log")).to_contain_text("analyser:")
        late.close()
        page.click("#connected")
        expect(page.locator("#prompt")).to_contain_text("short standard")
        assert "\n" in page.inner_text("#prompt pre")
        assert "\\x" not in page.inner_text("#prompt pre")
        keep(page, "bench-prompt")
        page.click("#stop")
        expect(page.locator("#run-status")).to_contain_text("the instruments are safe")
        page.click("#show-session")
        watched.drawn("story")
        watched.see("session")
        expect(page.locator("main")).to_contain_text(ATTACKS[1])
        expect(page.locator("main")).to_contain_text("Resume this run")
        # What comes next is the rest of the run.
        watched.see("story")
        expect(page.locator("#next-step")).to_have_text("Resume the run")
        page.click("#next-step")
        watched.drawn("bench")
        page.uncheck("#bench-ask")
        page.click("#resume")
        expect(page.locator("#run-status")).to_have_text("the run is complete", timeout=PATIENCE_MS)
        page.click("#show-session")
        watched.drawn("story")
        expect(page.locator("#next-step")).not_to_have_text("Resume the run")
        watched.close()
