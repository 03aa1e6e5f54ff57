"""Shape from one shaded photograph, on any OpenCL device.

    import persfs_cl as ps

    solution = ps.reconstruct(image, ps.Camera(focal_length=590.0))

See :func:`reconstruct` for the main entry, :func:`read_image` for photographs, :func:`devices` for OpenCL.
"""

from importlib.metadata import version as _version

from persfs_cl._cl.device import Device, devices
from persfs_cl.camera import Camera
from persfs_cl.errors import (
    CameraError,
    ConvergenceError,
    DeviceError,
    InputError,
    KernelBuildError,
    PersfsError,
)
from persfs_cl.forward import render
from persfs_cl.grey import normalise_grey
from persfs_cl.images import read_image, read_photo
from persfs_cl.light import FlashLight, ParallelLight
from persfs_cl.metrics import Errors, compare
from persfs_cl.photograph import Preparation, PreparedPhoto, prepare_photo
from persfs_cl.reflectance import Lambertian, OrenNayar, Phong
from persfs_cl.scanned import mesh_scene
from persfs_cl.scenes import Scene, bump, bumps, hillside, sphere_cap, vase
from persfs_cl.solution import Elapsed, Solution, Status
from persfs_cl.solver import reconstruct, reconstruct_batch

__version__ = _version("persfs-cl")

__all__ = [
    "Camera",
    "CameraError",
    "ConvergenceError",
    "Device",
    "DeviceError",
    "Elapsed",
    "Errors",
    "FlashLight",
    "InputError",
    "KernelBuildError",
    "Lambertian",
    "OrenNayar",
    "ParallelLight",
    "PersfsError",
    "Phong",
    "Preparation",
    "PreparedPhoto",
    "Scene",
    "Solution",
    "Status",
    "bump",
    "bumps",
    "compare",
    "devices",
    "hillside",
    "mesh_scene",
    "normalise_grey",
    "prepare_photo",
    "read_image",
    "read_photo",
    "reconstruct",
    "reconstruct_batch",
    "render",
    "sphere_cap",
    "vase",
]
