"""Which photos a batch does, and which again."""

from __future__ import annotations

import csv
import fcntl
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from batches import PLAN, SHAPE, Pretender, lines, photos, pretend, require_whole, times_done

import persfs_cl as ps
from persfs_cl.pipeline import claim
from persfs_cl.pipeline.listing import list_inputs
from persfs_cl.pipeline.manifest import FOLDER
from persfs_cl.pipeline.optics import CameraChoice
from persfs_cl.pipeline.pages import publish
from persfs_cl.pipeline.plan import Plan
from persfs_cl.pipeline.run import Batch
from persfs_cl.pipeline.store import FolderStore
from persfs_cl.surface.saving import Saving


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    photos(tmp_path / "in", 4)
    return tmp_path / "in"


@pytest.fixture
def store(tmp_path: Path) -> FolderStore:
    return FolderStore(tmp_path / "out")


NAMES = [f"{number:05}.png" for number in range(4)]


def test_what_was_done_is_not_done_again(folder: Path, store: FolderStore) -> None:
    did, results, skipped = pretend(folder, store)
    assert (did, sorted(result.name for result in results), skipped) == (NAMES, NAMES, 0)
    assert pretend(folder, store) == ([], [], 4)
    require_whole(store.root, NAMES)
    assert len(list((store.root / FOLDER).glob("*.jsonl"))) == 1, "a run that does nothing leaves no file"


def test_lines_that_are_torn_or_no_records_are_passed_over(folder: Path, store: FolderStore) -> None:
    pretend(folder, store)
    [file] = (store.root / FOLDER).glob("*.jsonl")
    whole = file.read_bytes().splitlines(keepends=True)
    odd = [b"\xff\xfe\n", b"[1]\n", b"null\n", b'{"name": ["a"]}\n', b"[" * 100_000 + b"\n"]
    odd += [
        whole[0].replace(b'"stamps": {', b'"stamps": null, "other": {'),
        whole[0].replace(b'"finished": "', b'"finished": 7, "x": "'),
    ]
    file.write_bytes(b"".join([*odd, *whole[:3], whole[3][: len(whole[3]) // 2]]))
    shutil.rmtree(store.root / NAMES[3])
    assert pretend(folder, store)[0] == [NAMES[3]]
    assert pretend(folder, store)[0] == []


def test_of_several_runs_the_latest_counts(folder: Path, store: FolderStore) -> None:
    assert len(pretend(folder, store, bad=NAMES[:2])[1]) == 4
    assert pretend(folder, store, bad=NAMES[:1])[0] == NAMES[:2]
    assert pretend(folder, store)[0] == NAMES[:1]
    assert pretend(folder, store)[0] == []
    assert times_done(store.root) == dict.fromkeys(NAMES, 1)
    assert sum(record.status == "failed" for record in lines(store.root)) == 3


def test_other_parameters_are_reason_to_do_it_again(folder: Path, store: FolderStore) -> None:
    plans: list[Plan] = [
        PLAN,
        replace(PLAN, camera=CameraChoice(31.0)),
        replace(PLAN, light=ps.FlashLight(gain=2.0)),
        replace(PLAN, reflectance=ps.OrenNayar(0.3)),
        replace(PLAN, keywords={"tolerance": 1e-3}),
        replace(PLAN, brightness=replace(PLAN.brightness, mean_filter=3)),
        replace(PLAN, saving=Saving.of("depth")),
    ]
    for plan in plans:
        assert pretend(folder, store, plan=plan)[0] == NAMES
        assert pretend(folder, store, plan=plan)[0] == []
    # What is said with other words is no other parameter, nor is the device, nor how fine a mesh is that is not saved.
    same = replace(plans[-1], camera=CameraChoice((30.0, 30.0)), keywords={"precision": "float32", "device": 0})
    same = replace(same, saving=Saving.of("depth", 1000))
    assert pretend(folder, store, plan=same)[0] == []
    meshes = [replace(PLAN, saving=Saving.of("mesh", faces)) for faces in (0, 1000)]
    solids = [replace(PLAN, saving=Saving.of("solid", width=width)) for width in (50.0, 60.0)]
    for plan in (*meshes, *solids):
        assert pretend(folder, store, plan=plan)[0] == NAMES


def test_of_a_file_counts_what_is_in_it_and_not_where_it_is(
    folder: Path, store: FolderStore, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = np.full(SHAPE, 0.001)
    np.save(tmp_path / "one.npy", image)
    np.save(tmp_path / "two.npy", image)
    monkeypatch.chdir(tmp_path)

    def plan(file: str | Path) -> Plan:
        return replace(PLAN, brightness=replace(PLAN.brightness, ambient=Path(file)))

    assert pretend(folder, store, plan=plan(tmp_path / "one.npy"))[0] == NAMES
    assert pretend(folder, store, plan=plan("one.npy"))[0] == []
    assert pretend(folder, store, plan=plan("two.npy"))[0] == []
    np.save(tmp_path / "two.npy", 2 * image)
    assert pretend(folder, store, plan=plan("two.npy"))[0] == NAMES


def test_other_files_are_reason_to_do_it_again(folder: Path, store: FolderStore, tmp_path: Path) -> None:
    pretend(folder, store)
    data = (folder / NAMES[0]).read_bytes()
    (folder / NAMES[0]).write_bytes(data)
    os.utime(folder / NAMES[1], ns=(7, 7))
    assert pretend(folder, store)[0] == [], "touched, but the same"
    photos(folder, 1, first=2000)
    (folder / NAMES[2]).write_bytes((folder / "02000.png").read_bytes())
    (folder / "02000.png").unlink()
    assert pretend(folder, store)[0] == [NAMES[2]]
    np.save(tmp_path / "mask.npy", np.ones(SHAPE, bool))
    masked = replace(PLAN, mask=tmp_path / "mask.npy")
    assert pretend(folder, store, plan=masked)[0] == NAMES
    assert pretend(folder, store, plan=masked)[0] == []
    np.save(tmp_path / "mask.npy", np.arange(SHAPE[1]) + np.zeros((SHAPE[0], 1)) > 2)
    assert pretend(folder, store, plan=masked)[0] == NAMES


def test_results_of_another_photo_are_replaced_only_when_all_are_done_again(
    folder: Path, store: FolderStore, tmp_path: Path
) -> None:
    assert pretend(folder, store)[0] == NAMES
    other = shutil.copytree(folder, tmp_path / "other")
    did, results, _ = pretend(other, store)
    assert did == []
    assert [result.name for result in results] == NAMES
    for result in results:
        assert f"would have the results of {folder / result.name}" in str(result.error)
    # What the first photos have come to stays noted.
    assert pretend(folder, store)[0] == []
    assert pretend(other, store, again="all")[0] == NAMES
    # The folder of photos may be moved.
    assert pretend(other.rename(tmp_path / "moved"), store)[0] == []


def test_a_path_with_a_slip_in_it_is_a_failure_of_its_run_alone(folder: Path, store: FolderStore) -> None:
    batch = Batch(list_inputs([folder, folder / "slip"]), PLAN, store)
    results = {result.name: result for result in batch.results(Pretender(store))}
    assert [name for name, result in results.items() if result.error is not None] == [str(folder / "slip")]
    assert {record.name for record in lines(store.root)} == set(NAMES)


def test_what_is_done_again_can_be_said(folder: Path, store: FolderStore) -> None:
    other = replace(PLAN, camera=CameraChoice(31.0))
    pretend(folder, store, bad=NAMES[:1])
    photos(folder, 1, first=9)
    new = "00009.png"
    assert pretend(folder, store, again="failed", plan=other, bad=NAMES[:1])[0] == NAMES[:1]
    assert pretend(folder, store, again="none", plan=other)[0] == [NAMES[0], new]
    assert pretend(folder, store, again="none", plan=other)[0] == []
    assert pretend(folder, store, again="failed", plan=other)[0] == []
    assert pretend(folder, store, again="changed", plan=other)[0] == NAMES[1:]
    assert pretend(folder, store, again="all", plan=other)[0] == [*NAMES, new]
    require_whole(store.root, [*NAMES, new])


def test_skipping_what_exists_needs_nothing_of_it(folder: Path, store: FolderStore, tmp_path: Path) -> None:
    pretend(folder, store)
    without_masks = replace(PLAN, masks=tmp_path / "nowhere")
    assert pretend(folder, store, plan=without_masks, again="none") == ([], [], 4)
    refused = pretend(folder, store, plan=without_masks)[1]
    assert ["has no mask" in str(result.error) for result in refused] == [True] * 4


def test_photos_that_failed_come_last(folder: Path, store: FolderStore) -> None:
    pretend(folder, store, bad=NAMES[:2])
    photos(folder, 1, first=9)
    assert pretend(folder, store)[0] == ["00009.png", *NAMES[:2]]


def test_a_result_that_was_removed_is_made_again(folder: Path, store: FolderStore) -> None:
    pretend(folder, store)
    shutil.rmtree(store.root / NAMES[1])
    assert pretend(folder, store, again="none")[0] == [NAMES[1]]
    require_whole(store.root, NAMES)


def test_parameters_for_people_tell_kinds_only_where_there_are_several() -> None:
    told = PLAN.parameters()
    assert [name for name, value in told.items() if isinstance(value, dict) and "kind" in value] == [
        "light",
        "reflectance",
    ]
    assert told["camera"]["focal_length"] == 30.0
    assert told["brightness"]["channel"] == "luminance"


@pytest.mark.parametrize("before", ["nothing", "failed", "other parameters"])
def test_a_result_that_its_run_could_not_note_is_taken_as_it_is(before: str, folder: Path, store: FolderStore) -> None:
    if before == "failed":
        pretend(folder, store, bad=NAMES)
    if before == "other parameters":
        pretend(folder, store, plan=replace(PLAN, camera=CameraChoice(31.0)))
    with pytest.raises(KeyboardInterrupt):
        pretend(folder, store, notices=2)
    noted = [record.name for record in lines(store.root) if record.status == "done"]
    assert noted.count(NAMES[2]) == (before == "other parameters")
    did, results, skipped = pretend(folder, store)
    assert (did, len(results), skipped) == (NAMES[3:], 1, 3)
    assert times_done(store.root)[NAMES[2]] == 1 + (before == "other parameters")
    assert pretend(folder, store) == ([], [], 4)


def test_a_result_under_another_name_is_none(folder: Path, store: FolderStore) -> None:
    pretend(folder, store)
    (folder / "copy.png").write_bytes((folder / NAMES[0]).read_bytes())
    shutil.copytree(store.root / NAMES[0], store.root / "copy.png")
    assert pretend(folder, store)[0] == ["copy.png"]


def test_an_interrupt_ends_the_search_for_tasks(folder: Path, store: FolderStore) -> None:
    worker, asked = Pretender(store), iter([False, False, False])
    batch = Batch(list_inputs(folder), PLAN, store)
    assert len(list(batch.results(worker, lambda: next(asked, True)))) == 1
    assert pretend(folder, store)[0] == NAMES[1:]


def test_two_runs_on_a_folder_refuse(folder: Path, store: FolderStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claim, "_PATIENCE", 0.0)
    results = Batch(list_inputs(folder), PLAN, store).results(Pretender(store))
    next(results)
    for shard in (None, (1, 2)):
        with pytest.raises(ps.InputError, match=r"Another run is at work on .*out: wait for its end"):
            pretend(folder, store, shard=shard)
    assert len(list(results)) == 3
    assert pretend(folder, store)[0] == []


def test_shares_run_beside_each_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(claim, "_PATIENCE", 0.0)
    names = photos(tmp_path / "in", 20)
    store, given = FolderStore(tmp_path / "out"), list_inputs(tmp_path / "in")
    runs = {number: Batch(given, PLAN, store, shard=(number, 2)).results(Pretender(store)) for number in (1, 2)}
    did = {number: [next(run).name] for number, run in runs.items()}
    for shard, why in (
        ((1, 2), "Another run of the share 1/2"),
        ((1, 3), r"The share [12]/2 of another division"),
        (None, "Another run"),
    ):
        with pytest.raises(ps.InputError, match=why):
            pretend(tmp_path / "in", store, shard=shard)
    for number, run in runs.items():
        did[number] += [result.name for result in run]
    assert sorted(did[1] + did[2]) == names
    assert min(len(did[1]), len(did[2])) > 3
    assert times_done(store.root) == dict.fromkeys(names, 1)
    assert pretend(tmp_path / "in", store)[0] == []
    assert pretend(tmp_path / "in", store, shard=(2, 3))[0] == []


def test_shares_that_begin_at_once_are_not_taken_for_others(tmp_path: Path) -> None:
    with claim.claimed(tmp_path, (1, 3)):
        pass
    with (tmp_path / FOLDER / "lock-1-of-3").open("rb+") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)  # as another share does, for a moment, to see whether somebody has it
        with claim.claimed(tmp_path, (1, 4)):
            pass


def test_what_is_no_result_stays(folder: Path, store: FolderStore) -> None:
    store.root.mkdir()
    (store.root / NAMES[0]).write_bytes(b"somebody's picture")
    (store.root / NAMES[1]).mkdir()
    (store.root / NAMES[1] / "notes.txt").write_text("somebody's notes")
    with pytest.raises(ps.InputError, match="holds something else than a result: move it away"):
        pretend(folder, store)
    assert (store.root / NAMES[0]).read_bytes() == b"somebody's picture"
    (store.root / NAMES[0]).unlink()
    with pytest.raises(ps.InputError, match="holds something else"):
        pretend(folder, store)
    assert (store.root / NAMES[1] / "notes.txt").read_text() == "somebody's notes"


def rows(store: FolderStore, folder: Path) -> dict[str, str]:
    """What the page's table says of each photo."""
    publish(store, list_inputs(folder).inputs, title="in", parameters={})
    with (store.root / "summary.csv").open(newline="", encoding="utf-8") as file:
        return {row["name"]: row["status"] for row in csv.DictReader(file)}


def test_what_is_neither_given_nor_there_leaves_the_page(folder: Path, store: FolderStore) -> None:
    pretend(folder, store, bad=NAMES[2:])
    everything = dict(zip(NAMES, ("done", "done", "failed", "failed"), strict=True))
    assert rows(store, folder) == everything
    # Those of other shares are given too.
    shutil.rmtree(store.root / NAMES[0])
    assert rows(store, folder) == everything, "it is given, and will be made again"
    for name in NAMES[:3]:
        (folder / name).unlink()
    assert rows(store, folder) == {NAMES[1]: "done", NAMES[3]: "failed"}, "one whose results are there stays"
    page = (store.root / "index.html").read_text(encoding="utf-8")
    assert [name in page for name in NAMES] == [False, True, False, True]
