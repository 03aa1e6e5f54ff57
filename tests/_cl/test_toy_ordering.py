"""A new ordering is a kernel file, a class and a line in the registry: here is one, added as a contributor would."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pyopencl as cl
import pytest
from command import run as run_command

import persfs_cl as ps
from persfs_cl._cl import program
from persfs_cl._cl.layout import Layout
from persfs_cl._cl.orderings import ORDERINGS
from persfs_cl._cl.orderings.ordering import Ordering
from persfs_cl._cl.run import DIRECTIONS, Run

KERNEL = """
/* Column by column, where the paper goes row by row: no cell sees the difference, since in both orders it comes after
 * the same two of its neighbours. One work-item takes an image: global size (images,). In place.
 */
__kernel void sweep(const int upwards,                 /* 1: rows from the bottom                             */
                    const int leftwards,               /* 1: columns from the right                           */
                    __global const parameter_set *parameters, /* shape (images,)                              */
                    __global const real *row_table,    /* shape (images, 3, rows)                             */
                    __global const real *column_table, /* shape (images, 3, stride)                           */
                    const int width, const int height, /* pixels                                              */
                    const int first_column,            /* of the image within its padding                     */
                    const int first_row,               /* likewise                                            */
                    const int stride, const int rows,  /* stored                                              */
                    const int images,                  /* of this run                                         */
                    const float tolerance,             /* on max |dZ|                                         */
                    const int iteration,               /* index into changes                                  */
                    __global const float *changes,     /* see prelude                                         */
                    __global const uchar *flags,       /* shape (images, rows, stride)                        */
                    __global const real *brightness,   /* E, marked as in update.cl, same shape                 */
                    __global const real *limits,       /* as many as LIMITS says, of that shape each          */
                    __global real *log_depth,          /* same shape                                          */
                    __global int *sync)                /* sweeps of an image that did not rest, shape (images,) */
{
    const int image = (int)get_global_id(0);
    if (finished(changes, iteration, image, images, tolerance))
        return;
    ++sync[image];
    const parameter_set numbers = parameters[image];
    const size_t begin = (size_t)image * (size_t)rows * (size_t)stride;
    const bounds within = bounds_from(limits, (size_t)images * (size_t)rows * (size_t)stride, 0);
    for (int j = 0; j < width; ++j)
        for (int i = 0; i < height; ++i) {
            const int row = first_row + (upwards ? height - 1 - i : i);
            const int column = first_column + (leftwards ? width - 1 - j : j);
            const size_t cell = begin + (size_t)row * (size_t)stride + (size_t)column;
            update_cell(log_depth, brightness, within, flags, cell, stride, leftwards, upwards,
                        axis_at(column_table + image * 3 * stride, stride, column),
                        axis_at(row_table + image * 3 * rows, rows, row), &numbers);
        }
}
"""


@dataclass(frozen=True)
class Toy(Ordering):
    """Column by column."""

    file: ClassVar[str] = "toy"
    reason: ClassVar[str] = "It shows how an ordering is added."

    def counters(self, images: int, layout: Layout) -> int:  # noqa: ARG002
        """Sweeps of each image."""
        return images

    def sweep(self, run: Run, number: int, count: int) -> cl.Event:  # noqa: ARG002
        """One launch."""
        leftwards, upwards = DIRECTIONS[number]
        return run.launch((run.images,), leftwards=leftwards, upwards=upwards)

    def is_done(self, run: Run) -> bool:
        """Whether each image had all its sweeps."""
        return bool((run.counters() == run.sweeps_of).all())


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "orderings"
    folder.mkdir()
    (folder / "toy.cl").write_text(KERNEL, encoding="utf-8")
    monkeypatch.setattr(program, "KERNEL_FOLDERS", [*program.KERNEL_FOLDERS, tmp_path])
    monkeypatch.setitem(ORDERINGS, "toy", Toy.of)


@pytest.mark.usefixtures("toy")
# What is corrected to second order does not know the ordering, and the ordering does not know the scheme.
@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32" and given["order"] == 1)
@pytest.mark.quick_where(holds=lambda given: given["scheme"] == "upwind")
@pytest.mark.parametrize(
    ("scheme", "boundary", "order"), [("lax-friedrichs", "outflow", 1), ("upwind", "wall", 1), ("upwind", "wall", 2)]
)
def test_a_new_ordering_is_there_for_users(
    device: ps.Device,
    precision: ps.choices.Precision,
    scheme: str,
    boundary: ps.choices.Boundary,
    order: int,
) -> None:
    scenes = [ps.bump((23, 31)).seeded(), ps.bump((31, 23)).seeded(), ps.bump((23, 31), orientation=40.0).seeded()]
    toys, expected = (
        ps.reconstruct_batch(
            [scene.image for scene in scenes],
            [scene.camera for scene in scenes],
            known_depth=[scene.known_depth for scene in scenes],
            scheme=scheme,
            boundary=boundary,
            accuracy_order=order,
            ordering=ordering,
            device=device,
            precision=precision,
        )
        for ordering in ("toy", "lexicographic")
    )
    for one, other in zip(toys, expected, strict=True):
        assert (one.parameters["ordering"], one.parameters["sweep"]) == ("toy", "toy")
        assert one.status is other.status is ps.Status.CONVERGED
        np.testing.assert_array_equal(one.changes, other.changes)
        np.testing.assert_array_equal(one.depth, other.depth)


@pytest.mark.usefixtures("toy")
def test_a_new_ordering_is_listed_where_another_is_refused() -> None:
    scene = ps.bump((9, 9))
    with pytest.raises(ps.InputError, match=r"ordering='spiral' is unknown: choose .wavefront., .* or .toy."):
        ps.reconstruct(scene.image, scene.camera, ordering="spiral")


def test_without_its_line_it_is_unknown() -> None:
    scene = ps.bump((9, 9))
    with pytest.raises(ps.InputError, match="ordering='toy' is unknown"):
        ps.reconstruct(scene.image, scene.camera, ordering="toy")


@pytest.mark.usefixtures("toy")
def test_the_command_takes_names_from_the_registry(tmp_path: Path) -> None:
    missing = tmp_path / "missing.png"
    refused = run_command("reconstruct", missing, "-o", tmp_path / "out", "--ordering", "spiral")
    assert "--ordering spiral is unknown: choose" in refused.stderr
    taken = run_command("reconstruct", missing, "-o", tmp_path / "out", "--ordering", "toy")
    assert (refused.status, taken.status) == (2, 1), "a file that is missing is found after the options"


@pytest.mark.usefixtures("toy")
def test_sweeps_that_a_driver_leaves_out_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Toy, "sweep", lambda _self, run, *_: run.launch((1,), leftwards=0, upwards=0))
    scene = ps.bump((9, 9))
    with pytest.raises(ps.DeviceError, match="left parts of the image undone"):
        ps.reconstruct_batch([scene.image] * 2, scene.camera, ordering="toy")
