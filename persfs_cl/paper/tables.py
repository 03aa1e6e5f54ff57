"""Courses as the columns of a table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from persfs_cl.paper.course import Course
from persfs_cl.paper.report import Table

PRINTED, PRINTED_TANKUS = "paper", "paper: Tankus"
HERE, TANKUS = "here", "here: Tankus"


def error_tables(name: str, courses: Mapping[str, Course], iterations: Sequence[int], form: str) -> list[Table]:
    """ME and RS after some numbers of iterations, a column each course.

    Parameters
    ----------
    name : str
        Of the paper's table, as in "table1".
    courses : mapping of str to Course
        By the head of the column.
    iterations : sequence of int
    form : str
        How an error is printed.
    """
    title = f"Table {name.removeprefix('table')}"
    mean = _rows(courses, iterations, lambda course, place: form.format(course.mean[place]))
    square = _rows(courses, iterations, lambda course, place: form.format(course.root_mean_square[place]))
    header = ("iterations", *courses)
    return [
        Table(f"{name}-me", f"{title}: mean error, ME", header, mean),
        Table(f"{name}-rs", f"{title}: root mean square error, RS", header, square),
    ]


def time_table(name: str, courses: Mapping[str, Course], iterations: Sequence[int]) -> Table:
    """Times from the start of those courses that have them; the paper's in seconds, ours in milliseconds."""
    timed = {
        f"{head}, {'s' if head.startswith(PRINTED) else 'ms'}": course
        for head, course in courses.items()
        if course.seconds is not None
    }
    factors = {id(course): 1.0 if head.endswith(", s") else 1e3 for head, course in timed.items()}

    def cell(course: Course, place: int) -> str:
        return "" if course.seconds is None else f"{factors[id(course)] * course.seconds[place]:.1f}"

    title = f"Table {name.removeprefix('table')}: time from the start"
    return Table(f"{name}-time", title, ("iterations", *timed), _rows(timed, iterations, cell))


def _rows(
    courses: Mapping[str, Course], iterations: Sequence[int], cell: Callable[[Course, int], str]
) -> tuple[tuple[str, ...], ...]:
    return tuple(
        (str(number), *(cell(course, course.iterations.index(number)) for course in courses.values()))
        for number in iterations
    )
