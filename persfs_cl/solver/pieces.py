"""Many images, some at a time: which share launches, and what is done beside the device's work.

While the device works on one piece, threads make the next one ready and turn the results of the one before into
solutions. So no more than three pieces are held at a time, besides what was given and what was found.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import pairwise

import numpy as np

from persfs_cl._cl import anderson, multigrid
from persfs_cl._cl.device import Device
from persfs_cl.solver.attempt import Attempt
from persfs_cl.solver.iterate import Watch
from persfs_cl.solver.options import Options
from persfs_cl.solver.problem import Problem
from persfs_cl.solver.solve import Finished, attempt, finish, solve, told
from persfs_cl.surface.solution import Solution

_FULL = 3 / 4
"""Share of the largest image of a piece that each of its others has at least: it takes as long as that one."""

_MOST_PIXELS = {"cpu": 2**21, "gpu": 2**24}

_IMAGES_A_PROCESSOR = 4
"""Images of a piece for each processor, where one takes whole images."""

_MOST_MEMORY = 2 / 3
"""Share of the device's memory that a piece may take, so that no array of it takes a quarter: more than that need not
be given at once."""

_WHOLE_IMAGES = 2**20
"""Up to so many pixels a processor may take a whole image, see :mod:`persfs_cl._cl.orderings.choices`."""


def busy_pixels(device: Device) -> int:
    """Pixels of a piece that keep a device busy: more than that would only hold memory."""
    return _MOST_PIXELS.get(device.kind, _MOST_PIXELS["cpu"])


def pieces(shapes: Sequence[tuple[int, ...]], device: Device, precision: str) -> list[list[int]]:
    """Numbers of images that may share launches: of about one size, and together well within the device's memory.

    Parameters
    ----------
    shapes : sequence of (int, int)
        Of what is solved of each image.
    device : Device
    precision : {"float32", "float64"}

    Returns
    -------
    list of list of int
        In the order of the first number of each.
    """
    # Values, their copy and brightness, what mixtures keep, and flags; or, before these, the grids.
    numbers_a_pixel = max(3 + anderson.NUMBERS_A_PIXEL, multigrid.NUMBERS_A_PIXEL)
    bytes_a_pixel = numbers_a_pixel * np.dtype(precision).itemsize + 1
    found = []
    for (height, width), numbers in _alike(shapes):
        # Index arithmetic within an array is done in 32 bits here and there, hence the second bound.
        cells = (height + 96) * (width + 96)
        most = min(int(_MOST_MEMORY * device.memory) // (cells * bytes_a_pixel), 2**30 // cells)
        useful = busy_pixels(device) // (height * width)
        if height * width <= _WHOLE_IMAGES:
            useful = max(useful, _IMAGES_A_PROCESSOR * device.compute_units)
        count = -(-len(numbers) // max(1, min(most, useful)))
        # Of as many images each as the others, or one more.
        bounds = [len(numbers) * place // count for place in range(count + 1)]
        found += [sorted(numbers[begin:end]) for begin, end in pairwise(bounds)]
    return sorted(found)


def solve_in_pieces(
    device: Device,
    numbers: Sequence[Sequence[int]],
    ready: Callable[[int], Problem],
    options: Options,
    watch: Watch | None,
) -> Iterator[tuple[int, Solution]]:
    """Solve images that are to share launches as :func:`pieces` says.

    Parameters
    ----------
    device : Device
    numbers : sequence of sequence of int
    ready : callable
        Makes the problem of an image, in any thread.
    options : Options
    watch : Watch, optional

    Yields
    ------
    number : int
    solution : Solution

    Warns
    -----
    UserWarning
        As :func:`persfs_cl.solver.solve.solve`.
    """
    if len(numbers) < 2:
        for members in numbers:
            problems = [ready(number) for number in members]
            yield from zip(members, solve(device, problems, options, watch, members), strict=True)
        return

    def made_ready(members: Sequence[int]) -> list[Problem]:
        return [ready(number) for number in members]

    helpers = ThreadPoolExecutor(2)
    try:
        coming = helpers.submit(made_ready, numbers[0])
        finishing: deque[tuple[Sequence[int], Future[list[Finished]]]] = deque()
        for place, members in enumerate(numbers):
            problems = coming.result()
            if place + 1 < len(numbers):
                coming = helpers.submit(made_ready, numbers[place + 1])
            attempts = attempt(device, problems, options, watch, members)
            del problems
            while finishing:
                yield from _told(*finishing.popleft())
            finishing.append((members, helpers.submit(_finished, device, attempts, options)))
            del attempts
        yield from _told(*finishing.popleft())
    finally:
        # After an error, or Ctrl-C, what has begun is soon done.
        helpers.shutdown(cancel_futures=True)


def _finished(device: Device, attempts: Sequence[Attempt], options: Options) -> list[Finished]:
    return [finish(device, each, options) for each in attempts]


def _told(members: Sequence[int], finishing: Future[list[Finished]]) -> Iterator[tuple[int, Solution]]:
    return zip(members, told(finishing.result(), members), strict=True)


def _alike(shapes: Sequence[tuple[int, ...]]) -> list[tuple[tuple[int, int], list[int]]]:
    """Images of about one size, the largest first in each, and a size that all of them fit into."""
    found: list[tuple[tuple[int, int], list[int]]] = []
    for number in sorted(range(len(shapes)), key=lambda number: -shapes[number][0] * shapes[number][1]):
        height, width = shapes[number]
        for (rows, columns), numbers in found:
            if height <= rows and width <= columns and height * width >= _FULL * rows * columns:
                numbers.append(number)
                break
        else:
            found.append(((height, width), [number]))
    return found
