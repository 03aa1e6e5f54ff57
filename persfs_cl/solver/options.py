"""The keywords of a reconstruction that are the same for all its images: one description of each.

:func:`persfs_cl.reconstruct` and :func:`persfs_cl.reconstruct_batch` take them, and the command has an option for each
that is described by words.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypedDict, TypeVar, cast, get_args, get_origin, get_type_hints

from persfs_cl._cl.device import Device
from persfs_cl._cl.orderings import ORDERINGS
from persfs_cl.checks import as_flag, as_number, as_whole_number, check_choice, finite_number
from persfs_cl.choices import Boundary, GuideKind, GuideScale, Precision, Stopping, Surface
from persfs_cl.errors import InputError
from persfs_cl.shading.lambertian import Lambertian
from persfs_cl.shading.lights import require_light
from persfs_cl.shading.materials import require_reflectance
from persfs_cl.shading.model import Light
from persfs_cl.shading.parallel_light import ParallelLight
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.schemes import AUTO, SCHEMES

Callback = Callable[[int, float], bool | None]

_STEEPEST = 1e6
_MOST_ITERATIONS = 10**9
_PAINTS = ("plain", "painted")
_MOST_PAINT = 10.0
_MOST_SMOOTHING = 1e4

_REGION, _SOLVER, _DEVICE = "Region and known values", "Solver", "Device"
_Function = TypeVar("_Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class Option:
    """What there is to say of a keyword besides its name and type.

    Attributes
    ----------
    default : object
    check : callable
        Gives the value as it is used, or raises InputError; called with the keyword's name and the value.
    help : str
        In the words of the command.
    in_command : bool
        False where the command has another way to say it, or none.
    in_report : bool
        Whether a report states it among the parameters, and not elsewhere.
    panel : str
        Under which heading the command lists it.
    choices : callable or None
        Gives the words that it may be.
    """

    default: Any
    check: Callable[[str, Any], Any]
    help: str = ""
    panel: str = _SOLVER
    choices: Callable[[], Sequence[str]] | None = None
    in_command: bool = True
    in_report: bool = True


def _one_of(choices: Callable[[], Sequence[str]]) -> Callable[[str, Any], str]:
    def check(name: str, value: Any) -> str:
        check_choice(name, value, choices())
        return str(value)

    return check


def _order(name: str, value: Any) -> int:
    if finite_number(value) not in (1.0, 2.0):
        raise InputError.about(name, value, ": the schemes are of order 1 or 2.")
    return int(value)


def _count(name: str, value: Any) -> int:
    return as_whole_number(name, value, least=1, most=_MOST_ITERATIONS)


def _change(name: str, value: Any) -> float:
    return as_number(name, value, least=0.0)


def _tolerance(name: str, value: Any) -> float | None:
    return None if value is None else _change(name, value)


def _slope(name: str, value: Any) -> float | None:
    hint = "; 30 is a surface seen at 2 degrees from grazing"
    return None if value is None else as_number(name, value, above=0.0, most=_STEEPEST, what="a bound", hint=hint)


def _share(name: str, value: Any) -> float | None:
    hint = ", such as 0.02 for 2 % of the depth"
    return None if value is None else as_number(name, value, above=0.0, most=1.0, what="a share", hint=hint)


def _paint(name: str, value: Any) -> str | float:
    if isinstance(value, str) and value in _PAINTS:
        return value
    hint = f": {' or '.join(_PAINTS)}, or the spread of ln albedo, such as 0.2"
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError as error:
            raise InputError.about(name, value, f"is neither a word for it nor a number{hint}.") from error
    return as_number(name, value, above=0.0, most=_MOST_PAINT, what="a spread", hint=hint)


def _smoothing(name: str, value: Any) -> float | None:
    hint = ", the pixels to smooth over"
    return None if value is None else as_number(name, value, above=0.0, most=_MOST_SMOOTHING, hint=hint)


def _callback(name: str, value: Any) -> Callback | None:
    if value is not None and not callable(value):
        raise InputError.about(name, value, "cannot be called: give a function of iteration and change.")
    return value  # type: ignore[no-any-return] # of what it takes and gives nothing can be known


def _as_given(_: str, value: Any) -> Any:
    return value


def _words(kind: Any) -> tuple[Callable[[str, Any], str], Callable[[], Sequence[str]]]:
    choices = get_args(kind)
    return _one_of(lambda: choices), lambda: choices


def _schemes() -> Sequence[str]:
    return (AUTO, *SCHEMES)


def _orderings() -> Sequence[str]:
    return list(ORDERINGS)


_IS_SURFACE, _SURFACES = _words(Surface)
_IS_BOUNDARY, _BOUNDARIES = _words(Boundary)
_IS_GUIDE_KIND, _GUIDE_KINDS = _words(GuideKind)
_IS_GUIDE_SCALE, _GUIDE_SCALES = _words(GuideScale)
_IS_STOPPING, _STOPPINGS = _words(Stopping)
_IS_PRECISION, _PRECISIONS = _words(Precision)


class Options(TypedDict, total=False):
    """The keywords, each with its :class:`Option`; :func:`persfs_cl.reconstruct` says at length what they mean."""

    light: Annotated[
        Light, Option(ParallelLight(), lambda _, value: require_light(value), in_command=False, in_report=False)
    ]
    reflectance: Annotated[
        Reflectance,
        Option(Lambertian(), lambda _, value: require_reflectance(value), in_command=False, in_report=False),
    ]
    surface: Annotated[
        Surface,
        Option(
            "away",
            _IS_SURFACE,
            "Whether the surface goes away from the camera, or comes toward it, from the known depths inwards. Under a "
            "flash the photo itself tells.",
            _REGION,
            choices=_SURFACES,
        ),
    ]
    guide_kind: Annotated[
        GuideKind,
        Option(
            "depth",
            _IS_GUIDE_KIND,
            "What the numbers of the guide are: depths, or inverse depths such as disparities.",
            _REGION,
            choices=_GUIDE_KINDS,
        ),
    ]
    guide_scale: Annotated[
        GuideScale,
        Option(
            "fixed",
            _IS_GUIDE_SCALE,
            "fixed: the guide is in the unit of depth. fit: its unit is unknown. affine: its unit and its zero are, as "
            "of a network's.",
            _REGION,
            choices=_GUIDE_SCALES,
        ),
    ]
    guide_tolerance: Annotated[
        float | None,
        Option(
            None,
            _share,
            "Share of the depth by which the guide scatters; found from guide and photo by default.",
            _REGION,
        ),
    ]
    boundary: Annotated[
        Boundary,
        Option(
            "auto",
            _IS_BOUNDARY,
            "On edges where no depth is known; auto: outflow for lax-friedrichs under a parallel light, else wall.",
            choices=_BOUNDARIES,
        ),
    ]
    scheme: Annotated[
        str,
        Option(
            AUTO,
            _one_of(_schemes),
            "lax-friedrichs is the paper's, upwind sharper and faster; regularised the surface of least energy, for "
            "what has no frame. auto: upwind where the material permits it, and the boundary.",
            choices=_schemes,
        ),
    ]
    ordering: Annotated[
        str, Option("wavefront", _one_of(_orderings), "Order of the pixels in a sweep.", choices=_orderings)
    ]
    accuracy_order: Annotated[
        int,
        Option(
            1,
            _order,
            "2: once converged, upwind is corrected to second order where the surface is smooth.",
        ),
    ]
    paint: Annotated[
        str | float,
        Option(
            "plain",
            _paint,
            "For regularised: whether brightness varies beyond the shading, painted, or a number, the spread of ln "
            "albedo; no photo tells.",
        ),
    ]
    smoothing: Annotated[
        float | None,
        Option(
            None,
            _smoothing,
            "For regularised: over about how many pixels the surface is smoothed; 1 by default, 20 where painted.",
        ),
    ]
    max_iterations: Annotated[int, Option(2000, _count, "Of four sweeps each.")]
    tolerance: Annotated[
        float | None,
        Option(
            None,
            _tolerance,
            "Ends when ln depth is estimated to be no farther than this from its limit; 1e-5 by default, 2e-3 "
            "for regularised.",
        ),
    ]
    stopping: Annotated[
        Stopping,
        Option(
            "distance",
            _IS_STOPPING,
            "What the tolerance bounds: the estimated distance from the limit, or, as in the paper, only the change of "
            "an iteration, or, for regularised, the share of its energy that five iterations gain, by default 1e-3.",
            choices=_STOPPINGS,
        ),
    ]
    resting: Annotated[
        float,
        Option(
            0.0,
            _change,
            "For upwind, by the wavefront: blocks of pixels rest while ln depth in and around them has changed by no "
            "more than this since they were swept. 0 changes nothing.",
        ),
    ]
    acceleration: Annotated[
        bool,
        Option(
            True,
            as_flag,
            "Whether lax-friedrichs is hastened: by coarser grids, to a dozen iterations, where all edges of a "
            "Lambertian surface under a parallel light are known; else by mixtures of what its last iterations came "
            "to, which saves a third to two thirds.",
        ),
    ]
    max_slope: Annotated[
        float | None,
        Option(
            None,
            _slope,
            "Bound on the slope where a pixel is too dark to set one; 30 by default, and 5 for upwind under a parallel "
            "light.",
        ),
    ]
    device: Annotated[
        int | str | Device | None,
        Option(
            None,
            _as_given,
            "'cpu', 'gpu', a number of 'persfs-cl devices', or part of a name; the first by default.",
            _DEVICE,
            in_report=False,
        ),
    ]
    precision: Annotated[Precision, Option("float32", _IS_PRECISION, panel=_DEVICE, choices=_PRECISIONS)]
    callback: Annotated[Callback | None, Option(None, _callback, in_command=False, in_report=False)]
    throw: Annotated[bool, Option(False, as_flag, in_command=False, in_report=False)]


def _described() -> dict[str, tuple[Any, Option]]:
    return {
        name: (get_args(kind)[0], get_args(kind)[1])
        for name, kind in get_type_hints(Options, include_extras=True).items()
        if get_origin(kind) is Annotated
    }


DESCRIBED = _described()
"""Type and description of every keyword, by its name."""


def reported(options: Options) -> dict[str, Any]:
    """Those that a report states, as plain values."""
    values, without = cast("dict[str, Any]", options), SCHEMES[options["scheme"]].without
    return {name: values[name] for name, (_, option) in DESCRIBED.items() if option.in_report and name not in without}


def with_options(function: _Function) -> _Function:
    """Show the keywords of :class:`Options` in the signature of a function that takes ``**options``."""
    signature = inspect.signature(function)
    own = [one for one in signature.parameters.values() if one.kind is not one.VAR_KEYWORD]
    keywords = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=option.default, annotation=kind)
        for name, (kind, option) in DESCRIBED.items()
    ]
    function.__signature__ = signature.replace(parameters=[*own, *keywords])  # type: ignore[attr-defined]
    return function
