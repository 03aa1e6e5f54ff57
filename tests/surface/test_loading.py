"""A solution from its folder is the one that was saved."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import FOCAL, SCENE, png, run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import persfs_cl as ps
from persfs_cl.shading.lights import LIGHTS
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.surface.geometry import Discontinuities

NUMBERS = st.floats(0.1, 0.5)
LIGHT = st.one_of(
    st.builds(ps.ParallelLight, NUMBERS, NUMBERS),
    st.builds(ps.FlashLight, gain=NUMBERS, offset=st.tuples(NUMBERS, NUMBERS, st.just(0.0))),
    st.just(ps.FlashLight(falloff=False)),
)
MATERIAL = st.one_of(
    st.just(ps.Lambertian()), st.builds(ps.OrenNayar, NUMBERS), st.builds(ps.Phong, NUMBERS, NUMBERS, st.just(20.0))
)
CAMERA = st.one_of(
    st.builds(ps.Camera, st.floats(8.0, 50.0)),
    st.builds(ps.Camera, st.tuples(st.floats(8.0, 50.0), st.floats(8.0, 50.0)), st.tuples(NUMBERS, NUMBERS)),
)
IN_SINGLE_PRECISION = ("image", "albedo", "departure")


@pytest.fixture(scope="module")
def solved() -> ps.Solution:
    return solution()


def solution(**keywords: Any) -> ps.Solution:
    scene = ps.bump((12, 15), light=ps.FlashLight())
    return ps.reconstruct(scene.image, scene.camera, light=scene.light, **keywords)


def alike(one: Any, other: Any, name: str = "solution") -> None:
    """Equal in every number; images in single precision."""
    if dataclasses.is_dataclass(one):
        assert type(one) is type(other)
        for field in dataclasses.fields(one):
            alike(getattr(one, field.name), getattr(other, field.name), field.name)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape), name
        tolerance = 1e-6 if name in IN_SINGLE_PRECISION else 4e-16 if name == "log_depth" else 0.0
        np.testing.assert_allclose(other, one, rtol=tolerance, atol=tolerance, err_msg=name)
    else:
        assert one == other or (one != one and other != other), name  # NaN


def test_the_strategies_have_every_light_and_material() -> None:
    assert set(LIGHTS.values()) == {ps.ParallelLight, ps.FlashLight}
    assert set(MATERIALS.values()) == {ps.Lambertian, ps.OrenNayar, ps.Phong}


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(light=LIGHT, material=MATERIAL, camera=CAMERA, seed=st.integers(0, 2**32 - 1), walls=st.booleans())
def test_what_was_saved_is_loaded(
    light: Any, material: Any, camera: ps.Camera, seed: int, walls: bool, solved: ps.Solution, tmp_path: Path
) -> None:
    random = np.random.default_rng(seed)
    shape = tuple(random.integers(1, 12, 2))
    depth = np.where(random.random(shape) < random.random(), random.uniform(0.5, 2.0, shape), np.nan)
    depth.flat[random.integers(depth.size)] = 1.0
    masks: dict[str, Any] = {name: random.random(shape) < 0.3 for name in ("unreached", "clamped", "at_bound")}
    cuts = Discontinuities(random.random((shape[0], shape[1] - 1)) < 0.3, random.random((shape[0] - 1, shape[1])) < 0.3)
    one = dataclasses.replace(
        solved,
        depth=depth,
        log_depth=np.log(depth),
        solved=np.isfinite(depth),
        **masks,
        image=random.uniform(0.0, 1.0, shape),
        albedo=random.uniform(0.1, 1.0, shape) if walls else None,
        camera=camera,
        light=light,
        reflectance=material,
        walls=random.random(shape) < 0.3 if walls else None,
        discontinuities=cuts if walls else None,
        changes=np.array([np.inf, 1.0 / 3.0, np.nan]),
        distance=float(random.choice([np.nan, 1e-7])),
        status=list(ps.Status)[seed % 3],
    )
    one.save(tmp_path, save="solution")
    alike(one, ps.load(tmp_path))


@pytest.mark.parametrize("precision", ["float32", pytest.param("float64", marks=pytest.mark.thorough)])
def test_a_loaded_solution_does_what_it_did(precision: str, tmp_path: Path) -> None:
    scene = ps.bump((12, 15), light=ps.FlashLight())
    device = ps.devices()[0]
    if precision == "float64" and not device.has_float64:
        pytest.skip("the device has no double precision")
    guide = scene.depth.reshape(4, 3, 5, 3).mean(axis=(1, 3))
    walls = np.zeros(scene.depth.shape, bool)
    walls[6, 3:9] = True
    before = solution(precision=precision, guide=guide, walls=walls, device=device)
    before.save(tmp_path / "one", save="solution")
    after = ps.load(tmp_path / "one")
    alike(before, after)
    assert after.device is before.device
    np.testing.assert_array_equal(after.normals(), before.normals())
    np.testing.assert_array_equal(after.points(), before.points())
    np.testing.assert_array_equal(after.render(), before.render())
    np.testing.assert_array_equal(after.mesh().vertices, before.mesh().vertices)
    assert after.solid().volume == before.solid().volume
    assert repr(after) == repr(before)
    assert after.residual().mean == pytest.approx(before.residual().mean, rel=1e-6)
    after.save(tmp_path / "two", save="solution")
    alike(after, ps.load(tmp_path / "two"))
    assert (tmp_path / "one" / "depth.npy").read_bytes() == (tmp_path / "two" / "depth.npy").read_bytes()
    said, again = (json.loads((tmp_path / name / "report.json").read_text()) for name in ("one", "two"))
    for report in (said, again):
        del report["grey_levels"]
    assert said == again


@pytest.mark.usefixtures("no_pictures", "in_this_process")
def test_what_the_commands_and_batch_write_can_be_loaded(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    png(tmp_path / "in" / "photo.png", SCENE.image)
    assert run("reconstruct", tmp_path / "in" / "photo.png", "-o", tmp_path / "one", *FOCAL).status == 0
    one = ps.load(tmp_path / "one")
    np.testing.assert_array_equal(one.depth, np.load(tmp_path / "one" / "depth.npy"))
    camera = ps.Camera(float(FOCAL[1]))
    [result] = ps.batch(tmp_path / "in", tmp_path / "many", camera=camera, save="depth,preview,solution")
    assert result.error is None
    many = ps.load(tmp_path / "many" / "photo.png")
    np.testing.assert_array_equal(one.depth, many.depth)
    assert (one.camera.fx, one.camera.fy) == (many.camera.fx, many.camera.fy) == (float(FOCAL[1]), float(FOCAL[1]))
    assert dict(one.parameters) == dict(many.parameters)


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("persfs_cl.surface.writing.draw_all", lambda *_arguments: [])


@pytest.mark.parametrize("file", ["depth.npy", "solution.npz", "report.json"])
def test_a_folder_that_lacks_something_is_refused(file: str, solved: ps.Solution, tmp_path: Path) -> None:
    solved.save(tmp_path / "folder", save="solution")
    place = tmp_path / "folder" / file
    whole = place.read_bytes()
    for broken in (b"", b"no such file", whole[: len(whole) // 2], bytes(len(whole))):
        place.write_bytes(broken)
        with pytest.raises(ps.InputError, match=rf"folder/{file}"):
            ps.load(tmp_path / "folder")
    place.unlink()
    with pytest.raises(ps.InputError, match=rf"folder/{file} does not exist: .*--save solution"):
        ps.load(tmp_path / "folder")


def test_what_is_no_folder_is_refused(tmp_path: Path) -> None:
    for place in (tmp_path / "none", 3):
        with pytest.raises(ps.InputError, match=r"none is no folder|3 is no path"):
            ps.load(place)  # type: ignore[arg-type]


@pytest.mark.parametrize("file", ["depth.npy", "solution.npz", "report.json"])
def test_files_of_different_surfaces_are_not_mixed(file: str, solved: ps.Solution, tmp_path: Path) -> None:
    solved.save(tmp_path / "one", save="solution")
    solution(max_iterations=1).save(tmp_path / "two", save="solution")
    shutil.copy(tmp_path / "two" / file, tmp_path / "one" / file)
    with pytest.raises(ps.InputError, match="is of another surface than"):
        ps.load(tmp_path / "one")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"status": "DONE"}, "the status 'DONE'"),
        ({"iterations": "4"}, "no iterations as reports have it"),
        ({"parameters": {}}, "no camera"),
        ({"parameters": {"camera": {"focal_length": -1.0}}}, "impossible camera"),
        ({"parameters": {"camera": {"focal_length": 10.0}, "light": {"kind": "Sun"}}}, "light='Sun' is none"),
        ({"parameters": {"camera": {"focal_length": 10.0}, "light": {"kind": "FlashLight"}}}, "the numbers falloff"),
        ({"parameters": {"camera": {"focal_length": 10.0}, "light": [1]}}, "light=.* has no kind and numbers"),
        ({"seconds": None}, "no seconds"),
        ({"device": None}, "no device"),
    ],
)
def test_a_report_that_was_changed_is_refused(
    change: dict[str, Any], message: str, solved: ps.Solution, tmp_path: Path
) -> None:
    solved.save(tmp_path, save="solution")
    place = tmp_path / "report.json"
    place.write_text(json.dumps({**json.loads(place.read_text()), **change}))
    with pytest.raises(ps.InputError, match=rf"report\.json.*{message}"):
        ps.load(tmp_path)


def test_a_report_of_brackets_is_refused(solved: ps.Solution, tmp_path: Path) -> None:
    solved.save(tmp_path, save="solution")
    for text in ("[" * 100_000, "[]", "3"):
        (tmp_path / "report.json").write_text(text)
        with pytest.raises(ps.InputError, match=r"report\.json is no"):
            ps.load(tmp_path)


def test_arrays_that_were_changed_are_refused(solved: ps.Solution, tmp_path: Path) -> None:
    solved.save(tmp_path, save="solution")
    place = tmp_path / "solution.npz"
    with np.load(place) as file:
        arrays = dict(file)
    changes: dict[str, tuple[Any, str]] = {
        "image": (np.ones((3, 3), np.float32), r"float32 of shape \(3, 3\) for image"),
        "clamped": (np.zeros(3, np.uint8), "for clamped"),
        "changes": (np.array(["a"]), "for changes"),
        "fingerprint": (np.array(np.nan), "is of another surface"),
        "distance": (np.array([1.0, 2.0]), "for distance"),
        "departure": (arrays["image"], "no guide"),
    }
    for name, (values, message) in changes.items():
        np.savez(place, **{**arrays, name: values})
        with pytest.raises(ps.InputError, match=message):
            ps.load(tmp_path)
    np.savez(place, **{name: values for name, values in arrays.items() if name != "image"})
    with pytest.raises(ps.InputError, match=r"solution\.npz has no image"):
        ps.load(tmp_path)
    np.savez(place, image=np.array([None]))
    with pytest.raises(ps.InputError, match=r"solution\.npz holds Python objects"):
        ps.load(tmp_path)
    np.savez_compressed(place, image=np.zeros(10**6))
    with pytest.raises(ps.InputError, match=r"solution\.npz promises more bytes than it has"):
        ps.load(tmp_path)
