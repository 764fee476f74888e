"""`make page`: the workbench in a real browser: start, first paint, click on an effect to its new error, zooming in long sweeps; how many clicks
lead from measured data to the report, and what axe-core finds on the way."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from importlib import resources
from pathlib import Path
from statistics import median

import numpy as np
from playwright.sync_api import Page, sync_playwright

from motoremi.data.session import SessionWriter
from motoremi.data.spectrum import Spectrum
from motoremi.data.sweep import ImpedanceSweep
from motoremi.emission.setup import scan_frequencies
from motoremi.simulate.analyser import SimulatedAnalyser
from motoremi.simulate.emission import Stand, measure
from motoremi.simulate.motor import SimulatedMotor
from motoremi.workbench.desk import Desk

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--disable-background-networking", "--disable-component-update", "--disable-sync"]
ROUNDS = 15
FRAMES = 120
LONG_MS = 60_000
# A diagnosis of spectra on a busy machine.
LONGEST_MS = 300_000
SIZES = {"1440": {"width": 1440, "height": 900}, "1024": {"width": 1024, "height": 768}, "phone": {"width": 390, "height": 844}}
AXE = (resources.files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")
FINDINGS = "async () => (await axe.run()).violations.length"
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
# What one step of a zoom costs the page's thread, and the time between pictures while zooming goes on.
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
    """Three repeats of each sweep of a motor that hides eddy currents; spectra of its arcing brushes where they are asked for."""
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


def started(session: Path) -> tuple[subprocess.Popen[str], str, float, float]:
    """A workbench, its address, and how long it took to print it: wall time and processor time."""
    began = time.perf_counter()
    command = [str(Path(sys.executable).with_name("motoremi")), "workbench", str(session), "--folder", str(session.parent), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert process.stdout is not None
    text = ""
    while not text.rstrip().endswith("}"):
        text += process.stdout.readline()
    wall = time.perf_counter() - began
    # utime and stime, in ticks.
    spent = sum(int(ticks) for ticks in Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[11:13])
    return process, json.loads(text)["address"], wall, spent / os.sysconf("SC_CLK_TCK")


def opened(page: Page, address: str, view: str) -> float:
    """Open a view; milliseconds to the first paint."""
    page.goto(address)
    page.evaluate("(view) => { location.hash = view; }", view)
    page.wait_for_selector(f"main[data-view={view}]:not([aria-busy])")
    paint = "performance.getEntriesByType('paint').find((one) => one.name === 'first-contentful-paint').startTime"
    return float(page.evaluate(paint))


def clicks(page: Page, effect: str, prepared: bool) -> list[float]:
    """Milliseconds from the click on an effect to its new error on the page."""
    times = []
    for _ in range(ROUNDS if prepared else 1):
        if prepared:
            page.hover(f"[data-effect='{effect}']")
            page.wait_for_selector(f"#signature-of:text-is('{effect}')", timeout=LONG_MS)
        times.append(page.evaluate(CLICK, effect))
        page.wait_for_selector(".step-name:text-is('+ " + effect + "')")
        page.click("#drop")
        page.wait_for_selector("#drop[aria-disabled=true]")
        page.wait_for_selector("main:not([aria-busy])")
    return times


def pressed(page: Page, text: str) -> float:
    """Milliseconds from the click on what comes next to what comes after it."""
    page.click(f"#next-step:text-is({json.dumps(text)})")
    began = time.perf_counter()
    page.wait_for_function("(before) => document.getElementById('next-step')?.textContent !== before", arg=text, timeout=LONGEST_MS)
    return 1e3 * (time.perf_counter() - began)


def story(page: Page, address: str) -> int:
    """From measured data to the written report, by what comes next alone; the number of clicks."""
    opened(page, address, "story")
    count = 0
    while (text := page.inner_text("#next-step")) != "Open the report":
        began = time.perf_counter()
        page.click("#next-step")
        page.wait_for_function("(before) => document.getElementById('next-step')?.textContent !== before", arg=text, timeout=LONGEST_MS)
        page.wait_for_selector("main:not([aria-busy])")
        count += 1
        print(f"{count}. {text}: {time.perf_counter() - began:.1f} s")
    return count


def found_by_axe(page: Page) -> list[int]:
    """Findings on the story's screen in each window, light and dark."""
    found = []
    for size in SIZES.values():
        for scheme in ("light", "dark"):
            page.set_viewport_size(size)  # type: ignore[arg-type]
            page.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
            page.evaluate(AXE)
            found.append(int(page.evaluate(FINDINGS)))
    return found


def row(name: str, values: list[float], unit: str, wanted: str) -> None:
    """One line of the table."""
    print(f"| {name} | {min(values):.0f} | {median(values):.0f} | {max(values):.0f} | {unit} | {wanted} |")


def main() -> None:
    """Measure and print."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        sys.exit("chromium is not installed: apt-get install chromium")
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n")
    print("| figure | least | median | most | unit | wanted |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        short = fitted(make_session(folder / "points-401", 401))
        starts, spents, paints = [], [], []
        for _ in range(5):
            process, address, seconds, spent = started(short)
            starts.append(1e3 * seconds)
            spents.append(1e3 * spent)
            browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
            paints.append(opened(browser.new_page(), address, "story"))
            browser.close()
            process.terminate()
            process.wait()
        row("start to address", starts, "ms", "< 2000")
        row("the same, processor time", spents, "ms", "")
        row("first paint", paints, "ms", "< 1000")
        process, address, *_ = started(short)
        browser = playwright.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page()
        opened(page, address, "story")
        row("click to new error, eddy-laminations, not pointed at before", clicks(page, "eddy-laminations", prepared=False), "ms", "< 300")
        for effect in ("eddy-laminations", "second-resonance", "skin-effect"):
            row(f"click to new error, {effect}, signature shown", clicks(page, effect, prepared=True), "ms", "< 300")
        process.terminate()
        process.wait()
        print("\nFrom measured sweeps and spectra to the report, 401 points, clicking on what comes next:")
        process, address, *_ = started(make_session(folder / "story", 401, spectra=True))
        page = browser.new_page()
        print(f"{story(page, address)} clicks")
        print(f"axe-core findings ({', '.join(f'{name} {scheme}' for name in SIZES for scheme in ('light', 'dark'))}): {found_by_axe(page)}")
        opened(page, address, "story")
        page.evaluate("sessionStorage.setItem('motoremi-story', 'emission')")
        page.reload()
        page.wait_for_selector("main[data-view=story]:not([aria-busy])")
        page.click("#drop")
        page.wait_for_selector("#drop[aria-disabled=true]")
        print("\n| figure | least | median | most | unit | wanted |\n|---|---|---|---|---|---|")
        row("click to new error of the spectra, arc-breakdown, drawn before", clicks(page, "arc-breakdown", prepared=True), "ms", "< 300")
        process.terminate()
        process.wait()
        process, address, *_ = started(make_session(folder / "points-10001", 10_001))
        page = browser.new_page()
        opened(page, address, "story")
        for text, wanted in (("Fit the paper's circuit", "< 5000"), ("Find what is missing", "< 20 000")):
            row(f"2 x 10 001 points, three repeats: {text}", [pressed(page, text)], "ms", wanted)
        for effect in ("eddy-laminations", "core-loss"):
            row(f"the same: click to new error after the diagnosis, {effect}", clicks(page, effect, prepared=False), "ms", "< 500")
        opened(page, address, "session")
        zoomed = page.evaluate(ZOOM, FRAMES)
        row("zoom in a sweep of 10 001 points, three plots with model and error: a step's cost", zoomed["costs"], "ms", "< 50")
        row("the same: time between pictures", zoomed["gaps"], "ms", "< 50")
        browser.close()
        process.terminate()
        process.wait()


if __name__ == "__main__":
    main()
