"""``persfs-cl compare``: maps, images and points."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import tifffile
from command import FOCAL, SCENE, run
from PIL import Image

import persfs_cl as ps
from persfs_cl import colour
from persfs_cl.io.export import write_depth
from persfs_cl.io.points import compare_points


@pytest.mark.parametrize("align", ["none", "scale", "range"])
def test_compare_depth_maps(align: str, tmp_path: Path) -> None:
    first, second = 2.5 * SCENE.depth + 0.1, SCENE.depth
    mask = SCENE.depth > 1.05
    write_depth(tmp_path / "a.npy", first)
    write_depth(tmp_path / "b.npy", second)
    np.save(tmp_path / "mask.npy", mask)
    files = (tmp_path / "a.npy", tmp_path / "b.npy", "--mask", tmp_path / "mask.npy")
    expected = ps.compare(first, second, mask=mask, align=None if align == "none" else align)  # type: ignore[arg-type]

    outcome = run("compare", *files, "--align", align, "--json")
    assert (outcome.status, outcome.stderr) == (0, "")
    result = json.loads(outcome.stdout)
    assert result.pop("unit") == ("share of the range" if align == "range" else "unit of the depth")
    assert result == vars(expected)

    rows = dict(line.split(maxsplit=1) for line in run("compare", *files, "--align", align).stdout.splitlines())
    assert float(rows["ME"]) == pytest.approx(expected.mean, rel=1e-5)
    assert float(rows["RS"]) == pytest.approx(expected.root_mean_square, rel=1e-5)
    assert float(rows["maximum"]) == pytest.approx(expected.maximum, rel=1e-5)
    assert float(rows["median"]) == pytest.approx(expected.median, rel=1e-5)
    assert int(rows["pixels"]) == mask.sum()


def test_compare_images_in_grey_levels(tmp_path: Path) -> None:
    first = np.array([[10, 20, 30], [40, 50, 60]], dtype=np.uint8)
    second = np.array([[10, 21, 33], [40, 50, 0]], dtype=np.uint8)
    opaque = np.array([[255, 255, 255], [255, 255, 0]], dtype=np.uint8)
    Image.fromarray(first).save(tmp_path / "a.png")
    Image.fromarray(np.stack([second, opaque], axis=-1)).save(tmp_path / "b.png")
    tifffile.imwrite(tmp_path / "a.tiff", first)
    for name, options in (("a.png", ()), ("a.tiff", ()), ("a.tiff", ("--kind=image",))):
        files = (tmp_path / name, tmp_path / "b.png")
        result = json.loads(run("compare", *files, "--encoding=linear", "--json", *options).stdout)
        assert result["mean"] == pytest.approx(4 / 5)
        assert result["root_mean_square"] == pytest.approx(np.sqrt(10 / 5))
        assert (result["count"], result["unit"]) == (5, "grey levels")
    decoded = 255 * (colour.decode_srgb(33 / 255) - colour.decode_srgb(30 / 255))
    result = json.loads(run("compare", tmp_path / "a.png", tmp_path / "b.png", "--json").stdout)
    assert result["maximum"] == pytest.approx(decoded)


def test_compare_refuses(photo: Path, tmp_path: Path) -> None:
    one, other, nan = tmp_path / "one.npy", tmp_path / "other.npy", tmp_path / "nan.npy"
    np.save(one, np.ones((3, 4)))
    np.save(other, np.ones((4, 3)))
    np.save(nan, np.full((3, 4), np.nan))
    points, bad = tmp_path / "points.csv", tmp_path / "bad.json"
    points.write_text("1,2,3\n")
    headed = tmp_path / "headed.csv"
    headed.write_text("crop_column,y,z\n1,2,3\n")
    bad.write_text('[{"x": 1}]')
    cases: list[tuple[Sequence[str | Path], int, Sequence[str]]] = [
        ((one, other), 1, (str(one), str(other), "(3, 4)", "(4, 3)")),
        ((one, nan), 1, (str(one), str(nan), "can be compared")),
        ((one, one, "--align=range"), 1, ("range",)),
        ((one, photo), 1, (str(one),)),
        ((one, one, "--mask", photo), 1, (str(photo), "(3, 4)")),
        ((one, tmp_path / "missing.npy"), 1, ("missing.npy",)),
        ((one, points, "--align=range"), 2, ("none or scale",)),
        ((one, points, "--photo", photo), 1, (str(photo), "(3, 4)")),
        ((one, points, "--mask", photo), 1, (str(photo), "(3, 4)")),
        ((nan, points), 1, (str(points), "no depth at any")),
        ((one, bad), 1, (str(bad), "column, row and depth")),
        ((one, headed), 1, (f"{headed} has the headings 'crop_column, y, z', but column, row and depth are wanted",)),
        ((one, tmp_path / "missing.csv"), 1, ("missing.csv does not exist: check",)),
        ((one, one, "--photo", photo), 2, ("--photo", "points")),
        ((one, one, "--align=best"), 2, ("none", "scale", "range")),
        ((one,), 2, ("B",)),
    ]
    for arguments, status, messages in cases:
        outcome = run("compare", *arguments)
        assert (outcome.status, outcome.stdout) == (status, "")
        for message in messages:
            assert message in outcome.stderr


@pytest.mark.parametrize("form", ["names.csv", "numbers.csv", "list.json", "object.json"])
def test_compare_with_points(form: str, tmp_path: Path) -> None:
    estimate = np.full((6, 8), np.nan)
    estimate[1, 1:5] = 1.0, 2.0, 3.0, 6.0
    write_depth(tmp_path / "depth.npy", estimate)
    # By the scale 2, the median, two are right, one is 1/3 too high, and one a third too low; two have no estimate.
    truth = [(1.2, 0.8, 2.0), (2.0, 1.0, 4.0), (2.6, 1.0, 4.5), (4.0, 1.4, 18.0), (0.0, 0.0, 7.0), (99.0, 1.0, 7.0)]
    named = [dict(zip(("column", "row", "depth"), point, strict=True)) for point in truth]
    lines = [",".join(map(str, point)) for point in truth]
    texts = {
        "names.csv": "\n".join(["id,row,depth,column", *(f"a,{y},{z},{x}" for x, y, z in truth)]),
        "numbers.csv": "\n".join(lines),
        "list.json": json.dumps(named),
        "object.json": json.dumps({"points": named}),
    }
    (tmp_path / form).write_text(texts[form])
    photo = np.full((6, 8), 0.5)
    photo[1, 1:5] = 1.0, 0.25, 1 / 9, 0.0
    tifffile.imwrite(tmp_path / "photo.tif", photo)
    files = ("compare", tmp_path / "depth.npy", tmp_path / form)
    options = ("--align=scale", "--photo", tmp_path / "photo.tif")
    outcome = run(*files, *options, "--json")
    left_out = "1 outside the depth map, 1 where there is no depth."
    assert outcome.stderr == f"2 of 6 points are left out: {left_out}"
    rows = json.loads(outcome.stdout)
    third = 1 / 3
    expected = {"mean_relative": (third + third) / 4, "rank_correlation": 1.0, "count": 4, "scale": 2.0}
    assert rows["depth"] == pytest.approx(expected)
    constant = np.mean([abs(4.25 / z - 1) for z in (2, 4, 4.5, 18)])
    assert rows["constant"] == {**rows["constant"], "mean_relative": pytest.approx(constant), "rank_correlation": None}
    # The black point is left out; 1, 2 and 3 by the scale 2.
    assert rows["1/sqrt(I)"] == pytest.approx({**expected, "mean_relative": third / 3, "count": 3})

    table = run(*files, *options).stdout.splitlines()
    assert table[2].startswith("constant (a flat depth, for comparison) ")
    assert table[1].split() == ["depth", f"{(third + third) / 4:.4f}", "1.0000", "4", "2"]
    unscaled = json.loads(run(*files, "--json").stdout)["depth"]
    assert unscaled == pytest.approx({**expected, "mean_relative": np.mean([0.5, 0.5, third, 2 * third]), "scale": 1.0})


def test_compare_counts_points_outside_the_mask(tmp_path: Path) -> None:
    write_depth(tmp_path / "depth.npy", np.ones((3, 4)))
    np.save(tmp_path / "mask.npy", np.arange(4) * np.ones((3, 1)) > 1)
    (tmp_path / "points.csv").write_text("column,row,depth\n1,1,2\n2,1,2\n3,1,2\n")
    files = ("compare", tmp_path / "depth.npy", tmp_path / "points.csv")
    assert run(*files).stderr == ""
    outcome = run(*files, "--mask", tmp_path / "mask.npy")
    assert outcome.stderr == f"1 of 3 points are left out: 1 outside {tmp_path / 'mask.npy'}."


@pytest.mark.usefixtures("quick")
def test_compare_hints_at_the_unit_of_a_flash(photo: Path, tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("1,1,2\n2,1,2\n")
    gain = ("--light=flash", "--gain=2")
    for name, options, hinted in (("flash", gain[:1], True), ("gain", gain, False), ("parallel", (), False)):
        depth = tmp_path / name / "depth.npy"
        assert run("reconstruct", photo, "-o", depth.parent, *FOCAL, *options).status == 0
        for other in (depth, tmp_path / "points.csv"):
            assert ("--align scale" in run("compare", depth, other).stderr) == hinted
            assert run("compare", depth, other, "--align=scale").stderr == ""
    for text in ("", "[1]", '{"parameters": 3}'):
        (tmp_path / "flash" / "report.json").write_text(text)
        assert run("compare", tmp_path / "flash" / "depth.npy", tmp_path / "points.csv").stderr == ""


def test_rank_correlation_with_ties() -> None:
    first, second = np.array([1.0, 2.0, 2.0, 5.0, 4.0]), np.array([3.0, 1.0, 1.0, 9.0, 9.0])
    ranks = np.array([1.0, 2.5, 2.5, 5.0, 4.0]), np.array([3.0, 1.5, 1.5, 4.5, 4.5])
    assert compare_points(first, second).rank_correlation == pytest.approx(np.corrcoef(*ranks)[0, 1])
    assert compare_points(-1 / first + 2, second).rank_correlation == compare_points(first, second).rank_correlation
