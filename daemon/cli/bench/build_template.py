"""The text of a commented build.toml from a few answers, with values and sources from the material library."""

from collections.abc import Sequence
from dataclasses import dataclass

from ....drivers import capabilities_of
from ....models.base.uncertain_numbers import complex_with_uncertainty
from ....models.materials import find
from ....models.sweep_plan import USUAL_POINTS

_SWEEP = """
[sweep]                            # how to measure: around the resonance, then wide
segments = [
    {{ start_MHz = {near_start:.4g}, stop_MHz = {near_stop:.4g}, points = {points} }},
    {{ start_MHz = {wide_start:.4g}, stop_MHz = {wide_stop:.4g}, points = {points} }},
]
oscillator_V = 0.5
bandwidth = 5                      # 1 fast to 5 precise
"""


@dataclass(frozen=True)
class NewLayer:
    """One layer as a person described it; lengths in mm, as in the file."""

    name: str
    kind: str
    """`piezo` or `elastic`."""
    material: str
    thickness_mm: float
    u_mm: float
    """Standard uncertainty of the thickness."""


@dataclass(frozen=True)
class NewBuild:
    """A transducer as a person described it; its layers from back to front, which is the order of gluing."""

    name: str
    diameter_mm: float
    layers: tuple[NewLayer, ...]
    back: str
    front: str


def build_text(new: NewBuild) -> str:
    """Return the text of build.toml, with one gluing step for every layer that is not glue.

    Raises MaterialError if a material is not in the library.
    """
    parts = [
        f"# Transducer {new.name}. A value that is not given here comes from the material library, with its tolerance;",
        "# a value given here replaces it. In { value = ..., u = ... }, u is the standard uncertainty; a number by",
        "# itself is taken as exact and held in the fit.",
        f"name = {_quoted(new.name)}",
        f"diameter_mm = {new.diameter_mm:g}",
    ]
    for layer in new.layers:
        parts += ["", *_layer(layer)]
    parts += ["", "[load]                             # what the outermost faces rest on"]
    parts += [f"back = {_quoted(new.back)}", f"front = {_quoted(new.front)}"]
    for name, present in steps_of(new.layers):
        layers = ", ".join(_quoted(layer_name) for layer_name in present)
        parts += ["", "[[steps]]", f"name = {_quoted(name)}", f"layers = [{layers}]"]
    return "\n".join(parts) + "\n" + _sweep(new)


def steps_of(layers: Sequence[NewLayer]) -> list[tuple[str, tuple[str, ...]]]:
    """Return name and layers of each gluing step: one step for every layer that is not glue."""
    names = [layer.name for layer in layers]
    ends = [k for k, layer in enumerate(layers) if not layer.name.startswith("glue")]
    return [(names[k], tuple(names[: k + 1])) for k in ends]


def _layer(layer: NewLayer) -> list[str]:
    material = find(layer.material)
    lines = [
        "[[layers]]",
        f"name = {_quoted(layer.name)}",
        f"kind = {_quoted(layer.kind)}",
        f"material = {_quoted(material.name)}",
        f"thickness_mm = {{ value = {layer.thickness_mm:g}, u = {layer.u_mm:g} }}",
        "# nominal, SI units:",
    ]
    for name in ("density", "c33D", "h33", "eps33S") if layer.kind == "piezo" else ("density", "z", "c", "q"):
        q = material.values.get(name)
        if q is not None:
            lines.append(f"#   {name} = {complex_with_uncertainty(q.re, q.im, q.u, q.u_im)}  ({q.source})")
    return lines


def _sweep(new: NewBuild) -> str:
    """Return the [sweep] table, which covers the first piezo layer's half-wave resonance and its third harmonic."""
    disk = next(layer for layer in new.layers if layer.kind == "piezo")
    values = find(disk.material).values
    speed = (values["c33D"].re / values["density"].re) ** 0.5 if "c33D" in values else 4400.0
    f_MHz = speed / (2e3 * disk.thickness_mm)
    highest_MHz = capabilities_of("").frequency_Hz[1] / 1e6
    return _SWEEP.format(
        near_start=0.25 * f_MHz,
        near_stop=1.5 * f_MHz,
        wide_start=0.12 * f_MHz,
        wide_stop=min(3.6 * f_MHz, highest_MHz),
        points=USUAL_POINTS,
    )


def _quoted(text: str) -> str:
    """Return the text as a TOML string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
