"""What every light answers, and the model that it makes of a material: kernels, and the numbers that they want."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import in_row_blocks
from persfs_cl.choices import Boundary, Precision
from persfs_cl.grid import PixelGrid
from persfs_cl.shading.equations import Equation
from persfs_cl.shading.reflectance import Reflectance

if TYPE_CHECKING:
    from typing_extensions import Self


DARKEST = 1e-30
"""A cosine that is 0 for all but divisions, of single precision too."""


@dataclass(frozen=True)
class Extremes:
    """The smallest and the largest brightness of the pixels to solve, NaN both where one of these is."""

    darkest: float
    brightest: float

    @classmethod
    def of(cls, image: Array, solved: Mask) -> Extremes:
        """Those of an image of which one pixel is to be solved at least; the others may hold anything."""
        found = [(np.inf, -np.inf)]

        def look(rows: slice) -> None:
            block, here = image[rows], solved[rows]
            if not (everything := here.all()) and not here.any():
                return
            low, high = block.min(), block.max()
            # So far, of all threads. A block within them cannot change them, whichever of its pixels are to be solved.
            darkest, brightest = found[-1]
            if not everything and not (low >= darkest and high <= brightest):
                used = block[here]
                low, high = used.min(), used.max()
            found.append((np.minimum(darkest, low), np.maximum(brightest, high)))

        in_row_blocks(look, solved.shape)
        lows, highs = zip(*found, strict=True)
        return cls(float(np.min(lows)), float(np.max(highs)))


@dataclass(frozen=True)
class Light(ABC):
    """What every light answers. Its numbers are its dataclass fields; `metadata` of a field describes an option.

    Attributes
    ----------
    summary : str
        What it is, for the command's help.
    normalised : bool
        Whether the image is the normalised reflectance E in [0, 1], rather than a brightness on a scale of its own.
    determines_depth : bool
        Whether the light fades with distance, so that the image alone determines the depth.
    flat_rim : bool
        Whether, where no depth is known, the edge of the image or mask is taken to be at z = 1.
    bounds_slope : bool
        Whether the equation bounds the slope at every pixel that is not as dark as at grazing.
    off_axis : bool
        Whether the light comes from a point near the camera, but not from the camera.
    boundary : str
        What ``boundary="auto"`` is for a scheme to which something may flow in.
    shading_kernel : str
        File of kernels/energy/ that has its brightness under a gain of 1, and the derivatives, for any material.
    """

    summary: ClassVar[str]
    shading_kernel: ClassVar[str]
    normalised: ClassVar[bool] = False
    flat_rim: ClassVar[bool] = False
    bounds_slope: ClassVar[bool] = True
    boundary: ClassVar[Boundary] = "wall"

    @property
    def determines_depth(self) -> bool:
        """See :class:`Light`."""
        return False

    @property
    def off_axis(self) -> bool:
        """See :class:`Light`."""
        return False

    @property
    def unknown(self) -> str | None:
        """Which of its numbers is not known, and found from a guide of known scale; None where all are."""
        return None

    @property
    def cosine_of_ground(self) -> float:
        """Cosine between the light and flat ground that faces the camera, seen along the axis."""
        return 1.0

    @abstractmethod
    def model(self, reflectance: Reflectance) -> Model:
        """The Hamiltonian of a material in this light, for rendering and the Lax-Friedrichs scheme.

        Raises
        ------
        InputError
            When there is none.
        """

    @abstractmethod
    def upwind_model(self, reflectance: Reflectance) -> Model:
        """The same for the upwind scheme, which wants the set of gradients {P : H(P) <= 0} to be convex.

        Asked for materials of which a brightness belongs to one angle.

        Raises
        ------
        InputError
            When there is none.
        """

    @abstractmethod
    def has_upwind(self, reflectance: Reflectance) -> bool:
        """Whether there is an upwind scheme for a material in this light."""

    @abstractmethod
    def brightness(
        self, log_depth: ArrayLike, p: ArrayLike, q: ArrayLike, x: ArrayLike, y: ArrayLike, reflectance: Reflectance
    ) -> Array:
        """Brightness of a surface, in plain NumPy.

        Parameters
        ----------
        log_depth : array_like
            Z = ln z, with the depth in the unit of the light's own numbers.
        p, q : array_like
            dZ/dx and dZ/dy, in normalised image coordinates.
        x, y : array_like
            Normalised image coordinates; everything broadcasts.
        reflectance : Reflectance

        Returns
        -------
        ndarray of float64
            Negative where the surface turns its back to the light.
        """

    @property
    def tilt(self) -> tuple[float, float]:
        """Slopes of the plane that faces the light; that of a lamp near the camera faces what the camera faces."""
        return (0.0, 0.0)

    @property
    @abstractmethod
    def shading_numbers(self) -> dict[str, float]:
        """What its `shading_kernel` reads, by the names that it has there."""

    @abstractmethod
    def toward(self, depth: Array, x: Array, y: Array) -> Array:
        """Vectors to the light, of any length, in the camera's axes, from points at a depth on rays (x, y, 1).

        The last axis has the three coordinates; what comes before it broadcasts with the points.
        """

    @property
    def of_unit_gain(self) -> Light:
        """The same light with a gain of 1, if it has any: brightness on another scale, see :meth:`scaled`."""
        return self

    def in_unit(self, unit: float) -> Light:
        """The same light where depths are counted in another unit."""
        return self

    def for_farther(self, log_depth: float) -> Light:
        """The light under which the same photograph shows a surface farther by a factor, of which this is the log."""
        raise TypeError(f"{self!r} does not tell how far away things are")

    def scaled(self, brightness: Array, log_depth: float) -> Array:
        """The brightness under the light, from that under one of gain 1 of a surface nearer by a factor.

        Parameters
        ----------
        brightness : ndarray of float64
        log_depth : float
            Logarithm of the factor.

        Raises
        ------
        InputError
            When it is beyond double precision.
        """
        return brightness


@dataclass(frozen=True)
class Model(ABC):
    """The Hamiltonian of a material in a light, and what a scheme must know to begin and to end with it.

    Attributes
    ----------
    light : Light
    reflectance : Reflectance
    kernels : tuple of str
        Kernel files that hold the Hamiltonian, in the order in which they are composed.
    upwind : tuple of str
        Those of the upwind scheme for it, after them; empty where it has none.
    in_rounds : bool
        Whether the equation has not all of the light: the image is corrected by what the surface found says of the rest
        and solved again, see :mod:`persfs_cl.solver.rounds`.
    exact_argmin : bool
        Whether the kernels have the very slope at which H is least, so that a state constraint is monotone.
    coarsens : bool
        Whether the kernels have the derivatives of H, so that the multigrid method takes it.
    """

    exact_argmin: ClassVar[bool] = True
    coarsens: ClassVar[bool] = False

    light: Light
    reflectance: Reflectance
    kernels: tuple[str, ...]
    upwind: tuple[str, ...] = ()
    in_rounds: bool = False

    def in_unit(self, unit: float) -> Self:
        """The same where depths are counted in another unit."""
        return replace(self, light=self.light.in_unit(unit))

    @abstractmethod
    def numbers(self, grid: PixelGrid, unit: float) -> dict[str, float]:
        """Numbers of light and material by the names that the kernels have for them; Z = 0 is the depth `unit`."""

    def with_material(self, **of_light: float) -> dict[str, float]:
        """Numbers of the light, and those of the material.

        Raises
        ------
        ValueError
            When both have one of the same name.
        """
        of_material = self.reflectance.numbers
        if both := of_light.keys() & of_material.keys():
            kinds = f"{type(self.light).__name__} and {type(self.reflectance).__name__}"
            raise ValueError(f"{kinds} both have a number {min(both)!r} in their kernels: rename one.")
        return {**of_light, **of_material}

    def parameters(
        self, grid: PixelGrid, *, sign: float = 1.0, max_slope: float = 1.0, unit: float = 1.0
    ) -> dict[str, float]:
        """All numbers of one image, see :mod:`persfs_cl._cl.parameters`; of a surface that leaves by `sign`."""
        return {
            "half_inverse_dx": 0.5 / grid.dx,
            "half_inverse_dy": 0.5 / grid.dy,
            "step_x": max_slope * grid.dx,
            "step_y": max_slope * grid.dy,
            "steepest": max_slope,
            "sign": sign,
            **self.numbers(grid, unit),
        }

    def axes(self, grid: PixelGrid) -> tuple[Array, Array]:
        """Numbers of the columns and of the rows, shapes (3, width) and (3, height).

        Coordinate x, sqrt(1 + x²) / (2 dx) and the part of the viscosity that the material plays no part in, over 2 dx;
        likewise for y.
        """
        tables = []
        for coordinate, spacing, along_y in ((grid.x, grid.dx, 0), (grid.y[:, 0], grid.dy, 1)):
            root, offset = np.sqrt(1.0 + coordinate**2), self.constant_viscosity(coordinate, along_y=along_y)
            tables.append(np.stack([coordinate, root / (2.0 * spacing), offset / (2.0 * spacing)]))
        return tables[0], tables[1]

    def constant_viscosity(self, coordinate: Array, *, along_y: int) -> Array:
        """What |∂H/∂p| may be, at most, without the part proportional to the brightness; of q `along_y`."""
        return np.zeros_like(coordinate)

    @abstractmethod
    def equation(
        self, brightness: Array, x: Array, y: Array, numbers: Mapping[str, float], steepest: float
    ) -> Equation:
        """The same Hamiltonian in plain NumPy at some pixels of an image, for the reference.

        `brightness` is what the kernels read in its place; `numbers` are those of :meth:`numbers`, found once for the
        image.
        """

    # What a scheme begins with.

    @abstractmethod
    def brightest(self, grid: PixelGrid) -> float:
        """The largest value that an image may have; infinite where it depends on the depth."""

    @abstractmethod
    def too_bright(self, most: float) -> str:
        """What is wrong with an image that is brighter than that, or negative, and the remedy."""

    def offset(self, grid: PixelGrid) -> Array:
        """What the unknown has more than Z = ln z: a number of the pixel, shape (height, width)."""
        return np.broadcast_to(0.0, (grid.y.size, grid.x.size))

    def level_slopes(self, x: Array, y: Array) -> tuple[Array | float, Array | float]:
        """Gradient of Z where the unknown is level: that of minus the offset."""
        return 0.0, 0.0

    def shading(self, image: Array, extremes: Extremes) -> Array:
        """What the kernels read in place of the image, where the depth is known somewhere.

        `extremes` are those of the pixels to solve, here and below.
        """
        return image

    @staticmethod
    def not_black(shading: Array, darkest: float) -> Array:
        """Cosines of which none is 0: where such a cell has no viscosity either, no neighbour weighs anything.

        `darkest` is the least of those that are read.
        """
        # NaN, of what is not solved, stays.
        return shading if darkest >= DARKEST else np.maximum(shading, DARKEST)

    def check_scale(self, extremes: Extremes, grid: PixelGrid) -> None:
        """InputError when image and light put the surface where numbers end, where the image tells the depth."""
        return

    def start(
        self, image: Array, solved: Mask, grid: PixelGrid, extremes: Extremes, precision: Precision
    ) -> tuple[NDArray[np.floating], float]:
        """Where the image tells the depth: what the kernels read in place of it, and a level to subtract from Z.

        The first is in the precision of the device. Black pixels would lie at infinity; they are given a little light.
        """
        raise TypeError(f"{self.light!r} does not tell how far away things are")

    def first(self, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, level: float) -> Array:
        """The values to begin with, less the level, from what :meth:`start` gives."""
        raise TypeError(f"{self.light!r} does not tell how far away things are")

    # What a scheme ends with.

    @abstractmethod
    def degenerate(
        self, image: Array, shading: NDArray[np.floating], solved: Mask, grid: PixelGrid, extremes: Extremes
    ) -> Mask:
        """Pixels to solve where the equation gives no bound to the slope."""

    def nearest_depth(self, x: Array, y: Array) -> Array | None:
        """Depth at which the equation ends, of rays (x, y, 1); None when it has no end."""
        return None

    def brightness_of_equation(self, log_depth: Array, p: Array, q: Array, x: Array, y: Array) -> tuple[Array, Array]:
        """Brightness of a surface by the equation, and by the light as it is, up to the same factor."""
        given = self.light.brightness(log_depth, p, q, x, y, self.reflectance)
        return given, given
