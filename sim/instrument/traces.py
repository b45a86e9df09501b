"""The two traces that the instrument derives from complex impedance, for each of the 24 measurement parameters.

Series: Z = Rs + j w Ls = Rs + 1/(j w Cs). Parallel: Y = G + j w Cp = G + 1/(j w Lp), Rp = 1/G.
Q = |X|/R with the sign of the element, D = 1/Q.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals

HUGE = 9.9e37
"""What the instrument shows where a value is not defined (a division by zero)."""


@dataclass(frozen=True, eq=False)
class Parts:
    """Impedance at frequencies, and the quantities derived from it. Every array has the shape (N,)."""

    w: Reals
    """Angular frequency, rad/s."""
    z: Impedances
    """ohm."""
    y: Impedances
    """S."""


QUANTITIES: Mapping[str, Callable[[Parts], Reals]] = {
    "|Z|": lambda p: np.abs(p.z),
    "theta_z": lambda p: np.angle(p.z, deg=True),
    "R": lambda p: p.z.real,
    "X": lambda p: p.z.imag,
    "|Y|": lambda p: np.abs(p.y),
    "theta_y": lambda p: np.angle(p.y, deg=True),
    "G": lambda p: p.y.real,
    "B": lambda p: p.y.imag,
    "Ls": lambda p: p.z.imag / p.w,
    "Cs": lambda p: -1 / (p.w * p.z.imag),
    "Lp": lambda p: -1 / (p.w * p.y.imag),
    "Cp": lambda p: p.y.imag / p.w,
    "Rp": lambda p: 1 / p.y.real,
    "Q": lambda p: np.abs(p.z.imag) / p.z.real,
    "D": lambda p: p.z.real / np.abs(p.z.imag),
}

TRACES: Mapping[str, tuple[str, str]] = {
    "IMPH": ("|Z|", "theta_z"), "IRIM": ("R", "X"), "LSR": ("Ls", "R"), "LSQ": ("Ls", "Q"), "CSR": ("Cs", "R"),
    "CSQ": ("Cs", "Q"), "CSD": ("Cs", "D"), "AMPH": ("|Y|", "theta_y"), "ARIM": ("G", "B"), "LPG": ("Lp", "G"),
    "LPQ": ("Lp", "Q"), "CPG": ("Cp", "G"), "CPQ": ("Cp", "Q"), "CPD": ("Cp", "D"), "IMLS": ("|Z|", "Ls"),
    "IMCS": ("|Z|", "Cs"), "IMLP": ("|Z|", "Lp"), "IMCP": ("|Z|", "Cp"), "IMRS": ("|Z|", "R"), "IMQ": ("|Z|", "Q"),
    "IMD": ("|Z|", "D"), "LPR": ("Lp", "Rp"), "CPR": ("Cp", "Rp"),
}  # fmt: skip
"""Quantities of trace A and trace B; COMP is not listed, because its traces are complex."""


def trace(frequency: Frequencies, z: Impedances, measurement: str, which: str) -> tuple[Reals, Reals]:
    """Return readout and subsidiary readout, each of shape (N,), of trace `A` or `B`.

    The subsidiary is 0 for a scalar parameter. `COMP` is Z (R, X) in trace A and Y (G, B) in trace B.
    """
    with np.errstate(all="ignore"):
        y = np.where(z == 0, HUGE, 1 / np.where(z == 0, 1, z))
        parts = Parts(2 * np.pi * frequency, z, y)
        if measurement == "COMP":
            first, second = ("R", "X") if which == "A" else ("G", "B")
            return _shown(QUANTITIES[first](parts)), _shown(QUANTITIES[second](parts))
        name = TRACES[measurement][0 if which == "A" else 1]
        shown = _shown(QUANTITIES[name](parts))
    return shown, np.zeros_like(shown)


def _shown(values: Reals) -> Reals:
    return np.nan_to_num(values, nan=HUGE, posinf=HUGE, neginf=-HUGE)
