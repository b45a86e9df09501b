"""`pzctl trend`: constants of a sample against temperature, with coefficients."""

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from ....fitters.population.trend import Trend
    from ....models.build import LayerSpec, Quantity
    from ...report.pictures.trend_picture import Series


def trend(
    sample: Annotated[str, typer.Argument(help="Name of a sample that was measured at several temperatures.")],
    constants: Annotated[
        list[str] | None, typer.Argument(help="Such as disk.c33D disk.kt; default: all that were fitted.")
    ] = None,
    against: Annotated[str, typer.Option(help="The noted number to plot against.")] = "temperature_C",
    step: Annotated[str | None, typer.Option(help="Only this gluing step.")] = None,
    fitter: Annotated[str | None, typer.Option(help="Use this fitter's fits; default: mason.")] = None,
    degree: Annotated[int, typer.Option(min=1, max=3, help="Degree of the polynomial.")] = 1,
    reference: Annotated[float, typer.Option(help="Where the value itself is given.")] = 25.0,
    picture: Annotated[Path | None, typer.Option(help="File of the picture: .png, .svg or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fit the constants of a series against temperature: value at the reference, and relative change per kelvin.

    The temperature is the one noted with `pzctl measure --temperature`, on the page, or by a reader. Where the material
    library has a published coefficient, the last column shows it.

    Example: pzctl trend S4 disk.c33D disk.eps33S --picture temperature.png
    """
    from ....fitters.plugins import DEFAULT
    from ...report.pictures.picture_file import check_picture, save_picture
    from ...report.pictures.trend_picture import trend_figure
    from ...report.terminal import console
    from ...samples.constant_table import constants as table_of

    if picture is not None:
        check_picture(picture)
    layers = _layers(sample)
    rows = table_of(sample, step, fitter or DEFAULT, every=True).rows
    series = _series(rows, constants or [], sample, against, degree, reference)
    published = _published(layers) if against == "temperature_C" else {}
    if picture is not None:
        save_picture(trend_figure(series, against), picture, dpi=110)
    if as_json:
        constants_json = {one[0]: {**_plain(one), "library": _library_json(published.get(one[0]))} for one in series}
        print(json.dumps({"sample": sample, "against": against, "constants": constants_json}))
        return
    from rich.box import SIMPLE_HEAD

    from ....models.base.uncertain_numbers import with_uncertainty
    from ...report.tables.unbroken_table import UnbrokenTable

    per = _unit(against)
    powers = [f"a{k + 1}, 1e-6/{per}{'' if k == 0 else f'^{k + 1}'}" for k in range(degree)]
    library = ["library's a1"] if any(one[0] in published for one in series) else []
    columns = ("constant", "n", f"at {reference:g}", "unit", *powers, "scatter", *library)
    shown = UnbrokenTable(*columns, box=SIMPLE_HEAD)
    for name, unit, _, _, _, found in series:
        changes = [with_uncertainty(1e6 * a.value, 1e6 * a.u) for a in found.relative]
        value = with_uncertainty(found.value.value, found.value.u)
        known = [_library_text(published.get(name), found)] if library else []
        shown.add_row(name, str(found.n), value, "" if unit == "1" else unit, *changes, f"{found.scatter:.2g}", *known)
    console().print(shown)
    if picture is not None:
        console().print(f"picture: {picture}", highlight=False, soft_wrap=True)


def _unit(against: str) -> str:
    """Return the unit of differences of a noted number, which its name ends in: kelvin for `temperature_C`."""
    _, _, unit = against.rpartition("_")
    return "K" if unit == "C" else unit if unit != against else f"(unit of {against})"


def _layers(sample: str) -> "tuple[LayerSpec, ...]":
    """Return the layers of a sample. Raises UnknownSampleError."""
    from ...samples.sample_record import sample_record
    from ...samples.sample_selection import open_journal

    journal = open_journal()
    try:
        return sample_record(journal, sample).build.layers
    finally:
        journal.close()


def _published(layers: "tuple[LayerSpec, ...]") -> "dict[str, Quantity]":
    """Return the library's temperature coefficients of a sample's layers, by the names of the fitted constants."""
    from ....models.materials import MaterialError
    from ...files.builds.own_materials import find_material

    found: dict[str, Quantity] = {}
    for layer in layers:
        with suppress(MaterialError):  # a material of the user's own file that is no longer there
            if layer.material is None:
                continue
            slopes = find_material(layer.material).temperature
            found |= {f"{layer.name}.{constant}": slope for constant, slope in slopes.items()}
    return found


def _library_text(known: "Quantity | None", found: "Trend") -> str:
    """Return a published coefficient, and how far the measured one is from it in units of both uncertainties."""
    from ....models.base.uncertain_numbers import with_uncertainty

    if known is None:
        return ""
    away = abs(found.relative[0].value - known.re) / math.hypot(found.relative[0].u, known.u)
    return f"{with_uncertainty(1e6 * known.re, 1e6 * known.u)} ({away:.1f} u away)"


def _library_json(known: "Quantity | None") -> dict[str, Any] | None:
    return None if known is None else {"value": known.re, "u": known.u, "source": known.source}


def _series(
    rows: tuple[dict[str, Any], ...], names: list[str], sample: str, against: str, degree: int, reference: float
) -> "list[Series]":
    """Return each constant's values and trend. Raises UnknownSampleError, TrendError."""
    from ....fitters.population.trend import TrendError
    from ....fitters.population.trend import trend as trend_of
    from ...samples.sample_record import UnknownSampleError

    points: dict[str, list[tuple[float, float, float, str]]] = {}
    for row in rows:
        x = json.loads(row["metadata"] or "{}").get(against)
        wanted = row["constant"] in names if names else row["free"] or row["derived"]
        if wanted and isinstance(x, int | float) and row["converged"] and row["re"] is not None:
            points.setdefault(row["constant"], []).append((float(x), row["re"], row["u_re"] or 0.0, row["unit"]))
    missing = [name for name in names if name not in points]
    if missing or not points:
        what = f"no fit has constant {missing[0]!r}" if missing else "nothing was fitted"
        raise UnknownSampleError(
            f"sample {sample!r}: {what} with {against} noted; note it with `pzctl measure --temperature`, or --note"
        )
    places = sorted({x for found in points.values() for x, *_ in found})
    if len(places) <= degree:
        at = f"only at {places[0]:g}" if len(places) == 1 else f"at {len(places)} values"
        raise TrendError(
            f"sample {sample!r}: the fits have {against} noted {at}; a trend of degree {degree} needs at least "
            f"{degree + 2} measurements, at {degree + 1} or more different values"
        )
    series: list[Series] = []
    for name, found in points.items():
        x, y, u, units = zip(*found, strict=True)
        if names or not math.isclose(min(y), max(y), rel_tol=1e-12):  # a held value has no trend
            series.append((name, units[0], x, y, u, trend_of(x, y, degree, reference)))
    if not series:
        raise TrendError(f"sample {sample!r}: no fitted constant differs between the measurements")
    return series


def _plain(one: "Series") -> dict[str, Any]:
    import msgspec

    _, unit, x, y, u, found = one
    return {"unit": unit, "x": list(x), "y": list(y), "u": list(u), **msgspec.to_builtins(found)}
