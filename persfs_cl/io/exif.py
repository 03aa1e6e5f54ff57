"""The focal length that a photo's EXIF data tell, in pixels, and where they cannot be right."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from persfs_cl.checks import warn
from persfs_cl.errors import CameraError
from persfs_cl.io.decode import asked
from persfs_cl.io.files import FilePath, as_path
from persfs_cl.io.raster import exif_number
from persfs_cl.io.tiff import BIG_SIGNATURES, read_directories
from persfs_cl.io.video import SUFFIXES as VIDEOS
from persfs_cl.wording import keyword

# The frame of 35 mm film is 36 mm × 24 mm.
_FILM_DIAGONAL = math.hypot(36.0, 24.0)
# EXIF's FocalPlaneResolutionUnit, in millimetres. 2 and 3 are in the standard, 4 and 5 in use besides.
_RESOLUTION_UNITS = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
# Millimetres: the longer side of the sensor of a simple telephone and of a medium-format camera, with room.
_SENSORS = (3.0, 60.0)
# Degrees: of a telescope, and of the widest lens that draws straight lines straight.
_VIEWS = (1.0, 150.0)
# The 35 mm equivalent is rounded to whole millimetres, and makers differ in what they hold to be equivalent.
_AGREEMENT = 1.1
# Pixels, of which no camera that writes FocalPlaneXResolution makes so few.
_SMALL = 1_000_000
_EDITORS = re.compile(
    r"photoshop|lightroom|gimp|paint\.?net|affinity|irfanview|imagemagick|graphicsmagick|darktable|rawtherapee|"
    r"capture one|acdsee|picasa|snapseed|paint ?shop|pixelmator|corel|digikam|gthumb|shotwell|xnview|faststone|luminar|"
    r"dxo|photolab|\bon1\b|photoscape|krita|imageready|photo editor|photos? \d|windows photo|preview|iphoto|aperture|"
    r"photo gallery|zoner|polarr|vsco|canva|pixlr|adobe|ffmpeg|nikon transfer|capture nx|viewnx|digital photo prof",
    re.IGNORECASE,
)
_NAMES = {11: "ProcessingSoftware"}
"""Of tags that exifread has no name for."""
_TELL = f"Give {keyword('focal_length')}, in pixels."


def exif_focal_length(path: FilePath, shape: tuple[int, int] | None = None) -> tuple[float, str]:
    """The focal length that a photo's EXIF data describe, and by which of their tags.

    Errors, warnings and meaning are those of :meth:`Camera.from_exif <persfs_cl.camera.Camera.from_exif>`.

    Parameters
    ----------
    path : path
    shape : (int, int), optional
        (height, width) of the image that was read; by default the file is asked for it.

    Returns
    -------
    focal_length : float
        In pixels.
    tags : str
        Their names.
    """
    if as_path(path).suffix.lower() in VIDEOS:
        raise CameraError(f"{path} is a video, which does not tell the focal length. {_TELL}")
    size, tags = _read_exif(path, shape)
    taken = _size_when_taken(path, size, tags)
    film, length = _positive(tags, "FocalLengthIn35mmFilm"), _positive(tags, "FocalLength")
    resolution = _positive(tags, "FocalPlaneXResolution")
    unit = _RESOLUTION_UNITS.get(int(exif_number(tags.get("FocalPlaneResolutionUnit", 2)) or 0))
    by_sensor = None
    if length and resolution and unit and taken:
        by_sensor = length * resolution / unit * max(size) / max(taken)
    if film:
        by_film = film * math.hypot(*size) / _FILM_DIAGONAL
        _require_view(path, f"FocalLengthIn35mmFilm = {film:g}", by_film, size)
        if by_sensor and abs(math.log(by_sensor / by_film)) > math.log(_AGREEMENT):
            warn(
                f"The EXIF data of {path} disagree: by FocalLengthIn35mmFilm the focal length is {by_film:.5g} pixels, "
                f"by FocalLength and FocalPlaneXResolution {by_sensor:.5g}. The first is taken. If the photo was "
                f"resized or cropped, give {keyword('focal_length')}, in pixels.",
            )
        return by_film, "FocalLengthIn35mmFilm"
    if not tags:
        raise CameraError(f"{path} has no EXIF data: the focal length in pixels is unknown. {_TELL}")
    if not (length and resolution and unit):
        missing = "FocalLengthIn35mmFilm"
        if not length:
            missing += " and FocalLength"
        elif not resolution:
            missing += " and FocalPlaneXResolution (the size of the sensor)"
        else:
            missing += " and a usable FocalPlaneResolutionUnit"
        tell = _TELL
        if length:
            tell = (
                f"{_TELL.removesuffix('.')}: {length:g} mm, over the width of the sensor in mm, times the width of the "
                "photo in pixels."
            )
        raise CameraError(f"The EXIF data of {path} lack {missing}: the focal length in pixels is unknown. {tell}")
    if not (taken and by_sensor):
        raise CameraError(
            f"The EXIF data of {path} lack FocalLengthIn35mmFilm and a usable ExifImageWidth and ExifImageHeight: "
            "whether the photo was resized since FocalPlaneXResolution was written is unknown, and so is the focal "
            f"length in pixels. {_TELL}"
        )
    sensor = max(taken) / resolution * unit
    what = f"FocalPlaneXResolution with ExifImageWidth and ExifImageHeight, {taken[0]:g} × {taken[1]:g},"
    if not _SENSORS[0] <= sensor <= _SENSORS[1]:
        raise CameraError(
            f"By {what} the sensor of {path} is {sensor:.3g} mm wide behind a lens of {length:g} mm, and none is under "
            f"{_SENSORS[0]:g} or over {_SENSORS[1]:g} mm: the photo was resized since, or the EXIF data are wrong. "
            f"{_TELL}"
        )
    view = _require_view(path, "FocalLength and FocalPlaneXResolution", by_sensor, size)
    doubt = _editor(tags)
    if not doubt and size[0] * size[1] < _SMALL and sorted(taken) == sorted(size):
        doubt = f"the photo is as small as its EXIF data say, {size[0]} × {size[1]} pixels"
    if doubt:
        warn(
            f"By {what} the sensor of {path} is {sensor:.2g} mm wide behind a lens of {length:g} mm, a view of "
            f"{view:.1f}° along the longer side; but {doubt}, so that an editor may have resized it without mending "
            f"FocalPlaneXResolution. Check these numbers, or give {keyword('focal_length')}, in pixels.",
        )
    return by_sensor, "FocalLength and FocalPlaneXResolution"


def _size_when_taken(path: FilePath, size: tuple[int, int], tags: Mapping[str, Any]) -> tuple[float, float] | None:
    """The size that the EXIF data give the photo, or None; one of another shape than the file's is refused."""
    width, height = _positive(tags, "ExifImageWidth"), _positive(tags, "ExifImageLength")
    if not (width and height):
        return None
    # Long and short side, because a photo may have been turned upright since.
    resized, resized_short = max(size) / max(width, height), min(size) / min(width, height)
    rounding = 1 / min(size)
    if abs(resized / resized_short - 1) > 0.01 + rounding:
        raise CameraError(
            f"{path} has {size[0]}×{size[1]} pixels but was taken with {width:g}×{height:g}: it was "
            f"cropped since, and its EXIF data no longer hold. {_TELL}"
        )
    return width, height


def _require_view(path: FilePath, tags: str, focal_length: float, size: tuple[int, int]) -> float:
    """The angle of view along the longer side, in degrees; refused where no lens that draws straight lines has it."""
    view = 2 * math.degrees(math.atan(max(size) / 2 / focal_length))
    if not _VIEWS[0] <= view <= _VIEWS[1]:
        raise CameraError(
            f"By {tags} {path} has a view of {view:.3g}° along its longer side, and none is under {_VIEWS[0]:g}° or "
            f"over {_VIEWS[1]:g}°: the EXIF data are wrong. {_TELL}"
        )
    return view


def _editor(tags: Mapping[str, Any]) -> str:
    """What says that an editor saved the photo; nothing where nothing does."""
    for name in ("Software", "ProcessingSoftware"):
        value = tags.get(name)
        text = value.decode("latin-1") if isinstance(value, bytes) else str(value or "")
        if _EDITORS.search(text):
            return f"{name} says {' '.join(text.split())[:60]!r}"
    return ""


def _read_exif(path: FilePath, shape: tuple[int, int] | None) -> tuple[tuple[int, int], Mapping[str, Any]]:
    """Size in pixels, one side and the other, and the EXIF tags by name."""
    with asked(as_path(path), "cannot be read as a photo") as (form, source):
        if source.head.startswith(BIG_SIGNATURES):
            # exifread follows 32-bit offsets only.
            raise CameraError(f"{path} is a BigTIFF file, whose EXIF data are not read. {_TELL}")
        size = form.size(source) if shape is None else (shape[1], shape[0])
        file = form.exif(source)
        if file is None:
            return size, {}
        import exifread

        # exifread follows what is in them wherever it leads, and makes a number of every value: walked first.
        read_directories(path, source.data if file is source.stream else file.read())
        found = exifread.process_file(file, details=False, extract_thumbnail=False)
        # Those of the photo itself, and then of how it was taken.
        return size, {
            _NAMES.get(tag.tag, key.removeprefix(kind)): tag.values
            for kind in ("Image ", "EXIF ")
            for key, tag in found.items()
            if key.startswith(kind)
        }


def _positive(tags: Mapping[str, Any], name: str) -> float | None:
    """The tag as a number above 0; None when it is absent, or 0 or 0/0, which EXIF writes for unknown."""
    value = exif_number(tags.get(name))
    return value if value is not None and value > 0 else None
