"""A new material is a class, a kernel file and a line in the registry: here is one, added as a contributor would."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from problems import random_problem, sweeper

import persfs_cl as ps
from persfs_cl._cl import program
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance, floats, visible
from persfs_cl.solver.reference import Reference

KERNEL = """
/* A material between matt and shiny, c = cos(theta)^m, from wherever it is seen. */
#define NEWTON_STEPS 10

static inline number minus_log_c(const number square, const parameter_set *parameters)
{
    return 0.5f * parameters->exponent * logarithm(1 + square);
}

static inline number minus_log_c_derivative(const number square, const parameter_set *parameters)
{
    return 0.5f * parameters->exponent / (1 + square);
}

static inline number returned_light(const number lit, const number seen, const number between,
                                    const parameter_set *parameters)
{
    const number positive = most(lit, 1e-30f);
    return choose(lit > 0, power(positive, parameters->exponent), lit);
}
"""


@dataclass(frozen=True)
class Toy(Reflectance):
    """c = cos^m θ."""

    kernel: ClassVar[str] = "toy"
    summary: ClassVar[str] = "between matt and shiny"

    exponent: float = field(default=1.2, metadata={"help": "the higher, the darker the flanks; 1.2 by default."})

    def coaxial(self, cosine: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(visible(cosine) ** self.exponent)

    def shade(self, cosine_light: ArrayLike, cosine_view: ArrayLike, cosine_between: ArrayLike) -> NDArray[np.float64]:
        lit, *_ = np.broadcast_arrays(*floats(cosine_light, cosine_view, cosine_between))
        return np.where(lit > 0.0, np.maximum(lit, 0.0) ** self.exponent, lit)

    @property
    def monotone(self) -> bool:
        return True

    @property
    def brightest(self) -> float:
        return 1.0

    @property
    def steepest_log(self) -> float:
        return 0.5 * self.exponent


@pytest.fixture(autouse=True)
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "materials"
    folder.mkdir()
    (folder / "toy.cl").write_text(KERNEL, encoding="utf-8")
    monkeypatch.setattr(program, "KERNEL_FOLDERS", [*program.KERNEL_FOLDERS, tmp_path])
    monkeypatch.setitem(MATERIALS, "toy", Toy)


# As it does with other materials, the precision goes with all of these.
@pytest.mark.quick_where(holds=lambda given: (given["precision"] == "float32") == (given["aside"] == 0.0))
@pytest.mark.parametrize(("scheme", "aside"), [("upwind", 0.0), ("upwind", 0.1), ("lax-friedrichs", 0.0)])
def test_its_surface_is_found(device: ps.Device, precision: ps.choices.Precision, scheme: str, aside: float) -> None:
    light = ps.FlashLight(offset=(aside, 0.0, 0.0))
    scene = ps.hillside((41, 41), light=light, reflectance=Toy(1.3), bits=None)
    solution = ps.reconstruct(
        scene.image,
        scene.camera,
        light=scene.light,
        reflectance=scene.reflectance,
        scheme=scheme,
        device=device,
        precision=precision,
        ordering="lexicographic",
    )
    assert solution.status is ps.Status.CONVERGED
    assert ps.compare(solution.depth, scene.depth).mean < (0.002 if scheme == "upwind" else 0.01)


_ITERATIONS = 3
LIGHTS: dict[str, tuple[Light, str]] = {
    "parallel": (ps.ParallelLight(0.3, -0.2), "lax-friedrichs"),
    "without fall-off": (ps.FlashLight(falloff=False, gain=1.5), "upwind"),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_its_kernel_is_what_its_class_says(device: ps.Device, name: str) -> None:
    light, scheme = LIGHTS[name]
    problem = random_problem(3, (5, 6), light=light, reflectance=Toy(), scheme=scheme)
    reference, kernel = Reference.of(problem), sweeper(problem, device, "float32", "lexicographic")
    for _ in range(_ITERATIONS):
        reference.iterate()
    kernel.run(_ITERATIONS)
    swept = problem.domain.solved
    np.testing.assert_allclose(kernel.log_depth()[0][swept], reference.log_depth[swept], atol=2e-3)


COMMAND = """
import json
import sys
from pathlib import Path
from persfs_cl._cl import program
from persfs_cl.shading.materials import MATERIALS
from test_toy_material import Toy
program.KERNEL_FOLDERS.append(Path(sys.argv.pop(1)))
MATERIALS["toy"] = Toy
from persfs_cl.cli import main
# Two commands, of which the second ends the process.
sys.argv[1:], help = json.loads(sys.argv[1]), json.loads(sys.argv[2])
try:
    main()
except SystemExit as end:
    assert not end.code, end
sys.argv[1:] = help
main()
"""


def test_the_command_has_it_with_its_number(tmp_path: Path) -> None:
    scene = ps.hillside((20, 20), light=ps.FlashLight(), reflectance=Toy(1.5), bits=None)
    np.save(tmp_path / "depth.npy", scene.depth)

    options = ["--focal-length=20", "--light=flash", "--reflectance=toy", "--exponent=1.5", "--encoding=linear"]
    image = tmp_path / "image.tiff"
    commands = [
        ["render", str(tmp_path / "depth.npy"), "-o", str(image), "--bits=16", *options],
        ["reconstruct", "--help"],
    ]
    path = os.pathsep.join(filter(None, [str(Path(__file__).parent), *sys.path]))
    environment = {**os.environ, "PYTHONPATH": path, "COLUMNS": "200"}
    words = [sys.executable, "-c", COMMAND, str(tmp_path), *map(json.dumps, commands)]
    said = subprocess.run(words, env=environment, capture_output=True, text=True, check=True).stdout
    shown = ps.read_image(image, encoding="linear")
    expected = ps.render(scene.depth, scene.camera, light=ps.FlashLight(), reflectance=Toy(1.5))
    np.testing.assert_allclose(shown, expected / expected.max(), atol=1e-4)
    assert "Of toy: the higher, the darker the flanks" in said
