"""How much memory the photos of a batch take: that of the process that solves them, as Linux tells it."""

from __future__ import annotations

from pathlib import Path

import pytest

import persfs_cl as ps
from persfs_cl.bench.memory import take
from persfs_cl.bench.peaks import tells_of_others
from persfs_cl.pipeline.room import BYTES_PER_PROCESS, bytes_for
from persfs_cl.surface.saving import Saving


@pytest.mark.thorough
@pytest.mark.skipif(not tells_of_others(), reason="this system does not tell how much memory other processes took")
@pytest.mark.parametrize(
    ("tiny", "side", "memory"),
    [(40, 500, 60 * 2**20), (1000, 3000, 2**28)],
)
def test_many_small_photos_and_a_large_one_stay_within_what_is_said(
    tiny: int, side: int, memory: int, tmp_path: Path
) -> None:
    taken = take(ps.devices()[0], tiny, side, memory, tmp_path)
    assert taken.said >= memory
    assert 0 < taken.first < BYTES_PER_PROCESS
    assert taken.first <= taken.half <= taken.whole < BYTES_PER_PROCESS + taken.said
    # What is said is no more than a few times what there is need for: it holds with all maps, of which there are none.
    assert taken.whole - taken.first > taken.said / 7


def test_what_a_photo_takes_goes_by_its_pixels_and_files() -> None:
    sizes = [bytes_for(10**6, Saving.of(save)) for save in ("depth", "depth,pictures", "mesh.glb", "mesh.obj,mesh.glb")]
    assert sizes == sorted(sizes)
    assert len(set(sizes)) == 4
    assert bytes_for(10**6, Saving.of("depth"), in_rounds=True) > bytes_for(10**6, Saving.of("depth"))
