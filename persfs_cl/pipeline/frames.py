"""Which pixels a photo is solved with: straightened where its lens bends lines, and fewer where that is asked for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera, camera_from
from persfs_cl.checks import warn
from persfs_cl.errors import CameraError, InputError
from persfs_cl.framing.frame import Frame
from persfs_cl.framing.reduced import Reduced, reduced_shape
from persfs_cl.framing.straightened import Straightened
from persfs_cl.io.calibrations import camera_of
from persfs_cl.io.files import read_bytes
from persfs_cl.surface.formats.records import CAMERA

LEAST_SIZE = 8
"""Pixels of the longer side below which no surface is left."""


def frames_for(camera: Camera, shape: tuple[int, int], size: int | None) -> list[Frame]:
    """The steps from the pixels of a photo to those that are solved, none where they are the same.

    Parameters
    ----------
    camera : Camera
        Of the photo.
    shape : (int, int)
        (height, width) of the photo.
    size : int or None
        Pixels that the longer side is to have at most.

    Raises
    ------
    CameraError
        When the distortion of the lens cannot be undone.
    """
    frames: list[Frame] = []
    if camera.distortion is not None:
        frames.append(Straightened(camera, shape))
        camera, shape = frames[-1].camera, frames[-1].shape
    if size is not None and size < max(shape):
        frames.append(Reduced(camera, shape, reduced_shape(shape, size)))
    return frames


def in_depth(points: Array, depth: Path, shape: tuple[int, int]) -> Array | None:
    """Places of a photo in the pixels of a depth map that has others, by the camera.json beside it.

    Parameters
    ----------
    points : ndarray of float64, shape (n, 3)
        Column, row, and what goes with them.
    depth : Path
        The file of the depth map.
    shape : (int, int)
        (height, width) of the depth map.

    Returns
    -------
    ndarray of float64, shape (n, 3), or None
        NaN for places that the depth map does not see. None where it has the photo's own pixels, or nothing tells.

    Warns
    -----
    UserWarning
        When there is such a file, and it cannot be used.
    """
    path = depth.with_name(CAMERA)
    if not path.exists():
        return None
    try:
        content = json.loads(read_bytes(path))
        # Another program's file may have this name.
        if not isinstance(content, dict) or "photo" not in content:
            return None
        straight, taken = camera_of(path, content), camera_of(path, content["photo"])
    except (InputError, CameraError, ValueError, RecursionError) as error:
        warn(f"{path} cannot be used ({error}): points are taken to be in the pixels of {depth}.")
        return None
    if straight.size != shape or taken.size is None:
        warn(f"{path} is of another depth map than {depth}: points are taken to be in the pixels of this.")
        return None
    if straight == taken:
        return None
    places = camera_from(path, taken).places(points[:, :2], taken.size)
    return np.column_stack([camera_from(path, straight).pixels(places, shape), points[:, 2:]])
