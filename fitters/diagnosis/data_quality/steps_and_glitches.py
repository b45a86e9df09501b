"""Detection of steps and glitches beside resonances: found one by one, then tested again once all are known."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ....models.base.arrays import Complexes, Reals
from ....models.sweep import Sweep
from ...engine.noise import resolution
from .matched_filters import Glitch, adjusted, standing, strongest
from .pole_fit import Frame, PoleFit, fit_poles, linear_fit, refined
from .sampling import points_per_linewidth

_SIGNIFICANT = 50.0
"""Score from which a flaw is accepted. In white noise, two numbers at some 6000 places reach 45 in one of a million
recordings."""
_UNCLEAR = 15.0
"""Residual chi2 near a flaw, corrected for correlated points, above which the pole fit is too poor to judge by."""
_MOST = 40
_ROUNDS = 10
_OF_SLOPE = 0.3
"""Smallest amplitude in units of the change of ln Z from point to point nearby; anything less could be a resonance
whose frequency fluctuates by a third of a step."""
_OF_ROUNDING = 1.5
"""Smallest amplitude in units of the last digit recorded."""
_SLOPE_OVER = 5
_HALF = 8
_LOCAL = 120.0
"""Score above which a step within sixteen points stands out against a cubic through them; 22 degrees of freedom."""
_NARROW = 6.0
"""Half width, in steps of frequency, below which a pole may imitate a glitch."""
_FAINT = 1e5
"""Decrease of chi2 above which a pole is certainly no glitch: poles cannot imitate a larger one."""
_BESIDE = 8
_UNRESOLVED = 2.0
"""Points per linewidth below which the width of a resonance cannot be told."""
_PER_POLE, _PART = 15.0, 0.03
"""Extra chi2 (absolute per pole, or relative) by which poles may beat a glitch and still count as its imitation."""
_ADJUSTED = 6
_GOOD = 10.0
"""chi2 per degree of freedom below which the fit estimates step heights better than the neighbouring points do."""


@dataclass(frozen=True, eq=False)
class Abrupt:
    """Steps and glitches of a recording, and the pole fit made together with them."""

    flaws: tuple[Glitch, ...]
    fit: PoleFit
    good: NDArray[np.bool_]
    """Points outside all glitches, shape (N,)."""
    density: tuple[float, float] | None
    """Fewest points within the width of a resonance apart from the flaws, its frequency (Hz); None without one."""


def find_abrupt(sweep: Sweep, noise: Reals) -> Abrupt:
    """Find steps and glitches in a recording; `noise` is that of Re and Im of ln Z, shape (N,)."""
    flaws = _local_steps(sweep, np.log(sweep.impedance * sweep.frequency), noise, [])
    flaws = [replace(flaw, plain=True) for flaw in flaws]
    flaws, fit = _settled(sweep, noise, flaws, None)
    for _ in range(_ROUNDS):
        new, fit = _look(sweep, noise, flaws, fit)
        if not new or len(flaws) >= _MOST:
            break
        poles = fit.poles
        trials = [_settled(sweep, noise, [*flaws, *some], poles) for some in new]
        flaws, fit = min(trials, key=lambda trial: trial[1].cost)
    while True:
        checked = [_checked(sweep, noise, flaws, flaw, fit) for flaw in flaws]
        doubtful = [(again.score, k) for k, (again, sure) in enumerate(checked) if not sure]
        if not doubtful:
            break
        # One at a time: of two flaws that overlap, each looks needless beside the other.
        _, weakest = min(doubtful)
        flaws = [flaw for k, flaw in enumerate(flaws) if k != weakest]
        fit = fit_poles(_frame(sweep, noise, flaws))
    sure = sorted((again for again, _ in checked), key=lambda flaw: flaw.first)
    density = points_per_linewidth(fit, sweep.frequency, _beside(sweep, sure))
    if density is not None and density[0] < _UNRESOLVED:
        # No pole is narrower than the points: beside a narrower resonance only what is abrupt by itself is certain.
        sure = [flaw for flaw in sure if flaw.plain]
    return Abrupt(tuple(sure), fit, good_points(sweep, sure), density)


def _beside(sweep: Sweep, flaws: Sequence[Glitch]) -> NDArray[np.bool_]:
    """Return which points are at a flaw or next to one, where a pole may stand for its edges; shape (N,)."""
    near = np.zeros(sweep.frequency.size, np.bool_)
    for flaw in flaws:
        near[max(0, flaw.first - _BESIDE) : _last(sweep, flaw) + _BESIDE] = True
    return near


def _last(sweep: Sweep, flaw: Glitch) -> int:
    """Return the index of a flaw's last edge; of a step, its only one."""
    return flaw.first if flaw.is_step(sweep.frequency.size) else flaw.stop


def _settled(
    sweep: Sweep, noise: Reals, flaws: Sequence[Glitch], poles: Complexes | None
) -> tuple[list[Glitch], PoleFit]:
    """Return the flaws and a pole fit after iterating between step heights and poles."""
    fit = fit_poles(_frame(sweep, noise, flaws), poles)
    now = list(flaws)
    stepped = any(flaw.is_step(sweep.frequency.size) for flaw in now)
    for _ in range(_ADJUSTED if stepped and fit.chi2_per_dof < _GOOD else 0):
        trial = adjusted(fit, now)
        again = refined(linear_fit(_frame(sweep, noise, trial), fit.poles))
        if again.cost > fit.cost:
            break
        gained, now, fit = fit.cost - again.cost, trial, again
        if gained < 1e-3 * fit.cost:
            break
    return now, fit


def _look(sweep: Sweep, noise: Reals, flaws: Sequence[Glitch], fit: PoleFit) -> tuple[list[list[Glitch]], PoleFit]:
    """Return one or two guesses for the next flaws, and the fit without the poles that imitated them.

    On the flank of a resonance a step and a glitch look alike until both are tried, so one of each is returned.
    """
    n = sweep.frequency.size
    local = _local_steps(sweep, np.log(1 - (fit.residual[:n] + 1j * fit.residual[n:]) * noise), noise, flaws)
    if local:
        return [local], fit
    possible = [flaw for flaw in strongest(fit) if _possible(sweep, flaw) and _is_new(flaw, flaws)]
    if found := [flaw for flaw in possible if flaw.score > _SIGNIFICANT]:
        step = next((flaw for flaw in found if flaw.is_step(n)), None)
        glitch = next((flaw for flaw in found if not flaw.is_step(n)), None)
        return [[flaw] for flaw in (step, glitch) if flaw is not None], fit
    for group in _narrow(fit):
        without = refined(linear_fit(fit.frame, np.delete(fit.poles, group)))
        brings = without.cost - fit.cost
        spared = max(_PER_POLE * len(group), _PART * brings)
        at = int(np.argmin(np.abs(fit.frame.s.imag - fit.poles[group[0]].imag)))
        for flaw in strongest(without):
            beside = min(abs(flaw.first - at), abs(flaw.stop - at)) < _BESIDE
            if beside and flaw.score > _SIGNIFICANT and flaw.raw > brings - spared and _possible(sweep, flaw):
                return [[flaw]], without
    return [], fit


def _is_new(flaw: Glitch, known: Sequence[Glitch]) -> bool:
    return all((flaw.first, flaw.stop) != (one.first, one.stop) for one in known)


def _narrow(fit: PoleFit) -> list[list[int]]:
    """Return groups of poles in the band that may imitate a glitch: narrow, close together, and of little effect."""
    s, width = fit.frame.s.imag, -fit.poles.real
    step = np.interp(fit.poles.imag, s, 2 * fit.frame.least_width)
    inside = (fit.poles.imag > s[0]) & (fit.poles.imag < s[-1]) & (width < _NARROW * step)
    groups: list[list[int]] = []
    for k in np.flatnonzero(inside).tolist():
        near = np.flatnonzero(inside & (np.abs(fit.poles.imag - fit.poles.imag[k]) < _BESIDE * step)).tolist()
        group = sorted({k, *near})
        faint = linear_fit(fit.frame, np.delete(fit.poles, group)).cost - fit.cost < _FAINT
        if faint and group not in groups:
            groups.append(group)
    return groups


def _possible(sweep: Sweep, flaw: Glitch) -> bool:
    """Return whether a flaw is larger than rounding or a fluctuating resonance frequency could make it."""
    slopes = np.abs(np.diff(np.log(sweep.impedance * sweep.frequency)))
    last = _last(sweep, flaw)
    near = slopes[max(0, flaw.first - _SLOPE_OVER) : last + _SLOPE_OVER]
    rounding = float(np.sqrt(12) * np.median(resolution(sweep)[flaw.first : max(last, flaw.first + 1)]))
    return abs(flaw.amplitude) > max(_OF_SLOPE * float(np.median(near)), _OF_ROUNDING * rounding)


def _checked(sweep: Sweep, noise: Reals, flaws: Sequence[Glitch], flaw: Glitch, fit: PoleFit) -> tuple[Glitch, bool]:
    """Return the flaw re-scored with all others known, and whether it is still significant."""
    if flaw.is_step(sweep.frequency.size):
        again = standing(fit, flaw)
    else:
        rest = [one for one in flaws if one is not flaw]
        again = standing(linear_fit(_frame(sweep, noise, rest), fit.poles), flaw)
    clear = flaw.plain or again.raw < _UNCLEAR * again.score
    # Where poles leave more than noise, the residual has bumps of its own, and rounding decides which of them reach 50.
    least = _SIGNIFICANT * max(1.0, fit.chi2_per_dof)
    return again, clear and again.score > least and _possible(sweep, again)


def _frame(sweep: Sweep, noise: Reals, flaws: Sequence[Glitch]) -> Frame:
    return Frame.of(replace(sweep, impedance=repaired(sweep, flaws)), noise, good_points(sweep, flaws))


def good_points(sweep: Sweep, flaws: Sequence[Glitch]) -> NDArray[np.bool_]:
    """Return the mask of points outside all glitches, shape (N,)."""
    good = np.ones(sweep.frequency.size, np.bool_)
    for flaw in flaws:
        if not flaw.is_step(good.size):
            good[flaw.first : flaw.stop] = False
    return good


def _local_steps(sweep: Sweep, course: Complexes, noise: Reals, known: Sequence[Glitch]) -> list[Glitch]:
    """Return steps of ln Z that stand out against a cubic through eight points on either side, most significant first.

    `course`, shape (N,), is ln Z minus a smooth part: that of a capacitor at first, later that of a pole fit. This
    local test comes first because many steps, as from an analyzer that keeps switching its range, would spoil the pole
    fit.
    """
    n, size = sweep.frequency.size, 2 * _HALF
    windows: Complexes = sliding_window_view(course, size)
    windows = windows - 2j * np.pi * np.round((windows.imag - windows.imag[:, :1]) / (2 * np.pi))
    x = np.linspace(-1, 1, size)
    smooth = np.linalg.qr(np.vander(x, 4))[0]
    step = np.where(np.arange(size) >= _HALF, 1.0, 0.0)
    step -= smooth @ (smooth.T @ step)
    left = windows - (windows @ smooth) @ smooth.T
    amplitude = left @ step / (step @ step)
    raw = np.abs(amplitude) ** 2 * (step @ step)
    rest = np.sum(np.abs(left) ** 2, axis=1) - raw
    floor = sliding_window_view(noise, size).mean(axis=1) ** 2
    score = raw / np.maximum(floor, rest / (2 * size - 10))
    found: list[Glitch] = []
    for k in np.argsort(-score):
        first = int(k) + _HALF
        flaw = Glitch(first, n, complex(np.exp(amplitude[int(k)]) - 1), float(raw[k] / floor[k]), float(score[k]))
        if score[k] < _LOCAL or len(found) >= _MOST:
            break
        if all(abs(first - one.first) >= _HALF for one in (*found, *known)) and _possible(sweep, flaw):
            found.append(flaw)
    return found


def repaired(sweep: Sweep, flaws: Sequence[Glitch]) -> Complexes:
    """Return the impedance with all steps removed, scaled to its longest stretch; ohm, shape (N,).

    The data do not tell which stretch is right; area and permittivity absorb a constant factor.
    """
    n = sweep.frequency.size
    level = np.ones(n, np.complex128)
    for flaw in flaws:
        if flaw.is_step(n):
            level[flaw.first :] *= 1 + flaw.amplitude
    values, counts = np.unique(level, return_counts=True)
    return np.asarray(sweep.impedance / level * values[int(np.argmax(counts))], np.complex128)
