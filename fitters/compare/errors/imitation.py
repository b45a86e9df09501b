"""How far sizes of changes imitate errors, so that the errors belong to the sizes."""

import numpy as np

from ....models.base.arrays import Complexes, Reals
from .linearised import Linearised

USUAL_DRIFT = 1e-4
"""Of ln frequency, of all resonances together and of each."""
_IMITATED = 0.5
"""Part of a drift's power that a change in the device may leave if it is to include the drift."""


def shares_of_drift(drift: Complexes, at: Linearised, noise: Reals) -> Reals:
    """Return the shift of the coordinates of changes in the device by each column of drift, shape (P, M).

    Only drift of the same kind counts: a change of strength includes no drift of the frequencies, although it
    imitates some of it. `noise`: of ln Z after, shape (N,).
    """
    made = np.zeros((at.x.size, drift.shape[1]))
    own = list(at.inside)
    if own:
        left, made[own] = beside(drift, at.slopes[:, own], 1 / noise)
        powers = [np.sum(np.abs(columns / noise[:, None]) ** 2, axis=0) for columns in (left, drift)]
        made[:, powers[0] > _IMITATED * powers[1]] = 0.0
    return made


def beside(columns: Complexes, slopes: Complexes, inverse: Reals) -> tuple[Complexes, Reals]:
    """Return columns without the part that coordinates could imitate, and that part's coefficients, shape (P, K).

    So sizes keep their meaning: a shift includes the part imitated by drift. Coordinates have their unit normal prior:
    one that hardly moves ln Z imitates nothing.
    """
    if not slopes.shape[1] or not columns.shape[1]:
        return columns, np.zeros((slopes.shape[1], columns.shape[1]))
    weighted, aim = slopes * inverse[:, None], columns * inverse[:, None]
    length = np.linalg.norm(weighted, axis=0)
    unit = np.where(length > 0, length, 1.0)
    basis = np.vstack([weighted.real / unit, weighted.imag / unit, np.diag(1 / unit)])
    rows = np.vstack([aim.real, aim.imag, np.zeros((unit.size, aim.shape[1]))])
    share = np.linalg.lstsq(basis, rows, rcond=1e-8)[0]
    return np.asarray(columns - (slopes / unit) @ share, np.complex128), share / unit[:, None]
