"""Photos of bent lenses, and photos solved with fewer pixels, from the command line, with all that goes with them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from command import run, strict
from lenses import depth, flashed, places
from PIL import Image

import persfs_cl as ps
from persfs_cl.io.export import write_grey
from persfs_cl.lens.distortion import distortion_of
from persfs_cl.masks import rim
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.headers import look
from persfs_cl.pipeline.job import Job
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.preparation.correct import cosine_vignetting
from persfs_cl.preparation.silhouette import eroded

SHAPE = (96, 128)
LENS = (-0.25, 0.06, 0.002, -0.001)
BENT = ps.Camera(150.0, distortion=LENS)
COEFFICIENTS = ",".join(map(str, LENS))


@pytest.fixture
def bent(tmp_path: Path) -> Path:
    """A photo through the lens, with all maps that may go with it beside it."""
    image, z = flashed(BENT, SHAPE), depth(*places(BENT, SHAPE))
    write_grey(tmp_path / "bent.png", image / image.max(), 16)
    mask = np.zeros(SHAPE, bool)
    mask[8:-8, 8:-8] = True
    np.save(tmp_path / "mask.npy", mask)
    np.save(tmp_path / "walls.npy", np.zeros(SHAPE, bool))
    known = np.full(SHAPE, np.nan)
    known[40:50, 60:70] = z[40:50, 60:70]
    np.save(tmp_path / "known.npy", known)
    np.save(tmp_path / "near.npy", 0.95 * z)
    np.save(tmp_path / "albedo.npy", np.ones(SHAPE))
    np.save(tmp_path / "dark.npy", np.zeros(SHAPE))
    np.save(tmp_path / "plate.npy", np.ones(SHAPE))
    np.savetxt(tmp_path / "points.csv", [(64.0, 48.0, z[48, 64]), (20.0, 30.0, z[30, 20])], delimiter=",")
    return tmp_path / "bent.png"


def _everything(folder: Path) -> list[str | Path]:
    return [
        *("--mask", folder / "mask.npy", "--walls", folder / "walls.npy", "--known-depth", folder / "known.npy"),
        *("--near", folder / "near.npy", "--far", "3", "--albedo", folder / "albedo.npy"),
        *("--ambient", folder / "dark.npy", "--vignetting", folder / "plate.npy", "--guide", folder / "points.csv"),
    ]


def _gain() -> str:
    return str(1.0 / float(flashed(BENT, SHAPE).max()))


def _error(folder: Path) -> float:
    """Of the depth in a folder, along the rays of the camera that the report tells of."""
    found, told = np.load(folder / "depth.npy"), strict(folder / "report.json")["parameters"]
    camera = ps.Camera(tuple(told["focal_length"]), tuple(told["principal_point"]))
    grid = camera.grid(found.shape)
    truth = np.where(np.isfinite(found), depth(*np.broadcast_arrays(grid.x, grid.y)), np.nan)
    return ps.compare(found, truth).mean


@pytest.mark.usefixtures("quick", "lexicographic_wavefront")
@pytest.mark.parametrize("size", [None, 64])
def test_a_bent_photo_and_all_that_goes_with_it(bent: Path, size: int | None) -> None:
    folder = bent.parent
    outcome = run(
        *("reconstruct", bent, "-o", folder / "out", "--light", "flash", "--gain", _gain(), "--focal-length", "150"),
        *("--distortion", COEFFICIENTS, *(() if size is None else ("--size", str(size))), *_everything(folder)),
    )
    assert outcome.status == 0, outcome.stderr
    found = np.load(folder / "out" / "depth.npy")
    assert max(found.shape) == (64 if size else max(ps.undistort(np.ones(SHAPE), BENT)[0].shape))
    assert _error(folder / "out") < 0.004
    told = strict(folder / "out" / "camera.json")
    assert ps.Camera.from_file(folder / "out" / "camera.json").distortion is None
    assert (told["image_height"], told["image_width"]) == found.shape
    assert told["photo"]["distortion_coefficients"] == list(LENS)
    report = strict(folder / "out" / "report.json")
    assert report["requested"]["distortion"] == list(LENS)
    assert report["requested"]["size"] == size
    assert report["photo"]["size"] == [128, 96]


def test_points_of_the_photo_are_compared_in_the_pixels_of_the_depth(bent: Path) -> None:
    folder, z = bent.parent, depth(*places(BENT, SHAPE))
    rows = [(column, row, z[row, column]) for row in range(10, 90, 8) for column in range(10, 120, 8)]
    np.savetxt(folder / "truth.csv", rows, delimiter=",")
    common = ("--light", "flash", "--gain", _gain(), "--focal-length", "150", "--save", "depth", "--size", "100")
    assert run("reconstruct", bent, "-o", folder / "out", "--distortion", COEFFICIENTS, *common).status == 0
    outcome = run("compare", folder / "out" / "depth.npy", folder / "truth.csv", "--json")
    assert outcome.status == 0
    assert json.loads(outcome.stdout)["depth"]["mean_relative"] < 0.004
    assert json.loads(outcome.stdout)["depth"]["count"] == len(rows)
    assert f"of which {folder / 'truth.csv'} is taken to be" in outcome.stderr
    # A photo of another size is none of these points', whatever the depth map has.
    for size, status in ((SHAPE, 0), (np.load(folder / "out" / "depth.npy").shape, 1)):
        tifffile.imwrite(folder / "other.tif", np.full(size, 0.5))
        told = run("compare", folder / "out" / "depth.npy", folder / "truth.csv", "--photo", folder / "other.tif")
        assert told.status == status
    assert f"other.tif has shape {size}, but by the camera.json beside it" in told.stderr
    assert f"comes of one of shape {SHAPE}: give the photo that it is from." in told.stderr
    (folder / "out" / "camera.json").unlink()
    outcome = run("compare", folder / "out" / "depth.npy", folder / "truth.csv", "--json")
    assert json.loads(outcome.stdout)["depth"]["mean_relative"] > 0.01
    assert "is taken to be" not in outcome.stderr


def test_masks_and_depths_of_the_photo_are_compared_in_the_pixels_of_the_depth(bent: Path) -> None:
    folder, z = bent.parent, depth(*places(BENT, SHAPE))
    np.save(folder / "truth.npy", z)
    common = ("--light", "flash", "--gain", _gain(), "--focal-length", "150", "--save", "depth", "--size", "100")
    assert run("reconstruct", bent, "-o", folder / "out", "--distortion", COEFFICIENTS, *common).status == 0
    files = ("compare", folder / "out" / "depth.npy", folder / "truth.npy", "--json")
    whole, masked = run(*files), run(*files, "--mask", folder / "mask.npy")
    told = [json.loads(outcome.stdout) for outcome in (whole, masked)]
    # The mask leaves out eight pixels along each side of the photo.
    share = np.load(folder / "mask.npy").mean()
    assert told[1]["count"] == pytest.approx(share * told[0]["count"], rel=0.05)
    assert told[0]["mean"] < 0.004
    assert f"of which {folder / 'truth.npy'} is taken to be" in whole.stderr
    assert f"of which {folder / 'mask.npy'} is taken to be" in masked.stderr
    np.savetxt(folder / "truth.csv", [(20.0, 30.0, z[30, 20]), (3.0, 3.0, z[3, 3])], delimiter=",")
    outcome = run("compare", folder / "out" / "depth.npy", folder / "truth.csv", "--mask", folder / "mask.npy")
    assert f"1 of 2 points are left out: 1 outside {folder / 'mask.npy'}" in outcome.stderr
    np.save(folder / "odd.npy", np.ones((7, 7), bool))
    outcome = run(*files, "--mask", folder / "odd.npy")
    assert outcome.status == 1
    assert "odd.npy has shape (7, 7)" in outcome.stderr
    assert "The photo's, (96, 128), does as well." in outcome.stderr
    np.save(folder / "odd.npy", np.ones((7, 7)))
    outcome = run(*files[:2], folder / "odd.npy")
    assert "or one of the size of the photo, (96, 128)" in outcome.stderr


def test_a_smaller_size_alone(bent: Path) -> None:
    straight = ps.Camera(150.0)
    image = flashed(straight, SHAPE)
    write_grey(bent, image / image.max(), 16)
    folder = bent.parent
    outcome = run(
        *("reconstruct", bent, "-o", folder / "out", "--light", "flash", "--gain", str(1.0 / image.max())),
        *("--focal-length", "150", "--size", "64", "--save", "depth,report,preview"),
    )
    assert outcome.status == 0, outcome.stderr
    assert np.load(folder / "out" / "depth.npy").shape == (48, 64)
    assert _error(folder / "out") < 0.004


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("kind", ["opencv", "fisheye", "fov"])
def test_the_file_of_a_camera(bent: Path, kind: str) -> None:
    lens = {"opencv": LENS, "fisheye": (0.03, -0.01, 0.0, 0.0), "fov": (0.6,)}[kind]
    camera = ps.Camera(150.0, distortion=distortion_of(kind, lens))
    image = flashed(camera, SHAPE)
    write_grey(bent, image / image.max(), 16)
    folder = bent.parent
    (folder / "camera.json").write_text(
        json.dumps(
            {
                "image_width": 128,
                "image_height": 96,
                "camera_matrix": [[150, 0, 63.5], [0, 150, 47.5], [0, 0, 1]],
                "distortion_coefficients": lens,
                "distortion_model": "plumb_bob" if kind == "opencv" else kind,
            }
        )
    )
    common = ("--light", "flash", "--gain", str(1.0 / image.max()), "--save", "depth,report")
    outcome = run("reconstruct", bent, "-o", folder / "one", "--camera", folder / "camera.json", *common)
    assert outcome.status == 0, outcome.stderr
    assert _error(folder / "one") < 0.004
    given = {"opencv": COEFFICIENTS, "fisheye": "fisheye:0.03,-0.01", "fov": "fov:0.6"}[kind]
    outcome = run("reconstruct", bent, "-o", folder / "two", "--focal-length", "150", "--distortion", given, *common)
    np.testing.assert_array_equal(np.load(folder / "one" / "depth.npy"), np.load(folder / "two" / "depth.npy"))
    outcome = run("batch", bent, "-o", folder / "three", "--camera", folder / "camera.json", *common)
    assert outcome.status == 0, outcome.stderr
    np.testing.assert_array_equal(
        np.load(folder / "one" / "depth.npy"), np.load(folder / "three" / "bent.png" / "depth.npy")
    )


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_with_a_table_of_lenses_of_smaller_size(bent: Path) -> None:
    folder = bent.parent
    (folder / "cameras.txt").write_text(f"1 OPENCV 128 96 150 150 64 48 {' '.join(map(str, LENS))}\n")
    common = ("--light", "flash", "--gain", _gain(), "--save", "depth,report", "--size", "64")
    outcome = run("batch", bent, "-o", folder / "out", "--cameras", folder / "cameras.txt", *common)
    assert outcome.status == 0, outcome.stderr
    assert max(np.load(folder / "out" / "bent.png" / "depth.npy").shape) == 64
    assert _error(folder / "out" / "bent.png") < 0.004
    # Another size is another result.
    assert (
        "1 done"
        in run("batch", bent, "-o", folder / "out", "--cameras", folder / "cameras.txt", *common[:-1], "32").stderr
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--distortion", "1,2,3"), "'1,2,3' is not 4, 5, 8, 12 or 14 numbers"),
        (
            ("--distortion", "fisheye:a"),
            "'a' is not up to 8 numbers, k1, k2, k3 and k4, or p1, p2, sx1 and sy1 too, behind fisheye:",
        ),
        (("--distortion", "fov:0.1,0.2"), "'0.1,0.2' is not the one number ω, behind fov:"),
        (("--distortion", "fov:4", "--focal-length", "150"), "4 for ω: give radians, between -π and π"),
        (("--distortion", "mirror:4"), "or fisheye: or fov: or rad_tan_thin_prism_fisheye: and its numbers"),
        (("--fov", "60", "--distortion", COEFFICIENTS), "--fov 60.0 tells the focal length only of a lens without"),
        (("--camera", "none.json", "--fov", "60"), "give a file, or the camera by the other options"),
        (("--size", "3"), "'--size'"),
    ],
)
def test_wrong_options(bent: Path, arguments: tuple[str, ...], said: str) -> None:
    outcome = run("reconstruct", bent, "-o", bent.parent / "out", *arguments)
    assert outcome.status == 2
    assert said in outcome.stderr
    assert not (bent.parent / "out").exists()


def test_a_camera_of_another_size_is_refused(bent: Path) -> None:
    (bent.parent / "cameras.txt").write_text("1 PINHOLE 64 48 150 150 32 24\n")
    outcome = run("reconstruct", bent, "-o", bent.parent / "out", "--camera", bent.parent / "cameras.txt")
    assert outcome.status == 1
    assert "has 128 × 96 pixels, but its camera in cameras.txt is for 64 × 48" in outcome.stderr
    outcome = run("reconstruct", bent, "-o", bent.parent / "out", "--camera", bent.parent / "none.txt")
    assert outcome.status == 1
    assert "none.txt" in outcome.stderr


def test_a_look_at_headers_knows_lenses(bent: Path) -> None:
    choice = CameraChoice(150.0, distortion=LENS)
    looked = look(Job(bent, choice, Brightness(), size=64))
    straight, pinhole = ps.undistort(np.ones(SHAPE), BENT)
    left = pinhole.centre(straight.shape)[0] + 0.5
    view = np.degrees(np.arctan(left / 150.0) + np.arctan((straight.shape[1] - left) / 150.0))
    assert looked.horizontal_view == pytest.approx(view)


@pytest.mark.usefixtures("in_this_process")
def test_a_mask_that_is_found_and_eroded(tmp_path: Path) -> None:
    scene = ps.bump((48, 48), light=ps.FlashLight())
    rows, columns = np.indices((48, 48))
    disc = (rows - 22) ** 2 + (columns - 25) ** 2 < 300
    image = np.where(disc, scene.image, 0.0)
    write_grey(tmp_path / "photo.png", image / image.max(), 16)
    common = ("--light", "flash", "--focal-length", str(scene.camera.fx), "--save", "depth,report,outline.png")
    for number, erode in enumerate(("0", "2")):
        out = tmp_path / str(number)
        outcome = run(
            "reconstruct", tmp_path / "photo.png", "-o", out, *common, "--mask", "auto", "--mask-erode", erode
        )
        assert outcome.status == 0, outcome.stderr
        found = np.isfinite(np.load(out / "depth.npy"))
        np.testing.assert_array_equal(found, eroded(disc, int(erode)))
        said = f"The mask: {found.sum()} pixels ({100 * found.mean():.2g} %), see outline.png."
        assert said in outcome.stderr
        photo = strict(out / "report.json")["photo"]
        assert (photo["mask"], photo["mask_erode"], photo["mask_pixels"]) == ("auto", int(erode), found.sum())
        shown = np.asarray(Image.open(out / "outline.png"))
        assert (shown[rim(found)] == (255, 96, 0)).all()
    outcome = run("batch", tmp_path / "photo.png", "-o", tmp_path / "all", *common, "--mask", "auto")
    np.testing.assert_array_equal(
        np.load(tmp_path / "all" / "photo.png" / "depth.npy"), np.load(tmp_path / "0" / "depth.npy")
    )
    write_grey(tmp_path / "flat.png", np.full((20, 20), 0.5), 8)
    outcome = run("reconstruct", tmp_path / "flat.png", "-o", tmp_path / "none", *common, "--mask", "auto")
    assert outcome.status == 1
    assert "flat.png: no object stands out from a dark background" in outcome.stderr


@pytest.mark.filterwarnings("always:")
def test_level_ground_wants_an_oblique_light(bent: Path) -> None:
    outcome = run(
        "reconstruct", bent, "-o", bent.parent / "out", "--fov", "40", "--normalise", "level", "--save", "depth"
    )
    assert outcome.status == 1
    assert "--normalise level is for an oblique light" in outcome.stderr
    outcome = run(
        *("reconstruct", bent, "-o", bent.parent / "out", "--fov", "40", "--normalise", "level", "--p0", "1"),
        *("--save", "depth,report", "--max-iterations", "2"),
    )
    assert outcome.status == 0
    # What was given is not asked for.
    assert "are darker than level ground" in outcome.stderr
    assert "Check --p0 and --q0; where noise" in outcome.stderr
    assert strict(bent.parent / "out" / "report.json")["photo"]["level"] == pytest.approx(2**-0.5)


def test_vignetting_by_a_law_follows_the_rays_of_the_lens() -> None:
    x, y = places(BENT, SHAPE)
    np.testing.assert_allclose(cosine_vignetting(BENT, SHAPE, 4.0), (1.0 + x**2 + y**2) ** -2.0, rtol=1e-6)


def test_erosion_wants_an_outline_and_says_what_it_took(bent: Path) -> None:
    common = ("reconstruct", bent, "-o", bent.parent / "out", "--fov", "40", "--save", "depth")
    outcome = run(*common, "--mask-erode", "3")
    assert outcome.status == 1
    assert "--mask-erode 3 has no outline to go by: give --mask" in outcome.stderr
    outcome = run(*common, "--mask", bent.parent / "mask.npy", "--mask-erode", "90")
    assert outcome.status == 1
    assert "within 90 pixels of the outline" in outcome.stderr


@pytest.mark.filterwarnings("default")
def test_files_that_there_are_not_of_a_surface(bent: Path) -> None:
    common = ("reconstruct", bent, "-o", bent.parent / "out", "--light", "flash", "--fov", "40")
    outcome = run(*common, "--save", "guide.png")
    assert outcome.status == 1
    assert "There is no guide.png of this surface" in outcome.stderr
    outcome = run(*common, "--save", "depth,guide.png", "--overwrite")
    assert outcome.status == 1
    assert "guide.png could not be made: there is none of this surface, so leave it out." in outcome.stderr
    assert {path.name for path in (bent.parent / "out").iterdir()} >= {"depth.npy", "camera.json"}
    # That a group has pictures which there are not of every surface is no failure.
    assert run(*common, "--save", "depth,pictures", "--overwrite").status == 0
    outcome = run(*common, "--save", "depth,solid", "--width", "1e-9", "--overwrite")
    assert outcome.status == 1
    assert "solid.stl could not be made: --base 3.0 is too thick for --width 1e-09" in outcome.stderr
    assert (bent.parent / "out" / "depth.npy").exists()
    assert not (bent.parent / "out" / "solid.stl").exists()
