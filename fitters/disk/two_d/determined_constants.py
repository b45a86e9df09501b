"""Constants and combinations of constants that a recording of a disk does not determine."""

import numpy as np
from scipy.linalg import eigh, pinvh, qr

from ....models.base.arrays import Reals
from ....models.disk2d.line_elements import Numbers
from ....models.disk2d.matrices import CONSTANTS
from ...engine.covariance import Curvature, curvature
from ...engine.descent import Descent

_TOLD = 0.5
# A combination counts as determined if the recording halves its prior uncertainty.
_PART = 0.25
# Constants that change by less than this part of their prior uncertainty are not named.


def undetermined(descent: Descent, layer: str) -> tuple[str, ...]:
    """Return sentences on constants, losses, and combinations of constants that the recording does not determine.

    The combinations are the generalised eigenvectors of posterior and prior covariance of ln|Re| of the ten constants;
    the eigenvalues are the remaining parts of the variance.
    """
    bends = curvature(descent.objective, descent.x)
    values, chain = descent.objective.coordinates.forward(descent.x)
    row = {name: k for k, name in enumerate(descent.objective.coordinates.parameters)}
    real = np.array([chain[row[f"{layer}.{c}.re"]] / abs(values[f"{layer}.{c}.re"]) for c in CONSTANTS])
    loss = np.array([chain[row[f"{layer}.{c}.im"]] / abs(values[f"{layer}.{c}.re"]) for c in CONSTANTS])
    after, before = _covariances(bends, real)
    lost, known = _covariances(bends, loss)
    held = [f"{layer}.{name}" for name, u, own in _each(after, before) if u > _TOLD * own]
    losses = [f"{layer}.{name}" for name, u, own in _each(lost, known) if u > _TOLD * own]
    says: list[str] = []
    if held:
        says.append(
            f"This recording alone does not determine {', '.join(held)}: their values and uncertainties are those of "
            "PZT in general."
        )
    together = _together(after, before, layer)
    if together:
        says.append(
            f"It determines {len(CONSTANTS) - len(together)} combinations of the ten real parts. The others rest on "
            f"the library; the constants of each change only together: {'; '.join(together)}."
        )
    if losses:
        says.append(f"Losses not determined for: {', '.join(losses)}.")
    return tuple(says)


def _covariances(bends: Curvature, chain: Reals) -> tuple[Reals, Reals]:
    """Return posterior and prior covariance of what `chain` derives from the coordinates, shape (10, 10)."""
    prior = bends.rows[bends.data :]
    norm = np.linalg.norm(prior, axis=0)
    scale = np.where(norm > 0, 1 / np.where(norm > 0, norm, 1.0), 0.0)  # effects beside the disk have no prior here
    known = np.asarray(pinvh((prior * scale).T @ (prior * scale)), np.float64)
    return bends.covariance(chain), (chain * scale) @ known @ (chain * scale).T


def _each(after: Reals, before: Reals) -> list[tuple[str, float, float]]:
    pairs = zip(np.sqrt(np.diag(after)).tolist(), np.sqrt(np.diag(before)).tolist(), strict=True)
    return [(name, *pair) for name, pair in zip(CONSTANTS, pairs, strict=True)]


def _together(after: Reals, before: Reals, layer: str) -> list[str]:
    """Return the undetermined directions: a constant changed by its standard uncertainty, and the others accordingly.

    The undetermined eigenvectors span a space; each sentence describes the direction in it in which one leading
    constant changes and the other leading ones do not, so that as few constants as possible are named.
    """
    own = np.sqrt(np.diag(before))
    scaled = before / np.outer(own, own)
    left, vectors = _eigh(after / np.outer(own, own), scaled)
    space = scaled @ vectors[:, left > _TOLD**2]
    if not space.size:
        return []
    leading = np.sort(_pivots(space.T)[: space.shape[1]])
    each = space @ np.linalg.inv(space[leading])
    sentences: list[str] = []
    for k, direction in zip(leading.tolist(), each.T, strict=True):
        moved = own * direction * float(np.sqrt(after[k, k])) / own[k]
        with_it = [i for i in np.argsort(-np.abs(direction)).tolist() if i != k and abs(direction[i]) > _PART]
        others = ", ".join(f"{layer}.{CONSTANTS[i]} {100 * moved[i]:+.2g} %" for i in with_it)
        sentences.append(f"{layer}.{CONSTANTS[k]} {100 * moved[k]:+.2g} %" + (f" with {others}" if others else ""))
    return sentences


def _eigh(a: Reals, b: Reals) -> tuple[Reals, Reals]:
    solution: tuple[Reals, Reals] = eigh(a, b)
    return solution


def _pivots(rows: Reals) -> Numbers:
    factors: tuple[Numbers, Numbers, Numbers] = qr(rows, pivoting=True)
    return factors[2]
