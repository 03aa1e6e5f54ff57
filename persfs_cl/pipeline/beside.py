"""The photo that a depth map comes from, by the camera.json beside it, and what is in its pixels."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera, camera_from
from persfs_cl.checks import warn
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.calibrations import camera_of
from persfs_cl.io.files import read_bytes
from persfs_cl.surface.formats.records import CAMERA


@dataclass(frozen=True)
class OtherPixels:
    """A depth map whose pixels are not those of its photo.

    Attributes
    ----------
    camera, photo_camera : Camera
        Of the depth map, and of the photo.
    shape, photo_shape : (int, int)
        (height, width) of either.
    """

    camera: Camera
    shape: tuple[int, int]
    photo_camera: Camera
    photo_shape: tuple[int, int]

    def points(self, points: Array) -> Array:
        """Points of the photo, shape (n, 3): column, row, and what goes with them; NaN where the depth map has none."""
        places = self.photo_camera.places(points[:, :2], self.photo_shape)
        return np.column_stack([self.camera.pixels(places, self.shape), points[:, 2:]])

    def map(self, values: Array) -> Array:
        """A map of the photo in the pixels of the depth map: linear between its own, NaN where one of them is."""
        from scipy.ndimage import map_coordinates  # slow to import

        rows, columns = np.indices(self.shape, np.float64).reshape(2, -1)
        places = self.camera.places(np.stack([columns, rows], axis=1), self.shape)
        column, row = self.photo_camera.pixels(places, self.photo_shape).T
        found = map_coordinates(values, np.stack([row, column]), order=1, cval=np.nan, prefilter=False)
        return np.asarray(found.reshape(self.shape))


def other_pixels(depth: Path, shape: tuple[int, int]) -> OtherPixels | None:
    """What the camera.json beside a depth map tells of its photo.

    Parameters
    ----------
    depth : Path
        The file of the depth map.
    shape : (int, int)
        (height, width) of it.

    Returns
    -------
    OtherPixels or None
        None where it has the photo's own pixels, or nothing tells.

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
        own, photo = camera_of(path, content), camera_of(path, content["photo"])
        if own == photo:
            return None
        cameras = camera_from(path, own), camera_from(path, photo)
    except (InputError, CameraError, ValueError, RecursionError) as error:
        warn(f"{path} cannot be used ({error}): all is taken to be in the pixels of {depth}.")
        return None
    if own.size != shape or photo.size is None:
        warn(f"{path} is of another depth map than {depth}: all is taken to be in the pixels of this.")
        return None
    return OtherPixels(cameras[0], shape, cameras[1], photo.size)
