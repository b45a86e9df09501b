"""`lateral-modes`: radial overtones and the edge mode of a disk of finite diameter, in its thickness band."""

from collections.abc import Mapping
from math import pi, sqrt

import numpy as np

from ..base.arrays import Complexes, Reals
from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter
from .base.scale import active, capacitance, resonance

_WIDTH, _REACH = 0.2, 4.0
"""Radial overtones are excited near the thickness mode: a Gaussian of this relative width, cut at some widths."""
_SLOWEST = 500.0
"""Lower limit of the comb's speed, m/s, which keeps the number of modes finite."""


class LateralModes(Effect):
    """Y + jw sum of C_k f_k^2/(f_k^2 - f^2 + j f f_k/Q): a comb with the spacing speed/diameter, and the edge mode."""

    name = "lateral-modes"
    says = "The finite diameter of {where} is visible: radial overtones or the edge mode ripple the thickness band."
    separates = (
        "sweep a disk of another diameter from the same batch, or damp the rim with wax; a 2-D model includes it"
    )
    references = (
        "Shaw, J. Acoust. Soc. Am. 28 (1956) 38 (thick disks, edge mode)",
        "Guo, Cawley and Hitchings, J. Sound Vib. 159 (1992) 115 (finite element analysis of disks)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the active layer."""
        return (f"layer:{active(stack).name}",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return strength of a radial overtone (C/C0), speed (m/s) and offset (spacings) of the comb, Q, and the rest.

        The rest is the edge mode: its strength (C/C0) and its frequency (in half-wave resonances).
        """
        return (
            EffectParameter("strength", "1", typical=1e-3, upper=0.3),
            EffectParameter("speed", "m/s", typical=30.0, lower=_SLOWEST, upper=8e3, null=3e3, scan=(2e3, 2.5e3, 3e3)),
            EffectParameter("offset", "1", typical=0.1, lower=-1.0, upper=2.0, null=0.5, scan=(0.0, 0.25, 0.5, 0.75)),
            EffectParameter("q", "1", typical=30.0, lower=3.0, upper=2000.0, null=80.0),
            EffectParameter("edge", "1", typical=1e-3, upper=0.3),
            EffectParameter(
                "edge_frequency", "1", typical=0.01, lower=0.2, upper=1.2, null=0.75, scan=(0.6, 0.7, 0.8, 0.9)
            ),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device in parallel with the branches of its lateral modes."""
        nominal = assembly.nominal
        C0, f0 = capacitance(nominal), resonance(nominal)
        spacing = values["speed"] / (2 * sqrt(nominal.area / pi))
        f_k, weights = _comb(f0, spacing, values["offset"])
        strengths = np.append(values["strength"] * weights, values["edge"])
        w_k = 2 * pi * np.append(f_k, values["edge_frequency"] * f0)
        shown = strengths > 0
        if not np.any(shown):
            return assembly
        strengths, w_k = strengths[shown], w_k[shown]

        def lateral(jw: Complexes) -> Complexes:
            w2, damped = w_k[:, None] ** 2, jw * (w_k[:, None] / values["q"])
            return C0 * jw * ((strengths * w_k**2) @ (1 / (w2 + jw * jw + damped)))

        return assembly.beside(lateral)


def _comb(f0: float, spacing: float, offset: float) -> tuple[Reals, Reals]:
    """Return frequencies (Hz) and weights of the radial overtones around f0."""
    low, high = (max(0.0, (f0 * (1 + sign * _REACH * _WIDTH)) / spacing) for sign in (-1, 1))
    f_k: Reals = (np.arange(int(low), int(high) + 2, dtype=np.float64) + offset) * spacing
    f_k = f_k[f_k > 0.05 * f0]
    weights: Reals = np.exp(-0.5 * ((f_k / f0 - 1) / _WIDTH) ** 2)
    return f_k, weights


EFFECT = LateralModes()
