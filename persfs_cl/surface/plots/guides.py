"""The picture of a guide: how far it was believed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath
from persfs_cl.quantiles import quantile
from persfs_cl.surface.plots.blocks import Blocks
from persfs_cl.surface.plots.canvas import load_matplotlib, new_figure, require_finite, show
from persfs_cl.surface.plots.panels import Panels

_PHOTOGRAPH, _GUIDE = "#56B4E9", "#D55E00"
_LEAST = 0.01
"""Per cent: the scale is no finer."""


def guide_picture(
    path: FilePath, departure: ArrayLike, at_bound: NDArray[np.bool_], title: str = "How far the guide was believed"
) -> None:
    """Draw how much farther the guide has the surface than it is, and where a bound holds it.

    Parameters
    ----------
    path : path
        The PNG file to write.
    departure : array_like, shape (height, width)
        ln of the guide's depth over that of the surface, see :class:`persfs_cl.GuideFit`; NaN where there is none.
    at_bound : ndarray of bool, shape (height, width)
        Pixels whose depth is a bound, and not what the photograph says.
    title : str

    Raises
    ------
    InputError
        When ``departure`` is no image or NaN everywhere, or ``at_bound`` has another shape.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from persfs_cl.surface.plots import guide_picture
    >>> departure = np.linspace(-0.02, 0.02, 400).reshape(20, 20)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     guide_picture(path, departure, departure > 0.015)
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    load_matplotlib()
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    given = np.asarray(departure, dtype=np.float64)
    if given.ndim != 2 or at_bound.shape != given.shape:
        raise InputError(
            f"departure has shape {given.shape} and at_bound {at_bound.shape}: give one number a pixel for both, "
            "(height, width)."
        )
    require_finite("departure", given)
    blocks = Blocks((given.shape[0], given.shape[1]))
    known = ~np.isnan(given)

    def numbers(rows: slice) -> Array:
        held = blocks.combined(np.maximum, (at_bound[rows] & known[rows]).astype(np.uint8)).astype(np.float64)
        farther = blocks.means(100.0 * np.expm1(given[rows]))
        held[np.isnan(farther)] = np.nan
        return np.stack([farther, held], axis=1)

    maps = blocks.collected(numbers)
    widest = max(_LEAST, 100.0 * float(np.expm1(quantile(np.abs(given[known]), 0.99))))
    count = int(np.count_nonzero(at_bound & known))
    patches = [
        Patch(color=_PHOTOGRAPH, label=f"the photograph: {int(np.count_nonzero(known)) - count:,} px"),
        Patch(color=_GUIDE, label=f"a bound: {count:,} px"),
    ]
    with new_figure(path) as figure:
        panels = Panels(figure, given.shape, 2)
        left, right = panels.axes
        heading = "The guide, smoothed along edges,\nis farther (red) or nearer (blue)"
        picture = show(left, maps[:, 0], blocks, heading, "RdBu_r", (-widest, widest))
        panels.add_bar(0, picture, "% of the depth", extend="both")
        show(right, maps[:, 1], blocks, "What tells the depth", ListedColormap((_PHOTOGRAPH, _GUIDE)), (-0.5, 1.5))
        legend = figure.legend(handles=patches, loc="lower center", ncols=2, frameon=False, fontsize=9)
        panels.arrange(title, legend)
