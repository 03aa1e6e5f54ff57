"""The forward model: the photograph that a surface would give."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl._cl import rendering
from persfs_cl._cl.device import Device
from persfs_cl._cl.selection import select_device
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_floats, as_mask, check_choice
from persfs_cl.choices import Precision
from persfs_cl.errors import InputError
from persfs_cl.maps import as_albedo
from persfs_cl.masks import NO_DOWN, NO_LEFT, NO_RIGHT, NO_UP, SWEPT, missing_neighbours
from persfs_cl.quantiles import median
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.lights import require_light
from persfs_cl.shading.materials import require_reflectance
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.surface.geometry import Discontinuities, depth_array, log_depth_gradient


def render(
    depth: ArrayLike,
    camera: Camera,
    *,
    light: Light = ParallelLight(),
    reflectance: Reflectance = Lambertian(),
    mask: ArrayLike | None = None,
    albedo: ArrayLike | None = None,
    discontinuities: Discontinuities | None = None,
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
        Frontal and parallel by default. With an off-axis lamp NumPy computes the image, not the device.
    reflectance : Lambertian, OrenNayar or Phong
    mask : array_like of bool, shape (height, width), optional
        Pixels to render; derivatives do not look across its edge.
    albedo : array_like of float, shape (height, width), optional
        Share of light in (0, 1] that the surface returns, by which the image is multiplied; 1 when not given.
    discontinuities : Discontinuities, optional
        Where the surface is interrupted between pixels, as :attr:`Solution.discontinuities`; derivatives do not look
        across.
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
        When the depth is not a 2-D array of values from 1e-30 to 1e30, or the mask, the albedo or the discontinuities
        do not fit it, or the lamp lies on it.
    DeviceError
        When the device does not exist or lacks the precision.

    Notes
    -----
    Derivatives of ln z are central differences, one-sided at the edge of the surface or at a discontinuity.

    Examples
    --------
    A plane that faces camera and lamp is darker away from the middle, where it is farther off:

    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> image = ps.render(np.full((3, 3), 2.0), ps.Camera(focal_length=2.0), light=ps.FlashLight(gain=4.0))
    >>> bool(image[1, 1] > image[0, 1] > image[0, 0])
    True
    >>> round(float(image[1, 1]), 5)
    1.0
    """
    model = require_light(light).model(require_reflectance(reflectance))
    require_camera(camera)
    check_choice("precision", precision, Precision)
    values = as_floats("depth", depth)
    if mask is not None:
        values = np.where(as_mask("mask", mask, values.shape, whose="depth"), values, np.nan)
    values = depth_array(values)
    present = ~np.isnan(values)
    if not present.any():
        raise InputError(
            "depth holds no finite value inside the mask: there is nothing to render.", argument="depth", value=depth
        )
    reflecting = None if albedo is None else as_albedo("albedo", albedo, present)
    if discontinuities is not None:
        if not isinstance(discontinuities, Discontinuities):
            raise InputError.about(
                "discontinuities",
                discontinuities,
                "is none: give Solution.discontinuities.",
            )
        discontinuities.check(values.shape)
    shape = values.shape[0], values.shape[1]
    grid = camera.grid(shape)
    camera.warn_if_off_image(shape)
    if light.off_axis:
        # Not a kernel: done once an image, in double precision, by the formula that reconstruct() itself uses.
        p, q = log_depth_gradient(values, camera, discontinuities)
        with np.errstate(divide="ignore", invalid="ignore"):
            lit = light.of_unit_gain.brightness(np.log(values), p, q, grid.x, grid.y, reflectance)
        if within := int(np.count_nonzero(~np.isfinite(lit) & present)):
            raise InputError.about(
                "light", light, f"lies on the surface, at {within} pixels of the depth: move it away."
            )
        return light.scaled(lit if reflecting is None else lit * reflecting, 0.0)
    log_depth = np.log(values)
    # Near zero single precision resolves the differences of Z best; under a flash the level scales the brightness.
    level = median(log_depth)
    log_depth -= level
    if not present.all():
        log_depth[~present] = 0.0
    flags = missing_neighbours(present) | present * np.uint8(SWEPT)
    if discontinuities is not None:
        flags[:, :-1][discontinuities.right] |= NO_RIGHT
        flags[:, 1:][discontinuities.right] |= NO_LEFT
        flags[:-1][discontinuities.down] |= NO_DOWN
        flags[1:][discontinuities.down] |= NO_UP
    image = rendering.render(
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
    if reflecting is not None:
        brightness *= reflecting
    return light.scaled(brightness, level)
