"""Small images: noise, on which every branch of the kernels has its turn, and surfaces known exactly."""

from __future__ import annotations

import numpy as np

from persfs_cl.camera import Camera
from persfs_cl.choices import Boundary, Surface
from persfs_cl.scenes.analytic import hillside
from persfs_cl.scenes.framed import bump
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare
from persfs_cl.solver.schemes import SCHEMES
from persfs_cl.solver.schemes.scheme import MAX_SLOPE
from persfs_cl.solver.schemes.upwind import MAX_SLOPE_UPWIND

SMALL = (9, 13)
LARGE = (270, 250)
"""More than one work-group is given: several share the image."""
_SMOOTH = 31
_FRAMED = (131, 118)
_SEED = 7
_DARKEST, _BRIGHTEST = 0.35, 0.98
"""Of what the material returns at most: darker pixels leave some lights no slope at all."""


def noise(
    light: Light,
    reflectance: Reflectance,
    scheme: str,
    surface: Surface,
    boundary: Boundary,
    shape: tuple[int, int] = SMALL,
    *,
    bounded: bool = False,
) -> Problem:
    """An image of noise with holes in its mask, known depths here and there and, where the boundary wants it, a frame.

    Parameters
    ----------
    light, reflectance, scheme, surface, boundary
        As for :func:`persfs_cl.reconstruct`, none of them "auto".
    shape : (int, int)
    bounded : bool
        Whether most pixels have bounds of their depth.
    """
    random = np.random.default_rng(_SEED)
    options = complete(
        {"light": light, "reflectance": reflectance, "scheme": scheme, "surface": surface, "boundary": boundary}
    )
    options["max_slope"] = MAX_SLOPE
    model = SCHEMES[scheme].model(light, reflectance)
    camera = Camera((1.1 * max(shape) + 3.0, 0.9 * max(shape) + 3.0))
    most = model.brightest(camera.grid(shape))
    image = random.uniform(_DARKEST, _BRIGHTEST, shape) * (most if np.isfinite(most) else 1.0)
    mask = random.uniform(size=shape) > 0.1
    known = np.where(random.uniform(size=shape) > 0.97, random.uniform(0.5, 2.0), np.nan)
    known[shape[0] // 2, shape[1] // 2] = 1.0
    if boundary == "fixed":
        mask[:] = True
        known[[0, -1]] = known[:, [0, -1]] = 1.0
    bounds = None
    if bounded:
        bounds = np.sort(random.uniform(0.4, 2.2, (2, *shape)), axis=0)
        bounds[:, ~np.isnan(known)] = bounds[random.uniform(size=bounds.shape) > 0.7] = np.nan
    return prepare(image, camera, mask, None, known, None, bounds, options=options)


def smooth(light: Light, reflectance: Reflectance) -> tuple[Scene, Problem]:
    """A hill for the upwind scheme, where its correction to second order leaves much less error."""
    shape = (_SMOOTH, _SMOOTH)
    options = complete({"light": light, "reflectance": reflectance, "scheme": "upwind"})
    if light.determines_depth:
        scene = hillside(shape, light=light, reflectance=reflectance, surface="toward")
        known = None
    else:
        scene = bump(shape, light=light, reflectance=reflectance, surface="toward", focal_length=2.0 * _SMOOTH)
        known = scene.known_depth
        options["surface"], options["max_slope"] = "toward", MAX_SLOPE_UPWIND
    return scene, prepare(scene.image, scene.camera, None, None, known, options=options)


def framed(light: Light) -> Problem:
    """A bump whose frame is known, for the Lax-Friedrichs scheme."""
    scene = bump(_FRAMED, light=light)
    options = complete({"light": light, "scheme": "lax-friedrichs"})
    options["surface"], options["max_slope"] = scene.surface, MAX_SLOPE
    return prepare(scene.image, scene.camera, None, None, scene.known_depth, options=options)


FRONTAL, OBLIQUE = ParallelLight(), ParallelLight(0.3, -0.2)
FLASH, EVEN = FlashLight(gain=2.0), FlashLight(gain=2.5, falloff=False)
LAMP = FlashLight(gain=2.0, offset=(0.15, -0.1, -0.1))
