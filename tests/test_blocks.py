"""Working by blocks of rows: nothing is left out, and nothing shows where a block ends."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import persfs_cl as ps
from persfs_cl import blocks
from persfs_cl.blocks import in_row_blocks, row_blocks
from persfs_cl.masks import Neighbours


@given(st.integers(1, 5000), st.integers(1, 200_000))
def test_blocks_cover_all_rows_in_their_order(height: int, width: int) -> None:
    rows = np.concatenate([np.arange(height)[block] for block in row_blocks((height, width))])
    np.testing.assert_array_equal(rows, np.arange(height))


@pytest.mark.parametrize("cores", [1, 3])
@pytest.mark.parametrize("height", [1, 23, 900])
def test_all_rows_are_worked_on_once_by_one_thread_or_several(
    height: int, cores: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blocks, "_PIXELS", 2**10)
    monkeypatch.setattr(blocks, "usable_cores", lambda: cores)
    counts = np.zeros((height, 100), int)
    threads, together = set(), threading.Event()
    several = cores > 1 and height == 900

    def work(rows: slice) -> None:
        counts[rows] += 1
        threads.add(threading.get_ident())
        if len(threads) > 1 or not several:
            together.set()
        assert together.wait(60.0)

    in_row_blocks(work, counts.shape)
    assert (counts == 1).all()
    assert (threads != {threading.get_ident()}) == several


@pytest.mark.parametrize("by_helper", [True, False])
def test_what_a_thread_raises_is_raised_and_ends_the_work(by_helper: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks, "usable_cores", lambda: 2)
    caller, raised, done = threading.get_ident(), threading.Event(), []

    def work(rows: slice) -> None:
        if (threading.get_ident() != caller) == by_helper:
            raised.set()
            raise ZeroDivisionError
        assert raised.wait(60.0)
        done.append(rows)

    with pytest.raises(ZeroDivisionError):
        in_row_blocks(work, (1000, 1000))
    assert len(done) < 8, "of 16 blocks"


@given(st.integers(0, 10_000), st.integers(1, 9), st.integers(1, 9), st.integers(0, 8), st.integers(1, 9))
def test_neighbours_of_some_rows_are_those_of_all(seed: int, height: int, width: int, begin: int, count: int) -> None:
    pixels = np.random.default_rng(seed).uniform(size=(height, width)) < 0.5
    rows = slice(min(begin, height), min(begin + count, height))
    all_of_them, some = Neighbours.of(pixels), Neighbours.of(pixels, rows)
    for side in ("left", "right", "up", "down"):
        np.testing.assert_array_equal(getattr(some, side), getattr(all_of_them, side)[rows])


# Each two of the light, the scheme and the ordering meet.
@pytest.mark.quick_where(
    holds=lambda given: (
        isinstance(given["light"], ps.FlashLight) ^ (given["scheme"] == "upwind") ^ (given["ordering"] == "wavefront")
    )
)
@pytest.mark.parametrize("light", [ps.ParallelLight(0.2, 0.1), ps.FlashLight()], ids=["parallel", "flash"])
@pytest.mark.parametrize("scheme", ["lax-friedrichs", "upwind"])
@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
def test_neither_the_size_of_blocks_nor_the_number_of_threads_matters(
    light: ps.ParallelLight | ps.FlashLight,
    scheme: str,
    ordering: str,
    device: ps.Device,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    random = np.random.default_rng(7)
    image = random.uniform(0.3, 1.0, (23, 17))
    mask = random.uniform(size=image.shape) > 0.1
    known = np.where(random.uniform(size=image.shape) > 0.9, random.uniform(1.0, 1.2, image.shape), np.nan)

    def solved() -> ps.Solution:
        return ps.reconstruct(
            image,
            ps.Camera(60.0),
            light=light,
            mask=mask,
            known_depth=known,
            scheme=scheme,
            ordering=ordering,
            max_iterations=3,
            device=device,
        )

    whole = solved()
    for rows, cores in ((5, 1), (1, 4)):
        monkeypatch.setattr(blocks, "_PIXELS", rows * 17)
        monkeypatch.setattr(blocks, "usable_cores", lambda: cores)  # noqa: B023  # used before it changes
        for name in ("depth", "log_depth", "solved", "unreached", "clamped"):
            np.testing.assert_array_equal(getattr(solved(), name), getattr(whole, name), err_msg=name)


def test_a_process_uses_its_share_of_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    there = blocks.usable_cores()
    # What is set here is set back.
    monkeypatch.setattr(blocks._Share, "cores", None)
    blocks.share_cores(1)
    assert blocks.usable_cores() == 1
    blocks.share_cores(there + 1)
    assert blocks.usable_cores() == there
