"""Pictures with a place for each pixel: depth, normals, comparison and confidence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.errors import InputError
from persfs_cl.io.export import write_png
from persfs_cl.io.files import FilePath
from persfs_cl.metrics import Errors, compare
from persfs_cl.quantiles import quantile, sampled
from persfs_cl.surface import geometry as surface
from persfs_cl.surface.plots.blocks import MAP_SAMPLES, Blocks
from persfs_cl.surface.plots.canvas import UNIT, load_matplotlib, new_figure, require_finite, show
from persfs_cl.surface.plots.panels import Panels

# Okabe and Ito's, which colour-blind people tell apart too, the darkest and the lightest first and last.
_REASONS = ("#000000", "#D55E00", "#56B4E9", "#E69F00", "#0072B2", "#009E73", "#CC79A7", "#882255", "#F0E442")
_NOTHING_DOUBTFUL = "0.65"
_NO_SURFACE = np.uint8(255)
"""The class of pixels that are none of the surface."""


def depth_picture(path: FilePath, depth: ArrayLike, title: str = "Depth", *, unit: str = UNIT) -> None:
    """Draw a depth map in colour: near is bright, far is dark, no surface is light grey.

    Parameters
    ----------
    path : path
        The PNG file to write.
    depth : array_like, shape (height, width)
        Depth along the optical axis, > 0; NaN where there is no surface.
    title : str
    unit : str
        Unit of the depth, for the label of the colour bar.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map, or is NaN everywhere.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import persfs_cl as ps
    >>> from persfs_cl.surface.plots import depth_picture
    >>> scene = ps.bump((20, 20))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     depth_picture(path, scene.depth)
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    z = surface.depth_array(depth)
    require_finite("depth", z)
    blocks = Blocks((z.shape[0], z.shape[1]))
    numbers = blocks.collected(lambda rows: blocks.means(z[rows]))
    with new_figure(path) as figure:
        panels = Panels(figure, z.shape)
        picture = show(panels.axes[0], numbers, blocks, title, "viridis_r", (np.nanmin(z), np.nanmax(z)))
        panels.add_bar(0, picture, f"depth ({unit})").long_axis.set_inverted(True)
        panels.arrange()


def normals_rgb(normals: ArrayLike) -> NDArray[np.uint8]:
    """Colours of unit normals, in the usual coding of normal maps.

    Red is right, green is up and blue is towards the camera, each coded (component + 1) / 2: a surface
    that faces the camera squarely is (128, 128, 255). Normals in camera axes point y down and z
    forward, so their second and third component change sign here.

    Parameters
    ----------
    normals : array_like, shape (height, width, 3)
        Unit normals in camera axes; NaN where there is no surface.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Middle grey (128, 128, 128), the code of no direction at all, where ``normals`` is NaN.

    Raises
    ------
    InputError
        When the shape is not (height, width, 3), or no pixel holds a normal.

    Examples
    --------
    >>> from persfs_cl.surface.plots import normals_rgb
    >>> normals_rgb([[[0.0, 0.0, -1.0]]])
    array([[[128, 128, 255]]], dtype=uint8)
    """
    vectors = np.asarray(normals, dtype=np.float64)
    if vectors.ndim != 3 or vectors.shape[2] != 3:
        raise InputError(f"normals has shape {vectors.shape}: give unit vectors, (height, width, 3).")
    require_finite("normals", vectors)
    colours = np.empty(vectors.shape, np.uint8)
    for rows in row_blocks(vectors.shape[:2]):
        colour_normals(np.moveaxis(vectors[rows], -1, 0), colours[rows])
    return colours


def colour_normals(components: Iterable[Array], colours: NDArray[np.uint8]) -> None:
    """Set the colours, of shape (height, width, 3), of normals, given by components of shape (height, width)."""
    for channel, (component, upright) in enumerate(zip(components, (np.add, np.subtract, np.subtract), strict=True)):
        levels = np.clip(component, -1.0, 1.0)
        upright(1.0, levels, out=levels)
        levels *= 127.5
        levels += 0.5
        np.copyto(levels, 128.0, where=np.isnan(levels))
        # Nothing is negative: cut off, it is rounded down.
        colours[..., channel] = levels


def normals_picture(path: FilePath, normals: ArrayLike) -> None:
    """Write a normal map, one pixel for one pixel, in the colours of `normals_rgb`.

    Parameters
    ----------
    path : path
        The PNG file to write.
    normals : array_like, shape (height, width, 3)
        Unit normals in camera axes; NaN where there is no surface.

    Raises
    ------
    InputError
        When the shape is not (height, width, 3), or no pixel holds a normal.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from persfs_cl.surface.plots import normals_picture
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     normals_picture(path, np.full((20, 20, 3), (0.0, 0.0, -1.0)))
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    write_png(path, normals_rgb(normals))


def comparison_picture(
    path: FilePath,
    photo: ArrayLike,
    rendered: ArrayLike,
    title: str = "",
    *,
    white: float = 1.0,
    photo_title: str = "Photograph",
    errors: Errors | None = None,
) -> None:
    """Draw photograph, re-rendered photograph and their difference, with its mean and root mean square.

    Parameters
    ----------
    path : path
        The PNG file to write.
    photo, rendered : array_like, shape (height, width)
        Linear light; NaN where there is none. Only pixels that are finite in both are compared;
        ``rendered`` is first cut to [0, white], since a photograph holds nothing else.
    title : str
    white : float
        The brightness that is shown as white and counts as 255 grey levels.
    photo_title : str
        What ``photo`` is called, where it has been prepared.
    errors : Errors, optional
        Of the re-rendered photograph, in grey levels, where they are at hand.

    Raises
    ------
    InputError
        When the shapes differ or are not (height, width), when no pixel is finite in both, or when
        ``white`` is not above 0.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import persfs_cl as ps
    >>> from persfs_cl.surface.plots import comparison_picture
    >>> scene = ps.bump((20, 20))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     comparison_picture(path, scene.image, 0.9 * scene.image)
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    if not 0 < white < np.inf:
        raise InputError.about("white", white, "is not a brightness: give a finite number above 0.")
    given, again = np.asarray(photo, dtype=np.float64), np.asarray(rendered, dtype=np.float64)
    if given.ndim != 2:
        raise InputError(f"photo has shape {given.shape}: give a grey image, (height, width).")
    scale = 255.0 / white
    if errors is None:
        errors = compare((again * scale).clip(0.0, 255.0), given * scale)
    blocks = Blocks((given.shape[0], given.shape[1]))

    def numbers(rows: slice) -> Array:
        before, after = given[rows], again[rows].clip(0.0, white)
        shown, seen = blocks.means(before), blocks.means(after)
        # That of the means is the mean, but where a pixel is missing in one of the two.
        missing = np.isnan(before.sum() + after.sum())
        difference = blocks.means(after - before) if missing else seen - shown
        return np.stack([shown, seen, difference], axis=1) * scale

    maps = blocks.collected(numbers)
    # A few outliers, at silhouettes mostly, would otherwise bleach the picture.
    places = sampled(given, MAP_SAMPLES**2)
    before, after = given.reshape(-1)[places] * scale, again.reshape(-1)[places] * scale
    limit = max(quantile(np.abs(after.clip(0.0, 255.0) - before), 0.99), 1.0)

    with new_figure(path) as figure:
        panels = Panels(figure, given.shape, 3)
        left, middle, right = panels.axes
        show(left, maps[:, 0], blocks, photo_title, "gray", (0.0, 255.0))
        show(middle, maps[:, 1], blocks, "Re-rendered", "gray", (0.0, 255.0))
        heading = f"Difference in grey levels\nME {errors.mean:.2f}, RS {errors.root_mean_square:.2f}"
        picture = show(right, maps[:, 2], blocks, heading, "RdBu_r", (-limit, limit))
        label = f"re-rendered − {photo_title.lower()}\n(grey levels)"
        panels.add_bar(2, picture, label, extend="both" if errors.maximum > limit else "neither")
        panels.arrange(title)


def confidence_picture(
    path: FilePath, slope_error: ArrayLike, unreliable: Mapping[str, NDArray[np.bool_]], title: str = "Confidence"
) -> None:
    """Draw how much the slope suffers from errors of the brightness, and which pixels are unreliable and why.

    Parameters
    ----------
    path : path
        The PNG file to write.
    slope_error : array_like, shape (height, width)
        Change of the slope for a change of the brightness by 1 %, above 0; NaN where there is no surface.
    unreliable : mapping of str to ndarray of bool, shape (height, width)
        Pixels by reason, at most 8; of several reasons the first is drawn, and counted.
    title : str

    Raises
    ------
    InputError
        When ``slope_error`` is NaN everywhere or no image, or a map of ``unreliable`` has another shape.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from persfs_cl.surface.plots import confidence_picture
    >>> slope_error = np.linspace(0.02, 0.2, 400).reshape(20, 20)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     confidence_picture(path, slope_error, {"steep": slope_error > 0.1})
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    load_matplotlib()
    from matplotlib.colors import ListedColormap, LogNorm
    from matplotlib.patches import Patch
    from matplotlib.ticker import LogFormatter

    errors = np.asarray(slope_error, dtype=np.float64)
    if errors.ndim != 2:
        raise InputError(f"slope_error has shape {errors.shape}: give one number a pixel, (height, width).")
    some = errors.reshape(-1)[sampled(errors, MAP_SAMPLES**2)]
    some = some[np.isfinite(some)]
    if not some.size:
        require_finite("slope_error", errors)
        some = errors[np.isfinite(errors)]
    labels = ["none", *unreliable]
    for reason, pixels in unreliable.items():
        if pixels.shape != errors.shape:
            raise InputError(
                f"unreliable[{reason!r}] has shape {pixels.shape}: give that of slope_error, {errors.shape}."
            )
    blocks = Blocks((errors.shape[0], errors.shape[1]))
    counts = [0] * (len(labels) + 1)

    def numbers(rows: slice) -> Array:
        classes = np.where(np.isfinite(errors[rows]), np.uint8(len(labels)), _NO_SURFACE)
        # Backwards, so that the first of several reasons is on top.
        for number, pixels in reversed(list(enumerate(unreliable.values(), start=1))):
            if pixels[rows].any():
                classes[pixels[rows]] = number
        for number in range(1, len(labels) + 1):
            counts[number] += int(np.count_nonzero(classes == number))
        # The first reason in each block, so that the smallest spot can be seen.
        first = blocks.combined(np.minimum, classes).astype(np.float64)
        first[first == len(labels)] = 0.0
        first[first == _NO_SURFACE] = np.nan
        return np.stack([100.0 * blocks.means(errors[rows]), first], axis=1)

    maps = blocks.collected(numbers)
    counts[0] = counts[len(labels)]
    colours = (_NOTHING_DOUBTFUL, *_REASONS)
    patches = [
        Patch(color=colours[number], label=f"{label}: {counts[number]:,} px")
        for number, label in enumerate(labels)
        if counts[number]
    ]
    low, high = 100.0 * np.percentile(some, (1, 99), overwrite_input=True)
    with new_figure(path) as figure:
        panels = Panels(figure, errors.shape, 2)
        left, right = panels.axes
        heading = "Slope error for a brightness\n1 % wrong (bright: worse)"
        # Wider than a flat surface needs, for a scale of one value has no colours.
        limits = low / 1.01, high * 1.01
        picture = show(left, maps[:, 0], blocks, heading, "cividis", limits)
        picture.set_norm(LogNorm(*limits))
        label = "change of tan θ, in hundredths;\nθ: angle between normal and light"
        bar = panels.add_bar(0, picture, label, extend="both")
        bar.long_axis.set_major_formatter("{x:g}")
        bar.long_axis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
        of_classes = (-0.5, len(colours) - 0.5)
        show(right, maps[:, 1], blocks, "Unreliable, and why", ListedColormap(colours), of_classes)
        legend = figure.legend(handles=patches, loc="lower center", ncols=2, frameon=False, fontsize=9)
        panels.arrange(title, legend)
