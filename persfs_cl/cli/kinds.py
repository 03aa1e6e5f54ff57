"""Options of what there are several kinds of, lights and materials: all of them come from a table of the kinds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, dataclass, fields
from inspect import Parameter
from typing import Annotated, Any, Literal, Optional, TypeVar, get_type_hints

import typer

from persfs_cl.cli.choosers import with_signature
from persfs_cl.cli.numbers import finite_numbers
from persfs_cl.cli.spelling import WrongOption
from persfs_cl.errors import InputError

_Kind = TypeVar("_Kind")
_LARGEST_ANGLE = 80.0


def kind_chooser(
    option: str, kinds: Mapping[str, type[_Kind]], panel: str, *, naming: bool = False
) -> Callable[..., _Kind]:
    """The chooser of one of several kinds: an option with their names, the first by default, and one for each number.

    Parameters
    ----------
    option : str
        The first option's name, without hyphens.
    kinds : mapping
        Dataclasses by name. Each says what it is in `summary`; `metadata` of a field may hold the `help` of its option,
        its `metavar`, and its name, `option`, where that is not the field's.
    panel : str
        Under which heading the options are listed.
    naming : bool
        Whether the help of a number begins with the kinds that have it.

    Returns
    -------
    callable
        Raises typer.BadParameter when an option belongs to another kind, one that is needed is missing, or a number is
        impossible.
    """
    numbers = _numbers(kinds)
    usual = next(iter(kinds))

    def choose(**values: Any) -> _Kind:
        name = values.pop(option)
        given = {field: value for field, value in values.items() if value is not None}
        for field in given:
            if name not in (owners := numbers[field].owners):
                # Nobody types the default.
                verb, needed = "add" if name == usual else "give", f"--{option} {' or '.join(owners)}"
                message = f"it goes with {needed}, not {name}: {verb} {needed}, or leave it out."
                raise typer.BadParameter(message, param_hint=f"'{numbers[field].hint}'")
        for field, number in numbers.items():
            if number.needed_by(name) and field not in given:
                message = f"{name} needs it: {number.about('help')}"
                raise typer.BadParameter(message, param_hint=f"'{number.hint}'")
        read = {field: numbers[field].read(value) for field, value in given.items()}
        try:
            return kinds[name](**read)
        except InputError as error:
            to_blame = numbers.get(error.argument or "")
            raise WrongOption(error, f"'{to_blame.hint if to_blame else f'--{option}'}'") from error

    choices: Any = Literal[tuple(kinds)]
    summaries = " ".join(f"{name}: {kind.summary}." for name, kind in kinds.items())  # type: ignore[attr-defined]
    typed = typer.Option(f"--{option}", help=summaries, rich_help_panel=panel)
    first = Parameter(option, Parameter.KEYWORD_ONLY, default=usual, annotation=Annotated[choices, typed])
    return with_signature(choose, [first, *(number.parameter(panel, naming) for number in numbers.values())])


@dataclass(frozen=True)
class _Number:
    """A field of one or more kinds, by their names; the first of them says what it is."""

    name: str
    type: Any
    owners: Mapping[str, Field[Any]]

    def about(self, what: str, otherwise: str | None = None) -> Any:
        return next(iter(self.owners.values())).metadata.get(what, otherwise)

    @property
    def option(self) -> str:
        return str(self.about("option", self.name)).replace("_", "-")

    @property
    def hint(self) -> str:
        return f"--no-{self.option}" if self.type is bool else f"--{self.option}"

    def needed_by(self, kind: str) -> bool:
        field = self.owners.get(kind)
        return field is not None and field.default is MISSING and field.default_factory is MISSING

    def read(self, value: Any) -> Any:
        """The value of the option as one of the field."""
        return _READERS[self.type](f"--{self.option}", value) if self.type in _READERS else value

    def parameter(self, panel: str, naming: bool) -> Parameter:
        *others, last = (f"{kind}{', which needs it' * self.needed_by(kind)}" for kind in self.owners)
        named = f"{', '.join(others)}, and {last}" if others else last
        switch = self.type is bool
        typed = typer.Option(
            f"--{self.option}/--no-{self.option}" if switch else f"--{self.option}",
            help=f"Of {named}: {self.about('help')}" if naming else self.about("help"),
            metavar=self.about("metavar"),
            show_default=not switch,
            rich_help_panel=panel,
        )
        annotation: Any = Annotated[Optional[str if self.type in _READERS else self.type], typed]  # noqa: UP045
        return Parameter(self.name, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _numbers(kinds: Mapping[str, type[Any]]) -> dict[str, _Number]:
    owners: dict[str, dict[str, Field[Any]]] = {}
    types: dict[str, Any] = {}
    for name, kind in kinds.items():
        types |= get_type_hints(kind)
        for field in fields(kind):
            owners.setdefault(field.name, {})[name] = field
    return {field: _Number(field, types[field], of) for field, of in owners.items()}


def _place(option: str, text: str) -> tuple[float, ...]:
    """Three numbers, or angles such as 5deg between the axis and a point, as seen from depth 1."""
    try:
        parts = [str(_tangent(part)) if part.strip().endswith("deg") else part for part in text.split(",")]
    except ValueError as error:
        message = f"{text!r} is not a place: an angle is a number of degrees between -80 and 80, as in 5deg."
        raise typer.BadParameter(message, param_hint=f"'{option}'") from error
    try:
        return tuple(finite_numbers(option, ",".join(parts), "three numbers", (3,)))
    except typer.BadParameter as error:
        message = f"{text!r} is not three numbers, right,down,forward."
        raise typer.BadParameter(message, param_hint=f"'{option}'") from error


def _tangent(angle: str) -> float:
    """Of an angle such as 5deg."""
    degrees = float(angle.strip().removesuffix("deg"))
    # Written so that a NaN is refused too.
    if not abs(degrees) <= _LARGEST_ANGLE:
        raise ValueError(angle)
    return math.tan(math.radians(degrees))


def _number_or_unknown(option: str, text: str) -> float | None:
    """A number, or None for the word that says that it is to be found."""
    if text.strip().lower() == "unknown":
        return None
    return finite_numbers(option, text, "a number, or 'unknown'", (1,))[0]


_READERS: dict[Any, Callable[[str, str], Any]] = {
    tuple[float, float, float]: _place,
    float | None: _number_or_unknown,
}
"""What is typed as a text, by the type of the field."""
