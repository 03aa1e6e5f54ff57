"""Records as plots, each one PNG file with the environment on its foot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from persfs_cl.bench import accuracy
from persfs_cl.bench.convergence import ELAPSED, ERROR
from persfs_cl.bench.rates import PLAIN_C, RATE, RATE_UNIT, YARDSTICKS
from persfs_cl.bench.results import Record
from persfs_cl.io.files import atomic_path
from persfs_cl.surface.plots import matplotlib_defaults

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 140
_RATE_LABEL = "million cell updates a second"
_MARKERS = "osD^v<>"
_LINES = ("-", "-", "--")
_LARGEST_SHOWN = 10.0
"""Above it lie the start values, which are arbitrary."""


def draw(folder: Path, records: Sequence[Record], foot: str) -> list[Path]:
    """Draw what the records allow: scaling, yardsticks, convergence and accuracy.

    Parameters
    ----------
    folder : Path
    records : sequence of Record
    foot : str
        The environment.

    Returns
    -------
    list of Path
        The files written. A plot of an earlier run that these records do not allow is deleted.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    written = []
    makers = {"scaling": _scaling, "yardsticks": _yardsticks, "convergence": _convergence, "accuracy": _accuracy}
    for name, make in makers.items():
        path = folder / f"{name}.png"
        with matplotlib_defaults():
            figure = make([record for record in records if record.median is not None])
            if figure is None:
                path.unlink(missing_ok=True)
                continue
            figure.supxlabel(foot, fontsize=5.5, color="0.35", wrap=True)
            with atomic_path(path) as temporary:
                # Not by savefig(), which would arrange everything twice.
                FigureCanvasAgg(figure).print_png(temporary)  # type: ignore[no-untyped-call]
        written.append(path)
    return written


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=_DOTS_PER_INCH, layout="constrained")


def _scaling(records: Sequence[Record]) -> Figure | None:
    """Rates over the size of the image and over the number of images, both axes logarithmic."""
    from matplotlib.ticker import LogLocator

    panels = [
        (title, attribute, chosen)
        for title, experiment, attribute in (
            ("One image", "sizes", "size"),
            ("Images that share launches", "batch", "images"),
        )
        if (chosen := [record for record in records if record.experiment == experiment])
    ]
    if not panels:
        return None
    figure = _figure(5.2 * len(panels), 4.2)
    places = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (title, attribute, chosen) in zip(places, panels, strict=True):
        for marker, workload in zip(_MARKERS, dict.fromkeys(record.workload for record in chosen), strict=False):
            if attribute == "images" and workload == PLAIN_C:
                continue
            points = sorted(
                (getattr(record, attribute), record.median, record.lowest, record.highest)
                for record in chosen
                if record.workload == workload
            )
            along, medians, lowest, highest = zip(*points, strict=True)
            (line,) = axes.loglog(along, medians, marker=marker, label=workload)
            axes.fill_between(along, lowest, highest, alpha=0.2, color=line.get_color(), linewidth=0)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("pixels along an edge" if attribute == "size" else f"images of {chosen[0].size}²")
        ticks = sorted({getattr(record, attribute) for record in chosen})
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        # Less than a decade may hold all rates: plain numbers at 1, 2 and 5 of each.
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    places[0].set_ylabel(_RATE_LABEL)
    return figure


def _yardsticks(records: Sequence[Record]) -> Figure | None:
    """Bars of the orderings and the yardsticks at one size, with how many times the plain C sweep they are."""
    bars = [record for record in records if record.experiment == "orderings" and record.quantity == RATE]
    if not bars:
        return None
    bars.sort(key=lambda record: record.median or 0.0)
    figure = _figure(7.5, 1.4 + 0.38 * len(bars))
    axes = figure.add_subplot()
    medians = [record.median or 0.0 for record in bars]
    errors = [
        [(record.median or 0.0) - (record.lowest or 0.0) for record in bars],
        [(record.highest or 0.0) - (record.median or 0.0) for record in bars],
    ]
    names = [f"{record.workload}, {record.size}²" for record in bars]
    colours = ["C1" if record.workload in YARDSTICKS else "C0" for record in bars]
    axes.barh(names, medians, xerr=errors, color=colours, error_kw={"elinewidth": 0.8, "capsize": 2})
    for place, record in enumerate(bars):
        factor = "" if record.factor is None else f", {record.factor:.1f} × {PLAIN_C}"
        rounded = float(f"{record.median or 0.0:.3g}")
        text = f"  {rounded:,g} {RATE_UNIT}{factor}"
        axes.annotate(text, (record.highest or 0.0, place), va="center", fontsize=7)
    axes.set_xlabel(_RATE_LABEL)
    axes.set_xlim(0, 1.45 * max(record.highest or 0.0 for record in bars))
    axes.tick_params(labelsize=8)
    return figure


def _convergence(records: Sequence[Record]) -> Figure | None:
    """The largest error over the sweeps, and over the seconds."""
    chosen = [record for record in records if record.experiment == "convergence"]
    if not chosen:
        return None
    figure = _figure(10.4, 4.2)
    by_sweep, by_second = figure.subplots(1, 2, sharey=True)
    workloads = dict.fromkeys(record.workload for record in chosen)
    for number, (marker, line, workload) in enumerate(zip(_MARKERS, _LINES, workloads, strict=False)):
        errors, elapsed = (
            [record.median for record in chosen if record.workload == workload and record.quantity == quantity]
            for quantity in (ERROR, ELAPSED)
        )
        sweeps = [4 * (k + 1) for k in range(len(errors))]
        # Two orderings may have the same errors: the first then shows between dashes and markers of the second.
        apart = max(1, len(errors) // 8)
        style = {
            "marker": marker,
            "markevery": (number * apart // len(_LINES), apart),
            "linestyle": line,
            "label": workload,
        }
        by_sweep.semilogy(sweeps, errors, **style)
        by_second.loglog(elapsed, errors, **style)
    by_sweep.set_ylim(top=_LARGEST_SHOWN)
    _label(by_sweep, f"sweeps, {chosen[0].size}² pixels", "largest error of ln z")
    _label(by_second, "milliseconds", "")
    return figure


def _accuracy(records: Sequence[Record]) -> Figure | None:
    """Mean error over the size of the image, with lines of slope 1 and 2: a colour a scheme, a marker a scene."""
    chosen = [record for record in records if record.experiment == "accuracy" and record.quantity == accuracy.ERROR]
    if not chosen:
        return None
    figure = _figure(7.2, 5.0)
    axes = figure.add_subplot()
    sizes = sorted({record.size for record in chosen})
    for number, scheme in enumerate(accuracy.SCHEMES):
        for marker, scene in zip(_MARKERS, accuracy.SCENES, strict=False):
            points = [record for record in chosen if record.workload == accuracy.workload(scene, scheme)]
            if not points:
                continue
            errors = [record.median for record in points]
            style = {
                "marker": marker,
                "markersize": 5,
                "linewidth": 1,
                "color": f"C{number}",
                "markerfacecolor": "none",
            }
            axes.loglog([record.size for record in points], errors, label=f"{scheme}; {scene}", **style)
    for order, scheme in enumerate(("upwind", "second order"), start=1):
        largest = max((record.median or 0.0 for record in chosen if record.workload.endswith(scheme)), default=0.0)
        if largest:
            # Next to the measured lines, and through no point of theirs.
            slope = [0.4 * largest * (sizes[0] / size) ** order for size in sizes]
            axes.loglog(sizes, slope, "--", color="0.6", linewidth=1)
            axes.annotate(f"slope {order}", (sizes[-1], 0.9 * slope[-1]), fontsize=8, color="0.4", va="top", ha="right")
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    _label(axes, "pixels along an edge", "mean error of the depth")
    axes.legend(fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _label(axes: Axes, along: str, up: str) -> None:
    axes.set_xlabel(along)
    axes.set_ylabel(up)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
