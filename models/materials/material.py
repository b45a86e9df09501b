"""Definition of a material, and the usual forms in which its values are given."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from ..build import Quantity
from ..constants.piezo_constants import EPS0
from ..constants.tensor import Tensor6mm

Kind: TypeAlias = Literal["piezo", "elastic", "electrode", "backing", "fluid"]
"""Elastic: glue, matching layer, foil. Electrode and backing are elastic, too, named after their use."""

_LIMIT_TO_U = 1 / math.sqrt(3)
# A data sheet's "+-10 %" are limits; the standard uncertainty of a uniform distribution between limits is
# limit/sqrt(3) (JCGM 100:2008, 4.3.7).
_EPS, _FREQUENCY, _COUPLING = 0.10, 0.05, 0.05  # limits that ceramics makers print
_Q = 0.30  # scatter of Q between data sheet and sample: tens of per cent
_PIEZO_LOSS = 0.01  # u of the loss angle of h, d, e: no data sheet gives it


@dataclass(frozen=True)
class Material:
    """A material of the library.

    Keys of `values`, SI units. Piezo: `density`, thickness mode `c33D h33 eps33S`, radial mode
    `s11E s12E d31 eps33T`, whole tensor `c11E c12E c13E c33E c44E e31 e33 e15 eps11S`, as far as a source gives them.
    Others: `density` (kg/m3), `z` (Rayl), `c` (m/s), `q`; a backing may be known by its `z` alone.
    """

    name: str
    kind: Kind
    values: Mapping[str, Quantity]
    note: str = ""
    temperature: Mapping[str, Quantity] = field(default_factory=dict[str, Quantity])
    """Relative change of constants per kelvin at 25 C, 1/K, where published."""


def standard_uncertainty(limit: float) -> float:
    """Return the standard uncertainty for a tolerance of +- limit."""
    return limit * _LIMIT_TO_U


def _relative_u(name: str) -> float:
    """Return the relative standard uncertainty of a ceramic's constant, from manufacturers' guarantees."""
    u_eps, u_f, u_k = (standard_uncertainty(limit) for limit in (_EPS, _FREQUENCY, _COUPLING))
    u_c = 2 * u_f  # stiffness goes as frequency squared
    if name == "density":
        return 0.01
    if name[0] in "cs":
        return u_c
    if name.startswith("eps"):
        return u_eps
    if name.startswith("h"):  # h = k sqrt(c/eps)
        return math.hypot(u_k, u_c / 2, u_eps / 2)
    return math.hypot(u_k, u_c / 2, u_eps / 2)  # d = k sqrt(eps s), e = k sqrt(eps c)


def ceramic(name: str, value: complex, source: str) -> Quantity:
    """Return a ceramic's constant with the usual tolerances: eps +-10 %, frequency +-5 %, coupling +-5 %, Q 30 %."""
    value = complex(value)
    piezo = name[0] in "degh" and not name.startswith(("density", "eps"))
    u_im = _PIEZO_LOSS * abs(value) if piezo else _Q * abs(value.imag)
    return Quantity(value.real, value.imag, _relative_u(name) * abs(value.real), u_im, source)


def ceramics(values: Mapping[str, complex], source: str) -> dict[str, Quantity]:
    """Return constants of a ceramic, all of one source, by name."""
    return {name: ceramic(name, value, source) for name, value in values.items()}


def from_tensor(tensor: Tensor6mm, density: float, source: str) -> dict[str, Quantity]:
    """Return the ten constants of a source and the thickness- and radial-mode constants that follow from them."""
    own = {name: complex(getattr(tensor, name)) for name in tensor.__dataclass_fields__}
    thickness, radial = tensor.thickness, tensor.radial
    derived: dict[str, complex] = {"c33D": thickness.c33D, "h33": thickness.h33}
    derived |= {name: getattr(radial, name) for name in ("s11E", "s12E", "d31", "eps33T")}
    return {
        **ceramics({"density": density, **own}, source),
        **ceramics(derived, f"{source}; computed from its ten constants"),
    }


def lossless_tensor(
    stiffness_GPa: tuple[float, float, float, float, float],
    e: tuple[float, float, float],
    eps: tuple[float, float],
    Q: float,
    tan_delta: float,
) -> Tensor6mm:
    """Return a tensor from a source's real constants, with one Q and one tan d.

    c11 c12 c13 c33 c44 in GPa; e31 e33 e15 in C/m2; eps11S and eps33S, relative to free space or in F/m. With e real
    the result is passive for any positive Q and tan d.
    """
    unit = EPS0 if eps[0] > 1 else 1.0
    c = [1e9 * value * (1 + 1j / Q) for value in stiffness_GPa]
    return Tensor6mm(*c, *(complex(value) for value in e), *(unit * value * (1 - 1j * tan_delta) for value in eps))


def elastic(
    c: float,
    q: float,
    source: str,
    *,
    density: float | None = None,
    z: float | None = None,
    u: float = 0.05,
    u_q: float = 0.5,
) -> dict[str, Quantity]:
    """Return the values of an elastic layer from its speed (m/s), Q, and density (kg/m3) or impedance (Rayl).

    `u`, `u_q`: relative standard uncertainties of speed and impedance, and of Q.
    """
    density = density if density is not None else (z or math.nan) / c
    z = z if z is not None else density * c
    return {
        "density": Quantity(density, u=u * density, source=source),
        "z": Quantity(z, u=u * z, source=source),
        "c": Quantity(c, u=u * c, source=source),
        "q": Quantity(q, u=u_q * q, source=source),
    }
