"""What was tried and not taken, compared with what was."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import persfs_cl as ps
from persfs_cl.bench.accuracy import DEPTH, ERROR, SCHEMES, workload
from persfs_cl.bench.plan import Plan
from persfs_cl.bench.rates import skip
from persfs_cl.bench.results import Record
from persfs_cl.bench.weno import solve
from persfs_cl.choices import Precision
from persfs_cl.errors import UnavailableError
from persfs_cl.scenes.scene import Scene

WENO = "third-order WENO"
NOT_SETTLED = "not settled"

_SIZES = (50, 100, 200)
_PHOTOGRAPH_SIZE = 100
_TOLERANCE, _MAX_ITERATIONS = 1e-9, 2000
_PRECISION: Precision = "float64"


def weno(plan: Plan) -> Iterator[list[Record]]:
    """Mean error of depth by differences of third order, and by the schemes of the project.

    All know the two outermost rows and columns, which WENO needs; the error is that of the other pixels. WENO goes on
    from the surface of second order, and its iterations are those that it adds.
    """
    for photograph, scene in _photographs(plan):
        if plan.device.has_float64:
            yield _side_by_side(plan, photograph, scene)
        else:
            reason = f"{plan.device} has no double precision."
            yield [_skipped(photograph, scheme, scene, reason) for scheme in (*SCHEMES, WENO)]


def _photographs(plan: Plan) -> Iterator[tuple[str, Scene]]:
    for size in plan.edges(_SIZES):
        if size <= plan.size(_SIZES[-1]):
            yield "bump", ps.bump((size, size))
    size = plan.size(_PHOTOGRAPH_SIZE)
    yield "bump, 12 bits", ps.bump((size, size), bits=12)
    yield "bump, 8 bits", ps.bump((size, size), bits=8)
    yield "bump, 8 bits, 1 % noise", ps.bump((size, size), bits=8, noise=0.01)
    cap = ps.sphere_cap((size, size))
    yield "cap", cap
    # The plane has depth 1.
    yield "cap, its plane known", replace(cap, known_depth=np.where(cap.depth == 1.0, 1.0, np.nan))


def _side_by_side(plan: Plan, photograph: str, scene: Scene) -> list[Record]:
    known = scene.depth.copy()
    known[2:-2, 2:-2] = scene.known_depth[2:-2, 2:-2]
    unknown = np.isnan(known)
    solutions = {
        scheme: ps.reconstruct(
            scene.image,
            scene.camera,
            known_depth=known,
            surface=scene.surface,
            device=plan.device,
            precision=_PRECISION,
            tolerance=_TOLERANCE,
            max_iterations=_MAX_ITERATIONS,
            **keywords,
        )
        for scheme, keywords in SCHEMES.items()
    }
    outcomes = {
        scheme: (solution.log_depth, solution.iterations, solution.status is ps.Status.CONVERGED)
        for scheme, solution in solutions.items()
    }
    skipped = []
    try:
        start = solutions["second order"].log_depth
        outcomes[WENO] = solve(scene, unknown, start, tolerance=_TOLERANCE, max_iterations=_MAX_ITERATIONS)
    except UnavailableError as reason:
        skipped.append(_skipped(photograph, WENO, scene, str(reason)))
    return [
        Record.of(
            [ps.compare(np.exp(log_depth), scene.depth, mask=unknown).mean],
            experiment="weno",
            workload=workload(photograph, scheme),
            quantity=ERROR,
            unit=DEPTH,
            size=scene.image.shape[0],
            images=1,
            precision=_PRECISION,
            iteration=iterations,
            detail="" if settled else NOT_SETTLED,
        )
        for scheme, (log_depth, iterations, settled) in outcomes.items()
    ] + skipped


def _skipped(photograph: str, scheme: str, scene: Scene, reason: str) -> Record:
    return skip("weno", workload(photograph, scheme), ERROR, DEPTH, scene.image.shape[0], _PRECISION, reason)
