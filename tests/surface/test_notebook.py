"""What notebooks show of a surface: pictures, and a page in a frame that draws it."""

from __future__ import annotations

import dataclasses
import io
import json
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, found_browser
from made import decoded, dome, surface
from PIL import Image

from persfs_cl.arrays import Array
from persfs_cl.surface.solved import SolvedSurface
from persfs_cl.surface.views.notebook import surface_html, surface_png

PROGRAM = found_browser()


class Shown(HTMLParser):
    """What the HTML holds: the pictures, the page in the frame, and the words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.pictures: list[dict[str, str | None]] = []
        self.frame = ""
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.pictures.append(dict(attrs))
        if tag == "iframe":
            self.frame = dict(attrs)["srcdoc"] or ""

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def half(height: int, width: int) -> Array:
    """A dome of which the left half is missing."""
    depth = dome(height, width)
    depth[:, : width // 2] = np.nan
    return depth


def pixels(png: bytes) -> Array:
    with Image.open(io.BytesIO(png)) as picture:
        assert picture.format == "PNG"
        return np.asarray(picture.convert("RGB")).astype(float)


def test_png_has_depth_and_shaded_relief_side_by_side() -> None:
    shown = pixels(surface_png(surface(dome(128, 128))))
    assert shown.shape == (256, 520, 3)
    depth, relief = shown[:, :256], shown[:, 264:]
    # Near is bright: the middle of the dome; and the relief is lit from the upper left.
    assert depth[128, 128].sum() > depth[5, 5].sum() + 200
    assert relief[100, 100].sum() > relief[156, 156].sum() + 60


def test_where_there_is_no_surface_is_grey() -> None:
    shown = pixels(surface_png(surface(half(64, 64))))
    assert (shown[:, :128] == shown[0, 0]).all()
    assert (shown[:, 264:392] == shown[0, 0]).all()
    assert not (shown[:, 128:256] == shown[0, 0]).all(axis=-1).any()


@pytest.mark.parametrize("shape", [(1, 1), (1, 2000), (2000, 1), (3, 2), (700, 900)])
def test_odd_shapes(shape: tuple[int, int]) -> None:
    found = surface(np.linspace(2, 3, shape[0] * shape[1]).reshape(shape))
    height, width, _ = pixels(surface_png(found)).shape
    assert height <= 256
    assert width <= 520
    shown = Shown(surface_html(found))
    assert [(one["width"], one["height"]) for one in shown.pictures] == 2 * [(str((width - 8) // 2), str(height))]


def test_the_frame_holds_the_surface_and_asks_for_nothing() -> None:
    found = surface(half(80, 100))
    shown = Shown(surface_html(found))
    heights = re.search(r'<script id="heights" type="application/json">\n(.*?)\n</script>', shown.frame, re.DOTALL)
    assert heights is not None
    there = decoded(json.loads(heights[1]))
    np.testing.assert_allclose(there, found.depth, atol=1e-5)
    assert not re.search(r'(src|href)="(?!data:)|https?://|@import|url\(', shown.frame)
    assert all(str(picture["src"]).startswith("data:image/jpeg;base64,") for picture in shown.pictures)
    assert f"Depth: {np.nanmin(found.depth):.4g} (bright) to 1" in shown.words


def test_ten_large_surfaces_fit_into_a_notebook() -> None:
    rough = np.random.default_rng(0).uniform(1, 2, (1500, 1500))
    found = dataclasses.replace(surface(rough), image=rough / 2)
    assert len(surface_html(found)) < 400_000
    assert len(surface_png(found)) < 200_000


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if PROGRAM is None:
        pytest.skip("no Chromium on this machine: 'apt-get install chromium'")
    with Browser(PROGRAM, tmp_path_factory.mktemp("profile")) as browser:
        yield browser


def visit(browser: Browser, page: Path, found: SolvedSurface) -> None:
    page.write_text(Shown(surface_html(found)).frame, encoding="utf-8")
    browser.visit(page)
    browser.wait("document.querySelector('canvas').getAttribute('aria-busy') === 'false'")
    browser.frame()


def test_the_frame_draws_turns_and_undresses(started: Browser, tmp_path: Path) -> None:
    started.size(340, 256)

    def picture() -> Array:
        # Without the buttons.
        return np.asarray(started.picture()[:220].astype(float))

    def changed(before: Array) -> float:
        return float((np.abs(picture() - before).max(axis=-1) > 20).mean())

    visit(started, tmp_path / "dome.html", surface(dome(60, 60)))
    first = picture()
    started.evaluate("document.querySelector('canvas').style.visibility = 'hidden'")
    started.frame()
    assert changed(first) > 0.15
    started.evaluate("document.querySelector('canvas').style.visibility = ''")
    started.drag("canvas", 60, 20)
    assert changed(first) > 0.05
    turned = picture()
    started.click("#wear")
    assert changed(turned) > 0.05
    assert started.evaluate("document.querySelector('#wear').textContent") == "Photograph"
    started.click("#reset")
    started.click("#wear")
    assert changed(first) < 0.02
    assert started.faults() == []
