"""Models beyond the paper's, from photograph to surface: lights, materials and albedo against exact scenes."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl import blocks
from persfs_cl.choices import Precision
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import DARKEST, Extremes
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.surface.geometry import log_depth_gradient

EVEN_FLASH = ps.FlashLight(falloff=False, gain=2.5)
MATERIALS = [ps.Lambertian(), ps.OrenNayar(0.4), ps.Phong()]
SCHEMES = ("upwind", "lax-friedrichs")

each_material = pytest.mark.parametrize("material", MATERIALS, ids=lambda material: type(material).__name__)


def materials_in_turn(parameters: Mapping[str, Any]) -> bool:
    """Whether a test is a quick one: shiny materials in double precision, others in single."""
    return bool((parameters["precision"] == "float64") == isinstance(parameters["material"], ps.Phong))


materials_take_turns = pytest.mark.quick_where(holds=materials_in_turn)


def solve(scene: Scene, **keywords: Any) -> ps.Solution:
    given: dict[str, Any] = {"light": scene.light, "reflectance": scene.reflectance, "surface": scene.surface}
    if isinstance(scene.light, ps.ParallelLight):
        given["scheme"] = "lax-friedrichs"
    return ps.reconstruct(scene.image, scene.camera, **{**given, "known_depth": scene.known_depth, **keywords})


def exact(scene: Scene, **keywords: Any) -> float:
    """Mean error of depth in the limit of the iteration, by what compiles fastest, unless an ordering is given."""
    settings = {"tolerance": 1e-8, "precision": "float64", "max_iterations": 4000, "ordering": "lexicographic"}
    solution = solve(scene, **{**settings, **keywords})
    assert solution.status is ps.Status.CONVERGED
    return ps.compare(solution.depth, scene.depth).mean


def nearest_known(scene: Scene) -> Scene:
    """The scene with only the point nearest to the camera known, from which the surface goes away."""
    grid = scene.camera.grid(scene.image.shape)
    distance = scene.depth * np.sqrt(1.0 + grid.x**2 + grid.y**2)
    known = np.where(distance <= distance.min() * (1.0 + 1e-12), scene.depth, np.nan)
    return replace(scene, known_depth=known, surface="away")


class TestAlbedo:
    """A painted surface: the image is divided by the paint."""

    LIGHTS = (ps.ParallelLight(0.1, 0.0), ps.FlashLight(gain=3.0), EVEN_FLASH)

    @staticmethod
    def painted(light: ps.ParallelLight | ps.FlashLight) -> tuple[Scene, np.ndarray]:
        scene = ps.hillside(shape=(30, 34), surface="toward", light=light)
        # Powers of two, so that dividing gives back the image of the white surface exactly.
        paint = np.random.default_rng(1).choice([0.25, 0.5, 1.0], scene.image.shape)
        return replace(scene, image=scene.image * paint), paint

    @pytest.mark.parametrize("light", LIGHTS, ids=str)
    def test_the_surface_is_that_of_the_unpainted_one(self, light: ps.ParallelLight | ps.FlashLight) -> None:
        scene, paint = self.painted(light)
        keywords: dict[str, Any] = {} if light == self.LIGHTS[1] else {"known_depth": scene.known_depth}
        keywords["surface"] = "away" if light == self.LIGHTS[1] else "toward"
        keywords["light"] = light
        plain = ps.reconstruct(scene.image / paint, scene.camera, **keywords)
        solution = ps.reconstruct(scene.image, scene.camera, albedo=paint, **keywords)
        np.testing.assert_array_equal(solution.depth, plain.depth)
        np.testing.assert_array_equal(solution.image, scene.image)
        np.testing.assert_allclose(solution.render(), plain.render() * paint)
        assert solution.residual().mean < plain.residual().mean

    def test_each_image_of_a_batch_has_its_own(self) -> None:
        scene, paint = self.painted(self.LIGHTS[0])
        keywords: dict[str, Any] = {"light": scene.light, "surface": "toward"}
        batch = ps.reconstruct_batch(
            [scene.image, scene.image / paint],
            scene.camera,
            albedo=[paint, None],
            known_depth=[scene.known_depth] * 2,
            **keywords,
        )
        np.testing.assert_array_equal(batch[0].depth, batch[1].depth)
        assert batch[1].albedo is None

    def test_outside_the_surface_it_may_be_anything(self) -> None:
        scene, paint = self.painted(self.LIGHTS[1])
        mask = np.ones(scene.image.shape, bool)
        mask[4:9, 7:12] = False
        unknown = np.where(mask, paint, np.nan)
        one, other = (
            ps.reconstruct(scene.image, scene.camera, light=scene.light, mask=mask, albedo=albedo)
            for albedo in (paint, unknown)
        )
        np.testing.assert_array_equal(one.depth, other.depth)
        np.testing.assert_array_equal(one.render(), other.render())

    @pytest.mark.parametrize(
        ("albedo", "message"),
        [
            (np.ones((2, 2)), "of shape"),
            (np.ones((30, 34), int), "is int"),
            ("paint.png", "read_light"),
            (np.full((30, 34), 1.5), "at 1020 pixels"),
            (np.full((30, 34), 0.0), "mask out what is black"),
            (np.full((30, 34), np.nan), "is not in"),
        ],
    )
    def test_bad_ones_are_refused(self, albedo: Any, message: str) -> None:
        scene = ps.hillside(shape=(30, 34))
        with pytest.raises(ps.InputError, match=message):
            ps.reconstruct(scene.image, scene.camera, albedo=albedo)
        with pytest.raises(ps.InputError, match=message):
            ps.render(scene.depth, scene.camera, albedo=albedo)
        with pytest.raises(ps.InputError, match="albedo has 2 entries for 1 images"):
            ps.reconstruct_batch([scene.image], scene.camera, albedo=[None, None])

    def test_an_image_too_bright_for_its_albedo_is_named(self) -> None:
        scene = ps.hillside(shape=(30, 34))
        with pytest.raises(ps.InputError, match="image / albedo ranges from"):
            ps.reconstruct(scene.image, scene.camera, albedo=np.full((30, 34), 0.5))


class TestExtremes:
    """The darkest and the brightest of the pixels to solve, by one thread and by several."""

    @pytest.fixture(autouse=True, params=[1, 4])
    def _cores(self, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(blocks, "_PIXELS", 2**12)
        monkeypatch.setattr(blocks, "usable_cores", lambda: request.param)

    @pytest.mark.parametrize("shape", [(1, 5), (300, 700)])
    @pytest.mark.parametrize("share", [0.001, 0.5, 1.0])
    def test_others_may_hold_anything(self, shape: tuple[int, int], share: float) -> None:
        random = np.random.default_rng(3)
        image, solved = random.normal(size=shape), random.random(shape) < share
        solved.flat[0] = True
        image[~solved] = random.choice([np.nan, -1e90, 1e90, 0.0], np.count_nonzero(~solved))
        assert Extremes.of(image, solved) == Extremes(image[solved].min(), image[solved].max())

    @pytest.mark.parametrize("place", [0, 100_000, -1])
    def test_what_is_no_number_is_both(self, place: int) -> None:
        image = np.ones((300, 700))
        image.flat[place] = np.nan
        found = Extremes.of(image, np.ones(image.shape, bool))
        assert np.isnan([found.darkest, found.brightest]).all()


class TestWhereTheSlopeIsNotBounded:
    """Eq. (7) is coercive where E is above a number of the pixel's own."""

    @pytest.mark.parametrize("light", [ps.ParallelLight(), ps.ParallelLight(0.4, -0.3), ps.ParallelLight(-3.0, 8.0)])
    @pytest.mark.parametrize("shape", [(1, 40), (70, 33), (150, 260)])
    def test_blocks_decide_as_their_pixels(self, light: ps.ParallelLight, shape: tuple[int, int]) -> None:
        random = np.random.default_rng(shape[0])
        grid = ps.Camera(0.7 * shape[1], principal_point=(0.3 * shape[1], 0.8 * shape[0])).grid(shape)
        rows, columns = np.indices(shape)
        offset = grid.x - light.p0, grid.y - light.q0
        square = offset[0] ** 2 + offset[1] ** 2
        along = (grid.x * offset[0] + grid.y * offset[1]) ** 2 / (1.0 + grid.x**2 + grid.y**2)
        for image in (
            random.random(shape),
            0.5 + 0.5 * np.sin(rows / 31.0) * np.cos(columns / 17.0),
            np.full(shape, 0.05),
            np.sqrt(square - along) / light.norm * (1.0 + 1e-3 * random.normal(size=shape)),
        ):
            solved = random.random(shape) < 0.9
            image[~solved] = random.choice([np.nan, -1e90, 1e90], np.count_nonzero(~solved))
            model = light.model(ps.Lambertian())
            found = model.degenerate(image, image, solved, grid, Extremes.of(image, solved))
            np.testing.assert_array_equal(found, solved & ((light.norm * image) ** 2 <= square - along))


class TestFlashWithoutFalloff:
    """A photograph that was corrected for the fall-off of its flash: angles only."""

    @each_material
    def test_the_angle_is_found_from_the_brightness(self, material: Reflectance) -> None:
        cosine = np.concatenate([np.linspace(0.0, 1.0, 1001), 1.0 - np.geomspace(1e-9, 1e-3, 50)])
        model, image = EVEN_FLASH.model(material), 2.5 * material.coaxial(cosine)
        found = model.shading(image, Extremes(image.min(), image.max()))
        np.testing.assert_allclose(found, cosine, atol=1e-8)
        grazing = float(2.5 * material.coaxial(0.0))
        darker = model.shading(np.array([grazing - 0.01, 2.0]), Extremes(grazing - 0.01, 2.0))
        assert 0.0 < darker[0] <= DARKEST

    @materials_take_turns
    @each_material
    def test_render_is_the_formula(self, device: ps.Device, precision: Precision, material: Reflectance) -> None:
        scene = ps.bumps(shape=(37, 53))
        depth = 7.0 * scene.depth
        depth[5:9, 11:20] = np.nan
        p, q = log_depth_gradient(depth, scene.camera)
        grid = scene.camera.grid(depth.shape)
        expected = np.where(
            np.isnan(depth), np.nan, EVEN_FLASH.brightness(np.log(depth), p, q, grid.x, grid.y, material)
        )
        image = ps.render(
            depth, scene.camera, light=EVEN_FLASH, reflectance=material, device=device, precision=precision
        )
        np.testing.assert_allclose(image, expected, atol=2e-4 if precision == "float32" else 1e-12)

    @pytest.mark.quick_where(holds=lambda given: given["material"] != ps.OrenNayar(0.4) or given["scheme"] == "upwind")
    @pytest.mark.quick_where(holds=lambda given: given["material"] != ps.Phong() or given["scheme"] == "lax-friedrichs")
    @pytest.mark.parametrize("scheme", SCHEMES)
    @each_material
    def test_a_hill_comes_towards_the_camera_from_its_frame(self, material: Reflectance, scheme: str) -> None:
        coarse, fine = (
            exact(
                ps.hillside(shape=(size, size), light=EVEN_FLASH, reflectance=material, surface="toward"),
                scheme=scheme,
            )
            for size in (30, 90)
        )
        assert fine < 0.45 * coarse
        assert fine < (0.0007 if scheme == "upwind" else 0.003)

    @pytest.mark.parametrize("scheme", SCHEMES)
    def test_a_hill_goes_away_from_its_nearest_point(self, scheme: str) -> None:
        coarse, fine = (
            exact(nearest_known(ps.bump(shape=(size, size), light=EVEN_FLASH, surface="toward")), scheme=scheme)
            for size in (30, 90)
        )
        assert fine < 0.6 * coarse
        assert fine < (0.008 if scheme == "upwind" else 0.032)

    def test_second_order_differences_are_of_second_order(self) -> None:
        errors = [
            exact(ps.bump(shape=(size, size), light=EVEN_FLASH, surface="toward", focal_length=2.0 * size), **more)
            for size, more in ((60, {}), (30, {"accuracy_order": 2}), (60, {"accuracy_order": 2}))
        ]
        assert errors[2] < 0.35 * errors[1]
        assert errors[2] < 0.2 * errors[0]

    def test_the_wrong_material_is_seen(self) -> None:
        scene = ps.hillside(shape=(60, 60), light=EVEN_FLASH, reflectance=ps.OrenNayar(0.5), surface="toward")
        assert exact(scene, reflectance=ps.Lambertian()) > 10.0 * exact(scene)

    def test_a_sphere_around_the_camera_is_as_bright_everywhere(self) -> None:
        """Flat brightness, but for one pixel: the depth follows the sphere exactly."""
        camera = ps.Camera(20.0)
        grid = camera.grid((24, 31))
        depth = 3.0 / np.sqrt(1.0 + grid.x**2 + grid.y**2)
        image = np.full((24, 31), 1.0)
        image[0, 0] = 0.99
        known = np.full((24, 31), np.nan)
        known[12, 15] = depth[12, 15]
        keywords: dict[str, Any] = {"known_depth": known, "precision": "float64", "ordering": "lexicographic"}
        solution = ps.reconstruct(image, camera, light=ps.FlashLight(falloff=False), **keywords)
        assert solution.status is ps.Status.CONVERGED
        np.testing.assert_allclose(solution.depth[2:, 2:], depth[2:, 2:], rtol=1e-12)

    # By the other scheme hills are found in double precision, cell by cell, and the orderings agree under other lights.
    @pytest.mark.quick_where(holds=lambda given: (given["precision"], given["scheme"]) == ("float32", "upwind"))
    @pytest.mark.parametrize("scheme", SCHEMES)
    def test_the_orderings_agree(self, device: ps.Device, precision: str, scheme: str) -> None:
        scene = ps.hillside(shape=(37, 50), light=EVEN_FLASH, surface="toward", noise=0.02)
        mask = np.random.default_rng(3).uniform(size=scene.image.shape) > 0.05
        image = np.minimum(scene.image, 2.5)
        keywords: dict[str, Any] = {"scheme": scheme, "mask": mask, "device": device, "precision": precision}
        keywords |= {"light": EVEN_FLASH, "known_depth": scene.known_depth, "surface": "toward", "tolerance": 1e-6}
        depths = [
            ps.reconstruct(image, scene.camera, ordering=ordering, **keywords).depth
            for ordering in ("lexicographic", "wavefront", "checkerboard")
        ]
        np.testing.assert_array_equal(depths[0], depths[1])
        np.testing.assert_allclose(depths[2], depths[0], rtol=1e-4)

    def test_black_pixels_are_reported(self) -> None:
        scene = ps.hillside(shape=(30, 30), light=EVEN_FLASH, reflectance=ps.OrenNayar(0.5), surface="toward")
        image = scene.image.copy()
        # Less than such a material returns at grazing.
        image[12, 14] = 0.1
        solution = solve(replace(scene, image=image), ordering="lexicographic", precision="float64")
        assert np.argwhere(solution.clamped).tolist() == [[12, 14]]

    @pytest.mark.parametrize(
        ("keywords", "message"),
        [
            ({"known_depth": None}, "known_depth is not given, but .* slopes only"),
            ({"reflectance": ps.OrenNayar(1.0)}, "belongs to two angles"),
            ({"light": ps.FlashLight(falloff=False, gain=2.0)}, "gives at most 2"),
            ({"reflectance": ps.OrenNayar(0.5)}, "give the gain"),
            ({"light": ps.FlashLight(falloff=False, offset=(0.1, 0, 0))}, "at the camera"),
        ],
    )
    def test_what_makes_no_sense_is_refused(self, keywords: dict[str, Any], message: str) -> None:
        scene = ps.hillside(shape=(30, 30), light=EVEN_FLASH, surface="toward")
        with pytest.raises(ps.InputError, match=message):
            solve(scene, **keywords)


class TestMaterialsUnderAParallelLight:
    """Rough and shiny materials by the Lax-Friedrichs scheme."""

    OBLIQUE = ps.ParallelLight(0.2, -0.1)
    OTHERS = (ps.OrenNayar(0.3), ps.OrenNayar(0.9), ps.Phong(), ps.Phong(0.5, 0.6, 40.0), ps.Phong(1.0, 0.0, 1.0))

    @pytest.mark.parametrize("light", [ps.ParallelLight(), OBLIQUE, ps.ParallelLight(-1.5, 2.5)], ids=str)
    @materials_take_turns
    @pytest.mark.parametrize("material", OTHERS, ids=str)
    def test_render_is_the_formula(
        self, device: ps.Device, precision: Precision, material: Reflectance, light: ps.ParallelLight
    ) -> None:
        depth = np.exp(np.random.default_rng(3).uniform(-0.02, 0.02, (30, 41)))
        camera = ps.Camera(15.0)
        p, q = log_depth_gradient(depth, camera)
        grid = camera.grid(depth.shape)
        expected = light.brightness(np.log(depth), p, q, grid.x, grid.y, material)
        image = ps.render(depth, camera, light=light, reflectance=material, device=device, precision=precision)
        np.testing.assert_allclose(image, expected, atol=1e-4 if precision == "float32" else 1e-12)
        assert (expected > 0.3).any()
        assert (light.norm < 2.0) or (expected < 0.0).any()

    @pytest.mark.parametrize("light", [ps.ParallelLight(), OBLIQUE, ps.ParallelLight(0.5, 1.0)], ids=str)
    @pytest.mark.parametrize("material", OTHERS, ids=str)
    def test_viscosity_bounds_the_slope_of_the_hamiltonian(
        self, material: Reflectance, light: ps.ParallelLight
    ) -> None:
        """Tightly: the scheme smears by it."""
        camera = ps.Camera(40.0)
        grid = camera.grid((31, 41))
        steepness = light.model(material).parameters(grid)["steepness"]
        random = np.random.default_rng(2)
        x, y = grid.x[random.integers(0, 41, 100_000)], grid.y[random.integers(0, 31, 100_000), 0]
        p, q = (np.sinh(random.uniform(-3.0, 3.0, x.size)) for _ in range(2))
        ray, step = np.sqrt(1.0 + x**2 + y**2), 1e-6
        largest = []
        for along, (a, b) in ((x, (step, 0.0)), (y, (0.0, step))):
            before, after = (light.brightness(0.0, p + sign * a, q + sign * b, x, y, material) for sign in (-1.0, 1.0))
            lit = (1.0 + (x - light.p0) * p + (y - light.q0) * q) > 1e-4
            slope = np.abs(after - before) / (2.0 * step)
            largest.append((slope / (ray * np.sqrt(1.0 + along**2)))[lit].max())
        assert max(largest) <= steepness
        assert max(largest) > 0.8 * steepness

    CASES = (
        (ps.Phong(), ps.ParallelLight(), "toward"),
        (ps.Phong(), OBLIQUE, "toward"),
        (ps.OrenNayar(0.3), ps.ParallelLight(), "away"),
        (ps.OrenNayar(0.3), OBLIQUE, "away"),
        (ps.OrenNayar(0.5), OBLIQUE, "away"),
    )

    @pytest.mark.parametrize(("material", "light", "surface"), CASES, ids=str)
    def test_a_hillside_is_recovered_and_better_than_with_the_wrong_material(
        self, material: Reflectance, light: ps.ParallelLight, surface: Any
    ) -> None:
        scenes = [
            ps.hillside(
                shape=(size, size),
                light=light,
                reflectance=material,
                surface=surface,
                relief=0.05,
                focal_length=3 * size,
            )
            for size in (24, 72)
        ]
        coarse, fine = (exact(scene, ordering="checkerboard") for scene in scenes)
        assert fine < 0.6 * coarse
        assert fine < 0.0012
        # What one would do who knows nothing of the material: the brightest value is 1.
        taken_as_matt = replace(scenes[1], image=scenes[1].image / scenes[1].image.max(), reflectance=ps.Lambertian())
        assert exact(taken_as_matt, ordering="checkerboard") > 2.0 * fine

    def test_a_matt_material_has_the_surface_of_the_papers_form(self) -> None:
        """E - R in place of S (E - R): the same equation, and less smearing."""
        scene = ps.bump(shape=(60, 60), light=self.OBLIQUE)
        matt = exact(scene, ordering="checkerboard")
        assert exact(scene, reflectance=ps.Phong(1.0, 0.0, 1.0), ordering="checkerboard") < 0.85 * matt
        assert exact(scene, reflectance=ps.OrenNayar(0.0), ordering="checkerboard") < 0.85 * matt

    # By other orderings the hills above are found in double precision.
    @pytest.mark.quick_where(holds=lambda given: given["precision"] == "float32")
    @pytest.mark.parametrize(
        "material", [pytest.param(ps.OrenNayar(0.4), marks=pytest.mark.thorough), ps.Phong()], ids=str
    )
    @pytest.mark.parametrize("boundary", ["wall", pytest.param("outflow", marks=pytest.mark.thorough)])
    def test_the_orderings_agree(self, device: ps.Device, precision: str, material: Reflectance, boundary: str) -> None:
        scene = ps.hillside(shape=(25, 30), light=self.OBLIQUE, reflectance=material, focal_length=90.0, relief=0.05)
        mask = np.random.default_rng(3).uniform(size=scene.image.shape) > 0.05
        keywords: dict[str, Any] = {"mask": mask, "boundary": boundary, "device": device, "precision": precision}
        depths = [
            solve(scene, ordering=ordering, tolerance=0.0, max_iterations=40, **keywords).depth
            for ordering in ("lexicographic", "wavefront")
        ]
        np.testing.assert_array_equal(depths[0], depths[1])

    def test_pixels_as_dark_as_at_grazing_are_reported(self) -> None:
        material = ps.OrenNayar(0.5)
        scene = ps.hillside(shape=(30, 30), reflectance=material, focal_length=90.0, relief=0.05)
        image = scene.image.copy()
        image[12, 14] = material.rim - 0.02
        solution = solve(replace(scene, image=image))
        assert np.argwhere(solution.clamped).tolist() == [[12, 14]]

    def test_what_makes_no_sense_is_refused(self) -> None:
        scene = ps.hillside(shape=(30, 30), reflectance=ps.OrenNayar(0.5))
        with pytest.raises(ps.InputError, match=r"upwind' with .*Use scheme='lax-friedrichs'"):
            solve(scene, scheme="upwind")
        with pytest.raises(ps.InputError, match=r"seen no brighter than 0\.\d+ under this light"):
            solve(replace(scene, image=scene.image / scene.image.max()))


class TestLampBesideTheCamera:
    """A flash or a torch at the side: in the equation of the upwind scheme, else corrected in rounds."""

    OFFSETS = ((0.05, 0.0, 0.0), (0.0, 0.2, 0.0), (0.15, 0.1, 0.05), (0.4, 0.0, 0.0))

    @staticmethod
    def scene(offset: tuple[float, float, float], material: Reflectance = ps.Lambertian(), size: int = 60) -> Scene:
        light = ps.FlashLight(gain=3.0, offset=offset)
        return ps.hillside(shape=(size, size), light=light, reflectance=material, surface="toward")

    @staticmethod
    def solve(scene: Scene, **keywords: Any) -> ps.Solution:
        given: dict[str, Any] = {"light": scene.light, "reflectance": scene.reflectance}
        if scene.reflectance != ps.Lambertian() or keywords.get("accuracy_order") == 2:
            # The bits of the wavefront, by a program that compiles in a third of the time.
            given["ordering"] = "lexicographic"
        return ps.reconstruct(scene.image, scene.camera, **{**given, **keywords})

    @pytest.mark.parametrize("offset", OFFSETS)
    @pytest.mark.parametrize(("size", "order", "bound"), [(60, 1, 1.3), (240, 1, 1.3), (60, 2, 2.5)])
    def test_the_surface_is_as_good_as_with_the_lamp_at_the_camera(
        self, offset: Any, size: int, order: int, bound: float
    ) -> None:
        coaxial = self.scene((0.0, 0.0, 0.0), size=size)
        least = ps.compare(self.solve(coaxial, accuracy_order=order).depth, coaxial.depth).mean
        scene = self.scene(offset, size=size)
        solution = self.solve(scene, accuracy_order=order)
        assert solution.status is ps.Status.CONVERGED
        assert "lamp_rounds" not in solution.parameters
        assert solution.iterations < 20
        assert ps.compare(solution.depth, scene.depth).mean < bound * least
        ignored = self.solve(scene, light=coaxial.light)
        assert ps.compare(ignored.depth, scene.depth).mean > 8.0 * least

    @pytest.mark.parametrize("ordering", ["checkerboard", "lexicographic"])
    def test_the_orderings_agree(self, ordering: str) -> None:
        scene = self.scene((0.3, -0.1, 0.0))
        by_wavefront = self.solve(scene)
        np.testing.assert_allclose(self.solve(scene, ordering=ordering).depth, by_wavefront.depth, rtol=2e-6)

    @pytest.mark.parametrize("offset", OFFSETS[:2])
    def test_by_lax_friedrichs_in_rounds(self, offset: Any) -> None:
        scene = self.scene(offset)
        solution = self.solve(scene, scheme="lax-friedrichs")
        assert solution.status is ps.Status.CONVERGED
        assert 1 < solution.parameters["lamp_rounds"] <= 10
        by_upwind = self.solve(scene)
        assert ps.compare(solution.depth, scene.depth).mean < 5.0 * ps.compare(by_upwind.depth, scene.depth).mean

    @pytest.mark.parametrize("material", [ps.OrenNayar(0.4), pytest.param(ps.Phong(), marks=pytest.mark.thorough)])
    def test_other_materials_and_a_mask(self, material: Reflectance) -> None:
        scene = self.scene((0.0, 0.1, 0.0), material)
        mask = np.ones(scene.image.shape, bool)
        mask[20:26, 30:44] = False
        solution = self.solve(scene, mask=mask)
        np.testing.assert_array_equal(solution.solved, mask)
        assert 1 < solution.parameters["lamp_rounds"] <= 10
        coaxial = self.scene((0.0, 0.0, 0.0), material)
        least = ps.compare(self.solve(coaxial, mask=mask).depth, coaxial.depth).mean
        assert ps.compare(solution.depth, scene.depth).mean < 2.2 * least

    def test_error_falls_with_the_grid(self) -> None:
        scenes = [self.scene((0.1, 0.0, 0.0), size=size) for size in (40, 120)]
        coarse, fine = (ps.compare(self.solve(scene).depth, scene.depth).mean for scene in scenes)
        assert fine < 0.5 * coarse

    @pytest.mark.parametrize("scheme", ["upwind", "lax-friedrichs"])
    def test_a_batch_has_the_numbers_of_its_images_alone(self, scheme: str) -> None:
        light = ps.FlashLight(offset=(0.1, 0.0, 0.0))
        scenes = [
            ps.hillside(shape=(40, 40), light=light, surface="toward"),
            ps.bump(shape=(40, 40), light=light, surface="toward", relief=0.05),
            ps.hillside(shape=(30, 44), light=light, surface="toward"),
        ]
        together = ps.reconstruct_batch(
            [scene.image for scene in scenes], [scene.camera for scene in scenes], light=light, scheme=scheme
        )
        for scene, solution in zip(scenes, together, strict=True):
            alone = ps.reconstruct(scene.image, scene.camera, light=light, scheme=scheme)
            np.testing.assert_array_equal(solution.depth, alone.depth)
            np.testing.assert_array_equal(solution.changes, alone.changes)
            assert solution.parameters == alone.parameters

    def test_the_callback_counts_on_and_stops(self) -> None:
        scene = self.scene((0.1, 0.0, 0.0), ps.OrenNayar(0.4))
        seen: list[int] = []

        def stop_at_six(iteration: int, _change: float) -> bool:
            seen.append(iteration)
            return iteration == 6

        solution = self.solve(scene, callback=stop_at_six)
        assert seen == [1, 2, 3, 4, 5, 6]
        assert solution.status is ps.Status.STOPPED
        assert len(solution.changes) == solution.iterations == 6
        assert solution.parameters["lamp_rounds"] == 2

    def test_a_lamp_too_far_away_for_rounds_is_warned_of(self) -> None:
        scene = self.scene((1.5, 0.0, 0.0))
        with (
            pytest.warns(UserWarning, match="turn their back to the lamp"),
            pytest.warns(UserWarning, match="too far from the camera"),
        ):
            solution = self.solve(scene, scheme="lax-friedrichs")
        assert solution.status is ps.Status.MAX_ITERATIONS
        assert solution.changes[-1] <= solution.parameters["tolerance"]
        with (
            pytest.warns(UserWarning, match="too far from the camera|turn their back to the lamp"),
            pytest.raises(ps.ConvergenceError, match="have it nearer") as caught,
        ):
            self.solve(scene, scheme="lax-friedrichs", throw=True)
        assert "above the tolerance" not in str(caught.value)

    @pytest.mark.parametrize("offset", [(0.0, 0.0, -1.5), (0.8, 0.0, 0.0), (0.0, 0.0, 0.6)])
    def test_a_lamp_far_behind_or_beside_or_ahead(self, offset: Any) -> None:
        scene = ps.hillside((121, 121), light=ps.FlashLight(gain=3.0, offset=offset))
        assert ps.compare(self.solve(scene).depth, scene.depth).mean < 0.005 * np.ptp(scene.depth)

    def test_values_do_not_fall_below_the_solution(self) -> None:
        """A steep hill, where the direction to the lamp changes much on the way down from the start."""
        light = ps.FlashLight(offset=(-0.159, 0.025, 0.118))
        scene = ps.hillside((109, 59), focal_length=65.4, orientation=230, relief=0.33, light=light)
        coaxial = ps.hillside((109, 59), focal_length=65.4, orientation=230, relief=0.33, light=ps.FlashLight())
        least = ps.compare(self.solve(coaxial).depth, coaxial.depth).maximum
        assert ps.compare(self.solve(scene).depth, scene.depth).maximum < 4.0 * least

    def test_pixels_that_come_too_near_are_warned_of(self) -> None:
        scene = self.scene((0.1, 0.0, 0.0))
        bright = scene.image.copy()
        bright[30, 30] *= 3000.0
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            solution = self.solve(replace(scene, image=bright))
        assert any("pixels come out as near to the camera as the lamp" in str(warning.message) for warning in caught)
        assert np.isfinite(solution.depth).all()
        with pytest.warns(UserWarning, match="^3600 pixels come out as near"):
            self.solve(scene, light=ps.FlashLight(gain=3.0, offset=(0.1, 0.0, 50.0)))

    @pytest.mark.thorough
    def test_rounds_survive_a_surface_that_turns_away(self) -> None:
        scene = ps.hillside((80, 80), relief=0.3, light=ps.FlashLight(offset=(0.0, 0.2, 0.4)), reflectance=ps.Phong())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            solution = self.solve(scene)
        assert np.isfinite(solution.depth).all()

    def test_render_is_the_formula(self) -> None:
        scene = self.scene((0.1, 0.05, -0.1), ps.Phong())
        depth = scene.depth.copy()
        depth[10:14, 20:30] = np.nan
        paint = np.full(depth.shape, 0.5)
        image = ps.render(depth, scene.camera, light=scene.light, reflectance=scene.reflectance, albedo=paint)
        assert (np.isnan(image) == np.isnan(depth)).all()
        inside = np.isfinite(image)
        inside[[0, -1]] = inside[:, [0, -1]] = inside[9:15, 19:31] = False
        np.testing.assert_allclose(image[inside], 0.5 * scene.image[inside], rtol=0.01)
