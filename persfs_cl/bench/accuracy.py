"""How far the depth is from the truth: under refinement, with noise, and with the right and the wrong material."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Literal

import numpy as np

import persfs_cl as ps
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.solutions import solved
from persfs_cl.choices import Surface
from persfs_cl.errors import InputError
from persfs_cl.preparation.normalise import mean_filter
from persfs_cl.scenes.meshes import mesh_scene, stanford_bunny
from persfs_cl.scenes.scene import Scene
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance

ERROR, ERROR_SCALED, ORDER = "mean error", "mean error, one scale", "fitted order"
GREY_ERROR = "grey error"
DEPTH, SHARE, CONTRAST = "depth", "% of the relief", "% of the contrast"
FLASH = ps.FlashLight()
PARALLEL = {"frontal": ps.ParallelLight(), "oblique": ps.ParallelLight(0.15, -0.1)}
SURFACES: tuple[Surface, ...] = ("away", "toward")

_SIZES = (51, 101, 201, 401)
_LARGEST_SIZE = 512
_OBJECT_SIZE, _OBJECT_FOCAL_LENGTH = 540, 590
_MATERIAL_SIZE = 201
_AMBIGUITY_SIZES = (101, 201, 401)
_LAMP_SIZES = (61, 121, 241)


def _bump(light: Light, surface: Surface, size: int) -> Scene:
    return ps.bump((size, size), light=light, surface=surface)


def _hill(size: int, **keywords: Any) -> Scene:
    return ps.hillside((size, size), light=FLASH, surface="toward", **keywords)


def scanned(mesh: Path, size: int, **keywords: Any) -> Scene:
    """Flash photograph of a mesh, the z axis of which points up."""
    focal_length = size * _OBJECT_FOCAL_LENGTH / _OBJECT_SIZE
    return mesh_scene(mesh, (size, size), up="z", focal_length=focal_length, light=FLASH, **keywords)


SCENES: dict[str, Callable[[int], Scene]] = {
    **{
        f"bump, {name}, {surface}": partial(_bump, light, surface)
        for name, light in PARALLEL.items()
        for surface in SURFACES
    },
    "hill, flash": _hill,
}
"""Smooth scenes by name, each made for a size."""

SCHEMES: dict[str, dict[str, Any]] = {
    "Lax-Friedrichs": {"scheme": "lax-friedrichs"},
    "upwind": {"scheme": "upwind"},
    "second order": {"scheme": "upwind", "accuracy_order": 2},
}

PHOTOGRAPHS: dict[str, dict[str, Any]] = {
    "exact": {},
    "8 bits": {"bits": 8},
    "8 bits, 1 % noise": {"bits": 8, "noise": 0.01},
    "8 bits, 2 % noise": {"bits": 8, "noise": 0.02},
}
FILTERED = "8 bits, 2 % noise, mean filter"

MATT = "Lambertian"
UNDER_FLASH: dict[str, Reflectance] = {
    MATT: ps.Lambertian(),
    "Oren-Nayar 0.4": ps.OrenNayar(0.4),
    "Oren-Nayar 0.9": ps.OrenNayar(0.9),
    "Phong": ps.Phong(),
}
UNDER_PARALLEL: dict[str, Reflectance] = {
    MATT: ps.Lambertian(),
    "Oren-Nayar 0.3": ps.OrenNayar(0.3),
    "Oren-Nayar 0.5": ps.OrenNayar(0.5),
    "Phong": ps.Phong(),
}
AMBIGUOUS = "Oren-Nayar 0.5"
REFINED = (MATT, "Oren-Nayar 0.3", AMBIGUOUS)
LAMP_ASIDE = (0.0, 0.1, 0.2, 0.3, 0.5)
"""In units of depth; the surface is about 1 away."""
LAMP_SCHEMES = ("upwind", "Lax-Friedrichs")


def workload(scene: str, scheme: str) -> str:
    """What the records of a scene and a scheme are of."""
    return f"{scene}: {scheme}"


def accuracy(plan: Plan) -> Iterator[list[Record]]:
    """Mean error of depth on smooth scenes over the size of the image, and the order fitted to it.

    Under a parallel light the frame of the image is known, under a flash nothing.
    """
    sizes = plan.edges_up_to(_SIZES, _LARGEST_SIZE)
    for scene, scheme in product(SCENES, SCHEMES):
        yield refined(plan, scene, scheme, sizes)


def refined(plan: Plan, scene: str, scheme: str, sizes: Sequence[int]) -> list[Record]:
    """The error of one scheme on one scene at each size, and the order if there are several."""
    scenes = [SCENES[scene](size) for size in sizes]
    solutions = [solved(plan, each, **SCHEMES[scheme]) for each in scenes]
    errors = [ps.compare(solution.depth, each.depth).mean for solution, each in zip(solutions, scenes, strict=True)]
    name = workload(scene, scheme)
    records = [
        _record(plan, "accuracy", name, size, [error], [solution], unit=DEPTH)
        for size, error, solution in zip(sizes, errors, solutions, strict=True)
    ]
    if len(sizes) > 1:
        order = -float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])
        of_all = _record(plan, "accuracy", name, 0, [order], solutions, quantity=ORDER)
        records.append(replace(of_all, iteration=None))
    return records


def noise(plan: Plan) -> Iterator[list[Record]]:
    """Mean error of depth from flash photographs with quantisation and noise, as a share of the relief.

    The solver is told nothing but the photograph, and where in it the object is. What noise does is measured with as
    many seeds as there are repeats, for the strongest also after a mean filter of 3 × 3 pixels.
    """
    objects: dict[str, tuple[int, Callable[..., Scene]]] = {"hill": (plan.size(_SIZES[-1]), _hill)}
    try:
        objects["bunny"] = plan.size(_OBJECT_SIZE), partial(scanned, stanford_bunny())
    except InputError as reason:
        yield [skip("noise", "bunny", ERROR, SHARE, plan.size(_OBJECT_SIZE), plan.precision, str(reason))]
    for name, (size, make) in objects.items():
        for photograph, keywords in PHOTOGRAPHS.items():
            scenes = [make(size, seed=seed, **keywords) for seed in range(plan.repeats if "noise" in keywords else 1)]
            solutions = [solved(plan, scene, mask=scene.mask) for scene in scenes]
            yield _shares(plan, "noise", f"{name}, {photograph}", scenes, solutions)
        smoothed = [replace(scene, image=mean_filter(scene.image, 3, scene.mask)) for scene in scenes]
        solutions = [solved(plan, scene, mask=scene.mask) for scene in smoothed]
        yield _shares(plan, "noise", f"{name}, {FILTERED}", smoothed, solutions)


def reflectance(plan: Plan) -> Iterator[list[Record]]:
    """Mean error of depth when the material of a hill is known, and when another one is assumed."""
    yield from under_flash(plan)
    yield from under_parallel(plan)


def under_flash(plan: Plan) -> Iterator[list[Record]]:
    """The part of :func:`reflectance` by a flash, where nothing else is known."""
    size = plan.size(_MATERIAL_SIZE)
    for true, material in UNDER_FLASH.items():
        scene = _hill(size, reflectance=material)
        for assumed, other in UNDER_FLASH.items():
            solution = solved(plan, scene, reflectance=other)
            yield _shares(plan, "reflectance", taken("flash", true, assumed), [scene], [solution])


def under_parallel(plan: Plan) -> Iterator[list[Record]]:
    """The part under a parallel light.

    The frame is known, and who takes the hill for Lambertian sets its brightest value to 1. The grey error is told too:
    how far the surface found explains the photograph.
    """
    size = plan.size(_MATERIAL_SIZE)
    for light, surface, true in product(PARALLEL, SURFACES, UNDER_PARALLEL):
        scene = _parallel_hill(light, surface, true, size)
        photographs = {true: scene}
        if true != MATT:
            photographs[MATT] = replace(scene, image=scene.image / scene.image.max(), reflectance=ps.Lambertian())
        for assumed, photograph in photographs.items():
            yield _explained(plan, "reflectance", taken(f"{light}, {surface}", true, assumed), photograph)


def ambiguity(plan: Plan) -> Iterator[list[Record]]:
    """What becomes of both errors under refinement where one brightness belongs to two slopes, and where it does not.

    A grey error that goes down while the error of the depth stays tells of another surface with the same photograph.
    """
    sizes = plan.edges_up_to(_AMBIGUITY_SIZES, _LARGEST_SIZE)
    for true, size in product(REFINED, sizes):
        yield _explained(plan, "ambiguity", true, _parallel_hill("frontal", "toward", true, size))


def lamp(plan: Plan) -> Iterator[list[Record]]:
    """Mean error of depth with an off-axis lamp, as a share of the relief, by both schemes.

    The upwind scheme has the lamp in its equation; the Lax-Friedrichs scheme has it at the camera, and takes rounds.
    """
    for aside, size in product(LAMP_ASIDE, plan.edges_up_to(_LAMP_SIZES)):
        scene = ps.hillside((size, size), light=ps.FlashLight(offset=(aside, 0.0, 0.0)), surface="toward")
        for scheme in LAMP_SCHEMES:
            with warnings.catch_warnings():
                # That the rounds do not settle is in the table.
                warnings.simplefilter("ignore")
                solution = solved(plan, scene, **SCHEMES[scheme])
            yield _shares(plan, "lamp", workload(lamp_name(aside), scheme), [scene], [solution])[:1]


def lamp_name(aside: float) -> str:
    """What a scene with the lamp at some place is called."""
    return f"lamp {aside:g} aside"


def taken(light: str, true: str, assumed: str) -> str:
    """What the records of a material taken for another, or for itself, are of."""
    return f"{light}: {true} taken as {assumed}"


def _parallel_hill(light: str, surface: Surface, material: str, size: int) -> Scene:
    return ps.hillside(
        (size, size),
        light=PARALLEL[light],
        reflectance=UNDER_PARALLEL[material],
        surface=surface,
        relief=0.05,
        focal_length=3.0 * size,
    )


def _explained(plan: Plan, experiment: str, name: str, scene: Scene) -> list[Record]:
    """Error of the depth, and of the photograph that the surface found would give, as a share of its contrast.

    By the scheme that all materials have.
    """
    solution = solved(plan, scene, **SCHEMES["Lax-Friedrichs"])
    grey = 100.0 * ps.compare(solution.render(), scene.image).mean / float(np.ptp(scene.image))
    size = scene.image.shape[0]
    return [
        _shares(plan, experiment, name, [scene], [solution])[0],
        _record(plan, experiment, name, size, [grey], [solution], quantity=GREY_ERROR, unit=CONTRAST),
    ]


def _shares(
    plan: Plan, experiment: str, name: str, scenes: Sequence[Scene], solutions: Sequence[ps.Solution]
) -> list[Record]:
    """Errors as shares of the relief, raw and after one global scale."""
    size = scenes[0].image.shape[0]
    records = []
    alignments: dict[str, Literal["scale"] | None] = {ERROR: None, ERROR_SCALED: "scale"}
    for quantity, align in alignments.items():
        shares = [
            100.0 * ps.compare(solution.depth, scene.depth, align=align).mean / float(np.ptp(scene.depth[scene.mask]))
            for solution, scene in zip(solutions, scenes, strict=True)
        ]
        records.append(_record(plan, experiment, name, size, shares, solutions, quantity=quantity, unit=SHARE))
    return records


def _record(
    plan: Plan,
    experiment: str,
    name: str,
    size: int,
    values: Sequence[float],
    solutions: Sequence[ps.Solution],
    *,
    quantity: str = ERROR,
    unit: str = "",
) -> Record:
    ends = {solution.status for solution in solutions}
    scheme = solutions[0].parameters["scheme"]
    return Record.of(
        values,
        experiment=experiment,
        workload=name,
        quantity=quantity,
        unit=unit,
        size=size,
        images=1,
        precision=plan.precision,
        iteration=max(solution.iterations for solution in solutions),
        detail=f"{scheme}, {'converged' if ends == {ps.Status.CONVERGED} else 'not converged'}",
    )
