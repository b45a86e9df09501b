"""What an analyzer and its fixture add to a recording, as columns of ln Z with unit normal priors."""

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals, j_omega
from ....models.circuits.terminals import skin
from ...error_model.prior_scales import FIXTURE
from ...error_model.smooth_basis import smooth
from ..pair import Pair

INSTRUMENT = 1e-3
"""Gain (ln |Z|) and phase (rad) of an analyzer."""
_LEVEL = 1.5e-3
"""Error of gain or phase common to all frequencies: cables, range and connectors of the day."""
_REFERENCE = 50.0
"""Of a network analyzer, ohm."""
_UNSTABLE = 30.0
"""Change of a network analyzer's errors between two recordings, relative to the noise of its reflection: 0.01 dB for
each of some kelvins, beside 0.002 dB of trace noise."""
_SAME = 1e-9
_SLOW, _FAST, _QUICK = 1.0, 0.25, 0.15
"""Correlation lengths of gain and phase in ln f, and the fraction of the shorter one."""


class InstrumentErrors:
    """Errors of gain, phase, fixture and calibration of both recordings."""

    def __init__(self, pair: Pair) -> None:
        """Take a pair: its band, the recording after, and the noise of its reflection."""
        f, u = pair.frequency, pair.log_f
        ends = float(u[0]), float(u[-1])
        span = max(ends[1] - ends[0], 1e-6)
        slow = smooth(u, ends, min(_SLOW, span), 4)
        fast = _QUICK * smooth(u, ends, max(_FAST, span / 12), 6)
        self._gain = INSTRUMENT * np.column_stack([slow, fast])
        self._jw, self._skin = j_omega(f), skin(f)
        self._after, self._reflection = pair.after, pair.reflection

    def columns(self, through: Complexes) -> dict[str, Complexes]:
        """Return the columns of each kind, shapes (N, M); `through`: d ln Z after / d ln Z before, shape (N,)."""
        s, one = through, np.ones_like(through)[:, None]
        gain = np.asarray(np.hstack([self._gain, 1j * self._gain]), np.complex128)
        level = np.asarray(_LEVEL * np.array([[1, 1j]]) * one, np.complex128)
        same = bool(np.all(np.abs(s - 1) < _SAME))
        before = (s - 1)[:, None]
        return {
            "level": level if same else np.column_stack([level, level * before]),
            "instrument": gain if same else np.column_stack([gain, gain * before]),
            "fixture": self.fixture(self._after),
        }

    def of_fixture(self, Z: Impedances) -> Reals:
        """Return the standard deviation of ln Z that two fixtures' residuals cause, shape (N,)."""
        return np.asarray(np.sqrt(2) * np.linalg.norm(self.fixture(Z), axis=1), np.float64)

    def fixture(self, Z: Impedances) -> Complexes:
        """Return the change of ln Z by the residuals of open and short compensation, shape (N, 5)."""
        one, jw = np.ones_like(Z), self._jw
        series = np.column_stack(
            [jw * FIXTURE["inductance"], one * FIXTURE["resistance"], self._skin * FIXTURE["skin"]]
        )
        shunt = np.column_stack([jw * FIXTURE["capacitance"], one * FIXTURE["conductance"]])
        return np.hstack([series / Z[:, None], -shunt * Z[:, None]])

    def of_calibration(self) -> Reals:
        """Return the standard deviation of ln Z by what moves between two recordings of a network analyzer, shape (N,).

        Directivity, tracking and source match add e00 + e01 S + e11 S^2 to the reflection S. Each is as stable as
        cables and connectors are, to some times the noise. Zeros if the noise is not that of a network analyzer.
        """
        Z, S = self._after, (self._after - _REFERENCE) / (self._after + _REFERENCE)
        moved = _UNSTABLE * self._reflection * np.sqrt(1 + np.abs(S) ** 2 + np.abs(S) ** 4)
        return np.asarray(moved * np.abs((Z + _REFERENCE) ** 2 / (2 * _REFERENCE * Z)), np.float64)
