"""Calls of the library: valid ones of every kind, and such with odd values."""

from __future__ import annotations

import datetime as dt
import decimal
import fractions
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

import persfs_cl as ps
from persfs_cl.shading.reflectance import Reflectance

Array = NDArray[Any]


@dataclass(frozen=True)
class Programs:
    """What chooses the kernels of a run."""

    light: str
    """parallel, flash, beside or headlight."""
    material: str
    scheme: str
    accuracy_order: int
    precision: str


def _possible(kind: Programs) -> bool:
    if kind.scheme == "lax-friedrichs":
        # In rounds, with the kernels of the flash.
        return kind.accuracy_order == 1
    return kind.light != "parallel" or kind.material == "lambertian"


ALL = tuple(
    filter(
        _possible,
        itertools.starmap(
            Programs,
            itertools.product(
                ("parallel", "flash", "beside", "headlight"),
                ("lambertian", "oren-nayar", "phong"),
                ("lax-friedrichs", "upwind"),
                (1, 2),
                ("float32", "float64"),
            ),
        ),
    )
)
FEW = (
    Programs("parallel", "lambertian", "lax-friedrichs", 1, "float32"),
    Programs("flash", "lambertian", "upwind", 1, "float32"),
)
"""As many as the tests have time to compile."""


def light(random: Generator, kind: str, scale: float) -> ps.ParallelLight | ps.FlashLight:
    """A light of a kind; `scale` is the depth at which the surface will be, if a lamp is beside the camera."""
    if kind == "parallel":
        if random.uniform() < 0.4:
            return ps.ParallelLight()
        steep = 0.5 if random.uniform() < 0.8 else 10.0 ** random.uniform(0, 3)
        return ps.ParallelLight(*np.clip(random.normal(0, steep, 2), -1000, 1000).tolist())
    gain = float(10.0 ** random.uniform(-2, 4) if random.uniform() < 0.8 else 10.0 ** random.uniform(-30, 30))
    if kind == "beside":
        aside = 0.1 if random.uniform() < 0.8 else 10.0 ** random.uniform(-6, 3)
        offset = np.clip(scale * random.normal(0, aside, 3), -1e9, 1e9)
        return ps.FlashLight(gain=gain, offset=tuple(offset.tolist()))
    return ps.FlashLight(falloff=kind == "flash", gain=gain)


def material(random: Generator, kind: str, *, monotone: bool) -> Reflectance:
    """A material of a kind."""
    if kind == "lambertian":
        return ps.Lambertian()
    if kind == "oren-nayar":
        return ps.OrenNayar(float(random.uniform(0, 0.6 if monotone else math.pi / 2)))
    diffuse, specular = random.uniform(0.05, 1, 2)
    return ps.Phong(float(diffuse), float(specular * (random.uniform() < 0.8)), float(10.0 ** random.uniform(0, 2.5)))


def camera(random: Generator, shape: tuple[int, int]) -> ps.Camera:
    """A camera that may see an image of this shape; one in six is extreme."""
    height, width = shape
    focal = float(max(shape) * random.uniform(0.6, 8))
    if random.uniform() < 0.16:
        focal = float(10.0 ** random.uniform(-3, 9))
    lengths = (focal, focal * float(random.uniform(0.5, 2))) if random.uniform() < 0.3 else focal
    lengths = tuple(np.clip(lengths, 1e-3, 1e9).tolist()) if isinstance(lengths, tuple) else lengths
    place = None
    if random.uniform() < 0.3:
        place = (float(random.uniform(-width, 2 * width)), float(random.uniform(-height, 2 * height)))
    return ps.Camera(lengths, place)


_SIZES = ((1, 9), (9, 1), (2, 2), (8, 12), (25, 30), (30, 17))


def shape(random: Generator, largest: int | None) -> tuple[int, int]:
    """A size: a profile, small, or up to the largest. None: one of a few, as PoCL compiles anew for each."""
    if largest is None:
        return _SIZES[random.integers(len(_SIZES))]
    kind = random.integers(5)
    if kind == 0:
        one, other = 1, int(random.integers(2, largest + 1))
        return (one, other) if random.integers(2) else (other, one)
    most = 8 if kind == 1 else largest
    height, width = random.integers(2, most + 1, 2)
    return int(height), int(width)


def pattern(random: Generator, size: tuple[int, int]) -> Array:
    """Brightness in [0, 1]: noise, something smooth, or that with black and white pixels."""
    rows, columns = np.indices(size) / max(size)
    smooth = 0.6 + 0.35 * np.sin(random.uniform(1, 9) * rows + random.uniform(0, 6)) * np.cos(
        random.uniform(1, 9) * columns
    )
    kind = random.integers(4)
    if kind == 0:
        return random.uniform(0.2, 1, size)
    if kind == 1:
        return np.asarray(smooth)
    image = np.clip(smooth + random.normal(0, 0.05, size), 0, 1)
    if kind == 2:
        image[random.uniform(size=size) < 0.1] = 0.0
        image[random.uniform(size=size) < 0.1] = 1.0
    return np.asarray(image)


def depth_range(
    random: Generator, size: tuple[int, int], scale: float, known: Array | None
) -> tuple[Array | float, Array | float]:
    """Bounds at some pixels, or the same at all, none where a depth is known."""
    bounds = np.sort(scale * random.uniform(0.3, 3, (2, *size)), axis=0)
    if random.uniform() < 0.3 and known is None:
        return float(bounds[0].min()), float(bounds[1].max())
    bounds[random.uniform(size=bounds.shape) < random.choice([0.1, 0.5, 0.9])] = np.nan
    if known is not None:
        bounds[:, ~np.isnan(known)] = np.nan
    return bounds[0], bounds[1]


def valid(random: Generator, kind: Programs, largest: int | None) -> dict[str, Any]:
    """All keywords of :func:`persfs_cl.reconstruct`, image and camera included, for a run that should succeed."""
    size = shape(random, largest)
    if random.uniform() < 0.02 and largest is not None and largest >= 70:
        # More than a work-group takes at a time: strips that wait for each other.
        size = ((2, 33000), (260, 270), (30000, 3))[random.integers(3)]
    scale = float(10.0 ** random.uniform(-2, 2) if random.uniform() < 0.8 else 10.0 ** random.uniform(-30, 30))
    lamp = light(random, kind.light, scale)
    surface = material(random, kind.material, monotone=kind.scheme == "upwind" or kind.light == "headlight")
    image = pattern(random, size)
    if isinstance(lamp, ps.FlashLight):
        image *= lamp.known_gain * surface.brightest
        if lamp.falloff:
            image *= (1 if random.uniform() < 0.9 else 10.0 ** random.uniform(-20, 20)) / scale**2
    elif kind.material != "lambertian":
        image *= 0.8 * surface.shade(1.0, 1.0, 1.0)
    call: dict[str, Any] = {
        "light": lamp,
        "reflectance": surface,
        "scheme": kind.scheme,
        "accuracy_order": kind.accuracy_order,
        "precision": kind.precision,
        "max_iterations": int(random.choice([1, 3, 20, 60])),
        "tolerance": float(random.choice([0.0, 1e-6, 1e-5, 1e-3])),
    }
    if random.uniform() < 0.5:
        mask = random.uniform(size=size) < random.choice([0.6, 0.9])
        if random.uniform() < 0.5:
            rows, columns = np.indices(size)
            height, width = size
            mask = ((rows / height - 0.5) ** 2 + (columns / width - 0.5) ** 2) < random.uniform(0.1, 0.4)
        call["mask"] = mask
    if random.uniform() < 0.3:
        walls = np.zeros(size, bool)
        walls[:, int(random.integers(size[1]))] = True
        if random.uniform() < 0.5:
            walls = random.uniform(size=size) < 0.1
        call["walls"] = walls
    if random.uniform() < 0.3:
        call["albedo"] = random.uniform(0.3, 1, size).astype(random.choice(["float32", "float64"]))
        image = image * call["albedo"]
    given = lamp.falloff if isinstance(lamp, ps.FlashLight) else False
    boundaries = ["auto", "wall"]
    if kind.scheme == "lax-friedrichs":
        boundaries += ["outflow"] if given else ["outflow", "extrapolate"]
    call["boundary"] = str(random.choice(boundaries))
    if not given:
        call["surface"] = str(random.choice(["away", "toward"]))
    if random.uniform() < (0.2 if given else 0.6) or kind.light == "headlight":
        known = np.full(size, np.nan)
        places = random.uniform(size=size) < random.choice([0.02, 0.3])
        places[size[0] // 2, size[1] // 2] = True
        known[places] = scale * random.uniform(0.5, 2, int(places.sum()))
        if random.uniform() < 0.2:
            for rim in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
                known[rim] = scale
            call["boundary"] = "fixed"
            for name in ("mask", "walls"):
                call.pop(name, None)
        call["known_depth"] = known
    if random.uniform() < 0.2:
        call["max_slope"] = float(10.0 ** random.uniform(-2, 6))
    types = ["float64", "float64", "float32"] if np.abs(np.log10(np.maximum(image, 1e-300)).max()) < 30 else ["float64"]
    call |= {"image": image.astype(random.choice(types)), "camera": camera(random, size)}
    if random.uniform() < 0.1:
        call["image"] = np.asfortranarray(call["image"])
    if random.uniform() < 0.3 and (given or "known_depth" in call):
        call["depth_range"] = depth_range(random, size, scale, call.get("known_depth"))
    return call


class _Nothing:
    """An object that is nothing that anyone could want."""


def odd(random: Generator) -> Any:
    """A value that is probably of the wrong type, shape or size."""
    return _ODD[int(random.integers(len(_ODD)))]()


def _cycle() -> list[Any]:
    itself: list[Any] = []
    itself.append(itself)
    return itself


def _with_object() -> Array:
    values = np.full((12, 12), 0.5, object)
    values[3, 3] = "x"
    return values


_ODD: tuple[Callable[[], Any], ...] = (
    lambda: None,
    lambda: True,
    lambda: 0,
    lambda: 1,
    lambda: -1,
    lambda: 3,
    lambda: 2**63,
    lambda: 10**400,
    lambda: 0.0,
    lambda: -0.0,
    lambda: 0.5,
    lambda: math.nan,
    lambda: math.inf,
    lambda: -math.inf,
    lambda: 1e308,
    lambda: 5e-324,
    lambda: 1j,
    lambda: "",
    lambda: "x",
    lambda: "1",
    lambda: "\0",
    lambda: "a" * 5000,
    lambda: b"away",
    list,
    dict,
    lambda: {"a": 1},
    lambda: {1, 2},
    lambda: (1, 2),
    lambda: (1.0, 2.0, 3.0),
    lambda: (0, 0),
    lambda: ("a", "b", "c"),
    lambda: [[1, 2], [3]],
    lambda: [None, None],
    lambda: [[0.5] * 12] * 12,
    lambda: range(3),
    lambda: iter([1, 2]),
    lambda: slice(1),
    lambda: ...,
    lambda: NotImplemented,
    _Nothing,
    lambda: _Nothing,
    _cycle,
    _with_object,
    lambda: decimal.Decimal("0.5"),
    lambda: decimal.Decimal("sNaN"),
    lambda: fractions.Fraction(1, 3),
    lambda: dt.datetime(2000, 1, 1),
    lambda: Path("nowhere.npy"),
    lambda: np.float64(0.5),
    lambda: np.float32("nan"),
    lambda: np.int8(-1),
    lambda: np.bool_(True),
    lambda: np.str_("away"),
    lambda: np.datetime64("2000-01-01"),
    lambda: np.timedelta64(3, "s"),
    lambda: np.array(0.5),
    lambda: np.array([]),
    lambda: np.array([0.5]),
    lambda: np.array("x"),
    lambda: np.array(["a", "b"]),
    lambda: np.array([1, "x", None], dtype=object),
    lambda: np.zeros((0, 3)),
    lambda: np.zeros((3, 0)),
    lambda: np.zeros((12, 12)),
    lambda: np.full((12, 12), 0.5),
    lambda: np.full((12, 12), np.nan),
    lambda: np.full((12, 12), np.inf),
    lambda: np.full((12, 12), -1.0),
    lambda: np.full((12, 12), 1e300),
    lambda: np.full((12, 12), 5e-324),
    lambda: np.full((12, 12), 0.5, np.longdouble),
    lambda: np.full((12, 12), 0.5, np.float16),
    lambda: np.full((12, 12), 1, np.uint8),
    lambda: np.full((12, 12), 0.5j),
    lambda: np.full((12, 12), "x"),
    lambda: np.full((12, 12), "2000", "datetime64[Y]"),
    lambda: np.ones((12, 12), bool),
    lambda: np.zeros((12, 12), bool),
    lambda: np.ones((12, 12, 3)),
    lambda: np.ones((11, 12), bool),
    lambda: np.ones((1,) * 33),
    lambda: np.ma.masked_array(np.full((12, 12), 0.5), mask=np.eye(12, dtype=bool)),
    lambda: np.zeros(3, [("a", "f8"), ("b", "U3")]),
    lambda: np.random.default_rng(1).uniform(0.1, 1, (12, 12)),
    lambda: memoryview(b"abc"),
    lambda: np.full((12, 12), 0.5).data,
    lambda: [np.full((12, 12), 0.5)] * 2,
    lambda: [np.ones((12, 12), bool)] * 2,
    lambda: ps.Camera(50.0),
    lambda: [ps.Camera(50.0)] * 2,
    ps.FlashLight,
    lambda: ps.FlashLight(falloff=False),
    lambda: ps.ParallelLight(900.0, -900.0),
    lambda: ps.OrenNayar(1.2),
    lambda: ps.Phong(1e-12, 1e12, 1e6),
    lambda: ps.Lambertian,
    lambda: ps.Status.CONVERGED,
)
