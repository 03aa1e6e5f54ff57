"""Pictures for people: depth, normals, relief, comparison, confidence, convergence and guide, each one PNG file.

Every picture is drawn on a figure of its own with the Agg canvas and Matplotlib's own defaults: no display, no pyplot,
no setting of the user's. Maps of more than 2000 pixels a side are drawn from 1000 to 2000 means of blocks of pixels,
more than the figure has dots; scales and numbers are those of all pixels. The normal map alone has a pixel for each of
the photograph.
"""

from persfs_cl.surface.plots.canvas import UNIT, matplotlib_defaults
from persfs_cl.surface.plots.curves import convergence_picture
from persfs_cl.surface.plots.guides import guide_picture
from persfs_cl.surface.plots.maps import (
    comparison_picture,
    confidence_picture,
    depth_picture,
    normals_picture,
    normals_rgb,
)
from persfs_cl.surface.plots.relief import relief_picture

__all__ = [
    "UNIT",
    "comparison_picture",
    "confidence_picture",
    "convergence_picture",
    "depth_picture",
    "guide_picture",
    "matplotlib_defaults",
    "normals_picture",
    "normals_rgb",
    "relief_picture",
]
