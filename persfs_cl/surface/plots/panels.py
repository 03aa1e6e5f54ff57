"""Maps side by side in a figure, placed by the inch.

Places follow from the size of the panels and from that of the few texts that differ from picture to picture, each
measured once. Matplotlib's own layouts measure every text several times, which takes longer than drawing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from persfs_cl.surface.plots.canvas import SLENDEREST

if TYPE_CHECKING:
    from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.legend import Legend
    from matplotlib.text import Text

_LEFT, _BELOW = 0.85, 0.6
"""Inches for the numbers of rows and columns, and what they are called."""
_GAP, _EDGE = 0.3, 0.12
"""Between two panels, and around everything."""
_BAR = 0.2
_WIDE = 2.0
"""Under maps of more times their height the colour bar lies below: beside them it would be too short for its label."""
_LARGE_TITLE = 13
_POINTS = 72.0
_LINES = 1.25
"""Height of a line, in font sizes."""


class Panels:
    """Axes of one size, side by side, each for a map of the same shape and perhaps with a colour bar.

    Parameters
    ----------
    figure : Figure
        Empty. It gets its size by :meth:`arrange`, when everything is drawn.
    shape : tuple of int
        (height, width) of the maps.
    count : int
    """

    def __init__(self, figure: Figure, shape: tuple[int, ...], count: int = 1) -> None:
        self._figure = figure
        # Of slender maps the pixels are stretched.
        aspect = float(np.clip(shape[1] / shape[0], 1 / SLENDEREST, SLENDEREST))
        self._wide = aspect > _WIDE
        side, bent = 4.6 if count == 1 else 3.6, np.sqrt(np.clip(aspect, 1 / 3, 3))
        self._width = float(min(side * bent, side / bent * aspect))
        self._height = self._width / aspect
        first = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        others = [figure.add_axes((0.0, 0.0, 1.0, 1.0), sharey=first) for _ in range(count - 1)]
        for axes in others:
            axes.tick_params(labelleft=False)
            axes.yaxis.label.set_visible(False)
        self.axes = [first, *others]
        self._bars: dict[int, Colorbar] = {}

    def add_bar(self, place: int, picture: AxesImage, label: str, extend: str = "neither") -> Colorbar:
        """A colour bar for the panel of a number."""
        bar = self._figure.colorbar(
            picture,
            cax=self._figure.add_axes((0.0, 0.0, 1.0, 1.0)),
            orientation="horizontal" if self._wide else "vertical",
            extend=extend,
        )
        bar.set_label(label)
        self._bars[place] = bar
        return bar

    def arrange(self, title: str = "", legend: Legend | None = None) -> None:
        """Give the figure its size and everything its place, below a title and above a legend."""
        renderer = _renderer(self._figure)
        titles = [axes.title for axes in self.axes]
        for each in titles:
            _break_lines(each, max(self._width, 2.4), renderer)
        pitch = max(self._width, *(_width(each, renderer) for each in titles)) + _GAP
        lefts, right = [], _LEFT - _GAP
        below = _BELOW
        for place in range(len(self.axes)):
            lefts.append(right + _GAP + (pitch - _GAP - self._width) / 2)
            right += pitch
            if (bar := self._bars.get(place)) is not None:
                taken = self._space_of(bar, renderer)
                if self._wide:
                    below = max(below, _BELOW + taken + _EDGE)
                else:
                    right += taken
        width = right + _GAP
        above = max(map(_height, titles)) + 2 * _EDGE
        if legend is not None:
            box = legend.get_window_extent(renderer)
            width = max(width, box.width / self._figure.dpi + 2 * _EDGE)
            below += box.height / self._figure.dpi
        if title:
            heading = self._figure.text(0.5, 1.0, title, ha="center", va="top", fontsize=_LARGE_TITLE)
            _break_lines(heading, width - 2 * _EDGE, renderer)
            above += _height(heading) + _EDGE
        height = below + self._height + above
        self._figure.set_size_inches(width, height)
        if title:
            heading.set_y(1.0 - _EDGE / height)
        # What is wider than all panels has them in its middle.
        shift = (width - right - _GAP) / 2
        beneath = below - _BELOW - _BAR
        for place, axes in enumerate(self.axes):
            left = lefts[place] + shift
            axes.set_position((left / width, below / height, self._width / width, self._height / height))
            if (bar := self._bars.get(place)) is None:
                continue
            bar.ax.set_position(
                (left / width, beneath / height, self._width / width, _BAR / height)
                if self._wide
                else ((left + self._width + _EDGE) / width, below / height, _BAR / width, self._height / height)
            )

    def _space_of(self, bar: Colorbar, renderer: RendererAgg) -> float:
        """Inches that a colour bar takes across its length, with its numbers and its label."""
        length = self._width if self._wide else self._height
        # How many numbers it has depends on its length.
        inches = self._figure.get_size_inches()
        bar.ax.set_position((0.0, 0.0, *(np.array([length, _BAR] if self._wide else [_BAR, length]) / inches)))
        _break_lines(bar.long_axis.label, length, renderer)
        box = bar.long_axis.get_tightbbox(renderer)
        across = 0.0 if box is None else (box.height if self._wide else box.width) / self._figure.dpi
        return _EDGE + _BAR + float(across)


def fit_title(title: Text, figure: Figure, inches: float) -> float:
    """Break a title where it is longer than so many inches; returns the height that it then has in inches."""
    _break_lines(title, inches, _renderer(figure))
    return _height(title)


def _renderer(figure: Figure) -> RendererAgg:
    canvas: FigureCanvasAgg = figure.canvas  # type: ignore[assignment]
    return canvas.get_renderer()  # type: ignore[no-any-return,no-untyped-call]


def _width(text: Text, renderer: RendererAgg) -> float:
    """Inches that the longest line of a text takes."""
    return max(_length(line, text, renderer) for line in text.get_text().split("\n"))


def _height(text: Text) -> float:
    """Inches that the lines of a text take."""
    return _LINES * float(text.get_fontsize()) / _POINTS * (text.get_text().count("\n") + 1)


def _length(line: str, text: Text, renderer: RendererAgg) -> float:
    width, _, _ = renderer.get_text_width_height_descent(line, text.get_fontproperties(), False)  # type: ignore[no-untyped-call]
    return float(width / renderer.dpi)


def _break_lines(text: Text, inches: float, renderer: RendererAgg) -> None:
    """Break the lines of a text between words where they are longer than so many inches."""
    lines: list[str] = []
    for line in text.get_text().split("\n"):
        if _length(line, text, renderer) <= inches:
            lines.append(line)
            continue
        first, *words = line.split()
        lines.append(first)
        for word in words:
            longer = f"{lines[-1]} {word}"
            if _length(longer, text, renderer) <= inches:
                lines[-1] = longer
            else:
                lines.append(word)
    text.set_text("\n".join(lines))
