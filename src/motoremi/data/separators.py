"""Numbers that may have a separator of thousands, which is read as the decimal sign: warnings, since both readings are possible."""

from __future__ import annotations

from collections.abc import Mapping

from motoremi.arrays import FloatArray
from motoremi.data.columns import Column
from motoremi.data.numbers import look_grouped, look_partly_grouped
from motoremi.data.table import Table
from motoremi.data.text import clean_text
from motoremi.quantities import show_band

REMEDY = "if a separator of thousands is meant, write the numbers without it"


def grouping_warnings(table: Table, found: Mapping[str, Column], frequency_hz: FloatArray) -> tuple[str, ...]:
    """A sentence for each column whose numbers look like thousands with a separator.

    Frequencies in kHz or MHz may have three decimals; they are doubtful only if no other number of the table has decimals.
    """
    said = []
    column = found["frequency"]
    cells = [row[column.index] for row in table.rows]
    others_are_whole = not any("." in cell for row in table.rows for index, cell in enumerate(row) if index != column.index)
    if look_grouped(cells) and (column.factor == 1 or others_are_whole):
        said.append(f"frequencies such as {cells[0]} are read as {show_band(float(frequency_hz[0]), float(frequency_hz[-1]))}: {REMEDY}")
    for index in sorted({one.index for one in found.values()}):
        cells = [row[index] for row in table.rows]
        if look_partly_grouped(cells):
            first = next(cell for cell in cells if "." in cell)
            whole = next(cell for cell in cells if "." not in cell)
            title = clean_text(table.columns[index], 40)
            said.append(f"the column {title!r} holds numbers such as {first} and {whole}, read as they are: {REMEDY}")
    return tuple(said)
