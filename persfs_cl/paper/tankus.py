"""The paper's baseline: A. Tankus, N. Sochen, Y. Yeshurun, "Shape-from-shading under perspective projection", [15].

International Journal of Computer Vision 63(1), 2005, 21-43. Squared, eq. (7) is a conic in P = (p, q) = ∇ ln z,

    A_xx p² + A_yy q² + 2 A_xy p q + 2 b_x p + 2 b_y q + c = 0.

Fast marching needs a p² + b q² = F. So all but the squares goes to the right, with the slopes of the surface found
before, and one fast marching makes the next surface: an iteration. The first solves the orthographic equation. What
this leaves open is done so, which need not be how [15] did it:

- The slopes of the surface before are its upwind differences, those of the fast marching. Where the iteration
  converges, its surface is then that of ``reconstruct(scheme="upwind")``. Central differences converge in the same
  cases, but for a few under lights 20° and more to the side, to much the same errors.
- The unknown is ln z + ln(1 + p0 x + q0 y), level where the surface faces the light, as Kimmel and Sethian march in
  coordinates of the light under orthographic projection. Under the frontal light of the paper's experiments that is
  ln z. Under an oblique one the iteration in ln z does not converge even on a smooth bump: where the surface is level
  the linear terms do not vanish.
- The orthographic equation is p² + q² = 1/E² - 1, that of the same relief before a distant camera.
- F is at least 0 and no slope larger than a bound, whatever the surface before says.

Nothing is damped, and so not every image converges. The smooth scenes of :mod:`persfs_cl.scenes` do in 5 to 15
iterations under a frontal light and in 10 to 30 under one 10° to the side; from 20° on many do not. Steep flanks off
the middle of the image need not either. On a dark flank along x each iteration multiplies an error by about
|x| / (E + |x|) where the depth grows outwards, but by -|x| / (E - |x|) where it grows inwards. So a hollow with
E < 2 |x| on its flanks, such as the paper's vase grown from its background, swings for ever.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.checks import check_choice, finite_number
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.paper import fast_marching
from persfs_cl.shading.lights import require_light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare

_DARKEST = 1e-6
"""Black pixels are taken to be so bright; the largest slope is reached long before."""

_FLAT = 1e-12
"""What a negative F is set to: a slope of a millionth, which still tells what comes first."""


@dataclass(frozen=True)
class Iterate:
    """The surface after one fast marching.

    Attributes
    ----------
    depth, log_depth : ndarray of float64, shape (height, width)
        z, and ln z; NaN outside the mask and where no known value reaches. Known depths are as given.
    number : int
        1 for the orthographic surface that the others start from.
    change : float
        max |ΔZ| to the iterate before; infinite for the first.
    clamped : int
        Pixels where F was below 0, or a slope larger than `max_slope` (E too dark, or a coefficient not above 0).
    """

    depth: Array
    log_depth: Array
    number: int
    change: float
    clamped: int


def iterations(
    image: ArrayLike,
    camera: Camera,
    *,
    light: ParallelLight = ParallelLight(),
    mask: ArrayLike | None = None,
    known_depth: ArrayLike | None = None,
    surface: Surface = "away",
    max_slope: float = 5.0,
) -> Iterator[Iterate]:
    """One iterate after the other, for ever; the caller stops.

    Parameters
    ----------
    image : array_like of float, shape (height, width)
        E in [0, 1].
    camera : Camera
    light : ParallelLight
    mask : array_like of bool, shape (height, width), optional
        True where the surface is to be solved; everywhere when not given.
    known_depth : array_like of float, shape (height, width), optional
        Depths z > 0 that are kept exactly, NaN where unknown: those of the minima from which the surface grows, or of
        the frame. When not given z = 1 on the edge of the image or mask, the paper's zero boundary conditions.
    surface : {"away", "toward"}
        Which way the surface leaves the known values: Z grows away from them, or falls, coming towards the camera.
    max_slope : float
        Bound on |dZ/dx| and |dZ/dy| between neighbouring pixels, as of :func:`persfs_cl.reconstruct` with the upwind
        scheme; under an oblique light from the plane that faces it. Surfaces with a silhouette depend on it.

    Returns
    -------
    iterator of Iterate

    Raises
    ------
    InputError, CameraError
        When something cannot be used; at once, not with the first iterate.
    UnavailableError
        When numba is not installed.
    """
    if not require_light(light).normalised:
        raise InputError.about(
            "light", light, "is no parallel light, the only one of this method: give ParallelLight()."
        )
    check_choice("surface", surface, ("away", "toward"))
    if not finite_number(max_slope) > 0:
        raise InputError.about("max_slope", max_slope, "is no slope: give a finite number above 0.")
    options = complete({"light": light, "scheme": "lax-friedrichs", "surface": surface, "boundary": "wall"})
    options["max_slope"] = float(max_slope)
    problem = prepare(image, camera, mask, None, known_depth, options=options)
    facing = 1.0 + light.p0 * problem.grid.x + light.q0 * problem.grid.y
    if facing.min() <= 0.0:
        raise InputError.about(
            "light",
            light,
            ": some pixels look into the light, where no surface faces it. Crop the image, or give a "
            "light closer to the camera's axis.",
        )
    return _iterate(problem, light, problem.sign * np.log(facing), fast_marching.compiled())


@dataclass(frozen=True)
class _Conic:
    """Coefficients of A_xx p² + A_yy q² + 2 A_xy p q + 2 b_x p + 2 b_y q + c, each of shape (height, width).

    p and q are the derivatives of W = ±(ln z + ln(1 + p0 x + q0 y)).
    """

    a_xx: Array
    a_yy: Array
    a_xy: Array
    b_x: Array
    b_y: Array
    c: Array

    @classmethod
    def of(cls, image: Array, grid: PixelGrid, light: ParallelLight, sign: float) -> _Conic:
        """e² S² - n² from eq. (7) with e = k E, in W."""
        x, y, squared = grid.x, grid.y, (light.norm * image) ** 2
        offset_x, offset_y = x - light.p0, y - light.q0
        a_xx = squared * (1.0 + x**2) - offset_x**2
        a_yy = squared * (1.0 + y**2) - offset_y**2
        a_xy = squared * x * y - offset_x * offset_y
        b_x, b_y = squared * x - offset_x, squared * y - offset_y
        facing = 1.0 + light.p0 * x + light.q0 * y
        level_x, level_y = light.p0 / facing, light.q0 / facing
        centre_x, centre_y = a_xx * level_x + a_xy * level_y, a_xy * level_x + a_yy * level_y
        c = squared - 1.0 + level_x * (centre_x - 2.0 * b_x) + level_y * (centre_y - 2.0 * b_y)
        return cls(a_xx, a_yy, a_xy, sign * (b_x - centre_x), sign * (b_y - centre_y), c)

    def without_squares(self, p: Array, q: Array) -> Array:
        """F, all but the squares on the other side."""
        return -(2.0 * (self.a_xy * p * q + self.b_x * p + self.b_y * q) + self.c)


def _iterate(problem: Problem, light: ParallelLight, level: Array, march: fast_marching.March) -> Iterator[Iterate]:
    grid, known, solved = problem.grid, problem.domain.known, problem.domain.solved
    # Pixels that are not solved may hold anything.
    image = np.where(solved, np.clip(problem.image, 0.0, 1.0), 1.0)
    conic = _Conic.of(image, grid, light, problem.sign)
    a, b = np.ones_like(image), np.ones_like(image)
    force = 1.0 / np.maximum(image, _DARKEST) ** 2 - 1.0
    known_values = np.where(known, problem.start + level, np.nan)
    before: Array | None = None
    for number in count(1):
        least = np.maximum(force, _FLAT) / problem.max_slope**2
        clamped = solved & ((force < 0.0) | (a < least) | (b < least))
        weight_x, weight_y = np.maximum(a, least) / grid.dx**2, np.maximum(b, least) / grid.dy**2
        values = march(known_values, solved, weight_x, weight_y, np.maximum(force, _FLAT))
        log_depth, depth = problem.depth(values - level, converged=True)
        change = np.inf if before is None else float(np.abs(values[solved] - before[solved]).max())
        yield Iterate(depth, log_depth, number, change, int(np.count_nonzero(clamped)))
        p = _upwind_slopes(values, known | solved, grid.dx)
        q = _upwind_slopes(values.T, (known | solved).T, grid.dy).T
        a, b, force = conic.a_xx, conic.a_yy, conic.without_squares(p, q)
        before = values


def _upwind_slopes(values: Array, present: NDArray[np.bool_], spacing: float) -> Array:
    """Difference quotient along rows from the lower neighbour; 0 where neither neighbour lies below."""
    beside = np.pad(np.where(present, values, np.inf), ((0, 0), (1, 1)), constant_values=np.inf)
    left, right = beside[:, :-2], beside[:, 2:]
    rise = np.where(present, values, -np.inf) - np.minimum(left, right)
    return np.asarray(np.where(left <= right, 1.0, -1.0) * np.maximum(rise, 0.0) / spacing)
