"""Run cases in a process of their own for some time, and tell what became of them: see ``--help``."""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

import typer

from fuzz.cases import KINDS
from fuzz.worker import Worker

_SHARES = {
    "image": 120,
    "exif": 60,
    "array": 40,
    "points": 60,
    "compare": 10,
    "invalid": 20,
    "reconstruct": 6,
    "render": 3,
    "batch": 2,
}
"""Cases of a kind in a round, 1 of the others: files and calls, which compile kernels, take about the same time."""
_SEEDS_APART = 1_000_000


@dataclass
class _Tally:
    """What became of the cases."""

    cases: Counter[str] = field(default_factory=Counter)
    verdicts: Counter[str] = field(default_factory=Counter)
    failures: dict[str, list[str]] = field(default_factory=dict)
    """Cases by the group of their failure."""


def _schedule(kinds: list[str], seed: int) -> Iterator[tuple[str, int]]:
    """Kinds in turn, each as often as its share, with seeds of its own."""
    numbers = {kind: itertools.count(seed * _SEEDS_APART) for kind in kinds}
    turns = [kind for turn in range(max(_SHARES.values())) for kind in kinds if turn < _SHARES.get(kind, 1)]
    for kind in itertools.cycle(turns):
        yield kind, next(numbers[kind])


def main(
    seconds: Annotated[float, typer.Option(help="How long to go on.")] = 600.0,
    seed: Annotated[int, typer.Option(help="Of the whole run: each is another.", min=0)] = 0,
    kind: Annotated[list[str] | None, typer.Option(help=f"Only cases of this kind: {', '.join(KINDS)}.")] = None,
    case: Annotated[list[str] | None, typer.Option(help="Run this case alone, as KIND:SEED, as reported.")] = None,
) -> None:
    """Random files and calls: none may crash, hang, print, or raise what is not an error of the package."""
    chosen = [_parsed(text) for text in case or ()]
    unknown = {*(kind or ()), *(name for name, _ in chosen)} - set(KINDS)
    if unknown:
        raise typer.BadParameter(f"{', '.join(sorted(unknown))}: the kinds are {', '.join(KINDS)}.")
    tally = _Tally()
    worker = Worker()
    end = time.monotonic() + seconds
    try:
        for name, number in chosen or _schedule(kind or list(KINDS), seed):
            if not chosen and time.monotonic() > end:
                break
            verdicts, violation = worker.run(name, number)
            tally.cases[name] += 1
            tally.verdicts.update(verdicts)
            if violation is not None:
                cases = tally.failures.setdefault(violation.group, [])
                if not cases or chosen:
                    typer.echo(f"{name}:{number} FAILED {violation}\n")
                cases.append(f"{name}:{number}")
    except KeyboardInterrupt:
        typer.echo("interrupted")
    finally:
        worker.close()
    _report(tally)
    if tally.failures:
        raise typer.Exit(1)


def _parsed(text: str) -> tuple[str, int]:
    kind, _, seed = text.partition(":")
    if not seed.isdigit():
        raise typer.BadParameter(f"{text!r} is no case: give KIND:SEED, as image:7.")
    return kind, int(seed)


def _report(tally: _Tally) -> None:
    typer.echo(f"{tally.cases.total()} cases: " + ", ".join(f"{count} {kind}" for kind, count in tally.cases.items()))
    by_call: dict[str, Counter[str]] = {}
    for verdict, count in tally.verdicts.items():
        call, _, outcome = verdict.partition(": ")
        by_call.setdefault(call, Counter())[outcome] += count
    for call, outcomes in sorted(by_call.items()):
        parts = [f"{outcomes.pop('accepted', 0)} accepted"]
        parts += [f"{count} refused by {error}" for error, count in sorted(outcomes.items())]
        typer.echo(f"  {call:22} {', '.join(parts)}")
    failed = sum(map(len, tally.failures.values()))
    typer.echo(f"{failed} cases failed, in {len(tally.failures)} groups")
    for group, cases in sorted(tally.failures.items(), key=lambda entry: -len(entry[1])):
        shown = " ".join(cases[:5]) + (" ..." if len(cases) > 5 else "")
        typer.echo(f"  {len(cases):5} {group}\n        make fuzz CASE={cases[0]}    of {shown}")


if __name__ == "__main__":
    typer.run(main)
