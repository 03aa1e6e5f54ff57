"""Frames of videos: how many there are, and single ones, decoded by imageio's plugin for PyAV."""

from __future__ import annotations

import importlib.util
import os
import threading
import weakref
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, as_path, opened
from persfs_cl.io.limits import require_pixels
from persfs_cl.io.remarks import decoding

SUFFIXES = frozenset({".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".mts", ".webm", ".wmv"})
"""In small letters."""


@dataclass(frozen=True)
class VideoHeader:
    """What a video says of itself.

    Attributes
    ----------
    frames : int
        How many there are.
    size : (int, int)
        (height, width) of each, upright.
    turns : int
        Quarter turns, counterclockwise, that make what is stored upright.
    """

    frames: int
    size: tuple[int, int]
    turns: int


def frame_slice(text: str | None) -> slice:
    """Which frames START:STOP:STEP are, as Python slices have it; all for None.

    Raises
    ------
    InputError
        When it is something else.
    """
    if text is None:
        return slice(None)
    try:
        parts = [int(part) if part.strip() else None for part in text.split(":")]
    except (ValueError, AttributeError):
        parts = []
    if len(parts) not in (2, 3) or parts[2:] == [0]:
        raise InputError.about("frames", text, "chooses no frames: give START:STOP:STEP, such as 0:100:5 or ::10.")
    return slice(*parts)


def count_frames(path: FilePath) -> int:
    """How many frames a video has.

    Raises
    ------
    InputError
        As :func:`read_video_header`.
    """
    return read_video_header(path).frames


def read_video_header(path: FilePath) -> VideoHeader:
    """What a video says of itself; its frames are counted where it does not, without decoding them.

    Raises
    ------
    InputError
        When the file cannot be read, or is no video; when PyAV is not installed.
    """
    _require_av(path)
    return _header(as_path(path), _status(path))


@lru_cache(maxsize=256)
def _header(path: Path, _status: tuple[int, int]) -> VideoHeader:
    import av

    with decoding(path, "cannot be read as a video"), av.open(os.fspath(path)) as container:
        if not container.streams.video:
            raise InputError(f"{path} has no pictures, or was cut off: give a video, or copy it again.")
        stream = container.streams.video[0]
        first = next(container.decode(stream), None)
        frames = stream.frames
        if first is None:
            raise InputError(f"{path} has no frame that can be read: save or copy it again.")
        if not frames:
            container.seek(0)
            frames = sum(1 for packet in container.demux(stream) if packet.size)
        turns = round(first.rotation / 90) % 4
        size = (first.width, first.height) if turns % 2 else (first.height, first.width)
        require_pixels(path, size)
        return VideoHeader(frames, size, turns)


def read_samples(path: FilePath, frame: int) -> NDArray[np.uint8]:
    """A frame of a video, upright: (height, width, 3).

    The video stays open in the thread that has read of it, so that those who read its frames in their order decode each
    once. Whoever goes back begins again: seeking finds other frames than are counted, in many videos.

    Raises
    ------
    InputError
        As :func:`read_video_header`, and when there is no such frame.
    """
    _require_av(path)
    place = as_path(path)
    status = _status(path)
    reader: _Reader | None = getattr(_open, "reader", None)
    if reader is None or (reader.path, reader.status) != (place, status) or frame < reader.next:
        close_video()
        reader = _open.reader = _Reader(path, status)
    try:
        return reader.read(frame)
    except InputError:
        close_video()
        raise


def close_video() -> None:
    """Close the video that this thread has open, if any."""
    reader: _Reader | None = getattr(_open, "reader", None)
    _open.reader = None
    if reader is not None:
        reader.close()


class _Reader:
    """A video that is read from its beginning to its end, by one thread."""

    def __init__(self, path: FilePath, status: tuple[int, int]) -> None:
        import imageio.v3 as imageio

        self.path, self.status, self.next = as_path(path), status, 0
        self.header = read_video_header(path)
        with decoding(path, "cannot be read as a video"):
            self.plugin: Any = imageio.imopen(self.path, "r", plugin="pyav")
        # Also when the thread ends, or the process does.
        self.close = weakref.finalize(self, self.plugin.close)

    def read(self, frame: int) -> NDArray[np.uint8]:
        with decoding(self.path, "cannot be read as a video"):
            try:
                samples = self.plugin.read(index=frame, constant_framerate=False, thread_type="FRAME")
            except (StopIteration, EOFError) as error:
                raise InputError(
                    f"{self.path} has no frame {frame} that can be read, of {self.header.frames}: choose another."
                ) from error
        self.next = frame + 1
        return np.ascontiguousarray(np.rot90(samples, self.header.turns))


_open = threading.local()


def _status(path: FilePath) -> tuple[int, int]:
    """What tells a file from another that has taken its place."""
    with opened(path) as file:
        status = os.fstat(file.fileno())
    return status.st_ino, status.st_mtime_ns


def _require_av(path: FilePath) -> None:
    if importlib.util.find_spec("av") is None:
        raise InputError(f"{path} is a video, and PyAV, which reads them, is missing: pip install 'persfs-cl[video]'.")
