"""From a photo's file to its surface, step by step."""

from __future__ import annotations

import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from videos import make_video

import persfs_cl as ps
from persfs_cl.io.export import write_grey
from persfs_cl.io.video import close_video
from persfs_cl.pipeline.brightness import Brightness
from persfs_cl.pipeline.job import Job, prepare, read_job, solve, solve_photo
from persfs_cl.pipeline.optics import CameraChoice, horizontal_view
from persfs_cl.preparation.normalise import normalise_linear
from persfs_cl.solver.options import Options

SCENE = ps.bump((16, 20))
CAMERA = CameraChoice(20.0)


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo.png"
    write_grey(path, SCENE.image, 16)
    return path


def test_the_steps_one_by_one_are_the_whole(photo: Path) -> None:
    keywords: Options = {"surface": "toward", "scheme": "lax-friedrichs", "max_iterations": 9}
    job = Job(photo, CAMERA, Brightness(mean_filter=3), keywords=keywords)
    whole = solve_photo(job)
    ready = prepare(read_job(job))
    iterations: list[int] = []
    solved = solve(ready, lambda iteration, _change: iterations.append(iteration))
    np.testing.assert_array_equal(solved.solution.depth, whole.solution.depth)
    assert solved.report == whole.report
    assert iterations == list(range(1, 10))
    expected = ps.reconstruct(ready.image, ps.Camera(20.0), **keywords)
    np.testing.assert_array_equal(solved.solution.depth, expected.depth)


def test_a_job_and_what_is_read_of_it_go_to_another_process(photo: Path) -> None:
    mask = photo.with_name("mask.npy")
    np.save(mask, np.arange(20) + np.zeros((16, 1)) > 2)
    job = Job(photo, CAMERA, Brightness(), mask=mask, light=ps.ParallelLight(0.1), keywords={"max_iterations": 3})
    assert pickle.loads(pickle.dumps(job)) == job
    there = pickle.loads(pickle.dumps(prepare(pickle.loads(pickle.dumps(read_job(job))))))
    np.testing.assert_array_equal(solve(there).solution.depth, solve_photo(job).solution.depth)


def test_steps_run_in_threads_at_once(photo: Path) -> None:
    jobs = [Job(photo, CameraChoice(length), Brightness()) for length in (20.0, 25.0, 30.0)]
    with ThreadPoolExecutor() as pool:
        inputs = pool.map(read_job, jobs)
        images = list(pool.map(prepare, inputs))
    for job, ready in zip(jobs, images, strict=True):
        assert ready.inputs.camera == ps.Camera(job.camera.focal_length or 0.0)
        np.testing.assert_array_equal(ready.image, normalise_linear(ready.inputs.photo.image))


def test_an_error_of_a_step_names_the_photo_and_keeps_its_argument(photo: Path) -> None:
    with pytest.raises(ps.InputError) as raised:
        prepare(read_job(Job(photo, CAMERA, Brightness(normalise="grey"), light=ps.FlashLight())))
    assert str(raised.value).startswith(f"{photo}: only a parallel light")
    assert (raised.value.argument, raised.value.value) == ("normalise", "grey")
    nowhere = photo.with_name("mask.npy")
    np.save(nowhere, np.zeros((16, 20), bool))
    with pytest.raises(ps.InputError, match=r"photo\.png: no pixel is left to solve: of 320, 320 are outside .*npy\."):
        read_job(Job(photo, CAMERA, Brightness(), mask=nowhere))


def test_a_camera_is_chosen_by_view_then_focal_length_then_exif(photo: Path) -> None:
    shape = (16, 20)
    camera, source = CameraChoice(33.0, 60.0, (3.0, 4.0)).of(photo, shape)
    assert camera == ps.Camera.from_fov(60.0, shape, (3.0, 4.0))
    assert source == "fov"
    assert horizontal_view(ps.Camera.from_fov(60.0, shape), shape) == pytest.approx(60.0)
    with pytest.raises(ps.CameraError, match=r"photo\.png has no EXIF data.* Or give fov, the horizontal field"):
        CameraChoice().of(photo, shape)
    with pytest.warns(UserWarning, match="^focal_length=5 means a view of 127 degrees"):
        CameraChoice(5.0).of(photo, shape)


def test_a_frame_of_a_video_is_a_photo_like_any_other(photo: Path) -> None:
    path = photo.with_name("clip.mkv")
    grey = np.rint(255 * SCENE.image).astype(np.uint8)
    samples = np.repeat(grey[..., None], 3, axis=2)
    make_video(path, [np.zeros_like(samples), samples, samples])
    still = photo.with_name("still.png")
    Image.fromarray(grey).save(still)
    solved = solve_photo(Job(path, CAMERA, Brightness(), frame=1))
    expected = solve_photo(Job(still, CAMERA, Brightness()))
    np.testing.assert_array_equal(solved.solution.depth, expected.solution.depth)
    assert solved.report["photo"] == {**expected.report["photo"], "path": str(path), "frame": 1}
    with pytest.raises(ps.InputError, match=r"clip\.mkv, frame 0: "):
        solve_photo(Job(path, CAMERA, Brightness(), frame=0))
    with pytest.raises(ps.CameraError, match=r"clip\.mkv is a video, which does not tell the focal length\..* fov"):
        read_job(Job(path, CameraChoice(), Brightness(), frame=2))
    close_video()


def test_the_pipeline_needs_no_command_line() -> None:
    script = "import sys, persfs_cl.pipeline.job as job; print({'typer', 'rich', 'persfs_cl.cli'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
