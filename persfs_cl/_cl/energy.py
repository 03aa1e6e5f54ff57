"""The energy of a surface on a device, and steps of Gauss-Newton's method that make it less; see kernels/energy/.

It is long because it names every array and every launch of a step: apart from each other these say nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from persfs_cl._cl.buffers import allocate, upload
from persfs_cl._cl.device import Device
from persfs_cl._cl.failures import in_words
from persfs_cl._cl.kernel import kernel, row_group
from persfs_cl._cl.parameters import records
from persfs_cl._cl.registers import SUFFICIENT, lanes
from persfs_cl.masks import LACKING

_PAD = 2
"""As in kernels/energy/rows.cl."""
_ALIGNED = 16
"""Numbers of a row of a padded array are a multiple of so many, and at least so many more than pixels, for vectors that
begin in the image."""
_BEHIND = 64
"""Numbers behind an array that may be read, though what they are plays no part."""

_SMALLEST = 4
_MOST_GRIDS = 7
"""Of the grids that hasten the method of conjugate gradients: pixels of the shorter side, and how many."""
_SMALL = 64**2
"""Pixels of a grid up to which a launch of its own would take longer than its work."""

_LEAST_FALL = 0.1
"""Along a direction, as a share of that along the step alone."""


@dataclass(frozen=True)
class Terms:
    """What an energy is made of: arrays of one grid, and numbers.

    Attributes
    ----------
    log_depth : ndarray of float64, shape (height, width)
        Z to begin with, less a level; anything where nothing is.
    brightness : ndarray of float64, shape (height, width)
        E; anything where the flags lack SWEPT.
    flags : ndarray of uint8, shape (height, width)
        See :mod:`persfs_cl.masks`: whose brightness counts, and which neighbours are missing; all of them where nothing
        is.
    fixed : ndarray of bool, shape (height, width)
        Pixels that keep their value.
    prior : ndarray of float64, shape (height, width)
        G less the level; anything where nothing is known.
    certainty : ndarray of float64, shape (height, width)
        1 / tolerance, 0 where nothing is known.
    limits : ndarray of float64, shape (2, height, width), or None
        Bounds of Z less the level from below and from above, NaN where there is none.
    parameters : mapping of str to float
        Of grid, light and material, see :mod:`persfs_cl._cl.parameters`.
    x, y : ndarray of float64, shapes (width,) and (height,)
        Coordinates.
    numbers : mapping of str to float
        Those that kernels/energy/linearise.cl declares, but for `white`.
    painted : bool
        Whether ratios of brightness count, and not differences.
    """

    log_depth: NDArray[np.float64]
    brightness: NDArray[np.float64]
    flags: NDArray[np.uint8]
    fixed: NDArray[np.bool_]
    prior: NDArray[np.float64]
    certainty: NDArray[np.float64]
    limits: NDArray[np.float64] | None
    parameters: Mapping[str, float]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    numbers: Mapping[str, float]
    painted: bool


@dataclass(frozen=True)
class _Grid:
    """Sizes of padded arrays."""

    width: int
    height: int

    @property
    def stride(self) -> int:
        """Of rows."""
        return (-(-(self.width + 2 * _PAD) // _ALIGNED) + 1) * _ALIGNED

    @property
    def size(self) -> int:
        """Numbers of one array."""
        return self.stride * (self.height + 2 * _PAD)

    @property
    def inside(self) -> tuple[slice, slice]:
        """The image in a padded array."""
        return slice(_PAD, _PAD + self.height), slice(_PAD, _PAD + self.width)

    def padded(self, values: NDArray[Any], dtype: Any, around: float = 0) -> NDArray[Any]:
        """An array of the image, with a border."""
        result = np.full((self.height + 2 * _PAD, self.stride), around, dtype)
        result[self.inside] = values
        return result

    @property
    def coarser(self) -> _Grid:
        """With squares of four as pixels."""
        return _Grid((self.width + 1) // 2, (self.height + 1) // 2)


def _grids(finest: _Grid) -> list[_Grid]:
    """A grid and the coarser ones, one at least."""
    grids = [finest, finest.coarser]
    while len(grids) < _MOST_GRIDS and min(grids[-1].width, grids[-1].height) >= 2 * _SMALLEST:
        grids.append(grids[-1].coarser)
    return grids


@dataclass(frozen=True)
class Sums:
    """What :meth:`Descent.linearise` finds.

    Attributes
    ----------
    energy : float
    white : float
        Level of ln albedo of which the energy is less, or not more; 0 for what is not painted.
    """

    energy: float
    white: float


class Descent:
    """A surface on a device, in steps towards the least energy.

    Parameters
    ----------
    device : Device
    terms : Terms
    kernels : sequence of str
        Files that stand before those of the energy: a material and its shading under a light.
    precision : {"float32", "float64"}
    """

    def __init__(self, device: Device, terms: Terms, kernels: Sequence[str], precision: str) -> None:
        self._device, self._real = device, device.real(precision)
        height, width = terms.flags.shape
        self._grids = _grids(_Grid(width, height))
        wide = lanes(device, precision, SUFFICIENT)
        # A vector wants a whole row, lest groups be too small to pay.
        self._items = 1 if wide > 1 else row_group(device)
        definitions = {
            "LANES": wide,
            "PAINTED": int(terms.painted),
            "BOUNDED": int(terms.limits is not None),
        }
        with device.lock, in_words(device):
            files = [*kernels, "rows", "linearise"]
            self._kernels = {
                "linearise": kernel(device, files, precision, definitions, "linearise", list(terms.parameters))
            }
            definitions.pop("PAINTED")
            files = ["rows", "grids", "normal_equations", "conjugate_gradients"]
            for name in (
                "assemble",
                "multiply",
                "precondition",
                "turn_direction",
                "advance",
                "compare_steps",
                "move",
                "restrict_remainder",
                "correct_grid",
                "correct_small_grids",
                "coarsen_diagonal",
            ):
                self._kernels[name] = kernel(device, files, precision, definitions, name)
            self._upload(terms)

    def _upload(self, terms: Terms) -> None:
        device, real, grid = self._device, self._real, self._grids[0]
        limits = np.full((2, 1, 1), np.nan) if terms.limits is None else terms.limits
        padded_limits = [grid.padded(bound, real, np.nan) for bound in limits]
        self._values: dict[str, Any] = {
            "log_depth": upload(device, grid.padded(terms.log_depth, real)),
            "brightness": upload(device, grid.padded(terms.brightness, real)),
            "flags": upload(device, grid.padded(terms.flags, np.uint8, LACKING)),
            "fixed": upload(device, grid.padded(terms.fixed, np.uint8, 1)),
            "prior": upload(device, grid.padded(terms.prior, real)),
            "certainty": upload(device, grid.padded(terms.certainty, real)),
            "limits": upload(device, np.stack(padded_limits)),
            "parameters": upload(device, records([terms.parameters], real)),
            "columns": upload(device, np.pad(terms.x, (0, grid.stride - grid.width)).astype(real)),
            "lines": upload(device, terms.y.astype(real)),
            **terms.numbers,
            "width": grid.width,
            "height": grid.height,
            "stride": grid.stride,
            "coarse_stride": self._grids[1].stride,
        }
        for name, planes in (
            ("before", 1),
            ("derivatives", 5),
            ("residuals", 1),
            ("curvature_weights", 3),
            ("prior_terms", 2),
            ("matrix", 7),
            ("remainder", 1),
            ("inverse_diagonal", 1),
            ("diagonal_parts", 3),
            ("direction", 1),
            ("product", 1),
            ("step", 1),
            ("correction", 1),
            ("right_hand_side", 1),
            ("last_right_hand_side", 1),
            ("course", 1),
        ):
            self._values[name] = self._zeros(planes * grid.size)
        self._partial = np.empty(3 * self._items * grid.height, real)
        self._values["partial"] = allocate(device, self._partial.nbytes)
        self._slope = self._last_slope = 0.0
        self._lay_out_coarse_grids()
        self._correction = list(self._launches_of_correction())
        self._multiply = self._prepared("multiply", grid.height, self._values)

    def _lay_out_coarse_grids(self) -> None:
        """Arrays of the coarse grids; of small ones, which come last, each kind in one buffer."""
        grids = self._grids[1:]
        count = len([grid for grid in grids if grid.width * grid.height <= _SMALL])
        large, small = grids[: len(grids) - count], grids[len(grids) - count :]
        self._coarse: list[dict[str, Any]] = []
        for grid in large:
            arrays = {name: self._zeros(grid.size) for name in ("remainder", "correction", "inverse_diagonal")}
            self._add_coarse(grid, arrays)
        if small:
            # A part of a buffer must begin where the device lets it.
            bits = self._device.context.devices[0].mem_base_addr_align
            aligned = max(_ALIGNED, bits // 8 // self._real.itemsize)
            lengths = [-(-(grid.size + _BEHIND) // aligned) * aligned for grid in small]
            begins = np.cumsum([0, *lengths])
            whole = {name: self._zeros(int(begins[-1])) for name in ("remainder", "correction", "inverse_diagonal")}
            for grid, begin, length in zip(small, begins, lengths, strict=False):
                place = int(begin) * self._real.itemsize, length * self._real.itemsize
                self._add_coarse(grid, {name: buffer.get_sub_region(*place) for name, buffer in whole.items()})
            places = [(grid.width, grid.height, grid.stride, begin) for grid, begin in zip(small, begins, strict=False)]
            self._small = {
                "small_grids": upload(self._device, np.array(places, np.int32)),
                "small_count": len(small),
                **{f"small_{name}s": buffer for name, buffer in whole.items()},
            }
        self._large = len(large)
        self._values["coarse_correction"] = self._coarse[0]["correction"]

    def _add_coarse(self, grid: _Grid, arrays: Mapping[str, cl.Buffer]) -> None:
        diagonal_parts = self._zeros(3 * grid.size)
        sizes = {"width": grid.width, "height": grid.height, "stride": grid.stride}
        self._coarse.append({**arrays, "diagonal_parts": diagonal_parts, **sizes})

    def _zeros(self, count: int) -> cl.Buffer:
        buffer = allocate(self._device, (count + _BEHIND) * self._real.itemsize)
        cl.enqueue_fill_buffer(self._device.queue, buffer, np.zeros(1, self._real), 0, buffer.size)
        return buffer

    def _prepared(self, name: str, height: int, values: Mapping[str, Any]) -> Callable[[], cl.Event]:
        # Groups of one size for all images: drivers for processors compile a kernel anew for each.
        return self._kernels[name].prepared(self._device, (self._items, height), (self._items, 1), values)

    def _launch(self, name: str, height: int, values: Mapping[str, Any]) -> None:
        self._prepared(name, height, values)()

    def _finest(self, name: str, **own: Any) -> None:
        self._launch(name, self._grids[0].height, {**self._values, **own})

    def _sums(self, count: int = 1) -> NDArray[np.floating]:
        """What the work-items have found, shape (work-items, count)."""
        found = self._partial[: count * self._items * self._grids[0].height]
        cl.enqueue_copy(self._device.queue, found, self._values["partial"])
        return found.reshape(-1, count)

    def linearise(self, white: float) -> Sums:
        """The energy of the surface as it is now, for a level of ln albedo.

        Makes the terms ready for :meth:`assemble`.
        """
        with self._device.lock, in_words(self._device):
            self._finest("linearise", white=white)
            energy, weighted, weights = self._sums(3).sum(axis=0, dtype=np.float64)
        return Sums(float(energy), float(weighted / weights) if weights > 0.0 else 0.0)

    def assemble(self, damping: float) -> None:
        """Make matrix and right-hand side of what :meth:`linearise` found, the diagonal raised by a share."""
        with self._device.lock, in_words(self._device):
            self._finest("assemble", damping=damping)
            for fine, coarse in self._pairs("diagonal_parts", "inverse_diagonal"):
                self._launch("coarsen_diagonal", coarse["coarse_height"], {**fine, **coarse})

    def solve(self, iterations: int, reduction: float) -> int:
        """Find the step to the minimum of the linearised energy, as far as so many iterations go.

        Parameters
        ----------
        iterations : int
            At most.
        reduction : float
            Of the remainder, as the preconditioner measures it, at which the step is good enough.

        Returns
        -------
        int
            How many iterations it took.
        """
        values = self._values
        with self._device.lock, in_words(self._device):
            values["right_hand_side"], values["last_right_hand_side"] = (
                values["last_right_hand_side"],
                values["right_hand_side"],
            )
            cl.enqueue_copy(self._device.queue, values["right_hand_side"], values["remainder"])
            self._last_slope, self._slope = self._slope, 0.0
            first = last = self._precondition()
            turn, done = 0.0, 0
            # The first is made even if there is nothing to do: the step must become 0.
            for done in range(1, iterations + 1):
                self._finest("turn_direction", turn=turn)
                self._multiply()
                along = float(self._sums().sum(dtype=np.float64))
                length = last / along if along > 0.0 else 0.0
                self._slope += length * last
                self._finest("advance", length=length, first=int(done == 1))
                if length == 0.0 or done == iterations:
                    break
                now = self._precondition()
                if now <= reduction**2 * first:
                    break
                turn, last = now / last, now
        return done

    def _precondition(self) -> float:
        """The correction for the remainder, and their product."""
        for launch in self._correction:
            launch()
        return float(self._sums().sum(dtype=np.float64))

    def _launches_of_correction(self) -> Iterator[Callable[[], cl.Event]]:
        """Down to the coarsest grid and back."""
        for fine, coarse in islice(self._pairs("remainder", "inverse_diagonal"), self._large + 1):
            yield self._prepared("restrict_remainder", coarse["coarse_height"], {**fine, **coarse})
        if self._large < len(self._coarse):
            yield self._prepared("correct_small_grids", 1, self._small)
        for place in reversed(range(self._large)):
            own, coarser = self._coarse[place], self._coarse[min(place + 1, len(self._coarse) - 1)]
            values = {
                **own,
                "has_coarser": int(coarser is not own),
                "coarse_correction": coarser["correction"],
                "coarse_stride": coarser["stride"],
            }
            yield self._prepared("correct_grid", own["height"], values)
        yield self._prepared("precondition", self._grids[0].height, self._values)

    def _pairs(self, *names: str) -> Iterator[tuple[Mapping[str, Any], Mapping[str, Any]]]:
        """Each grid and the next, that with some of its values by other names."""
        fine: Mapping[str, Any] = self._values
        for coarse in self._coarse:
            yield fine, {f"coarse_{name}": coarse[name] for name in ("width", "height", "stride", *names)}
            fine = coarse

    def turn(self, *, afresh: bool) -> float:
        """Choose where to go: by the step that :meth:`solve` found and a share of where it went before.

        The share is that of the method of conjugate gradients for any function (Polak and Ribière 1969), for which the
        steps are the preconditioned gradients.

        Parameters
        ----------
        afresh : bool
            By the step alone.

        Returns
        -------
        float
            By how much the energy falls along the direction, at first, for each length of it.
        """
        share, slope = 0.0, self._slope
        with self._device.lock, in_words(self._device):
            if not afresh and self._last_slope > 0.0:
                self._finest("compare_steps", last_direction=self._values["course"])
                with_last, along_last = self._sums(2).sum(axis=0, dtype=np.float64)
                share = max(0.0, float(self._slope - with_last) / self._last_slope)
                slope = self._slope + share * float(along_last)
                if not slope > _LEAST_FALL * self._slope:
                    share, slope = 0.0, self._slope
            self._finest(
                "turn_direction", correction=self._values["step"], direction=self._values["course"], turn=share
            )
        return slope

    def move(self, length: float = 1.0) -> float:
        """Go in that direction, so many times its length; gives the largest change of Z."""
        with self._device.lock, in_words(self._device):
            self._finest("move", direction=self._values["course"], length=length)
            return float(self._sums().max())

    def go_back(self) -> None:
        """Undo the last move."""
        values = self._values
        values["log_depth"], values["before"] = values["before"], values["log_depth"]

    def log_depth(self) -> NDArray[np.floating]:
        """Z less the level, shape (height, width)."""
        grid = self._grids[0]
        padded = np.empty((grid.height + 2 * _PAD, grid.stride), self._real)
        with self._device.lock, in_words(self._device):
            cl.enqueue_copy(self._device.queue, padded, self._values["log_depth"])
        return padded[grid.inside]

    def read(self, name: str) -> NDArray[np.floating]:
        """Planes of one of the arrays, shape (planes, height, width)."""
        grid = self._grids[0]
        buffer = self._values[name]
        numbers = np.empty(buffer.size // self._real.itemsize, self._real)
        with self._device.lock, in_words(self._device):
            cl.enqueue_copy(self._device.queue, numbers, buffer)
        planes = numbers.size // grid.size
        rows, columns = grid.inside
        return numbers[: planes * grid.size].reshape(planes, -1, grid.stride)[:, rows, columns]
