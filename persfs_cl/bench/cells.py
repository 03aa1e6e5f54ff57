"""What stands in the cells of tables of records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal

from persfs_cl.bench.report import number
from persfs_cl.bench.results import Record
from persfs_cl.page import markdown_table

Records = Sequence[Record]

Tables = Mapping[str, tuple[str, Callable[[Records], str]]]
"""By the name of the marker: the experiment whose records a table shows, and what makes it of them."""

SPREAD = "median (lowest–highest)"
MILLISECONDS = f"ms, {SPREAD}"


def two_digits(value: float | None) -> str:
    """Two significant digits, never as a power of ten; empty for None."""
    return "" if value is None else format(Decimal(f"{value:.1e}"), "f")


def value_cell(record: Record, form: Callable[[float | None], str] = number) -> str:
    """The median, and the spread if there is one; or why it is missing."""
    if record.median is None:
        return record.detail
    spread = f" ({form(record.lowest)}–{form(record.highest)})" if record.repeats > 1 else ""
    return form(record.median) + spread


def factor_cell(record: Record) -> str:
    """How many times the baseline's rate it is, if that is known."""
    return "" if record.factor is None else f"{record.factor:.1f}"


def pixels_cell(record: Record) -> str:
    """The size of the image, if it is of one."""
    return f"{record.size}²" if record.size else ""


def iterations_cell(record: Record) -> str:
    """How many iterations were done, if any."""
    return "" if record.iteration is None else str(record.iteration)


def by_quantity(records: Records) -> dict[tuple[str, str], dict[str, Record]]:
    """Of each workload and size, what was found of it."""
    places: dict[tuple[str, str], dict[str, Record]] = {}
    for record in records:
        places.setdefault((record.workload, pixels_cell(record)), {})[record.quantity] = record
    return places


def a_column_each(
    head: str, quantities: Mapping[str, str], records: Records, form: Callable[[float | None], str] = two_digits
) -> str:
    """A row each workload, a column each of the quantities, which have units."""
    found: dict[str, dict[str, str]] = {}
    for record in records:
        found.setdefault(record.workload, {})[record.quantity] = value_cell(record, form)
    header = (head, *(f"{name}, {unit}".rstrip(", ") for name, unit in quantities.items()))
    rows = [(name, *(cells.get(quantity, "") for quantity in quantities)) for name, cells in found.items()]
    return markdown_table(header, rows, words=1)
