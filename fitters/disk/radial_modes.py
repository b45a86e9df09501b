"""Identification of the radial modes among the peaks of a recording, by expected frequency and by their ratio."""

from dataclasses import dataclass

from ..engine.plausibility import refuse_lost
from ..interface import FitError
from .bare_disk import BareDisk
from .critical_frequencies import Critical, ImmittanceTrace, admittance_trace, critical, impedance_trace, tops

_NEAR_EXPECTED = (0.6, 1.6)
# First resonance over the expected one: for a known ceramic its frequency is known to a few per cent, for any PZT of
# the stated diameter to a third.
_ANTIRESONANCE = (1.005, 1.5)
# fp1/fs1: 1.15 at kp 0.6, 1.37 at kp 0.8.
_SECOND = (2.35, 2.85)
# fs2/fs1: 2.73 at sigma 0.2, 2.49 at sigma 0.5; finite thickness reduces it by some per cent.
_USUAL_LOSS = 1 / 80
# Of soft PZT, for a disk without known radial constants.


@dataclass(frozen=True)
class RadialModes:
    """Critical frequencies of the first two radial resonances and the first antiresonance."""

    first: Critical
    parallel: Critical
    second: Critical


def _largest(traces: list[ImmittanceTrace], low: float, high: float) -> tuple[ImmittanceTrace, int] | None:
    there = tops(traces, low, high)
    if not there:
        return None
    at = there[0][0].frequency[there[0][1]]
    same = [peak for peak in there if abs(peak[0].frequency[peak[1]] / at - 1) < 0.01]
    trace, k, _ = min(same, key=lambda peak: float(peak[0].frequency[1] - peak[0].frequency[0]))  # the finest sweep
    return trace, k


@dataclass(frozen=True, eq=False)
class Peaks:
    """Peaks of the radial modes: a trace and the index of its maximum."""

    first: tuple[ImmittanceTrace, int]
    parallel: tuple[ImmittanceTrace, int]
    second: tuple[ImmittanceTrace, int] | None

    @property
    def frequencies(self) -> tuple[float, float, float | None]:
        """Resonance, antiresonance, second resonance, Hz."""
        (series, i), (anti, j) = self.first, self.parallel
        second = None if self.second is None else float(self.second[0].frequency[self.second[1]])
        return float(series.frequency[i]), float(anti.frequency[j]), second


def radial_peaks(disk: BareDisk) -> Peaks:
    """Return the peaks of the radial modes. Raises FitError with the expected frequency of the first."""
    pairs = list(zip(disk.sweeps, disk.noises, strict=True))
    series = [admittance_trace(sweep, noise) for sweep, noise in pairs]
    parallel = [impedance_trace(sweep, noise) for sweep, noise in pairs]
    expected = disk.expected_radial_mode
    first = _largest(series, _NEAR_EXPECTED[0] * expected, _NEAR_EXPECTED[1] * expected)
    if first is None:
        refuse_lost(disk.sweeps, expected, _loss(disk))
        raise FitError(
            f"no radial resonance in {disk.bands}: the first is expected near {expected / 1e3:.3g} kHz for a diameter "
            f"of {2e3 * disk.radius:.4g} mm"
        )
    fs1 = float(first[0].frequency[first[1]])
    _refuse_overtone(disk, first, _largest(series, fs1 / _SECOND[1], fs1 / _SECOND[0]))
    anti = _largest(parallel, _ANTIRESONANCE[0] * fs1, _ANTIRESONANCE[1] * fs1)
    if anti is None:
        refuse_lost(disk.sweeps, fs1, _loss(disk))
        raise FitError(
            f"no antiresonance of the first radial mode in {disk.bands}: the resonance is at {fs1 / 1e3:.5g} kHz, "
            f"sweep up to {1.3 * fs1 / 1e3:.4g} kHz"
        )
    return Peaks(first, anti, _largest(series, _SECOND[0] * fs1, _SECOND[1] * fs1))


def _refuse_overtone(
    disk: BareDisk, first: tuple[ImmittanceTrace, int], below: tuple[ImmittanceTrace, int] | None
) -> None:
    """Reject a peak as the first radial mode if a stronger one below it makes it the second."""
    if below is None:
        return
    (peak, i), (other, k) = first, below
    if other.values.real[k] > peak.values.real[i]:
        strongest, diameter = float(other.frequency[k]), 2e3 * disk.radius
        raise FitError(
            f"the strongest radial resonance is at {strongest / 1e3:.4g} kHz, where the first is expected near "
            f"{disk.expected_radial_mode / 1e3:.3g} kHz for a diameter of {diameter:.4g} mm: a diameter of "
            f"{diameter * disk.expected_radial_mode / strongest:.3g} mm would explain it"
        )


def _loss(disk: BareDisk) -> float:
    """Return the expected loss tangent of the radial modes from build and library."""
    s11E = disk.layer.values.get("s11E")
    return -s11E.im / s11E.re if s11E is not None and s11E.im < 0 else _USUAL_LOSS


def second_missing(disk: BareDisk, fs1: float) -> FitError:
    """Return the error of a recording without the second radial resonance; `fs1` in Hz."""
    return FitError(
        f"no second radial resonance in {disk.bands}: it is expected near {2.6 * fs1 / 1e3:.4g} kHz, and the first, at "
        f"{fs1 / 1e3:.5g} kHz, does not determine Poisson's ratio alone"
    )


def radial_modes(disk: BareDisk) -> RadialModes:
    """Return the critical frequencies of the radial modes. Raises FitError."""
    peaks = radial_peaks(disk)
    if peaks.second is None:
        raise second_missing(disk, peaks.frequencies[0])
    return RadialModes(
        critical(*peaks.first, "the first radial resonance"),
        critical(*peaks.parallel, "the first radial antiresonance"),
        critical(*peaks.second, "the second radial resonance"),
    )
