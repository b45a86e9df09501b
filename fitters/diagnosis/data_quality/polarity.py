"""Recordings that are turned: Z with the wrong sign, or its complex conjugate."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....models.sweep import Sweep

_MOSTLY = 0.9


def polarity_of(sweep: Sweep) -> str | None:
    """Return how a recording is turned: `inverted` (Z has the wrong sign), `conjugated`, or None where it is right.

    A passive device has Re Z >= 0 everywhere; a piezoelectric one is a capacitor at most frequencies.
    """
    negative = float(np.mean(sweep.impedance.real < 0)) > _MOSTLY
    inductive = float(np.median(sweep.impedance.imag)) > 0
    if negative and inductive:
        return "inverted"
    return "conjugated" if inductive and not negative and _mirrored(sweep) else None


def _mirrored(sweep: Sweep) -> bool:
    """Return whether X falls like that of a capacitor seen in a mirror: inductive, yet largest at low frequency."""
    X = sweep.impedance.imag
    n = max(2, X.size // 10)
    return float(np.median(X[:n])) > float(np.median(X[-n:])) and float(np.mean(X > 0)) > _MOSTLY


def put_right(sweeps: Mapping[str, tuple[Sweep, ...]]) -> tuple[dict[str, tuple[Sweep, ...]], dict[str, str]]:
    """Return the sweeps with their polarity put right, and by step what had to be done."""
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
