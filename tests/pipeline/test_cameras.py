"""Cameras from tables: of whatever form, by whatever path, and every slip named with its line."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import pytest

import persfs_cl as ps
from persfs_cl.errors import CameraError, InputError, PersfsError
from persfs_cl.pipeline.cameras import read_cameras
from persfs_cl.pipeline.listing import Input
from persfs_cl.pipeline.optics import CameraChoice

CAMERAS = """# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
1 SIMPLE_PINHOLE 640 480 500 320 240
2 PINHOLE 800 600 700 710 401.5 300
7 SIMPLE_RADIAL 640 480 500 320 240 0.1
8 DIVISION 640 480 500 500 320 240 0.1
"""
IMAGES = """# Image list with two lines of data per image:
1 1 0 0 0 0 0 0 1 s/a b.jpg
10.5 20.5 -1 11 21 3
2 1 0 0 0 0 0 0 2 c.jpg

3 1 0 0 0 0 0 0 7 d.jpg
1 2 3
4 1 0 0 0 0 0 0 8 e.jpg

"""


def write(path: Path, text: str) -> Path:
    path.write_text(text, "utf-8")
    return path


def choice(folder: Path, rows: object, name: str = "a.png") -> CameraChoice:
    return read_cameras(write(folder / "c.json", json.dumps(rows))).choice(Input(folder / name, name))


def test_columns_of_a_csv_file(tmp_path: Path) -> None:
    text = "path,focal_length,fx,fy,fov,cx,cy,width,height\n"
    text += 'a.png,500,,,,,,,\n"s/b, c.png",,500,510,,30,20.5,64,48\n\nd.png,,,,60,3,4,,\n'
    table = read_cameras(write(tmp_path / "c.csv", "\ufeff" + text))
    assert table.rows == {
        "a.png": CameraChoice(500.0),
        "s/b, c.png": CameraChoice((500.0, 510.0), None, (30.0, 20.5), (48, 64)),
        "d.png": CameraChoice(None, 60.0, (3.0, 4.0)),
    }
    assert pickle.loads(pickle.dumps(table)) == table
    camera, source = table.choice(Input(tmp_path / "x", "d.png")).of(tmp_path / "x", (40, 60))
    assert camera == ps.Camera.from_fov(60.0, (40, 60), (3.0, 4.0))
    assert source == "fov of c.csv"


def test_objects_of_a_json_file(tmp_path: Path) -> None:
    rows: dict[str, Any] = {"a.png": {"focal_length": [500, 510], "principal_point": [30, 20]}, "b.png": {"fov": 50}}
    listed = [{"path": path, **row} for path, row in rows.items()]
    for form in (rows, listed):
        assert choice(tmp_path, form) == CameraChoice((500.0, 510.0), None, (30.0, 20.0))
        assert choice(tmp_path, form, "b.png") == CameraChoice(None, 50.0)


def test_a_row_is_found_by_name_then_by_table_then_by_root_then_by_absolute_path(tmp_path: Path) -> None:
    path = tmp_path / "data" / "s" / "a.png"
    keys = ["n/a.png", "../data/s/a.png", "a.png", str(path)]
    rows = {key: {"fov": 50 + number} for number, key in enumerate(keys)}
    (tmp_path / "tables").mkdir()
    for number in range(4):
        left = dict(list(rows.items())[number:])
        table = read_cameras(write(tmp_path / "tables" / "c.json", json.dumps(left)))
        found = table.choice(Input(path, "n/a.png"), roots=[tmp_path, path.parent])
        assert found.fov == 50 + number
    frame = Input(tmp_path / "clip.mp4", "clip.mp4/000012", 12)
    table = read_cameras(
        write(tmp_path / "c.json", json.dumps({"./clip.mp4": {"fov": 40}, "clip.mp4/000012": {"fov": 41}}))
    )
    assert table.choice(frame).fov == 41
    assert table.choice(Input(tmp_path / "clip.mp4", "clip.mp4/000013", 13)).fov == 40
    with pytest.raises(CameraError, match=r"x\.png has no camera in .*c\.json: add a row for 'n/x\.png'"):
        table.choice(Input(tmp_path / "x.png", "n/x.png"))


def test_cameras_of_colmap(tmp_path: Path) -> None:
    write(tmp_path / "cameras.txt", CAMERAS)
    write(tmp_path / "images.txt", IMAGES)
    for given in (tmp_path, tmp_path / "cameras.txt"):
        table = read_cameras(given)
        # Pixels there are centred on halves.
        assert table.rows == {
            "s/a b.jpg": CameraChoice(500.0, None, (319.5, 239.5), (480, 640)),
            "c.jpg": CameraChoice((700.0, 710.0), None, (401.0, 299.5), (600, 800)),
            "d.jpg": CameraChoice(500.0, None, (319.5, 239.5), (480, 640), distortion=(0.1, 0.0, 0.0, 0.0)),
        }
        with pytest.raises(CameraError, match=r"^.*e\.jpg: .*line 6, has the camera model DIVISION.*undistorter"):
            table.choice(Input(tmp_path / "e.jpg", "e.jpg"))
    found = table.choice(Input(tmp_path / "images" / "c.jpg", "images/c.jpg"), roots=[tmp_path / "images"])
    assert found.of(tmp_path, (600, 800)) == (ps.Camera((700.0, 710.0), (401.0, 299.5)), "focal_length of cameras.txt")
    with pytest.raises(
        CameraError, match=r"c\.jpg has 400 × 300 pixels, but its camera in cameras\.txt is for 800 × 600"
    ):
        found.of(tmp_path / "c.jpg", (300, 400))
    with pytest.raises(CameraError, match=r"may have been turned by its EXIF data\.$"):
        found.of(tmp_path / "c.jpg", (800, 600))


def test_a_single_camera_of_colmap_is_that_of_all(tmp_path: Path) -> None:
    write(tmp_path / "cameras.txt", "1 SIMPLE_PINHOLE 640 480 500 320 240\n")
    assert read_cameras(tmp_path).choice(Input(tmp_path / "x.png", "x.png")).focal_length == 500
    write(tmp_path / "cameras.txt", CAMERAS)
    with pytest.raises(InputError, match=r"cameras\.txt has 4 cameras: put COLMAP's images\.txt beside it"):
        read_cameras(tmp_path)
    write(tmp_path / "cameras.txt", "1 DIVISION 640 480 500 500 320 240 0\n")
    with pytest.raises(CameraError, match=r"line 1, has the camera model DIVISION.*image_undistorter"):
        read_cameras(tmp_path)
    (tmp_path / "cameras.txt").rename(tmp_path / "cameras.bin")
    with pytest.raises(InputError, match=r"does not exist, but cameras\.bin: .*colmap model_converter"):
        read_cameras(tmp_path)


@pytest.mark.parametrize(
    ("rows", "lens"),
    [
        ({"k1": -0.1}, (-0.1, 0.0, 0.0, 0.0)),
        ({"k1": -0.1, "k3": 0.2}, (-0.1, 0.0, 0.0, 0.0, 0.2)),
        ({"p2": 0.01, "k5": 0.2}, (0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.2, 0.0)),
        ({"fisheye": True, "k1": 0.1, "k3": 0.2}, ps.Fisheye(0.1, 0.0, 0.2)),
        ({"distortion": [0.1, 0.2, 0, 0]}, (0.1, 0.2, 0.0, 0.0)),
        ({"fisheye": 1, "distortion": [0.1, 0.2, 0, 0]}, ps.Fisheye(0.1, 0.2)),
    ],
)
def test_lenses_of_a_table(tmp_path: Path, rows: dict[str, object], lens: object) -> None:
    assert choice(tmp_path, [{"path": "a.png", "focal_length": 500.0, **rows}]).distortion == lens


def test_lenses_of_a_table_in_csv(tmp_path: Path) -> None:
    table = write(tmp_path / "c.csv", "path,focal_length,k1,k2,fisheye\na,500,-0.1,0.02,\nb,400,0.1,,1\n")
    rows = read_cameras(table).rows
    assert rows["a"].distortion == (-0.1, 0.02, 0.0, 0.0)
    assert rows["b"].distortion == ps.Fisheye(0.1)


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("c.json", '{"a": {"fov": 50, "k1": 0.1}}', r"'a': fov=50\.0 tells the focal length only of a lens without"),
        ("c.csv", "path,focal_length,fisheye,p1\na,500,1,0.1\n", r"'a': a fisheye has k1, k2, k3 and k4"),
        ("c.json", '{"a": {"focal_length": 5, "k1": 0.1, "distortion": [1]}}', r"'a': it has a distortion and k1"),
        ("c.json", '{"a": {"focal_length": 5, "k1": "x"}}', r"'a': k1='x' is no|k1"),
        ("c.json", '{"a": {"focal_length": 5, "k1": [1]}}', r"'a': k1=\[1\]"),
        ("c.json", '{"a": {"focal_length": 5, "fisheye": "yes"}}', r"'a': it has 'yes' for fisheye"),
        ("c.json", '{"a": {"focal_length": 5, "fisheye": 1, "distortion": [1, 2, 3, 4, 5]}}', r"of a fisheye: give k1"),
        ("c.json", '{"a": {"focal_length": 5, "distortion": [1]}}', r"'a': distortion=.* is impossible"),
        ("c.csv", "image,fov\na,50\n", r"c\.csv has no column 'path', but \['image', 'fov'\]"),
        ("c.csv", "path,fov,focus\na,50,1\n", r"c\.csv has the columns .*leave out those that are not"),
        ("c.csv", "path,fov\na,50\nb,wide\n", r"c\.csv, line 3, has 'wide' for fov: give a number"),
        (
            "c.csv",
            "path,fov\na,200\n",
            r"c\.csv, line 2, 'a': A horizontal field of view of 200\.0 degrees is impossible",
        ),
        ("c.csv", "path,focal_length\n\na,-5\n", r"c\.csv, line 3, 'a': focal_length=-5\.0 is impossible"),
        ("c.csv", "path,focal_length\na,nan\n", r"c\.csv, line 2, 'a': focal_length=nan is impossible"),
        (
            "c.csv",
            "path,focal_length,fov\na,5,50\n",
            r"line 2, 'a': it has focal_length and fov: give the focal length or",
        ),
        ("c.csv", "path,focal_length\na,\n", r"line 2, 'a': it has neither: give"),
        ("c.csv", "path,fx,fy\na,5,\n", r"line 2, 'a': it has fx alone: give fx and fy, or neither"),
        ("c.csv", "path,fov,width,height\na,50,6.5,4\n", r"line 2, 'a': width 6\.5 and height 4 are no size"),
        ("c.csv", "path,fov\na,50\n./a,60\n", r"line 3, has '\./a' again after .*line 2: leave one"),
        ("c.csv", "path,fov\na,50,3\n", r"line 2, has 3 values for 2 columns"),
        ("c.csv", "path,fov\n,50\n", r"line 2, names no photo"),
        ("c.csv", "path,fov\n", r"c\.csv has no row: write one for each photo"),
        ("c.json", '{"a": {"fov": 50},\n "b"}', r"c\.json, line 2, is no JSON"),
        ("c.json", '{"a": {"fov": 50}, "a": {"fov": 60}}', r"c\.json has 'a' more than once"),
        ("c.json", '{"a": {"fov": 50, "fov": 60}}', r"'a' has 'fov' more than once"),
        ("c.json", '{"a": 50}', r"c\.json, is no object with a path"),
        ("c.json", '[{"path": "a", "fov": 50}, {"fov": 50}]', r"c\.json, entry 2, is no object with a path"),
        ("c.json", '[{"path": "a", "fov": "50"}]', r"c\.json, entry 1, 'a': fov='50' is not possible"),
        ("c.json", '[{"path": "a", "fov": 50, "f": 3}]', r"'a': 'f' is no name of a table"),
        ("c.json", "3", r"c\.json holds int: give a list"),
        ("c.json", "[" * 100_000, r"c\.json is nested too deep"),
        ("cameras.txt", "1 PINHOLE 640 480 500 320 240\n", r"cameras\.txt, line 1, is '1 PINHOLE .*4 parameters"),
        ("cameras.txt", "1 PINHOLE 640\n", r"cameras\.txt, line 1, is .*COLMAP writes CAMERA_ID MODEL"),
        (
            "cameras.txt",
            "1 PINHOLE 640 480 -5 5 3 2\n",
            r"cameras\.txt, line 1: focal_length=\(-5\.0, 5\.0\) is impossible",
        ),
        ("cameras.txt", "1 PINHOLE 1 1 5 5 3 2\n" * 2, r"line 2, is the second with camera 1"),
        ("cameras.txt", "# none\n", r"cameras\.txt has no camera"),
        ("c.xml", "x", r"c\.xml is no table of cameras by its name"),
    ],
)
def test_what_is_wrong_in_a_table_is_named_with_its_line(tmp_path: Path, file: str, text: str, said: str) -> None:
    with pytest.raises(PersfsError, match=said):
        read_cameras(write(tmp_path / file, text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 1 0 0 0 0 0 0 5 a.jpg\n\n", r"images\.txt, line 1, names camera 5, which .*cameras\.txt lacks"),
        ("1 1 0 0 0 0 0 0 a.jpg\n\n", r"images\.txt, line 1, is '1 1 0 0 0 0 0 0 a\.jpg': COLMAP writes IMAGE_ID"),
    ],
)
def test_what_is_wrong_in_the_images_of_colmap_is_named_too(tmp_path: Path, text: str, said: str) -> None:
    write(tmp_path / "cameras.txt", CAMERAS)
    write(tmp_path / "images.txt", text)
    with pytest.raises(InputError, match=said):
        read_cameras(tmp_path)


def test_a_table_that_is_not_there(tmp_path: Path) -> None:
    for name in ("c.csv", "c.json", "cameras.txt", "other"):
        with pytest.raises(InputError, match=f"{name} does not exist: check the spelling and the folder"):
            read_cameras(tmp_path / name)
