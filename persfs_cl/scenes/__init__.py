"""Surfaces whose depth is known exactly."""

from persfs_cl.scenes.analytic import Scene, bump, bumps, hillside, sphere_cap, vase
from persfs_cl.scenes.meshes import MeshView, mesh_scene, mesh_view, stanford_bunny

__all__ = [
    "MeshView",
    "Scene",
    "bump",
    "bumps",
    "hillside",
    "mesh_scene",
    "mesh_view",
    "sphere_cap",
    "stanford_bunny",
    "vase",
]
