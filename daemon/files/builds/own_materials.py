"""The user's own materials: `materials.toml` in the data folder, which adds to or replaces materials of the library.

[[materials]]
name = "our glue"
kind = "elastic"                        # "piezo", "elastic", "electrode", "backing" or "fluid"
source = "measured on 12 samples, March 2026"
z_MRayl = { value = 2.9, u = 0.1 }
c_m_s = { value = 2550, u = 80 }
q = { value = 30, u = 10 }
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import cast, get_args

from ....models.build import Quantity
from ....models.materials import MATERIALS, Kind, Material, find
from ..paths import home
from .build_table import BuildError, Table, TomlError, parse_toml
from .file_keys import MATERIAL_ENTRIES, material_keys

_FILE = "materials.toml"


def own_materials() -> tuple[Material, ...]:
    """Return the user's materials; none if there is no file. Raises BuildError if the file is not valid."""
    path = home() / _FILE
    return read_materials(path) if path.exists() else ()


def read_materials(path: Path) -> tuple[Material, ...]:
    """Read materials from a TOML file. Raises BuildError with file, key, what was found and what is allowed."""
    try:
        data = parse_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError, TomlError) as error:
        raise BuildError(f"{path}: cannot be read as TOML: {error}") from None
    top = Table(data, str(path))
    top.only(("materials",))
    materials = tuple(_material(table) for table in top.tables("materials", "material"))
    names = [material.name.casefold() for material in materials]
    for material in materials:
        if names.count(material.name.casefold()) > 1:
            raise BuildError(f"{path}: two materials are called {material.name!r}; every material needs its own name")
    return materials


def all_materials() -> tuple[Material, ...]:
    """Return the user's materials, then those of the library that they do not replace."""
    user_materials = own_materials()
    replaced = {material.name.casefold() for material in user_materials}
    return (*user_materials, *(material for material in MATERIALS if material.name.casefold() not in replaced))


def find_material(name: str) -> Material:
    """Return the material `name`, preferably the user's own. Raises MaterialError, BuildError."""
    return find(name, own_materials())


def _material(table: Table) -> Material:
    kind = table.string("kind")
    if kind not in get_args(Kind):
        raise table.error("kind", f"is {kind!r}; one of {', '.join(get_args(Kind))} is needed")
    keys = material_keys(kind)
    table.only((*MATERIAL_ENTRIES, *keys))
    values = table.quantities(keys)
    if not values:
        raise table.missing("value", f"give at least one of {', '.join(keys)}")
    source = table.string("source") if "source" in table.data else f"{_FILE} of this user"
    quantities = {name: replace(quantity, source=source) for name, quantity in values.items()}
    if "z" not in quantities and {"density", "c"} <= set(quantities):
        density, c = quantities["density"], quantities["c"]
        u = math.hypot(density.u * c.re, density.re * c.u)
        quantities["z"] = Quantity(density.re * c.re, u=u, source=f"density * c, {source}")
    return Material(table.string("name"), cast(Kind, kind), quantities)
