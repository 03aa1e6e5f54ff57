"""Records as the tables of the pages that publish them, by the names of their markers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from typing import Any

from persfs_cl.bench import accuracy as exact
from persfs_cl.bench import distance as limits
from persfs_cl.bench import guided as guides
from persfs_cl.bench.alternatives import WENO
from persfs_cl.bench.calibration import QUANTITIES
from persfs_cl.bench.calls import FAST_MARCHING, SPEED
from persfs_cl.bench.convergence import ELAPSED
from persfs_cl.bench.endoscopy import ERROR_UNIT
from persfs_cl.bench.flash import PIXELS, PIXELS_UNIT
from persfs_cl.bench.masked import BOX, CASES, FRAME, RATIO
from persfs_cl.bench.rates import PLAIN_C, RATE, RATE_UNIT
from persfs_cl.bench.report import number
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import TIME
from persfs_cl.bench.terrain import ANGLE, ERROR
from persfs_cl.environment import summary
from persfs_cl.page import ENVIRONMENT, markdown_table

Records = Sequence[Record]

_SPREAD = "median (lowest–highest)"
_RATES = f"{RATE_UNIT}, {_SPREAD}"
_MILLISECONDS = f"ms, {_SPREAD}"


def contents(header: Mapping[str, Any], records: Records) -> dict[str, str]:
    """What belongs between the markers of a page: the environment, and the tables of the experiments that were run.

    Parameters
    ----------
    header : mapping
        As :func:`persfs_cl.environment.environment` has it.
    records : sequence of Record
        Each experiment's own all together, in the order in which they were found.
    """
    found = {ENVIRONMENT: _environment(header, records)}
    for name, (experiment, made) in _TABLES.items():
        if own := [record for record in records if record.experiment == experiment]:
            found[name] = made(own)
    return found


def markers(experiments: Iterable[str]) -> list[str]:
    """Names of the tables that come of some experiments."""
    wanted = set(experiments)
    return [name for name, (experiment, _) in _TABLES.items() if experiment in wanted]


def two_digits(value: float | None) -> str:
    """Two significant digits, never as a power of ten; empty for None."""
    return "" if value is None else format(Decimal(f"{value:.1e}"), "f")


def _environment(header: Mapping[str, Any], records: Records) -> str:
    parts = [summary(header).replace("\n", "; ")]
    parts += [record.detail for record in records if record.workload == PLAIN_C and record.median is not None][:1]
    if header["load_average"] is not None:
        parts.append(f"load average at the start {header['load_average']:.1f}")
    return "; ".join(parts)


def _value(record: Record, form: Callable[[float | None], str] = number) -> str:
    """The median, and the spread if there is one; or why it is missing."""
    if record.median is None:
        return record.detail
    spread = f" ({form(record.lowest)}–{form(record.highest)})" if record.repeats > 1 else ""
    return form(record.median) + spread


def _factor(record: Record) -> str:
    return "" if record.factor is None else f"{record.factor:.1f}"


def _pixels(record: Record) -> str:
    return f"{record.size}²" if record.size else ""


def _orderings(records: Records) -> str:
    rows = [(record.workload, _pixels(record), _value(record), _factor(record)) for record in records]
    return markdown_table(("what", "pixels", _RATES, f"× {PLAIN_C}"), rows, words=1)


def _beside_plain_c(head: str, name: Callable[[Record], str], records: Records) -> str:
    """A column each workload, a row each value of what is varied."""
    rows: dict[str, dict[str, str]] = {}
    for record in records:
        factor = "" if record.factor is None or record.workload == PLAIN_C else f", {_factor(record)} ×"
        rows.setdefault(name(record), {})[record.workload] = _value(record) + factor
    workloads = list(dict.fromkeys(record.workload for record in records))
    cells = [(value, *(row.get(workload, "") for workload in workloads)) for value, row in rows.items()]
    return markdown_table((head, *workloads), cells, words=1)


def _sizes(records: Records) -> str:
    return _beside_plain_c("pixels", _pixels, records)


def _batch(records: Records) -> str:
    # The plain C sweep has one image whatever their number.
    shared = [record for record in records if record.workload != PLAIN_C]
    return _beside_plain_c("images", lambda record: str(record.images), shared)


def _precision(records: Records) -> str:
    return _beside_plain_c("precision", lambda record: record.precision, records)


def _tunings(records: Records) -> str:
    rows = [(record.workload, _value(record), record.detail) for record in records]
    return markdown_table(("kernel", _RATES, ""), rows, words=1, remarks=True)


def _roofline(records: Records) -> str:
    rows = [
        (record.workload, _pixels(record), f"{record.quantity}, {record.unit}", _value(record), record.detail)
        for record in records
    ]
    return markdown_table(("what", "pixels", "quantity", _SPREAD, "assumed"), rows, words=3, remarks=True)


def _small(records: Records) -> str:
    rows = [(record.workload, _value(record), number(record.by_device)) for record in records]
    return markdown_table(("ordering", _MILLISECONDS, "of these on the device"), rows, words=1)


def _convergence(records: Records) -> str:
    last = {record.workload: record for record in records if record.quantity == ELAPSED}
    rows = [(workload, str(record.iteration), _value(record)) for workload, record in last.items()]
    return markdown_table(("ordering", "iterations", f"ms on the device, {_SPREAD}"), rows, words=1)


def _calls(records: Records) -> str:
    rows = [
        (record.workload, _images(record), _value(record), _factor(record), _share_in_kernels(record))
        for record in records
        if record.quantity == RATE
    ]
    header = ("whole calls", "pixels", _RATES, f"× {PLAIN_C}", "in kernels, %")
    return markdown_table(header, rows, words=1)


def _images(record: Record) -> str:
    return _pixels(record) if record.images == 1 else f"{record.images} × {_pixels(record)}"


def _share_in_kernels(record: Record) -> str:
    """Of the time that a rate was found in, by the medians."""
    if record.median is None or record.by_device is None:
        return ""
    return f"{100.0 * record.median / record.by_device:.0f}"


def _fast_marching(records: Records) -> str:
    speeds = {(record.workload, record.size): _value(record) for record in records if record.quantity == SPEED}
    rows = []
    for record in records:
        if record.quantity == TIME:
            speed = speeds.get((record.workload, record.size), "")
            how = "" if record.median is None else record.detail
            rows.append((record.workload, _pixels(record), _value(record), speed, how))
    header = ("light, solver", "pixels", _MILLISECONDS, f"× {FAST_MARCHING}'s speed", "how")
    return markdown_table(header, rows, words=1, remarks=True)


def _by_quantity(records: Records) -> dict[tuple[str, str], dict[str, Record]]:
    """Of each workload and size, what was found of it."""
    places: dict[tuple[str, str], dict[str, Record]] = {}
    for record in records:
        places.setdefault((record.workload, _pixels(record)), {})[record.quantity] = record
    return places


def _iterations(record: Record) -> str:
    return "" if record.iteration is None else str(record.iteration)


def _flash(records: Records) -> str:
    cells = []
    for place, found in _by_quantity(records).items():
        time, pixels, rate = (found.get(quantity) for quantity in (TIME, PIXELS, RATE))
        told = ["" if record is None else number(record.median) for record in (pixels, rate)]
        if time is not None:
            cells.append((*place, _iterations(time), _value(time), number(time.by_device), *told))
    header = ("photograph: ordering", "pixels", "iterations", _MILLISECONDS, "of these on the device", PIXELS_UNIT)
    return markdown_table((*header, f"kernels, {RATE_UNIT}"), cells, words=1)


def _masked(records: Records) -> str:
    found = {(record.workload, record.quantity): record for record in records}
    rows = [
        (
            name,
            _pixels(found[name, RATIO]),
            *(number(found[f"{name}: {what}", TIME].median) for what in (FRAME, BOX)),
            _value(found[name, RATIO]),
        )
        for name in CASES
        if (name, RATIO) in found
    ]
    header = ("an object on 1/16 of the frame", "pixels", f"ms, {FRAME}", f"ms, {BOX}", f"ratio, {_SPREAD}")
    return markdown_table(header, rows, words=1)


def _distance(records: Records) -> str:
    cells = []
    for (workload, pixels), found in _by_quantity(records).items():
        photograph, _, solver = workload.partition(": ")
        told = [
            _value(found[quantity]) if quantity in found else ""
            for quantity in (limits.ESTIMATE, limits.TRUE, limits.RATIO)
        ]
        cells.append((photograph, solver, pixels, _iterations(found[limits.TRUE]), *told))
    header = ("photograph", "scheme, ordering", "pixels", "iterations", "estimate", "truth", "estimate over truth")
    return markdown_table(header, cells, words=2)


def _compilation(records: Records) -> str:
    rows = [(record.workload, record.quantity, _value(record)) for record in records]
    return markdown_table(("ordering", "quantity", f"s, {_SPREAD}"), rows, words=2)


def _memory(records: Records) -> str:
    rows = [(_pixels(record), record.quantity, f"{_value(record)} {record.unit}", record.detail) for record in records]
    return markdown_table(("pixels", "quantity", "value", "what"), rows, words=2, remarks=True)


def _tasks(records: Records) -> str:
    rows = [
        (record.workload, record.quantity, f"{_value(record)} {record.unit}".strip(), record.detail)
        for record in records
    ]
    return markdown_table(("what", "quantity", "value", "of"), rows, words=2, remarks=True)


def _accuracy(records: Records) -> str:
    by_workload: dict[str, dict[int, str]] = {}
    orders = {}
    for record in records:
        if record.quantity == exact.ORDER:
            orders[record.workload] = "" if record.median is None else f"{record.median:.2f}"
        else:
            found = by_workload.setdefault(record.workload, {})
            found[record.size] = f"{two_digits(record.median)} ({record.iteration})"
    sizes = sorted({size for found in by_workload.values() for size in found})
    rows = [
        (scene, scheme, *(by_workload[name].get(size, "") for size in sizes), orders.get(name, ""))
        for scheme in exact.SCHEMES
        for scene in exact.SCENES
        if (name := exact.workload(scene, scheme)) in by_workload
    ]
    return markdown_table(("scene", "scheme", *(f"{size}²" for size in sizes), "order"), rows, words=2)


def _noise(records: Records) -> str:
    rows: dict[str, list[str]] = {}
    for record in records:
        rows.setdefault(record.workload, [_pixels(record)]).append(_value(record, two_digits))
    last = {record.workload: "" if record.iteration is None else str(record.iteration) for record in records}
    # One that was skipped has the reason, and nothing after it.
    cells = [(workload, *row, *[""] * (3 - len(row)), last[workload]) for workload, row in rows.items()]
    header = ("photograph", "pixels", f"mean error, {exact.SHARE}", "after one scale", "iterations")
    return markdown_table(header, cells, words=1)


def _flash_materials(records: Records) -> str:
    errors = {record.workload: record for record in records if record.quantity == exact.ERROR_SCALED}
    names = list(exact.UNDER_FLASH)
    rows = []
    for true in names:
        cells = [two_digits(errors[exact.taken("flash", true, assumed)].median) for assumed in names]
        rows.append((true, *(f"**{cell}**" if name == true else cell for name, cell in zip(names, cells, strict=True))))
    return markdown_table(("truly", *(f"as {name}" for name in names)), rows, words=1)


def _parallel_materials(records: Records) -> str:
    found = {(record.workload, record.quantity): two_digits(record.median) for record in records}
    rows = []
    for light in (f"{name}, {surface}" for name in exact.PARALLEL for surface in exact.SURFACES):
        for true in exact.UNDER_PARALLEL:
            right, matt = exact.taken(light, true, true), exact.taken(light, true, exact.MATT)
            cells = [found[right, exact.ERROR], found[right, exact.GREY_ERROR]]
            cells += ["", ""] if right == matt else [found[matt, exact.ERROR], found[matt, exact.GREY_ERROR]]
            rows.append((light, true, f"**{cells[0]}**", *cells[1:]))
    header = ("light and surface", "truly", "as what it is", "grey error", "as Lambertian", "grey error")
    return markdown_table(header, rows, words=2)


def _ambiguity(records: Records) -> str:
    rows: dict[tuple[str, str], list[str]] = {}
    for record in records:
        rows.setdefault((record.workload, _pixels(record)), []).append(two_digits(record.median))
    cells = [(*place, *errors) for place, errors in rows.items()]
    return markdown_table(("material", "pixels", exact.ERROR, exact.GREY_ERROR), cells, words=1)


def _lamp(records: Records) -> str:
    rows: dict[tuple[str, str], list[str]] = {}
    for record in records:
        scene, _, _scheme = record.workload.partition(": ")
        settled = "" if record.detail.endswith(", converged") else ", not settled"
        cell = f"{two_digits(record.median)} ({record.iteration}{settled})"
        rows.setdefault((scene, _pixels(record)), []).append(cell)
    header = ("hill, flash", "pixels", *exact.LAMP_SCHEMES)
    return markdown_table(header, [(*place, *cells) for place, cells in rows.items()], words=1)


def _calibration(records: Records) -> str:
    return _a_column_each("known: also sought", QUANTITIES, records)


def _a_column_each(head: str, quantities: Mapping[str, str], records: Records) -> str:
    """A row each workload, a column each of the quantities, which have units."""
    found: dict[str, dict[str, str]] = {}
    for record in records:
        found.setdefault(record.workload, {})[record.quantity] = _value(record, two_digits)
    header = (head, *(f"{name}, {unit}".rstrip(", ") for name, unit in quantities.items()))
    rows = [(name, *(cells.get(quantity, "") for quantity in quantities)) for name, cells in found.items()]
    return markdown_table(header, rows, words=1)


def _guided(records: Records) -> str:
    flash = {record.workload for record in records if record.quantity == guides.ALONE}
    own = [record for record in records if record.workload in flash]
    return _a_column_each("object: guide", guides.QUANTITIES, own)


def _guided_lights(records: Records) -> str:
    flash = {record.workload for record in records if record.quantity == guides.ALONE}
    own = [record for record in records if record.workload not in flash]
    told = {record.quantity: record.unit for record in own}
    return _a_column_each("scene: light", told, own)


def _endoscopy(records: Records) -> str:
    rows = [
        (record.workload, _value(record, two_digits), "" if record.median is None else record.detail)
        for record in records
    ]
    return markdown_table(("what", f"mean error, {ERROR_UNIT}", "over"), rows, words=1, remarks=True)


def _weno(records: Records) -> str:
    rows: dict[tuple[str, str], list[str]] = {}
    for record in records:
        photograph, _, _scheme = record.workload.partition(": ")
        after = ", ".join(filter(None, (str(record.iteration), record.detail)))
        cell = record.detail if record.median is None else f"{two_digits(record.median)} ({after})"
        rows.setdefault((photograph, _pixels(record)), []).append(cell)
    header = ("photograph", "pixels", *exact.SCHEMES, WENO)
    return markdown_table(header, [(*place, *cells) for place, cells in rows.items()], words=1)


def _folder(records: Records) -> str:
    columns: dict[str, list[str]] = {}
    for record in records:
        cell = two_digits(record.median)
        columns.setdefault(f"{record.quantity}, {record.unit}".rstrip(", "), []).append(cell)
    rows = []
    for place, name in enumerate(dict.fromkeys(record.workload for record in records)):
        rows.append((f"{name}, {_pixels(records[0])}", *(cells[place] for cells in columns.values())))
    return markdown_table(("photographs to", *columns), rows, words=1)


def _terrain(records: Records) -> str:
    rows: dict[tuple[str, str], dict[str, str]] = {}
    for name, cell in _errors_and_angles(records).items():
        photograph, way = name.split(": ")
        noise, prior = photograph.split(", ")
        rows.setdefault((prior, way), {})[noise] = cell
    noises = list(dict.fromkeys(noise for row in rows.values() for noise in row))
    cells = [(*key, *(row.get(noise, "") for noise in noises)) for key, row in rows.items()]
    return markdown_table(("blocks", "what", *noises), cells, words=2)


def _priors(records: Records) -> str:
    rows: dict[str, dict[str, str]] = {}
    for name, cell in _errors_and_angles(records).items():
        scene, way = name.split(": ") if ": " in name else (name, "")
        rows.setdefault(scene, {})[way] = cell
    ways = list(dict.fromkeys(way for row in rows.values() for way in row if way))
    cells = [(scene, *(row.get(way, row.get("", "")) for way in ways)) for scene, row in rows.items()]
    return markdown_table(("scene", *ways), cells, words=1)


def _energy(records: Records) -> str:
    rows: dict[int, list[str]] = {}
    for record in records:
        form = two_digits if record.quantity in (ERROR, ANGLE) else number
        rows.setdefault(record.size, []).append(_value(record, form))
    cells = [(f"{size}²", *row) for size, row in rows.items()]
    return markdown_table(
        ("pixels", _MILLISECONDS, "iterations", "error, % of the relief", "angle of normals, °"), cells, words=1
    )


def _errors_and_angles(records: Records) -> dict[str, str]:
    """By workload: its error in percent and its angle in degrees, or why they are missing."""
    found: dict[str, str] = {}
    for record in records:
        if record.median is None:
            found[record.workload] = record.detail
        elif record.quantity == ERROR:
            found[record.workload] = f"{two_digits(record.median)} %"
        else:
            found[record.workload] += f", {two_digits(record.median)}°"
    return found


_TABLES: dict[str, tuple[str, Callable[[Records], str]]] = {
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
    "tasks": ("tasks", _tasks),
    "accuracy": ("accuracy", _accuracy),
    "noise": ("noise", _noise),
    "flash-materials": ("reflectance", _flash_materials),
    "parallel-materials": ("reflectance", _parallel_materials),
    "ambiguity": ("ambiguity", _ambiguity),
    "lamp": ("lamp", _lamp),
    "calibration": ("calibration", _calibration),
    "guided": ("guided", _guided),
    "guided-lights": ("guided", _guided_lights),
    "endoscopy": ("endoscopy", _endoscopy),
    "weno": ("weno", _weno),
    "terrain": ("terrain", _terrain),
    "priors": ("priors", _priors),
    "painted": ("painted", _priors),
    "energy": ("energy", _energy),
    "folder": ("folder", _folder),
    "photograph": ("photograph", _tasks),
}
"""By the name of the marker: the experiment whose records a table shows, and what makes it of them."""
