"""Only the part of an image that its solution depends on is solved, and nobody can tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import persfs_cl as ps
from persfs_cl._cl.sweeper import Sweeper
from persfs_cl.arrays import Mask
from persfs_cl.masks import NONE
from persfs_cl.solver import reconstruct as entry
from persfs_cl.solver.complete import complete
from persfs_cl.solver.given import check
from persfs_cl.solver.window import Window

# The images are no photographs of surfaces, and nothing is asked of these.
pytestmark = pytest.mark.filterwarnings("ignore::persfs_cl.errors.PersfsWarning")

SHAPE = (90, 113)
PARALLEL, OBLIQUE, FLASH = ps.ParallelLight(), ps.ParallelLight(0.2, -0.1), ps.FlashLight()
OFF_AXIS = ps.FlashLight(offset=(0.05, 0.02, 0.0))
CAMERA = ps.Camera(150.0)


def disc(row: int, column: int, radius: int) -> Mask:
    rows, columns = np.ogrid[: SHAPE[0], : SHAPE[1]]
    return np.asarray((rows - row) ** 2 + (columns - column) ** 2 <= radius**2)


MASKS = {
    "corner": disc(0, 0, 22),
    "right edge": disc(41, SHAPE[1] - 1, 20),
    "bottom edge": disc(SHAPE[0] - 1, 37, 19),
    "odd": disc(45, 52, 17) & ~disc(45, 50, 2),
    "odd by one": disc(46, 52, 17),
    "far apart": disc(15, 14, 11) | disc(73, 96, 12),
    "in line": disc(30, 14, 11) | disc(32, 96, 9),
}
each_mask = pytest.mark.parametrize("mask", MASKS.values(), ids=list(MASKS))


def image() -> np.ndarray[Any, np.dtype[np.float64]]:
    random = np.random.default_rng(4)
    rows, columns = np.ogrid[: SHAPE[0], : SHAPE[1]]
    smooth = 0.7 + 0.2 * np.sin(0.11 * rows) * np.cos(0.07 * columns)
    return np.asarray(smooth + random.uniform(-0.02, 0.02, SHAPE))


def depths() -> np.ndarray[Any, np.dtype[np.float64]]:
    rows, columns = np.ogrid[: SHAPE[0], : SHAPE[1]]
    return np.asarray(1.0 + 0.05 * np.sin(0.05 * rows + 0.08 * columns))


def walls() -> Mask:
    found = np.zeros(SHAPE, bool)
    found[35:60, 50:52] = found[66:80, 95] = found[10:14, 5:20] = True
    return found


def assert_the_same(call: Callable[[], ps.Solution], monkeypatch: pytest.MonkeyPatch) -> None:
    """By the part that is needed and by the whole image, of which the part must not be all."""
    sizes = []

    def noted(*given: Any, **keywords: Any) -> Any:
        found = check(*given, **keywords)
        sizes.append(found.window.shape[0] * found.window.shape[1])
        return found

    with monkeypatch.context() as patch:
        patch.setattr(entry, "check", noted)
        by_part = call()
        patch.setattr(entry, "check", lambda *given, **keywords: check(*given, **{**keywords, "whole": True}))
        by_whole = call()
    assert sizes[0] < by_part.depth.size
    arrays = ("depth", "log_depth", "solved", "unreached", "clamped", "at_bound", "image", "changes", "albedo", "walls")
    for name in arrays:
        np.testing.assert_array_equal(getattr(by_part, name), getattr(by_whole, name), err_msg=name)
    assert by_part.status is by_whole.status
    assert by_part.solved.any()
    if by_whole.discontinuities is not None:
        assert by_part.discontinuities is not None
        np.testing.assert_array_equal(by_part.discontinuities.right, by_whole.discontinuities.right)
        np.testing.assert_array_equal(by_part.discontinuities.down, by_whole.discontinuities.down)
    np.testing.assert_array_equal(by_part.confidence().slope_error, by_whole.confidence().slope_error)
    reports = [solution.report() for solution in (by_part, by_whole)]
    for report in reports:
        # What is chosen for the size gives the same bits.
        del report["parameters"]["sweep"], report["seconds"]
    assert reports[0] == reports[1]


ORDERINGS = ["wavefront", "checkerboard", "lexicographic"]
SCHEMES: dict[str, dict[str, Any]] = {
    "lax-friedrichs": {"scheme": "lax-friedrichs", "max_iterations": 25},
    "upwind": {"scheme": "upwind", "light": FLASH},
    "second order": {"scheme": "upwind", "light": FLASH, "accuracy_order": 2},
}


def in_turn(parameters: Mapping[str, Any]) -> bool:
    """Whether a test of these parameters is a quick one: of each mask, scheme and ordering each two meet."""
    places = [
        list(MASKS).index(parameters["name"]),
        list(SCHEMES).index(parameters["scheme"]),
        ORDERINGS.index(parameters["ordering"]),
    ]
    return sum(places) % 3 == 0


@pytest.mark.quick_where(holds=in_turn)
@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", MASKS)
def test_the_bits_are_those_of_the_whole_image(
    name: str, scheme: str, ordering: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    keywords = {"mask": MASKS[name], "ordering": ordering, **SCHEMES[scheme]}
    assert_the_same(lambda: ps.reconstruct(image(), CAMERA, **keywords), monkeypatch)


@pytest.mark.parametrize("boundary", ["outflow", "extrapolate", "wall"])
@pytest.mark.parametrize("given", ["everywhere", "here and there", "along lines"])
@pytest.mark.parametrize("mask", [MASKS["odd"], MASKS["far apart"]], ids=["odd", "far apart"])
def test_known_depths_outside_the_mask_are_kept(
    mask: Mask, given: str, boundary: ps.choices.Boundary, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = np.where(mask, np.nan, depths())
    if given == "here and there":
        known[1::2] = known[:, ::3] = np.nan
    if given == "along lines":
        # What comes back into the mask by a way outside it.
        known[:, :60] = np.where(np.arange(60) % 7 == 0, known[:, :60], np.nan)
        known[1:, 60:] = np.where(np.arange(SHAPE[1] - 60) % 5 == 0, depths()[1:, 60:], np.nan)
    keywords: dict[str, Any] = {"known_depth": known, "scheme": "lax-friedrichs", "boundary": boundary}
    assert_the_same(lambda: ps.reconstruct(image(), CAMERA, mask=mask, max_iterations=20, **keywords), monkeypatch)


@each_mask
def test_walls_are_filled_as_in_the_whole_image(mask: Mask, monkeypatch: pytest.MonkeyPatch) -> None:
    keywords: dict[str, Any] = {"mask": mask, "walls": walls(), "light": FLASH}
    assert_the_same(lambda: ps.reconstruct(image(), CAMERA, **keywords), monkeypatch)
    shares = np.random.default_rng(2).uniform(0.5, 1.0, SHAPE)
    assert_the_same(lambda: ps.reconstruct(image() * shares, CAMERA, albedo=shares, **keywords), monkeypatch)


@pytest.mark.parametrize(
    "keywords",
    [
        {"light": FLASH, "walls": walls()},
        {"light": OFF_AXIS, "scheme": "lax-friedrichs", "max_iterations": 40},
        {"light": OBLIQUE, "surface": "away"},
        {"light": OBLIQUE, "surface": "toward", "scheme": "lax-friedrichs", "max_iterations": 25},
    ],
    ids=["walls", "rounds", "away", "toward"],
)
@pytest.mark.parametrize("mask", [MASKS["odd"], MASKS["far apart"]], ids=["odd", "far apart"])
def test_bounds_of_the_depth_are_those_of_the_pixels(
    mask: Mask, keywords: Mapping[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    random = np.random.default_rng(6)
    near, far = 0.97 * depths(), 1.02 * depths()
    for bound in (near, far):
        bound[random.uniform(size=SHAPE) < 0.4] = np.nan
    fixed = random.uniform(size=SHAPE) < 0.02
    if keywords["light"] is not OBLIQUE:
        # Walls and rounds look at all that is known.
        fixed &= mask
    far[fixed] = near[fixed]

    def call() -> ps.Solution:
        return ps.reconstruct(image(), CAMERA, mask=mask, depth_range=(near, far), **keywords)

    assert_the_same(call, monkeypatch)
    at_bound = call().at_bound
    assert at_bound[fixed & ~np.isnan(near) & ~walls()].all()
    assert (at_bound & mask & ~fixed).any()


@pytest.mark.parametrize("scheme", ["lax-friedrichs", "upwind"])
@each_mask
def test_a_lamp_off_the_axis_takes_the_same_rounds(mask: Mask, scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    keywords: dict[str, Any] = {"mask": mask, "light": OFF_AXIS, "scheme": scheme, "max_iterations": 40}
    assert_the_same(lambda: ps.reconstruct(image(), CAMERA, **keywords), monkeypatch)


@pytest.mark.parametrize("reflectance", [ps.OrenNayar(0.3), ps.Phong()], ids=["Oren-Nayar", "Phong"])
def test_bounds_over_all_rays_stay_those_of_the_image(
    reflectance: ps.OrenNayar | ps.Phong, monkeypatch: pytest.MonkeyPatch
) -> None:
    keywords: dict[str, Any] = {"mask": MASKS["right edge"], "reflectance": reflectance, "light": OBLIQUE}
    assert_the_same(lambda: ps.reconstruct(0.7 * image(), CAMERA, max_iterations=20, **keywords), monkeypatch)


def test_what_is_around_may_hold_anything(monkeypatch: pytest.MonkeyPatch) -> None:
    odd = np.where(MASKS["odd"], image(), np.inf)
    odd[3, 4] = np.nan
    assert_the_same(lambda: ps.reconstruct(odd, CAMERA, mask=MASKS["odd"], light=FLASH), monkeypatch)


def test_a_run_that_is_ended_early_forgets_what_was_not_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    known = np.full(SHAPE, np.nan)
    known[45, 36], known[2, 2] = 1.0, 1.0
    keywords: dict[str, Any] = {"known_depth": known, "scheme": "upwind", "ordering": "checkerboard"}
    keywords |= {"mask": MASKS["odd"], "max_iterations": 1}
    solution = ps.reconstruct(image(), CAMERA, **keywords)
    assert solution.unreached.any()
    assert solution.solved[2, 2]
    assert_the_same(lambda: ps.reconstruct(image(), CAMERA, **keywords), monkeypatch)


@pytest.mark.parametrize("ordering", ["wavefront", "checkerboard"])
def test_images_of_about_one_size_share_launches_and_have_the_bits_of_one_by_one(
    ordering: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    masks = [MASKS["odd"], MASKS["far apart"], None, disc(40, 61, 16), MASKS["right edge"]]
    counts = []

    class Counted(Sweeper):
        def __init__(self, *given: Any, **keywords: Any) -> None:
            super().__init__(*given, **keywords)
            counts.append(self.count)

    images = [image() * share for share in (1.0, 0.9, 0.8, 1.05, 0.95)]
    monkeypatch.setattr("persfs_cl.solver.iterate.Sweeper", Counted)
    keywords: dict[str, Any] = {"light": FLASH, "ordering": ordering}
    together = ps.reconstruct_batch(images, CAMERA, mask=masks, **keywords)
    assert sum(counts) == len(images)
    assert max(counts) > 1
    for one, mask, solution in zip(images, masks, together, strict=True):
        alone = ps.reconstruct(one, CAMERA, mask=mask, **keywords)
        np.testing.assert_array_equal(solution.depth, alone.depth)
        np.testing.assert_array_equal(solution.changes, alone.changes)


def test_the_kernels_see_little_more_than_what_is_to_be_solved() -> None:
    mask = np.zeros((400, 600), bool)
    mask[101:151, 301:361] = mask[320:351, 20:61] = True
    options = complete({"light": FLASH})
    window = check(np.ones(mask.shape) * 0.5, CAMERA, mask, None, None, options=options, whole=False).window
    rows, columns = window.shape
    assert 50 + 31 < rows <= 50 + 31 + 4 * 2 + 2 * 5
    assert 60 + 41 < columns <= 60 + 41 + 4 * 2 + 2 * 5
    assert window.cut(mask).sum() == mask.sum()


def test_a_window_cuts_and_puts_back() -> None:
    mask = np.zeros((60, 80), bool)
    mask[2:5, 70:75] = mask[50:53, 9] = True
    window = Window.around(mask, 2)
    assert [len(stretches) for stretches in (window.rows, window.columns)] == [2, 2]
    for stretches in (window.rows, window.columns):
        before = 0
        for stretch in stretches:
            assert (stretch.start - before) % 6 == 0, "the colours of pixels stay"
            before = stretch.stop
    numbers = np.arange(mask.size, dtype=np.int32).reshape(mask.shape)
    part = window.cut(numbers)
    assert part.shape == window.shape
    back = window.spread(part, NONE)
    kept = back != NONE
    np.testing.assert_array_equal(back[kept], numbers[kept])
    assert kept[mask].all()
    np.testing.assert_array_equal(window.pixels(part), np.arange(part.size).reshape(part.shape))
    assert window.pixels(np.array([NONE], np.int32)) == NONE
    grid, of_part = CAMERA.grid(mask.shape), window.grid(CAMERA.grid(mask.shape))
    np.testing.assert_array_equal(of_part.x + of_part.y, window.cut(grid.x + grid.y))


def test_where_little_is_left_out_a_window_is_the_image() -> None:
    mask = np.ones((60, 80), bool)
    mask[:, -9:] = False
    window = Window.around(mask, 2)
    assert window.is_whole
    assert window.cut(mask).base is mask
    assert window.spread(mask, 0.0) is mask
