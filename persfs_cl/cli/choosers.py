"""Options that say one thing together: a camera, a light, a material.

A *chooser* is a function whose parameters are such options, as typer has them, and which returns the thing. A command
that takes things has the options of their choosers, and needs to know none of them.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

_Chosen = TypeVar("_Chosen")


def takes(
    together: Callable[..., None] = lambda **_chosen: None, /, **choosers: Callable[..., Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options of choosers, and in their place, under a parameter's name, what each has chosen.

    The choosers are called in the order in which they are given. Then `together` is called with all that they have
    chosen, and refuses what does not go together. What is decorated has both alone as its attribute `check`: a function
    of the options' values, others besides.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        options = {name: signature(chooser) for name, chooser in choosers.items()}
        own = inspect.signature(command, eval_str=True).parameters

        def chosen(values: dict[str, Any]) -> dict[str, Any]:
            found = {
                name: chooser(**{option: values.pop(option) for option in options[name]})
                for name, chooser in choosers.items()
            }
            together(**found)
            return found

        @functools.wraps(command)
        def run(**values: Any) -> None:
            things = chosen(values)
            command(**values, **things)

        run.check = lambda **values: chosen(values)  # type: ignore[attr-defined]

        parameters = [
            option for name, each in own.items() for option in (options[name].values() if name in options else [each])
        ]
        return with_signature(run, parameters)

    return decorate


def signature(chooser: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """The options of a chooser."""
    return dict(inspect.signature(chooser, eval_str=True).parameters)


def with_signature(function: Callable[..., _Chosen], parameters: list[inspect.Parameter]) -> Callable[..., _Chosen]:
    """A function that takes keywords, with its signature in the places where typer looks for it."""
    keywords = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters]
    function.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    function.__annotations__ = {parameter.name: parameter.annotation for parameter in keywords}
    return function
