"""The material library: each value with its source and standard uncertainty."""

from collections.abc import Iterable

from ..base.errors import PzctlError
from ..base.names import bare, likely_meant
from .ceramics import CERAMICS, SHERRIT_RADIAL
from .crystals import CRYSTALS
from .material import Kind, Material
from .passive import PASSIVE

__all__ = ["MATERIALS", "SHERRIT_RADIAL", "Kind", "Material", "MaterialError", "find"]

MATERIALS: tuple[Material, ...] = (*CERAMICS, *CRYSTALS, *PASSIVE)
"""Every material of the library."""


class MaterialError(PzctlError):
    """An unknown material."""


def find(name: str, own: Iterable[Material] = ()) -> Material:
    """Return the material named `name`; case, spaces and hyphens do not matter.

    `own`: the user's materials, which have precedence over the library's. Raises MaterialError naming the closest.
    """
    known = {bare(material.name): material for material in (*MATERIALS, *own)}
    found = known.get(bare(name))
    if found is not None:
        return found
    near = likely_meant(name, (material.name for material in known.values()), most=3)
    guess = f"did you mean {' or '.join(near)}? " if near else ""
    raise MaterialError(f"material {name!r} is not known: {guess}`pzctl materials` lists them all")
