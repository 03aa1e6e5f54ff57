"""Which images share launches."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from persfs_cl.solver.pieces import pieces

SHAPES = [(400, 600)] * 12 + [(100, 90), (600, 400)]


def device(memory: int, kind: str = "gpu") -> Any:
    return SimpleNamespace(memory=memory, kind=kind, compute_units=8)


@pytest.mark.parametrize("memory", [10**6, 10**8, 10**9, 10**11])
@pytest.mark.parametrize("precision", ["float32", "float64"])
def test_images_of_about_one_size_share_launches_as_far_as_the_memory_goes(memory: int, precision: str) -> None:
    found = pieces(SHAPES, device(memory), precision)
    assert sorted(number for members in found for number in members) == list(range(len(SHAPES)))
    # Values, what they were and E; what acceleration keeps: two numbers of six launches, and two more; flags.
    needed = 400 * 600 * (17 * (4 if precision == "float32" else 8) + 1)
    for members in found:
        assert len({SHAPES[number] for number in members}) == 1
        assert len(members) == 1 or len(members) * needed <= memory * 2 / 3
    assert max(map(len, found)) == {10**6: 1, 10**8: 2 if precision == "float32" else 1}.get(memory, 12)
