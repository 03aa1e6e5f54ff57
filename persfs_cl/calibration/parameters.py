"""What can be fitted: each parameter as one number that a fit may change, and what it is to a light or a material.

A fit works on numbers of its own, such as the logarithm of a gain, in which the brightness is nearly linear and errors
are alike from end to end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from difflib import get_close_matches
from typing import Any

from persfs_cl.errors import InputError
from persfs_cl.preparation.correct import MOST_POWER
from persfs_cl.preparation.prepare import LEAST_EXPONENT, MOST_EXPONENT
from persfs_cl.shading.flash_light import FlashLight
from persfs_cl.shading.model import Light
from persfs_cl.shading.oren_nayar import OrenNayar
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.phong import Phong
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.wording import keyword


@dataclass(frozen=True)
class Assumed:
    """What is taken to be true while photographs are explained.

    Attributes
    ----------
    light : Light
    reflectance : Reflectance
    exponent : float
        The power that linear light is raised to.
    vignetting : float
        The power of the cosine by which the lens darkens; 0 for none.
    white : float or None
        Light of a white surface that faces the light, for lights whose image is E; None for the usual percentile.
    """

    light: Light
    reflectance: Reflectance
    exponent: float = 1.0
    vignetting: float = 0.0
    white: float | None = None


@dataclass(frozen=True)
class Parameter:
    """One number of a fit.

    Attributes
    ----------
    name : str
    said : str
        What it is, in a sentence about it.
    read, write : callable
        From what is assumed to the number, and the assumption with another number.
    value : callable
        From the number to what users know it as.
    spread : float
        How far it may plausibly lie from where a fit begins: the range of its prior.
    accuracy : float
        What error of it hardly matters.
    least, most : float
        Between which it lies.
    step : float
        For differences; larger than what single precision blurs.
    """

    name: str
    said: str
    read: Callable[[Assumed], float]
    write: Callable[[Assumed, float], Assumed]
    value: Callable[[float], float]
    spread: float
    accuracy: float
    least: float
    most: float
    step: float = 0.02

    def uncertainty(self, number: float, error: float) -> float:
        """A standard error of the number, as one of what users know."""
        beyond = number + error if number + error <= self.most else number - error
        return abs(self.value(min(max(beyond, self.least), self.most)) - self.value(number))


@dataclass(frozen=True)
class Word:
    """What users ask for by one word: a parameter or a few.

    Attributes
    ----------
    belongs : callable
        Whether it is one of the light or material that is assumed.
    remedy : str
        What it belongs to, and what to give.
    make : callable
        The parameters, for what is assumed at the start and a typical depth.
    """

    belongs: Callable[[Assumed], bool]
    remedy: str
    make: Callable[[Assumed, float], list[Parameter]]


def _has(thing: Light | Reflectance, *names: str) -> bool:
    return {*names} <= {field.name for field in fields(thing)}


def _light(assumed: Assumed, **numbers: Any) -> Assumed:
    """With other numbers of the light."""
    return replace(assumed, light=replace(assumed.light, **numbers))


def _material(assumed: Assumed, **numbers: Any) -> Assumed:
    """With other numbers of the material."""
    return replace(assumed, reflectance=replace(assumed.reflectance, **numbers))


def _of(thing: Light | Reflectance, name: str) -> Any:
    """A number that only some lights or materials have."""
    return getattr(thing, name)


def _gain(_start: Assumed, _depth: float) -> list[Parameter]:
    return [
        Parameter(
            "gain",
            "the gain",
            lambda assumed: math.log(_of(assumed.light, "gain")),
            lambda assumed, number: _light(assumed, gain=math.exp(number)),
            math.exp,
            spread=math.log(10.0),
            accuracy=0.01,
            least=-200.0,
            most=200.0,
        )
    ]


def _white(_start: Assumed, _depth: float) -> list[Parameter]:
    return [
        Parameter(
            "white",
            "the white level",
            lambda assumed: math.log(assumed.white or 1.0),
            lambda assumed, number: replace(assumed, white=math.exp(number)),
            math.exp,
            spread=math.log(3.0),
            accuracy=0.01,
            least=-200.0,
            most=200.0,
        )
    ]


def _direction(_start: Assumed, _depth: float) -> list[Parameter]:
    def slope(name: str, along: str) -> Parameter:
        return Parameter(
            name,
            f"the slope of the light along {along}",
            lambda assumed: float(_of(assumed.light, name)),
            lambda assumed, number: _light(assumed, **{name: number}),
            float,
            spread=1.0,
            accuracy=0.02,
            least=-20.0,
            most=20.0,
            step=0.01,
        )

    return [slope("p0", "x"), slope("q0", "y")]


def _exponent(_start: Assumed, _depth: float) -> list[Parameter]:
    return [
        Parameter(
            "exponent",
            "the tone exponent",
            lambda assumed: assumed.exponent,
            lambda assumed, number: replace(assumed, exponent=number),
            float,
            spread=0.5,
            accuracy=0.03,
            least=LEAST_EXPONENT,
            most=MOST_EXPONENT,
        )
    ]


def _lamp(_start: Assumed, depth: float) -> list[Parameter]:
    def place(axis: int, name: str, along: str) -> Parameter:
        def moved(assumed: Assumed, number: float) -> Assumed:
            offset = list(_of(assumed.light, "offset"))
            offset[axis] = number * depth
            return _light(assumed, offset=tuple(offset))

        return Parameter(
            name,
            f"the place of the lamp {along}",
            lambda assumed: float(_of(assumed.light, "offset")[axis]) / depth,
            moved,
            lambda number: number * depth,
            spread=0.5,
            accuracy=0.01,
            least=-3.0,
            most=3.0,
        )

    return [
        place(0, "lamp_x", "to the right"),
        place(1, "lamp_y", "downwards"),
        place(2, "lamp_z", "forwards"),
    ]


def _vignetting(_start: Assumed, _depth: float) -> list[Parameter]:
    return [
        Parameter(
            "vignetting",
            "the power of the vignetting",
            lambda assumed: assumed.vignetting,
            lambda assumed, number: replace(assumed, vignetting=number),
            float,
            spread=4.0,
            accuracy=0.2,
            least=0.0,
            most=MOST_POWER,
            step=0.1,
        )
    ]


def _roughness(_start: Assumed, _depth: float) -> list[Parameter]:
    # Its square, in which the brightness is linear near a smooth surface.
    return [
        Parameter(
            "roughness",
            "the roughness",
            lambda assumed: float(_of(assumed.reflectance, "roughness")) ** 2,
            lambda assumed, number: _material(assumed, roughness=math.sqrt(number)),
            math.sqrt,
            spread=0.3,
            accuracy=0.02,
            least=0.0,
            most=(math.pi / 2) ** 2,
        )
    ]


def _gloss(start: Assumed, _depth: float) -> list[Parameter]:
    # Their sum is a share of the light like the gain or the white level, and is held.
    total = float(_of(start.reflectance, "diffuse") + _of(start.reflectance, "specular"))

    def shared(assumed: Assumed, number: float) -> Assumed:
        return _material(assumed, diffuse=(1.0 - number) * total, specular=number * total)

    return [
        Parameter(
            "specular",
            "the highlight",
            lambda assumed: float(_of(assumed.reflectance, "specular")) / total,
            shared,
            lambda number: number * total,
            spread=0.3,
            accuracy=0.03,
            least=0.0,
            most=0.95,
        ),
        Parameter(
            "shininess",
            "the shininess",
            lambda assumed: math.log(_of(assumed.reflectance, "shininess")),
            lambda assumed, number: _material(assumed, shininess=math.exp(number)),
            math.exp,
            spread=1.5,
            accuracy=0.2,
            least=0.0,
            most=math.log(1e3),
            step=0.1,
        ),
    ]


_FLASH = keyword("light", FlashLight(), written="FlashLight()")
_PARALLEL = keyword("light", ParallelLight(), written="ParallelLight()")
_ROUGH = keyword("reflectance", OrenNayar(0.3), written="OrenNayar(roughness=0.3)")
_SHINY = keyword("reflectance", Phong(), written="Phong()")

WORDS: dict[str, Word] = {
    "gain": Word(
        lambda assumed: _has(assumed.light, "gain"), f"is that of a flash: give {_FLASH}, or fit white", _gain
    ),
    "white": Word(lambda assumed: assumed.light.normalised, "", _white),
    "direction": Word(
        lambda assumed: _has(assumed.light, "p0", "q0"),
        f"is that of a parallel light: give {_PARALLEL}, or fit lamp",
        _direction,
    ),
    "exponent": Word(lambda _assumed: True, "", _exponent),
    "lamp": Word(
        lambda assumed: _has(assumed.light, "offset") and assumed.light.determines_depth,
        f"is the place of a flash that fades with distance: give {_FLASH}, or fit direction",
        _lamp,
    ),
    "vignetting": Word(lambda _assumed: True, "", _vignetting),
    "roughness": Word(
        lambda assumed: _has(assumed.reflectance, "roughness"),
        f"is that of a rough material: give {_ROUGH}, where the fit begins",
        _roughness,
    ),
    "gloss": Word(
        lambda assumed: _has(assumed.reflectance, "diffuse", "specular", "shininess"),
        f"is that of a shiny material: give {_SHINY}, where the fit begins",
        _gloss,
    ),
}
"""By what users type. What comes first is kept where two cannot be told apart."""

_ALBEDO = "albedo"
NEVER_TOLD: Mapping[str, str] = {
    _ALBEDO: "a surface that returns a share of the light everywhere is the same photograph as one under a gain or a "
    "white level that is so much lower: fit these, and they hold the share",
    "white": "under a flash the gain is the brightness of white, and no photograph tells the two apart: fit the gain",
}
"""Why words that somebody may well ask for are never fitted; "white" only where nothing is normalised."""


def usual(light: Light) -> list[str]:
    """What is sought where nobody says what: what every photograph under the light leaves open."""
    return ["direction", "white"] if light.normalised else ["gain"]


def words_of(fit: object, start: Assumed) -> tuple[list[str], dict[str, str]]:
    """The words that are asked for, in the order of :data:`WORDS`, and those that nothing can tell, with the reason.

    Raises
    ------
    InputError
        When one is unknown, or belongs to another light or material.
    """
    listed: Any = fit.split(",") if isinstance(fit, str) else fit
    try:
        asked = [word.strip() if isinstance(word, str) else word for word in listed]
    except TypeError as error:
        raise InputError.about("fit", fit, f"is no list of words: give some of {_listed()}.") from error
    if not asked:
        raise InputError.about("fit", fit, f"asks for nothing: give some of {_listed()}.")
    for word in asked:
        if not isinstance(word, str) or (word not in WORDS and word not in NEVER_TOLD):
            near = get_close_matches(str(word), WORDS, n=1)
            meant = f" Is it {near[0]}?" if near else ""
            raise InputError.about("fit", word, f"is nothing that can be fitted.{meant} Give some of {_listed()}.")
    reasons = {
        word: why
        for word, why in NEVER_TOLD.items()
        if word in asked and (word not in WORDS or not WORDS[word].belongs(start))
    }
    words = [word for word in WORDS if word in asked and word not in reasons]
    for word in words:
        if not WORDS[word].belongs(start):
            taken = f"{keyword('light', start.light)}, {keyword('reflectance', start.reflectance)}"
            raise InputError.about("fit", word, f"{WORDS[word].remedy}. Taken are {taken}.")
    return words, reasons


def parameters_of(words: list[str], start: Assumed, depth: float) -> list[Parameter]:
    """The parameters of some words."""
    return [parameter for word in words for parameter in WORDS[word].make(start, depth)]


def _listed() -> str:
    return ", ".join(WORDS)
