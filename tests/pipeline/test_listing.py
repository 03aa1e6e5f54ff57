"""What paths stand for: each photograph once, with a folder for its results that is nobody else's."""

from __future__ import annotations

import os
import pickle
from pathlib import Path
from typing import Any

import pytest

from persfs_cl.errors import InputError
from persfs_cl.io import video
from persfs_cl.pipeline.listing import Input, Listing, list_inputs, mask_for
from persfs_cl.pipeline.naming import result_names, safe


def make(folder: Path, *names: str) -> Path:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return folder


def named(listing: Listing) -> list[str]:
    assert listing.problems == []
    return [entry.name for entry in listing.inputs]


def why(listing: Listing) -> list[tuple[str, str]]:
    return [(given, str(error)) for given, error in listing.problems]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_folder_is_its_images_and_those_of_its_folders(tmp_path: Path) -> None:
    photos = make(tmp_path, "b.JPG", "a.png", "a.jpg", "s/a.tiff", "s/t/x.nef", "notes.txt", "s/clip.mp4", "README")
    make(tmp_path, ".hidden.png", ".cache/c.png", "s/.persfs-cl-1/a.png")
    listing = list_inputs([photos])
    assert named(listing) == ["a.jpg", "a.png", "b.JPG", "s/a.tiff", "s/t/x.nef"]
    assert listing.inputs[3] == Input(photos / "s" / "a.tiff", "s/a.tiff")
    assert listing.roots == (photos,)
    assert pickle.loads(pickle.dumps(listing.inputs)) == listing.inputs
    # What is hidden may be named.
    assert named(list_inputs([photos / ".cache", photos / ".hidden.png"])) == [".hidden.png", "c.png"]


def test_output_and_masks_are_no_input(tmp_path: Path) -> None:
    make(tmp_path, "a.png", "out/a.png/preview.jpg", "m/a.png.png", "s/out/b.png")
    kept = named(list_inputs(tmp_path, output=tmp_path / "s" / ".." / "out", masks=tmp_path / "m"))
    assert kept == ["a.png", "s/out/b.png"]
    # Where they share a folder, the names tell.
    beside = make(
        tmp_path / "beside", "a.jpg", "a.jpg.png", "b.png", "b.png.png", "s/c.tif", "s/c.tif.png", "d.jpg.png"
    )
    assert named(list_inputs(beside, masks=beside)) == ["a.jpg", "b.png", "d.jpg.png", "s/c.tif"]
    assert len(list_inputs(beside).inputs) == 7


def test_links_are_followed_without_end_and_each_photo_is_there_once(tmp_path: Path) -> None:
    photos = make(tmp_path / "photos", "z/deep/a.png", "b.png")
    (photos / "again").symlink_to(photos / "z")
    (photos / "z" / "loop").symlink_to(photos)
    (photos / "z" / "other").symlink_to(make(tmp_path / "elsewhere", "c.png"))
    (photos / "elsewhere").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "elsewhere" / "back").symlink_to(photos / "z")
    (photos / "copy.png").symlink_to(photos / "b.png")
    # By the way without links; of links, by the first name. A link to a photo is a photo of its own.
    assert named(list_inputs([photos])) == ["b.png", "copy.png", "elsewhere/c.png", "z/deep/a.png"]
    (tmp_path / "link").symlink_to(photos)
    twice = list_inputs([tmp_path / "link", photos, str(photos / "z" / "**" / "*.png"), photos / "z" / ".." / "b.png"])
    assert named(twice) == ["b.png", "copy.png", "elsewhere/c.png", "z/deep/a.png"]
    assert twice.inputs[0].path == tmp_path / "link" / "b.png"


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        ("*.png", ["a.png", "b.png"]),
        ("s*/?.png", ["s1/a.png", "s2/a.png"]),
        ("s1/*", ["a.png", "t/c.jpg"]),
        ("s[2]", ["s2/a.png"]),
        ("**/*.png", ["a.png", "b.png", "s1/a.png", "s2/a.png"]),
        ("**/t/*", ["s1/t/c.jpg"]),
        ("**", ["a.png", "b.png", "s1/a.png", "s1/t/c.jpg", "s2/a.png"]),
        ("s1/**/c.*", ["t/c.jpg"]),
        ("./s1/../s2/*.png", ["a.png"]),
        ("x[1]/*.png", ["d.png"]),
        ("x[1]/[d].png", ["d.png"]),
    ],
)
def test_patterns(here: Path, pattern: str, expected: list[str]) -> None:
    make(here, "a.png", "b.png", "s1/a.png", "s1/t/c.jpg", "s2/a.png", "s2/notes.md", ".h/a.png")
    if pattern.startswith("x"):
        make(here, "x[1]/d.png", "x1/e.png")
    assert named(list_inputs([pattern])) == expected
    assert named(list_inputs([str(here / pattern)])) == expected


def test_a_file_keeps_its_path_if_that_stays_below(here: Path) -> None:
    make(here, "a/b.png", "a/photo[1].png", "odd.dat", "c.png")
    given = ["./a/b.png", "a/photo[1].png", "odd.dat", "a/../c.png"]
    assert named(list_inputs(given)) == ["a/b.png", "a/photo[1].png", "c.png", "odd.dat"]
    assert named(list_inputs(here / "a" / "b.png")) == ["b.png"]


def test_lists(here: Path) -> None:
    make(here, "l/a/b.png", "l/c d.png", "l/é.png", "x.png", "y.png", "# odd\n.png", "clip/1.png")
    (here / "l" / "list.lst").write_text("\ufeffa/b.png\r\n# c\n\n  c d.png \né.png\n../x.png\nno.png\n", "utf-8")
    listing = list_inputs(["l/list.lst"])
    assert [entry.name for entry in listing.inputs] == ["a/b.png", "c d.png", "x.png", "é.png"]
    assert why(listing) == [
        (
            "l/list.lst, line 7: no.png",
            "l/no.png does not exist: check the spelling and the folder. Paths in a list start at its folder.",
        )
    ]
    assert listing.roots == (Path("l"),)
    standard = list_inputs(["-"], read_stdin=lambda: b"x.png\n#\ncl*\nl/a\n")
    assert named(standard) == ["b.png", "clip/1.png", "x.png"]
    missing = why(list_inputs(["-"], read_stdin=lambda: b"no.png"))[0]
    assert missing[1] == "no.png does not exist: check the spelling and the folder."
    assert named(list_inputs(["-"], read_stdin=lambda: b"# odd\n.png\0y.png\0")) == ["# odd%0a.png", "y.png"]


def test_a_photo_in_place_of_a_list_is_no_list_of_paths(here: Path) -> None:
    make(here, "x.png")
    for data in (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0.\0x.png\0", b"\0.\0"):
        listing = list_inputs(["-"], read_stdin=lambda data=data: data)  # type: ignore[misc]
        assert listing.inputs == []
        ((given, said),) = why(listing)
        assert given == "-"
        assert "standard input holds no text: give photos by themselves" in said


def test_what_cannot_be_used_is_told_by_name_and_the_rest_goes_on(here: Path) -> None:
    make(here, "good.png", "empty/.x.png", "list.txt", "no/notes.md", "bad.lst", "only.lst", "in.lst")
    (here / "bad.lst").write_bytes(b"good.png\n\xff\xfe\n")
    (here / "only.lst").write_text("# nothing\n")
    (here / "in.lst").write_text("bad.lst\n")
    given = ["gone.png", "empty", "no/*.png", "gone/*.png", "list.txt", "bad.lst", "only.lst", "in.lst", "a\0b", "out"]
    make(here, "out/a.png")
    listing = list_inputs(given, output=here / "out")
    assert [entry.name for entry in listing.inputs] == ["good.png"]
    expected = [
        ("gone.png", "gone.png does not exist: check the spelling"),
        ("empty", "empty holds no image by its suffix (PNG, JPEG, TIFF, camera raw, WebP and others)"),
        ("no/*.png", "no/*.png fits no image"),
        ("gone/*.png", "gone/*.png fits nothing: gone is no folder"),
        ("list.txt", "list.txt is empty (0 bytes)"),
        ("bad.lst", "bad.lst, line 2, is no UTF-8"),
        ("only.lst", "only.lst names no photo: write a path a line"),
        ("in.lst, line 1: bad.lst", "bad.lst is a list in a list"),
        ("a\0b", "cannot be read (embedded null"),
        ("out", "out is the output itself: choose another output"),
    ]
    assert [given for given, _ in why(listing)] == [given for given, _ in expected]
    for (_, said), (_, part) in zip(why(listing), expected, strict=True):
        assert part in said
    with pytest.raises(InputError, match="7 is no path"):
        list_inputs([7])  # type: ignore[list-item]
    with pytest.raises(InputError, match="'' is no path: it is empty"):
        list_inputs(["a.png", ""])


def test_a_folder_that_cannot_be_read_is_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path, "a.png", "closed/b.png")
    scandir = os.scandir

    def refuse(path: str) -> object:
        if "closed" in path:
            raise PermissionError(13, "Permission denied")
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    listing = list_inputs([tmp_path])
    assert [entry.name for entry in listing.inputs] == ["a.png"]
    assert [given for given, _ in why(listing)] == [str(tmp_path / "closed")]
    assert "cannot be read (Permission denied): change its permissions" in why(listing)[0][1]


def test_equal_names_get_parents_until_they_differ(tmp_path: Path) -> None:
    make(tmp_path, "x/left/a.png", "x/right/a.png", "y/left/a.png", "y/left/b.png")
    given = [tmp_path / "x" / "left", tmp_path / "x" / "right", tmp_path / "y" / "left"]
    expected = ["b.png", "right/a.png", "x/left/a.png", "y/left/a.png"]
    assert named(list_inputs(given)) == expected
    assert named(list_inputs(reversed(given))) == expected
    assert result_names(["a", "a", "b"], ["/p/q/a", "/p/r/a", "/p/b"]) == ["q/a", "r/a", "b"]
    # The longer name is taken already.
    assert result_names(["a", "a", "q/a"], ["/p/q/a", "/p/r/a", "/s/q/a"]) == ["p/q/a", "r/a", "s/q/a"]


def test_no_result_lies_inside_another(tmp_path: Path) -> None:
    make(tmp_path, "r/a.png", "q/a.png/b.png", "q/c.png")
    assert named(list_inputs([tmp_path / "r", tmp_path / "q"])) == ["c.png", "q/a.png/b.png", "r/a.png"]


def test_names_are_safe(tmp_path: Path) -> None:
    make(tmp_path, "manifest/a.png", "Manifest/a.png", "_manifest/a.png", "index.html/a.jpg", "manifests/a.png")
    assert named(list_inputs([tmp_path])) == [
        "_Manifest/a.png",
        "__manifest/a.png",
        "_index.html/a.jpg",
        "_manifest/a.png",
        "manifests/a.png",
    ]
    assert safe("s/manifest") == "s/manifest"
    assert safe("s/.persfs-cl-1.png") == "s/_.persfs-cl-1.png"
    assert safe("contact.jpg") == "_contact.jpg"
    assert safe(os.fsdecode("é".encode() + b"\xff.png")) == "é%ff.png"
    assert safe("a\nb\x1b[31m\u2028 \u3000é.png") == "a%0ab%1b[31m%e2%80%a8 \u3000é.png"
    # Nothing but their names told these apart.
    (tmp_path / "odd").mkdir()
    make(tmp_path / "odd", "é%ff.png", os.fsdecode("é".encode() + b"\xff.png"))
    listing = list_inputs([tmp_path / "odd"])
    assert len(listing.inputs) == 1
    assert "rename one of them" in why(listing)[0][1]


def test_results_never_lie_where_photos_are(here: Path) -> None:
    make(here, "a.png", "s/b.png")
    listing = list_inputs(["a.png", "s"], output=here)
    assert [entry.name for entry in listing.inputs] == ["b.png"]
    assert why(listing) == [
        ("a.png", f"The results of a.png would lie where photos are, in {here.resolve()}: choose another output.")
    ]


def test_frames_without_a_video_are_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.png").touch()
    (tmp_path / "clip.mp4").touch()
    monkeypatch.setattr(video, "count_frames", lambda _path: 3)
    for given in (tmp_path, tmp_path / "a.png"):
        with pytest.raises(InputError, match="frames=':2' chooses frames of videos, and none is given"):
            list_inputs(given, frames=":2")
    assert len(list_inputs([tmp_path, tmp_path / "clip.mp4"], frames=":2").inputs) == 3
    # What is wrong with the only path comes first, and a video that cannot be read is one.
    assert "does not exist" in why(list_inputs(tmp_path / "gone", frames=":2"))[0][1]
    (tmp_path / "torn.mp4").touch()
    monkeypatch.undo()
    assert "torn.mp4" in why(list_inputs([tmp_path, tmp_path / "torn.mp4"], frames=":2"))[0][0]


def test_frames_of_videos(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path, "s/clip.mp4", "s/bad.MOV", "s/a.png", "t/clip.mp4")

    def count(path: str) -> int:
        if path.endswith("MOV"):
            raise InputError("bad is no video.")
        return 12

    monkeypatch.setattr(video, "count_frames", count)
    assert named(list_inputs([tmp_path / "s"])) == ["a.png"]
    clip = tmp_path / "s" / "clip.mp4"
    listing = list_inputs([clip, tmp_path / "s" / "*"], frames="2::7")
    assert [entry.name for entry in listing.inputs] == ["a.png", "clip.mp4/000002", "clip.mp4/000009"]
    assert listing.inputs[2] == Input(clip, "clip.mp4/000009", 9)
    assert why(listing) == [(str(tmp_path / "s" / "*"), "bad is no video.")]
    both = named(list_inputs([clip, tmp_path / "t" / "clip.mp4"], frames="3:4"))
    assert both == ["s/clip.mp4/000003", "t/clip.mp4/000003"]
    assert "has 12 frames, and none of those asked for" in why(list_inputs([clip], frames="20:"))[0][1]
    assert "would lie where photos are" in why(list_inputs([clip], frames=":1", output=tmp_path / "s"))[0][1]


def test_a_mask_is_named_after_its_photo(tmp_path: Path) -> None:
    masks = make(tmp_path / "masks", "abc/012.jpg.png", "clip.mp4.png", "clip.mp4/000002.png")
    photo = Input(tmp_path / "012.jpg", "abc/012.jpg")
    assert mask_for(photo, masks) == masks / "abc" / "012.jpg.png"
    frames = [mask_for(Input(tmp_path / "clip.mp4", f"clip.mp4/{i:06}", i), masks) for i in (1, 2)]
    assert frames == [masks / "clip.mp4.png", masks / "clip.mp4" / "000002.png"]
    with pytest.raises(InputError, match=r"12\.jpg has no mask: .*masks/12\.jpg\.png does not exist\. Make it"):
        mask_for(Input(tmp_path / "12.jpg", "12.jpg"), masks)


def test_files_in_a_folder_are_not_asked_for_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make(tmp_path, *(f"{number // 100}/{number}.png" for number in range(1000)))
    calls: list[str] = []
    stat = os.stat

    def counted(path: str, **options: Any) -> os.stat_result:
        calls.append(path)
        return stat(path, **options)

    monkeypatch.setattr(os, "stat", counted)
    assert len(list_inputs([tmp_path]).inputs) == 1000
    assert len(calls) < 10
