"""Polarity of recordings: detect and correct Z with the wrong sign, or its complex conjugate."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..models.sweep import Sweep

_MOSTLY = 0.9
_FALLING = 0.75
"""Share of points with falling reactance from which a recording is conjugated or inverted; in a correct recording,
coupled modes make the reactance fall at one point in six at most."""
_STRIDE = 100
"""The rise of the reactance is measured over 1/100 of the sweep, so that noise does not decide."""


def polarity_of(sweep: Sweep) -> str | None:
    """Return `inverted` (Z has the wrong sign), `conjugated`, or None if the recording is correct.

    A passive device has Re Z >= 0 everywhere. Where its losses are small its reactance rises with frequency (Foster's
    theorem), whatever is in series with it; the reactance of the complex conjugate falls.
    """
    negative = float(np.mean(sweep.impedance.real < 0)) > _MOSTLY
    rising = _part_rising(sweep)
    if rising is None or 1 - rising < _FALLING:
        return None
    return "inverted" if negative else "conjugated"


def _part_rising(sweep: Sweep) -> float | None:
    """Return the share of mostly reactive points at which the reactance rises; None if there are too few points."""
    Z = sweep.impedance
    stride = max(1, Z.size // _STRIDE)
    reactive = np.abs(Z.imag) > np.abs(Z.real)
    both = reactive[stride:] & reactive[:-stride] & (Z.imag[stride:] * Z.imag[:-stride] > 0)
    rise = (Z.imag[stride:] - Z.imag[:-stride])[both]
    return float(np.mean(rise > 0)) if rise.size >= _STRIDE // 10 else None


def put_right(sweeps: Mapping[str, tuple[Sweep, ...]]) -> tuple[dict[str, tuple[Sweep, ...]], dict[str, str]]:
    """Return the sweeps with correct polarity, and by step the correction that was needed."""
    turned: dict[str, str] = {}
    right: dict[str, tuple[Sweep, ...]] = {}
    for step, of_step in sweeps.items():
        made: list[Sweep] = []
        for sweep in of_step:
            wrong = polarity_of(sweep)
            if wrong is not None:
                turned[step] = wrong
                sign = -sweep.impedance if wrong == "inverted" else np.conj(sweep.impedance)
                made.append(replace(sweep, impedance=sign))
            else:
                made.append(sweep)
        right[step] = tuple(made)
    return right, turned


def turned_says(step: str, how: str) -> str:
    """Return the sentence about a recording that was corrected; `how`: `inverted` or `conjugated`."""
    return f"The recording of {step} is {how}: fits take it turned round; the file stays as it is."
