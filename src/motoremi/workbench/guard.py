"""Access control: only this machine, only with the token from the address printed at the start, and only requests from our own page."""

from __future__ import annotations

import secrets
from collections.abc import Collection
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import ClientDisconnect
from starlette.responses import HTMLResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from motoremi.workbench.body import FILE, LETTERHEAD, USUAL, TooLong, read_already, whole_body
from motoremi.workbench.refusal import refusal

SAFE_METHODS = frozenset({"GET", "HEAD"})
# Accepts files as bytes; all other requests are JSON.
UPLOADS = "/api/files"
LABORATORY = "/api/laboratory"
# Values of Sec-Fetch-Site for requests from our own page, and for an address typed by the user.
ALLOWED_SITES = frozenset({"same-origin", "none"})
# Trusted types: browsers that support them refuse to turn text into markup in scripts.
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)
# A report is a single file with inline styles and drawings; it may run no script and load nothing.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; sandbox"
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
# Redirects to the page in a separate request.
ENTRANCE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>motoremi workbench</title><meta http-equiv="refresh" content="0; url=/"></html>
"""


class Guard:
    """ASGI middleware: passes a request on, or refuses it with one sentence that says why.

    Parameters
    ----------
    app : ASGI application
    token : str
        Given in the start-up address; later requests carry it as a cookie or as `Authorization: Bearer`.
    hosts : collection of str
        Accepted values of the Host header. Any other host name points to DNS rebinding.
    """

    def __init__(self, app: ASGIApp, token: str, hosts: Collection[str]) -> None:
        self._app = app
        self._token = token
        self._hosts = frozenset(hosts)
        # Cookies are shared between ports of one host, so the port is part of the name.
        self._cookie = "motoremi-" + min(hosts).rpartition(":")[2]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        if scope["type"] != "http":
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in {"Content-Security-Policy": PAGE_POLICY, **HEADERS}.items():
                    headers.setdefault(name, value)
            await send(message)

        answer = self._refusal(scope) or self._entrance(scope)
        if answer is None:
            allowance = FILE if _is_upload(scope) else LETTERHEAD if scope["path"] == LABORATORY else USUAL
            try:
                body = await whole_body(receive, allowance)
            except TooLong:
                answer = _refuse(scope, allowance.refusal(), 413)
            except TimeoutError:
                answer = _refuse(scope, "the request did not arrive in time", 408)
            except ClientDisconnect:
                return
            else:
                await self._app(scope, read_already(body, receive), send_with_headers)
                return
        await answer(scope, receive, send_with_headers)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if host not in self._hosts:
            return _refuse(scope, "this workbench answers on the loopback address only")
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            return _refuse(scope, "another page may not use this workbench")
        if headers.get("sec-fetch-site", "none") not in ALLOWED_SITES and not self._shows_token(scope):
            return _refuse(scope, "another page may not use this workbench")
        if scope["method"] in SAFE_METHODS:
            return None
        # A form on another page cannot send these content types without a CORS preflight, which is refused.
        wanted = "application/octet-stream" if _is_upload(scope) else "application/json"
        if headers.get("content-type", "").partition(";")[0].strip().lower() != wanted:
            return _refuse(scope, "files come as bytes" if _is_upload(scope) else "requests are JSON", 415)
        return None

    def _entrance(self, scope: Scope) -> Response | None:
        """None if the request is authorised; a redirect that sets the cookie if its address carries the token; otherwise a refusal."""
        headers = Headers(scope=scope)
        if self._shows_token(scope):
            # Remove the token from the address, so that it stays in neither history nor screenshots.
            answer: Response = RedirectResponse("/", status_code=303)
            if headers.get("sec-fetch-site", "none") not in ALLOWED_SITES:
                # The local file that opens the browser led here: browsers send no SameSite cookie along such redirects, so load the page anew.
                answer = HTMLResponse(ENTRANCE)
            answer.set_cookie(self._cookie, self._token, httponly=True, samesite="strict", path="/")
            return answer
        scheme, _, bearer = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self._is_token(bearer):
            return None
        if self._is_token(_cookie_of(headers, self._cookie)):
            return None
        return _refuse(scope, "open the address that 'motoremi workbench' printed when it started: it carries the key to this page", 401)

    def _shows_token(self, scope: Scope) -> bool:
        """Whether this is the address printed at the start, with the right token."""
        shown = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        return scope["path"] == "/" and scope["method"] in SAFE_METHODS and self._is_token(shown)

    def _is_token(self, shown: str) -> bool:
        return secrets.compare_digest(shown.encode(), self._token.encode())


def _is_upload(scope: Scope) -> bool:
    return scope["path"] == UPLOADS and scope["method"] not in SAFE_METHODS


def _cookie_of(headers: Headers, name: str) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return "" if found is None else found.value


def _refuse(scope: Scope, why: str, status: int = 403) -> Response:
    answer = refusal(scope, why, status)
    # Close the connection: the rest of a refused request is not read.
    answer.headers["Connection"] = "close"
    return answer
