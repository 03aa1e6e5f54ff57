"""Text that mentions keywords, which readers get in words of their own: those of Python, or of the command line.

A message is written as an f-string, and mentions a keyword by what :func:`keyword` returns. Between the marks of a
mention stands what one has to know to word it; :func:`parts` takes the text apart again. The marks are lone surrogates,
which neither text nor file names can hold: what only looks like a keyword stays as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from numbers import Real
from typing import Any, TypeAlias

_BEGIN, _BETWEEN, _END = "\ud800", "\ud801", "\ud802"
_MARKS_ESCAPED = {ord(mark): f"\\u{ord(mark):04x}" for mark in (_BEGIN, _BETWEEN, _END)}
_MENTION = re.compile(f"{_BEGIN}([^{_BEGIN}{_END}]*){_END}")
_NO_VALUE: Any = object()


@dataclass(frozen=True)
class Mention:
    """A keyword in a text, by itself or with a value.

    Attributes
    ----------
    keyword : str
        Its name.
    value : str or None
        The value as Python writes it, on one line and not too long.
    typed : str
        The value as it is typed in a shell, where that can be told from the value alone: texts without quotes, numbers,
        and numbers with commas between. Else nothing.
    kind : str
        The name of the value's type.
    """

    keyword: str
    value: str | None = None
    typed: str = ""
    kind: str = ""

    def __str__(self) -> str:
        """As Python has it: ``scheme='upwind'``, or the bare name."""
        return self.keyword if self.value is None else f"{self.keyword}={self.value}"


Text: TypeAlias = tuple[str | Mention, ...]
Spelling: TypeAlias = Callable[[Mention], str]


def keyword(name: str, value: object = _NO_VALUE, *, written: str | None = None) -> str:
    """A piece of a message that mentions a keyword.

    Parameters
    ----------
    name : str
    value : object, optional
        With it the mention is `scheme='upwind'`, without it `scheme`.
    written : str, optional
        The value in Python, where it is to have fewer digits than its own `repr`.

    Returns
    -------
    str
        To be put into the message of an error or a warning; into no other text.
    """
    if value is _NO_VALUE:
        return _mark(Mention(name))
    return _mark(
        Mention(name, brief(value) if written is None else written, _typed(value, written), type(value).__name__)
    )


def parts(text: str) -> Text:
    """A text taken apart into plain pieces and mentions."""
    found: list[str | Mention] = []
    for number, piece in enumerate(_MENTION.split(text)):
        if number % 2:
            found.append(Mention(*piece.split(_BETWEEN)))
        elif piece:
            found.append(piece)
    return tuple(found)


def worded(text: Iterable[str | Mention], spelling: Spelling = str) -> str:
    """A text put together again, with each mention spelled as its reader knows it."""
    return "".join(piece if isinstance(piece, str) else spelling(piece) for piece in text)


def at_place(place: object, text: str, between: str = "") -> str:
    """A text with its place before it, and a colon, unless it begins with the place by itself.

    Examples
    --------
    >>> from persfs_cl.wording import at_place
    >>> at_place("a.png", "it is empty."), at_place("a.png", "a.png is empty.")
    ('a.png: it is empty.', 'a.png is empty.')
    """
    name = str(place)
    named = text.startswith(name) and text[len(name) : len(name) + 1] in {" ", ",", ":"}
    return f"{between}{text}" if named else f"{name}: {between}{text}"


def nearest(word: str, choices: Iterable[str]) -> str | None:
    """That of some choices which somebody may have meant who gave another word.

    Examples
    --------
    >>> from persfs_cl.wording import nearest
    >>> nearest("ligth", ["mask", "light"]), nearest("colour", ["mask", "light"])
    ('light', None)
    """
    return next(iter(get_close_matches(word, list(choices), n=1)), None)


def marked(text: Iterable[str | Mention]) -> str:
    """The text that :func:`parts` takes apart into this: to be put into another message."""
    return worded(text, _mark)


def _mark(mention: Mention) -> str:
    if mention.value is None:
        return f"{_BEGIN}{mention.keyword}{_END}"
    return f"{_BEGIN}{_BETWEEN.join((mention.keyword, mention.value, mention.typed, mention.kind))}{_END}"


def brief(value: object) -> str:
    """`repr` of a value for a message: at most one line, whatever the value is."""
    return _line(repr, value)


def _line(write: Callable[[object], str], value: object) -> str:
    try:
        text = " ".join(write(value).split())
    except Exception:  # noqa: BLE001  # too many digits, or nested too deep: a message must not fail over it
        text = f"<{type(value).__name__}>"
    text = text.translate(_MARKS_ESCAPED)
    return text if len(text) <= 80 else f"{text[:79]}…"


def _typed(value: object, written: str | None) -> str:
    if isinstance(value, str):
        return _line(str if value.isprintable() else repr, value)
    if _is_number(value):
        return written or _line(str, value)
    if isinstance(value, (tuple, list)) and all(map(_is_number, value)):
        return "".join(written.split()).strip("()[]") if written else ",".join(_line(str, each) for each in value)
    return ""


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
