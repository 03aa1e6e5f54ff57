"""The forward model: the photograph that a surface would give."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl._cl import launches
from persfs_cl._cl.device import Device, select_device
from persfs_cl.camera import Camera, PixelGrid
from persfs_cl.domain import SWEPT, missing_neighbours
from persfs_cl.errors import InputError
from persfs_cl.light import ParallelLight
from persfs_cl.reflectance import Lambertian


def shading_model(light: ParallelLight, reflectance: Lambertian) -> str:
    """Kernel file that holds the Hamiltonian of a light and a reflectance.

    Raises
    ------
    InputError
        When there is none for them.
    """
    if isinstance(light, ParallelLight) and isinstance(reflectance, Lambertian):
        return "parallel_light"
    raise InputError(
        f"light={light!r} with reflectance={reflectance!r} is no known model: give a ParallelLight and Lambertian()."
    )


def kernel_parameters(
    grid: PixelGrid, light: ParallelLight, *, sign: float = 1.0, max_slope: float = 1.0
) -> list[float]:
    """Numbers of one image in the order of kernels/prelude.cl and kernels/parallel_light.cl."""
    spacing = [0.5 / grid.dx, 0.5 / grid.dy, max_slope * grid.dx, max_slope * grid.dy, max_slope]
    return [*spacing, light.p0, light.q0, 1.0 / light.norm, sign]


def kernel_axes(grid: PixelGrid, light: ParallelLight) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Numbers of the columns and of the rows, shapes (3, width) and (3, height): see kernels/lax_friedrichs.cl.

    Coordinate x, and the two terms of σx / (2 dx) = (E sqrt(1 + x²) + |x - p0| / k) / (2 dx); likewise for y.
    """
    tables = []
    for coordinate, spacing, slope in ((grid.x, grid.dx, light.p0), (grid.y[:, 0], grid.dy, light.q0)):
        root, offset = np.sqrt(1.0 + coordinate**2), np.abs(coordinate - slope) / light.norm
        tables.append(np.stack([coordinate, root / (2.0 * spacing), offset / (2.0 * spacing)]))
    return tables[0], tables[1]


def render(
    depth: ArrayLike,
    camera: Camera,
    *,
    light: ParallelLight = ParallelLight(),
    reflectance: Lambertian = Lambertian(),
    mask: ArrayLike | None = None,
    device: int | str | Device | None = None,
    precision: str = "float32",
) -> NDArray[np.float64]:
    """Photograph a surface, eq. (6).

    Parameters
    ----------
    depth : array_like, shape (height, width)
        z > 0 along the optical axis, in any unit; NaN where there is no surface.
    camera : Camera
    light : ParallelLight
        Frontal by default.
    reflectance : Lambertian
    mask : array_like of bool, shape (height, width), optional
        Pixels to render; derivatives do not look across its edge.
    device : optional
        As for :func:`reconstruct`.
    precision : {"float32", "float64"}

    Returns
    -------
    ndarray of float64, shape (height, width)
        E, at most 1; negative where the surface turns its back to the light; NaN outside.

    Raises
    ------
    InputError
        When the depth is not a positive 2-D array, or the mask does not fit it.
    DeviceError
        When the device does not exist or lacks the precision.

    Notes
    -----
    Derivatives of ln z are central differences, one-sided beside the edge of the surface.
    """
    model = shading_model(light, reflectance)
    if not isinstance(camera, Camera):
        raise InputError(f"camera={camera!r} is no Camera: give Camera(focal_length=...) or Camera.from_fov(...).")
    if precision not in ("float32", "float64"):
        raise InputError(f"precision={precision!r} is not a choice: use one of float32, float64.")
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
    log_depth = np.log(np.where(present, values, 1.0))
    # The level of Z is irrelevant under a parallel light; near zero single precision resolves its differences best.
    log_depth -= np.median(log_depth[present])
    flags = missing_neighbours(present) | present * np.uint8(SWEPT)
    grid = camera.grid((values.shape[0], values.shape[1]))
    image = launches.render(
        select_device(device),
        model,
        precision,
        log_depth,
        flags,
        kernel_parameters(grid, light),
        grid.x,
        grid.y[:, 0],
    )
    return image.astype(np.float64)
