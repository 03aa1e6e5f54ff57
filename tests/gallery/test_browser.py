"""The page as people see it: in a headless Chromium, from the disk, with real clicks, drags and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from browser import Browser, found_browser
from made import HOSTILE, chequered, dome, failure, record, surface
from numpy.typing import NDArray

from persfs_cl.gallery.index import write_index
from persfs_cl.surface.views.preview import write_preview

PROGRAM = found_browser()
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="no Chromium on this machine: 'apt-get install chromium'")

HALF = "half.png"
"""One with nothing on its left half."""
ODD = "folder #1/100% 'größe'?&=.png"
SHAPE = 150, 200
STAGE = "#relief canvas"


def shown_names() -> str:
    return "[...document.querySelectorAll('tbody tr[data-place] td.name')].map((cell) => cell.title)"


def results(output: Path, name: str, *, hole: bool = False) -> None:
    depth = dome(*SHAPE)
    if hole:
        depth[:, : SHAPE[1] // 2] = np.nan
    folder = output / name
    folder.mkdir(parents=True, exist_ok=True)
    write_preview(folder, surface(depth), chequered(*SHAPE), name=name)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two images that are done, some with other names only, and one that failed."""
    output = tmp_path_factory.mktemp("results")
    for name in (HALF, ODD):
        results(output, name, hole=name == HALF)
    others = [record(name, files=[], warnings=[name]) for name in HOSTILE]
    records = [record(ODD), record(HALF, size=[10, 10], converged="MAX_ITERATIONS"), *others, failure("zz.png")]
    write_index(output, records, title="Results", parameters={"scheme": "upwind", "light": {"kind": "FlashLight"}})
    return output


@pytest.fixture(scope="module")
def thousands(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("thousands")

    def one(number: int) -> dict[str, Any]:
        name = f"{number:05}.png"
        if number % 1000 == 999:
            return failure(name, f"reason {number}")
        figures = {"mean_error": float(number * 7919 % 10007), "depth_min": 1.0, "depth_max": 2.0}
        return record(name, figures=figures, files=[])

    write_index(output, map(one, range(10_000)), title="Thousands")
    return output


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(str(PROGRAM), tmp_path_factory.mktemp("profile")) as browser:
        yield browser


@pytest.fixture
def browser(started: Browser) -> Iterator[Browser]:
    started.events.clear()
    started.size(1120, 640)
    yield started
    assert started.faults() == []


def view_of(name: str, turn: str = "", others: str = "") -> str:
    return f"#relief={quote(name, safe='')}" + (f"&turn={turn}" if turn else "") + others


def stage(browser: Browser) -> NDArray[np.int_]:
    """Pixels of the relief, without the buttons above it and the line below."""
    pixels = browser.picture(STAGE).astype(int)
    return pixels[52:-44]


def worn(pixels: NDArray[np.int_]) -> NDArray[np.bool_]:
    """Which pixels show a square of the photograph: nothing else on the page is of strong colour."""
    return np.asarray(np.ptp(pixels, axis=-1) > 90)


def test_relief_wears_its_photograph_and_is_turned_by_the_address(browser: Browser, folder: Path) -> None:
    seen = {}
    browser.visit(folder / "index.html", view_of(ODD, "30,20"))
    browser.drawn()
    for turn in ("30,20", "0,0", "60,0", "0,60"):
        browser.evaluate(f"location.hash = {view_of(ODD, turn)!r}")
        browser.frame()
        seen[turn] = stage(browser)
    front = worn(seen["0,0"])
    rows, columns = np.flatnonzero(front.any(axis=1)), np.flatnonzero(front.any(axis=0))
    # As wide to its height as the photograph, and in the middle.
    assert np.ptp(columns) / np.ptp(rows) == pytest.approx(SHAPE[1] / SHAPE[0], rel=0.06)
    assert columns.mean() == pytest.approx(front.shape[1] / 2, rel=0.05)
    assert front.mean() > 0.25
    # The upper left square is blue, and its neighbours red, as in the photograph.
    across, down = np.ptp(columns) / 8, np.ptp(rows) / 8
    at = seen["0,0"][rows[0] + int(down / 2), columns[0] + int(across / 2) :: int(across)][:2]
    assert at[0, 2] > at[0, 0]
    assert at[1, 0] > at[1, 2]
    # Turned, it is narrower or lower, and another picture.
    assert np.ptp(np.flatnonzero(worn(seen["60,0"]).any(axis=0))) < 0.85 * np.ptp(columns)
    assert np.ptp(np.flatnonzero(worn(seen["0,60"]).any(axis=1))) < 0.85 * np.ptp(rows)
    for turn in ("60,0", "0,60", "30,20"):
        assert (np.abs(seen[turn] - seen["0,0"]).max(axis=-1) > 40).mean() > 0.1


@pytest.mark.thorough
def test_mouse_turns_and_double_click_takes_it_back(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", view_of(ODD))
    browser.drawn()
    first = stage(browser)
    browser.drag(STAGE, 80, 0)
    turned = stage(browser)
    browser.drag(STAGE, 0, 70)
    raised = stage(browser)
    for one, other in ((first, turned), (turned, raised)):
        assert (np.abs(one - other).max(axis=-1) > 40).mean() > 0.1
        assert worn(other).mean() > 0.05
    browser.wait("location.hash.includes('turn=60,52')")
    browser.click(STAGE, 2)
    np.testing.assert_allclose(stage(browser), first, atol=2)  # the ground is dithered


@pytest.mark.thorough
def test_wheel_zooms(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", view_of(ODD, "0,0"))
    browser.drawn()
    before = worn(stage(browser)).mean()
    box = browser.box(STAGE)
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    browser.mouse("mouseWheel", x, y, deltaX=0, deltaY=600)
    browser.wait("location.hash.includes('zoom=0.41')")
    browser.frame()
    assert worn(stage(browser)).mean() == pytest.approx(before * np.exp(-0.9) ** 2, rel=0.1)


@pytest.mark.thorough
def test_bare_surface_is_shaded_without_the_photograph(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", view_of(ODD, "0,0"))
    browser.drawn()
    place = worn(stage(browser))
    browser.click("#wear button[value=bare]")
    bare = stage(browser)
    assert not worn(bare).any()
    grey = bare.mean(axis=-1)
    rows, columns = (np.flatnonzero(place.any(axis=axis)) for axis in (1, 0))
    middle = int(rows.mean()), int(columns.mean())
    reach = int(np.ptp(columns) * 0.2)
    # The dome is lit from the upper left.
    upper_left = grey[middle[0] - reach // 2, middle[1] - reach // 2]
    lower_right = grey[middle[0] + reach // 2, middle[1] + reach // 2]
    assert upper_left > lower_right + 30
    browser.wait("location.hash.includes('wear=bare')")
    browser.visit(folder / "index.html", view_of(ODD, "0,0", "&wear=bare"))
    browser.drawn()
    np.testing.assert_allclose(stage(browser), bare, atol=2)


@pytest.mark.thorough
def test_nothing_is_drawn_where_there_is_no_surface(browser: Browser, folder: Path) -> None:
    halves = {}
    for name in (ODD, HALF):
        browser.visit(folder / "index.html", view_of(name, "0,0"))
        browser.drawn()
        drawn = worn(stage(browser))
        rows, columns = (np.flatnonzero(drawn.any(axis=axis)) for axis in (1, 0))
        halves[name] = np.ptp(columns) / np.ptp(rows)
    assert halves[HALF] == pytest.approx(halves[ODD] / 2, rel=0.12)


@pytest.mark.thorough
def test_keys_turn_zoom_and_change_what_is_worn(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", view_of(ODD, "0,0"))
    browser.drawn()
    browser.evaluate(f"document.querySelector('{STAGE}').focus()")
    for key, found in (
        ("ArrowRight", "turn=5,0"),
        ("ArrowDown", "turn=5,5"),
        ("+", "zoom=1.15"),
        ("w", "wear=bare"),
        ("f", "turn=0,0"),
        ("0", "turn=28,24"),
    ):
        browser.press(key)
        browser.wait(f"location.hash.includes('{found}')")


def test_table_filters_sorts_and_counts(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", "#")
    browser.wait(f"{shown_names()}.length > 8")
    assert "13 images · 12 done · 1 failed" in browser.evaluate("document.querySelector('#totals').textContent")
    for words, names in (("GRÖßE png", [ODD]), ("empty copy", ["zz.png"]), ("not converged", [HALF])):
        browser.evaluate("document.querySelector('#filter').select()")
        browser.type(words)
        browser.wait(f"JSON.stringify({shown_names()}) === JSON.stringify({names})")
    browser.evaluate("document.querySelector('#filter').select()")
    browser.type("no such image")
    browser.wait(f"{shown_names()}.length === 0")
    browser.click("#nothing button")
    assert len(browser.evaluate(shown_names())) > 8
    browser.click("#states button[value=failed]")
    assert browser.evaluate(shown_names()) == ["zz.png"]
    assert browser.evaluate("document.querySelector('.reason').textContent") == failure("")["error"]["message"]
    browser.click("#states button[value=unfinished]")
    assert browser.evaluate(shown_names()) == [HALF]
    browser.click("#states button[value=all]")
    choose = "select.value = 'size up'; select.dispatchEvent(new Event('change'))"
    browser.evaluate(f"(() => {{ const select = document.querySelector('#order select'); {choose} }})()")
    # The least first; what has no size comes last either way.
    assert browser.evaluate(shown_names())[0] == HALF


def test_ten_thousand_rows(browser: Browser, thousands: Path) -> None:
    browser.visit(thousands / "index.html")
    browser.wait(f"{shown_names()}.length > 5")
    drawn = "document.querySelectorAll('tbody tr').length"
    assert browser.evaluate(drawn) < 40
    whole = browser.evaluate("document.querySelector('#list table').offsetHeight")
    assert whole == 10_000 * 68 + 36
    browser.evaluate("document.querySelector('#list').scrollTop = 68 * 5000")
    browser.wait(f"{shown_names()}.includes('05003.png')")
    assert browser.evaluate(drawn) < 40
    # Sorted by the error, least first and then largest; those that failed have none.
    errors = {number: number * 7919 % 10007 for number in range(10_000) if number % 1000 != 999}
    ascending = [f"{number:05}.png" for number in sorted(errors, key=errors.__getitem__)]
    for expected in (ascending, ascending[::-1]):
        browser.click("th[data-key=error] button")
        assert browser.evaluate(shown_names())[:8] == expected[:8]
    browser.evaluate("document.querySelector('#list').scrollTop = 1e9")
    browser.wait(f"{shown_names()}.includes('09999.png')")
    browser.click("th[data-key=name] button")
    browser.evaluate("document.querySelector('#filter').focus()")
    browser.type("reason 49")
    browser.wait(f"{shown_names()}.length === 1")
    assert browser.evaluate(shown_names()) == ["04999.png"]
    assert browser.evaluate("document.querySelector('#shown').textContent") == "1 of 10,000"


def test_rows_are_walked_by_keys(browser: Browser, thousands: Path) -> None:
    browser.visit(thousands / "index.html")
    browser.wait(f"{shown_names()}.length > 5")
    focused = "document.activeElement.querySelector('td.name')?.title"
    browser.evaluate("document.querySelector('tbody tr[tabindex=\"0\"]').focus()")
    for key, name in (
        ("ArrowDown", "00001.png"),
        ("End", "09999.png"),
        ("ArrowUp", "09998.png"),
        ("Home", "00000.png"),
    ):
        browser.press(key)
        assert browser.evaluate(focused) == name
    browser.press("Enter", "\r")
    assert browser.evaluate("document.querySelector('#panel h2').textContent") == "00000.png"
    browser.press("Escape")
    assert browser.evaluate("document.querySelector('#panel').hidden")
    assert browser.evaluate(focused) == "00000.png"


def test_hostile_names_are_shown_as_they_are(browser: Browser, folder: Path) -> None:
    browser.size(1300, 1400)
    browser.visit(folder / "index.html", "#")
    browser.wait(f"{shown_names()}.length === 13")
    names = [name for name in HOSTILE if "\udcff" not in name]
    assert {*names, ODD, HALF, "zz.png"} <= {*browser.evaluate(shown_names())}
    assert browser.evaluate("document.title") == "Results"
    # All pictures of both images were found, whatever their names.
    pictures = "[...document.querySelectorAll('td.picture img')]"
    browser.wait(f"{pictures}.length === 4 && {pictures}.every((picture) => picture.complete)")
    assert browser.evaluate(f"{pictures}.every((picture) => picture.naturalWidth > 0)")


def test_links_lead_to_the_files(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", view_of(ODD))
    browser.drawn()
    links = browser.evaluate("[...document.querySelectorAll('ul.files a')].map((link) => link.href)")
    assert links == [folder.joinpath(ODD, name).as_uri() for name in record(ODD)["files"]]


def test_nothing_comes_from_a_network(browser: Browser, folder: Path) -> None:
    browser.visit(folder / "index.html", view_of(ODD))
    browser.drawn()
    addresses = [address for address in browser.requested() if address != "about:blank"]
    assert any(address.endswith("relief.js") for address in addresses)
    assert {address.partition(":")[0] for address in addresses} <= {"file", "data"}


def test_relief_that_is_gone_is_said_to_be(browser: Browser, tmp_path: Path) -> None:
    results(tmp_path, "a.png")
    results(tmp_path, "b.png")
    (tmp_path / "a.png" / "relief.js").unlink()
    write_index(tmp_path, [record("a.png"), record("b.png")], title="Gone")
    browser.visit(tmp_path / "index.html", view_of("a.png"))
    browser.drawn()
    assert browser.evaluate("document.querySelector('#message').textContent") == "relief.js cannot be read."
    assert browser.evaluate("!document.querySelector('#relief > img').hidden")
    browser.events.clear()  # which has the browser's own word on the missing file
    browser.click("#next")
    browser.drawn()
    assert worn(stage(browser)).any()


def test_single_image_opens_on_its_relief(browser: Browser, tmp_path: Path) -> None:
    write_preview(tmp_path, surface(dome(*SHAPE)), chequered(*SHAPE), name="")
    files = ["preview.jpg", "relief.js", "depth.npy", "index.html", "report.json"]
    write_index(tmp_path, [record("", path="/data/one.png", files=files)], title="one.png")
    browser.visit(tmp_path / "index.html")
    browser.drawn()
    assert worn(stage(browser)).mean() > 0.15
    assert browser.evaluate("document.querySelector('#list').offsetHeight") == 0
    facts = browser.evaluate("[...document.querySelectorAll('#facts dd')].map((one) => one.textContent)")
    named = browser.evaluate("[...document.querySelectorAll('#facts dt')].map((one) => one.textContent)")
    told = dict(zip(named, facts, strict=True))
    assert told["Outcome"] == "converged"
    assert told["Mean grey error"].endswith(" of 255")
    assert told["Field of view"].endswith("°")
    links = browser.evaluate("[...document.querySelectorAll('ul.files a')].map((link) => link.textContent)")
    assert links == ["depth.npy", "report.json", "preview.jpg", "relief.js", "index.html"]
    first = stage(browser)
    browser.drag(STAGE, 100, 40)
    assert (np.abs(stage(browser) - first).max(axis=-1) > 40).mean() > 0.1


@pytest.mark.parametrize(("path", "shown"), [("/data/one.png", "/data/one.png"), ("one.png", "")])
def test_path_of_a_single_image_is_shown_where_it_says_more(
    path: str, shown: str, browser: Browser, tmp_path: Path
) -> None:
    write_index(tmp_path, [record("", path=path, files=["report.json"])], title="one.png")
    browser.visit(tmp_path / "index.html")
    browser.wait("document.querySelectorAll('#facts dd').length > 3")
    assert browser.evaluate("document.querySelector('#totals').textContent") == shown


@pytest.mark.thorough
def test_nothing_sticks_out_of_a_window(browser: Browser, folder: Path) -> None:
    outside = (
        "[...document.querySelectorAll('button, input, select, canvas, td, h1, h2, dd')]"
        ".filter((one) => one.offsetWidth && !one.closest('#states'))"
        ".filter((one) => one.getBoundingClientRect().right > innerWidth + 1).map((one) => one.outerHTML)"
    )
    browser.visit(folder / "index.html", view_of(ODD))
    browser.drawn()
    for width in (360, 800, 1000, 1900):
        for dark in (False, True):
            browser.size(width, 700, dark=dark)
            browser.frame()
            assert browser.evaluate(outside) == []
            assert worn(stage(browser)).mean() > 0.05
    browser.press("Escape")
    for width in (360, 800, 1000, 1900):
        for dark in (False, True):
            browser.size(width, 700, dark=dark)
            browser.frame()
            assert browser.evaluate(outside) == []
            paper = browser.picture()[2, 2].astype(int).mean()
            assert (paper < 60) == dark
