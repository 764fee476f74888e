"""A matplotlib figure as an SVG element to put into a page."""

from __future__ import annotations

import html
import io
import re
import threading
import warnings
from typing import TYPE_CHECKING

from motoremi.interrupts import checkpoint
from motoremi.report.contents import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Matplotlib's settings are global: two threads of the workbench must not change them at once.
_settings = threading.Lock()
_GEOMETRY = re.compile(r'\b(?:d|x|y|transform|points)="[^"]*"')
_FURTHER_DIGITS = re.compile(r"(?<=\.\d\d)\d+")


def picture(name: str, figure: Figure, caption: str) -> Picture:
    """A figure with its caption, for a section."""
    checkpoint()
    return Picture(to_svg(figure, name, caption), caption)


def to_svg(figure: Figure, name: str = "plot", label: str = "") -> str:
    """An SVG element: same figure, same bytes.

    Parameters
    ----------
    figure : Figure
    name : str
        Makes its identifiers unique within a page, so a page with several plots gives each its own; letters and `-`.
    label : str
        What it shows, for those who cannot see it; the name by default.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    # A fixed salt makes identifiers, and so the bytes, reproducible; text stays text, which is small and can be searched.
    with _settings, warnings.catch_warnings(), matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none", "path.simplify": True}):
        # Text stays text: the page's reader may well have the letters that matplotlib's fonts lack.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        # Straight to the canvas: `savefig` would draw every figure twice, the first time for its layout alone.
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    text = buffer.getvalue()
    # The XML prolog and the document type, which points outside, have no place within a page.
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # Nothing refers to groups; identifiers that something refers to are hashes with the salt, so no two plots of a page share one.
    text = re.sub(r'<g id="[^"]*"', "<g", text)
    # A hundredth of a point cannot be seen and makes up half of the file.
    text = _GEOMETRY.sub(lambda found: _FURTHER_DIGITS.sub("", found.group()), text)
    return text.replace("<svg", f'<svg role="img" aria-label="{html.escape(label or name)}"', 1)
