"""Lenses that bend straight lines.

Places are normalised: (column - cx) / fx and (row - cy) / fy, in a pinhole camera and as the lens draws them.
"""
