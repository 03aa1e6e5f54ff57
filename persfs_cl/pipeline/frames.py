"""Which pixels a photo is solved with: straightened where its lens bends lines, and fewer where that is asked for."""

from __future__ import annotations

from persfs_cl.camera import Camera
from persfs_cl.framing.frame import Frame
from persfs_cl.framing.reduced import Reduced, reduced_shape
from persfs_cl.framing.straightened import Straightened

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
