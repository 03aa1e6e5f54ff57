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

from persfs_cl.cli.alike import Alike
from persfs_cl.cli.spelling import in_a_line
from persfs_cl.pipeline.run import Batch, BatchResult
from persfs_cl.surface.saving import Saving
from persfs_cl.wording import Spelling

_EVERY = 0.1
"""Seconds between two changes of the bar."""


@dataclass
class Tally:
    """What has come of the photos so far.

    Parameters
    ----------
    spell : callable
        How the command spells keywords.
    saving : Saving
        What was asked for of each photo.
    """

    spell: Spelling
    saving: Saving
    done: int = 0
    failed: int = 0
    skipped: int = 0
    warned: int = 0
    unfinished: int = 0
    lacking: int = 0
    lacking_before: int = 0
    failures: Alike = field(default_factory=lambda: Alike(every_name=True))
    warnings: Alike = field(default_factory=lambda: Alike(every_name=False))
    began: float = field(default_factory=time.perf_counter)

    def add(self, result: BatchResult) -> None:
        """Count a result."""
        if result.error is not None:
            self.failed += 1
            self.failures.add(result.name, result.path, in_a_line(result.error, self.spell))
            return
        self.done += 1
        self.warned += bool(result.warnings)
        for warning in dict.fromkeys(in_a_line(warning, self.spell) for warning in result.warnings):
            self.warnings.add(result.name, result.path, warning)
        self.lacking += bool(self.saving.lacking(result.record.files))
        self.unfinished += result.record.converged != "CONVERGED"

    def summary(self) -> str:
        """A sentence or two."""
        seconds = time.perf_counter() - self.began
        rate = f", {self.done / seconds:.3g} a second" if self.done and seconds > 0 else ""
        parts = [f"{self.done} done in {seconds:.1f} s{rate}"]
        lacking = f", {self.lacking_before} without a file that was asked for" if self.lacking_before else ""
        parts += [f"{self.skipped} were done before{lacking}"] * bool(self.skipped)
        parts += [f"{self.failed} failed"] * bool(self.failed)
        parts += [f"{self.unfinished} not converged"] * bool(self.unfinished)
        parts += [f"{self.lacking} without a file that was asked for"] * bool(self.lacking)
        parts += [f"{self.warned} with warnings"] * bool(self.warned)
        return f"{', '.join(parts)}."

    def left(self, total: int) -> str:
        """A sentence about a run that was interrupted."""
        return f"Interrupted: {self.done + self.skipped} of {total} are done. The same command goes on from there."

    def told(self) -> str:
        """What was warned of, and what failed, and why: that as a table on a terminal, else as lines."""
        warnings = "".join(f"{line}\n" for line in self.warnings.lines("warning: "))
        if self.warnings.more:
            warnings += f"and {self.warnings.more} more warnings, which summary.csv has.\n"
        return warnings + self._failures()

    def _failures(self) -> str:
        if not self.failed:
            return ""
        rest = f"and {self.failures.more} more, which summary.csv has.\n" if self.failures.more else ""
        if not sys.stderr.isatty():
            return "".join(f"{line}\n" for line in self.failures.lines()) + rest
        table = Table("photo", "why it failed", title=f"{self.failed} failed", title_justify="left", show_lines=True)
        for count, names, why in self.failures.groups():
            table.add_row("\n".join(names), why if count == 1 else f"{count} photos: {why}")
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
