"""Small random problems for the kernel tests: images, masks and known values without pattern."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from persfs_cl import Camera, Device, FlashLight, Lambertian, OrenNayar, ParallelLight, Phong
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.registers import SUFFICIENT, WIDEST, lanes
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.choices import Boundary, Surface
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare

OBLIQUE = ParallelLight(0.3, -0.2)
FLASH = FlashLight(gain=2.0)
BESIDE = FlashLight(gain=2.0, offset=(0.15, -0.1, -0.1))

LAX_FRIEDRICHS: dict[str, dict[str, Any]] = {
    "frontal away": {},
    "frontal toward": {"surface": "toward"},
    "oblique away": {"light": OBLIQUE},
    "oblique toward": {"light": OBLIQUE, "surface": "toward"},
    "flash on a rough surface": {"light": FLASH, "reflectance": OrenNayar(0.9)},
    "flash on a shiny surface": {"light": FLASH, "reflectance": Phong()},
}
UPWIND: dict[str, dict[str, Any]] = {
    **{f"upwind {name}": {**LAX_FRIEDRICHS[name], "scheme": "upwind"} for name in list(LAX_FRIEDRICHS)[:4]},
    "upwind flash": {"light": FLASH, "scheme": "upwind"},
    "upwind flash on a rough surface": {"light": FLASH, "reflectance": OrenNayar(0.4), "scheme": "upwind"},
    "upwind lamp beside": {"light": BESIDE, "scheme": "upwind"},
    "upwind lamp beside a rough surface": {"light": BESIDE, "reflectance": OrenNayar(0.4), "scheme": "upwind"},
    "upwind flash on a shiny surface": {"light": FLASH, "reflectance": Phong(), "scheme": "upwind"},
}
"""Keywords of :func:`random_problem`, each for kernels of its own."""

IN_DOUBLE_PRECISION = ["flash on a shiny surface", "upwind headlight"]
"""Those whose kernels the quick tests run in double precision, by all orderings, so that tests share programs.

By the Lax-Friedrichs scheme under a parallel light they run in both, by all others in single precision.
"""
OTHER_MATERIALS = [
    "flash on a rough surface",
    "upwind flash on a rough surface",
    "upwind lamp beside a rough surface",
    "upwind flash on a shiny surface",
]
"""With a light and a scheme that others have too: quick tests compare their kernels with the reference, no more."""


def in_turn(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters, `name` and `precision`, is a quick one, if it is of the reference."""
    name = parameters["name"]
    in_both = name in LAX_FRIEDRICHS and "flash" not in name
    return in_both or bool((parameters["precision"] == "float64") == (name in IN_DOUBLE_PRECISION))


def one_material_in_turn(parameters: Mapping[str, Any]) -> bool:
    """The same of a test of orderings."""
    return parameters["name"] not in OTHER_MATERIALS and in_turn(parameters)


def random_problem(
    seed: int,
    shape: tuple[int, int],
    *,
    surface: Surface = "away",
    boundary: Boundary = "outflow",
    light: Light = ParallelLight(),
    reflectance: Reflectance = Lambertian(),
    holes: float = 0.1,
    scheme: str = "lax-friedrichs",
    bounded: bool = False,
) -> Problem:
    """An image of noise with holes in the mask and a few known depths, and with bounds at most pixels or none."""
    random = np.random.default_rng(seed)
    image = random.uniform(0.2, 1.0, shape)
    mask = random.uniform(size=shape) > holes
    known = np.full(shape, np.nan)
    row, column = shape[0] // 2, shape[1] // 2
    known[row, column] = random.uniform(0.5, 2.0)
    known[random.uniform(size=shape) > 0.97] = random.uniform(0.5, 2.0)
    if mask.any() and not (mask & np.isnan(known)).any():
        known[:] = np.nan
        known[row, column] = 1.0
    camera = Camera(focal_length=(1.1 * max(shape) + 3, 0.9 * max(shape) + 3))
    options = complete({"light": light, "reflectance": reflectance, "scheme": scheme, "surface": surface})
    # Whatever the scheme, for the kernels that renew the boundary; and flat surfaces too.
    options["boundary"], options["max_slope"] = boundary, 30.0
    inside = mask | (np.arange(shape[1]) < 2)
    depths = None
    if bounded:
        bounds = np.sort(random.uniform(0.4, 2.2, (2, *shape)), axis=0)
        bounds[random.uniform(size=bounds.shape) < 0.3] = np.nan
        depths = np.where(np.isnan(known), bounds, np.nan)
    return prepare(image, camera, inside, None, known, None, depths, options=options)


def fitted(ordering: Ordering, device: Device, precision: str) -> Ordering:
    """The ordering with no wider vectors than the device takes, and as many of them a strip.

    Those of 16 are for registers that hold them, or would be what others are.
    """
    wide = lanes(device, precision, ordering.lanes)
    if ordering.lanes == WIDEST and precision == "float32" and 1 < wide < WIDEST:
        pytest.skip(f"{device} has no registers for vectors of {WIDEST}")
    if ordering.lanes > 1 and wide == 1:
        pytest.skip(f"{device} takes no vectors")
    return replace(ordering, lanes=wide)


def sweeper(
    problem: Problem,
    device: Device,
    precision: str,
    ordering: str | Ordering,
    *,
    linear: bool = False,
    tolerance: float = 0.0,
    rests: bool = True,
    resting: float = 0.0,
) -> Sweeper:
    """The problem on a device, in a variant that can be stepped sweep by sweep."""
    widest = WIDEST if problem.scheme.settles else SUFFICIENT
    wide = lanes(device, precision, widest)
    if isinstance(ordering, Ordering):
        ordering = fitted(ordering, device, precision)
    elif ordering == "wavefront" and wide > 1:
        # The lowest strips, so that a small image has several, and the program that compiles fastest.
        ordering = WavefrontStrips(wide, vectors=1, work_groups=device.compute_units)
    return Sweeper(
        device,
        [problem.kernel_arguments],
        model=problem.kernels,
        ordering=ordering,
        precision=precision,
        linear=linear,
        tolerance=tolerance,
        rests=rests,
        resting=resting,
    )
