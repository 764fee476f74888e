"""What a bench puts between analyser and motor and how often it reads: options of a sweep that not every analyser has."""

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
        How long it takes to raise the voltage, and to take it away.
    """

    volt: float = 0.0
    limit_a: float = 1e-3
    ramp_s: float = 1.0


@dataclass(frozen=True)
class SweepOptions:
    """Options of a sweep; the defaults are what every analyser does.

    Parameters
    ----------
    adapter : str
        Between analyser and fixture: a word of `motoremi.data.analyser.ADAPTERS`.
    fixture : str
        A word of `motoremi.data.analyser.FIXTURES`.
    sweep_averages, point_averages : int
        Of how many sweeps, and of how many readings at each point, a result is the mean.
    bias : Bias
    segments : tuple of Segment
        A list sweep instead of one from start to stop, if there are any.
    """

    adapter: str = "none"
    fixture: str = "none"
    sweep_averages: int = 1
    point_averages: int = 1
    bias: Bias = field(default_factory=Bias)
    segments: tuple[Segment, ...] = ()

    def needed(self) -> list[str]:
        """Which options an analyser must have, by the name of their key in a procedure; any analyser may stand in any fixture."""
        asked = {
            "adapter": self.adapter != "none",
            "sweep_averages": self.sweep_averages > 1,
            "point_averages": self.point_averages > 1,
            "bias": self.bias.volt != 0,
            "segments": bool(self.segments),
        }
        return [name for name, is_asked in asked.items() if is_asked]
