"""Reflectances: how the material returns the light that falls on it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Lambertian:
    """A perfectly matt material: brightness is the cosine between normal and light, eq. (2)."""
