"""What a person sees of a batch: a bar while it runs, and what failed at the end."""

from __future__ import annotations

import io
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from persfs_cl.cli.spelling import in_a_line
from persfs_cl.pipeline.batch import Batch, BatchResult
from persfs_cl.wording import Spelling

_SHOWN = 100
"""Failures that are listed at the end; the page and the table of the results have all."""
_EVERY = 0.1
"""Seconds between two changes of the bar."""


@dataclass
class Tally:
    """What has come of the photos so far.

    Parameters
    ----------
    spell : callable
        How the command spells keywords.
    """

    spell: Spelling
    done: int = 0
    failed: int = 0
    skipped: int = 0
    warned: int = 0
    unfinished: int = 0
    failures: list[tuple[str, str]] = field(default_factory=list)
    began: float = field(default_factory=time.perf_counter)

    def add(self, result: BatchResult) -> None:
        """Count a result."""
        if result.error is not None:
            self.failed += 1
            if len(self.failures) < _SHOWN:
                self.failures.append((result.name, in_a_line(result.error, self.spell)))
            return
        self.done += 1
        self.warned += bool(result.record.warnings)
        self.unfinished += result.record.converged != "CONVERGED"

    def summary(self) -> str:
        """A sentence or two."""
        seconds = time.perf_counter() - self.began
        rate = f", {self.done / seconds:.3g} a second" if self.done and seconds > 0 else ""
        parts = [f"{self.done} done in {seconds:.1f} s{rate}"]
        parts += [f"{self.skipped} were done before"] * bool(self.skipped)
        parts += [f"{self.failed} failed"] * bool(self.failed)
        parts += [f"{self.unfinished} not converged"] * bool(self.unfinished)
        parts += [f"{self.warned} with warnings"] * bool(self.warned)
        return f"{', '.join(parts)}."

    def table(self) -> str:
        """What failed, and why: a table on a terminal, else lines."""
        if not self.failures:
            return ""
        more = self.failed - len(self.failures)
        rest = f"and {more} more, which summary.csv has.\n" if more else ""
        if not sys.stderr.isatty():
            return "".join(f"persfs-cl: {name}: {why}\n" for name, why in self.failures) + rest
        table = Table("photo", "why it failed", title=f"{self.failed} failed", title_justify="left")
        for name, why in self.failures:
            table.add_row(name, why)
        text = io.StringIO()
        Console(file=text, width=Console(stderr=True).width, markup=False, highlight=False).print(table)
        return text.getvalue() + rest


@contextmanager
def progress_bar(whole: Batch, tally: Tally) -> Iterator[Callable[[str], None]]:
    """A bar on standard error with counts, rate, time left and failures; nothing when that is not a terminal.

    Yields
    ------
    callable
        To be called after each result, with a line for standard output or "".
    """
    if not sys.stderr.isatty():
        yield _print
        return
    # Where both go to one terminal, the bar makes room for lines.
    shared = sys.stdout.isatty()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(compact=True),
        TextColumn("[red]{task.fields[failed]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False) as bar:
        task = bar.add_task("photos", total=whole.total, rate="", failed="")
        shown = began = time.perf_counter()

        def show(line: str) -> None:
            nonlocal shown
            if line and shared:
                bar.console.print(Text(line), soft_wrap=True)
            else:
                _print(line)
            now = time.perf_counter()
            if now - shown < _EVERY:
                return
            shown = now
            bar.update(
                task,
                completed=tally.done + tally.failed + whole.skipped,
                rate=f"{(tally.done + tally.failed) / (now - began):.3g}/s",
                failed=f"{tally.failed} failed" if tally.failed else "",
            )

        yield show


def _print(line: str) -> None:
    if line:
        typer.echo(line)
