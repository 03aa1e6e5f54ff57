"""The kernels of the energy against its plain form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl._cl import energy
from persfs_cl.choices import Precision
from persfs_cl.selftest.energy import PAINTED, PLAIN, derivative, descent_of, rough
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.energy.reference import Reference
from persfs_cl.solver.energy.weights import Weights

Array = NDArray[np.float64]

LIGHTS: dict[str, Light] = {
    "front": ps.ParallelLight(),
    "side": ps.ParallelLight(0.6, -0.3),
    "flash": ps.FlashLight(),
    "even flash": ps.FlashLight(falloff=False),
    "lamp": ps.FlashLight(offset=(0.25, -0.1, 0.05)),
}
MATERIALS: dict[str, Reflectance] = {
    "lambertian": ps.Lambertian(),
    "oren-nayar": ps.OrenNayar(0.4),
    "phong": ps.Phong(0.6, 0.4, 6.0),
}
CASES = [
    *((light, "lambertian", PLAIN) for light in LIGHTS),
    *(("lamp", material, PLAIN) for material in ("oren-nayar", "phong")),
    *(("side", material, PAINTED) for material in MATERIALS),
]


def problem(
    light: str, material: str, weights: Weights, shape: tuple[int, int] = (11, 14), spacing: int = 1
) -> tuple[Reference, Array]:
    """An energy with all of its terms, and a surface."""
    return rough(LIGHTS[light], MATERIALS[material], weights, shape, spacing=spacing)


# In double precision by the kernels that the tests of directions, below, have too.
@pytest.mark.quick_where(
    holds=lambda given: (
        given["precision"] == "float32"
        or (given["material"], given["weights"]) in (("phong", PLAIN), ("phong", PAINTED), ("lambertian", PLAIN))
    )
)
@pytest.mark.parametrize(("light", "material", "weights"), CASES)
def test_energy_and_gradient(
    device: ps.Device, precision: Precision, light: str, material: str, weights: Weights
) -> None:
    reference, log_depth = problem(light, material, weights)
    white = 0.1 if weights.painted else 0.0
    descent = descent_of(reference, log_depth, device, precision)
    tolerance = 1e-9 if precision == "float64" else 3e-5
    assert descent.linearise(white).energy == pytest.approx(reference.energy(log_depth, white), rel=tolerance)
    descent.assemble(0.0)
    gradient = -descent.read("remainder")[0]
    assert not gradient[~reference.view.solved].any()
    rng = np.random.default_rng(3)
    for _ in range(4):
        direction = np.where(reference.view.solved, rng.normal(size=log_depth.shape), 0.0)
        expected = derivative(reference, log_depth, direction, white)
        size = float(np.abs(gradient).sum())
        assert float((gradient * direction).sum()) == pytest.approx(expected, abs=1e-5 * size)


def jacobian(reference: Reference, log_depth: Array) -> Array:
    """Of all residuals times the roots of their weights, by the pixels to solve."""
    free = np.flatnonzero(reference.view.solved)
    weights, certainty = reference.weights, reference.view.certainty

    def parts(values: Array) -> list[Array]:
        prior = values * certainty
        return [reference.residuals(values), prior, *(bend for _, bend in reference.bends(values))]

    here = parts(log_depth)
    off = (log_depth - np.where(certainty > 0.0, reference.view.prior, 0.0)) * certainty
    factors = [
        weights.weight / (1.0 + (here[0] / weights.scale) ** 2),
        weights.prior_weight / np.sqrt(1.0 + (off / weights.prior_scale) ** 2),
        *(
            share * weights.smoothness / np.sqrt(1.0 + (bend / weights.crease) ** 2)
            for share, bend in reference.bends(log_depth)
        ),
    ]
    columns = []
    for pixel in free:
        nudge = np.where(np.arange(log_depth.size) == pixel, 1e-5, 0.0).reshape(log_depth.shape)
        ahead, behind = parts(log_depth + nudge), parts(log_depth - nudge)
        columns.append(
            np.concatenate(
                [
                    (np.sqrt(factor) * (a - b) / 2e-5).ravel()
                    for factor, a, b in zip(factors, ahead, behind, strict=True)
                ]
            )
        )
    return np.stack(columns, axis=1)


def dense(planes: Array) -> Array:
    """The matrix of all pixels, from the planes that hold one number of each pair."""
    _, height, width = planes.shape
    numbers = np.arange(height * width).reshape(height, width)
    matrix = np.zeros((numbers.size, numbers.size))
    steps = ((0, 0), (0, 1), (0, 2), (1, 0), (2, 0), (1, 1), (1, -1))
    for plane, (down, right) in zip(planes, steps, strict=True):
        for row in range(height - down):
            for column in range(max(0, -right), min(width, width - right)):
                one, other = numbers[row, column], numbers[row + down, column + right]
                matrix[one, other] = matrix[other, one] = plane[row, column]
    return matrix


@pytest.mark.parametrize(("light", "material", "weights"), CASES[2:5])
def test_matrix_and_step(device: ps.Device, precision: Precision, light: str, material: str, weights: Weights) -> None:
    reference, log_depth = problem(light, material, weights, (9, 8))
    descent = descent_of(reference, log_depth, device, precision)
    descent.linearise(0.0)
    descent.assemble(0.0)
    free = reference.view.solved.ravel()
    found = dense(descent.read("matrix").astype(np.float64))[np.ix_(free, free)]
    derivatives = jacobian(reference, log_depth)
    expected = derivatives.T @ derivatives
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())
    right_hand_side = descent.read("remainder")[0].ravel()[free].astype(np.float64)
    descent.solve(300, 1e-6)
    step = descent.read("step")[0]
    np.testing.assert_allclose(
        step.ravel()[free], np.linalg.solve(found.astype(np.float64), right_hand_side), atol=1e-3 * np.abs(step).max()
    )
    assert not step[~reference.view.solved].any()


def test_grids_in_one_launch_have_the_bits_of_launches_of_their_own(
    device: ps.Device, monkeypatch: pytest.MonkeyPatch
) -> None:
    reference, log_depth = problem("front", "lambertian", PLAIN, (40, 55))
    steps = []
    for small in (0, 12**2, 10**6):
        monkeypatch.setattr(energy, "_SMALL", small)
        descent = descent_of(reference, log_depth, device, "float32")
        descent.linearise(0.0)
        descent.assemble(1e-3)
        descent.solve(5, 1e-6)
        steps.append(descent.read("step"))
    assert np.abs(steps[0]).max() > 0.0
    np.testing.assert_array_equal(steps[0], steps[1])
    np.testing.assert_array_equal(steps[0], steps[2])


@pytest.mark.thorough
@pytest.mark.parametrize(("light", "material"), [("front", "lambertian"), ("lamp", "phong")])
def test_devices_without_vectors_find_the_same(
    device: ps.Device, light: str, material: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Many work-items do a row, each a pixel at a time, as on a GPU."""
    reference, log_depth = problem(light, material, PLAIN, (23, 70))
    found = []
    for narrow in (False, True):
        if narrow:
            monkeypatch.setattr(energy, "lanes", lambda *_: 1)
        descent = descent_of(reference, log_depth, device, "float32")
        sums = descent.linearise(0.0)
        descent.assemble(1e-3)
        descent.solve(8, 1e-3)
        descent.turn(afresh=True)
        change = descent.move()
        found.append((sums.energy, change, descent.log_depth()))
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-6)
    assert found[1][1] == pytest.approx(found[0][1], rel=1e-3)
    np.testing.assert_allclose(found[1][2], found[0][2], atol=1e-4 * found[0][1])


@pytest.mark.parametrize("weights", [PLAIN, PAINTED], ids=["plain", "painted"])
def test_directions_go_on_and_tell_their_slope(device: ps.Device, precision: Precision, weights: Weights) -> None:
    reference, log_depth = problem("lamp", "phong", weights)
    descent = descent_of(reference, log_depth, device, precision)
    before = np.zeros_like(log_depth)
    for turn in range(3):
        here = descent.log_depth().astype(np.float64)
        descent.linearise(0.0)
        descent.assemble(1e-3)
        descent.solve(3, 0.1)
        slope = descent.turn(afresh=turn == 0)
        course, step = descent.read("course")[0].astype(np.float64), descent.read("step")[0].astype(np.float64)
        assert slope > 0.0
        assert slope == pytest.approx(-derivative(reference, here, course, 0.0), rel=2e-3)
        apart = np.abs(course - step).max()
        if turn == 0:
            assert apart == 0.0
        elif turn == 1:
            share = ((course - step) * before).sum() / (before**2).sum()
            np.testing.assert_allclose(course - step, share * before, atol=1e-4 * np.abs(course).max())
        before = course
        descent.move(0.3)
    descent.go_back()
    np.testing.assert_array_equal(descent.log_depth(), here.astype(descent.log_depth().dtype))
