"""Table 2 and Figure 3: a real photograph, under protocol P.

The paper's statue is not to be had. In its place stands a modelled skull, taken as the statue was, by a camera's own
flash, and at the same size in pixels: see ``data/README.md`` for its author and its licence. What the paper does is
done: a mean filter, the grey values as the file has them stretched by (2), a frontal light, zero boundary conditions,
here on the outline of the skull. There is no true depth; the surface is re-rendered by (6), and compared with the
filtered photograph in grey levels of 255. So is the surface that is found when the light is taken for the flash that it
is.
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.colour import encode_srgb
from persfs_cl.io.maps import read_mask
from persfs_cl.io.photos import Encoding, read_photo
from persfs_cl.masks import rim
from persfs_cl.metrics import Errors, compare
from persfs_cl.paper import figures, printed
from persfs_cl.paper.history import PAPERS_OWN, marching, sweeping
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings, Table
from persfs_cl.paper.tables import HERE, PRINTED, PRINTED_TANKUS, TANKUS, error_tables, time_table
from persfs_cl.preparation.prepare import Preparation, prepare_photo
from persfs_cl.preparation.prepared import Normalise, PreparedPhoto
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.solver.reconstruct import reconstruct
from persfs_cl.surface.render import render

_DATA = Path(__file__).resolve().parent.parent / "data"
PHOTO = _DATA / "skull.png"
MASK = _DATA / "skull_mask.png"
SHAPE = (280, 320)
CAMERA = Camera(1211.35, principal_point=(151.0, 132.5))
"""As the series of photographs calibrates itself."""
CAMERA_OF_EXIF = Camera(1277.7, principal_point=CAMERA.principal_point)
"""As 55 mm on a sensor of 22.2 mm would have it, focused far away."""
CAMERA_OF_PAPER = Camera(28.0)
"""The paper's focal length, and its principal point in the middle for want of another."""

_GREY = 255.0
_LAST = printed.ITERATIONS[-1:]


@cache
def inside() -> Mask:
    """Which pixels show the skull."""
    return read_mask(MASK, SHAPE)


def _prepared(mask: Mask, encoding: Encoding = "linear", mean_filter: int = 3) -> PreparedPhoto:
    photo = read_photo(PHOTO, encoding=encoding)
    return prepare_photo(photo, CAMERA, Preparation(mean_filter=mean_filter), mask=mask)


def prepared(encoding: Encoding = "linear", normalise: Normalise = "grey", mean_filter: int = 3) -> Array:
    """E of the photograph; as left out, by the paper's recipe, which takes grey values as they come."""
    return _prepared(inside(), encoding, mean_filter).normalised(normalise).image


def photographed_again(depth: Array, camera: Camera, device: Device) -> Array:
    """The image of a surface in grey levels, by (6)."""
    return _GREY * np.clip(render(depth, camera, device=device), 0.0, 1.0)


def flash_photographed_again(depth: Array, device: Device) -> Array:
    """The image of a surface by a flash, as grey levels of a file, stretched as the photograph was by (2)."""
    stretch = _prepared(inside()).normalised("grey").report
    black, white = float(stretch["black"]), float(stretch["white"])
    values = encode_srgb(render(depth, CAMERA, light=FlashLight(), device=device))
    return _GREY * np.clip((values - black) / (white - black), 0.0, 1.0)


def measured(image: Array, camera: Camera, device: Device, depth: Array) -> Errors:
    """Errors of the surface's own image under protocol P."""
    return compare(photographed_again(depth, camera, device), _GREY * image, mask=inside())


def judged_by_flash(image: Array, device: Device, depth: Array) -> Errors:
    """The same, of a surface and its image under a flash."""
    return compare(flash_photographed_again(depth, device), _GREY * image, mask=inside())


def experiment(plan: Plan) -> Findings:
    """Both methods with the paper's focal length, and with that of the camera."""
    image, mask = prepared(), inside()
    seen = np.where(mask, _GREY * image, np.nan)
    iterations = printed.ITERATIONS[:2] if plan.quick else printed.ITERATIONS
    histories = {PRINTED: printed.YANG_HAN_STATUE}
    baseline = {PRINTED_TANKUS: printed.TANKUS_STATUE}
    pictures: dict[str, Any] = {}
    at_1 = outline_at_1(mask)
    for camera, name in ((CAMERA_OF_PAPER, "figure3"), (CAMERA, "figure3-camera")):
        measure = partial(measured, image, camera, plan.device)
        common = (image, camera, measure, iterations)
        here = sweeping(*common, repeats=plan.repeats, device=plan.device, **at_1)
        tankus = marching(*common, repeats=plan.repeats, **at_1)
        focal_length = f"f = {camera.fx:.0f}"
        histories[f"{HERE}, {focal_length}"] = here.history
        baseline[f"{TANKUS}, {focal_length}"] = tankus.history
        pictures[f"{name}.png"] = partial(
            figures.statue,
            image=seen,
            depths=(here.depth, tankus.depth),
            again=[photographed_again(depth, camera, plan.device) for depth in (here.depth, tankus.depth)],
            camera=camera,
            histories=((here.history, printed.YANG_HAN_STATUE), (tankus.history, printed.TANKUS_STATUE)),
        )
    upwind = sweeping(*common, repeats=plan.repeats, device=plan.device, scheme="upwind", **at_1)
    histories[f"{HERE}, upwind, {focal_length}"] = upwind.history
    flash = sweeping(
        _prepared(mask, "srgb").light,
        CAMERA,
        partial(judged_by_flash, image, plan.device),
        iterations,
        repeats=plan.repeats,
        light=FlashLight(),
        mask=mask,
        device=plan.device,
        scheme="upwind",
    )
    histories[f"{HERE}, flash light, upwind, {focal_length}"] = flash.history
    pictures["figure3-flash.png"] = partial(
        figures.flash,
        image=seen,
        depth=flash.depth,
        again=flash_photographed_again(flash.depth, plan.device),
        camera=CAMERA,
    )
    histories |= baseline
    tables = [*error_tables("table2", histories, iterations, "{:.2f}"), time_table("table2", histories, iterations)]
    return Findings(tables if plan.quick else [*tables, _readings(plan)], pictures)


def outline_at_1(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """A mask with the paper's "zero boundary conditions", z = 1 along its edge, as keywords of both methods.

    They assume the same where no depth is given, but warn of it where a photograph speaks against it, as this one does.
    """
    return {"mask": mask, "known_depth": np.where(rim(mask), 1.0, np.nan)}


def _readings(plan: Plan) -> Table:
    """What else the photograph could be taken for, one thing at a time."""
    usual, mask, whole = prepared(), inside(), np.ones(SHAPE, dtype=np.bool_)
    framed = _prepared(whole).normalised("grey").image
    readings = {
        "none: grey values as they come, stretched by (2), going away": (usual, CAMERA, "away", mask),
        "grey values decoded from sRGB to linear light": (prepared("srgb"), CAMERA, "away", mask),
        "divided by the brightest value instead of (2)": (prepared(normalise="linear"), CAMERA, "away", mask),
        "both of these": (prepared("srgb", "linear"), CAMERA, "away", mask),
        "no mean filter": (prepared(mean_filter=1), CAMERA, "away", mask),
        "z = 1 on the frame alone, the background solved too": (framed, CAMERA, "away", whole),
        f"f = {CAMERA_OF_EXIF.fx:.0f}, by EXIF": (usual, CAMERA_OF_EXIF, "away", mask),
        "coming toward the camera": (usual, CAMERA, "toward", mask),
        "linear light, divided by the brightest value, toward": (prepared("srgb", "linear"), CAMERA, "toward", mask),
        "f = 28, as in the paper": (usual, CAMERA_OF_PAPER, "away", mask),
        "f = 28, coming toward the camera": (usual, CAMERA_OF_PAPER, "toward", mask),
    }
    rows = []
    for name, (image, camera, surface, solved) in readings.items():
        measure = partial(measured, image, camera, plan.device)
        settings: dict[str, Any] = {**outline_at_1(solved), "surface": surface}
        here = {**PAPERS_OWN, "device": plan.device, **settings}
        found = [
            sweeping(image, camera, measure, _LAST, **here).history.mean[0],
            measure(reconstruct(image, camera, **here).depth).mean,
            measure(reconstruct(image, camera, **{**here, "scheme": "upwind"}).depth).mean,
            marching(image, camera, measure, _LAST, **settings).history.mean[0],
        ]
        rows.append((name, *(f"{error:.2f}" for error in found)))
    header = ("change", "here, 30 iterations", "here, at rest", "upwind, at rest", "Tankus, 30 iterations")
    title = f"Table 2: ME at f = {CAMERA.fx:.0f} with other readings"
    return Table("table2-readings", title, header, tuple(rows), words=1)
