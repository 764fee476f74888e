"""What has arrived on a socket, so that neither a slow link nor one that never falls silent can stretch a deadline.

PyVISA-py begins the deadline of a read on a socket anew with each byte, and clears a socket for as long as anything comes. A read that asks
for what is there already, or for a single byte, has no such chance. The vendors' libraries hold the deadline of a read themselves.
"""

from __future__ import annotations

import select
import socket
import time

from pyvisa.resources import MessageBasedResource

# A link on which nothing has come for so long is silent.
_SILENCE_S = 0.1


def socket_of(resource: MessageBasedResource) -> socket.socket | None:
    """The socket of a resource that PyVISA-py serves; None for any other link."""
    link = getattr(_session(resource), "interface", None)
    return link if isinstance(link, socket.socket) else None


def at_hand(resource: MessageBasedResource) -> int:
    """How many bytes one read may ask for, so that it does not wait for more than one."""
    link, most = socket_of(resource), int(resource.chunk_size)
    if link is None:
        return most
    # What PyVISA-py has taken from the socket already, and what the socket holds.
    taken = len(getattr(_session(resource), "_pending_buffer", b""))
    ready, _, _ = select.select([link], [], [], 0)
    return max(1, taken + (len(link.recv(most, socket.MSG_PEEK)) if ready else 0))


def fell_silent(link: socket.socket, longest_s: float) -> bool:
    """Drop what arrives until nothing does; False if that takes longer, or the other side has closed the link."""
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
