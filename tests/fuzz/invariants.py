"""What must hold whatever is given: of a call, of what was read, of a solution."""

from __future__ import annotations

import json
import logging
import os
import re
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NoReturn, TypeVar

# At its first import on a machine it says, after some seconds, that it collects the fonts.
import matplotlib.font_manager  # noqa: F401
import numpy as np
from numpy.typing import NDArray

import persfs_cl as ps

_HERE = Path(__file__).parent
_PACKAGE = Path(ps.__file__).parent
_LONGEST_MESSAGE = 1000

T = TypeVar("T")


class Violation(Exception):  # noqa: N818 # not an error of the code that raises it
    """Something that must hold does not; `group` is the same for others of its kind."""

    def __init__(self, group: str, details: str = "") -> None:
        super().__init__(f"{group}\n{details}".rstrip())
        self.group = group
        self.details = details

    def __reduce__(self) -> tuple[type[Violation], tuple[str, str]]:
        return type(self), (self.group, self.details)


def require(holds: object, what: str, details: str = "") -> None:
    """Raise Violation unless it holds."""
    if not holds:
        raise Violation(what, details)


def attempt(call: Callable[[], T], what: str, *, naming: str = "") -> tuple[T | None, str]:
    """What a call returns, if it does, and "accepted" or the name of the error of the package that it raised.

    Parameters
    ----------
    call : callable
    what : str
        How the call is named in what is reported.
    naming : str
        What the message of an error must hold: the name of a file.

    Raises
    ------
    Violation
        When the call raises something else, warns of what is not the package's to say, or prints.
    """
    value: T | None = None
    verdict = "accepted"
    with _silent(what), warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            value = call()
        except ps.PersfsError as error:
            verdict = type(error).__name__
            message = str(error)
            details = f"{verdict}: {message[:3000]}"
            require(message.strip(), f"{what}: an error without a message", details)
            require(naming in message, f"{what}: a message that does not name the file", details)
            # What a file holds may be of any length; a value that is wrong was the caller's own to choose.
            short = not naming or len(message) <= _LONGEST_MESSAGE
            require(short, f"{what}: a message of over {_LONGEST_MESSAGE} letters", details)
        except Exception as error:  # noqa: BLE001 # whatever it is, it is reported
            _foreign(error, what)
    for warning in told:
        own = warning.category is UserWarning or warning.category.__module__.startswith("persfs_cl")
        # A warning of the package points to whoever called it.
        ours = own and Path(warning.filename).parent == _HERE
        text = f"{warning.category.__name__} at {Path(warning.filename).name}:{warning.lineno}"
        require(ours, f"{what}: a warning leaks: {text}", str(warning.message)[:3000])
    return value, verdict


def _foreign(error: BaseException, what: str) -> NoReturn:
    frames = traceback.extract_tb(error.__traceback__)
    inside = [frame for frame in frames if Path(frame.filename).is_relative_to(_PACKAGE)]
    where = f" at {Path(inside[-1].filename).relative_to(_PACKAGE)}:{inside[-1].lineno}" if inside else ""
    raise Violation(f"{what}: {type(error).__name__}{where}", "".join(traceback.format_exception(error)[-12:]))


@contextmanager
def _silent(what: str) -> Iterator[None]:
    """Raise Violation when anything is printed, by Python, through logging or by a C library."""
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    saved = {number: os.dup(number) for number in (1, 2)}
    root = logging.getLogger()
    # Whoever runs the tests may listen to what else would go to standard error.
    handlers, root.handlers = root.handlers, []
    with tempfile.TemporaryFile() as low, tempfile.TemporaryFile("w+", encoding="utf-8") as high:
        try:
            for number in saved:
                os.dup2(low.fileno(), number)
            with redirect_stdout(high), redirect_stderr(high):
                yield
        finally:
            root.handlers = handlers
            for number, copy in saved.items():
                os.dup2(copy, number)
                os.close(copy)
        low.seek(0)
        high.seek(0)
        printed = low.read().decode(errors="replace") + high.read()
    require(not printed, f"{what}: it prints {_template(printed)!r}", printed[:3000])


def _template(text: str) -> str:
    """A text without its numbers, cut short."""
    return re.sub(r"\d+", "#", re.sub(r"<[^>]*>", "<>", text.strip()))[:40]


def image_holds(photo: Any) -> None:
    """What is true of every photo that was read."""
    shape = photo.image.shape
    require(photo.image.dtype == np.float64 and photo.image.ndim == 2 and photo.image.size, "photo: no image")
    require((photo.image[~np.isnan(photo.image)] >= 0).all() and not np.isinf(photo.image).any(), "photo: not light")
    if photo.white is not None:
        require(photo.image.max() <= 1 + 1e-9, "photo: integers beyond 1", f"{photo.image.max()}")
    require(photo.colour.dtype == np.uint8 and photo.colour.shape == (*shape, 3), "photo: no colours")
    require(photo.mask is None or (photo.mask.dtype == bool and photo.mask.shape == shape), "photo: no mask")
    for samples in (photo.largest_sample, photo.smallest_sample):
        require(samples.shape == shape, "photo: samples of another shape")


def map_holds(values: NDArray[Any], shape: tuple[int, int], *, positive: bool = False) -> None:
    """What is true of every depth map and map of light that was read."""
    require(values.dtype == np.float64 and values.shape == shape, "map: of another shape or type")
    if positive:
        known = values[~np.isnan(values)]
        require((known > 0).all() and np.isfinite(known).all(), "map: no depth")


def strict_json(text: str) -> Any:
    """A JSON text as it is read by those who know no NaN."""

    def refuse(word: str) -> NoReturn:
        raise Violation(f"JSON: it holds {word}", text[:3000])

    return json.loads(text, parse_constant=refuse)


def same_bits(what: str, one: ps.Solution, other: ps.Solution) -> None:
    """Two solutions agree to the last bit."""
    for name in ("depth", "log_depth", "solved", "unreached", "clamped", "at_bound", "changes"):
        first, second = getattr(one, name), getattr(other, name)
        differing = -1
        if first.shape == second.shape:
            differing = int(np.count_nonzero(first.view(np.uint8) != second.view(np.uint8)))
        require(differing == 0, f"{what}: {name} differs", f"{differing} bytes of {first.nbytes}")
    require(one.status is other.status, f"{what}: status differs", f"{one.status} {other.status}")


def solution_holds(solution: ps.Solution, given: Mapping[str, Any]) -> None:
    """What is true of every solution of a call with these keywords."""
    solved, depth = solution.solved, solution.depth
    shape = given["image"].shape
    for name in ("depth", "log_depth", "solved", "unreached", "clamped", "at_bound", "image"):
        require(getattr(solution, name).shape == shape, f"solution: {name} of another shape")
    for name in ("depth", "log_depth"):
        values = getattr(solution, name)
        wrong = int(np.count_nonzero(~np.isfinite(values[solved])))
        require(wrong == 0, f"solution: {name} not finite where solved", f"at {wrong} of {int(solved.sum())} pixels")
        wrong = int(np.count_nonzero(~np.isnan(values[~solved])))
        require(wrong == 0, f"solution: {name} not NaN where unsolved", f"at {wrong} of {int((~solved).sum())} pixels")
    require((depth[solved] > 0).all(), "solution: depth not above 0")
    require(not (solution.unreached & solved).any(), "solution: unreached and solved")
    require((solution.clamped <= solved).all(), "solution: clamped and not solved")
    require((solution.at_bound <= solved).all(), "solution: at a bound and not solved")
    if given.get("depth_range") is not None:
        near, far = (np.broadcast_to(bound, shape) for bound in given["depth_range"])
        # Written so that a NaN is never beyond.
        beyond = solved & ((depth < near) | (depth > far))
        require(not beyond.any(), "solution: beyond a bound", f"at {int(beyond.sum())} pixels")
        on_bound = solved & ((depth == near) | (depth == far))
        require((on_bound == solution.at_bound).all(), "solution: on a bound and not said to be, or not")
    require(solution.changes.shape == (solution.iterations,), "solution: changes are not one an iteration")
    require((solution.changes >= 0).all(), "solution: a change is negative or NaN", f"{solution.changes}")
    wanted = np.ones(shape, bool) if given.get("mask") is None else given["mask"]
    walls = np.zeros(shape, bool) if given.get("walls") is None else given["walls"]
    known = np.zeros(shape, bool)
    if given.get("known_depth") is not None:
        known = np.isfinite(given["known_depth"])
        kept = known & ~walls
        require((depth[kept] == given["known_depth"][kept]).all(), "solution: a known depth is not kept")
    require((solved <= wanted | known).all(), "solution: solved beyond the mask")
    missing = wanted & ~walls & ~solved & ~solution.unreached
    require(not missing.any(), "solution: neither solved nor unreached", f"{int(missing.sum())} pixels")
    if solution.status is ps.Status.CONVERGED:
        last = solution.changes[-1]
        require(last <= given.get("tolerance", 1e-5), "solution: converged above the tolerance", f"{last}")


def derived_holds(solution: ps.Solution) -> None:
    """What is true of what a solution gives on request."""
    solved = solution.solved
    for name, values in (("normals", solution.normals()), ("points", solution.points()), ("render", solution.render())):
        flat = values.reshape(*solved.shape, -1)
        wrong = int(np.count_nonzero(~np.isfinite(flat[solved])))
        require(wrong == 0, f"{name}: not finite where solved", f"{wrong} of {flat[solved].size} numbers")
        require(np.isnan(flat[~solved]).all(), f"{name}: not NaN where unsolved")
        if name == "normals":
            lengths = np.linalg.norm(values[solved], axis=-1)
            require(np.allclose(lengths, 1.0), "normals: not of unit length", f"{lengths}")
            require(solved.any() or not lengths.size, "normals: none")
    mesh = solution.mesh()
    require(len(mesh.vertices) == int(solved.sum()), "mesh: not a vertex a pixel", f"{len(mesh.vertices)}")
    require(np.isfinite(mesh.vertices).all(), "mesh: a vertex is not finite")
    strict_json(json.dumps(solution.report()))
    errors = ps.compare(solution.depth, solution.depth)
    require(errors.maximum == 0.0 and errors.count == int(solved.sum()), "compare: a depth differs from itself")
