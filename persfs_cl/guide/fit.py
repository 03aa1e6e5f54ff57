"""A guide fitted to the surface that the photograph alone gives, and the bounds that both set together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.choices import GuideScale
from persfs_cl.errors import InputError
from persfs_cl.guide.agreement import LEAST_NOISE, agreeing, distortion_of, drift_of, mode_of, noise_of
from persfs_cl.guide.cells import Cells
from persfs_cl.guide.few import are_few, scatter_of
from persfs_cl.guide.guide import Guide
from persfs_cl.wording import keyword

_HELD, _FEW, _LOOSE = (1.0, 0.5, 0.25), (1.0, 0.5, 0.5), (1.0, 0.5, 0.25, 0.125, 0.125)
"""Tolerance of each round, in noises, where the photograph tells the depth, by many cells and by few points, and where
only bounds hold the surface, which so comes to lie on one side of what they allow."""
_NOISE_LEFT = 0.3
"""Noises that smoothing leaves of noise alone, about, root mean square. Where guide and photograph differ by no more,
the photograph may be right everywhere, and the tolerance stays that of the first round; where they differ by more, it
shrinks accordingly."""
_DISTORTIONS, _DISTORTIONS_DRIFTING = 1.5, 3.0
"""Tolerance at least, in distortions, of a guide that is distorted."""
_FAR = 3.0
"""Tolerances that the surface may lie behind the guide, where the photograph holds it: paint makes it look farther."""
_BAND = 2.0
"""Noises that the first surface may be away from the guide, where the photograph does not hold it."""
_TRIALS, _APART, _SAMPLE = 1000, 0.05, 2000
"""Pairs of cells that are tried as the line on which most of the others lie; by what share of all numbers they differ
at least; and cells that are asked."""
_WIDTH, _NEARER = 0.05, 4.0
"""Share of the depth from which a cell does not lie on the line, and how much more it counts on its nearer side."""
_REWEIGHINGS, _WIDEST, _SHRINKS = 20, 0.05, 0.85


@dataclass(frozen=True, eq=False)
class GuideFit:
    """What became of a guide.

    Attributes
    ----------
    cells, used : int
        Cells of its map, or points, on the surface; and those of them that were used, the others being unlike all that
        is around them.
    spacing : float
        Pixels from one to the next.
    noise : float
        By how much its depths scatter, as a share of the depth, or ``guide_tolerance``. Taken to be 0.01, or less where
        there is little relief, of fewer than 25 points, which do not tell it.
    distortion : float
        What it errs besides, as a share of the depth.
    drifts : bool
        Whether it was bent by a quadratic of the place, so that it fits.
    tolerance : float
        By what share of the depth the surface may be nearer than the guide, smoothed along the photograph's edges.
    factor, offset : float
        By which its numbers were multiplied, and what was added, to have depth, or inverse depth.
    gain : float or None
        Of the flash, where it was found from the guide.
    departure : ndarray of float64, shape (height, width)
        ln of the depth that the guide, so smoothed, has more than the surface; NaN where there is none.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> scene = ps.bump((24, 24), light=ps.FlashLight())
    >>> guide = scene.depth.reshape(8, 3, 8, 3).mean(axis=(1, 3))
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light, guide=guide)
    >>> solution.guide.cells, solution.guide.gain
    (64, None)
    """

    cells: int
    used: int
    spacing: float
    noise: float
    distortion: float
    drifts: bool
    tolerance: float
    factor: float
    offset: float
    gain: float | None
    departure: Array

    def __repr__(self) -> str:
        gain = "" if self.gain is None else f", gain {self.gain:.4g}"
        return f"<GuideFit {self.used} of {self.cells} values used, noise {100 * self.noise:.2g} % of the depth{gain}>"

    def report(self) -> dict[str, float | int | bool | None]:
        """What a report says of it: all but the departure.

        Examples
        --------
        >>> import persfs_cl as ps
        >>> scene = ps.bump((24, 24), light=ps.FlashLight())
        >>> guide = ps.Points([4, 12, 20], [4, 12, 20], scene.depth[[4, 12, 20], [4, 12, 20]])
        >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light, guide=guide)
        >>> report = solution.guide.report()
        >>> report["cells"], report["drifts"]
        (3, False)
        """
        names = (name for name in self.__dataclass_fields__ if name != "departure")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, eq=False)
class Fitted:
    """A guide that was fitted to a surface.

    Attributes
    ----------
    cells : Cells
        Of ln depth, in the scale of the surface.
    farther : float
        How much farther, in ln depth, the surface must be taken where the gain is unknown.
    disagreement : float
        How much farther, in ln depth, most of the guide is than the surface, before anything of either was changed.
    scatter : float
        By how much the rest differs from that for no reason that is known.
    noise, distortion, drifts, factor, offset
        As in :class:`GuideFit`.
    step : float
        Between neighbouring cells, in depths aside.
    held : bool
        Whether the photograph tells the depth.
    told : bool
        Whether somebody has said what the noise is.
    trusted : Fitted or None
        The same, as if the guide erred by no more than its noise, where it seems to err otherwise: then either it is
        distorted, or the surface is wrong in large parts.
    """

    cells: Cells
    farther: float
    disagreement: float
    scatter: float
    noise: float
    distortion: float
    drifts: bool
    factor: float
    offset: float
    step: float
    held: bool
    told: bool
    trusted: Fitted | None = None

    @classmethod
    def to_surface(
        cls,
        guide: Guide,
        log_depth: Array,
        focal_length: float,
        *,
        scale: GuideScale,
        gain_unknown: bool,
        held: bool,
        tolerance: float | None,
    ) -> Fitted:
        """Find what is unknown of a guide, or of a flash, from the surface that the photograph alone gives.

        Where the photograph does not tell the depth, and the scale is fixed, a band around the guide has placed it.

        Raises
        ------
        InputError
            When they have nothing in common.
        """
        cells = guide.cells
        found = cells.of_surface(log_depth)
        factor, offset = 1.0, 0.0
        if guide.affine:
            factor, offset = _line_of(guide, found)
            cells = cells.saying(guide.log_depth(factor, offset))
        residuals = cells.values - found
        if np.isnan(residuals).all():
            raise InputError(
                f"{keyword('guide')} says nothing of pixels that get a depth: see that it is of the same view.",
                argument="guide",
            )
        few = held and are_few(cells)
        noise = noise_of(residuals, cells) if tolerance is None else tolerance
        step = cells.spacing / focal_length
        free = gain_unknown or scale != "fixed"
        # Of few points hardly two have the same residual.
        width = max(noise, scatter_of(residuals)) if few else noise
        most = mode_of(residuals, width)
        shift = np.full(cells.count, most if free else 0.0)
        trusted = agreeing(residuals, cells, noise, step)
        # A surface that the guide itself has placed tells nothing of what it errs, and who gives a tolerance knows.
        told = tolerance is None and not few and (held or scale != "fixed")
        distortion = distortion_of(residuals - most, trusted, noise) if told else 0.0

        def by(shift: Array, distortion: float, *, drifts: bool, instead: Fitted | None = None) -> Fitted:
            farther, line = 0.0, (factor, offset)
            if gain_unknown:
                farther = float(np.mean(shift)) if drifts else float(shift[0])
                shift = shift - farther
            elif not drifts:
                # The scale of the numbers themselves, which is known to be wrong by so much.
                change = math.exp(shift[0] if guide.kind == "inverse" else -shift[0])
                line = factor * change, offset * change
            fitted = cells.saying(cells.values - shift)
            given = tolerance is not None
            return cls(
                fitted, farther, most, width, noise, distortion, drifts, *line, step, held, told=given, trusted=instead
            )

        if distortion <= noise:
            return by(shift, distortion, drifts=False)
        # Numbers of unknown scale may be bent; others were measured.
        instead = by(shift, 0.0, drifts=False) if held and scale == "fixed" else None
        if not free:
            return by(shift, distortion, drifts=False, instead=instead)
        shift = drift_of(residuals, cells, noise)
        return by(shift, distortion_of(residuals - shift, trusted, noise), drifts=True, instead=instead)

    @classmethod
    def as_given(cls, guide: Guide, focal_length: float, tolerance: float | None) -> Fitted:
        """A guide in the unit of depth, where there is no surface yet."""
        noise = noise_of(guide.cells.values, guide.cells) if tolerance is None else tolerance
        step = guide.cells.spacing / focal_length
        return cls(
            guide.cells,
            0.0,
            0.0,
            noise,
            noise,
            0.0,
            drifts=False,
            factor=1.0,
            offset=0.0,
            step=step,
            held=False,
            told=tolerance is not None,
        )

    @property
    def count(self) -> int:
        """Cells on the surface."""
        return int(np.count_nonzero(self.cells.pixels))

    def outcome(self, used: int, tolerance: float, gain: float | None, departure: Array) -> GuideFit:
        """What became of it; the parameters are those of :class:`GuideFit`."""
        return GuideFit(
            cells=self.count,
            used=used,
            spacing=self.cells.spacing,
            noise=self.noise,
            distortion=self.distortion,
            drifts=self.drifts,
            tolerance=tolerance,
            factor=self.factor,
            offset=self.offset,
            gain=gain,
            departure=departure,
        )

    def residuals(self, log_depth: Array) -> Array:
        """Of the cells that agree with their neighbours; NaN for the others."""
        found = self.cells.values - self.cells.of_surface(log_depth)
        trusted = agreeing(found, self.cells, self.noise, self.step)
        return np.where(trusted, found, np.nan) if trusted.any() else found

    @property
    def few(self) -> bool:
        """Whether there are few points, on a surface that the photograph holds."""
        return self.held and are_few(self.cells)

    @property
    def rounds(self) -> int:
        """How often the surface is solved again."""
        return len(self._noises)

    @property
    def _noises(self) -> tuple[float, ...]:
        if not self.held:
            return _LOOSE
        return _FEW if self.few else _HELD

    def tolerance(self, number: int, difference: float) -> float:
        """Of a round, from 0.

        Parameters
        ----------
        number : int
        difference : float
            Of guide and photograph, in ln depth: root mean square of the first smooth residual.
        """
        # Beyond the noise, so that it grows from nothing.
        least = _DISTORTIONS * math.sqrt(max(self.distortion**2 - self.noise**2, 0.0))
        if self.drifts:
            least = _DISTORTIONS_DRIFTING * self.distortion
        noises = self._noises
        share = noises[number]
        if self.held:
            share = max(share, noises[0] * _NOISE_LEFT / max(difference / self.noise, _NOISE_LEFT))
        return max(share * self.noise, least)

    def around(self, log_depth: Array, tolerance: float) -> tuple[Array, Array]:
        """Bounds of ln depth around what guide and surface say together."""
        return log_depth - tolerance, log_depth + (_FAR if self.held else 1.0) * tolerance


def band(cells: Cells, tolerance: float | None) -> tuple[Array, Array]:
    """Bounds of ln depth between which a surface begins that no photograph holds: around the guide, interpolated."""
    noise = noise_of(cells.values, cells) if tolerance is None else tolerance
    middle = cells.interpolated(cells.values)
    half = _BAND * noise + 0.5 * cells.spacing * slope_of(middle)
    half[~cells.reached(~np.isnan(cells.values))] = np.nan
    return middle - half, middle + half


def slope_of(values: Array) -> Array:
    """Size of the gradient of a map, between pixels."""
    down, across = (
        np.gradient(values, axis=axis) if values.shape[axis] > 1 else np.zeros_like(values) for axis in (0, 1)
    )
    return np.asarray(np.hypot(down, across))


def _line_of(guide: Guide, log_depth: Array) -> tuple[float, float]:
    """Factor and offset by which the numbers of a guide best become the depth, or inverse depth, of a surface.

    Most cells count, and not the worst: a line through two of them on which most others lie, and then by least squares
    whose weights fall with the error. Where the surface was dragged it is too near, so that the guide may well be
    farther than the surface, but hardly nearer.
    """
    known = ~np.isnan(log_depth) & ~np.isnan(guide.cells.values)
    numbers = guide.cells.values[known]
    goal = np.exp(-log_depth[known] if guide.kind == "inverse" else log_depth[known])
    if known.sum() < 3 or np.ptp(numbers) == 0.0:
        raise InputError(
            f"{keyword('guide')} has {len(np.unique(numbers))} different values on the surface, from which "
            f"{keyword('guide_scale', 'affine')} cannot be found: give a guide with more of them.",
            argument="guide",
        )
    random = np.random.default_rng(0)
    first, second = random.integers(0, numbers.size, (2, _TRIALS))
    # Of most of them: a single wild one must not make all others alike.
    spread = float(np.ptp(np.percentile(numbers, (5, 95)))) or float(np.ptp(numbers))
    apart = np.abs(numbers[first] - numbers[second]) > _APART * spread
    first, second = first[apart], second[apart]
    if not first.size:
        raise InputError(
            f"{keyword('guide')} has nearly the same value everywhere on the surface, from which "
            f"{keyword('guide_scale', 'affine')} cannot be found: give a guide with more different ones.",
            argument="guide",
        )
    factors = (goal[first] - goal[second]) / (numbers[first] - numbers[second])
    offsets = goal[first] - factors * numbers[first]
    sample = random.permutation(numbers.size)[:_SAMPLE]
    farther = -1.0 if guide.kind == "inverse" else 1.0
    costs = [
        _cost(farther * (factor * numbers[sample] + offset - goal[sample]) / goal[sample])
        for factor, offset in zip(factors, offsets, strict=True)
    ]
    terms = np.stack([numbers, np.ones_like(numbers)], axis=1)
    line = np.array([factors[np.argmin(costs)], offsets[np.argmin(costs)]])
    for number in range(_REWEIGHINGS):
        error = (terms @ line - goal) / goal
        width = max(_WIDEST * _SHRINKS**number, LEAST_NOISE)
        weight = 1.0 / (1.0 + (error / width) ** 2) ** 2 / goal**2
        line = np.linalg.lstsq(terms * np.sqrt(weight)[:, None], goal * np.sqrt(weight), rcond=None)[0]
    return float(line[0]), float(line[1])


def _cost(farther: Array) -> float:
    """Of shares of the depth by which a guide is farther than the surface."""
    share = np.minimum(np.abs(farther) / _WIDTH, 1.0)
    return float(np.sum(np.where(farther < 0.0, _NEARER, 1.0) * share))
