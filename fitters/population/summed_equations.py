"""Normal equations of all samples together, and ln evidence as a quadratic in the sizes of shared effects."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..error_model import prior_scales as scales
from ..error_model.error_sizes import ErrorSizes
from .sample_equations import HALF, Knobs, SampleEquations

_Part = tuple[SampleEquations, Reals, float]
"""A sample, its Gram matrix on the keys of all, and ln det of what was integrated out."""


@dataclass(frozen=True, eq=False)
class SummedEquations:
    """Normal equations of all samples."""

    keys: tuple[str, ...]
    G: Reals
    log_det: float
    parts: "tuple[_Part, ...]"
    """Each sample's, on the keys of all."""

    @classmethod
    def of(cls, equations: Sequence[SampleEquations], model_error: tuple[float, float]) -> "SummedEquations":
        """Return the sum over samples, with the model's own error of this size (smooth, rough)."""
        keys = tuple(dict.fromkeys(key for one in equations for key in one.keys))
        at = {key: k for k, key in enumerate(keys)}
        parts: list[_Part] = []
        for one in equations:
            gram, log_det = one.grams[model_error]
            index = np.array([*(at[key] for key in one.keys), len(keys)])
            G = np.zeros((len(keys) + 1, len(keys) + 1))
            G[np.ix_(index, index)] = gram
            parts.append((one, G, log_det))
        return cls.summed(keys, parts)

    @classmethod
    def summed(cls, keys: tuple[str, ...], parts: "Sequence[_Part]") -> "SummedEquations":
        """Return the sum of equations that are on the keys of all."""
        return cls(keys, np.sum([G for _, G, _ in parts], axis=0), sum(own for _, _, own in parts), tuple(parts))

    def only(self, number: int) -> "SummedEquations":
        """Return the equations of one sample alone."""
        return SummedEquations.summed(self.keys, self.parts[number : number + 1])

    def scattered(self, key: str, spread: float) -> "SummedEquations":
        """Return the equations with a size that scatters between samples with this standard deviation."""
        if spread == 0:
            return self
        k = self.keys.index(key)
        parts = [
            (
                one,
                G - np.outer(G[:, k], G[k]) / (1 / spread**2 + G[k, k]),
                own + float(np.log(1 + spread**2 * G[k, k])),
            )
            for one, G, own in self.parts
        ]
        return SummedEquations.summed(self.keys, parts)


@dataclass(frozen=True, eq=False)
class Quadratic:
    """ln evidence as a quadratic in the sizes of some effects: top - b.d - d.A.d/2."""

    top: float
    b: Reals
    A: Reals


def scales_of(total: SummedEquations, sizes: ErrorSizes, names: Sequence[str], knobs: Knobs) -> Reals:
    """Return the prior standard deviation of every shared column's coefficient; 0 for an absent one."""
    scale = {"slow": sizes.slow, "fast": sizes.fast, "fixture": sizes.fixture}
    scale |= {"tau": HALF * sizes.tau, "imaginary": HALF * scales.IMAGINARY * sizes.tau}
    beside = {f"{name} {knob.name}" for name in names for knob in knobs[name][1:]}
    return np.array([1.0 if key in beside else scale.get(key.partition(" ")[0], 0.0) for key in total.keys])


def quadratic_in(
    total: SummedEquations, sizes: ErrorSizes, names: Sequence[str], knobs: Knobs, fixture: Mapping[str, float]
) -> Quadratic:
    """Return ln evidence in the deviations of the sizes of these effects from where they were linearised.

    `fixture`: its residue where it was linearised, SI.
    """
    d = scales_of(total, sizes, names, knobs)
    on = np.flatnonzero(d > 0)
    rest = np.array([*(total.keys.index(f"{name} {knobs[name][0].name}") for name in names), len(total.keys)])
    inner = np.eye(on.size) + d[on][:, None] * total.G[np.ix_(on, on)] * d[on]
    outer = d[on][:, None] * total.G[np.ix_(on, rest)]
    there = residue_at(total, fixture)
    outer[:, -1] += there[on]
    left = total.G[np.ix_(rest, rest)] - outer.T @ np.linalg.solve(inner, outer)
    _, log_det = np.linalg.slogdet(inner)
    top = -0.5 * (left[-1, -1] + float(there @ there) + log_det + total.log_det) + sizes.log_prior
    return Quadratic(float(top), left[:-1, -1], left[:-1, :-1])


def residue_at(total: SummedEquations, fixture: Mapping[str, float]) -> Reals:
    """Return the fixture's residue where it was linearised, in units of its prior, at its columns."""
    of = {f"fixture {name}": value / scales.FIXTURE[name] for name, value in fixture.items()}
    return np.array([of.get(key, 0.0) for key in total.keys])


def without_others(found: Quadratic) -> Quadratic:
    """Return the quadratic in the first size, the others at their likeliest."""
    if found.b.size == 1:
        return found
    part = np.linalg.solve(found.A[1:, 1:], np.column_stack([found.A[1:, :1], found.b[1:]]))
    A = found.A[:1, :1] - found.A[:1, 1:] @ part[:, :1]
    return Quadratic(found.top, found.b[:1] - found.A[:1, 1:] @ part[:, 1], A)
