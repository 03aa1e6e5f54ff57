"""Oclgrind takes the place of the device, runs the kernels of each ordering, and looks for data races.

It models barriers and the ends of launches, and not that a counter puts one access before another. So of orderings
whose groups wait for each other one group is run here; docs/performance.md says what it reports for several.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import sys
from dataclasses import replace

from problems import BESIDE, FLASH, OBLIQUE, random_problem

import persfs_cl as ps
from persfs_cl._cl.orderings.checkerboard import Checkerboard
from persfs_cl._cl.orderings.checkerboard_bands import CheckerboardBands
from persfs_cl._cl.orderings.three_colours import ThreeColours
from persfs_cl._cl.orderings.wavefront_images import WavefrontImages
from persfs_cl._cl.orderings.wavefront_strips import WavefrontStrips
from persfs_cl._cl.orderings.wavefront_tiles import WavefrontTiles
from persfs_cl._cl.sweeper import Sweeper

ordering, light, boundary = eval(sys.argv[1]), eval(sys.argv[2]), sys.argv[3]
device, = ps.devices()
assert "Oclgrind" in device.name, device
problems = [
    random_problem(seed, (17, 30), boundary=boundary, holes=0.3, light=light, scheme="upwind") for seed in range(2)
]
sweeper = Sweeper(
    device,
    [problem.kernel_arguments for problem in problems],
    model=problems[0].kernels,
    ordering=ordering,
    precision="float32",
    second_order=ordering.second_order,
)
assert (sweeper.run(2)[0] > 0.0).all()
"""
ORDERINGS = {
    "strips": "WavefrontStrips(8, vectors=1)",
    "wide strips": "WavefrontStrips(16, vectors=1)",
    "strips, second order": "WavefrontStrips(4, vectors=3, second_order=True)",
    "images": "WavefrontImages(8, vectors=1, work_groups=2)",
    "tiles": "WavefrontTiles(tile=(8, 16))",
    "tiles, second order": "WavefrontTiles(tile=(8, 16), second_order=True)",
    "bands": "CheckerboardBands(8, band_rows=3)",
    "wide bands": "CheckerboardBands(16, band_rows=3)",
    "checkerboard": "Checkerboard(group=8)",
    "three colours": "ThreeColours(group=8, second_order=True)",
}
KERNELS = Path(__file__).resolve().parents[2] / "kernels"


def reported(ordering: str, light: str, boundary: str, log: Path) -> list[tuple[str, ...]]:
    """The lines of the kernels that each race is between."""
    command = ["oclgrind", "--data-races", "--max-errors", "1000000", "--log", str(log), sys.executable, "-c", SCRIPT]
    run = subprocess.run([*command, ordering, light, boundary], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    text = log.read_text(encoding="utf-8") if log.exists() else ""
    races = re.split(r"(?=(?:Read|Write)-write data race)", text)
    assert not races[0].strip(), races[0]
    return [
        tuple(line_of(file, int(line)) for line, file in re.findall(r"At line (\d+) \(column \d+\) of (\w+\.cl)", race))
        for race in races[1:]
    ]


def line_of(file: str, line: int) -> str:
    (path,) = KERNELS.glob(f"*/{file}")
    return path.read_text(encoding="utf-8").splitlines()[line - 1].strip()


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("oclgrind") is None, reason="Oclgrind is not installed: Debian's package has its name")
@pytest.mark.parametrize("light", ["OBLIQUE", "FLASH"])
@pytest.mark.parametrize("name", ORDERINGS)
def test_no_value_is_read_while_it_is_written(
    name: str, light: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Except that work-items of a part look at its account while one that has the same colour notes a change."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[1]), prepend=":")
    races = reported(ORDERINGS[name], light, "wall", tmp_path / "races.txt")
    if name not in ("checkerboard", "three colours"):
        assert not races
    for race in races:
        assert len(race) == 2
        assert all("changed" in line or "part" in line for line in race), race


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which("oclgrind") is None, reason="Oclgrind is not installed: Debian's package has its name")
def test_no_boundary_is_read_while_it_is_renewed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[1]), prepend=":")
    assert not reported(ORDERINGS["tiles"], "OBLIQUE", "outflow", tmp_path / "races.txt")
