"""The physical range of elastic layers, from the material library: what no material has, and no such layer."""

import math
from collections.abc import Iterable, Iterator, Mapping

from ...models.build import Build, LayerSpec
from ...models.effects.bond_layer import SOFT, THICKEST
from ...models.materials import MATERIALS
from ..interface import Constant, FitError

_SHOWN = {"z": (1e-6, "MRayl"), "c": (1.0, "m/s")}
"""Factor from SI to the unit of the build file, and that unit."""
_ANY = 10.0
"""Factor beyond all materials and fluids of the library from which on a value is a slip of its unit."""
OTHER = 6.0
"""Standard uncertainties from its value beyond which a material is another one."""


def refuse_impossible(build: Build, layers: Iterable[LayerSpec]) -> None:
    """Raise FitError for an impedance or a velocity in the build that is far from that of any material."""
    for layer in layers:
        for name, (factor, unit) in _SHOWN.items() if layer.kind == "elastic" else ():
            known = [m.values[name].re for m in MATERIALS if m.kind != "piezo" and name in m.values]
            low, high = min(value for value in known if value > 0), max(known)
            value = layer.values[name].re
            if not low / _ANY < value < high * _ANY:
                raise FitError(
                    f"layer {layer.name!r} of build {build.name!r}: {name} is {factor * value:.3g} {unit}; materials "
                    f"have {_rounded(factor * low)} to {_rounded(factor * high)} {unit}; correct the value, or its "
                    "unit, in the build file"
                )


def beyond_solids(layer: LayerSpec, constants: Mapping[str, Constant]) -> Iterator[str]:
    """Yield a warning for each constant of a layer that a fit has taken out of the range of the library's solids."""
    for name, (factor, unit) in _SHOWN.items():
        fitted, given = constants[f"{layer.name}.{name}"], layer.values[name].re
        solids = [m.values[name] for m in MATERIALS if m.kind not in ("piezo", "fluid") and name in m.values]
        low, high = min(q.re - OTHER * q.u for q in solids), max(q.re + OTHER * q.u for q in solids)
        if fitted.free and low < given < high and not low < fitted.re < high:
            yield (
                f"{layer.name}.{name} is {factor * fitted.re:.3g} {unit}; solids have "
                f"{_rounded(factor * low)} to {_rounded(factor * high)} {unit}: check the layers of the build file, "
                f"and hold {layer.name}.{name} if the recording does not determine it."
            )


def too_thick(build: Build, layer: LayerSpec, constants: Mapping[str, Constant]) -> Iterator[str]:
    """Yield a warning if a layer is thicker than glue lines if it is soft, or than the device is wide."""
    thickness, z = (constants[f"{layer.name}.{name}"].re for name in ("thickness", "z"))
    width = 2 * math.sqrt(build.area.re / math.pi) if build.diameter is None else build.diameter.re
    limit, what = (THICKEST, "a line of glue") if z < SOFT else (width, "a layer of this device, by its width,")
    if thickness > limit:
        yield (
            f"{layer.name}.thickness is {1e3 * thickness:.3g} mm; {what} has up to {1e3 * limit:.3g} mm: check "
            f"thickness_mm of {layer.name!r} in the build file."
        )


def _rounded(value: float) -> str:
    return f"{float(f'{value:.2g}'):g}"
