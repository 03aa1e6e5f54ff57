"""An option as a line of TOML: what a value there means for it, and how its own value is written."""

from __future__ import annotations

import inspect
import textwrap
import types
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import typer

from persfs_cl.cli.spelling import meant_by
from persfs_cl.wording import brief

_WIDTH = 110
_REMEDIES = {bool: "give true or false.", int: "give a whole number.", float: "give a number."}
_LARGEST = 2.0**63
"""Whole numbers of TOML are smaller."""

_TYPES: dict[Any, Any] = {bool: bool, int: int, float: (int, float)}
"""Of Python's types for values of TOML; all others take a text."""


@dataclass(frozen=True)
class MayBePath:
    """Put into the annotation of an option that is a text: what the text stands for, a path or something else.

    Attributes
    ----------
    meaning : callable
        Takes the text.
    """

    meaning: Callable[[str], object]

    def at(self, folder: Path, text: str) -> str:
        """The text, with a path that begins at a folder."""
        found = self.meaning(text)
        # A path that begins at the root stays as it is written: Python would take a slash off its end.
        return str(folder / found) if isinstance(found, Path) and not found.is_absolute() else text


class WrongValue(Exception):  # noqa: N818  # the message is the remedy alone
    """What stands in a file is no value for the option; says what is one."""


@dataclass(frozen=True)
class Setting:
    """An option of a command, as it stands in a file.

    Attributes
    ----------
    parameter : str
        Name of the command's parameter.
    name : str
        Its name in the file: the option's, without the dashes.
    kind : type
        What one value is.
    many : bool
        Whether the option may be given several times.
    default : object
    help, metavar, panel : str
        As the command's help has them; "" where it has none.
    path : MayBePath or None
    """

    parameter: str
    name: str
    kind: Any
    many: bool
    default: Any
    help: str
    metavar: str
    panel: str
    path: MayBePath | None

    @property
    def choices(self) -> tuple[str, ...]:
        """The words of which it takes one; none where it takes anything else."""
        words = tuple(map(str, get_args(self.kind)))
        return words or (tuple(self.metavar.strip("<>").split("|")) if self.metavar.startswith("<") else ())

    def typed(self, value: Any, folder: Path) -> Any:
        """A value of TOML as the command line would have it.

        Raises
        ------
        WrongValue
            When it has the wrong type.
        """
        if self.many:
            return [self._one(each, folder) for each in (value if isinstance(value, list) else [value])]
        return self._one(value, folder)

    def _one(self, value: Any, folder: Path) -> Any:
        words = get_args(self.kind)
        if words and value not in words:
            raise WrongValue(f"give one of {', '.join(map(as_toml, words))}.{meant_by(self.parameter, str(value))}")
        if self.kind is str:
            text = _text(value)
            return self.path.at(folder, text) if self.path else text
        # For Python, but for nobody else, true is a number.
        if not isinstance(value, _TYPES.get(self.kind, str)) or (isinstance(value, bool) and self.kind is not bool):
            raise WrongValue(_REMEDIES.get(self.kind, "give a text."))
        if self.kind is float:
            try:
                return float(value)
            except OverflowError:
                raise WrongValue("give a smaller number.") from None
        return str(folder / value) if self.kind is Path else value

    def lines(self, value: Any) -> Iterator[str]:
        """What stands in a file for a value of the option, with its help; a comment where it is the default."""
        yield from _comment(f"{self.help} One of {', '.join(self.choices)}." if self.choices else self.help)
        off = value == self.default or (self.many and not value)
        yield f"{'#' * off}{self.name} = {self._example() if off and value in (None, []) else self._toml(value)}"

    def _toml(self, value: Any) -> str:
        if self.many:
            return as_toml([self._plain(each) for each in value])
        return as_toml(self._plain(value))

    def _plain(self, value: Any) -> Any:
        """With paths that hold wherever the file will lie, and numbers that are texts to the command as numbers."""
        if self.path:
            value = self.path.at(Path.cwd(), value)
        if self.kind is Path:
            # Some versions of typer leave it a text.
            return str(Path(value).absolute())
        return _number(value) if isinstance(value, str) and self.kind is str else value

    def _example(self) -> str:
        """In place of a value where there is none."""
        if self.kind is bool:
            return "true"
        return as_toml("|".join(get_args(self.kind)) or self.metavar or self.kind.__name__.upper())


def settings_of(
    callback: Callable[..., Any] | None, parameters: Iterable[Any], apart: Iterable[str]
) -> dict[str, Setting]:
    """The options of a command that a file may hold, by their names there.

    Parameters
    ----------
    callback : callable or None
        The command's function, if it has one.
    parameters : iterable
        The command's parameters.
    apart : iterable of str
        Names of those that a file may not hold, besides arguments and what is required.
    """
    kinds = inspect.signature(callback, eval_str=True).parameters if callback else {}
    settings = {}
    for each in parameters:
        if each.param_type_name != "option" or each.required or each.name not in kinds or each.name in apart:
            continue
        annotation = kinds[each.name].annotation
        kind, *notes = get_args(annotation) if get_origin(annotation) is Annotated else (annotation,)
        kind, many = _kind(kind)
        name = max(each.opts, key=len).lstrip("-")
        settings[name] = Setting(
            each.name,
            name,
            kind,
            many,
            kinds[each.name].default,
            each.help or "",
            each.metavar or "",
            each.rich_help_panel or "Options",
            next((note for note in notes if isinstance(note, MayBePath)), None),
        )
    return settings


def dumped(settings: Collection[Setting], values: Mapping[str, Any], command: str) -> str:
    """A file with the values in force, and all else that could be said in comments.

    Raises
    ------
    typer.BadParameter
        When a value is a path that no text can hold.
    """
    lines = _comment(
        f"Options of '{command}', for --config. One with a # before its name is not set: what follows is its default, "
        "or stands for what it may be."
    )
    for panel in dict.fromkeys(setting.panel for setting in settings):
        lines += ["", "", f"# {panel}", f"# {'-' * len(panel)}"]
        for setting in settings:
            if setting.panel == panel:
                lines += ["", *setting.lines(values[setting.parameter])]
    text = "\n".join(lines) + "\n"
    try:
        text.encode()
    except UnicodeEncodeError as error:
        line = text[text.rfind("\n", 0, error.start) + 1 : text.find("\n", error.start)]
        raise typer.BadParameter(
            f"{brief(line)} has bytes that are no text, which TOML does not hold: name the file otherwise.",
            param_hint="'--dump-config'",
        ) from error
    return text


def as_toml(value: Any) -> str:
    """A value as TOML writes it."""
    import tomlkit  # slow

    return str(tomlkit.item(value).as_string())


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text.strip(), _WIDTH, initial_indent="# ", subsequent_indent="# ")


def _kind(annotation: Any) -> tuple[Any, bool]:
    """The type of one value, and whether there may be several."""
    if get_origin(annotation) in (Union, types.UnionType):
        annotation = next(each for each in get_args(annotation) if each is not type(None))
    if get_origin(annotation) is list:
        return get_args(annotation)[0], True
    return annotation, False


def _text(value: Any) -> str:
    """What would be typed for it: numbers in their own words, several with commas between."""
    each = value if isinstance(value, list) else [value]
    if not each or any(isinstance(one, bool) or not isinstance(one, (str, int, float)) for one in each):
        raise WrongValue("give a text or a number, or a list of them where the option takes several.")
    return ",".join(map(str, each))


def _number(text: str) -> str | int | float:
    """The number that a text is, if it is typed in no other way."""
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        if str(number) == text and abs(number) < _LARGEST:
            return number
    return text
