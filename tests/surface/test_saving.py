"""Which files are written."""

from __future__ import annotations

import pickle

import pytest

import persfs_cl as ps
from persfs_cl.surface.saving import DEFAULT_MESH_FACES, FILES, GROUPS, PREVIEW, Saving


def test_groups_and_files_become_names_in_one_order() -> None:
    assert Saving.of("report, Mesh.GLB,depth,depth.npy,").files == (
        "depth.npy",
        "depth.tiff",
        "report.json",
        "mesh.glb",
    )
    assert Saving.of(["normals", "normals.npy"]) == Saving(("normals.npy", "normals.png"), DEFAULT_MESH_FACES)
    assert Saving.of(tuple(GROUPS)).without("pictures", "page", "depth.tiff").files == (
        "depth.npy",
        "report.json",
        "mesh.ply",
    )
    assert set(Saving.of("preview").files) == set(PREVIEW)
    for name in FILES:
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
        (
            "depth,mash",
            r"item 'mash', which is none: .*depth, normals, mesh, pictures, preview, page, report, .*mesh\.glb",
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
