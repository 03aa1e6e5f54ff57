"""Options from files: ``--config`` and ``--dump-config``, for any command.

A file is TOML, and its names are those of the options without the dashes before them. The command line comes first:
what stands there is not looked for in a file. Not in a file are arguments, what is required, and where results go: they
differ from call to call.
"""

from __future__ import annotations

import copy
import functools
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from persfs_cl.cli.choosers import signature, with_signature
from persfs_cl.cli.settings import Setting, WrongValue, as_toml, dumped, settings_of
from persfs_cl.cli.spelling import WrongOption, meant_by, spelling
from persfs_cl.errors import PersfsError
from persfs_cl.wording import nearest

_CONFIG, _DUMP = "config", "dump_config"
_APART = (_CONFIG, _DUMP, "output")
_ALTERNATIVES = (
    frozenset({"focal_length", "fov", "camera", "cameras"}),
    frozenset({"principal_point", "camera", "cameras"}),
    frozenset({"distortion", "camera", "cameras"}),
    frozenset({"mask", "masks"}),
    frozenset({"guide", "guides"}),
    frozenset({"overwrite", "skip_existing", "retry_failed"}),
)
"""Options that say one thing in several ways: what is given sets the others aside that stood in an earlier place."""

_UNSET = ", as a variable that is not set leaves it"

_LARGEST = 2**20
"""Bytes of a file; a photo that is given by mistake has more."""

ConfigOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--config",
        metavar="FILE",
        help="TOML file with options by their names, such as focal-length = 590. Those on the command line win. Of "
        "several files the later one wins, name by name. Relative paths in a file start at its folder.",
    ),
]
DumpOption = Annotated[
    bool,
    typer.Option(
        "--dump-config", help="Print the options in force as such a file, with all others as comments, and exit."
    ),
]


def configurable(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options --config and --dump-config.

    They do something where the command is a :class:`ConfiguredCommand`: the command itself never sees them.
    """

    @functools.wraps(command)
    def run(**values: Any) -> None:
        del values[_CONFIG], values[_DUMP]
        command(**values)

    own = signature(command)
    before = [each for each in own.values() if each.default is each.empty]
    rest = [each for each in own.values() if each.default is not each.empty]
    return with_signature(run, [*before, *signature(_options).values(), *rest])


def _options(config: ConfigOption = None, dump_config: DumpOption = False) -> None:
    """The two, as they are declared."""


_WIDEST = 16
"""Letters that the choices of an option may take in the help's column of values."""


_ON, _OFF = ("yes", "true", "on"), ("no", "false", "off")
"""What people type after a flag."""


def bare_flags(parameters: list[Any]) -> list[Any]:
    """The parameters, with nothing in the help's column of values for those that take none."""
    for each in parameters:
        if getattr(each, "is_flag", False):
            each.metavar = ""
    return parameters


class ConfiguredCommand(TyperCommand):
    """A command of the app that reads files of options, if it is :func:`configurable`."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Those of the class above, with nothing in the place of a value where they take none."""
        return bare_flags(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the files before the command line is looked at in earnest.

        Raises
        ------
        typer.BadParameter
            When a file, or what stands in it, cannot be used; with --dump-config, when options contradict each other.
        typer.Exit
            After --dump-config.
        """
        if not ctx.resilient_parsing and (slip := self._slip(args)):
            ctx.fail(slip)
        if not any(parameter.name == _CONFIG for parameter in self.params):
            return self._parsed(ctx, args)
        given, _, _ = self.make_parser(ctx).parse_args(args=list(args))
        if given.get("help"):
            return super().parse_args(ctx, args)
        settings = settings_of(self.callback, self.params, _APART)
        read = self._read(ctx, settings, [Path(file) for file in given.get(_CONFIG) or ()])
        in_force = {name: one for name, one in read.items() if not (_same_as(name) & given.keys())}
        ctx.meta[__name__] = in_force
        ctx.default_map = {name: one.value for name, one in in_force.items()}
        if not given.get(_DUMP):
            return self._parsed(ctx, args)
        # It is a question about options: what is required besides need not be there.
        relaxed = copy.copy(self)
        relaxed.params = [_optional(parameter) for parameter in self.params]
        super(ConfiguredCommand, relaxed).parse_args(ctx, args)
        self._require_usable(ctx)
        typer.echo(dumped(settings.values(), ctx.params, ctx.command_path).encode(), nl=False)
        raise typer.Exit

    def _parsed(self, ctx: Any, args: list[str]) -> list[str]:
        """As the class above does it, but for what it says of arguments too many."""
        ctx.allow_extra_args = True
        rest = super().parse_args(ctx, args)
        if ctx.args and not ctx.resilient_parsing:
            ctx.fail(self._why_too_many(ctx.args))
        return rest

    def _slip(self, args: list[str]) -> str | None:
        """What helps where a value is empty, a flag has one, or a choice is an option; None where none is seen."""
        # What follows is no option, whatever it looks like.
        args = args[: args.index("--")] if "--" in args else args
        options = [each for each in self.params if each.param_type_name == "option"]
        names = {name: each for each in options for name in (*each.opts, *each.secondary_opts)}
        valued = {name for name, each in names.items() if not getattr(each, "is_flag", False)}
        after = [name for name, word in pairwise(["", *args]) if not word]
        joined = [each.removesuffix("=") for each in args if each.startswith("--") and each.endswith("=")]
        for name in (*after, *joined):
            if name in valued:
                what = names[name].metavar or "a value"
                remedy = what if names[name].required else f"{what}, or leave {name} out"
                return f"{name} is empty{_UNSET}: give {remedy}."
        taken = self._arguments().rstrip(".")
        if taken and any(name in names or "=" in name or not name.startswith("-") for name in after):
            return f"An argument is empty{_UNSET}: give {taken}."
        for name, word in pairwise(args):
            if not getattr(names.get(name), "is_flag", False) or word.lower() not in _ON + _OFF or Path(word).exists():
                continue
            remedy = f"leave {word} out"
            if word.lower() in _OFF:
                contrary = {*names[name].opts, *names[name].secondary_opts} - {name}
                remedy = f"give {contrary.pop()}" if names[name].secondary_opts else "leave both out"
            return f"{name} {word}: {name} takes no value, {remedy}."
        for name in (each.partition("=")[0] for each in args if each.startswith("--")):
            if name not in names and (meant := self._choice(name.removeprefix("--"))):
                return f"No such option: {name}. {meant}"
        return None

    def _choice(self, word: str) -> str | None:
        """What to give where the name of an option is a value of another one."""
        settings = settings_of(self.callback, self.params, ()).values()
        owners = [f"--{one.name}" for one in settings if word in one.choices]
        if len(owners) == 1:
            return f"Give {owners[0]} {word}."
        # What is said of other words is of use after the name of their option alone.
        return meant_by("light", word).strip() or None if any(one.parameter == "light" for one in settings) else None

    def _arguments(self) -> str:
        return " ".join(each.metavar or "" for each in self.params if each.param_type_name == "argument")

    def _why_too_many(self, extra: list[str]) -> str:
        text = (
            f"{' '.join(extra)} is too much: 'persfs-cl {self.name}' takes {self._arguments() or 'options alone'}. A "
            "name with spaces goes in quotes."
        )
        return f"{text} For several photos there is 'persfs-cl batch'." if self.name == "reconstruct" else text

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, so that it fits a terminal of 80 columns."""
        choices = {one.parameter: one.choices for one in settings_of(self.callback, self.params, ()).values()}
        narrow = copy.copy(self)
        narrow.params = [_narrow(parameter, choices.get(parameter.name, ())) for parameter in self.params]
        super(ConfiguredCommand, narrow).format_help(ctx, formatter)

    def invoke(self, ctx: Any) -> Any:
        """Say of an option that cannot be used in which file it stands."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            self._say_where(ctx, error)
            raise

    def _require_usable(self, ctx: Any) -> None:
        """Refuse options that contradict each other: a file of them would be of no use. What they lack may follow."""
        try:
            # A file that is named, such as a camera's, need not be there yet.
            with suppress(PersfsError):
                getattr(self.callback, "check", lambda **_values: None)(**ctx.params)
        except typer.BadParameter as error:
            self._say_where(ctx, error)
            raise

    def _read(self, ctx: Any, settings: dict[str, Setting], files: list[Path]) -> dict[str, _Given]:
        """What files hold, by the names of the parameters."""
        parameters = {parameter.name: parameter for parameter in self.params}
        read: dict[str, _Given] = {}
        for file in files:
            here: dict[str, _Given] = {}
            for written, value in _parsed(file).items():
                place = f"{file}: {written} = {_shown(value)}"
                setting = settings.get(written.replace("_", "-"))
                if setting is None:
                    raise _refused(f"{place}: {self._why_unknown(written, settings)}")
                if setting.parameter in here:
                    raise _refused(f"{place}: {setting.name} stands there twice. Take one of them out.")
                try:
                    text = setting.typed(value, file.parent)
                    parameters[setting.parameter].process_value(ctx, text)
                except WrongValue as error:
                    raise _refused(f"{place}: {error}") from error
                except typer.BadParameter as error:
                    raise _refused(f"{place}: {self._worded(error).removeprefix('Value error, ')}") from error
                here[setting.parameter] = _Given(text, place)
            for name in here:
                for other in _same_as(name):
                    read.pop(other, None)
            read |= here
        return read

    def _why_unknown(self, written: str, settings: dict[str, Setting]) -> str:
        name = written.replace("_", "-")
        if any(f"--{name}" in each.opts or each.name == written for each in self.params):
            return "that is said on the command line alone. Take it out."
        near = nearest(name.removeprefix("no-"), settings)
        meant = f"Is it {near}? " if near else ""
        return f"there is no such option. {meant}--dump-config lists all that there are."

    def _say_where(self, ctx: Any, error: typer.BadParameter) -> None:
        """Add the lines of files that have to do with an error to its message."""
        text = f"{error.param_hint or ''} {self._worded(error)}"
        words = {word.strip(".,:;'\"") for word in text.split()}
        places = [
            given.place
            for parameter in self.params
            if (given := ctx.meta.get(__name__, {}).get(parameter.name))
            and words & {*parameter.opts, *parameter.secondary_opts}
        ]
        if not places:
            return
        where = f"(From {'; '.join(places)}.)"
        if isinstance(error, WrongOption):
            error.error = error.error.adding(where)
        error.message = f"{error.message} {where}"

    def _worded(self, error: typer.BadParameter) -> str:
        return error.error.worded(spelling(self.params)) if isinstance(error, WrongOption) else error.message


@dataclass(frozen=True)
class _Given:
    """A value that a file gives for an option.

    Attributes
    ----------
    value : object
        As the command line would have it.
    place : str
        File, name and value, for messages.
    """

    value: Any
    place: str


def _parsed(file: Path) -> dict[str, Any]:
    """The names and values of a file."""
    import tomlkit  # slow
    from tomlkit.exceptions import TOMLKitError

    try:
        with file.open("rb") as stream:
            data = stream.read(_LARGEST + 1)
    except OSError as error:
        raise _refused(f"{file} cannot be read: {error.strerror}. Name a file of TOML.") from error
    if len(data) > _LARGEST:
        raise _refused(f"{file} is larger than any file of options. Name a file of TOML.")
    try:
        return tomlkit.parse(data.decode("utf-8-sig")).unwrap()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise _refused(f"{file} is no text in UTF-8, in line {line}. Name a file of TOML.") from error
    except TOMLKitError as error:
        remedy = _quoted(data.decode("utf-8-sig"), getattr(error, "line", 0))
        raise _refused(f"{file} is no TOML: {error}. {remedy}") from error


def _quoted(text: str, line: int) -> str:
    """What helps where a line, counted from 1, is no TOML: mostly a text lacks its quotes."""
    written = "".join(text.splitlines()[max(line - 1, 0) : line])
    found = re.fullmatch(r"\s*([\w-]+)\s*=\s*([^\W\d][^\"'#]*|[~./][^\"'#]*)", written)
    if found is None:
        return "A line of it is such as focal-length = 590."
    return f"Text stands in quotes: {found[1]} = {as_toml(found[2].strip())}"


def _shown(value: Any) -> str:
    """A value as it stands in the file, on a line that is not too long."""
    text = " ".join(as_toml(value).split())
    return text if len(text) <= 80 else f"{text[:79]}…"


def _same_as(name: str) -> set[str]:
    """The options that say what one says, itself included."""
    return {name}.union(*(names for names in _ALTERNATIVES if name in names))


def _narrow(parameter: Any, choices: tuple[str, ...]) -> Any:
    """The same parameter with what is long told in its help, which wraps, and not in columns of their own."""
    narrow = copy.copy(parameter)
    if len("|".join(choices)) > _WIDEST:
        narrow.metavar = "NAME"
        if not all(choice in parameter.help for choice in choices):
            narrow.help = f"{parameter.help} One of {', '.join(choices)}."
    if parameter.secondary_opts:
        narrow.secondary_opts = []
        default = "On by default: " if parameter.default is True else ""
        narrow.help = f"{parameter.help} {default}{' or '.join(parameter.secondary_opts)} turns it off."
        narrow.show_default = False
    return narrow


def _optional(parameter: Any) -> Any:
    other = copy.copy(parameter)
    other.required = False
    return other


def _refused(message: str) -> typer.BadParameter:
    return typer.BadParameter(message, param_hint="'--config'")
