"""A photograph made ready: linear light, and from there E."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from persfs_cl.arrays import Array, Mask
from persfs_cl.checks import as_number, check_choice
from persfs_cl.errors import InputError
from persfs_cl.framing.frame import Frame
from persfs_cl.preparation.normalise import brightest_diffuse, normalise_grey, normalise_linear

Normalise = Literal["linear", "level", "grey", "none"]


@dataclass(frozen=True, eq=False)
class PreparedPhoto:
    """Linear light of a photo, made ready.

    Attributes
    ----------
    light : ndarray of float64, shape (H, W)
        Linear light on the scale of the photo, 0 or more, after every step; anything outside `mask`.
    unfiltered : ndarray of float64, shape (H, W)
        The same, less ambient light and without vignetting, but with highlights as they were, and not smoothed.
    mask : ndarray of bool, shape (H, W)
        Pixels to solve: those that were asked for, less masked highlights.
    below_ambient : ndarray of bool, shape (H, W)
        Pixels darker than the ambient light, which are 0.
    saturated : ndarray of bool, shape (H, W)
        Pixels that were too bright for the file.
    specks : ndarray of bool, shape (H, W)
        Small bright specks that were replaced.
    specular : ndarray of bool, shape (H, W)
        Shiny spots; none where highlights are kept, because they are not looked for.
    masked, filled : ndarray of bool, shape (H, W)
        Highlights, with what goes with them, that were left out, or filled from their surroundings.
    clipped : ndarray of bool, shape (H, W)
        Pixels that were cut to the percentile.
    report : mapping
        What was done and to how many pixels, ready for JSON.

    Examples
    --------
    >>> from importlib.resources import files
    >>> import persfs_cl as ps
    >>> photo = ps.read_photo(files("persfs_cl") / "data" / "coin.png")
    >>> prepared = ps.prepare_photo(photo, ps.Camera(focal_length=576.0), ps.Preparation(mean_filter=3))
    >>> prepared.light.shape, int(prepared.mask.sum()), prepared.report["mean_filter"]
    ((72, 72), 5184, 3)
    """

    light: Array
    unfiltered: Array
    mask: Mask
    below_ambient: Mask
    saturated: Mask
    specks: Mask
    specular: Mask
    masked: Mask
    filled: Mask
    clipped: Mask
    report: Mapping[str, Any]

    def __repr__(self) -> str:
        height, width = self.light.shape
        inside = self.light[self.mask]
        light = f", light {inside.min():.4g} to {inside.max():.4g}" if inside.size else ""
        return f"<PreparedPhoto, {inside.size} of {width} x {height} pixels{light}>"

    def normalised(
        self,
        how: Normalise = "linear",
        *,
        percentile: float | None = None,
        white: float | None = None,
        level: float | None = None,
    ) -> NormalisedPhoto:
        """E in [0, 1], for a parallel light.

        Parameters
        ----------
        how : {"linear", "level", "grey", "none"}
            Divide by the brightest value, or so that the median is that of level ground, stretch by eq. (2), or take
            the light for E as it is.
        percentile : float, optional
            In (0, 100]; the brightest value is this percentile of the pixels to solve, so that a few hot pixels do not
            set it. Left out, it is 99.5 for "linear", 50 for "level", and 100 for "grey".
        white : float, optional
            For "linear", instead of a percentile: the light of a white surface that faces the lamp, on the scale of
            the photo, as a calibration finds it.
        level : float, optional
            For "level": E of level ground, which faces the camera, below 1 where the light is oblique.

        Returns
        -------
        NormalisedPhoto

        Raises
        ------
        InputError
            When `how` is unknown, `percentile` or `white` is impossible or given where it has no meaning, or there is
            no shading.

        Examples
        --------
        >>> from importlib.resources import files
        >>> import persfs_cl as ps
        >>> photo = ps.read_photo(files("persfs_cl") / "data" / "coin.png")
        >>> prepared = ps.prepare_photo(photo, ps.Camera(focal_length=576.0))
        >>> image = prepared.normalised("grey").image
        >>> float(image.min()), float(image.max())
        (0.0, 1.0)
        """
        black, brightest, image = 0.0, 1.0, self.light
        check_choice("how", how, Normalise)
        if (level is not None) != (how == "level") or (level is not None and not 0.0 < level < 1.0):
            raise InputError.about(
                "level",
                level,
                'goes with "level", where it is between 0 and 1: the light must be oblique. Else leave it out.',
            )
        if white is not None and (how != "linear" or percentile is not None):
            raise InputError.about(
                "white", white, 'goes with "linear", instead of a percentile: leave one of them out.'
            )
        if white is not None:
            brightest = as_number("white", white, above=0.0, what="a brightness")
            image = normalise_linear(image, mask=self.mask, brightest=brightest)
        elif level is not None:
            percentile = 50.0 if percentile is None else percentile
            brightest = brightest_diffuse(image, mask=self.mask, percentile=percentile) / level
            image = normalise_linear(image, mask=self.mask, brightest=brightest)
        elif how == "linear":
            percentile = 99.5 if percentile is None else percentile
            brightest = brightest_diffuse(image, mask=self.mask, percentile=percentile)
            image = normalise_linear(image, mask=self.mask, brightest=brightest)
        elif how == "grey":
            percentile = 100.0 if percentile is None else percentile
            image = normalise_grey(image, self.mask, percentile=percentile)
            inside = self.light[self.mask]
            black, brightest = float(inside.min()), float(np.percentile(inside, percentile))
        elif percentile is not None:
            raise InputError.about(
                "percentile", percentile, "has no meaning where nothing is normalised: leave it out."
            )
        unfiltered = np.clip((self.unfiltered - black) / (brightest - black), 0.0, 1.0)
        report = {
            "normalise": how,
            "white_percentile": percentile,
            "black": black,
            "white": brightest,
            **({} if level is None else {"level": level}),
            "white_pixels": int(np.count_nonzero(image[self.mask] >= 1.0)),
        }
        return NormalisedPhoto(image, unfiltered, report)


@dataclass(frozen=True, eq=False)
class NormalisedPhoto:
    """A photo as E.

    Attributes
    ----------
    image : ndarray of float64, shape (H, W)
        E; what is brighter than the brightest value is 1.
    unfiltered : ndarray of float64, shape (H, W)
        :attr:`PreparedPhoto.unfiltered` on the same scale, cut to [0, 1].
    report : mapping
        What was done, the linear light that became 0 and 1, and how many pixels are 1, ready for JSON.
    """

    image: Array
    unfiltered: Array
    report: Mapping[str, Any]

    def __repr__(self) -> str:
        height, width = self.image.shape
        scale = ", ".join(f"{name}={self.report[name]:.4g}" for name in ("black", "white"))
        return f"<NormalisedPhoto, {width} x {height} pixels, {self.report['normalise']}, {scale}>"


def framed(prepared: PreparedPhoto, frame: Frame, told: Mask) -> PreparedPhoto:
    """A photo made ready, with the pixels of another frame.

    Parameters
    ----------
    prepared : PreparedPhoto
    frame : Frame
    told : ndarray of bool, shape (H, W)
        Pixels whose light is known: those to solve, and those of walls.
    """
    flagged = ("below_ambient", "saturated", "specks", "specular", "filled", "clipped")
    mask = frame.mostly(prepared.mask)
    return PreparedPhoto(
        light=frame.light(prepared.light, told)[0],
        unfiltered=frame.light(prepared.unfiltered, told | prepared.masked)[0],
        mask=mask,
        masked=frame.mostly(prepared.mask | prepared.masked) & ~mask,
        **{name: frame.anywhere(getattr(prepared, name)) for name in flagged},
        report=prepared.report,
    )
