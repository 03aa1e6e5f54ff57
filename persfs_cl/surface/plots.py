"""Pictures for people: depth, normals, relief, comparison, confidence and convergence, each one PNG file.

Every picture is drawn on a figure of its own with the Agg canvas and Matplotlib's own defaults: no display, no pyplot,
no setting of the user's. Maps of more than 2000 pixels a side are drawn from 1000 to 2000 means of blocks of pixels,
more than the figure has dots; scales and numbers are those of all pixels. The normal map alone has a pixel for each of
the photograph.
"""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, atomic_path
from persfs_cl.metrics import compare
from persfs_cl.surface import geometry as surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from mpl_toolkits.mplot3d import Axes3D


UNIT = "units of the known values"
_DOTS_PER_INCH = 140
# Okabe and Ito's, which colour-blind people tell apart too, the darkest and the lightest first and last.
_REASONS = ("#000000", "#D55E00", "#56B4E9", "#E69F00", "#0072B2", "#009E73", "#CC79A7", "#F0E442")
_NOTHING_DOUBTFUL = "0.65"
_NO_SURFACE = "0.88"
_SLENDEREST = 8.0
_STEEPEST_CHANGE = 10.0
_MAP_SAMPLES = 1000
_COMPRESSION = 4  # half the time of the usual 6, and no more bytes
_RELIEF_SAMPLES = 200
_SOLID_INCHES = 5.6
_ELEVATION, _AZIMUTH = 48.0, -70.0

# Matplotlib is not thread-safe, even when every thread has a figure of its own.
_drawing = threading.Lock()


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
    """
    z = surface.depth_array(depth)
    _require_finite("depth", z)
    with _figure(path, *_size(z)) as figure:
        picture = _show(figure.add_subplot(), z, title, "viridis_r")
        place = "bottom" if z.shape[1] > 3 * z.shape[0] else "right"
        figure.colorbar(picture, location=place, label=f"depth ({unit})").long_axis.set_inverted(True)


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
    """
    vectors = np.asarray(normals, dtype=np.float64)
    if vectors.ndim != 3 or vectors.shape[2] != 3:
        raise InputError(f"normals has shape {vectors.shape}: give unit vectors, (height, width, 3).")
    _require_finite("normals", vectors)
    colours = np.empty(vectors.shape, np.uint8)
    for rows in row_blocks(vectors.shape[:2]):
        upright = np.nan_to_num(vectors[rows] * (1.0, -1.0, -1.0), nan=0.0)
        np.floor((upright.clip(-1.0, 1.0) + 1.0) * 127.5 + 0.5, out=colours[rows], casting="unsafe")
    return colours


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
    """
    import imageio.v3

    pixels = normals_rgb(normals)
    # In memory first: imageio's writers print a traceback of their own when the disk is full.
    data = imageio.v3.imwrite("<bytes>", pixels, extension=".png", compress_level=_COMPRESSION)
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def relief_picture(
    path: FilePath,
    depth: ArrayLike,
    camera: Camera,
    image: ArrayLike | None = None,
    title: str = "Surface",
    *,
    unit: str = UNIT,
    white: float = 1.0,
    cuts: surface.Cuts | None = None,
    normals: ArrayLike | None = None,
) -> None:
    """Draw the surface as a solid seen obliquely: near side up, lower edge of the photograph in front.

    All three axes have the same scale. At most about 200 x 200 samples are drawn. A surface without any
    square of four finite samples is drawn as dots. Where 1 pixel in 100, or fewer, would make the axes more than twice
    as long, it is left out, and the picture says so.

    Parameters
    ----------
    path : path
        The PNG file to write.
    depth : array_like, shape (height, width)
        Depth along the optical axis, > 0; NaN where there is no surface.
    camera : Camera
    image : array_like, shape (height, width), optional
        Photograph in [0, white]; a second view then wears its grey.
    title : str
    unit : str
        Unit of the depth, for the note on the scale.
    white : float
        The brightness of the photograph that is shown as white.
    cuts : Cuts, optional
        Where the surface is interrupted; no facet is drawn across.
    normals : array_like, shape (height, width, 3), optional
        Those of `persfs_cl.surface.geometry.normals`, where they are at hand.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map or is NaN everywhere, or when ``image``, ``normals`` or ``cuts`` has another
        shape.
    """
    z = surface.depth_array(depth)
    _require_finite("depth", z)
    shape = z.shape[0], z.shape[1]
    grid = camera.grid(shape)
    x, y = np.broadcast_to(grid.x, shape), np.broadcast_to(grid.y, shape)
    far_off = _far_off(x, y, z)
    z = np.where(far_off, np.nan, z)
    grey = None if image is None else np.asarray(image, dtype=np.float64)
    if grey is not None and grey.shape != shape:
        raise InputError(f"image has shape {grey.shape}: give a grey image of the depth's shape {shape}.")
    facing = surface.normals(depth, camera, cuts) if normals is None else np.asarray(normals, dtype=np.float64)
    if facing.shape != (*shape, 3):
        raise InputError(f"normals has shape {facing.shape}: give those of the depth, {(*shape, 3)}.")

    finite = np.isfinite(z)
    rows, columns = np.nonzero(finite)
    step = 1 + max(np.ptp(rows), np.ptp(columns)) // _RELIEF_SAMPLES
    sampled = np.s_[rows.min() : rows.max() + 1 : step, columns.min() : columns.max() + 1 : step]
    whole = _corners(finite[sampled]).all(axis=2)
    if cuts is not None:
        cuts.check(shape)
        whole &= ~_interrupted(cuts, sampled)

    def facets_of(values: Array) -> Array:
        return _corners(values[sampled])[whole] if whole.any() else values[finite][:, None]

    depths = facets_of(z)
    facets = np.stack([depths * facets_of(x), depths * facets_of(y), depths], axis=-1)
    colours = [_clay(facets_of(facing).mean(axis=1))]
    if grey is not None:
        worn = (np.nan_to_num(facets_of(grey)) / white).clip(0.0, 1.0)
        colours.insert(0, worn.mean(axis=1).repeat(3).reshape(-1, 3))

    lowest, highest = facets.min(axis=(0, 1)), facets.max(axis=(0, 1))
    centre, extent = (lowest + highest) / 2, highest - lowest
    extent = np.maximum(extent, 0.05 * (extent.max() or centre[2]))
    panel_width, panel_height = _oblique_size(extent)
    width, height = panel_width * len(colours), panel_height
    with _figure(path, width, height, arrange=False) as figure:
        for index, colour in enumerate(colours):
            # Matplotlib keeps these axes square: a square larger than the panel, centred, wastes no paper.
            left = (index + 0.5) * panel_width - _SOLID_INCHES / 2 - 0.25
            bottom = (panel_height - _SOLID_INCHES) / 2 + 0.15
            place = (left / width, bottom / height, _SOLID_INCHES / width, _SOLID_INCHES / height)
            axes = figure.add_axes(place, projection="3d", facecolor="none")
            _draw_solid(axes, facets, colour, centre - extent / 2, centre + extent / 2)
        figure.text(0.5, 1 - 0.1 / height, title, ha="center", va="top", fontsize=12)
        note = f"x, y and depth in {unit}, one scale"
        if far_off.any():
            note += f"\n{np.count_nonzero(far_off):,} pixels outside the view"
        figure.text(0.5, 0.1 / height, note, ha="center", fontsize=9, color="0.35")


def comparison_picture(
    path: FilePath,
    photo: ArrayLike,
    rendered: ArrayLike,
    title: str = "",
    *,
    white: float = 1.0,
    photo_title: str = "Photograph",
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

    Raises
    ------
    InputError
        When the shapes differ or are not (height, width), when no pixel is finite in both, or when
        ``white`` is not above 0.
    """
    if not 0 < white < np.inf:
        raise InputError.about("white", white, "is not a brightness: give a finite number above 0.")
    scale = 255.0 / white
    given = np.asarray(photo, dtype=np.float64) * scale
    again = np.asarray(rendered, dtype=np.float64) * scale
    np.clip(again, 0.0, 255.0, out=again)
    if given.ndim != 2:
        raise InputError(f"photo has shape {given.shape}: give a grey image, (height, width).")
    errors = compare(again, given)
    difference = again - given
    sizes = np.abs(difference[~np.isnan(difference)])
    # A few outliers, at silhouettes mostly, would otherwise bleach the picture.
    limit = max(float(np.percentile(sizes, 99, overwrite_input=True)), 1.0)

    with _figure(path, *_size(difference, panels=3)) as figure:
        left, middle, right = figure.subplots(1, 3, sharey=True)
        _show(left, given, photo_title, "gray", (0.0, 255.0))
        _show(middle, again, "Re-rendered", "gray", (0.0, 255.0))
        picture = _show(
            right,
            difference,
            f"Difference in grey levels\nME {errors.mean:.2f}, RS {errors.root_mean_square:.2f}",
            "RdBu_r",
            (-limit, limit),
        )
        figure.colorbar(
            picture,
            label=f"re-rendered − {photo_title.lower()} (grey levels)",
            extend="both" if errors.maximum > limit else "neither",
        )
        if title:
            figure.suptitle(title)


def confidence_picture(
    path: FilePath, slope_error: ArrayLike, doubts: Mapping[str, NDArray[np.bool_]], title: str = "Confidence"
) -> None:
    """Draw how much the slope suffers from errors of the brightness, and beside it which pixels are in doubt and why.

    Parameters
    ----------
    path : path
        The PNG file to write.
    slope_error : array_like, shape (height, width)
        Change of the slope for a change of the brightness by 1 %, above 0; NaN where there is no surface.
    doubts : mapping of str to ndarray of bool, shape (height, width)
        Pixels by reason, at most 8; of several reasons the first is drawn, and counted.
    title : str

    Raises
    ------
    InputError
        When ``slope_error`` is NaN everywhere or no image, or a map of ``doubts`` has another shape.
    """
    _matplotlib()
    from matplotlib.colors import ListedColormap, LogNorm
    from matplotlib.patches import Patch
    from matplotlib.ticker import LogFormatter

    errors = np.asarray(slope_error, dtype=np.float64)
    if errors.ndim != 2:
        raise InputError(f"slope_error has shape {errors.shape}: give one number a pixel, (height, width).")
    _require_finite("slope_error", errors)
    classes = np.where(np.isfinite(errors), 0.0, np.nan)
    labels = ["none", *doubts]
    # Backwards, so that the first of several reasons is on top.
    for number, reason in reversed(list(enumerate(labels))[1:]):
        pixels = doubts[reason]
        if pixels.shape != errors.shape:
            raise InputError(f"doubts[{reason!r}] has shape {pixels.shape}: give that of slope_error, {errors.shape}.")
        classes[pixels] = number
    colours = (_NOTHING_DOUBTFUL, *_REASONS)
    patches = [
        Patch(color=colours[number], label=f"{labels[number]}: {count:,} px")
        for number, count in zip(*np.unique(classes[~np.isnan(classes)].astype(int), return_counts=True), strict=True)
    ]
    hundredths = 100.0 * errors
    low, high = np.nanpercentile(hundredths, (1, 99))
    with _figure(path, *_size(errors, panels=2)) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        picture = _show(left, hundredths, "Slope error for a brightness\n1 % wrong (bright: worse)", "cividis")
        # Wider than a flat surface needs, for a scale of one value has no colours.
        picture.set_norm(LogNorm(low / 1.01, high * 1.01))
        place = "bottom" if errors.shape[1] > 3 * errors.shape[0] else "right"
        label = "change of tan θ, in hundredths;\nθ: angle between normal and light"
        bar = figure.colorbar(picture, location=place, label=label, extend="both")
        bar.long_axis.set_major_formatter("{x:g}")
        bar.long_axis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
        limits = (-0.5, len(colours) - 0.5)
        _show(right, classes, "In doubt, and why", ListedColormap(colours), limits, thin=_first_reasons)
        figure.legend(handles=patches, loc="outside lower center", ncols=2, frameon=False, fontsize=9)
        figure.suptitle(title)


def convergence_picture(path: FilePath, changes: ArrayLike, tolerance: float, title: str = "Convergence") -> None:
    """Draw the change of every iteration on a logarithmic axis, beside the tolerance.

    Parameters
    ----------
    path : path
        The PNG file to write.
    changes : array_like, shape (iterations,)
        max |ΔZ| of each iteration, finite and >= 0. A change of exactly 0 is drawn as a triangle at the foot,
        and one above 10, which only the start value explains, at the top when others are below.
    tolerance : float
        The change at which the iteration stops, >= 0; drawn as a line unless it is 0.
    title : str

    Raises
    ------
    InputError
        When there is no change, one is negative or not finite, or the tolerance is negative or not finite.
    """
    values = np.asarray(changes, dtype=np.float64)
    if values.ndim != 1 or values.size == 0 or not (np.isfinite(values) & (values >= 0)).all():
        raise InputError.about("changes", changes, ": give one finite number >= 0 for each iteration.")
    if not 0 <= tolerance < np.inf:
        raise InputError.about("tolerance", tolerance, "is not a change: give a finite number >= 0.")

    iterations = np.arange(1, values.size + 1)
    moved = values > 0
    with _figure(path, 6.4, 4.0) as figure:
        axes = figure.add_subplot()
        # Matplotlib complains of limits of its own that come from one value alone.
        axes.set_autoscaley_on(False)
        axes.semilogy(iterations[moved], values[moved], color="#31688e", marker="o", markersize=3.5, label="change")
        if tolerance > 0:
            axes.axhline(tolerance, color="#c44e52", linestyle="--", label=f"tolerance {tolerance:g}")
        if not moved.all():
            axes.plot(
                iterations[~moved],
                np.full(np.count_nonzero(~moved), 0.03),
                transform=axes.get_xaxis_transform(),
                color="#31688e",
                marker="v",
                linestyle="none",
                label="no change at all",
            )
        axes.set(title=title, xlabel="iteration (four sweeps)", ylabel="change of ln depth, max |ΔZ|")
        axes.locator_params(axis="x", integer=True, min_n_ticks=1)
        _limit_changes(axes, values, tolerance)
        axes.grid(which="major", color="0.9")
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend()


def _limit_changes(axes: Axes, changes: Array, tolerance: float) -> None:
    """Fit the axis to the iterations proper; the first ones come down from a start value as high as you like."""
    positive = changes[changes > 0]
    bottom = min((*positive, *([tolerance] if tolerance > 0 else [])), default=1.0)
    # No surface is a factor e^10 deeper than its known values, but each pixel adds a step to the start value.
    proper = positive[positive <= _STEEPEST_CHANGE]
    high = np.flatnonzero(changes > _STEEPEST_CHANGE)
    top = max((*proper, tolerance), default=1.0) if proper.size else positive.max(initial=1.0)
    axes.set_ylim(bottom / (3 if (changes > 0).all() else 10), 3 * top)
    if proper.size and high.size:
        axes.plot(
            high + 1,
            np.full(high.size, 0.97),
            transform=axes.get_xaxis_transform(),
            color="#31688e",
            marker="^",
            linestyle="none",
            label=f"from the start value: up to {changes[high].max():.2g}",
        )


def _require_finite(name: str, values: Array) -> None:
    if not np.isfinite(values).any():
        raise InputError(f"{name} of shape {values.shape} holds no finite value: there is nothing to draw.")


@contextmanager
def matplotlib_defaults() -> Iterator[None]:
    """Matplotlib as it comes: whatever MPLBACKEND and the user's matplotlibrc say plays no part in the block."""
    matplotlib = _matplotlib()
    # The backend, which no figure here asks for, would stay.
    defaults = {name: value for name, value in matplotlib.rcParamsDefault.items() if name != "backend"}
    with matplotlib.rc_context(defaults):
        yield


def _matplotlib() -> ModuleType:
    """Matplotlib, which cannot be imported where MPLBACKEND is wrong, and complains of lines of a matplotlibrc."""
    if "matplotlib" in sys.modules:
        return sys.modules["matplotlib"]
    backend = os.environ.pop("MPLBACKEND", None)
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        import matplotlib as mpl
    finally:
        logger.setLevel(level)
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    if backend:
        # For others in this process who draw, as the import would have done.
        with suppress(ValueError):
            mpl.rcParams["backend"] = backend
    return mpl


@contextmanager
def _figure(path: FilePath, width: float, height: float, *, arrange: bool = True) -> Iterator[Figure]:
    """An empty figure of a size in inches; it becomes the PNG file when the block has drawn on it."""
    with _drawing, matplotlib_defaults():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), dpi=_DOTS_PER_INCH, layout="compressed" if arrange else None)
        canvas = FigureCanvasAgg(figure)
        yield figure
        with atomic_path(path) as temporary:
            # Without the metadata the same input gives the same bytes under every version number.
            # Not by savefig(), which would go through everything twice.
            canvas.print_png(temporary, metadata={"Software": None})  # type: ignore[no-untyped-call]


def _size(image: Array, panels: int = 1) -> tuple[float, float]:
    """Width and height in inches of a figure with some copies of the image side by side and a colour bar."""
    aspect = np.clip(image.shape[1] / image.shape[0], 1 / 3, 3)
    side = 4.6 if panels == 1 else 3.6
    return panels * (side * np.sqrt(aspect) + 0.5) + 1.0, side / np.sqrt(aspect) + 0.9


def _show(
    axes: Axes,
    image: Array,
    title: str,
    cmap: str | Colormap,
    limits: tuple[float, float] | None = None,
    thin: Callable[[Array, int, int], Array] | None = None,
) -> AxesImage:
    """Image on axes in pixels, light grey where it is NaN; of a large one, means of blocks or what `thin` makes of it.

    Pixels are square, unless the image is so slender that nothing could be seen of it, nor of a colour bar beside it.
    Unless there are limits, colours are for the range of all pixels.
    """
    height, width = image.shape
    slenderness = width / height
    stretch = slenderness / np.clip(slenderness, 1 / _SLENDEREST, _SLENDEREST)
    low, high = limits or (np.nanmin(image), np.nanmax(image))
    down, right = (max(1, size // _MAP_SAMPLES) for size in image.shape)
    shown = image if down == right == 1 else (thin or _means)(image, down, right)
    extent = (-0.5, shown.shape[1] * right - 0.5, shown.shape[0] * down - 0.5, -0.5)
    picture = axes.imshow(shown, cmap=cmap, vmin=low, vmax=high, aspect=float(stretch), extent=extent)
    # Blocks may end behind the last pixel.
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.set_facecolor(_NO_SURFACE)
    axes.set_title(title, fontsize=11)
    axes.set_xlabel("column (px)")
    axes.set_ylabel("row (px)")
    axes.label_outer()
    axes.locator_params(integer=True, min_n_ticks=1)
    return picture


def _of_blocks(combine: np.ufunc, values: Array, down: int, right: int) -> Array:
    """One number for every block of so many pixels down and to the right; at the end there may be fewer."""
    height, width = values.shape
    # Along rows first: neighbours in memory.
    along_rows = combine.reduceat(values, np.arange(0, width, right), axis=1)
    return np.asarray(combine.reduceat(along_rows, np.arange(0, height, down)))


def _means(values: Array, down: int, right: int) -> Array:
    """Means of blocks, over what is not NaN."""
    there = ~np.isnan(values)
    total = _of_blocks(np.add, np.where(there, values, 0.0), down, right)
    count = _of_blocks(np.add, there.astype(np.float64), down, right)
    return np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)


def _first_reasons(classes: Array, down: int, right: int) -> Array:
    """The first reason for doubt in each block, so that the smallest spot can be seen; 0 where there is none."""
    first = _of_blocks(np.fmin, np.where(classes == 0, np.inf, classes), down, right)
    first[np.isinf(first)] = 0.0
    return first


def _corners(samples: NDArray[Any]) -> NDArray[Any]:
    """Values at the corners of every square of samples, counter-clockwise: (rows, columns, 4, ...)."""
    return np.stack([samples[:-1, :-1], samples[1:, :-1], samples[1:, 1:], samples[:-1, 1:]], axis=2)


def _interrupted(cuts: surface.Cuts, sampled: tuple[slice, slice]) -> NDArray[np.bool_]:
    """Squares of samples with a cut anywhere along one of their four sides."""
    # Cuts before each pixel of its row or column: between two samples there are some where the numbers differ.
    along_rows = np.pad(np.cumsum(cuts.right, axis=1), ((0, 0), (1, 0)))[sampled]
    along_columns = np.pad(np.cumsum(cuts.down, axis=0), ((1, 0), (0, 0)))[sampled]
    across, downwards = np.diff(along_rows, axis=1) > 0, np.diff(along_columns, axis=0) > 0
    return np.asarray(across[:-1] | across[1:] | downwards[:, :-1] | downwards[:, 1:])


def _far_off(x: Array, y: Array, z: Array) -> NDArray[np.bool_]:
    """The few points z (x, y, 1) that lie so far from all others that those could hardly be seen."""
    finite = np.isfinite(z)
    there = z[finite]
    points = np.stack([there * x[finite], there * y[finite], there])
    low, high = np.percentile(points[:, :: 1 + there.size // _MAP_SAMPLES**2], (0.5, 99.5), axis=1)[..., None]
    longest = (high - low).max()
    far_off = np.zeros(z.shape, bool)
    if np.ptp(points, axis=1).max() > 2 * longest:
        margin = longest / 4
        far_off[finite] = ((points < low - margin) | (points > high + margin)).any(axis=0)
    return far_off


def _clay(towards_camera: Array) -> Array:
    """RGB of matt facets under a lamp to the left of the camera, softened so that no side is black."""
    lamp = np.array([-0.7, 0.1, -0.7])
    brightness = 0.2 + 0.8 * (0.5 + 0.5 * towards_camera @ lamp) ** 1.5
    return np.asarray(brightness[:, None].clip(0.0, 1.0) * (1.0, 0.96, 0.9))


def _oblique_size(extent: Array) -> tuple[float, float]:
    """Inches that a box of some extent in x, y and depth takes in the oblique view, with room for labels."""
    x, y, depth = extent / np.linalg.norm(extent)
    elevation, azimuth = np.radians(_ELEVATION), np.radians(90 + _AZIMUTH)
    across = x * np.cos(azimuth) + y * np.sin(azimuth)
    upwards = (x * np.sin(azimuth) + y * np.cos(azimuth)) * np.sin(elevation) + depth * np.cos(elevation)
    return _SOLID_INCHES * across + 1.9, _SOLID_INCHES * upwards + 1.5


def _draw_solid(axes: Axes3D, facets: Array, colours: Array, lowest: Array, highest: Array) -> None:
    """Facets, or dots, in camera axes; y and depth run downwards, so that the near side is up."""
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    if facets.shape[1] == 1:
        axes.scatter(*facets[:, 0].T, c=colours, s=10, edgecolors="0.3", linewidths=0.5, depthshade=False)
    else:
        axes.add_collection3d(Poly3DCollection(facets, facecolors=colours, edgecolors=colours, linewidths=0.4))
    axes.set_xlim(lowest[0], highest[0])
    axes.set_ylim(highest[1], lowest[1])
    axes.set_zlim(highest[2], lowest[2])
    axes.set_box_aspect(highest - lowest)
    axes.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    axes.set(xlabel="x", ylabel="y", zlabel="depth")
    extent = highest - lowest
    for index, axis in enumerate((axes.xaxis, axes.yaxis, axes.zaxis)):
        axis.set_pane_color((0.97, 0.97, 0.97))
        axis.set_major_locator(MaxNLocator(max(1, round(5 * extent[index] / extent.max()))))
        # Matplotlib shrinks these distances with the box's other two sides; this takes it back.
        stretch = extent.max() / np.delete(extent, index).max()
        axis.labelpad = 25 * stretch - 21
        axis.set_tick_params(labelsize=8, pad=11.5 * stretch - 8)
