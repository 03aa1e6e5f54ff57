"""The experiment on guides, and its tables."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import persfs_cl as ps
from persfs_cl.bench import guided
from persfs_cl.bench.guided import ALONE, CASES, GUIDE, GUIDED, QUANTITIES, RATIO, blocks
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.tables import contents
from persfs_cl.environment import environment
from persfs_cl.guide.cells import Cells
from persfs_cl.scenes.meshes import stanford_bunny


def two_balls() -> Any:
    """One ball half hides another one."""
    near, far = (trimesh.creation.icosphere(3, radius) for radius in (0.5, 0.8))
    near.apply_translation((-0.3, -1.2, 0.0))
    far.apply_translation((0.5, 0.6, 0.0))
    return trimesh.util.concatenate([near, far])


@pytest.mark.thorough
def test_what_guides_are_worth_is_told_in_two_tables(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> Path:
        raise ps.InputError("get the head")

    monkeypatch.setattr(guided, "OBJECTS", {"bunny": two_balls, "head": missing})
    monkeypatch.setattr(guided, "TURNS", (0,))
    monkeypatch.setattr(guided, "OTHER_LIGHTS", {"parallel": ps.ParallelLight(0.15, -0.1)})
    monkeypatch.setattr(guided, "SCENES", {"bump": ps.bump})
    kept = ("1/9, 2 % noise", "200 points, 1 % noise", "1/9, gain unknown", "like a network's, inverse")
    for name in set(CASES).difference(kept):
        monkeypatch.delitem(CASES, name)
    records = [record for group in guided.guided(Plan(device, sizes=(100,))) for record in group]
    assert {record.size for record in records} == {90}
    found = {(record.workload, record.quantity): record for record in records}
    assert [*dict.fromkeys(name for name, _ in found)] == [
        *(f"bunny: {name}" for name in kept),
        f"head: {kept[0]}",
        "bump, away: parallel",
        "bump, toward: parallel",
    ]

    def value(workload: str, quantity: str) -> float:
        median = found[workload, quantity].median
        assert median is not None
        return median

    first, points, third, network = (f"bunny: {name}" for name in kept)
    assert max(value(first, RATIO), value(points, RATIO)) <= 1.05
    assert value(network, GUIDED) <= max(value(network, ALONE), value(network, GUIDE))
    assert value(first, GUIDED) < 0.7 * min(value(first, ALONE), value(first, GUIDE))
    assert value(third, GUIDED) < 0.1 * value(third, ALONE)
    assert value(first, "guided, normals") < value(first, "guide, normals")
    assert value("bump, toward: parallel", RATIO) < 1.0
    assert ("bump, toward: parallel", ALONE) not in found

    tables = contents(environment(device, ""), records)
    header, _rule, *rows = tables["guided"].splitlines()
    assert header.count("|") == len(QUANTITIES) + 2
    assert {row.count("|") for row in rows} == {len(QUANTITIES) + 2}
    assert "skipped: get the head" in rows[-1]
    header, _rule, *rows = tables["guided-lights"].splitlines()
    assert (header.count("|"), len(rows)) == (7, 2)


@pytest.mark.thorough
def test_a_guide_like_a_networks_does_no_harm_on_average() -> None:
    """Nor is it ever worse than the worse of guide and photograph."""
    flash, size, random = ps.FlashLight(), 270, np.random.default_rng
    views = [
        ps.mesh_scene(
            stanford_bunny(), (size, size), up="z", turn=turn, focal_length=295.0, light=flash, bits=8, noise=0.005
        )
        for turn in guided.TURNS
    ]
    solve = partial(
        ps.reconstruct_batch,
        [view.image for view in views],
        views[0].camera,
        mask=[view.mask for view in views],
        light=flash,
    )

    def errors(depths: Iterable[Any]) -> Any:
        found = [
            ps.compare(depth, view.depth, mask=view.mask).mean / np.ptp(view.depth[view.mask])
            for depth, view in zip(depths, views, strict=True)
        ]
        return np.array(found)

    alone = errors(solution.depth for solution in solve())
    for case in (CASES["like a network's"], CASES["like a network's, inverse"]):
        given: list[Any] = [case.depths(view, random(7)) for view in views]
        cells = [Cells.of_map(guide, view.mask) for guide, view in zip(given, views, strict=True)]
        of_guide = errors(each.interpolated(each.values) for each in cells)
        numbers = [3.7 / guide + 0.4 for guide in given] if case.relative else given
        both = errors(solution.depth for solution in solve(guide=numbers, **case.keywords))
        assert (both <= np.maximum(alone, of_guide)).all()
        assert both.mean() <= alone.mean()


def test_guides_are_what_they_are_called() -> None:
    scene = ps.bump((90, 90), light=ps.FlashLight(), relief=0.3)
    made: dict[str, Any] = {name: case.depths(scene, np.random.default_rng(0)) for name, case in CASES.items()}
    exact = blocks(scene.depth, 9)
    plain, points, network = (made[name] for name in ("1/9, 2 % noise", "200 points, 1 % noise", "like a network's"))
    assert (plain.shape, made["1/15, 2 % noise"].shape, points.columns.shape) == ((10, 10), (6, 6), (200,))
    assert 0.01 < np.std(plain - exact) / np.ptp(scene.depth) < 0.03
    np.testing.assert_allclose(made["1/9, scaled"], 1.05 * plain)
    assert 0 < np.count_nonzero(np.abs(made["1/9, 5 % outliers"] / plain - 1.0) > 0.1) < 15
    # A distortion, and no noise.
    assert np.abs(network / exact - 1.0).max() > 0.03
    assert np.abs(np.diff(network / exact, axis=0)).max() < 0.03


def test_blocks_are_medians_of_what_is_there() -> None:
    depth = np.arange(48.0).reshape(6, 8)
    depth[:3, :4] = np.nan
    depth[5, 7] = 1e6
    depth[3, 0] = np.nan
    np.testing.assert_array_equal(
        blocks(depth, 3),
        [
            [np.nan, np.median([4.0, 5.0, 12.0, 13.0, 20.0, 21.0])],
            np.nanmedian(depth[3:, :6].reshape(3, 2, 3), axis=(0, 2)),
        ],
    )


@pytest.mark.parametrize("name", ["head", "brain"])
def test_an_object_whose_package_is_missing_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.path", [])
    with pytest.raises(ps.InputError, match="tvb-data"):
        guided.OBJECTS[name]()
