"""The surface as a solid, seen obliquely."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array, Mask
from persfs_cl.blocks import row_blocks
from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.grid import PixelGrid
from persfs_cl.io.files import FilePath
from persfs_cl.quantiles import sampled
from persfs_cl.surface import geometry as surface
from persfs_cl.surface.plots.blocks import MAP_SAMPLES
from persfs_cl.surface.plots.canvas import UNIT, new_figure, require_finite

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

_RELIEF_SAMPLES = 200
_SOLID_INCHES = 5.6
_ELEVATION, _AZIMUTH = 48.0, -70.0


def relief_picture(
    path: FilePath,
    depth: ArrayLike,
    camera: Camera,
    image: ArrayLike | None = None,
    title: str = "Surface",
    *,
    unit: str = UNIT,
    white: float = 1.0,
    discontinuities: surface.Discontinuities | None = None,
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
    discontinuities : Discontinuities, optional
        Where the surface is interrupted; no facet is drawn across.

    Raises
    ------
    InputError
        When ``depth`` is not a depth map or is NaN everywhere, or when ``image`` or ``discontinuities`` has another
        shape.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import persfs_cl as ps
    >>> from persfs_cl.surface.plots import relief_picture
    >>> scene = ps.bump((20, 20))
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     relief_picture(path, scene.depth, scene.camera, scene.image)
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    given = z = surface.depth_array(depth)
    require_finite("depth", z)
    shape = z.shape[0], z.shape[1]
    grid = camera.grid(shape)
    x, y = np.broadcast_to(grid.x, shape), np.broadcast_to(grid.y, shape)
    far_off = _far_off(grid, z)
    outside = int(np.count_nonzero(far_off)) if far_off is not None else 0
    if far_off is not None:
        z = np.where(far_off, np.nan, z)
    grey = None if image is None else np.asarray(image, dtype=np.float64)
    if grey is not None and grey.shape != shape:
        raise InputError(f"image has shape {grey.shape}: give a grey image of the depth's shape {shape}.")

    finite = np.isfinite(z)
    rows, columns = (np.flatnonzero(finite.any(axis=axis)) for axis in (1, 0))
    step = 1 + max(np.ptp(rows), np.ptp(columns)) // _RELIEF_SAMPLES
    chosen = np.s_[rows.min() : rows.max() + 1 : step, columns.min() : columns.max() + 1 : step]
    whole = _corners(finite[chosen]).all(axis=2)
    if discontinuities is not None:
        discontinuities.check(shape)
        whole &= ~_interrupted(discontinuities, chosen)

    def facets_of(values: Array) -> Array:
        return _corners(values[chosen])[whole] if whole.any() else values[finite][:, None]

    depths = facets_of(z)
    facets = np.stack([depths * facets_of(x), depths * facets_of(y), depths], axis=-1)
    if whole.any():
        facing = surface.normals_of_rows(given, camera, np.arange(len(given))[chosen[0]], discontinuities)
        facing = _corners(facing[:, chosen[1]])[whole].mean(axis=1)
    else:
        facing = surface.normals(given, camera, discontinuities)[finite]
    colours = [_clay(facing)]
    if grey is not None:
        worn = (np.nan_to_num(facets_of(grey)) / white).clip(0.0, 1.0)
        colours.insert(0, worn.mean(axis=1).repeat(3).reshape(-1, 3))

    lowest, highest = facets.min(axis=(0, 1)), facets.max(axis=(0, 1))
    centre, extent = (lowest + highest) / 2, highest - lowest
    extent = np.maximum(extent, 0.05 * (extent.max() or centre[2]))
    panel_width, panel_height = _oblique_size(extent)
    width, height = panel_width * len(colours), panel_height
    with new_figure(path, width, height) as figure:
        for index, colour in enumerate(colours):
            # Matplotlib keeps these axes square: a square larger than the panel, centred, wastes no paper.
            left = (index + 0.5) * panel_width - _SOLID_INCHES / 2 - 0.25
            bottom = (panel_height - _SOLID_INCHES) / 2 + 0.15
            place = (left / width, bottom / height, _SOLID_INCHES / width, _SOLID_INCHES / height)
            axes = figure.add_axes(place, projection="3d", facecolor="none")
            _draw_solid(axes, facets, colour, centre - extent / 2, centre + extent / 2)
        figure.text(0.5, 1 - 0.1 / height, title, ha="center", va="top", fontsize=12)
        note = f"x, y and depth in {unit}, one scale"
        if outside:
            note += f"\n{outside:,} pixels outside the view"
        figure.text(0.5, 0.1 / height, note, ha="center", fontsize=9, color="0.35")


def _corners(samples: NDArray[Any]) -> NDArray[Any]:
    """Values at the corners of every square of samples, counter-clockwise: (rows, columns, 4, ...)."""
    return np.stack([samples[:-1, :-1], samples[1:, :-1], samples[1:, 1:], samples[:-1, 1:]], axis=2)


def _interrupted(discontinuities: surface.Discontinuities, sampled: tuple[slice, slice]) -> NDArray[np.bool_]:
    """Squares of samples with a cut anywhere along one of their four sides."""
    # How many there are before each pixel of its row or column: between two samples some lie where the numbers differ.
    along_rows = np.pad(np.cumsum(discontinuities.right, axis=1), ((0, 0), (1, 0)))[sampled]
    along_columns = np.pad(np.cumsum(discontinuities.down, axis=0), ((1, 0), (0, 0)))[sampled]
    across, downwards = np.diff(along_rows, axis=1) > 0, np.diff(along_columns, axis=0) > 0
    return np.asarray(across[:-1] | across[1:] | downwards[:, :-1] | downwards[:, 1:])


def _far_off(grid: PixelGrid, z: Array) -> Mask | None:
    """The few points z (x, y, 1) that lie so far from all others that those could hardly be seen; None for none."""
    x, y = grid.x, grid.y
    places = sampled(z, MAP_SAMPLES**2)
    places = places[np.isfinite(z.reshape(-1)[places])]
    if not places.size:
        places = np.flatnonzero(np.isfinite(z))
    rows, columns = np.divmod(places, len(x))
    some = z.reshape(-1)[places]
    low, high = np.array(
        [np.percentile(values, (0.5, 99.5)) for values in (some * x[columns], some * y[rows, 0], some)]
    ).T[..., None, None]
    longest = (high - low).max()
    # What the whole image spans at the least or the largest depth, no point lies outside of.
    depths = np.array([np.fmin.reduce(z, axis=None), np.fmax.reduce(z, axis=None)])
    spans = [np.ptp(np.outer(depths, (sides.min(), sides.max()))) for sides in (x, y)]
    if max(*spans, np.ptp(depths)) <= 2 * longest:
        return None

    def points(rows: slice) -> Array:
        return np.stack([z[rows] * x, z[rows] * y[rows], z[rows]])

    lows, highs = [], []
    for some_rows in row_blocks((z.shape[0], z.shape[1])):
        of_rows = points(some_rows)
        lows.append(np.fmin.reduce(of_rows, axis=(1, 2)))
        highs.append(np.fmax.reduce(of_rows, axis=(1, 2)))
    if not (np.fmax.reduce(highs) - np.fmin.reduce(lows)).max() > 2 * longest:
        return None
    margin = longest / 4
    far_off = np.empty(z.shape, bool)
    for some_rows in row_blocks((z.shape[0], z.shape[1])):
        of_rows = points(some_rows)
        far_off[some_rows] = ((of_rows < low - margin) | (of_rows > high + margin)).any(axis=0)
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
        # Without edges they fit together as they are, if they are not smoothed.
        axes.add_collection3d(Poly3DCollection(facets, facecolors=colours, edgecolors="none", antialiaseds=False))
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
