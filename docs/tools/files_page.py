"""Generates docs/build-file.md and the JSON schemas of build.toml and materials.toml, from the keys that are read.

python docs/tools/files_page.py docs
"""

import json
import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

from pzctl.daemon.files.builds import file_keys as keys
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.files.builds.file_keys import Entry, Key
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.engine.parameters.known_effects import parameter_key
from pzctl.models.build import LoadSpec, Quantity
from pzctl.models.effects import EffectParameter, Stage, catalogue
from pzctl.models.effects.learned.learned import NAME as LEARNED

Schema: TypeAlias = dict[str, Any]
_SANDWICH = Path(__file__).resolve().parents[2] / "examples" / "langevin.toml"
Rows: TypeAlias = Mapping[str, Entry | Key]

_HEAD = """# build.toml, materials.toml and queues, key by key

`make docs` generates this page from the code that reads the files; do not edit it. For a guide see
[A transducer, from disk to second matching layer](transducer.md) and [Your own materials](materials.md).

Numbers have a decimal point, and every key ends in its unit. The key of a constant takes

- a number: taken as exact, and held in a fit;
- `{ value = 0.512, u = 0.001 }` with the standard uncertainty `u`: fitted, with this uncertainty as a datum;
- for a complex constant `{ re = 14.4, im = 0.1, u = 0.3, u_im = 0.05 }`; without `u_im`, `u` is that of both parts;
- further `min` and `max`, both: limits of the (real) value in a fit;
- `{ same_as = "glue1" }` for thickness, z, c and q: the same constant as in that layer, fitted as one.

A constant has one key for each of its units; give one of them. The default *from the material* means that the key is
needed unless the layer's `material` has the constant.

Editors that know JSON Schema complete keys and mark mistakes while you type: the schemas are
[schema/files/build.json](schema/files/build.json) and [schema/files/materials.json](schema/files/materials.json). Copy
them beside your files and, for an editor with Taplo (VS Code: Even Better TOML), begin a file with
`#:schema ./build.json`.
"""
_MATERIALS = """
# materials.toml

The file in the data folder (`pzctl doctor` names it) adds materials to the library, or replaces some of it.
"""
_QUEUE = """
# Queue file

The file that `pzctl measure --queue` reads; see [A production lab](production.md).
"""

_SEVERAL = "A place has an effect once, but may have several resonances (`spurious-resonance`) and learned laws:"


def page() -> str:
    """Return the page as Markdown."""
    parts = [_HEAD, "## At the top", _table({**keys.TOP_ENTRIES, **keys.SIZE_KEYS, **keys.HOLE_KEYS})]
    parts += ["## `[[layers]]`", _table(keys.LAYER_ENTRIES)]
    parts += [
        'With `kind = "piezo"`:',
        _table({**keys.POLED_ENTRIES, **keys.PIEZO_KEYS, **keys.ELECTRODE_KEYS}, keys.NEEDED["piezo"]),
    ]
    parts += ['With `kind = "elastic"`:', _table({**keys.ELASTIC_KEYS, **keys.LAYER_SIZE_KEYS}, keys.NEEDED["elastic"])]
    parts += ["## `[electrical]`", _table(keys.ELECTRICAL_ENTRIES)]
    parts += ["## `[bolt]`", _table({**keys.BOLT_ENTRIES, **keys.BOLT_KEYS}, ("stiffness",))]
    parts += ["## `[load]`", _table(keys.LOAD_ENTRIES), "In the table of a face:", _table(keys.Z_KEYS)]
    parts += ["## `[[steps]]`", _table({**keys.STEP_ENTRIES, **keys.MASS_KEYS})]
    parts += ["In the table of a layer in `reground`:", _table(keys.THICKNESS_KEYS)]
    parts += ["## `[sweep]`", _table(keys.SWEEP_ENTRIES), "In each of `segments`:", _table(keys.SEGMENT_ENTRIES)]
    parts += ["## `[sample]`", _table(keys.SAMPLE_ENTRIES)]
    parts += ["## `[limits]`", _table(keys.LIMITS_ENTRIES)]
    parts += ["Beside it, one table per layer, `[limits.disk]`, with a table for each constant:"]
    parts += [_table(keys.LIMIT_ENTRIES), "The constants are those of `[[layers]]`, and the derived ones:"]
    parts += [_table(keys.DERIVED_KEYS), "## `[measurement]`", _table(keys.MEASUREMENT_ENTRIES)]
    parts += ["Any other key holds a text or a number.", "## `[[effects]]`", _table(keys.EFFECT_ENTRIES)]
    left_out = "one that does nothing at an end of its range may be left out"
    parts += [f"An effect's parameters; one with `u` is fitted, {left_out}.", _SEVERAL, _effects()]
    parts += [_MATERIALS, "## `[[materials]]`", _table(keys.MATERIAL_ENTRIES), "At least one constant is needed."]
    parts += ['With `kind = "piezo"`:', _table(keys.material_keys("piezo"))]
    parts += ["With another kind:", _table(keys.material_keys("elastic"))]
    parts += [_QUEUE, "## At the top of a queue", _table(keys.QUEUE_ENTRIES)]
    parts += ["## `[[measure]]`", _table(keys.QUEUED_ENTRIES)]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def schemas() -> dict[str, Schema]:
    """Return the schema of each file, by the file's name without its ending."""
    return {
        "build": _whole("build.toml of pzctl", _build()),
        "materials": _whole("materials.toml of pzctl", _object({"materials": _list(_materials())}, ["materials"])),
    }


def written() -> dict[str, str]:
    """Return the text of each generated file by its path in docs."""
    files = {f"schema/files/{name}.json": json.dumps(schema, indent=2) + "\n" for name, schema in schemas().items()}
    return {"build-file.md": page(), **files}


def _table(rows: Rows, needed: Iterable[str] = ()) -> str:
    """Return the table of keys; `needed`: constants that are needed unless the material has them."""
    lines = ["| key | unit | range | default | meaning |", "|---|---|---|---|---|"]
    for name, row in rows.items():
        if isinstance(row, Key):
            default = "-" if row.name not in needed else "needed" if row.name == "thickness" else "from the material"
            cells = (row.unit, _range(row), default, keys.MEANINGS[row.name])
        else:
            choices = " or ".join(f"`{choice}`" for choice in row.choices)
            allowed = row.allowed or choices or {"number": "any number", "text": "a text"}.get(row.kind, "")
            default = "needed" if row.needed else "-" if row.default is None else f"{row.default}"
            cells = (row.unit, allowed, default, row.about)
        lines.append(f"| `{name}` | {' | '.join(cell.replace('|', ' ') or '-' for cell in cells)} |")
    return "\n".join(lines)


def _range(key: Key) -> str:
    sign = keys.LOSS_SIGN.get(key.name)
    real = "> 0" if key.name in keys.POSITIVE else "any"
    real += f", < {keys.BELOW[key.name]:g}" if key.name in keys.BELOW else ""
    if key.name in keys.REAL or key.name in {constant.name for constant in keys.DERIVED_KEYS.values()}:
        return real
    return f"re {real}, im {'any' if sign is None else '>= 0' if sign > 0 else '<= 0'}"


def _effects() -> str:
    lines = ["| effect | keys, with their range |", "|---|---|"]
    for name, parameters in _effect_parameters().items():
        ranges = ", ".join(f"`{parameter_key(knob)}` {_bounds(knob)}" for knob in parameters)
        lines.append(f"| `{name}` | {ranges} |")
    return "\n".join(lines)


def _bounds(knob: EffectParameter) -> str:
    return f"{knob.lower:.3g} to {knob.upper:.3g}" if knob.upper < float("inf") else f"{knob.lower:.3g} or more"


def _effect_parameters() -> dict[str, tuple[EffectParameter, ...]]:
    """Return the parameters of each effect that a build can have.

    The ranges are those in the thesis's transducer, or of an effect that it cannot have in a sandwich.
    """
    loaded = LoadSpec("given", Quantity(3e6))
    builds = replace(read_build(THESIS_BUILD), back=loaded, front=loaded), read_build(_SANDWICH)
    found: dict[str, tuple[EffectParameter, ...]] = {}
    for effect in catalogue():
        stacks = (stack_of(build, build.steps[-1]) for build in builds)
        places = ((stack, where) for stack in stacks for where in effect.places(stack))
        if effect.stage != Stage.ACQUISITION:
            found[effect.name] = effect.effect_parameters(*next(places))
    return {name: parameters for name, parameters in found.items() if parameters}


def _whole(title: str, schema: Schema) -> Schema:
    used = sorted({found for found in keys.MEANINGS if f'"#/$defs/{found}"' in json.dumps(schema)})
    definitions = {name: _definition(name) for name in used}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **schema, "$defs": definitions}


def _object(properties: Schema, required: Iterable[str] = (), others: Schema | bool = False) -> Schema:
    return {
        "type": "object",
        "properties": properties,
        "required": list(required),
        "additionalProperties": others,
    }


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items, "minItems": 1}


def _build() -> Schema:
    entries = _entries(keys.TOP_ENTRIES)
    layers = _list({"oneOf": [_layer(kind) for kind in keys.NEEDED]})
    load = {
        name: {"anyOf": [entry, _object(_constants(keys.Z_KEYS))]}
        for name, entry in _entries(keys.LOAD_ENTRIES).items()
    }
    ground = _object({}, others=_object(_constants(keys.THICKNESS_KEYS)))
    steps = {**_entries(keys.STEP_ENTRIES), **_constants(keys.MASS_KEYS), "reground": ground}
    segments = {"segments": _list(_object(_entries(keys.SEGMENT_ENTRIES)))}
    limit = _object(_entries(keys.LIMIT_ENTRIES))
    limits = _object(dict.fromkeys(keys.LIMIT_KEYS, limit))
    noted = _object(_entries(keys.MEASUREMENT_ENTRIES), others={"type": ["string", "number"]})
    names = {"enum": [*_effect_parameters(), LEARNED]}
    value = {"anyOf": [{"type": "number"}, _object({"value": {"type": "number"}, "u": _U}, ["value"])]}
    effects = {**_entries(keys.EFFECT_ENTRIES), "effect": {**_entry(keys.EFFECT_ENTRIES["effect"]), **names}}
    tables: Schema = {
        "layers": layers,
        "electrical": _object(_entries(keys.ELECTRICAL_ENTRIES), _needed(keys.ELECTRICAL_ENTRIES)),
        "bolt": _object({**_entries(keys.BOLT_ENTRIES), **_constants(keys.BOLT_KEYS)}, _needed(keys.BOLT_ENTRIES)),
        "load": _object(load),
        "steps": _list(_object(steps, _needed(keys.STEP_ENTRIES))),
        "sweep": _object({**_entries(keys.SWEEP_ENTRIES), **segments}, _needed(keys.SWEEP_ENTRIES)),
        "sample": _object(_entries(keys.SAMPLE_ENTRIES)),
        "limits": _object(_entries(keys.LIMITS_ENTRIES), others=limits),
        "measurement": noted,
        "effects": _list(_object(effects, _needed(keys.EFFECT_ENTRIES), others=value)),
    }
    described = {name: {**entries[name], **table} for name, table in tables.items()}
    sizes = _constants({**keys.SIZE_KEYS, **keys.HOLE_KEYS})
    whole = _object({**entries, **described, **sizes}, _needed(keys.TOP_ENTRIES))
    beside = {key: ["diameter_mm"] for key in keys.HOLE_KEYS}
    return {**whole, "oneOf": [{"required": [key]} for key in keys.SIZE_KEYS], "dependentRequired": beside}


def _layer(kind: str) -> Schema:
    if kind == "piezo":
        constants = {**keys.PIEZO_KEYS, **keys.ELECTRODE_KEYS}
    else:
        constants = {**keys.ELASTIC_KEYS, **keys.LAYER_SIZE_KEYS}
    entries = {**_entries(keys.LAYER_ENTRIES), "kind": {**_entry(keys.LAYER_ENTRIES["kind"]), "const": kind}}
    if kind == "piezo":
        shared = _object({"same_as": {"type": "string", "description": "a layer of this ceramic"}}, ["same_as"])
        entries["material"] = {"anyOf": [entries["material"], shared]}
        entries.update(_entries(keys.POLED_ENTRIES))
    return _object({**entries, **_constants(constants)}, _needed(keys.LAYER_ENTRIES))


def _materials() -> Schema:
    others = tuple(str(kind) for kind in keys.MATERIAL_ENTRIES["kind"].choices if kind != "piezo")
    found: list[Schema] = []
    for kinds in (("piezo",), others):
        entries = _entries(keys.MATERIAL_ENTRIES)
        entries["kind"] = {**entries["kind"], "enum": list(kinds)}
        constants = _constants(keys.material_keys(kinds[0]))
        found.append(_object({**entries, **constants}, _needed(keys.MATERIAL_ENTRIES)))
    return {"oneOf": found}


def _needed(entries: Mapping[str, Entry]) -> list[str]:
    return [name for name, entry in entries.items() if entry.needed]


def _entries(entries: Mapping[str, Entry]) -> dict[str, Schema]:
    return {name: _entry(entry) for name, entry in entries.items()}


def _entry(entry: Entry) -> Schema:
    types: dict[keys.Kind, Schema] = {
        "text": {"type": "string"},
        "texts": {"type": "array", "items": {"type": "string"}},
        "number": {"type": "number"},
        "integer": {"type": "integer"},
        "table": {"type": "object"},
        "tables": {"type": "array"},
    }
    about = entry.about + (f", {entry.unit}" if entry.unit else "") + (f"; {entry.allowed}" if entry.allowed else "")
    schema: Schema = {"description": about, **types[entry.kind]}
    if entry.choices:
        schema["enum"] = list(entry.choices)
    if entry.default is not None and entry.kind != "texts":
        schema["default"] = entry.default
    if entry.least is not None:
        schema["minimum" if entry.least_allowed else "exclusiveMinimum"] = entry.least
    return schema


def _constants(constants: Mapping[str, Key]) -> dict[str, Schema]:
    return {name: _constant(key) for name, key in constants.items()}


_U: Schema = {"type": "number", "minimum": 0, "description": "standard uncertainty"}


def _constant(key: Key) -> Schema:
    about = keys.MEANINGS[key.name] + (f", {key.unit}" if key.unit else "")
    return {"description": about, "$ref": f"#/$defs/{key.name}"}


def _definition(name: str) -> Schema:
    """Return the schema of a constant in any unit."""
    number: Schema = {"type": "number"}
    real = {**number, "exclusiveMinimum": 0} if name in keys.POSITIVE else number
    real |= {"exclusiveMaximum": keys.BELOW[name]} if name in keys.BELOW else {}
    sign = keys.LOSS_SIGN.get(name)
    imaginary = number if sign is None else {**number, "minimum" if sign > 0 else "maximum": 0}
    ends = {"min": number, "max": number}
    ways = [real, _object({"value": real, "u": _U, **ends}, ["value"])]
    if name not in keys.REAL:
        ways.append(_object({"re": real, "im": imaginary, "u": _U, "u_im": _U, **ends}, ["re"]))
    if name in keys.TIED:
        ways.append(_object({"same_as": {"type": "string", "description": "a layer"}}, ["same_as"]))
    return {"anyOf": ways}


def main() -> None:
    """Write page and schemas into the given folder."""
    for name, text in written().items():
        path = Path(sys.argv[1]) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
