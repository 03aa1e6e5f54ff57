"""The paper's iteration as its wording can be read, where that is not what the project solves.

The sign of (11) is put right in :func:`iterates`, since nothing comes of the other; :func:`with_minus` shows that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.image import Image
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.arrays import Array
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare
from persfs_cl.solver.reference import Reference

_SCHEME = "lax-friedrichs"
_NO_BOUND = 1e4
"""The paper bounds no slope. No surface here is so steep, and no start value so high, that this one is met."""
_NEVER = -1.0


@dataclass(frozen=True)
class Reading:
    """What the paper says, or may mean, and the project does otherwise.

    Attributes
    ----------
    start : float
        C, the value that ln z starts from where it is not known. The paper wants it above all solutions.
    one_viscosity : bool
        σx and σy are their largest values over the image, "max |∂H/∂p|", instead of those of each pixel.
    rescaled : bool
        After each iteration the height over the background is scaled so that its largest value is the true one. The
        paper normalises the height after each iteration, and does not say to what.
    """

    start: float
    one_viscosity: bool = False
    rescaled: bool = False


def iterates(scene: Scene, reading: Reading, device: Device) -> Iterator[Array]:
    """Depth maps, one after the other, for ever; the caller stops.

    Parameters
    ----------
    scene : Scene
        A surface that leaves its lowest known depth away from the camera, under a parallel light.
    reading : Reading
    device : Device

    Yields
    ------
    ndarray of float64, shape (height, width)
    """
    problem = _problem(scene)
    grid, solved = problem.kernel_arguments, problem.domain.solved
    if reading.one_viscosity:
        x_axis, y_axis = (_one_for_all(axis, scene.image.max()) for axis in (grid.x_axis, grid.y_axis))
        grid = replace(grid, x_axis=x_axis, y_axis=y_axis)
    lowest, relief = float(scene.depth.min()), float(np.ptp(scene.depth))
    values = np.where(solved, reading.start - problem.level, problem.start)
    while True:
        values = _iterated(device, problem, replace(grid, log_depth=values))
        depth = np.exp(values + problem.level)
        if reading.rescaled:
            stretch = relief / (depth[solved].max() - lowest)
            depth[solved] = lowest + stretch * (depth[solved] - lowest)
            values = np.log(depth) - problem.level
        yield depth


def with_minus(scene: Scene, start: float) -> Iterator[Array]:
    """Depth maps by (11) as it is printed, with its leading minus, for ever; the caller stops.

    In NumPy, by the reference implementation that the kernels are tested against.
    """
    problem = _problem(scene)
    reference = _Negated.of(problem)
    reference.log_depth[problem.domain.solved] = start - problem.level
    while True:
        reference.iterate()
        yield np.exp(reference.log_depth + problem.level)


class _Negated(Reference):
    """The sweep with the sign of (11) as printed."""

    def lax_friedrichs(self, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
        return -super().lax_friedrichs(rows, columns)


def _problem(scene: Scene) -> Problem:
    options = complete({"scheme": _SCHEME, "surface": scene.surface, "boundary": "outflow"})
    options["max_slope"] = _NO_BOUND
    return prepare(scene.image, scene.camera, scene.mask, None, scene.known_depth, options=options)


def _iterated(device: Device, problem: Problem, grid: Image) -> Array:
    # In double precision: C may lie far above the relief.
    precision = "float64" if device.has_float64 else "float32"
    sweeper = Sweeper(
        device,
        [grid],
        model=problem.kernels,
        ordering="wavefront",
        precision=precision,
        tolerance=_NEVER,
    )
    sweeper.run(1)
    return np.asarray(sweeper.log_depth()[0], dtype=np.float64)


def _one_for_all(axis: Array, brightest: float) -> Array:
    """The axis of an image with one viscosity for all pixels, a bound of that of each."""
    coordinate, root, offset = axis
    return np.stack([coordinate, np.zeros_like(root), np.full_like(offset, (brightest * root + offset).max())])
