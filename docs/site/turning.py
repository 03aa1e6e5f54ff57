"""The moving picture of the README: the skull of the demo, turned to and fro, wearing its photograph and as bare clay.

``python docs/site/turning.py`` runs the demo and films its page in a headless Chromium.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from browser import Browser, found_browser  # noqa: E402

PICTURE = ROOT / "docs" / "demo.webp"
_FRAMES = 24
_MILLISECONDS = 100
_YAW, _PITCH = 32.0, 8.0
"""Degrees: how far it turns to either side, and from how far above it is seen."""
_WINDOW = 1000, 560
_VIEW = slice(56, -50), slice(70, -70)
"""Of the canvas, without the buttons above and the line below."""
_WIDTH = 720


def frames(page: Path) -> list[NDArray[np.uint8]]:
    """One turn to and fro of the first relief of a page."""
    program = found_browser()
    if program is None:
        raise SystemExit("The picture is filmed in Chromium, which is not on this machine: 'apt-get install chromium'.")
    made = []
    with tempfile.TemporaryDirectory() as profile, Browser(str(program), Path(profile)) as browser:
        browser.size(*_WINDOW)
        for yaw in _YAW * np.sin(2 * np.pi * np.arange(_FRAMES) / _FRAMES):
            sides = []
            for wear in ("", "&wear=bare"):
                browser.visit(page, f"#relief=skull.png&turn={yaw:.0f},{_PITCH:.0f}{wear}")
                browser.drawn()
                browser.frame()
                sides.append(browser.picture("#relief canvas")[_VIEW])
            made.append(np.concatenate(sides, axis=1).astype(np.uint8)[..., :3])
    return made


def main() -> None:
    """Write the picture."""
    from PIL import Image

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([sys.executable, "-m", "persfs_cl", "demo", "-o", folder], check=True)
        whole = [Image.fromarray(frame) for frame in frames(folder / "skull" / "index.html")]
    size = _WIDTH, round(_WIDTH * whole[0].height / whole[0].width)
    first, *others = (frame.resize(size, Image.Resampling.LANCZOS) for frame in whole)
    first.save(PICTURE, save_all=True, append_images=others, duration=_MILLISECONDS, loop=0, quality=72, method=6)


if __name__ == "__main__":
    main()
