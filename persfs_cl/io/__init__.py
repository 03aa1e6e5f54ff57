"""Files: read whole and written whole, photographs, masks, depth maps and points."""

from persfs_cl.io.export import write_depth, write_grey
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.io.photos import Photo, read_image, read_photo
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
    "write_depth",
    "write_grey",
]
