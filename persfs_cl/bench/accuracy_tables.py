"""The tables on accuracy, of which `docs/accuracy.md` consists."""

from __future__ import annotations

from persfs_cl.bench import accuracy as exact
from persfs_cl.bench import guided as guides
from persfs_cl.bench.alternatives import WENO
from persfs_cl.bench.calibration import QUANTITIES
from persfs_cl.bench.cells import MILLISECONDS, Records, Tables, a_column_each, pixels_cell, two_digits, value_cell
from persfs_cl.bench.endoscopy import ERROR_UNIT
from persfs_cl.bench.report import number
from persfs_cl.bench.terrain import ANGLE, DISTANCE, ERROR
from persfs_cl.page import markdown_table


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
        rows.setdefault(record.workload, [pixels_cell(record)]).append(value_cell(record, two_digits))
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
        rows.setdefault((record.workload, pixels_cell(record)), []).append(two_digits(record.median))
    cells = [(*place, *errors) for place, errors in rows.items()]
    return markdown_table(("material", "pixels", exact.ERROR, exact.GREY_ERROR), cells, words=1)


def _lamp(records: Records) -> str:
    rows: dict[tuple[str, str], list[str]] = {}
    for record in records:
        scene, _, _scheme = record.workload.partition(": ")
        settled = "" if record.detail.endswith(", converged") else ", not settled"
        cell = f"{two_digits(record.median)} ({record.iteration}{settled})"
        rows.setdefault((scene, pixels_cell(record)), []).append(cell)
    header = ("hill, flash", "pixels", *exact.LAMP_SCHEMES)
    return markdown_table(header, [(*place, *cells) for place, cells in rows.items()], words=1)


def _calibration(records: Records) -> str:
    return a_column_each("known: also sought", QUANTITIES, records)


def _guided(records: Records) -> str:
    flash = {record.workload for record in records if record.quantity == guides.ALONE}
    own = [record for record in records if record.workload in flash]
    return a_column_each("object: guide", guides.QUANTITIES, own)


def _guided_lights(records: Records) -> str:
    flash = {record.workload for record in records if record.quantity == guides.ALONE}
    own = [record for record in records if record.workload not in flash]
    told = {record.quantity: record.unit for record in own}
    return a_column_each("scene: light", told, own)


def _endoscopy(records: Records) -> str:
    rows = [
        (record.workload, value_cell(record, two_digits), "" if record.median is None else record.detail)
        for record in records
    ]
    return markdown_table(("what", f"mean error, {ERROR_UNIT}", "over"), rows, words=1, remarks=True)


def _weno(records: Records) -> str:
    rows: dict[tuple[str, str], list[str]] = {}
    for record in records:
        photograph, _, _scheme = record.workload.partition(": ")
        after = ", ".join(filter(None, (str(record.iteration), record.detail)))
        cell = record.detail if record.median is None else f"{two_digits(record.median)} ({after})"
        rows.setdefault((photograph, pixels_cell(record)), []).append(cell)
    header = ("photograph", "pixels", *exact.SCHEMES, WENO)
    return markdown_table(header, [(*place, *cells) for place, cells in rows.items()], words=1)


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
    rows: dict[tuple[int, str], list[str]] = {}
    for record in records:
        form = two_digits if record.quantity in (DISTANCE, ERROR, ANGLE) else number
        rows.setdefault((record.size, record.workload), []).append(value_cell(record, form))
    cells = [(f"{size}²", name, *row) for (size, name), row in rows.items()]
    header = (
        "pixels",
        "until",
        MILLISECONDS,
        "iterations",
        "distance",
        "error, % of the relief",
        "angle of normals, °",
    )
    return markdown_table(header, cells, words=2)


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


ACCURACY_TABLES: Tables = {
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
    "outline": ("outline", _priors),
    "energy": ("energy", _energy),
}
