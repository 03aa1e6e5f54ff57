"""The length of a step, on energies along a line that are known."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import pytest

from persfs_cl._cl.energy import Sums
from persfs_cl.solver.energy.line_search import Reached, search


class Line:
    """What the search asks of a descent, for a function of the length."""

    def __init__(self, energy: Callable[[float], float]) -> None:
        self.energy, self.place, self.moves = energy, 0.0, 0

    def move(self, length: float) -> float:
        """Go on."""
        self.before, self.place, self.moves = self.place, self.place + length, self.moves + 1
        return length

    def go_back(self) -> None:
        """Undo it."""
        self.place = self.before

    def linearise(self, _white: float) -> Sums:
        """The energy there."""
        return Sums(self.energy(self.place), 0.0)


def searched(line: Line, slope: float, length: float = 1.0) -> Reached:
    return search(cast("Any", line), line.linearise(0.0), slope, 0.0, length)


@pytest.mark.parametrize("lowest", [0.02, 0.3, 0.9, 1.4, 2.0, 20.0])
def test_a_parabola_is_followed_to_its_least(lowest: float) -> None:
    line = Line(lambda at: (at - lowest) ** 2)
    found = searched(line, 2.0 * lowest)
    assert line.place == found.length == pytest.approx(found.change)
    assert found.sums.energy == line.energy(found.length) < line.energy(0.0)
    near = 1.0 / 1.5 <= lowest <= 1.5
    assert line.moves == (1 if near else 2 if lowest >= 0.1 else line.moves)
    assert found.length == (1.0 if near else pytest.approx(min(lowest, 3.0), rel=0.6))


def test_a_worse_second_trial_gives_way_to_the_first() -> None:
    line = Line(lambda at: -at if at <= 1.0 else 5.0 * at)
    assert searched(line, 10.0).sums.energy < 0.0
    line = Line(lambda at: [0.0, -3.0, 7.0][min(2, math.ceil(at))])
    found = searched(line, 3.2)
    assert line.place == found.length == 1.0


@pytest.mark.parametrize("energy", [lambda at: at, lambda at: math.nan if at else 0.0], ids=["uphill", "NaN"])
def test_where_nothing_is_lower_the_surface_stays(energy: Callable[[float], float]) -> None:
    line = Line(energy)
    found = searched(line, 1.0)
    assert (found.length, found.change, found.sums.energy) == (0.0, 1.0, 0.0)
    assert line.place == 0.0
    assert line.moves <= 6
