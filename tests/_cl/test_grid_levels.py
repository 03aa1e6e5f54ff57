"""The multigrid method's kernels against the same cycle in plain NumPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl._cl.multigrid import (
    ABSENT,
    COARSEST_ITERATIONS,
    FIRST_CYCLES,
    FIRST_ITERATIONS,
    KNOWN,
    SOLVED,
    Multigrid,
    Part,
    Steps,
    coarse_cells,
)
from persfs_cl.masks import LACKING, Neighbours
from persfs_cl.solver import multigrid
from persfs_cl.solver.complete import complete
from persfs_cl.solver.multigrid import Hierarchy
from persfs_cl.solver.problem import Problem, prepare

Array = NDArray[np.float64]

LIGHT = ps.ParallelLight(0.3, -0.2)
CASES: dict[str, dict[str, Any]] = {
    "even": {"shape": (48, 48)},
    "odd, oblong, oblique, toward": {"shape": (33, 75), "light": LIGHT, "surface": "toward"},
    "rows as many as stored columns": {"shape": (63, 20)},
    "known inside, two objects": {"shape": (60, 41), "light": LIGHT, "holes": True},
    "larger than what is small": {"shape": (130, 110), "holes": True},
}


@pytest.fixture(autouse=True)
def _of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small images take less time without, but tests less with these."""
    monkeypatch.setattr(multigrid, "_LEAST_PIXELS", 0)


def problem(
    shape: tuple[int, int], light: ps.ParallelLight = ps.ParallelLight(), surface: Any = "away", holes: bool = False
) -> Problem:
    """An image of noise, all of its frame known; with holes, of which all pixels around are."""
    random = np.random.default_rng(sum(shape))
    scene = ps.bump(shape, light=light, surface=surface)
    known, mask = np.array(scene.known_depth), np.ones(shape, bool)
    if holes:
        row, column = np.indices(shape)
        mask = np.hypot(row - 0.4 * shape[0], column - 0.5 * shape[1]) > 0.12 * min(shape)
        mask &= np.abs(column - 0.7 * shape[1]) > 1.0
        rim = mask & ~Neighbours.of(mask).all
        known[rim] = scene.depth[rim]
        known[shape[0] // 5, shape[1] // 4] = scene.depth[shape[0] // 5, shape[1] // 4]
    image = scene.image * random.uniform(0.95, 1.0, shape)
    options = complete({"light": light, "surface": surface, "scheme": "lax-friedrichs"})
    return prepare(image, scene.camera, mask, None, np.where(mask, known, np.nan), options=options)


class Axis:
    """Matrices from a fine axis to a coarse one and back."""

    def __init__(self, cells: int) -> None:
        count = cells // 2 + 1
        places = np.linspace(0.0, cells - 1.0, count)
        self.spacing = (cells - 1) / (count - 1)
        self.sampled = self._hats(places, np.arange(cells))
        self.interpolated = self._hats(np.arange(cells) / self.spacing, np.arange(count))
        nearest = np.floor(np.arange(cells) / self.spacing + 0.5 + 1e-9)
        self.nearest = (np.arange(count)[:, None] == nearest).astype(float)

    @staticmethod
    def _hats(places: Array, cells: NDArray[np.int64]) -> Array:
        shares = np.maximum(0.0, 1.0 - np.abs(places[:, None] - cells))
        return np.where(shares < 1e-9, 0.0, shares)


def both(down: Array, values: Array, across: Array) -> Array:
    return np.asarray(down @ values @ across.T)


def weighted(down: Array, values: Array, across: Array, counted: NDArray[np.bool_]) -> Array:
    """Of the values that count, with shares that add up to 1; 0 where there are none."""
    shares = both(down, counted.astype(float), across)
    sums = both(down, np.where(counted, values, 0.0), across)
    return np.divide(sums, shares, out=np.zeros_like(sums), where=shares > 1e-9)


class Plain:
    """A level, and the coarser ones."""

    def __init__(self, of: Problem, brightness: Array, kinds: NDArray[np.uint8], values: Array, level: Any) -> None:
        self.problem, self.brightness, self.kinds, self.values = of, brightness, kinds, values
        self.x, self.y, self.dx, self.dy = level
        light = of.model.light
        assert isinstance(light, ps.ParallelLight)
        self.light, self.solved = light, kinds == SOLVED
        self.highest = float(values[kinds == KNOWN].max())
        norm = light.norm
        self.own = (
            brightness * np.sqrt(1.0 + self.x**2) + np.abs(self.x - light.p0) / norm,
            brightness * np.sqrt(1.0 + self.y**2) + np.abs(self.y - light.q0) / norm,
        )
        self.coarse: Plain | None = None

    @classmethod
    def of(cls, given: Problem, part: Part) -> Plain:
        solved, grid = given.domain.solved, given.grid
        near = Neighbours.of(Neighbours.of(solved).any | solved).any
        kinds = np.where(given.domain.known & near, KNOWN, ABSENT).astype(np.uint8)
        kinds[solved] = SOLVED
        brightness = np.where(solved, given.shading, 1.0)
        x, y = (np.broadcast_to(axis, solved.shape)[part] for axis in (grid.x, grid.y))
        begun = (x[0], y[:, :1], grid.dx, grid.dy)
        finest = level = cls(given, brightness[part], kinds[part], given.start[part], begun)
        while min(level.kinds.shape) // 2 + 1 >= 5 and (coarse := level.coarsened()):
            level.coarse = level = coarse
        return finest

    def coarsened(self) -> Plain | None:
        self.down, self.across = map(Axis, self.kinds.shape)
        down, across = self.down, self.across
        known = both(down.nearest, (self.kinds == KNOWN).astype(float), across.nearest) > 0
        absent = both(down.nearest, (self.kinds == ABSENT).astype(float), across.nearest) > 0
        kinds = np.where(known, KNOWN, np.where(absent, ABSENT, SOLVED)).astype(np.uint8)
        if np.count_nonzero(kinds == SOLVED) < 9:
            return None
        held = self.kinds == KNOWN
        sampled = weighted(down.sampled, self.values, across.sampled, held)
        beside = both(down.sampled, held.astype(float), across.sampled) > 0
        mean = weighted(down.nearest, self.values, across.nearest, held)
        brightness = weighted(down.interpolated.T, self.brightness, across.interpolated.T, self.solved)
        coarse = Plain(
            self.problem,
            np.where(kinds == SOLVED, brightness, 1.0),
            kinds,
            np.where(beside, sampled, mean),
            (
                across.sampled @ self.x,
                down.sampled @ self.y,
                self.dx * across.spacing,
                self.dy * down.spacing,
            ),
        )
        coarse.highest = self.highest
        return coarse

    def scheme(self, values: Array, sigma: tuple[Array, Array]) -> tuple[Array, Array]:
        """What eq. (11) gives cells, and by how much that counts."""
        sign, steepest, light = self.problem.sign, self.problem.max_slope, self.light
        around = np.pad(values, 1, mode="edge")
        left, right, up, down = around[1:-1, :-2], around[1:-1, 2:], around[:-2, 1:-1], around[2:, 1:-1]
        p, q = sign * (right - left) / (2.0 * self.dx), sign * (down - up) / (2.0 * self.dy)
        w = 1.0 + self.x * p + self.y * q
        lit = (1.0 + (self.x - light.p0) * p + (self.y - light.q0) * q) / light.norm
        weights = sigma[0] / (2.0 * self.dx), sigma[1] / (2.0 * self.dy)
        scale = 2.0 * (weights[0] + weights[1])
        norm = np.sqrt(p**2 + q**2 + w**2)
        value = (lit - self.brightness * norm + weights[0] * (left + right) + weights[1] * (up + down)) / scale
        highest = np.minimum(np.minimum(left, right) + steepest * self.dx, np.minimum(up, down) + steepest * self.dy)
        self.slopes = (
            self.brightness * (p + self.x * w) / norm - (self.x - light.p0) / light.norm,
            self.brightness * (q + self.y * w) / norm - (self.y - light.q0) / light.norm,
        )
        return np.minimum(value, highest), scale

    def relax(self, values: Array, sigma: tuple[Array, Array], source: Array | float, iterations: int = 1) -> Array:
        row, column = np.indices(values.shape)
        for half in range(8 * iterations):
            found, scale = self.scheme(values, sigma)
            values = np.where(self.solved & ((row + column) % 2 == half % 2), found + source / scale, values)
        return values

    def residual(self, values: Array, sigma: tuple[Array, Array], source: Array | float) -> Array:
        found, scale = self.scheme(values, sigma)
        return np.where(self.solved, source - scale * (values - found), 0.0)

    def correct(self, values: Array, sigma: tuple[Array, Array], source: Array | float) -> Array:
        """The part of a cycle that the coarser levels have."""
        coarse, down, across = self.coarse, self.down, self.across
        assert coarse is not None
        present = self.kinds != ABSENT
        begin = weighted(down.sampled, values, across.sampled, present)
        coarse.scheme(begin, coarse.own)
        frozen_x, frozen_y = (
            np.maximum(
                np.minimum(1.125 * np.abs(slope), own),
                weighted(down.sampled, finer, across.sampled, self.solved) * ratio,
            )
            for slope, own, finer, ratio in zip(
                coarse.slopes, coarse.own, sigma, (self.dx / coarse.dx, self.dy / coarse.dy), strict=True
            )
        )
        # Elsewhere it does not matter, but must be no 0.
        frozen = np.where(coarse.solved, frozen_x, 1.0), np.where(coarse.solved, frozen_y, 1.0)
        gathered = weighted(
            down.interpolated.T, self.residual(values, sigma, source), across.interpolated.T, self.solved
        )
        wanted = gathered - coarse.residual(begin, frozen, 0.0)
        moved = coarse.cycle(begin, frozen, wanted) - begin
        correction = weighted(down.interpolated, moved, across.interpolated, coarse.kinds != ABSENT)
        return np.where(self.solved, values + correction, values)

    def cycle(self, values: Array, sigma: tuple[Array, Array], source: Array | float) -> Array:
        if self.coarse is None:
            return self.relax(values, sigma, source, COARSEST_ITERATIONS)
        values = self.correct(self.relax(values, sigma, source), sigma, source)
        return self.relax(values, sigma, source)

    def started(self) -> Array:
        """Values of the coarser levels, for the finest one."""
        if self.coarse is None:
            above = self.highest + 2.0 * max(self.dx, self.dy) * max(self.kinds.shape)
            return np.where(self.solved, above, self.values)
        coarse = self.coarse
        values = coarse.started()
        if coarse.coarse is None:
            values = coarse.relax(values, coarse.own, 0.0, FIRST_ITERATIONS)
        else:
            for _ in range(FIRST_CYCLES):
                values = coarse.cycle(values, coarse.own, 0.0)
        fine = weighted(self.down.interpolated, values, self.across.interpolated, coarse.kinds != ABSENT)
        return np.where(self.solved, fine, self.values)


def grids(device: ps.Device, given: Problem, precision: str) -> tuple[Multigrid, Part]:
    found = Hierarchy.of(given)
    assert found
    image = given.kernel_arguments
    made = Multigrid(device, image, found.levels, part=found.part, model=given.kernels, precision=precision)
    return made, found.part


@pytest.mark.quick_where(holds=lambda given: given["precision"] == "float64" or given["name"].startswith("larger"))
@pytest.mark.parametrize("name", CASES)
def test_cycles_are_those_of_numpy(device: ps.Device, precision: str, name: str) -> None:
    given = problem(**CASES[name])
    one, part = grids(device, given, precision)
    plain, solved = Plain.of(given, part), given.domain.solved[part]
    close = 1e-12 if precision == "float64" else 2e-5
    one.start()
    values = plain.started()
    np.testing.assert_allclose(one.log_depth()[solved], values[solved], rtol=0.0, atol=close)
    for _ in range(2):
        before = values
        values = plain.relax(values, plain.own, 0.0)
        assert one.smooth() == pytest.approx(np.abs(values - before)[solved].max(), rel=1e-9, abs=2.0 * close)
        np.testing.assert_allclose(one.log_depth()[solved], values[solved], rtol=0.0, atol=close)
        corrected = plain.correct(values, plain.own, 0.0)
        values = plain.relax(corrected, plain.own, 0.0)
        change, of_cycle = one.correct()
        assert change == pytest.approx(np.abs(values - corrected)[solved].max(), rel=1e-9, abs=2.0 * close)
        assert of_cycle == pytest.approx(np.abs(values - before)[solved].max(), rel=1e-9, abs=2.0 * close)
        np.testing.assert_allclose(one.log_depth()[solved], values[solved], rtol=0.0, atol=close)
    known = given.domain.known[part]
    np.testing.assert_array_equal(one.log_depth()[known], given.start[part][known].astype(precision))


def test_bits_depend_neither_on_vectors_nor_on_groups(device: ps.Device, monkeypatch: pytest.MonkeyPatch) -> None:
    given = problem(**CASES["larger than what is small"])
    found = []
    for lanes, vectors, group in ((None, 8, 64), (1, 3, 16)):
        with monkeypatch.context() as patch:
            patch.setattr("persfs_cl._cl.multigrid._VECTORS", vectors)
            patch.setattr("persfs_cl._cl.multigrid._GROUP", 4 * group)
            patch.setattr("persfs_cl._cl.multigrid.row_group", lambda _, group=group: group)
            if lanes:
                patch.setattr("persfs_cl._cl.multigrid.lanes", lambda *_: 1)
            one, _ = grids(device, given, "float32")
            one.start()
            changes = one.smooth(), *one.correct()
        found.append((one.log_depth(), changes))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    assert found[0][1] == found[1][1]


@pytest.mark.parametrize("cells", [8, 9, 10, 11, 64, 75])
def test_axes_have_their_ends_in_common_and_interpolate_what_is_linear(cells: int) -> None:
    steps = Steps.of(cells)
    assert steps.cells == coarse_cells(cells) == cells // 2 + 1
    places = np.linspace(0.0, cells - 1.0, steps.cells)
    np.testing.assert_allclose((1.0 - steps.fine_share) * steps.fine + steps.fine_share * (steps.fine + 1), places)
    found = (1.0 - steps.share) * places[steps.coarse] + steps.share * places[steps.coarse + 1]
    np.testing.assert_allclose(found, np.arange(cells))
    nearest = np.abs(places - np.arange(cells)[:, None]).min(axis=1)
    for number in range(steps.cells):
        own = np.arange(steps.nearest[number], steps.nearest[number + 1])
        assert own.size
        np.testing.assert_allclose(np.abs(own - places[number]), nearest[own])
    assert steps.nearest[-1] == cells


@pytest.mark.parametrize("name", CASES)
def test_solved_cells_have_all_their_neighbours_on_every_level(name: str) -> None:
    found = Hierarchy.of(problem(**CASES[name]))
    assert found
    for level in found.levels:
        present = Neighbours.of(level.kinds != ABSENT).all
        assert present[level.kinds == SOLVED].all()


def test_the_hierarchy_is_only_for_what_it_can_solve() -> None:
    given = problem((48, 48))
    assert Hierarchy.of(given)
    flags = given.domain.flags.copy()
    flags[20, 20] |= LACKING
    assert Hierarchy.of(replace(given, domain=replace(given.domain, flags=flags))) is None
    assert Hierarchy.of(problem((8, 90))) is None
