"""build.toml: one transducer, its layers and gluing steps, read into a `Build`; and a `Build` as plain JSON."""

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, cast

import msgspec

from ....models.base.errors import PzctlError
from ....models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from ....models.metadata import MetadataError, check_metadata
from ....models.specification import SpecificationError
from ....models.sweep_plan import BANDWIDTHS, USUAL_POINTS, LevelLimits, PlanError, Segment, SweepPlan
from .build_check import check_build
from .build_table import (
    ELASTIC_KEYS,
    ELECTRODE_KEYS,
    PIEZO_KEYS,
    THICKNESS_KEYS,
    Z_KEYS,
    BuildError,
    Key,
    Table,
    keys_for,
)
from .effects_table import with_effects
from .limits_table import read_limits
from .own_materials import find_material
from .tied_parameters import resolved

__all__ = ["BuildError", "build_from_json", "build_to_json", "parse_build", "read_build"]

THESIS_BUILD = Path(__file__).with_name("thesis.toml")
"""The transducer of the 2012 thesis, which is also the one on the simulated bench."""

LAYER_KEYS = ("name", "kind", "material")
MASS_KEYS = {"mass_g": Key("mass", 1e-3)}
SIZE_KEYS = {"diameter_mm": Key("diameter", 1e-3), "area_mm2": Key("area", 1e-6)}
FREQUENCY_UNITS = {"MHz": 1e6, "kHz": 1e3, "Hz": 1.0}
NEEDED = {"piezo": ("thickness", "density", "c33D", "h33", "eps33S"), "elastic": ("thickness", "z", "c", "q")}
_DECIMAL_COMMA = re.compile(r"=\s*([-+]?\d+,\d+)\s*(?:#|$)", re.MULTILINE)
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
        raise BuildError(f"{source}: the file is empty; name, diameter_mm, [[layers]], [load], [[steps]] are needed")
    try:
        data = tomllib.loads(text.replace("\r\n", "\n"))
    except tomllib.TOMLDecodeError as error:
        comma = _DECIMAL_COMMA.search(text)
        hint = f"; write numbers with a point, not as {comma[1]!r}" if comma else ""
        raise BuildError(f"{source}: this is not TOML: {error}{hint}") from None
    except (RecursionError, ValueError):  # deeply nested brackets; a whole number with thousands of digits
        raise BuildError(
            f"{source}: this is not a build.toml: it is nested too deeply or has a number too long"
        ) from None
    top = Table(data, source)
    top.only(("name", *SIZE_KEYS, "layers", "load", "steps", "sweep", "sample", "limits", "measurement", "effects"))
    name = top.string("name")
    diameter, area = _size(top)
    load = top.table("load")
    load.only(("back", "front"))
    build = Build(
        name=name,
        area=area,
        diameter=diameter,
        layers=resolved(tuple(_layer(table) for table in top.tables("layers", "layer")), source),
        back=_load(load, "back"),
        front=_load(load, "front"),
        steps=tuple(_step(table) for table in top.tables("steps", "step")),
        plan=_plan(top.table("sweep")) if "sweep" in data else None,
        limits=_limits(top.table("sample")) if "sample" in data else None,
        metadata=_metadata(top.table("measurement")) if "measurement" in data else {},
        specification=read_limits(top.table("limits")) if "limits" in data else None,
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


def _size(top: Table) -> tuple[Quantity | None, Quantity]:
    """Return diameter (m), or None if only the area is given, and area (m2)."""
    size = top.quantities(SIZE_KEYS)
    if len(size) == 2:
        raise top.error("area_mm2", "is given beside diameter_mm; give one of the two")
    if "area" in size:
        return None, size["area"]
    if "diameter" not in size:
        raise top.missing("size", "write diameter_mm = ... or area_mm2 = ...")
    d = size["diameter"]
    return d, Quantity(math.pi * d.re**2 / 4, u=math.pi * d.re / 2 * d.u, source=d.source)


def _material(table: Table, key: str) -> tuple[str, Mapping[str, Quantity]]:
    """Return name and values of the library material that `key` names."""
    name = table.string(key)
    try:
        return name, find_material(name).values
    except PzctlError as error:
        raise table.error(key, f"is {name!r}: {error}") from None


def _layer(table: Table) -> LayerSpec:
    kind = _kind(table)
    keys = PIEZO_KEYS | ELECTRODE_KEYS if kind == "piezo" else ELASTIC_KEYS
    table.only((*LAYER_KEYS, *keys))
    material, nominal = _material(table, "material") if "material" in table.data else (None, dict[str, Quantity]())
    given = table.quantities(keys)
    values = {**nominal, **given}
    if kind == "elastic":
        _impedance_from_density(table, values, given)
    for name in NEEDED[kind]:
        if name not in values:
            beside = f"{material} of the library has none" if material else "or name a material that has it"
            raise table.missing(name, f"give {keys_for(name, keys)}; {beside}")
    return LayerSpec(table.string("name"), kind, values, material, nominal)


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


def _load(table: Table, key: str) -> LoadSpec:
    if isinstance(table.data.get(key), dict):
        inner = table.table(key)
        inner.only(Z_KEYS)
        z = inner.quantities(Z_KEYS).get("z")
        if z is None:
            raise inner.missing("z_MRayl", f"write {key} = {{ z_MRayl = ... }}, or the name of a material")
        return LoadSpec("given", z)
    if key not in table.data:
        raise table.missing(key, f'write {key} = "air", another material, or {{ z_MRayl = ... }}')
    name, values = _material(table, key)
    if "z" not in values:
        raise table.error(key, f"is {name!r}, which has no z in the library; write {{ z_MRayl = ... }}")
    return LoadSpec(name, values["z"])


def _step(table: Table) -> Step:
    table.only(("name", "layers", "reground", *MASS_KEYS))
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


def _metadata(table: Table) -> dict[str, str | float]:
    """Return the section [measurement]: what is noted at every measurement of this transducer."""
    try:
        check_metadata(table.data, f"{table.source}: {table.path}")
    except MetadataError as error:
        raise BuildError(str(error)) from None
    return dict(table.data)


def _limits(table: Table) -> LevelLimits:
    """Return the section [sample]: the highest bias and test signal that the sample withstands."""
    keys = ("max_bias_V", "max_oscillator_V")
    table.only(keys)
    limits = {key: table.number(key) for key in keys if key in table.data}
    for key, number in limits.items():
        if number < 0:
            raise table.error(key, f"is {number:g}; 0 V or more is needed")
    return LevelLimits(**limits)


def _plan(table: Table) -> SweepPlan:
    """Return the section [sweep]. The driver checks the limits of the instrument later."""
    floats = ("oscillator_V", "bias_V", "point_delay_s", "sweep_delay_s")
    integers = ("bandwidth", "point_average", "sweep_average")
    table.only(("segments", *floats, "oscillator_mA", *integers, "direction"))
    segments = tuple(_segment(segment) for segment in table.tables("segments", "segment"))
    settings: dict[str, Any] = {key: table.number(key) for key in floats if key in table.data}
    settings |= {key: table.integer(key) for key in integers if key in table.data}
    settings |= _level(table)
    for key in ("point_delay_s", "sweep_delay_s"):
        if settings.get(key, 0.0) < 0:
            raise table.error(key, f"is {settings[key]:g}; 0 s (none) or more is needed")
    if settings.get("bandwidth", BANDWIDTHS[0]) not in BANDWIDTHS:
        fast, precise = BANDWIDTHS[0], BANDWIDTHS[-1]
        says = f"is {settings['bandwidth']}; {fast} (fast) to {precise} (precise) is allowed"
        raise table.error("bandwidth", says)
    for key in ("point_average", "sweep_average"):
        if settings.get(key, 1) < 1:
            raise table.error(key, f"is {settings[key]}; 1 (off) or more is needed")
    if "direction" in table.data:
        settings["direction"] = table.string("direction")
        if settings["direction"] not in ("up", "down"):
            raise table.error("direction", f'is {settings["direction"]!r}; "up" or "down" is needed')
    return SweepPlan(segments, **settings)


def _level(table: Table) -> dict[str, float]:
    """Return the drive current (A) from `oscillator_mA`, or an empty dict if `oscillator_V` drives the device."""
    given = [key for key in ("oscillator_V", "oscillator_mA") if key in table.data]
    if len(given) == 2:
        raise table.error("oscillator_mA", "is given beside oscillator_V; the device is driven by one of the two")
    for key in given:
        if table.number(key) <= 0:
            raise table.error(key, f"is {table.number(key):g}; a positive number is needed")
    return {"oscillator_A": table.number("oscillator_mA") / 1e3} if "oscillator_mA" in given else {}


def _segment(table: Table) -> Segment:
    ends = {end: {f"{end}_{unit}": factor for unit, factor in FREQUENCY_UNITS.items()} for end in ("start", "stop")}
    table.only((*ends["start"], *ends["stop"], "points", "spacing"))
    limits_Hz: dict[str, float] = {}
    for end, keys in ends.items():
        given = [key for key in keys if key in table.data]
        if len(given) != 1:
            raise table.missing(f"single {end}", f"give one of {', '.join(keys)}")
        limits_Hz[end] = table.number(given[0]) * keys[given[0]]
    points = table.integer("points") if "points" in table.data else USUAL_POINTS
    spacing = table.string("spacing") if "spacing" in table.data else "linear"
    if spacing not in ("linear", "log"):
        raise table.error("spacing", f'is {spacing!r}; "linear" or "log" is needed')
    try:
        return Segment(limits_Hz["start"], limits_Hz["stop"], points, spacing)
    except PlanError as error:
        raise BuildError(f"{table.source}: {table.path}: {error}") from None
