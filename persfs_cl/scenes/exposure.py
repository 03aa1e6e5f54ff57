"""How a scene is lit and taken: from a surface to its image, and to the scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import as_number, as_whole_number, check_finite
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.lights import require_light
from persfs_cl.shading.materials import require_reflectance
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance

FRONTAL = ParallelLight()
MATT = Lambertian()


@dataclass(frozen=True)
class Exposure:
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
        return self.light == FRONTAL and self.reflectance == MATT

    def of(self, depth: Array, log_depth_gradient: tuple[Array, Array], grid: PixelGrid) -> Array:
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


def put_together(
    name: str,
    camera: Camera,
    exposure: Exposure,
    surface: Surface,
    depth: Array,
    log_depth_gradient: tuple[Array, Array],
    *,
    mask: Mask | None = None,
    known: Mask | None = None,
) -> Scene:
    """Photograph the surface and put the scene together: by default all is to be solved and the frame is known."""
    shape = (depth.shape[0], depth.shape[1])
    image = exposure.of(depth, log_depth_gradient, camera.grid(shape))
    if mask is None:
        mask = np.ones(shape, dtype=bool)
    known_depth = np.where(frame(shape) if known is None else known, depth, np.nan)
    light, reflectance = exposure.light, exposure.reflectance
    return Scene(depth, image, camera, mask, known_depth, log_depth_gradient, light, reflectance, surface, name)


def square_camera(shape: tuple[int, int], focal_length: float | tuple[float, float] | None) -> Camera:
    """A camera with its focal length; that of an image one focal length wide when none is given."""
    _, width = checked_shape(shape)
    return Camera(focal_length=float(width) if focal_length is None else focal_length)


def frame(shape: tuple[int, int]) -> Mask:
    """The outermost pixels of an image of shape (height, width)."""
    edge = np.ones(shape, dtype=bool)
    edge[1:-1, 1:-1] = False
    return edge


def turn(orientation: float) -> tuple[float, float]:
    """Cosine and sine of an angle in degrees."""
    check_finite("orientation", orientation)
    return math.cos(math.radians(orientation)), math.sin(math.radians(orientation))


def checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Height and width; InputError when they are none, or below 3."""
    sides = tuple(shape) if isinstance(shape, Sequence) else ()
    if len(sides) != 2 or not all(isinstance(side, Integral) and side >= 3 for side in sides):
        raise InputError.about("shape", shape, "is no image size: give (height, width), both whole and at least 3.")
    return sides[0], sides[1]
