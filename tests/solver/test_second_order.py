"""The correction to second order: its orderings, its invariances, and where it must do no harm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl._cl.registers import lanes

# In double precision kernels of second order are tested one by one.
in_single_precision = pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32")


def bump(size: int, light: ps.ParallelLight, surface: str) -> ps.Scene:
    return ps.bump((size, size), light=light, surface=surface)  # type: ignore[arg-type]


def hillside(size: int) -> ps.Scene:
    return ps.hillside((size, size), light=ps.FlashLight(), surface="toward")


def solved(scene: ps.Scene, device: ps.Device, **keywords: object) -> ps.Solution:
    if isinstance(scene.light, ps.ParallelLight):
        keywords = {"known_depth": scene.known_depth, "surface": scene.surface, "scheme": "upwind", **keywords}
    options: dict[str, object] = {"accuracy_order": 2, "tolerance": 1e-6, "device": device, "throw": True, **keywords}
    return ps.reconstruct(scene.image, scene.camera, light=scene.light, **options)  # type: ignore[arg-type]


@in_single_precision
@pytest.mark.parametrize("flash", [False, True], ids=["parallel", "flash"])
def test_wavefront_gives_the_bits_of_lexicographic(device: ps.Device, precision: str, flash: bool) -> None:
    scene = hillside(61) if flash else bump(61, ps.ParallelLight(0.2, -0.1), "toward")
    one, other = (
        solved(scene, device, ordering=ordering, precision=precision) for ordering in ("lexicographic", "wavefront")
    )
    if lanes(device, precision) > 1:
        assert other.parameters["sweep"] == "wavefront_images"
    np.testing.assert_array_equal(one.log_depth, other.log_depth)
    np.testing.assert_array_equal(one.changes, other.changes)


@in_single_precision
def test_three_colours_reach_the_same_surface(device: ps.Device, precision: str) -> None:
    scene = hillside(51)
    one, other = (
        solved(scene, device, ordering=ordering, tolerance=1e-7, precision=precision)
        for ordering in ("wavefront", "checkerboard")
    )
    assert other.parameters["sweep"] == "three_colours"
    apart = np.abs(one.depth / other.depth - 1.0)
    if precision == "float64":
        assert apart.max() <= 1e-9
    else:
        # Which pixels look smooth enough may depend on rounding, here at a corner, which reaches as far as it is seen.
        assert np.median(apart) <= 1e-4
        assert np.quantile(apart, 0.8) <= 1e-3
        assert apart.max() <= 1e-2


def test_a_silhouette_is_left_no_worse(device: ps.Device) -> None:
    scene = ps.vase()
    first, second = (solved(scene, device, mask=scene.mask, accuracy_order=order, tolerance=1e-5) for order in (1, 2))
    assert ps.compare(second.depth, scene.depth).mean <= ps.compare(first.depth, scene.depth).mean
    assert second.iterations > first.iterations
    np.testing.assert_array_equal(second.changes[: first.iterations], first.changes)


def test_mirrored_and_transposed_images_give_such_surfaces(device: ps.Device) -> None:
    scene = hillside(51)
    plain = solved(scene, device).depth
    turned: list[Callable[[NDArray[np.float64]], NDArray[np.float64]]] = [np.fliplr, np.flipud, np.transpose]
    for turn in turned:
        image = np.ascontiguousarray(turn(scene.image))
        depth = ps.reconstruct(
            image, scene.camera, light=scene.light, accuracy_order=2, tolerance=1e-6, device=device
        ).depth
        np.testing.assert_allclose(depth, turn(plain), rtol=1e-5)


def test_images_of_a_batch_are_corrected_each_for_itself(device: ps.Device) -> None:
    scene = hillside(41)
    images = [scene.image, 0.7 * scene.image]
    keywords = {"light": scene.light, "accuracy_order": 2, "device": device}
    together = ps.reconstruct_batch(images, scene.camera, **keywords)  # type: ignore[arg-type]
    for image, solution in zip(images, together, strict=True):
        alone = ps.reconstruct(image, scene.camera, **keywords)  # type: ignore[arg-type]
        np.testing.assert_array_equal(solution.depth, alone.depth)
        assert solution.iterations == alone.iterations


def test_a_tolerance_below_rounding_costs_no_order(device: ps.Device) -> None:
    """Corrected values go up and down by rounding in the end, by more than such a tolerance."""
    scene = hillside(160)
    as_usual, tight = (solved(scene, device, tolerance=tolerance) for tolerance in (1e-5, 1e-8))
    assert np.abs(tight.log_depth - as_usual.log_depth).max() < 1e-5


def test_a_run_ended_at_first_order_is_not_corrected(device: ps.Device) -> None:
    scene = hillside(41)
    keywords = {"light": scene.light, "device": device, "max_iterations": 1}
    first, second = (
        ps.reconstruct(scene.image, scene.camera, accuracy_order=order, **keywords)  # type: ignore[arg-type]
        for order in (1, 2)
    )
    assert second.status is ps.Status.MAX_ITERATIONS
    np.testing.assert_array_equal(first.depth, second.depth)


def test_lax_friedrichs_has_no_second_order() -> None:
    scene = bump(21, ps.ParallelLight(), "away")
    with pytest.raises(ps.InputError, match="only the upwind scheme"):
        ps.reconstruct(
            scene.image, scene.camera, known_depth=scene.known_depth, scheme="lax-friedrichs", accuracy_order=2
        )
