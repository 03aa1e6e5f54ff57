"""What the project claims of its accuracy: the experiments of 'persfs-cl bench', held to it."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Iterator

import pytest

from persfs_cl import Device
from persfs_cl.bench import accuracy
from persfs_cl.bench.accuracy import (
    AMBIGUOUS,
    ERROR,
    ERROR_SCALED,
    GREY_ERROR,
    MATT,
    SCENES,
    SURFACES,
    UNDER_FLASH,
    refined,
    taken,
)
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record

BUMPS = [scene for scene in SCENES if scene.startswith("bump")]


def values(records: Iterable[Record]) -> list[float]:
    """All of them of runs that converged."""
    medians = []
    for record in records:
        assert record.detail.endswith(", converged")
        assert record.median is not None
        medians.append(record.median)
    return medians


@pytest.mark.parametrize(("scene", "most"), [*[(scene, 0.0005) for scene in BUMPS], ("hill, flash", 0.0010)])
def test_upwind_is_of_first_order_in_a_few_iterations(device: Device, scene: str, most: float) -> None:
    records = refined(Plan(device), scene, "upwind", (51, 101, 201, 401))
    *_, error, order = values(records)
    assert error <= most
    assert order >= 0.9
    assert max(record.iteration or 0 for record in records) <= 6


@pytest.mark.parametrize("scene", SCENES)
def test_second_order_is_of_second_order(device: Device, scene: str) -> None:
    *_, error, order = values(refined(Plan(device), scene, "second order", (51, 101, 201)))
    assert order >= 1.8
    # From there to 401 pixels at that order.
    assert error * (201 / 401) ** 1.8 <= 0.00001


def test_mean_error_of_second_order_at_401_pixels(device: Device) -> None:
    assert values(refined(Plan(device), BUMPS[0], "second order", (401,)))[0] <= 0.00001


@functools.cache
def noise(device: Device) -> dict[tuple[str, str], float]:
    records = [record for group in accuracy.noise(Plan(device, repeats=1)) for record in group]
    return dict(zip([(record.workload, record.quantity) for record in records], values(records), strict=True))


def test_a_scanned_object_is_found_from_its_photograph(device: Device) -> None:
    assert noise(device)["bunny, 8 bits", ERROR_SCALED] <= 0.5
    assert noise(device)["bunny, 8 bits, 2 % noise", ERROR_SCALED] <= 2.0


def test_a_smooth_hill_is_found_from_its_photograph(device: Device) -> None:
    assert noise(device)["hill, 8 bits", ERROR] <= 0.1
    assert noise(device)["hill, 8 bits, 2 % noise", ERROR_SCALED] <= 2.0


def of_materials(experiment: Callable[[Plan], Iterator[list[Record]]], device: Device, kind: str) -> dict[str, float]:
    """Errors of one kind by what was measured."""
    groups = experiment(Plan(device, sizes=(101,)))
    records = [record for group in groups for record in group if record.quantity == kind]
    return dict(zip([record.workload for record in records], values(records), strict=True))


@functools.cache
def errors_under_parallel_lights(device: Device) -> dict[str, float]:
    return of_materials(accuracy.under_parallel, device, ERROR)


@pytest.mark.thorough
def test_materials_under_a_flash_are_found_and_wrong_ones_seen(device: Device) -> None:
    # After one scale, which the depth of another material has not.
    errors = of_materials(accuracy.under_flash, device, ERROR_SCALED)
    for true in UNDER_FLASH:
        right = errors[taken("flash", true, true)]
        assert right <= 0.4
        for other in UNDER_FLASH:
            assert other == true or errors[taken("flash", true, other)] >= 20.0 * right


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("material", "light", "factor"),
    [
        *[("Phong", f"{light}, {surface}", 20.0) for light in ("frontal", "oblique") for surface in SURFACES],
        *[("Oren-Nayar 0.3", light, 2.0) for light in ("frontal, away", "oblique, away", "oblique, toward")],
    ],
)
def test_materials_under_a_parallel_light_are_found_better_than_lambertian(
    device: Device, material: str, light: str, factor: float
) -> None:
    right, matt, wrong = (
        errors_under_parallel_lights(device)[taken(light, *names)]
        for names in ((material, material), (MATT, MATT), (material, MATT))
    )
    assert right <= matt
    assert wrong >= factor * right


@pytest.mark.thorough
def test_a_rough_hill_and_another_surface_have_the_same_photograph(device: Device) -> None:
    """Under refinement the grey error goes down as fast as where depth is found, and the depth stays where it is."""
    records = [record for group in accuracy.ambiguity(Plan(device, sizes=(101, 201))) for record in group]
    found = dict(
        zip([(record.workload, record.quantity, record.size) for record in records], values(records), strict=True)
    )
    for material in (MATT, AMBIGUOUS):
        assert found[material, GREY_ERROR, 201] <= 0.65 * found[material, GREY_ERROR, 101]
    assert found[MATT, ERROR, 201] <= 0.8 * found[MATT, ERROR, 101]
    assert found[AMBIGUOUS, ERROR, 201] >= 15.0


def test_a_lamp_beside_the_camera_costs_no_exactness_by_upwind(device: Device) -> None:
    records = [record for group in accuracy.lamp(Plan(device, sizes=(61,))) for record in group]
    assert [record.workload for record in records] == [
        accuracy.workload(accuracy.lamp_name(aside), scheme)
        for aside in accuracy.LAMP_ASIDE
        for scheme in accuracy.LAMP_SCHEMES
    ]
    by_upwind, in_rounds = records[::2], records[1::2]
    assert {record.detail for record in by_upwind} == {"upwind, converged"}
    assert max(values(by_upwind)) < 0.6
    assert in_rounds[-1].detail == "lax-friedrichs, not converged"
