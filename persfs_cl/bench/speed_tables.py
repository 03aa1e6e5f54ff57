"""The tables on speed, of which `docs/performance.md` and `docs/batch.md` consist."""

from __future__ import annotations

from collections.abc import Callable

from persfs_cl.bench import distance as limits
from persfs_cl.bench.calls import FAST_MARCHING, SPEED
from persfs_cl.bench.cells import (
    MILLISECONDS,
    SPREAD,
    Records,
    Tables,
    a_column_each,
    by_quantity,
    factor_cell,
    iterations_cell,
    pixels_cell,
    two_digits,
    value_cell,
)
from persfs_cl.bench.convergence import ELAPSED
from persfs_cl.bench.flash import PIXELS, PIXELS_UNIT
from persfs_cl.bench.masked import BOX, CASES, FRAME, RATIO
from persfs_cl.bench.memory import OF_PHOTOGRAPHS, OF_PROCESS, ONE, PEAK, SHARE
from persfs_cl.bench.rates import PLAIN_C, RATE, RATE_UNIT
from persfs_cl.bench.report import number
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import TIME
from persfs_cl.page import markdown_table

_RATES = f"{RATE_UNIT}, {SPREAD}"


def _orderings(records: Records) -> str:
    rows = [(record.workload, pixels_cell(record), value_cell(record), factor_cell(record)) for record in records]
    return markdown_table(("what", "pixels", _RATES, f"× {PLAIN_C}"), rows, words=1)


def _beside_plain_c(head: str, name: Callable[[Record], str], records: Records) -> str:
    """A column each workload, a row each value of what is varied."""
    rows: dict[str, dict[str, str]] = {}
    for record in records:
        factor = "" if record.factor is None or record.workload == PLAIN_C else f", {factor_cell(record)} ×"
        rows.setdefault(name(record), {})[record.workload] = value_cell(record) + factor
    workloads = list(dict.fromkeys(record.workload for record in records))
    cells = [(value, *(row.get(workload, "") for workload in workloads)) for value, row in rows.items()]
    return markdown_table((head, *workloads), cells, words=1)


def _sizes(records: Records) -> str:
    return _beside_plain_c("pixels", pixels_cell, records)


def _batch(records: Records) -> str:
    # The plain C sweep has one image whatever their number.
    shared = [record for record in records if record.workload != PLAIN_C]
    return _beside_plain_c("images", lambda record: str(record.images), shared)


def _precision(records: Records) -> str:
    return _beside_plain_c("precision", lambda record: record.precision, records)


def _tunings(records: Records) -> str:
    rows = [(record.workload, value_cell(record), record.detail) for record in records]
    return markdown_table(("kernel", _RATES, ""), rows, words=1, remarks=True)


def _roofline(records: Records) -> str:
    rows = [
        (record.workload, pixels_cell(record), f"{record.quantity}, {record.unit}", value_cell(record), record.detail)
        for record in records
    ]
    return markdown_table(("what", "pixels", "quantity", SPREAD, "assumed"), rows, words=3, remarks=True)


def _small(records: Records) -> str:
    rows = [(record.workload, value_cell(record), number(record.by_device)) for record in records]
    return markdown_table(("ordering", MILLISECONDS, "of these on the device"), rows, words=1)


def _convergence(records: Records) -> str:
    last = {record.workload: record for record in records if record.quantity == ELAPSED}
    rows = [(workload, str(record.iteration), value_cell(record)) for workload, record in last.items()]
    return markdown_table(("ordering", "iterations", f"ms on the device, {SPREAD}"), rows, words=1)


def _calls(records: Records) -> str:
    rows = [
        (record.workload, _images(record), value_cell(record), factor_cell(record), _share_in_kernels(record))
        for record in records
        if record.quantity == RATE
    ]
    header = ("whole calls", "pixels", _RATES, f"× {PLAIN_C}", "in kernels, %")
    return markdown_table(header, rows, words=1)


def _images(record: Record) -> str:
    return pixels_cell(record) if record.images == 1 else f"{record.images} × {pixels_cell(record)}"


def _share_in_kernels(record: Record) -> str:
    """Of the time that a rate was found in, by the medians."""
    if record.median is None or record.by_device is None:
        return ""
    return f"{100.0 * record.median / record.by_device:.0f}"


def _fast_marching(records: Records) -> str:
    speeds = {(record.workload, record.size): value_cell(record) for record in records if record.quantity == SPEED}
    rows = []
    for record in records:
        if record.quantity == TIME:
            speed = speeds.get((record.workload, record.size), "")
            how = "" if record.median is None else record.detail
            rows.append((record.workload, pixels_cell(record), value_cell(record), speed, how))
    header = ("light, solver", "pixels", MILLISECONDS, f"× {FAST_MARCHING}'s speed", "how")
    return markdown_table(header, rows, words=1, remarks=True)


def _flash(records: Records) -> str:
    cells = []
    for place, found in by_quantity(records).items():
        time, pixels, rate = (found.get(quantity) for quantity in (TIME, PIXELS, RATE))
        told = ["" if record is None else number(record.median) for record in (pixels, rate)]
        if time is not None:
            cells.append((*place, iterations_cell(time), value_cell(time), number(time.by_device), *told))
    header = ("photograph: ordering", "pixels", "iterations", MILLISECONDS, "of these on the device", PIXELS_UNIT)
    return markdown_table((*header, f"kernels, {RATE_UNIT}"), cells, words=1)


def _masked(records: Records) -> str:
    found = {(record.workload, record.quantity): record for record in records}
    rows = [
        (
            name,
            pixels_cell(found[name, RATIO]),
            *(number(found[f"{name}: {what}", TIME].median) for what in (FRAME, BOX)),
            value_cell(found[name, RATIO]),
        )
        for name in CASES
        if (name, RATIO) in found
    ]
    header = ("an object on 1/16 of the frame", "pixels", f"ms, {FRAME}", f"ms, {BOX}", f"ratio, {SPREAD}")
    return markdown_table(header, rows, words=1)


def _distance(records: Records) -> str:
    cells = []
    for (workload, pixels), found in by_quantity(records).items():
        photograph, _, solver = workload.partition(": ")
        told = [
            value_cell(found[quantity]) if quantity in found else ""
            for quantity in (limits.ESTIMATE, limits.TRUE, limits.RATIO)
        ]
        cells.append((photograph, solver, pixels, iterations_cell(found[limits.TRUE]), *told))
    header = ("photograph", "scheme, ordering", "pixels", "iterations", "estimate", "truth", "estimate over truth")
    return markdown_table(header, cells, words=2)


def _compilation(records: Records) -> str:
    rows = [(record.workload, record.quantity, value_cell(record)) for record in records]
    return markdown_table(("ordering", "quantity", f"s, {SPREAD}"), rows, words=2)


def _memory(records: Records) -> str:
    rows = [
        (pixels_cell(record), record.quantity, f"{value_cell(record)} {record.unit}", record.detail)
        for record in records
        if record.workload == ONE
    ]
    return markdown_table(("pixels", "quantity", "value", "what"), rows, words=2, remarks=True)


def _room(records: Records) -> str:
    batch = [record for record in records if record.workload != ONE]
    columns = {OF_PHOTOGRAPHS: "MiB", OF_PROCESS: "MiB", PEAK: "MiB", SHARE: ""}
    return a_column_each("photographs", columns, batch, number)


def _tasks(records: Records) -> str:
    rows = [
        (record.workload, record.quantity, f"{value_cell(record)} {record.unit}".strip(), record.detail)
        for record in records
    ]
    return markdown_table(("what", "quantity", "value", "of"), rows, words=2, remarks=True)


def _folder(records: Records) -> str:
    columns: dict[str, list[str]] = {}
    for record in records:
        cell = two_digits(record.median)
        columns.setdefault(f"{record.quantity}, {record.unit}".rstrip(", "), []).append(cell)
    rows = []
    for place, name in enumerate(dict.fromkeys(record.workload for record in records)):
        rows.append((f"{name}, {pixels_cell(records[0])}", *(cells[place] for cells in columns.values())))
    return markdown_table(("photographs to", *columns), rows, words=1)


SPEED_TABLES: Tables = {
    "orderings": ("orderings", _orderings),
    "sizes": ("sizes", _sizes),
    "batch": ("batch", _batch),
    "precision": ("precision", _precision),
    "tunings": ("tunings", _tunings),
    "roofline": ("roofline", _roofline),
    "calls": ("calls", _calls),
    "fast-marching": ("calls", _fast_marching),
    "flash": ("flash", _flash),
    "masked": ("masked", _masked),
    "small": ("small", _small),
    "convergence": ("convergence", _convergence),
    "distance": ("distance", _distance),
    "compilation": ("compilation", _compilation),
    "memory": ("memory", _memory),
    "room": ("memory", _room),
    "tasks": ("tasks", _tasks),
    "folder": ("folder", _folder),
    "photograph": ("photograph", _tasks),
}
