"""build.toml: one transducer, its layers and gluing steps, read into a `Build`; and a `Build` as plain JSON."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, cast

import msgspec

from ....models.base.errors import PzctlError
from ....models.build import NEEDED, BoltSpec, Build, LayerSpec, LoadSpec, Quantity, Step
from ....models.metadata import MetadataError, check_metadata
from ....models.specification import SpecificationError
from ....models.sweep_plan import LevelLimits, PlanError, Segment, SweepPlan
from .build_check import check_build
from .build_table import BuildError, Table, TomlError, keys_for, parse_toml
from .effects_table import with_effects
from .file_keys import (
    BOLT_ENTRIES,
    BOLT_KEYS,
    ELASTIC_KEYS,
    ELECTRICAL_ENTRIES,
    ELECTRODE_KEYS,
    FREQUENCY_UNITS,
    HOLE_KEYS,
    LAYER_ENTRIES,
    LAYER_SIZE_KEYS,
    LOAD_ENTRIES,
    MASS_KEYS,
    PIEZO_KEYS,
    POLED_ENTRIES,
    SAMPLE_ENTRIES,
    SEGMENT_ENTRIES,
    SIZE_KEYS,
    STEP_ENTRIES,
    SWEEP_ENTRIES,
    THICKNESS_KEYS,
    TOP_ENTRIES,
    Z_KEYS,
)
from .limits_table import read_limits
from .own_materials import find_material
from .tied_parameters import CERAMIC, resolved

__all__ = ["BuildError", "build_from_json", "build_to_json", "parse_build", "read_build", "read_metadata", "read_plan"]

THESIS_BUILD = Path(__file__).with_name("thesis.toml")
"""The transducer of the 2012 thesis, which is also the one on the simulated bench."""

_LARGEST = 1_000_000
"""Bytes. A build file has a few kilobytes; anything larger is another file given by mistake."""


def read_build(path: Path | str) -> Build:
    """Read a transducer from build.toml. Raises BuildError with one sentence for a person."""
    path = Path(path)
    try:
        if path.is_dir():
            raise BuildError(f"{path}: this is a folder; a file like build.toml is needed")
        if path.exists() and not path.is_file():
            raise BuildError(f"{path}: this is a device or a pipe; a file like build.toml is needed")
        if path.stat().st_size > _LARGEST:
            raise BuildError(f"{path}: {path.stat().st_size} bytes is too large for a build.toml")
        data = path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise BuildError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BuildError(f"{path}: byte {error.start + 1} is not UTF-8 text; build.toml is a text file") from None
    return parse_build(text, str(path))


def parse_build(text: str, source: str = "build.toml") -> Build:
    """Read a transducer from the text of build.toml; errors call the file `source`. Raises BuildError.

    Values that the text does not give come from the material library, with its tolerances as uncertainties.
    """
    if not text.strip():
        raise BuildError(f"{source}: the file is empty; name, diameter_mm, [[layers]], [[steps]] are needed")
    try:
        data = parse_toml(text.replace("\r\n", "\n"))
    except TomlError as error:
        raise BuildError(f"{source}: this is not TOML: {error}") from None
    except (RecursionError, ValueError):  # deeply nested brackets; a whole number with thousands of digits
        raise BuildError(
            f"{source}: this is not a build.toml: it is nested too deeply or has a number too long"
        ) from None
    top = Table(data, source)
    top.only((*SIZE_KEYS, *HOLE_KEYS, *TOP_ENTRIES))
    name = top.string("name")
    diameter, hole, area = _size(top)
    load = _loads(top)
    layers = resolved(tuple(_layer(table) for table in top.tables("layers", "layer")), source)
    build = Build(
        name=name,
        area=area,
        diameter=diameter,
        hole_diameter=hole,
        layers=layers,
        back=_load(load, "back"),
        front=_load(load, "front"),
        steps=tuple(_step(table) for table in top.tables("steps", "step")),
        plan=read_plan(top.table("sweep")) if "sweep" in data else None,
        limits=_limits(top.table("sample")) if "sample" in data else None,
        metadata=read_metadata(top.table("measurement")) if "measurement" in data else {},
        specification=read_limits(top.table("limits")) if "limits" in data else None,
        connection=_connection(top, layers),
        bolt=_bolt(top.table("bolt")) if "bolt" in data else None,
    )
    if "effects" in data:
        build = with_effects(build, top.tables("effects", "effect"))
    check_build(build, source)
    return build


def build_to_json(build: Build) -> dict[str, Any]:
    """Return the build as plain dicts, lists, texts and numbers, in SI units."""
    return msgspec.to_builtins(build)


def build_from_json(obj: object) -> Build:
    """Return the build that `build_to_json` made. Raises BuildError."""
    try:
        build = msgspec.convert(obj, Build)
    except msgspec.ValidationError as error:
        raise BuildError(f"build: {error}") from None
    except PlanError as error:
        raise BuildError(f"build: plan: {error}") from None
    except SpecificationError as error:
        raise BuildError(f"build: specification: {error}") from None
    check_build(build, "build")
    return build


def _size(top: Table) -> tuple[Quantity | None, Quantity | None, Quantity]:
    """Return diameter (m), or None if only the area is given, that of the hole (m), if there is one, and area (m2)."""
    size, hole = top.quantities(SIZE_KEYS), top.quantities(HOLE_KEYS).get("hole_diameter")
    if len(size) == 2:
        raise top.error("area_mm2", "is given beside diameter_mm; give one of the two")
    if "area" in size:
        if hole is not None:
            raise top.error("hole_diameter_mm", "is given beside area_mm2; a ring needs diameter_mm")
        return None, None, size["area"]
    if "diameter" not in size:
        raise top.missing("size", "write diameter_mm = ... or area_mm2 = ...")
    d = size["diameter"]
    if hole is None:
        return d, None, Quantity(math.pi / 4 * d.re * d.re, u=math.pi / 2 * d.re * d.u, source=d.source)
    area, u = math.pi / 4 * (d.re * d.re - hole.re * hole.re), math.pi / 2 * math.hypot(d.re * d.u, hole.re * hole.u)
    return d, hole, Quantity(area, u=u, source=d.source)


def _material(table: Table, key: str) -> tuple[str, Mapping[str, Quantity]]:
    """Return name and values of the library material that `key` names."""
    name = table.string(key)
    try:
        return name, find_material(name).values
    except PzctlError as error:
        raise table.error(key, f"is {name!r}: {error}") from None


def _connection(top: Table, layers: tuple[LayerSpec, ...]) -> Literal["series", "parallel"]:
    """Return the wiring of the piezo layers, which a build with several of them must state."""
    if "electrical" not in top.data:
        several = [layer.name for layer in layers if layer.kind == "piezo"]
        if len(several) > 1:
            raise top.missing(
                "[electrical]",
                f'write connection = "series" or "parallel" there: {", ".join(several)} are several piezo layers',
            )
        return "series"
    electrical = top.table("electrical")
    electrical.only(ELECTRICAL_ENTRIES)
    if "connection" not in electrical.data:
        raise electrical.missing("connection", 'write connection = "series" or "parallel"')
    return cast(Literal["series", "parallel"], electrical.settings(ELECTRICAL_ENTRIES)["connection"])


def _bolt(table: Table) -> BoltSpec:
    table.only((*BOLT_ENTRIES, *BOLT_KEYS))
    ends = table.strings("between")
    if len(ends) != 2:
        raise table.error("between", f"names {len(ends)} layers; the two that hold the ends of the bolt are needed")
    stiffness = table.quantities(BOLT_KEYS).get("stiffness")
    if stiffness is None:
        raise table.missing("stiffness", f"give {keys_for('stiffness', BOLT_KEYS)}")
    return BoltSpec(*ends, stiffness)


def _same_ceramic(table: Table) -> LayerSpec:
    """Return a piezo layer of the ceramic of another one; `resolved` fills in the values."""
    inner = table.table("material")
    inner.only(("same_as",))
    leader = inner.string("same_as")
    given = table.quantities(PIEZO_KEYS | ELECTRODE_KEYS)
    for key in (key for key, what in PIEZO_KEYS.items() if key in table.data and what.name != "thickness"):
        raise table.error(key, f"is given beside material = {{ same_as = {leader!r} }}, which shares it; give one")
    if "thickness" not in given:
        raise table.missing("thickness", f"give {keys_for('thickness', THICKNESS_KEYS)}; material does not share it")
    tied = {name: Quantity(math.nan, source="build.toml", same_as=f"{leader}.{name}") for name in CERAMIC}
    return LayerSpec(table.string("name"), "piezo", tied | given, **table.settings(POLED_ENTRIES))


def _layer(table: Table) -> LayerSpec:
    kind = _kind(table)
    keys = PIEZO_KEYS | ELECTRODE_KEYS if kind == "piezo" else ELASTIC_KEYS | LAYER_SIZE_KEYS
    table.only((*LAYER_ENTRIES, *(POLED_ENTRIES if kind == "piezo" else ()), *keys))
    if kind == "piezo" and isinstance(table.data.get("material"), dict):
        return _same_ceramic(table)
    material, nominal = _material(table, "material") if "material" in table.data else (None, dict[str, Quantity]())
    given = table.quantities(keys)
    values = {**nominal, **given}
    if kind == "elastic":
        _impedance_from_density(table, values, given)
    for name in NEEDED[kind]:
        if name not in values:
            beside = f"{material} of the library has none" if material else "or name a material that has it"
            raise table.missing(name, f"give {keys_for(name, keys)}; {beside}")
    poled = table.settings(POLED_ENTRIES) if kind == "piezo" else {}
    return LayerSpec(table.string("name"), kind, values, material, nominal, **poled)


def _kind(table: Table) -> Literal["piezo", "elastic"]:
    kind = table.string("kind")
    if kind not in NEEDED:
        raise table.error("kind", f'is {kind!r}; "piezo" or "elastic" is needed')
    return cast(Literal["piezo", "elastic"], kind)


def _impedance_from_density(table: Table, values: dict[str, Quantity], given: Mapping[str, Quantity]) -> None:
    """Set z = density * c if the file gives the density of an elastic layer and not its impedance."""
    if "density" not in given:
        values.pop("density", None)  # the library's density does not fit a layer whose z or c the file overrides
        return
    if "z" in given:
        raise table.error("density_kg_m3", f"is given beside {keys_for('z', Z_KEYS)}; z = density * c, give one")
    if "c" in values:
        density, c = given["density"], values["c"]
        if c.same_as:
            raise table.error("density_kg_m3", "is given beside a tied c; z = density * c needs a number, give z")
        u = math.hypot(density.u * c.re, density.re * c.u)
        values["z"] = Quantity(density.re * c.re, u=u, source="density * c")


def _loads(top: Table) -> Table:
    """Return what the outermost faces border on, with the default for a face that the file does not name."""
    given = top.table("load") if "load" in top.data else Table({}, top.source, "load")
    given.only(LOAD_ENTRIES)
    usual = {key: entry.default for key, entry in LOAD_ENTRIES.items()}
    return Table({**usual, **given.data}, given.source, given.path)


def _load(table: Table, key: str) -> LoadSpec:
    if isinstance(table.data.get(key), dict):
        inner = table.table(key)
        inner.only(Z_KEYS)
        z = inner.quantities(Z_KEYS).get("z")
        if z is None:
            raise inner.missing("z_MRayl", f"write {key} = {{ z_MRayl = ... }}, or the name of a material")
        return LoadSpec("given", z)
    name, values = _material(table, key)
    if "z" not in values:
        raise table.error(key, f"is {name!r}, which has no z in the library; write {{ z_MRayl = ... }}")
    return LoadSpec(name, values["z"])


def _step(table: Table) -> Step:
    table.only((*STEP_ENTRIES, *MASS_KEYS))
    reground = _reground(table.table("reground")) if "reground" in table.data else {}
    mass = table.quantities(MASS_KEYS).get("mass")
    if mass is not None and mass.u == 0:
        raise table.error("mass_g", "has no u; write mass_g = { value = ..., u = ... } with the balance's uncertainty")
    return Step(table.string("name"), table.strings("layers"), reground, mass)


def _reground(table: Table) -> dict[str, Quantity]:
    """Return the new thickness (m) of each layer that was ground before this step."""
    reground: dict[str, Quantity] = {}
    for layer in table.data:
        inner = table.table(layer)
        inner.only(THICKNESS_KEYS)
        thickness = inner.quantities(THICKNESS_KEYS).get("thickness")
        if thickness is None:
            raise inner.missing("thickness", "write thickness_mm = { value = ..., u = ... }")
        if thickness.same_as:
            raise inner.missing("thickness of its own", "a ground layer cannot be tied to another")
        reground[layer] = thickness
    return reground


def read_metadata(table: Table) -> dict[str, str | float]:
    """Return the section [measurement]: what is noted at every measurement of this transducer."""
    try:
        check_metadata(table.data, f"{table.source}: {table.path}")
    except MetadataError as error:
        raise BuildError(str(error)) from None
    return dict(table.data)


def _limits(table: Table) -> LevelLimits:
    """Return the section [sample]: the highest bias and test signal that the sample withstands."""
    table.only(SAMPLE_ENTRIES)
    return LevelLimits(**table.settings(SAMPLE_ENTRIES))


def read_plan(table: Table) -> SweepPlan:
    """Return the section [sweep]. The driver checks the limits of the instrument later."""
    table.only(SWEEP_ENTRIES)
    segments = tuple(_segment(segment) for segment in table.tables("segments", "segment"))
    settings = table.settings({key: entry for key, entry in SWEEP_ENTRIES.items() if entry.kind != "tables"})
    if "oscillator_mA" in settings:
        if "oscillator_V" in settings:
            raise table.error("oscillator_mA", "is given beside oscillator_V; the device is driven by one of the two")
        settings["oscillator_A"] = settings.pop("oscillator_mA") / 1e3
    return SweepPlan(segments, **settings)


def _segment(table: Table) -> Segment:
    ends = {end: {f"{end}_{unit}": factor for unit, factor in FREQUENCY_UNITS.items()} for end in ("start", "stop")}
    table.only(SEGMENT_ENTRIES)
    limits_Hz: dict[str, float] = {}
    for end, keys in ends.items():
        given = [key for key in keys if key in table.data]
        if len(given) != 1:
            raise table.missing(f"single {end}", f"give one of {', '.join(keys)}")
        limits_Hz[end] = table.number(given[0]) * keys[given[0]]
    settings = table.settings({key: SEGMENT_ENTRIES[key] for key in ("points", "spacing")})
    try:
        return Segment(limits_Hz["start"], limits_Hz["stop"], **settings)
    except PlanError as error:
        raise BuildError(f"{table.source}: {table.path}: {error}") from None
