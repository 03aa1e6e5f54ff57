"""How a run ended, and the surface that it found: all that is known of a reconstruction."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.guide.fit import GuideFit
from persfs_cl.surface.solved import SolvedSurface


class Status(enum.Enum):
    """How an iteration ended; the value says what that means and what to try.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> solution.status is ps.Status.CONVERGED
    True
    """

    CONVERGED = "The tolerance is met, or nothing changes any more."
    MAX_ITERATIONS = (
        "The iterations ran out before the tolerance was met: allow more of them, or accept a larger tolerance; "
        "where an off-axis lamp takes rounds, have it nearer to the camera."
    )
    STOPPED = "It was ended before the tolerance was met, by Ctrl-C or a callback: the surface is unfinished."


@dataclass(frozen=True)
class Elapsed:
    """Seconds a reconstruction took.

    Attributes
    ----------
    total : float
        From call to return.
    kernels : float
        Of these, on the device.
    build : float
        Of these, compiling kernels; next to nothing when they were compiled before.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> solution.elapsed.total > solution.elapsed.kernels > 0
    True
    """

    total: float
    kernels: float
    build: float


@dataclass(frozen=True)
class Taken:
    """The photograph that a surface comes from.

    Attributes
    ----------
    camera : Camera
        That took it, perhaps with a distortion.
    shape : (int, int)
        (height, width) of it.
    outlined : bool
        Whether it was found, or changed, which of its pixels are the surface.
    """

    camera: Camera
    shape: tuple[int, int]
    outlined: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome(SolvedSurface):
    """A surface, and how the run went that found it; :class:`persfs_cl.Solution` says what each is.

    Attributes
    ----------
    iterations : int
    changes : ndarray of float64, shape (iterations,)
    status : Status
    distance : float
    elapsed : Elapsed
    parameters : mapping
    guide : GuideFit or None
    taken_by : Taken or None
    """

    iterations: int
    changes: Array
    status: Status
    distance: float
    elapsed: Elapsed
    parameters: Mapping[str, Any]
    guide: GuideFit | None = None
    taken_by: Taken | None = None
