"""An image and all that goes with it, with other pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_array, as_floats, as_mask, to_float64, unlike
from persfs_cl.errors import InputError
from persfs_cl.framing.frame import Frame
from persfs_cl.framing.straightened import Straightened
from persfs_cl.guide.guide import Points
from persfs_cl.maps import as_array_of_image, as_depth_range, as_image, as_known_depth, as_map, no_numbers

Bound = float | Array | None


@dataclass(frozen=True)
class Maps:
    """What goes with an image.

    Attributes
    ----------
    mask, walls : ndarray of bool, shape (height, width), or None
    known_depth : ndarray of float64, shape (height, width), or None
        NaN where unknown.
    albedo : ndarray of float64, shape (height, width), "fit", or None
    depth_range : (near, far) or None
        Numbers, arrays of that shape, or None where there is no bound.
    guide : ndarray of float64, shape (any, any), Points, or None
    """

    mask: Mask | None = None
    walls: Mask | None = None
    known_depth: Array | None = None
    albedo: Array | Literal["fit"] | None = None
    depth_range: tuple[Bound, Bound] | None = None
    guide: Array | Points | None = None

    def framed(self, frame: Frame) -> Maps:
        """The same with the pixels of another frame."""
        albedo = self.albedo
        if albedo is not None and not isinstance(albedo, str):
            means, _ = frame.light(albedo, np.isfinite(albedo))
            # Outside the old image there is nothing to paint.
            albedo = np.where(means > 0.0, means, 1.0)
        within = self.depth_range
        if within is not None:
            near, far = within
            within = (
                frame.nearest(near) if isinstance(near, np.ndarray) else near,
                frame.farthest(far) if isinstance(far, np.ndarray) else far,
            )
        guide = self.guide
        if guide is not None:
            guide = frame.points(guide) if isinstance(guide, Points) else frame.guide(guide)
        return Maps(
            None if self.mask is None else frame.mostly(self.mask),
            None if self.walls is None else frame.anywhere(self.walls),
            None if self.known_depth is None else frame.known(self.known_depth),
            albedo,
            within,
            guide,
        )


def straighten(
    image: ArrayLike,
    camera: Camera,
    mask: ArrayLike | None,
    walls: ArrayLike | None,
    known_depth: ArrayLike | None,
    albedo: ArrayLike | str | None,
    depth_range: Any,
    guide: Any,
) -> dict[str, Any]:
    """An image and what a user gave with it as a pinhole camera has them, by the keywords of `reconstruct`.

    Raises
    ------
    InputError, CameraError
        When something cannot be used.
    """
    given = as_image("image", image)
    shape = given.shape[0], given.shape[1]
    frame = Straightened(camera, shape)
    inside = np.ones(shape, bool) if mask is None else as_mask("mask", as_array_of_image("mask", mask), shape)
    maps = Maps(
        walls=None if walls is None else as_mask("walls", as_array_of_image("walls", walls), shape),
        known_depth=None if known_depth is None else as_known_depth("known_depth", known_depth, shape)[0],
        albedo=_albedo(albedo, shape),
        depth_range=_range(depth_range, shape),
        guide=guide if guide is None or isinstance(guide, Points) else _guide(guide),
    ).framed(frame)
    # Of straightened pixels each has its light from four: more would hold none than there are in the image.
    if not np.isfinite(given).all() and not np.isfinite(given[inside]).all():
        raise InputError(f"image {no_numbers(given, inside)}", argument="image", value=image)
    light, there = frame.light(given, inside)
    return {"image": light, "camera": frame.camera, **vars(maps), "mask": there}


def _albedo(given: Any, shape: tuple[int, int]) -> Any:
    return given if given is None or isinstance(given, str) else as_map("albedo", given, shape)


def _guide(given: Any) -> Array:
    values = as_floats("guide", as_array_of_image("guide", given))
    if values.ndim != 2 or values.size == 0:
        raise unlike("guide", given, f"has shape {values.shape}: give numbers of shape (height, width), or Points.")
    return values


def _range(given: Any, shape: tuple[int, int]) -> Any:
    """Two bounds, checked: numbers as they are."""
    if given is None:
        return None
    arrays = as_depth_range("depth_range", given, shape)
    return tuple(one if one is None or np.ndim(one) == 0 else array for one, array in zip(given, arrays, strict=True))


def undistort(values: ArrayLike, camera: Camera) -> tuple[Any, Camera]:
    """What a lens that bends straight lines drew, as a pinhole camera has it.

    Parameters
    ----------
    values : array_like, shape (H, W) or (H, W, channels)
        Numbers, such as linear light or depth, NaN where unknown; or bool.
    camera : Camera
        That took the image.

    Returns
    -------
    straight : ndarray of float64 or bool, shape (height, width) or (height, width, channels)
        Linear between the centres of the old pixels; NaN, or False, where the old image shows nothing. The size is
        another: all that lies up to 70 degrees from the optical axis is kept, and no detail is lost in the middle.
    camera : Camera
        The pinhole camera, of about the same focal length. Without a distortion it is the one that was given, and the
        values are a copy.

    Raises
    ------
    CameraError
        When OpenCV is not installed, or the lens shows nothing that a pinhole camera could see.
    InputError
        When `values` is no map.

    Examples
    --------
    The corners of a barrel lie farther from the middle than it draws them:

    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> camera = ps.Camera(focal_length=60.0, distortion=(-0.2, 0.03, 0.0, 0.0))
    >>> straight, pinhole = ps.undistort(np.ones((41, 61)), camera)
    >>> straight.shape, pinhole.focal_length, pinhole.distortion
    ((45, 67), (60.0, 60.0), None)
    """
    require_camera(camera)
    array = as_array("values", values)
    if array.ndim not in (2, 3) or array.size == 0 or array.dtype.kind not in "biuf":
        raise unlike(
            "values",
            values,
            f"is {array.dtype} of shape {array.shape}: give numbers or bool of shape (height, width), or of as many "
            "channels.",
        )
    if camera.distortion is None:
        return array.copy() if array.dtype == bool else as_floats("values", array).copy(), camera
    frame = Straightened(camera, (array.shape[0], array.shape[1]))
    if array.ndim == 3:
        return np.stack([_one(array[..., number], frame) for number in range(array.shape[2])], axis=2), frame.camera
    return _one(array, frame), frame.camera


def _one(array: Any, frame: Frame) -> Any:
    if array.dtype == bool:
        return frame.mostly(array)
    array = to_float64(array)
    there = np.isfinite(array)
    means, known = frame.light(np.where(there, array, 0.0), there)
    return np.where(known, means, np.nan)
