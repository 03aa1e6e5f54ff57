"""What mkdocstrings must be told of this project's docstrings: their references, and keywords that a table holds."""

from __future__ import annotations

import inspect
import re
from typing import Any

import griffe

import persfs_cl

# :func:`reconstruct`, or :class:`its words <persfs_cl.surface.solved.SolvedSurface>`.
_ROLE = re.compile(r":(?:func|class|meth|attr|data|mod):`(?:(?P<words>[^`<]+) <)?(?P<name>[^`<>]+)>?`")


class Docstrings(griffe.Extension):
    """Sphinx's roles become links, and decorators that give a signature are asked for it."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change one docstring."""
        if obj.docstring is not None:
            obj.docstring.value = _ROLE.sub(lambda role: _reference(role, obj), obj.docstring.value)

    def on_function(self, *, func: griffe.Function, **_: Any) -> None:
        """Replace ``**options`` by the keywords of their table."""
        if any(each.callable_path.endswith("with_options") for each in func.decorators):
            signature = inspect.signature(getattr(persfs_cl, func.name))
            func.parameters = griffe.Parameters(*map(_parameter, signature.parameters.values()))


def _parameter(given: inspect.Parameter) -> griffe.Parameter:
    default = None if given.default is inspect.Parameter.empty else repr(given.default)
    kind = griffe.ParameterKind(given.kind.description)
    return griffe.Parameter(given.name, kind=kind, default=default)


def _reference(role: re.Match[str], obj: griffe.Object) -> str:
    name = role["name"]
    public = name.partition(".")[0] in persfs_cl.__all__
    kind = obj if obj.is_class else obj.parent
    if public:
        name = f"persfs_cl.{name}"
    elif not name.startswith("persfs_cl.") and kind is not None:
        name = f"{kind.path}.{name}"
    words = role["words"] or role["name"].removeprefix("persfs_cl.")
    # Private modules have no page: then the words stand as they are.
    return f'<autoref identifier="{name}" optional><code>{words}</code></autoref>'
