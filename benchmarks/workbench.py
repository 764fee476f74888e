"""`make page`: the workbench in a real browser: time to start, to the first paint, from a click on an effect to its new error, of a zoom in long
sweeps; number of clicks from dropped files to a signed report; violations that axe-core finds in every view."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from motoremi.data.session import SessionWriter
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.emission.setup import scan_frequencies
from motoremi.simulate.analyser_errors import SimulatedAnalyser
from motoremi.simulate.emission_in_time import Stand, measure
from motoremi.simulate.simulated_motor import SimulatedMotor
from motoremi.workbench.desk import Desk

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--disable-background-networking", "--disable-component-update", "--disable-sync"]
ROUNDS = 15
FRAMES = 120
LONG_MS = 60_000
# Limit for a diagnosis of spectra on a busy machine.
LONGEST_MS = 300_000
SIZES = {"1440": {"width": 1440, "height": 900}, "1024": {"width": 1024, "height": 768}, "phone": {"width": 390, "height": 844}}
AXE = (resources.files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")
FINDINGS = "async () => (await axe.run()).violations.map((one) => one.id)"
VIEWS = ("files", "bench", "story", "session", "fails", "inspect", "next", "emission", "report", "challenge", "together")
# Number of clicks on an effect whose fit is kept.
AGAIN = 5
# Effects that were not pointed at before: each click needs a new fit.
MISSING, NOT_MISSING = "eddy-laminations", ("skin-effect", "core-loss", "second-resonance", "distributed-winding")
LABORATORY = 'name = "Benchmark laboratory"\nseries = "BENCH-"\n'
# From the click to the picture that shows the new error: two animation frames after the text is there.
CLICK = """async (effect) => {
  const outcome = document.getElementById("outcome"), button = document.querySelector(`[data-effect="${effect}"]`);
  outcome.textContent = "";
  const began = performance.now();
  // As a mouse does that moves there and clicks at once.
  button.closest("tr").dispatchEvent(new PointerEvent("pointerenter", { pointerType: "mouse" }));
  button.click();
  await new Promise((done) => new MutationObserver((_, watch) => { watch.disconnect(); done(); }).observe(outcome, { childList: true }));
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  return performance.now() - began;
}"""
# Time of the page's thread for one step of a zoom, and the time between frames during zooming.
ZOOM = """async (frames) => {
  const host = document.querySelector(".plots"), costs = [], gaps = [];
  let last = 0;
  for (let step = 0; step < frames; step++) {
    const now = await new Promise(requestAnimationFrame);
    if (last) gaps.push(now - last);
    last = now;
    const began = performance.now();
    host.dispatchEvent(new KeyboardEvent("keydown", { key: step % 8 < 4 ? "+" : "-", bubbles: true }));
    await new Promise((done) => queueMicrotask(done));
    costs.push(performance.now() - began);
  }
  return { costs, gaps };
}"""


def make_session(folder: Path, points: int, spectra: bool = False) -> Path:
    """Three repeats of each sweep of a motor with hidden eddy currents; on request also spectra of its arcing brushes."""
    frequency_hz = np.geomspace(150e3, 30e6, points)
    motor, analyser = SimulatedMotor.random(7, ("eddy-laminations",)), SimulatedAnalyser(1007)
    with SessionWriter.create(folder, {"title": f"{points} points", "motor": "benchmark", "analyser": "4294a"}) as writer:
        for connection, termination in enumerate(("short", "open")):
            true = motor.impedance(termination, frequency_hz)
            for _ in range(3):
                measured = analyser.measure(termination, frequency_hz, true, connection=connection, bandwidth_factor=3)
                writer.add_sweep(ImpedanceSweep(termination, frequency_hz, measured))
        if spectra:
            scan_hz = scan_frequencies()
            read = measure(motor, Stand.random(1004, ("arc-breakdown",)), scan_hz, 1004, quasi_peak=False)
            for detector in ("peak", "average"):
                writer.add_spectrum(Spectrum(detector, scan_hz, read.level(detector)))
        writer.close("done")
    return folder


def fitted(folder: Path) -> Path:
    """The same, with the paper's circuit fitted."""
    Desk(folder).fit()
    return folder


class Running(NamedTuple):
    """A workbench that answers.

    Parameters
    ----------
    address : str
    wall_ms, spent_ms : float
        Until it printed its address: time on the clock and of the processor.
    """

    address: str
    wall_ms: float
    spent_ms: float


@contextmanager
def running(*arguments: Path | str) -> Iterator[Running]:
    """A workbench until the block ends."""
    began = time.perf_counter()
    command = [str(Path(sys.executable).with_name("motoremi")), "workbench", *map(str, arguments), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    try:
        assert process.stdout is not None
        text = ""
        while not text.rstrip().endswith("}"):
            line = process.stdout.readline()
            if not line:
                sys.exit("the workbench did not start")
            text += line
        wall = time.perf_counter() - began
        # utime and stime, in ticks.
        spent = sum(int(ticks) for ticks in Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13])
        yield Running(json.loads(text)["address"], 1e3 * wall, 1e3 * spent / os.sysconf("SC_CLK_TCK"))
    finally:
        process.terminate()
        process.wait()


def opened(page: Page, address: str, view: str) -> float:
    """Open a view; milliseconds to the first paint."""
    page.goto(address)
    page.evaluate("(view) => { location.hash = view; }", view)
    page.wait_for_selector(f"main[data-view={view}]:not([aria-busy])")
    paint = "performance.getEntriesByType('paint').find((one) => one.name === 'first-contentful-paint').startTime"
    return float(page.evaluate(paint))


def clicks(page: Page, effect: str, rounds: int = 1, pointed_at: bool = False) -> list[float]:
    """Milliseconds from the click on an effect to its new error on the page; each time it is dropped again."""
    times = []
    for _ in range(rounds):
        if pointed_at:
            page.hover(f"[data-effect='{effect}']")
            page.wait_for_selector(f"#signature-of:text-is('{effect}')", timeout=LONG_MS)
            page.wait_for_selector("#story-hint:has-text('→')", timeout=LONG_MS)
        times.append(page.evaluate(CLICK, effect))
        page.wait_for_selector(".step-name:text-is('+ " + effect + "')")
        page.click("#drop")
        page.wait_for_selector("#drop[aria-disabled=true]")
        page.wait_for_selector("main:not([aria-busy])")
    return times


def pressed(page: Page, text: str) -> float:
    """Milliseconds from the click on the button of the next step until that button has another text."""
    button = page.locator("#next-step")
    if button.inner_text() != text:
        sys.exit(f"{button.inner_text()!r} comes next, not {text!r}")
    began = time.perf_counter()
    button.click()
    page.wait_for_function("(before) => document.getElementById('next-step')?.textContent !== before", arg=text, timeout=LONGEST_MS)
    spent = time.perf_counter() - began
    page.wait_for_selector("main:not([aria-busy])")
    return 1e3 * spent


def from_files(page: Page, address: str, measured: Path) -> int:
    """From dropped files to the signed report, by the button of the next step; the number of clicks, dropping the files counted as one."""
    opened(page, address, "files")
    files = [str(path) for folder in ("sweeps", "spectra") for path in sorted((measured / folder).glob("*.csv"))]
    page.set_input_files("#file-input", files)
    page.wait_for_selector(f"#files-read tbody tr >> nth={len(files) - 1}")
    page.click("#make-session")
    page.wait_for_selector("main[data-view=story]:not([aria-busy])")
    count = 2
    print(f"1. drop {len(files)} files\n2. Make session")
    while (text := page.inner_text("#next-step")) != "Open the report":
        spent = pressed(page, text)
        count += 1
        print(f"{count}. {text}: {spent / 1e3:.1f} s")
    page.click("#next-step")
    page.wait_for_selector("main[data-view=report]:not([aria-busy])")
    profile = {"name": "laboratory.toml", "mimeType": "application/toml", "buffer": LABORATORY.encode()}
    page.set_input_files("#laboratory-files", profile)  # type: ignore[arg-type]
    page.wait_for_selector("#who-signs:has-text('Signed by')")
    began = time.perf_counter()
    with page.expect_response(lambda got: got.request.method == "POST" and got.url.endswith("/report"), timeout=LONGEST_MS) as answer:
        page.click("#write-report")
    if not answer.value.ok:
        sys.exit(answer.value.text())
    spent = time.perf_counter() - began
    print(f"{count + 1}. Open the report\n{count + 2}. Choose the laboratory's profile\n{count + 3}. Write the report, signed: {spent:.1f} s")
    return count + 3


def found_by_axe(page: Page) -> dict[str, list[str]]:
    """Violations that axe-core finds in every view, in each window size, light and dark."""
    found = {}
    for name, size in SIZES.items():
        for scheme in ("light", "dark"):
            page.set_viewport_size(size)  # type: ignore[arg-type]
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            violations = []
            for view in VIEWS:
                page.click(f"nav a[href='#{view}']")
                page.wait_for_selector(f"main[data-view={view}]:not([aria-busy])", timeout=LONG_MS)
                page.evaluate(AXE)
                violations += [f"{view}: {one}" for one in page.evaluate(FINDINGS)]
            found[f"{name} {scheme}"] = violations
    return found


def row(name: str, values: list[float], wanted: str) -> None:
    """One line of the table."""
    print(f"| {name} | {min(values):.0f} | {median(values):.0f} | {max(values):.0f} | {len(values)} | {wanted} |", flush=True)


def head() -> None:
    """The header of a table."""
    print("\n| figure, ms | least | median | most | times | wanted |\n|---|---|---|---|---|---|")


def begin(browser: Browser, session: Path) -> None:
    """Start to first paint."""
    starts, spents, paints = [], [], []
    for _ in range(5):
        with running(session, "--folder", session.parent) as workbench:
            starts.append(workbench.wall_ms)
            spents.append(workbench.spent_ms)
            page = browser.new_context().new_page()
            paints.append(opened(page, workbench.address, "story"))
            page.context.close()
    row("start to address", starts, "< 2000")
    row("the same, processor time", spents, "")
    row("first paint", paints, "< 1000")


def short_session(browser: Browser, session: Path) -> None:
    """Clicks on effects of sweeps with 401 points."""
    with running(session, "--folder", session.parent) as workbench:
        page = browser.new_context().new_page()
        opened(page, workbench.address, "story")
        row(f"401 points: click to new error, {MISSING}, not pointed at before", clicks(page, MISSING), "< 300")
        row(
            "401 points: the same, four effects that are not missing: the search goes on for longer",
            [clicks(page, one)[0] for one in NOT_MISSING],
            "",
        )
        for effect in ("eddy-laminations", "second-resonance", "skin-effect"):
            row(f"401 points: click to new error, {effect}, signature shown", clicks(page, effect, ROUNDS, pointed_at=True), "< 300")
        page.context.close()


def whole_story(browser: Browser, measured: Path, folder: Path) -> None:
    """Clicks from files to the signed report, findings of axe-core, clicks on an effect of the spectra."""
    print("\nFrom dropped files of sweeps and spectra, 401 points, to a report that a laboratory signs:\n")
    with running("--folder", folder) as workbench:
        page = browser.new_context().new_page()
        print(f"\n{from_files(page, workbench.address, measured)} clicks\n")
        for window, found in found_by_axe(page).items():
            print(f"axe-core, {len(VIEWS)} views, {window}: {len(found)} findings{': ' if found else ''}{', '.join(found)}")
        page.set_viewport_size(SIZES["1440"])  # type: ignore[arg-type]
        page.evaluate("sessionStorage.setItem('motoremi-story', 'emission')")
        page.click("nav a[href='#story']")
        page.wait_for_selector("main[data-view=story]:not([aria-busy])")
        page.click("#drop")
        page.wait_for_selector("#drop[aria-disabled=true]")
        head()
        row("spectra: click to new error, arc-breakdown, signature shown", clicks(page, "arc-breakdown", AGAIN, pointed_at=True), "< 300")
        page.context.close()


def long_session(browser: Browser, session: Path) -> None:
    """Fit, diagnosis, clicks and zoom of sweeps with 10 001 points."""
    with running(session, "--folder", session.parent) as workbench:
        page = browser.new_context().new_page()
        opened(page, workbench.address, "story")
        for text, wanted in (("Fit the paper's circuit", "< 5000"), ("Find what is missing", "< 20 000")):
            row(f"2 x 10 001 points, three repeats: {text}", [pressed(page, text)], wanted)
        for effect in ("eddy-laminations", "core-loss"):
            row(f"2 x 10 001 points: click to new error after the diagnosis, {effect}", clicks(page, effect, AGAIN), "< 500")
        page.click("nav a[href='#session']")
        page.wait_for_selector("main[data-view=session]:not([aria-busy])", timeout=LONG_MS)
        zoomed = page.evaluate(ZOOM, FRAMES)
        row("2 x 10 001 points, three plots with model and error: a step of the zoom", zoomed["costs"], "< 50")
        row("the same: time between pictures", zoomed["gaps"], "< 50")
        page.context.close()


def main() -> None:
    """Measure and print."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        sys.exit("chromium is not installed: apt-get install chromium")
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        short = fitted(make_session(folder / "points-401", 401))
        head()
        begin(browser, short)
        short_session(browser, short)
        (folder / "own").mkdir()
        whole_story(browser, make_session(folder / "story", 401, spectra=True), folder / "own")
        head()
        long_session(browser, make_session(folder / "points-10001", 10_001))
        browser.close()


if __name__ == "__main__":
    main()
