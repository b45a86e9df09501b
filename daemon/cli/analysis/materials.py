"""`pzctl materials`: the material library, each value with its source."""

import json
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ....models.materials import Material
    from ...report.tables.unbroken_table import UnbrokenTable


def materials(
    name: Annotated[str | None, typer.Argument(help="One material, to be shown in full; without it, the list.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """List the materials, or show one with every value, its uncertainty and its source.

    Your own materials are read from materials.toml in the data folder, where each key ends in its unit as in
    build.toml; they take precedence over the library's.

    Example: pzctl materials Pz27
    """
    from ...files.builds.own_materials import all_materials, find_material

    chosen = [find_material(name)] if name else list(all_materials())
    if as_json:
        import msgspec

        print(json.dumps({"materials": [msgspec.to_builtins(material) for material in chosen]}))
        return
    from ....models.base.uncertain_numbers import complex_with_uncertainty
    from ...report.tables.unbroken_table import Column, UnbrokenTable
    from ...report.terminal import console

    of_one = ("constant", "value (SI)", Column("source", prose=True))
    columns = of_one if name else (Column("constants", prose=True),)
    material_and_kind = (Column(head, spare=k if name else 0) for k, head in enumerate(("material", "kind"), 1))
    table = UnbrokenTable(*material_and_kind, *columns, title=name or "")
    for material in chosen:
        if not name:
            table.add_row(material.name, material.kind, " ".join(material.values))
            continue
        for constant, q in material.values.items():
            value = complex_with_uncertainty(q.re, q.im, q.u, q.u_im)
            table.add_row(material.name, material.kind, constant, value, q.source)
    console().print(table)
    if name and chosen[0].temperature:
        console().print(_coefficients(chosen[0]))


def _coefficients(material: "Material") -> "UnbrokenTable":
    """Return the table of a material's temperature coefficients."""
    from ....models.base.uncertain_numbers import with_uncertainty
    from ...report.tables.unbroken_table import Column, UnbrokenTable

    table = UnbrokenTable("material", "constant", "change, 1e-6/K at 25 C", Column("source", prose=True))
    for constant, q in material.temperature.items():
        table.add_row(material.name, constant, with_uncertainty(1e6 * q.re, 1e6 * q.u), q.source)
    return table
