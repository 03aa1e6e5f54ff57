"""What is to be done with every photo of a batch, and what tells whether it has been done."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from persfs_cl.errors import InputError
from persfs_cl.io.files import opened
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.cameras import CameraTable
from persfs_cl.pipeline.guides import GuideFile
from persfs_cl.pipeline.job import Job
from persfs_cl.pipeline.listing import Input, guide_for, mask_for
from persfs_cl.pipeline.manifest import Known, Stamps
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.complete import complete
from persfs_cl.solver.options import Options
from persfs_cl.surface.saving import Saving
from persfs_cl.wording import Spelling

DEFAULT_ITEMS = "depth,normals,preview,report"
"""What a batch writes of each photo."""

_NOT_OF_THE_RESULT = ("device", "callback", "throw")
_BLOCK = 2**20


@dataclass(frozen=True)
class Plan:
    """What is to be done with every photo.

    Attributes
    ----------
    camera : CameraChoice
        Of photos that `cameras` does not tell of.
    cameras : CameraTable or None
        One entry a photo.
    masks : Path or None
        A folder with a mask for each photo.
    mask, walls, known_depth, albedo : Path or None
        Files for all photos, which must have their size. A mask may be "auto", and an albedo "fit".
    mask_erode : int
        Pixels along the outline of masks that are left out.
    near, far : float, Path or None
        Bounds of the depth for all photos, as numbers or such files.
    guides : Path or None
        A folder with a guide for each photo, or None.
    guide : GuideFile or None
        One for all photos.
    guide_unit : float
        Of those in the folder.
    size, brightness, light, reflectance, keywords
        As for :class:`persfs_cl.pipeline.job.Job`.
    saving : Saving
    spelling : callable
        How records, reports and pages spell the keywords that warnings and errors mention: as whoever reads them has
        given them, see :mod:`persfs_cl.wording`.
    """

    camera: CameraChoice = field(default_factory=CameraChoice)
    cameras: CameraTable | None = None
    masks: Path | None = None
    mask: Path | Literal["auto"] | None = None
    mask_erode: int = 0
    walls: Path | None = None
    known_depth: Path | None = None
    albedo: Path | Literal["fit"] | None = None
    near: float | Path | None = None
    far: float | Path | None = None
    guides: Path | None = None
    guide: GuideFile | None = None
    guide_unit: float = 1.0
    size: int | None = None
    brightness: Brightness = field(default_factory=Brightness)
    light: Light = ParallelLight()
    reflectance: Reflectance = Lambertian()
    keywords: Options = field(default_factory=Options)
    saving: Saving = field(default_factory=lambda: Saving.of(DEFAULT_ITEMS))
    spelling: Spelling = str

    def job(self, one: Input, roots: Sequence[Path] = ()) -> Job:
        """What is to be done with one photo.

        Parameters
        ----------
        one : Input
        roots : sequence of Path
            Folders that the entries of the table of cameras may be relative to.

        Raises
        ------
        PersfsError
            When the table has no entry for it, or it has no mask, or no guide.
        """
        return Job(
            one.path,
            self.camera if self.cameras is None else self.cameras.choice(one, roots),
            self.brightness,
            mask=self.mask if self.masks is None else mask_for(one, self.masks),
            mask_erode=self.mask_erode,
            walls=self.walls,
            known_depth=self.known_depth,
            albedo=self.albedo,
            near=self.near,
            far=self.far,
            guide=self.guide if self.guides is None else GuideFile(guide_for(one, self.guides), self.guide_unit),
            light=self.light,
            reflectance=self.reflectance,
            keywords=self.keywords,
            frame=one.frame,
            size=self.size,
        )

    def require_files(self) -> None:
        """Look at what all photos have in common once, rather than find it missing for each of them.

        Raises
        ------
        InputError
            When a file for all photos cannot be opened, or `masks` or `guides` is no folder.
        """
        for name in ("masks", "guides"):
            folder = getattr(self, name)
            if folder is not None and not folder.is_dir():
                raise InputError(f"{folder} is no folder: name the one that the {name} are in.")
        if self.guide is not None:
            self.guide.check()
        of_depth = (self.known_depth, self.near, self.far)
        for file in (self.mask, self.walls, *of_depth, self.albedo, *vars(self.brightness).values()):
            if isinstance(file, Path):
                with opened(file):
                    pass

    def parameters(self) -> dict[str, Any]:
        """All of it, as plain values for people to read."""
        return {
            "camera": _plain(vars(self.camera)),
            "cameras": None if self.cameras is None else str(self.cameras.path),
            **{
                name: _plain(getattr(self, name))
                for name in ("masks", "mask", "mask_erode", "walls", "known_depth", "albedo", "near", "far", "guides")
            },
            "guide": None if self.guide is None else str(self.guide.path),
            "guide_unit": self.guide_unit if self.guide is None else self.guide.unit,
            "size": self.size,
            "brightness": _plain(vars(self.brightness)),
            "light": _plain(self.light),
            "reflectance": _plain(self.reflectance),
            **{name: value for name, value in self._completed().items() if name not in ("light", "reflectance")},
            "files": list(self.saving.files),
            **self.saving.said,
        }

    def parameter_hash(self, job: Job) -> str:
        """What changes whenever another result is to be expected of the same files."""
        says = {
            "camera": _plain(_same_of_pixels(job.camera.said)),
            # Of files counts what is in them, by the input hash, and not where they are.
            "brightness": {
                name: "file" if isinstance(value, Path) else value for name, value in vars(job.brightness).items()
            },
            "bounds": ["file" if isinstance(bound, Path) else bound for bound in (job.near, job.far)],
            "albedo": job.albedo if isinstance(job.albedo, str) else None,
            "mask": [job.mask if isinstance(job.mask, str) else None, job.mask_erode],
            "guide_unit": None if job.guide is None else job.guide.unit,
            "light": _plain(job.light),
            "reflectance": _plain(job.reflectance),
            "keywords": self._completed(),
            "frame": job.frame,
            "size": job.size,
            "files": self.saving.files,
            **self.saving.said,
        }
        return _digest(json.dumps(says, sort_keys=True, default=_plain).encode())

    def _completed(self) -> dict[str, Any]:
        options = complete({**self.keywords, "light": self.light, "reflectance": self.reflectance})
        return {name: _plain(value) for name, value in options.items() if name not in _NOT_OF_THE_RESULT}


def sources(job: Job) -> dict[str, Path]:
    """All files that a photo is solved from, by what they are."""
    named = {**job.files, **vars(job.brightness)}
    if job.guide is not None:
        named |= {f"guide, {file.name}": file for file in job.guide.beside}
    return {name: file for name, file in named.items() if isinstance(file, Path)}


def stamps(job: Job) -> Stamps:
    """Size and time of each file.

    Raises
    ------
    OSError
        When one cannot be looked at.
    """
    found = {}
    for name, file in sources(job).items():
        status = file.stat()
        found[name] = (status.st_size, status.st_mtime_ns)
    return found


def input_hash(job: Job, stamped: Stamps) -> str:
    """Of the bytes of all files.

    Parameters
    ----------
    job : Job
    stamped : mapping
        Of :func:`stamps`: files that many photos have in common are read once for as long as it stays.

    Raises
    ------
    OSError
        When one cannot be read.
    """
    digests = {name: _file_digest(file, stamped[name]) for name, file in sources(job).items()}
    return _digest(json.dumps(digests, sort_keys=True).encode())


def is_the_same(job: Job, parameter_hash: str, before: Known) -> bool:
    """Whether a result would come out as it is.

    Parameters
    ----------
    job : Job
    parameter_hash : str
        Of the job.
    before : Known
        Of the result.
    """
    if parameter_hash != before.parameter_hash:
        return False
    try:
        stamped = stamps(job)
        return stamped == before.stamps or input_hash(job, stamped) == before.input_hash
    except OSError:  # whoever reads it will say so
        return False


@lru_cache(maxsize=64)
def _file_digest(file: Path, _stamp: tuple[int, int]) -> str:
    found = hashlib.blake2b(digest_size=16)
    with file.open("rb") as handle:
        while block := handle.read(_BLOCK):
            found.update(block)
    return found.hexdigest()


def _same_of_pixels(said: Mapping[str, Any]) -> dict[str, Any]:
    """What is said of a camera, in the same words whether its pixels are said to be square or come out so."""
    length = said["focal_length"]
    square = length is not None and not isinstance(length, (tuple, list))
    return {**said, "focal_length": (float(length), float(length)) if square else length}


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return {"kind": type(value).__name__, **{one.name: _plain(getattr(value, one.name)) for one in fields(value)}}
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)
