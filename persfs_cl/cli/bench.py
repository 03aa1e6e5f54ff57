"""``persfs-cl bench``: experiments on speed and on accuracy."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console

from persfs_cl._cl.registers import LANES, SUFFICIENT
from persfs_cl._cl.registers import lanes as lanes_of
from persfs_cl._cl.selection import select_device
from persfs_cl.bench.endoscopy import EXPERIMENT, FRAME, MASK, POINTS
from persfs_cl.bench.experiments import EXPERIMENTS
from persfs_cl.bench.plan import SCHEMES, STANDARD_SIZES, Plan
from persfs_cl.bench.plots import draw
from persfs_cl.bench.report import table
from persfs_cl.bench.results import Record, write_csv, write_json
from persfs_cl.bench.tables import contents, markers
from persfs_cl.cli.choosers import takes
from persfs_cl.cli.options import chosen_device_and_precision
from persfs_cl.cli.output import check_folder
from persfs_cl.cli.pages import check_page
from persfs_cl.cli.progress import writing
from persfs_cl.cli.status import INTERRUPTED
from persfs_cl.environment import environment, summary
from persfs_cl.page import ENVIRONMENT, fill_page, marked, read_page
from persfs_cl.solver.options import Options

_Choice = TypeVar("_Choice", bound=str)

_ORDERINGS = Plan.orderings
_TUNINGS = "Of the experiment tunings"
_QUICK_SIZES, _QUICK_BATCH = (128, 256), (1, 4)
_QUICK_REPEATS, _QUICK_SECONDS, _QUICK_TASKS = 3, 0.01, 1000


def _listed(values: Iterable[object]) -> str:
    """As an option's value."""
    return ",".join(map(str, values))


@takes(keywords=chosen_device_and_precision)
def bench(
    *,
    experiment: Annotated[
        list[str] | None,
        typer.Option(
            "--experiment", metavar="NAME", help=f"Only this of {', '.join(EXPERIMENTS)}; may be given several times."
        ),
    ] = None,
    sizes: Annotated[
        str | None,
        typer.Option(
            metavar="PX,...",
            help=f"Edges of square images; times unless given at {_listed(STANDARD_SIZES)}, errors at sizes"
            " of their own.",
        ),
    ] = None,
    batch: Annotated[
        str | None,
        typer.Option(
            metavar="N,...",
            help=f"Numbers of images that share launches; {_listed(Plan.batch)} unless given.",
        ),
    ] = None,
    orderings: Annotated[
        str | None, typer.Option(metavar="NAME,...", help=f"Of {', '.join(_ORDERINGS)}; all unless given.")
    ] = None,
    schemes: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help=f"Of {', '.join(SCHEMES)}; unless given both where orderings, calls and distances are compared,"
            f" elsewhere {SCHEMES[0]}.",
        ),
    ] = None,
    repeats: Annotated[
        int | None, typer.Option(min=1, help=f"Measurements of each thing; {Plan.repeats} unless given.")
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Small images and few repeats, to see that everything works.")
    ] = False,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; those of an earlier run go."),
    ] = Path("bench-output"),
    page: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Put the tables of these experiments between the markers of this page too, and the environment if"
            " these are all its tables; may be given several times.",
        ),
    ] = None,
    endoscopy: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help=f"Folder of the experiment endoscopy: {FRAME}, {MASK} and {POINTS}, with the camera and points of "
            "known depth. Without it this experiment is left out.",
        ),
    ] = None,
    strip_rows: Annotated[
        str | None,
        typer.Option(
            metavar="N,...",
            help=f"Heights of a strip of the wavefront, multiples of {SUFFICIENT}; {_listed(Plan.strip_rows)} unless"
            " given. Of those that are no multiples of the vectors none is measured.",
            rich_help_panel=_TUNINGS,
        ),
    ] = None,
    tiles: Annotated[
        str | None,
        typer.Option(
            metavar="NxN,...",
            help=f"Rows and columns of a tile of the wavefront; {_listed('x'.join(map(str, t)) for t in Plan.tiles)}"
            " unless given.",
            rich_help_panel=_TUNINGS,
        ),
    ] = None,
    band_rows: Annotated[
        str | None,
        typer.Option(
            metavar="N,...",
            help="Heights of a band of the checkerboard; of some thousand pixels unless given.",
            rich_help_panel=_TUNINGS,
        ),
    ] = None,
    lanes: Annotated[
        str | None,
        typer.Option(
            metavar="N,...",
            help=f"Widths of the vectors of the checkerboard, of {_listed(LANES)}; all that the device's"
            " compiler has registers for unless given.",
            rich_help_panel=_TUNINGS,
        ),
    ] = None,
    work_groups: Annotated[
        str | None,
        typer.Option(
            metavar="N,...",
            help="How many work-groups run along strips or over bands; one, and as many as the device has units, unless"
            " given.",
            rich_help_panel=_TUNINGS,
        ),
    ] = None,
    keywords: Options,
) -> None:
    """Measure how fast sweeps and whole calls are, against other ways to do the same, and how exact the depth is.

    Prints tables, and writes bench.json, bench.csv and the plots scaling.png, yardsticks.png, convergence.png and
    accuracy.png.
    """
    precision = keywords["precision"]
    experiments = _known("--experiment", experiment or list(EXPERIMENTS), tuple(EXPERIMENTS))
    if endoscopy is None and EXPERIMENT in (experiment or ()):
        raise typer.BadParameter(
            f"give the folder of {FRAME}, {MASK} and {POINTS} that the experiment {EXPERIMENT} reads.",
            param_hint="'--endoscopy'",
        )
    pages = page or []
    for each in pages:
        check_page(each, quick=quick, wanted=markers(experiments), known=markers(EXPERIMENTS))
    chosen = select_device(keywords["device"])
    plan = Plan(
        device=chosen,
        sizes=_numbers("--sizes", sizes, least=8) or (_QUICK_SIZES if quick else None),
        batch=_numbers("--batch", batch, least=1) or (_QUICK_BATCH if quick else Plan.batch),
        orderings=_ORDERINGS if orderings is None else _known("--orderings", orderings.split(","), _ORDERINGS),
        schemes=None if schemes is None else _known("--schemes", schemes.split(","), SCHEMES),
        precision=precision,
        repeats=repeats or (_QUICK_REPEATS if quick else Plan.repeats),
        least_seconds=_QUICK_SECONDS if quick else Plan.least_seconds,
        strip_rows=_numbers("--strip-rows", strip_rows, least=SUFFICIENT, multiple=SUFFICIENT) or Plan.strip_rows,
        tiles=_tiles("--tiles", tiles, most_rows=chosen.largest_group) or Plan.tiles,
        band_rows=_numbers("--band-rows", band_rows, least=1),
        lanes=_numbers("--lanes", lanes, choices=[width for width in LANES if width <= lanes_of(chosen, precision)]),
        work_groups=_numbers("--work-groups", work_groups, least=1),
        tasks=_QUICK_TASKS if quick else Plan.tasks,
        endoscopy=endoscopy,
    )
    plan.device.real(precision)
    check_folder(output, overwrite=True)
    header = environment(plan.device, shlex.join(["persfs-cl", *sys.argv[1:]]))
    # A file or pipe has no width to fit: one line a record.
    console = Console(width=None if sys.stdout.isatty() else 250, markup=False, highlight=False)
    console.print(summary(header))
    records: list[Record] = []
    interrupted = False
    try:
        for name in experiments:
            _measure(name, plan, records, console)
    except KeyboardInterrupt:
        interrupted = True
    finally:
        files = _write(output, header, records) if records else []
    for file in files:
        typer.echo(file)
    if interrupted:
        typer.echo(f"persfs-cl: interrupted; {len(records)} records were kept.", err=True)
        raise typer.Exit(INTERRUPTED)
    found = contents(header, records)
    for each in pages:
        filled = {name: content for name, content in found.items() if name in (places := marked(read_page(each)))}
        if len(filled) < len(places):
            # Other tables of the page were found elsewhere, or at another time.
            filled.pop(ENVIRONMENT, None)
        fill_page(each, filled)
        typer.echo(each)


def _measure(name: str, plan: Plan, records: list[Record], console: Console) -> None:
    """Run one experiment and print its table, also when it is interrupted."""
    own: list[Record] = []
    try:
        with _measuring(name):
            for group in EXPERIMENTS[name](plan):
                own += group
                records += group
    finally:
        if own:
            console.print(table(name, own))


def _write(folder: Path, header: dict[str, Any], records: list[Record]) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    with writing():
        write_json(folder / "bench.json", header, records)
        write_csv(folder / "bench.csv", records)
        return [folder / "bench.json", folder / "bench.csv", *draw(folder, records, summary(header))]


@contextmanager
def _measuring(name: str) -> Iterator[None]:
    """A line on standard error, if that is a terminal."""
    if sys.stderr.isatty():
        with Console(stderr=True).status(f"measuring: {name}"):
            yield
    else:
        yield


def _numbers(
    option: str, text: str | None, *, least: int = 1, multiple: int = 1, choices: Sequence[int] = ()
) -> tuple[int, ...] | None:
    """Whole numbers, ascending, each once."""
    if text is None:
        return None
    try:
        numbers = sorted({int(part) for part in text.split(",")})
    except ValueError:
        numbers = []
    allowed = f"of {_listed(choices)}" if choices else f"{least} or more"
    if multiple > 1:
        allowed += f", each a multiple of {multiple}"
    if not numbers or any(
        number < least or number % multiple or (choices and number not in choices) for number in numbers
    ):
        raise typer.BadParameter(f"{text!r} is not a list of whole numbers, {allowed}.", param_hint=f"'{option}'")
    return tuple(numbers)


def _tiles(option: str, text: str | None, *, most_rows: int) -> tuple[tuple[int, int], ...] | None:
    """Pairs of rows and columns."""
    if text is None:
        return None
    matches = [re.fullmatch(r"([1-9]\d*)x([1-9]\d*)", part.strip()) for part in text.split(",")]
    tiles = tuple((int(match[1]), int(match[2])) for match in matches if match)
    if not all(matches) or max(rows for rows, _ in tiles) > most_rows:
        message = f"{text!r} is not a list of rows and columns, up to {most_rows} rows, as in 32x64,64x64."
        raise typer.BadParameter(message, param_hint=f"'{option}'")
    return tiles


def _known(option: str, names: list[str], choices: tuple[_Choice, ...]) -> tuple[_Choice, ...]:
    """The names in the order of the choices, each once."""
    if unknown := [name for name in names if name not in choices]:
        raise typer.BadParameter(f"{unknown[0]!r} is not a choice: use {', '.join(choices)}.", param_hint=f"'{option}'")
    return tuple(choice for choice in choices if choice in names)
