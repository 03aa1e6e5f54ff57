"""A large photograph through the command to all its default files: what a user waits for, start of Python included."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import persfs_cl as ps
from persfs_cl.bench.fresh import FreshProcessError, child_environment
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.colour import encode_srgb

SIZE = 3464
"""12 million pixels."""
ELAPSED, PROCESSOR, PEAK = "from start to end", "processor time", "peak memory"
_COMMAND = """
import sys
from persfs_cl.cli import main
try:
    main()
finally:
    from persfs_cl.bench.peaks import peak_memory
    sys.stderr.write(f"\\npeak memory {peak_memory()}\\n")
"""
"""The command, which says at its end how much memory it had: what is told of it afterwards holds that of the process
that started it too."""
_PHOTOS = {"PNG": ("png", 0.0), "JPEG, with noise": ("jpg", 0.01)}
"""By what they are called, their suffix and the standard deviation of their noise, in shares of the brightness."""


def photograph(plan: Plan) -> Iterator[list[Record]]:
    """Time, processor time and memory of `persfs-cl reconstruct` for a bump under a flash, with warm kernel caches."""
    size = plan.size(SIZE)
    for kind, (suffix, noise) in _PHOTOS.items():
        common: dict[str, Any] = {
            "experiment": "photograph",
            "workload": f"{kind}, {size}²",
            "size": size,
            "images": 1,
            "precision": plan.precision,
        }
        if not hasattr(os, "wait4"):
            yield [skip("photograph", kind, ELAPSED, "s", size, plan.precision, "this system has no wait4")]
            continue
        with tempfile.TemporaryDirectory(prefix="persfs-cl-") as place:
            photo, output = Path(place) / f"photo.{suffix}", Path(place) / "output"
            _write(photo, size, noise)
            _command(plan, photo, output, size)
            found = [_command(plan, photo, output, size) for _ in range(plan.repeats)]
            files = [file.stat().st_size for file in output.iterdir() if not file.name.startswith(".")]
        details = {
            ELAPSED: f"{len(files)} files, {sum(files) / 2**20:.0f} MiB",
            PROCESSOR: "of all its threads, in user mode and in the system",
            PEAK: f"{max(one[PEAK] for one in found) * 2**20 / size**2:.0f} B a pixel",
        }
        units = {ELAPSED: "s", PROCESSOR: "s", PEAK: "MiB"}
        yield [
            Record.of([one[name] for one in found], quantity=name, unit=unit, detail=details[name], **common)
            for name, unit in units.items()
        ]


def _write(path: Path, size: int, noise: float) -> None:
    import imageio.v3 as iio

    light = ps.bump((size, size), light=ps.FlashLight()).image
    light = 0.9 * light / light.max()
    light = light * (1.0 + noise * np.random.default_rng(7).standard_normal(light.shape, np.float32))
    levels = np.clip(255.0 * encode_srgb(light.clip(0.0, 1.0)) + 0.5, 0, 255).astype(np.uint8)
    iio.imwrite(path, np.repeat(levels[..., None], 3, axis=2))


def _command(plan: Plan, photo: Path, output: Path, size: int) -> dict[str, float]:
    """What one call of the command takes.

    Raises
    ------
    FreshProcessError
        When it fails.
    """
    command = [sys.executable, "-c", _COMMAND, "reconstruct", str(photo), "-o", str(output), "--overwrite"]
    command += ["--light", "flash", "--focal-length", str(size)]
    command += ["--device", str(plan.device.index), "--precision", plan.precision]
    with tempfile.TemporaryFile() as said:
        began = time.perf_counter()
        process = subprocess.Popen(command, env=child_environment({}), stdout=subprocess.DEVNULL, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
        elapsed = time.perf_counter() - began
        # So that it does not wait for it again.
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        text = said.read().decode(errors="replace")
        peak = re.search(r"^peak memory (\d+)$", text, re.MULTILINE)
        if process.returncode or peak is None:
            raise FreshProcessError(f"persfs-cl {' '.join(command[3:])} failed:\n{text.strip()}")
    return {
        ELAPSED: elapsed,
        PROCESSOR: usage.ru_utime + usage.ru_stime,
        PEAK: int(peak[1]) / 2**20,
    }
