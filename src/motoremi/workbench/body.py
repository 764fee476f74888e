"""Reads the bodies of requests, with one size limit and one deadline for every kind of transfer."""

from __future__ import annotations

import asyncio
from typing import NamedTuple

from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive


class Allowance(NamedTuple):
    """How long a body may be, and how long its transfer may take. The deadline for headers is in `server`."""

    most_bytes: int
    within_s: float
    what: str

    def refusal(self) -> str:
        """The message for a body that is too long."""
        unit, size = ("MiB", 1024**2) if self.most_bytes >= 1024**2 else ("KiB", 1024)
        return f"{self.what} is longer than {self.most_bytes // size} {unit}"


# The largest JSON request holds an effect's name and a few settings.
USUAL = Allowance(64 * 1024, 10.0, "the request")
# A laboratory's profile with its logo, base64-encoded.
LETTERHEAD = Allowance(4 * 1024**2, 30.0, "the profile with its logo")
# A measurement file; 10 000 points take about a megabyte.
FILE = Allowance(64 * 1024**2, 60.0, "the file")


class TooLong(Exception):
    """The body is longer than allowed."""


async def whole_body(receive: Receive, allowance: Allowance) -> bytes:
    """The body, counted as it arrives, whatever its headers declare.

    Raises
    ------
    TooLong
        As soon as more bytes arrive than allowed.
    TimeoutError
        If it is not complete in time.
    ClientDisconnect
        If the client disconnects before the end.
    """
    body = bytearray()
    async with asyncio.timeout(allowance.within_s):
        while True:
            message = await receive()
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            body += message.get("body", b"")
            if len(body) > allowance.most_bytes:
                raise TooLong
            if not message.get("more_body", False):
                return bytes(body)


def read_already(body: bytes, receive: Receive) -> Receive:
    """A `receive` for the application that returns the whole body first, then the connection's own messages."""
    waiting: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def next_message() -> Message:
        return waiting.pop() if waiting else await receive()

    return next_message
