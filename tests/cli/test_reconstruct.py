"""``persfs-cl reconstruct``: from a photo's file to a folder of results."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
import trimesh
from command import FILES, FOCAL, HEIGHT, SCENE, WIDTH, names, png, run, strict
from PIL import Image

import persfs_cl as ps
from persfs_cl import colour
from persfs_cl.cli.reconstruct import _of_guide
from persfs_cl.io.export import write_depth
from persfs_cl.io.maps import read_depth
from persfs_cl.io.photos import read_photo
from persfs_cl.preparation import normalise as grey
from persfs_cl.preparation.correct import cosine_vignetting
from persfs_cl.preparation.prepare import Preparation, prepare_photo


def test_reconstruct_writes_every_file(photo: Path, tmp_path: Path) -> None:
    folder = tmp_path / "made" / "here.png"  # a suffix does not make a file of it
    outcome = run("reconstruct", photo, "-o", folder, *FOCAL)
    assert outcome.status == 0
    assert names(folder) == FILES
    assert {Path(line) for line in outcome.stdout.splitlines()} == {folder / name for name in FILES}

    image = grey.normalise_linear(read_photo(photo).image)
    expected = ps.reconstruct(image, ps.Camera(WIDTH))
    np.testing.assert_array_equal(np.load(folder / "depth.npy"), expected.depth)
    np.testing.assert_array_equal(read_depth(folder / "depth.tiff"), expected.depth.astype(np.float32))
    assert ps.compare(expected.depth, SCENE.depth).mean < 0.1 * np.ptp(SCENE.depth)
    assert f"CONVERGED after {expected.iterations} iterations" in outcome.stderr
    assert len(trimesh.load_mesh(folder / "mesh.ply", process=False).vertices) == HEIGHT * WIDTH

    report = strict(folder / "report.json")
    assert report["status"] == "CONVERGED"
    assert report["parameters"]["principal_point"] == [(WIDTH - 1) / 2, (HEIGHT - 1) / 2]
    rim = 2 * (HEIGHT + WIDTH) - 4
    assert report["known"] == {"pixels": rim, "assumed": "z = 1 on the edge of the image or mask"}
    unsaid = dict.fromkeys(("fov", "principal_point", "distortion", "size", "device"))
    assert report["requested"] == {**unsaid, "focal_length": WIDTH}
    assert report["camera"] == {
        "source": "focal_length",
        "horizontal_view": pytest.approx(np.degrees(2 * np.arctan(0.5))),
    }
    assert f"Focal length {WIDTH} pixels, by --focal-length: 53.1 degrees from left to right." in outcome.stderr
    assert report["iterations"] == len(report["changes"]) == expected.iterations
    assert report["photo"] == {
        "path": str(photo),
        "mask": None,
        "walls": None,
        "known_depth": None,
        "albedo": None,
        "near": None,
        "far": None,
        "guide": None,
        "channel": "luminance",
        "encoding": "srgb",
        "bits": 16,
        "size": [WIDTH, HEIGHT],
        "tone_exponent": 1,
        "ambient": 0,
        "below_ambient_pixels": 0,
        "vignetting": "none",
        "saturation": 0.98 * 65535,
        "saturated_pixels": np.count_nonzero(SCENE.image >= colour.decode_srgb(0.98)),
        "despeckle": True,
        "speck_pixels": 0,
        "highlights": "keep",
        "specular_pixels": None,
        "masked_pixels": 0,
        "filled_pixels": 0,
        "clip_highlights": None,
        "clipped_pixels": 0,
        "denoise": 0,
        "mean_filter": 1,
        "mask_erode": 0,
        "mask_pixels": HEIGHT * WIDTH,
        "normalise": "linear",
        "white_percentile": 99.5,
        "black": 0,
        "white": grey.brightest_diffuse(read_photo(photo).image),
        "white_pixels": np.count_nonzero(image == 1),
    }


@pytest.mark.usefixtures("quick")
def test_every_option_reaches_the_solver(photo: Path, tmp_path: Path) -> None:
    known = tmp_path / "known.npy"
    write_depth(known, SCENE.known_depth)
    options = {
        "surface": "toward",
        "boundary": "fixed",
        "scheme": "lax-friedrichs",
        "ordering": "checkerboard",
        "max_iterations": 7,
        "tolerance": 1e-3,
        "max_slope": 12.5,
        "precision": "float64" if ps.devices()[0].has_float64 else "float32",
    }
    texts = [f"--{name.replace('_', '-')}={value}" for name, value in options.items()]
    camera = ("--focal-length", "30,31", "--principal-point", "14,11.5", "--light", "parallel")
    files = ("--known-depth", known, "--device", "0")
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *camera, "--p0=0.1", "--q0=-0.2", *files, *texts)
    assert outcome.status == 0
    parameters = strict(tmp_path / "out" / "report.json")["parameters"]
    assert parameters["focal_length"] == [30, 31]
    assert parameters["principal_point"] == [14, 11.5]
    assert parameters["light"] == {"kind": "ParallelLight", "p0": 0.1, "q0": -0.2}
    assert {name: parameters[name] for name in options} == options
    report = strict(tmp_path / "out" / "report.json")
    assert report["known"] == {"pixels": int(np.isfinite(SCENE.known_depth).sum()), "assumed": None}
    unsaid = dict.fromkeys(("fov", "distortion", "size"))
    requested = {"focal_length": [30, 31], "principal_point": [14, 11.5], "device": "0"}
    assert report["requested"] == {**unsaid, **requested}
    assert "MAX_ITERATIONS after 7 iterations" in outcome.stderr
    depth = np.load(tmp_path / "out" / "depth.npy")
    given = np.isfinite(SCENE.known_depth)
    np.testing.assert_array_equal(depth[given], SCENE.known_depth[given])


FLASH = ("--light", "flash", "--gain", "0.8", "--scheme", "upwind", "--accuracy-order", "2", "--max-slope", "9")


# By the order whose kernels are compiled most quickly.
ROUGH = ("--reflectance", "oren-nayar", "--roughness", "0.25", "--ordering", "lexicographic")


@pytest.mark.usefixtures("quick")
def test_flash_material_and_albedo_reach_the_solver(tmp_path: Path) -> None:
    light, reflectance = ps.FlashLight(gain=0.8), ps.OrenNayar(0.25)
    camera = ps.Camera(WIDTH)
    albedo = np.where(np.arange(WIDTH) < 12, 0.5, 1.0) * np.ones((HEIGHT, 1))
    image = ps.render(SCENE.depth, camera, light=light, reflectance=reflectance, albedo=albedo)
    tifffile.imwrite(tmp_path / "photo.tif", image)
    np.save(tmp_path / "albedo.npy", albedo)
    files = ("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, "--albedo", tmp_path / "albedo.npy")
    outcome = run(*files, *FLASH, *ROUGH)
    assert outcome.status == 0
    assert "(0 to 255), from the photo itself by ME" in outcome.stderr, "nothing was done to it"
    report = strict(tmp_path / "out" / "report.json")
    given = {"kind": "FlashLight", "falloff": True, "gain": 0.8, "offset": [0, 0, 0]}
    assert report["parameters"]["light"] == given
    assert report["parameters"]["reflectance"] == {"kind": "OrenNayar", "roughness": 0.25}
    wanted = {"scheme": "upwind", "accuracy_order": 2, "max_slope": 9, "ordering": "lexicographic"}
    assert wanted.items() <= report["parameters"].items()
    assert (report["known"], report["photo"]["normalise"]) == ({"pixels": 0, "assumed": None}, "none")
    assert report["photo"]["albedo"] == str(tmp_path / "albedo.npy")
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert ps.compare(depth, SCENE.depth).mean < 0.05 * np.ptp(SCENE.depth), "depth in its unit, with nothing known"


def test_a_guide_tells_the_gain_and_is_told_of(tmp_path: Path) -> None:
    scene = ps.bump((HEIGHT, WIDTH), light=ps.FlashLight(), focal_length=WIDTH)
    tifffile.imwrite(tmp_path / "photo.tif", scene.image)
    rows, columns = np.mgrid[2:HEIGHT:3, 2:WIDTH:3].reshape(2, -1)
    depths = 2000.0 * scene.depth[rows, columns]
    np.savetxt(tmp_path / "points.csv", np.column_stack([columns, rows, depths]), delimiter=",")
    options = ("--light=flash", "--gain=unknown", "--guide", tmp_path / "points.csv", "--guide-unit=0.001")
    saved = "--save=depth.npy,report,guide.png,page"
    outcome = run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, *options, saved)
    assert outcome.status == 0, outcome.stderr
    np.testing.assert_allclose(np.load(tmp_path / "out" / "depth.npy"), 2.0 * scene.depth, rtol=0.01)
    report = strict(tmp_path / "out" / "report.json")
    assert report["guide"]["gain"] == report["parameters"]["light"]["gain"] == pytest.approx(4.0, rel=0.02)
    assert (report["guide"]["cells"], report["photo"]["guide"]) == (len(rows), str(tmp_path / "points.csv"))
    assert f"{report['guide']['used']} of {len(rows)} values used, the gain is" in outcome.stderr
    assert (tmp_path / "out" / "guide.png").stat().st_size > 1000
    assert '"guide":' in (tmp_path / "out" / "index.html").read_text()


def test_of_a_guide_that_is_a_prior_it_is_told_how_far_the_surface_differs(tmp_path: Path) -> None:
    scene = ps.bump((HEIGHT, WIDTH), light=ps.ParallelLight(0.3), focal_length=WIDTH)
    tifffile.imwrite(tmp_path / "photo.tif", scene.image)
    np.save(tmp_path / "guide.npy", scene.depth.reshape(HEIGHT // 3, 3, WIDTH // 3, 3).mean(axis=(1, 3)))
    options = (*FOCAL, "--guide", tmp_path / "guide.npy", "--scheme=regularised", "--save=depth")
    told = run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *options, "--p0=-1").stderr
    assert "the surface differs from it by up to" in told
    assert "% at 95 % of the pixels. That is far more than the noise: check the light's direction" in told
    assert "nearer than it" not in told


@pytest.mark.parametrize(("apart", "warned"), [(0.0, False), (0.04, False), (0.06, True)])
def test_a_surface_far_from_its_guide_is_warned_of(apart: float, warned: bool) -> None:
    departure = np.full((4, 5), -apart)
    departure[0] = np.nan
    fit = ps.GuideFit(9, 9, 1.0, 0.01, 0.0, False, 0.01, 1.0, 0.0, None, departure)
    told = _of_guide(fit, bounded=False)
    assert f"by up to {100 * np.expm1(apart):.2g} % at" in told
    assert ("check the light" in told) == warned
    assert "may be 1 % nearer than it." in _of_guide(fit, bounded=True)


@pytest.mark.usefixtures("quick")
def test_bounds_of_the_depth_are_numbers_or_files(tmp_path: Path) -> None:
    scene = ps.bump((HEIGHT, WIDTH), light=ps.FlashLight(), focal_length=WIDTH)
    tifffile.imwrite(tmp_path / "photo.tif", scene.image)
    near = float(np.median(scene.depth))
    far = np.where(np.arange(WIDTH) < 8, 1.02 * near, np.nan) + np.zeros((HEIGHT, 1))
    np.save(tmp_path / "far.npy", far)
    bounds = (f"--near={near!r}", "--far", tmp_path / "far.npy")
    outcome = run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, "--light=flash", *bounds)
    assert outcome.status == 0
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert depth.min() == near
    assert (depth[:, :8].max(), far[0, 0]) == (far[0, 0], 1.02 * near)
    report = strict(tmp_path / "out" / "report.json")
    assert (report["photo"]["near"], report["photo"]["far"]) == (near, str(tmp_path / "far.npy"))
    at_bound = int(((depth == near) | (depth == far)).sum())
    assert report["pixels"]["at_bound"] == at_bound
    assert f"{at_bound} pixels lie on a bound of the depth" in outcome.stderr


@pytest.mark.usefixtures("quick")
def test_the_place_of_the_lamp_may_be_an_angle(tmp_path: Path) -> None:
    light = ps.FlashLight(offset=(0.0, -math.tan(math.radians(6)), 0.05))
    scene = ps.hillside((HEIGHT, WIDTH), light=light, focal_length=WIDTH)
    tifffile.imwrite(tmp_path / "photo.tif", scene.image)
    lamp = ("--light=flash", "--lamp=0,-6deg,0.05")
    outcome = run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, *lamp)
    assert outcome.status == 0
    median = np.median(np.load(tmp_path / "out" / "depth.npy"))
    assert f"--lamp counts in the unit of --gain 1, in which the median depth is {median:.4g}" in outcome.stderr
    told = run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "told", *FOCAL, *lamp, "--gain=1")
    assert (told.status, "counts in the unit" in told.stderr) == (0, False)
    given = strict(tmp_path / "out" / "report.json")["parameters"]["light"]["offset"]
    assert given == pytest.approx(light.offset)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("normalise", ["linear", "grey", "none"])
def test_brightness_is_clipped_then_filtered_then_normalised(normalise: str, photo: Path, tmp_path: Path) -> None:
    options = ("--clip-highlights=80", "--mean-filter=3", "--normalise", normalise, "--encoding=linear")
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, *options)
    assert outcome.status == 0

    clipped, highlights = grey.clip_highlights(read_photo(photo, encoding="linear").image, percentile=80)
    smooth = grey.mean_filter(clipped, 3)
    image = {"linear": grey.normalise_linear(smooth), "grey": grey.normalise_grey(smooth), "none": smooth}[normalise]
    expected = ps.reconstruct(image, ps.Camera(WIDTH))
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "depth.npy"), expected.depth)
    said = strict(tmp_path / "out" / "report.json")["photo"]
    assert said["clipped_pixels"] == np.count_nonzero(highlights) > 0
    assert said["white_pixels"] == np.count_nonzero(image >= 1)

    # The photo itself at the same white: neither clipped nor filtered, and stretched as E was.
    light = read_photo(photo, encoding="linear").image
    black, white = {
        "linear": (0.0, np.percentile(smooth, 99.5)),
        "grey": (smooth.min(), smooth.max()),
        "none": (0.0, 1.0),
    }[normalise]
    itself = np.clip((light - black) / (white - black), 0.0, 1.0)
    report = strict(tmp_path / "out" / "report.json")
    for name, reference in (("grey_levels", image), ("grey_levels_photo", itself)):
        errors = ps.compare(255 * np.clip(expected.render(), 0, 1), 255 * reference)
        assert report[name]["mean_error"] == pytest.approx(errors.mean, rel=1e-9)
        assert report[name]["root_mean_square"] == pytest.approx(errors.root_mean_square, rel=1e-9)
        assert f"by ME {errors.mean:.2f}, RS {errors.root_mean_square:.2f}" in outcome.stderr
    assert report["grey_levels"]["mean_error"] != report["grey_levels_photo"]["mean_error"]
    assert "from the prepared photo (clipped, filtered) by" in outcome.stderr


@pytest.mark.usefixtures("quick")
def test_alpha_mask_and_walls_are_combined(tmp_path: Path) -> None:
    opaque, mask, walls = np.ones((3, HEIGHT, WIDTH), dtype=bool)
    opaque[:4] = False
    mask[:, :5] = False
    walls[:] = False
    walls[:, 20] = True
    levels = np.rint(255 * colour.encode_srgb(SCENE.image)).astype(np.uint8)
    colours = np.stack([levels, levels // 2, levels // 3, 255 * opaque.astype(np.uint8)], axis=-1)
    Image.fromarray(colours).save(tmp_path / "photo.png")
    Image.fromarray(mask).save(tmp_path / "mask.png")
    np.save(tmp_path / "walls.npy", walls)
    files = ("--mask", tmp_path / "mask.png", "--walls", tmp_path / "walls.npy")
    outcome = run("reconstruct", tmp_path / "photo.png", "-o", tmp_path / "out", *FOCAL, *files)
    assert outcome.status == 0
    solved = np.isfinite(np.load(tmp_path / "out" / "depth.npy"))
    np.testing.assert_array_equal(solved, opaque & mask)
    mesh: Any = trimesh.load_mesh(tmp_path / "out" / "mesh.ply", process=False)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], colours[solved][:, :3])
    report = strict(tmp_path / "out" / "report.json")
    said, count = report["photo"], int((opaque & mask & walls).sum())
    assert said["mask"] == str(tmp_path / "mask.png")
    assert said["walls"] == str(tmp_path / "walls.npy")
    assert (report["pixels"]["walls"], report["pixels"]["walls_solved"]) == (count, count)
    assert report["confidence"]["doubtful_pixels"]["on a wall"] == count
    assert f"{count} of {count} pixels on walls" in outcome.stderr
    # Between any two rows the wall costs one square, whichever sides its pixels are on.
    height, width = HEIGHT - 4, WIDTH - 5
    assert len(mesh.faces) == 2 * (height - 1) * (width - 2)


@pytest.mark.usefixtures("quick")
def test_one_iteration_is_no_plural(photo: Path, tmp_path: Path) -> None:
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--max-iterations=1")
    assert "after 1 iteration in" in outcome.stderr


@pytest.mark.usefixtures("quick")
def test_walls_nowhere_change_nothing(tmp_path: Path) -> None:
    photo, walls = tmp_path / "photo.png", tmp_path / "walls.png"
    Image.fromarray(np.rint(200 * SCENE.image).astype(np.uint8)).save(photo)
    Image.fromarray(np.zeros((HEIGHT, WIDTH), np.uint8)).save(walls)
    assert run("reconstruct", photo, "-o", tmp_path / "without", *FOCAL).status == 0
    outcome = run("reconstruct", photo, "-o", tmp_path / "with", *FOCAL, "--walls", walls)
    assert outcome.stderr.endswith(f"{walls} has no white pixel where the photo is solved: there are no walls.")
    one, other = (np.load(tmp_path / name / "depth.npy") for name in ("without", "with"))
    np.testing.assert_array_equal(one, other)
    reports = [strict(tmp_path / name / "report.json")["photo"] for name in ("without", "with")]
    assert reports[0]["normalise"] == reports[1]["normalise"] == "linear"


@pytest.mark.usefixtures("quick")
def test_camera_from_exif_or_field_of_view(tmp_path: Path) -> None:
    jpeg, out = tmp_path / "photo.jpg", tmp_path / "out"
    picture = Image.fromarray(np.rint(255 * SCENE.image).astype(np.uint8))
    picture.save(jpeg)
    outcome = run("reconstruct", jpeg, "-o", out)
    assert outcome.status == 1
    assert all(text in outcome.stderr for text in (str(jpeg), "--focal-length", "--fov"))
    assert not out.exists()

    exif = Image.Exif()
    exif.get_ifd(0x8769)[41989] = 50  # FocalLengthIn35mmFilm
    picture.save(jpeg, exif=exif)
    outcome = run("reconstruct", jpeg, "-o", out, "--principal-point=14,12")
    assert outcome.status == 0
    assert "pixels, by EXIF FocalLengthIn35mmFilm: " in outcome.stderr
    left, right = 14.5 / ps.Camera.from_exif(jpeg).fx, (WIDTH - 14.5) / ps.Camera.from_exif(jpeg).fx
    view = pytest.approx(np.degrees(np.arctan(left) + np.arctan(right)))
    assert strict(out / "report.json")["camera"] == {"source": "EXIF FocalLengthIn35mmFilm", "horizontal_view": view}
    parameters = strict(out / "report.json")["parameters"]
    assert parameters["focal_length"] == [ps.Camera.from_exif(jpeg).fx] * 2
    assert parameters["principal_point"] == [14, 12]

    assert run("reconstruct", jpeg, "-o", out, "--overwrite", "--fov", "60").status == 0
    assert strict(out / "report.json")["requested"]["fov"] == 60
    assert strict(out / "report.json")["camera"] == {"source": "fov", "horizontal_view": pytest.approx(60.0)}
    expected = ps.Camera.from_fov(60.0, (HEIGHT, WIDTH)).fx
    assert strict(out / "report.json")["parameters"]["focal_length"] == [expected] * 2


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("files", ["arrays", "pictures"])
def test_ambient_light_and_vignetting_are_undone(files: str, tmp_path: Path) -> None:
    camera = ps.Camera(WIDTH)
    lens, ambient = cosine_vignetting(camera, (HEIGHT, WIDTH)), np.full((HEIGHT, WIDTH), 0.125)
    ambient[3:9, 4:11] = 0.25
    tifffile.imwrite(tmp_path / "photo.tif", 0.5 * SCENE.image * lens + ambient)
    for name, light in (("lens", 0.75 * lens), ("dark", ambient)):
        if files == "arrays":
            np.save(tmp_path / f"{name}.npy", light)
        else:
            tifffile.imwrite(tmp_path / f"{name}.tif", light)
    suffix = "npy" if files == "arrays" else "tif"
    dark, plate = tmp_path / f"dark.{suffix}", tmp_path / f"lens.{suffix}"
    expected = ps.reconstruct(grey.normalise_linear(SCENE.image), camera)
    for law in (plate, "cos4"):
        options = ("--ambient", dark, "--vignetting", law, "--overwrite")
        assert run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, *options).status == 0
        np.testing.assert_allclose(np.load(tmp_path / "out" / "depth.npy"), expected.depth, rtol=1e-5)
        report = strict(tmp_path / "out" / "report.json")
        assert (report["photo"]["ambient"], report["photo"]["vignetting"]) == (str(dark), str(law))
        assert "less tone curve, ambient light and vignetting" in report["grey_levels_photo"]["compared_with"]
        assert report["grey_levels_photo"]["mean_error"] == pytest.approx(report["grey_levels"]["mean_error"], 1e-3)


@pytest.mark.usefixtures("quick", "in_this_process")
def test_a_tone_curve_and_the_white_level_are_told(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "photo.tif", (0.5 * SCENE.image) ** (1 / 1.4))
    expected = ps.reconstruct(SCENE.image, ps.Camera(WIDTH))
    options = ("--tone-exponent=1.4", "--white-level=0.5")
    assert run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, *options).status == 0
    np.testing.assert_allclose(np.load(tmp_path / "out" / "depth.npy"), expected.depth, rtol=1e-5)
    said = strict(tmp_path / "out" / "report.json")
    assert (said["photo"]["tone_exponent"], said["photo"]["white"]) == (1.4, 0.5)
    assert "less tone curve" in said["grey_levels_photo"]["compared_with"]
    assert run("batch", tmp_path / "photo.tif", "-o", tmp_path / "many", *FOCAL, *options, "--save=depth").status == 0
    np.testing.assert_allclose(tifffile.imread(tmp_path / "many" / "photo.tif" / "depth.tiff"), expected.depth, 1e-5)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--tone-exponent=0",), "0.0 is no exponent: give a number from 0.1 to 10"),
        (("--white-level=0",), "0.0 is not a finite number above 0"),
        (("--white-level=1", "--normalise=grey"), "'--white-level': goes with --normalise linear"),
        (("--white-level=1", "--white-percentile=99"), "instead of --white-percentile: leave one of them out"),
        (("--white-level=1", "--light=flash"), "'--white-level': under a flash nothing is normalised"),
    ],
)
def test_impossible_tones_are_refused(options: tuple[str, ...], said: str, photo: Path, tmp_path: Path) -> None:
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, *options)
    assert outcome.status == 2
    assert said in outcome.stderr


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("highlights", ["mask", "fill"])
def test_highlights_are_left_out_or_filled(highlights: str, tmp_path: Path) -> None:
    levels = np.rint(200 * SCENE.image).astype(np.uint8)
    levels[8, 12], levels[0, 20] = 255, 255
    Image.fromarray(levels).save(tmp_path / "photo.png")
    options = ("--encoding=linear", "--ambient=10", "--white-percentile=98", "--saturation=254")
    files = ("reconstruct", tmp_path / "photo.png", "-o", tmp_path / "out", *FOCAL)
    assert run(*files, *options, "--highlights", highlights).status == 0
    gone = np.zeros((HEIGHT, WIDTH), bool)
    gone[6:11, 10:15] = gone[:3, 18:23] = True
    said = strict(tmp_path / "out" / "report.json")["photo"]
    counts = {"mask": (gone.sum(), 0), "fill": (0, gone.sum())}[highlights]
    doubtful = strict(tmp_path / "out" / "report.json")["confidence"]["doubtful_pixels"]
    assert (doubtful["highlight, left out"], doubtful["highlight, filled"]) == counts
    assert (doubtful["saturated"], doubtful["any"]) == (2, gone.sum() + doubtful["darker than the ambient light"])
    assert (said["masked_pixels"], said["filled_pixels"]) == counts
    assert (said["highlights"], said["saturated_pixels"], said["saturation"]) == (highlights, 2, 254)
    assert (said["ambient"], said["white_percentile"]) == (10, 98)

    photo = read_photo(tmp_path / "photo.png", encoding="linear")
    chosen: Any = highlights
    prepared = prepare_photo(photo, ps.Camera(WIDTH), Preparation(ambient=10, saturation=254, highlights=chosen))
    image = prepared.normalised(percentile=98)
    assert said["white"] == image.report["white"]
    # The edge of a hole is no edge of the image: only the latter has depth 1.
    frame = np.full((HEIGHT, WIDTH), 1.0)
    frame[1:-1, 1:-1] = np.nan
    expected = ps.reconstruct(image.image, ps.Camera(WIDTH), mask=prepared.mask, known_depth=frame)
    depth = np.load(tmp_path / "out" / "depth.npy")
    np.testing.assert_array_equal(depth, expected.depth)
    np.testing.assert_array_equal(np.isnan(depth), prepared.masked & np.isnan(frame))
    if highlights == "mask":
        assert np.nanmin(depth[5:12, 9:16]) > 1


def test_acceleration_is_an_option_and_an_entry_of_a_configuration(photo: Path, tmp_path: Path) -> None:
    (tmp_path / "plain.toml").write_text("acceleration = false\n", encoding="utf-8")
    given: list[str | Path] = ["reconstruct", photo, *FOCAL, "--scheme", "lax-friedrichs", "--save", "report"]
    for more, expected in (
        ([], True),
        (["--no-acceleration"], False),
        (["--config", tmp_path / "plain.toml"], False),
    ):
        folder = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        assert run(*given, *more, "-o", folder).status == 0
        assert strict(folder / "report.json")["parameters"]["acceleration"] is expected


def test_few_pixels_that_are_too_dark_are_told_of(tmp_path: Path) -> None:
    image = SCENE.image.copy()
    image[10:12, 10:12] = 0.0
    png(tmp_path / "spots.png", image)
    outcome = run("reconstruct", tmp_path / "spots.png", "-o", tmp_path / "out", *FOCAL, "--save", "depth.npy")
    assert "4 pixels, 0.56 % of those with a depth, are too dark for the light" in outcome.stderr
    assert "warning" not in outcome.stderr


@pytest.mark.filterwarnings("always:")
def test_an_object_before_a_dark_background_without_a_mask_is_told_of(tmp_path: Path) -> None:
    rows, columns = np.indices((20, 24)) - np.array([[[9.5]], [[11.5]]])
    moon = np.sqrt(np.clip(1.0 - (rows**2 + columns**2) / 7.0**2, 0.0, 1.0))
    Image.fromarray((255 * moon).astype(np.uint8)).save(tmp_path / "moon.png")
    saved = ("--save", "depth.npy,report,page")
    outcome = run("reconstruct", tmp_path / "moon.png", "-o", tmp_path / "out", "--fov", "2", *saved)
    assert outcome.status == 0
    assert "warning: --known-depth is not given, and the edge of the image is taken for flat ground" in outcome.stderr
    assert "half of it has at most 0 % of the brightness" in outcome.stderr
    assert outcome.stderr.count("of those with a depth") == 1
    warned = strict(tmp_path / "out" / "report.json")["warnings"]
    assert warned[0].startswith("--known-depth is not given")
    assert "% of those with a depth, are too dark for the light, and only --max-slope bounds" in warned[1]
    assert "Check it: --p0 and --q0 for one from the side, --light flash for a lamp at the camera." in warned[1]
    assert all(f"persfs-cl: warning: {text}" in outcome.stderr for text in warned)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    [record] = json.loads(page.partition('<script id="records" type="application/json">')[2].partition("</script>")[0])
    assert record["warnings"] == warned
