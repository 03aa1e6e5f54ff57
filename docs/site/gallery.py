"""The gallery: every surface of docs/gallery.md made anew by its commands, and its pictures and figures from them.

``python docs/site/gallery.py [NAME ...]`` does all entries, or those whose pictures have these names.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.colour import to_display
from persfs_cl.page import fill_page
from persfs_cl.surface.plots import relief_picture
from persfs_cl.surface.views.reduced import Samples
from persfs_cl.surface.views.shaded import shaded

PAGE = Path(__file__).resolve().parents[1] / "gallery.md"
_ENTRY = re.compile(
    r"^## (?P<title>.+?)$.*?^```bash\n(?P<commands>.*?)^```$.*?\((?:gallery/)(?P<name>[\w-]+)\.jpg\)",
    re.MULTILINE | re.DOTALL,
)
_SIDE = 300
_GAP = 6
_NOTE = 0.94
"""How much of the oblique picture is above its note."""


@dataclass(frozen=True)
class Entry:
    """A subject: its heading, the name of its picture, and the commands, which write a folder ``result``.

    Where these also write ``truth.npy``, that is the true depth.
    """

    title: str
    name: str
    commands: str


def entries(markdown: str) -> list[Entry]:
    """Those of a page, in its order."""
    return [Entry(found["title"], found["name"], found["commands"]) for found in _ENTRY.finditer(markdown)]


def make(entry: Entry, folder: Path) -> str:
    """Run the commands in a folder; what they found, in a line."""
    place = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "-euo", "pipefail", "-c", entry.commands]
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, "PATH": place}, capture_output=True, text=True, check=False
    )
    if done.returncode != 0:
        raise RuntimeError(f"{entry.title}: {done.stderr}")
    solution = ps.load(folder / "result")
    height, width = solution.depth.shape
    found = f"{width} × {height} pixels, {solution.iterations} iterations"
    truth = _truth(folder)
    if truth is None:
        return f"{found}; the true depth is not known."
    error = ps.compare(solution.depth, truth).mean / np.ptp(truth[np.isfinite(truth)])
    return f"{found}; mean error {error:.1%} of the relief."


def picture(folder: Path) -> NDArray[np.uint8]:
    """Photograph, relief shaded, and the same of the truth; where there is none, the surface seen obliquely."""
    from PIL import Image

    solution = ps.load(folder / "result")
    height, width = solution.depth.shape
    samples = Samples.of((height, width), _SIDE)
    truth = _truth(folder)
    if truth is not None:
        photo = np.repeat(to_display(np.nan_to_num(solution.image / solution.white))[..., None], 3, axis=2)
        true = replace(solution, depth=truth, log_depth=np.log(truth), solved=np.isfinite(truth))
        panels = [photo, shaded(solution, samples), shaded(true, samples)]
    else:
        oblique = folder / "oblique.png"
        relief_picture(oblique, solution.depth, solution.camera, title="", discontinuities=solution.discontinuities)
        with Image.open(folder / "result" / "photo.jpg") as photo, Image.open(oblique) as drawn:
            above = np.asarray(drawn.convert("RGB").crop((0, 0, drawn.width, round(_NOTE * drawn.height))))
            panels = [np.asarray(photo.convert("RGB")), shaded(solution, samples), _trimmed(above)]
    gap = np.full((_SIDE, _GAP, 3), 255, np.uint8)
    return np.hstack([part for panel in panels for part in (gap, _as_high(panel))][1:])


def _truth(folder: Path) -> NDArray[np.float64] | None:
    file = folder / "truth.npy"
    return np.load(file).astype(np.float64) if file.exists() else None


def _as_high(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture so high as all are, and no wider than it may be."""
    from PIL import Image

    height, width = pixels.shape[:2]
    scale = min(_SIDE / height, 1.25 * _SIDE / width)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    small = np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS))
    above = (_SIDE - size[1]) // 2
    return np.pad(small, ((above, _SIDE - size[1] - above), (0, 0), (0, 0)), constant_values=255)


def _trimmed(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Without what is white around it."""
    drawn = (pixels < 250).any(axis=2)
    rows, columns = (np.flatnonzero(drawn.any(axis=axis)) for axis in (1, 0))
    return pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def main(names: list[str]) -> None:
    """Make the pictures, and put the figures between the markers of the page."""
    from PIL import Image

    known = {entry.name: entry for entry in entries(PAGE.read_text(encoding="utf-8"))}
    if unknown := [name for name in names if name not in known]:
        raise SystemExit(f"No subject of the gallery is named {unknown[0]!r}: there are {', '.join(known)}.")
    for entry in (known[name] for name in names or known):
        with tempfile.TemporaryDirectory() as folder:
            found = make(entry, Path(folder))
            target = PAGE.parent / "gallery" / f"{entry.name}.jpg"
            Image.fromarray(picture(Path(folder))).save(target, quality=85, optimize=True)
        fill_page(PAGE, {entry.name: found})
        sys.stdout.write(f"{entry.title}: {found}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
