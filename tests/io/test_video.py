"""Frames of videos: the very ones that are counted, upright."""

from __future__ import annotations

import importlib.util
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from videos import make_video

from persfs_cl.errors import InputError
from persfs_cl.io import video
from persfs_cl.io.photos import read_frame
from persfs_cl.io.video import VideoHeader, close_video, count_frames, frame_slice, read_samples, read_video_header

SIZE = (48, 64)


def numbered(count: int) -> Iterator[NDArray[np.uint8]]:
    """Frames that differ from each other in all their pixels."""
    for number in range(count):
        samples = np.full((*SIZE, 3), 20 + 7 * number, np.uint8)
        samples[:24, :32] = 255 - 5 * number
        yield samples


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    yield
    close_video()


@pytest.mark.parametrize(
    ("name", "codec", "pixels", "uneven"),
    [
        ("a.mp4", "libx264", "yuv420p", True),
        ("a.mkv", "libx264", "yuv420p", True),
        ("a.webm", "libvpx-vp9", "yuv420p", False),
        ("a.avi", "mpeg4", "yuv420p", False),
        ("a.mov", "mjpeg", "yuvj420p", False),
    ],
)
def test_each_frame_in_any_order(tmp_path: Path, name: str, codec: str, pixels: str, uneven: bool) -> None:
    path = tmp_path / name
    frames = make_video(path, numbered(30), codec=codec, pixels=pixels, uneven=uneven)
    assert count_frames(path) == len(frames) == 30
    # Forward with gaps, back, and the last.
    for number in (0, 1, 2, 7, 8, 20, 19, 3, 29):
        np.testing.assert_array_equal(read_samples(path, number), frames[number])


def test_frames_without_loss_are_photos(tmp_path: Path) -> None:
    path = tmp_path / "a.mkv"
    make_video(path, numbered(5))
    photo = read_frame(path, 3, channel="red")
    expected = list(numbered(4))[3][..., 0]
    np.testing.assert_array_equal(photo.largest_sample, expected)
    np.testing.assert_array_equal(photo.image, photo.linear(expected))
    assert (photo.bits, photo.encoding, photo.channel, photo.mask, photo.path) == (8, "srgb", "red", None, path)


def test_frames_are_turned_upright(tmp_path: Path) -> None:
    path = tmp_path / "a.mov"
    (frame,) = make_video(path, numbered(1), codec="mjpeg", pixels="yuvj420p")
    data = bytearray(path.read_bytes())
    # The matrix of the track header: 90 degrees clockwise, as telephones write it.
    place = data.index(b"tkhd") + 4 + 40
    assert struct.unpack_from(">9i", data, place)[:2] == (0x10000, 0)
    struct.pack_into(">9i", data, place, 0, 0x10000, 0, -0x10000, 0, 0, SIZE[0] << 16, 0, 0x40000000)
    path.write_bytes(data)
    assert read_video_header(path) == VideoHeader(1, (64, 48), 3)
    np.testing.assert_array_equal(read_samples(path, 0), np.rot90(frame, -1))


def test_a_video_stays_open_for_its_thread_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mkv"
    frames = make_video(path, numbered(6))
    opened: list[Path] = []
    header = video.read_video_header

    def counted(path: Path) -> VideoHeader:
        opened.append(path)
        return header(path)

    monkeypatch.setattr(video, "read_video_header", counted)
    for number in (0, 2, 5):
        read_samples(path, number)
    assert len(opened) == 1
    read_samples(path, 5)
    assert len(opened) == 2
    found = []
    thread = threading.Thread(target=lambda: found.append(read_samples(path, 1)))
    thread.start()
    thread.join()
    np.testing.assert_array_equal(found, frames[1:2])
    assert len(opened) == 3
    # Another file of that name is another video.
    other = tmp_path / "b.mkv"
    others = make_video(other, numbered(9), codec="libx264", pixels="yuv420p")
    other.replace(path)
    np.testing.assert_array_equal(read_samples(path, 8), others[8])


def test_what_is_no_video_or_no_frame_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.mp4"
    make_video(path, numbered(3), codec="mpeg4", pixels="yuv420p")
    with pytest.raises(InputError, match=r"a\.mp4 has no frame 3 that can be read, of 3: choose another"):
        read_frame(path, 3)
    with pytest.raises(InputError, match="frame=-1 is not possible"):
        read_frame(path, -1)
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "cut.mp4").write_bytes(path.read_bytes()[:500])
    (tmp_path / "empty.mp4").touch()
    for name, said in [
        ("text.mp4", r"text\.mp4 cannot be read as a video \(.*\): save or copy it again"),
        ("cut.mp4", r"cut\.mp4 has no pictures, or was cut off"),
        ("empty.mp4", r"empty\.mp4 is empty \(0 bytes\)"),
        ("none.mp4", r"none\.mp4 does not exist"),
    ]:
        for ask in (count_frames, lambda path: read_frame(path, 0)):
            with pytest.raises(InputError, match=said):
                ask(tmp_path / name)
    with av.open(str(tmp_path / "sound.mp4"), "w") as container:
        stream: Any = container.add_stream("aac", rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
        container.mux(stream.encode())
    with pytest.raises(InputError, match=r"sound\.mp4 has no pictures, or was cut off: give a video"):
        count_frames(tmp_path / "sound.mp4")
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(
        InputError, match=r"a\.mp4 is a video, and PyAV.* is missing: pip install 'persfs-cl\[video\]'\."
    ):
        count_frames(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("text", "expected"),
    [(None, [0, 1, 2, 3, 4]), ("1:3", [1, 2]), ("::2", [0, 2, 4]), ("-2:", [3, 4]), (" 1 : : 3", [1, 4])],
)
def test_a_choice_of_frames(text: str | None, expected: list[int]) -> None:
    assert list(range(5)[frame_slice(text)]) == expected


@pytest.mark.parametrize("text", ["", "3", "a:b", "0:9:0", "1:2:3:4", "1.5:2"])
def test_what_chooses_no_frames(text: str) -> None:
    with pytest.raises(InputError, match=r"frames='.*' chooses no frames: give START:STOP:STEP"):
        frame_slice(text)
