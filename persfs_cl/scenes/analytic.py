"""Surfaces in closed form that have silhouettes or creases, or no frame of one depth.

Depth is given in closed form over the image, so a scene is the same continuous surface at every image
size of one aspect ratio, and errors can be measured under refinement.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from persfs_cl.camera import Camera
from persfs_cl.checks import check_choice, check_finite, check_positive
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.scenes.exposure import FRONTAL, MATT, Exposure, checked_shape, frame, put_together, square_camera, turn
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import brief

VaseKnown = Literal["background and frame", "background"]


def vase(
    shape: tuple[int, int] = (100, 100),
    *,
    light: Light = FRONTAL,
    reflectance: Reflectance = MATT,
    bits: int | None = 8,
    noise: float = 0.0,
    seed: int = 0,
    offset: float = 1.0,
    surface: Surface = "away",
    known: VaseKnown = "background and frame",
) -> Scene:
    """Vase of the paper, eq. (13), a body of revolution in front of a flat background.

    The camera sees an image one unit wide and one unit high at depth one: its focal length is (width, height)
    pixels. With h the height of eq. (13), the depth is ``offset`` ± h, and ``offset`` on the background. The
    slopes are infinite at the silhouette, so the equation is not solvable exactly there at any image size.

    Parameters
    ----------
    shape : tuple of int
        (height, width) in pixels, at least 3 × 3. The paper's is 100 × 100.
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    bits : int or None
        Grey levels of the image, 2**bits; None leaves it unquantised. The highest level is 1, under a flash the
        brightest value of the image.
    noise : float
        Standard deviation of normal noise, added before quantisation, as a share of 1, under a flash of the brightest
        value of the image. What it takes below 0 or, but for a flash, above 1 is cut off.
    seed : int
        The same seed, at least 0, gives the same noise.
    offset : float
        Depth of the background, which the paper leaves open.
    surface : {"away", "toward"}
        ``"away"``: depth = offset + h, the vase as a hollow, which is what a known background leads to.
        ``"toward"``: depth = offset - h.
    known : {"background and frame", "background"}
        Where ``known_depth`` holds the truth. The top and bottom of the vase are cut by the image frame;
        ``"background"`` leaves these cuts unknown.

    Returns
    -------
    Scene
        ``mask`` is True on the vase.

    Raises
    ------
    InputError
        When an argument is out of its range, or the vase would reach the camera.

    Examples
    --------
    The paper's image, whose background faces the camera and the light:

    >>> import persfs_cl as ps
    >>> scene = ps.vase()
    >>> scene.image.shape, float(scene.image[0, 0]), float(scene.depth[0, 0])
    ((100, 100), 1.0, 1.0)
    """
    height, width = checked_shape(shape)
    exposure = Exposure(light, reflectance, bits, noise, seed)
    check_choice("surface", surface, Surface)
    check_choice("known", known, VaseKnown)
    check_positive("offset", offset)
    camera = Camera(focal_length=(float(width), float(height)))
    grid = camera.grid(shape)
    u, v = grid.x, 0.5 - grid.y
    t = np.polynomial.Polynomial([0, 1])
    profile = 0.15 - 0.1 * t * (6 * t + 1) ** 2 * (t - 1) ** 2 * (3 * t - 2)
    radius, radius_slope = profile(v), profile.deriv()(v)
    squared = radius**2 - u**2
    inside = squared > 0
    bulge = np.sqrt(np.where(inside, squared, 0.0))
    sign = 1.0 if surface == "away" else -1.0
    depth = offset + sign * bulge
    if depth.min() <= 0:
        raise InputError.about("offset", offset, f"puts the vase behind the camera: give more than {bulge.max():.3g}.")
    scale = np.divide(sign, bulge * depth, out=np.zeros_like(depth), where=inside)
    # v points up and y down, hence the opposite signs.
    p, q = -u * scale, -radius * radius_slope * scale
    known_here = ~inside if known == "background" else ~inside | frame(shape)
    return put_together("vase", camera, exposure, surface, depth, (p, q), mask=inside, known=known_here)


def hillside(
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
    relief: float = 0.15,
) -> Scene:
    """A smooth hollow or hill on a slope, off the middle: nothing about it is special to a pixel or to the frame.

    depth = (1 ± relief exp(-4 |X - C|²)) / (1 + u² F·X), C = (0.3, -0.2), F = (-0.4, 0.25), in the coordinates of
    :func:`persfs_cl.bump` and with their unit u: a plane through depth 1 that faces the camera at X = F, and on it the
    bump.

    At every edge of the image a hill moves away from the camera, so that a flash photograph determines it without
    any boundary values. So does a hollow in a view as wide as the default one; in a narrow view it comes closer
    towards an edge, and the depth of that edge must be known.

    Parameters
    ----------
    shape, focal_length, light, reflectance, bits, noise, seed, orientation
        As for :func:`persfs_cl.bump`.
    surface : {"away", "toward"}
        Whether the bump is a hollow in the slope, or a hill.
    relief : float
        Height of the bump, as a share of the depth of the slope.

    Returns
    -------
    Scene
        ``mask`` is True everywhere, ``known_depth`` is given on the frame.

    Raises
    ------
    InputError
        When an argument is out of its range, the hill would reach the camera, or the view is so wide that it looks
        past the slope.
    CameraError
        When the focal length is impossible.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.hillside((40, 60), light=ps.FlashLight(), surface="toward")
    >>> scene.image.shape, scene.surface
    ((40, 60), 'toward')
    """
    exposure = Exposure(light, reflectance, bits, noise, seed)
    check_choice("surface", surface, Surface)
    check_positive("relief", relief)
    camera = square_camera(shape, focal_length)
    grid = camera.grid(shape)
    unit = min(shape[1] * grid.dx, shape[0] * grid.dy) / 2
    cosine, sine = turn(orientation)
    right, down = (cosine * grid.x - sine * grid.y) / unit, (sine * grid.x + cosine * grid.y) / unit

    signed_relief = relief if surface == "away" else -relief
    value = signed_relief * np.exp(-4 * ((right - 0.3) ** 2 + (down + 0.2) ** 2))
    fall_right, fall_down = -0.4 * unit**2, 0.25 * unit**2
    plane = 1 + fall_right * right + fall_down * down
    if plane.min() <= 0:
        raise InputError.about("focal_length", focal_length, "gives a view that looks past the slope: give more.")
    if value.min() <= -1:
        raise InputError.about("relief", relief, "takes the surface behind the camera: give less.")
    slope_right = -8 * (right - 0.3) * value / (1 + value) - fall_right / plane
    slope_down = -8 * (down + 0.2) * value / (1 + value) - fall_down / plane
    p, q = (cosine * slope_right + sine * slope_down) / unit, (cosine * slope_down - sine * slope_right) / unit
    return put_together("hillside", camera, exposure, surface, (1 + value) / plane, (p, q))


def sphere_cap(
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
    radius: float = 0.6,
    centre: tuple[float, float] = (0.2, 0.0),
) -> Scene:
    """Cap of a true sphere on the plane z = 1 that faces the camera, by ray intersection in closed form.

    The surface has a crease at the rim of the cap, where slope and brightness jump. Under a frontal light the
    plane has E = 1 and takes the depth of the frame. Under an oblique light the plane is given too: part of
    the rim is then a valley from which the surface rises on both sides, and such a valley, like a dip, cannot
    be found from the frame.

    Parameters
    ----------
    shape, focal_length, light, reflectance, bits, noise, seed, orientation
        As for :func:`persfs_cl.bump`.
    surface : {"away", "toward"}
        A spherical hollow in the plane, or a cap that stands out of it.
    relief : float
        Height of the cap, in units of the depth of the plane. It sets the steepness: at the rim the cap is
        inclined by 2 atan(relief / base radius). This and the angle between optical axis and viewing ray must
        stay below 90° together, for a steeper rim is hidden, or as dark as r / sqrt(1 + r²), where the
        equation no longer determines the surface.
    radius : float
        Radius of the cap's base, as a share of half the smaller side of the image.
    centre : tuple of float
        (x, y) of the base before the rotation, in the same unit, from the image centre.

    Returns
    -------
    Scene
        ``mask`` is True everywhere, ``known_depth`` is given on the frame, under an oblique light also on the
        plane.

    Raises
    ------
    InputError
        When an argument is out of its range, the cap does not fit into the image, or is too steep.
    CameraError
        When the focal length is impossible.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.sphere_cap((41, 41), relief=0.125, centre=(0.0, 0.0))
    >>> round(float(scene.depth[20, 20]), 9), float(scene.depth[0, 0])
    (1.125, 1.0)
    """
    exposure = Exposure(light, reflectance, bits, noise, seed)
    check_choice("surface", surface, Surface)
    check_positive("relief", relief)
    check_positive("radius", radius)
    check_finite("centre", *centre)
    camera = square_camera(shape, focal_length)
    grid = camera.grid(shape)
    unit = min(shape[1] * grid.dx, shape[0] * grid.dy) / 2
    reach = math.hypot(*centre) + radius
    if reach >= 1:
        raise InputError.about(
            "radius",
            radius,
            f"around centre={brief(centre)} reaches {reach:.3g} of the way to the edge of the image: keep it below 1.",
        )
    base = radius * unit
    incline = 2 * math.atan(relief / base)
    steepest = base * math.tan((math.pi / 2 - math.atan(reach * unit)) / 2)
    if relief >= min(steepest, 1.0):
        raise InputError.about(
            "relief",
            relief,
            f"inclines the rim of the cap by {math.degrees(incline):.0f}°, too steep to be"
            f" seen all round: give less than {min(steepest, 1.0):.3g}.",
        )
    cosine, sine = turn(orientation)
    centre_x = unit * (cosine * centre[0] + sine * centre[1])
    centre_y = unit * (cosine * centre[1] - sine * centre[0])
    sign = 1.0 if surface == "away" else -1.0
    sphere_radius = base / math.sin(incline)
    centre_z = 1 - sign * (sphere_radius - relief)

    inside = (grid.x - centre_x) ** 2 + (grid.y - centre_y) ** 2 < base**2
    ray_squared = 1 + grid.x**2 + grid.y**2
    along = centre_x * grid.x + centre_y * grid.y + centre_z
    power = centre_x**2 + centre_y**2 + centre_z**2 - sphere_radius**2
    # Rays outside the cap may miss the sphere; what the root makes of them is not used.
    root = np.sqrt(np.maximum(along**2 - ray_squared * power, 0.0))
    depth = np.where(inside, (along + sign * root) / ray_squared, 1.0)
    # The derivative of |z (x, y, 1) - centre|² = const, in which (x, y, 1) · (z (x, y, 1) - centre) = ± root.
    p, q = (
        np.divide(sign * (middle - depth * slope), root, out=np.zeros_like(depth), where=inside)
        for middle, slope in ((centre_x, grid.x), (centre_y, grid.y))
    )
    known = frame(shape) if exposure.tilt == (0.0, 0.0) else frame(shape) | ~inside
    scene = put_together("sphere cap", camera, exposure, surface, depth, (p, q), known=known)
    if not exposure.brightest_on_top:
        return scene
    top = 1 + sign * relief
    # Rounded so that a top on a pixel centre is found there in spite of rounding.
    row = round(centre_y / top / grid.dy + (shape[0] - 1) / 2, 9)
    column = round(centre_x / top / grid.dx + (shape[1] - 1) / 2, 9)
    return replace(scene, singular_point=(row, column))
