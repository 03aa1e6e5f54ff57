from __future__ import annotations

import base64
import time
from pathlib import Path

import numpy as np
import pytest
from made import chequered, decoded, dome, handed_over, opened, surface

from persfs_cl import Camera
from persfs_cl.arrays import Array, Indices, Mask
from persfs_cl.errors import InputError
from persfs_cl.surface import geometry
from persfs_cl.surface.geometry import Discontinuities
from persfs_cl.surface.views.heights import heights_script
from persfs_cl.surface.views.preview import write_preview
from persfs_cl.surface.views.reduced import Samples
from persfs_cl.surface.views.shaded import shaded

NAMES = ["preview.jpg", "photo.jpg", "relief.js"]


def with_holes(depth: Array) -> Array:
    depth = depth.copy()
    depth[: len(depth) // 4, : depth.shape[1] // 3] = np.nan
    depth[-1, -1] = np.nan
    return depth


def test_files_and_sizes(tmp_path: Path) -> None:
    depth = with_holes(dome(900, 1300))
    assert write_preview(tmp_path, surface(depth), chequered(900, 1300), name="a") == NAMES
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(NAMES)
    assert opened(tmp_path / "preview.jpg").shape == (222, 320, 3)
    assert opened(tmp_path / "photo.jpg").shape == (300, 434, 3)
    assert handed_over(tmp_path / "relief.js")["grid"] == [177, 256]


def test_depth_comes_back_within_quantisation() -> None:
    depth = with_holes(dome(500, 700))
    found = surface(depth, Camera((650.0, 640.0), (300.0, 240.0)))
    values = handed_over(heights_script(found, "name", b"photo"))
    assert values["size"] == [500, 700]
    assert values["focal_length"] == [650.0, 640.0]
    assert values["principal_point"] == [300.0, 240.0]
    # As the page places samples: sample i of n is pixel floor((i + 1/2) N / n).
    rows, columns = (np.floor((np.arange(n) + 0.5) * size / n).astype(int) for n, size in ((183, 500), (256, 700)))
    assert values["grid"] == [183, 256]
    expected = depth[np.ix_(rows, columns)]
    there = decoded(values)
    np.testing.assert_array_equal(np.isnan(there), np.isnan(expected))
    assert np.nanmin(there) == pytest.approx(np.nanmin(expected), rel=1e-12)
    half_a_level = np.ptp(expected[np.isfinite(expected)]) / 65534 / 2
    assert np.nanmax(np.abs(there - expected)) <= half_a_level * (1 + 1e-9)


def test_small_image_is_handed_over_whole() -> None:
    depth = with_holes(dome(20, 33))
    values = handed_over(heights_script(surface(depth), "name", b""))
    assert values["grid"] == values["size"] == [20, 33]
    np.testing.assert_allclose(decoded(values), depth, atol=1e-5)
    assert values["right"] is None
    assert values["down"] is None


def test_interruptions_are_those_between_the_samples() -> None:
    height, width = 520, 640
    depth = dome(height, width)
    depth[300, 100:200] = np.nan  # a line that few samples see
    generator = np.random.default_rng(3)
    cuts = Discontinuities(generator.random((height, width - 1)) < 0.01, generator.random((height - 1, width)) < 0.01)
    samples = Samples.of((height, width), 100)
    right, down = samples.joined(np.isfinite(depth), cuts)

    def goes_on(row: int, column: int, to_row: int, to_column: int) -> bool:
        way = np.isfinite(depth[row : to_row + 1, column : to_column + 1]).all()
        cut = cuts.right[row, column:to_column].any() or cuts.down[row:to_row, column].any()
        return bool(way and not cut)

    expected_right = [[goes_on(r, c, r, d) for c, d in _pairs(samples.columns)] for r in samples.rows]
    expected_down = [[goes_on(r, c, s, c) for c in samples.columns] for r, s in _pairs(samples.rows)]
    np.testing.assert_array_equal(right, expected_right)
    np.testing.assert_array_equal(down, expected_down)
    assert 0.5 < right.mean() < 0.99
    values = handed_over(heights_script(surface(depth, discontinuities=cuts), "name", b""))
    rows, columns = values["grid"]
    right, down = Samples.of((height, width), 256).joined(np.isfinite(depth), cuts)
    np.testing.assert_array_equal(_bits(values["right"], (rows, columns - 1)), right)
    np.testing.assert_array_equal(_bits(values["down"], (rows - 1, columns)), down)


def _pairs(places: Indices) -> list[tuple[int, int]]:
    return list(zip(places[:-1].tolist(), places[1:].tolist(), strict=True))


def _bits(text: str, shape: tuple[int, int]) -> Mask:
    bits = np.unpackbits(np.frombuffer(base64.b64decode(text), np.uint8), count=shape[0] * shape[1])
    return bits.reshape(shape).astype(bool)


def test_shading_is_that_of_the_normals() -> None:
    depth = with_holes(dome(60, 80))
    found = surface(depth, Camera((70.0, 80.0)))
    picture = shaded(found, Samples.of((60, 80), 320)).astype(float)
    normals = geometry.normals(depth, found.camera)
    lamp = np.array([-0.55, -0.60, -0.58])
    expected = 238 * (0.12 + 0.88 * (0.5 + 0.5 * normals @ lamp) ** 1.5)
    solved = np.isfinite(depth)
    # At a rim the slope on a few pixels is one of both sides, and the picture takes whole levels.
    assert np.abs(picture[..., 0] - expected)[solved].max() <= 1.01
    assert np.unique(picture[~solved], axis=0).tolist() == [[118, 122, 128]]


def test_shading_shows_which_side_faces_the_lamp() -> None:
    picture = shaded(surface(dome(600, 600)), Samples.of((600, 600), 100)).mean(axis=2)
    upper_left, lower_right = picture[28:36, 28:36].mean(), picture[64:72, 64:72].mean()
    assert upper_left > 1.5 * lower_right


@pytest.mark.parametrize("shape", [(1, 1), (1, 2000), (2000, 1), (2, 3), (257, 255)])
@pytest.mark.parametrize("missing", ["none", "some", "all"])
def test_odd_shapes_and_holes(shape: tuple[int, int], missing: str, tmp_path: Path) -> None:
    depth = np.linspace(2, 3, shape[0] * shape[1]).reshape(shape)
    if missing == "some":
        depth.flat[::2] = np.nan
    elif missing == "all":
        depth[:] = np.nan
    for colour in (None, chequered(*shape)):
        assert write_preview(tmp_path, surface(depth), colour, name="") == NAMES
    values = handed_over(tmp_path / "relief.js")
    assert (values["depth"] is None) == (not np.isfinite(decoded(values)).any())
    for name, longest in zip(NAMES, (320, 640), strict=False):
        sides = opened(tmp_path / name).shape[:2]
        assert all(1 <= side <= min(whole, longest) for side, whole in zip(sides, shape, strict=True))
    assert values["photo"].startswith("data:image/jpeg;base64,")


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_depths_in_any_unit_look_the_same(scale: float) -> None:
    samples = Samples.of((50, 50), 320)
    one, other = (shaded(surface(scale_of_it * dome(50, 50)), samples) for scale_of_it in (1.0, scale))
    assert np.abs(one.astype(int) - other).max() <= 1
    assert handed_over(heights_script(surface(scale * dome(50, 50)), "", b""))["depth"][1] == scale


def test_flat_surface_has_one_level() -> None:
    values = handed_over(heights_script(surface(np.full((9, 9), 5.0)), "", b""))
    assert values["depth"] == [5.0, 5.0]
    assert np.unique(decoded(values)).tolist() == [5.0]


def test_photograph_is_the_one_given_and_the_one_that_the_relief_wears(tmp_path: Path) -> None:
    write_preview(tmp_path, surface(dome(400, 560)), chequered(400, 560), name="a")
    shown = opened(tmp_path / "photo.jpg").astype(int)
    assert np.median(np.abs(shown - chequered(400, 560))) <= 8
    worn = handed_over(tmp_path / "relief.js")["photo"].partition(",")[2]
    assert base64.b64decode(worn) == (tmp_path / "photo.jpg").read_bytes()


def test_without_a_photograph_what_was_solved_is_shown(tmp_path: Path) -> None:
    write_preview(tmp_path, surface(dome(40, 40)), name="a")
    grey = opened(tmp_path / "photo.jpg")
    # The flat image is the brightest that there is.
    assert grey.min() >= 253


def test_hostile_name_stays_in_its_text() -> None:
    name = "'); alert(1) //\u2028\n\"</script>\udcff"
    script = heights_script(surface(dome(5, 5)), name, b"")
    assert script.isascii()
    assert handed_over(script)["name"] == name


def test_folder_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone.preview\.jpg cannot be written"):
        write_preview(tmp_path / "gone", surface(dome(9, 9)), name="a")


def test_takes_some_hundredths_of_a_second(tmp_path: Path) -> None:
    found, photo = surface(dome(1000, 1000)), chequered(1000, 1000)
    write_preview(tmp_path, found, photo, name="a")
    spent = []
    for _ in range(5):
        start = time.process_time()
        write_preview(tmp_path, found, photo, name="a")
        spent.append(time.process_time() - start)
    # 0.02 on a processor of 2021; Matplotlib's pictures take a hundred times as long.
    assert min(spent) < 1.0
