"""Maps smoothed along the edges of a photograph, on a device: see kernels/shared/smooth.cl."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.buffers import upload
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.kernel import in_row_groups, kernel, row_group

LEAST, HUBER, RELAXATION = 0.2, 1.5, 1.7
"""Share of the noise that a step counts at least; noises from which a datum pulls no harder; over-relaxation."""
_BORDER = 16
"""Stored columns beside the map, of which the first and the last must be: rows begin alike for vectors."""
COARSEST, FINER = (6, 12), (2, 10)
"""How often the weights are renewed, and how many sweeps of both colours follow, where smoothing begins and at each
finer level."""

Data = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
"""What to begin with, what is to be smoothed, and how much each pixel of it counts."""


class Smoother:
    """Smooths maps of one photograph, first coarsely, with blocks of pixels in place of pixels.

    Parameters
    ----------
    device : Device
    precision : {"float32", "float64"}
    right, below : ndarray of float, shape (height, width)
        Weights of the steps between pixels; 0 where there is none, as in the last column and row.
    levels : int
        How often blocks of 2 x 2 become one.

    Raises
    ------
    DeviceError
        When the device lacks the precision or the memory.
    """

    def __init__(
        self, device: Device, precision: str, right: NDArray[Any], below: NDArray[Any], levels: int = 0
    ) -> None:
        self._levels = []
        for level in range(levels + 1):
            self._levels.append(_Level(device, precision, right, below))
            if level < levels:
                right, below = reduced_weights(right, below)

    def smoothed(
        self, start: NDArray[Any], target: NDArray[Any], votes: NDArray[Any], noise: float
    ) -> NDArray[np.float64]:
        """The smooth map that is near to data.

        Parameters
        ----------
        start, target, votes : ndarray of float, shape (height, width)
            What to begin with, the data, and how much each counts, 0 for none; all finite.
        noise : float
            Of the data.
        """
        given: list[Data] = [(start, target, votes)]
        for _ in self._levels[1:]:
            given.append(reduced_data(*given[-1]))
        found, times = given[-1][0], COARSEST
        for level, (begin, data, weight) in zip(reversed(self._levels), reversed(given), strict=True):
            if times is FINER:
                found = refined(found, begin.shape)
            found = level.smoothed(found, data, weight, noise, *times)
            times = FINER
        return found


class _Level:
    """The buffers of a map of one size; its parameters are those of :class:`Smoother`."""

    def __init__(self, device: Device, precision: str, right: NDArray[Any], below: NDArray[Any]) -> None:
        self._device, self._real = device, device.real(precision)
        self._shape = height, width = right.shape
        self._items, self._group = in_row_groups(row_group(device), width, height)
        self._stride = self._items[0] + _BORDER
        with in_words(device):
            self._reweigh, self._relax = (
                kernel(device, ["smooth"], precision, None, name) for name in ("reweigh", "relax")
            )
            self._values: dict[str, Any] = {
                "right": self._upload(right),
                "below": self._upload(below),
                **{name: self._upload(np.zeros(self._shape)) for name in ("pull", "across", "down")},
                "least": LEAST,
                "huber": HUBER,
                "relaxation": RELAXATION,
                "stride": self._stride,
            }

    def _upload(self, map_: NDArray[Any]) -> cl.Buffer:
        """The map in a border."""
        height, width = self._shape
        stored = np.zeros((height + 2, self._stride), self._real)
        stored[1:-1, 1 : width + 1] = map_
        return upload(self._device, stored)

    def smoothed(
        self,
        start: NDArray[Any],
        target: NDArray[Any],
        votes: NDArray[Any],
        noise: float,
        reweighings: int,
        sweeps: int,
    ) -> NDArray[np.float64]:
        device, (height, width) = self._device, self._shape
        with device.lock, in_words(device):
            maps = [self._upload(start) for _ in range(2)]
            values = {**self._values, "target": self._upload(target), "votes": self._upload(votes), "noise": noise}
            for _ in range(reweighings):
                self._reweigh.launch(device, self._items, self._group, {**values, "map": maps[0]})
                for _ in range(sweeps):
                    for colour in range(2):
                        taken = {"map": maps[colour], "relaxed": maps[1 - colour], "colour": colour}
                        self._relax.launch(device, self._items, self._group, {**values, **taken})
            found = np.empty((height + 2, self._stride), self._real)
            cl.enqueue_copy(device.queue, found, maps[0])
        return found[1:-1, 1 : width + 1].astype(np.float64)


def reduced_weights(right: NDArray[Any], below: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Weights of the steps between blocks of 2 x 2: of two rows, or columns, the lesser of two steps.

    Each step between pixels is one of those between blocks, so that no edge is lost.
    """
    wide, high = _pairs(right, 1), _pairs(below, 0)
    across = np.minimum(wide[..., 0], wide[..., 1])
    down = np.minimum(high[..., 0], high[..., 1])
    return _pairs(across, 0).sum(axis=-1), _pairs(down, 1).sum(axis=-1)


def reduced_data(start: NDArray[Any], target: NDArray[Any], votes: NDArray[Any]) -> Data:
    """Data of blocks of 2 x 2: means, weighted by the votes, of which the sum stays; at odd edges of what there is."""
    total = _sums(votes)
    mean = np.divide(_sums(target * votes), total, out=np.zeros_like(total), where=total > 0)
    return _sums(start) / _sums(np.ones_like(start)), mean, total


def refined(values: NDArray[np.float64], shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Each block's value on its pixels."""
    return values.repeat(2, axis=0).repeat(2, axis=1)[: shape[0], : shape[1]]


def _pairs(values: NDArray[Any], axis: int) -> NDArray[Any]:
    """Two neighbours along an axis as a last axis; 0 in place of one that is missing."""
    padded = np.pad(values, [(0, values.shape[axis] % 2 * (axis == along)) for along in range(2)])
    return np.stack(
        [padded[0::2], padded[1::2]] if axis == 0 else [padded[:, 0::2], padded[:, 1::2]],
        axis=-1,
    )


def _sums(values: NDArray[Any]) -> NDArray[np.float64]:
    return np.asarray(_pairs(_pairs(values, 0).sum(axis=-1), 1).sum(axis=-1), np.float64)
