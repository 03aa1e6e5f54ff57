"""``persfs-cl bench``: experiments on speed and on accuracy."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console

from persfs_cl._cl.device import select_device
from persfs_cl.bench.experiments import EXPERIMENTS
from persfs_cl.bench.plan import STANDARD_SIZES, Plan
from persfs_cl.bench.plots import draw
from persfs_cl.bench.report import table
from persfs_cl.bench.results import Record, write_csv, write_json
from persfs_cl.bench.tables import contents, markers
from persfs_cl.circumstances import circumstances, summary
from persfs_cl.cli.options import DeviceOption, PrecisionOption
from persfs_cl.cli.output import check_folder
from persfs_cl.cli.pages import check_page
from persfs_cl.cli.progress import INTERRUPTED, writing
from persfs_cl.page import CIRCUMSTANCES, fill_page, marked, read_page

_Choice = TypeVar("_Choice", bound=str)

_ORDERINGS = Plan.orderings
_QUICK_SIZES, _QUICK_BATCH = (128, 256), (1, 4)
_QUICK_REPEATS, _QUICK_SECONDS = 3, 0.01


def bench(
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
            help=f"Edges of square images; times unless given at {','.join(map(str, STANDARD_SIZES))}, errors at sizes"
            " of their own.",
        ),
    ] = None,
    batch: Annotated[
        str | None,
        typer.Option(
            metavar="N,...",
            help=f"Numbers of images that share launches; {','.join(map(str, Plan.batch))} unless given.",
        ),
    ] = None,
    orderings: Annotated[
        str | None, typer.Option(metavar="NAME,...", help=f"Of {', '.join(_ORDERINGS)}; all unless given.")
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
            help="Put the tables of these experiments between the markers of this page too, and the circumstances if"
            " these are all its tables; may be given several times.",
        ),
    ] = None,
    device: DeviceOption = None,
    precision: PrecisionOption = "float32",
) -> None:
    """Measure how fast the sweeps are, beside other ways to do the same in the same run, and how exact the depth is.

    Prints tables, and writes bench.json, bench.csv and the plots scaling.png, yardsticks.png, convergence.png and
    accuracy.png.
    """
    experiments = _known("--experiment", experiment or list(EXPERIMENTS), tuple(EXPERIMENTS))
    pages = page or []
    for each in pages:
        check_page(each, quick=quick, wanted=markers(experiments), known=markers(EXPERIMENTS))
    plan = Plan(
        device=select_device(device),
        sizes=_numbers("--sizes", sizes, least=8) or (_QUICK_SIZES if quick else None),
        batch=_numbers("--batch", batch, least=1) or (_QUICK_BATCH if quick else Plan.batch),
        orderings=_ORDERINGS if orderings is None else _known("--orderings", orderings.split(","), _ORDERINGS),
        precision=precision,
        repeats=repeats or (_QUICK_REPEATS if quick else Plan.repeats),
        least_seconds=_QUICK_SECONDS if quick else Plan.least_seconds,
    )
    plan.device.real(precision)
    check_folder(output, overwrite=True)
    header = circumstances(plan.device, shlex.join(["persfs-cl", *sys.argv[1:]]))
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
            filled.pop(CIRCUMSTANCES, None)
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


def _numbers(option: str, text: str | None, *, least: int) -> tuple[int, ...] | None:
    if text is None:
        return None
    try:
        numbers = sorted({int(part) for part in text.split(",")})
    except ValueError:
        numbers = []
    if not numbers or numbers[0] < least:
        raise typer.BadParameter(
            f"{text!r} is not a list of whole numbers, {least} or more, as in 128,512.", param_hint=f"'{option}'"
        )
    return tuple(numbers)


def _known(option: str, names: list[str], choices: tuple[_Choice, ...]) -> tuple[_Choice, ...]:
    """The names in the order of the choices, each once."""
    if unknown := [name for name in names if name not in choices]:
        raise typer.BadParameter(f"{unknown[0]!r} is not a choice: use {', '.join(choices)}.", param_hint=f"'{option}'")
    return tuple(choice for choice in choices if choice in names)
