"""How fast a folder of photographs becomes surfaces, beside what the processors could do at best."""

from __future__ import annotations

import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any, TypeVar

import numpy as np

from persfs_cl.bench.plan import Plan
from persfs_cl.bench.results import Record
from persfs_cl.blocks import usable_cores
from persfs_cl.colour import encode_srgb
from persfs_cl.pipeline.crew import Crew
from persfs_cl.pipeline.job import Job, finished, pose, prepare, read_job
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.plan import DEFAULT_ITEMS
from persfs_cl.pipeline.plan import Plan as BatchPlan
from persfs_cl.pipeline.results import write
from persfs_cl.pipeline.run import Batch
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.pipeline.workforce import crew_settings
from persfs_cl.scenes.framed import bumps
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.solver.complete import complete
from persfs_cl.solver.solve import solve
from persfs_cl.surface.saving import Saving

SIZE = 1000
DEPTH, DEFAULT = "depth files", "default files"
SAVINGS = {DEPTH: "depth", DEFAULT: DEFAULT_ITEMS}
IDEAL, MEASURED, SHARE = "ideal rate", "rate", "share of the ideal"
_PHOTOS = 96
_ALONE = 4
"""Photographs whose steps are measured one by one."""
_FORMATS = ("jpg", "png")
_LIGHT = FlashLight()
_Result = TypeVar("_Result")


def folder(plan: Plan) -> Iterator[list[Record]]:
    """Photographs of a flash, from files to files, as a batch does them.

    The ideal is all processors at work all the time, on decoding, preparing, kernels and encoding only, each of which
    is measured by itself, by its processor time. The rate is that of the whole call, with warm kernel caches: it has
    the start of the process in it.
    """
    size = plan.size(SIZE)
    photos = max(2, _PHOTOS * plan.repeats // Plan.repeats)
    with tempfile.TemporaryDirectory(prefix="persfs-cl-") as place:
        root = Path(place)
        choice = _photographs(root / "in", size, photos)
        inputs = list_inputs(root / "in")
        for name, items in SAVINGS.items():
            work = BatchPlan(
                camera=choice, light=_LIGHT, keywords={"precision": plan.precision}, saving=Saving.of(items)
            )
            jobs = [work.job(one) for one in inputs.inputs]
            _steps(plan, jobs[:1], work, root / "warm")
            alone = _steps(plan, jobs[:_ALONE], work, root / "alone")
            megapixels = photos * size**2 / 1e6
            ideal = megapixels / photos * usable_cores() / sum(map(fmean, alone.values()))
            began = time.perf_counter()
            store = FolderStore(root / name.replace(" ", "-"))
            settings = crew_settings(work, store, [plan.device], None)
            results = list(Batch(inputs, work, store).results(partial(Crew, settings)))
            rate = megapixels / (time.perf_counter() - began)
            for result in results:
                if result.error is not None:
                    raise result.error
            common: dict[str, Any] = {
                "experiment": "folder",
                "workload": name,
                "size": size,
                "precision": plan.precision,
            }
            yield [
                *(
                    Record.of(values, quantity=f"{step}, processor time", unit="s", images=1, **common)
                    for step, values in alone.items()
                ),
                Record.of([ideal], quantity=IDEAL, unit="Mpx/s", images=photos, **common),
                Record.of([rate], quantity=MEASURED, unit="Mpx/s", images=photos, **common),
                Record.of([rate / ideal], quantity=SHARE, unit="", images=photos, **common),
            ]


def _photographs(folder: Path, size: int, count: int) -> CameraChoice:
    """Write photographs of bumps, all of them different, as JPEG and PNG in turn, and say what camera they have."""
    import imageio.v3 as iio

    folder.mkdir()
    scene = bumps((size, size), light=_LIGHT)
    noise = np.random.default_rng(7)
    for number in range(count):
        suffix = _FORMATS[number % len(_FORMATS)]
        light = scene.image * (1 - 0.3 * number / count) / scene.image.max()
        levels = 255 * encode_srgb(light) + noise.normal(0, 1, light.shape)
        image = np.repeat(np.clip(levels + 0.5, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
        iio.imwrite(folder / f"{number:04}.{suffix}", image)
    return CameraChoice.like(scene.camera)


def _steps(plan: Plan, jobs: Sequence[Job], work: BatchPlan, output: Path) -> dict[str, list[float]]:
    """Processor time of each step, one photograph at a time."""
    options = complete({**work.keywords, "light": work.light, "reflectance": work.reflectance})
    took: dict[str, list[float]] = defaultdict(list)

    def timed(step: str, call: Callable[[], _Result]) -> _Result:
        began = time.process_time()
        result = call()
        took[step].append(time.process_time() - began)
        return result

    for number, job in enumerate(jobs):
        inputs = timed("decoding", partial(read_job, job))
        ready = timed("preparing", partial(prepare, inputs))
        problem = timed("preparing", partial(pose, ready, options))
        took["preparing"][-2:] = [sum(took["preparing"][-2:])]
        (solution,) = timed("kernels", partial(solve, plan.device, [problem], options, None))
        solved = finished(ready, solution)
        timed("encoding", partial(write, solved, output / f"{number}", work.saving))
    return took
