from __future__ import annotations

import functools
import itertools
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import imageio.v3
import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.transforms import Bbox

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.errors import InputError
from persfs_cl.surface import plots
from persfs_cl.surface.geometry import normals

Draw = Callable[[Path, Array], None]
# Any: the axes and artists found in a figure are narrower than its stubs say.
Drawn = list[Any]

CAMERA = Camera(focal_length=(60.0, 50.0))
NO_SURFACE = (224, 224, 224)

DRAW: dict[str, Draw] = {
    "depth": plots.depth_picture,
    "normals": lambda path, depth: plots.normals_picture(path, normals(depth, CAMERA)),
    "relief": lambda path, depth: plots.relief_picture(path, depth, CAMERA),
    "textured relief": lambda path, depth: plots.relief_picture(path, depth, CAMERA, np.full(depth.shape, 0.4)),
    "comparison": lambda path, depth: plots.comparison_picture(path, depth / 4, depth / 5),
    "confidence": lambda path, depth: plots.confidence_picture(path, depth / 9, {"odd": depth > 2.4}),
}
HISTORY = [2.0, 0.3, 0.02, 0.0]
LONG = "A title that says all that there is to be said of " + 3 * "this long bump and "


def a_bump(shape: tuple[int, int] = (24, 37)) -> Array:
    height, width = shape
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    return np.asarray(3.0 - np.exp(-3 * (x**2 + y**2)))


def a_holed_bump() -> Array:
    depth = a_bump()
    depth[4:9, 5:20] = np.nan
    return depth


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """The figures that were drawn, so that a test can read what they say."""
    figures: Drawn = []
    draw = FigureCanvasAgg.draw

    def remember(canvas: FigureCanvasAgg) -> None:
        figures.append(canvas.figure)
        draw(canvas)  # type: ignore[no-untyped-call]

    monkeypatch.setattr(FigureCanvasAgg, "draw", remember)
    return figures


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], bytes]:
    """The picture of a name, which is drawn once, of a bump with a hole."""

    @functools.cache
    def picture(name: str) -> bytes:
        folder = tmp_path_factory.mktemp("alone")
        DRAW[name](folder / "one.png", a_holed_bump())
        (path,) = folder.iterdir()
        assert path.name == "one.png"
        return path.read_bytes()

    return picture


@pytest.mark.parametrize("name", DRAW)
def test_a_picture_is_one_png_file(name: str, alone: Callable[[str], bytes]) -> None:
    assert alone(name).startswith(b"\x89PNG")
    red, green, blue = np.moveaxis(imageio.v3.imread(alone(name))[..., :3].astype(int), -1, 0)
    assert len(np.unique(red << 16 | green << 8 | blue)) > 100


@pytest.mark.parametrize("name", DRAW)
def test_a_flat_surface_can_be_drawn(name: str, tmp_path: Path) -> None:
    DRAW[name](tmp_path / "picture.png", np.full((4, 6), 2.0))
    assert imageio.v3.imread(tmp_path / "picture.png").size


# The narrow ones also have tests of their colour bars and of their texts.
@pytest.mark.parametrize(
    "shape", [(1, 1), *(pytest.param(narrow, marks=pytest.mark.thorough) for narrow in ((9, 1), (2, 60)))]
)
@pytest.mark.parametrize("name", DRAW)
def test_slender_images_can_be_drawn(name: str, shape: tuple[int, int], tmp_path: Path) -> None:
    depth = np.linspace(1.0, 2.0, shape[0] * shape[1]).reshape(shape)
    DRAW[name](tmp_path / "picture.png", depth)
    assert imageio.v3.imread(tmp_path / "picture.png").size


@pytest.mark.parametrize("name", DRAW)
def test_a_depth_that_is_nan_everywhere_is_refused_and_leaves_no_file(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        DRAW[name](tmp_path / "picture.png", np.full((5, 6), np.nan))
    assert not list(tmp_path.iterdir())


def test_depth_shows_holes_in_light_grey_and_near_in_bright(tmp_path: Path, drawn: Drawn) -> None:
    plots.depth_picture(tmp_path / "holed.png", a_holed_bump(), "A bump", unit="mm")
    plots.depth_picture(tmp_path / "whole.png", a_bump())
    holed, whole = (
        (imageio.v3.imread(tmp_path / f"{name}.png")[..., :3] == NO_SURFACE).all(axis=-1).sum()
        for name in ("holed", "whole")
    )
    image = drawn[0].axes[0].images[0]
    shown = image.get_window_extent()
    assert holed == pytest.approx(shown.width * shown.height * (5 * 15) / (24 * 37), rel=0.1)
    assert whole < holed / 100

    near, far = image.cmap(image.norm(2.0)), image.cmap(image.norm(3.0))
    assert sum(near[:3]) > sum(far[:3])
    axes, bar = drawn[0].axes
    assert axes.get_title() == "A bump"
    assert bar.get_ylabel() == "depth (mm)"
    assert drawn[1].axes[1].get_ylabel() == "depth (units of the known values)"


def test_normals_are_coded_right_up_and_towards_the_camera(tmp_path: Path) -> None:
    right, up, camera, missing = (1, 0, 0), (0, -1, 0), (0, 0, -1), (np.nan,) * 3
    plots.normals_picture(tmp_path / "normals.png", np.array([[right, up], [camera, missing], [right, up]]))
    pixels = imageio.v3.imread(tmp_path / "normals.png")
    assert pixels.shape == (3, 2, 3)
    assert pixels[:2].tolist() == [
        [[255, 128, 128], [128, 255, 128]],
        [[128, 128, 255], [128, 128, 128]],
    ]


def test_normals_that_are_not_vectors_are_refused() -> None:
    with pytest.raises(InputError, match=r"normals has shape \(4, 5\)"):
        plots.normals_rgb(np.zeros((4, 5)))


def test_relief_has_one_scale_on_all_axes_and_the_near_side_up(tmp_path: Path, drawn: Drawn) -> None:
    plots.relief_picture(tmp_path / "relief.png", a_bump(), CAMERA, np.full((24, 37), 0.5))
    assert len(drawn[0].axes) == 2
    for axes in drawn[0].axes:
        (left, right), (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim(), axes.get_zlim()
        assert left < right
        assert low > high
        assert bottom > top
        assert (top, bottom) == pytest.approx((a_bump().min(), a_bump().max()))
        sides = np.array([right - left, low - high, bottom - top])
        np.testing.assert_allclose(axes._box_aspect / sides, (axes._box_aspect / sides)[0])


@pytest.mark.parametrize(("far", "shown"), [(30.0, 3.0), (4.5, 4.5)])
def test_relief_leaves_out_the_few_pixels_that_would_shrink_all_others(
    far: float, shown: float, tmp_path: Path, drawn: Drawn
) -> None:
    depth = 10.0 * (a_bump((40, 40)) - 2.0) + 2.0
    depth *= 3.0 / depth.max()
    depth[2:4, 3:5] = far
    plots.relief_picture(tmp_path / "relief.png", depth, CAMERA)
    assert drawn[0].axes[0].get_zlim()[0] == pytest.approx(shown)
    assert ("4 pixels outside the view" in drawn[0].texts[-1].get_text()) == (far > shown)


def test_relief_shows_all_of_a_small_object_in_a_large_photograph(tmp_path: Path, drawn: Drawn) -> None:
    depth = np.full((1200, 2500), np.nan)
    depth[700:703, 900:904] = np.linspace(2.0, 3.0, 12).reshape(3, 4)
    plots.relief_picture(tmp_path / "relief.png", depth, Camera(2000.0))
    assert drawn[0].axes[0].get_zlim() == pytest.approx((3.0, 2.0), abs=0.2)
    assert "outside" not in drawn[0].texts[-1].get_text()


def test_relief_draws_a_large_photograph_with_few_samples(tmp_path: Path, drawn: Drawn) -> None:
    depth = np.full((500, 900), np.nan)
    depth[100:350, 200:700] = a_bump((250, 500))
    plots.relief_picture(tmp_path / "relief.png", depth, CAMERA)
    (solid,) = drawn[0].axes[0].collections
    assert 80 * 160 < len(solid.get_facecolor()) <= 200 * 200


def test_relief_wears_the_photograph(tmp_path: Path, drawn: Drawn) -> None:
    grey = np.tile(np.linspace(0.0, 1.0, 37), (24, 1))
    plots.relief_picture(tmp_path / "relief.png", np.full((24, 37), 2.0), CAMERA, grey)
    faces = drawn[0].axes[0].collections[0].get_facecolor()
    np.testing.assert_allclose(np.unique(faces[:, 0]), np.unique((grey[0, 1:] + grey[0, :-1]) / 2), atol=1e-12)


def test_relief_refuses_an_image_of_another_size(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"image has shape \(3, 4\)"):
        plots.relief_picture(tmp_path / "relief.png", a_bump(), CAMERA, np.ones((3, 4)))


def test_comparison_reports_errors_in_grey_levels_of_shared_pixels(tmp_path: Path, drawn: Drawn) -> None:
    photo = np.full((4, 8), 1.0)
    rendered = np.full((4, 8), 1.0)
    rendered[:2] = 0.5
    rendered[0, 0] = np.nan
    rendered[3] = -2.0
    photo[3] = 0.0
    plots.comparison_picture(tmp_path / "comparison.png", photo, rendered, white=2.0)
    mean, root_mean_square = 63.75 * 15 / 31, 63.75 * np.sqrt(15 / 31)
    titles = [axes.get_title() for axes in drawn[0].axes]
    assert titles[:2] == ["Photograph", "Re-rendered"]
    assert titles[2].endswith(f"ME {mean:.2f}, RS {root_mean_square:.2f}")
    difference = np.ma.filled(drawn[0].axes[2].images[0].get_array(), np.nan)
    np.testing.assert_allclose(difference[1:3], [[-63.75] * 8, [0.0] * 8])
    assert np.isnan(difference[0, 0])


@pytest.mark.parametrize("shapes", [((3, 4), (4, 3)), ((3,), (3,)), ((3, 4, 3), (3, 4, 3))])
def test_comparison_refuses_images_that_do_not_fit(shapes: tuple[tuple[int, ...], ...], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="shape"):
        plots.comparison_picture(tmp_path / "comparison.png", np.ones(shapes[0]), np.ones(shapes[1]))


@pytest.mark.parametrize("white", [0.0, -1.0, np.inf, np.nan])
def test_comparison_refuses_a_white_that_is_none(white: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="white="):
        plots.comparison_picture(tmp_path / "comparison.png", a_bump(), a_bump(), white=white)


def test_confidence_shows_the_first_of_several_reasons(tmp_path: Path, drawn: Drawn) -> None:
    errors = np.geomspace(0.02, 0.2, 12).reshape(3, 4)
    errors[0, 0] = np.nan
    dark, shiny, never = np.zeros((3, 3, 4), dtype=bool)
    dark[1] = shiny[1:, 2:] = True
    never[1, 0] = True
    unreliable = {"dark": dark, "shiny": shiny, "also dark": never}
    plots.confidence_picture(tmp_path / "confidence.png", errors, unreliable)
    left, right, bar = drawn[0].axes
    assert "θ: angle between normal and light" in bar.get_ylabel()
    np.testing.assert_allclose(np.ma.filled(left.images[0].get_array(), np.nan), 100 * errors)
    assert np.ma.filled(right.images[0].get_array(), -1).tolist() == [[-1, 0, 0, 0], [1, 1, 1, 1], [0, 0, 2, 2]]
    (legend,) = drawn[0].legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["none: 5 px", "dark: 4 px", "shiny: 2 px"]
    colours = right.images[0].cmap(right.images[0].norm([0, 1, 2]))
    assert [patch.get_facecolor() for patch in legend.get_patches()] == [tuple(colour) for colour in colours]


def test_confidence_refuses_maps_that_do_not_fit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unreliable\['dark'\] has shape \(2, 2\)"):
        plots.confidence_picture(tmp_path / "a.png", np.ones((3, 4)), {"dark": np.ones((2, 2), dtype=bool)})
    with pytest.raises(InputError, match=r"slope_error has shape \(3,\)"):
        plots.confidence_picture(tmp_path / "a.png", np.ones(3), {})


@pytest.mark.parametrize("tolerance", [1e-4, 0.0])
def test_convergence_is_logarithmic_and_shows_a_change_of_zero(tolerance: float, tmp_path: Path, drawn: Drawn) -> None:
    plots.convergence_picture(tmp_path / "convergence.png", HISTORY, tolerance)
    axes = drawn[0].axes[0]
    assert axes.get_yscale() == "log"
    curve = axes.lines[0]
    assert curve.get_xdata().tolist() == [1, 2, 3]
    assert curve.get_ydata().tolist() == HISTORY[:3]
    assert axes.lines[-1].get_xdata().tolist() == [4]
    levels = [line.get_ydata()[0] for line in axes.lines if line.get_linestyle() == "--"]
    assert levels == ([tolerance] if tolerance else [])
    assert axes.get_ylim()[0] < min(level for level in (*HISTORY, tolerance) if level > 0)


def test_the_distance_stands_by_the_last_change(tmp_path: Path, drawn: Drawn) -> None:
    plots.convergence_picture(tmp_path / "convergence.png", HISTORY[:3], 1e-3, distance=10.0 * HISTORY[0])
    axes = drawn[0].axes[0]
    diamonds = [line for line in axes.lines if line.get_marker() == "D"]
    assert [(line.get_xdata().tolist(), line.get_ydata().tolist()) for line in diamonds] == [([3], [10.0 * HISTORY[0]])]
    assert axes.get_ylim()[1] > 10.0 * HISTORY[0]


def test_the_start_value_does_not_squeeze_the_curve(tmp_path: Path, drawn: Drawn) -> None:
    plots.convergence_picture(tmp_path / "convergence.png", [3e4, 0.5, 0.01], 1e-3)
    axes = drawn[0].axes[0]
    bottom, top = axes.get_ylim()
    assert 1e-4 < bottom < 1e-3
    assert 0.5 < top < 5
    assert axes.lines[-1].get_xdata().tolist() == [1]
    assert "3e+04" in axes.lines[-1].get_label()
    plots.convergence_picture(tmp_path / "high.png", [3e4], 1e-3)
    assert drawn[1].axes[0].get_ylim()[1] > 3e4


def test_the_axis_of_changes_has_powers_of_ten_at_their_places(tmp_path: Path, drawn: Drawn) -> None:
    plots.convergence_picture(tmp_path / "a.png", HISTORY[:3], 1e-4)
    axes = drawn[0].axes[0]
    low, high = axes.get_ylim()
    plain = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")
    shown = {tick.get_loc(): tick.label1.get_text() for tick in axes.yaxis.get_major_ticks()}
    places = [place for place in shown if low <= place <= high]
    assert places == pytest.approx([1e-4, 1e-3, 1e-2, 1e-1, 1.0])
    assert [float(f"1e{shown[place][2:].translate(plain)}") for place in places] == pytest.approx(places)


def test_the_axis_of_changes_has_numbers_where_it_spans_no_power_of_ten(tmp_path: Path, drawn: Drawn) -> None:
    plots.convergence_picture(tmp_path / "a.png", [3.2], 3.0)
    axes = drawn[0].axes[0]
    low, high = axes.get_ylim()
    ticks = [*axes.yaxis.get_major_ticks(), *axes.yaxis.get_minor_ticks()]
    assert 1.0 <= low < high <= 10.0
    assert any(tick.label1.get_text() for tick in ticks if low <= tick.get_loc() <= high)


@pytest.mark.parametrize("shape", [(1, 60), (60, 1), (2, 500)])
def test_the_colour_bar_of_a_slender_image_can_be_read(shape: tuple[int, int], tmp_path: Path, drawn: Drawn) -> None:
    plots.depth_picture(tmp_path / "a.png", np.linspace(1.0, 2.0, shape[0] * shape[1]).reshape(shape))
    bar = drawn[0].axes[1]
    box = bar.get_window_extent()
    assert min(box.width, box.height) > 15
    labels = [*bar.get_xticklabels(), *bar.get_yticklabels()]
    boxes = [label.get_window_extent() for label in labels if label.get_text()]
    assert len(boxes) > 2
    assert not any(one.overlaps(other) for one, other in itertools.pairwise(boxes))


@pytest.mark.parametrize(
    ("shape", "title"),
    [
        ((3, 300), LONG),
        ((90, 20), LONG),
        *(pytest.param(shape, "Bump", marks=pytest.mark.thorough) for shape in ((24, 37), (300, 3))),
    ],
)
def test_texts_neither_overlap_nor_leave_the_picture(
    shape: tuple[int, int], title: str, tmp_path: Path, drawn: Drawn
) -> None:
    depth = np.linspace(1e5, 2e5, shape[0] * shape[1]).reshape(shape)
    reasons = dict.fromkeys(("saturated", "darker than the ambient light"), depth > 1.2e5)
    plots.depth_picture(tmp_path / "a.png", depth, title, unit="thousandths of a nautical mile")
    plots.comparison_picture(tmp_path / "b.png", depth / 3e5, depth / 2e5, title, photo_title="Prepared photograph")
    plots.confidence_picture(tmp_path / "c.png", depth / 1e6, reasons, title)
    plots.convergence_picture(tmp_path / "d.png", HISTORY, 1e-4, title)
    for figure in drawn:
        boxes = [part.get_tightbbox() for part in (*figure.legends, *figure.texts)]
        for axes in figure.axes:
            own = axes.get_window_extent(), axes.yaxis.get_tightbbox()
            boxes.append(Bbox.union([box for box in own if box is not None]))
            beside = axes.title, axes.xaxis.label
            boxes += [text.get_window_extent() for text in beside if text.get_text()]
        for box in boxes:
            assert figure.bbox.x0 < box.x0 < box.x1 < figure.bbox.x1
            assert figure.bbox.y0 < box.y0 < box.y1 < figure.bbox.y1
        assert not any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def test_comparison_names_a_prepared_photograph(tmp_path: Path, drawn: Drawn) -> None:
    plots.comparison_picture(tmp_path / "a.png", a_bump() / 4, a_bump() / 5, photo_title="Prepared photograph")
    assert drawn[0].axes[0].get_title() == "Prepared photograph"
    assert "prepared photograph" in drawn[0].axes[3].get_ylabel()


def test_convergence_can_be_drawn_when_nothing_ever_changed(tmp_path: Path) -> None:
    plots.convergence_picture(tmp_path / "convergence.png", [0.0], 0.0)
    assert imageio.v3.imread(tmp_path / "convergence.png").size


@pytest.mark.parametrize("changes", [[], [1.0, -1.0], [np.nan], [np.inf], [[1.0]]])
def test_convergence_refuses_what_is_no_history(changes: list[Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="changes="):
        plots.convergence_picture(tmp_path / "convergence.png", changes, 1e-4)


@pytest.mark.parametrize("tolerance", [-1.0, np.nan, np.inf])
def test_convergence_refuses_an_impossible_tolerance(tolerance: float, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="tolerance="):
        plots.convergence_picture(tmp_path / "convergence.png", HISTORY, tolerance)


def test_pictures_drawn_again_and_in_threads_are_the_same(alone: Callable[[str], bytes], tmp_path: Path) -> None:
    with ThreadPoolExecutor(len(DRAW)) as pool:
        started = [pool.submit(draw, tmp_path / f"{name}.png", a_holed_bump()) for name, draw in DRAW.items()]
        for drawing in started:
            drawing.result()
    for name in DRAW:
        assert (tmp_path / f"{name}.png").read_bytes() == alone(name)


def test_large_maps_are_drawn_from_means_of_blocks_at_their_places(tmp_path: Path, drawn: Drawn) -> None:
    depth = np.full((3, 2 * 1000 + 501), 2.0)
    depth[:, 1::2] = 3.0
    depth[0] = np.nan
    depth[2, :2] = np.nan
    plots.depth_picture(tmp_path / "depth.png", depth)
    axes = drawn[0].axes[0]
    shown = np.ma.filled(axes.images[0].get_array(), np.nan)
    assert shown.shape == (3, 1251)
    np.testing.assert_array_equal(shown[1], [*[2.5] * 1250, 2.0])  # the last block is one pixel
    assert np.isnan(shown[0]).all()
    assert np.isnan(shown[2, 0])
    assert shown[2, 1] == 2.5
    assert (axes.get_xlim(), axes.get_ylim()) == ((-0.5, 2500.5), (2.5, -0.5))
    assert tuple(axes.images[0].get_extent()) == (-0.5, 2501.5, 2.5, -0.5)
    assert axes.images[0].get_clim() == (2.0, 3.0)  # of all pixels


def test_the_smallest_doubt_is_seen_in_a_large_map(tmp_path: Path, drawn: Drawn) -> None:
    errors = np.full((2, 4000), 0.1)
    errors[:, 2000:] = np.nan
    first, second = np.zeros((2, *errors.shape), dtype=bool)
    second[0, 40:44] = first[1, 43] = second[1, 99] = True
    plots.confidence_picture(tmp_path / "confidence.png", errors, {"first": first, "second": second})
    classes = np.ma.filled(drawn[0].axes[1].images[0].get_array(), -1)
    expected = np.repeat([[0, -1]], 500, axis=1).repeat(2, axis=0)
    expected[0, 10], expected[1, 10], expected[1, 24] = 2, 1, 2
    np.testing.assert_array_equal(classes, expected)
    assert "first: 1 px" in [text.get_text() for text in drawn[0].legends[0].get_texts()]


def test_relief_takes_the_white_of_its_photograph(tmp_path: Path) -> None:
    depth, photo = a_holed_bump(), np.tile(np.linspace(0.0, 1.0, 37), (24, 1))
    plots.relief_picture(tmp_path / "one.png", depth, CAMERA, photo)
    plots.relief_picture(tmp_path / "two.png", depth, CAMERA, 8.0 * photo, white=8.0)
    assert (tmp_path / "one.png").read_bytes() == (tmp_path / "two.png").read_bytes()


def test_settings_of_the_user_play_no_part_nor_pyplot_nor_a_backend(tmp_path: Path) -> None:
    depth = np.linspace(1.0, 2.0, 30).reshape(5, 6)
    plots.depth_picture(tmp_path / "plain.png", depth)
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nno line\naxes.grid: maybe\nfont.size: 30\n")
    program = (
        "import sys\nimport numpy\nfrom persfs_cl import camera\nfrom persfs_cl.surface import geometry, plots\n"
        "assert not {'matplotlib', 'trimesh', 'imageio'} & sys.modules.keys()\n"
        "depth = numpy.linspace(1.0, 2.0, 30).reshape(5, 6)\n"
        "plots.confidence_picture('confidence.png', depth, {})\n"
        "plots.depth_picture('own.png', depth)\n"
        "plots.relief_picture('relief.png', depth, camera.Camera(9.0))\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    environment = os.environ | {
        "MPLBACKEND": "nonsense",
        "PYTHONPATH": os.pathsep.join([str(Path(plots.__file__).parents[3]), os.environ.get("PYTHONPATH", "")]),
    }
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "own.png").read_bytes() == (tmp_path / "plain.png").read_bytes()


def test_settings_of_the_process_stay_as_they_were(tmp_path: Path) -> None:
    depth = np.linspace(1.0, 2.0, 30).reshape(5, 6)
    plots.depth_picture(tmp_path / "plain.png", depth)
    with mpl.rc_context({"font.size": 30.0, "text.usetex": True, "figure.facecolor": "red"}):
        before = {name: value for name, value in mpl.rcParams.items() if name != "backend"}
        plots.depth_picture(tmp_path / "own.png", depth)
        assert {name: mpl.rcParams[name] for name in before} == before
    assert (tmp_path / "own.png").read_bytes() == (tmp_path / "plain.png").read_bytes()
