"""Open the browser without the key in its command line, which all users of the machine can read."""

from __future__ import annotations

import os
import tempfile
import threading
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path

# Long enough for a browser that must start first to read the file.
KEPT_S = 60.0
PAGE = (
    '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
    '<title>motoremi workbench</title><meta http-equiv="refresh" content="0; url={address}"></html>\n'
)


@contextmanager
def doorway(address: str) -> Iterator[Path]:
    """An HTML file, readable by its owner only, that redirects to an address; deleted on exit.

    It is placed in the home folder: browsers installed as a snap can read neither the temporary folder nor hidden folders.
    """
    home = Path.home()
    folder = home if os.access(home, os.W_OK) else None
    descriptor, name = tempfile.mkstemp(".html", "motoremi-workbench-", folder)
    path = Path(name)
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as file:
            file.write(PAGE.format(address=escape(address)))
        yield path
    finally:
        path.unlink(missing_ok=True)


class Opener:
    """Opens the browser in a thread and deletes the redirecting file afterwards."""

    def __init__(self) -> None:
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self, address: str) -> None:
        """Show an address in the user's browser."""
        self._thread = threading.Thread(target=self._show, args=(address,), name="open the browser")
        self._thread.start()

    def close(self) -> None:
        """Delete the file now and wait until that is done."""
        self._over.set()
        if self._thread is not None:
            self._thread.join()

    def _show(self, address: str) -> None:
        try:
            with doorway(address) as file:
                webbrowser.open(file.as_uri())
                self._over.wait(KEPT_S)
        except OSError:
            # No folder is writable; the address was also printed in the terminal.
            return
