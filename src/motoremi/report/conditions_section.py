"""Tables of sweeps under conditions and single values, and of the steps of an investigation."""

from __future__ import annotations

from motoremi.arrays import JsonDict
from motoremi.data.session import Session
from motoremi.quantities import percent, show, show_band
from motoremi.report.contents import Table


def beside_tables(session: Session) -> tuple[Table, ...]:
    """Sweeps under conditions and single values; no tables if there are none."""
    rows = tuple((str(sweep.condition), sweep.termination, str(len(sweep)), show_band(*sweep.span_hz)) for sweep in session.conditioned)
    values = tuple((one.name, show(one.value_si, one.unit), show(one.sigma, one.unit, 2)) for one in session.values)
    tables = []
    if rows:
        tables.append(Table("Sweeps under conditions", ("condition", "termination", "points", "span"), rows))
    if values:
        tables.append(Table("Single values", ("value", "measured", "standard uncertainty"), values))
    return tuple(tables)


def path_table(diagnosis: JsonDict) -> tuple[Table, ...]:
    """What each further measurement contributed, in the order of measurement."""
    rows = tuple((str(one["id"]), f"{one['information_bits']:.2g}", _leading(one), _mistakes(one)) for one in diagnosis.get("taught", ()))
    columns = ("measured", "bits gained", "most probable afterwards", "possible mistakes")
    return (Table("What each further measurement contributed", columns, rows),) if rows else ()


def asked_table(asked: JsonDict | None) -> tuple[Table, ...]:
    """What was asked for, why, and what was measured in answer."""
    rows = tuple((str(one["asked"] or "nothing"), str(one["why"]), str(one["brought"])) for one in (asked or {}).get("steps", ()))
    return (Table("What was asked for, and what was measured", ("asked for", "why", "measured"), rows),) if rows else ()


def _leading(taught: JsonDict) -> str:
    return ", ".join(f"{label} {_chance(share)}" for label, share in list(taught["probabilities"].items())[:3] if share >= 0.01)


def _chance(share: float) -> str:
    """A probability, never shown as certain."""
    return "> 99 %" if share > 0.995 else percent(100 * share, 2)


def _mistakes(taught: JsonDict) -> str:
    return "; ".join(str(one["says"]) for one in taught["mistakes"]) or "-"
