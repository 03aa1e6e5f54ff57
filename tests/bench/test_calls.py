"""Whole calls on the bench: their tables are whole, and they solve what they say. No test looks at a time."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.bench import flash, masked
from persfs_cl.bench.calls import FAST_MARCHING, LIGHTS, SPEED, calls
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import PLAIN_C
from persfs_cl.bench.results import Record
from persfs_cl.bench.tables import contents
from persfs_cl.environment import environment

ORDERINGS = ("wavefront", "checkerboard")


@pytest.fixture
def plan(device: ps.Device) -> Plan:
    return Plan(device, sizes=(24,), batch=(1, 2), repeats=2, least_seconds=0.0)


def records_of(experiment: Callable[[Plan], Iterator[list[Record]]], plan: Plan) -> list[Record]:
    records = [record for group in experiment(plan) for record in group]
    for record in records:
        if record.median is not None:
            assert math.isfinite(record.median)
            assert record.median > 0
    return records


def cells(records: list[Record], name: str, plan: Plan) -> list[list[str]]:
    """The rows of a table, without its header."""
    text = contents(environment(plan.device, ""), records)[name]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()[2:]]


def test_calls_stand_beside_plain_c(plan: Plan) -> None:
    records = records_of(calls, plan)
    rows = cells(records, "calls", plan)
    names = [*(f"reconstruct, {name}" for name in ORDERINGS), PLAIN_C]
    of_batch = [*(f"reconstruct_batch, {name}" for name in ORDERINGS), PLAIN_C]
    assert [row[:2] for row in rows] == [
        *([name, "24²"] for name in names),
        *([name, "24²" if name == PLAIN_C else "2 × 24²"] for name in of_batch),
    ]
    for name, _pixels, rate, factor, share in rows:
        if "skipped" not in rate:
            assert float(rate.partition(" ")[0].replace(",", "")) > 0
            assert (share == "") == (name == PLAIN_C)
            assert factor or any("skipped" in row[2] for row in rows)


def test_calls_stand_beside_fast_marching(plan: Plan) -> None:
    pytest.importorskip("skfmm")
    records = records_of(calls, plan)
    rows = cells(records, "fast-marching", plan)
    solvers = [f"{light}, {solver}" for light in LIGHTS for solver in ("upwind", FAST_MARCHING)]
    assert [row[0] for row in rows] == solvers
    for _name, pixels, time, speed, how in rows:
        assert pixels == "24²"
        assert time
        assert bool(speed) != how.startswith("the true slope given")
        assert how.endswith("% of the relief")
    errors = [float(row[4].rpartition("mean error ")[2].partition(" ")[0]) for row in rows]
    assert max(errors) < 5.0, "all find the same surface"


def test_without_fast_marching_the_calls_are_measured(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "skfmm", None)
    records = records_of(calls, plan)
    rows = cells(records, "fast-marching", plan)
    assert [row[0] for row in rows if row[2].startswith("skipped: scikit-fmm")] == [
        f"{light}, {FAST_MARCHING}" for light in LIGHTS
    ]
    assert SPEED not in {record.quantity for record in records}
    assert all(row[3] == "" for row in rows)


def test_flash_photographs_are_timed(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> Path:
        raise ps.InputError("get the bunny")

    monkeypatch.setattr(flash, "stanford_bunny", missing)
    records = records_of(flash.flash, plan)
    first, *rows = cells(records, "flash", plan)
    assert first == [flash.BUNNY, "24²", "", "skipped: get the bunny", "", "", ""]
    names = [f"{photograph}: {name}" for photograph in ("bump", "bump, 2 % noise", "bumps") for name in ORDERINGS]
    assert [row[0] for row in rows] == names
    assert all(cell for row in rows for cell in row)
    assert {record.detail for record in records[1:]} == {"converged"}


def test_pixels_of_the_object_alone_are_counted(device: ps.Device) -> None:
    plan = Plan(device, sizes=(24,), orderings=("wavefront",), repeats=1, least_seconds=0.0)
    found = {record.quantity: record for record in records_of(flash.flash, plan) if flash.BUNNY in record.workload}
    seconds = 1e-3 * (found["time"].median or 0.0)
    counted = 1e6 * seconds * (found[flash.PIXELS].median or 0.0)
    assert counted == pytest.approx(round(counted))
    assert 0.1 * 24**2 < counted < 0.9 * 24**2


@pytest.mark.thorough
def test_an_object_in_its_frame_is_the_one_in_its_box(plan: Plan) -> None:
    rows = cells(records_of(masked.masked, plan), "masked", plan)
    assert [row[0] for row in rows] == list(masked.CASES)
    assert all(cell for row in rows for cell in row)
    for light, scheme in masked.CASES.values():
        box = ps.bump((8, 8), light=light)
        whole, cropped = (masked._call(plan, box, scheme, size)() for size in (32, None))
        assert int(whole.solved.sum()) == int(cropped.solved.sum()) > 0
        found = whole.depth[4:12, 16:24]
        assert np.isfinite(found).sum() == np.isfinite(whole.depth).sum()
        np.testing.assert_allclose(found, cropped.depth, rtol=1e-5)
