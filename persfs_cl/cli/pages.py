"""Pages that tables go into, checked before the tables are made."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import typer

from persfs_cl.page import ENVIRONMENT, marked, read_page

_OPTION = "'--page'"


def check_page(
    page: Path, *, quick: bool, wanted: Collection[str] | None = None, known: Collection[str] | None = None
) -> None:
    """Refuse a page that the tables cannot go into.

    Parameters
    ----------
    page : Path
    quick : bool
        Whether what is to come is less than a page shows.
    wanted : collection of str, optional
        Tables to come; the page must have a place for one of them. Any table when not given.
    known : collection of str, optional
        All tables that there are; the page must have a place for no other.

    Raises
    ------
    typer.BadParameter
        Naming the page and the marker.
    InputError
        When the page cannot be read.
    """
    if quick:
        raise typer.BadParameter("a page wants all tables in full: leave out --quick.", param_hint=_OPTION)
    places = set(marked(read_page(page))) - {ENVIRONMENT}
    if known is not None and (unknown := places.difference(known)):
        raise typer.BadParameter(
            f"{page} has a marker <!-- {min(unknown)} -->, but no such table is made: use {', '.join(known)}, or "
            f"{ENVIRONMENT}.",
            param_hint=_OPTION,
        )
    if not (places if wanted is None else places.intersection(wanted)):
        example = "table1-me" if wanted is None else next(iter(wanted))
        raise typer.BadParameter(
            f"{page} holds no marker of a table that is to come, such as <!-- {example} --> followed by a line with "
            "<!-- end -->.",
            param_hint=_OPTION,
        )
