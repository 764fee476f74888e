"""The errors of motoremi, by the person who has to act.

Every error carries one line that says what is wrong and what to do; the command line prints that line and exits with `exit_status`.
"""

from __future__ import annotations


class MotoremiError(Exception):
    """Base of all errors that motoremi raises on purpose."""

    exit_status = 2


class BadInput(MotoremiError, ValueError):
    """A file, number or name from outside cannot be used."""


class InstrumentError(MotoremiError):
    """An instrument, or the connection to it, failed."""

    exit_status = 3


class Stopped(MotoremiError):
    """The user stopped a measurement; the message says where the measured data are stored."""

    # The status that shells use for Ctrl-C.
    exit_status = 130
