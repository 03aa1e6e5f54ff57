"""Files: read whole and written whole, photographs, masks, depth maps and points."""

from persfs_cl.io.photos import (
    Photo,
    read_depth,
    read_image,
    read_light,
    read_mask,
    read_photo,
    to_display,
    write_depth,
    write_grey,
)
from persfs_cl.io.points import PointErrors, at_points, compare_points, read_points

__all__ = [
    "Photo",
    "PointErrors",
    "at_points",
    "compare_points",
    "read_depth",
    "read_image",
    "read_light",
    "read_mask",
    "read_photo",
    "read_points",
    "to_display",
    "write_depth",
    "write_grey",
]
