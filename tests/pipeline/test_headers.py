"""What a dry run tells is what reading the files tells, without their pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import ExifTags, Image
from samples import random_samples, save
from videos import make_video

from persfs_cl.camera import Camera
from persfs_cl.errors import PersfsError
from persfs_cl.io.export import write_depth
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.headers import Looked, look
from persfs_cl.pipeline.job import Job, read_job
from persfs_cl.pipeline.optics import CameraChoice

CAMERA = CameraChoice(fov=50.0)
SHAPE = (48, 64)


def photograph(path: Path, **tags: int) -> Path:
    exif = Image.Exif()
    exif.get_ifd(ExifTags.IFD.Exif).update({ExifTags.Base[name].value: value for name, value in tags.items()})
    if "Orientation" in tags:
        exif[ExifTags.Base.Orientation] = tags["Orientation"]
    Image.fromarray(random_samples(3, 8, SHAPE)).save(path, exif=exif)
    return path


@pytest.mark.parametrize(
    "name", ["grey8.png", "rgb16.png", "rgba8.png", "grey8.tiff", "rgb16.tiff", "float.tiff", "palette.png", "a.jpg"]
)
def test_size_bits_and_camera_are_those_that_reading_finds(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name == "float.tiff":
        tifffile.imwrite(path, np.random.default_rng(0).random(SHAPE, np.float32))
    elif name == "palette.png":
        Image.fromarray(random_samples(1, 8, SHAPE)).convert("P").save(path)
    elif name == "a.jpg":
        Image.fromarray(random_samples(3, 8, SHAPE)).save(path)
    else:
        channels = 4 if "rgba" in name else 3 if "rgb" in name else 1
        save(path, random_samples(channels, 16 if "16" in name else 8, SHAPE))
    job = Job(path, CAMERA, Brightness())
    looked, read = look(job), read_job(job)
    assert looked == Looked(SHAPE, read.photo.bits, read.camera, read.source, looked.horizontal_view, False)
    assert looked.horizontal_view == pytest.approx(50.0)
    assert looked.megapixels == pytest.approx(48 * 64 / 1e6)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("orientation", [1, 6])
def test_exif_turns_and_tells_the_focal_length(tmp_path: Path, suffix: str, orientation: int) -> None:
    path = photograph(tmp_path / f"a{suffix}", FocalLengthIn35mmFilm=26, Orientation=orientation)
    job = Job(path, CameraChoice(), Brightness())
    looked, read = look(job), read_job(job)
    assert looked.size == read.photo.image.shape == (SHAPE if orientation == 1 else SHAPE[::-1])
    assert (looked.camera, looked.camera_source) == (read.camera, "EXIF FocalLengthIn35mmFilm")


def test_exif_behind_the_pixels_of_a_png_file_is_found(tmp_path: Path) -> None:
    path = photograph(tmp_path / "a.png", FocalLengthIn35mmFilm=26, Orientation=1)
    data = path.read_bytes()
    start = data.index(b"eXIf") - 4
    end = start + int.from_bytes(data[start : start + 4], "big") + 12
    path.write_bytes(data[:start] + data[end:-12] + data[start:end] + data[-12:])
    assert look(Job(path, CameraChoice(), Brightness())).camera == Camera.from_exif(path)
    assert Camera.from_exif(path).fx == pytest.approx(26 * 80 / np.hypot(36, 24))


def test_pixels_are_not_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = photograph(tmp_path / "a.png")
    write_depth(tmp_path / "depth.tiff", np.ones(SHAPE))
    save(tmp_path / "mask.png", random_samples(1, 8, SHAPE))
    job = Job(path, CAMERA, Brightness(), mask=tmp_path / "mask.png", known_depth=tmp_path / "depth.tiff")
    monkeypatch.setattr(Image.Image, "load", lambda _: pytest.fail("was decoded"))
    monkeypatch.setattr("PIL.ImageFile.ImageFile.load", lambda _: pytest.fail("was decoded"))
    monkeypatch.setattr(tifffile.TiffPage, "asarray", lambda _: pytest.fail("was decoded"))
    assert look(job).masked


def test_what_cannot_be_used_is_refused_as_by_reading(tmp_path: Path) -> None:
    good = photograph(tmp_path / "good.png")
    np.save(tmp_path / "bool.npy", np.ones(SHAPE, bool))
    np.save(tmp_path / "float.npy", np.ones(SHAPE))
    np.save(tmp_path / "small.npy", np.ones((3, 4), bool))
    (tmp_path / "cut.npy").write_bytes((tmp_path / "float.npy").read_bytes()[:-8])
    save(tmp_path / "small.png", random_samples(1, 8, (3, 4)))
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.png").write_text("this is no photo")
    (tmp_path / "cut.png").write_bytes(good.read_bytes()[:20])
    (tmp_path / "cut.jpg").write_bytes(photograph(tmp_path / "good.jpg").read_bytes()[:100])
    (tmp_path / "cut.tiff").write_bytes(save(tmp_path / "good.tiff", random_samples(1, 8, SHAPE)).read_bytes()[:60])
    Image.fromarray(random_samples(3, 8, SHAPE)).convert("CMYK").save(tmp_path / "cmyk.jpg")
    tifffile.imwrite(tmp_path / "signed.tiff", np.ones(SHAPE, np.int16))
    tifffile.imwrite(tmp_path / "pages.tiff", np.ones((2, *SHAPE), np.uint8), photometric="minisblack")
    (tmp_path / "raw.dng").write_bytes(b"II*\0" + bytes(4) + b"CR\x02" + bytes(60))
    path = {file.name: file for file in tmp_path.iterdir()} | {"none.png": tmp_path / "none.png"}
    plain = Brightness()
    names = [
        "empty.png",
        "text.png",
        "cut.png",
        "cut.jpg",
        "cut.tiff",
        "cmyk.jpg",
        "signed.tiff",
        "pages.tiff",
        "raw.dng",
    ]
    jobs = [Job(path[name], CAMERA, plain) for name in [*names, "none.png"]]
    jobs += [Job(good, CAMERA, plain, mask=path[name]) for name in ("small.png", "small.npy", "float.npy", "none.png")]
    jobs += [Job(good, CAMERA, plain, walls=path["empty.png"])]
    jobs += [Job(good, CAMERA, plain, known_depth=path[name]) for name in ("bool.npy", "cut.npy", "small.png")]
    jobs += [Job(good, CAMERA, plain, far=path[name]) for name in ("cut.npy", "small.png")]
    jobs += [Job(good, CAMERA, plain, albedo=path[name]) for name in ("bool.npy", "small.png", "signed.tiff")]
    jobs += [Job(good, CAMERA, Brightness(ambient=path["small.png"]))]
    jobs += [Job(good, CAMERA, Brightness(vignetting=path["small.png"]))]
    jobs += [Job(good, CameraChoice(), plain), Job(good, CameraChoice(fov=50.0, size=(4, 3)), plain)]
    for job in jobs:
        with pytest.raises(PersfsError) as reading:
            read_job(job)
        with pytest.raises(PersfsError) as looking:
            look(job)
        assert (type(looking.value), str(looking.value)) == (type(reading.value), str(reading.value))


def test_a_camera_that_no_lens_has_is_named_with_its_photo(tmp_path: Path) -> None:
    path = photograph(tmp_path / "a.png")
    choice = CameraChoice(1.0, principal_point=(30.0, 20.0))
    with pytest.warns(UserWarning, match="not millimetres"), pytest.raises(PersfsError, match=r"a\.png: focal_length"):
        look(Job(path, choice, Brightness()))


def test_a_frame_of_a_video(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    make_video(path, [random_samples(3, 8, SHAPE)])
    looked = look(Job(path, CAMERA, Brightness(), frame=0))
    assert (looked.size, looked.bits) == (SHAPE, 8)
    with pytest.raises(PersfsError, match=r"a\.mkv has no frame 1, of 1: choose another"):
        look(Job(path, CAMERA, Brightness(), frame=1))
