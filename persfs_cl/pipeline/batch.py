"""Any number of photographs to surfaces, as one function of the library."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal, cast, get_args

from persfs_cl._cl.device import Device
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_whole_number, check_choice
from persfs_cl.errors import InputError
from persfs_cl.io.files import FilePath, as_path
from persfs_cl.pipeline.bounds import checked_bounds
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.cameras import read_cameras
from persfs_cl.pipeline.frames import LEAST_SIZE
from persfs_cl.pipeline.guides import GuideFile, require_guided
from persfs_cl.pipeline.listing import Listing, list_inputs
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.pages import publish, title_of
from persfs_cl.pipeline.plan import DEFAULT_ITEMS, Plan
from persfs_cl.pipeline.remote_store import store_for
from persfs_cl.pipeline.run import Again, Batch, BatchResult
from persfs_cl.pipeline.shards import Shard, as_shard
from persfs_cl.pipeline.store import FolderStore, Store
from persfs_cl.pipeline.workforce import workforce
from persfs_cl.solver.complete import complete
from persfs_cl.solver.options import DESCRIBED, Options
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, Saving
from persfs_cl.surface.solid import Block
from persfs_cl.wording import nearest

_OF_CAMERAS = ("focal_length", "fov", "principal_point", "distortion")
"""What messages say of cameras, which is told by a Camera here."""


def batch(
    inputs: FilePath | Iterable[FilePath],
    output: FilePath | None = None,
    *,
    camera: Camera | None = None,
    cameras: FilePath | None = None,
    masks: FilePath | None = None,
    mask: FilePath | None = None,
    mask_erode: int = 0,
    walls: FilePath | None = None,
    known_depth: FilePath | None = None,
    albedo: FilePath | None = None,
    near: float | FilePath | None = None,
    far: float | FilePath | None = None,
    guides: FilePath | None = None,
    guide: FilePath | None = None,
    guide_unit: float = 1.0,
    frames: str | None = None,
    size: int | None = None,
    save: str | Iterable[str] = DEFAULT_ITEMS,
    mesh_faces: int | None = DEFAULT_MESH_FACES,
    width: float = Block.width,
    base: float = Block.base,
    again: Again = "changed",
    shard: Shard | None = None,
    max_memory: int | None = None,
    device: int | str | Device | Sequence[int | str | Device] | None = None,
    scheduler: str | None = None,
    **keywords: Any,
) -> Iterator[BatchResult]:
    """Reconstruct any number of photographs, in processes of their own: one for each GPU, or for each core.

    Where there is an output, `index.html` and the rest of what the command shows is written when the last result has
    been taken.

    Parameters
    ----------
    inputs : path or iterable of path
        Image files, folders, patterns, lists and videos, see
        :func:`persfs_cl.pipeline.listing.list_inputs`.
    output : path or str, optional
        Folder, or URL of any protocol of fsspec, for the results: a folder for each photograph, and the manifest.
        Running again does what is missing, failed, or made from other files or with other parameters. Without it,
        results carry the solutions, and nothing is written.
    camera : Camera, optional
        Of all photographs; the EXIF data of each tell when it is not given.
    cameras : path, optional
        A table of cameras instead, see :func:`persfs_cl.pipeline.cameras.read_cameras`.
    masks : path, optional
        Folder with a mask for each photograph: that of ``a/b.jpg`` is ``a/b.jpg.png``, black where nothing is solved.
    mask, walls, known_depth, albedo : path, optional
        Files for all photographs, of their size. A mask may be "auto": the object is what stands out from a dark
        background. An albedo may be "fit", as for :func:`reconstruct`.
    mask_erode : int
        Pixels along the outline of masks that are left out.
    near, far : float or path, optional
        Depths between which all surfaces lie, see `depth_range` of :func:`reconstruct`: numbers, or such files.
    guides : path, optional
        Folder with a guide for each photograph: that of ``a/b.jpg`` is ``a/b.jpg.npy``, or has another suffix of
        :class:`persfs_cl.pipeline.guides.GuideFile`.
    guide : path, optional
        One for all photographs, such as COLMAP's ``points3D.txt``.
    guide_unit : float
        What the numbers of guides are multiplied by.
    frames : str, optional
        Which frames of videos, "START:STOP:STEP". An error where there are photographs and no video.
    size : int, optional
        Pixels that the longer side is reduced to, by means over areas, with all that goes with a photograph.
    save, mesh_faces, width, base
        What is written, as for :meth:`persfs_cl.surface.saving.Saving.of`.
    again : {"changed", "all", "none", "failed"}
        Which photographs are done again: those that failed or whose files or parameters have changed; all; none that
        has results; or only those that failed, and no new ones.
    shard : (int, int), optional
        ``(2, 8)`` does the second of eight shares, which may run at once, on machines that share the folder.
    max_memory : int, optional
        Bytes that the photographs in work may take; half of the memory when not given.
    device : optional
        As for :func:`reconstruct`, or several in a list, or "all".
    scheduler : str, optional
        The address of a scheduler of Dask, or the path of its file: its workers do the photographs, each that has the
        resource "device". Then `device` and `max_memory` are for each of them, and an output is needed.
    **keywords
        Those of :func:`reconstruct`, and those by which a photograph becomes an image: ``channel``, ``encoding``,
        ``page``, ``half_size``, ``ambient``, ``vignetting``, ``tone_exponent``, ``despeckle``, ``highlights``,
        ``saturation``, ``clip_highlights``, ``denoise``, ``mean_filter``, ``normalise``, ``white_percentile``,
        ``white_level``.

    Yields
    ------
    BatchResult
        Of each photograph that was not done before, as they end, in no order.

    Raises
    ------
    InputError
        When an option cannot be used, nothing is given, another run is at work on the output, or the scheduler does
        not answer. A photograph that cannot be used is a result with an error.
    DeviceError
        When no device can be used.
    UnavailableError
        When a scheduler is given, and Dask is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import imageio.v3
    >>> import persfs_cl as ps
    >>> scene = ps.bump((20, 20), light=ps.FlashLight())
    >>> with TemporaryDirectory() as folder:
    ...     for name in ("one.png", "two.png"):
    ...         imageio.v3.imwrite(Path(folder) / name, (255 * scene.image / scene.image.max()).astype("uint8"))
    ...     results = list(ps.batch(folder, camera=scene.camera, light=ps.FlashLight()))
    >>> sorted((result.name, result.solution.status.name) for result in results)
    [('one.png', 'CONVERGED'), ('two.png', 'CONVERGED')]
    """
    options = cast("Options", {name: keywords.pop(name) for name in list(keywords) if name in DESCRIBED})
    own = {one.name for one in fields(Brightness)}
    brightness = Brightness(**{name: keywords.pop(name) for name in list(keywords) if name in own})
    if keywords:
        unknown = next(iter(keywords))
        if unknown in _OF_CAMERAS:
            raise TypeError(
                f"There is no keyword argument {unknown!r}: give camera=Camera(...), or one by "
                "Camera.from_fov(degrees, shape)."
            )
        near = nearest(unknown, [*inspect.signature(batch).parameters, *DESCRIBED, *own])
        raise TypeError(f"There is no keyword argument {unknown!r}{'.' if near is None else f': did you mean {near}?'}")
    check_choice("again", again, get_args(Again))
    for name in ("callback", "throw"):
        if options.get(name):
            raise InputError.about(name, options[name], "is for one photograph: results say how each iteration ended.")
    for name, one, all_of_them in (("camera", camera, cameras), ("mask", mask, masks), ("guide", guide, guides)):
        if one is not None and all_of_them is not None:
            raise InputError.about(f"{name}s", all_of_them, f"and {name} say the same in two ways: give one of them.")
    if camera is not None:
        require_camera(camera)
    settings = complete(options)
    paint: Path | Literal["fit"] | None = "fit" if albedo == "fit" else _path(albedo)
    require_guided(settings, paint, guide_unit, guided=guide is not None or guides is not None)
    near, far = checked_bounds(_bound(near), _bound(far))
    plan = Plan(
        camera=CameraChoice() if camera is None else CameraChoice.like(camera),
        cameras=None if cameras is None else read_cameras(cameras),
        masks=_path(masks),
        guides=_path(guides),
        walls=_path(walls),
        known_depth=_path(known_depth),
        mask="auto" if mask == "auto" else _path(mask),
        mask_erode=as_whole_number("mask_erode", mask_erode, least=0),
        albedo=paint,
        near=near,
        far=far,
        guide=None if guide is None else GuideFile(as_path(guide), guide_unit),
        guide_unit=guide_unit,
        size=None if size is None else as_whole_number("size", size, least=LEAST_SIZE),
        brightness=brightness,
        light=settings["light"],
        reflectance=settings["reflectance"],
        keywords=options,
        saving=Saving.of(save, mesh_faces, width=width, base=base),
    )
    plan.require_files()
    store = None if output is None else store_for(output)
    root = store.root if isinstance(store, FolderStore) else None
    given = [inputs] if isinstance(inputs, (str, os.PathLike)) else list(inputs)
    listing = list_inputs(given, output=root, masks=plan.masks, frames=frames)
    if not listing.inputs and not listing.problems:
        raise InputError.about("inputs", inputs, "holds no path: give photographs, folders, patterns or lists.")
    whole = Batch(listing, plan, store, again=again, shard=as_shard(shard))
    results = whole.results(workforce(plan, store, device, max_memory, scheduler))
    return _shown(results, plan, store, listing, title_of([str(one) for one in given]))


def _path(given: FilePath | None) -> Path | None:
    return None if given is None else as_path(given)


def _bound(given: float | FilePath | None) -> float | Path | None:
    """A bound of the depth as a plan has it, if it is one."""
    return as_path(given) if isinstance(given, (str, os.PathLike)) else given


def _shown(
    results: Iterator[BatchResult], plan: Plan, store: Store | None, listing: Listing, title: str
) -> Iterator[BatchResult]:
    """The results, and then, where they are written, the page of all."""
    yield from results
    if store is not None:
        publish(store, listing.inputs, title=title, parameters=plan.parameters())
