"""Cameras in files: what OpenCV and others write, read to the same numbers."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl.errors import CameraError, InputError
from persfs_cl.io.calibrations import read_calibration

MATRIX = [[590.0, 0.0, 320.0], [0.0, 588.0, 240.0], [0.0, 0.0, 1.0]]
LENS = (-0.2, 0.05, 0.001, -0.002, 0.01)
CAMERA = ps.Camera((590.0, 588.0), (320.0, 240.0), LENS)

ROS = """# of a calibration
image_width: 640
image_height: 480
camera_name: narrow
camera_matrix:
  rows: 3
  cols: 3
  data: [590., 0., 320., 0., 588., 240., 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.05, 0.001, -0.002, 0.01]
"""
KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.1, 0.02, 0.003, 0.0004]
  distortion_model: equidistant
  intrinsics: [590.0, 588.0, 320.0, 240.0]
  resolution: [640, 480]
"""
BLOCKS = """cam0:
  T_cam_imu:
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 1.0, 0.0, 0.0]
  intrinsics:
  - 590.0
  - 588.0
  - 320.0
  - 240.0
  distortion_coeffs: [0.1, 0.2, 0.0, 0.0]
"""


@pytest.mark.parametrize("suffix", ["yaml", "yml", "json"])
def test_what_opencv_writes(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", np.array(MATRIX))
    storage.write("distortion_coefficients", np.array([LENS]).T)
    storage.release()
    assert ps.Camera.from_file(path) == CAMERA
    assert read_calibration(path).size == (480, 640)


@pytest.mark.parametrize(
    ("name", "text", "camera"),
    [
        ("ros.yaml", ROS, CAMERA),
        ("ros.yml", "---\n" + ROS, CAMERA),
        ("blocks.yaml", BLOCKS, ps.Camera((590.0, 588.0), (320.0, 240.0), (0.1, 0.2, 0.0, 0.0))),
        ("echo.yaml", "---\n" + ROS + "---\n", CAMERA),
        ("kalibr.yaml", KALIBR, ps.Camera((590.0, 588.0), (320.0, 240.0), ps.Fisheye(0.1, 0.02, 0.003, 0.0004))),
        ("k.json", json.dumps({"K": MATRIX, "D": LENS, "width": 640, "height": 480}), CAMERA),
        (
            "open3d.json",
            json.dumps({"width": 640, "height": 480, "intrinsic_matrix": np.array(MATRIX).T.ravel().tolist()}),
            ps.Camera((590.0, 588.0), (320.0, 240.0)),
        ),
        (
            "fov.json",
            json.dumps({"K": MATRIX, "D": [0.9], "distortion_model": "FOV"}),
            ps.Camera((590.0, 588.0), (320.0, 240.0), ps.FieldOfView(0.9)),
        ),
        (
            "fisheye.json",
            json.dumps({"camera_matrix": MATRIX, "dist_coeffs": [[0.1], [0.2], [0.3], [0.4]], "fisheye_model": 1}),
            ps.Camera((590.0, 588.0), (320.0, 240.0), ps.Fisheye(0.1, 0.2, 0.3, 0.4)),
        ),
    ],
)
def test_what_others_write(tmp_path: Path, name: str, text: str, camera: ps.Camera) -> None:
    (tmp_path / name).write_text(text, "utf-8")
    assert ps.Camera.from_file(tmp_path / name) == camera


@pytest.mark.parametrize(
    ("line", "camera"),
    [
        ("SIMPLE_PINHOLE 640 480 590 320.5 240.5", ps.Camera(590.0, (320.0, 240.0))),
        ("PINHOLE 640 480 590 588 320.5 240.5", ps.Camera((590.0, 588.0), (320.0, 240.0))),
        ("SIMPLE_RADIAL 640 480 590 320.5 240.5 -0.2", ps.Camera(590.0, (320.0, 240.0), (-0.2, 0, 0, 0))),
        ("RADIAL 640 480 590 320.5 240.5 -0.2 0.1", ps.Camera(590.0, (320.0, 240.0), (-0.2, 0.1, 0, 0))),
        (
            "OPENCV 640 480 590 588 320.5 240.5 1 2 3 4",
            ps.Camera((590.0, 588.0), (320.0, 240.0), (1, 2, 3, 4)),
        ),
        (
            "FULL_OPENCV 640 480 590 588 320.5 240.5 1 2 3 4 5 6 7 8",
            ps.Camera((590.0, 588.0), (320.0, 240.0), (1, 2, 3, 4, 5, 6, 7, 8)),
        ),
        (
            "OPENCV_FISHEYE 640 480 590 588 320.5 240.5 1 2 3 4",
            ps.Camera((590.0, 588.0), (320.0, 240.0), ps.Fisheye(1, 2, 3, 4)),
        ),
        (
            "THIN_PRISM_FISHEYE 640 480 590 588 320.5 240.5 1 2 3 4 5 6 7 8",
            ps.Camera((590.0, 588.0), (320.0, 240.0), ps.Fisheye(1, 2, 5, 6, 3, 4, 7, 8)),
        ),
        ("SIMPLE_RADIAL_FISHEYE 640 480 590 320.5 240.5 1", ps.Camera(590.0, (320.0, 240.0), ps.Fisheye(1))),
        ("RADIAL_FISHEYE 640 480 590 320.5 240.5 1 2", ps.Camera(590.0, (320.0, 240.0), ps.Fisheye(1, 2))),
        ("SIMPLE_FISHEYE 640 480 590 320.5 240.5", ps.Camera(590.0, (320.0, 240.0), ps.Fisheye())),
        ("FISHEYE 640 480 590 588 320.5 240.5", ps.Camera((590.0, 588.0), (320.0, 240.0), ps.Fisheye())),
        ("FOV 640 480 590 588 320.5 240.5 0.9", ps.Camera((590.0, 588.0), (320.0, 240.0), ps.FieldOfView(0.9))),
        (
            "RAD_TAN_THIN_PRISM_FISHEYE 640 480 590 588 320.5 240.5 1 2 3 4 5 6 7 8 9 10 11 12",
            ps.Camera((590.0, 588.0), (320.0, 240.0), ps.RadTanFisheye(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)),
        ),
    ],
)
def test_cameras_of_colmap(tmp_path: Path, line: str, camera: ps.Camera) -> None:
    path = tmp_path / "cameras.txt"
    path.write_text(f"# Camera list\n3 {line}\n", "utf-8")
    assert ps.Camera.from_file(path) == camera


@pytest.mark.parametrize(
    ("name", "text", "error", "said"),
    [
        ("a.json", "{", InputError, r"a\.json, line 1, is no JSON"),
        ("a.json", "[" * 100_000, InputError, r"a\.json"),
        ("a.json", "{}", InputError, "has no camera_matrix"),
        ("a.json", '[{"K": 1}]', InputError, "has no camera_matrix"),
        ("a.json", '{"K": [1, 2, 3]}', InputError, "has 3 numbers for camera_matrix"),
        ("a.json", '{"K": [1, 2, "x", 4]}', InputError, "has 'x' in camera_matrix: give finite numbers"),
        ("a.json", '{"K": [1, 2, NaN, 4]}', InputError, "has nan in camera_matrix"),
        ("a.json", '{"K": [[5, 1, 3], [0, 5, 3], [0, 0, 1]]}', CameraError, "with skew"),
        ("a.json", '{"K": [0, 0, 1, 1]}', CameraError, r"a\.json: focal_length=\(0\.0, 0\.0\) is impossible"),
        ("a.json", '{"K": [5, 5, 1, 1], "D": [1, 2]}', CameraError, r"a\.json: distortion=.* is impossible"),
        (
            "a.json",
            '{"K": [5, 5, 1, 1], "D": [1], "fisheye_model": true}',
            CameraError,
            "impossible for a lens of the model fisheye",
        ),
        ("a.json", '{"K": [5, 5, 1, 1], "D": [4], "model": "fov"}', CameraError, "between -π and π"),
        ("a.json", '{"K": [5, 5, 1, 1], "model": "omni"}', CameraError, "has the lens model 'omni'"),
        ("a.json", '{"K": [5, 5, 1, 1], "width": 0.5, "height": 4}', InputError, "has 0.5 for image_width"),
        ("a.json", '{"K": [5, 5, 1, 1], "width": NaN, "height": 4}', InputError, "has nan for image_width"),
        ("a.json", '{"intrinsic_matrix": 5}', InputError, "has 5 in camera_matrix|has None in camera_matrix"),
        ("a.json", '{"intrinsic_matrix": []}', InputError, "has 0 numbers"),
        ("a.json", '{"K": [5, 5, 1, 1' + "0" * 400 + "]}", InputError, "in camera_matrix: give finite numbers"),
        ("a.json", '{"cam0": {"K": [1]}, "cam1": {"K": [1]}}', InputError, "has 2 cameras: leave the one"),
        (
            "a.json",
            '{"K": [5, 5, 1, 1], "camera_model": "omni", "distortion_model": "radtan"}',
            CameraError,
            "has the lens model 'omni'",
        ),
        ("a.json", '{"K": [5, 5, 1, 1], "width": 5}', InputError, "has None for image_height"),
        ("a.yaml", "a: [1, 2\n b", InputError, r"a\.yaml"),
        ("a.yaml", "text", InputError, r"a\.yaml"),
        ("a.toml", "K = 1", InputError, "is no camera by its name"),
        ("cameras.txt", "1 PINHOLE 4 4 1 1 1 1\n2 PINHOLE 4 4 1 1 1 1\n", InputError, "has 2 cameras: leave the line"),
        ("cameras.txt", "1 DIVISION 4 4 1 1 1 1 1\n", CameraError, "has the camera model DIVISION"),
        (
            "cameras.txt",
            "1 FOV 4 4 1 1 1 1 4\n",
            CameraError,
            r"with 4 for ω: .* between -π and π .*; 4 degrees are 0\.0698",
        ),
        (
            "cameras.txt",
            f"1 RAD_TAN_THIN_PRISM_FISHEYE 4 4 1 1 1 1 1e7{' 0' * 11}\n",
            CameraError,
            r"distortion=10000000\.0 is impossible for k0 of RadTanFisheye: give a number between -1,000,000 and",
        ),
        ("cameras.txt", "1 PINHOLE -4 4 1 1 1 1\n", InputError, "line 1, has images of -4 x 4 pixels: give the width"),
        ("cameras.txt", "1 PINHOLE 4 0 1 1 1 1\n", InputError, "line 1, has images of 4 x 0 pixels"),
        ("cameras.txt", "1 OPENCV 4 4 1 1 1 1 1\n", InputError, "COLMAP writes 8 parameters for OPENCV there"),
    ],
)
def test_what_is_no_camera_is_refused(tmp_path: Path, name: str, text: str, error: type[Exception], said: str) -> None:
    (tmp_path / name).write_text(text, "utf-8")
    with pytest.raises(error, match=said):
        ps.Camera.from_file(tmp_path / name)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    for name in ("a.json", "a.yaml", "a.txt", "a"):
        with pytest.raises(InputError, match="does not exist"):
            ps.Camera.from_file(tmp_path / name)


def test_yaml_without_its_reader_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.yaml").write_text(ROS, "utf-8")
    hidden: Any = None
    monkeypatch.setitem(sys.modules, "yaml", hidden)
    with pytest.raises(CameraError, match=r"is YAML, which PyYAML reads.*pip install 'persfs-cl\[lens\]'"):
        ps.Camera.from_file(tmp_path / "a.yaml")
