"""Light, material, tone and lens are found again from photographs that were made with known ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.cli.calibrated import calibrated
from persfs_cl.preparation.correct import cosine_vignetting
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance

SIZE = 72
SHAPE = SIZE, SIZE
CAMERA = ps.Camera(SIZE)
NEAR = ps.bump(SHAPE, surface="toward", relief=0.4).depth
FAR = 1.6 * ps.hillside(SHAPE, surface="toward", relief=0.3).depth
LAMP = (0.1, -0.05, 0.0)

Image = NDArray[np.float64]


def taken(
    depth: Image,
    light: Light,
    reflectance: Reflectance = ps.Lambertian(),
    *,
    white: float | None = None,
    exponent: float = 1.0,
    noise: float = 0.0,
    seed: int = 0,
) -> Image:
    """A photograph in 8 bits of a camera with a tone curve: linear light to the power of 1 / exponent."""
    image = ps.render(depth, CAMERA, light=light, reflectance=reflectance)
    share = np.clip(image / (image.max() if white is None else white), 0.0, 1.0) ** (1.0 / exponent)
    share += noise * np.random.default_rng(seed).normal(size=share.shape)
    return np.asarray(np.round(255.0 * np.clip(share, 0.0, 1.0)) / 255.0)


def points(depth: Image, count: int, seed: int, noise: float = 0.01) -> Image:
    """Column, row and depth of some pixels, the depth with normal noise."""
    draw = np.random.default_rng(seed)
    rows, columns = draw.integers(3, SIZE - 3, (2, count))
    return np.stack([columns, rows, depth[rows, columns] * (1.0 + noise * draw.normal(size=count))], axis=1)


def lamp_of(calibration: ps.Calibration) -> ps.FlashLight:
    assert isinstance(calibration.light, ps.FlashLight)
    return calibration.light


def ball_in_front(distance: float, radius: float) -> Image:
    """Depth of a ball as far as it can be seen, NaN around it."""
    grid = CAMERA.grid(SHAPE)
    square = 1.0 + grid.x**2 + grid.y**2
    under = distance**2 - square * (distance**2 - radius**2)
    return np.where(under > 0.0, (distance - np.sqrt(np.maximum(under, 0.0))) / square, np.nan)


def brightest(*depths: Image, light: Light, reflectance: Reflectance = ps.Lambertian()) -> float:
    return max(float(ps.render(depth, CAMERA, light=light, reflectance=reflectance).max()) for depth in depths)


def test_gain_tone_and_lamp_are_found_from_a_hundred_points() -> None:
    light = ps.FlashLight(offset=LAMP)
    white = brightest(NEAR, FAR, light=light)
    pairs = [
        (taken(depth, light, white=white, exponent=1.2), points(depth, 50, seed))
        for seed, depth in ((0, NEAR), (1, FAR))
    ]
    calibration = ps.calibrate(pairs, CAMERA, fit="gain,exponent,lamp")
    assert lamp_of(calibration).known_gain * white == pytest.approx(1.0, abs=0.01)
    assert calibration.exponent == pytest.approx(1.2, abs=0.03)
    apart = np.subtract(lamp_of(calibration).offset, LAMP)
    assert np.linalg.norm(apart) <= 0.02
    # Forwards the lamp does as the gain does, and is left where it was.
    assert list(calibration.reasons) == ["lamp_z"]
    assert "the place of the lamp forwards and the gain cannot be told apart" in calibration.reasons["lamp_z"]
    assert lamp_of(calibration).offset[2] == 0.0
    assert calibration.validation == "2 photographs"
    assert calibration.before.depth is not None
    assert calibration.after.depth is not None
    # The points themselves are off by 0.8 % in the mean.
    assert calibration.before.depth > 0.4
    assert calibration.after.depth < 0.012
    solution = ps.reconstruct(
        pairs[0][0] ** calibration.exponent, CAMERA, light=calibration.light, reflectance=calibration.reflectance
    )
    assert ps.compare(solution.depth, NEAR).mean < 0.006


def test_errors_lie_within_what_is_said_of_them() -> None:
    light = ps.FlashLight()
    white = brightest(NEAR, light=light)
    photo = taken(NEAR, light, exponent=1.2)
    # So much that what the scheme itself errs by on so few pixels does not matter.
    known = [points(NEAR, 100, seed, noise=0.05) for seed in range(8)]
    found = [ps.calibrate([(photo, each)], CAMERA, fit="gain,exponent") for each in known]
    truth = {"gain": 1.0 / white, "exponent": 1.2}
    for name, value in truth.items():
        shares = [(one.values[name] - value) / one.uncertainties[name] for one in found]
        assert 0.5 < float(np.sqrt(np.mean(np.square(shares)))) < 1.6, name


def test_noise_of_the_photo_does_little_harm() -> None:
    light = ps.FlashLight()
    white = brightest(NEAR, light=light)
    photo = taken(NEAR, light, noise=0.01)
    calibration = ps.calibrate([(photo, points(NEAR, 100, 0))], CAMERA)
    assert calibration.values == {"gain": pytest.approx(1.0 / white, rel=0.01)}


def test_outliers_do_not_count() -> None:
    light = ps.FlashLight(gain=0.7)
    photo, known = ps.render(NEAR, CAMERA, light=light), points(NEAR, 60, 0)
    known[::6, 2] *= 1.5
    assert ps.calibrate([(photo, known)], CAMERA).values["gain"] == pytest.approx(0.7, rel=0.01)


@pytest.mark.parametrize(("white", "exponent"), [(0.7, 1.0), (0.7, 1.3)])
def test_a_parallel_light_is_found_from_a_dense_truth(white: float, exponent: float) -> None:
    light = ps.ParallelLight(0.3, -0.2)
    depths = [ps.bump(SHAPE).depth, ps.hillside(SHAPE, surface="toward").depth]
    pairs = [
        (taken(depth, light, white=1.0 / white, exponent=exponent, noise=0.01, seed=seed), depth)
        for seed, depth in enumerate(depths)
    ]
    fit = ["direction", "white", *["exponent"] * (exponent != 1.0)]
    calibration = ps.calibrate(pairs, CAMERA, light=ps.ParallelLight(), fit=fit)
    assert isinstance(calibration.light, ps.ParallelLight)
    np.testing.assert_allclose((calibration.light.p0, calibration.light.q0), (0.3, -0.2), atol=0.01)
    assert calibration.white_level == pytest.approx(white, rel=0.01)
    assert calibration.exponent == pytest.approx(exponent, abs=0.02)
    assert calibration.before.depth is None
    assert calibration.after.brightness is not None
    assert calibration.after.brightness < 0.02


def test_without_a_white_level_each_photo_has_its_own() -> None:
    light = ps.ParallelLight(0.3, -0.2)
    depths = [ps.bump(SHAPE).depth, ps.hillside(SHAPE, surface="toward").depth]
    pairs = [
        (exposure * ps.render(depth, CAMERA, light=light), depth)
        for exposure, depth in zip((0.4, 0.9), depths, strict=True)
    ]
    calibration = ps.calibrate(pairs, CAMERA, light=ps.ParallelLight(), fit="direction")
    assert calibration.white_level is None
    np.testing.assert_allclose([*calibration.values.values()], (0.3, -0.2), atol=0.02)


@pytest.mark.usefixtures("lexicographic_wavefront")
@pytest.mark.parametrize("truth", ["map", pytest.param("points", marks=pytest.mark.thorough)])
def test_roughness_is_found(truth: str) -> None:
    rough = ps.OrenNayar(0.5)
    white = brightest(NEAR, light=ps.FlashLight(), reflectance=rough)
    photo = taken(NEAR, ps.FlashLight(), rough)
    known = NEAR if truth == "map" else points(NEAR, 100, 0, noise=0.003)
    calibration = ps.calibrate([(photo, known)], CAMERA, reflectance=ps.OrenNayar(0.2), fit="gain,roughness")
    assert calibration.values == {"gain": pytest.approx(1 / white, rel=0.01), "roughness": pytest.approx(0.5, abs=0.03)}


@pytest.mark.usefixtures("lexicographic_wavefront")
def test_gloss_is_found() -> None:
    shiny = ps.Phong(0.6, 0.4, 8.0)
    ball = ball_in_front(distance=3.0, radius=1.2)
    photo = ps.render(ball, CAMERA, reflectance=shiny, light=ps.FlashLight())
    calibration = ps.calibrate([(photo, ball)], CAMERA, reflectance=ps.Phong(), fit="gain,gloss")
    assert calibration.values == {
        "gain": pytest.approx(1.0, rel=0.02),
        "specular": pytest.approx(0.4, abs=0.02),
        "shininess": pytest.approx(8.0, rel=0.05),
    }
    assert isinstance(calibration.reflectance, ps.Phong)
    assert calibration.reflectance.diffuse == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize("truth", ["map", "points"])
def test_vignetting_is_found(truth: str) -> None:
    photo = ps.render(NEAR, CAMERA, light=ps.FlashLight()) * cosine_vignetting(CAMERA, SHAPE, 3.0)
    known = NEAR if truth == "map" else points(NEAR, 100, 0, noise=0.003)
    calibration = ps.calibrate([(photo, known)], CAMERA, fit="gain,vignetting")
    assert calibration.values["vignetting"] == pytest.approx(3.0, abs=0.01 if truth == "map" else 0.2)
    assert calibration.preparation.vignetting == f"cos{calibration.values['vignetting']:.6f}"


def test_the_lamp_is_told_in_depth_where_the_truth_is_dense() -> None:
    light = ps.FlashLight(gain=0.6, offset=(0.1, -0.05, 0.06))
    photo = taken(NEAR, light, white=1.0)
    calibration = ps.calibrate([(photo, NEAR)], CAMERA, fit="gain,lamp")
    assert not calibration.reasons
    np.testing.assert_allclose(lamp_of(calibration).offset, light.offset, atol=0.005)
    assert calibration.validation == "5 folds"


def test_a_noisy_map_is_believed_by_its_depth_alone() -> None:
    light = ps.FlashLight(gain=0.8)
    photo = ps.render(NEAR, CAMERA, light=light)
    noisy = NEAR * (1.0 + 0.01 * np.random.default_rng(0).normal(size=SHAPE))
    by_solution = ps.calibrate([(photo, noisy)], CAMERA, normals="solution")
    by_truth = ps.calibrate([(photo, noisy)], CAMERA, normals="truth")
    assert by_solution.values["gain"] == pytest.approx(0.8, rel=0.005)
    # Slopes of noise are steep, and steep surfaces are dark.
    assert by_truth.values["gain"] > 1.05 * 0.8


def test_a_map_with_few_depths_counts_as_points() -> None:
    photo = ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=0.8))
    sparse = np.where((np.indices(SHAPE) % 9 == 4).all(axis=0), NEAR, np.nan)
    calibration = ps.calibrate([(photo, sparse)], CAMERA)
    assert calibration.values["gain"] == pytest.approx(0.8, rel=0.005)
    assert calibration.after.brightness is None


@pytest.mark.parametrize("unit", [1e-3, pytest.param(500.0, marks=pytest.mark.thorough)])
def test_depth_may_be_in_any_unit(unit: float) -> None:
    light = ps.FlashLight(gain=0.5 * unit**2, offset=(0.1 * unit, 0.0, 0.0))
    known = points(unit * NEAR, 60, 0, noise=0.003)
    calibration = ps.calibrate([(ps.render(unit * NEAR, CAMERA, light=light), known)], CAMERA, fit="gain,lamp")
    # What so coarse a grid errs by, the place of the lamp forwards takes up, and hands on to the gain.
    assert calibration.values["gain"] == pytest.approx(light.gain, rel=0.03)
    assert calibration.values["lamp_x"] == pytest.approx(0.1 * unit, abs=0.01 * unit)
    assert calibration.after.depth is not None
    assert calibration.after.depth < 0.01


@pytest.mark.parametrize("noise", [0.0, *(pytest.param(noise, marks=pytest.mark.thorough) for noise in (0.003, 0.01))])
def test_points_do_not_tell_the_lamp_forwards_from_the_gain(noise: float) -> None:
    light = ps.FlashLight(gain=0.5, offset=(0.1, 0.0, 0.0))
    photo = ps.render(NEAR, CAMERA, light=light)
    calibration = ps.calibrate([(photo, points(NEAR, 60, 0, noise=noise))], CAMERA, fit="gain,lamp")
    assert list(calibration.reasons) == ["lamp_z"]
    assert "forwards and the gain cannot be told apart" in calibration.reasons["lamp_z"]
    assert lamp_of(calibration).offset[2] == 0.0
    assert calibration.values["gain"] == pytest.approx(0.5, rel=0.01)


def test_errors_of_a_smooth_map_are_no_noise() -> None:
    photo = ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=0.8))
    row, column = np.indices(SHAPE) / SHAPE[0]
    found = []
    for seed in range(8):
        # Bent by 2 %, as stereo does it, over a good part of the photo.
        phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 2)
        bent = NEAR * (1.0 + 0.02 * np.sin(7.0 * row + phase[0]) * np.sin(7.0 * column + phase[1]))
        found.append(ps.calibrate([(photo, bent)], CAMERA, normals="solution"))
    shares = [(one.values["gain"] - 0.8) / one.uncertainties["gain"] for one in found]
    assert 0.3 < float(np.sqrt(np.mean(np.square(shares)))) < 2.0


def test_photographs_that_contradict_each_other_are_told_of() -> None:
    photo = ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=2.0))
    with pytest.warns(UserWarning, match=r"over 2 photographs.* \d+\.\d\d% off in place of \d.*contradict"):
        ps.calibrate([(photo, NEAR), (3.0 * photo, NEAR)], CAMERA, fit="gain")


def test_a_fit_that_does_not_settle_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("persfs_cl.calibration.least_squares._MOST_STEPS", 1)
    photo = ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=0.8)) ** 0.7
    with pytest.warns(UserWarning, match="did not settle.*fit"):
        calibration = ps.calibrate([(photo, NEAR)], CAMERA, fit="gain,exponent")
    assert not calibration.converged
    assert "not converged" in repr(calibration)
    assert "# Not converged: " in calibrated(calibration, {}, [Path("photo.png")])


def test_two_points_tell_the_gain() -> None:
    photo = ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=0.8))
    calibration = ps.calibrate([(photo, points(NEAR, 2, 0, noise=0.0))], CAMERA)
    assert calibration.values["gain"] == pytest.approx(0.8, rel=0.02)
    same = ps.calibrate([(photo, ps.Points(*points(NEAR, 2, 0, noise=0.0).T))], CAMERA)
    assert same.values == calibration.values


def test_without_fall_off_the_gain_is_told_by_a_map() -> None:
    light = ps.FlashLight(falloff=False, gain=0.6)
    calibration = ps.calibrate([(taken(NEAR, light, white=1.0), NEAR)], CAMERA, light=ps.FlashLight(falloff=False))
    assert calibration.values["gain"] == pytest.approx(0.6, rel=0.005)
    assert calibration.before.depth is None


def test_a_photo_is_prepared_as_it_will_be(tmp_path: Path) -> None:
    lit = 0.6 * ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=0.4)) * cosine_vignetting(CAMERA, SHAPE)
    tifffile.imwrite(tmp_path / "photo.tif", (lit + 0.04) ** (1 / 1.3))
    preparation = ps.Preparation(ambient=0.04 ** (1 / 1.3), vignetting="cos4", mean_filter=3)
    photo = ps.read_photo(tmp_path / "photo.tif")
    calibration = ps.calibrate([(photo, NEAR)], CAMERA, preparation=preparation, fit="gain,exponent")
    assert calibration.exponent == pytest.approx(1.3, abs=0.01)
    assert calibration.values["gain"] == pytest.approx(0.24, rel=0.01)
    prepared = ps.prepare_photo(photo, CAMERA, calibration.preparation)
    solution = ps.reconstruct(prepared.light, CAMERA, light=calibration.light)
    assert ps.compare(solution.depth, NEAR).mean < 0.01


def test_what_is_saturated_tells_nothing(tmp_path: Path) -> None:
    light = ps.FlashLight()
    image = ps.render(NEAR, CAMERA, light=light)
    levels = np.minimum(np.rint(255.0 * image / (0.7 * image.max())), 255).astype(np.uint8)
    tifffile.imwrite(tmp_path / "photo.tif", levels)
    photo = ps.read_photo(tmp_path / "photo.tif", encoding="linear")
    calibration = ps.calibrate([(photo, NEAR)], CAMERA)
    assert calibration.values["gain"] == pytest.approx(1.0 / (0.7 * image.max()), rel=0.01)
    rows, columns = np.nonzero(levels == 255)
    known = np.stack([columns, rows, NEAR[rows, columns]], axis=1)
    with pytest.raises(
        ps.InputError, match=rf"photo.tif: of {len(known)} known depths none lies where the photo tells"
    ):
        ps.calibrate([(photo, known)], CAMERA)


@pytest.mark.thorough
def test_large_photos_are_reduced() -> None:
    light = ps.FlashLight(gain=0.8, offset=(0.1, 0.0, 0.0))
    large = ps.bump((260, 300), light=light, surface="toward", relief=0.4, focal_length=300.0, noise=0.02)
    rows, columns = np.random.default_rng(0).integers(5, 255, (2, 80))
    known = np.stack([columns, rows, large.depth[rows, columns]], axis=1)
    steps: list[int] = []
    calibration = ps.calibrate(
        [(large.image, known)], large.camera, fit="gain,lamp", callback=lambda step, _error: steps.append(step)
    )
    assert steps == [*range(1, len(steps) + 1)]
    assert calibration.values["gain"] == pytest.approx(0.8, rel=0.01)
    assert calibration.values["lamp_x"] == pytest.approx(0.1, abs=0.01)


UNTOLD: dict[str, tuple[dict[str, Any], dict[str, str]]] = {
    "flat and evenly lit": (
        {"light": ps.ParallelLight(), "fit": "direction,white,exponent", "truth": np.full(SHAPE, 2.0)},
        {
            "exponent": "cannot be told apart",
            "p0": "hardly depend on the slope of the light along x",
            "q0": "hardly depend on the slope of the light along y",
        },
    ),
    "white under a flash": ({"fit": "gain,white"}, {"white": "the gain is the brightness of white"}),
    "one paint all over": ({"fit": "gain,albedo"}, {"albedo": "a gain or a white level that is so much lower"}),
}


@pytest.mark.parametrize("case", UNTOLD)
def test_what_cannot_be_told_is_said_and_not_guessed(case: str) -> None:
    keywords, reasons = UNTOLD[case]
    keywords = dict(keywords)
    truth = keywords.pop("truth", NEAR)
    light = keywords.get("light", ps.FlashLight())
    # Seen so narrowly that no ray tells of the direction.
    camera = ps.Camera(1e6) if light.normalised else CAMERA
    calibration = ps.calibrate([(0.5 * ps.render(truth, camera, light=light), truth)], camera, **keywords)
    assert calibration.reasons.keys() == reasons.keys()
    for name, reason in reasons.items():
        assert reason in calibration.reasons[name]
        assert name not in calibration.values
    assert calibration.light == (light if light.normalised else ps.FlashLight(gain=calibration.values["gain"]))
    assert calibration.exponent == 1.0


def test_where_nothing_is_told_all_stays() -> None:
    flat = np.full(SHAPE, 2.0)
    calibration = ps.calibrate(
        [(np.full(SHAPE, 0.5), flat)], ps.Camera(1e6), light=ps.ParallelLight(), fit="vignetting", white_level=0.5
    )
    assert calibration.values == {}
    assert "hardly depend on the power of the vignetting" in calibration.reasons["vignetting"]
    assert calibration.preparation.vignetting == "none"
    assert calibration.before == calibration.after
    assert repr(calibration).startswith("<Calibration not told: vignetting, brightness error ")


def test_it_is_said_in_a_line() -> None:
    calibration = ps.calibrate([(ps.render(NEAR, CAMERA, light=ps.FlashLight(gain=0.8)), NEAR)], CAMERA)
    assert repr(calibration).startswith("<Calibration gain=0.8±")
    assert "\n" not in repr(calibration)


PHOTO = ps.render(NEAR, CAMERA, light=ps.FlashLight())
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no pairs": ({"pairs": []}, r"pairs=\[\] is empty: give at least one \(photo, truth\)"),
    "no list": ({"pairs": 3}, r"pairs=3 is no list: give \[\(photo, truth\), ...\]"),
    "no pair": ({"pairs": [(PHOTO,)]}, r"pairs\[0\] has 1 entries: give a photo and what is known of its depth"),
    "a path": ({"photo": "a.png"}, r"photo='a.png' is a path: give read_photo\(path\)"),
    "negative light": ({"photo": -PHOTO}, "photo goes down to -.*: light cannot be negative. Clip it at 0"),
    "another size": ({"truth": NEAR[1:]}, r"truth has shape \(71, 72\): give a depth map of the photo's shape"),
    "no depth": ({"truth": -NEAR}, "is not a distance in front of the camera"),
    "nothing known": ({"truth": np.full(SHAPE, np.nan)}, "truth has no known depth at any pixel that mask leaves"),
    "points elsewhere": ({"truth": [[500.0, 3.0, 1.0]] * 9}, "truth has no known depth at any pixel that mask leaves"),
    "points of no depth": ({"truth": [[5.0, 3.0, -1.0]] * 9}, "truth has points that are not finite, or no depth"),
    "too few points": (
        {"truth": points(NEAR, 3, 0), "fit": "gain,exponent,lamp"},
        r"truth has 3 known depths that can be used, and 5 numbers are sought \(gain, exponent, lamp_x, .*give more",
    ),
    "a mask that hides all": ({"mask": np.zeros(SHAPE, bool)}, "no pixel of the photo is left: of 5184, all are"),
    "a mask of another size": ({"mask": np.ones((3, 3), bool)}, "mask is bool of shape .*give a bool array of the pho"),
    "masks of another number": ({"mask": [None, None]}, "mask has 2 entries for 1 photos: give one for all, or one a"),
    "cameras of another number": ({"camera": [CAMERA] * 2}, "camera has 2 entries for 1 photos: give one for all"),
    "no camera": ({"camera": 590.0}, "camera=590.0 is no Camera"),
    "an unknown gain that is not sought": (
        {"light": ps.FlashLight(gain=None), "fit": "lamp"},
        "fit='lamp' leaves out gain, which is not known",
    ),
    "no callback": ({"callback": 3}, "callback=3 cannot be called"),
    "an unknown word": ({"fit": "gian"}, "fit='gian' is nothing that can be fitted. Is it gain. Give some of gain, wh"),
    "no word": ({"fit": ()}, r"fit=\(\) asks for nothing: give some of gain"),
    "no words": ({"fit": 3}, "fit=3 is no list of words"),
    "direction of a flash": (
        {"fit": "direction"},
        r"fit='direction' is that of a parallel light: give light=ParallelLight",
    ),
    "lamp of the sun": (
        {"fit": "lamp", "light": ps.ParallelLight()},
        r"fit='lamp' is the place of a flash that fades with distance: give light=FlashLight\(\), or fit direction",
    ),
    "gain of the sun": (
        {"fit": "gain", "light": ps.ParallelLight()},
        "fit='gain' is that of a flash: give light=FlashLight",
    ),
    "roughness of a smooth surface": (
        {"fit": "roughness"},
        r"give reflectance=OrenNayar\(roughness=0.3\), where the fit begins",
    ),
    "gloss of a matt surface": (
        {"fit": "gloss"},
        r"is that of a shiny material: give reflectance=Phong\(\), where the fit begins",
    ),
    "points under the sun": (
        {"light": ps.ParallelLight(), "truth": points(NEAR, 60, 0)},
        "truth has no slopes that can be believed, and under light=ParallelLight.* give a dense depth map",
    ),
    "points without fall-off": (
        {"light": ps.FlashLight(falloff=False), "truth": points(NEAR, 60, 0)},
        "truth has no slopes that can be believed",
    ),
    "slopes of points": (
        {"truth": points(NEAR, 60, 0), "normals": "truth"},
        "normals='truth' is for a dense truth: points have no slopes. Give normals='solution'",
    ),
    "slopes of a sparse map": (
        {"truth": np.where(np.indices(SHAPE).sum(axis=0) % 2, NEAR, np.nan), "normals": "truth"},
        "normals='truth' is for a dense truth: of the pixels with a known depth 0% have neighbours",
    ),
    "unknown normals": ({"normals": "both"}, 'normals=\'both\' is unknown: choose "auto", "truth" or "solution"'),
    "a plate and a law": (
        {"fit": "vignetting", "preparation": ps.Preparation(vignetting=np.ones(SHAPE))},
        "fit='vignetting' is known by the white plate of the preparation: leave one of them out",
    ),
    "no preparation": ({"preparation": 3}, "preparation=3 is none"),
    "no brightness": ({"light": ps.ParallelLight(), "white_level": 0.0}, "white_level=0.0 is not a brightness"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_used_is_refused(case: str) -> None:
    changed, message = REFUSED[case]
    keywords = {"photo": PHOTO, "truth": NEAR, "camera": CAMERA, **changed}
    pairs = [(keywords.pop("photo"), keywords.pop("truth"))]
    with pytest.raises(ps.InputError, match=message):
        ps.calibrate(**{"pairs": pairs, **keywords})


def test_which_of_several_is_refused_is_said() -> None:
    dark = ps.Preparation(ambient=np.zeros((3, 4)))
    with pytest.raises(ps.InputError, match=r"pairs\[0\]: ambient is float64 of shape \(3, 4\): give an array of"):
        ps.calibrate([(PHOTO, NEAR), (PHOTO, NEAR)], CAMERA, preparation=dark)
    with pytest.raises(ps.InputError, match=r"pairs\[1\]: truth has shape \(3, 4\)"):
        ps.calibrate([(PHOTO, NEAR), (PHOTO, np.ones((3, 4)))], CAMERA)
