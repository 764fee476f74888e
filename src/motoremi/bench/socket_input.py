"""Input that waits on a socket: with it, a link that is slow or sends without end cannot extend a deadline.

PyVISA-py restarts the deadline of a read on a socket with each byte, and clears a socket for as long as data arrive. A read of no more than
has already arrived, or of a single byte, keeps its deadline. The vendors' libraries keep the deadline of a read themselves.
"""

from __future__ import annotations

import select
import socket
import time

from pyvisa.resources import MessageBasedResource

# A link is silent when nothing has arrived for this time.
_SILENCE_S = 0.1


def socket_of(resource: MessageBasedResource) -> socket.socket | None:
    """The socket of a resource that PyVISA-py serves; None for any other link."""
    link = getattr(_session(resource), "interface", None)
    return link if isinstance(link, socket.socket) else None


def readable_bytes(resource: MessageBasedResource, longest_s: float) -> int:
    """How many bytes one read may ask for: of a socket those that have arrived, 0 if none arrive within `longest_s`.

    Raises
    ------
    ConnectionError
        If the other side has closed the socket, which PyVISA-py does not distinguish from a slow answer.
    """
    link, most = socket_of(resource), int(resource.chunk_size)
    if link is None:
        return most
    # Bytes that PyVISA-py has already read from the socket, and bytes in the socket.
    taken = len(getattr(_session(resource), "_pending_buffer", b""))
    ready, _, _ = select.select([link], [], [], 0.0 if taken else longest_s)
    arrived = len(link.recv(most, socket.MSG_PEEK)) if ready else 0
    if ready and not arrived and not taken:
        raise ConnectionError("the other side closed the connection")
    return taken + arrived


def discard_until_silent(link: socket.socket, longest_s: float) -> bool:
    """Discard input until nothing arrives; False if that takes longer than `longest_s`, or the other side has closed the link."""
    until = time.monotonic() + longest_s
    while time.monotonic() < until:
        ready, _, _ = select.select([link], [], [], _SILENCE_S)
        if not ready:
            return True
        if not link.recv(1 << 16):
            return False
    return False


def _session(resource: MessageBasedResource) -> object:
    return getattr(resource.visalib, "sessions", {}).get(resource.session)
