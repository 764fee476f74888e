"""A request's body: one way of counting for all of them, and a deadline."""

from __future__ import annotations

import asyncio
from typing import NamedTuple

from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive


class Allowance(NamedTuple):
    """How long a body may be, and how long it may take; one that stays away must not hold a connection for ever.

    `server` has the deadline for headers.
    """

    most_bytes: int
    within_s: float
    what: str

    def refusal(self) -> str:
        """What somebody is told who sent more."""
        unit, size = ("MiB", 1024**2) if self.most_bytes >= 1024**2 else ("KiB", 1024)
        return f"{self.what} is longer than {self.most_bytes // size} {unit}"


# The largest request is an effect's name with a few settings.
USUAL = Allowance(64 * 1024, 10.0, "the request")
# A laboratory's profile with its logo, as text.
LETTERHEAD = Allowance(4 * 1024**2, 30.0, "the profile with its logo")
# A file of a measurement; 10 000 points take a megabyte.
FILE = Allowance(64 * 1024**2, 60.0, "the file")


class TooLong(Exception):
    """More bytes came than are allowed."""


async def whole_body(receive: Receive, allowance: Allowance) -> bytes:
    """The body, counted as it arrives whatever its headers say.

    Raises
    ------
    TooLong
        As soon as it is longer than allowed.
    TimeoutError
        If it is not complete in time.
    ClientDisconnect
        If the connection ends before.
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
    """What the application receives: the body at once, then whatever happens to the connection."""
    waiting: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def next_message() -> Message:
        return waiting.pop() if waiting else await receive()

    return next_message
