"""Keywords that go together: what is left open is decided, and what contradicts another keyword is refused."""

from __future__ import annotations

from typing import Any, cast

from persfs_cl._cl.orderings import REST_EARLY
from persfs_cl.choices import Stopping
from persfs_cl.errors import InputError
from persfs_cl.solver.options import DESCRIBED, Options
from persfs_cl.solver.schemes import AUTO, SCHEMES, scheme_for
from persfs_cl.solver.schemes.scheme import Scheme
from persfs_cl.wording import keyword, nearest

_MAPS = ("mask", "walls", "known_depth", "albedo", "depth_range", "guide")
"""Keywords that each image has of its own."""
_LEAST_GAIN = 1e-3
"""The tolerance of the gain when none is given."""
_MOST_RESTING = 0.1 * (1.0 + 1e-12)
"""Of the tolerance: the changes that blocks let pass add up along the way that a value takes."""


def complete(given: Options) -> Options:
    """All keywords, checked one by one and against each other, "auto" replaced.

    Raises
    ------
    InputError
        Naming the keyword, its value, and what it may be.
    TypeError
        When there is no such keyword.
    """
    unknown = next((name for name in given if name not in DESCRIBED), None)
    if unknown is not None:
        near = nearest(unknown, (*_MAPS, *DESCRIBED))
        remedy = f"give some of {', '.join((*_MAPS, *DESCRIBED))}." if near is None else f"did you mean {near}?"
        raise TypeError(f"There is no keyword argument {unknown!r}: {remedy}")
    options = cast(
        "Options",
        {name: option.check(name, given.get(name, option.default)) for name, (_, option) in DESCRIBED.items()},
    )
    light, reflectance = options["light"], options["reflectance"]
    scheme = scheme_for(options["scheme"], light, reflectance, options["boundary"])
    scheme.model(light, reflectance)
    for name in scheme.without:
        value: Any = cast("dict[str, Any]", options)[name]
        if value != DESCRIBED[name][1].default:
            raise InputError.about(
                name,
                value,
                f"with {keyword('scheme', scheme.name)}: {scheme.why_without}. Leave {keyword(name)} out.",
            )
    boundary = scheme.boundary(light) if options["boundary"] == AUTO else options["boundary"]
    if boundary not in scheme.boundaries:
        raise InputError.about(
            "boundary",
            boundary,
            f"with {keyword('scheme', scheme.name)}: {scheme.why_no_other_boundary}. Use "
            f"{keyword('boundary', scheme.boundary(light))}, or {keyword('scheme', 'lax-friedrichs')}.",
        )
    if light.determines_depth and boundary == "extrapolate":
        remedy = f"use {keyword('boundary', 'wall')}."
        raise InputError.about("boundary", boundary, f"under a flash has no level to start from: {remedy}")
    if light.unknown is not None and options["guide_scale"] != "fixed":
        raise InputError.about(
            "guide_scale",
            options["guide_scale"],
            f"with {keyword('light', light)}: only one of the two may be unknown. Give the {light.unknown}, or a guide "
            f"in units of depth with {keyword('guide_scale', 'fixed')}.",
        )
    if light.determines_depth and options["surface"] != "away":
        raise InputError.about(
            "surface",
            options["surface"],
            "under a flash with fall-off: the image alone tells which way the surface goes. Leave "
            f"{keyword('surface')} out.",
        )
    if options["accuracy_order"] > scheme.highest_order:
        raise InputError.about(
            "accuracy_order",
            options["accuracy_order"],
            f"with {keyword('scheme', scheme.name)}: only the upwind scheme has a correction to second order. Use "
            f"{keyword('scheme', 'upwind')}, or {keyword('accuracy_order', 1)}.",
        )
    if options["stopping"] == "gain" and not scheme.by_energy:
        raise InputError.about(
            "stopping",
            options["stopping"],
            f"with {keyword('scheme', scheme.name)}: only the regularised scheme has an energy to gain. Use "
            f"{keyword('stopping', 'distance')}, or {keyword('scheme', 'regularised')}.",
        )
    options["scheme"], options["boundary"] = scheme.name, boundary
    if options["tolerance"] is None:
        options["tolerance"] = default_tolerance(scheme.name, options["stopping"])
    _require_rest(options, scheme)
    if options["max_slope"] is None:
        options["max_slope"] = scheme.max_slope(light)
    return options


def _require_rest(options: Options, scheme: Scheme) -> None:
    """Refuse that blocks rest early where that gains nothing, or where nobody knows what it costs."""
    resting, most_resting = options["resting"], _MOST_RESTING * tolerance_of(options)
    if resting == 0.0:
        return
    if not scheme.settles:
        raise InputError.about(
            "resting",
            resting,
            f"with {keyword('scheme', scheme.name)}: it creeps to its limit by such small changes. Use "
            f"{keyword('resting', 0)}, or {keyword('scheme', 'upwind')}.",
        )
    if options["ordering"] not in REST_EARLY:
        others = " or ".join(keyword("ordering", name) for name in REST_EARLY)
        raise InputError.about(
            "resting",
            resting,
            f"with {keyword('ordering', options['ordering'])}: only in the {' or '.join(REST_EARLY)}'s is the distance "
            f"from the limit bounded. Use {keyword('resting', 0)}, or {others}.",
        )
    if options["accuracy_order"] > 1:
        raise InputError.about(
            "resting",
            resting,
            f"with {keyword('accuracy_order', 2)}: it would correct what is not at rest. Use {keyword('resting', 0)}, "
            f"or {keyword('accuracy_order', 1)}.",
        )
    if resting > most_resting:
        raise InputError.about(
            "resting",
            resting,
            f"with {keyword('tolerance', tolerance_of(options))}: blocks would rest too far from the limit. Give at "
            f"most a tenth of the tolerance, {most_resting:g}.",
        )


def default_tolerance(scheme: str, stopping: Stopping) -> float:
    """What the tolerance is when none is given."""
    if stopping == "gain":
        return _LEAST_GAIN
    # "auto" never is the scheme of an energy.
    return SCHEMES[scheme].tolerance if scheme in SCHEMES else Scheme.tolerance


def tolerance_of(options: Options) -> float:
    """The tolerance of complete keywords, see :func:`complete`."""
    tolerance = options["tolerance"]
    assert tolerance is not None  # noqa: S101 - for the type checker
    return tolerance


def require_guide(options: Options, *, guided: bool) -> None:
    """Refuse what is said of a guide where there is none.

    Raises
    ------
    InputError
        Naming the keyword.
    """
    for name in ("guide_kind", "guide_scale", "guide_tolerance"):
        value: Any = cast("dict[str, Any]", options)[name]
        if not guided and value != DESCRIBED[name][1].default:
            raise InputError.about(name, value, f"is without {keyword('guide')}: give one, or leave it out.")
