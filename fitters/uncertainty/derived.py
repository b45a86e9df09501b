"""Constants derived from the fitted ones, with uncertainties and correlations propagated."""

from collections.abc import Mapping

import numpy as np

from ...models.base.arrays import Reals
from ...models.build import LayerSpec
from ..interface import Constant

_STEP = 1e-6
DERIVED_UNITS = {
    "kt": "1",
    "Qm": "1",
    "tan_delta": "1",
    "v33D": "m/s",
    "z33D": "Rayl",
    "fp": "Hz",
    "c33": "Pa",
    "delay": "s",
    "compliance": "m/Pa",
}
_BY_THICKNESS = {"fp": -1, "delay": 1, "compliance": 1}
"""Exponent of the thickness in a derived constant."""


def derived_of(layer: LayerSpec, values: Mapping[str, float]) -> dict[str, complex]:
    """Return the derived constants of one layer by name, with `delay@step` and so on for a layer ground before a step.

    Piezo: `kt` = h33 sqrt(eps33S/c33D), `Qm` = c'/c'', `tan_delta`, `v33D` = sqrt(c'/density), `z33D`, `fp` = v/2t.
    Elastic: `c33` = z c (1 + j/q), `delay` = thickness/c, `compliance` = thickness/(z c), the only property that a thin
    bond shows electrically if thickness and stiffness cannot be separated.
    """

    def get(name: str) -> float:
        return values[f"{layer.name}.{name}"]

    if layer.kind == "piezo":
        c = complex(get("c33D.re"), get("c33D.im"))
        h = complex(get("h33.re"), get("h33.im"))
        eps = complex(get("eps33S.re"), get("eps33S.im"))
        v = np.sqrt(c.real / get("density"))
        derived = {
            "kt": complex(np.sqrt(h**2 * eps / c)),
            "Qm": complex(c.real / c.imag) if c.imag else complex(np.inf),
            "tan_delta": complex(-eps.imag / eps.real),
            "v33D": complex(v),
            "z33D": complex(v * get("density")),
            "fp": complex(v / (2 * get("thickness"))),
        }
    else:
        z, c_, q, t = get("z"), get("c"), get("q"), get("thickness")
        derived = {"c33": z * c_ * (1 + 1j / q), "delay": complex(t / c_), "compliance": complex(t / (z * c_))}
    named = {f"{layer.name}.{name}": value for name, value in derived.items()}
    first = f"{layer.name}.thickness"
    for ground in (name for name in values if name.startswith(f"{first}@")):
        thinner, since = values[ground] / values[first], ground.removeprefix(first)
        for name, power in _BY_THICKNESS.items():
            if name in derived:
                named[f"{layer.name}.{name}{since}"] = derived[name] * thinner**power
    return named


def derived_constants(
    layers: tuple[LayerSpec, ...], values: Mapping[str, float], names: tuple[str, ...], covariance: Reals | None
) -> dict[str, Constant]:
    """Return all derived constants; `covariance` is that of the parameters `names`, None if there is none."""
    result: dict[str, Constant] = {}
    for layer in layers:
        there = derived_of(layer, values)
        gradients = {name: np.zeros(len(names), np.complex128) for name in there}
        for k, name in enumerate(names):
            if covariance is None or covariance[k, k] == 0 or not name.startswith(f"{layer.name}."):
                continue
            step = max(_STEP * abs(values[name]), 1e-3 * float(np.sqrt(covariance[k, k])))
            up = derived_of(layer, {**values, name: values[name] + step})
            down = derived_of(layer, {**values, name: values[name] - step})
            for constant in there:
                gradients[constant][k] = (up[constant] - down[constant]) / (2 * step)
        for constant, value in there.items():
            u_re, u_im = (None, None)
            if covariance is not None:
                g = gradients[constant]
                u_re = float(np.sqrt(max(0.0, g.real @ covariance @ g.real)))
                u_im = float(np.sqrt(max(0.0, g.imag @ covariance @ g.imag)))
            unit = DERIVED_UNITS[constant.split(".")[1].partition("@")[0]]
            result[constant] = Constant(value.real, value.imag, u_re, u_im, unit, free=False)
    return result
