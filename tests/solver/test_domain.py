"""Which pixels are solved, known, cut off, or renewed from inside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from persfs_cl import InputError
from persfs_cl.arrays import Mask
from persfs_cl.masks import NONE, SWEPT
from persfs_cl.solver.domain import Domain, lay_out


def no(shape: tuple[int, int]) -> Mask:
    return np.zeros(shape, bool)


def yes(shape: tuple[int, int]) -> Mask:
    return np.ones(shape, bool)


Place = tuple[int, int] | None


def looks(layout: Domain, shape: tuple[int, int]) -> dict[Place, list[Place]]:
    """Boundary cells as coordinates, with the cells they look at."""

    def at(cell: int) -> Place:
        return None if cell == NONE else (int(cell) // shape[1], int(cell) % shape[1])

    pairs = zip(layout.boundary.cells, layout.boundary.inwards, strict=True)
    return {at(cell): [at(look) for look in inwards] for cell, inwards in pairs}


def test_rectangle_has_edges_that_look_inwards_and_corners_that_look_along_edges() -> None:
    known = no((5, 6))
    known[2, 3] = True
    layout = lay_out(yes((5, 6)), known, no((5, 6)), "outflow")
    found = looks(layout, (5, 6))
    assert len(found) == 2 * (5 + 6) - 4
    assert (layout.boundary.edges, layout.boundary.corners) == (14, 4)
    assert found[0, 2] == [None, None, (1, 2), (2, 2)]
    assert found[3, 5] == [(3, 4), (3, 3), None, None]
    assert found[4, 0] == [(4, 1), (4, 2), (3, 0), (2, 0)]
    swept = (layout.flags & SWEPT) != 0
    assert swept[1:-1, 1:-1].sum() == 3 * 4 - 1, "all inner pixels but the known one"
    assert not swept[0].any()


def test_strips_of_two_pixels_are_swept_because_looking_inwards_would_go_in_circles() -> None:
    known = no((2, 7))
    known[0, 0] = True
    layout = lay_out(yes((2, 7)), known, no((2, 7)), "outflow")
    assert len(layout.boundary.cells) == 0
    assert ((layout.flags & SWEPT) != 0).sum() == 13


def test_cells_beside_a_known_corner_are_swept_so_that_it_is_heard() -> None:
    known = no((6, 6))
    known[0, 0] = True
    layout = lay_out(yes((6, 6)), known, no((6, 6)), "outflow")
    swept = (layout.flags & SWEPT) != 0
    assert swept[0, 1]
    assert swept[1, 0]
    assert not swept[0, 2]


def test_cells_beside_a_known_value_that_inner_cells_hear_are_renewed() -> None:
    known = no((6, 6))
    known[:, 0] = True
    layout = lay_out(yes((6, 6)), known, no((6, 6)), "outflow")
    swept = (layout.flags & SWEPT) != 0
    assert swept[1:-1, 1:-1].all()
    assert not swept[0].any()


def test_pieces_without_a_known_value_are_unreached() -> None:
    wanted = yes((5, 9))
    walls = no((5, 9))
    walls[:, 4] = True
    known = no((5, 9))
    known[2, 1] = True
    layout = lay_out(wanted, known, walls, "wall")
    assert layout.unreached[:, 5:].all()
    assert not layout.unreached[:, :5].any()
    assert not layout.solved[:, 4:].any()


@given(st.integers(0, 10_000), st.integers(2, 15), st.integers(2, 15), st.floats(0.0, 0.5))
def test_every_boundary_cell_looks_at_pixels_that_exist(seed: int, height: int, width: int, holes: float) -> None:
    random = np.random.default_rng(seed)
    wanted = random.uniform(size=(height, width)) >= holes
    wanted[0, :2] = True
    known = no((height, width))
    known[0, 0] = True
    layout = lay_out(wanted, known, no((height, width)), "outflow")
    present = (layout.solved | layout.known).ravel()
    renewed = set(layout.boundary.cells.tolist())
    for number, (cell, inwards) in enumerate(zip(layout.boundary.cells, layout.boundary.inwards, strict=True)):
        seen = [int(look) for look in inwards if look != NONE]
        assert seen
        assert present[seen].all()
        assert cell not in seen
        if number < layout.boundary.edges:
            assert not renewed & {int(near) for near in inwards[::2]}, "edges look at cells that are not renewed"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"known": yes((4, 4))}, "nothing to solve"),
        ({"known": no((4, 4))}, "No depth is known"),
        ({"walls": yes((4, 4)), "known": no((4, 4))}, "nothing to solve"),
        ({"boundary": "fixed"}, "11 have none"),
    ],
)
def test_impossible_layouts_are_refused(change: dict[str, Any], message: str) -> None:
    shape = (4, 4)
    known = no(shape)
    known[0, 0] = True
    problem: dict[str, Any] = {
        "wanted": yes(shape),
        "known": known,
        "walls": no(shape),
        "boundary": "outflow",
        **change,
    }
    with pytest.raises(InputError, match=message):
        lay_out(**problem)


def test_known_depth_out_of_reach_is_refused() -> None:
    wanted, known = no((6, 6)), no((6, 6))
    wanted[:2, :2] = True
    known[5, 5] = True
    with pytest.raises(InputError, match="can reach"):
        lay_out(wanted, known, no((6, 6)), "outflow")
