"""The section [limits] of build.toml, or a specification file that holds nothing else.

[limits]
conformance = 0.95                            # how sure a verdict must be; 0.95 where it is left out

[limits.disk]                                 # by layer; keys as in [[layers]], and the derived constants
c33D_1e10_Pa = { min = 14.6, max = 15.6 }
kt = { min = 0.45 }
Qm = { min = 70 }
"""

from dataclasses import replace
from pathlib import Path

from ....models.build import Build
from ....models.specification import USUAL_CONFORMANCE, Limit, Specification, SpecificationError
from .build_table import BuildError, Table, read_table
from .file_keys import LIMIT_KEYS

_ENDS = {"min": ("", "low"), "max": ("", "high"), "min_im": (".im", "low"), "max_im": (".im", "high")}


def read_limits(table: Table) -> Specification:
    """Return the limits of the section. Raises BuildError."""
    conformance = table.number("conformance") if "conformance" in table.data else USUAL_CONFORMANCE
    limits: dict[str, Limit] = {}
    for layer in table.data:
        if layer != "conformance":
            limits |= _of_layer(layer, table.table(layer))
    if not limits:
        raise table.missing("limit", "write a table such as [limits.disk] with kt = { min = 0.45 }")
    try:
        return Specification(limits, conformance)
    except SpecificationError as error:
        raise BuildError(f"{table.source}: {table.path}: {error}") from None


def with_limits(build: Build, path: Path | None) -> Build:
    """Return the build with the limits of a specification file in place of its own. Raises BuildError."""
    if path is None:
        return build
    top = read_table(path)
    top.only(("limits",))
    changed = replace(build, specification=read_limits(top.table("limits")))
    check_limits(changed, str(path))
    return changed


def check_limits(build: Build, source: str) -> None:
    """Raise BuildError if limits name a layer that the build does not have."""
    layers = [layer.name for layer in build.layers]
    for name in build.specification.limits if build.specification else ():
        layer = name.split(".")[0]
        if layer not in layers:
            raise BuildError(f"{source}: limits.{layer}: the build has no such layer; it has {', '.join(layers)}")


def _of_layer(layer: str, table: Table) -> dict[str, Limit]:
    table.only(LIMIT_KEYS)
    ends: dict[str, dict[str, float]] = {}
    given: dict[str, str] = {}
    for key in table.data:
        what = LIMIT_KEYS[key]
        if what.name in given:
            raise table.error(key, f"is given beside {given[what.name]}; give one of the two")
        given[what.name] = key
        inner = table.table(key)
        inner.only(_ENDS)
        if not inner.data:
            raise inner.missing("min or max", f"write {key} = {{ min = ..., max = ... }}")
        for end in inner.data:
            part, side = _ENDS[end]
            ends.setdefault(f"{layer}.{what.name}{part}", {})[side] = what.factor * inner.number(end)
    limits: dict[str, Limit] = {}
    for name, sides in ends.items():
        try:
            limits[name] = Limit(**sides)
        except SpecificationError as error:
            raise table.error(
                given[name.removeprefix(f"{layer}.").removesuffix(".im")], f"has limits: {error}"
            ) from None
    return limits
