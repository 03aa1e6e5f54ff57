"""The schemes that there are: how new values of cells are found, and what each of them allows."""

from __future__ import annotations

from persfs_cl.checks import check_choice
from persfs_cl.shading.model import Light
from persfs_cl.shading.reflectance import Reflectance
from persfs_cl.solver.schemes.lax_friedrichs import LaxFriedrichs
from persfs_cl.solver.schemes.regularised import Regularised
from persfs_cl.solver.schemes.scheme import Scheme
from persfs_cl.solver.schemes.upwind import Upwind

SCHEMES: dict[str, Scheme] = {scheme.name: scheme for scheme in (LaxFriedrichs(), Upwind(), Regularised())}
"""All schemes, by the names that users type. Whatever else knows of a scheme reads it from here."""

AUTO = "auto"


def scheme_for(name: str, light: Light, reflectance: Reflectance, boundary: str) -> Scheme:
    """The scheme of a name, "auto" resolved: upwind where there is one, and it has the boundary, else the paper's.

    What minimises an energy is taken by its name only.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    if name == AUTO:
        fits = light.has_upwind(reflectance) and boundary in (AUTO, *Upwind.boundaries)
        return SCHEMES[Upwind.name if fits else LaxFriedrichs.name]
    check_choice("scheme", name, (AUTO, *SCHEMES))
    return SCHEMES[name]
