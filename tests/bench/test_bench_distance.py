"""Estimated distances from the limit on the bench, and true ones."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import persfs_cl as ps
from persfs_cl.bench import distance
from persfs_cl.bench.plan import SCHEMES, Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.tables import contents
from persfs_cl.environment import environment

NAMES = [
    (photograph, f"{scheme}, {ordering}{unlike}")
    for photograph in distance.PHOTOGRAPHS
    for scheme in SCHEMES
    for ordering in ("wavefront", "checkerboard")
    for unlike in ("", f", {distance.NOT_ACCELERATED}")
    if not unlike or (scheme == "lax-friedrichs" and "flash" not in photograph)
]


@pytest.fixture
def plan(device: ps.Device) -> Plan:
    return Plan(device, sizes=(24,))


def records_of(plan: Plan) -> list[Record]:
    return [record for group in distance.distance(plan) for record in group]


def cells(records: list[Record], plan: Plan) -> list[list[str]]:
    text = contents(environment(plan.device, ""), records)["distance"]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()[2:]]


# Under each light as many programs again are compiled.
@pytest.mark.usefixtures("lexicographic_wavefront")
@pytest.mark.parametrize(
    "kept",
    [("bump, frontal, away",), pytest.param(tuple(distance.PHOTOGRAPHS), marks=pytest.mark.thorough)],
    ids=["one", "all"],
)
def test_estimates_stand_beside_the_truth(plan: Plan, kept: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(distance, "PHOTOGRAPHS", {name: distance.PHOTOGRAPHS[name] for name in kept})
    if not plan.device.has_float64:
        pytest.skip(f"{plan.device} has no double precision.")
    records = records_of(plan)
    assert {record.detail for record in records} == {"tolerance 1e-05"}, "all have converged, and so have the limits"
    true = [record.median for record in records if record.quantity == distance.TRUE]
    assert all(value is not None and 0.0 < value < 1e-4 for value in true)
    rows = cells(records, plan)
    assert [(row[0], row[1]) for row in rows] == [name for name in NAMES if name[0] in kept]
    assert all(cell for row in rows for cell in row)
    assert all(math.isfinite(float(cell)) for row in rows for cell in row[3:])


def test_what_is_not_told_or_exact_has_no_ratio(plan: Plan) -> None:
    scene = ps.bump((12, 12))
    solution = ps.reconstruct(
        scene.image, scene.camera, known_depth=scene.known_depth, device=plan.device, scheme="upwind"
    )
    records = distance._compared(plan, "some: solver", replace(solution, distance=math.nan), solution)
    assert cells(records, plan) == [["some", "solver", "12²", str(solution.iterations), "not told", "0", ""]]
    records = distance._compared(plan, "some: solver", replace(solution, distance=2e-6), solution)
    assert cells(records, plan) == [["some", "solver", "12²", str(solution.iterations), "2e-06", "0", ""]]


def test_a_device_without_double_precision_is_told(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan.device, "has_float64", False)
    rows = cells(records_of(plan), plan)
    assert [(row[0], row[1]) for row in rows] == NAMES
    assert {row[5] for row in rows} == {f"skipped: {plan.device} has no double precision."}
