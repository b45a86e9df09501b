"""Recordings that determine nothing, recognised before they are fitted; and answers that no ceramic could give."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..models.arrays import Reals
from ..models.build import Build, LayerSpec
from ..models.sweep import Sweep
from .interface import Constant, FitError
from .noise import noise_of
from .start import largest_peaks

_FAR, _OFF = 30.0, 6.0
# Factors by which |Z| may differ from that of the build's clamped capacitance: beyond the first it is no disk at all,
# beyond the second its dimensions are others. The free capacitance is up to 2.3 times the clamped one.
_MOST = 0.5
_NOISE = 0.01
# Part of |Z| below which the sign of a resistance tells nothing.
_NEED, _WANT = 0.25, 3.0
# Points per linewidth: below the first a resonance may lie between two points, below the second the loss rests on what
# the model says of the flanks.
_SCATTER = {"eps33S": (0.7, 1.4), "c33D": (0.75, 1.3)}
# Fitted over data sheet: no maker's batches scatter more.


def refuse_degenerate(build: Build, sweeps: Mapping[str, Sequence[Sweep]]) -> None:
    """Raise FitError for a short or open circuit, an inverted sign, another size, or a step without resonance."""
    refuse_another_device(build, sweeps)
    values = _piezo(build).values
    for step, of_step in sweeps.items():
        if not any(map(_resonates, of_step)):
            ends = [edge for sweep in of_step for edge in (sweep.frequency[0], sweep.frequency[-1])]
            expected = float(np.sqrt(values["c33D"].re / values["density"].re)) / (2 * values["thickness"].re)
            raise FitError(
                f"step {step!r} shows no resonance with an antiresonance above it between {min(ends) / 1e6:.4g} and "
                f"{max(ends) / 1e6:.4g} MHz; the bare piezo layer's is expected near {expected / 1e6:.3g} MHz"
            )


def refuse_another_device(build: Build, sweeps: Mapping[str, Sequence[Sweep]]) -> None:
    """Raise FitError for a short or open circuit, an inverted sign, or another size."""
    values = _piezo(build).values
    capacitance = values["eps33S"].re * build.area.re / values["thickness"].re
    for step, of_step in sweeps.items():
        for sweep in of_step:
            _refuse_sign(_named(step, sweep), sweep)
            _refuse_size(_named(step, sweep), sweep, capacitance)


def _piezo(build: Build) -> LayerSpec:
    return next(layer for layer in build.layers if layer.kind == "piezo")


def _named(step: str, sweep: Sweep) -> str:
    return sweep.id or f"the recording of step {step!r}"


def _refuse_sign(name: str, sweep: Sweep) -> None:
    size = np.abs(sweep.impedance)
    negative = float(np.mean(sweep.impedance.real < -_NOISE * size))
    inductive = float(np.mean(sweep.impedance.imag > _NOISE * size))
    if negative > _MOST and inductive > _MOST:
        raise FitError(f"{name} is inverted: resistance is negative at {negative:.0%} of its points; change its sign")
    if negative > _MOST:
        raise FitError(f"{name} has a negative resistance at {negative:.0%} of its points; no passive device has that")
    if inductive > 0.9:
        falls = float(np.polyfit(np.log(sweep.frequency), np.log(size), 1)[0]) < 0
        why = (
            "while |Z| falls like a capacitor's: the sign of its reactance is that of exp(-jwt), conjugate it"
            if falls
            else "and |Z| rises: this is a wire, not a piezo disk; is it shorted?"
        )
        raise FitError(f"{name} is inductive at {inductive:.0%} of its points, {why}")


def _refuse_size(name: str, sweep: Sweep, capacitance: float) -> None:
    """Refuse a recording whose |Z| is not that of the build's capacitance (F), whatever resonates."""
    expected: Reals = 1 / (2 * np.pi * sweep.frequency * capacitance)
    ratio = float(np.median(np.abs(sweep.impedance) / expected))
    level, wanted = float(np.median(np.abs(sweep.impedance))), float(np.median(expected))
    found = f"{name}: |Z| is {level:.3g} ohm in the middle, where the capacitance of this build has {wanted:.3g} ohm"
    if ratio < 1 / _FAR:
        raise FitError(f"{found}; this is a short circuit, or another device")
    if ratio > _FAR:
        raise FitError(f"{found}; this is an open circuit, or another device")
    if not 1 / _OFF < ratio < _OFF:
        raise FitError(
            f"{found}; a permittivity is never off by a factor of {max(ratio, 1 / ratio):.1f}: diameter or thickness "
            "of the build file are not those of this device"
        )


def _resonates(sweep: Sweep) -> bool:
    w = 2 * np.pi * sweep.frequency
    _, (noise,) = noise_of([sweep])
    series = largest_peaks(sweep.admittance.real / w, noise * np.abs(sweep.admittance) / w)
    return bool(series or largest_peaks(sweep.impedance.real * w, noise * np.abs(sweep.impedance) * w))


def doubts(
    build: Build, sweeps: Mapping[str, Sequence[Sweep]], constants: Mapping[str, Constant], fp: float
) -> tuple[str, ...]:
    """Return what is to be doubted of an answer whose thickness resonance of the bare piezo layer is at `fp` Hz.

    Raises FitError where the recordings have too few points to tell a resonance of that width at all.
    """
    piezo = _piezo(build)
    bare = [sweep for step, of_step in sweeps.items() if build.step(step).layers == (piezo.name,) for sweep in of_step]
    return (*_few_points(bare, constants[f"{piezo.name}.c33D"], fp), *_strange(build, piezo, constants))


def _few_points(sweeps: Sequence[Sweep], c33D: Constant, fp: float) -> tuple[str, ...]:
    spacings = [_spacing(sweep, fp) for sweep in sweeps if sweep.frequency[0] < fp < sweep.frequency[-1]]
    if not spacings or c33D.im <= 0:
        return ()
    width = fp * c33D.im / c33D.re
    count = width / min(spacings)
    what = f"{count:.2g} points lie in the linewidth of {width / 1e3:.3g} kHz at {fp / 1e6:.4g} MHz"
    if count < _NEED:
        raise FitError(f"only {what}; the resonance is lost between them: sweep it every {width / 10 / 1e3:.2g} kHz")
    if count < _WANT:
        return (f"Only {what}: losses rest on what the model says of the flanks. {_WANT:.0f} or more are wanted.",)
    return ()


def _spacing(sweep: Sweep, fp: float) -> float:
    """Return the distance of the points about `fp`, Hz."""
    k = int(np.searchsorted(sweep.frequency, fp))
    return float(np.min(np.diff(sweep.frequency)[max(0, k - 2) : k + 2]))


def _strange(build: Build, piezo: LayerSpec, constants: Mapping[str, Constant]) -> tuple[str, ...]:
    """Return what cannot be a ceramic's scatter: eps33S tells of the area, c33D of the thickness."""
    says: list[str] = []
    for name, (low, high) in _SCATTER.items():
        sheet = piezo.nominal.get(name)
        found = constants[f"{piezo.name}.{name}"]
        if sheet is None or not found.free or low < found.re / sheet.re < high:
            continue
        ratio = found.re / sheet.re
        size = build.diameter.re if build.diameter is not None else None
        if name == "c33D":
            right = f"a thickness of {1e3 * piezo.values['thickness'].re / np.sqrt(ratio):.3g} mm would explain it"
        elif size is not None:
            right = (
                f"a diameter of {1e3 * size * np.sqrt(ratio):.3g} mm instead of {1e3 * size:.3g} mm would explain it"
            )
        else:
            right = f"an area of {1e6 * build.area.re * ratio:.3g} mm2 would explain it"
        says.append(
            f"{piezo.name}.{name} comes out at {ratio:.2f} times what the data sheet of {piezo.material} says, more "
            f"than ceramics scatter: {right}. Do not use these constants before that is settled."
        )
    return tuple(says)
