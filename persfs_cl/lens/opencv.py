"""The package OpenCV, where it is installed."""

from __future__ import annotations

from types import ModuleType

from persfs_cl.errors import CameraError


def opencv() -> ModuleType:
    """The package OpenCV, which knows its own models.

    Raises
    ------
    CameraError
        When it is not installed.
    """
    try:
        import cv2
    except ImportError as error:
        raise CameraError(
            "The camera has a distortion, and the package that knows such is missing: pip install 'persfs-cl[lens]'."
        ) from error
    return cv2
