"""The cases: each is a kind and a seed, and these alone decide what it does."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.random import Generator

import persfs_cl as ps
from fuzz import generate_calls, generate_files
from fuzz.generate_calls import ALL, Programs, odd, valid
from fuzz.invariants import (
    Violation,
    attempt,
    derived_holds,
    image_holds,
    map_holds,
    require,
    same_bits,
    solution_holds,
    strict_json,
)
from fuzz.mutate import mutated, text_mutated
from persfs_cl.io.maps import read_depth, read_light, read_mask
from persfs_cl.io.photos import Channel, Encoding
from persfs_cl.io.points import at_points, compare_points, read_points


@dataclass(frozen=True)
class Setting:
    """Where a case may write, and how much it may compile and compute."""

    folder: Path
    programs: Sequence[Programs] = ALL
    brief: bool = False
    """Leave out what costs more kernels or a second: the checkerboard, other sizes, and pictures of the result."""

    @property
    def largest(self) -> int | None:
        """See :func:`fuzz.generate_calls.shape`."""
        return None if self.brief else 70


@dataclass
class Verdicts:
    """What became of the calls of a case."""

    found: list[str]

    def attempt(self, call: Callable[[], Any], what: str, *, naming: str = "") -> Any:
        """As :func:`fuzz.invariants.attempt`; None after a refusal."""
        value, verdict = attempt(call, what, naming=naming)
        self.found.append(f"{what}: {verdict}")
        return value


def run(kind: str, seed: int, setting: Setting) -> list[str]:
    """Run one case, and tell what became of its calls.

    Raises
    ------
    Violation
        When something does not hold.
    """
    verdicts = Verdicts([])
    random = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    KINDS[kind](random, seed, setting, verdicts)
    return verdicts.found


def _written(setting: Setting, suffix: str, data: bytes) -> Path:
    path = setting.folder / f"case{suffix}"
    path.write_bytes(data)
    return path


def _image(random: Generator, _seed: int, setting: Setting, verdicts: Verdicts) -> None:
    file = generate_files.image(random)
    _read_image(random, _written(setting, file.suffix, mutated(random, file.data)), file.shape, verdicts)


def _exif(random: Generator, _seed: int, setting: Setting, verdicts: Verdicts) -> None:
    file = generate_files.photo_with_exif(random)
    data = mutated(random, file.data) if random.uniform() < 0.5 else file.data
    path = _written(setting, file.suffix, data)
    camera = verdicts.attempt(lambda: ps.Camera.from_exif(path), "Camera.from_exif", naming=path.name)
    if camera is not None:
        require(np.isfinite(camera.fx) and camera.fx > 0, "Camera.from_exif: no focal length", f"{camera}")
    _read_image(random, path, file.shape, verdicts)


def _read_image(random: Generator, path: Path, shape: tuple[int, int], verdicts: Verdicts) -> None:
    options: dict[str, Any] = {
        "channel": str(random.choice(get_args(Channel))),
        "encoding": str(random.choice(get_args(Encoding))),
    }
    keep_nan = bool(random.integers(2))
    photo = verdicts.attempt(lambda: ps.read_photo(path, keep_nan=keep_nan, **options), "read_photo", naming=path.name)
    if photo is not None:
        image_holds(photo)
        shape = photo.image.shape
    match random.integers(3):
        case 0:
            _read_mask(path, shape, verdicts)
        case 1:
            light = verdicts.attempt(lambda: read_light(path, shape, **options), "read_light", naming=path.name)
            if light is not None:
                map_holds(light, shape)
        case _:
            _read_depth(path, shape, verdicts)


def _read_mask(path: Path, shape: tuple[int, int], verdicts: Verdicts) -> None:
    mask = verdicts.attempt(lambda: read_mask(path, shape), "read_mask", naming=path.name)
    if mask is not None:
        require(mask.dtype == bool and mask.shape == shape, "read_mask: no mask")


def _read_depth(path: Path, shape: tuple[int, int], verdicts: Verdicts) -> None:
    depth = verdicts.attempt(lambda: read_depth(path, shape), "read_depth", naming=path.name)
    if depth is not None:
        map_holds(depth, shape, positive=True)


def _array(random: Generator, _seed: int, setting: Setting, verdicts: Verdicts) -> None:
    file = generate_files.array(random)
    path = _written(setting, file.suffix, mutated(random, file.data))
    _read_mask(path, file.shape, verdicts)
    _read_depth(path, file.shape, verdicts)
    light = verdicts.attempt(lambda: read_light(path, file.shape), "read_light", naming=path.name)
    if light is not None:
        map_holds(light, file.shape)


def _points(random: Generator, _seed: int, setting: Setting, verdicts: Verdicts) -> None:
    file = generate_files.points(random)
    text = file.data.decode()
    if random.uniform() < 0.7:
        text = text_mutated(random, text)
    data = text.encode("utf-8-sig" if random.uniform() < 0.1 else "utf-8")
    path = _written(setting, file.suffix, mutated(random, data) if random.uniform() < 0.4 else data)
    points = verdicts.attempt(lambda: read_points(path), "read_points", naming=path.name)
    if points is None:
        return
    require(points.ndim == 2 and points.shape[1] == 3 and np.isfinite(points).all(), "read_points: no points")
    require((points[:, 2] > 0).all(), "read_points: a depth not above 0")
    depth = random.uniform(0.5, 2, file.shape)
    values = verdicts.attempt(lambda: at_points(depth, points), "at_points")
    require(values.shape == points.shape[:1], "at_points: not a value a point")
    scaled = bool(random.integers(2))
    errors = verdicts.attempt(lambda: compare_points(values, points[:, 2], scale=scaled), "compare_points")
    if errors is not None:
        require(np.isfinite([errors.mean_relative, errors.scale]).all(), "compare_points: not finite", f"{errors}")


def _reconstruct(random: Generator, seed: int, setting: Setting, verdicts: Verdicts) -> None:
    given = valid(random, setting.programs[seed % len(setting.programs)], setting.largest)
    before = {name: value.copy() for name, value in given.items() if isinstance(value, np.ndarray)}
    solution = verdicts.attempt(lambda: ps.reconstruct(**given), "reconstruct")
    for name, value in before.items():
        require(np.array_equal(given[name], value, equal_nan=True), f"reconstruct: it changes {name}")
    orderings = ["wavefront", "lexicographic"]
    if not setting.brief and random.uniform() < 0.3:
        orderings.append("checkerboard")
    for ordering in orderings:
        again = verdicts.attempt(partial(ps.reconstruct, **given, ordering=ordering), ordering)
        if ordering == "checkerboard":
            if again is not None:
                solution_holds(again, given)
            continue
        require((again is None) == (solution is None), f"reconstruct: {ordering} is refused and accepted")
        if solution is not None:
            same_bits("twice" if ordering == "wavefront" else "lexicographic", solution, again)
    if solution is None:
        return
    solution_holds(solution, given)
    verdicts.attempt(lambda: derived_holds(solution), "derived")
    suffixes = [".npy", ".tif", ".tiff", ".ply", ".obj", ".stl", ".glb", ".json"]
    suffix = str(random.choice(suffixes if setting.brief else [*suffixes, ".png"]))
    path = setting.folder / f"saved{suffix}"
    # A binary mesh without a face cannot be told from a broken one.
    if verdicts.attempt(lambda: solution.save(path), f"save {suffix}") and suffix == ".json":
        strict_json(path.read_text(encoding="utf-8"))
    if not setting.brief and random.uniform() < 0.05:
        _save_all(solution, setting, verdicts)


def _save_all(solution: ps.Solution, setting: Setting, verdicts: Verdicts) -> None:
    files = verdicts.attempt(lambda: solution.save(setting.folder / "all"), "save")
    for file in files or ():
        require(file.stat().st_size, "save: an empty file", f"{file}")
        if file.suffix == ".json":
            strict_json(file.read_text(encoding="utf-8"))


def _save(random: Generator, seed: int, setting: Setting, verdicts: Verdicts) -> None:
    given = valid(random, setting.programs[seed % len(setting.programs)], setting.largest)
    solution = verdicts.attempt(lambda: ps.reconstruct(**given), "reconstruct")
    if solution is not None:
        _save_all(solution, setting, verdicts)


def _batch(random: Generator, seed: int, setting: Setting, verdicts: Verdicts) -> None:
    """Several images by the same keywords: the bits of each alone."""
    programs = setting.programs[seed % len(setting.programs)]
    given = valid(random, programs, setting.largest and 30)
    count = int(random.integers(1, 5))
    own = ("mask", "walls", "known_depth", "albedo", "depth_range")
    entries = [{name: given[name] for name in ("image", "camera", *own) if name in given} for _ in range(count)]
    for number, entry in enumerate(entries):
        if number and random.uniform() < 0.5:
            # Of another size, and plain; on the scale of the first.
            size = generate_calls.shape(random, setting.largest and 30)
            scale = float(given["image"].max()) or 1.0
            fresh: dict[str, Any] = {"image": np.maximum(generate_calls.pattern(random, size), 1e-3) * scale}
            fresh["camera"] = generate_calls.camera(random, size)
            if "known_depth" in entry:
                fresh["known_depth"] = np.full(size, np.nan)
                fresh["known_depth"][0, 0] = np.nanmax(entry["known_depth"])
                if given["boundary"] == "fixed":
                    continue
            entries[number] = fresh
        elif random.uniform() < 0.5:
            entry["image"] = entry["image"] * random.choice([1.0, 0.9])
    shared = {name: value for name, value in given.items() if name not in ("image", "camera", *own)}
    lists: dict[str, Any] = {name: [entry.get(name) for entry in entries] for name in own}
    cameras = [entry["camera"] for entry in entries]
    images = [entry["image"] for entry in entries]
    together = verdicts.attempt(lambda: ps.reconstruct_batch(images, cameras, **lists, **shared), "batch")
    alone = [verdicts.attempt(partial(ps.reconstruct, **entry, **shared), "reconstruct") for entry in entries]
    require((together is None) == (None in alone), "batch: what is refused alone is accepted, or the reverse")
    for one, other in zip(together or (), alone, strict=False):
        same_bits("batch", one, other)


def _render(random: Generator, seed: int, setting: Setting, verdicts: Verdicts) -> None:
    kind = setting.programs[seed % len(setting.programs)]
    size = generate_calls.shape(random, setting.largest)
    scale = float(10.0 ** random.uniform(-2, 2) if random.uniform() < 0.7 else 10.0 ** random.uniform(-300, 300))
    lamp = generate_calls.light(random, kind.light, min(scale, 1e5))
    surface = generate_calls.material(random, kind.material, monotone=kind.light == "headlight")
    depth = scale * (1 + generate_calls.pattern(random, size))
    depth[random.uniform(size=size) < random.choice([0.0, 0.1])] = np.nan
    given: dict[str, Any] = {"light": lamp, "reflectance": surface, "precision": kind.precision}
    present = ~np.isnan(depth)
    if random.uniform() < 0.3:
        given["mask"] = random.uniform(size=size) < 0.7
        present &= given["mask"]
    if random.uniform() < 0.3:
        given["albedo"] = random.uniform(0.1, 1, size)
    lens = generate_calls.camera(random, size)
    image = verdicts.attempt(lambda: ps.render(depth, lens, **given), "render")
    if image is None:
        return
    again = verdicts.attempt(lambda: ps.render(depth, lens, **given), "render")
    require(np.array_equal(image.view(np.uint8), again.view(np.uint8)), "render: other bits the second time")
    require(image.shape == size and np.isnan(image[~present]).all(), "render: not NaN outside")
    wrong = int(np.count_nonzero(~np.isfinite(image[present])))
    require(wrong == 0, "render: not finite inside", f"{wrong} of {int(present.sum())} pixels; {lamp}")


def _compare(random: Generator, _seed: int, _setting: Setting, verdicts: Verdicts) -> None:
    size = generate_calls.shape(random, 30)
    arrays = []
    for _ in range(2):
        values = random.uniform(0.5, 2, size) * 10.0 ** random.choice([0, 0, 0, -300, 150, 300])
        values[random.uniform(size=size) < random.choice([0.0, 0.3, 1.0])] = np.nan
        arrays.append(values.astype(random.choice(["float64", "float64", "longdouble"])))
    mask = random.uniform(size=size) < 0.5 if random.integers(2) else None
    align: Any = (None, "scale", "range")[random.integers(3)]
    errors = verdicts.attempt(lambda: ps.compare(arrays[0], arrays[1], mask=mask, align=align), "compare")
    if errors is not None:
        numbers = [errors.mean, errors.root_mean_square, errors.maximum, errors.median]
        require(np.isfinite(numbers).all() and min(numbers) >= 0, "compare: not finite", f"{errors}")
        require(errors.mean <= errors.maximum * (1 + 1e-12), "compare: a mean above the maximum", f"{errors}")


def _targets(setting: Setting) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Callables and keywords that are right, some of which are then made wrong."""
    rows, columns = np.indices((12, 12)) / 12
    image = 0.6 + 0.3 * np.sin(4 * rows) * np.cos(5 * columns)
    known = np.full((12, 12), np.nan)
    known[6, 6] = 1.5
    lens = ps.Camera(30.0)
    inside, wall = np.ones((12, 12), bool), np.zeros((12, 12), bool)
    wall[:, 4] = True
    common: dict[str, Any] = {
        "light": ps.ParallelLight(),
        "reflectance": ps.Lambertian(),
        "surface": "away",
        "boundary": "auto",
        "scheme": "auto",
        "ordering": "wavefront",
        "accuracy_order": 1,
        "max_iterations": 10,
        "tolerance": 1e-5,
        "max_slope": 30.0,
        "device": None,
        "precision": "float32",
        "callback": None,
        "throw": False,
    }
    arrays: dict[str, Any] = {"mask": inside, "walls": wall, "known_depth": known, "albedo": np.full((12, 12), 0.9)}
    arrays["depth_range"] = (np.where(np.isnan(known), 0.2, np.nan), np.nan)
    solve = {"image": 0.8 * image, "camera": lens, **arrays, **common}
    lists = {name: [value] for name, value in arrays.items()}
    many = {"images": [0.8 * image], "cameras": [lens], **lists, **common}
    flash = {**solve, "light": ps.FlashLight(), "max_slope": None}
    shown = {"light": ps.FlashLight(), "reflectance": ps.Lambertian(), "mask": inside, "albedo": arrays["albedo"]}
    solution = ps.reconstruct(0.8 * image, lens, max_iterations=5)
    target = setting.folder / "saved.npy"
    return {
        "reconstruct": (ps.reconstruct, solve),
        "reconstruct, flash": (ps.reconstruct, flash),
        "reconstruct_batch": (ps.reconstruct_batch, many),
        "render": (ps.render, {"depth": 1 + image, "camera": lens, **shown, "device": None, "precision": "float32"}),
        "compare": (ps.compare, {"estimate": image, "truth": image + 1, "mask": inside, "align": None}),
        "Camera": (ps.Camera, {"focal_length": 50.0, "principal_point": (3.0, 4.0)}),
        "Camera.from_fov": (
            ps.Camera.from_fov,
            {"horizontal_degrees": 60.0, "image_shape": (4, 5), "principal_point": (1.0, 2.0)},
        ),
        "Camera.from_matrix": (ps.Camera.from_matrix, {"matrix": np.eye(3)}),
        "Camera.from_exif": (ps.Camera.from_exif, {"path": setting.folder / "missing.jpg"}),
        "Camera.grid": (lens.grid, {"shape": (4, 5)}),
        "ParallelLight": (ps.ParallelLight, {"p0": 0.1, "q0": 0.2}),
        "FlashLight": (ps.FlashLight, {"falloff": True, "gain": 1.0, "offset": (0.1, 0.2, 0.3)}),
        "OrenNayar": (ps.OrenNayar, {"roughness": 0.3}),
        "Phong": (ps.Phong, {"diffuse": 0.7, "specular": 0.3, "shininess": 10.0}),
        "normalise_grey": (ps.normalise_grey, {"image": image}),
        "read_photo": (
            ps.read_photo,
            {"path": setting.folder / "missing.png", "channel": "red", "encoding": "auto", "keep_nan": False},
        ),
        "read_depth": (read_depth, {"path": setting.folder / "missing.npy", "shape": (4, 5)}),
        "read_points": (read_points, {"path": setting.folder / "missing.csv"}),
        "Solution.save": (
            solution.save,
            {
                "path": target,
                "colour": np.zeros((12, 12), np.uint8),
                "report": {"a": 1},
                "unreliable": {"dark": inside},
            },
        ),
        "Solution.mesh": (solution.mesh, {"colour": np.zeros((12, 12, 3), np.uint8)}),
        "Solution.confidence": (solution.confidence, {"unreliable": {"dark": inside}}),
        "Solution.residual": (solution.residual, {"photo": image}),
        "Solution.report": (solution.report, {"unreliable": {"dark": inside}}),
    }


def _invalid(random: Generator, seed: int, setting: Setting, verdicts: Verdicts) -> None:
    """One or two keywords of a good call are odd: that is refused by an error of the package, or it works."""
    targets = _targets(setting)
    name = list(targets)[seed % len(targets)]
    call, given = targets[name]
    changed = random.choice(list(given), min(len(given), 1 + int(random.uniform() < 0.1)), replace=False)
    for keyword in changed:
        given[str(keyword)] = odd(random)
    if callable(given.get("callback")):
        given["callback"] = "callback"  # what a callback of one's own raises is one's own
    # A relative path is as good as any, but would leave a file where the tests are run.
    if isinstance(given.get("path"), (str, bytes, Path)) and name == "Solution.save":
        given["path"] = setting.folder / "odd.npy"
    try:
        verdicts.attempt(lambda: call(**given), name)
    except Violation as violation:
        told = ", ".join(f"{keyword}={repr(given[str(keyword)])[:300]}" for keyword in changed)
        raise Violation(violation.group, f"{told}\n{violation.details}") from None


KINDS: dict[str, Callable[[Generator, int, Setting, Verdicts], None]] = {
    "image": _image,
    "exif": _exif,
    "array": _array,
    "points": _points,
    "reconstruct": _reconstruct,
    "batch": _batch,
    "render": _render,
    "compare": _compare,
    "save": _save,
    "invalid": _invalid,
}
"""What each kind of case does."""
