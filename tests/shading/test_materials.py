from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from persfs_cl.arrays import Array
from persfs_cl.errors import InputError
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.oren_nayar import OrenNayar
from persfs_cl.shading.phong import Phong
from persfs_cl.shading.reflectance import Reflectance

ROUGH = [OrenNayar(roughness) for roughness in (0.0, 1e-3, 0.1, 0.3, 0.6, 0.63, 1.0, math.pi / 2)]
SHINY = [
    Phong(),
    Phong(specular=0.0),
    Phong(1.0, 1e-3, 30.0),
    Phong(0.5, 0.5, 1.0),
    Phong(1e-3, 1.0, 1.0),
    Phong(1e-6, 1.0, 1.2),
    Phong(0.5, 0.5, 2000.0),
    Phong(1e-9, 1.0, 50.0),
    Phong(0.3, 2.0, 1e6),
]

every_material = pytest.mark.parametrize("reflectance", [Lambertian(), *ROUGH, *SHINY], ids=repr)
every_rough_one = pytest.mark.parametrize("rough", ROUGH, ids=repr)
every_shiny_one = pytest.mark.parametrize("shiny", SHINY, ids=repr)

ANGLES = np.linspace(0.0, math.pi / 2, 100_001)


def directions(count: int = 2000, *, lit: bool = True) -> tuple[Array, Array]:
    """Unit vectors to light and viewer, in the frame of the normal (0, 0, 1)."""
    light, viewer = np.random.default_rng(1).normal(size=(2, 3, count))
    viewer[2] = np.abs(viewer[2])
    if lit:
        light[2] = np.abs(light[2])
    return light / np.linalg.norm(light, axis=0), viewer / np.linalg.norm(viewer, axis=0)


def shaded(reflectance: Reflectance, light: Array, viewer: Array) -> Array:
    return reflectance.shade(light[2], viewer[2], (light * viewer).sum(axis=0))


@every_material
def test_coaxial_is_shade_where_the_viewer_is_at_the_light(reflectance: Reflectance) -> None:
    cosine = np.cos(ANGLES)
    np.testing.assert_allclose(
        reflectance.shade(cosine, cosine, 1.0), reflectance.coaxial(cosine), rtol=1e-12, atol=1e-15
    )


@every_material
def test_brightness_does_not_depend_on_the_azimuth_of_the_whole(reflectance: Reflectance) -> None:
    light, viewer = directions()
    turn = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    # The cosine between rounds to 1e-16, which a highlight of power m makes m times as large.
    np.testing.assert_allclose(
        shaded(reflectance, turn @ light, turn @ viewer), shaded(reflectance, light, viewer), rtol=1e-8, atol=1e-12
    )


def test_lambertian_limits() -> None:
    light, viewer = directions(lit=False)
    expected = shaded(Lambertian(), light, viewer)
    np.testing.assert_array_equal(expected, light[2])
    np.testing.assert_array_equal(shaded(OrenNayar(0.0), light, viewer), expected)
    np.testing.assert_array_equal(shaded(Phong(1.0, 0.0, 5.0), light, viewer), expected)
    np.testing.assert_allclose(shaded(OrenNayar(1e-5), light, viewer), expected, atol=1e-8)


@every_rough_one
def test_oren_nayar_is_its_formula_in_angles(rough: OrenNayar) -> None:
    light, viewer = directions()
    incident, reflected = np.arccos(light[2]), np.arccos(viewer[2])
    azimuth = np.arctan2(light[1], light[0]) - np.arctan2(viewer[1], viewer[0])
    variance = rough.roughness**2
    direct, rim = 1 - 0.5 * variance / (variance + 0.33), 0.45 * variance / (variance + 0.09)
    steeper, flatter = np.maximum(incident, reflected), np.minimum(incident, reflected)
    expected = np.cos(incident) * (direct + rim * np.maximum(0, np.cos(azimuth)) * np.sin(steeper) * np.tan(flatter))
    np.testing.assert_allclose(shaded(rough, light, viewer), expected, rtol=1e-10, atol=1e-13)


@every_rough_one
def test_oren_nayar_is_reciprocal(rough: OrenNayar) -> None:
    light, viewer = directions()
    np.testing.assert_allclose(
        shaded(rough, light, viewer) / light[2], shaded(rough, viewer, light) / viewer[2], rtol=1e-12
    )


@every_shiny_one
def test_phong_is_its_formula_in_vectors(shiny: Phong) -> None:
    light, viewer = directions()
    mirrored = np.stack([-light[0], -light[1], light[2]])
    cosine = np.maximum((mirrored * viewer).sum(axis=0), 0)
    expected = shiny.diffuse * light[2] + shiny.specular * cosine**shiny.shininess
    np.testing.assert_allclose(shaded(shiny, light, viewer), expected, rtol=1e-8, atol=1e-12)


def test_phong_is_brightest_in_the_mirrored_direction() -> None:
    light = np.array([[0.6], [0.0], [0.8]])
    assert shaded(Phong(0.5, 0.25, 40.0), light, light * [[-1.0], [1.0], [1.0]]) == pytest.approx(0.4 + 0.25)


@every_material
def test_a_light_behind_the_surface_leaves_the_matt_part_below_0(reflectance: Reflectance) -> None:
    light, viewer = directions(lit=False)
    light[2] = -np.abs(light[2])
    matt = {Lambertian: 1.0, OrenNayar: getattr(reflectance, "direct", None), Phong: getattr(reflectance, "diffuse", 0)}
    np.testing.assert_array_equal(shaded(reflectance, light, viewer), matt[type(reflectance)] * light[2])


@every_material
def test_grazing_is_the_limit_and_rounding_does_not_pass_it(reflectance: Reflectance) -> None:
    limit = reflectance.rim if isinstance(reflectance, OrenNayar) else 0.0
    np.testing.assert_allclose(reflectance.coaxial([1e-13, 0.0, -1e-9]), limit, atol=1e-12)
    assert reflectance.coaxial(1 + 1e-9) == reflectance.coaxial(1.0)


@every_material
def test_monotone_tells_whether_it_decreases(reflectance: Reflectance) -> None:
    # The first steps are below rounding where 2 B is next to A.
    steps = np.diff(reflectance.coaxial(np.cos(ANGLES[::50])))
    assert bool((steps < 0).all()) == reflectance.monotone


def test_oren_nayar_is_monotone_up_to_a_roughness() -> None:
    # 2 B = A is 0.4 s² - 0.078 s - 0.0297 = 0 in the variance s.
    limit = math.sqrt(max(np.roots([0.4, -0.078, -0.0297])))
    assert OrenNayar(limit - 1e-9).monotone
    assert not OrenNayar(limit + 1e-9).monotone
    assert limit == pytest.approx(0.62, abs=0.005)


@every_material
def test_brightest_is_the_maximum(reflectance: Reflectance) -> None:
    assert reflectance.coaxial(np.cos(ANGLES)).max() == pytest.approx(reflectance.brightest, rel=1e-9)


def largest_secant_slope(reflectance: Reflectance) -> float:
    """Max |Δ ln c / Δt| over t >= 0: at most the largest slope, by the mean value theorem, and close to it."""
    highlight = 1 / math.sqrt(getattr(reflectance, "shininess", 1.0))
    to_end = np.geomspace(1e-9, 0.7, 20_000)
    angle = np.unique(np.concatenate([np.geomspace(1e-2 * highlight, 1.57, 20_000), math.pi / 4 - to_end]))
    tangent = np.tan(angle)
    brightness = reflectance.coaxial(1 / np.sqrt(1 + tangent**2))
    # Neighbours closer than this differ by rounding only.
    apart = np.diff(tangent) > 1e-10 * tangent[1:]
    return float(np.abs(np.diff(np.log(brightness)) / np.diff(tangent))[apart].max())


@every_material
def test_steepest_log_is_an_upper_bound_and_tight(reflectance: Reflectance) -> None:
    secant = largest_secant_slope(reflectance)
    assert reflectance.steepest_log >= secant * (1 - 1e-5)  # for the rounding of ln c
    assert reflectance.steepest_log <= 1.01 * secant


@pytest.mark.parametrize("shiny", [Phong(0.5, 0.5, 1.0), Phong(1e-3, 1.0, 1.0)], ids=repr)
def test_steepest_log_where_a_highlight_ends_in_a_kink(shiny: Phong) -> None:
    one_sided = 0.5 + 2 * shiny.specular / shiny.diffuse / math.sqrt(2)
    assert shiny.steepest_log == pytest.approx(one_sided, rel=2e-3)


@pytest.mark.parametrize(
    ("make", "keywords", "message"),
    [
        (OrenNayar, {"roughness": -0.1}, "roughness=-0.1 .*radians"),
        (OrenNayar, {"roughness": 30}, "roughness=30"),
        (OrenNayar, {"roughness": math.nan}, "roughness=nan"),
        (OrenNayar, {"roughness": None}, "roughness=None"),
        (Phong, {"diffuse": 0.0}, "diffuse=0.0 .*from 1e-12 to"),
        (Phong, {"diffuse": math.inf}, "diffuse=inf"),
        (Phong, {"specular": -0.1}, "specular=-0.1"),
        (Phong, {"shininess": 0.5}, "shininess=0.5 .*from 1 to"),
        (Phong, {"shininess": math.inf}, "shininess=inf"),
        (Phong, {"shininess": "high"}, "shininess='high'"),
    ],
)
def test_wrong_materials_are_named(make: Any, keywords: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(**keywords)


def test_materials_are_values() -> None:
    assert OrenNayar(1) == OrenNayar(1.0)
    rough = OrenNayar(0.5)
    before = hash(rough)
    assert rough.steepest_log == rough.steepest_log
    assert rough == OrenNayar(0.5)
    assert hash(rough) == before
