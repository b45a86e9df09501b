"""Recordings with their resonances broadened, for searches.

The sharper resonances are, the narrower is the valley around the right constants, and the more wrong orders of
overtones look right. The capacitance of any linear device is analytic on one side of the real axis of frequency. There,
at f (1 - j d/2), it is what it would be at f if every loss tangent were larger by d. A sum of poles on the other side
that describes the recording continues it.
"""

import math
import warnings
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.interpolate import AAA

from ....models.base.arrays import Complexes, Frequencies, j_omega
from ...engine.recording import Recording

_MOST, _PARTS = 100, 4
# Largest number of poles, and of points for each: more poles would describe noise.
_NARROWEST = 0.5
# Half width of the narrowest pole in steps of frequency: what points do not resolve is noise.
_PER_WIDTH = 8
# Points that are kept for the width of a broadened resonance.


@dataclass(frozen=True, eq=False)
class Broadening:
    """A recording as a sum of poles, and a polynomial of second degree for what is far from its band."""

    recording: Recording
    poles: Complexes
    """Hz, above the real axis."""
    parts: Complexes
    """Coefficients of `_columns`, F."""

    @classmethod
    def of(cls, recording: Recording) -> Self:
        """Return the poles of a recording (AAA, Nakatsukasa et al., SIAM J. Sci. Comput. 40 (2018) A1494).

        Poles on the wrong side are mirrored: noise has them. Their parts are those of least relative misfit.
        """
        good = np.isfinite(recording.noise)
        f, Z = recording.sweep.frequency[good], recording.sweep.impedance[good]
        C = 1 / (j_omega(f) * Z)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # that it ends with so many poles
            poles = AAA(f, C, rtol=1e-13, max_terms=min(_MOST, f.size // _PARTS), clean_up=False).poles()
        poles = poles[np.isfinite(poles)]
        above = poles.real + 1j * np.maximum(np.abs(poles.imag), _NARROWEST * np.min(np.diff(f)))
        columns = _columns(f, above, f) / np.abs(C)[:, None]
        size = np.linalg.norm(columns, axis=0)
        parts = np.linalg.lstsq(columns / size, C / np.abs(C), rcond=1e-10)[0] / size
        return cls(recording, above, parts)

    def by(self, damping: float, most: int) -> Recording:
        """Return the recording as if every loss tangent were larger by `damping`, with at most so many points.

        They are as many as resonances of that width need. The model is that of the recording, without more loss.
        """
        recording, f = self.recording, self.recording.sweep.frequency
        needed = _PER_WIDTH * (f[-1] - f[0]) / (damping * f[0]) if damping > 0 else math.inf
        seen = slice(None, None, max(1, int(f.size // min(most, needed))))
        sweep, noise = recording.sweep.at(seen), recording.noise[seen]
        if damping > 0:
            below: Complexes = np.multiply(1 - 0.5j * damping, sweep.frequency, dtype=np.complex128)
            C = _columns(below, self.poles, f) @ self.parts
            sweep = replace(sweep, impedance=1 / (j_omega(sweep.frequency) * C))
        return replace(recording, sweep=sweep, noise=noise)


def _columns(at: Frequencies | Complexes, poles: Complexes, band: Frequencies) -> Complexes:
    """Return each pole at its height of 1, and powers of frequency, shape (N, P + 3)."""
    relative = (at - band[0]) / (band[-1] - band[0])
    lines = poles.imag / (at[:, None] - poles)
    return np.column_stack([lines, *(relative**power for power in range(3))])
