"""What is measured: sweeps of the library on a device, on images made for the purpose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.probes import device_seconds
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.bench.timing import Work
from persfs_cl.camera import Camera
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.solver.complete import complete
from persfs_cl.solver.problem import Problem, prepare
from persfs_cl.solver.schemes.lax_friedrichs import LaxFriedrichs
from persfs_cl.solver.schemes.scheme import MAX_SLOPE

# Oblique, so that no term of the equation vanishes.
LIGHT = ParallelLight(0.2, -0.1)
"""That of smooth images."""
# A change is never negative: the tolerance is never met, so that no image rests while it is measured.
_NEVER = -1.0


@dataclass(frozen=True)
class Workload:
    """Something to be timed.

    Attributes
    ----------
    name : str
    work : Work
        Its units are sweeps.
    cells : int
        Cells that a unit updates.
    detail : str
        How it is done.
    step : int
        Sweeps are done in multiples of this.
    like_plain_c : bool
        Whether a cell is updated by the formula of the plain C sweep, so that rates may be compared with its rate.
    """

    name: str
    work: Work
    cells: int
    detail: str
    step: int = 4
    like_plain_c: bool = True


def smooth_image(size: int) -> NDArray[np.float64]:
    """A square image with waves of brightness."""
    wave = np.sin(np.linspace(0.0, 7.0, size))
    return 0.75 + 0.2 * wave[:, None] * wave


def smooth_frame(size: int) -> NDArray[np.float64]:
    """The known depths of that image."""
    frame = np.full((size, size), np.nan)
    frame[[0, -1]] = frame[:, [0, -1]] = 1.0
    return frame


def smooth_problem(size: int, scheme: str = "lax-friedrichs") -> Problem:
    """That image with a known frame: every other pixel is swept."""
    options = complete({"light": LIGHT, "scheme": scheme, "boundary": "fixed"})
    options["max_slope"] = MAX_SLOPE
    return prepare(smooth_image(size), Camera(float(size)), None, None, smooth_frame(size), options=options)


def swept_cells(problem: Problem) -> int:
    """Cells that a sweep updates."""
    return int(problem.domain.solved.sum())


def sweeper(
    device: Device,
    problem: Problem,
    ordering: str | Ordering,
    precision: str,
    *,
    images: int = 1,
) -> Sweeper:
    """So many times the same image on the device; they never rest."""
    return Sweeper(
        device,
        [problem.kernel_arguments] * images,
        model=problem.kernels,
        ordering=ordering,
        precision=precision,
        tolerance=_NEVER,
        # A rate is one of cells that are computed.
        rests=False,
    )


def iterations(name: str, sweeps: Sweeper, problem: Problem) -> Workload:
    """Whole iterations on images like this one, queued as when solving: four sweeps and the search for the change."""

    def work(count: int) -> float:
        before = sweeps.kernel_seconds
        sweeps.run(max(1, count // 4))
        return sweeps.kernel_seconds - before

    return _workload(name, work, sweeps, problem, step=4 * sweeps.queued_at_least)


def sweeps_alone(name: str, device: Device, sweeps: Sweeper, problem: Problem) -> Workload:
    """Sweeps of images like this one, in all four directions in turn, and nothing else."""

    def work(count: int) -> float:
        return device_seconds(device, lambda: [sweeps.sweep_in_turn() for _ in range(count // 4)])

    return _workload(name, work, sweeps, problem, step=4)


def _workload(name: str, work: Work, sweeps: Sweeper, problem: Problem, *, step: int) -> Workload:
    like_plain_c = problem.scheme == LaxFriedrichs()
    cells = swept_cells(problem) * sweeps.count
    return Workload(name, work, cells, str(sweeps.ordering), step=step, like_plain_c=like_plain_c)
