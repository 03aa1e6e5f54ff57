"""What is tested, first what matters most: a test that is ended early has been through each ordering and precision."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, get_args

from persfs_cl._cl.orderings import ORDERINGS as REGISTERED
from persfs_cl.choices import Boundary, Precision, Surface
from persfs_cl.selftest.scenes import EVEN, FLASH, FRONTAL, LAMP, OBLIQUE
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.model import Light
from persfs_cl.shading.oren_nayar import OrenNayar
from persfs_cl.shading.phong import Phong
from persfs_cl.shading.reflectance import Reflectance

Kind = Literal["sweeps", "shared image", "second order", "multigrid", "render", "smoothing", "energy", "rate", "copy"]

FIRST = "lexicographic"
ORDERINGS = (FIRST, *(name for name in REGISTERED if name != FIRST))
"""The first gives the bits that all must have which are not coloured."""
PRECISIONS = get_args(Precision)

_LIGHTS: dict[str, Light] = {
    "frontal light": FRONTAL,
    "oblique light": OBLIQUE,
    "flash": FLASH,
    "flash without fall-off": EVEN,
    "lamp off the axis": LAMP,
}
_MATERIALS: dict[str, Reflectance] = {"Lambertian": Lambertian(), "Oren-Nayar": OrenNayar(0.4), "Phong": Phong()}


@dataclass(frozen=True)
class Case:
    """One thing that is tested or measured.

    Attributes
    ----------
    kind : str
        "sweeps" against the reference; a "shared image", large enough for several work-groups; "second order" against
        a surface known exactly; "multigrid" to the limit; "render", the forward model; "smoothing" of what a guide
        says; the "energy" of scheme "regularised", and a step that lowers it; and the measurements "rate", of sweeps,
        and "copy".
    precision : {"float32", "float64"}
    ordering : str
        Empty where nothing is swept.
    light, material : str
        In words.
    scheme, surface, boundary
        As for :func:`persfs_cl.reconstruct`.
    bounded : bool
        Whether depths have bounds.
    painted : bool
        Whether ratios of brightness count; of an energy.
    """

    kind: Kind
    precision: Precision
    ordering: str = ""
    light: str = "oblique light"
    material: str = "Lambertian"
    scheme: str = "lax-friedrichs"
    surface: Surface = "away"
    boundary: Boundary = "wall"
    bounded: bool = False
    painted: bool = False

    @property
    def light_source(self) -> Light:
        """The light itself."""
        return _LIGHTS[self.light]

    @property
    def reflectance(self) -> Reflectance:
        """The material itself."""
        return _MATERIALS[self.material]

    @property
    def title(self) -> str:
        """What it is, but for ordering and precision."""
        if self.kind == "copy":
            return "copy"
        if self.kind == "rate":
            return "rate of sweeps"
        if self.kind == "smoothing":
            return "smoothing along edges"
        parts = [self.light, self.material]
        if self.kind == "render":
            return ", ".join(["render", *parts])
        if self.kind == "energy":
            extra = ["painted"] * self.painted + ["with bounds"] * self.bounded
            return ", ".join(["energy", *parts, *extra])
        parts.append(self.scheme)
        if self.kind != "sweeps":
            return ", ".join([*parts, self.kind])
        if self.surface != "away":
            parts.append(self.surface)
        if self.boundary != "wall":
            parts.append(self.boundary)
        if self.bounded:
            parts.append("with bounds")
        return ", ".join(parts)

    @property
    def measures(self) -> bool:
        """Whether it is a measurement, which cannot be wrong."""
        return self.kind in ("rate", "copy")

    def __str__(self) -> str:
        return ": ".join([", ".join(part for part in (self.title, self.ordering) if part), self.precision])


def cases(*, quick: bool) -> list[Case]:
    """All of them, or the first few that cover each ordering, precision and scheme once, and the measurements."""
    chosen = [*_first(), *(() if quick else _others()), *_measurements()]
    # A sorted set: what is named twice is done at its first place.
    return list(dict.fromkeys(chosen))


def _first() -> Iterator[Case]:
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("sweeps", precision, ordering, surface="toward")
        yield Case("render", precision)
        yield Case("smoothing", precision)
        yield Case("energy", precision)
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("sweeps", precision, ordering, "flash", scheme="upwind")
    for precision in PRECISIONS:
        yield Case("multigrid", precision)


def _others() -> Iterator[Case]:
    # Kernels that are there already, or nearly: other numbers, other boundaries.
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("sweeps", precision, ordering, "frontal light")
            yield Case("sweeps", precision, ordering, "frontal light", surface="toward")
            yield Case("sweeps", precision, ordering)
            yield Case("sweeps", precision, ordering, boundary="outflow")
            yield Case("sweeps", precision, ordering, boundary="extrapolate")
            yield Case("sweeps", precision, ordering, boundary="fixed")
            yield Case("sweeps", precision, ordering, scheme="upwind")
            yield Case("sweeps", precision, ordering, "frontal light", scheme="upwind", surface="toward")
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("sweeps", precision, ordering, "flash")
            yield Case("sweeps", precision, ordering, "flash without fall-off")
            yield Case("sweeps", precision, ordering, "flash without fall-off", scheme="upwind", surface="toward")
            yield Case("sweeps", precision, ordering, "lamp off the axis", scheme="upwind")
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("sweeps", precision, ordering, boundary="outflow", bounded=True)
            yield Case("sweeps", precision, ordering, "flash", scheme="upwind", bounded=True)
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("shared image", precision, ordering)
        for ordering in ORDERINGS:
            yield Case("second order", precision, ordering, scheme="upwind")
        yield Case("second order", precision, "wavefront", "flash", scheme="upwind")
    # Of materials the orderings that people use: the third is the reference of the first where kernels differ in more.
    for material in ("Oren-Nayar", "Phong"):
        for precision in PRECISIONS:
            for ordering in ORDERINGS[1:]:
                yield Case("sweeps", precision, ordering, "oblique light", material)
                yield Case("sweeps", precision, ordering, "flash", material)
                yield Case("sweeps", precision, ordering, "flash without fall-off", material)
                yield Case("sweeps", precision, ordering, "flash", material, "upwind")
                yield Case("sweeps", precision, ordering, "flash without fall-off", material, "upwind")
                yield Case("sweeps", precision, ordering, "lamp off the axis", material, "upwind")
    for light in ("oblique light", "flash", "flash without fall-off"):
        for material in _MATERIALS:
            for precision in PRECISIONS:
                yield Case("render", precision, "", light, material)
    for light in ("oblique light", "flash", "lamp off the axis"):
        for material in _MATERIALS:
            for precision in PRECISIONS:
                yield Case("energy", precision, "", light, material)
    for precision in PRECISIONS:
        yield Case("energy", precision, "", "frontal light")
        yield Case("energy", precision, "", "flash without fall-off")
        yield Case("energy", precision, painted=True)
        yield Case("energy", precision, bounded=True)
    for light in ("flash without fall-off", "lamp off the axis"):
        yield Case("second order", "float32", "wavefront", light, scheme="upwind")


def _measurements() -> Iterator[Case]:
    yield Case("copy", "float32")
    for precision in PRECISIONS:
        for ordering in ORDERINGS:
            yield Case("rate", precision, ordering)
