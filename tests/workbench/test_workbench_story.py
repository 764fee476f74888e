"""The story on one screen, of sweeps and of spectra: its gestures are the commands; what comes next; both by clicks, and by keys alone."""

from __future__ import annotations

import re
import shutil
from itertools import pairwise
from pathlib import Path

import pypdfium2
import pytest
from conftest import simulated_sweeps
from laboratory_cases import PROFILE, SVG
from playwright.sync_api import Page, Response, expect
from workbench_browser import PATIENCE_MS, Watched, choose_by_keys, drop, findings, keep, needs_chromium
from workbench_tools import bench_of, client_of, make_fitted_session, served

from motoremi.data.session import SessionWriter, load, reopen, verify
from motoremi.data.spectrum import Spectrum
from motoremi.emission.setup import scan_frequencies
from motoremi.interrupts import Cancelled
from motoremi.simulate.emission_in_time import Stand, measure
from motoremi.workbench.desk import Desk
from motoremi.workbench.events import Events
from motoremi.workbench.jobs import Jobs
from motoremi.workflow import drop_from_session, opened
from motoremi.workflow_emission import add_source_effects, drop_source_effect, emission_steps, stored_emission_steps

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("few_effects", "few_source_effects")]

DESKTOP, SMALL, PHONE = {"width": 1440, "height": 900}, {"width": 1024, "height": 768}, {"width": 390, "height": 844}
# What a laboratory's engineer chooses on the view Report.
LABORATORY = [
    {"name": "lab.toml", "mimeType": "application/toml", "buffer": ('logo = "logo.svg"\n' + PROFILE).encode()},
    {"name": "logo.svg", "mimeType": "image/svg+xml", "buffer": SVG.encode()},
]
# A motor for the sweeps, the stand of its spectra.
MOTOR, STAND = 7, 1004


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Path:
    """Sweeps of a motor with eddy currents, and spectra of one whose brushes arc: nothing is fitted yet."""
    folder = tmp_path_factory.mktemp("story") / "measured"
    sweeps, motor = simulated_sweeps(MOTOR, ("eddy-laminations",))
    frequency_hz = scan_frequencies()[::8]
    read = measure(motor, Stand.random(STAND, ("arc-breakdown",)), frequency_hz, STAND, quasi_peak=False)
    with SessionWriter.create(folder, {"title": "story", "motor": "Story motor 7", "analyser": "4294a"}) as writer:
        for sweep in sweeps:
            writer.add_sweep(sweep)
        for detector in ("peak", "average"):
            writer.add_spectrum(Spectrum(detector, frequency_hz, read.level(detector)))
        writer.close("done")
    return folder


@pytest.fixture(scope="module")
def fitted(measured) -> Path:
    """The same, motor and source fitted."""
    folder = measured.parent / "fitted"
    shutil.copytree(measured, folder)
    desk = Desk(folder)
    desk.fit()
    desk.source.fit()
    return folder


@pytest.fixture
def copied(fitted, tmp_path) -> Path:
    shutil.copytree(fitted, tmp_path / "story")
    return tmp_path / "story"


@pytest.fixture
def at(copied):
    """Asks for something of the one session; with a body it is a change."""
    workbench = bench_of(copied.parent, copied)
    client, base = client_of(workbench), f"/api/sessions/{workbench.shelf.first}"

    def ask(path, **body):
        return (client.post(base + path, json=body) if body else client.get(base + path)).json()

    return ask


def test_adding_a_source_effect_is_what_the_command_does(at, copied):
    before = at("/story?of=emission")
    assert [panel["name"] for panel in before["panels"]] == ["peak", "average"]
    drawn = at("/look?of=emission&effect=arc-breakdown")
    told = at("/add", of="emission", effect="arc-breakdown", standing=before["standing"])
    assert told["before"]["error"] > 5
    assert told["after"]["error"] < 1
    assert drawn["after"] == told["after"]
    stored = stored_emission_steps(load(copied))
    # The model that was pointed at is the one that stands now.
    frames = at("/story?of=emission")["panels"][0]["frames"]
    assert [frame["series"][at_]["values"] for frame, at_ in zip(frames, (1, 0), strict=True)] == drawn["panels"][0]
    assert at("/drop", of="emission")["after"]["effects"] == []
    with opened(copied) as store:
        add_source_effects(store, ["arc-breakdown"])
    by_command = stored_emission_steps(load(copied))
    assert by_command[-1]["parameters"] == pytest.approx(stored[-1]["parameters"], rel=1e-6)
    assert at("/story?of=emission")["in_model"] == ["arc-breakdown"]
    assert "in the model already" in at("/add", of="emission", effect="arc-breakdown")["error"]
    assert not verify(copied)


def test_a_fit_of_the_spectra_tells_how_far_it_is_and_can_be_cancelled(copied):
    desk, jobs, shares, before = Desk(copied), Jobs(Events()), [], stored_emission_steps(load(copied))

    def tell(doing: str, done: int, total: int) -> None:
        shares.append(done / total)
        if len(shares) == 6:
            jobs.cancel("s")

    with jobs.begin("s", "fitting"), pytest.raises(Cancelled):
        desk.source.fit(progress=tell)
    assert len(shares) == 6
    assert shares == sorted(set(shares))
    assert 0 <= shares[0] < shares[-1] < 1
    assert stored_emission_steps(load(copied)) == before


def test_the_ladder_is_a_history(at, copied):
    """Several steps back and forth at once; what does not exist is a sentence."""
    added = [at("/add", effect=effect)["after"]["error"] for effect in ("eddy-laminations", "core-loss")]
    assert at("/drop", count=2)["after"]["effects"] == []
    told = at("/story")
    assert [one["added"] for one in told["dropped"]] == ["eddy-laminations", "core-loss"]
    assert [one["error"] for one in told["dropped"]] == added
    for path, count, says in (("/redo", 3, "fewer steps were dropped"), ("/redo", True, "whole number"), ("/drop", 1, "no effect to drop")):
        assert says in at(path, count=count)["error"]
    assert at("/redo", count=1)["after"]["effects"] == ["eddy-laminations"]
    assert at("/redo", count=1)["after"]["effects"] == ["eddy-laminations", "core-loss"]
    assert "fewer steps" in at("/drop", count=3)["error"]
    assert at("/drop", count=1)["after"]["error"] == added[0]
    assert load(copied).ladder[-1]["fit"]["effects"] == ["eddy-laminations"]


@pytest.mark.parametrize(("of", "effect"), [("impedance", "eddy-laminations"), ("emission", "arc-breakdown")])
def test_what_is_dropped_can_be_put_back(at, copied, of, effect):
    story = f"/story?of={of}"
    assert "nothing was dropped" in at("/redo", of=of)["error"]
    assert "no effect to drop" in at("/drop", of=of)["error"]
    added = at("/add", of=of, effect=effect)
    standing = at(story)["standing"]
    assert at("/drop", of=of)["after"] == added["before"]
    assert [one["added"] for one in at(story)["dropped"]] == [effect]
    assert at("/redo", of=of)["after"]["error"] == pytest.approx(added["after"]["error"], rel=1e-9)
    assert (at(story)["standing"], at(story)["dropped"]) == (standing, [])
    # What somebody else does in between is not undone by it.
    at("/drop", of=of)
    other = "core-loss" if of == "impedance" else "lisn-deviation"
    at("/add", of=of, effect=other)
    assert at(story)["dropped"] == []
    assert at(story)["in_model"] == [other]


def test_a_ladder_of_the_spectra_that_moved_is_left_alone(at, copied):
    shown = at("/story?of=emission")["standing"]
    with opened(copied) as store:
        add_source_effects(store, ["lisn-deviation"])
    for path, body in (("/add", {"effect": "arc-breakdown"}), ("/drop", {}), ("/fit", {}), ("/diagnose", {})):
        told = at(path, of="emission", standing=shown, **body)
        assert "the current model is now source and motor alone + lisn-deviation" in told["error"], path
    assert at("/story?of=emission")["in_model"] == ["lisn-deviation"]
    with opened(copied) as store:
        drop_source_effect(store)
    assert at("/story?of=emission")["standing"] == shown


def test_another_model_of_the_motor_is_another_ladder_of_the_spectra(at, copied):
    before = at("/story?of=emission")
    at("/add", of="impedance", effect="eddy-laminations")
    after = at("/story?of=emission")
    assert after["standing"] != before["standing"]
    assert after["ladder"][0]["error"] != before["ladder"][0]["error"]
    with opened(copied) as store:
        assert emission_steps(store)[0].rms_error_db == pytest.approx(after["ladder"][0]["error"])
        drop_from_session(store)


def test_what_comes_next_leads_to_the_report(measured, tmp_path):
    shutil.copytree(measured, tmp_path / "s")
    workbench = bench_of(tmp_path, tmp_path / "s")
    client, base = client_of(workbench), f"/api/sessions/{workbench.shelf.first}"
    of, done = "impedance", []
    for _ in range(12):
        told = client.get(f"{base}/story?of={of}").json()
        coming = told["next"]
        done.append(coming["do"])
        if coming["do"] == "go":
            break
        if coming["do"] == "turn":
            of = "emission"
            continue
        answer = client.post(f"{base}/{coming['do']}", json={"of": of, "standing": told["standing"], "effect": coming.get("effect", "")})
        assert answer.status_code == 200, answer.text
    assert done == ["fit", "diagnose", "add", "turn", "fit", "diagnose", "add", "predict", "report", "go"]
    assert all(stage["done"] for stage in told["stages"])
    assert told["sides"] == ["impedance", "emission"]
    session = load(tmp_path / "s")
    assert session.ladder[-1]["fit"]["effects"] == ["eddy-laminations"]
    assert session.analysis("prediction")["effects"] == ["arc-breakdown"]
    # Another effect on top is another model: it has to be asked again.
    client.post(f"{base}/add", json={"effect": "core-loss"})
    assert client.get(f"{base}/story").json()["next"]["do"] == "diagnose"
    client.post(f"{base}/drop", json={})
    assert client.get(f"{base}/story").json()["next"]["do"] == "report"


@needs_chromium
def test_spectra_alone_are_judged_and_reported_by_clicks(browser, tmp_path):
    """Without sweeps there is no model; the verdict on the levels is that of `motoremi predict`."""
    level = 70.0 + 0 * scan_frequencies()[::100]
    for name, kept in (("s", lambda writer: writer.add_spectrum(Spectrum("average", scan_frequencies()[::100], level))), ("nothing", id)):
        with SessionWriter.create(tmp_path / name, {"title": "x", "motor": name}) as writer:
            kept(writer)
            writer.close("done")
    workbench = bench_of(tmp_path, tmp_path / "nothing", tmp_path / "s")
    with served(workbench) as address:
        watched = Watched(browser, address, viewport=PHONE)
        page = watched.page
        watched.drawn("story")
        # What was chosen for another session leads to no empty screen.
        page.evaluate("sessionStorage.setItem('motoremi-story', 'impedance')")
        page.reload()
        watched.drawn("story")
        expect(page.locator("#story-curves canvas")).to_have_count(1)
        expect(page.locator("#story-stages .title")).to_have_text(["Measured", "Judged", "Report"])
        expect(page.locator("#story-steps")).to_contain_text("needs the motor's open-circuit sweep")
        assert findings(page) == []
        page.click("#next-step:text-is('Judge against the limit')")
        expect(page.locator("#next-step")).to_have_text("Write the report")
        watched.see("emission")
        expect(page.locator("#limit-verdict")).to_have_text("FAIL")
        page.select_option("#limit", index=1)
        page.click("#predict:text-is('Judge against the limit')")
        expect(page.locator("#limit-verdict")).to_be_visible()
        watched.see("story")
        page.click("#next-step")
        expect(page.locator("#next-step")).to_have_text("Open the report", timeout=PATIENCE_MS)
        page.select_option("#session-choice", workbench.shelf.place(tmp_path / "nothing"))
        expect(page.locator("#next-step")).to_have_text("Measure on the bench")
        watched.close()
    assert load(tmp_path / "s").analysis("prediction")["judged_what"] == "measured"
    assert "average" in pdf_of(tmp_path / "s")


@pytest.mark.parametrize("steps", [[1], [{"effects": ["arc-breakdown"]}], "x"])
def test_a_stored_model_of_others_is_told_not_obeyed(at, copied, steps):
    with reopen(copied) as writer:
        writer.save_analysis("emission", {"setup": None, "limit": "x", "steps": steps})
        writer.close("done")
    assert "cannot be read" in at("/story?of=emission")["error"]
    assert "error" not in at("/story?of=impedance")


def in_view(page: Page, *selectors: str) -> None:
    """Each of these stands in the window as it is, and is not covered; nothing is wider than the window."""
    size = page.viewport_size
    for selector in selectors:
        box = page.locator(selector).first.bounding_box()
        assert box is not None, selector
        assert box["x"] >= 0, selector
        assert box["y"] >= 0, selector
        assert box["x"] + box["width"] <= size["width"], selector
        assert box["y"] + box["height"] <= size["height"], selector
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]


def pdf_of(session: Path) -> str:
    """The text of the written report."""
    with pypdfium2.PdfDocument(session / "report" / "report.pdf") as document:
        return "\n".join(page.get_textpage().get_text_bounded() for page in document)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory) -> Path:
    return make_fitted_session(tmp_path_factory.mktemp("diagnosed") / "s")


@needs_chromium
@pytest.mark.parametrize(("size", "scheme"), [(DESKTOP, "light"), (SMALL, "dark"), (PHONE, "light"), (PHONE, "dark")])
def test_curve_error_and_effect_are_in_view_wherever_one_points(browser, diagnosed, size, scheme):
    with served(bench_of(diagnosed.parent, diagnosed)) as address:
        watched = Watched(browser, address, viewport=size, color_scheme=scheme)
        page = watched.page
        watched.drawn("story")
        last = page.locator("button.effect").last
        last.scroll_into_view_if_needed()
        last.hover()
        name = last.inner_text()
        expect(page.locator("#signature-of")).to_have_text(name)
        expect(page.locator("#story-hint")).to_contain_text("→")
        in_view(
            page,
            "#story-curves canvas",
            "#story-curves figure:nth-child(3) canvas",
            "#outcome",
            "#story-hint",
            ".ladder",
            "#next-step",
            f"[data-effect='{name}']",
        )
        assert page.evaluate("document.scrollingElement.scrollTop") == 0
        assert findings(page) == []
        watched.close()


@needs_chromium
def test_a_finger_points_with_its_first_tap(browser, diagnosed, tmp_path):
    shutil.copytree(diagnosed, tmp_path / "s")
    with served(bench_of(tmp_path, tmp_path / "s")) as address:
        watched = Watched(browser, address, viewport=PHONE, has_touch=True)
        page = watched.page
        watched.drawn("story")
        page.tap("[data-effect='skin-effect']")
        expect(page.locator("#signature-of")).to_have_text("skin-effect")
        expect(page.locator("#story-hint")).to_contain_text("→")
        assert load(tmp_path / "s").ladder[-1]["fit"]["effects"] == []
        page.tap("[data-effect='skin-effect']")
        page.wait_for_selector("#outcome:has-text('→')")
        in_view(page, "#story-curves canvas", "#outcome", "#story-steps")
        assert findings(page) == []
        page.tap("#panel-1")
        expect(page.locator("#story-curves figure:visible")).to_have_count(2)
        expect(page.locator("#story-curves figure:visible").first).to_contain_text("open-circuit sweep")
        page.tap("#redo", force=True)
        page.tap("#drop")
        expect(page.locator(".ladder .step-name")).to_have_count(1)
        page.tap("#redo")
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        # A step of the ladder is gone back to by a tap on it; rows do not run into each other.
        page.tap(".ladder button.step-name")
        expect(page.locator(".ladder .dropped-name")).to_have_text(["+ skin-effect"])
        rows = [row.bounding_box() for row in page.locator(".ladder :is(li, p)").all()]
        assert all(upper["y"] + upper["height"] <= lower["y"] + 1 for upper, lower in pairwise(rows))
        assert findings(page) == []
        # What comes next stands where the thumb is, error and ladder in view above it.
        in_view(page, "#story-curves figure:visible canvas", "#outcome", "#story-steps", "#story-list", "#next-step")
        assert page.locator("#next-step").bounding_box()["y"] > 0.85 * PHONE["height"]
        page.tap("#next-step:text-is('Add eddy-laminations')")
        expect(page.locator("#next-step")).to_have_text("Go on to the spectra")
        expect(page.locator("#outcome")).to_contain_text("→")
        watched.close()


def files_of(session: Path) -> dict[str, bytes]:
    """The sweeps and spectra of a session as files that somebody saved."""
    return {path.name: path.read_bytes() for folder in ("sweeps", "spectra") for path in sorted((session / folder).glob("*.csv"))}


@needs_chromium
def test_both_stories_by_clicks_from_dropped_files(browser, measured, tmp_path):
    clicks = 0
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address, viewport=DESKTOP)
        page = watched.page
        watched.drawn("files")
        drop(page, files_of(measured))
        expect(page.locator("#files-read tbody tr")).to_have_count(len(files_of(measured)))
        page.fill("#import-motor", "s")
        page.select_option("#import-analyser", "4294a")
        page.click("#make-session")
        watched.drawn("story")

        def on(text: str, becomes: str) -> None:
            nonlocal clicks
            expect(page.locator("#next-step")).to_have_text(text)
            expect(page.locator("button.main:visible")).to_have_count(1)
            page.click("#next-step")
            clicks += 1
            expect(page.locator("#next-step")).to_have_text(becomes, timeout=PATIENCE_MS)

        on("Fit the paper's circuit", "Find what is missing")
        assert page.locator("#story-curves canvas").count() == 6
        on("Find what is missing", "Add eddy-laminations")
        expect(page.locator("#signature-of")).to_have_text("eddy-laminations")
        on("Add eddy-laminations", "Go on to the spectra")
        before, after = fell(page, "%")
        assert after < before / 10
        on("Go on to the spectra", "Fit source and path")
        on("Fit source and path", "Find what is missing")
        assert page.locator("#story-curves canvas").count() == 4
        on("Find what is missing", "Add arc-breakdown")
        page.hover("[data-effect='lisn-deviation']")
        expect(page.locator("#signature-of")).to_have_text("lisn-deviation")
        on("Add arc-breakdown", "Judge against the limit")
        before, after = fell(page, "dB")
        assert before > 5
        assert after < 1
        expect(page.locator(".ladder .step-name")).to_have_text(["source and motor alone", "+ arc-breakdown"])
        page.click("#drop")
        expect(page.locator("#next-step")).to_have_text("Add arc-breakdown")
        assert fell(page, "dB") == (after, before)
        page.hover("[data-effect='arc-breakdown']")
        expect(page.locator("#story-hint")).to_contain_text("→")
        keep(page, "story-emission")
        page.click("#redo")
        on("Judge against the limit", "Write the report")
        on("Write the report", "Open the report")
        assert clicks == 9
        with page.expect_download() as download:
            page.click("#outcome a:text-is('report.pdf')")
        assert Path(download.value.path()).read_bytes() == (tmp_path / "s" / "report" / "report.pdf").read_bytes()
        # A laboratory signs it.
        page.click("#next-step")
        watched.drawn("report")
        with page.expect_file_chooser() as asked:
            page.click("#choose-laboratory")
        asked.value.set_files(LABORATORY)
        expect(page.locator("#who-signs")).to_have_text("Signed by EMC Laboratory North.")
        with page.expect_response(written):
            page.click("#write-report")
        page.go_back()
        watched.drawn("story")
        # The other views are one click away, and the step bar leads to them too.
        page.click("#story-stages a:has-text('Measured')")
        watched.drawn("emission")
        page.go_back()
        watched.drawn("story")
        expect(page.locator("#of-emission")).to_have_attribute("aria-pressed", "true")
        watched.close()
    text = pdf_of(tmp_path / "s")
    for told in ("eddy-laminations", "arc-breakdown", "EMC Laboratory North", "EMC-2026-0001"):
        assert told in text


def written(answer: Response) -> bool:
    """Whether this is the answer to the button that writes the report."""
    return answer.request.method == "POST" and answer.url.endswith("/report")


def fell(page: Page, unit: str) -> tuple[float, float]:
    """Error before and after, as the page says it."""
    expect(page.locator("#outcome")).to_have_text(re.compile("→"))
    before, after = page.inner_text("#outcome").removeprefix("error").split("→")
    return float(before.replace(unit, "")), float(after.replace(unit, ""))


@needs_chromium
@pytest.mark.case
def test_both_stories_by_keys_alone_from_chosen_files(browser, measured, tmp_path):
    with served(bench_of(tmp_path)) as address:
        watched = Watched(browser, address, viewport=SMALL, color_scheme="dark")
        page = watched.page
        choose_by_keys(watched, files_of(measured))
        expect(page.locator("#files-read tbody tr")).to_have_count(len(files_of(measured)))
        page.focus("#import-analyser")
        page.keyboard.type("4294a")
        page.focus("#import-motor")
        page.keyboard.type("s")
        page.keyboard.press("Enter")
        watched.drawn("story")
        # Reloaded, the first stop of Tab leads past header and views, to what comes next.
        page.reload()
        watched.drawn("story")
        page.keyboard.press("Tab")
        expect(page.locator(".skip")).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.locator("main")).to_be_focused()
        for _ in range(10):
            if page.evaluate("document.activeElement.id") == "next-step":
                break
            page.keyboard.press("Tab")

        def enter(becomes: str) -> None:
            """What comes next, by the key; the focus stays."""
            expect(page.locator("#next-step")).to_be_focused()
            page.keyboard.press("Enter")
            expect(page.locator("#next-step")).to_have_text(becomes, timeout=PATIENCE_MS)
            expect(page.locator("#next-step")).to_be_focused()

        enter("Find what is missing")
        enter("Add eddy-laminations")
        page.keyboard.press("ArrowDown")
        expect(page.locator("[data-effect='eddy-laminations']")).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        expect(page.locator("[data-effect='eddy-laminations']")).to_be_focused()
        # What a screen reader is told.
        expect(page.locator("[role=status]#outcome")).to_contain_text("→")
        page.keyboard.press("d")
        expect(page.locator(".ladder .step-name")).to_have_count(1)
        page.keyboard.press("r")
        expect(page.locator(".ladder .step-name")).to_have_count(2)
        assert findings(page) == []
        page.keyboard.press("n")
        expect(page.locator("#next-step")).to_have_text("Fit source and path")
        enter("Find what is missing")
        enter("Add arc-breakdown")
        assert findings(page) == []
        enter("Judge against the limit")
        page.focus("#drop")
        page.keyboard.press("Enter")
        expect(page.locator("#next-step")).to_have_text("Add arc-breakdown")
        expect(page.locator("#drop")).to_be_focused()
        page.keyboard.press("Tab")
        expect(page.locator("#redo")).to_be_focused()
        page.keyboard.press("Enter")
        expect(page.locator("#next-step")).to_have_text("Judge against the limit")
        page.keyboard.press("n")
        expect(page.locator("#next-step")).to_have_text("Write the report")
        enter("Open the report")
        page.keyboard.press("Enter")
        watched.drawn("report")
        expect(page.locator("main")).to_be_focused()
        expect(page.locator("#report-files a").first).to_be_visible()
        # A laboratory signs it; what to press next is the next stop of Tab each time.
        with page.expect_file_chooser() as asked:
            page.keyboard.press("Tab")
            expect(page.locator("#choose-laboratory")).to_be_focused()
            page.keyboard.press("Enter")
        asked.value.set_files(LABORATORY)
        expect(page.locator("#who-signs")).to_have_text("Signed by EMC Laboratory North.")
        expect(page.locator("#choose-laboratory")).to_be_focused()
        assert findings(page) == []
        page.keyboard.press("Tab")
        expect(page.locator("#report-form")).to_be_focused()
        page.keyboard.press("Tab")
        expect(page.locator("#write-report")).to_be_focused()
        with page.expect_response(written):
            page.keyboard.press("Enter")
        watched.close()
    text = pdf_of(tmp_path / "s")
    for told in ("eddy-laminations", "arc-breakdown", "EMC Laboratory North", "EMC-2026-0001"):
        assert told in text
