"""Start values of the two-dimensional fit, and the priors of a piezoceramic."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ....models.base.errors import PzctlError
from ....models.build import LayerSpec, Quantity
from ....models.constants.passivity import tensor_coordinates
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.disk_model import Disk2D
from ....models.disk2d.matrices import CONSTANTS
from ....models.materials import MATERIALS
from ...engine.parameters.coordinates import Coordinates
from ...engine.recording import Posterior, Prior
from ..bare_disk import BareDisk
from .reference import parameters_of
from .tensor_coordinates import LOSSES, TURNS

WIDTHS: Mapping[str, float] = {
    "c11E": 0.12,
    "c12E": 0.16,
    "c13E": 0.14,
    "c33E": 0.08,
    "c44E": 0.14,
    "e31": 0.40,
    "e33": 0.12,
    "e15": 0.25,
    "eps11S": 0.25,
    "eps33S": 0.20,
}
"""Prior relative standard uncertainties: the scatter among the complete sets of the library.

Two published sets of the same Pz27 differ by 20 % in c11E, c12E, c13E and by 43 % in e31.
"""
AXIAL = dict.fromkeys(("c11E", "c12E", "c13E", "c44E"), "c33E") | {
    "e31": "e33",
    "e15": "e33",
    "eps11S": "eps33S",
}
"""The axial constant of the kind of each other one: softer and stiffer ceramics have their ratio in common."""
PLANE = 0.12
"""Half the prior relative uncertainty of s11E - s12E and of s11E + s12E.

They are known far better than c11E and c12E suggest: the sets of the library that differ by 20 % in each differ by as
much in the difference.
"""
_LOSS, _LOSS_FACTOR = 0.01, 2.7
# Loss tangents of PZT: 1e-3 for hard, 3e-2 for the softest; the logarithm has this standard deviation.
_ANGLE = 0.03
# Prior standard deviation of the piezoelectric losses, as off-diagonal elements of A.
_UNUSUAL = 1.5
# Deviation of a constant from its expected value, in standard uncertainties, from which it is reported.
_SCAN = 500
# Points of each sweep for the comparison of starts.
_FACES: Reals = np.linspace(-0.16, 0.16, 65)
_SPEED, _LEVEL = 0.08, 0.25
# Prior standard deviations of the logarithms of the scale factors: of a tensor's frequencies and of its permittivities.
_TRIES = 40
# Draws for each tensor wanted, at most.
_SOFTER = (0.0, -0.03, 0.03, -0.06, 0.06)
# Half the relative change of s11E and s12E.
_BLUR = 0.2
# Misfit of ln C above which a point counts as an outlier.


def _tensor(values: Mapping[str, Quantity]) -> Tensor6mm | None:
    """Return the tensor of a layer or material; None if it is not complete."""
    if any(name not in values for name in CONSTANTS):
        return None
    return Tensor6mm(*(values[name].value for name in CONSTANTS))


def library() -> dict[str, Tensor6mm]:
    """Return the complete and passive tensors of the material library, by material."""
    tensors: dict[str, Tensor6mm] = {}
    for material in MATERIALS:
        tensor = _tensor(material.values)
        if tensor is not None and _has_coordinates(tensor):
            tensors[material.name] = tensor
    return tensors


def _has_coordinates(tensor: Tensor6mm) -> bool:
    try:
        tensor_coordinates(tensor)
    except PzctlError:
        return False
    return True


def expected(layer: LayerSpec) -> dict[str, float]:
    """Return the real parts of the ten constants of the layer's material, SI units.

    Of a material that is known in thickness alone, the constants of its thickness mode with the others of the library's
    mean in proportion (see `AXIAL`).
    """
    tensor = _tensor(layer.values)
    sets = [tensor] if tensor is not None else list(library().values())
    usual = {name: float(np.mean([complex(getattr(each, name)).real for each in sets])) for name in CONSTANTS}
    own = _axial(layer.values) if tensor is None else {}
    kinds = {name: AXIAL.get(name, name) for name in CONSTANTS}
    return {name: usual[name] * own[kind] / usual[kind] if own else usual[name] for name, kind in kinds.items()}


def _axial(values: Mapping[str, Quantity]) -> dict[str, float]:
    """Return the real parts of c33E, e33 and eps33S from the constants of the thickness mode; empty without these."""
    if any(name not in values for name in ("c33D", "h33", "eps33S")):
        return {}
    c33D, h33, eps33S = (values[name].re for name in ("c33D", "h33", "eps33S"))
    return {"c33E": c33D - h33**2 * eps33S, "e33": h33 * eps33S, "eps33S": eps33S}


def unusual(layer: LayerSpec, found: Tensor6mm) -> tuple[str, ...]:
    """Return a sentence on the constants that deviate unusually far from those of this kind of ceramic, if any."""
    off = {name: getattr(found, name).real / value - 1 for name, value in expected(layer).items()}
    deviating = [f"{layer.name}.{name} {100 * part:+.0f} %" for name, part in off.items() if _far(name, part)]
    if not deviating:
        return ()
    return (
        f"Unusually far from the material of the build: {', '.join(deviating)}. "
        "If the recording is not described to its noise, such a constant compensates for physics that the model lacks.",
    )


def _far(constant: str, part: float) -> bool:
    return abs(part) > _UNUSUAL * WIDTHS[constant]


def implausibility(disk: BareDisk, found: Mapping[str, complex]) -> float:
    """Return -ln of the probability of ten constants relative to those of the usual ceramic, at least 0.

    It is half of the chi2 of their deviations in excess of its mean.
    """
    z = deviations(disk, found)
    return 0.5 * max(0.0, float(z @ z) - z.size)


def deviations(disk: BareDisk, found: Mapping[str, complex]) -> Reals:
    """Return how far ten constants are from the usual ceramic, in the prior scatter of the fits.

    Of ratios of constants to the axial one of their kind, which softer and stiffer ceramics have in common, and of
    losses above the usual.
    """
    usual = expected(disk.layer)
    part = {
        name: (found[name].real / found[axial].real) / (usual[name] / usual[axial]) for name, axial in AXIAL.items()
    }
    z = [(ratio - 1) / WIDTHS[name] for name, ratio in part.items()]
    lossy = [abs(found[name].imag / found[name].real) for name in ("c11E", "c33E", "c44E", "eps11S", "eps33S")]
    z += [max(0.0, math.log(max(loss, _LOSS) / _LOSS) / math.log(_LOSS_FACTOR)) for loss in lossy]
    return np.array(z)


def tensor_priors(disk: BareDisk) -> tuple[Prior | Posterior, ...]:
    """Return the priors of the ten constants, and of sizes and density."""
    sizes = (Prior(disk.size_name(name), q.re, q.u) for name, q in disk.sizes.items() if q.u > 0)
    return (*ceramic_priors(disk.layer), *sizes)


def ceramic_priors(layer: LayerSpec) -> tuple[Prior | Posterior, ...]:
    """Return the priors of the ten constants of a layer."""
    at, usual = layer.name, expected(layer)
    priors = (Prior(f"{at}.{name}.re", value, WIDTHS[name] * abs(value)) for name, value in usual.items())
    return (*priors, _plane_prior(at, usual), _loss_prior(at))


def _plane_prior(layer: str, c: Mapping[str, float]) -> Posterior:
    """Return the prior of s11E - s12E and s11E + s12E, on the coordinates that are half their logarithms."""
    minus = 1 / (c["c11E"] - c["c12E"])
    plus = 1 / (c["c11E"] + c["c12E"] - 2 * c["c13E"] ** 2 / c["c33E"])
    names = (f"{layer}.tensor.minus0", f"{layer}.tensor.axial0")
    return Posterior(names, np.log([minus, plus]) / 2, np.eye(2) / PLANE)


def _loss_prior(layer: str) -> Posterior:
    """Return the prior of the losses, on their coordinates: no recording determines all of them."""
    names = tuple(f"{layer}.{name}" for name in (*LOSSES, *TURNS))
    mean = np.array([math.log(_LOSS) / 2] * len(LOSSES) + [0.0] * len(TURNS))
    width = np.array([math.log(_LOSS_FACTOR) / 2] * len(LOSSES) + [_ANGLE] * len(TURNS))
    return Posterior(names, mean, np.diag(1 / width))


def starts(disk: BareDisk) -> list[dict[str, float]]:
    """Return start values of the model parameters: the layer's own tensor, then each of the library's."""
    own = _tensor(disk.layer.values)
    tensors = [own] if own is not None and _has_coordinates(own) else []
    tensors += [tensor for tensor in library().values() if tensor != own]
    sizes = {disk.size_name(name): q.re for name, q in disk.sizes.items()}
    return [sizes | parameters_of(tensor, disk.layer.name) for tensor in tensors]


def drawn_constants(usual: Mapping[str, float], rng: np.random.Generator) -> dict[str, float] | None:
    """Return real constants from the prior around `usual`, with the same axial ones; None if they are unlikely."""
    lateral = [name for name in CONSTANTS if name in AXIAL]
    drawn = {**usual, **{name: usual[name] * (1 + WIDTHS[name] * rng.normal()) for name in lateral}}
    return drawn if _likelihood(drawn, usual) >= rng.uniform() else None


def _likelihood(drawn: Mapping[str, float], usual: Mapping[str, float]) -> float:
    """Return the prior density of s11E - s12E and s11E + s12E over its largest value."""
    minus, plus = _plane(drawn)
    if minus <= 0 or plus <= 0:
        return 0.0
    ratios = [math.log(one / other) for one, other in zip((minus, plus), _plane(usual), strict=True)]
    return math.exp(-sum((ratio / (2 * PLANE)) ** 2 for ratio in ratios) / 2)


def _plane(c: Mapping[str, float]) -> tuple[float, float]:
    """Return the stiffnesses 1/(s11E - s12E) and 1/(s11E + s12E), Pa."""
    return c["c11E"] - c["c12E"], c["c11E"] + c["c12E"] - 2 * c["c13E"] ** 2 / c["c33E"]


def matched(
    disk: BareDisk, model: Disk2D, coordinates: Coordinates, beside: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return the same with the plane softer or stiffer, and the whole tensor scaled to match the recordings.

    The best match of each tensor comes first, then the others, each group best first. `beside`: values of what else
    the coordinates have.

    Order and frequency of an overtone determine the stiffness of the plane only together, and neighbouring orders look
    alike: five stiffnesses of the plane are tried. With stiffnesses s times, permittivities q times and piezoelectric
    constants sqrt(s q) times as large, the capacitance is q C(f/sqrt(s)), so one curve serves for all s and q.
    """
    at = [coordinates.free.index(f"{disk.layer.name}.tensor.{name}") for name in ("minus0", "axial0")]
    first: list[tuple[float, dict[str, float]]] = []
    rest: list[tuple[float, dict[str, float]]] = []
    for start in ({**one, **beside} for one in starts(disk)):
        x = coordinates.inverse(start)
        family: list[tuple[float, dict[str, float]]] = []
        for softer in _SOFTER:
            moved = x.copy()
            moved[at] += softer
            family.append(_matched(disk, model.replace(_own(start | coordinates.forward(moved)[0], model))))
        family.sort(key=lambda entry: entry[0])
        first.append(family[0])
        rest += family[1:]
    return [start for part in (first, rest) for _, start in sorted(part, key=lambda entry: entry[0])]


def drawn_starts(
    disk: BareDisk,
    scaled: Sequence[Mapping[str, float]],
    coordinates: Coordinates,
    count: int,
    rng: np.random.Generator,
) -> list[Reals]:
    """Return the coordinates of random tensors: the prior's, with the axial constants of each of `scaled` in turn.

    The values of what else the coordinates have are those of `scaled`, too.
    """
    layer, usual = disk.layer.name, expected(disk.layer)
    made: list[Reals] = []
    for _ in range(_TRIES * count):
        drawn, base = drawn_constants(usual, rng), scaled[len(made) % len(scaled)]
        if drawn is None:
            continue
        values = dict(base)
        for name in CONSTANTS:
            axial, re = AXIAL.get(name, name), f"{layer}.{name}.re"
            values[re] = drawn[name] * base[f"{layer}.{axial}.re"] / usual[axial]
            values[f"{layer}.{name}.im"] *= values[re] / base[re]
        try:
            made.append(coordinates.inverse(values))
        except PzctlError:
            continue
        if len(made) == count:
            break
    return made


def _own(values: Mapping[str, float], model: Disk2D) -> dict[str, float]:
    return {name: values[name] for name in model.parameters()}


def _matched(disk: BareDisk, model: Disk2D) -> tuple[float, dict[str, float]]:
    """Return the misfit of the best scaled tensor, and its parameters."""
    ratios: list[Complexes] = []
    for sweep in disk.sweeps:
        low, high = math.log(float(sweep.frequency[0])), math.log(float(sweep.frequency[-1]))
        reach = float(_FACES[-1])
        asked: Reals = np.linspace(low, high, _SCAN)
        wide: Reals = np.linspace(low - reach, high + reach, 2 * _SCAN)
        measured = _between(asked, np.log(sweep.frequency), _log_C(sweep.frequency, sweep.impedance))
        curve = _log_C(np.exp(wide), model.impedance(np.exp(wide)))
        ratios.append(np.array([measured - _between(asked + face, wide, curve) for face in _FACES.tolist()]))
    whole = np.hstack(ratios)
    level = np.median(whole.real, axis=1)
    misfit = np.mean(np.log1p(np.abs(whole - level[:, None]) ** 2 / _BLUR**2), axis=1)
    misfit += (_FACES**2 / _SPEED**2 + level**2 / _LEVEL**2) / whole.shape[1]
    best = int(np.argmin(misfit))
    s, q = math.exp(-2 * float(_FACES[best])), math.exp(float(level[best]))
    factor = {"c": s, "e": math.sqrt(s * q), "eps": q}
    tensor = {
        f"{model.name}.{name}.{part}": value * factor["eps" if name.startswith("eps") else name[0]]
        for name in CONSTANTS
        for part in ("re", "im")
        for value in [model.parameters()[f"{model.name}.{name}.{part}"]]
    }
    return float(misfit[best]), model.parameters() | tensor


def _log_C(frequency: Frequencies, impedance: Impedances) -> Complexes:
    return -np.log(j_omega(frequency) * impedance)


def _between(x: Reals, known: Reals, values: Complexes) -> Complexes:
    """Return complex values interpolated linearly."""
    return np.interp(x, known, values.real) + 1j * np.interp(x, known, values.imag)
