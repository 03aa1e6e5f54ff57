"""What every picture is drawn on: a figure of its own, and images on it in pixels.

Figures have the Agg canvas and Matplotlib's own defaults: no display, no pyplot, no setting of the user's.
"""

from __future__ import annotations

import logging
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.export import write_png
from persfs_cl.io.files import FilePath
from persfs_cl.surface.plots.blocks import Blocks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

UNIT = "units of the known values"
_DOTS_PER_INCH = 140
_NO_SURFACE = "0.88"
SLENDEREST = 8.0
"""A map that is longer is stretched to so many times its width, or height."""
# Matplotlib is not thread-safe, even when every thread has a figure of its own.
_drawing = threading.Lock()


@contextmanager
def matplotlib_defaults() -> Iterator[None]:
    """Matplotlib as it comes: whatever MPLBACKEND and the user's matplotlibrc say plays no part in the block.

    Examples
    --------
    >>> import matplotlib
    >>> from persfs_cl.surface.plots import matplotlib_defaults
    >>> with matplotlib.rc_context({"lines.linewidth": 9.0}), matplotlib_defaults():
    ...     matplotlib.rcParams["lines.linewidth"]
    1.5
    """
    matplotlib = load_matplotlib()
    # The backend, which no figure here asks for, would stay.
    defaults = {name: value for name, value in matplotlib.rcParamsDefault.items() if name != "backend"}
    with matplotlib.rc_context(defaults):
        yield


def load_matplotlib() -> ModuleType:
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


def prepare_to_draw() -> None:
    """Import Matplotlib and find its fonts, which the first picture would wait for."""
    with _drawing, matplotlib_defaults():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(1.0, 1.0))
        figure.text(0.0, 0.0, "0")
        FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]


@contextmanager
def new_figure(path: FilePath, width: float = 10.0, height: float = 10.0) -> Iterator[Figure]:
    """An empty figure of a size in inches, which may be changed; it becomes the PNG file when the block has ended."""
    with _drawing, matplotlib_defaults():
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), dpi=_DOTS_PER_INCH)
        canvas = FigureCanvasAgg(figure)
        yield figure
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])  # type: ignore[no-untyped-call]
    # Not by Matplotlib, which takes longer, writes names and versions, and would keep others from drawing.
    write_png(path, pixels)


def show(
    axes: Axes, numbers: Array, blocks: Blocks, title: str, cmap: str | Colormap, limits: tuple[float, float]
) -> AxesImage:
    """Numbers of blocks on axes in pixels, with colours between limits, light grey where they are NaN.

    Pixels are square, unless the image is so slender that nothing could be seen of it, nor of its colour bar.
    """
    height, width = blocks.shape
    low, high = limits
    slenderness = width / height
    stretch = slenderness / np.clip(slenderness, 1 / SLENDEREST, SLENDEREST)
    picture = axes.imshow(numbers, cmap=cmap, vmin=low, vmax=high, aspect=float(stretch), extent=blocks.extent)
    # Blocks may end behind the last pixel.
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.set_facecolor(_NO_SURFACE)
    # The numbers at the upper ends of axes are half above them. Where a title stands is said, or else Matplotlib would
    # measure all texts of the axes for it.
    axes.set_title(title, fontsize=11, pad=9, y=1.0)
    axes.set_xlabel("column (px)")
    axes.set_ylabel("row (px)")
    axes.locator_params(integer=True, min_n_ticks=1)
    return picture


def require_finite(name: str, values: Array) -> None:
    """Refuse what holds nothing that could be drawn."""
    # Most have one in their first rows.
    if not any(np.isfinite(rows).any() for rows in np.array_split(values, 16)):
        raise InputError(f"{name} of shape {values.shape} holds no finite value: there is nothing to draw.")
