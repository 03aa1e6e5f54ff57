"""Surfaces that need no solving, and what a manifest says of them."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from persfs_cl import Camera, FlashLight, Lambertian, devices
from persfs_cl.arrays import Array, Mask
from persfs_cl.surface.geometry import Discontinuities
from persfs_cl.surface.solved import SolvedSurface

HOSTILE = (
    "</script><script>document.title = 'taken over'</script>.png",
    "<!-- <script> & 'single' \"double\" `back`.png",
    "100% #1?a=b&c=d+e;f.png",
    "größe/写真 5/ein Bild.jpeg",
    "=cmd()|'x'!A1.png",
    "two\nlines\tand a tab.png",
    "not text \udcff\udc80.png",  # bytes of a file's name that are no UTF-8
    "separators \u2028\u2029.png",
    "__proto__",
    "a.png/{{script}}",
)
"""Names of images that may end a script, an address, a line or a cell too early."""


def surface(
    depth: Array, camera: Camera | None = None, discontinuities: Discontinuities | None = None
) -> SolvedSurface:
    solved: Mask = np.isfinite(depth)
    none = np.zeros_like(solved)
    return SolvedSurface(
        depth=depth,
        log_depth=np.log(depth),
        solved=solved,
        unreached=none,
        clamped=none,
        at_bound=none,
        image=np.where(solved, 0.5, np.nan),
        camera=camera or Camera(float(max(depth.shape))),
        light=FlashLight(),
        reflectance=Lambertian(),
        device=devices()[0],
        discontinuities=discontinuities,
    )


def dome(height: int, width: int, radius: float = 0.35) -> Array:
    """A plane at 1 with half a ball in the middle, towards the camera."""
    y, x = np.mgrid[:height, :width]
    size = max(height, width)
    squares = ((x - (width - 1) / 2) ** 2 + (y - (height - 1) / 2) ** 2) / size**2
    return np.asarray(1 - np.sqrt(np.clip(radius**2 - squares, 0, None)))


def chequered(height: int, width: int) -> NDArray[np.uint8]:
    """A photograph that nothing else looks like: red and blue squares."""
    y, x = np.mgrid[:height, :width]
    red = ((y * 8 // height + x * 8 // width) % 2).astype(bool)
    return np.where(red[..., None], [220, 30, 30], [30, 60, 220]).astype(np.uint8)


def opened(path: Path) -> NDArray[np.uint8]:
    """Pixels of a picture."""
    with Image.open(path) as picture:
        return np.asarray(picture)


def handed_over(script: str | Path) -> dict[str, Any]:
    """What relief.js hands to the page."""
    text = script.read_text("ascii") if isinstance(script, Path) else script
    assert text.startswith("persfsRelief(")
    assert text.endswith(");\n")
    values: dict[str, Any] = json.loads(text.removeprefix("persfsRelief(").removesuffix(");\n"))
    return values


def decoded(values: dict[str, Any]) -> Array:
    """Depth of the samples, NaN where there is none."""
    levels = np.frombuffer(base64.b64decode(values["levels"]), "<u2").reshape(values["grid"]).astype(float)
    least, largest = values["depth"] or (0.0, 0.0)
    return np.where(levels > 0, least + (levels - 1) / 65534 * (largest - least), np.nan)


def record(name: str, **others: Any) -> dict[str, Any]:
    """Of an image that is done."""
    return {
        "name": name,
        "path": f"/data/{name}",
        "status": "done",
        "error": None,
        "warnings": [],
        "input_hash": "0123456789abcdef",
        "parameter_hash": "fedcba9876543210",
        "version": "0.1.0",
        "device": "cpu: a processor",
        "converged": "CONVERGED",
        "iterations": 7,
        "size": [48, 64],
        "seconds": {"read": 0.02, "prepare": 0.05, "solve": 0.7, "write": 0.1},
        "finished": "2026-11-29T14:00:00+00:00",
        "files": ["depth.npy", "report.json", "preview.jpg", "photo.jpg", "relief.js"],
        "figures": {
            "focal_length": [60.0, 61.0],
            "horizontal_view": 50.0,
            "depth_min": 0.9,
            "depth_median": 1.0,
            "depth_max": 1.25,
            "solved": 3000,
            "unreached": 72,
            "clamped": 0,
            "at_bound": 0,
            "mean_error": 1.5,
            "root_mean_square": 2.25,
        },
        **others,
    }


def failure(name: str, message: str = "it is empty (0 bytes): copy or save it again.") -> dict[str, Any]:
    """Of an image that failed."""
    return {
        "name": name,
        "path": f"/data/{name}",
        "status": "failed",
        "error": {"kind": "InputError", "message": message},
        "warnings": [],
        "input_hash": None,
        "parameter_hash": "fedcba9876543210",
        "version": "0.1.0",
        "device": None,
        "converged": None,
        "iterations": None,
        "size": None,
        "seconds": {"read": 0.01},
        "finished": "2026-11-29T14:00:00+00:00",
        "files": [],
        "figures": {},
    }
