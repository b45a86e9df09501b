"""Relative noise of a recording at each of its points, estimated from the recording itself.

An analyzer's noise has a part proportional to |Z| and two that exceed it where |Z| is very small or very large
(4294A Operation Manual: Zs/|Z| and Yo |Z| beside the proportional term). The variance of ln Z is therefore modelled as
a^2 + (b/|Z|)^2 + (c |Z|)^2, and a, b, c are estimated from differences of neighbouring points.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import comb

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ...models.sweep import Sweep
from ..interface import Noise

_ORDER = 5
# Differences of this order remove everything smooth over six points; higher orders gain nothing (measured on
# 801-point sweeps of disks: orders 4, 5 and 6 agree within 3 %, order 3 still sees the resonances).
_CLIP = 8.0
# Squared differences above this multiple of their expectation count as signal (a resonance too sharp for the grid):
# noise exceeds it once in 3000 points. The mean is corrected for the clipping.
_KEPT_MEAN = 1 - _CLIP * np.exp(-_CLIP) / (1 - np.exp(-_CLIP))
_ROUNDS, _SETTLED = 12, 1e-3
# Convergence limit: the noise of a thousand points is only known to a few per cent.
_PRICE = 30.0
# Deviance that a further term must save: five times the usual 6.6, since neighbouring differences share points.
_NOISY = 1e-3
# Noise of the reflection of a network analyzer with few parts and a wide bandwidth: -60 dB.
_FLOOR = 1e-7
# Lower limit of the noise: 4294A data have seven digits.
_SAME = 1e-9
# Relative difference below which two numbers differ by arithmetic rounding only.
_UNKNOWN = 1e-3
# The analyzer's accuracy at 1 MHz, for short recordings without an accuracy of their own.


def _from_differences(squares: Reals, size: Reals) -> Reals:
    """Return a, b, c: `squares` are estimates of the variance of Re (or Im) of ln Z, `size` is |Z|, shape (M,).

    A term is included only if it is significant, so that the remainder of a sharp resonance is not taken for noise.
    """
    middle = float(np.median(size))
    terms = np.column_stack([np.ones_like(size), (middle / size) ** 2, (size / middle) ** 2])
    fits = [_fit(squares, terms, chosen) for chosen in ([0], [0, 1], [0, 2], [0, 1, 2])]
    parts, _ = min(fits, key=lambda fit: fit[1])
    # To four digits: rounding errors must not decide anything that depends on a noise known to a few per cent.
    return np.array([float(f"{x:.4g}") for x in np.sqrt(parts) * np.array([1.0, middle, 1 / middle])])


def _fit(squares: Reals, terms: Reals, chosen: list[int]) -> tuple[Reals, float]:
    """Return the variance terms, zero if not chosen, and the deviance plus a price for each term.

    Iteratively reweighted nonnegative least squares; squares of complex Gaussian numbers are exponentially distributed.
    """
    from scipy.optimize import nnls  # who draws a picture need not wait for it: importing takes a quarter of a second

    taken = terms[:, chosen]
    variance = np.full(squares.size, max(float(np.median(squares)) / np.log(2), _FLOOR**2))
    estimate = np.zeros(len(chosen))
    for _ in range(_ROUNDS):
        weight = (squares < _CLIP * variance) / variance**2
        weighted = taken.T * weight
        # Normal equations with three unknowns at most; if one would be negative, the fit without it is better.
        last, (estimate, _) = estimate, nnls(weighted @ taken, weighted @ squares / _KEPT_MEAN)
        variance = np.maximum(taken @ estimate, _FLOOR**2)
        if np.all(np.abs(estimate - last) <= _SETTLED * estimate):
            break
    deviance = 2 * float(np.sum(np.log(variance) + np.minimum(squares / variance, _CLIP)))
    parts = np.zeros(terms.shape[1])
    parts[chosen] = estimate
    return parts, deviance + _PRICE * len(chosen)


def _at(parts: Reals, impedance: Complexes) -> Reals:
    """Return the standard deviation of Re and Im of ln Z at each point, shape (N,)."""
    a, b, c = parts
    size = np.abs(impedance)
    return np.maximum(np.sqrt(a**2 + (b / size) ** 2 + (c * size) ** 2), _FLOOR)


@lru_cache(maxsize=64)
def noise_from_smoothness(sweep: Sweep) -> Reals | None:
    """Return the standard deviation of Re and Im of ln Z, shape (N,), from fifth differences.

    None for fewer than 20 points. The result is cached per sweep and read only.
    """
    if sweep.frequency.size < 20:
        return None
    sigma = np.maximum(_at(_from_differences(*_differences(sweep)), sweep.impedance), resolution(sweep))
    sigma.flags.writeable = False
    return sigma


def _differences(sweep: Sweep) -> tuple[Reals, Reals]:
    """Return estimates of the variance of Re (or Im) of ln Z from fifth differences, and |Z| there, shapes (N - 5,)."""
    squares = np.abs(np.diff(np.log(sweep.impedance), _ORDER)) ** 2 / (2 * comb(2 * _ORDER, _ORDER))
    return squares, np.abs(sweep.impedance[_ORDER // 2 :][: squares.size])


def reflection_noise(sweeps: Sequence[Sweep], reference: float = 50.0) -> float:
    """Return the noise of the reflection at a reference impedance, ohm, if it may be the same everywhere; else 0.

    So it is of network analyzers, and in ln Z it is |Z + reference|^2 / (2 reference |Z|) times as large. This form is
    excluded if noise proportional to |Z| describes the recordings better by more than the price of a term, or if the
    reflection would be noisier than in any network analyzer.
    """
    against, variance = 0.0, 0.0
    for sweep in sweeps:
        if sweep.frequency.size < 20:
            return 0.0
        squares, _ = _differences(sweep)
        Z = sweep.impedance[_ORDER // 2 :][: squares.size]
        terms = np.column_stack([np.ones(Z.size), np.abs(Z + reference) ** 4 / (2 * reference * np.abs(Z)) ** 2])
        (found, reflection), (_, proportional) = (_fit(squares, terms, chosen) for chosen in ([1], [0]))
        against += reflection - proportional
        variance += float(found[1]) / len(sweeps)
    return float(np.sqrt(variance)) if against < _PRICE and variance < _NOISY**2 else 0.0


def noise_from_repeats(sweeps: Sequence[Sweep]) -> tuple[Reals, ...] | None:
    """Return the same for repeated sweeps on one grid, each of shape (N,); None if there are no repeats.

    Only differences from point to point count: a slow drift between repeats is misfit, not noise.
    """
    squares: list[Reals] = []
    sizes: list[Reals] = []
    for first, second in pairwise(sweeps):
        same = first.frequency.shape == second.frequency.shape
        if same and np.allclose(first.frequency, second.frequency, rtol=1e-9):
            squares.append(np.abs(np.diff(np.log(second.impedance / first.impedance))) ** 2 / 8)
            sizes.append(np.abs(first.impedance[1:]))
    if not squares:
        return None
    parts = _from_differences(np.concatenate(squares), np.concatenate(sizes))
    return tuple(_at(parts, sweep.impedance) for sweep in sweeps)


def noise_of(sweeps: Sequence[Sweep]) -> tuple[Noise, tuple[Reals, ...]]:
    """Return the noise of one step's sweeps, as a summary and at each point of each sweep.

    Estimated from repeats if there are any, else from smoothness, else from the analyzer's accuracy. Sweeps with
    another level, bandwidth or direction are not repeats: their noise differs, or they differ by more than noise.
    """
    by_index: dict[int, Reals] = {}
    sources: set[str] = set()
    kinds = [common_settings(sweep) for sweep in sweeps]
    for kind in dict.fromkeys(kinds):
        alike = [k for k, other in enumerate(kinds) if other == kind]
        repeats = noise_from_repeats([sweeps[k] for k in alike])
        if repeats is not None:
            sources.add("repeats")
            by_index |= dict(zip(alike, repeats, strict=True))
            continue
        for k in alike:
            smooth = noise_from_smoothness(sweeps[k])
            sources.add("analyzer accuracy" if smooth is None else "smoothness")
            by_index[k] = _accuracy(sweeps[k]) if smooth is None else smooth
    sigmas = tuple(by_index[k] for k in range(len(sweeps)))
    source = next(name for name in ("repeats", "smoothness", "analyzer accuracy") if name in sources)
    return Noise(_typical(sigmas), source), sigmas


def _accuracy(sweep: Sweep) -> Reals:
    """Return the accuracy that the driver noted at each point, shape (N,), or a default."""
    accuracy = sweep.per_point("accuracy_relative")
    return np.full(sweep.frequency.size, _UNKNOWN) if accuracy is None else accuracy


def common_settings(sweep: Sweep) -> tuple[object, ...]:
    """Return the settings that sweeps which repeat one another have in common."""
    names = ("oscillator_V", "oscillator_A", "bandwidth", "point_average", "sweep_average", "direction")
    return tuple(sweep.settings.get(name) for name in names)


def resolution(sweep: Sweep) -> Reals:
    """Return the standard deviation of Re and Im of ln Z due to rounding alone, shape (N,).

    Where R or X are whole multiples of one step, as in a table with three digits, nothing below the step is visible.
    """
    step = max(_step(sweep.impedance.real), _step(sweep.impedance.imag))
    return step / np.sqrt(12) / np.abs(sweep.impedance)


def _step(values: Reals) -> float:
    gaps = np.diff(np.sort(values))
    gaps = gaps[gaps > _SAME * float(np.max(np.abs(values)))]
    if gaps.size == 0:
        return 0.0
    q = float(np.min(gaps))
    multiples = values / q
    return q if bool(np.all(np.abs(multiples - np.round(multiples)) < 1e-3)) else 0.0


def _typical(sigmas: Sequence[Reals]) -> float:
    return float(np.median(np.concatenate(sigmas)))
