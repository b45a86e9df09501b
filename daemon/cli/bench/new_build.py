"""`pzctl new`: write a build.toml from the answers to a few questions."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ....models.base.errors import PzctlError

if TYPE_CHECKING:
    from .build_template import NewBuild, NewLayer


_THICKNESS_MODE = ("density", "c33D", "h33", "eps33S")
_ELASTIC = ("z", "c", "q")
_MATCHING = (("thesis ML1", 0.01, 0.139), ("thesis ML2", 0.005, 0.147), ("epoxy", 0.01, 0.15))
# Proposed for each matching layer in turn: material, thickness of the glue below it and its own, mm. Together with the
# disk's 0.512 mm of Pz27 this is the transducer on the simulated bench, so that Enter everywhere gives a build of it.


class NotWritten(PzctlError):
    """The build file was not written."""


def new(
    out: Annotated[Path, typer.Argument(help="The file to write.")] = Path("build.toml"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Ask a few questions and write a commented build.toml with nominal values and their sources.

    The proposed answers describe the transducer on the simulated bench.
    Questions go to standard error. An existing file is never overwritten. Exit status: 0 written, 2 not.

    Example: pzctl new S4.toml
    """
    from ...files.builds.build_file import parse_build
    from ...report.terminal import console
    from .build_template import build_text

    if out.exists():
        raise NotWritten(f"{out}: this file exists already; name another one")
    try:
        new_build = _asked()
    except typer.Abort as error:
        if isinstance(error.__context__, EOFError):
            raise NotWritten(f"{out}: not written: the answers ended before the questions did") from None
        raise
    text = build_text(new_build)
    known = parse_build(text, str(out))  # only write what can be read back
    try:
        with out.open("x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise NotWritten(f"{out}: cannot be written: {error.strerror or error}") from None
    if as_json:
        print(json.dumps({"file": str(out), "build": known.name, "steps": [step.name for step in known.steps]}))
    else:
        says = f"written: {out}; measure with: pzctl measure --build {out} --fit"
        console(stderr=True).print(says, highlight=False, soft_wrap=True, markup=False)


def _asked() -> "NewBuild":
    from .build_template import NewBuild

    name = _ask_name()
    diameter = _ask_number("Diameter (mm)", 16.0)
    layers = _layers()
    back, front = (_ask_material(f"Medium at the {face} face", "air", ("z",)) for face in ("back", "front"))
    return NewBuild(name, diameter, tuple(layers), back, front)


def _layers() -> "list[NewLayer]":
    from .build_template import NewLayer

    disk = _ask_material("Material of the piezo disk", "Pz27", _THICKNESS_MODE)
    layers = [NewLayer("disk", "piezo", disk, *_thickness("the disk", 0.512, 0.001))]
    while typer.confirm(f"Is a layer glued in front of {layers[-1].name!r}?", default=len(layers) == 1, err=True):
        k = len(layers) // 2 + 1
        material, bond, thickness = _MATCHING[min(k, len(_MATCHING)) - 1]
        glue = _ask_material(f"Glue below matching layer {k}", "thesis glue", _ELASTIC)
        layers.append(NewLayer(f"glue{k}", "elastic", glue, *_thickness("this glue line", bond, bond / 2)))
        matching = _ask_material(f"Material of matching layer {k}", material, _ELASTIC)
        layers.append(NewLayer(f"ml{k}", "elastic", matching, *_thickness(f"matching layer {k}", thickness, 0.001)))
    return layers


def _thickness(of: str, nominal: float, u: float) -> tuple[float, float]:
    return (
        _ask_number(f"Thickness of {of} (mm)", nominal),
        _ask_number("  its standard uncertainty (mm)", u),
    )


def _ask_name() -> str:
    from ...files.builds.build_check import check_build_name
    from ...files.builds.build_table import BuildError

    while True:
        name = _ask("Name of the transducer", "S1")
        try:
            check_build_name(name, "name")
        except BuildError:
            typer.echo(f"{name!r} is not possible; use letters, digits, space and _ + - . inside", err=True)
        else:
            return name


def _ask(question: str, default: str) -> str:
    return str(typer.prompt(question, default=default, err=True)).strip() or default


def _ask_number(question: str, default: float) -> float:
    from ...files.builds.build_table import decimal_point

    while True:
        answer = _ask(question, str(default))
        try:
            value = float(answer)
        except ValueError:
            hint = decimal_point(answer) if re.fullmatch(r"\d+,\d+", answer) else "a positive number is needed"
            typer.echo(f"{answer!r} is not possible; {hint}", err=True)
            continue
        if value > 0 and value < float("inf"):
            return value
        typer.echo(f"{value:g} is not possible; a positive number is needed", err=True)


def _ask_material(question: str, default: str, needed: Sequence[str]) -> str:
    """Ask until the answer is a material for which the library has all the needed constants; return its name."""
    from ....models.materials import MATERIALS, find

    allowed = [material.name for material in MATERIALS if all(constant in material.values for constant in needed)]
    while True:
        name = _ask(f"{question} (? lists them)", default)
        if name != "?":
            try:
                full_name = find(name).name
            except PzctlError as error:
                typer.echo(str(error), err=True)
                continue
            if full_name in allowed:
                return full_name
        typer.echo(f"possible: {', '.join(allowed)}", err=True)
