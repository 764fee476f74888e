"""One counter for work that is made of parts."""

from __future__ import annotations

from motoremi.arrays import Progress

WHOLE = 1000


def part(progress: Progress | None, begin: float, end: float) -> Progress | None:
    """Who is told of a part of some work; hears of the whole.

    Parameters
    ----------
    progress : callable, optional
        Told of the whole.
    begin, end : float
        Where the part begins and ends, as shares of the whole.
    """
    if progress is None:
        return None

    def tell(name: str, done: int, total: int) -> None:
        progress(name, round(WHOLE * (begin + (end - begin) * done / max(total, 1))), WHOLE)

    return tell
