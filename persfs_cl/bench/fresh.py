"""What can only be seen in a process of its own: compilation with empty caches, and peak memory.

``python -m persfs_cl.bench.fresh WHAT ...`` prints a JSON object; :func:`run_fresh` starts it and reads that.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from typing import Any

import persfs_cl as ps
from persfs_cl.bench.peaks import peak_memory
from persfs_cl.bench.workloads import smooth_image
from persfs_cl.choices import Precision
from persfs_cl.errors import PersfsError

_ITERATIONS = 4


class FreshProcessError(PersfsError):
    """A measurement in a process of its own failed; the message holds what it said."""


def run_fresh(*arguments: str, environment: Mapping[str, str] | None = None) -> dict[str, float]:
    """Run this module in a new interpreter.

    Raises
    ------
    FreshProcessError
        When it fails.
    """
    command = [sys.executable, "-m", "persfs_cl.bench.fresh", *arguments]
    done = subprocess.run(
        command,
        env=child_environment(environment or {}),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise FreshProcessError(f"{' '.join(arguments)} failed in a process of its own:\n{done.stderr.strip()}")
    values: dict[str, float] = json.loads(done.stdout)
    return values


def child_environment(more: Mapping[str, str]) -> dict[str, str]:
    """The environment of a new interpreter that is to import this very package, with some more variables."""
    # Where the package lies in the working directory, it must be found there too.
    search = os.pathsep.join(path for path in sys.path if path)
    return {**os.environ, "PYTHONPATH": search, **more}


def compilation(device: int, ordering: str, precision: Precision) -> dict[str, float]:
    """Seconds of the first reconstruction in this process, and of the second, of a tiny image."""
    first, second = (_seconds(16, device, ordering, precision) for _ in range(2))
    return {"first": first, "second": second}


def memory(device: int, size: int, precision: Precision) -> dict[str, float]:
    """Peak memory of this process in bytes, before and after the reconstruction of one image."""
    compilation(device, "wavefront", precision)
    before = peak_memory()
    _seconds(size, device, "wavefront", precision)
    return {"before": before, "peak": peak_memory()}


def _seconds(size: int, device: int, ordering: str, precision: Precision) -> float:
    image, camera = smooth_image(size), ps.Camera(float(size))
    began = time.perf_counter()
    ps.reconstruct(
        image,
        camera,
        device=device,
        ordering=ordering,
        precision=precision,
        scheme="lax-friedrichs",
        max_iterations=_ITERATIONS,
        tolerance=0.0,
        acceleration=False,
    )
    return time.perf_counter() - began


def _main(what: str, device: str, *rest: Any) -> None:
    if what == "compilation":
        ordering, precision = rest
        values = compilation(int(device), ordering, precision)
    else:
        size, precision = rest
        values = memory(int(device), int(size), precision)
    sys.stdout.write(json.dumps(values))


if __name__ == "__main__":
    _main(*sys.argv[1:])
