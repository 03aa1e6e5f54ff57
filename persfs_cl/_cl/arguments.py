"""The arguments of a kernel, read from its source text: the one place where their names and types are kept."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from persfs_cl.errors import KernelBuildError

_SCALARS: dict[str, type[np.generic]] = {
    "int": np.int32,
    "uint": np.uint32,
    "long": np.int64,
    "ulong": np.uint64,
    "float": np.float32,
    "double": np.float64,
}
_QUALIFIERS = {"const", "volatile", "restrict", "__private", "private"}
_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_ATTRIBUTE = re.compile(r"\b__attribute__\s*(?=\()")
_KERNEL = re.compile(r"\b(?:__kernel|kernel)\s+void\s+(\w+)\s*(?=\()")
_NAME = re.compile(r"(\w+)\s*(?:\[[^]]*\]\s*)?$")


@dataclass(frozen=True)
class Argument:
    """An argument of a kernel.

    Attributes
    ----------
    name : str
    scalar : type or None
        NumPy type of a number; None for a buffer, or local memory.
    """

    name: str
    scalar: type[np.generic] | None


def arguments_of(source: str, kernel: str, real: type[np.generic]) -> tuple[Argument, ...]:
    """The arguments of a kernel in their order.

    Parameters
    ----------
    source : str
        OpenCL C in which the kernel is defined. Arguments stand there as they are, not by way of a macro or `#if`.
    kernel : str
        Name of its function.
    real : type
        What the type `real` of the kernels stands for.

    Raises
    ------
    KernelBuildError
        When the source has no such kernel, or an argument has a type that is neither a pointer nor a number.
    """
    text = _without_attributes(_COMMENT.sub(" ", source))
    for match in _KERNEL.finditer(text):
        if match[1] == kernel:
            listed = text[match.end() + 1 : _closing(text, match.end())]
            parts = [part for part in listed.split(",") if part.strip() not in ("", "void")]
            return tuple(_argument(part, kernel, real) for part in parts)
    raise KernelBuildError(f"There is no __kernel function {kernel!r} in the kernel files: see that one defines it.")


def _argument(declaration: str, kernel: str, real: type[np.generic]) -> Argument:
    found = _NAME.search(declaration.strip())
    if found and "#" not in declaration:
        if "*" in declaration or "[" in declaration:
            return Argument(found[1], None)
        words = [word for word in declaration.split()[:-1] if word not in _QUALIFIERS]
        kinds = {"real": real, **_SCALARS}
        if len(words) == 1 and words[0] in kinds:
            return Argument(found[1], kinds[words[0]])
    raise KernelBuildError(
        f"The argument {' '.join(declaration.split())!r} of the kernel {kernel!r} is neither a pointer nor one number: "
        f"use one of the types real, {', '.join(_SCALARS)}, or a pointer."
    )


def _without_attributes(text: str) -> str:
    while match := _ATTRIBUTE.search(text):
        text = text[: match.start()] + " " + text[_closing(text, match.end()) + 1 :]
    return text


def _closing(text: str, opening: int) -> int:
    """Where the parenthesis closes that opens there."""
    depth = 0
    for place in range(opening, len(text)):
        depth += {"(": 1, ")": -1}.get(text[place], 0)
        if depth == 0:
            return place
    raise KernelBuildError("A parenthesis in the kernel files is not closed: mend the arguments or attribute after it.")
