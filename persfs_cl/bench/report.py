"""Records as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich import box
from rich.markup import escape
from rich.table import Table

from persfs_cl.bench.convergence import ELAPSED, ERROR
from persfs_cl.bench.rates import PLAIN_C
from persfs_cl.bench.results import Record

_WORDS = ("workload", "precision", "quantity", "detail")


def table(experiment: str, records: Sequence[Record]) -> Table:
    """The records of one experiment, one a line; of a convergence only the last iterations.

    A column that is empty is left out; one that says the same everywhere moves into the title.
    """
    lines = [_line(record) for record in _last_iterations(records)]
    title = [experiment]
    shown = Table(title_justify="left", box=box.SIMPLE)
    columns = []
    for name, *cells in zip(lines[0], *(line.values() for line in lines), strict=True):
        if name in ("images", "precision") and len(set(cells)) == 1:
            title.append(f"{name}: {cells[0]}")
        elif any(cells):
            shown.add_column(name, justify="left" if name in _WORDS else "right", overflow="fold")
            columns.append(cells)
    for row in zip(*columns, strict=True):
        shown.add_row(*row)
    shown.title = ", ".join(title)
    return shown


def _line(record: Record) -> dict[str, str]:
    after = f" after {record.iteration} iterations" if record.iteration else ""
    unit = f", {record.unit}" if record.unit else ""
    once = record.median is None or record.repeats == 1
    return {
        "workload": escape(record.workload),
        "pixels": f"{record.size}²" if record.size else "",
        "images": str(record.images),
        "precision": record.precision,
        "quantity": f"{record.quantity}{after}{unit}",
        "median": number(record.median),
        "spread": "" if once else f"{number(record.lowest)} to {number(record.highest)}",
        "by device": number(record.by_device),
        f"× {PLAIN_C}": "" if record.factor is None else f"{record.factor:.1f}",
        "detail": escape(record.detail),
    }


def _last_iterations(records: Sequence[Record]) -> Iterator[Record]:
    last: dict[str, int] = {}
    for record in records:
        last[record.workload] = max(last.get(record.workload, 0), record.iteration or 0)
    for record in records:
        if record.quantity not in (ERROR, ELAPSED) or record.iteration == last[record.workload]:
            yield record


def number(value: float | None) -> str:
    """Three digits, and never fewer than those before the point; empty for None."""
    if value is None:
        return ""
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
