"""The device's part of Anderson acceleration: what was reached last, the products of its differences, and mixtures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.buffers import allocate, upload
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.kernel import Kernel, in_row_groups, kernel, row_group
from persfs_cl._cl.run import Run

DEPTH = 5
"""Differences that are mixed."""
_SLOTS = DEPTH + 1
NUMBERS_A_PIXEL = 2 * _SLOTS + 2
"""What it takes on the device, beside the values themselves."""
_SUMS = 2 * DEPTH + 5
_IDLE = -1
_LANES = 4
"""Of the sums, on any device: see kernels/shared/anderson.cl."""


@dataclass(frozen=True)
class Products:
    """Sums over the pixels of an image, of what the last iterations changed: F = G(X) - X, and the values G(X).

    Attributes
    ----------
    of_steps, of_residual : ndarray of float64, shape (DEPTH,)
        Of the latest difference of F with each, the latest first, and of F with each.
    squares : float
        Of F.
    value_squares, across : float
        Of the latest difference of G, and of that with the latest of F.
    largest : float
        max |F|.
    rise : float
        How far G is above what was noted first, at most; 0 where it is nowhere above.
    """

    of_steps: NDArray[np.float64]
    of_residual: NDArray[np.float64]
    squares: float
    value_squares: float
    across: float
    largest: float
    rise: float

    @classmethod
    def of(cls, rows: NDArray[np.floating]) -> Products:
        """From those of the rows of an image."""
        sums = rows[:, :-2].sum(axis=0, dtype=np.float64)
        return cls(
            of_steps=sums[:DEPTH],
            of_residual=sums[DEPTH : 2 * DEPTH],
            squares=float(sums[2 * DEPTH]),
            value_squares=float(sums[2 * DEPTH + 1]),
            across=float(sums[2 * DEPTH + 2]),
            largest=float(rows[:, -2].max()),
            rise=float(rows[:, -1].max()),
        )


class Mixer:
    """What each image of a run has come to, launch by launch, and its next values.

    Parameters
    ----------
    run : Run
    precision : {"float32", "float64"}
    """

    def __init__(self, run: Run, precision: str) -> None:
        device, layout = run.device, run.layout
        self._run, self._real = run, np.dtype(precision)
        self._heads = np.zeros(run.images, np.int32)
        self._kept = np.zeros(run.images, np.int32)
        """Launches that the device keeps of each image, the latest not counted."""
        self._bytes = layout.size * self._real.itemsize
        cells = run.images * self._bytes
        definitions = {"LANES": _LANES, "DEPTH": DEPTH}
        with in_words(device):
            self._sum, self._mix = (
                kernel(device, ["anderson"], precision, definitions, name) for name in ("sum_products", "mix_values")
            )
            self._values = {
                **run.values,
                "base": allocate(device, cells),
                "ceiling": allocate(device, cells),
                "residuals": allocate(device, _SLOTS * cells),
                "values": allocate(device, _SLOTS * cells),
                "sums": allocate(device, run.images * layout.height * _SUMS * self._real.itemsize),
                "parts": 2 if layout.apart else 1,
            }

    def products(self, images: Sequence[int]) -> list[Products]:
        """Note what these images have come to since :meth:`mix`, and multiply; 0 where there is no difference yet."""
        run, chosen = self._run, list(images)
        self._heads[chosen] = (self._heads[chosen] + 1) % _SLOTS
        sums = np.empty((run.images, run.layout.height, _SUMS), self._real)
        with run.device.lock, in_words(run.device):
            for image in chosen:
                if not self._kept[image]:  # what is noted first, and has come from nowhere
                    for noted in ("ceiling", "base"):
                        self._copy(run.values["log_depth"], self._values[noted], image)
            self._launch(self._sum, chosen, self._kept)
            cl.enqueue_copy(run.device.queue, sums, self._values["sums"])
        self._kept[chosen] = np.minimum(self._kept[chosen] + 1, DEPTH)
        return [Products.of(sums[image]) for image in images]

    def mix(self, weights: dict[int, NDArray[np.float64]]) -> None:
        """Go on from a mixture: the values that were noted last, less so much of each of the last differences.

        Parameters
        ----------
        weights : dict
            Of the differences of an image, the latest first, DEPTH at most.
        """
        padded = np.zeros((self._run.images, DEPTH), self._real)
        counts = np.zeros(self._run.images, np.int32)
        for image, own in weights.items():
            padded[image, : len(own)] = own
            counts[image] = len(own)
        device = self._run.device
        with device.lock, in_words(device):
            self._values["weights"] = upload(device, padded)
            self._launch(self._mix, list(weights), counts)
            # The numbers on the device may be those arrays themselves.
            device.queue.finish()

    def begin_again(self, image: int) -> None:
        """Bring an image back to what was noted first."""
        with self._run.device.lock, in_words(self._run.device):
            self._copy(self._values["ceiling"], self._run.values["log_depth"], image)

    def _copy(self, source: cl.Buffer, goal: cl.Buffer, image: int) -> None:
        begin = image * self._bytes
        cl.enqueue_copy(
            self._run.device.queue, goal, source, byte_count=self._bytes, src_offset=begin, dst_offset=begin
        )

    def _launch(self, launched: Kernel, images: list[int], counts: NDArray[np.int32]) -> None:
        """Queue a kernel for these images."""
        run = self._run
        heads = np.full(run.images, _IDLE, np.int32)
        heads[images] = self._heads[images]
        self._values |= {"heads": upload(run.device, heads), "counts": upload(run.device, counts.copy())}
        # A row is work enough for a group of a processor.
        rows = 1 if run.device.kind == "cpu" else row_group(run.device)
        launched.launch(run.device, *in_row_groups(rows, run.layout.height, run.images), self._values)
