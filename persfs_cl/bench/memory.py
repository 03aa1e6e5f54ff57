"""How much memory photographs take: one by itself, and those of a batch, beside what a batch says that it takes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import persfs_cl as ps
from persfs_cl.bench import fresh
from persfs_cl.bench.peaks import peaks_of_workers, tells_of_others
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.choices import Precision
from persfs_cl.pipeline.room import BYTES_PER_PROCESS, bytes_for
from persfs_cl.surface.saving import Saving

ONE = "wavefront"
"""What the records of one image are of; all others are of a batch."""
OF_PHOTOGRAPHS, OF_PROCESS, PEAK, SHARE = "said of photographs", "said of the process", "peak", "share of what is said"
_SIZE, _LARGE = 4096, 8192
_TINY = 24, 30
_DRAWN = 1000
"""Pixels a side that a photograph is drawn with; a larger one is enlarged, which takes less memory."""
_TASKS_EACH = 10
"""Tasks of the experiment on handing out for each photograph here, which is solved and written."""
_MEMORY = 2**28
"""What the photographs of the batch may take together, unless one takes more: less than they would without a bound."""
_SAVE = "depth,preview"
_LIGHT = ps.FlashLight()


def memory(plan: Plan) -> Iterator[list[Record]]:
    """Peak memory of a process that reconstructs one image, and of one that does tiny photographs and a large one."""
    yield _of_one(plan)
    yield _of_batch(plan)


def _of_one(plan: Plan) -> list[Record]:
    size = plan.size(_SIZE)
    used = fresh.run_fresh("memory", str(plan.device.index), str(size), plan.precision)
    on_host = " and its device's arrays, which are memory of the host too" if plan.device.kind == "cpu" else ""
    values = {
        "peak memory": (used["peak"] / 2**20, "MiB", f"of the process{on_host}"),
        "before the image": (used["before"] / 2**20, "MiB", "interpreter, libraries and driver"),
        "memory a pixel": ((used["peak"] - used["before"]) / size**2, "B", "what the image adds"),
    }
    return [
        Record.of([value], quantity=quantity, unit=unit, detail=detail, workload=ONE, images=1, **_common(plan, size))
        for quantity, (value, unit, detail) in values.items()
    ]


def _of_batch(plan: Plan) -> list[Record]:
    size, count = plan.size(_LARGE), max(2, plan.tasks // _TASKS_EACH)
    tiny = "{} × {}".format(*_TINY)
    half, whole = f"{count // 2:,} of {tiny}", f"{count:,} of {tiny} and one of {size}²"
    if not tells_of_others():
        reason = "this system does not tell how much memory other processes took, as Linux does."
        return [skip("memory", whole, PEAK, "MiB", size, plan.precision, reason)]
    with tempfile.TemporaryDirectory(prefix="persfs-cl-") as place:
        taken = take(plan.device, count, size, _MEMORY, Path(place), plan.precision)
    records = []
    # By half of the tiny ones the large one, which comes last, has hardly been read.
    for workload, said, peak, images, pixels in (
        (half, _MEMORY, taken.half, count // 2, 0),
        (whole, taken.said, taken.whole, count + 1, size),
    ):
        bound = BYTES_PER_PROCESS + said
        values = {
            OF_PHOTOGRAPHS: (said / 2**20, "MiB"),
            OF_PROCESS: (bound / 2**20, "MiB"),
            PEAK: (peak / 2**20, "MiB"),
            SHARE: (peak / bound, ""),
        }
        records += [
            Record.of([value], quantity=quantity, unit=unit, workload=workload, images=images, **_common(plan, pixels))
            for quantity, (value, unit) in values.items()
        ]
    return records


def _common(plan: Plan, size: int) -> dict[str, Any]:
    return {"experiment": "memory", "size": size, "precision": plan.precision}


@dataclass(frozen=True)
class Peaks:
    """What a batch took.

    Attributes
    ----------
    said : int
        Bytes that its photographs may take together, by what is said of a batch.
    first, half, whole : int
        Bytes that its process had had at most by the time of the first result, of half of the tiny ones, and of all.
    """

    said: int
    first: int
    half: int
    whole: int


def take(device: ps.Device, tiny: int, side: int, memory: int, folder: Path, precision: Precision = "float32") -> Peaks:
    """Run a batch of tiny photographs and a large one, which comes last, on one device.

    Parameters
    ----------
    device : Device
    tiny : int
        How many, two or more.
    side : int
        Pixels a side of the large one.
    memory : int
        Bytes that photographs may take together.
    folder : Path
        For photographs and results.
    precision : str

    Raises
    ------
    PersfsError
        Of a photograph that fails.
    """
    _write(folder / "in", tiny, side)
    peaks = {}
    results = ps.batch(
        folder / "in",
        folder / "out",
        camera=ps.Camera(float(side)),
        light=_LIGHT,
        save=_SAVE,
        max_memory=memory,
        device=device.index,
        precision=precision,
    )
    for number, result in enumerate(results, 1):
        if result.error is not None:
            raise result.error
        if number in (1, tiny // 2, tiny + 1):
            peaks[number] = max(peaks_of_workers().values())
    said = max(memory, bytes_for(side**2, Saving.of(_SAVE)))
    return Peaks(said, peaks[1], peaks[tiny // 2], peaks[tiny + 1])


def _write(folder: Path, tiny: int, side: int) -> None:
    """Write photographs of bumps, the tiny ones of different brightness."""
    from PIL import Image

    folder.mkdir(parents=True)
    levels = _levels(_TINY)
    for number in range(tiny):
        image = (levels * (0.5 + 0.5 * (number * 0.618 % 1.0))).astype(np.uint8)
        Image.fromarray(image).save(folder / f"{number:06}.png")
    drawn = min(side, _DRAWN)
    large = Image.fromarray(_levels((drawn, drawn)).astype(np.uint8))
    large.resize((side, side), Image.Resampling.BICUBIC).save(folder / "large.png")


def _levels(shape: tuple[int, int]) -> Any:
    image = ps.bump(shape, light=_LIGHT).image
    return 255.0 * image / image.max()
