"""Synthetic scenes whose depth, slopes and image are known exactly: ground truth for solvers.

Depth is given in closed form over the image, so a scene is the same continuous surface at every image
size of one aspect ratio, and errors can be measured under refinement.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Literal

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera, PixelGrid
from persfs_cl.checks import as_number, as_whole_number, check_choice, check_finite, check_positive
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.light import require_light
from persfs_cl.shading.material import require_reflectance
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import brief

VaseKnown = Literal["background and frame", "background"]

_FRONTAL = ParallelLight()
_MATT = Lambertian()


@dataclass(frozen=True, eq=False)
class Scene:
    """A surface, the photograph of it, and what a solver may be told.

    Attributes
    ----------
    depth : ndarray of float64, shape (height, width)
        True depth z > 0 along the optical axis, in units of the depth of the background or frame unless the
        scene says otherwise. The gain and the offset of a flash are in the same unit.
    image : ndarray of float64, shape (height, width)
        Brightness of the analytic surface, quantised, with noise as asked for; self-shadowed pixels are 0. Under a
        parallel light E of eq. (6), cut off at 1; under a flash I, as large as its gain makes it.
    camera : Camera
        Its principal point is the image centre.
    mask : ndarray of bool, shape (height, width)
        True on the surface to reconstruct.
    known_depth : ndarray of float64, shape (height, width)
        True depth where a solver under a parallel light may know it, NaN elsewhere. A flash photograph with fall-off
        determines the surface without.
    log_depth_gradient : tuple of two ndarray of float64, shape (height, width)
        p = dZ/dx and q = dZ/dy of Z = ln z in normalised image coordinates, x right and y down.
    light : ParallelLight or FlashLight
    reflectance : Reflectance
    surface : {"away", "toward"}
        Which way the surface leaves the values in ``known_depth``: the solver's keyword of that name.
    name : str
    singular_point : tuple of float or None
        (row, column), in pixels, of the scene's only peak or pit, where E = 1. None when the scene has
        several, or when its light is oblique or a flash or its material not Lambertian, which moves E = 1 off the
        peak.
    walls : ndarray of bool, shape (height, width), or None
        The nearer pixel of every two inside the mask between which the depth jumps. None where nothing jumps.
    """

    depth: Array
    image: Array
    camera: Camera
    mask: Mask
    known_depth: Array
    log_depth_gradient: tuple[Array, Array]
    light: Light
    reflectance: Reflectance
    surface: Surface
    name: str
    singular_point: tuple[float, float] | None = None
    walls: Mask | None = None

    def seeded(self) -> Scene:
        """Give the same scene with only its singular point known, as when an object's top is measured.

        Returns
        -------
        Scene
            ``known_depth`` holds the one, two or four pixels around the singular point. ``surface`` is
            reversed: what goes away from the frame comes toward the camera when seen from its own peak.

        Raises
        ------
        InputError
            When the scene has no single singular point.
        """
        if self.singular_point is None:
            raise InputError(
                f"the scene {self.name!r} under {self.light} has no single singular point to be seeded from: use its"
                " known_depth, or take a Lambertian bump or sphere_cap under a frontal light."
            )
        row, column = self.singular_point
        rows, columns = np.ogrid[: self.depth.shape[0], : self.depth.shape[1]]
        beside = (np.abs(rows - row) < 1) & (np.abs(columns - column) < 1)
        return replace(
            self,
            known_depth=np.where(beside, self.depth, np.nan),
            surface="toward" if self.surface == "away" else "away",
        )


@dataclass(frozen=True)
class Photograph:
    """How a scene is lit and taken."""

    light: Light
    reflectance: Reflectance
    bits: int | None
    noise: float
    seed: int

    def __post_init__(self) -> None:
        require_light(self.light)
        require_reflectance(self.reflectance)
        if self.bits is not None:
            as_whole_number(
                "bits", self.bits, least=1, most=32, what="a quantisation", hint=", or None for unquantised"
            )
        as_number("noise", self.noise, least=0.0, hint=": a share of the brightest value, 0 for none")
        as_whole_number("seed", self.seed, what="a start of random numbers")

    @property
    def tilt(self) -> tuple[float, float]:
        """Slopes of the plane that faces the light; the camera's own light faces what the camera faces."""
        return self.light.tilt

    @property
    def brightest_on_top(self) -> bool:
        """Whether a peak or pit has E = 1, wherever in the image it is."""
        return self.light == _FRONTAL and self.reflectance == _MATT

    def taken(self, depth: Array, log_depth_gradient: tuple[Array, Array], grid: PixelGrid) -> Array:
        """The image of a surface."""
        exact = self.light.brightness(np.log(depth), *log_depth_gradient, grid.x, grid.y, self.reflectance)
        image = self._in_range(exact)
        if not image.any():
            raise InputError.about("light", self.light, "lights nothing that the camera sees: move it to the camera.")
        if self.noise:
            spread = self.noise * self._white(image)
            image = self._in_range(image + np.random.default_rng(self.seed).normal(scale=spread, size=image.shape))
        if self.bits is None:
            return image
        white, levels = self._white(image), 2 ** int(self.bits) - 1
        return np.asarray(np.round(image * (levels / white)) / levels * white)

    def _in_range(self, image: Array) -> Array:
        return np.clip(image, 0.0, 1.0 if self.light.normalised else None)

    def _white(self, image: Array) -> float:
        return 1.0 if self.light.normalised else float(image.max())


def vase(
    shape: tuple[int, int] = (100, 100),
    *,
    light: Light = _FRONTAL,
    reflectance: Reflectance = _MATT,
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
    """
    height, width = _checked_shape(shape)
    photograph = Photograph(light, reflectance, bits, noise, seed)
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
    known_here = ~inside if known == "background" else ~inside | _frame(shape)
    return _scene("vase", camera, photograph, surface, depth, (p, q), mask=inside, known=known_here)


def bump(
    shape: tuple[int, int] = (100, 100),
    *,
    focal_length: float | tuple[float, float] | None = None,
    light: Light = _FRONTAL,
    reflectance: Reflectance = _MATT,
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
        As for :func:`vase`.
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
    """
    photograph = Photograph(light, reflectance, bits, noise, seed)

    def profile(x: Array, y: Array) -> tuple[Array, Array, Array]:
        value = np.exp(-(x**2) - 3 * y**2)
        return value, -2 * x * value, -6 * y * value

    scene = _framed("bump", profile, shape, focal_length, photograph, surface, orientation, relief)
    if not photograph.brightest_on_top:
        return scene
    return replace(scene, singular_point=((shape[0] - 1) / 2, (shape[1] - 1) / 2))


def bumps(
    shape: tuple[int, int] = (100, 100),
    *,
    focal_length: float | tuple[float, float] | None = None,
    light: Light = _FRONTAL,
    reflectance: Reflectance = _MATT,
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
    """
    photograph = Photograph(light, reflectance, bits, noise, seed)

    def profile(x: Array, y: Array) -> tuple[Array, Array, Array]:
        total, slope_x, slope_y = np.zeros((3, *np.broadcast_shapes(x.shape, y.shape)))
        for angle in np.radians((90.0, 210.0, 330.0)):
            right, down = x - 0.5 * np.cos(angle), y + 0.5 * np.sin(angle)
            value = np.exp(-12 * (right**2 + down**2))
            total += value
            slope_x -= 24 * right * value
            slope_y -= 24 * down * value
        return total, slope_x, slope_y

    scene = _framed("bumps", profile, shape, focal_length, photograph, surface, orientation, relief)
    grid = scene.camera.grid(shape)
    p0, q0 = photograph.tilt
    above_lit_plane = np.log(scene.depth * (1 + grid.x * p0 + grid.y * q0))
    lowest = _local_minima(above_lit_plane if surface == "away" else -above_lit_plane)
    return replace(scene, known_depth=np.where(lowest, scene.depth, scene.known_depth))


def hillside(
    shape: tuple[int, int] = (100, 100),
    *,
    focal_length: float | tuple[float, float] | None = None,
    light: Light = _FRONTAL,
    reflectance: Reflectance = _MATT,
    surface: Surface = "away",
    bits: int | None = None,
    noise: float = 0.0,
    seed: int = 0,
    orientation: float = 0.0,
    relief: float = 0.15,
) -> Scene:
    """A smooth hollow or hill on a slope, off the middle: nothing about it is special to a pixel or to the frame.

    depth = (1 ± relief exp(-4 |X - C|²)) / (1 + u² F·X), C = (0.3, -0.2), F = (-0.4, 0.25), in the coordinates of
    :func:`bump` and with their unit u: a plane through depth 1 that faces the camera at X = F, and on it the bump.

    At every edge of the image a hill moves away from the camera, so that a flash photograph determines it without
    any boundary values. So does a hollow in a view as wide as the default one; in a narrow view it comes closer
    towards an edge, and the depth of that edge must be known.

    Parameters
    ----------
    shape, focal_length, light, reflectance, bits, noise, seed, orientation
        As for :func:`bump`.
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
    """
    photograph = Photograph(light, reflectance, bits, noise, seed)
    check_choice("surface", surface, Surface)
    check_positive("relief", relief)
    camera = square_camera(shape, focal_length)
    grid = camera.grid(shape)
    unit = min(shape[1] * grid.dx, shape[0] * grid.dy) / 2
    cosine, sine = _turn(orientation)
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
    return _scene("hillside", camera, photograph, surface, (1 + value) / plane, (p, q))


def sphere_cap(
    shape: tuple[int, int] = (100, 100),
    *,
    focal_length: float | tuple[float, float] | None = None,
    light: Light = _FRONTAL,
    reflectance: Reflectance = _MATT,
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
        As for :func:`bump`.
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
    """
    photograph = Photograph(light, reflectance, bits, noise, seed)
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
    cosine, sine = _turn(orientation)
    centre_x = unit * (cosine * centre[0] + sine * centre[1])
    centre_y = unit * (cosine * centre[1] - sine * centre[0])
    sign = 1.0 if surface == "away" else -1.0
    sphere_radius = base / math.sin(incline)
    centre_z = 1 - sign * (sphere_radius - relief)

    inside = (grid.x - centre_x) ** 2 + (grid.y - centre_y) ** 2 < base**2
    ray_squared = 1 + grid.x**2 + grid.y**2
    along = centre_x * grid.x + centre_y * grid.y + centre_z
    power = centre_x**2 + centre_y**2 + centre_z**2 - sphere_radius**2
    # Rays beside the cap may miss the sphere; what the root makes of them is not used.
    root = np.sqrt(np.maximum(along**2 - ray_squared * power, 0.0))
    depth = np.where(inside, (along + sign * root) / ray_squared, 1.0)
    # The derivative of |z (x, y, 1) - centre|² = const, in which (x, y, 1) · (z (x, y, 1) - centre) = ± root.
    p, q = (
        np.divide(sign * (middle - depth * slope), root, out=np.zeros_like(depth), where=inside)
        for middle, slope in ((centre_x, grid.x), (centre_y, grid.y))
    )
    known = _frame(shape) if photograph.tilt == (0.0, 0.0) else _frame(shape) | ~inside
    scene = _scene("sphere cap", camera, photograph, surface, depth, (p, q), known=known)
    if not photograph.brightest_on_top:
        return scene
    top = 1 + sign * relief
    # Rounded so that a top on a pixel centre is found there in spite of rounding.
    row = round(centre_y / top / grid.dy + (shape[0] - 1) / 2, 9)
    column = round(centre_x / top / grid.dx + (shape[1] - 1) / 2, 9)
    return replace(scene, singular_point=(row, column))


def _framed(
    name: str,
    profile: Callable[[Array, Array], tuple[Array, Array, Array]],
    shape: tuple[int, int],
    focal_length: float | tuple[float, float] | None,
    photograph: Photograph,
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
    cosine, sine = _turn(orientation)
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
    return _scene(name, camera, photograph, surface, depth, (p, q))


def _scene(
    name: str,
    camera: Camera,
    photograph: Photograph,
    surface: Surface,
    depth: Array,
    log_depth_gradient: tuple[Array, Array],
    *,
    mask: Mask | None = None,
    known: Mask | None = None,
) -> Scene:
    """Photograph the surface and put the scene together: by default all is to be solved and the frame is known."""
    shape = (depth.shape[0], depth.shape[1])
    image = photograph.taken(depth, log_depth_gradient, camera.grid(shape))
    if mask is None:
        mask = np.ones(shape, dtype=bool)
    known_depth = np.where(_frame(shape) if known is None else known, depth, np.nan)
    light, reflectance = photograph.light, photograph.reflectance
    return Scene(depth, image, camera, mask, known_depth, log_depth_gradient, light, reflectance, surface, name)


def square_camera(shape: tuple[int, int], focal_length: float | tuple[float, float] | None) -> Camera:
    """A camera with its focal length; that of an image one focal length wide when none is given."""
    _, width = _checked_shape(shape)
    return Camera(focal_length=float(width) if focal_length is None else focal_length)


def _frame(shape: tuple[int, int]) -> Mask:
    frame = np.ones(shape, dtype=bool)
    frame[1:-1, 1:-1] = False
    return frame


def _local_minima(values: Array) -> Mask:
    """Pixels inside the frame that are no higher than their eight neighbours."""
    lowest = np.lib.stride_tricks.sliding_window_view(values, (3, 3)).min(axis=(2, 3))
    minima = np.zeros(values.shape, dtype=bool)
    # A minimum between pixels makes two or four of them equal, but for rounding.
    minima[1:-1, 1:-1] = values[1:-1, 1:-1] <= lowest + 1e-13
    return minima


def _turn(orientation: float) -> tuple[float, float]:
    check_finite("orientation", orientation)
    return math.cos(math.radians(orientation)), math.sin(math.radians(orientation))


def _checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    sides = tuple(shape) if isinstance(shape, Sequence) else ()
    if len(sides) != 2 or not all(isinstance(side, Integral) and side >= 3 for side in sides):
        raise InputError.about("shape", shape, "is no image size: give (height, width), both whole and at least 3.")
    return sides[0], sides[1]
