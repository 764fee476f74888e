"""Renders matplotlib figures as SVG elements for a page."""

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

# Matplotlib's settings are global, so threads of the workbench must not change them at the same time.
_settings = threading.Lock()
_GEOMETRY = re.compile(r'\b(?:d|x|y|transform|points)="[^"]*"')
_FURTHER_DIGITS = re.compile(r"(?<=\.\d\d)\d+")


def picture(name: str, figure: Figure, caption: str) -> Picture:
    """Render a figure with its caption for a section."""
    checkpoint()
    return Picture(to_svg(figure, name, caption), caption)


def to_svg(figure: Figure, name: str = "plot", label: str = "") -> str:
    """Render a figure as an SVG element; the same figure gives the same bytes.

    Parameters
    ----------
    figure : Figure
    name : str
        Makes its identifiers unique within a page, so a page with several plots gives each its own; letters and `-`.
    label : str
        Description for screen readers; the name by default.
    """
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.StringIO()
    # A fixed salt makes identifiers, and so the bytes, reproducible; text stays text, which is small and can be searched.
    with _settings, warnings.catch_warnings(), matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none", "path.simplify": True}):
        # Text is kept as text, so the reader's fonts may have letters that matplotlib's lack.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        # Straight to the canvas: `savefig` would draw every figure twice, the first time for its layout alone.
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
    text = buffer.getvalue()
    # Remove the XML prolog and the document type, which refers to an outside address.
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # Nothing refers to groups; identifiers that something refers to are hashes with the salt, so no two plots of a page share one.
    text = re.sub(r'<g id="[^"]*"', "<g", text)
    # Digits beyond a hundredth of a point are invisible and make up half of the file.
    text = _GEOMETRY.sub(lambda found: _FURTHER_DIGITS.sub("", found.group()), text)
    return text.replace("<svg", f'<svg role="img" aria-label="{html.escape(label or name)}"', 1)
