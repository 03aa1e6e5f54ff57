"""Surfaces whose depth is known exactly."""

from persfs_cl.scenes.analytic import hillside, sphere_cap, vase
from persfs_cl.scenes.framed import bump, bumps
from persfs_cl.scenes.meshes import mesh_scene, stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.scenes.view import MeshView, mesh_view

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
