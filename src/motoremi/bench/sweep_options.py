"""Options of a sweep that not every analyser has: adapter, fixture, averaging, bias, list of segments."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Segment:
    """One part of a list sweep; its points are spaced linearly."""

    start_hz: float
    stop_hz: float
    points: int


@dataclass(frozen=True)
class Bias:
    """Direct voltage across the motor while it is measured.

    Parameters
    ----------
    volt : float
        0 for none.
    limit_a : float
        Largest current that may flow.
    ramp_s : float
        Time in which the voltage is raised, and removed.
    """

    volt: float = 0.0
    limit_a: float = 1e-3
    ramp_s: float = 1.0


@dataclass(frozen=True)
class SweepOptions:
    """Options of a sweep; every analyser has the defaults.

    Parameters
    ----------
    adapter : str
        Between analyser and fixture: a word of `motoremi.data.analyser.ADAPTERS`.
    fixture : str
        A word of `motoremi.data.analyser.FIXTURES`.
    sweep_averages, point_averages : int
        Number of sweeps, and of readings at each point, of which a result is the mean.
    bias : Bias
    segments : tuple of Segment
        If there are any, a list sweep replaces the one from start to stop.
    """

    adapter: str = "none"
    fixture: str = "none"
    sweep_averages: int = 1
    point_averages: int = 1
    bias: Bias = field(default_factory=Bias)
    segments: tuple[Segment, ...] = ()

    def needed(self) -> list[str]:
        """Which options the analyser must have, by their keys in a procedure; not `fixture`, which needs nothing of the analyser."""
        asked = {
            "adapter": self.adapter != "none",
            "sweep_averages": self.sweep_averages > 1,
            "point_averages": self.point_averages > 1,
            "bias": self.bias.volt != 0,
            "segments": bool(self.segments),
        }
        return [name for name, is_asked in asked.items() if is_asked]
