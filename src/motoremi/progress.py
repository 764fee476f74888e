"""One progress counter for work that consists of parts."""

from __future__ import annotations

from motoremi.arrays import Progress

WHOLE = 1000


def part(progress: Progress | None, begin: float, end: float) -> Progress | None:
    """A progress function for a part of some work, which reports the progress of the whole.

    Parameters
    ----------
    progress : callable, optional
        Progress function of the whole.
    begin, end : float
        Begin and end of the part, as shares of the whole.
    """
    if progress is None:
        return None

    def tell(name: str, done: int, total: int) -> None:
        progress(name, round(WHOLE * (begin + (end - begin) * done / max(total, 1))), WHOLE)

    return tell
