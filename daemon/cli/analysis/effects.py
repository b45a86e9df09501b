"""`pzctl effects`: the catalogue of physical effects that a model may lack."""

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from ....models.effects import Effect
    from ....models.stack import Stack


def effects(
    name: Annotated[str | None, typer.Argument(help="One effect, to be shown in full; without it, the list.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """List the physical effects that a model may lack, or show one: what it is, and how to tell it from others.

    Example: pzctl effects lead-inductance
    """
    from ....models.effects import catalogue, find_effect

    chosen = [find_effect(name)] if name else list(catalogue())
    if as_json:
        print(json.dumps({"effects": [_described(effect) for effect in chosen]}))
        return
    from rich.table import Table

    from ...report.terminal import console

    if name:
        console().print(_page(_described(chosen[0])))
        return
    table = Table("effect", "where", "the physics")
    for described in map(_described, chosen):
        table.add_row(described["name"], " ".join(described["where"]), described["physics"])
    console().print(table)


def _described(effect: "Effect") -> dict[str, Any]:
    """Return the catalogue's entry of an effect as plain data; sizes and places are those of an example device."""
    from ....fitters.engine.parameters.known_effects import parameter_key

    stack = _example()
    places = effect.places(stack)
    effect_parameters = effect.effect_parameters(stack, places[0])
    return {
        "name": effect.name,
        "where": list(dict.fromkeys(_kind(place) for place in places)),
        "physics": " ".join((effect.__doc__ or "").split()),
        "says": effect.says,
        "separates": effect.separates,
        "references": list(effect.references),
        "parameters": [
            {
                "name": parameter.name,
                "key": parameter_key(parameter),
                "unit": parameter.unit,
                "null": parameter.null,
                "typical": parameter.typical,
                "limits": _limits(parameter.lower, parameter.upper),
            }
            for parameter in effect_parameters
        ],
        "example": list(places),
    }


def _kind(place: str) -> str:
    """Return the kind of a place: `layer` for `layer:NAME`; `face:back` stays as it is."""
    return place if place.startswith("face:") else place.partition(":")[0]


def _limits(lower: float, upper: float) -> list[float | None]:
    return [lower, upper if upper < float("inf") else None]


def _example() -> "Stack":
    """Return a stack with a place for every effect: a disk, 10 mm x 0.5 mm, with a matching layer and a backing."""
    from ....models.stack import AIR, Elastic, HalfSpace, Piezo

    disk = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 0j, 8.09e-9 * (1 - 0.017j))
    glue, ml1 = Elastic("glue", 10e-6, 2.9e6, 2550.0, 30.0), Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0)
    return (HalfSpace("backing", 5e6) | disk | glue | ml1 | AIR).with_area(7.854e-5)


def _page(described: dict[str, Any]) -> "Table":
    """Return one effect as a table with a heading and a text in each row."""
    from rich.table import Table

    page = Table(show_header=False)
    for heading, text in (
        ("effect", described["name"]),
        ("where", " ".join(described["where"])),
        ("the physics", described["physics"]),
        ("says", described["says"]),
        ("told apart by", described["separates"]),
        ("typical on a disk of 10 mm x 0.5 mm", "\n".join(map(_size, described["parameters"])) or "there or not"),
        ("keys in [[effects]] of a build", ", ".join(one["key"] for one in described["parameters"])),
        ("references", "\n".join(described["references"])),
    ):
        page.add_row(heading, text)
    return page


def _size(parameter: dict[str, Any]) -> str:
    unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
    around = f"{parameter['null']:.3g} +- " if parameter["null"] else ""
    return f"{parameter['name']}: {around}{parameter['typical']:.3g}{unit}"
