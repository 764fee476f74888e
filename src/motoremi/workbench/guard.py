"""Who may talk to the workbench: this machine, through the address that was printed at the start, and no page but our own."""

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
# Where files are taken in; everywhere else requests are JSON.
UPLOADS = "/api/files"
LABORATORY = "/api/laboratory"
# A page of ours is asked for by ourselves, or by somebody who types its address.
WELCOME_SITES = frozenset({"same-origin", "none"})
# Trusted types: a browser that knows them refuses to make markup from text, whatever a script tries.
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; require-trusted-types-for 'script'"
)
# A report is one file with its styles and drawings in it; nothing in it may run or fetch.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; sandbox"
HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
# Leads on to the page as a request of its own.
ENTRANCE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>motoremi workbench</title><meta http-equiv="refresh" content="0; url=/"></html>
"""


class Guard:
    """Lets a request through to the application, or says in a sentence why not.

    Parameters
    ----------
    app : ASGI application
    token : str
        What the start-up address carries; afterwards a cookie or the header `Authorization: Bearer`.
    hosts : collection of str
        Values of the Host header that are this workbench; any other name that leads here was made to by somebody else's name server.
    """

    def __init__(self, app: ASGIApp, token: str, hosts: Collection[str]) -> None:
        self._app = app
        self._token = token
        self._hosts = frozenset(hosts)
        # Cookies do not know ports: two workbenches must not overwrite each other's.
        self._cookie = "motoremi-" + min(hosts).rpartition(":")[2]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
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
        if headers.get("sec-fetch-site", "none") not in WELCOME_SITES and not self._shows_token(scope):
            return _refuse(scope, "another page may not use this workbench")
        if scope["method"] in SAFE_METHODS:
            return None
        # A form of another page cannot send these types without asking first, and is not allowed to.
        wanted = "application/octet-stream" if _is_upload(scope) else "application/json"
        if headers.get("content-type", "").partition(";")[0].strip().lower() != wanted:
            return _refuse(scope, "files come as bytes" if _is_upload(scope) else "requests are JSON", 415)
        return None

    def _entrance(self, scope: Scope) -> Response | None:
        """None for those who have shown the token; a cookie for those who show it now."""
        headers = Headers(scope=scope)
        if self._shows_token(scope):
            # Out of the address, so that it does not stay in the history or on a screenshot.
            answer: Response = RedirectResponse("/", status_code=303)
            if headers.get("sec-fetch-site", "none") not in WELCOME_SITES:
                # Sent here by the local file that opens the browser: a browser keeps the cookie from a redirection that another page began.
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
        """Whether this is the address that was printed at the start."""
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
    # The connection ends with the answer: nobody waits for the rest of what was refused.
    answer.headers["Connection"] = "close"
    return answer
