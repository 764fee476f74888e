"""A real browser for the tests of the page, and what it asked for or complained of."""

from __future__ import annotations

import base64
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

expect.set_options(timeout=60_000)
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# A sandbox cannot be set up in most containers; the rest keeps the browser from talking to its maker.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
VIEWS = ("files", "bench", "story", "session", "fails", "inspect", "next", "emission", "report", "challenge", "together")
COLOURS = 48
# A diagnosis on a busy machine; only ends a test that would hang.
PATIENCE_MS = 120_000
AXE = (resources.files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")
RUN = "async () => (await axe.run()).violations.map((one) => `${one.id}: ${one.nodes.map((node) => node.html).join(' | ')}`)"
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed: apt-get install chromium")


# As a browser hands over what was dragged from a folder.
DROP = """(files) => {
  const carried = new DataTransfer();
  for (const [name, content] of files) carried.items.add(new File([Uint8Array.from(atob(content), (one) => one.charCodeAt(0))], name));
  const event = (kind) => new DragEvent(kind, { dataTransfer: carried, bubbles: true, cancelable: true });
  for (const kind of ["dragenter", "dragover", "drop"]) document.querySelector("main").dispatchEvent(event(kind));
}"""


def findings(page: Page) -> list[str]:
    """What axe-core finds on the page as it is, with its usual rules."""
    page.wait_for_selector("#busy", state="hidden")
    page.evaluate(AXE)
    return list(page.evaluate(RUN))


def keep(page: Page, name: str) -> None:
    """A picture of the page as it is, where somebody wants them."""
    folder = os.environ.get("MOTOREMI_SCREENSHOTS")
    if folder:
        for box in ("#busy", "#jobs"):
            page.wait_for_selector(box, state="hidden")
        page.mouse.move(0, 0)
        taken = Image.open(BytesIO(page.screenshot()))
        # A page has few colours; a palette makes the file a third as large.
        taken.convert("RGB").quantize(COLOURS).save(Path(folder) / f"workbench-{name}.png", optimize=True)


@contextmanager
def launched() -> Iterator[Browser]:
    """A browser until the block ends."""
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


class Watched:
    """A page, and everything that it asked for or complained of."""

    def __init__(self, browser: Browser, address: str, **settings: object) -> None:
        self.context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **settings})
        self.page: Page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE_MS)
        self.base = address.partition("/?")[0]
        self.asked: list[str] = []
        self.trouble: list[str] = []
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on(
            "console",
            lambda message: self.trouble.append(f"{message.text} {message.location['url']}") if message.type in ("error", "warning") else None,
        )
        self.page.on("pageerror", lambda error: self.trouble.append(str(error)))
        self.page.on("dialog", lambda dialog: self.trouble.append(f"dialog: {dialog.message}"))
        self.page.goto(address)

    def see(self, view: str) -> None:
        """Go to a view as the navigation does."""
        self.page.click(f"nav a[href='#{view}']")
        self.drawn(view)

    def drawn(self, view: str) -> None:
        """Wait until a view stands there complete."""
        self.page.wait_for_selector(f"main[data-view={view}]:not([aria-busy])")

    def close(self) -> None:
        """Nothing left the machine, nothing was complained of."""
        assert self.asked
        assert [url for url in self.asked if not url.startswith(self.base)] == []
        assert self.trouble == [], self.trouble
        self.context.close()


def drop(page: Page, files: dict[str, bytes]) -> None:
    page.evaluate(DROP, [[name, base64.b64encode(data).decode()] for name, data in files.items()])


def choose_by_keys(watched: Watched, files: dict[str, bytes]) -> None:
    """Choose files in the view Files with the keyboard alone."""
    page = watched.page
    # Playwright needs a while before it catches the dialog.
    with page.expect_file_chooser() as asked:
        watched.see("bench")
        page.keyboard.press("0")
        watched.drawn("files")
        page.focus("#choose-files")
        page.keyboard.press("Enter")
    asked.value.set_files([{"name": name, "mimeType": "text/csv", "buffer": data} for name, data in files.items()])
