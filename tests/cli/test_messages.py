"""What the command says of input that it cannot use, and with which exit status."""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import tifffile
from command import FOCAL, HEIGHT, SCENE, WIDTH, names, png, run, strict
from numpy.typing import NDArray
from PIL import Image

import persfs_cl as ps
from persfs_cl.cli.app import _command
from persfs_cl.cli.spelling import spelling
from persfs_cl.io.export import write_depth
from persfs_cl.wording import keyword


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
    assert "means a view" not in run("reconstruct", photo, "-o", tmp_path / "fov", "--fov=150").stderr
    assert "warning" not in run("reconstruct", photo, "-o", tmp_path / "pixels", "--focal-length=9").stderr

    flash = ps.bump((HEIGHT, WIDTH), light=ps.FlashLight())
    tifffile.imwrite(tmp_path / "flash.tif", flash.image)
    lamp = ("--light=flash", "--scheme=lax-friedrichs", "--lamp=0.8,0,0")
    outcome = run("reconstruct", tmp_path / "flash.tif", "-o", tmp_path / "lamp", *FOCAL, *lamp)
    assert "persfs-cl: warning: --light flash is too far from the camera" in outcome.stderr
    assert "UserWarning" not in outcome.stderr
    assert ".py" not in outcome.stderr


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
    "text": ("photo.png", lambda path: path.write_text("no image"), "no image of a format that is read"),
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
    "light by another name": (("--light=sun",), 2, ("'sun' is not one of", "--light parallel", "--p0 and --q0")),
    "lamp at the camera": (("--light=Torch",), 2, ("'Torch' is not one of", "--light flash")),
    "lamp under a parallel light": (("--lamp=0,0,0",), 2, ("--lamp", "add --light flash, or leave it out")),
    "another photo": (
        ("b.png", "c.png"),
        2,
        ("b.png c.png is too much: 'persfs-cl reconstruct' takes PHOTO", "in quotes", "'persfs-cl batch'"),
    ),
    "angle in degrees": (("--distortion=fov:4",), 2, ("--distortion", "4 for ω", "4 degrees are 0.06981")),
    "too many coefficients": (
        (f"--distortion=rad_tan_thin_prism_fisheye:{'1,' * 12}1",),
        2,
        ("is not up to 12 numbers, k0 to k5",),
    ),
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
    "flash with a side": (("--light=flash", "--surface=toward"), 2, ("--surface toward", "Leave --surface out")),
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
    "bound of 0": (("--near=0",), 2, ("--near", "0.0 is not a depth")),
    "bound nan": (("--far=nan",), 2, ("--far", "nan is not a depth")),
    "bounds crossed": (("--near=2", "--far=1"), 2, ("--near 2.0 is beyond --far 1.0",)),
    "bounds crossed at a pixel": (("--near=2", "--far=one.npy"), 1, ("photo.png", "--near 2.0 beyond --far 1.0")),
    "bound of another size": (("--far=small.npy",), 1, ("small.npy", "(5, 6)")),
    "missing bound": (("--far=none.npy",), 1, ("none.npy", "does not exist")),
    "known depth out of bounds": (
        ("--near=2", "--known-depth=one.npy"),
        1,
        ("photo.png", "--known-depth 1.0 at pixel [0, 0] lies outside", "--near 2.0"),
    ),
    "no guide": (("--light=flash", "--guide=none.csv"), 1, ("none.csv", "does not exist")),
    "guide of no kind": (("--light=flash", "--guide=photo.jpeg"), 1, ("photo.jpeg", "no guide by its name")),
    "unit of 0": (("--guide=one.npy", "--guide-unit=0"), 2, ("--guide-unit", "above 0")),
    "gain of nothing": (("--light=flash", "--gain=unknown"), 2, ("--gain", "unknown", "--guide")),
    "gain of a word": (("--light=flash", "--gain=bright"), 2, ("--gain", "'bright'", "'unknown'")),
    "two unknowns": (("--light=flash", "--gain=unknown", "--guide-scale=fit"), 2, ("--guide-scale", "only one")),
    "scale of no guide": (("--light=flash", "--guide-scale=fit"), 2, ("--guide-scale fit is without --guide",)),
    "kind of no guide": (("--light=flash", "--guide-kind=inverse"), 2, ("--guide-kind inverse is without --guide",)),
    "tolerance of no guide": (("--guide-tolerance=0.01",), 2, ("--guide-tolerance 0.01 is without --guide",)),
    "unit of no guide": (("--guide-unit=0.001",), 2, ("--guide-unit 0.001 is without --guide",)),
    "paint of the sweeps": (("--albedo=fit", "--guide=none.npy"), 2, ("--albedo fit with --scheme", "regularised")),
    "paint without a guide": (("--albedo=fit", "--scheme=regularised"), 2, ("--albedo fit without --guide",)),
    "nothing to hang from": (("--near=2",), 1, ("photo.png", "No depth is known", "--far")),
    "third order": (("--accuracy-order=3",), 2, ("--accuracy-order",)),
    "second order of the paper's scheme": (
        ("--scheme=lax-friedrichs", "--accuracy-order=2"),
        2,
        ("--accuracy-order 2", "Use --scheme upwind"),
    ),
    "unknown scheme": (("--scheme=best",), 2, ("best", "auto", "lax-friedrichs", "upwind")),
    "unknown option": (("--focus=3",), 2, ("--focus",)),
    "a light as an option": (("--flash",), 2, ("No such option: --flash. Give --light flash.",)),
    "a scheme as an option": (("--upwind",), 2, ("No such option: --upwind. Give --scheme upwind.",)),
    "the sun as an option": (("--sun",), 2, ("No such option: --sun. Give --light parallel, and its direction",)),
    "a side as an option": (("--left",), 2, ("No such option: --left (",)),
    "a word of many options": (("--auto",), 2, ("No such option: --auto (",)),
    "a name that looks like an option": (("--", "--flash"), 2, ("--flash is too much",)),
    "a flag with no": (("--falloff", "no"), 2, ("--falloff no: --falloff takes no value, give --no-falloff.",)),
    "a flag with false": (("--overwrite", "False"), 2, ("--overwrite takes no value, leave both out.",)),
    "nothing for a file": (
        ("--mask", ""),
        2,
        ("--mask is empty, as a", "give FILE|auto, or leave --mask out."),
    ),
    "nothing for the photo": (("--falloff", ""), 2, ("An argument is empty, as a variable", "give PHOTO.")),
    "nothing after an equals sign": (("--output=",), 2, ("--output is empty", "give DIR.")),
    "a flag with yes": (("--no-falloff", "yes"), 2, ("--no-falloff takes no value, leave yes out.",)),
    "a word for a number": (("--p0=left",), 2, ("'--p0': 'left' is no", "Give 1 for a sun on the left")),
    "a unit by its name": (("--guide-unit=mm",), 2, ("'--guide-unit': 'mm' is no", "0.001 for millimetres")),
    "a decimal comma": (("--tone-exponent=2,2",), 2, ("'2,2' is no", "Write 2.2, with a point.")),
    "a word for a whole number": (("--max-iterations=many",), 2, ("'--max-iterations': 'many' is no",)),
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
    np.save("small.npy", np.ones((5, 6)))
    before = names(tmp_path)
    camera = () if any(option.startswith(("--focal-length", "--fov")) for option in options) else FOCAL
    outcome = run("reconstruct", photo.name, "-o", "out", *camera, *options)
    assert (outcome.status, outcome.stdout) == (status, "")
    for message in messages:
        assert message in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert names(tmp_path) == before


FLASH = ps.FlashLight(offset=(0.0, 1.0, 0.0))
SPELLINGS = {
    f"{keyword('scheme', 'upwind')} with {keyword('cell', 'wall')}.": "--scheme upwind with cell='wall'.",
    f"Leave {keyword('surface')} out, or give {keyword('known_depth')}.": "Leave --surface out, or give --known-depth.",
    f"{keyword('max_slope', -1e-5)}, {keyword('max_slope', np.nan)}.": "--max-slope -1e-05, --max-slope nan.",
    f"{keyword('max_slope', 1 / 3, written='0.33')}.": "--max-slope 0.33.",
    f"{keyword('principal_point', (500, 3.5))} is far outside": "--principal-point 500,3.5 is far outside",
    f"{keyword('light', FLASH)} fades": "--light flash fades",
    f"{keyword('light', ps.ParallelLight())} does not": "--light parallel does not",
    f"{keyword('falloff', False)} or {keyword('falloff', True)}": "--no-falloff or --falloff",
    f"{keyword('known_depth')} or {keyword('depth_range', (1, 2))}": "--known-depth or --near/--far",
    f"{keyword('gain', None)}, {keyword('offset')}": "--gain unknown, --lamp",
    f"{keyword('mask', object)} is none": "--mask is none",
    "the surface, --max-slope, and scheme='upwind'": "the surface, --max-slope, and scheme='upwind'",
}


@pytest.mark.parametrize("message", SPELLINGS)
def test_keywords_become_options(message: str) -> None:
    spell = spelling(_command("reconstruct").params)
    assert ps.InputError(message).worded(spell) == SPELLINGS[message]


def test_what_a_folder_holds_is_named_by_the_option_of_the_folder() -> None:
    spell = spelling(_command("batch").params, instead={"guide": "guides"})
    text = f"{keyword('guide')} holds -1: see {keyword('guide_scale', 'fit')} and {keyword('mask')}"
    assert ps.InputError(text).worded(spell) == "--guides holds -1: see --guide-scale fit and --mask"


def test_a_file_whose_name_looks_like_a_keyword_keeps_it(tmp_path: Path) -> None:
    name = "known_depth light=FlashLight() scheme='upwind'.png"
    outcome = run("reconstruct", tmp_path / name, "-o", tmp_path / "out", *FOCAL)
    assert outcome.status == 1
    assert f"{tmp_path / name} does not exist" in outcome.stderr


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


@pytest.mark.parametrize(
    ("options", "status", "messages"),
    [
        (("--ambient=-1",), 2, ("--ambient", "-1 is no brightness")),
        (("--ambient=nan",), 2, ("--ambient", "nan is no brightness")),
        (("--ambient=none.png",), 1, ("none.png", "does not exist")),
        (("--ambient=small.png",), 1, ("small.png", "(5, 6)")),
        (("--ambient=70000",), 1, ("photo.png", "--ambient 70000 is more than 65535")),
        (("--ambient=65535",), 1, ("photo.png", "No pixel is brighter than the ambient light")),
        (("--vignetting=cos^5",), 1, ("cos^5", "does not exist")),
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


def test_without_a_focal_length_it_is_told_how_to_come_to_one(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[37386] = 35.0  # FocalLength
    Image.new("L", (30, 24), 100).save(tmp_path / "photo.jpg", exif=exif)
    told = run("reconstruct", tmp_path / "photo.jpg", "-o", tmp_path / "out").stderr
    assert "Give --focal-length, in pixels: 35 mm, over the width of the sensor in mm, times the width" in told
    assert "Or give --fov, the horizontal field of view in degrees. Common cameras have 30 to 80." in told


def test_render_names_the_camera_that_lies_beside_the_depth(tmp_path: Path) -> None:
    wanted = "'--focal-length' / '--fov': give one of the two, in pixels or in degrees"
    arguments = ("render", tmp_path / "depth.npy", "-o", tmp_path / "a.png")
    assert f"{wanted}. Common cameras" in run(*arguments).stderr
    (tmp_path / "camera.json").touch()
    assert f"{wanted}, or --camera {tmp_path / 'camera.json'}. Common cameras" in run(*arguments).stderr


def test_a_photo_in_place_of_a_command_is_told_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my photos").mkdir()
    assert "persfs-cl batch 'my photos' -o results" in run("my photos").stderr
    assert "moon.png is no command. For a photo: persfs-cl reconstruct moon.png -o result" in run("moon.png").stderr
    assert "Did you mean 'reconstruct'?" in run("recnstruct").stderr


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


@pytest.mark.parametrize(
    ("option", "value"),
    [("--size", "3"), ("--size", "abc"), ("--denoise", "9"), ("--page", "0"), ("--mask-erode", "-1")],
)
def test_a_number_out_of_its_range_is_told_with_its_option(
    option: str, value: str, photo: Path, tmp_path: Path
) -> None:
    outcome = run("reconstruct", photo, "-o", tmp_path / "out", option, value)
    assert outcome.status == 2
    told = outcome.stderr.partition("Invalid value for ")[2]
    assert f"'{option}'" in told
    assert value in told.replace(option, "")
