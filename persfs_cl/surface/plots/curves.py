"""How the iteration converged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath
from persfs_cl.surface.plots.canvas import load_matplotlib, new_figure
from persfs_cl.surface.plots.panels import fit_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STEEPEST_CHANGE = 10.0
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_DECADES = 100.0
"""From the foot of an axis to its top; where it spans less, numbers are wanted in between."""
_WIDTH, _HEIGHT = 5.3, 3.1
_LEFT, _BELOW, _EDGE = 0.9, 0.55, 0.2
"""Inches of the axes, and around them, with room for numbers and names."""


def convergence_picture(
    path: FilePath, changes: ArrayLike, tolerance: float, title: str = "Convergence", *, distance: float = math.nan
) -> None:
    """Draw the change of every iteration on a logarithmic axis, with the tolerance.

    Parameters
    ----------
    path : path
        The PNG file to write.
    changes : array_like, shape (iterations,)
        max |ΔZ| of each iteration, finite and >= 0. A change of exactly 0 is drawn as a triangle at the foot,
        and one above 10, which only the start value explains, at the top when others are below.
    tolerance : float
        What the iteration stops at, >= 0; drawn as a line unless it is 0.
    title : str
    distance : float
        Estimated distance from the limit after the last iteration, drawn as a diamond unless it is 0 or NaN.

    Raises
    ------
    InputError
        When there is no change, one is negative or not finite, or the tolerance is negative or not finite.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from persfs_cl.surface.plots import convergence_picture
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "picture.png"
    ...     convergence_picture(path, [0.3, 0.02, 0.0], tolerance=1e-5)
    ...     path.read_bytes()[1:4]
    b'PNG'
    """
    values = np.asarray(changes, dtype=np.float64)
    if values.ndim != 1 or values.size == 0 or not (np.isfinite(values) & (values >= 0)).all():
        raise InputError.about("changes", changes, ": give one finite number >= 0 for each iteration.")
    if not 0 <= tolerance < np.inf:
        raise InputError.about("tolerance", tolerance, "is not a change: give a finite number >= 0.")

    load_matplotlib()
    from matplotlib.ticker import NullLocator

    iterations = np.arange(1, values.size + 1)
    moved = values > 0
    with new_figure(path) as figure:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        above = fit_title(axes.set_title(title, y=1.0), figure, _WIDTH) + 1.5 * _EDGE
        width, height = _LEFT + _WIDTH + _EDGE, _BELOW + _HEIGHT + above
        figure.set_size_inches(width, height)
        axes.set_position((_LEFT / width, _BELOW / height, _WIDTH / width, _HEIGHT / height))
        # Matplotlib complains of limits of its own that come from one value alone.
        axes.set_autoscaley_on(False)
        axes.semilogy(iterations[moved], values[moved], color="#31688e", marker="o", markersize=3.5, label="change")
        if tolerance > 0:
            axes.axhline(tolerance, color="#c44e52", linestyle="--", label=f"tolerance {tolerance:g}")
        if distance > 0:
            axes.plot(values.size, distance, color="#c44e52", marker="D", linestyle="none", label="distance from limit")
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
        axes.set(xlabel="iteration (four sweeps)", ylabel="change of ln depth, max |ΔZ|")
        axes.locator_params(axis="x", integer=True, min_n_ticks=1)
        _limit_changes(axes, values, [mark for mark in (tolerance, distance) if mark > 0])
        low, high = axes.get_ylim()
        if high >= _DECADES * low:
            # The formulas that Matplotlib writes exponents with take longer than all else that is drawn.
            axes.yaxis.set_major_formatter(_power_of_ten)
            axes.yaxis.set_minor_locator(NullLocator())
        axes.grid(which="major", color="0.9")
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend()


def _power_of_ten(value: float, _position: float = 0.0) -> str:
    """A whole power of 10 as a text."""
    return "10" + str(round(math.log10(value))).translate(_RAISED)


def _limit_changes(axes: Axes, changes: Array, marks: Sequence[float]) -> None:
    """Fit the axis to the iterations proper; the first ones come down from a start value as high as you like."""
    positive = changes[changes > 0]
    bottom = min((*positive, *marks), default=1.0)
    # No surface is a factor e^10 deeper than its known values, but each pixel adds a step to the start value.
    proper = positive[positive <= _STEEPEST_CHANGE]
    high = np.flatnonzero(changes > _STEEPEST_CHANGE)
    top = max(*proper, *marks, 0.0) if proper.size else positive.max(initial=1.0)
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
