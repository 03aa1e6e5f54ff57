"""``persfs-cl paper``: the paper's experiments, done again."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from persfs_cl._cl.selection import select_device
from persfs_cl.cli.choosers import takes
from persfs_cl.cli.options import chosen_device
from persfs_cl.cli.output import check_folder
from persfs_cl.cli.pages import check_page
from persfs_cl.cli.progress import writing
from persfs_cl.cli.status import INTERRUPTED
from persfs_cl.environment import environment, summary
from persfs_cl.page import fill_page
from persfs_cl.paper import fast_marching
from persfs_cl.paper.experiments import EXPERIMENTS
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings, Table, fragments, write_fragments
from persfs_cl.solver.options import Options

_TABLES = "tables.md"


@takes(keywords=chosen_device)
def paper(
    *,
    quick: Annotated[
        bool, typer.Option("--quick", help="Leave out what takes long, to see that everything works.")
    ] = False,
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; replaces files of their names."),
    ] = Path("paper-output"),
    page: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Put the tables between the markers of this page, not into tables.md."),
    ] = None,
    keywords: Options,
) -> None:
    """Do the paper's experiments again: Tables 1 and 2, Figures 2 and 3, by its method and by Tankus'.

    Prints the tables, and writes them as tables.md and one CSV file each, with the figures as PNG files. Takes a minute
    or two.
    """
    # Before any work: this command alone needs the extra.
    fast_marching.compiled()
    if page is not None:
        check_page(page, quick=quick)
    plan = (
        Plan(select_device(keywords["device"]), repeats=1, quick=True)
        if quick
        else Plan(select_device(keywords["device"]))
    )
    check_folder(output, overwrite=True)
    foot = summary(environment(plan.device, shlex.join(["persfs-cl", *sys.argv[1:]])))
    typer.echo(f"{foot}\n")
    tables: list[Table] = []
    files: list[Path] = []
    try:
        for name, experiment in EXPERIMENTS.items():
            findings = _done(name, experiment, plan)
            for table in findings.tables:
                typer.echo(f"{table.title}\n\n{table.markdown}\n")
            tables += findings.tables
            files += _write(output, findings)
            if page is None:
                write_fragments(output / _TABLES, tables, foot)
    except KeyboardInterrupt:
        for file in files:
            typer.echo(file)
        typer.echo(f"persfs-cl: interrupted; {len(tables)} tables were kept.", err=True)
        raise typer.Exit(INTERRUPTED) from None
    if page is not None:
        fill_page(page, fragments(tables, foot))
    for file in [page or output / _TABLES, *files]:
        typer.echo(file)


def _done(name: str, experiment: Callable[[Plan], Findings], plan: Plan) -> Findings:
    """The experiment, with a line on standard error if that is a terminal."""
    if not sys.stderr.isatty():
        return experiment(plan)
    with Console(stderr=True).status(name):
        return experiment(plan)


def _write(folder: Path, findings: Findings) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    with writing():
        for table in findings.tables:
            files.append(folder / f"{table.name}.csv")
            table.write_csv(files[-1])
        for name, draw in findings.pictures.items():
            files.append(folder / name)
            draw(files[-1])
    return files
