"""The figures: each one PNG file, panels that belong together with one view and one scale."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.io.files import FilePath, atomic_path
from persfs_cl.paper.history import History
from persfs_cl.paper.printed import TANKUS_VASE, YANG_HAN_VASE
from persfs_cl.scenes.scene import Scene
from persfs_cl.surface.plots import matplotlib_defaults

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.image import AxesImage
    from mpl_toolkits.mplot3d import Axes3D


_DOTS_PER_INCH = 105
# Okabe and Ito's, which colour-blind people tell apart too.
_COLOURS = ("#0072B2", "#009E73", "#56B4E9", "#CC79A7", "#E69F00", "#000000")
_OURS, _BASELINE = "#0072B2", "#D55E00"
_CLAY = (0.93, 0.88, 0.80)
_ELEVATION, _AZIMUTH = 38.0, -62.0
_SAMPLES = 110
"""Facets along the longer side of a surface."""
_MARKERS = "osD^vP"


@contextmanager
def _figure(path: FilePath, width: float, height: float) -> Iterator[Figure]:
    """An empty figure of a size in inches; it becomes the PNG file when the block has drawn on it."""
    from PIL import Image

    with matplotlib_defaults():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), dpi=_DOTS_PER_INCH, layout="constrained")
        yield figure
        drawn = io.BytesIO()
        figure.savefig(drawn, format="png")
    # Of 256 colours, which nobody misses, a file has a third of the size.
    picture = Image.open(drawn).convert("RGB")
    picture = picture.quantize(256, method=Image.Quantize.MAXCOVERAGE, kmeans=3, dither=Image.Dither.NONE)
    with atomic_path(path) as temporary:
        picture.save(temporary, format="PNG", optimize=True)


def histories(path: FilePath, own: Mapping[str, History], printed: Mapping[str, History], unit: str) -> None:
    """ME and RS over the iterations; what the paper prints is dashed.

    Parameters
    ----------
    path : path
    own, printed : mapping of str to History
        By what the legend calls them.
    unit : str
        Of the errors.
    """
    with _figure(path, 9.0, 4.2) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, title in zip(panels, ("Mean error, ME", "Root mean square error, RS"), strict=True):
            for number, (name, history) in enumerate(own.items()):
                style = {"color": _COLOURS[number], "marker": _MARKERS[number], "markersize": 4}
                axes.plot(history.iterations, _errors(history, title), label=name, **style)
            for colour, (name, history) in zip(("0.25", "#D55E00"), printed.items(), strict=True):
                style = {"color": colour, "linestyle": "--", "linewidth": 2.0}
                axes.plot(history.iterations, _errors(history, title), label=f"printed: {name}", **style)
            axes.set(yscale="log", title=title, xlabel="iterations", xticks=[1, 5, 10, 15, 20, 25, 30])
            axes.minorticks_off()
            axes.set_yticks([0.02, 0.05, 0.1, 0.2, 0.4])
            axes.yaxis.set_major_formatter("{x:g}")
            axes.grid(alpha=0.3)
            axes.spines[["top", "right"]].set_visible(False)
        panels[0].set_ylabel(f"error ({unit})")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)


def vase_shapes(path: FilePath, scene: Scene, here: Array, tankus: Array, iterations: int) -> None:
    """Figure 2: shape, image, and for both methods reconstruction and deviation.

    Heights are scaled to that of the vase, as the errors are, and drawn upwards, all lengths in pixels.

    Parameters
    ----------
    path : path
    scene : Scene
    here, tankus : ndarray of float, shape (height, width)
        Depths found.
    iterations : int
        After how many.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    relief = float(np.ptp(scene.depth)) * scene.camera.fx

    def height(depth: Array) -> Array:
        return np.asarray(relief * (depth - np.nanmin(depth)) / (np.nanmax(depth) - np.nanmin(depth)))

    truth = height(scene.depth)
    found = {"the project's sweeps": height(here), "Tankus' method": height(tankus)}
    limits = (0.0, relief)
    furthest = float(max(np.abs(values - truth).max() for values in found.values()))
    colours = Normalize(-furthest, furthest)
    with _figure(path, 10.5, 6.6) as figure:
        upper, lower = _halves(figure)
        _solid(_solid_axes(upper, (1, 3, 1)), truth, "(a) original shape", limits)
        for place, (letter, (name, values)) in enumerate(zip("ce", found.items(), strict=True), 2):
            title = f"({letter}) {name}, {iterations} iterations"
            _solid(_solid_axes(upper, (1, 3, place)), values, title, limits)
        axes = lower.add_subplot(1, 3, 1)
        axes.imshow(255.0 * scene.image, cmap="gray", vmin=0, vmax=255)
        axes.set(title="(b) image, grey levels", xlabel="column (px)", ylabel="row (px)")
        for place, (letter, source, values) in enumerate(zip("df", "ce", found.values(), strict=True), 2):
            axes = lower.add_subplot(1, 3, place)
            axes.imshow(values - truth, cmap="RdBu_r", norm=colours)
            axes.set(title=f"({letter}) deviation of ({source}) from (a)", xlabel="column (px)")
            axes.tick_params(labelleft=False)
        label = "too low (blue), too high (red): px"
        lower.colorbar(ScalarMappable(colours, "RdBu_r"), ax=lower.axes, shrink=0.85, label=label)


def statue(
    path: FilePath,
    image: Array,
    depths: Sequence[Array],
    again: Sequence[Array],
    camera: Camera,
    histories: tuple[tuple[History, History], tuple[History, History]],
) -> None:
    """Figure 3: photograph, and for both methods the surface re-rendered and the surface; the histories of ME.

    Parameters
    ----------
    path : path
    image : ndarray, shape (height, width)
        In grey levels.
    depths, again : sequence of two ndarray, shape (height, width)
        Depths found by the project's sweeps and by Tankus' method, and their images in grey levels.
    camera : Camera
    histories : tuple
        Of each method what was measured, and what is printed.
    """
    from matplotlib.ticker import FixedLocator

    names = ("the project's sweeps", "Tankus' method")
    number = histories[0][0].iterations[-1]
    # What is not solved lies where its edge does.
    heights = [camera.fx * np.nan_to_num(depth - 1.0) for depth in depths]
    # Where there is no surface yet, or none to be found, there is no limit to the heights: they are cut off.
    limits = (0.0, min(float(heights[0].max()), float(max(image.shape))))
    with _figure(path, 10.5, 6.6) as figure:
        upper, lower = _halves(figure)
        titles = ["(a) photograph", *(f"({letter}) {name}: image" for letter, name in zip("ce", names, strict=True))]
        panels = upper.subplots(1, 3, sharey=True)
        for axes, title, values in zip(panels, titles, (image, *again), strict=True):
            picture = _photograph(axes, values, title)
        panels[0].set_ylabel("row (px)")
        upper.colorbar(picture, ax=panels, shrink=0.8, label="grey levels")
        axes = lower.add_subplot(1, 3, 1)
        for colour, name, (measured, printed) in zip((_OURS, _BASELINE), names, histories, strict=True):
            axes.plot(measured.iterations, measured.mean, color=colour, marker="o", markersize=4, label=name)
            axes.plot(printed.iterations, printed.mean, color=colour, linestyle="--", label="printed: another photo")
        axes.set(title="mean error of the image", yscale="log", xlabel="iterations", ylabel="ME (grey levels)")
        axes.set_xticks(histories[0][0].iterations)
        axes.set_ylim(top=800)
        axes.yaxis.set_major_locator(FixedLocator([2, 5, 10, 20, 50, 100, 200]))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_locator(FixedLocator([]))
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, loc="upper center", ncols=2, frameon=False)
        for place, (letter, name, values) in enumerate(zip("bd", names, heights, strict=True), 2):
            title = f"({letter}) {name}, {number} iterations"
            if values.max() > 1.02 * limits[1]:
                title += ", cut off"
            _solid(_solid_axes(lower, (1, 3, place)), values.clip(*limits), title, limits)


def flash(path: FilePath, image: Array, depth: Array, again: Array, camera: Camera) -> None:
    """Photograph, surface found from it as one by flash, and that surface re-rendered.

    Parameters
    ----------
    path : path
    image : ndarray, shape (height, width)
        In grey levels.
    depth, again : ndarray, shape (height, width)
        Depth found, and its image in grey levels.
    camera : Camera
    """
    # The surface is known up to its size: a pixel is as long as it is at the median depth. The steep rim is cut off.
    heights = camera.fx * (np.nanpercentile(depth, 99.0) - depth) / np.nanmedian(depth)
    limits = (0.0, float(np.nanmax(heights)))
    with _figure(path, 10.5, 3.7) as figure:
        left, right = _parts(figure, 1, 2, width_ratios=(1.75, 1.0))
        panels = left.subplots(1, 2, sharey=True)
        titles = ("(a) photograph", "(g) by flash, upwind: image")
        for axes, title, values in zip(panels, titles, (image, again), strict=True):
            picture = _photograph(axes, values, title)
        panels[0].set_ylabel("row (px)")
        left.colorbar(picture, ax=panels, shrink=0.7, label="grey levels")
        _solid(_solid_axes(right, (1, 1, 1)), heights.clip(*limits), "(f) by flash, upwind, rim cut off", limits)


def sensitivity(path: FilePath, errors: Sequence[tuple[str, str, float, float | None]], iterations: int) -> None:
    """ME of each variation as a dot, compared with what the paper prints.

    Parameters
    ----------
    path : path
    errors : sequence of (str, str, float, float or None)
        What is varied, to what, ME here, and that of Tankus' method.
    iterations : int
        After how many.
    """
    rows = np.arange(len(errors))
    with _figure(path, 9.0, 0.21 * len(errors) + 1.2) as figure:
        axes = figure.add_subplot()
        printed_place = TANKUS_VASE.iterations.index(iterations)
        for colour, name, history in ((_OURS, "Yang and Han", YANG_HAN_VASE), (_BASELINE, "Tankus", TANKUS_VASE)):
            value = history.mean[printed_place]
            axes.axvline(value, color=colour, linestyle="--", linewidth=1, label=f"printed: {name}, {value:g}")
        here = [error for _, _, error, _ in errors]
        tankus = [np.nan if error is None else error for *_, error in errors]
        axes.plot(tankus, rows, "s", color=_BASELINE, markersize=5, fillstyle="none", label="Tankus' method")
        axes.plot(here, rows, "o", color=_OURS, markersize=6, label="the project's sweeps")
        axes.set(
            xscale="log",
            xlabel=f"mean error after {iterations} iterations (height scaled to [0, 1], unless said otherwise)",
            yticks=rows,
            yticklabels=[f"{aspect}: {choice}" for aspect, choice, *_ in errors],
        )
        axes.set_xticks([0.01, 0.02, 0.05, 0.1, 0.2], ["0.01", "0.02", "0.05", "0.1", "0.2"])
        axes.minorticks_off()
        axes.margins(y=0.01)
        axes.invert_yaxis()
        axes.tick_params(axis="y", labelsize=8, length=0)
        axes.grid(alpha=0.3)
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)


def _errors(history: History, title: str) -> tuple[float, ...]:
    return history.mean if title.endswith("ME") else history.root_mean_square


def _halves(figure: Figure) -> tuple[SubFigure, SubFigure]:
    return _parts(figure, 2, 1)


def _parts(figure: Figure, rows: int, columns: int, **keywords: Any) -> tuple[SubFigure, SubFigure]:
    parts: Any = figure.subfigures(rows, columns, **keywords)
    return parts[0], parts[1]


def _photograph(axes: Axes, values: Array, title: str) -> AxesImage:
    """Grey levels; black where there are none, as the background of the photograph is."""
    axes.set(title=title, xlabel="column (px)", facecolor="black")
    return axes.imshow(values, cmap="gray", vmin=0, vmax=255)


def _solid_axes(figure: Figure | SubFigure, place: tuple[int, int, int]) -> Axes3D:
    axes: Any = figure.add_subplot(*place, projection="3d", facecolor="none")
    return axes


def _solid(axes: Axes3D, heights: Array, title: str, limits: tuple[float, float]) -> None:
    """A surface in clay over its pixels, height upwards, one scale along all axes."""
    from matplotlib.colors import LightSource

    step = 1 + max(heights.shape) // _SAMPLES
    rows, columns = np.mgrid[: heights.shape[0] : step, : heights.shape[1] : step]
    axes.plot_surface(
        columns,
        rows,
        heights[::step, ::step],
        rstride=1,
        cstride=1,
        color=_CLAY,
        lightsource=LightSource(azdeg=300, altdeg=50),
        linewidth=0,
        antialiased=False,
    )
    height, width = heights.shape
    axes.set(xlim=(0, width), ylim=(height, 0), zlim=limits)
    axes.set_box_aspect((width, height, max(limits[1] - limits[0], 1.0)), zoom=0.9)
    axes.view_init(elev=_ELEVATION, azim=_AZIMUTH)
    axes.set_title(title, fontsize=10)
    for axis, name in ((axes.xaxis, "column (px)"), (axes.yaxis, "row (px)"), (axes.zaxis, "height (px)")):
        axis.set_label_text(name, fontsize=8)
        axis.labelpad = 0 if axis is not axes.zaxis else -4
        axis.set_tick_params(labelsize=7, pad=1)
    axes.locator_params(axis="z", nbins=3)
