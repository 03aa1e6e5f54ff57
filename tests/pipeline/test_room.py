"""How much memory the photos of a batch take: that of the processes that solve them, as Linux tells it."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from batches import FOCAL, photos

import persfs_cl as ps
from persfs_cl.pipeline.room import BYTES_PER_PROCESS, bytes_for
from persfs_cl.surface.saving import Saving

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux tells what processes took")
SAVE = "depth,preview"


def peaks() -> dict[int, int]:
    """The most memory that each process for a device has had, by their numbers."""
    found = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            status = (place / "status").read_text()
            ours = f"PPid:\t{os.getpid()}\n" in status and b"pipeline.workers" in (place / "cmdline").read_bytes()
        except OSError:
            continue
        if ours and (peak := re.search(r"VmHWM:\s+(\d+) kB", status)):
            found[int(place.name)] = int(peak[1]) * 1024
    return found


@pytest.mark.parametrize(
    ("tiny", "side", "memory"),
    [(40, 700, 100 * 2**20), pytest.param(1000, 3000, 2**28, marks=pytest.mark.thorough)],
)
def test_many_small_photos_and_a_large_one_stay_within_what_is_said(
    tiny: int, side: int, memory: int, tmp_path: Path
) -> None:
    names = photos(tmp_path / "in", tiny)
    [large] = photos(tmp_path / "in", 1, (side, side), first=99_999)
    light, camera = ps.FlashLight(), ps.Camera(FOCAL * side / 30)
    seen: dict[str, int] = {}
    for result in ps.batch(
        tmp_path / "in", tmp_path / "out", camera=camera, light=light, save=SAVE, max_memory=memory, device=0
    ):
        assert result.error is None
        [seen[result.name]] = peaks().values()
    assert sorted(seen) == [*names, large]
    peak = max(seen.values())
    before = min(seen.values())
    said = max(memory, bytes_for(side**2, Saving.of(SAVE)))
    assert before < BYTES_PER_PROCESS
    assert peak < BYTES_PER_PROCESS + said
    # What is said is no more than a few times what there is need for.
    assert peak - before > said / 6


def test_what_a_photo_takes_goes_by_its_pixels_and_files() -> None:
    sizes = [bytes_for(10**6, Saving.of(save)) for save in ("depth", "depth,pictures", "mesh.glb", "mesh.obj,mesh.glb")]
    assert sizes == sorted(sizes)
    assert len(set(sizes)) == 4
    assert bytes_for(10**6, Saving.of("depth"), in_rounds=True) > bytes_for(10**6, Saving.of("depth"))
