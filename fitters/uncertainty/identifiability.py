"""Identifiability: constants that a recording cannot separate, and the combination that it determines."""

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...models.base.arrays import Reals
from ...models.base.uncertain_numbers import with_uncertainty
from ...models.build import LayerSpec
from ..interface import Constant

_TOGETHER = 0.95
_NEARLY_ONE = 0.99
_TIED = 1 - 1e-10
# Correlation above which two parameters are one tied constant.
_BETTER = 0.3
# A combination is reported if its relative uncertainty is below this part of that of the better known constant.
_THIN = 0.05
# Thickness in periods below which a layer acts as a spring: only its compliance matters.
_MADE_OF = {"delay": ("c", "thickness"), "compliance": ("z", "c", "thickness")}
_MOST = 3


@dataclass(frozen=True)
class _Pair:
    first: str
    second: str
    correlation: float


def separability(
    layers: Sequence[LayerSpec],
    values: Mapping[str, float],
    names: Sequence[str],
    covariance: Reals,
    derived: Mapping[str, Constant],
    highest: float,
) -> tuple[str, ...]:
    """Return sentences on inseparable constants; `covariance` is of the parameters `names`, `highest` in Hz."""
    relative = _relative(values, names, covariance)
    says: list[str] = []
    for layer in layers:
        if layer.kind == "elastic":
            says += _of_layer(layer.name, relative, derived, highest)
    ceramics = [layer.name for layer in layers if layer.kind == "piezo" and layer.values["c33D"].same_as is None]
    says += filter(None, (_alike(first, second, relative) for first, second in combinations(ceramics, 2)))
    tied = {f"{layer.name}.{name}" for layer in layers for name, value in layer.values.items() if value.same_as}
    return (*says, *_across(relative, tied))


class _Relative:
    """Relative uncertainties and correlations of the free parameters."""

    def __init__(self, names: Sequence[str], covariance: Reals) -> None:
        self.names = tuple(names)
        self.u = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        self._covariance = covariance
        self._at = {name: k for k, name in enumerate(names)}

    def correlation(self, first: str, second: str) -> float:
        size = self.u[first] * self.u[second]
        return float(self._covariance[self._at[first], self._at[second]]) / size


def _relative(values: Mapping[str, float], names: Sequence[str], covariance: Reals) -> _Relative:
    size = np.array([values[name] for name in names])
    kept = [k for k in range(len(names)) if covariance[k, k] > 0 and size[k] != 0]
    scaled = covariance[np.ix_(kept, kept)] / np.outer(size[kept], size[kept])
    return _Relative([names[k] for k in kept], scaled)


def _alike(first: str, second: str, relative: _Relative) -> str | None:
    """Return the sentence on two piezo layers of which the recording determines only the mean of some constants."""
    found: list[str] = []
    for name in relative.names:
        layer, _, constant = name.partition(".")
        other = f"{second}.{constant}"
        if layer != first or other not in relative.u or constant in ("thickness", "density"):
            continue
        rho, u, v = relative.correlation(name, other), relative.u[name], relative.u[other]
        mean = float(np.sqrt(max(0.0, u**2 + v**2 + 2 * rho * u * v))) / 2
        if rho < -_TOGETHER and mean < _BETTER * min(u, v):
            shown = constant.removesuffix(".re")
            found.append(f"{shown} to {100 * mean:.2g} % (each alone to {100 * min(u, v):.2g} %)")
    if not found:
        return None
    return (
        f"The recordings cannot tell {first} from {second}; they determine the mean of {', '.join(found)}. If both are "
        f'of one ceramic, write material = {{ same_as = "{first}" }} for {second}.'
    )


def _of_layer(layer: str, relative: _Relative, derived: Mapping[str, Constant], highest: float) -> list[str]:
    """Return the sentences on one passive layer."""
    free = [name for name in ("z", "c", "thickness") if f"{layer}.{name}" in relative.u]
    thin = derived[f"{layer}.delay"].re * highest < _THIN
    if free == ["thickness"] and thin:
        return [
            f"{layer}.thickness depends on {layer}.z and {layer}.c, which are held; the recording determines "
            f"{_shown(layer, 'compliance', derived)}."
        ]
    says: list[str] = []
    told: set[str] = set()
    for combination in ("compliance", "delay") if thin else ("delay", "compliance"):
        parts = [name for name in _MADE_OF[combination] if name in free and name not in told]
        pairs = [(a, b, relative.correlation(f"{layer}.{a}", f"{layer}.{b}")) for a, b in combinations(parts, 2)]
        close = [pair for pair in pairs if abs(pair[2]) > _TOGETHER]
        if not close or not _better(layer, combination, parts, relative, derived):
            continue
        a, b, rho = max(close, key=lambda pair: abs(pair[2]))
        told |= {a, b}
        says.append(
            f"{layer}.{a} and {layer}.{b} cannot be separated (correlation {_rho(rho)}); the recording "
            f"determines {_shown(layer, combination, derived)}."
        )
    return says


def _better(layer: str, made: str, parts: Sequence[str], relative: _Relative, derived: Mapping[str, Constant]) -> bool:
    constant = derived[f"{layer}.{made}"]
    best = min(relative.u[f"{layer}.{name}"] for name in parts)
    return constant.u_re is not None and constant.u_re / abs(constant.re) < _BETTER * best


def _shown(layer: str, made: str, derived: Mapping[str, Constant]) -> str:
    constant = derived[f"{layer}.{made}"]
    return f"{layer}.{made} = {with_uncertainty(constant.re, constant.u_re)} {constant.unit}"


def _rho(rho: float) -> str:
    """Return a correlation with as many digits as it has nines, plus one."""
    digits = int(np.clip(np.ceil(-np.log10(max(1e-12, 1 - abs(rho)))), 2, 8))
    return f"{rho:.{digits}f}"


def _across(relative: _Relative, tied: Set[str]) -> list[str]:
    """Return the closest pairs of constants of different layers, and the product of powers that is known better.

    `tied`: the constants that follow another one.
    """
    pairs = [
        _Pair(a, b, relative.correlation(a, b))
        for a, b in combinations((name for name in relative.names if name.removesuffix(".re") not in tied), 2)
        if a.split(".")[0] != b.split(".")[0] and not a.endswith(".im") and not b.endswith(".im")
        # The loads of air on the two faces of a disk are inseparable, and nobody needs them.
        if not {a, b} & {"back.z", "front.z"}
    ]
    near = (pair for pair in pairs if _NEARLY_ONE < abs(pair.correlation) < _TIED)
    close = sorted(near, key=lambda pair: -abs(pair.correlation))
    says: list[str] = []
    told: set[str] = set()
    for pair in close:
        if told & {pair.first, pair.second} or len(says) == _MOST:
            continue
        told |= {pair.first, pair.second}
        power = -pair.correlation * relative.u[pair.first] / relative.u[pair.second]
        left = relative.u[pair.first] * float(np.sqrt(max(0.0, 1 - pair.correlation**2)))
        first, second = pair.first.removesuffix(".re"), pair.second.removesuffix(".re")
        says.append(
            f"{first} and {second} are strongly correlated ({_rho(pair.correlation)}): they are known to "
            f"{100 * relative.u[pair.first]:.2g} % and {100 * relative.u[pair.second]:.2g} %, but "
            f"{first} * {second}^{power:.2g} to {100 * left:.1g} %."
        )
    return says
