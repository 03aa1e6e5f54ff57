"""Which camera took a photo: as somebody says, or else as its file does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from persfs_cl.camera import COMMON_VIEWS, Camera, camera_from
from persfs_cl.checks import warn
from persfs_cl.errors import CameraError
from persfs_cl.io.cameras import read_camera
from persfs_cl.io.exif import exif_focal_length
from persfs_cl.lens.distortion import Distortion, told
from persfs_cl.lens.numbers import Lens
from persfs_cl.wording import keyword

_WIDE = 120.0
"""Degrees that hardly any lens sees which draws straight lines straight."""


@dataclass(frozen=True)
class CameraChoice:
    """What is said of the camera. Where neither focal length nor field of view is, the photo's file must say it.

    Attributes
    ----------
    focal_length : float, (float, float) or None
        In pixels.
    fov : float or None
        Horizontal, in degrees; it counts before the focal length.
    principal_point : (float, float) or None
        Column and row in pixels.
    size : (int, int) or None
        (height, width) of the images that this was said of; one of another size is refused.
    table : Path or None
        The file that says all this, if a file does. It makes no difference to the camera.
    distortion : tuple of float, Fisheye or None
        Of the lens, as for :class:`persfs_cl.Camera`.
    """

    focal_length: float | tuple[float, float] | None = None
    fov: float | None = None
    principal_point: tuple[float, float] | None = None
    size: tuple[int, int] | None = None
    table: Path | None = field(default=None, compare=False)
    distortion: Distortion | None = None

    def __post_init__(self) -> None:
        if self.fov is not None and self.distortion is not None:
            raise CameraError.about(
                "fov",
                self.fov,
                f"tells the focal length only of a lens without {keyword('distortion')}: give "
                f"{keyword('focal_length')}, in pixels.",
            )

    @classmethod
    def like(cls, camera: Camera) -> CameraChoice:
        """What is to be said for a camera."""
        return cls(camera.focal_length, principal_point=camera.principal_point, distortion=camera.distortion)

    @classmethod
    def of_file(cls, path: Path) -> CameraChoice:
        """What the file of one camera says, see :meth:`persfs_cl.Camera.from_file`.

        Raises
        ------
        InputError, CameraError
            When it cannot be used.
        """
        calibrated = read_camera(path)
        return replace(cls.like(camera_from(path, calibrated)), size=calibrated.size, table=path)

    @property
    def said(self) -> dict[str, Any]:
        """What is said of the camera itself, for the report."""
        lens: Any = self.distortion
        if isinstance(lens, Lens):
            model, coefficients = told(lens)
            lens = {model: coefficients}
        return {
            **{name: getattr(self, name) for name in ("focal_length", "fov", "principal_point")},
            "distortion": lens,
        }

    def of(self, path: Path, shape: tuple[int, int]) -> tuple[Camera, str]:
        """The camera of an image, and what told its focal length.

        Parameters
        ----------
        path : Path
            The image's file; its EXIF data say the focal length where nothing else does.
        shape : (int, int)
            (height, width) of the image.

        Raises
        ------
        CameraError
            When the EXIF data lack the focal length, or the image has not the size that is said.

        Warns
        -----
        UserWarning
            When the focal length makes so wide a view that it looks like millimetres.
        """
        if self.size is not None and self.size != tuple(shape):
            turned = " It may have been turned by its EXIF data." if self.size == tuple(shape)[::-1] else ""
            said_in = "the table" if self.table is None else self.table.name
            raise CameraError(
                f"{path} has {shape[1]} × {shape[0]} pixels, but its camera in {said_in} is for {self.size[1]} × "
                f"{self.size[0]}: give the photo that the camera was calibrated with.{turned}"
            )
        if self.fov is not None:
            return Camera.from_fov(self.fov, shape, self.principal_point), self._source("fov")
        if self.focal_length is None:
            try:
                length, tags = exif_focal_length(path, shape)
            except CameraError as error:
                raise error.adding(
                    f"Or give {keyword('fov')}, the horizontal field of view in degrees. {COMMON_VIEWS}"
                ) from error
            return Camera(length, self.principal_point, self.distortion), f"EXIF {tags}"
        camera = Camera(self.focal_length, self.principal_point, self.distortion)
        view = horizontal_view(camera, shape)
        if view > _WIDE and not isinstance(self.distortion, Lens):
            given = keyword("focal_length", camera.fx, written=f"{camera.fx:g}")
            warn(
                f"{given} means a view of {view:.0f} degrees from left to right of the {shape[1]} pixels: it is in "
                "pixels, not millimetres."
            )
        return camera, self._source("focal_length")

    def _source(self, name: str) -> str:
        return name if self.table is None else f"{name} of {self.table.name}"


def horizontal_view(camera: Camera, shape: tuple[int, int]) -> float:
    """Angle in degrees between the left and the right edge of an image of shape (height, width)."""
    left = camera.centre(shape)[0] + 0.5
    return math.degrees(math.atan(left / camera.fx) + math.atan((shape[1] - left) / camera.fx))
