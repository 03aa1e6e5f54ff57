"""Shape from one shaded photograph, on any OpenCL device.

    import persfs_cl as ps

    solution = ps.reconstruct(image, ps.Camera(focal_length=590.0))

See :func:`reconstruct` for the main entry, :func:`read_image` for photographs, :func:`devices` for OpenCL.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from persfs_cl._cl.device import Device, devices
    from persfs_cl.calibration.calibrate import calibrate
    from persfs_cl.calibration.result import Calibration, CalibrationErrors
    from persfs_cl.camera import Camera
    from persfs_cl.errors import (
        CameraError,
        ConvergenceError,
        DeviceError,
        InputError,
        KernelBuildError,
        PersfsError,
    )
    from persfs_cl.framing.maps import undistort
    from persfs_cl.guide.fit import GuideFit
    from persfs_cl.guide.guide import Points
    from persfs_cl.io.maps import read_depth, read_light, read_mask
    from persfs_cl.io.photos import read_image, read_photo
    from persfs_cl.lens.field_of_view import FieldOfView
    from persfs_cl.lens.fisheye import Fisheye
    from persfs_cl.lens.rad_tan_fisheye import RadTanFisheye
    from persfs_cl.metrics import Errors, compare
    from persfs_cl.pipeline.batch import batch
    from persfs_cl.pipeline.run import BatchResult
    from persfs_cl.preparation.normalise import clip_highlights, mean_filter, normalise_grey, normalise_linear
    from persfs_cl.preparation.prepare import Preparation, prepare_photo
    from persfs_cl.preparation.prepared import PreparedPhoto
    from persfs_cl.scenes.analytic import hillside, sphere_cap, vase
    from persfs_cl.scenes.framed import bump, bumps
    from persfs_cl.scenes.meshes import mesh_scene
    from persfs_cl.scenes.scene import Scene
    from persfs_cl.shading.flash_light import FlashLight
    from persfs_cl.shading.lambertian import Lambertian
    from persfs_cl.shading.oren_nayar import OrenNayar
    from persfs_cl.shading.parallel_light import ParallelLight
    from persfs_cl.shading.phong import Phong
    from persfs_cl.solver.reconstruct import reconstruct, reconstruct_batch
    from persfs_cl.surface.loading import load
    from persfs_cl.surface.outcome import Elapsed, Status
    from persfs_cl.surface.render import render
    from persfs_cl.surface.solution import Solution

    __version__: str
else:
    # Imported when first asked for. The command imports this module before it can answer Ctrl-C, and NumPy and pyopencl
    # take half a second; a program that reads photographs needs no OpenCL.
    _HOMES = {
        "_cl.device": ("Device", "devices"),
        "calibration.calibrate": ("calibrate",),
        "calibration.result": ("Calibration", "CalibrationErrors"),
        "camera": ("Camera",),
        "errors": (
            "CameraError",
            "ConvergenceError",
            "DeviceError",
            "InputError",
            "KernelBuildError",
            "PersfsError",
        ),
        "surface.render": ("render",),
        "preparation.normalise": ("clip_highlights", "mean_filter", "normalise_grey", "normalise_linear"),
        "io.maps": ("read_depth", "read_light", "read_mask"),
        "io.photos": ("read_image", "read_photo"),
        "framing.maps": ("undistort",),
        "guide.fit": ("GuideFit",),
        "guide.guide": ("Points",),
        "shading.flash_light": ("FlashLight",),
        "shading.parallel_light": ("ParallelLight",),
        "lens.field_of_view": ("FieldOfView",),
        "lens.fisheye": ("Fisheye",),
        "lens.rad_tan_fisheye": ("RadTanFisheye",),
        "metrics": ("Errors", "compare"),
        "pipeline.batch": ("batch",),
        "pipeline.run": ("BatchResult",),
        "preparation.prepare": ("Preparation", "prepare_photo"),
        "preparation.prepared": ("PreparedPhoto",),
        "shading.lambertian": ("Lambertian",),
        "shading.oren_nayar": ("OrenNayar",),
        "shading.phong": ("Phong",),
        "scenes.analytic": ("hillside", "sphere_cap", "vase"),
        "scenes.framed": ("bump", "bumps"),
        "scenes.meshes": ("mesh_scene",),
        "scenes.scene": ("Scene",),
        "surface.loading": ("load",),
        "surface.outcome": ("Elapsed", "Status"),
        "surface.solution": ("Solution",),
        "solver.reconstruct": ("reconstruct", "reconstruct_batch"),
    }

    def __getattr__(name):
        from importlib import import_module  # noqa: PLC0415  # this too takes its time
        from importlib.util import find_spec  # noqa: PLC0415

        if name == "__version__":
            value = import_module("importlib.metadata").version("persfs-cl")
        elif home := next((home for home, names in _HOMES.items() if name in names), None):
            value = getattr(import_module(f"{__name__}.{home}"), name)
        elif not name.startswith("__") and find_spec(f"{__name__}.{name}"):
            value = import_module(f"{__name__}.{name}")
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value

    def __dir__():
        return sorted({*globals(), *__all__, "__version__"})


__all__ = [
    "BatchResult",
    "Calibration",
    "CalibrationErrors",
    "Camera",
    "CameraError",
    "ConvergenceError",
    "Device",
    "DeviceError",
    "Elapsed",
    "Errors",
    "FieldOfView",
    "Fisheye",
    "FlashLight",
    "GuideFit",
    "InputError",
    "KernelBuildError",
    "Lambertian",
    "OrenNayar",
    "ParallelLight",
    "PersfsError",
    "Phong",
    "Points",
    "Preparation",
    "PreparedPhoto",
    "RadTanFisheye",
    "Scene",
    "Solution",
    "Status",
    "batch",
    "bump",
    "bumps",
    "calibrate",
    "clip_highlights",
    "compare",
    "devices",
    "hillside",
    "load",
    "mean_filter",
    "mesh_scene",
    "normalise_grey",
    "normalise_linear",
    "prepare_photo",
    "read_depth",
    "read_image",
    "read_light",
    "read_mask",
    "read_photo",
    "reconstruct",
    "reconstruct_batch",
    "render",
    "sphere_cap",
    "undistort",
    "vase",
]
