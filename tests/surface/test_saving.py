"""Which files are written."""

from __future__ import annotations

import importlib.util
import pickle

import pytest

import persfs_cl as ps
from persfs_cl.surface.formats import FORMATS, GROUPS
from persfs_cl.surface.formats.pictures import PREVIEW
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, Saving
from persfs_cl.surface.solid import Block


def test_groups_and_files_become_names_in_one_order() -> None:
    assert Saving.of("report, Mesh.GLB,depth,depth.npy,").files == (
        "depth.npy",
        "depth.tiff",
        "camera.json",
        "report.json",
        "mesh.glb",
    )
    assert Saving.of(["normals", "normals.npy"]) == Saving(("normals.npy", "normals.png"), DEFAULT_MESH_FACES)
    assert Saving.of("depth,pictures,page,report,mesh").without("pictures", "page", "depth.tiff").files == (
        "depth.npy",
        "camera.json",
        "report.json",
        "mesh.ply",
    )
    assert {file for group in GROUPS for file in Saving.of(group).files} <= {*FORMATS}
    assert set(Saving.of("preview").files) == set(PREVIEW)
    for name in FORMATS:
        assert Saving.of(name).files == (name,)


def test_it_goes_to_other_processes() -> None:
    saving = Saving.of("depth,mesh", 1000)
    assert pickle.loads(pickle.dumps(saving)) == saving
    assert hash(saving) == hash(Saving.of(["mesh", "depth"], 1000))


@pytest.mark.parametrize("none", [0, None])
def test_all_triangles_are_kept_on_request(none: int | None) -> None:
    assert Saving.of("mesh", none).mesh_faces is None


@pytest.mark.parametrize(
    ("items", "message"),
    [
        ("depth,mash", r"item 'mash', which is none: is it mesh\? Groups are depth, solution, .*, solid\.$"),
        (
            "depth,walls",
            r"item 'walls', which is none: .*depth, solution, .*report, pictures, normals, .*mesh, solid, .*mesh\.glb",
        ),
        ("mesh.xyz", r"'mesh\.xyz'"),
        ("", "names nothing"),
        ([], "names nothing"),
        (3, "no list of items"),
        (["depth", 3], "no list of items"),
    ],
)
def test_what_is_no_item_is_refused(items: str, message: str) -> None:
    with pytest.raises(ps.InputError, match=message) as raised:
        Saving.of(items)
    assert raised.value.argument == "save"


@pytest.mark.parametrize("faces", [-1, 99, 1000.0, True, "1000"])
def test_what_is_no_number_of_triangles_is_refused(faces: int) -> None:
    with pytest.raises(ps.InputError, match=r"mesh_faces=.* is not a number of triangles: .*100.*, or 0 for all"):
        Saving.of("mesh", faces)


def test_sizes_of_solids_are_checked_and_kept() -> None:
    saving = Saving.of("solid", width=60, base=2)
    assert saving.block == Block(60.0, 2.0)
    assert saving.said == {"mesh_faces": DEFAULT_MESH_FACES, "width": 60.0, "base": 2.0}
    assert Saving.of("depth", width=60).said == {}
    assert pickle.loads(pickle.dumps(saving)) == saving
    for width in (0, -1, float("nan"), "60"):
        with pytest.raises(ps.InputError, match=r"width=.* is not a length in millimetres"):
            Saving.of("solid", width=width)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("file", "package", "extra"), [("depth.exr", "OpenEXR", "exr"), ("solid.3mf", "lxml", "print")]
)
def test_a_missing_extra_is_told_of_before_the_work(
    file: str, package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        "persfs_cl.surface.formats.format.find_spec", lambda name: None if name == package else found(name)
    )
    with pytest.raises(ps.InputError, match=rf"save='{file}' needs {package}, .*pip install 'persfs-cl\[{extra}\]'"):
        Saving.of(f"depth,{file}")
    assert Saving.of("depth").files
