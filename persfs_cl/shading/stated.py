"""A light or a material as plain values, as reports have it, and again from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from typing import Any, TypeVar

from persfs_cl.errors import InputError
from persfs_cl.shading.lights import LIGHTS
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance

_Kind = TypeVar("_Kind")


def stated(given: Light | Reflectance) -> dict[str, Any]:
    """Its class and its numbers, for JSON.

    Examples
    --------
    >>> import persfs_cl as ps
    >>> from persfs_cl.shading.stated import stated
    >>> stated(ps.OrenNayar(roughness=0.3))
    {'kind': 'OrenNayar', 'roughness': 0.3}
    """
    return {"kind": type(given).__name__, **asdict(given)}


def light_from(values: object) -> Light:
    """The light that :func:`stated` was asked about.

    Raises
    ------
    InputError
        When it is none of those that there are, or its numbers are not possible.

    Examples
    --------
    >>> from persfs_cl.shading.stated import light_from
    >>> light_from({"kind": "ParallelLight", "p0": 0.5, "q0": 0.0})
    ParallelLight(p0=0.5, q0=0.0)
    """
    return _restored("light", values, LIGHTS.values())


def reflectance_from(values: object) -> Reflectance:
    """The material that :func:`stated` was asked about; as :func:`light_from`."""
    return _restored("reflectance", values, MATERIALS.values())


def _restored(name: str, values: object, kinds: Iterable[type[_Kind]]) -> _Kind:
    if not isinstance(values, Mapping):
        raise InputError.about(name, values, "has no kind and numbers: take it from a report as it was written.")
    known = {kind.__name__: kind for kind in kinds}
    kind = known.get(str(values.get("kind")))
    if kind is None:
        raise InputError.about(name, values.get("kind"), f"is none that there is: give one of {', '.join(known)}.")
    wanted = {field.name for field in fields(kind) if field.init}  # type: ignore[arg-type]  # they are dataclasses
    if wanted != values.keys() - {"kind"}:
        raise InputError.about(
            name, dict(values), f"does not have the numbers {', '.join(sorted(wanted))} and no others: see the report."
        )
    return kind(**{one: values[one] for one in wanted})
