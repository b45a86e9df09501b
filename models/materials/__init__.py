"""The material library: each value with its source and standard uncertainty."""

from collections.abc import Iterable
from difflib import get_close_matches

from ..base.errors import PzctlError
from .ceramics import CERAMICS, SHERRIT_RADIAL
from .crystals import CRYSTALS
from .material import Kind, Material
from .passive import PASSIVE

__all__ = ["MATERIALS", "SHERRIT_RADIAL", "Kind", "Material", "MaterialError", "find"]

MATERIALS: tuple[Material, ...] = (*CERAMICS, *CRYSTALS, *PASSIVE)
"""Every material of the library."""


class MaterialError(PzctlError):
    """An unknown material."""


def _key(name: str) -> str:
    return "".join(letter for letter in name.casefold() if letter.isalnum())


def find(name: str, own: Iterable[Material] = ()) -> Material:
    """Return the material named `name`; case, spaces and hyphens do not matter.

    `own`: the user's materials, which have precedence over the library's. Raises MaterialError naming the closest.
    """
    known = {_key(material.name): material for material in (*MATERIALS, *own)}
    found = known.get(_key(name))
    if found is not None:
        return found
    near = [known[key].name for key in get_close_matches(_key(name), known, n=3, cutoff=0.5)]
    guess = f"did you mean {' or '.join(near)}? " if near else ""
    raise MaterialError(f"material {name!r} is not known: {guess}`pzctl materials` lists them all")
