"""The forward model: the photograph that a surface would give."""

from __future__ import annotations

from typing import get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl import reference
from persfs_cl._cl import launches
from persfs_cl._cl.device import Device
from persfs_cl._cl.selection import select_device
from persfs_cl.camera import Camera
from persfs_cl.choices import Precision
from persfs_cl.domain import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, SWEPT, missing_neighbours
from persfs_cl.errors import InputError
from persfs_cl.light import FlashLight, Light, ParallelLight
from persfs_cl.models import Model
from persfs_cl.problem import require_albedo
from persfs_cl.reflectance import Lambertian, Reflectance
from persfs_cl.surface import Cuts, log_depth_gradient


def render(
    depth: ArrayLike,
    camera: Camera,
    *,
    light: Light = ParallelLight(),
    reflectance: Reflectance = Lambertian(),
    mask: ArrayLike | None = None,
    albedo: ArrayLike | None = None,
    cuts: Cuts | None = None,
    device: int | str | Device | None = None,
    precision: Precision = "float32",
) -> NDArray[np.float64]:
    """Photograph a surface: eq. (6) under a parallel light, I = κ c(θ) / r² or κ c(θ) under a flash.

    Parameters
    ----------
    depth : array_like, shape (height, width)
        z > 0 along the optical axis, in any unit, or under a flash in that of its gain; NaN where there is no surface.
    camera : Camera
    light : ParallelLight or FlashLight
        Frontal and parallel by default. With a lamp beside the camera NumPy computes the image, not the device.
    reflectance : Lambertian, OrenNayar or Phong
    mask : array_like of bool, shape (height, width), optional
        Pixels to render; derivatives do not look across its edge.
    albedo : array_like of float, shape (height, width), optional
        Share of light in (0, 1] that the surface returns, by which the image is multiplied; 1 when not given.
    cuts : Cuts, optional
        Where the surface is interrupted between pixels, as :attr:`Solution.cuts`; derivatives do not look across.
    device : optional
        As for :func:`reconstruct`.
    precision : {"float32", "float64"}

    Returns
    -------
    ndarray of float64, shape (height, width)
        Under a parallel light E, at most 1, and negative where the surface turns its back to the light; under a flash
        the brightness on the scale of the gain. NaN outside.

    Raises
    ------
    InputError
        When the depth is not a positive 2-D array, or the mask, the albedo or the cuts do not fit it.
    DeviceError
        When the device does not exist or lacks the precision.

    Notes
    -----
    Derivatives of ln z are central differences, one-sided beside the edge of the surface or a cut.
    """
    model = Model.of(light, reflectance)
    if not isinstance(camera, Camera):
        raise InputError(f"camera={camera!r} is no Camera: give Camera(focal_length=...) or Camera.from_fov(...).")
    if precision not in get_args(Precision):
        raise InputError(f"precision={precision!r} is not a choice: use one of {', '.join(get_args(Precision))}.")
    try:
        values = np.asarray(depth, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"depth is no array of numbers ({error}).") from error
    if values.ndim != 2 or values.size == 0:
        raise InputError(f"depth has shape {values.shape}: give a (height, width) array.")
    if np.isinf(values).any():
        raise InputError(
            f"depth holds {int(np.isinf(values).sum())} infinite values: use NaN where there is no surface."
        )
    present = ~np.isnan(values)
    if mask is not None:
        chosen = np.asarray(mask)
        if chosen.dtype != bool or chosen.shape != values.shape:
            raise InputError(
                f"mask is {chosen.dtype} of shape {chosen.shape}: give bool, of the depth's shape {values.shape}."
            )
        present = present & chosen
    if not present.any():
        raise InputError("depth holds no finite value inside the mask: there is nothing to render.")
    if (lowest := float(values[present].min())) <= 0:
        raise InputError(f"depth goes down to {lowest:g}: depths are distances along the optical axis and positive.")
    reflecting = None if albedo is None else require_albedo(albedo, present)
    if cuts is not None:
        cuts.check(values.shape)
    grid = camera.grid((values.shape[0], values.shape[1]))
    if isinstance(light, FlashLight) and not light.coaxial:
        # Not a kernel: done once an image, in double precision, by the formula that reconstruct() itself uses.
        surface = np.where(present, values, np.nan)
        p, q = log_depth_gradient(surface, camera, cuts)
        lit = reference.brightness(np.log(surface), p, q, grid.x, grid.y, light, reflectance)
        return lit if reflecting is None else lit * reflecting
    log_depth = np.log(np.where(present, values, 1.0))
    # Near zero single precision resolves the differences of Z best; under a flash the level scales the brightness.
    level = float(np.median(log_depth[present]))
    log_depth -= level
    flags = missing_neighbours(present) | present * np.uint8(SWEPT)
    if cuts is not None:
        flags[:, :-1][cuts.right] |= NO_RIGHT
        flags[:, 1:][cuts.right] |= NO_LEFT
        flags[:-1][cuts.down] |= NO_DOWN
        flags[1:][cuts.down] |= NO_UP
    image = launches.render(
        select_device(device),
        model.kernels,
        precision,
        log_depth,
        flags,
        model.parameters(grid),
        grid.x,
        grid.y[:, 0],
    )
    brightness: NDArray[np.float64] = image.astype(np.float64)
    if model.falls_off:
        brightness *= np.exp(-2.0 * level)
    return brightness if reflecting is None else brightness * reflecting
