"""`pzctl effects`: the physical effects that a model may lack, of the catalogue and the user's own."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .fit_options import UsageError

if TYPE_CHECKING:
    from rich.table import Table

    from ....models.effects import Effect
    from ....models.stack import Stack


def effects(
    name: Annotated[
        str | None, typer.Argument(help="One effect, to be shown in full; with --add, the name of what is added.")
    ] = None,
    add: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Add the learned laws of this file to your own effects: a build, or its [[effects]] alone.",
        ),
    ] = None,
    remove: Annotated[str | None, typer.Option(metavar="NAME", help="Remove this one of your own effects.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """List the physical effects that a model may lack, or show one: what it is, and how to tell it from others.

    Effects of your own are laws that `pzctl diagnose --learn` has found; every diagnosis tries them too.

    Example: pzctl effects lead-inductance
    """
    from ....fitters.user_effects import add_user_effects, every_effect, find_any_effect, remove_user_effect

    if add is not None and remove is not None:
        raise UsageError("--add and --remove do not go together")
    if remove is not None:
        if name is not None:
            raise UsageError(f"--remove takes one name; found {name} as well")
        _tell({"removed": remove, "file": str(remove_user_effect(remove))}, as_json=as_json)
        return
    if add is not None:
        for law, file in add_user_effects(add, name):
            _tell({"added": law.name, "file": str(file)}, as_json=as_json)
        return
    chosen = [find_any_effect(name)] if name else list(every_effect())
    if as_json:
        print(json.dumps({"effects": [_described(effect) for effect in chosen]}))
        return
    from ...report.tables.unbroken_table import Column, UnbrokenTable
    from ...report.terminal import console

    if name:
        console().print(_page(_described(chosen[0])))
        return
    table = UnbrokenTable("effect", Column("where", prose=True), Column("the physics", prose=True))
    for described in map(_described, chosen):
        table.add_row(described["name"], " ".join(described["where"]), described["physics"])
    console().print(table)


def _tell(done: dict[str, str], *, as_json: bool) -> None:
    """Print what was added or removed, and its file."""
    if as_json:
        print(json.dumps(done))
        return
    from ...report.terminal import console

    what, name = next(iter(done.items()))
    console().print(f"{what}: {name} ({done['file']})", soft_wrap=True, highlight=False, markup=False)


def _described(effect: "Effect") -> dict[str, Any]:
    """Return the catalogue's entry of an effect as plain data; sizes and places are those of an example device.

    A parameter of an effect that no build can state has no `key`. `stated`: what a build states beside place and
    parameters.
    """
    from ....fitters.engine.parameters.known_effects import parameter_key
    from ....models.effects import Stage
    from ....models.effects.learned.user_law import UserLaw

    stack, device = _example(effect)
    places = effect.places(stack)
    effect_parameters = effect.effect_parameters(stack, places[0])
    return {
        "name": effect.name,
        "own": isinstance(effect, UserLaw),
        "stated": effect.stated if isinstance(effect, UserLaw) else {"effect": effect.name},
        "where": list(dict.fromkeys(_kind(place) for place in places)),
        "physics": effect.physics,
        "says": effect.says.format(where=places[0]),
        "separates": effect.separates,
        "references": list(effect.references),
        "parameters": [
            {
                "name": parameter.name,
                "key": parameter_key(parameter) if effect.stage != Stage.ACQUISITION else None,
                "unit": parameter.unit,
                "null": parameter.null,
                "typical": parameter.typical,
                "limits": _limits(parameter.lower, parameter.upper),
            }
            for parameter in effect_parameters
        ],
        "example": list(places),
        "device": device,
    }


def _kind(place: str) -> str:
    """Return the kind of a place: `layer` for `layer:NAME`; `face:back` stays as it is."""
    return place if place.startswith("face:") else place.partition(":")[0]


def _limits(lower: float, upper: float) -> list[float | None]:
    return [lower, upper if upper < float("inf") else None]


def _example(effect: "Effect") -> "tuple[Stack, str]":
    """Return a stack with a place for the effect, and its name: a matched disk, one in water, or two rings."""
    from dataclasses import replace

    from ....models.stack import AIR, Elastic, HalfSpace, Piezo

    disk = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 0j, 8.09e-9 * (1 - 0.017j))
    glue, ml1 = Elastic("glue", 10e-6, 2.9e6, 2550.0, 30.0), Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0)
    transducer = (HalfSpace("backing", 5e6) | disk | glue | ml1 | AIR).with_area(7.854e-5)
    if effect.places(transducer):
        return transducer, "a disk of 10 mm x 0.5 mm"
    wet = replace(transducer, front=HalfSpace("water", 1.48e6))
    if effect.places(wet):
        return wet, "a disk of 10 mm x 0.5 mm in water"
    ring1, ring2 = (replace(disk, name=name, thickness=2e-3) for name in ("ring1", "ring2"))
    tail, head = Elastic("tail", 10e-3, 46e6, 5900.0, 1000.0), Elastic("head", 10e-3, 17e6, 6300.0, 1000.0)
    return (AIR | tail | ring1 | ring2 | head | AIR).with_area(7.854e-5), "two rings of 10 mm x 2 mm between masses"


def _page(described: dict[str, Any]) -> "Table":
    """Return one effect as a table with a heading and a text in each row."""
    from rich.table import Table

    page = Table(show_header=False)
    page.add_column(width=24)
    page.add_column()
    for heading, text in (
        ("effect", described["name"]),
        ("where", " ".join(described["where"])),
        ("the physics", described["physics"]),
        ("says", described["says"]),
        ("told apart by", described["separates"]),
        (f"typical on {described['device']}", "\n".join(map(_size, described["parameters"])) or "there or not"),
        ("keys in [[effects]] of a build", _keys(described)),
        ("references", "\n".join(described["references"])),
    ):
        page.add_row(heading, text)
    return page


def _keys(described: dict[str, Any]) -> str:
    """Return how a build states the effect, a learned law under that name; one of a sweep belongs to no sample."""
    keys = [one["key"] for one in described["parameters"] if one["key"] is not None]
    stated = [f"{key} = {json.dumps(value)}" for key, value in described["stated"].items()] if described["own"] else []
    return ", ".join([*stated, *keys]) or "none: it belongs to a sweep, not to a sample"


def _size(parameter: dict[str, Any]) -> str:
    unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
    null, (lower, upper) = parameter["null"], parameter["limits"]
    if null and null == upper:  # absent at a limit, far from any typical value
        return f"{parameter['name']}: {lower:.3g} to {upper:.3g}{unit}"
    around = f"{null:.3g} +- " if null else ""
    return f"{parameter['name']}: {around}{parameter['typical']:.3g}{unit}"
