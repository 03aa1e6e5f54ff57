"""Histories as the columns of a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from persfs_cl.paper.history import History
from persfs_cl.paper.report import Table

PRINTED, PRINTED_TANKUS = "paper", "paper: Tankus"
HERE, TANKUS = "here", "here: Tankus"


def error_tables(name: str, histories: Mapping[str, History], iterations: Sequence[int], form: str) -> list[Table]:
    """ME and RS after some numbers of iterations, a column each history.

    Parameters
    ----------
    name : str
        Of the paper's table, as in "table1".
    histories : mapping of str to History
        By the head of the column.
    iterations : sequence of int
    form : str
        How an error is printed.
    """
    title = f"Table {name.removeprefix('table')}"
    mean = _rows(histories, iterations, lambda history, place: form.format(history.mean[place]))
    square = _rows(histories, iterations, lambda history, place: form.format(history.root_mean_square[place]))
    header = ("iterations", *histories)
    return [
        Table(f"{name}-me", f"{title}: mean error, ME", header, mean),
        Table(f"{name}-rs", f"{title}: root mean square error, RS", header, square),
    ]


def time_table(name: str, histories: Mapping[str, History], iterations: Sequence[int]) -> Table:
    """Times from the start of those histories that have them; the paper's in seconds, ours in milliseconds."""
    timed = {
        f"{head}, {'s' if head.startswith(PRINTED) else 'ms'}": history
        for head, history in histories.items()
        if history.seconds is not None
    }
    factors = {id(history): 1.0 if head.endswith(", s") else 1e3 for head, history in timed.items()}

    def cell(history: History, place: int) -> str:
        return "" if history.seconds is None else f"{factors[id(history)] * history.seconds[place]:.1f}"

    title = f"Table {name.removeprefix('table')}: time from the start"
    return Table(f"{name}-time", title, ("iterations", *timed), _rows(timed, iterations, cell))


def _rows(
    histories: Mapping[str, History], iterations: Sequence[int], cell: Callable[[History, int], str]
) -> tuple[tuple[str, ...], ...]:
    return tuple(
        (str(number), *(cell(history, history.iterations.index(number)) for history in histories.values()))
        for number in iterations
    )
