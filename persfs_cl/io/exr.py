"""Depth maps in OpenEXR files, read and written by the package OpenEXR."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, atomic_path, not_written, opened
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.remarks import decoding

_DEPTHS = ("z", "depth")
"""Last part of the name of the channel that holds the depth, in small letters, where there are several."""


def read_exr(path: Path) -> NDArray[Any]:
    """The depth channel of an OpenEXR file: that called Z, or its only one.

    Raises
    ------
    InputError
        When it cannot be read, or none of several channels is the depth; when OpenEXR is not installed.
    """
    OpenEXR = _package(path)  # noqa: N806  # its name
    # It names neither a missing file nor an empty one.
    with opened(path):
        pass
    with decoding(path), OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
        (left, top), (right, bottom) = (np.asarray(corner).tolist() for corner in file.header()["dataWindow"])
        require_pixels(path, (bottom - top + 1, right - left + 1), weight=4)
    with decoding(path), OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        names = list(channels)
        name = (
            names[0]
            if len(names) == 1
            else next((name for name in names if name.rpartition(".")[2].lower() in _DEPTHS), None)
        )
        if name is None:
            raise InputError(f"{path} has the channels {', '.join(names)}, and none is called Z: save the depth as Z.")
        return np.array(channels[name].pixels)


def write_exr(path: FilePath, depth: Array) -> None:
    """Write a depth map as the channel Z, in single precision.

    Parameters
    ----------
    path : path
    depth : ndarray of float, shape (height, width)
        NaN where there is none.

    Raises
    ------
    InputError
        When it cannot be written, or OpenEXR is not installed.
    """
    OpenEXR = _package(path)  # noqa: N806  # its name
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with atomic_path(path) as temporary:
        file = OpenEXR.File(header, {"Z": np.ascontiguousarray(depth, np.float32)})
        try:
            file.write(str(temporary))
        except RuntimeError as error:
            # It says so of whatever the operating system refuses.
            raise not_written(path, OSError(str(error))) from error


def _package(path: FilePath) -> Any:
    try:
        import OpenEXR
    except ImportError as error:
        raise InputError(
            f"{path} is an OpenEXR file, and the package for them is missing: pip install 'persfs-cl[exr]'."
        ) from error
    return OpenEXR
