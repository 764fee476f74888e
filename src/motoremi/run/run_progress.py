"""Progress of a run in seconds, from the duration of each step in a dry run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from motoremi.arrays import JsonDict
from motoremi.bench.clock import Clock
from motoremi.run.rehearsal import Rehearsed


class RunProgress:
    """Follows a run and shows elapsed and total seconds.

    Parameters
    ----------
    rehearsed : sequence of Rehearsed
    clock : Clock
        The bench's.
    show : callable
        Called with the present step, elapsed seconds and total seconds.
    """

    def __init__(self, rehearsed: Sequence[Rehearsed], clock: Clock, show: Callable[[str, int, int], None]) -> None:
        self._seconds = {step.number: step.seconds for step in rehearsed}
        self._total = sum(self._seconds.values())
        self._clock = clock
        self._show = show
        self._step = 0
        self._doing = ""
        self._from_s = clock.now()

    def document(self, document: JsonDict) -> None:
        """A step has begun."""
        if document["kind"] == "step-start":
            self._step, self._doing = int(document["step"]), str(document["do"])
            self._from_s = self._clock.now()
            self.tick()

    def tick(self) -> None:
        """Time has passed."""
        before = sum(seconds for number, seconds in self._seconds.items() if number < self._step)
        # A step that takes longer than in the dry run counts as complete until the next one begins.
        within = min(self._clock.now() - self._from_s, self._seconds.get(self._step, 0.0))
        self._show(self._doing, int(before + within), int(self._total))
