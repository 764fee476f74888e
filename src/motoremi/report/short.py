"""The sections of the short form for customers: two pages, together with the results on the first page."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from motoremi.report.all_sections import bands_table, parameters_table, results_of, sweeps_picture, sweeps_section
from motoremi.report.contents import Materials, Section, Table
from motoremi.report.emission_section import final_tables, limit_table, spectra_picture
from motoremi.report.equipment import equipment_section

# The most rows of a table for which two pages have room.
MOST_ROWS = 12
SPECTRA_INCH = 3.8


def short_sections(materials: Materials) -> tuple[Section, ...]:
    """Curves, values and verdicts of each kind of measurement, and the equipment."""
    return tuple(_sections(materials))


def _sections(materials: Materials) -> Iterator[Section]:
    results = results_of(materials.steps)
    if results:
        tables = [_narrow(parameters_table(materials.steps), 4)] if materials.steps[-1] is results[-1] else []
        # With spectra there is no room for the bands; the first page has their verdict.
        tables += [] if materials.comparison is None or materials.session.spectra else [_narrow(bands_table(materials.comparison), 8)]
        yield Section("Impedance", (), tuple(map(_first, tables)), (sweeps_picture(results),))
    elif materials.session.sweeps:
        yield sweeps_section(materials)
    if materials.session.spectra:
        prediction = materials.stored("prediction")
        judged = () if prediction is None else (*final_tables(prediction), limit_table(prediction))
        yield Section("Emission", (), tuple(map(_first, judged)), (spectra_picture(materials, SPECTRA_INCH),))
    equipment = equipment_section(materials)
    yield dataclasses.replace(equipment, tables=tuple(map(_first, equipment.tables)))


def _narrow(table: Table, columns: int) -> Table:
    return dataclasses.replace(table, columns=table.columns[:columns], rows=tuple(row[:columns] for row in table.rows))


def _first(table: Table) -> Table:
    """The marked rows and then the first others, in their order."""
    if len(table.rows) <= MOST_ROWS:
        return table
    order = sorted(range(len(table.rows)), key=lambda index: (index not in table.marked, index))
    kept = sorted(order[:MOST_ROWS])
    title = f"{table.title} ({MOST_ROWS} of {len(table.rows)}, the rest in the long form)"
    return dataclasses.replace(
        table,
        title=title,
        rows=tuple(table.rows[index] for index in kept),
        marked=frozenset(new for new, old in enumerate(kept) if old in table.marked),
    )
