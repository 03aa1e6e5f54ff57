"""The depths that a surface may have."""

from __future__ import annotations

NEAREST, FARTHEST = 1e-30, 1e30
"""Depths from here to there can be squared, and written in single precision, in any unit that somebody may choose."""
