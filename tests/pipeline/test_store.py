"""Results in places that fsspec has a protocol for: whole, or not at all."""

from __future__ import annotations

import os
import uuid
from pathlib import Path
from typing import Any

import fsspec
import pytest
from batches import FOCAL, lines, photos, pretend, require_whole, times_done
from fsspec.implementations.local import LocalFileSystem
from fsspec.implementations.memory import MemoryFileSystem

import persfs_cl as ps
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.manifest import Record, now
from persfs_cl.pipeline.pages import publish
from persfs_cl.pipeline.remote_store import RemoteStore, store_for
from persfs_cl.pipeline.store import RECORD, FolderStore


@pytest.fixture(params=["memory", "file"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> RemoteStore:
    place = f"/{uuid.uuid4().hex}" if request.param == "memory" else str(tmp_path / "out")
    return RemoteStore(f"{request.param}://{place}")


def files(store: RemoteStore, name: str) -> set[str]:
    system, root = fsspec.core.url_to_fs(store.url)
    return {file.rpartition("/")[2] for file in system.find(f"{root}/{name}")}


def result(name: str, *written: str) -> Any:
    def fill(folder: Path) -> Record:
        for file in written:
            (folder / file).write_text(file)
        return Record(name=name, path=name, status="done", finished=now())

    return fill


def test_a_result_is_sent_with_its_record_last(store: RemoteStore, monkeypatch: pytest.MonkeyPatch) -> None:
    system, _ = fsspec.core.url_to_fs(store.url)
    sent: list[str] = []
    for way in ("put_file", "pipe_file"):
        usual = getattr(type(system), way)

        def noting(self: Any, *arguments: Any, usual: Any = usual, **keywords: Any) -> None:
            sent.append(next(str(one) for one in reversed(arguments) if isinstance(one, str)).rpartition("/")[2])
            usual(self, *arguments, **keywords)

        monkeypatch.setattr(type(system), way, noting)
    with store.opened() as shelf:
        shelf.put("a/b.png", result("a/b.png", "one", "two"))
        assert sent == ["one", "two", RECORD]
        assert "a/b.png" in store.results()
        # Of an earlier result nothing stays.
        shelf.put("a/b.png", result("a/b.png", "three"))
    assert files(store, "a/b.png") == {"three", RECORD}
    record = store.results().record("a/b.png")
    assert record is not None
    assert record.name == "a/b.png"


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), RuntimeError("the service said no")])
def test_a_result_that_cannot_be_sent_is_not_there(
    error: Exception, store: RemoteStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    with store.opened() as shelf:
        shelf.put("a.png", result("a.png", "one"))
        system, _ = fsspec.core.url_to_fs(store.url)
        usual = type(system).put_file

        def put_file(self: Any, here: str, there: str, **keywords: Any) -> None:
            if there.endswith("/two"):
                raise error
            usual(self, here, there, **keywords)

        monkeypatch.setattr(type(system), "put_file", put_file)
        for name in ("a.png", "b.png"):
            with pytest.raises(
                ps.InputError, match=rf"{name} cannot be (written|used).*(No space|the service said no)"
            ):
                shelf.put(name, result(name, "one", "two"))
            assert RECORD not in files(store, name)
            assert name not in store.results()


def test_a_result_is_on_the_disk_before_it_has_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settled: list[str] = []

    def fsync(handle: int) -> None:
        file = Path(f"/proc/self/fd/{handle}").readlink()
        assert not (tmp_path / "a.png").exists()
        settled.append(file.name)

    monkeypatch.setattr(os, "fsync", fsync)
    with FolderStore(tmp_path).opened() as shelf:
        shelf.put("a.png", result("a.png", "one", "two"))
    assert sorted(settled) == sorted(["one", "two", RECORD])
    assert {path.name for path in (tmp_path / "a.png").iterdir()} == {"one", "two", RECORD}


def test_going_on_does_what_is_missing(store: RemoteStore, tmp_path: Path) -> None:
    names = photos(tmp_path / "in", 4)
    with pytest.raises(KeyboardInterrupt):
        pretend(tmp_path / "in", store, bad=names[:1], notices=2)
    did, _, skipped = pretend(tmp_path / "in", store)
    assert (did, skipped) == ([names[3], names[0]], 2), "of the third, the result was there"
    assert pretend(tmp_path / "in", store) == ([], [], 4)
    system, root = fsspec.core.url_to_fs(store.url)
    system.rm(f"{root}/{names[2]}", recursive=True)
    system.pipe_file(f"{root}/{names[1]}/{RECORD}", b'{"name": "torn')
    assert pretend(tmp_path / "in", store)[0] == [names[2]]
    written = publish(store, list_inputs(tmp_path / "in").inputs, title="in", parameters={})
    assert files(store, "index.html") == {"index.html"}
    assert {"index.html", "summary.csv"} <= set(written)


def test_devices_write_to_a_url(tmp_path: Path) -> None:
    names = photos(tmp_path / "in", 3)
    url = f"file://{tmp_path}/out"
    keywords: dict[str, Any] = {"camera": ps.Camera(FOCAL), "light": ps.FlashLight(), "save": "depth.npy"}
    assert sorted(one.name for one in ps.batch(tmp_path / "in", url, **keywords)) == names
    require_whole(tmp_path / "out", names)
    assert times_done(tmp_path / "out") == dict.fromkeys(names, 1)
    assert list(ps.batch(tmp_path / "in", url, **keywords)) == []
    assert len(lines(tmp_path / "out")) == 3


def test_the_store_of_a_place(tmp_path: Path) -> None:
    assert store_for(tmp_path) == FolderStore(tmp_path)
    assert store_for(os.fspath(tmp_path)) == FolderStore(tmp_path)
    assert store_for("s3://bucket/out/") == RemoteStore("s3://bucket/out")
    with pytest.raises(ps.InputError, match="is in the memory of one process"):
        store_for("memory://out")
    with pytest.raises(ps.errors.UnavailableError, match=r"cannot be used .* install what its protocol needs"):
        RemoteStore("nosuchthing://out").results()
    assert isinstance(fsspec.core.url_to_fs("memory://out")[0], MemoryFileSystem)
    assert isinstance(fsspec.core.url_to_fs("file:///out")[0], LocalFileSystem)
