"""The command line, end to end: files, numbers, messages and exit statuses."""

from __future__ import annotations

import errno
import inspect
import io
import json
import math
import os
import signal
import subprocess
import sys
import time
import typing
import warnings
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
import trimesh
from command import run
from numpy.typing import NDArray
from PIL import Image

import persfs_cl as ps
from persfs_cl._cl import device as device_room
from persfs_cl.cli.interrupts import raising, stop_on_interrupt
from persfs_cl.cli.output import in_options
from persfs_cl.cli.progress import remaining_iterations
from persfs_cl.cli.reconstruct import reconstruct
from persfs_cl.io import files
from persfs_cl.io.photos import read_depth, read_photo, write_depth, write_grey
from persfs_cl.io.points import compare_points
from persfs_cl.preparation import normalise as grey
from persfs_cl.preparation.prepare import Preparation, cos4_vignetting, prepare_photo
from persfs_cl.solver import reconstruct as solver

FILES = {
    "depth.npy",
    "depth.tiff",
    "depth.png",
    "normals.png",
    "relief.png",
    "mesh.ply",
    "rendered.png",
    "comparison.png",
    "confidence.png",
    "convergence.png",
    "report.json",
}
HEIGHT, WIDTH = 24, 30
SCENE = ps.bump((HEIGHT, WIDTH))
FOCAL = ("--focal-length", str(WIDTH))


def strict(path: Path) -> dict[str, Any]:
    """A JSON file, with Python's NaN and Infinity refused."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{path} holds {name}")

    loaded: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    return loaded


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """The image of a smooth bump whose frame has depth 1, what the solver assumes."""
    path = tmp_path / "photo.png"
    write_grey(path, SCENE.image, 16)
    return path


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the pictures, which take far longer than the rest."""
    monkeypatch.setattr(ps.Solution, "_draw", lambda *_arguments: [])


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Python's own answer to Ctrl-C, which a test run in the background of a shell lacks; the usual ones to others."""
    previous = {signal.SIGINT: signal.signal(signal.SIGINT, signal.default_int_handler)}
    previous |= {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, answer in previous.items():
        signal.signal(number, answer)


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
    assert report["requested"] == {"focal_length": WIDTH, "fov": None, "principal_point": None, "device": None}
    assert report["camera"] == {
        "source": "--focal-length",
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
        "channel": "luminance",
        "encoding": "srgb",
        "bits": 16,
        "ambient": 0,
        "below_ambient_pixels": 0,
        "vignetting": "none",
        "saturation": 0.98 * 65535,
        "saturated_pixels": np.count_nonzero(SCENE.image >= grey.decode_srgb(0.98)),
        "highlights": "keep",
        "specular_pixels": None,
        "masked_pixels": 0,
        "filled_pixels": 0,
        "clip_highlights": None,
        "clipped_pixels": 0,
        "mean_filter": 1,
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
    requested = {"focal_length": [30, 31], "fov": None, "principal_point": [14, 11.5], "device": "0"}
    assert report["requested"] == requested
    assert "MAX_ITERATIONS after 7 iterations" in outcome.stderr
    depth = np.load(tmp_path / "out" / "depth.npy")
    given = np.isfinite(SCENE.known_depth)
    np.testing.assert_array_equal(depth[given], SCENE.known_depth[given])


FLASH = ("--light", "flash", "--gain", "0.8", "--scheme", "upwind", "--accuracy-order", "2", "--max-slope", "9")
ROUGH = ("--reflectance", "oren-nayar", "--roughness", "0.25")


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
    wanted = {"scheme": "upwind", "accuracy_order": 2, "max_slope": 9}
    assert wanted.items() <= report["parameters"].items()
    assert (report["known"], report["photo"]["normalise"]) == ({"pixels": 0, "assumed": None}, "none")
    assert report["photo"]["albedo"] == str(tmp_path / "albedo.npy")
    depth = np.load(tmp_path / "out" / "depth.npy")
    assert ps.compare(depth, SCENE.depth).mean < 0.05 * np.ptp(SCENE.depth), "depth in its unit, with nothing known"


def test_the_place_of_the_lamp_may_be_an_angle(tmp_path: Path) -> None:
    light = ps.FlashLight(offset=(0.0, -math.tan(math.radians(6)), 0.05))
    scene = ps.hillside((HEIGHT, WIDTH), light=light, focal_length=WIDTH)
    tifffile.imwrite(tmp_path / "photo.tif", scene.image)
    lamp = ("--light=flash", "--lamp=0,-6deg,0.05")
    assert run("reconstruct", tmp_path / "photo.tif", "-o", tmp_path / "out", *FOCAL, *lamp).status == 0
    given = strict(tmp_path / "out" / "report.json")["parameters"]["light"]["offset"]
    assert given == pytest.approx(light.offset)


@pytest.mark.parametrize("white", [None, 2.0])
def test_render_with_a_flash(white: float | None, tmp_path: Path) -> None:
    write_depth(tmp_path / "depth.npy", 0.5 * SCENE.depth)
    options = ("--light=flash", "--gain=2", "--reflectance=phong", "--specular=0.2", "--bits=16", "--encoding=linear")
    limit = () if white is None else (f"--white={white}",)
    outcome = run("render", tmp_path / "depth.npy", "-o", tmp_path / "a.png", *FOCAL, *options, *limit)
    light, reflectance = ps.FlashLight(gain=2.0), ps.Phong(specular=0.2)
    expected = ps.render(0.5 * SCENE.depth, ps.Camera(WIDTH), light=light, reflectance=reflectance)
    brightest = white or expected.max()
    assert (outcome.status, outcome.stderr) == (0, f"White is a brightness of {brightest:g}.")
    written = read_photo(tmp_path / "a.png", encoding="linear").image
    np.testing.assert_allclose(written, (expected / brightest).clip(0, 1), atol=1e-5)


def test_choices_and_defaults_are_those_of_the_library() -> None:
    types = typing.get_type_hints(reconstruct)
    command, library = inspect.signature(reconstruct).parameters, inspect.signature(ps.reconstruct).parameters
    for name, choices in solver._CHOICES.items():
        # Of orderings both look at one registry: see tests/_cl/test_toy_ordering.py.
        if name != "ordering":
            assert typing.get_args(types[name]) == choices
    for name in (*solver._CHOICES, "max_iterations", "tolerance", "max_slope"):
        assert command[name].default == library[name].default


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
    levels = np.rint(255 * grey.encode_srgb(SCENE.image)).astype(np.uint8)
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
    assert strict(out / "report.json")["camera"] == {"source": "--fov", "horizontal_view": pytest.approx(60.0)}
    expected = ps.Camera.from_fov(60.0, (HEIGHT, WIDTH)).fx
    assert strict(out / "report.json")["parameters"]["focal_length"] == [expected] * 2


@pytest.mark.usefixtures("quick")
def test_warnings_that_are_to_be_errors_are_lines_too(photo: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # as PYTHONWARNINGS=error does
        outcome = run("reconstruct", photo, "-o", tmp_path / "millimetres", "--focal-length=8")
    assert outcome.status == 1
    assert outcome.stderr.startswith("persfs-cl: --focal-length 8 means a view of 124 degrees")
    assert not (tmp_path / "millimetres").exists()


@pytest.mark.usefixtures("quick")
@pytest.mark.filterwarnings("default")
def test_warnings_are_lines_in_the_words_of_the_command(photo: Path, tmp_path: Path) -> None:
    # Told in millimetres, of a lens for a sensor of 36 mm.
    outcome = run("reconstruct", photo, "-o", tmp_path / "millimetres", "--focal-length=8")
    assert outcome.status == 0
    assert outcome.stderr.startswith(
        "persfs-cl: warning: --focal-length 8 means a view of 124 degrees from left to right of the 30 pixels: it is "
        "in pixels, not millimetres. CONVERGED"
    )
    assert strict(tmp_path / "millimetres" / "report.json")["camera"]["horizontal_view"] > 120
    assert "warning" not in run("reconstruct", photo, "-o", tmp_path / "fov", "--fov=150").stderr
    assert "warning" not in run("reconstruct", photo, "-o", tmp_path / "pixels", "--focal-length=9").stderr

    flash = ps.bump((HEIGHT, WIDTH), light=ps.FlashLight())
    tifffile.imwrite(tmp_path / "flash.tif", flash.image)
    lamp = ("--light=flash", "--scheme=lax-friedrichs", "--lamp=0.8,0,0")
    outcome = run("reconstruct", tmp_path / "flash.tif", "-o", tmp_path / "lamp", *FOCAL, *lamp)
    assert "persfs-cl: warning: --light flash is too far from the camera" in outcome.stderr
    assert "UserWarning" not in outcome.stderr
    assert ".py" not in outcome.stderr


def png(path: Path, image: NDArray[np.floating]) -> None:
    write_grey(path, image, encoding="linear")


def truncated(path: Path) -> None:
    stream = io.BytesIO()
    Image.fromarray(np.rint(255 * SCENE.image).astype(np.uint8)).save(stream, "PNG")
    path.write_bytes(stream.getvalue()[:-200])


def with_nan(path: Path) -> None:
    image = SCENE.image.astype(np.float32)
    image[3, 4] = np.nan
    tifffile.imwrite(path, image)


def transparent(path: Path) -> None:
    levels = np.arange(72, dtype=np.uint8).reshape(8, 9)
    Image.fromarray(np.stack([levels, np.zeros_like(levels)], axis=-1)).save(path)


BAD_PHOTOS: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "nan": ("photo.tiff", with_nan, "1 NaN"),
    "black": ("photo.png", lambda path: png(path, np.zeros((8, 9))), "every pixel to solve is black"),
    "constant": (
        "photo.png",
        lambda path: png(path, np.full((8, 9), 128 / 255)),
        "constant, 0.2159 in linear light (128 of 255 in sRGB) at each of 72 pixels",
    ),
    "constant floats": (
        "photo.tiff",
        lambda path: tifffile.imwrite(path, np.full((8, 9), 3.5, np.float32)),
        "constant, 3.5 in linear light at each",
    ),
    "transparent": ("photo.png", transparent, "of 72, 72 are transparent."),
    "text": ("photo.png", lambda path: path.write_text("no image"), "not a PNG, JPEG or TIFF image"),
    "truncated": ("photo.png", truncated, "broken"),
    "empty": ("photo.png", lambda path: path.touch(), "empty"),
    "missing": ("photo.png", lambda _path: None, "does not exist"),
    "folder": ("photo.png", lambda path: path.mkdir(), "is a folder"),
}


@pytest.mark.parametrize("case", BAD_PHOTOS)
def test_bad_photo(case: str, tmp_path: Path) -> None:
    name, make, message = BAD_PHOTOS[case]
    make(tmp_path / name)
    before = names(tmp_path)
    outcome = run("reconstruct", tmp_path / name, "-o", tmp_path / "out", "--focal-length=30")
    assert (outcome.status, outcome.stdout) == (1, "")
    assert str(tmp_path / name) in outcome.stderr
    assert message in outcome.stderr
    assert names(tmp_path) == before


def corner(value: float) -> NDArray[np.float64]:
    depth = np.full((HEIGHT, WIDTH), np.nan)
    depth[0, 0] = value
    return depth


BAD_OPTIONS: dict[str, tuple[tuple[str, ...], int, tuple[str, ...]]] = {
    "mask of another size": (("--mask=small.png",), 1, ("small.png", "(5, 6)")),
    "mask that selects nothing": (("--mask=black.png",), 1, ("photo.png", "no pixel", "720 are outside black.png.")),
    "walls everywhere": (("--walls=white.png",), 1, ("photo.png", "no pixel", "720 are in white.png.")),
    "shading clipped away": (("--clip-highlights=0.01",), 1, ("photo.png", "same everywhere", "--clip-highlights")),
    "missing mask": (("--mask=none.png",), 1, ("none.png", "does not exist")),
    "known depth of 0": (("--known-depth=zero.npy",), 1, ("zero.npy", "above 0")),
    "negative known depth": (("--known-depth=negative.npy",), 1, ("negative.npy", "above 0")),
    "known depth out of reach": (("--mask=half.png", "--known-depth=one.npy"), 1, ("photo.png", "can reach")),
    "filter larger than the photo": (("--mean-filter=99",), 1, ("photo.png", "99")),
    "principal point far outside": (("--principal-point=5000,3",), 1, ("photo.png", "--principal-point 5000,3", "85")),
    "unknown device": (("--device=abacus",), 3, ("abacus", ps.devices()[0].name)),
    "device out of range": (("--device=99",), 3, ("--device 99", "leave it out")),
    "focal length 0": (("--focal-length=0",), 2, ("--focal-length", "0", "between 0.001")),
    "negative focal length": (("--focal-length=-5",), 2, ("--focal-length", "-5")),
    "focal length nan": (("--focal-length=nan",), 2, ("--focal-length", "nan")),
    "focal length as text": (("--focal-length=long",), 2, ("--focal-length", "long")),
    "three focal lengths": (("--focal-length=1,2,3",), 2, ("--focal-length", "1,2,3")),
    "one coordinate": (("--principal-point=3",), 2, ("--principal-point", "two numbers")),
    "two cameras": (("--focal-length=30", "--fov=60"), 2, ("--focal-length", "--fov", "not both")),
    "field of view of 180°": (("--fov=180",), 2, ("--fov", "180")),
    "light at nan": (("--p0=nan",), 2, ("--p0", "nan")),
    "even filter": (("--mean-filter=4",), 2, ("--mean-filter", "odd")),
    "percentile of 0": (("--clip-highlights=0",), 2, ("--clip-highlights", "above 0")),
    "no iterations": (("--max-iterations=0",), 2, ("--max-iterations",)),
    "negative tolerance": (("--tolerance=-1",), 2, ("--tolerance",)),
    "tolerance nan": (("--tolerance=nan",), 2, ("--tolerance",)),
    "slope of 0": (("--max-slope=0",), 2, ("--max-slope", "above 0")),
    "unknown surface": (("--surface=up",), 2, ("for '--surface': 'up'", "away", "toward")),
    "unknown boundary": (("--boundary=open",), 2, ("open", "outflow", "extrapolate", "fixed", "wall")),
    "unknown light": (("--light=candle",), 2, ("candle", "parallel", "flash")),
    "gain of a parallel light": (("--gain=2",), 2, ("--gain", "goes with --light flash, not parallel")),
    "fall-off of a parallel light": (("--no-falloff",), 2, ("--no-falloff", "goes with --light flash")),
    "lamp of a parallel light": (("--lamp=0,0,0",), 2, ("--lamp", "goes with --light flash")),
    "slope of a flash": (("--light=flash", "--p0=0"), 2, ("--p0", "goes with --light parallel, not flash")),
    "gain of 0": (("--light=flash", "--gain=0"), 2, ("--gain", "above 0")),
    "flat lamp": (("--light=flash", "--lamp=1,2"), 2, ("--lamp", "1,2", "three numbers")),
    "lamp at a right angle": (("--light=flash", "--lamp=90deg,0,0"), 2, ("--lamp", "90deg,0,0", "between -80 and 80")),
    "lamp at no angle": (("--light=flash", "--lamp=1.2.3deg,0,0"), 2, ("--lamp", "1.2.3deg,0,0", "as in 5deg")),
    "flash with a side": (("--light=flash", "--surface=toward"), 2, ("--surface toward", "Leave the option out")),
    "normalised flash": (("--light=flash", "--normalise=grey"), 2, ("--normalise", "leave it out")),
    "white flash": (("--light=flash", "--white-percentile=99"), 2, ("--white-percentile", "leave it out")),
    "flash without size": (("--light=flash", "--no-falloff"), 1, ("photo.png", "--known-depth", "--light flash")),
    "unknown material": (("--reflectance=velvet",), 2, ("velvet", "lambertian", "oren-nayar", "phong")),
    "roughness of phong": (("--reflectance=phong", "--roughness=1"), 2, ("--roughness", "oren-nayar, not phong")),
    "highlight of a matt surface": (("--shininess=5",), 2, ("--shininess", "phong, not lambertian")),
    "how rough": (("--reflectance=oren-nayar",), 2, ("--roughness", "needs it")),
    "too rough": (("--reflectance=oren-nayar", "--roughness=2"), 2, ("--roughness 2.0", "π/2")),
    "albedo of another size": (("--albedo=small.png",), 1, ("small.png", "(5, 6)")),
    "black paint": (("--albedo=black.png",), 1, ("photo.png", "albedo")),
    "third order": (("--accuracy-order=3",), 2, ("--accuracy-order",)),
    "second order of the paper's scheme": (("--accuracy-order=2",), 2, ("--accuracy-order 2", "Use --scheme upwind")),
    "unknown scheme": (("--scheme=best",), 2, ("best", "auto", "lax-friedrichs", "upwind")),
    "unknown option": (("--focus=3",), 2, ("--focus",)),
}


@pytest.mark.parametrize("case", BAD_OPTIONS)
def test_bad_option(case: str, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options, status, messages = BAD_OPTIONS[case]
    monkeypatch.chdir(tmp_path)
    png(Path("small.png"), np.ones((5, 6)))
    png(Path("black.png"), np.zeros((HEIGHT, WIDTH)))
    png(Path("white.png"), np.ones((HEIGHT, WIDTH)))
    png(Path("half.png"), np.arange(WIDTH) // (WIDTH // 2) * np.ones((HEIGHT, 1)))
    for name, value in (("zero", 0.0), ("negative", -1.0), ("one", 1.0)):
        np.save(f"{name}.npy", corner(value))
    before = names(tmp_path)
    camera = () if any(option.startswith(("--focal-length", "--fov")) for option in options) else FOCAL
    outcome = run("reconstruct", photo.name, "-o", "out", *camera, *options)
    assert (outcome.status, outcome.stdout) == (status, "")
    for message in messages:
        assert message in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert names(tmp_path) == before


OPTIONS = ("--scheme", "--known-depth", "--max-slope", "--principal-point", "--light", "--surface")
SPELLINGS = {
    "photo.png: boundary='wall' with scheme='upwind'.": "photo.png: boundary='wall' with --scheme upwind.",
    "Leave the keyword out, or give known_depth.": "Leave the option out, or give --known-depth.",
    "max_slope=-1e-05: max_slope=1.5. (max_slope=nan)": "--max-slope -1e-05: --max-slope 1.5. (--max-slope nan)",
    "principal_point=(500, 3.5) is far outside": "--principal-point 500,3.5 is far outside",
    "light=FlashLight(gain=1.0, offset=(0, 0, 0)) fades": "--light flash fades",
    "the surface, --max-slope, and a keyword": "the surface, --max-slope, and a keyword",
    "a/known_depth/b max_slope=3.png known_depth.npy": "a/known_depth/b max_slope=3.png known_depth.npy",
}


@pytest.mark.parametrize("message", SPELLINGS)
def test_keywords_become_options(message: str) -> None:
    assert in_options(message, OPTIONS) == SPELLINGS[message]


def test_output_folder_is_checked_before_the_photo_is_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    places = {"file": "is a file", "file/below": "Not a directory", "full": "--overwrite", "x" * 300: "too long"}
    for place, message in places.items():
        outcome = run("reconstruct", tmp_path / "missing.png", "-o", tmp_path / place, *FOCAL)
        assert (outcome.status, outcome.stdout) == (2, "")
        assert message in outcome.stderr
        assert "missing.png" not in outcome.stderr
    assert names(tmp_path) == {"file", "full"}
    assert names(tmp_path / "full") == {"mine"}


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder in which even root can create nothing")
def test_output_folder_must_be_writable() -> None:
    outcome = run("reconstruct", "missing.png", "-o", "/proc/self/out", *FOCAL)
    assert outcome.status == 2
    assert "/proc/self/out cannot be written" in outcome.stderr


@pytest.mark.usefixtures("quick")
def test_overwrite_replaces_results_and_keeps_other_files(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine").write_text("mine")
    (out / "depth.npy").write_text("old")
    assert run("reconstruct", photo, "-o", out, *FOCAL, "--overwrite").status == 0
    assert (out / "mine").read_text() == "mine"
    assert np.load(out / "depth.npy").shape == (HEIGHT, WIDTH)
    assert names(out) == {"mine", "depth.npy", "depth.tiff", "mesh.ply", "report.json"}


@pytest.mark.parametrize("existing", [False, True])
def test_full_disk_leaves_nothing_behind(
    existing: bool, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    out = tmp_path / "above" / "out"
    if existing:
        out.mkdir(parents=True)
        (out / "depth.npy").write_text("old")
    monkeypatch.setattr(trimesh.Trimesh, "export", fail)  # after depth.npy and others
    outcome = run("reconstruct", photo, "-o", out, *FOCAL, "--overwrite")
    assert (outcome.status, outcome.stdout) == (1, "")
    assert f"{out / 'mesh.ply'} cannot be written: No space left on device" in outcome.stderr
    assert out.parent.exists() == existing
    if existing:
        assert names(out) == {"depth.npy"}
        assert (out / "depth.npy").read_text() == "old"


@pytest.mark.parametrize("failure", [ps.InputError("no"), KeyboardInterrupt()])
def test_a_demo_that_fails_leaves_nothing_behind(
    failure: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_arguments: object) -> None:
        raise failure

    monkeypatch.setattr(ps.Solution, "_draw", fail)
    assert run("demo", "-o", tmp_path / "a" / "b").status in (1, 130)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("quick")
def test_what_a_killed_run_left_does_not_fill_the_folder(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    left = out / f".persfs-cl-{files._machine()}-{'1' * 32}-abc"
    left.mkdir(parents=True)
    (left / "depth.npy").write_text("half")
    assert run("reconstruct", photo, "-o", out, *FOCAL).status == 0
    assert names(out) == {"depth.npy", "depth.tiff", "mesh.ply", "report.json"}


@pytest.mark.usefixtures("quick")
def test_nan_outside_the_mask_does_no_harm(tmp_path: Path) -> None:
    with_nan(tmp_path / "photo.tiff")
    inside = np.ones((HEIGHT, WIDTH), bool)
    inside[3, 4] = False
    np.save(tmp_path / "mask.npy", inside)
    options = ("-o", tmp_path / "out", *FOCAL, "--mean-filter=3")
    outcome = run("reconstruct", tmp_path / "photo.tiff", *options)
    assert outcome.status == 1
    assert "--mask" in outcome.stderr
    assert run("reconstruct", tmp_path / "photo.tiff", *options, "--mask", tmp_path / "mask.npy").status == 0
    np.testing.assert_array_equal(np.isfinite(np.load(tmp_path / "out" / "depth.npy")), inside)


def test_unexpected_error_keeps_its_traceback(photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_arguments: object, **_keywords: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("persfs_cl.pipeline.job.reconstruct", fail)
    with pytest.raises(ZeroDivisionError):
        run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)


def test_second_interrupt_writes_nothing(photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_arguments: object, **_keywords: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("persfs_cl.pipeline.job.reconstruct", interrupted)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)
    assert (outcome.status, outcome.stdout) == (130, "")
    assert "interrupted" in outcome.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupt_of_the_preparation_writes_nothing(
    number: signal.Signals, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def prepare(*_arguments: object, **_keywords: object) -> None:
        signal.raise_signal(number)
        pytest.fail("the preparation goes on")

    monkeypatch.setattr("persfs_cl.pipeline.job.prepare_photo", prepare)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)
    assert outcome == (130, "", "persfs-cl: interrupted.")
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("ctrl_c", "quick")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_comes_twice_at_once_keeps_what_there_is(
    number: signal.Signals, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def progress(*_arguments: object) -> Iterator[Callable[[int, float], None]]:
        def show(iteration: int, _change: float) -> None:
            for _ in range(2 * (iteration == 2)):  # as timeout sends it
                signal.raise_signal(number)

        yield show

    monkeypatch.setattr("persfs_cl.cli.reconstruct.progress_line", progress)
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL, "--tolerance=0")
    assert outcome.status == 130
    assert strict(tmp_path / "out" / "report.json")["status"] == "STOPPED"
    assert strict(tmp_path / "out" / "report.json")["iterations"] == 2
    assert names(tmp_path / "out") == {"depth.npy", "depth.tiff", "mesh.ply", "report.json"}


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(
    ("existing", "number"), [(False, signal.SIGINT), (True, signal.SIGINT), (True, signal.SIGTERM)]
)
def test_interrupt_of_the_pictures_keeps_the_rest(
    existing: bool, number: signal.Signals, photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    if existing:
        out.mkdir()
        (out / "relief.png").write_text("old")
    monkeypatch.setattr(ps.Solution, "_draw", lambda *_arguments: signal.raise_signal(number))
    outcome = run("reconstruct", photo, "-o", out, *FOCAL, "--overwrite")
    kept = {"depth.npy", "depth.tiff", "mesh.ply", "report.json"}
    assert outcome.status == 130
    assert {Path(line) for line in outcome.stdout.splitlines()} == {out / name for name in kept}
    assert names(out) == kept | ({"relief.png"} if existing else set())
    assert "depth, mesh and report are still written, the pictures are not" in outcome.stderr
    assert ("of an earlier run" in outcome.stderr) == existing
    assert strict(out / "report.json")["status"] == "CONVERGED"
    image = grey.normalise_linear(read_photo(photo).image)
    np.testing.assert_array_equal(np.load(out / "depth.npy"), ps.reconstruct(image, ps.Camera(WIDTH)).depth)


@pytest.mark.usefixtures("ctrl_c")
def test_second_interrupt_of_the_writing_leaves_nothing(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trimesh.Trimesh, "export", lambda *_arguments: signal.raise_signal(signal.SIGINT))
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL)
    assert (outcome.status, outcome.stdout) == (130, "")
    assert outcome.stderr.endswith("persfs-cl: interrupted.")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("module", ["typer", "persfs_cl.cli.reconstruct"])
def test_interrupt_of_the_start_is_quiet(module: str) -> None:
    script = f"""
import sys
class Interrupt:
    def find_spec(name, *_arguments):
        if name == {module!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt)
from persfs_cl.__main__ import main
main()
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "persfs-cl: interrupted.\n")


@pytest.mark.usefixtures("ctrl_c")
def test_stop_on_interrupt_asks_first_and_raises_then() -> None:
    with stop_on_interrupt() as asked:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert not asked(), "from here on there is something to keep"
        signal.raise_signal(signal.SIGINT)
        assert asked()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) == signal.default_int_handler
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


@pytest.mark.usefixtures("ctrl_c")
def test_stop_on_interrupt_leaves_an_ignored_interrupt_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with stop_on_interrupt() as asked:
        for _ in range(2):
            signal.raise_signal(signal.SIGINT)
            assert not asked()


@pytest.mark.usefixtures("ctrl_c")
def test_interrupt_in_a_weak_reference_ends_the_command() -> None:
    things = [{"some", "thing"}]
    reference = weakref.ref(things[0], lambda _reference: signal.raise_signal(signal.SIGINT))

    def draw() -> None:
        things.clear()  # Python drops what this raises
        assert reference() is None
        for _ in range(300):
            time.sleep(0.1)

    with pytest.raises(KeyboardInterrupt), raising():
        draw()


@pytest.mark.skipif(os.name != "posix", reason="needs a pseudo-terminal")
def test_progress_on_a_terminal_and_interrupt_of_a_real_run(tmp_path: Path) -> None:
    # From its one known peak a bump takes thousands of iterations to come to rest.
    scene = ps.bump((300, 300)).seeded()
    write_grey(tmp_path / "photo.png", scene.image, 16)
    write_depth(tmp_path / "known.npy", scene.known_depth)
    # A test run in the background of a shell would hand on that Ctrl-C is ignored.
    script = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    command = [sys.executable, "-c", f"{script}from persfs_cl.cli import main; main()"]
    command += ["reconstruct", "photo.png", "-o", "out", "--focal-length=300"]
    command += ["--known-depth=known.npy", "--surface", scene.surface, "--tolerance=0", "--max-iterations=1000000"]
    ours, theirs = os.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100"}
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=theirs) as process:
        os.close(theirs)
        seen, pressed = b"", False
        while chunk := read_or_end(ours):
            seen += chunk
            if b"iteration " in seen and b" left" in seen and not pressed:
                process.send_signal(signal.SIGINT)
                pressed = True
        stdout, _ = process.communicate()
    os.close(ours)
    assert process.returncode == 130, seen
    assert {Path(line).name for line in stdout.decode().splitlines()} == FILES
    assert names(tmp_path / "out") == FILES
    report = strict(tmp_path / "out" / "report.json")
    assert report["status"] == "STOPPED"
    assert 1 <= report["iterations"] < 1000000
    assert b"STOPPED after" in seen


def read_or_end(terminal: int) -> bytes:
    try:
        return os.read(terminal, 4096)
    except OSError:  # how Linux says that nobody writes to a pseudo-terminal any more
        return b""


def test_remaining_iterations() -> None:
    halves = [2.0**-k for k in range(11)]
    assert remaining_iterations(halves, 2.0**-30, 1000) == 20
    assert remaining_iterations(halves, 2.0**-30, 15) == 4
    assert remaining_iterations(halves, 2.0**-9, 1000) == 0
    for changes, tolerance in (([1.0], 0.1), (halves, 0.0), ([1.0, 2.0], 0.1), ([1.0, 0.0], 0.1)):
        assert remaining_iterations(changes, tolerance, 100) == 100 - len(changes)


@pytest.mark.parametrize(("suffix", "bits"), [(".png", 8), (".png", 16), (".tiff", 16)])
def test_render_is_the_forward_model(suffix: str, bits: int, tmp_path: Path) -> None:
    depth, image = tmp_path / "depth.tiff", tmp_path / f"image{suffix}"
    write_depth(depth, SCENE.depth)
    mask = np.arange(WIDTH) * np.ones((HEIGHT, 1)) > 5
    np.save(tmp_path / "mask.npy", mask)
    options = ("--p0=0.3", "--q0=-0.1", f"--bits={bits}", "--encoding=linear", "--mask", tmp_path / "mask.npy")
    outcome = run("render", depth, "-o", image, *FOCAL, *options)
    assert outcome == (0, f"{image}\n", "")
    light = ps.ParallelLight(0.3, -0.1)
    expected = ps.render(read_depth(depth), ps.Camera(WIDTH), light=light, mask=mask)
    written = read_photo(image, encoding="linear")
    assert written.bits == bits
    white = 2**bits - 1
    np.testing.assert_array_equal(written.image, np.rint(np.nan_to_num(expected).clip(0, 1) * white) / white)


def test_render_refuses(photo: Path, tmp_path: Path) -> None:
    depth, image = tmp_path / "depth.npy", tmp_path / "image.png"
    write_depth(depth, SCENE.depth)
    np.save(tmp_path / "unknown.npy", np.full((3, 3), np.nan))
    cases: list[tuple[Sequence[str | Path], int, str]] = [
        ((depth, "-o", image), 2, "--focal-length"),
        ((depth, "-o", image, *FOCAL, "--fov=50"), 2, "not both"),
        ((depth, "-o", image, *FOCAL, "--bits=12"), 2, "16"),
        ((depth, "-o", tmp_path / "image.jpg", *FOCAL), 2, ".tiff"),
        ((depth, "-o", tmp_path / "none" / "image.png", *FOCAL), 2, "not a folder"),
        ((depth, "-o", photo, *FOCAL), 2, "--overwrite"),
        ((photo, "-o", image, *FOCAL), 1, str(photo)),
        ((tmp_path / "unknown.npy", "-o", image, *FOCAL), 1, "unknown.npy"),
        ((depth, "-o", image, *FOCAL, "--principal-point=9999,0"), 1, "no lens"),
        ((depth, "-o", image, *FOCAL, "--device=abacus"), 3, "abacus"),
    ]
    for arguments, status, message in cases:
        outcome = run("render", *arguments)
        assert (outcome.status, outcome.stdout) == (status, "")
        assert message in outcome.stderr
    assert not image.exists()
    assert run("render", depth, "-o", photo, *FOCAL, "--overwrite").status == 0


@pytest.mark.parametrize("align", ["none", "scale", "range"])
def test_compare_depth_maps(align: str, tmp_path: Path) -> None:
    first, second = 2.5 * SCENE.depth + 0.1, SCENE.depth
    mask = SCENE.depth > 1.05
    write_depth(tmp_path / "a.npy", first)
    write_depth(tmp_path / "b.npy", second)
    np.save(tmp_path / "mask.npy", mask)
    files = (tmp_path / "a.npy", tmp_path / "b.npy", "--mask", tmp_path / "mask.npy")
    expected = ps.compare(first, second, mask=mask, align=None if align == "none" else align)  # type: ignore[arg-type]

    outcome = run("compare", *files, "--align", align, "--json")
    assert (outcome.status, outcome.stderr) == (0, "")
    result = json.loads(outcome.stdout)
    assert result.pop("unit") == ("share of the range" if align == "range" else "unit of the depth")
    assert result == vars(expected)

    rows = dict(line.split(maxsplit=1) for line in run("compare", *files, "--align", align).stdout.splitlines())
    assert float(rows["ME"]) == pytest.approx(expected.mean, rel=1e-5)
    assert float(rows["RS"]) == pytest.approx(expected.root_mean_square, rel=1e-5)
    assert float(rows["maximum"]) == pytest.approx(expected.maximum, rel=1e-5)
    assert float(rows["median"]) == pytest.approx(expected.median, rel=1e-5)
    assert int(rows["pixels"]) == mask.sum()


def test_compare_images_in_grey_levels(tmp_path: Path) -> None:
    first = np.array([[10, 20, 30], [40, 50, 60]], dtype=np.uint8)
    second = np.array([[10, 21, 33], [40, 50, 0]], dtype=np.uint8)
    opaque = np.array([[255, 255, 255], [255, 255, 0]], dtype=np.uint8)
    Image.fromarray(first).save(tmp_path / "a.png")
    Image.fromarray(np.stack([second, opaque], axis=-1)).save(tmp_path / "b.png")
    tifffile.imwrite(tmp_path / "a.tiff", first)
    for name, options in (("a.png", ()), ("a.tiff", ()), ("a.tiff", ("--kind=image",))):
        files = (tmp_path / name, tmp_path / "b.png")
        result = json.loads(run("compare", *files, "--encoding=linear", "--json", *options).stdout)
        assert result["mean"] == pytest.approx(4 / 5)
        assert result["root_mean_square"] == pytest.approx(np.sqrt(10 / 5))
        assert (result["count"], result["unit"]) == (5, "grey levels")
    decoded = 255 * (grey.decode_srgb(33 / 255) - grey.decode_srgb(30 / 255))
    result = json.loads(run("compare", tmp_path / "a.png", tmp_path / "b.png", "--json").stdout)
    assert result["maximum"] == pytest.approx(decoded)


def test_compare_refuses(photo: Path, tmp_path: Path) -> None:
    one, other, nan = tmp_path / "one.npy", tmp_path / "other.npy", tmp_path / "nan.npy"
    np.save(one, np.ones((3, 4)))
    np.save(other, np.ones((4, 3)))
    np.save(nan, np.full((3, 4), np.nan))
    points, bad = tmp_path / "points.csv", tmp_path / "bad.json"
    points.write_text("1,2,3\n")
    headed = tmp_path / "headed.csv"
    headed.write_text("crop_column,y,z\n1,2,3\n")
    bad.write_text('[{"x": 1}]')
    cases: list[tuple[Sequence[str | Path], int, Sequence[str]]] = [
        ((one, other), 1, (str(one), str(other), "(3, 4)", "(4, 3)")),
        ((one, nan), 1, (str(one), str(nan), "can be compared")),
        ((one, one, "--align=range"), 1, ("range",)),
        ((one, photo), 1, (str(one),)),
        ((one, one, "--mask", photo), 1, (str(photo), "(3, 4)")),
        ((one, tmp_path / "missing.npy"), 1, ("missing.npy",)),
        ((one, points, "--align=range"), 2, ("none or scale",)),
        ((one, points, "--photo", photo), 1, (str(photo), "(3, 4)")),
        ((one, points, "--mask", photo), 1, (str(photo), "(3, 4)")),
        ((nan, points), 1, (str(points), "no depth at any")),
        ((one, bad), 1, (str(bad), "column, row and depth")),
        ((one, headed), 1, (f"{headed} has the headings 'crop_column, y, z', but column, row and depth are wanted",)),
        ((one, tmp_path / "missing.csv"), 1, ("missing.csv does not exist: check",)),
        ((one, one, "--photo", photo), 2, ("--photo", "points")),
        ((one, one, "--align=best"), 2, ("none", "scale", "range")),
        ((one,), 2, ("B",)),
    ]
    for arguments, status, messages in cases:
        outcome = run("compare", *arguments)
        assert (outcome.status, outcome.stdout) == (status, "")
        for message in messages:
            assert message in outcome.stderr


@pytest.mark.parametrize("form", ["names.csv", "numbers.csv", "list.json", "object.json"])
def test_compare_with_points(form: str, tmp_path: Path) -> None:
    estimate = np.full((6, 8), np.nan)
    estimate[1, 1:5] = 1.0, 2.0, 3.0, 6.0
    write_depth(tmp_path / "depth.npy", estimate)
    # By the scale 2, the median, two are right, one is 1/3 too high, and one a third too low; two have no estimate.
    truth = [(1.2, 0.8, 2.0), (2.0, 1.0, 4.0), (2.6, 1.0, 4.5), (4.0, 1.4, 18.0), (0.0, 0.0, 7.0), (99.0, 1.0, 7.0)]
    named = [dict(zip(("column", "row", "depth"), point, strict=True)) for point in truth]
    lines = [",".join(map(str, point)) for point in truth]
    texts = {
        "names.csv": "\n".join(["id,row,depth,column", *(f"a,{y},{z},{x}" for x, y, z in truth)]),
        "numbers.csv": "\n".join(lines),
        "list.json": json.dumps(named),
        "object.json": json.dumps({"points": named}),
    }
    (tmp_path / form).write_text(texts[form])
    photo = np.full((6, 8), 0.5)
    photo[1, 1:5] = 1.0, 0.25, 1 / 9, 0.0
    tifffile.imwrite(tmp_path / "photo.tif", photo)
    files = ("compare", tmp_path / "depth.npy", tmp_path / form)
    options = ("--align=scale", "--photo", tmp_path / "photo.tif")
    outcome = run(*files, *options, "--json")
    left_out = "1 beside the depth map, 1 where there is no depth."
    assert outcome.stderr == f"2 of 6 points are left out: {left_out}"
    rows = json.loads(outcome.stdout)
    third = 1 / 3
    expected = {"mean_relative": (third + third) / 4, "rank_correlation": 1.0, "count": 4, "scale": 2.0}
    assert rows["depth"] == pytest.approx(expected)
    constant = np.mean([abs(4.25 / z - 1) for z in (2, 4, 4.5, 18)])
    assert rows["constant"] == {**rows["constant"], "mean_relative": pytest.approx(constant), "rank_correlation": None}
    # The black point is left out; 1, 2 and 3 by the scale 2.
    assert rows["1/sqrt(I)"] == pytest.approx({**expected, "mean_relative": third / 3, "count": 3})

    table = run(*files, *options).stdout.splitlines()
    assert table[1].split() == ["depth", f"{(third + third) / 4:.4f}", "1.0000", "4", "2"]
    unscaled = json.loads(run(*files, "--json").stdout)["depth"]
    assert unscaled == pytest.approx({**expected, "mean_relative": np.mean([0.5, 0.5, third, 2 * third]), "scale": 1.0})


def test_compare_counts_points_outside_the_mask(tmp_path: Path) -> None:
    write_depth(tmp_path / "depth.npy", np.ones((3, 4)))
    np.save(tmp_path / "mask.npy", np.arange(4) * np.ones((3, 1)) > 1)
    (tmp_path / "points.csv").write_text("column,row,depth\n1,1,2\n2,1,2\n3,1,2\n")
    files = ("compare", tmp_path / "depth.npy", tmp_path / "points.csv")
    assert run(*files).stderr == ""
    outcome = run(*files, "--mask", tmp_path / "mask.npy")
    assert outcome.stderr == f"1 of 3 points are left out: 1 outside {tmp_path / 'mask.npy'}."


@pytest.mark.usefixtures("quick")
def test_compare_hints_at_the_unit_of_a_flash(photo: Path, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("1,1,2\n2,1,2\n")
    gain = ("--light=flash", "--gain=2")
    for name, options, hinted in (("flash", gain[:1], True), ("gain", gain, False), ("parallel", (), False)):
        depth = tmp_path / name / "depth.npy"
        assert run("reconstruct", photo, "-o", depth.parent, *FOCAL, *options).status == 0
        for other in (depth, tmp_path / "points.csv"):
            assert ("--align scale" in run("compare", depth, other).stderr) == hinted
            assert run("compare", depth, other, "--align=scale").stderr == ""
    for text in ("", "[1]", '{"parameters": 3}'):
        (tmp_path / "flash" / "report.json").write_text(text)
        assert run("compare", tmp_path / "flash" / "depth.npy", tmp_path / "points.csv").stderr == ""


def test_rank_correlation_with_ties() -> None:
    first, second = np.array([1.0, 2.0, 2.0, 5.0, 4.0]), np.array([3.0, 1.0, 1.0, 9.0, 9.0])
    ranks = np.array([1.0, 2.5, 2.5, 5.0, 4.0]), np.array([3.0, 1.5, 1.5, 4.5, 4.5])
    assert compare_points(first, second).rank_correlation == pytest.approx(np.corrcoef(*ranks)[0, 1])
    assert compare_points(-1 / first + 2, second).rank_correlation == compare_points(first, second).rank_correlation


def test_devices_lists_every_device() -> None:
    found = ps.devices()
    table = run("devices")
    assert table.status == 0
    listed = json.loads(run("devices", "--json").stdout)
    assert [entry["index"] for entry in listed] == list(range(len(found)))
    assert sum(entry["default"] for entry in listed) == 1
    for entry, device in zip(listed, found, strict=True):
        (row,) = (line for line in table.stdout.splitlines() if line.split()[:1] == [str(device.index)])
        assert (entry["name"], entry["kind"], entry["memory_bytes"]) == (device.name, device.kind, device.memory)
        assert entry["platform_version"] == device.platform_version
        for text in (device.name, device.platform, device.version, device.driver_version, device.kind):
            assert text in row
        assert entry["default"] == (f"{device.index} *" in row)


def test_devices_says_what_to_install_where_there_is_none(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device_room, "_all_devices", lambda: ())
    for arguments, stdout in ((("devices",), ""), (("devices", "--json"), "[]\n")):
        outcome = run(*arguments)
        assert (outcome.status, outcome.stdout) == (3, stdout)
        assert "pip install pocl-binary-distribution" in outcome.stderr
    assert run("reconstruct", photo, "-o", tmp_path / "out", *FOCAL).status == 3
    assert not (tmp_path / "out").exists()


def test_devices_reports_a_default_that_does_not_exist(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYOPENCL_CTX", "99")
    outcome = run("devices")
    assert outcome.status == 3
    assert ps.devices()[0].name in outcome.stdout
    assert "PYOPENCL_CTX" in outcome.stderr


def test_demo_needs_no_arguments_and_can_be_repeated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("demo")
    assert outcome.status == 0
    assert names(tmp_path / "demo-output" / "coin") == names(tmp_path / "demo-output" / "vase") == FILES
    scene = ps.vase()
    errors = ps.compare(np.load("demo-output/vase/depth.npy"), scene.depth, align="range")
    assert f"ME {errors.mean:.4f}, RS {errors.root_mean_square:.4f}" in outcome.stdout
    assert errors.mean < 0.0272 and errors.root_mean_square < 0.0559  # noqa: PT018  # the paper's
    report = strict(Path("demo-output/coin/report.json"))
    said = [outcome.stdout.index(text) for text in ("from the prepared photograph", "from the photograph itself")]
    for grey_levels, place in zip((report["grey_levels"], report["grey_levels_photo"]), said, strict=True):
        text = f"ME {grey_levels['mean_error']:.2f}, RS {grey_levels['root_mean_square']:.2f}"
        assert place < outcome.stdout.index(text) < place + 200
    coin = np.load("demo-output/coin/depth.npy")
    assert np.count_nonzero(np.isfinite(coin)) == 2861
    assert np.nanmax(coin) == 1
    for named in ("vase/relief.png", "coin/relief.png", "coin/comparison.png", "coin/mesh.ply"):
        assert str(Path("demo-output") / named) in outcome.stdout

    monkeypatch.setattr(ps.Solution, "_draw", lambda *_arguments: [])
    assert run("demo").status == 0


def test_help_and_version() -> None:
    assert run("--version") == (0, f"persfs-cl {ps.__version__}\n", "")
    overview = run("--help")
    assert overview.status == 0
    for name in ("reconstruct", "render", "compare", "devices", "demo"):
        assert name in overview.stdout
        assert run(name, "-h").status == 0
    assert run().status == 2
    assert run("reconstrct").status == 2
    details = run("reconstruct", "--help").stdout
    for name in inspect.signature(reconstruct).parameters:
        assert name == "photo" or f"--{name.replace('_', '-')}" in details
    for text in ("Camera", "Light", "Solver", "DEGREES", "persfs-cl reconstruct photo.jpg", "STOPPED"):
        assert text in details


def test_module_starts_without_what_help_does_not_need() -> None:
    heavy = ("PIL", "imageio", "matplotlib", "tifffile", "trimesh")
    script = f"""
import atexit, sys
atexit.register(lambda: print("loaded:", *{heavy!r} & sys.modules.keys()))
sys.argv = ["persfs-cl", "--help"]
from persfs_cl.__main__ import main
main()
""".replace(repr(heavy), repr(set(heavy)))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "Usage: persfs-cl" in done.stdout
    assert done.stdout.splitlines()[-1].strip() == "loaded:"


def test_module_as_a_command(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "persfs_cl", "reconstruct", "missing.png", "-o", "out", "--focal-length=3"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "missing.png does not exist" in done.stderr


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("files", ["arrays", "pictures"])
def test_ambient_light_and_vignetting_are_undone(files: str, tmp_path: Path) -> None:
    camera = ps.Camera(WIDTH)
    lens, ambient = cos4_vignetting(camera, (HEIGHT, WIDTH)), np.full((HEIGHT, WIDTH), 0.125)
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
        assert "less ambient light and vignetting" in report["grey_levels_photo"]["compared_with"]
        assert report["grey_levels_photo"]["mean_error"] == pytest.approx(report["grey_levels"]["mean_error"], 1e-3)


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


@pytest.mark.parametrize(
    ("options", "status", "messages"),
    [
        (("--ambient=-1",), 2, ("--ambient", "-1 is no brightness")),
        (("--ambient=nan",), 2, ("--ambient", "nan is no brightness")),
        (("--ambient=none.png",), 1, ("none.png", "does not exist")),
        (("--ambient=small.png",), 1, ("small.png", "(5, 6)")),
        (("--ambient=70000",), 1, ("photo.png", "--ambient 70000 is more than 65535")),
        (("--ambient=65535",), 1, ("photo.png", "No pixel is brighter than the ambient light")),
        (("--vignetting=cos5",), 1, ("cos5", "does not exist")),
        (("--vignetting=small.png",), 1, ("small.png", "(5, 6)")),
        (("--vignetting=black.png",), 1, ("photo.png", "vignetting is 0 or so at 720 pixels")),
        (("--highlights=remove",), 2, ("--highlights", "keep", "mask", "fill")),
        (("--highlights=mask", "--saturation=1"), 1, ("photo.png", "720 pixels are highlights")),
        (("--saturation=0",), 2, ("--saturation", "above 0")),
        (("--white-percentile=101",), 2, ("--white-percentile", "percentile")),
        (("--white-percentile=90", "--normalise=none"), 2, ("--white-percentile", "nothing is normalised")),
        (("--channel=max", "--ambient=photo.png"), 1, ("photo.png", "another channel")),
    ],
)
def test_bad_option_of_the_preparation(
    options: tuple[str, ...],
    status: int,
    messages: tuple[str, ...],
    photo: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    png(Path("small.png"), np.ones((5, 6)))
    png(Path("black.png"), np.zeros((HEIGHT, WIDTH)))
    before = names(tmp_path)
    outcome = run("reconstruct", photo.name, "-o", "out", *FOCAL, *options)
    assert (outcome.status, outcome.stdout) == (status, "")
    for message in messages:
        assert message in outcome.stderr
    assert names(tmp_path) == before


@pytest.mark.filterwarnings("default")
@pytest.mark.usefixtures("quick")
def test_a_mask_made_without_turning_the_photo_is_told_of(tmp_path: Path) -> None:
    samples = np.rint(255 * SCENE.image).astype(np.uint8)
    turned = Image.Exif()
    turned[0x0112] = 6
    Image.fromarray(np.rot90(samples)).save(tmp_path / "phone.png", exif=turned)
    Image.fromarray(np.full((WIDTH, HEIGHT), 255, np.uint8)).save(tmp_path / "mask.png")
    for option in ("--mask", "--walls", "--albedo", "--ambient", "--vignetting"):
        outcome = run(
            "reconstruct", tmp_path / "phone.png", "-o", tmp_path / "out", *FOCAL, option, tmp_path / "mask.png"
        )
        assert outcome.status == 1
        assert f"mask.png has shape ({WIDTH}, {HEIGHT}), and fits the photo as it lies in its file" in outcome.stderr
        assert "EXIF orientation 6: turned" in outcome.stderr
    turned[0x0112] = 3
    Image.fromarray(samples[::-1, ::-1]).save(tmp_path / "phone.png", exif=turned)
    Image.fromarray(np.full((HEIGHT, WIDTH), 255, np.uint8)).save(tmp_path / "mask.png")
    outcome = run(
        "reconstruct", tmp_path / "phone.png", "-o", tmp_path / "out", *FOCAL, "--mask", tmp_path / "mask.png"
    )
    assert outcome.status == 0
    assert "warning: The photo is read upright (EXIF orientation 3: turned by 180°)" in outcome.stderr


def test_what_exif_cannot_mean_names_the_tag_and_the_options_that_help(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[41989] = 65535  # FocalLengthIn35mmFilm
    Image.fromarray(np.rint(255 * SCENE.image).astype(np.uint8)).save(tmp_path / "photo.jpg", exif=exif)
    outcome = run("reconstruct", tmp_path / "photo.jpg", "-o", tmp_path / "out")
    assert outcome.status == 1
    assert "FocalLengthIn35mmFilm = 65535" in outcome.stderr
    assert "Give --focal-length, in pixels. Or give --fov" in outcome.stderr


@pytest.mark.filterwarnings("default")
@pytest.mark.usefixtures("quick")
def test_a_photo_that_an_editor_may_have_resized_is_warned_of_once(tmp_path: Path) -> None:
    exif = Image.Exif()
    tags = {37386: 50.0, 41486: 150.0, 41488: 2, 40962: WIDTH, 40963: HEIGHT}
    exif.get_ifd(0x8769).update(tags)
    Image.fromarray(np.rint(255 * SCENE.image).astype(np.uint8)).save(tmp_path / "photo.jpg", exif=exif)
    outcome = run("reconstruct", tmp_path / "photo.jpg", "-o", tmp_path / "out")
    assert outcome.status == 0
    assert outcome.stderr.count("persfs-cl: warning: By FocalPlaneXResolution with ExifImageWidth and") == 1
    assert "is 5.1 mm wide behind a lens of 50 mm, a view of 5.8°" in outcome.stderr
    assert "or give --focal-length, in pixels." in outcome.stderr


@pytest.mark.parametrize("command", ["reconstruct", "render", "compare", "points"])
def test_pipes_are_refused_at_once(tmp_path: Path, command: str) -> None:
    write_depth(tmp_path / "depth.npy", SCENE.depth)
    for name in ("pipe.npy", "pipe.csv", "pipe.json", "pipe.png"):
        os.mkfifo(tmp_path / name)
    commands: dict[str, tuple[str | Path, ...]] = {
        "reconstruct": ("reconstruct", tmp_path / "pipe.png", "-o", tmp_path / "out", *FOCAL),
        "render": ("render", tmp_path / "pipe.npy", "-o", tmp_path / "a.png", *FOCAL),
        "compare": ("compare", tmp_path / "depth.npy", tmp_path / "pipe.npy"),
        "points": ("compare", tmp_path / "depth.npy", tmp_path / "pipe.csv"),
    }
    outcome = run(*commands[command])
    assert outcome.status == 1
    assert "is a pipe, not a regular file" in outcome.stderr
