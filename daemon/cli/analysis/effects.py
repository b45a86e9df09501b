"""`pzctl effects`: the catalogue of physics that a model can leave out."""

import json
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from ....models.effects import Effect
    from ....models.stack import Stack


def effects(
    name: Annotated[str | None, typer.Argument(help="One effect with all it says; without it, the list.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """List the physics that a model can leave out, or show one effect: what it is, and what tells it from others.

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
    for told in map(_described, chosen):
        table.add_row(told["name"], " ".join(told["where"]), told["physics"])
    console().print(table)


def _described(effect: "Effect") -> dict[str, Any]:
    """Return what the catalogue says of an effect; sizes and places are those of an example."""
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
                "name": knob.name,
                "unit": knob.unit,
                "null": knob.null,
                "typical": knob.typical,
                "limits": _limits(knob.lower, knob.upper),
            }
            for knob in effect_parameters
        ],
        "example": list(places),
    }


def _kind(place: str) -> str:
    """Return `layer` of `layer:NAME`, `face:back` as it is."""
    return place if place.startswith("face:") else place.partition(":")[0]


def _limits(lower: float, upper: float) -> list[float | None]:
    return [lower, upper if upper < float("inf") else None]


def _example() -> "Stack":
    """Return a stack that has a place for every effect: a disk, 10 mm x 0.5 mm, with a matching layer and backing."""
    from ....models.stack import AIR, Elastic, HalfSpace, Piezo

    disk = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 0j, 8.09e-9 * (1 - 0.017j))
    glue, ml1 = Elastic("glue", 10e-6, 2.9e6, 2550.0, 30.0), Elastic("ml1", 139e-6, 10.3e6, 2455.0, 60.0)
    return (HalfSpace("backing", 5e6) | disk | glue | ml1 | AIR).with_area(7.854e-5)


def _page(told: dict[str, Any]) -> "Table":
    """Return one effect as a table of headings and texts."""
    from rich.table import Table

    page = Table(show_header=False)
    for heading, text in (
        ("effect", told["name"]),
        ("where", " ".join(told["where"])),
        ("the physics", told["physics"]),
        ("says", told["says"]),
        ("told apart by", told["separates"]),
        ("typical on a disk of 10 mm x 0.5 mm", "\n".join(map(_size, told["parameters"])) or "there or not"),
        ("references", "\n".join(told["references"])),
    ):
        page.add_row(heading, text)
    return page


def _size(parameter: dict[str, Any]) -> str:
    unit = "" if parameter["unit"] == "1" else f" {parameter['unit']}"
    around = f"{parameter['null']:.3g} +- " if parameter["null"] else ""
    return f"{parameter['name']}: {around}{parameter['typical']:.3g}{unit}"
