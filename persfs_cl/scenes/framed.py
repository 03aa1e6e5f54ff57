"""Smooth bumps that sink to depth 1 at the image frame, so that the frame is all that need be known.

Depth is given in closed form over the image, so a scene is the same continuous surface at every image
size of one aspect ratio, and errors can be measured under refinement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import check_choice, check_positive
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.scenes.exposure import FRONTAL, MATT, Exposure, put_together, square_camera, turn
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance


def bump(
    shape: tuple[int, int] = (100, 100),
    *,
    focal_length: float | tuple[float, float] | None = None,
    light: Light = FRONTAL,
    reflectance: Reflectance = MATT,
    surface: Surface = "away",
    bits: int | None = None,
    noise: float = 0.0,
    seed: int = 0,
    orientation: float = 0.0,
    relief: float = 0.2,
) -> Scene:
    """One smooth oblong bump that sinks to depth 1 at the image frame.

    depth = 1 ± relief g,  g = (1 - ξ²)(1 - η²) exp(-X² - 3Y²), with ξ and η running from -1 to 1 over the
    image, and X, Y the coordinates turned by ``orientation``, in units of half the smaller side of the image.
    ln g is strictly concave, so the middle is the only peak and nothing but the frame needs to be known; g is
    infinitely smooth, so that only the scheme limits the order of convergence.

    Parameters
    ----------
    shape : tuple of int
        (height, width) in pixels, at least 3 × 3.
    focal_length : float, tuple of float or None
        In pixels, f or (fx, fy); None = the image width, a view of 53°.
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    surface : {"away", "toward"}
        Whether the bump leaves the frame away from the camera (a hollow) or toward it.
    bits, noise, seed
        As for :func:`persfs_cl.vase`.
    orientation : float
        Turns the surface, not the light, counter-clockwise in the displayed image, in degrees.
    relief : float
        Height of the bump, in units of the depth of the frame. Steep reliefs leave the range in which the
        equation determines the surface: E must stay above r / sqrt(1 + r²), r² = x² + y².

    Returns
    -------
    Scene
        ``mask`` is True everywhere, ``known_depth`` is given on the frame.

    Raises
    ------
    InputError
        When an argument is out of its range, or the bump would reach the camera.
    CameraError
        When the focal length is impossible.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((51, 51), relief=0.25)
    >>> scene.singular_point
    (25.0, 25.0)
    >>> float(scene.depth[25, 25]), float(scene.image[25, 25])
    (1.25, 1.0)
    """
    exposure = Exposure(light, reflectance, bits, noise, seed)

    def profile(x: Array, y: Array) -> tuple[Array, Array, Array]:
        value = np.exp(-(x**2) - 3 * y**2)
        return value, -2 * x * value, -6 * y * value

    scene = _framed("bump", profile, shape, focal_length, exposure, surface, orientation, relief)
    if not exposure.brightest_on_top:
        return scene
    return replace(scene, singular_point=((shape[0] - 1) / 2, (shape[1] - 1) / 2))


def bumps(
    shape: tuple[int, int] = (100, 100),
    *,
    focal_length: float | tuple[float, float] | None = None,
    light: Light = FRONTAL,
    reflectance: Reflectance = MATT,
    surface: Surface = "away",
    bits: int | None = None,
    noise: float = 0.0,
    seed: int = 0,
    orientation: float = 0.0,
    relief: float = 0.1,
) -> Scene:
    """Three smooth bumps in a ring around a dip, all sinking to depth 1 at the image frame.

    depth = 1 ± relief (1 - ξ²)(1 - η²) Σ exp(-12 |X - Xi|²), in the coordinates of :func:`bump`, with the
    three Xi at distance ½ from the middle.

    The depth of the dip's lowest pixels is given along with the frame. A solver builds the surface upwards
    from known values, and every point of a bump can be reached uphill from the frame, but the dip cannot:
    whatever lies around it is higher. Its brightness tells that it is flat, not how deep it lies, and without
    its depth the solver makes a peak of it. Under an oblique light uphill means away from the plane that
    faces the light, and the lowest pixels are found accordingly.

    Parameters
    ----------
    shape, focal_length, light, reflectance, surface, bits, noise, seed, orientation
        As for :func:`bump`.
    relief : float
        Height of each bump before the factor (1 - ξ²)(1 - η²), in units of the depth of the frame.

    Returns
    -------
    Scene
        ``mask`` is True everywhere, ``known_depth`` is given on the frame and at the bottom of the dip.

    Raises
    ------
    InputError
        When an argument is out of its range, or the bumps would reach the camera.
    CameraError
        When the focal length is impossible.

    Examples
    --------
    Apart from the frame, the lowest pixel of the dip is known:

    >>> import numpy as np
    >>> import persfs_cl as ps
    >>> scene = ps.bumps((41, 41))
    >>> int(np.isfinite(scene.known_depth[1:-1, 1:-1]).sum())
    1
    """
    exposure = Exposure(light, reflectance, bits, noise, seed)

    def profile(x: Array, y: Array) -> tuple[Array, Array, Array]:
        total, slope_x, slope_y = np.zeros((3, *np.broadcast_shapes(x.shape, y.shape)))
        for angle in np.radians((90.0, 210.0, 330.0)):
            right, down = x - 0.5 * np.cos(angle), y + 0.5 * np.sin(angle)
            value = np.exp(-12 * (right**2 + down**2))
            total += value
            slope_x -= 24 * right * value
            slope_y -= 24 * down * value
        return total, slope_x, slope_y

    scene = _framed("bumps", profile, shape, focal_length, exposure, surface, orientation, relief)
    grid = scene.camera.grid(shape)
    p0, q0 = exposure.tilt
    above_lit_plane = np.log(scene.depth * (1 + grid.x * p0 + grid.y * q0))
    lowest = _local_minima(above_lit_plane if surface == "away" else -above_lit_plane)
    return replace(scene, known_depth=np.where(lowest, scene.depth, scene.known_depth))


def _framed(
    name: str,
    profile: Callable[[Array, Array], tuple[Array, Array, Array]],
    shape: tuple[int, int],
    focal_length: float | tuple[float, float] | None,
    exposure: Exposure,
    surface: Surface,
    orientation: float,
    relief: float,
) -> Scene:
    """1 ± relief (1 - ξ²)(1 - η²) profile, which returns its value and its two slopes at turned (X, Y)."""
    check_choice("surface", surface, Surface)
    check_positive("relief", relief)
    camera = square_camera(shape, focal_length)
    grid = camera.grid(shape)
    half_width, half_height = shape[1] * grid.dx / 2, shape[0] * grid.dy / 2
    unit = min(half_width, half_height)
    cosine, sine = turn(orientation)
    value, slope_right, slope_down = profile(
        (cosine * grid.x - sine * grid.y) / unit, (sine * grid.x + cosine * grid.y) / unit
    )
    slope_x = (cosine * slope_right + sine * slope_down) / unit
    slope_y = (cosine * slope_down - sine * slope_right) / unit
    window_x, window_y = 1 - (grid.x / half_width) ** 2, 1 - (grid.y / half_height) ** 2

    signed_relief = relief if surface == "away" else -relief
    depth = 1 + signed_relief * window_x * window_y * value
    if depth.min() <= 0:
        raise InputError.about("relief", relief, "takes the surface behind the camera: give less.")
    p = signed_relief * window_y * (window_x * slope_x - 2 * grid.x / half_width**2 * value) / depth
    q = signed_relief * window_x * (window_y * slope_y - 2 * grid.y / half_height**2 * value) / depth
    return put_together(name, camera, exposure, surface, depth, (p, q))


def _local_minima(values: Array) -> Mask:
    """Pixels inside the frame that are no higher than their eight neighbours."""
    lowest = np.lib.stride_tricks.sliding_window_view(values, (3, 3)).min(axis=(2, 3))
    minima = np.zeros(values.shape, dtype=bool)
    # A minimum between pixels makes two or four of them equal, but for rounding.
    minima[1:-1, 1:-1] = values[1:-1, 1:-1] <= lowest + 1e-13
    return minima
