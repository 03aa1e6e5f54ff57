"""The file of one camera, of any kind that is read."""

from __future__ import annotations

from pathlib import Path

from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.calibrations import Calibrated, read_calibration
from persfs_cl.io.colmap import read_colmap_cameras, unknown_model


def read_camera(path: Path) -> Calibrated:
    """What the file of one camera says, see :meth:`persfs_cl.Camera.from_file`.

    Raises
    ------
    InputError, CameraError
        When it cannot be read, or does not hold one camera.
    """
    if path.suffix.lower() != ".txt":
        return read_calibration(path)
    cameras = list(read_colmap_cameras(path).values())
    if len(cameras) > 1:
        raise InputError(f"{path} has {len(cameras)} cameras: leave the line of one; a batch may have a table of all.")
    if cameras[0].camera is None:
        raise CameraError(unknown_model(path, cameras[0]))
    return cameras[0].camera
