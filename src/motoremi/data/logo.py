"""A logo from a user's file: PNG or SVG, checked to contain graphics only."""

from __future__ import annotations

import base64
import binascii
import io
import math
import re
from xml.etree import ElementTree

from motoremi.errors import BadInput

MAXIMUM_BYTES = 2_000_000
# Largest width and height of a file, and of the stored logo, which is sharp on paper at the size of a letterhead.
MAXIMUM_PIXELS = 6000
STORED_PIXELS = 1000
# Largest number of shapes with all references followed: ten levels of ten references each would be ten thousand million shapes.
MOST_SHAPES = 20_000
# Deepest nesting: drawing programs nest about a dozen groups, and the renderer recurses.
DEEPEST = 50
PNG_START = b"\x89PNG\r\n\x1a\n"
_SVG = "{http://www.w3.org/2000/svg}"
_HREF = ("href", "{http://www.w3.org/1999/xlink}href")
_DRAWING = frozenset(
    [
        "svg",
        "g",
        "path",
        "rect",
        "circle",
        "ellipse",
        "line",
        "polyline",
        "polygon",
        "defs",
        "linearGradient",
        "radialGradient",
        "stop",
        "clipPath",
        "use",
        "symbol",
        "text",
        "tspan",
        "style",
    ]
)
_SILENT = frozenset(("title", "desc", "metadata"))
# Not allowed in a style: anything that fetches from outside, and escapes that could hide it.
_FETCHES = re.compile(r"@import|\\|expression\(|url\(\s*(?![\"']?#)", re.IGNORECASE)
_LENGTH = re.compile(r"\s*\+?([\d.]+(?:[eE][+-]?\d+)?)\s*(?:px|pt|mm|cm|in|pc|em|%)?\s*")
_TOO_COMPLICATED = "is too complicated for a logo; save it as PNG"
_NOT_AN_IMAGE = "is not an image that a report can show; save the logo as PNG or SVG"


def png_logo(data: bytes, name: str) -> str:
    """A PNG as base64 text: encoded again with its pixels only, and scaled down if it is large.

    Raises
    ------
    BadInput
        If it is not a complete PNG of acceptable size.
    """
    image = _opened(data, name)
    image = image.convert("RGBA" if "A" in image.getbands() or "transparency" in image.info else "RGB")
    image.thumbnail((STORED_PIXELS, STORED_PIXELS))
    image.info = {}
    buffer = io.BytesIO()
    image.save(buffer, "PNG")
    return base64.b64encode(buffer.getvalue()).decode()


def checked_png(text: str, name: str) -> str:
    """A stored PNG, unchanged.

    Raises
    ------
    BadInput
        If it is not a PNG.
    """
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError) as error:
        raise BadInput(f"{name}: {_NOT_AN_IMAGE}") from error
    _opened(data, name)
    return text


def _opened(data: bytes, name: str):  # type: ignore[no-untyped-def]
    # A dependency of matplotlib.
    from PIL import Image

    try:
        image = Image.open(io.BytesIO(data), formats=["PNG"])
        if max(image.size) > MAXIMUM_PIXELS:
            raise BadInput(f"{name}: {image.size[0]} x {image.size[1]} pixels are too many for a logo; the limit is {MAXIMUM_PIXELS} each way")
        image.load()
    except BadInput:
        raise
    except Exception as error:  # the library's parsers raise exceptions of many kinds
        raise BadInput(f"{name}: {_NOT_AN_IMAGE}") from error
    return image


def svg_logo(text: str, name: str) -> str:
    """An SVG drawing, written again without comments, metadata and the elements of drawing programs.

    Raises
    ------
    BadInput
        If it is not SVG, has no size, or contains anything but shapes: scripts, pictures, references to outside.
    """
    without_type = re.sub(r"<!DOCTYPE[^>\[]*>", "", text, count=1)
    if "<!DOCTYPE" in without_type or "<!ENTITY" in without_type:
        raise BadInput(f"{name}: defines entities, which are not allowed in a logo; save it as plain SVG or PNG")
    try:
        root = ElementTree.fromstring(without_type)
    except (ElementTree.ParseError, ValueError) as error:
        raise BadInput(f"{name}: {_NOT_AN_IMAGE}") from error
    if root.tag != f"{_SVG}svg":
        raise BadInput(f"{name}: {_NOT_AN_IMAGE}")
    _clean(root, name)
    _check_size(root, name)
    _check_references(root, name)
    ElementTree.register_namespace("", _SVG[1:-1])
    ElementTree.register_namespace("xlink", _HREF[1].partition("}")[0][1:])
    return ElementTree.tostring(root, encoding="unicode")


def _clean(element: ElementTree.Element, name: str, depth: int = 1) -> None:
    """Remove elements and attributes that are not graphics; refuse scripts and references to outside."""
    if depth > DEEPEST:
        raise BadInput(f"{name}: {_TOO_COMPLICATED}")
    for key, value in list(element.attrib.items()):
        if key.startswith("{") and key not in _HREF:
            del element.attrib[key]
        elif key.lower().startswith("on") or (key in _HREF and not value.strip().startswith("#")) or _FETCHES.search(value):
            raise BadInput(f"{name}: holds a script or refers to something outside, which is not allowed in a logo; save it as plain SVG or PNG")
    if element.tag == f"{_SVG}style" and _FETCHES.search(element.text or ""):
        raise BadInput(f"{name}: its style refers to something outside, which is not allowed in a logo; save it as plain SVG or PNG")
    for child in list(element):
        tag = str(child.tag)
        own = tag.removeprefix(_SVG)
        if own == tag or own in _SILENT:
            element.remove(child)
        elif own not in _DRAWING:
            raise BadInput(f"{name}: holds <{own[:30]}>, which is not allowed in a logo; save it as plain SVG or PNG")
        else:
            _clean(child, name, depth + 1)


def _check_size(root: ElementTree.Element, name: str) -> None:
    written = re.split(r"[\s,]+", root.get("viewBox", "").strip())[2:] or [root.get("width", ""), root.get("height", "")]
    lengths = [float(found[1]) for part in written if (found := _LENGTH.fullmatch(part)) and found[1].count(".") < 2]
    if len(lengths) != 2 or not all(0 < length < 1e5 and math.isfinite(length) for length in lengths):
        raise BadInput(f"{name}: has no size; save it with width and height, or with a viewBox")


def _check_references(root: ElementTree.Element, name: str) -> None:
    """Refuse circular references, and more or deeper ones than can be drawn."""
    by_name = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
    # Infinite for an element that is still being counted: reaching it again is a circular reference.
    known: dict[int, tuple[float, float]] = {}

    def drawn(element: ElementTree.Element, depth: int) -> tuple[float, float]:
        """Number of shapes that an element draws with its references, and depth of their nesting."""
        if depth > DEEPEST:
            return math.inf, math.inf
        key = id(element)
        if key not in known:
            known[key] = math.inf, math.inf
            used = next((element.get(href, "").strip() for href in _HREF if element.get(href)), "") if element.tag == f"{_SVG}use" else ""
            inside = [drawn(child, depth + 1) for child in (*element, *([by_name[used]] if used in by_name else []))]
            known[key] = 1 + sum(count for count, _ in inside), 1 + max((height for _, height in inside), default=0)
        return known[key]

    count, height = drawn(root, 1)
    if count > MOST_SHAPES or height > DEEPEST:
        raise BadInput(f"{name}: {_TOO_COMPLICATED}")
