"""What the paper leaves open about the vase, varied one thing at a time from Table 1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from persfs_cl.arrays import Array
from persfs_cl.camera import Camera
from persfs_cl.masks import rim
from persfs_cl.metrics import Errors, compare
from persfs_cl.paper import figures
from persfs_cl.paper.history import PAPERS_OWN, History, followed, marching, sweeping, told
from persfs_cl.paper.literal import Reading, iterates, with_minus
from persfs_cl.paper.plan import Plan
from persfs_cl.paper.report import Findings, Table
from persfs_cl.paper.vase import CLOSEST, START
from persfs_cl.scenes.analytic import vase
from persfs_cl.scenes.scene import Scene
from persfs_cl.solver.reconstruct import reconstruct

ITERATIONS = (1, 5, 15, 30)
_THRESHOLDS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5)
_SIZES, _LARGE_SIZES = (50,), (200, 400)


@dataclass(frozen=True)
class Variation:
    """Something done otherwise.

    Attributes
    ----------
    aspect, choice : str
        What is varied, and to what.
    scene : Scene
        The surface and its photograph, and what is known of them.
    scaled : bool
        Heights are scaled to [0, 1] by their own extremes. If not, by the true height.
    only_vase : bool
        The background is not compared.
    keywords : mapping
        Further ones for :func:`persfs_cl.reconstruct`.
    reading : Reading or None
        Iterate by it, and not by :func:`persfs_cl.reconstruct`.
    """

    aspect: str
    choice: str
    scene: Scene
    scaled: bool = True
    only_vase: bool = False
    keywords: Mapping[str, Any] = field(default_factory=dict)
    reading: Reading | None = None

    def measured(self, depth: Array) -> Errors:
        """Errors of a depth map of the scene."""
        truth, mask = self.scene.depth, self.scene.mask if self.only_vase else None
        if self.scaled:
            return compare(depth, truth, mask=mask, align="range")
        relief = np.ptp(truth)
        return compare(depth / relief, truth / relief, mask=mask)

    def here(self, plan: Plan) -> History:
        """The history of the project's own sweeps."""
        if self.reading is not None:
            return followed(iterates(self.scene, self.reading, plan.device), self.measured, ITERATIONS).history
        keywords = {"device": plan.device, **told(self.scene), **self.keywords}
        return sweeping(self.scene.image, self.scene.camera, self.measured, ITERATIONS, **keywords).history

    def at_rest(self, plan: Plan) -> float | None:
        """ME of the project's own sweeps once they have converged; None for a reading."""
        if self.reading is not None:
            return None
        keywords = {"device": plan.device, **PAPERS_OWN, **told(self.scene), **self.keywords}
        return self.measured(reconstruct(self.scene.image, self.scene.camera, **keywords).depth).mean

    def tankus(self) -> History | None:
        """That of Tankus' method, where the variation touches it."""
        if self.keywords or self.reading is not None:
            return None
        return marching(self.scene.image, self.scene.camera, self.measured, ITERATIONS, **told(self.scene)).history


def variations(plan: Plan) -> Iterator[Variation]:
    """All of them, Table 1 itself first."""
    usual = vase()
    frame = rim(np.ones_like(usual.mask))
    everywhere = np.ones_like(usual.mask)
    ridge = usual.mask & (np.abs(usual.camera.grid((100, 100)).x) < usual.camera.grid((100, 100)).dx)
    yield Variation("nothing", "as in Table 1", usual)
    for offset in (0.5, 2.0, 5.0):
        yield Variation("depth of the background", f"{offset:g} focal lengths, not 1", vase(offset=offset))
    yield Variation("side", "toward the camera", vase(surface="toward"))
    yield Variation("optical axis", "through u = v = 0 of (13): lower edge", _seen_from_below(usual))
    for focal_length in (50.0, 200.0):
        scene = replace(usual, camera=Camera(focal_length))
        yield Variation("focal length", f"{focal_length:g} px taken for 100", scene)
    yield Variation("known", "background", vase(known="background"))
    true_frame, zero = np.where(frame, usual.depth, np.nan), np.where(frame, 1.0, np.nan)
    yield Variation("known", "frame alone", replace(usual, mask=everywhere, known_depth=true_frame))
    yield Variation("known", "z = 1 on the whole frame, no more", replace(usual, mask=everywhere, known_depth=zero))
    seeded = np.where(ridge, usual.depth, usual.known_depth)
    yield Variation("known", "background, frame, and the ridge", replace(usual, known_depth=seeded))
    yield Variation("image", "not quantised", vase(bits=None))
    for percent in (0.5, 1.0, 2.0):
        yield Variation("image", f"{percent:g} % noise", vase(noise=percent / 100))
    for size in _SIZES if plan.quick else (*_SIZES, *_LARGE_SIZES):
        yield Variation("size", f"{size} × {size} pixels", vase((size, size)))
    yield Variation("errors", "over the vase alone", usual, only_vase=True)
    yield Variation("errors", "both heights scaled by the true one", usual, scaled=False)
    for slope in (3.0, 5.0):
        yield Variation("bound on the slope", f"{slope:g}, not 30", usual, keywords={"max_slope": slope})
    for start in (CLOSEST.start, START, 10.0):
        yield Variation("start value", f"C = {start:g}", usual, reading=Reading(start))
    yield Variation("viscosity", "one σ, C = 1", usual, reading=Reading(START, one_viscosity=True))
    yield Variation("height", "rescaled each iteration, C = 1", usual, reading=Reading(START, rescaled=True))
    both = Reading(START, one_viscosity=True, rescaled=True)
    yield Variation("literal", "one σ, rescaled, C = 1", usual, reading=both)
    choice = f"closest: rescaled, cut ends open, C = {CLOSEST.start:g}"
    yield Variation("literal", choice, vase(known="background"), reading=CLOSEST)


def experiment(plan: Plan) -> Findings:
    """ME and RS of each variation, for both methods."""
    rows, errors = [], []
    for variation in variations(plan):
        here, tankus = variation.here(plan), variation.tankus()
        name = (variation.aspect, variation.choice)
        rows.append((*name, *_cells(here, variation.at_rest(plan)), *_tankus_cells(tankus)))
        errors.append((*name, here.mean[-1], None if tankus is None else tankus.mean[-1]))
    if not plan.quick:
        scene = vase()
        printed_sign = followed(with_minus(scene, START), partial(_range_errors, scene), ITERATIONS).history
        rows.append(("literal", "the minus of (11) as printed, C = 1", *_cells(printed_sign), *_tankus_cells(None)))
    header = (
        "varied",
        "to",
        *(f"ME {number}" for number in ITERATIONS),
        f"RS {ITERATIONS[-1]}",
        "ME at rest",
        f"Tankus ME {ITERATIONS[-1]}",
        f"Tankus RS {ITERATIONS[-1]}",
    )
    title = "Sensitivity: errors on the vase after so many iterations"
    return Findings(
        [Table("sensitivity", title, header, tuple(rows), words=2), _stopping(plan)],
        {"sensitivity.png": partial(figures.sensitivity, errors=errors, iterations=ITERATIONS[-1])},
    )


def _cells(history: History, at_rest: float | None = None) -> tuple[str, ...]:
    errors = (*history.mean, history.root_mean_square[-1])
    return (*(f"{error:.4f}" for error in errors), "" if at_rest is None else f"{at_rest:.4f}")


def _tankus_cells(history: History | None) -> tuple[str, ...]:
    return ("", "") if history is None else (f"{history.mean[-1]:.4f}", f"{history.root_mean_square[-1]:.4f}")


def _range_errors(scene: Scene, depth: Array) -> Errors:
    return compare(depth, scene.depth, align="range")


def _stopping(plan: Plan) -> Table:
    """When the run comes to rest, and with what errors."""
    scene, rows = vase(), []
    for threshold in _THRESHOLDS:
        solution = reconstruct(
            scene.image, scene.camera, tolerance=threshold, device=plan.device, **PAPERS_OWN, **told(scene)
        )
        errors = _range_errors(scene, solution.depth)
        stopped = (f"{threshold:.5f}".rstrip("0"), str(solution.iterations))
        rows.append((*stopped, f"{errors.mean:.4f}", f"{errors.root_mean_square:.4f}"))
    return Table("stopping", "Threshold δ of the stop criterion", ("δ", "iterations", "ME", "RS"), tuple(rows))


def _seen_from_below(scene: Scene) -> Scene:
    """The vase with the optical axis where (13) has u = v = 0, the middle of the lower edge."""
    height, width = scene.depth.shape
    camera = Camera(scene.camera.focal_length, principal_point=((width - 1) / 2, height - 0.5))
    grid = camera.grid((height, width))
    exact = scene.light.brightness(0.0, *scene.log_depth_gradient, grid.x, grid.y, scene.reflectance)
    image = np.where(scene.mask, np.clip(exact, 0.0, 1.0), 1.0)
    return replace(scene, camera=camera, image=np.round(255.0 * image) / 255.0)
