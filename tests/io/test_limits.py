"""The limit on pixels follows the memory, and the environment above it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from persfs_cl.errors import InputError
from persfs_cl.io.limits import VARIABLE, max_pixels, memory, require_pixels


def test_the_limit_is_a_share_of_the_memory_unless_it_is_set() -> None:
    assert 0 < memory() <= os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    assert max_pixels({}) == max_pixels({VARIABLE: " "}) == memory() // 64
    assert max_pixels({VARIABLE: "4e8"}) == 400_000_000
    assert max_pixels({VARIABLE: " 12 "}) == 12


def test_a_container_has_less_memory_than_its_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = tmp_path / "max", tmp_path / "bytes", tmp_path / "none"
    files[0].write_text("max\n")
    files[1].write_text("1048576\n")
    monkeypatch.setattr("persfs_cl.io.limits._CONTROL_GROUPS", files)
    assert memory() == 1048576


@pytest.mark.parametrize("text", ["many", "0", "-1", "nan", "inf"])
def test_a_limit_that_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=rf"PERSFS_CL_MAX_PIXELS is '{text}': give a number of pixels, such as 4e8"):
        max_pixels({VARIABLE: text})


def test_pixels_up_to_the_limit_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "24e6")
    require_pixels("a.tif", (4000, 6000))
    with pytest.raises(InputError, match=r"a\.tif is too large: 4000 × 6001 pixels are 24 million, and the limit"):
        require_pixels("a.tif", (4000, 6001))
    with pytest.raises(
        InputError, match=r"4000 × 6000 pixels take the room of 48 million, and the limit here is 24 mil"
    ):
        require_pixels("a.tif", (4000, 6000), weight=2)
    with pytest.raises(InputError, match=r"pixels are .* million"):
        require_pixels("a.tif", (2**64, 2**64, 10**300))
