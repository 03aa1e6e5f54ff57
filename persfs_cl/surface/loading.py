"""A solution from the folder that it was saved to."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from persfs_cl._cl.device import Device, devices
from persfs_cl._cl.selection import select_device
from persfs_cl.arrays import Array, Mask
from persfs_cl.camera import Camera
from persfs_cl.checks import finite_numbers
from persfs_cl.errors import CameraError, InputError
from persfs_cl.guide.fit import GuideFit
from persfs_cl.io.files import FilePath, as_path, read_bytes
from persfs_cl.io.npy import read_npy, read_npz
from persfs_cl.lens.distortion import distortion_of
from persfs_cl.shading.stated import light_from, reflectance_from
from persfs_cl.surface.formats.records import ARRAYS, MASKS, REPORT, fingerprint
from persfs_cl.surface.geometry import Discontinuities, depth_array
from persfs_cl.surface.outcome import Elapsed, Status, Taken
from persfs_cl.surface.solution import Solution

_DEPTH = "depth.npy"
_STATED_ELSEWHERE = ("camera", "focal_length", "principal_point", "taken_by", "light", "reflectance")
"""What a report has among the parameters, and a solution has not."""


def load(directory: FilePath, *, device: int | str | Device | None = None) -> Solution:
    """A solution as it was saved, by :meth:`Solution.save`, ``persfs-cl reconstruct``, :func:`batch` or its command.

    Depth, masks, changes, camera, light and all numbers are those of the solution, bit for bit. `log_depth` is ln of
    the depth; image, albedo and the guide's departure are in single precision.

    Parameters
    ----------
    directory : path
        With depth.npy, solution.npz and report.json, which ``save="solution"`` writes, and the default of all but a
        batch.
    device : None, "cpu", "gpu", int, str or Device
        On which the surface is rendered: as for :func:`reconstruct`. None takes that on which it was found, or the
        first where that is not there.

    Returns
    -------
    Solution

    Raises
    ------
    InputError
        When a file is missing, broken, or of another surface than the others; names it.
    DeviceError
        When there is no OpenCL device, or none as it is asked for.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> solution = ps.reconstruct(scene.image, scene.camera, light=scene.light)
    >>> with TemporaryDirectory() as folder:
    ...     saved = solution.save(folder, save="solution")
    ...     again = ps.load(folder)
    >>> bool((again.depth == solution.depth).all()), again.light == solution.light
    (True, True)
    """
    folder = as_path(directory)
    _require_files(folder)
    depth = read_npy(folder / _DEPTH)
    if depth.dtype != np.float64 or depth.ndim != 2 or not depth.size:
        raise InputError(
            f"{folder / _DEPTH} holds {depth.dtype} of shape {depth.shape}: it is no depth of a solution, (height, "
            "width) of float64."
        )
    arrays = _Arrays(folder / ARRAYS, read_npz(folder / ARRAYS), (depth.shape[0], depth.shape[1]))
    report = _Report.read(folder / REPORT)
    if arrays.number("fingerprint") != fingerprint(depth):
        raise _of_another(folder / ARRAYS, folder / _DEPTH)
    elapsed = report.elapsed
    if elapsed.total != arrays.number("seconds"):
        raise _of_another(folder / REPORT, folder / ARRAYS)
    return Solution(
        depth=depth,
        log_depth=np.log(_checked(folder / _DEPTH, depth)),
        solved=np.isfinite(depth),
        **{name: arrays.mask(name) for name in MASKS},
        image=arrays.map("image"),
        camera=report.camera,
        taken_by=report.taken_by,
        light=report.made("light", light_from),
        reflectance=report.made("reflectance", reflectance_from),
        device=report.device if device is None else select_device(device),
        albedo=arrays.map("albedo") if "albedo" in arrays else None,
        walls=arrays.mask("walls") if "walls" in arrays else None,
        discontinuities=arrays.discontinuities,
        iterations=report.count("iterations"),
        changes=arrays.changes,
        status=report.status,
        distance=arrays.number("distance"),
        elapsed=elapsed,
        parameters=report.options,
        guide=report.guide(arrays.map("departure")) if "departure" in arrays else None,
    )


def _require_files(folder: Path) -> None:
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: name the one that a solution was saved to.")
    for file in (_DEPTH, ARRAYS, REPORT):
        if not (folder / file).exists():
            raise InputError(
                f"{folder / file} does not exist: a solution is loaded from {_DEPTH}, {ARRAYS} and {REPORT}. Save it "
                "again with save='solution', on the command line --save solution."
            )


def _checked(path: Path, depth: Array) -> Array:
    try:
        return depth_array(depth)
    except InputError as error:
        raise error.at(str(path)) from error


def _of_another(file: Path, other: Path) -> InputError:
    return InputError(f"{file} is of another surface than {other.name} beside it: save the solution again.")


@dataclass(frozen=True)
class _Arrays:
    """What `solution.npz` holds.

    Attributes
    ----------
    path : Path
    held : mapping of str to ndarray
    shape : (int, int)
        (height, width) of the surface.
    """

    path: Path
    held: Mapping[str, NDArray[Any]]
    shape: tuple[int, int]

    def __contains__(self, name: str) -> bool:
        return name in self.held

    def _get(self, name: str, kinds: str, shape: tuple[int, ...] | None) -> NDArray[Any]:
        if name not in self.held:
            raise InputError(f"{self.path} has no {name}: save the solution again.")
        values = self.held[name]
        if values.dtype.kind not in kinds or (shape is not None and values.shape != shape):
            wanted = "" if shape is None else f", and not of shape {shape}"
            raise InputError(
                f"{self.path} has {values.dtype} of shape {values.shape} for {name}{wanted}: save the solution again."
            )
        return values

    def number(self, name: str) -> float:
        """A single number."""
        return float(self._get(name, "iuf", ()))

    @property
    def changes(self) -> Array:
        """The change of each iteration."""
        return np.atleast_1d(self._get("changes", "f", None).astype(np.float64, copy=False))

    def map(self, name: str) -> Array:
        """A number for each pixel."""
        return self._get(name, "f", self.shape).astype(np.float64, copy=False)

    def mask(self, name: str, shape: tuple[int, int] | None = None) -> Mask:
        """A bit for each pixel, or for each of another shape."""
        height, width = self.shape if shape is None else shape
        bits = self._get(name, "u", ((height * width + 7) // 8,))
        return np.unpackbits(bits, count=height * width).astype(bool).reshape(height, width)

    @property
    def discontinuities(self) -> Discontinuities | None:
        """Where the surface is interrupted, if it is known."""
        if "cut_right" not in self:
            return None
        height, width = self.shape
        return Discontinuities(self.mask("cut_right", (height, width - 1)), self.mask("cut_down", (height - 1, width)))


@dataclass(frozen=True)
class _Report:
    """What `report.json` says."""

    path: Path
    says: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path) -> _Report:
        try:
            says = json.loads(read_bytes(path))
        except (ValueError, RecursionError) as error:  # no JSON, or no UTF-8
            raise InputError(f"{path} is no JSON ({error}): save the solution again.") from error
        if not isinstance(says, dict):
            raise InputError(f"{path} is no report of a solution: save the solution again.")
        return cls(path, says)

    def _get(self, name: str, kind: type | tuple[type, ...], within: Mapping[str, Any] | None = None) -> Any:
        found = (self.says if within is None else within).get(name)
        if not isinstance(found, kind):
            raise InputError(f"{self.path} has no {name} as reports have it: save the solution again.")
        return found

    @property
    def _parameters(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = self._get("parameters", dict)
        return found

    @property
    def options(self) -> dict[str, Any]:
        """The parameters of a solution."""
        self._get("tolerance", (int, float), self._parameters)
        return {name: value for name, value in self._parameters.items() if name not in _STATED_ELSEWHERE}

    def count(self, name: str) -> int:
        """A whole number."""
        return int(self._get(name, int))

    @property
    def status(self) -> Status:
        name = self._get("status", str)
        if name not in Status.__members__:
            raise InputError(f"{self.path} has the status {name!r}: give one of {', '.join(Status.__members__)}.")
        return Status[name]

    @property
    def elapsed(self) -> Elapsed:
        seconds = self._get("seconds", dict)
        return Elapsed(**{field.name: float(self._get(field.name, (int, float), seconds)) for field in fields(Elapsed)})

    @property
    def camera(self) -> Camera:
        return self._camera(self._parameters)

    @property
    def taken_by(self) -> Taken | None:
        """The photograph, where the surface comes from one."""
        if self._parameters.get("taken_by") is None:
            return None
        said = self._get("taken_by", dict, self._parameters)
        sizes = finite_numbers(said.get("shape"))
        if sizes is None or len(sizes) != 2:
            raise InputError(f"{self.path} has no shape of the photograph: save the solution again.")
        return Taken(self._camera(said), (int(sizes[0]), int(sizes[1])), self._get("outlined", bool, said))

    def _camera(self, within: Mapping[str, Any]) -> Camera:
        given = self._get("camera", dict, within)
        try:
            said = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
            if (lens := given.get("distortion")) is not None:
                said["distortion"] = distortion_of(lens["model"], tuple(lens["coefficients"]))
            return Camera(**said)
        except (TypeError, KeyError, CameraError) as error:
            raise InputError(f"{self.path} has an impossible camera ({error}): save the solution again.") from error

    def made(self, name: str, make: Any) -> Any:
        """A light or a material."""
        try:
            return make(self._parameters.get(name))
        except InputError as error:
            raise error.at(str(self.path)) from error

    @property
    def device(self) -> Device:
        """That on which the surface was found, or else the first."""
        found = self._get("device", dict)
        names = ("name", "platform", "platform_version", "driver_version")
        same = (one for one in devices() if all(getattr(one, name) == found.get(name) for name in names))
        return next(same, None) or select_device()

    def guide(self, departure: Array) -> GuideFit:
        """What became of the guide."""
        found = self._get("guide", dict)
        names = [field.name for field in fields(GuideFit) if field.name != "departure"]
        if missing := [name for name in names if name not in found]:
            raise InputError(f"{self.path} says nothing of the guide's {missing[0]}: save the solution again.")
        for name in names:
            if found[name] is not None:
                self._get(name, (bool, int, float), found)
        # JSON has no NaN; of all numbers, the gain alone may be missing.
        numbers: dict[str, Any] = {
            name: math.nan if found[name] is None and name != "gain" else found[name] for name in names
        }
        return GuideFit(**numbers, departure=departure)
