"""Errors and warnings of the library in the words of a command: its options in place of keywords."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import typer

from persfs_cl.errors import Worded, spelled
from persfs_cl.shading.lights import LIGHTS
from persfs_cl.shading.materials import MATERIALS
from persfs_cl.wording import Mention, Spelling

_KINDS = {kind.__name__: name for kinds in (LIGHTS, MATERIALS) for name, kind in kinds.items()}
"""What is typed for values that are told by their type."""


_SEVERAL = {"depth_range": ("near", "far")}
"""Keywords for which a command has an option for each of their parts."""

_UNKNOWN = "unknown"
"""What is typed for None, where an option takes it."""


_SUN = (
    "Give --light parallel, and its direction by --p0 and --q0: --p0 1 is a sun on the left, 45 degrees from the view."
)
_LAMP = "Give --light flash for a lamp at the camera, and --lamp for one beside the lens."
_MEANT = {
    "light": {
        **dict.fromkeys(("sun", "sunlight", "daylight", "directional", "distant"), _SUN),
        **dict.fromkeys(("lamp", "torch", "point", "led", "endoscope"), _LAMP),
    },
    "guide_unit": {
        **dict.fromkeys(("mm", "millimetres", "millimeters"), "Give 0.001 for millimetres where depths are in metres."),
        **dict.fromkeys(("cm", "centimetres", "centimeters"), "Give 0.01 for centimetres where depths are in metres."),
        **dict.fromkeys(("m", "metres", "meters"), "Give 1 where depths are in metres too."),
    },
    "p0": dict.fromkeys(("left", "right"), "Give 1 for a sun on the left, 45 degrees from the view, -1 on the right."),
}
"""What helps those who give another word than one that is taken, by the parameter and the word."""


def meant_by(parameter: str | None, word: str) -> str:
    """What to give where a word is none of the choices, to be put after the message; mostly nothing."""
    remedy = _MEANT.get(parameter or "", {}).get(word.lower())
    return f" {remedy}" if remedy else ""


class WrongOption(typer.BadParameter):
    """An error of the library about what stands on the command line."""

    def __init__(self, error: Worded, hint: str | None = None) -> None:
        super().__init__(str(error), param_hint=hint)
        self.error = error

    def word(self, spelling: Spelling) -> None:
        """Take the words of the command for the message."""
        self.message = self.error.worded(spelling)


@dataclass(frozen=True)
class _Option:
    """What is typed for a keyword: its name, the name that turns it off, and whether it may be unknown."""

    name: str
    off: str
    may_be_unknown: bool


@dataclass(frozen=True)
class _OptionNames:
    """A spelling that processes of devices can be sent, by the keywords of a command's options."""

    options: Mapping[str, _Option]

    def __call__(self, mention: Mention) -> str:
        option = self.options.get(mention.keyword)
        if option is None:
            several = [self.options[name] for name in _SEVERAL.get(mention.keyword, ()) if name in self.options]
            return "/".join(each.name for each in several) or str(mention)
        if mention.value == "None" and option.may_be_unknown:
            return f"{option.name} {_UNKNOWN}"
        if mention.value == "False" and option.off:
            return option.off
        return f"{option.name} {mention.typed or _KINDS.get(mention.kind, '')}".rstrip()


def spelling(parameters: Iterable[Any], *, instead: Mapping[str, str] = MappingProxyType({})) -> Spelling:
    """How a command spells keywords: `scheme='upwind'` as `--scheme upwind`; those that it lacks as Python does.

    Parameters
    ----------
    parameters : iterable
        Those of the command.
    instead : mapping, optional
        Keywords that were given by another option, such as guides by a folder of them, with the keyword of that.
    """
    options = {
        each.name: _Option(each.opts[0], next(iter(each.secondary_opts), ""), _UNKNOWN in (each.metavar or ""))
        for each in parameters
        if each.param_type_name == "option"
    }
    return _OptionNames({**options, **{name: options[given] for name, given in instead.items()}})


def source_of_camera(source: str) -> str:
    """What told the focal length, `source` of a report, as a reader of the command knows it.

    Examples
    --------
    >>> from persfs_cl.cli.spelling import source_of_camera
    >>> source_of_camera("focal_length"), source_of_camera("fov of table.csv"), source_of_camera("EXIF FocalLength")
    ('--focal-length', 'table.csv', 'EXIF FocalLength')
    """
    name, _, table = source.partition(" of ")
    return source if source.startswith("EXIF") else table or f"--{name.replace('_', '-')}"


def in_a_line(message: Warning | Exception | str, spell: Spelling) -> str:
    """The same where many are listed, each on a line."""
    return " ".join(spelled(message, spell).splitlines())
