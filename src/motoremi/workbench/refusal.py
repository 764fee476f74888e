"""Responses to refused requests: an HTML page for a browser window, JSON for everything else."""

from __future__ import annotations

import base64
import hashlib
from html import escape

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.types import Scope

from motoremi.data.text import clean_text

# Inline, because the workbench's style sheet is not served without the key.
STYLE = (
    ":root{color-scheme:light dark}"
    "body{font:16px/1.5 system-ui,'Segoe UI','DejaVu Sans',sans-serif;max-width:40rem;margin:12vh auto;padding:0 1rem}"
    "code{overflow-wrap:anywhere}"
)
STYLE_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
POLICY = f"default-src 'none'; style-src 'sha256-{STYLE_HASH}'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
HEADINGS = {401: "This page needs its key", 403: "Not from here", 404: "There is no such page"}


def refusal(scope: Scope, why: str, status: int) -> Response:
    """A response with one sentence that says why the request is refused."""
    reason = clean_text(" ".join(why.split()))
    if not _is_for_a_window(Headers(scope=scope)):
        return JSONResponse({"error": reason}, status_code=status)
    heading = HEADINGS.get(status, "That did not work")
    way_out = '<p><a href="/">To the workbench</a></p>' if status == 404 else ""
    markup = (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{heading} - motoremi workbench</title><style>{STYLE}</style><main><h1>{heading}</h1><p>{escape(reason)}</p>{way_out}</main></html>"
    )
    return HTMLResponse(markup, status_code=status, headers={"Content-Security-Policy": POLICY})


def _is_for_a_window(headers: Headers) -> bool:
    """Whether the browser loads this as a page, rather than from a script."""
    return "text/html" in headers.get("accept", "") and headers.get("sec-fetch-dest", "document") == "document"
