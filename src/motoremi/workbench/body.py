"""A request's body: one way of counting for all of them, and a deadline."""

from __future__ import annotations

import asyncio

from starlette.requests import ClientDisconnect
from starlette.types import Message, Receive

# The largest request is an effect's name with a few settings.
LARGEST_BODY = 64 * 1024
# A body that stays away must not hold a connection for ever; `server` has the deadline for headers.
BODY_DEADLINE_S = 10.0


class TooLong(Exception):
    """More bytes came than any request of the page has."""


async def whole_body(receive: Receive) -> bytes:
    """The body, counted as it arrives whatever its headers say.

    Raises
    ------
    TooLong
        As soon as it is longer than `LARGEST_BODY`.
    TimeoutError
        If it is not complete in time.
    ClientDisconnect
        If the connection ends before.
    """
    body = bytearray()
    async with asyncio.timeout(BODY_DEADLINE_S):
        while True:
            message = await receive()
            if message["type"] == "http.disconnect":
                raise ClientDisconnect
            body += message.get("body", b"")
            if len(body) > LARGEST_BODY:
                raise TooLong
            if not message.get("more_body", False):
                return bytes(body)


def read_already(body: bytes, receive: Receive) -> Receive:
    """What the application receives: the body at once, then whatever happens to the connection."""
    waiting: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def next_message() -> Message:
        return waiting.pop() if waiting else await receive()

    return next_message
