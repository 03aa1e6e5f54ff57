"""Frames of videos."""

from __future__ import annotations

from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath

SUFFIXES = frozenset({".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".mts", ".webm", ".wmv"})
"""In small letters."""


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
    """How many frames a video has."""
    raise InputError(f"{path}: to come.")
