"""``persfs-cl batch``: what its options mean, what it says and how it ends. What it does is tested in the pipeline."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
import trimesh
from command import run
from PIL import Image
from videos import make_video

import persfs_cl as ps
from persfs_cl.cli.batch_progress import Tally, progress_bar
from persfs_cl.io.export import write_grey
from persfs_cl.pipeline.listing import Listing
from persfs_cl.pipeline.plan import Plan
from persfs_cl.pipeline.run import Batch, BatchResult
from persfs_cl.surface.saving import Saving

SCENE = ps.bump((20, 24), light=ps.FlashLight())
FLASH = ("--light", "flash", "--focal-length", "24")


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photos")
    (folder / "deep").mkdir()
    for number, name in enumerate(("a.png", "b.png", "deep/a.png")):
        write_grey(folder / name, SCENE.image / SCENE.image.max() * (1 - 0.1 * number))
    return folder


@pytest.fixture(scope="module")
def done(photos: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch, one of whose photos is none."""
    folder = tmp_path_factory.mktemp("done")
    given, output = folder / "in", folder / "out"
    shutil.copytree(photos, given)
    (given / "text.png").write_text("no image")
    outcome = run("batch", given, "-o", output, *FLASH)
    assert outcome.status == 1
    assert sorted(outcome.stdout.splitlines()) == [str(output / name) for name in ("a.png", "b.png", "deep/a.png")]
    assert f"persfs-cl: {given}/text.png " in outcome.stderr
    assert "3 done" in outcome.stderr
    assert "1 failed" in outcome.stderr
    assert str(output / "index.html") in outcome.stderr
    return output


def test_each_photo_has_its_folder_and_all_have_a_page(done: Path) -> None:
    for name in ("a.png", "b.png", "deep/a.png"):
        files = {file.name for file in (done / name).iterdir()}
        assert files == {
            *("camera.json", "depth.npy", "depth.tiff", "normals.png", "report.json"),
            *("preview.jpg", "photo.jpg", "relief.js", "record.json"),
        }
    assert {"index.html", "contact.jpg", "summary.csv", "manifest"} <= {file.name for file in done.iterdir()}
    with (done / "summary.csv").open(encoding="utf-8", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert {name: row["status"] for name, row in rows.items()} == {
        **dict.fromkeys(("a.png", "b.png", "deep/a.png"), "done"),
        "text.png": "failed",
    }


@pytest.mark.usefixtures("in_this_process")
def test_again_only_what_failed_is_tried(done: Path) -> None:
    outcome = run("batch", done.parent / "in", "-o", done, *FLASH)
    assert outcome.status == 1
    assert outcome.stdout == ""
    assert "3 were done before" in outcome.stderr
    assert "1 failed" in outcome.stderr


@pytest.mark.usefixtures("in_this_process")
def test_every_photo_may_become_a_solid(photos: Path, tmp_path: Path) -> None:
    outcome = run("batch", photos / "a.png", "-o", tmp_path / "out", *FLASH, "--save", "solid.3mf", "--width", "33")
    assert outcome.status == 0
    [solid] = trimesh.load_scene(tmp_path / "out" / "a.png" / "solid.3mf").geometry.values()
    assert solid.is_watertight
    assert max(solid.extents[:2]) == pytest.approx(33.0, rel=1e-6)


@pytest.mark.usefixtures("in_this_process")
def test_a_file_that_cannot_be_made_costs_no_other_and_is_told(photos: Path, tmp_path: Path) -> None:
    common = ("batch", photos / "a.png", "-o", tmp_path / "out", *FLASH)
    outcome = run(*common, "--save", "depth,solid.stl", "--width", "1e-9")
    assert outcome.status == 1
    assert "a.png: warning: solid.stl could not be made: --base 3.0 is too thick for --width 1e-09" in outcome.stderr
    assert "1 without a file that was asked for" in outcome.stderr
    # It is not tried again, and not forgotten either.
    outcome = run(*common, "--save", "depth,solid.stl", "--width", "1e-9")
    assert (outcome.status, outcome.stdout) == (1, "")
    assert "1 were done before, 1 without a file that was asked for" in outcome.stderr
    assert (tmp_path / "out" / "a.png" / "depth.npy").exists()
    assert run(*common, "--save", "depth,pictures").status == 0


@pytest.mark.usefixtures("ctrl_c", "in_this_process")
@pytest.mark.parametrize("presses", [1, 2])
def test_an_interrupted_batch_says_how_many_are_done_and_goes_on(
    presses: int, photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = Tally.add

    def interrupted(tally: Tally, result: BatchResult) -> None:
        usual(tally, result)
        for _ in range(presses * (tally.done == 1)):
            signal.raise_signal(signal.SIGINT)

    common = ("batch", photos, "-o", tmp_path / "out", *FLASH, "--save", "depth.npy")
    with monkeypatch.context() as patch:
        patch.setattr(Tally, "add", interrupted)
        outcome = run(*common)
    assert outcome.status == 130
    found = re.search(
        r"persfs-cl: Interrupted: (\d) of 3 are done\. The same command goes on from there\.$", outcome.stderr
    )
    assert found
    count = int(found[1])
    assert count >= 1
    again = run(*common)
    assert again.status == 0
    numbers = re.search(r"(\d) done in .*, (\d) were done before", again.stderr)
    assert numbers, again.stderr
    now, before = map(int, numbers.groups())
    assert now + before == 3
    # A second Ctrl-C leaves at once: what had come to its place by then need not have been counted.
    assert before == count or (presses == 2 and before > count)


def test_no_folder_is_no_output(photos: Path) -> None:
    outcome = run("batch", photos / "a.png", "-o", "", *FLASH)
    assert outcome.status == 2
    assert "-o is empty, as a variable that is not set leaves it: give DIR." in outcome.stderr


def test_records_and_pages_have_the_words_of_the_command(tmp_path: Path) -> None:
    given, output = tmp_path / "in", tmp_path / "out"
    given.mkdir()
    dark = np.where(np.indices(SCENE.image.shape).sum(0) < 16, SCENE.image / SCENE.image.max(), 0.0)
    write_grey(given / "dark.png", dark)
    assert run("batch", given, "-o", output, "--fov", "40", "--save", "report,page").status == 0
    for place in ("dark.png/report.json", "dark.png/index.html", "index.html", "summary.csv"):
        said = (output / place).read_text(encoding="utf-8")
        assert "--light flash for a lamp at the camera" in said, place
        assert "light=FlashLight()" not in said, place
    outcome = run("batch", given, "-o", output / "other")
    assert outcome.status == 1
    with (output / "other" / "summary.csv").open(encoding="utf-8", newline="") as file:
        [failed] = csv.DictReader(file)
    assert "--fov" in failed["error"]
    assert failed["error"] in outcome.stderr


@pytest.mark.parametrize("options", [(), ("--dry-run",)])
def test_a_path_with_a_slip_is_named_once(
    options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = run("batch", "photoz", "-o", "out", *FLASH, *options)
    assert outcome.status == 1
    assert outcome.stderr.startswith("persfs-cl: photoz does not exist: check the spelling")


def test_dry_run_says_what_would_be_done_and_does_nothing(photos: Path, tmp_path: Path) -> None:
    given, masks, output = tmp_path / "in", tmp_path / "masks", tmp_path / "out"
    shutil.copytree(photos, given)
    (given / "empty.png").write_bytes(b"")
    masks.mkdir()
    for name, size in (("a.png.png", (24, 20)), ("b.png.png", (25, 20)), ("empty.png.png", (24, 20))):
        Image.new("L", size, 255).save(masks / name)
    outcome = run("batch", given, "-o", output, "--masks", masks, *FLASH, "--dry-run")
    assert outcome.status == 1
    (line,) = outcome.stdout.splitlines()
    assert line.split("\t") == ["a.png", "24 x 20", "24 px, 53.1 degrees, by --focal-length", str(masks / "a.png.png")]
    for name, why in (("b.png", "25"), ("deep/a.png", "has no mask"), ("empty.png", "is empty")):
        assert re.search(rf"persfs-cl: (\S*/)?{re.escape(name)}[: ]", outcome.stderr), outcome.stderr
        assert why in outcome.stderr
    assert "1 would be done" in outcome.stderr
    assert "3 cannot be used" in outcome.stderr
    assert not output.exists()


@pytest.mark.usefixtures("in_this_process")
def test_options_may_stand_in_a_file(photos: Path, tmp_path: Path) -> None:
    config = tmp_path / "flash.toml"
    config.write_text('light = "flash"\nfocal-length = 24\nsave = "depth.npy"\n', encoding="utf-8")
    outcome = run("batch", photos / "a.png", "-o", tmp_path / "out", "--config", config)
    assert outcome.status == 0
    (folder,) = map(Path, outcome.stdout.splitlines())
    assert {file.name for file in folder.iterdir()} == {"depth.npy", "record.json"}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--overwrite", "--retry-failed"), ("--overwrite", "--retry-failed", "not several")),
        (("--shard", "3/2"), ("'--shard': there is no share 3/2: the first number is from 1",)),
        (("--shard", "half"), ("--shard", "half", "2/8")),
        (("--memory", "much"), ("--memory", "much", "8G")),
        (("--memory", "0"), ("--memory", "0")),
        (("--save", "everything"), ("everything", "depth")),
        (("--cameras", "cameras.csv"), ("--cameras", "not both")),
        (("--mask", "a.png", "--masks", "."), ("--mask", "not both")),
        (("--normalise", "grey"), ("--normalise", "leave it out")),
        (("--frames", "a:b"), ("--frames a:b",)),
        (("--frames", ":3"), ("--frames :3", "none is given")),
        (("--scheduler", "tcp://localhost:1", "--device", "all"), ("--device all",)),
        (("--scheme", "upwinds"), ("upwinds",)),
        (("--near", "3", "--far", "2"), ("--near 3.0 is beyond --far 2.0",)),
    ],
)
def test_wrong_options_are_refused_before_any_work(
    photos: Path, tmp_path: Path, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    outcome = run("batch", photos, "-o", tmp_path / "out", *FLASH, *options)
    assert outcome.status == 2
    for word in words:
        assert word in outcome.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["--mask", "--walls", "--known-depth", "--albedo", "--far", "--ambient", "--masks"])
def test_what_all_photos_have_in_common_must_be_there(photos: Path, tmp_path: Path, option: str) -> None:
    outcome = run("batch", photos, "-o", tmp_path / "out", *FLASH, option, tmp_path / "gone.png")
    assert outcome.status == 1
    assert outcome.stderr.count("gone.png") == 1
    assert not (tmp_path / "out").exists()


def test_where_nothing_can_be_used_nothing_is_made(photos: Path, tmp_path: Path) -> None:
    outcome = run("batch", tmp_path / "gone", photos / "gone*", "-o", tmp_path / "out", *FLASH)
    assert outcome.status == 1
    assert "gone does not exist" in outcome.stderr
    assert "gone* fits no image" in outcome.stderr
    assert not (tmp_path / "out").exists()
    before = sorted(photos.rglob("*"))
    outcome = run("batch", photos, "-o", photos, *FLASH)
    assert outcome.status == 1
    assert "choose another output" in outcome.stderr
    assert sorted(photos.rglob("*")) == before


@pytest.mark.usefixtures("in_this_process")
def test_what_failed_is_told_where_the_page_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "text.png").write_text("no image")
    (tmp_path / "out" / "index.html").mkdir(parents=True)
    outcome = run("batch", tmp_path / "in", "-o", tmp_path / "out", *FLASH)
    assert outcome.status == 1
    assert f"persfs-cl: {tmp_path / 'in' / 'text.png'} " in outcome.stderr
    assert "1 failed." in outcome.stderr
    assert "index.html is not a regular file" in outcome.stderr


def test_lines_and_bar_share_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr("sys.stdout", screen)
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with progress_bar(Batch(Listing([], []), Plan(), None), Tally(str, Saving.of("depth"))) as show:
        show("out/[a]" + "b" * 200)
        show("")
    printed = next(line for line in screen.getvalue().split("\n") if "[a]" in line)
    # From the beginning of a line, and in one piece.
    assert re.search(r"(?:^|\x1b\[2K)out/\[a\]b{200}$", printed)


def test_output_that_is_a_file_is_refused(photos: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    outcome = run("batch", photos, "-o", tmp_path / "out", *FLASH)
    assert outcome.status == 2
    assert "is a file" in outcome.stderr
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.usefixtures("in_this_process")
def test_what_is_not_there_is_named(photos: Path, tmp_path: Path) -> None:
    outcome = run("batch", photos / "none.png", photos / "a.png", "-o", tmp_path / "out", *FLASH, "--save", "depth.npy")
    assert outcome.status == 1
    assert "none.png" in outcome.stderr
    assert "1 done" in outcome.stderr


def test_no_device_ends_with_its_status(photos: Path, tmp_path: Path) -> None:
    outcome = run("batch", photos, "-o", tmp_path / "out", *FLASH, "--device", "no such device")
    assert outcome.status == 3
    assert "no such device" in outcome.stderr


@pytest.mark.usefixtures("in_this_process")
def test_shares_together_do_all(photos: Path, tmp_path: Path) -> None:
    lines = []
    for share in ("1/2", "2/2"):
        outcome = run("batch", photos, "-o", tmp_path / "out", *FLASH, "--save", "depth.npy", "--shard", share)
        assert outcome.status == 0
        lines += outcome.stdout.splitlines()
    assert sorted(lines) == [str(tmp_path / "out" / name) for name in ("a.png", "b.png", "deep/a.png")]
    files = sorted((tmp_path / "out/manifest").glob("*.jsonl"))
    records = [json.loads(line) for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    assert sorted(record["name"] for record in records) == ["a.png", "b.png", "deep/a.png"]


@pytest.mark.usefixtures("in_this_process")
def test_frames_of_a_video_with_masks_of_their_own(tmp_path: Path) -> None:
    clip, masks, out = tmp_path / "clip.mkv", tmp_path / "masks", tmp_path / "out"
    levels = [np.round(share * SCENE.image / SCENE.image.max()).astype(np.uint8) for share in (255, 230, 205, 180)]
    make_video(clip, [np.repeat(frame[..., None], 3, axis=-1) for frame in levels])
    mask = np.full(SCENE.image.shape, 255, np.uint8)
    mask[:, :4] = 0
    (masks / "clip.mkv").mkdir(parents=True)
    Image.fromarray(np.full_like(mask, 255)).save(masks / "clip.mkv.png")
    Image.fromarray(mask).save(masks / "clip.mkv" / "000003.png")
    options = (*FLASH, "--masks", masks, "--frames", "1::2", "--save", "depth.npy")
    outcome = run("batch", clip, "-o", out, *options)
    assert outcome.status == 0, outcome.stderr
    names = ["clip.mkv/000001", "clip.mkv/000003"]
    assert sorted(outcome.stdout.splitlines()) == [str(out / name) for name in names]
    shared, own = (np.load(out / name / "depth.npy") for name in names)
    assert np.isfinite(shared).all()
    np.testing.assert_array_equal(np.isfinite(own), mask > 0)
    Image.fromarray(levels[1]).save(tmp_path / "one.png")
    light = ps.prepare_photo(ps.read_photo(tmp_path / "one.png"), SCENE.camera).light
    np.testing.assert_array_equal(shared, ps.reconstruct(light, SCENE.camera, light=ps.FlashLight()).depth)
    assert "2 were done before" in run("batch", clip, "-o", out, *options).stderr


@pytest.mark.usefixtures("in_this_process")
def test_a_folder_of_colmap_with_its_cameras_and_masks(tmp_path: Path) -> None:
    """Names below a folder, masks named after them, and a camera that two images share."""
    images, sparse, masks, out = (tmp_path / name for name in ("images", "sparse", "masks", "out"))
    names = ["left/a.png", "left/b.png", "right/a.png"]
    for name in names:
        (images / name).parent.mkdir(parents=True, exist_ok=True)
        (masks / name).parent.mkdir(parents=True, exist_ok=True)
        write_grey(images / name, SCENE.image / SCENE.image.max())
        Image.fromarray(np.full(SCENE.image.shape, 255, np.uint8)).save(masks / f"{name}.png")
    height, width = SCENE.image.shape
    sparse.mkdir()
    (sparse / "cameras.txt").write_text(
        f"# Camera list\n1 SIMPLE_PINHOLE {width} {height} 24 {width / 2} {height / 2}\n"
        f"2 PINHOLE {width} {height} 30 31 {width / 2} {height / 2}\n"
    )
    poses = [(1, 1, names[0]), (2, 1, names[1]), (3, 2, names[2])]
    (sparse / "images.txt").write_text(
        "# Image list\n" + "".join(f"{one} 1 0 0 0 0 0 0 {camera} {name}\n1.5 2.5 -1\n" for one, camera, name in poses)
    )
    given = ("batch", images, "-o", out, "--light=flash", "--cameras", sparse / "cameras.txt", "--masks", masks)
    outcome = run(*given, "--save", "depth.npy,report")
    assert outcome.status == 0, outcome.stderr
    reports = {name: json.loads((out / name / "report.json").read_text(encoding="utf-8")) for name in names}
    lengths = {name: report["parameters"]["focal_length"] for name, report in reports.items()}
    assert lengths == {names[0]: [24, 24], names[1]: [24, 24], names[2]: [30, 31]}
    expected = [(width - 1) / 2, (height - 1) / 2]
    assert all(report["parameters"]["principal_point"] == expected for report in reports.values())
    (masks / f"{names[1]}.png").unlink()
    outcome = run(*given, "--save", "depth.npy", "--dry-run")
    assert outcome.status == 1
    assert f"persfs-cl: {images / names[1]} has no mask" in outcome.stderr
