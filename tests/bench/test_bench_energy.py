"""The experiments on the least energy: what they claim, at sizes that are quick."""

from __future__ import annotations

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.bench import painted
from persfs_cl.bench import terrain as bench
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.bench.tables import contents
from persfs_cl.environment import environment


def found(records: list[Record], quantity: str) -> dict[str, float]:
    return {record.workload: record.median or 0.0 for record in records if record.quantity == quantity}


def test_terrain_with_a_prior_is_better_than_all_else(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "NOISES", (0.01,))
    records = [record for group in bench.terrain(Plan(device, sizes=(96,))) for record in group]
    errors, angles = found(records, bench.ERROR), found(records, bench.ANGLE)
    ways = [bench.FLAT, bench.PRIOR, *(f"{name}, {frame} frame" for name in bench.SWEPT for frame in ("true", "no"))]
    for step in bench.STEPS:
        energy = bench.workload(0.01, step, bench.ENERGY)
        for way in ways:
            other = bench.workload(0.01, step, way)
            assert other not in errors or errors[energy] < errors[other]
            assert other not in angles or angles[energy] < angles[other]
    text = contents(environment(device, ""), records)["terrain"]
    assert text.splitlines()[0] == "| blocks | what | 1 % noise |"
    assert f"| 32 × 32 | {bench.ENERGY} | " in text


def test_objects_with_a_prior_are_better_than_it(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise ps.InputError("get the bunny")

    monkeypatch.setattr(bench, "stanford_bunny", missing)
    records = [record for group in bench.priors(Plan(device, sizes=(90,))) for record in group]
    errors = found(records, bench.ERROR)
    for scene in ("bump", "hill"):
        assert errors[f"{scene}: {bench.ENERGY}"] < errors[f"{scene}: {bench.PRIOR}"]
    text = contents(environment(device, ""), records)["priors"]
    assert "| bunny | skipped: get the bunny |" in text


@pytest.mark.thorough
def test_paint_is_found(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise ps.InputError("get the bunny")

    monkeypatch.setattr(painted, "stanford_bunny", missing)
    records = [record for group in painted.painted(Plan(device, sizes=(90,))) for record in group]
    errors, angles = found(records, bench.ERROR), found(records, bench.ANGLE)
    for name in ("bump, checker", "bump, gradient", "hill, checker", "hill, gradient"):
        fitted, prior = f"{name}: {painted.FITTED}", f"{name}: {bench.PRIOR}"
        assert errors[fitted] <= 0.5 * errors[f"{name}: {painted.WITHOUT}"]
        assert angles[fitted] <= 0.75 * angles[prior]
    assert "| bunny | skipped: get the bunny |" in contents(environment(device, ""), records)["painted"]


def test_its_time_is_measured(device: ps.Device) -> None:
    records = [record for group in bench.energy(Plan(device, sizes=(24, 64), repeats=1)) for record in group]
    text = contents(environment(device, ""), records)["energy"]
    cells = [[cell.strip() for cell in line.split("|")[1:3]] for line in text.splitlines()[2:]]
    assert cells == [[size, ending] for size in ("24²", "64²") for ending in bench.ENDINGS]


def test_a_prior_of_blocks_has_their_means_and_knows_its_error() -> None:
    y, x = np.mgrid[:24, :30]
    depth = 2.0 + 0.01 * x + 0.001 * (y - 12.0) ** 2
    there = np.ones(depth.shape, bool)
    there[:6, :6] = False
    prior = bench.prior_of_blocks(depth, there, 6, tolerance=0.01)
    np.testing.assert_array_equal(np.isfinite(prior.log_depth), there)
    off = np.abs(np.exp(prior.log_depth) - depth)[there]
    assert np.mean(off < 3.0 * (prior.tolerance * np.exp(prior.log_depth))[there]) > 0.9
    assert np.nanmin(prior.tolerance * np.exp(prior.log_depth)) >= 0.01 * np.ptp(depth[there])
