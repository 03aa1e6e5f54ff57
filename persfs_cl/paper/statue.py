"""Table 2 and Figure 3: a real photograph, under protocol P.

The paper's statue is not to be had. In its place stands the face of a Buddha's head, cast and stone-like, of the same
size in pixels: see ``data/README.md`` for its authors and its licence. What the paper does is done: a mean filter, the
grey values as the file has them stretched by (2), a frontal light, zero boundary conditions. There is no true depth;
the surface is photographed again by (6), and compared with the filtered photograph in grey levels of 255.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl.camera import Camera
from persfs_cl.forward import render
from persfs_cl.images import Encoding, read_photo
from persfs_cl.metrics import Errors, compare
from persfs_cl.paper import figures, printed
from persfs_cl.paper.course import marching, sweeping
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings, Table
from persfs_cl.paper.tables import HERE, PRINTED, PRINTED_TANKUS, TANKUS, error_tables, time_table
from persfs_cl.photograph import Normalise, Preparation, prepare_photo
from persfs_cl.solver import reconstruct

Array = NDArray[np.float64]

PHOTO = Path(__file__).resolve().parent.parent / "data" / "buddha.png"
CAMERA = Camera(437.86, principal_point=(160.74, 133.44))
"""As the authors' own calibration of the photograph has it."""
CAMERA_OF_PAPER = Camera(28.0)
"""The paper's focal length, and its principal point in the middle for want of another."""

_GREY = 255.0
_LAST = printed.ITERATIONS[-1:]


def prepared(encoding: Encoding = "linear", normalise: Normalise = "grey", mean_filter: int = 3) -> Array:
    """E of the photograph; as left out, by the paper's recipe, which takes grey values as they come."""
    photo = read_photo(PHOTO, encoding=encoding)
    return prepare_photo(photo, CAMERA, Preparation(mean_filter=mean_filter)).normalised(normalise).image


def photographed_again(depth: Array, camera: Camera, device: Device) -> Array:
    """The image of a surface in grey levels, by (6)."""
    return _GREY * np.clip(render(depth, camera, device=device), 0.0, 1.0)


def judged(image: Array, camera: Camera, device: Device, depth: Array) -> Errors:
    """Errors of the surface's own image under protocol P."""
    return compare(photographed_again(depth, camera, device), _GREY * image)


def experiment(plan: Plan) -> Findings:
    """Both methods with the paper's focal length, and with that of the camera."""
    image = prepared()
    iterations = printed.ITERATIONS[:2] if plan.quick else printed.ITERATIONS
    courses = {PRINTED: printed.YANG_HAN_STATUE}
    baseline = {PRINTED_TANKUS: printed.TANKUS_STATUE}
    pictures = {}
    for camera, name in ((CAMERA_OF_PAPER, "figure3"), (CAMERA, "figure3-camera")):
        judge = partial(judged, image, camera, plan.device)
        common = (image, camera, judge, iterations)
        here = sweeping(*common, repeats=plan.repeats, device=plan.device)
        tankus = marching(*common, repeats=plan.repeats)
        focal_length = f"f = {camera.fx:.0f}"
        courses[f"{HERE}, {focal_length}"] = here.course
        baseline[f"{TANKUS}, {focal_length}"] = tankus.course
        pictures[f"{name}.png"] = partial(
            figures.statue,
            image=_GREY * image,
            depths=(here.depth, tankus.depth),
            again=[photographed_again(depth, camera, plan.device) for depth in (here.depth, tankus.depth)],
            camera=camera,
            courses=((here.course, printed.YANG_HAN_STATUE), (tankus.course, printed.TANKUS_STATUE)),
        )
    upwind = sweeping(*common, repeats=plan.repeats, device=plan.device, scheme="upwind")
    courses[f"{HERE}, upwind, {focal_length}"] = upwind.course
    courses |= baseline
    tables = [*error_tables("table2", courses, iterations, "{:.2f}"), time_table("table2", courses, iterations)]
    return Findings(tables if plan.quick else [*tables, _readings(plan)], pictures)


def _readings(plan: Plan) -> Table:
    """What else the photograph could be taken for, one thing at a time."""
    usual, of_paper = prepared(), CAMERA_OF_PAPER
    readings = {
        "none: grey values as they come, stretched by (2), going away": (usual, CAMERA, "away"),
        "grey values decoded from sRGB to linear light": (prepared("srgb"), CAMERA, "away"),
        "divided by the brightest value instead of (2)": (prepared(normalise="linear"), CAMERA, "away"),
        "both of these": (prepared("srgb", "linear"), CAMERA, "away"),
        "no mean filter": (prepared(mean_filter=1), CAMERA, "away"),
        "coming toward the camera": (usual, CAMERA, "toward"),
        "f = 28, as in the paper": (usual, of_paper, "away"),
        "f = 28, coming toward the camera": (usual, of_paper, "toward"),
    }
    rows = []
    for name, (image, camera, surface) in readings.items():
        judge = partial(judged, image, camera, plan.device)
        settings: dict[str, Any] = {"device": plan.device, "surface": surface}
        found = [
            sweeping(image, camera, judge, _LAST, **settings).course.mean[0],
            judge(reconstruct(image, camera, **settings).depth).mean,
            judge(reconstruct(image, camera, scheme="upwind", **settings).depth).mean,
            marching(image, camera, judge, _LAST, surface=surface).course.mean[0],
        ]
        rows.append((name, *(f"{error:.2f}" for error in found)))
    header = ("change", "here, 30 iterations", "here, at rest", "upwind, at rest", "Tankus, 30 iterations")
    title = f"Table 2: ME at f = {CAMERA.fx:.0f} with other readings"
    return Table("table2-readings", title, header, tuple(rows), words=1)
