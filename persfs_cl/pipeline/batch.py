"""Any number of photos to surfaces: what is to be done, by whom, and what has become of it."""

from __future__ import annotations

import os
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, cast, get_args

from persfs_cl._cl.device import Device
from persfs_cl.camera import Camera, require_camera
from persfs_cl.checks import as_whole_number, check_choice
from persfs_cl.errors import InputError, PersfsError
from persfs_cl.io.files import FilePath, as_path
from persfs_cl.pipeline.bounds import checked_bounds
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.cameras import read_cameras
from persfs_cl.pipeline.claim import Shard, claimed
from persfs_cl.pipeline.frames import LEAST_SIZE
from persfs_cl.pipeline.guides import GuideFile, require_guided
from persfs_cl.pipeline.listing import Input, Listing, list_inputs
from persfs_cl.pipeline.manifest import Known, Record, latest, now, package_version
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.pages import publish, title_of
from persfs_cl.pipeline.plan import DEFAULT_ITEMS, Plan, is_the_same
from persfs_cl.pipeline.station import Task
from persfs_cl.pipeline.store import FolderStore, Journal, Results, Store, store_for
from persfs_cl.pipeline.workforce import Workforce, workforce
from persfs_cl.solver.options import Options, complete, described
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, Saving
from persfs_cl.surface.solid import Block
from persfs_cl.surface.solution import Solution

Again = Literal["changed", "all", "none", "failed"]
"""Which photos are done again that were done before."""


@dataclass(frozen=True)
class BatchResult:
    """What has become of one photo of a batch.

    Attributes
    ----------
    path : Path
        Its file.
    name : str
        Of its results, below the output.
    record : Record
        What the manifest says of it.
    solution : Solution or None
        Where there is no output, and no error.
    error : PersfsError or None
        Why there is no surface.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> for result in ps.batch("no such folder"):
    ...     print(result.path, result.solution, result.record.status, type(result.error).__name__)
    no such folder None failed InputError
    """

    path: Path
    name: str
    record: Record
    solution: Solution | None = None
    error: PersfsError | None = None


class Batch:
    """Photos to be done, or what is left of them.

    Parameters
    ----------
    listing : Listing
    plan : Plan
    store : Store or None
        None sends the solutions instead.
    again : {"changed", "all", "none", "failed"}
        Done again are photos that failed, and those whose files or parameters have changed; all; none, whatever was
        made and however; or those alone that failed, and no others.
    shard : (int, int) or None
        Number, from 1, and count of the share of the photos to be done.

    Attributes
    ----------
    total : int
        Photos of this share.
    skipped : int
        Photos found done so far.
    """

    def __init__(
        self,
        listing: Listing,
        plan: Plan,
        store: Store | None,
        *,
        again: Again = "changed",
        shard: Shard | None = None,
    ) -> None:
        self._plan, self._store, self._again, self._shard = plan, store, again, shard
        self._inputs = [one for one in listing.inputs if is_in(shard, one.name)]
        self._problems = [one for one in listing.problems if is_in(shard, one[0])]
        self._roots = listing.roots
        self.total, self.skipped = len(self._inputs) + len(self._problems), 0
        self._given: dict[int, Input] = {}
        self._refused: deque[tuple[BatchResult, bool]] = deque()
        """With whether the manifest shall know of it."""

    def results(
        self,
        workforce: Callable[[Sequence[int]], Workforce],
        interrupted: Callable[[], bool] = lambda: False,
    ) -> Iterator[BatchResult]:
        """Do what is left, and say of each photo what has become of it.

        Parameters
        ----------
        workforce : callable
            Gives who does the tasks; called with the file descriptors that processes are to hold.
        interrupted : callable
            Whether an end is asked for.

        Raises
        ------
        InputError
            When another run is at work on the output, or it cannot be written to.
        DeviceError
            When no device is left.
        """
        with ExitStack() as open_things:
            held: Sequence[int] = ()
            if isinstance(self._store, FolderStore):
                held = open_things.enter_context(claimed(self._store.root, self._shard))
            journal = None
            if self._store is not None:
                # Now, for there may be nobody to do anything, and then, for processes may have been ended.
                self._store.clean()
                open_things.callback(self._store.clean)
                journal = self._store.journal()
                open_things.callback(journal.close)
            tasks = self._tasks(journal, interrupted)
            # Without a task there is nobody to call.
            first = next(tasks, None)
            yield from self._noted(journal)
            if first is None:
                return
            with closing(workforce(held).outcomes(_chained(first, tasks), interrupted)) as outcomes:
                for outcome in outcomes:
                    yield from self._noted(journal)
                    if outcome.end == "dropped":
                        continue
                    if journal is not None:
                        journal.add(outcome.record)
                    yield BatchResult(
                        self._given.pop(outcome.number).path,
                        outcome.record.name,
                        outcome.record,
                        outcome.solution,
                        outcome.error,
                    )
            yield from self._noted(journal)

    def pending(self) -> Iterator[Task | BatchResult]:
        """What would be done, and the photos that nobody would be called for. Writes nothing."""
        for task in self._tasks(None, lambda: False):
            yield from self._noted(None)
            yield task
        yield from self._noted(None)

    def _noted(self, journal: Journal | None) -> Iterator[BatchResult]:
        """The photos that nobody need be called for."""
        while self._refused:
            result, noted = self._refused.popleft()
            if noted and journal is not None:
                journal.add(result.record)
            yield result

    def _tasks(self, journal: Journal | None, interrupted: Callable[[], bool]) -> Iterator[Task]:
        for place, error in self._problems:
            # No photo, such as a path with a slip in it: it would be among the failures for ever.
            self._refuse(Path(place), place, error, noted=False)
        known = {} if self._store is None else latest(self._store.manifests())
        there = None if self._store is None else self._store.results()
        # Photos that end processes or devices must not come before others in every run.
        failed: list[int] = []
        for number, one in enumerate(self._inputs):
            if interrupted():
                return
            before = known.get(one.name)
            if before is not None and before.status == "failed" and self._again != "none":
                failed.append(number)
            elif (task := self._task(number, before, there, journal)) is not None:
                yield task
        for number in failed:
            if interrupted():
                return
            if (task := self._task(number, known[self._inputs[number].name], there, journal)) is not None:
                yield task

    def _task(self, number: int, before: Known | None, there: Results | None, journal: Journal | None) -> Task | None:
        """What is to be done with a photo, if it is."""
        one = self._inputs[number]
        if before is not None and before.status == "done" and there is not None and one.name not in there:
            before = None  # somebody removed it
        if (self._again == "none" and before is not None and before.status == "done") or (
            self._again == "failed" and (before is None or before.status == "done")
        ):
            self.skipped += 1
            return None
        try:
            if before is not None and self._again != "all":
                _require_same_photo(one, before)
            job = self._plan.job(one, self._roots)
        except PersfsError as error:
            # What another photo has come to stays noted.
            self._refuse(one.path, one.name, error, noted=before is None or before.status == "failed")
            return None
        task = Task(number, one.name, job, self._plan.parameter_hash(job))
        if self._again != "all" and (
            self._is_as_wanted(task, before) or self._is_adopted(task, before, there, journal)
        ):
            self.skipped += 1
            return None
        self._given[number] = one
        return task

    def _is_as_wanted(self, task: Task, before: Known | None) -> bool:
        if before is None or before.status != "done":
            return False
        return self._again == "none" or is_the_same(task.job, task.parameter_hash, before)

    def _is_adopted(self, task: Task, before: Known | None, there: Results | None, journal: Journal | None) -> bool:
        """Whether there is a result that its run could not note any more: it is noted now."""
        found = None if there is None else there.record(task.name)
        if found is None or (before is not None and found.finished <= before.finished):
            return False
        if journal is None or not self._is_as_wanted(task, Known.of(found)):
            return False
        journal.add(found)
        return True

    def _refuse(self, path: Path, name: str, error: PersfsError, *, noted: bool = True) -> None:
        record = Record(
            name=name,
            path=str(path),
            status="failed",
            error={"kind": type(error).__name__, "message": str(error)},
            version=package_version(),
            finished=now(),
        )
        self._refused.append((BatchResult(path, name, record, error=error), noted))


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
    """Reconstruct any number of photographs, in processes of their own, one for each device.

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
    options = cast("Options", {name: keywords.pop(name) for name in list(keywords) if name in described()})
    own = {one.name for one in fields(Brightness)}
    brightness = Brightness(**{name: keywords.pop(name) for name in list(keywords) if name in own})
    if keywords:
        raise TypeError(f"There is no keyword argument {next(iter(keywords))!r}.")
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
    paint: Path | Literal["fit"] | None = "fit" if albedo == "fit" else None if albedo is None else as_path(albedo)
    require_guided(settings, paint, guide_unit, guided=guide is not None or guides is not None)
    near, far = checked_bounds(_bound(near), _bound(far))
    files = {
        "masks": masks,
        "guides": guides,
        "walls": walls,
        "known_depth": known_depth,
    }
    plan = Plan(
        camera=CameraChoice() if camera is None else CameraChoice.like(camera),
        cameras=None if cameras is None else read_cameras(cameras),
        **{name: None if file is None else as_path(file) for name, file in files.items()},
        mask="auto" if mask == "auto" else None if mask is None else as_path(mask),
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


def _require_same_photo(one: Input, before: Known) -> None:
    """Refuse to put results in the place of another photo's.

    Raises
    ------
    InputError
        When the results of this name are of another file, which is still there.
    """
    earlier = Path(before.path)
    if before.status == "done" and earlier != one.path:
        with suppress(OSError):
            if not earlier.samefile(one.path):
                raise InputError(
                    f"{one.path} would have the results of {earlier}, {one.name}: choose another output, or do all "
                    "again, whatever was done before."
                )


def is_in(shard: Shard | None, name: str) -> bool:
    """Whether a photo belongs to a share: by its name alone, so that more photos change nothing for the others."""
    return shard is None or zlib.crc32(name.encode("utf-8", "surrogateescape")) % shard[1] == shard[0] - 1


def as_shard(given: Any) -> Shard | None:
    """A share: its number, from 1, and how many there are.

    Raises
    ------
    InputError
        When it is none.
    """
    if given is None:
        return None
    try:
        number, count = given
    except (TypeError, ValueError):
        raise InputError.about(
            "shard", given, "is no share: give two numbers, (2, 8) for the second of eight."
        ) from None
    count = as_whole_number("shard", count, least=1)
    return as_whole_number("shard", number, least=1, most=count), count


def _chained(first: Task, rest: Iterator[Task]) -> Iterator[Task]:
    yield first
    yield from rest
